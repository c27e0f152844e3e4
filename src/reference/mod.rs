//! The kernels in f64, written from the formulas: twins of `glsl/*.comp` and `glsl/*.glsl` under the same stems.
//!
//! A twin takes what one invocation of its kernel reads and returns what it writes, in the shared structs; inside it
//! computes in f64. [`render`] runs them in order. [`area`] is an integrator of its own that shares nothing with them;
//! [`mod@walk`] is what the models approximate.

pub mod accumulate;
pub mod area;
pub mod begin;
pub mod boundary;
pub mod cluster;
pub mod count;
pub mod emitter;
pub mod gather;
pub mod intersect;
pub mod irradiance;
pub mod light;
pub mod math;
pub mod mixture;
pub mod pixel;
pub mod primary;
pub mod profile;
pub mod projection;
pub mod random;
pub mod reflect;
pub mod reproject;
pub mod resolve;
pub mod rough;
pub mod sample;
pub mod single;
pub mod strict;
pub mod sums;
pub mod texture;
pub mod walk;

use crate::shared::{
    BATCHES, Balance, Coordinates, Emitter, Features, Light, Material, Mixture, Pixel, Shading, Step, Sums, Surface,
    Texture, Triangle, View,
};
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// What every kernel may read: the buffers that do not change from sample to sample.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    pub features: Features,
    pub view: &'a View,
    /// In the order of the BVH's leaves.
    pub triangles: &'a [Triangle],
    pub shadings: &'a [Shading],
    pub materials: &'a [Material],
    pub lights: &'a [Light],
    /// Triangles that emit light, and the table from which they are drawn; see [`emitter`].
    pub emitters: &'a [Emitter],
    /// Texels of the environment image, empty if there is none.
    pub environment: &'a [Vec3],
    /// Its sampling table; see [`Slot::EnvironmentCdf`](crate::shared::Slot::EnvironmentCdf).
    pub environment_cdf: &'a [f32],
    /// Tables of rough boundaries; see [`rough`].
    pub boundaries: &'a [f32],
    /// Texels, textures and coordinates as their [slots](crate::shared::Slot) hold them; empty in scenes without textures.
    pub texels: &'a [u32],
    pub textures: &'a [Texture],
    pub coordinates: &'a [Coordinates],
    /// Tabulated profiles of the materials.
    pub profiles: &'a [f32],
    /// Curvatures at the vertices of each triangle; empty where no profile depends on them.
    pub thickness: &'a [Vec3],
    /// Balances of profiles and triangles; as many as curvatures, or several times that.
    pub balances: &'a [Balance],
    /// Media of each set; empty where none holds several materials.
    pub mixtures: &'a [Mixture],
}

/// The step of one sample that traces all its rays in one dispatch.
pub fn step(inputs: &Inputs, sample_index: u32, rows: Range<u32>, samples: Range<u32>) -> Step {
    Step {
        first_row: rows.start,
        pixel_count: rows.len() as u32 * inputs.view.crop_width,
        sample_index,
        ray_count: inputs.features.rays(inputs.view),
        first: 1,
        count: 1,
        range_begin: samples.start,
        range_end: samples.end,
        point: random::point(sample_index),
        ..Default::default()
    }
}

/// The rows `rows` of the image with the samples `samples`, by the twins in the order of the kernels.
pub fn render(inputs: &Inputs, rows: Range<u32>, samples: Range<u32>) -> Vec<Pixel> {
    let pixels = rows.len() as u32 * inputs.view.crop_width;
    (0..pixels).into_par_iter().map(|index| render_pixel(inputs, index, rows.clone(), samples.clone())).collect()
}

fn render_pixel(inputs: &Inputs, index: u32, rows: Range<u32>, samples: Range<u32>) -> Pixel {
    let mut sums = Sums::default();
    let mut batch_sums = [Vec3::ZERO; BATCHES as usize];
    // The first surface of each batch, and its stratum.
    let mut first: [Option<(u32, Surface)>; BATCHES as usize] = [None; BATCHES as usize];
    for sample_index in samples.clone() {
        let step = step(inputs, sample_index, rows.clone(), samples.clone());
        let batch = random::batch(sample_index) as usize;
        let stratum = random::stratum(&inputs.features, sample_index);
        let surface = match first[batch] {
            Some((known, surface)) if known == stratum => surface,
            _ => primary::primary(inputs, &step, index),
        };
        first[batch] = Some((stratum, surface));
        let probe = sample::sample(inputs, &step, index, &surface);
        let hits = reproject::reproject(inputs, &step, index, &surface, &probe);
        let subsurface = accumulate::accumulate(inputs, &step, index, &surface, &probe, &hits);
        subsurface.add_subsurface(&step, &surface, &mut sums, &mut batch_sums[batch]);
        let reflection = reflect::reflect(inputs, &step, index, &surface);
        reflection.add_reflection(&mut sums, &mut Vec3::ZERO.clone());
        sums.samples += 1;
        let once = single::single(inputs, &step, index, &surface);
        once.add_single(&mut sums, &mut batch_sums[batch]);
    }
    let step = step(inputs, samples.start, rows, samples);
    resolve::resolve(&inputs.features, &step, &sums, &batch_sums)
}
