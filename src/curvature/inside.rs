//! Distances to the surface of a body from inside, in f32: many rays soon.

use crate::reference::walk::mesh::Corners;
use crate::scene::bvh;
use glam::{DVec3, Vec3A};
use obvhs::{
    aabb::Aabb,
    bvh2::Bvh2,
    ray::{Ray, RayHit},
};

/// The triangles of a body, and their tree.
pub struct Inside {
    tree: Bvh2,
    /// In the order of the tree's leaves.
    facets: Vec<Facet>,
}

struct Facet {
    corner: Vec3A,
    edge1: Vec3A,
    edge2: Vec3A,
}

impl Inside {
    pub fn new(corners: &[Corners]) -> Inside {
        let facet = |triangle: &Corners| {
            let [corner, b, c] = triangle.map(|corner| corner.as_vec3a());
            Facet { corner, edge1: b - corner, edge2: c - corner }
        };
        let boxes: Vec<Aabb> = corners.iter().map(|corners| bvh::bounds(corners.map(|c| c.as_vec3a()))).collect();
        let tree = bvh::binary(&boxes);
        let facets = tree.primitive_indices.iter().map(|&index| facet(&corners[index as usize])).collect();
        Inside { tree, facets }
    }

    /// The distance at which a ray leaves the body next; none up to `limit`. Faces that it would enter by are not there, so
    /// it may start on one.
    pub fn distance(&self, origin: DVec3, direction: DVec3, limit: f64) -> Option<f64> {
        let ray = Ray::new(origin.as_vec3a(), direction.as_vec3a(), 0.0, limit as f32);
        let mut hit = RayHit::none();
        self.tree.ray_traverse(ray, &mut hit, |ray, place| self.facets[place].left(ray));
        (hit.t < limit as f32).then_some(f64::from(hit.t))
    }
}

impl Facet {
    /// T. Möller, B. Trumbore, J. Graphics Tools 2 (1997); infinite where the ray does not leave by it.
    fn left(&self, ray: &Ray) -> f32 {
        let p = ray.direction.cross(self.edge2);
        // Negative where the ray runs as the normal does.
        let determinant = self.edge1.dot(p);
        if determinant >= 0.0 {
            return f32::INFINITY;
        }
        let s = ray.origin - self.corner;
        let q = s.cross(self.edge1);
        let [u, v, t] = [s.dot(p), ray.direction.dot(q), self.edge2.dot(q)].map(|x| x / determinant);
        let within = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0;
        if within { t } else { f32::INFINITY }
    }
}
