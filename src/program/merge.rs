//! `merge`: the parts of a larger render become one image.

use super::{Failure, keep, print};
use std::{path::PathBuf, process::ExitCode};
use translucent::{
    Image,
    image::{Attribute, check_writable},
};

#[derive(clap::Args)]
pub struct Merge {
    /// EXR files of one render with consecutive sample ranges (`render --samples A:B`), in any order.
    #[arg(required = true, value_name = "PART.exr")]
    parts: Vec<PathBuf>,
    /// The EXR file to write.
    #[arg(short, long, value_name = "OUT.exr")]
    output: PathBuf,
}

impl Merge {
    pub fn run(self) -> Result<ExitCode, Failure> {
        check_writable(&self.output)?;
        for part in &self.parts {
            keep(part, &self.output)?;
        }
        let mut parts = Vec::new();
        for file in self.parts {
            let image = Image::read(&file).map_err(Failure::while_reading)?;
            parts.push((file, image));
        }
        let count = parts.len();
        let image = Image::merge(parts).map_err(Failure::while_reading)?;
        image.write(&self.output)?;
        let samples = match image.attributes.get("translucent.samples") {
            Some(Attribute::Integer(samples)) => *samples,
            _ => 0,
        };
        let (file, (width, height)) = (self.output.display(), (image.width, image.height));
        print(&format!("{file}: {width}x{height}, {samples} samples of {count} parts\n"))?;
        Ok(ExitCode::SUCCESS)
    }
}
