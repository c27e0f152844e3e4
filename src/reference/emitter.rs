//! Emissive triangles as lights: draws of their points, and the density of those. Twin of `emitter.glsl`.
//!
//! # Density
//! A triangle k of area A_k is chosen with the probability P_k in proportion to its power, A_k times the sum of its
//! radiance over the channels, and a point uniformly on it. Per solid angle at a position x that sees the point at the
//! distance d, where its normal has the cosine c to the ray, the density is
//!
//!   p_E = P_k / A_k d^2 / |c|                             (M. Pharr, W. Jakob, G. Humphreys, 3rd ed., section 14.2.2).
//!
//! P_k is what the table really does: its entries and the random numbers are multiples of 2^-24. A triangle whose power
//! rounds to nothing there is not drawn, P_k = 0.
//!
//! # Combination
//! Points of emitters are drawn, n_E of them in the mean, and n_D directions, with the density p_D of the cosine, the
//! reflection or the environment image. Light L of an emitter counts with both, divided by the sum of both (balance
//! heuristic; E. Veach, L. Guibas, SIGGRAPH 1995):
//!
//!   L / (n_E p_E + n_D p_D) for each point that x sees, and for each direction in which the first surface is an emitter.
//!
//! So no weight has a pole, neither where an emitter touches the surface (p_E -> 0 at fixed solid angle) nor where it
//! is small and far. Directions that meet nothing are the environment's, L / (n_D p_D); those that meet other matter have
//! no light.
//!
//! Where light is reflected, n_E = n_D = N: a narrow lobe needs directions, a small lamp points. Where it enters matter,
//! each of N rays is one or the other: a point with the probability q of [`share`], so that n_E = q N and n_D = (1 - q) N.
//!
//! # What emits
//! Radiance is the same in all directions of the side from which the vertices run counter-clockwise, and of both sides
//! where the material is two-sided. The camera sees it so too.

use super::projection::geometric_normal;
use super::{Inputs, texture};
use crate::shared::{ENVIRONMENT_NONE, Emitter, Material, Shading, TWO_SIDED, Triangle};
use glam::{DVec2, DVec3, Vec3};

/// Probabilities are multiples of its inverse.
const STEPS: f64 = (1 << 24) as f64;

/// The triangles that emit, with the probabilities of their draw.
pub fn table(triangles: &[Triangle], shadings: &[Shading], materials: &[Material]) -> Vec<Emitter> {
    let power = |index: usize| {
        let radiance = materials[shadings[index].material as usize].emission.as_dvec3().element_sum();
        if radiance > 0.0 { radiance * area(&triangles[index]) } else { 0.0 }
    };
    let total: f64 = (0..triangles.len()).map(power).sum();
    let mut emitters = vec![];
    let (mut sum, mut last) = (0.0, 0.0);
    if total > 0.0 {
        for (index, triangle) in triangles.iter().enumerate() {
            sum += power(index);
            let next = (sum / total * STEPS).round();
            if next > last {
                let density = (next - last) / STEPS / area(triangle);
                let cumulative = [last, next].map(|step: f64| (step / STEPS) as f32);
                emitters.push(Emitter { triangle: index as u32, density: density as f32, cumulative });
                last = next;
            }
        }
    }
    emitters
}

/// Centre and squared radius of a ball around the triangles that emit.
pub fn ball(triangles: &[Triangle], emitters: &[Emitter]) -> (Vec3, f32) {
    let corners = || emitters.iter().flat_map(|emitter| triangles[emitter.triangle as usize].vertices);
    let box_of = |[low, high]: [Vec3; 2], corner: Vec3| [low.min(corner), high.max(corner)];
    let Some([low, high]) = corners().map(|corner| [corner; 2]).reduce(|all, [corner, _]| box_of(all, corner)) else {
        return (Vec3::ZERO, 0.0);
    };
    let centre = low.midpoint(high);
    (centre, corners().map(|corner| corner.distance_squared(centre)).fold(0.0, f32::max))
}

/// The probability q that a ray from `x` goes to a point of an emitter. Any q in (0, 1] leaves the expectation as it is,
/// and 1 too, for points reach all emitters, if nothing else shines. Then it is 1 - min(1, (R / d)^4) / 2, with the radius R
/// of a ball around all emitters and the distance d of its centre: far from them points are as good as can be, near them
/// 1 / d^2 varies. Beside an environment it is 1/2.
pub fn share(inputs: &Inputs, x: DVec3) -> f64 {
    if inputs.features.emitters == 0 {
        return 0.0;
    }
    if inputs.features.environment != ENVIRONMENT_NONE {
        return 0.5;
    }
    let ratio = f64::from(inputs.view.emitters_radius2) / x.distance_squared(inputs.view.emitters_centre.as_dvec3());
    1.0 - 0.5 * ratio.powi(2).min(1.0)
}

fn area(triangle: &Triangle) -> f64 {
    let [_, edge1, edge2] = triangle.corner_and_edges();
    edge1.cross(edge2).length() / 2.0
}

/// A point of an emitter as a position sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Unit vector to it.
    pub wi: DVec3,
    pub distance: f64,
    pub triangle: u32,
    /// Radiance that it sends to the position.
    pub radiance: DVec3,
    /// p_E.
    pub density: f64,
}

/// The point that two numbers in [0, 1) pick, seen from `x`.
pub fn draw(inputs: &Inputs, x: DVec3, u1: f64, u2: f64) -> Point {
    let chosen = inputs.emitters.partition_point(|emitter| f64::from(emitter.cumulative[1]) <= u1);
    let Emitter { triangle, cumulative, .. } = inputs.emitters[chosen];
    let [low, high] = cumulative.map(f64::from);
    // The middle of the interval for which u1 stands.
    let s = ((u1 + 0.5 / STEPS - low) / (high - low)).sqrt();
    let barycentric = DVec2::new(s * (1.0 - u2), s * u2);
    let shape = &inputs.triangles[triangle as usize];
    let [corner, edge1, edge2] = shape.corner_and_edges();
    let to = corner + barycentric.x * edge1 + barycentric.y * edge2 - x;
    let (wi, distance) = (to.normalize(), to.length());
    let radiance = radiance(inputs, triangle, barycentric, wi);
    Point { wi, distance, triangle, radiance, density: density(inputs, triangle, wi, distance) }
}

/// Radiance that a triangle sends against the unit vector `wi`, at the weights of its second and third vertex. Textures
/// count here; the power by which triangles are drawn is that of the material's factor alone.
pub fn radiance(inputs: &Inputs, triangle: u32, barycentric: DVec2, wi: DVec3) -> DVec3 {
    let material = &inputs.materials[inputs.shadings[triangle as usize].material as usize];
    let back = geometric_normal(&inputs.triangles[triangle as usize]).dot(wi) > 0.0;
    if back && material.flags & TWO_SIDED == 0 || !texture::solid(inputs, triangle, barycentric) {
        return DVec3::ZERO;
    }
    texture::surface(inputs, material, triangle, barycentric).emission.as_dvec3()
}

/// p_E of a point of `triangle` in the direction `wi` at `distance`.
pub fn density(inputs: &Inputs, triangle: u32, wi: DVec3, distance: f64) -> f64 {
    let cosine = geometric_normal(&inputs.triangles[triangle as usize]).dot(wi).abs();
    let found = inputs.emitters.binary_search_by_key(&triangle, |emitter| emitter.triangle);
    let per_area = found.map_or(0.0, |k| f64::from(inputs.emitters[k].density));
    per_area * distance * distance / cosine
}
