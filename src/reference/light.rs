//! Light that arrives at a point: delta lights, and the environment with its density for importance sampling.
//!
//! Delta lights follow KHR_lights_punctual: irradiance perpendicular to the direction is I / d^2 (point, spot) with a
//! window max(1 - (d / range)^4, 0), and a spot's factor saturate(cosine * scale + offset)^2.
//!
//! Environment image: u = 1/2 + atan2(e_z, e_x) / 2 pi, v = acos(e_y) / pi, bilinear between texel centres, u periodic.
//! Its density is constant within cells of (u, v), proportional to the integral of luminance x sin theta over the cell, so
//! that it is nowhere far below the light that the lookup finds there; a row comes from the marginal
//! distribution and a column from the row's, both by inversion (M. Pharr, W. Jakob, G. Humphreys, "Physically Based
//! Rendering", 3rd ed., section 14.2.4). Per solid angle it is p(u, v) / (2 pi^2 sin theta).

use super::Inputs;
use super::math::luminance;
use crate::shared::{ENVIRONMENT_CONSTANT, ENVIRONMENT_IMAGE, LIGHT_DIRECTIONAL, LIGHT_SPOT, Light};
use glam::{DVec3, Vec3};
use std::f64::consts::{PI, TAU};

/// End of a ray that goes to infinity.
pub const FAR: f64 = 1e30;

/// Light from one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incident {
    /// Unit vector towards the light.
    pub wi: DVec3,
    /// Irradiance of a surface perpendicular to wi, if nothing is between.
    pub irradiance: DVec3,
    /// Distance to the light.
    pub distance: f64,
}

/// What arrives at `x` from a delta light.
pub fn delta(light: &Light, x: DVec3) -> Incident {
    let intensity = light.intensity.as_dvec3();
    let direction = light.direction.as_dvec3();
    if light.kind == LIGHT_DIRECTIONAL {
        return Incident { wi: -direction, irradiance: intensity, distance: FAR };
    }
    let to = light.position.as_dvec3() - x;
    let distance = to.length();
    let wi = to / distance;
    let mut factor = (1.0 - (distance * f64::from(light.inverse_range)).powi(4)).clamp(0.0, 1.0) / to.length_squared();
    if light.kind == LIGHT_SPOT {
        let angular = -wi.dot(direction) * f64::from(light.spot_scale) + f64::from(light.spot_offset);
        factor *= angular.clamp(0.0, 1.0).powi(2);
    }
    Incident { wi, irradiance: intensity * factor, distance }
}

/// Radiance of the environment from the unit vector `d`.
pub fn environment(inputs: &Inputs, d: DVec3) -> DVec3 {
    let view = inputs.view;
    let scale = view.environment_scale.as_dvec3();
    match inputs.features.environment {
        ENVIRONMENT_CONSTANT => scale,
        ENVIRONMENT_IMAGE => {
            let (u, v) = coordinates(inputs, d);
            let (width, height) = (i64::from(view.environment_width), i64::from(view.environment_height));
            let (x, y) = (u * width as f64 - 0.5, v * height as f64 - 0.5);
            let texel = |i: i64, j: i64| {
                let (i, j) = (i.rem_euclid(width), j.clamp(0, height - 1));
                inputs.environment[(j * width + i) as usize].as_dvec3()
            };
            let (i, j) = (x.floor() as i64, y.floor() as i64);
            let row = |j: i64| texel(i, j).lerp(texel(i + 1, j), x - x.floor());
            row(j).lerp(row(j + 1), y - y.floor()) * scale
        }
        _ => DVec3::ZERO,
    }
}

fn rotated(inputs: &Inputs, d: DVec3) -> DVec3 {
    let view = inputs.view;
    DVec3::new(
        view.environment_row0.as_dvec3().dot(d),
        view.environment_row1.as_dvec3().dot(d),
        view.environment_row2.as_dvec3().dot(d),
    )
}

/// (u, v) of a direction, each in [0, 1].
fn coordinates(inputs: &Inputs, d: DVec3) -> (f64, f64) {
    let e = rotated(inputs, d);
    (0.5 + e.z.atan2(e.x) / TAU, e.y.clamp(-1.0, 1.0).acos() / PI)
}

/// Row (or column) `cell` of a cumulative table, and the density within it, relative to uniform.
fn cell_density(cdf: &[f32], cell: usize) -> f64 {
    (f64::from(cdf[cell + 1]) - f64::from(cdf[cell])) * (cdf.len() - 1) as f64
}

fn table<'a>(inputs: &Inputs<'a>) -> (&'a [f32], impl Fn(usize) -> &'a [f32]) {
    let (width, height) = (inputs.view.density_width as usize, inputs.view.density_height as usize);
    let cdf = inputs.environment_cdf;
    (&cdf[..=height], move |row| &cdf[height + 1 + row * (width + 1)..][..=width])
}

/// Density of [`sample_environment`] per solid angle.
pub fn environment_pdf(inputs: &Inputs, d: DVec3) -> f64 {
    let (u, v) = coordinates(inputs, d);
    let (marginal, rows) = table(inputs);
    let cell = |x: f64, count: u32| ((x * f64::from(count)) as usize).min(count as usize - 1);
    let (i, j) = (cell(u, inputs.view.density_width), cell(v, inputs.view.density_height));
    let sin = (v * PI).sin();
    if sin > 0.0 { cell_density(marginal, j) * cell_density(rows(j), i) / (2.0 * PI * PI * sin) } else { 0.0 }
}

/// Inverse of a cumulative table: the cell, and the coordinate in [0, 1].
fn invert(cdf: &[f32], u: f64) -> (usize, f64) {
    let cells = cdf.len() - 1;
    let cell = (cdf.partition_point(|&c| f64::from(c) <= u) - 1).min(cells - 1);
    let (low, high) = (f64::from(cdf[cell]), f64::from(cdf[cell + 1]));
    (cell, (cell as f64 + (u - low) / (high - low)) / cells as f64)
}

/// A direction towards the environment image, from two numbers in [0, 1).
pub fn sample_environment(inputs: &Inputs, u1: f64, u2: f64) -> DVec3 {
    let (marginal, rows) = table(inputs);
    let (row, v) = invert(marginal, u2);
    let (_, u) = invert(rows(row), u1);
    let ((sin, cos), phi) = ((PI * v).sin_cos(), TAU * (u - 0.5));
    let view = inputs.view;
    view.environment_row0.as_dvec3() * (sin * phi.cos())
        + view.environment_row1.as_dvec3() * cos
        + view.environment_row2.as_dvec3() * (sin * phi.sin())
}

/// Most cells of the environment's density.
const DENSITY_LIMIT: (usize, usize) = (1024, 512);

/// The sampling table of an environment image (layout of [`Slot::EnvironmentCdf`](crate::shared::Slot)), and the width
/// and height of its cells. `radiance` holds `width` x `height` >= 1 non-negative texels.
pub fn environment_cdf(radiance: &[Vec3], width: u32, height: u32) -> (Vec<f32>, u32, u32) {
    let (width, height) = (width as usize, height as usize);
    let (columns, rows) = (width.min(DENSITY_LIMIT.0), height.min(DENSITY_LIMIT.1));
    // Bilinear lookup spreads a texel over its neighbours, whose own light may be nothing beside it.
    let parts = |cell: usize, cells: usize, texels: usize| {
        let (begin, end) =
            (cell as f64 * texels as f64 / cells as f64, (cell + 1) as f64 * texels as f64 / cells as f64);
        (begin.floor() as i64 - 1..=end.ceil() as i64)
            .map(move |texel| (texel, tent(end - texel as f64 - 0.5) - tent(begin - texel as f64 - 0.5)))
            .filter(|(_, part)| *part > 0.0)
    };
    let weight = |row: usize, column: usize| {
        let mut sum = 0.0;
        for (j, part_j) in parts(row, rows, height) {
            let j = j.clamp(0, height as i64 - 1) as usize;
            for (i, part_i) in parts(column, columns, width) {
                let i = i.rem_euclid(width as i64) as usize;
                sum += luminance(radiance[j * width + i].as_dvec3()) * part_i * part_j;
            }
        }
        sum
    };
    let mut marginal = Vec::with_capacity(rows);
    let mut conditional = Vec::with_capacity(rows * (columns + 1));
    for row in 0..rows {
        let weights: Vec<f64> = (0..columns).map(|column| weight(row, column)).collect();
        // Integral of sin theta over the row.
        let (top, bottom) = (PI * row as f64 / rows as f64, PI * (row + 1) as f64 / rows as f64);
        marginal.push(weights.iter().sum::<f64>() * (top.cos() - bottom.cos()));
        conditional.extend(cumulative(&weights));
    }
    let mut table = cumulative(&marginal);
    table.extend(conditional);
    (table, columns as u32, rows as u32)
}

/// Integral of max(1 - |x|, 0) up to `x`.
fn tent(x: f64) -> f64 {
    let rest = 1.0 - x.abs().min(1.0);
    if x < 0.0 { rest * rest / 2.0 } else { 1.0 - rest * rest / 2.0 }
}

/// Cumulative sums from 0 to exactly 1; uniform where all weights are zero.
fn cumulative(weights: &[f64]) -> Vec<f32> {
    let total: f64 = weights.iter().sum();
    let usable = total > 0.0 && total.is_finite();
    let mut sum = 0.0;
    let mut cdf = vec![0.0];
    cdf.extend(weights.iter().map(|w| {
        sum += if usable { w / total } else { 1.0 / weights.len() as f64 };
        sum.min(1.0) as f32
    }));
    cdf[weights.len()] = 1.0;
    cdf
}
