//! The kernels in f64, written from the formulas: twins of `glsl/*.comp` and `glsl/*.glsl` under the same stems.
//!
//! A twin takes what one invocation of its kernel reads and returns what it writes, in the shared structs; inside it
//! computes in f64. [`render`] runs them in order. [`area`] is an integrator of its own that shares nothing with them,
//! [`mod@uniform`] one that shares what leaves and what enters; [`mod@walk`] is what the models approximate.

pub mod accumulate;
pub mod area;
pub mod begin;
pub mod boundary;
pub mod cached;
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
pub mod reuse;
pub mod rough;
pub mod sample;
pub mod screen;
pub mod shared_hit;
pub mod single;
pub mod strict;
pub mod sums;
pub mod texture;
pub mod tile;
pub mod uniform;
pub mod walk;

use crate::shared::{
    BATCHES, Balance, Cluster, Coordinates, Emitter, Features, Hits, Lattice, Light, Material, Mixture, Pixel, Probe,
    Shading, Step, Sums, Surface, Texture, Triangle, View,
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
    pub profiles: &'a [Vec3],
    /// Balances of profiles and triangles, one of each triangle or several; empty where no profile depends on curvatures.
    pub balances: &'a [Balance],
    /// Media of each set; empty where none holds several materials.
    pub mixtures: &'a [Mixture],
    /// Points whose light is kept, and the lattice of each triangle; empty where none is. See [`cached`](mod@cached).
    pub kept: &'a [Cluster],
    pub lattices: &'a [Lattice],
    /// Finds triangles that a ray may meet, where there is one; else rays look at all of them.
    pub tree: Option<&'a walk::mesh::Mesh>,
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
    let mut all = vec![Sums::default(); pixels as usize];
    let mut batch_sums = vec![[Vec3::ZERO; BATCHES as usize]; pixels as usize];
    // The first surfaces of each batch, and their stratum.
    let mut first: [Option<(u32, Vec<Surface>)>; BATCHES as usize] = Default::default();
    for sample_index in samples.clone() {
        let step = step(inputs, sample_index, rows.clone(), samples.clone());
        let of_each = || (0..pixels).into_par_iter();
        let batch = random::batch(sample_index) as usize;
        let stratum = random::stratum(&inputs.features, sample_index);
        if first[batch].as_ref().is_none_or(|(known, _)| *known != stratum) {
            first[batch] = Some((stratum, of_each().map(|index| primary::primary(inputs, &step, index)).collect()));
        }
        let (_, surfaces) = first[batch].as_ref().expect("traced above");
        let probe = |index| sample::sample(inputs, &step, index, &surfaces[index as usize]);
        let mut probes: Vec<Probe> = of_each().map(probe).collect();
        let hit = |index| screen::reproject(inputs, &step, index, surfaces, &probes[index as usize]);
        let hits: Vec<Hits> = of_each().map(hit).collect();
        if inputs.features.reuse != 0 {
            let stage = reuse::Stage { surfaces, probes: &probes };
            let light = |index| reuse::light(inputs, &step, index, &stage, &hits[index as usize]).unwrap_or_default();
            let lit: Vec<reuse::Lit> = of_each().map(light).collect();
            for (probe, lit) in probes.iter_mut().zip(lit) {
                lit.into_probe(probe);
            }
        }
        let stage = reuse::Stage { surfaces, probes: &probes };
        let add = |(index, (sums, batch_sums)): (usize, (&mut Sums, &mut [Vec3; BATCHES as usize]))| {
            let (surface, i) = (&surfaces[index], index as u32);
            let own = accumulate::accumulate(inputs, &step, i, surface, &probes[index], &hits[index]);
            own.add_subsurface(&step, surface, sums, &mut batch_sums[batch]);
            if inputs.features.reuse != 0 {
                reuse::reuse(inputs, &step, i, &stage).add_single(sums, &mut batch_sums[batch]);
            }
            let reflection = reflect::reflect(inputs, &step, i, surface);
            reflection.add_reflection(sums, &mut Vec3::ZERO.clone());
            sums.samples += 1;
            single::single(inputs, &step, i, surface).add_single(sums, &mut batch_sums[batch]);
        };
        all.par_iter_mut().zip(&mut batch_sums).enumerate().for_each(add);
    }
    let step = step(inputs, samples.start, rows, samples);
    let both = all.iter().zip(&batch_sums);
    both.map(|(sums, of_batches)| resolve::resolve(&inputs.features, &step, sums, of_batches)).collect()
}
