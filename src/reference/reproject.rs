//! Where a probe meets surfaces of its set: twin of `reproject.comp`.
//!
//! All hits count (the density is of points of the surface, not of probes); of more than MAX_HITS, each is kept with
//! the same probability by reservoir sampling (J. S. Vitter, ACM TOMS 11 (1985), algorithm R), and `accumulate`
//! multiplies by count / MAX_HITS. The n-th hit found replaces entry h mod n, if there is one, with
//!
//!   h = hash(key(seed, pixel, batch, DIM_OVERFLOW) + hash(number of the sample within its batch) + n):
//!
//! every sample decides anew. Which hit is the n-th depends on the order of traversal, so kernel and twin may keep
//! different ones. The method as given keeps the first hit only.

use super::pixel::position;
use super::random::{batch, hash, key};
use super::{Inputs, intersect};
use crate::shared::{BATCHES, DIM_OVERFLOW, Hits, MAX_HITS, PROJECTION_CAMERA, Probe, Step, Surface};

/// The hits of the probe of pixel `index` of the band, whose first surface is `surface`.
pub fn reproject(inputs: &Inputs, step: &Step, index: u32, surface: &Surface, probe: &Probe) -> Hits {
    let mut found = Hits::default();
    if probe.t_min > probe.t_max {
        return found;
    }
    let set = inputs.triangles[surface.triangle as usize].set;
    let origin = surface.position.as_dvec3() + probe.offset.as_dvec3();
    let direction = probe.direction.as_dvec3();
    let all = intersect::hits(inputs, origin, direction, probe.t_min.into(), probe.t_max.into())
        .filter(|hit| inputs.triangles[hit.triangle as usize].set == set);

    let mut kept: Vec<intersect::Hit> = Vec::new();
    if inputs.features.projection == PROJECTION_CAMERA {
        kept.extend(all.min_by(|a, b| a.t.total_cmp(&b.t)));
        found.count = kept.len() as u32;
    } else {
        let (px, py) = position(inputs.view, step, index);
        let key = key(inputs.view.seed, px, py, batch(step.sample_index), DIM_OVERFLOW)
            .wrapping_add(hash(step.sample_index / BATCHES));
        for hit in all {
            found.count += 1;
            if found.count <= MAX_HITS {
                kept.push(hit);
            } else {
                let slot = hash(key.wrapping_add(found.count)) % found.count;
                if slot < MAX_HITS {
                    kept[slot as usize] = hit;
                }
            }
        }
        kept.sort_by(|a, b| a.t.total_cmp(&b.t));
    }
    for (slot, hit) in kept.iter().enumerate() {
        found.t[slot] = hit.t as f32;
        found.triangle[slot] = hit.triangle;
    }
    found
}
