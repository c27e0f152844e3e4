//! How points of the tangent plane are carried to the surface, and with which density they arrive there.
//!
//! # Techniques
//! A technique is a plane through xo with a density p_T, and lines that carry its points to the surface. The density per
//! area of the surface at x = xo + D, with normal n_x:
//!
//! - lines parallel to the unit vector a, plane perpendicular to a (A. King et al., "BSSRDF importance sampling",
//!   SIGGRAPH 2013 talks): p_a(x) = p_T(|D - (D.a) a|) |n_x.a|;
//! - lines from the eye at distance l along wo, plane tangent with normal no. A point y of the plane and its image x on
//!   the line span the same solid angle, so dA/dA_tan = (no.-d) / (n_x.-d) |x - e|^2 / |y - e|^2. With
//!   q = |y - e| / |x - e| = 1 / (1 - (D.no) / (l wo.no)):
//!
//!     y - xo = q [D - wo (D.no) / (wo.no)],   p_C(x) = p_T(|y - xo|) |n_x.d| / |no.d| q^2,   d = normalize(D / l - wo),
//!
//!   zero behind the eye (1/q <= 0). 1/l = 0 is an orthographic camera.
//!
//! p_T(r) = sum of b_c shape_c(r) / mass_c over the channels: [`plane_density`].
//!
//! # Combination
//! The normal axis, two tangent axes and the camera are chosen with the fractions a_k, and every point found is divided
//! by p = sum a_k p_k (balance heuristic, E. Veach, L. Guibas, SIGGRAPH 1995, one-sample model). Since |n.N| + |n.U| +
//! |n.V| >= 1, and p_T falls with r, which an axis only shortens, p >= a_min p_T(|D|): a hit weighs at most 1/a_min
//! times what it weighs on a plane, on any surface. Camera rays alone have an unbounded weight at silhouettes (n_x.d =
//! 0), where the fraction a_C goes to 0 smoothly. Fractions depend on xo only.

use super::Inputs;
use super::math::basis;
use super::profile::{Matter, plane_density};
use super::texture;
use crate::shared::{
    CAMERA_FADE, CAMERA_FRACTION, Features, MODEL_TABLE, Material, PROJECTION_CAMERA, PROJECTION_NORMAL,
    REPROJECT_SCREEN, Surface, TANGENT_FRACTION, Triangle,
};
use glam::DVec3;

/// The techniques, in the order in which they are chosen.
pub const NORMAL: usize = 0;
pub const TANGENT_U: usize = 1;
pub const TANGENT_V: usize = 2;
pub const CAMERA: usize = 3;

/// A surface as the camera sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// xo.
    pub position: DVec3,
    /// Unit vector to the eye.
    pub wo: DVec3,
    /// Distance to the eye, or to an orthographic camera's plane.
    pub eye_distance: f64,
    /// 1 / distance to the eye; 0 for an orthographic camera.
    pub inverse_distance: f64,
    /// 1 if the outside faces the camera, else -1.
    pub side: f64,
    /// Geometric normal on the camera's side.
    pub normal: DVec3,
    /// Shading normal on that side; the geometric one where it faces away.
    pub shading_normal: DVec3,
    /// Axes N, U, V: the normal and two tangents.
    pub axes: [DVec3; 3],
}

/// Unit normal of a triangle, out of the matter.
pub fn geometric_normal(triangle: &Triangle) -> DVec3 {
    let [_, edge1, edge2] = triangle.corner_and_edges();
    edge1.cross(edge2).normalize()
}

/// Shading normal of triangle `index`, out of the matter: interpolated between the vertices, then turned by the normal
/// map.
pub fn shading_normal(inputs: &Inputs, index: u32, barycentric: glam::DVec2) -> DVec3 {
    let shading = &inputs.shadings[index as usize];
    let (b1, b2) = (barycentric.x, barycentric.y);
    let sum = shading.normal0.as_dvec3() * (1.0 - b1 - b2)
        + shading.normal1.as_dvec3() * b1
        + shading.normal2.as_dvec3() * b2;
    texture::mapped_normal(inputs, sum.normalize(), index, barycentric)
}

/// What the camera sees of a surface that it hit.
pub fn seen(inputs: &Inputs, surface: &Surface) -> Seen {
    let view = inputs.view;
    let from_pivot = surface.position.as_dvec3() - view.pivot.as_dvec3();
    let forward = view.forward.as_dvec3();
    let perspective = f64::from(view.perspective);
    let to = forward + perspective * from_pivot;
    let wo = -to.normalize();
    let eye_distance =
        if view.perspective > 0.0 { to.length() } else { f64::from(view.reach) + from_pivot.dot(forward) };
    let outward = geometric_normal(&inputs.triangles[surface.triangle as usize]);
    let side = if outward.dot(wo) < 0.0 { -1.0 } else { 1.0 };
    let normal = side * outward;
    let shading = side * shading_normal(inputs, surface.triangle, surface.barycentric.as_dvec2());
    let shading_normal = if shading.dot(wo) > 0.0 { shading } else { normal };
    let (u, v) = basis(normal);
    Seen {
        position: surface.position.as_dvec3(),
        wo,
        eye_distance,
        inverse_distance: perspective / to.length(),
        side,
        normal,
        shading_normal,
        axes: [normal, u, v],
    }
}

/// Material of the surface's triangle.
pub fn material<'a>(inputs: &Inputs<'a>, surface: &Surface) -> &'a Material {
    &inputs.materials[inputs.shadings[surface.triangle as usize].material as usize]
}

/// 1 over the radius of the sphere that the body resembles at the surface; 0 where that is not asked for.
pub fn curvature(inputs: &Inputs, surface: &Surface) -> f64 {
    let number = material(inputs, surface).balance + surface.triangle;
    let Some(balance) = inputs.balances.get(number as usize) else { return 0.0 };
    let [b1, b2] = surface.barycentric.as_dvec2().to_array();
    balance.curvature.as_dvec3().dot(DVec3::new(1.0 - b1 - b2, b1, b2))
}

/// The factor on the profile of a material at the surface that is seen; 1 where profiles do not depend on the curvature.
pub fn balance(inputs: &Inputs, material: &Material, surface: &Surface) -> DVec3 {
    if material.model != MODEL_TABLE || inputs.balances.is_empty() {
        return DVec3::ONE;
    }
    let [a, b, c] = inputs.balances[(material.balance + surface.triangle) as usize].at.map(|at| at.as_dvec3());
    let [b1, b2] = surface.barycentric.as_dvec2().to_array();
    a * (1.0 - b1 - b2) + b * b1 + c * b2
}

/// The material, with what its profile reads.
pub fn matter_at<'a>(inputs: &Inputs<'a>, surface: &Surface) -> Matter<'a> {
    Matter { material: material(inputs, surface), tables: inputs.profiles, curvature: curvature(inputs, surface) }
}

/// The projection whose techniques find points; a G-buffer knows those of the camera alone.
pub fn techniques(features: &Features) -> u32 {
    if features.reproject == REPROJECT_SCREEN { PROJECTION_CAMERA } else { features.projection }
}

/// Fractions of the techniques at a point seen with cosine `cos`.
pub fn fractions(projection: u32, cos: f64) -> [f64; 4] {
    match projection {
        PROJECTION_CAMERA => [0.0, 0.0, 0.0, 1.0],
        PROJECTION_NORMAL => [1.0, 0.0, 0.0, 0.0],
        _ => {
            let s = (cos / f64::from(CAMERA_FADE)).clamp(0.0, 1.0);
            let camera = f64::from(CAMERA_FRACTION) * s * s * (3.0 - 2.0 * s);
            let rest = 1.0 - camera;
            let tangents = f64::from(TANGENT_FRACTION) * rest;
            [rest - tangents, tangents / 2.0, tangents / 2.0, camera]
        }
    }
}

/// 1/q, the camera's rescaling between plane and surface; not positive behind the eye.
pub fn inverse_scale(seen: &Seen, delta: DVec3) -> f64 {
    1.0 - delta.dot(seen.normal) * seen.inverse_distance / seen.wo.dot(seen.normal)
}

/// Density per area at xo + `delta` of one technique, where the surface's normal is `normal`.
pub fn density(technique: usize, matter: Matter, seen: &Seen, delta: DVec3, normal: DVec3) -> f64 {
    if technique != CAMERA {
        let axis = seen.axes[technique];
        let r = (delta - delta.dot(axis) * axis).length();
        return plane_density(matter, r) * normal.dot(axis).abs();
    }
    let k = inverse_scale(seen, delta);
    if k <= 0.0 {
        return 0.0;
    }
    let q = 1.0 / k;
    let r = q * (delta - seen.wo * (delta.dot(seen.normal) / seen.wo.dot(seen.normal))).length();
    let d = (delta * seen.inverse_distance - seen.wo).normalize();
    plane_density(matter, r) * normal.dot(d).abs() / seen.normal.dot(d).abs() * q * q
}

/// Density per area at xo + `delta` of all techniques together.
pub fn mixture_density(projection: u32, matter: Matter, seen: &Seen, delta: DVec3, normal: DVec3) -> f64 {
    let fractions = fractions(projection, seen.normal.dot(seen.wo));
    let part = |(k, a): (usize, f64)| if a > 0.0 { a * density(k, matter, seen, delta, normal) } else { 0.0 };
    fractions.into_iter().enumerate().map(part).sum()
}
