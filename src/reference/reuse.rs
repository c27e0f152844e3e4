//! Pixels of a tile share the hits that they light: twin of `reuse.comp`.
//!
//! # Estimator
//! What pixels see that lie side by side differs little, and so do their integrals over the surface: a point that one has
//! found and lit serves all (P. Bekaert, M. Sbert, J. Halton, "Accelerating path tracing by re-using paths", EGWR 2002).
//! With f_i(x) the [profile](super::accumulate) of light from x to the point that pixel i sees, F_i its sum over channels,
//! p_i the density of the hits of i's probes, and E the light that enters, pixel i of a tile T gets from the hits x of all
//! probes j in T
//!
//!   Lo_i ~ Ft(wo) sum over j, x of  m_j(x) f_i(x) / p_j(x) E(x),     m_j(x) = G_j(x) / sum over k in T of G_k(x).
//!
//! The weights m_j add up to 1 at each x where any G_k > 0, so the expectation is that of each pixel alone, whatever the
//! tile, if p_j > 0 wherever G_j > 0. That takes G_j = 0 beyond j's [reach], where its profile
//! ends or its probes do not look, and pixels of one set that are seen from one side: then the hits of one are hits of the
//! other. Within its reach G_j is [about F_j](super::shared_hit::weight). One hit of each probe is lit, with the
//! probability c / C, c = F_j / p_j, C the sum of c over the probe's hits, so that what is added is
//!
//!   C E(x) f_i(x) / F_j(x) G_j(x) / sum over k of G_k(x):
//!
//! with G = F each channel would be at most C E, which bounds the weight of a hit of a pixel alone too; it is more by as
//! much as F / G differs between the tile's pixels. Where a tile is small beside the mean free path, all F_k are alike and
//! the variance is that of W^2 probes; where it is large, that of one. The noise of neighbours goes together: the mean
//! over an area is no better than it was.
//!
//! # Reading tables
//! A tabulated f_i is the mean of those of two curvatures by their weights. One is drawn for a pixel and sample, as textures
//! may be (M. Fajardo, B. Wronski, M. Salvi, M. Pharr, "Stochastic texture filtering" (2023)): the expectation is the same,
//! with half of the reads.

use super::Inputs;
use super::accumulate::{Entry, choose, entering_light, keeps_light, kept_light, leaving};
use super::pixel::position;
use super::profile::obliqueness;
use super::profile::{shapes, shapes_drawn};
use super::projection::{matter_at, seen};
use super::random::{batch, hash, key, unit};
use super::shared_hit::{reach, sharing, tile_share};
use super::sums::Contribution;
use super::tile::{Place, first_share, members};
use crate::shared::{BATCHES, DIM_REUSE, Hits, MODEL_LAMBERT, Probe, Step, Surface};
use glam::{DVec3, UVec4};

/// What the pixels of a band see and probe in a sample.
#[derive(Clone, Copy, Debug)]
pub struct Stage<'a> {
    /// Of the sample's batch.
    pub surfaces: &'a [Surface],
    pub probes: &'a [Probe],
}

impl Stage<'_> {
    pub fn position(&self, index: u32) -> DVec3 {
        self.surfaces[index as usize].position.as_dvec3()
    }
}

/// A hit that a pixel lights.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lit {
    pub position: DVec3,
    /// From the point that the pixel sees.
    pub distance: f64,
    /// Times its share of the tile's weights over its own profile.
    pub light: DVec3,
}

impl Lit {
    /// As `accumulate.comp` leaves it.
    pub fn into_probe(self, probe: &mut Probe) {
        probe.hit = self.position.as_vec3();
        probe.hit_r2 = (self.distance * self.distance) as f32;
        let [x, y, z] = self.light.as_vec3().to_array().map(f32::to_bits);
        probe.lit = UVec4::new(x, y, z, probe.lit.w);
    }
}

/// Whether pixel `index` shares hits in the step's sample.
fn takes_part(inputs: &Inputs, step: &Step, stage: &Stage, index: u32) -> bool {
    let share = stage.probes[index as usize].share();
    share.wrapping_sub(first_share(inputs, step)) < inputs.view.groups
}

/// The part of `accumulate.comp`: the hit that pixel `index` lights; none where there is no such hit.
pub fn light(inputs: &Inputs, step: &Step, index: u32, stage: &Stage, hits: &Hits) -> Option<Lit> {
    let (surface, probe) = (&stage.surfaces[index as usize], &stage.probes[index as usize]);
    if !takes_part(inputs, step, stage, index) || step.ray_count == 0 {
        return None;
    }
    let (matter, seen) = (matter_at(inputs, surface), seen(inputs, surface));
    // f / p with the weight of the choice, and over channels C.
    let (chosen, weighted) = choose(inputs, step, index, matter, &seen, probe, hits)?;
    let delta = probe.offset.as_dvec3() + f64::from(hits.t[chosen]) * probe.direction.as_dvec3();
    let entry = Entry::new(inputs, matter.material, seen.side, seen.position + delta, hits.triangle[chosen]);
    let value = |wi: DVec3| obliqueness(matter, entry.shading.dot(wi), false);
    let light = match keeps_light(inputs, matter, &seen) {
        true => kept_light(inputs, step, matter, &entry, hits.triangle[chosen]),
        false => entering_light(inputs, step, Place::of(inputs, step, index), &entry, value),
    };
    let light = entry.tint * light;
    if light == DVec3::ZERO {
        return None;
    }
    let profile = matter.material.strength.as_dvec3() * shapes(matter, delta.length());
    let share = tile_share(inputs, step, stage, index, delta);
    let light = light * (weighted.element_sum() / profile.element_sum() * share);
    Some(Lit { position: seen.position + delta, distance: delta.length(), light })
}

/// The contribution of the tile's hits to pixel `index`, with what [`light`] found in the probes.
pub fn reuse(inputs: &Inputs, step: &Step, index: u32, stage: &Stage) -> Contribution {
    let surface = &stage.surfaces[index as usize];
    if !takes_part(inputs, step, stage, index) {
        return Contribution::default();
    }
    let matter = matter_at(inputs, surface);
    debug_assert!(matter.material.model != MODEL_LAMBERT, "no probe is drawn in the opaque limit");
    let (px, py) = position(inputs.view, step, index);
    let key = key(inputs.view.seed, px, py, batch(step.sample_index), DIM_REUSE);
    let key = key.wrapping_add(hash(step.sample_index / BATCHES));
    let u = unit(hash(key));
    let sharing = sharing(inputs, step, stage, index);
    let of = |other: u32| {
        if !sharing.contains(&other) {
            return DVec3::ZERO;
        }
        let probe = &stage.probes[other as usize];
        let Probe { hit, hit_r2, .. } = *probe;
        let own = other == index;
        let r = if own { f64::from(hit_r2).sqrt() } else { hit.as_dvec3().distance(stage.position(index)) };
        let reached = own || r <= reach(matter);
        if reached { probe.light().as_dvec3() * shapes_drawn(matter, r, u) } else { DVec3::ZERO }
    };
    let sum: DVec3 = members(inputs, step, Place::of(inputs, step, index)).into_iter().map(of).sum();
    Contribution::of(
        leaving(inputs, matter, matter, &seen(inputs, surface), surface) * matter.material.strength.as_dvec3() * sum,
    )
}
