//! Light that was scattered once on its way to the camera: twin of `single.comp` and `phase.glsl`.
//!
//! # Light
//! Diffusion describes light that was scattered often; of the models, the standard and the better dipole leave out what
//! was scattered once (`is_missing`). In matter with the extinction sigma_t = sigma_a + sigma_s, sigma_s = sigma_s' /
//! (1 - g), neither reduced, behind a smooth surface with the index of refraction n inside over outside (S. Chandrasekhar,
//! "Radiative Transfer", 1950; H. W. Jensen, S. R. Marschner, M. Levoy, P. Hanrahan, SIGGRAPH 2001, section 2.2):
//!
//!   L1(xo, wo) = Ft(wo) / n^2 int_0^T sigma_s e^(-sigma_t s) int p(w'i . d) Li' dw'i ds,
//!
//! s along the refracted camera ray d up to the other side of the matter at T; Li' is light inside. That of a beam
//! outside, of perpendicular irradiance E from wi at a surface point xi with normal n_i, is, with cosines c = wi . n_i and
//! c' = w'i . n_i of the refracted direction, and the distance s_i in the matter,
//!
//!   E' = E Ft(wi) c / c' e^(-sigma_t s_i).
//!
//! (Jensen et al. leave out c / (n^2 c'), which flux through the surface and radiance in denser matter ask for.)
//!
//! On a half-space with parallel light, mu cosines outside and mu' those of the refracted directions,
//!
//!   L1 = alpha p E Ft(wi) Ft(wo) / n^2 * mu_i / (mu'_i + mu'_o),
//!
//! at n = 1 with p = 1 / (4 pi) the law of Lommel and Seeliger.
//!
//! # Straight lines
//! A light is connected with the point P = xo + s d by a straight line, which meets the surface at xi. The way in the
//! matter is then s_i c / c', if s_i is that along the straight line (Jensen et al.), while w'i in the phase function is
//! refracted as at a smooth surface, whatever its roughness. That is exact on a plane in parallel light, and on every surface at n = 1; elsewhere an approximation, which
//! has no caustics. The irradiance E is that at P without the surface. Fresnel, cosines and refraction take the shading
//! normal, at xo the geometric one if else the ray would not enter. P and the way to it are of the matter at xo, also in a
//! set of several materials, where only the boundary is that of xi; a set ends at its own surfaces, whichever way they are
//! wound; other objects block light outside.
//!
//! # Estimator
//! s has the density of the mean over channels that scatter of sigma_t e^(-sigma_t s) / (1 - e^(-sigma_t T)) (balance
//! heuristic), so that the quotient is at most 1 / (probability of the channel). Delta lights are summed; directions of
//! the environment are drawn half from its image, half as the phase function scatters, refracted at the plane of the
//! normal at xo where they go up (where n > 1: below 1 that would leave directions out). Emitters are found by their own
//! points and by these directions, as in [`emitter`].
//!
//! # Phase function
//! L. G. Henyey, J. L. Greenstein, Astrophys. J. 93 (1941): p = (1 - g^2) / (4 pi (1 + g^2 - 2 g cos)^(3/2)). With the
//! distribution function inverted, 1 - cos = (1 - g) (1 - u) / b ((1 - g)(1 + g) / b + 1 - g), b = 1 - g + 2 g u; for
//! g < 0, |g| and the opposite direction.

use super::accumulate::{lifted, tint, visibility};
use super::light::{self, FAR};
use super::math::from_local;
use super::pixel::position;
use super::projection::{geometric_normal, material, seen, shading_normal};
use super::random::{batch, key, scramble, unit};
use super::rough::crossing;
use super::sums::Contribution;
use super::texture;
use super::tile::{Place, direction_point, golden};
use super::{Inputs, emitter, intersect, mixture};
use crate::shared::{
    DIM_SINGLE, DIM_SINGLE_EMITTER, DIM_SINGLE_LIGHT, DIM_SINGLE_SOURCE, EMITTER_REACH, ENVIRONMENT_IMAGE, MISS,
    Material, SHADOW_OFFSET, Step, Surface, Triangle,
};
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// Extinction, scattering and mean cosine of the phase function, per channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scattering {
    /// sigma_t [1/length].
    pub extinction: DVec3,
    /// sigma_s [1/length].
    pub scattering: DVec3,
    /// -G_MAX to G_MAX.
    pub g: DVec3,
}

/// Largest |g|: beyond it, sigma_s' is kept with this g, and f32 would lose the peak.
pub const G_MAX: f64 = 0.999;

impl Scattering {
    /// From sigma_s', sigma_a [1/length] and the mean cosine, in (-1, 1).
    pub fn new(sigma_s_prime: DVec3, sigma_a: DVec3, g: DVec3) -> Scattering {
        let g = g.clamp(DVec3::splat(-G_MAX), DVec3::splat(G_MAX));
        let scattering = sigma_s_prime / (1.0 - g);
        Scattering { extinction: scattering + sigma_a, scattering, g }
    }
}

/// Density per solid angle of the scattered direction at the cosine `cos` to the old one.
pub fn phase(g: f64, cos: f64) -> f64 {
    (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * cos).powf(1.5))
}

/// A direction with the density [`phase`] about the unit vector `d`.
pub(crate) fn draw_phase(g: f64, d: DVec3, u: (f64, f64)) -> DVec3 {
    let k = 1.0 - g.abs();
    let below = k + 2.0 * g.abs() * u.0;
    let t = k * (1.0 - u.0) / below * (k * (1.0 + g.abs()) / below + k);
    let (sin, cos) = (TAU * u.1).sin_cos();
    let r = (t * (2.0 - t)).max(0.0).sqrt();
    from_local(if g < 0.0 { -d } else { d }, DVec3::new(r * cos, r * sin, 1.0 - t))
}

/// The direction that `w` (unit, above the normal) has inside, on the same side; none beyond the critical angle.
pub fn refracted(w: DVec3, normal: DVec3, ior: f64) -> Option<DVec3> {
    let c = w.dot(normal);
    let cos2 = 1.0 - (1.0 - c * c).max(0.0) / (ior * ior);
    (cos2 > 0.0).then(|| (w - c * normal) / ior + cos2.sqrt() * normal)
}

/// Probability of each channel: those that scatter, equally.
fn chances(material: &Material) -> [f64; 3] {
    let scatters = material.scattering.to_array().map(|scattering| f64::from(u32::from(scattering > 0.0)));
    scatters.map(|scatters_too| scatters_too / scatters.iter().sum::<f64>())
}

/// Directions about the refracted camera ray `d`, where `normal` is that of its surface.
struct Directions<'a> {
    material: &'a Material,
    d: DVec3,
    normal: DVec3,
}

impl Directions<'_> {
    fn ior(&self) -> f64 {
        f64::from(self.material.ior)
    }

    fn density(&self, w: DVec3) -> f64 {
        let c = w.dot(self.normal);
        let (inner, spread) = match refracted(w, self.normal, self.ior()) {
            Some(inner) if c > 0.0 && self.ior() > 1.0 => {
                (inner, c / (self.ior() * self.ior() * inner.dot(self.normal)))
            }
            _ => (w, 1.0),
        };
        let chances = chances(self.material);
        spread * (0..3).map(|i| chances[i] * phase(self.material.g[i].into(), inner.dot(self.d))).sum::<f64>()
    }

    /// None if total reflection keeps it inside.
    fn draw(&self, u: (f64, f64)) -> Option<DVec3> {
        let (channel, rest) = choose(&chances(self.material), u.0);
        let inner = draw_phase(self.material.g[channel].into(), self.d, (rest, u.1));
        let c = inner.dot(self.normal);
        if c <= 0.0 || self.ior() <= 1.0 {
            return Some(inner);
        }
        let along = self.ior() * (inner - c * self.normal);
        let cos2 = 1.0 - along.length_squared();
        (cos2 > 0.0).then(|| along + cos2.sqrt() * self.normal)
    }
}

/// Which of some probabilities u picks, and u within it.
fn choose(chances: &[f64; 3], u: f64) -> (usize, f64) {
    let edges = [0.0, chances[0], chances[0] + chances[1]];
    let picked = if u < edges[1] {
        0
    } else if u < edges[2] {
        1
    } else {
        2
    };
    (picked, (u - edges[picked]) / chances[picked])
}

/// Light scattered once, from the step's lights, at pixel `index` of the band with the first surface `surface`.
pub fn single(inputs: &Inputs, step: &Step, index: u32, surface: &Surface) -> Contribution {
    if surface.triangle == MISS {
        return Contribution::default();
    }
    let material = material(inputs, surface);
    if material.scattering == glam::Vec3::ZERO {
        return Contribution::default();
    }
    let seen = seen(inputs, surface);
    let ior = f64::from(material.ior);
    let inward = |normal: DVec3| refracted(seen.wo, normal, ior).map(|w| (normal, -w));
    let entered = inward(seen.shading_normal).filter(|(_, d)| d.dot(seen.normal) < 0.0).or(inward(seen.normal));
    let Some((normal, d)) = entered else { return Contribution::default() };
    let own = inputs.triangles[surface.triangle as usize].set;
    let nearest = |origin: DVec3, direction: DVec3, t_min: f64, t_max: f64| {
        intersect::hits(inputs, origin, direction, t_min, t_max)
            .filter(|hit| inputs.triangles[hit.triangle as usize].set == own)
            .min_by(|a, b| a.t.total_cmp(&b.t))
    };

    // The point.
    let offset = f64::from(SHADOW_OFFSET);
    let end = nearest(seen.position - offset * seen.normal, d, 0.0, FAR).map_or(FAR, |hit| hit.t);
    let (extinction, scattering) = (material.extinction.as_dvec3(), material.scattering.as_dvec3());
    let (px, py) = position(inputs.view, step, index);
    let coordinate = |k: u32| {
        let key = key(inputs.view.seed, px, py, batch(step.sample_index), DIM_SINGLE + k);
        unit(scramble(step.point[k as usize], key))
    };
    let chances = chances(material);
    let (channel, _) = choose(&chances, coordinate(0));
    let within = extinction.to_array().map(|sigma| -(-sigma * end).exp_m1());
    let depth = (-(-coordinate(1) * within[channel]).ln_1p() / extinction[channel]).min(end);
    let point = seen.position + depth * d;

    let directions = Directions { material, d, normal };
    let each = f64::from(inputs.view.directions);
    // The part that arrives of light towards which `wi` points, whose source is `distance` away; and where it crosses the
    // surface.
    let passage = |wi: DVec3, distance: f64, source: u32| -> Option<(DVec3, DVec3, f64)> {
        let hit = nearest(point, wi, -offset, distance).filter(|hit| hit.triangle != source)?;
        let triangle = &inputs.triangles[hit.triangle as usize];
        let outward = geometric_normal(triangle);
        let side = if outward.dot(wi) < 0.0 { -1.0 } else { 1.0 };
        let shading = side * shading_normal(inputs, hit.triangle, hit.barycentric);
        let c = shading.dot(wi);
        let inner = refracted(wi, shading, ior).filter(|_| c > 0.0)?;
        let cos_inside = inner.dot(shading);
        let along =
            if hit.triangle == surface.triangle { -depth * d.dot(outward) / wi.dot(outward) } else { hit.t.max(0.0) };
        let entered = mixture::entered(inputs, material, hit.triangle);
        let roughness = texture::roughness_share(inputs, hit.triangle, hit.barycentric);
        let flux = crossing(inputs, entered, c, roughness) * c / cos_inside / (ior * ior);
        let channel = |i: usize| {
            // sigma_s p e^(-sigma_t (depth + way)) over the density of the depth, all exponents together.
            let density = |k: usize| {
                let exponent = (extinction[i] - extinction[k]) * depth + extinction[i] * along * c / cos_inside;
                if chances[k] > 0.0 { chances[k] * extinction[k] / within[k] * exponent.exp() } else { 0.0 }
            };
            let density: f64 = (0..3).map(density).sum();
            scattering[i] * phase(material.g[i].into(), inner.dot(d)) / density
        };
        let part = tint(inputs, hit.triangle, hit.barycentric) * flux * DVec3::from([0, 1, 2].map(channel));
        Some((part, lifted(on_triangle(triangle, hit.barycentric), side * outward), along))
    };
    let share = emitter::share(inputs, point);
    let lit = |k: u32| -> Option<DVec3> {
        if let Some(light) = inputs.lights.get(k as usize) {
            let incident = light::delta(light, point);
            let (part, exit, along) = passage(incident.wi, incident.distance, MISS)?;
            return Some(part * incident.irradiance * visibility(inputs, exit, incident.wi, incident.distance - along));
        }
        let place = Place::alone(position(inputs.view, step, index));
        let numbers = |dimension| direction_point(inputs, step, place, k - inputs.view.light_count, dimension);
        let pdf = |wi| (1.0 - share) * direction_pdf(inputs, &directions, wi);
        if golden(inputs, step, place, k - inputs.view.light_count, DIM_SINGLE_SOURCE) < share {
            let (u1, u2) = numbers(DIM_SINGLE_EMITTER);
            let drawn = emitter::draw(inputs, point, u1, u2);
            let reach = drawn.distance * f64::from(EMITTER_REACH);
            let (part, exit, along) = passage(drawn.wi, reach, drawn.triangle)?;
            let hit = intersect::closest(inputs, exit, drawn.wi, 0.0, reach - along);
            let hidden = hit.is_some_and(|hit| hit.triangle != drawn.triangle) || !drawn.density.is_finite();
            let density = share * drawn.density + pdf(drawn.wi);
            return (!hidden).then(|| part * drawn.radiance / (density * each));
        }
        let wi = direction(inputs, &directions, numbers(DIM_SINGLE_LIGHT))?;
        let pdf = pdf(wi);
        let (part, exit, along) = passage(wi, FAR, MISS)?;
        let radiance = match intersect::closest(inputs, exit, wi, 0.0, FAR) {
            None => light::environment(inputs, wi) / pdf,
            Some(hit) if inputs.features.emitters != 0 => {
                let emitted = emitter::radiance(inputs, hit.triangle, hit.barycentric, wi);
                emitted / (share * emitter::density(inputs, hit.triangle, wi, along + hit.t) + pdf)
            }
            Some(_) => DVec3::ZERO,
        };
        Some(part * radiance / each)
    };
    let light: DVec3 = (step.ray_begin..step.ray_begin + step.ray_count).filter_map(lit).sum();
    let barycentric = surface.barycentric.as_dvec2();
    let roughness = texture::roughness_share(inputs, surface.triangle, barycentric);
    let leaving = crossing(inputs, material, normal.dot(seen.wo), roughness);
    Contribution::of(leaving * tint(inputs, surface.triangle, barycentric) * light)
}

fn on_triangle(triangle: &Triangle, barycentric: DVec2) -> DVec3 {
    let [corner, edge1, edge2] = triangle.corner_and_edges();
    corner + barycentric.x * edge1 + barycentric.y * edge2
}

/// A direction from two numbers: half from the image of the environment, if there is one.
fn direction(inputs: &Inputs, directions: &Directions, u: (f64, f64)) -> Option<DVec3> {
    if inputs.features.environment != ENVIRONMENT_IMAGE {
        return directions.draw(u);
    }
    if u.0 < 0.5 {
        return Some(light::sample_environment(inputs, 2.0 * u.0, u.1));
    }
    directions.draw((2.0 * u.0 - 1.0, u.1))
}

/// Its density.
fn direction_pdf(inputs: &Inputs, directions: &Directions, wi: DVec3) -> f64 {
    if inputs.features.environment != ENVIRONMENT_IMAGE {
        return directions.density(wi);
    }
    0.5 * light::environment_pdf(inputs, wi) + 0.5 * directions.density(wi)
}
