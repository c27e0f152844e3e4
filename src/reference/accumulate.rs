//! Light x BSSRDF x Jacobian / density, into running sums: twin of `accumulate.comp`.
//!
//! # Estimator
//! Lo(xo, wo) = int_A int_Omega S Li cos dw dA is estimated by the sum over a probe's hits x_j of
//!
//!   Ft(wo) f(|x_j - xo|) / p(x_j) E(x_j),   f = Rd / (pi (1 - rho_e)),   E = int Ft(wi) Li cos dw,
//!
//! with p of [`projection`](super::projection). Every hit's weight is known without its light, so only one hit is lit:
//! drawn with probability w_j / W, w_j = (sum of f over channels) / p_j, and multiplied by W / w_j (resampled importance
//! sampling: J. Talbot, D. Cline, P. Egbert, EGSR 2005). The geometric normal is in p, which is a density of area; the
//! interpolated one is in Ft and the cosines. Light from below either horizon counts nothing.
//!
//! # The method as given
//! Polar coordinates of the tangent plane, p_T = s e^(-s r) / (2 pi r) with one rate s for all channels, wi and camera
//! ray as above:
//!
//!   Lo ~ 1 / N * sum of Ft(wo) f E (2 pi r / s) e^(s r) J,   J = |no.d| / |n.d| / q^2.
//!
//! The exponentials of density and profile are one, so that neither overflows.
//!
//! # The opaque limit
//! Nothing is drawn: the entry is xo itself, and f / p the material's strength ([`profile::lambert`]).

use super::light::{self, FAR};
use super::math::cosine_direction;
use super::profile::{self, Directional, Matter, shapes, shapes_shifted};
use super::projection::{
    Seen, balance, geometric_normal, inverse_scale, matter_at, mixture_density, seen, shading_normal, techniques,
};
use super::rough::{crossing, leaving_share};
use super::sums::Contribution;
use super::tile::{Place, coordinate, direction_point, golden};
use super::{Inputs, cached, emitter, intersect, mixture, texture};
use crate::shared::{
    DIM_EMITTER, DIM_HIT, DIM_LIGHT, DIM_SOURCE, EMITTER_REACH, ENVIRONMENT_IMAGE, Hits, INTEGRATOR_SAMPLE,
    IRRADIANCE_CACHED, MAX_HITS, MISS, MODEL_DIRECTIONAL, MODEL_LAMBERT, Material, PROJECTION_CAMERA, Probe,
    RECIPROCAL, SHADOW_OFFSET, Step, Surface, TEXTURE_BASE_COLOR, Triangle,
};
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// Where shadow rays of a point begin. `normal` is the geometric one.
pub(super) fn lifted(point: DVec3, normal: DVec3) -> DVec3 {
    point + normal * f64::from(SHADOW_OFFSET)
}

/// 1 if nothing is between `origin` and `distance` along `wi`, else 0.
pub(super) fn visibility(inputs: &Inputs, origin: DVec3, wi: DVec3, distance: f64) -> f64 {
    if intersect::any(inputs, origin, wi, 0.0, distance) { 0.0 } else { 1.0 }
}

/// Light of a point of an emitter over n_E p_E + n_D p_D; `pdf` is n_D p_D. 0 where it is hidden.
pub(super) fn from_emitter(inputs: &Inputs, origin: DVec3, point: &emitter::Point, points: f64, pdf: f64) -> DVec3 {
    let reach = point.distance * f64::from(EMITTER_REACH);
    let hit = intersect::closest(inputs, origin, point.wi, 0.0, reach);
    let hidden = hit.is_some_and(|hit| hit.triangle != point.triangle);
    // A point seen along its own surface has no solid angle.
    if hidden || !point.density.is_finite() { DVec3::ZERO } else { point.radiance / (points * point.density + pdf) }
}

/// Light from the direction `wi` over its density: an emitter's, or the environment's over `pdf` = n_D p_D alone.
pub(super) fn from_direction(inputs: &Inputs, origin: DVec3, wi: DVec3, points: f64, pdf: f64) -> DVec3 {
    if inputs.features.emitters != 0
        && let Some(hit) = intersect::closest(inputs, origin, wi, 0.0, FAR)
    {
        let radiance = emitter::radiance(inputs, hit.triangle, hit.barycentric, wi);
        return radiance / (points * emitter::density(inputs, hit.triangle, wi, hit.t) + pdf);
    }
    light::environment(inputs, wi) / pdf * visibility(inputs, origin, wi, FAR)
}

/// The contribution of the step's rays to pixel `index` of the band.
pub fn accumulate(
    inputs: &Inputs,
    step: &Step,
    index: u32,
    surface: &Surface,
    probe: &Probe,
    hits: &Hits,
) -> Contribution {
    if surface.triangle == MISS || step.ray_count == 0 {
        return Contribution::default();
    }
    let seen = seen(inputs, surface);
    let matter = matter_at(inputs, surface);
    // Other integrators do the rest.
    if inputs.features.integrator != INTEGRATOR_SAMPLE && matter.material.model != MODEL_LAMBERT {
        return Contribution::default();
    }
    // Hits of the others are shared.
    if inputs.features.reuse != 0 && matter.material.model != MODEL_LAMBERT {
        return Contribution::default();
    }
    let entry = if matter.material.model == MODEL_LAMBERT {
        let weights = surface.barycentric.as_dvec2();
        let strength = texture::medium(inputs, matter.material, surface.triangle, weights).strength;
        (DVec3::ZERO, surface.triangle, strength.as_dvec3())
    } else {
        match choose(inputs, step, index, matter, &seen, probe, hits) {
            Some((chosen, factor)) => (delta(probe, hits, chosen), hits.triangle[chosen], factor),
            None => return Contribution::default(),
        }
    };
    let given = inputs.features.projection == PROJECTION_CAMERA;
    let members = mixture::members(inputs, matter.material, surface.triangle);
    let rate = members.first().map_or(0.0, |member| f64::from(member.camera_rate));
    let exponent = if given { rate * f64::from(probe.radius) } else { 0.0 };
    carried(inputs, step, index, surface, entry, exponent)
}

/// Light of the step's rays that enters at xo + `delta`, on `triangle`, and leaves `surface`. `factor` is e^exponent f / p;
/// of the directional dipole, whose value comes with each ray, e^exponent / p.
pub(super) fn carried(
    inputs: &Inputs,
    step: &Step,
    index: u32,
    surface: &Surface,
    (delta, triangle, factor): (DVec3, u32, DVec3),
    exponent: f64,
) -> Contribution {
    let (seen, matter) = (seen(inputs, surface), matter_at(inputs, surface));
    let point = surface.position.as_dvec3() + delta;
    let material = mixture::entered(inputs, matter.material, triangle);
    let entry = Entry::new(inputs, material, seen.side, point, triangle);
    let local = texture::medium(inputs, material, triangle, entry.weights);
    let local = Matter { material: &local, ..matter };
    let leaving = leaving(inputs, matter, local, &seen, surface);
    let value = |wi: DVec3| match material.model {
        MODEL_DIRECTIONAL => directed(local, &seen, delta, entry.shading, wi, exponent),
        _ => profile::obliqueness(local, entry.shading.dot(wi), false),
    };
    let light = match keeps_light(inputs, matter, &seen) {
        true => kept_light(inputs, step, local, &entry, triangle),
        false => entering_light(inputs, step, Place::of(inputs, step, index), &entry, value),
    };
    Contribution::of(entry.tint * leaving * factor * light)
}

/// Whether light that enters on the seen side of a surface is kept; in the opaque limit it is not spread.
pub(super) fn keeps_light(inputs: &Inputs, matter: Matter, seen: &Seen) -> bool {
    inputs.features.irradiance == IRRADIANCE_CACHED && seen.side > 0.0 && matter.material.model != MODEL_LAMBERT
}

/// All light that enters, once in a sample.
pub(super) fn kept_light(inputs: &Inputs, step: &Step, local: Matter, entry: &Entry, triangle: u32) -> DVec3 {
    if step.ray_begin == 0 { cached::cached(inputs, local, triangle, entry.weights) } else { DVec3::ZERO }
}

/// What light that leaves is multiplied by: `matter` is that of the surface that is seen, `local` that which it entered.
pub(super) fn leaving(inputs: &Inputs, matter: Matter, local: Matter, seen: &Seen, surface: &Surface) -> DVec3 {
    let weights = surface.barycentric.as_dvec2();
    let share = texture::roughness_share(inputs, surface.triangle, weights);
    let cos = seen.shading_normal.dot(seen.wo);
    tint(inputs, surface.triangle, weights)
        * crossing(inputs, matter.material, cos, share)
        * leaving_share(inputs, matter.material, share)
        * profile::obliqueness(local, cos, true)
        * balance(inputs, local.material, surface)
        * if inputs.mixtures.is_empty() { DVec3::ONE } else { matter.material.exit.as_dvec3() }
}

/// The base colour's texture, which tints what crosses the surface; the factor is in the profile's strength.
pub(super) fn tint(inputs: &Inputs, triangle: u32, barycentric: DVec2) -> DVec3 {
    texture::value(inputs, TEXTURE_BASE_COLOR, triangle, barycentric).truncate()
}

/// The directional dipole's value of light from `wi` that enters at xo + `delta` with the normal `ni`.
fn directed(matter: Matter, seen: &Seen, delta: DVec3, ni: DVec3, wi: DVec3, exponent: f64) -> DVec3 {
    DVec3::from([0, 1, 2].map(|c| {
        let profile = Directional::unpack(matter, c);
        let value = profile.value(-delta, ni, wi, seen.shading_normal, exponent);
        if matter.material.flags & RECIPROCAL == 0 {
            return value;
        }
        (value + profile.value(delta, seen.shading_normal, seen.wo, ni, exponent)) / 2.0
    }))
}

/// From xo to hit `j`.
fn delta(probe: &Probe, hits: &Hits, j: usize) -> DVec3 {
    probe.offset.as_dvec3() + f64::from(hits.t[j]) * probe.direction.as_dvec3()
}

/// The hit that is lit, and its f / p including the weight of the choice; none if no hit weighs anything. `matter` is that of
/// the surface that is seen.
pub fn choose(
    inputs: &Inputs,
    step: &Step,
    index: u32,
    matter: Matter,
    seen: &Seen,
    probe: &Probe,
    hits: &Hits,
) -> Option<(usize, DVec3)> {
    if hits.count == 0 {
        return None;
    }
    let normal = |j: usize| seen.side * geometric_normal(&inputs.triangles[hits.triangle[j] as usize]);
    // The matter as it is where hit j lets light in.
    let local = |j: usize| {
        let triangle = hits.triangle[j];
        let point = seen.position + delta(probe, hits, j);
        let weights = barycentric(&inputs.triangles[triangle as usize], point);
        texture::medium(inputs, mixture::entered(inputs, matter.material, triangle), triangle, weights)
    };
    let members = mixture::members(inputs, matter.material, hits.triangle[0]);
    if inputs.features.projection == PROJECTION_CAMERA {
        let local = local(0);
        let local = Matter { material: &local, ..matter };
        let rate = f64::from(members[0].camera_rate);
        return Some((0, given_factor(local, rate, seen, probe, delta(probe, hits, 0), normal(0))));
    }
    let stored = hits.count.min(MAX_HITS) as usize;
    let terms: Vec<(DVec3, f64)> = (0..stored)
        .map(|j| {
            let delta = delta(probe, hits, j);
            let density = |material| {
                mixture_density(techniques(&inputs.features), Matter { material, ..matter }, seen, delta, normal(j))
            };
            let p = members.iter().map(density).sum::<f64>() / members.len() as f64;
            let local = local(j);
            let local = Matter { material: &local, ..matter };
            // In the opaque limit light leaves nowhere else.
            let limit = local.material.model == MODEL_LAMBERT;
            let strength = if limit { DVec3::ZERO } else { local.material.strength.as_dvec3() };
            let f = strength * shapes(local, delta.length());
            // The directional dipole's own value comes with each ray.
            let value = if local.material.model == MODEL_DIRECTIONAL { DVec3::ONE } else { f };
            if p > 0.0 { (value / p, (f / p).element_sum()) } else { (DVec3::ZERO, 0.0) }
        })
        .collect();
    // One after the other: hit j takes the place of those before it with probability w_j / (w_1 + ... + w_j). What is left
    // of the number in [0, 1), of the share that it fell into, is one again (M. T. Chao, Biometrika 69 (1982)).
    let mut u = coordinate(inputs, step, Place::of(inputs, step, index), DIM_HIT);
    let (mut total, mut chosen) = (0.0, None);
    for (j, (_, w)) in terms.iter().enumerate() {
        total += w;
        let chance = if total > 0.0 { w / total } else { 0.0 };
        if u < chance {
            (chosen, u) = (Some(j), u / chance);
        } else {
            u = (u - chance) / (1.0 - chance);
        }
    }
    let chosen = chosen?;
    let (value, weight) = terms[chosen];
    let lost = (f64::from(hits.count) / f64::from(MAX_HITS)).max(1.0);
    Some((chosen, value * (total / weight) * lost))
}

/// f / p of the method as given.
fn given_factor(matter: Matter, rate: f64, seen: &Seen, probe: &Probe, delta: DVec3, normal: DVec3) -> DVec3 {
    let r = f64::from(probe.radius);
    let d = probe.direction.as_dvec3();
    let jacobian = seen.normal.dot(d).abs() / normal.dot(d).abs() * inverse_scale(seen, delta).powi(2);
    let value = match matter.material.model {
        MODEL_DIRECTIONAL => DVec3::ONE,
        MODEL_LAMBERT => DVec3::ZERO,
        _ => matter.material.strength.as_dvec3() * shapes_shifted(matter, delta.length(), rate * r),
    };
    value * (TAU * r / rate * jacobian)
}

/// A point where light enters.
pub(super) struct Entry<'a> {
    inputs: &'a Inputs<'a>,
    material: &'a Material,
    point: DVec3,
    /// Geometric normal on the camera's side of xo.
    pub normal: DVec3,
    /// Interpolated normal on that side.
    pub shading: DVec3,
    /// Base colour where the light crosses the surface.
    pub tint: DVec3,
    /// Weights of the second and third vertex.
    weights: DVec2,
    /// Share of the material's roughness.
    roughness: f64,
}

impl<'a> Entry<'a> {
    pub fn new(inputs: &'a Inputs<'a>, material: &'a Material, side: f64, point: DVec3, triangle: u32) -> Entry<'a> {
        let shape = &inputs.triangles[triangle as usize];
        let weights = barycentric(shape, point);
        let shading = side * shading_normal(inputs, triangle, weights);
        let tint = tint(inputs, triangle, weights);
        let normal = side * geometric_normal(shape);
        let roughness = texture::roughness_share(inputs, triangle, weights);
        Entry { inputs, material, point, normal, shading, tint, weights, roughness }
    }

    /// Ft(wi) cos; 0 below either horizon.
    fn transmission(&self, wi: DVec3) -> f64 {
        let cos = self.shading.dot(wi);
        if self.normal.dot(wi) > 0.0 && cos > 0.0 {
            crossing(self.inputs, self.material, cos, self.roughness) * cos
        } else {
            0.0
        }
    }
}

/// E: the light of the step's rays that enters.
///
/// `value` is what a direction's light weighs besides.
pub(super) fn entering_light(
    inputs: &Inputs,
    step: &Step,
    place: Place,
    entry: &Entry,
    value: impl Fn(DVec3) -> DVec3,
) -> DVec3 {
    let origin = lifted(entry.point, entry.normal);
    let directions = f64::from(inputs.view.directions);
    let share = emitter::share(inputs, entry.point);
    let ray = |k: u32| -> DVec3 {
        // Most rays need not be traced.
        let entering = |wi: DVec3, light: &dyn Fn() -> DVec3| {
            let transmission = entry.transmission(wi);
            if transmission > 0.0 { transmission * value(wi) * light() } else { DVec3::ZERO }
        };
        if let Some(light) = inputs.lights.get(k as usize) {
            let incident = light::delta(light, entry.point);
            let visible = || visibility(inputs, origin, incident.wi, incident.distance);
            return entering(incident.wi, &|| incident.irradiance * visible());
        }
        let point = |dimension| direction_point(inputs, step, place, k - inputs.view.light_count, dimension);
        let pdf = |wi| (1.0 - share) * direction_pdf(inputs, entry.shading, wi);
        if golden(inputs, step, place, k - inputs.view.light_count, DIM_SOURCE) < share {
            let (u1, u2) = point(DIM_EMITTER);
            let point = emitter::draw(inputs, origin, u1, u2);
            return entering(point.wi, &|| from_emitter(inputs, origin, &point, share, pdf(point.wi)) / directions);
        }
        let (u1, u2) = point(DIM_LIGHT);
        let wi = direction(inputs, entry.shading, u1, u2);
        entering(wi, &|| from_direction(inputs, origin, wi, share, pdf(wi)) / directions)
    };
    (step.ray_begin..step.ray_begin + step.ray_count).map(ray).sum()
}

/// A direction from which light may come: cosine-weighted, or half of that and half of the environment image's.
fn direction(inputs: &Inputs, normal: DVec3, u1: f64, u2: f64) -> DVec3 {
    if inputs.features.environment != ENVIRONMENT_IMAGE {
        cosine_direction(normal, u1, u2)
    } else if u1 < 0.5 {
        light::sample_environment(inputs, 2.0 * u1, u2)
    } else {
        cosine_direction(normal, 2.0 * u1 - 1.0, u2)
    }
}

/// The density of [`direction`].
fn direction_pdf(inputs: &Inputs, normal: DVec3, wi: DVec3) -> f64 {
    let cosine = normal.dot(wi).max(0.0) / PI;
    if inputs.features.environment != ENVIRONMENT_IMAGE {
        return cosine;
    }
    0.5 * light::environment_pdf(inputs, wi) + 0.5 * cosine
}

/// Weights of the second and third vertex of a point in the plane of a triangle.
pub(super) fn barycentric(triangle: &Triangle, point: DVec3) -> DVec2 {
    let [corner, edge1, edge2] = triangle.corner_and_edges();
    let p = point - corner;
    let normal = edge1.cross(edge2);
    let scale = normal.length_squared();
    DVec2::new(p.cross(edge2).dot(normal) / scale, edge1.cross(p).dot(normal) / scale)
}
