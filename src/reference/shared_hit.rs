//! What a lit hit brings to the pixels of its tile: twin of `shared_hit.glsl`. See [`reuse`](mod@super::reuse).

use super::profile::{Matter, shapes};
use super::projection::matter_at;
use super::tile::{Place, members};
use super::{Inputs, reuse::Stage};
use crate::shared::Step;
use glam::DVec3;

/// F: a pixel's value of light that enters at `delta` from the point that it sees; 0 where none of its probes looks. Its
/// `own` hits count as in reach.
pub fn value(matter: Matter, delta: DVec3, own: bool) -> DVec3 {
    let r = delta.length();
    let reached = own || r <= f64::from(matter.material.radius_max);
    if reached { matter.material.strength.as_dvec3() * shapes(matter, r) } else { DVec3::ZERO }
}

/// The pixels of the tile that share hits with pixel `index`, itself among them.
pub fn sharing(inputs: &Inputs, step: &Step, stage: &Stage, index: u32) -> Vec<u32> {
    let own = &stage.probes[index as usize];
    let shares = |other: &u32| {
        let other = &stage.probes[*other as usize];
        (other.stamp, other.group) == (step.sample_index + 1, own.group)
    };
    members(inputs, step, Place::of(inputs, step, index)).into_iter().filter(shares).collect()
}

/// The sum over those pixels, and channels, of the values of the hit at `delta` from the point that pixel `index` sees.
pub fn tile_value(inputs: &Inputs, step: &Step, stage: &Stage, index: u32, delta: DVec3) -> f64 {
    let value = |other: u32| {
        let surface = &stage.surfaces[other as usize];
        let delta = stage.position(index) - stage.position(other) + delta;
        value(matter_at(inputs, surface), delta, other == index).element_sum()
    };
    sharing(inputs, step, stage, index).into_iter().map(value).sum()
}
