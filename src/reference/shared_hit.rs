//! What a lit hit brings to the pixels of its tile: twin of `shared_hit.glsl`. See [`reuse`](mod@super::reuse).

use super::profile::{Matter, shapes, table};
use super::projection::matter_at;
use super::tile::{Place, members};
use super::{Inputs, reuse::Stage};
use crate::shared::{MODEL_TABLE, Step};
use glam::DVec3;

/// Distance beyond which a pixel's profile ends, or the ball in which its probes look.
pub fn reach(matter: Matter) -> f64 {
    let radius = f64::from(matter.material.radius_max);
    if matter.material.model == MODEL_TABLE { table::reach(matter).min(radius) } else { radius }
}

/// G: about the profile at a distance, the same for all pixels that share the hit; of a tabulated one that of the half-space,
/// all channels together, which takes one read. (One exponential in place of a profile was tried: where tiles are many mean
/// free paths wide, its tails make fireflies.)
pub fn weight(matter: Matter, r: f64) -> f64 {
    match matter.material.model {
        MODEL_TABLE => table::weighed(matter, r * r),
        _ => (matter.material.strength.as_dvec3() * shapes(matter, r)).element_sum(),
    }
}

/// The pixels of the tile that share hits with pixel `index`, itself among them.
pub fn sharing(inputs: &Inputs, step: &Step, stage: &Stage, index: u32) -> Vec<u32> {
    let own = stage.probes[index as usize].share();
    let shares = |other: &u32| stage.probes[*other as usize].share() == own;
    members(inputs, step, Place::of(inputs, step, index)).into_iter().filter(shares).collect()
}

/// G of the hit at `delta` from the point that pixel `index` sees, over the sum of those of all pixels of the tile that may
/// find it. Its own hits count as in reach.
pub fn tile_share(inputs: &Inputs, step: &Step, stage: &Stage, index: u32, delta: DVec3) -> f64 {
    let of = |other: u32| {
        let matter = matter_at(inputs, &stage.surfaces[other as usize]);
        let r = (stage.position(index) - stage.position(other) + delta).length();
        let reached = other == index || r <= reach(matter);
        if reached { weight(matter, r) } else { 0.0 }
    };
    of(index) / sharing(inputs, step, stage, index).into_iter().map(of).sum::<f64>()
}
