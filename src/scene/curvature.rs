//! How thick a body is at each point of its surface, as the radius of the sphere that is as thick.
//!
//! Rays run inwards from the middle of each triangle, with the density of the cosine to its normal. On a sphere of radius a
//! their mean length is 4 a / 3; in a slab of thickness h it is 2 h, which is taken for a sphere of radius 1.5 h. Rays
//! that meet no surface of their set count as infinitely long: with the share p of such rays
//!
//!   1 / a = (1 - p) 4 / (3 mean length of the others).
//!
//! A vertex has the mean over its triangles, weighted by area.

use super::Scene;
use crate::reference::math::cosine_direction;
use crate::shared::{SHADOW_OFFSET, Triangle};
use glam::{DVec3, Vec3, Vec3A};
use obvhs::cwbvh::{CwBvh, node::CwBvhNode};
use obvhs::ray::{Ray, RayHit};
use rayon::prelude::*;
use std::collections::HashMap;

/// Rays of a triangle.
const RAYS: u32 = 32;
/// Positions closer than this are one vertex [internal units].
const CLOSE: f32 = 1.0 / (1 << 17) as f32;

/// 1/a [1/internal unit] at the three vertices of every triangle whose material `wanted` has; 0 elsewhere.
pub fn curvatures(scene: &Scene, wanted: &[bool]) -> Vec<Vec3> {
    let nodes: &[CwBvhNode] = bytemuck::cast_slice(bytemuck::cast_slice::<_, u32>(&scene.nodes));
    let tree = CwBvh { nodes: nodes.to_vec(), ..CwBvh::default() };
    let of_triangle: Vec<f64> = (0..scene.triangles.len())
        .into_par_iter()
        .map(|i| if wanted[scene.shadings[i].material as usize] { middle(&tree, &scene.triangles, i) } else { 0.0 })
        .collect();
    let place = |t: &Triangle, corner: usize| {
        let p = t.corner + [Vec3::ZERO, t.edge1, t.edge2][corner];
        ((p / CLOSE).round().as_ivec3(), t.set)
    };
    let mut sums: HashMap<_, (f64, f64)> = HashMap::new();
    for (triangle, curvature) in scene.triangles.iter().zip(&of_triangle) {
        let area = f64::from(triangle.edge1.cross(triangle.edge2).length());
        for corner in 0..3 {
            let sum = sums.entry(place(triangle, corner)).or_default();
            *sum = (sum.0 + area * curvature, sum.1 + area);
        }
    }
    let mean = |triangle: &Triangle, corner| {
        let (sum, area) = sums[&place(triangle, corner)];
        if area > 0.0 { (sum / area) as f32 } else { 0.0 }
    };
    scene.triangles.iter().map(|t| Vec3::from([0, 1, 2].map(|corner| mean(t, corner)))).collect()
}

/// 1/a at the middle of a triangle.
fn middle(tree: &CwBvh, triangles: &[Triangle], index: usize) -> f64 {
    let triangle = &triangles[index];
    let normal = triangle.edge1.cross(triangle.edge2).normalize();
    let origin = triangle.corner + (triangle.edge1 + triangle.edge2) / 3.0 - normal * SHADOW_OFFSET;
    let golden = (5f64.sqrt() - 1.0) / 2.0;
    let (mut met, mut sum) = (0, 0.0);
    for i in 0..RAYS {
        let u1 = (f64::from(i) + 0.5) / f64::from(RAYS);
        let direction = cosine_direction(-normal.as_dvec3(), u1, (f64::from(i) * golden).fract());
        if let Some(length) = length(tree, triangles, triangle.set, index, origin, direction) {
            met += 1;
            sum += length;
        }
    }
    if sum > 0.0 { f64::from(met * met) / f64::from(RAYS) * 4.0 / (3.0 * sum) } else { 0.0 }
}

/// Distance to the next surface of the set.
fn length(tree: &CwBvh, triangles: &[Triangle], set: u32, from: usize, origin: Vec3, direction: DVec3) -> Option<f64> {
    let ray = Ray::new(Vec3A::from(origin), direction.as_vec3a(), 0.0, f32::MAX);
    let mut hit = RayHit::none();
    tree.ray_traverse(ray, &mut hit, |ray, i| {
        let other = &triangles[i];
        if other.set != set || i == from {
            return f32::INFINITY;
        }
        meets(other, ray).unwrap_or(f32::INFINITY)
    });
    hit.t.is_finite().then_some(f64::from(hit.t))
}

/// Distance to a triangle (T. Moeller, B. Trumbore, J. Graphics Tools 2 (1997)).
fn meets(triangle: &Triangle, ray: &Ray) -> Option<f32> {
    let (origin, direction) = (Vec3::from(ray.origin), Vec3::from(ray.direction));
    let p = direction.cross(triangle.edge2);
    let determinant = triangle.edge1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let from_corner = origin - triangle.corner;
    let q = from_corner.cross(triangle.edge1);
    let (u, v) = (from_corner.dot(p) / determinant, direction.dot(q) / determinant);
    let t = triangle.edge2.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t < ray.tmax).then_some(t)
}
