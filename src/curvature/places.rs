//! Where on a body that is looked at which varies slowly along it, and what its vertices get of that.

use super::GRID;
use crate::reference::walk::mesh::Corners;
use glam::{DVec3, I64Vec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// Triangles up to which each is looked at in three points; beyond, their neighbours are near.
const FEW: usize = 1 << 10;
/// Triangles up to which each is looked at in one point; beyond, one of those is that lie in a cube of a grid.
const MANY: usize = 1 << 14;
/// Faces of the grid's cubes that would cover the body.
const FACES: f64 = 4096.0;
/// Radius over a cube's edge within which vertices get the mean of what was found.
const REACH: f64 = 1.5;

fn area([a, b, c]: &Corners) -> f64 {
    (*b - *a).cross(*c - *a).length() / 2.0
}

/// A point of a triangle.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    pub triangle: usize,
    pub point: DVec3,
    /// Unit vector, out of the body.
    pub normal: DVec3,
    /// Weights of the triangle's vertices.
    pub weights: DVec3,
}

/// Three points of each triangle, one of each, or, of a fine mesh, one in each cube of a grid and for each axis that
/// surfaces there face most.
pub struct Places<'a> {
    corners: &'a [Corners],
    pub all: Vec<Place>,
    /// Of a fine mesh, how far a place counts.
    reach: Option<f64>,
}

impl<'a> Places<'a> {
    pub fn new(corners: &'a [Corners]) -> Places<'a> {
        let all = (0..corners.len()).into_par_iter();
        let third = DVec3::splat(1.0 / 3.0);
        if corners.len() <= FEW {
            let of = |triangle| DVec3::AXES.map(|axis| Place::new(corners, triangle, (third + axis) / 2.0));
            return Places { corners, all: all.flat_map_iter(of).collect(), reach: None };
        }
        let middles: Vec<Place> = all.map(|triangle| Place::new(corners, triangle, third)).collect();
        if corners.len() <= MANY {
            return Places { corners, all: middles, reach: None };
        }
        let edge = (corners.iter().map(area).sum::<f64>() / FACES).sqrt();
        let mut cubes: HashMap<_, (usize, f64)> = HashMap::new();
        for (triangle, place) in middles.iter().enumerate() {
            let cube = (place.point / edge).floor();
            // The triangle nearest to the cube's centre stands for all.
            let off = (place.point / edge - cube).distance_squared(DVec3::splat(0.5));
            let axis = place.normal.abs().max_position();
            let nearest = cubes.entry((cube.as_i64vec3(), axis, place.normal[axis] > 0.0)).or_insert((triangle, off));
            if off < nearest.1 {
                *nearest = (triangle, off);
            }
        }
        let mut chosen: Vec<usize> = cubes.into_values().map(|(triangle, _)| triangle).collect();
        chosen.sort_unstable();
        let all = chosen.into_iter().map(|triangle| middles[triangle]).collect();
        Places { corners, all, reach: Some(REACH * edge) }
    }

    /// What was found at the places, at the three vertices of each triangle: the mean over the triangles around a vertex
    /// by area, or over the places near it by distance and normal.
    pub fn at_vertices(&self, found: &[DVec3]) -> Vec<[DVec3; 3]> {
        let mut vertices = Vertices::default();
        match self.reach {
            None => {
                let each = self.all.len() / self.corners.len();
                for (triangle, corners) in self.corners.iter().enumerate() {
                    for (k, corner) in corners.iter().enumerate() {
                        vertices.add(*corner, found[each * triangle + k % each], area(corners));
                    }
                }
            }
            Some(reach) => {
                for corners in self.corners {
                    let [a, b, c] = *corners;
                    corners.iter().for_each(|corner| vertices.add(*corner, (b - a).cross(c - a), 1.0));
                }
                let near = Near::new(&self.all, reach);
                let mean = |(key, (normals, weight, point)): (&I64Vec3, &(DVec3, f64, DVec3))| {
                    let normal = (normals / weight).normalize_or_zero();
                    (*key, (near.mean(found, *point, normal), 1.0, *point))
                };
                vertices = Vertices(vertices.0.par_iter().map(mean).collect());
            }
        }
        self.corners.iter().map(|corners| corners.map(|corner| vertices.mean(corner))).collect()
    }
}

impl Place {
    fn new(corners: &[Corners], triangle: usize, weights: DVec3) -> Place {
        let [a, b, c] = corners[triangle];
        let normal = (b - a).cross(c - a).normalize();
        Place { triangle, point: weights.x * a + weights.y * b + weights.z * c, normal, weights }
    }
}

/// Weighted sums, weights and places of vertices.
#[derive(Default)]
struct Vertices(HashMap<I64Vec3, (DVec3, f64, DVec3)>);

impl Vertices {
    fn key(corner: DVec3) -> I64Vec3 {
        (corner * GRID).round().as_i64vec3()
    }

    fn add(&mut self, corner: DVec3, value: DVec3, weight: f64) {
        let (sum, weights, _) = self.0.entry(Vertices::key(corner)).or_insert((DVec3::ZERO, 0.0, corner));
        (*sum, *weights) = (*sum + weight * value, *weights + weight);
    }

    fn mean(&self, corner: DVec3) -> DVec3 {
        let (sum, weight, _) = self.0[&Vertices::key(corner)];
        sum / weight
    }
}

/// Finds places.
struct Near<'a> {
    places: &'a [Place],
    reach: f64,
    cells: HashMap<I64Vec3, Vec<usize>>,
}

impl<'a> Near<'a> {
    fn new(places: &'a [Place], reach: f64) -> Near<'a> {
        let mut cells: HashMap<I64Vec3, Vec<usize>> = HashMap::new();
        for (index, place) in places.iter().enumerate() {
            cells.entry((place.point / reach).floor().as_i64vec3()).or_default().push(index);
        }
        Near { places, reach, cells }
    }

    /// The mean of the values at the places around a point: smooth, and of those that face as the point does.
    fn mean(&self, values: &[DVec3], point: DVec3, normal: DVec3) -> DVec3 {
        let centre = (point / self.reach).floor().as_i64vec3();
        let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
        for step in 0..27 {
            let cell = centre + I64Vec3::new(step % 3 - 1, step / 3 % 3 - 1, step / 9 - 1);
            for &index in self.cells.get(&cell).into_iter().flatten() {
                let place = &self.places[index];
                let squared = place.point.distance_squared(point) / (self.reach * self.reach);
                let facing = place.normal.dot(normal).max(0.0);
                let weight = (1.0 - squared).max(0.0).powi(2) * facing * facing;
                (sum, weights) = (sum + weight * values[index], weights + weight);
            }
        }
        if weights > 0.0 {
            return sum / weights;
        }
        // A vertex of large triangles alone, or of a fold.
        let distance = |&index: &usize| self.places[index].point.distance_squared(point);
        let nearest = (0..self.places.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        values[nearest.expect("a mesh has places")]
    }
}
