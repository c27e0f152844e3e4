//! How far each model is from a random walk through the same matter.
//!
//! Every model of the renderer is tried on bodies of several sizes; the truth is [`walk`](mod@crate::reference::walk), and
//! the model stands in its place ([`predict`]), so that light, bins and boundary
//! are the same. No kernel and no twin of the projection takes part.
//!
//! # How to read the tables
//! Lengths are in reduced mean free paths 1 / sigma_t'; scattering is isotropic; light is directional and looked at from
//! 60 degrees aside. A cell holds percent of what leaves by the walk: the signed error of all light that leaves, of the
//! mean that a camera sees, and the sum of the absolute errors of some two dozen parts of the surface. On the half-space
//! there is no camera, and a thin beam's parts are rings. All that leaves counts, also "unscattered", the part of the
//! entering light that crosses the body straight: the renderer has nothing but the model for it, and the spheres of the
//! table model hold it. Standard errors, and what noise alone makes of the last number, are in `src/docs/model_errors.csv`.
//! A hundred thousand paths a scene: means of all light are good to .2 to 1.1 %, of what a camera sees of most to 1.7 %;
//! absolute errors of parts below about 8 % on meshes are noise.
//!
//! # What they say
//! - A profile of the half-space loses light on small and thin bodies, whichever it is. "table on spheres" takes at each
//!   point the profile of the sphere that the body is [locally like](mod@crate::curvature), and as much of it as makes the
//!   body give back what that sphere does ([balance](mod@crate::curvature::balance)).
//! - The directional dipole makes light; Burley's lengths are fits for index-matched matter.
//!
//! `cargo run --release --example model_errors` measures them anew. "head" is *Infinite, 3D Head Scan* by Lee Perry-Smith
//! (CC BY 3.0), which is not shipped; three of its edges are open, through which a path is lost now and then.
//!
#![doc = include_str!("../docs/model_errors.md")]

mod models;
mod plane;
mod scenes;

pub use plane::{Truth, Verdict};
pub use scenes::{Figure, Scene};

use crate::reference::walk::exitance::{Bins, exitance, seen};
use crate::reference::walk::mesh::Corners;
use crate::reference::walk::model::{Prediction, Transfer, predict};
use crate::reference::walk::{Estimate, Matter};
use glam::DVec3;
use models::{Named, models};
use std::f64::consts::PI;
use std::fmt::Write;

/// Places per internal unit to which vertices are moved; f32 keeps 2^24, and a vertex is a sum of two.
const GRID: f64 = (1 << 20) as f64;

/// Rays across the image of a camera.
const RAYS: u32 = 512;

/// How much is computed.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Paths of the walk in each scene.
    pub paths: u64,
    /// Entries that each model carries on.
    pub samples: u64,
    pub seed: u64,
}

/// One model in one scene; errors are relative to what leaves by the walk.
#[derive(Clone, Debug)]
pub struct Row {
    pub matter: &'static str,
    pub scene: String,
    pub model: &'static str,
    /// Light that passes without being scattered, over what entered; none on a half-space.
    pub straight: f64,
    /// Share of the walk's paths that were lost.
    pub lost: f64,
    /// Signed error of all light that leaves.
    pub all: Estimate,
    /// Signed error of the mean that a camera sees, 60 degrees from the light.
    pub seen: Option<Estimate>,
    /// Sum of the absolute errors of the bins. `error` is what the noise of both sides alone would make.
    pub l1: Option<Estimate>,
}

/// Matter of three kinds, isotropic, 1 / sigma_t' = 1: alpha' of skin1 in green and red and of marble in green.
pub fn matters() -> [(&'static str, Matter); 3] {
    [
        ("skin1, green", Matter::isotropic(0.88 / 1.05, 1.3)),
        ("skin1, red", Matter::isotropic(0.74 / 0.772, 1.3)),
        ("marble, green", Matter::isotropic(2.62 / 2.6241, 1.5)),
    ]
}

/// The triangles of all that a scene holds, internal units; their vertices are joined where f32 has moved them apart.
pub fn corners(scene: &crate::Scene) -> Vec<Corners> {
    let snapped = |p: DVec3| (p * GRID).round() / GRID;
    let corners = scene.triangles.iter().map(|t| t.vertices.map(|vertex| snapped(vertex.as_dvec3())));
    corners.filter(|[a, b, c]| (b - a).cross(c - a).length_squared() > 0.0).collect()
}

/// The bodies: simple ones, and closed meshes by name, each in two sizes.
pub fn bodies(meshes: &[(String, Vec<Corners>)]) -> Vec<Scene> {
    let mut all: Vec<Scene> = [1.0, 3.0, 10.0, 100.0].map(Scene::sphere).into();
    all.extend([Scene::plate(20.0, 1.0), Scene::plate(20.0, 3.0), Scene::cube(20.0), Scene::capsule(3.0, 18.0)]);
    for (name, corners) in meshes {
        all.extend([20.0, 100.0].map(|size| Scene::mesh(name, corners, size)));
    }
    all
}

/// The models on the half-space.
pub fn on_plane(matter: (&'static str, Matter), effort: Effort) -> Vec<Row> {
    let (name, matter) = matter;
    let truth = Truth::new(matter, effort.paths, effort.seed);
    let judge = |(model, transfer): Named| {
        let verdict = truth.judge(matter.ior, &*transfer);
        let row = |scene: &str, all, l1| Row {
            matter: name,
            scene: scene.into(),
            model,
            straight: 0.0,
            lost: 0.0,
            all,
            seen: None,
            l1,
        };
        [row("plane, thin beam", verdict.beam, Some(verdict.l1)), row("plane, even light", verdict.even, None)]
    };
    models(&matter, None).into_iter().flat_map(judge).collect()
}

/// The models on a body.
pub fn on_body(matter: (&'static str, Matter), scene: &Scene, effort: Effort) -> Vec<Row> {
    let (name, matter) = matter;
    let bins = Bins { count: scene.areas.len(), of: &|position, place| scene.bin(position, place) };
    let body = &scene.figure;
    let truth = exitance(body, matter, &[matter.sigma_a], scene.light, bins, effort.paths, effort.seed).remove(0);
    let models = models(&matter, Some(scene));
    let transfers: Vec<&dyn Transfer> = models.iter().map(|(_, model)| &**model).collect();
    let diffuse = 1.0 / (3.0 * matter.sigma_a).sqrt().max(1e-3);
    let lengths = [0.1, 1.0, diffuse];
    let runs = (effort.samples, effort.seed + 1);
    let found = predict(body, matter.ior, &transfers, scene.light, bins, lengths, runs);
    let visible = seen(body, matter.ior, scene.forward, bins, RAYS);
    let weights: Vec<f64> = visible.iter().zip(&scene.areas).map(|(weight, area)| weight / area).collect();
    let mean = |bins: &[Estimate]| {
        let mean = bins.iter().zip(&weights).map(|(bin, weight)| bin.mean * weight).sum();
        let variance: f64 = bins.iter().zip(&weights).map(|(bin, weight)| (bin.error * weight).powi(2)).sum();
        Estimate { mean, error: variance.sqrt() }
    };
    let row = |(prediction, (model, _)): (&Prediction, &Named)| {
        let pairs = || prediction.bins.iter().zip(&truth.bins);
        let wrong: f64 = pairs().map(|(a, b)| (a.mean - b.mean).abs()).sum();
        let noise: f64 = pairs().map(|(a, b)| a.error.hypot(b.error)).sum();
        let all = truth.all.mean;
        Row {
            matter: name,
            scene: scene.name.clone(),
            model,
            straight: truth.straight.mean / truth.entered.mean,
            lost: truth.lost,
            all: relative(prediction.all, truth.all),
            seen: Some(relative(mean(&prediction.bins), mean(&truth.bins))),
            l1: Some(Estimate { mean: wrong / all, error: (2.0 / PI).sqrt() * noise / all }),
        }
    };
    found.iter().zip(&models).map(row).collect()
}

fn relative(found: Estimate, truth: Estimate) -> Estimate {
    let ratio = found.mean / truth.mean;
    Estimate { mean: ratio - 1.0, error: ratio * (found.error / found.mean).hypot(truth.error / truth.mean) }
}

/// Every model in every scene. `done` is told of each scene.
pub fn measure(meshes: &[(String, Vec<Corners>)], effort: Effort, mut done: impl FnMut(&str, &str)) -> Vec<Row> {
    let mut rows = Vec::new();
    let bodies = bodies(meshes);
    for matter in matters() {
        rows.extend(on_plane(matter, effort));
        done(matter.0, "plane");
        for scene in &bodies {
            rows.extend(on_body(matter, scene, effort));
            done(matter.0, &scene.name);
        }
    }
    rows
}

/// A table a matter: a scene a row, a model a column.
pub fn markdown(rows: &[Row]) -> String {
    let mut text = String::new();
    let mut models: Vec<&str> = rows.iter().map(|row| row.model).collect();
    dedup(&mut models);
    for (matter, properties) in matters() {
        let rows: Vec<&Row> = rows.iter().filter(|row| row.matter == matter).collect();
        let mut scenes: Vec<&str> = rows.iter().map(|row| row.scene.as_str()).collect();
        dedup(&mut scenes);
        if scenes.is_empty() {
            continue;
        }
        let (albedo, ior) = (properties.albedo(), properties.ior);
        let diffuse = 1.0 / (3.0 * properties.sigma_a).sqrt();
        let _ = writeln!(text, "\n## {matter}: alpha' = {albedo:.4}, n = {ior}, diffuse mean free path {diffuse:.1}\n");
        let _ = writeln!(text, "| scene | unscattered | {} |", models.join(" | "));
        let _ = writeln!(text, "| --- | --- |{}", " --- |".repeat(models.len()));
        for scene in scenes {
            let of = |model: &str| rows.iter().find(|row| row.scene == scene && row.model == model);
            let straight = of(models[0]).map_or(String::new(), |row| percent(row.straight));
            let cells: Vec<String> =
                models.iter().map(|model| of(model).map_or(String::new(), |row| cell(row))).collect();
            let _ = writeln!(text, "| {scene} | {straight} | {} |", cells.join(" | "));
        }
    }
    text
}

fn dedup<'a>(names: &mut Vec<&'a str>) {
    let mut seen: Vec<&'a str> = Vec::new();
    names.retain(|name| {
        let new = !seen.contains(name);
        seen.push(name);
        new
    });
}

/// "all / seen / L1" in percent.
fn cell(row: &Row) -> String {
    let signed = |value: f64| format!("{:+.1}", 100.0 * value);
    let seen = row.seen.map_or("".into(), |seen| format!(" / {}", signed(seen.mean)));
    let l1 = row.l1.map_or("".into(), |l1| format!(" / {:.1}", 100.0 * l1.mean));
    format!("{}{seen}{l1}", signed(row.all.mean))
}

fn percent(value: f64) -> String {
    format!("{:.1}", 100.0 * value)
}

/// One line a row, with standard errors; all numbers relative.
pub fn csv(rows: &[Row]) -> String {
    let mut text = String::from("matter,scene,model,unscattered,lost,all,all_error,seen,seen_error,l1,l1_of_noise\n");
    let pair = |estimate: Option<Estimate>| estimate.map_or(",".into(), |e| format!("{:.5},{:.5}", e.mean, e.error));
    for row in rows {
        let Row { matter, scene, model, straight, lost, all, seen, l1 } = row;
        let (all, seen, l1) = (pair(Some(*all)), pair(*seen), pair(*l1));
        let _ = writeln!(text, "\"{matter}\",\"{scene}\",{model},{straight:.5},{lost:.7},{all},{seen},{l1}");
    }
    text
}
