//! Rays and triangles: brute force over all triangles, so that no acceleration structure is part of the reference.
//!
//! T. Möller, B. Trumbore, "Fast, minimum storage ray-triangle intersection", J. Graphics Tools 2 (1997): with the
//! origin o = corner + u edge1 + v edge2 - t d, Cramer's rule gives t, u and v. Both faces of a triangle are hit.

use super::{Inputs, texture};
use crate::shared::Triangle;
use glam::{DVec2, DVec3};

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray in units of its direction.
    pub t: f64,
    /// Index of the triangle.
    pub triangle: u32,
    /// Weights of the second and third vertex.
    pub barycentric: DVec2,
}

/// t and the weights of the second and third vertex, wherever the line meets the triangle.
pub fn line(triangle: &Triangle, origin: DVec3, direction: DVec3) -> Option<(f64, DVec2)> {
    let (edge1, edge2) = (triangle.edge1.as_dvec3(), triangle.edge2.as_dvec3());
    let p = direction.cross(edge2);
    let determinant = edge1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = origin - triangle.corner.as_dvec3();
    let u = s.dot(p) / determinant;
    let q = s.cross(edge1);
    let v = direction.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| (edge2.dot(q) / determinant, DVec2::new(u, v)))
}

/// Every hit with t in [t_min, t_max] where there is a surface, in the order of the triangles.
pub fn hits(inputs: &Inputs, origin: DVec3, direction: DVec3, t_min: f64, t_max: f64) -> impl Iterator<Item = Hit> {
    inputs.triangles.iter().enumerate().filter_map(move |(index, triangle)| {
        let (t, barycentric) = line(triangle, origin, direction)?;
        let index = index as u32;
        let hit = t >= t_min && t <= t_max && texture::solid(inputs, index, barycentric);
        hit.then_some(Hit { t, triangle: index, barycentric })
    })
}

/// The hit with the smallest t.
pub fn closest(inputs: &Inputs, origin: DVec3, direction: DVec3, t_min: f64, t_max: f64) -> Option<Hit> {
    hits(inputs, origin, direction, t_min, t_max).min_by(|a, b| a.t.total_cmp(&b.t))
}

/// Whether anything is hit.
pub fn any(inputs: &Inputs, origin: DVec3, direction: DVec3, t_min: f64, t_max: f64) -> bool {
    hits(inputs, origin, direction, t_min, t_max).next().is_some()
}
