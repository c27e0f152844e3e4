//! Light that enters at a point that keeps it, as of the cloud: twin of `irradiance.comp`.
//!
//! A point that stands for the area A takes in the flux
//!
//!   Phi = A E,   E = int Ft(wi) Li cos dw,
//!
//! estimated as by [`accumulate`](super::accumulate), on the outer side of the surface. Profiles of the table model
//! depend on the direction by the factor 1 + slope (1 - mu'), mu' the cosine of refraction, and the slope on the exit;
//! hence A int Ft(wi) (1 - mu') Li cos dw is kept as well. What does not factor so cannot be kept: the directional dipole.
//!
//! The base colour's texture tints the light of the cloud's points. Where light is interpolated between points
//! ([`cached`](mod@super::cached)), A is 1 and each pixel brings the tint of its own hit.

use super::Inputs;
use super::accumulate::{Entry, entering_light};
use super::boundary::cos_refracted;
use super::tile::Place;
use crate::shared::{Cluster, IRRADIANCE_CACHED, POINTS_ROW, Step};
use glam::DVec3;

/// Flux, and flux times 1 - mu', of the step's rays at point `index`. `step` has the samples that light the cloud as its
/// range; delta lights need one of them.
pub fn irradiance(inputs: &Inputs, step: &Step, index: u32, point: &Cluster) -> [DVec3; 2] {
    let material = &inputs.materials[inputs.shadings[point.triangle as usize].material as usize];
    let mut entry = Entry::new(inputs, material, 1.0, point.position.as_dvec3(), point.triangle);
    // At a vertex that of all surfaces around it.
    entry.normal = point.normal.as_dvec3();
    let tint = if inputs.features.irradiance == IRRADIANCE_CACHED { DVec3::ONE } else { entry.tint };
    let lights = inputs.view.light_count;
    let samples = f64::from(step.range_end - step.range_begin);
    let end = step.ray_begin + step.ray_count;
    // The rays of the step among delta lights, and the others.
    let delta = Step { ray_count: end.min(lights).saturating_sub(step.ray_begin), ..*step };
    let begin = step.ray_begin.max(lights);
    let other = Step { ray_begin: begin, ray_count: end.saturating_sub(begin), ..*step };
    let light = |value: &dyn Fn(DVec3) -> DVec3| {
        let place = Place::first(inputs, (index, POINTS_ROW - step.first_row));
        let of = |step: &Step| entering_light(inputs, step, place, &entry, value);
        f64::from(point.area) * tint * (of(&delta) + of(&other) / samples)
    };
    let oblique = |wi: DVec3| DVec3::splat(1.0 - cos_refracted(material.ior.into(), entry.shading.dot(wi)));
    [light(&|_| DVec3::ONE), light(&oblique)]
}
