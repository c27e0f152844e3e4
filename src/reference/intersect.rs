//! Rays and triangles: brute force over all triangles, so that no acceleration structure is part of the reference; but for
//! integrators on the host, whose shadow rays ask a tree of their own which triangles to look at.
//!
//! S. Woop, C. Benthin, I. Wald, "Watertight ray/triangle intersection", J. Computer Graphics Techniques 2 (2013): let the
//! ray start in the origin, and z be the axis along which it runs most. Seen along the ray a vertex v is at
//!
//!   p(v) = (v_x, v_y) - v_z (d_x, d_y) / d_z,
//!
//! and the ray meets the triangle (a, b, c) where p(b) x p(c), p(c) x p(a) and p(a) x p(b) have one sign, whichever: both
//! faces are hit. They are in proportion to the weights of a, b and c. In any precision the triangles at a vertex have it
//! at the same place, rounding is monotonic, so that a cross product never has the wrong sign, though it may be 0, and an
//! edge's two triangles have opposite ones. On an edge (0) the product counts as positive where the edge rises, in y or
//! else in x, as if the ray were moved a little: then one of the two is hit, and no ray passes between or meets both.
//!
//! The distance is t = n . (a - o) / (n . d), with n = (b - a) x (c - a).

use super::{Inputs, texture, walk::mesh::Mesh};
use crate::shared::Triangle;
use glam::{DVec2, DVec3, Vec3Swizzles};

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

/// A ray's line, made ready for many triangles.
struct Line {
    origin: DVec3,
    direction: DVec3,
    axis: usize,
    slope: DVec2,
}

impl Line {
    fn new(origin: DVec3, direction: DVec3) -> Line {
        let d = direction.abs();
        let axis = if d.x >= d.y.max(d.z) { 0 } else { 1 + usize::from(d.y < d.z) };
        let turned = turned(direction, axis);
        Line { origin, direction, axis, slope: turned.truncate() / turned.z }
    }

    /// Where a point is seen along the line.
    fn along(&self, point: DVec3) -> DVec2 {
        let to = turned(point - self.origin, self.axis);
        to.truncate() - self.slope * to.z
    }

    /// t and the weights of the second and third vertex, wherever the line meets the triangle.
    fn meets(&self, triangle: &Triangle) -> Option<(f64, DVec2)> {
        let vertices = triangle.vertices.map(|vertex| vertex.as_dvec3());
        let [a, b, c] = vertices.map(|vertex| self.along(vertex));
        // Most triangles lie to one side.
        if (a.min(b).min(c).max_element() > 0.0) || (a.max(b).max(c).min_element() < 0.0) {
            return None;
        }
        let areas = DVec3::new(side_of_edge(b, c), side_of_edge(c, a), side_of_edge(a, b));
        if areas.min_element() < 0.0 && areas.max_element() > 0.0 {
            return None;
        }
        let [corner, edge1, edge2] = triangle.corner_and_edges();
        let normal = edge1.cross(edge2);
        let rate = normal.dot(self.direction);
        let barycentric = DVec2::new(areas.y, areas.z) / areas.element_sum();
        (rate != 0.0).then(|| (normal.dot(corner - self.origin) / rate, barycentric))
    }
}

/// Turns an axis to z.
fn turned(v: DVec3, axis: usize) -> DVec3 {
    match axis {
        0 => v.yzx(),
        1 => v.zxy(),
        _ => v,
    }
}

/// What stands for the area of a ray through an edge.
const EDGE: f64 = 1e-36;

/// Twice the area of (0, a, b), never 0.
fn side_of_edge(a: DVec2, b: DVec2) -> f64 {
    let area = a.x * b.y - a.y * b.x;
    let rises = a.y < b.y || a.y == b.y && a.x < b.x;
    match area != 0.0 {
        true => area,
        false if rises => EDGE,
        false => -EDGE,
    }
}

/// Every hit with t in [t_min, t_max] where there is a surface, in the order of the triangles.
pub fn hits(inputs: &Inputs, origin: DVec3, direction: DVec3, t_min: f64, t_max: f64) -> impl Iterator<Item = Hit> {
    let line = Line::new(origin, direction);
    inputs.triangles.iter().enumerate().filter_map(move |(index, triangle)| {
        let (t, barycentric) = line.meets(triangle)?;
        let index = index as u32;
        let hit = t >= t_min && t <= t_max && texture::solid(inputs, index, barycentric);
        hit.then_some(Hit { t, triangle: index, barycentric })
    })
}

/// The hit with the smallest t.
pub fn closest(inputs: &Inputs, origin: DVec3, direction: DVec3, t_min: f64, t_max: f64) -> Option<Hit> {
    if let Some(tree) = inputs.tree.filter(|_| t_min >= 0.0) {
        return found(inputs, tree, origin, direction, (t_min, t_max), |hit| hit.t);
    }
    hits(inputs, origin, direction, t_min, t_max).min_by(|a, b| a.t.total_cmp(&b.t))
}

/// Whether anything is hit.
pub fn any(inputs: &Inputs, origin: DVec3, direction: DVec3, t_min: f64, t_max: f64) -> bool {
    if let Some(tree) = inputs.tree.filter(|_| t_min >= 0.0) {
        return found(inputs, tree, origin, direction, (t_min, t_max), |_| f64::NEG_INFINITY).is_some();
    }
    hits(inputs, origin, direction, t_min, t_max).next().is_some()
}

/// The last hit found in `range` of those that come before the `limit` that the one before left.
fn found(
    inputs: &Inputs,
    tree: &Mesh,
    origin: DVec3,
    direction: DVec3,
    (t_min, t_max): (f64, f64),
    limit: impl Fn(&Hit) -> f64,
) -> Option<Hit> {
    let line = Line::new(origin, direction);
    let (mut last, mut end) = (None, t_max);
    tree.candidates(origin, direction, t_max, |index| {
        let triangle = index as u32;
        if let Some((t, barycentric)) = line.meets(&inputs.triangles[index])
            && (t_min..=end).contains(&t)
            && texture::solid(inputs, triangle, barycentric)
        {
            let hit = Hit { t, triangle, barycentric };
            (last, end) = (Some(hit), limit(&hit));
        }
        end
    });
    last
}
