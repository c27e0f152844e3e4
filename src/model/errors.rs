//! How far each model is from a random walk through a half-space, as a function of the albedo and the index.
//!
//! A thin perpendicular beam enters isotropic matter; `total` is the model's error of all light that leaves, `l1` the
//! light that it puts in the wrong place or that is too much or too little, both over what leaves by the walk. Between
//! the albedos and indices of the grid the errors are interpolated, beyond it the nearest holds. Similar matter of g other
//! than 0 has nearly the same errors beyond a mean free path.
//!
//! `BLESS=1 cargo test --test physics model_errors` measures the grid anew.

use super::{beam, grid};
use crate::reference::profile::Coefficients;
use crate::reference::walk::{
    Matter,
    searchlight::{Incidence, Searchlight, searchlight},
};
use crate::settings::Model;
use std::f64::consts::PI;
use std::fmt;

/// alpha' = sigma_s' / sigma_t' of the grid.
pub const ALBEDOS: [f64; 9] = [0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.998, 0.9998];

/// Indices of refraction of the grid, inside over outside.
pub const INDICES: [f64; 4] = [1.0, 1.3, 1.5, 2.0];

/// Relative errors on a plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Error {
    pub total: f64,
    pub l1: f64,
}

impl fmt::Display for Error {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let (total, l1) = (100.0 * self.total, 100.0 * self.l1);
        write!(out, "sends out {total:+.0} % light, {l1:.0} % is in the wrong place or amount (against a random walk)")
    }
}

/// Errors of a model: of the grid's albedos for each of its indices.
pub type Errors = [[Error; ALBEDOS.len()]; INDICES.len()];

/// The published [`model_errors`](crate::model_errors).
const MEASURED: &str = include_str!("../docs/model_errors.csv");

/// What the [table](crate::table) errs at most.
const TABLE: Error = Error { total: 0.005, l1: 0.01 };

/// The error of a model, interpolated; none for one that was not measured.
pub fn of(model: Model, albedo: f64, ior: f64) -> Option<Error> {
    if model == Model::Table {
        return Some(TABLE);
    }
    let errors = grid::GRID.iter().find(|(name, _)| *name == model.to_string()).map(|(_, errors)| errors)?;
    // Errors change evenly with the logarithm of what is absorbed.
    let (i, s) = place(ALBEDOS.map(|albedo| -(1.0 - albedo).ln()), -(1.0 - albedo).max(1e-9).ln());
    let (j, t) = place(INDICES, ior);
    let mix = |f: fn(&Error) -> f64| {
        let row = |j: usize| f(&errors[j][i]) * (1.0 - s) + f(&errors[j][i + 1]) * s;
        row(j) * (1.0 - t) + row(j + 1) * t
    };
    Some(Error { total: mix(|error| error.total), l1: mix(|error| error.l1) })
}

/// Least and largest error of what a camera sees of balls of the radius 1 and of plates of the thickness 1 mean free
/// path, over the media of [`model_errors`](crate::model_errors); none for the opaque limit. `curvature` as in
/// [`Settings`](crate::Settings).
pub fn on_thin_bodies(model: Model, curvature: bool) -> Option<[(f64, f64); 2]> {
    let name = if model == Model::Table && curvature { "table on spheres".into() } else { model.to_string() };
    let range = |scene: &str| {
        let row = format!("\"{scene}\",{name},");
        // After the model: unscattered, lost, all, its error, seen.
        let seen = MEASURED.lines().filter_map(|line| line.split_once(&row)?.1.split(',').nth(4)?.parse::<f64>().ok());
        seen.map(|seen| (seen, seen)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    };
    Some([range("sphere, radius 1")?, range("plate, 20 x 20 x 1")?])
}

/// The interval of an ascending grid that holds x, and where in it x is, 0 to 1; the nearest end for an x outside.
fn place<const N: usize>(grid: [f64; N], x: f64) -> (usize, f64) {
    let index = grid.partition_point(|start| *start <= x).clamp(1, N - 1) - 1;
    (index, ((x - grid[index]) / (grid[index + 1] - grid[index])).clamp(0.0, 1.0))
}

/// Ends of rings in scattering lengths, to far beyond all light.
fn radii() -> Vec<f64> {
    std::iter::once(0.0).chain((0..40).map(|i| 0.02 * 1.3f64.powi(i))).collect()
}

/// Walks `paths` paths through a half-space of index `ior`, weighed for each albedo of the grid.
pub fn walk(ior: f64, paths: u64, seed: u64) -> Vec<Searchlight> {
    let matter = Matter { sigma_s: 1.0, sigma_a: 0.0, g: 0.0, ior };
    searchlight(matter, &ALBEDOS.map(absorption), Incidence::Angle(0.0), &radii(), paths, seed)
}

/// sigma_a over sigma_s'.
fn absorption(albedo: f64) -> f64 {
    (1.0 - albedo) / albedo
}

/// The error of a model against what was walked for an albedo; none for one that is not built.
pub fn measure(model: Model, albedo: f64, ior: f64, walked: &Searchlight) -> Option<Error> {
    let matter =
        Coefficients { sigma_s_prime: 1.0, sigma_a: absorption(albedo), g: 0.0, ior, rough: None, appearance: None };
    let cdf = beam(model, &matter)?;
    let (mut l1, mut inside) = (0.0, 0.0);
    for (ends, ring) in walked.radii.windows(2).zip(&walked.rings) {
        let light = ring.mean * PI * (ends[1] - ends[0]) * (ends[1] + ends[0]);
        l1 += (cdf(ends[1]) - cdf(ends[0]) - light).abs();
        inside += light;
    }
    let (end, total) = (walked.radii[walked.radii.len() - 1], cdf(f64::INFINITY));
    l1 += ((total - cdf(end)) - (walked.total.mean - inside)).abs();
    Some(Error { total: total / walked.total.mean - 1.0, l1: l1 / walked.total.mean })
}
