//! Measures how far each model is from a random walk, and writes the table of the crate's documentation anew:
//!
//!     cargo run --release --example model_errors -- [PATHS] [FOLDER] [NAME=FILE]...
//!
//! PATHS of the walk in each scene (2000000; the published table has 100000); FOLDER (src/docs) gets model_errors.md and
//! model_errors.csv; FILEs are closed meshes (.gltf, .glb) to try beside Spot.

use std::path::PathBuf;
use std::time::Instant;
use translucent::model_errors::{Effort, corners, csv, markdown, measure};
use translucent::{Error, Result, Scene};

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let paths = arguments
        .next()
        .map_or(Ok(2_000_000), |text| text.parse())
        .map_err(|error| Error::Setting { setting: "PATHS".into(), problem: format!("{error}") })?;
    let folder = PathBuf::from(arguments.next().unwrap_or_else(|| "src/docs".into()));
    let mut meshes = vec![("spot".to_string(), corners(&Scene::load("assets/spot.glb")?))];
    for argument in arguments {
        let (name, file) = argument
            .split_once('=')
            .ok_or_else(|| Error::Setting { setting: "NAME=FILE".into(), problem: format!("`{argument}` has no =") })?;
        meshes.push((name.to_string(), corners(&Scene::load(file)?)));
    }
    let start = Instant::now();
    let effort = Effort { paths, samples: 2 * paths, seed: 1 };
    let rows = measure(&meshes, effort, |matter, scene| {
        eprintln!("{:6.0} s  {matter}: {scene}", start.elapsed().as_secs_f64());
    });
    for (name, text) in [("model_errors.md", markdown(&rows)), ("model_errors.csv", csv(&rows))] {
        let file = folder.join(name);
        std::fs::write(&file, text).map_err(|error| Error::File { file, problem: error.to_string() })?;
    }
    Ok(())
}
