//! Light kept on surfaces: where its points are, and where more of them are needed.
//!
//! Light that enters is kept at the vertices, by all triangles around one that shade it alike, and on a lattice in each
//! triangle that is larger than the distance between points (C. Yuksel, J. Keyser, D. H. House, "Mesh colors", ACM TOG 29
//! (2010)). Between them it is interpolated ([`reference::cached`](crate::reference::cached)). The lattice of a triangle is
//! made twice as fine, and again, while its light differs between neighbours.

use crate::{
    reference::cached::number,
    scene::Scene,
    shared::{Cluster, Coordinates, Lattice, Shading, Triangle},
};
use glam::{DVec3, Vec3, vec2};
use std::collections::HashMap;

/// Distance between points at the start, in those at the end.
const START: f64 = 4.0;
/// Most cells along an edge.
const CELLS_MAX: f64 = 2048.0;

/// Points whose light is kept.
#[derive(Clone, Debug, Default)]
pub struct Cache {
    /// One of each triangle.
    pub lattices: Vec<Lattice>,
    /// Those at vertices, then those of the lattices. The area is 1 where light is still to come, else 0.
    pub points: Vec<Cluster>,
    /// What is known of each point's noise: the variance of its flux, all channels together. 0 before it is lit.
    pub noise: Vec<f64>,
    /// Points that there are at most, once refined.
    pub room: usize,
    /// Cells of each triangle beyond which it is fine enough.
    finest: Vec<u32>,
    /// Points at vertices.
    shared: usize,
}

/// What places points: the scene's triangles, as kernels read them.
#[derive(Clone, Copy, Debug)]
pub struct Geometry<'a> {
    pub triangles: &'a [Triangle],
    pub shadings: &'a [Shading],
    /// None without textures.
    pub coordinates: &'a [Coordinates],
}

impl<'a> Geometry<'a> {
    pub fn of(scene: &'a Scene) -> Geometry<'a> {
        Geometry { triangles: &scene.triangles, shadings: &scene.shadings, coordinates: &scene.coordinates }
    }
}

impl Cache {
    /// Points to begin with. `spacing` is the distance between points that is fine enough on each triangle, none where no
    /// light is kept; `most` how many points there may be besides those at vertices.
    pub fn new(geometry: Geometry, spacing: impl Fn(usize) -> Option<f64>, most: usize) -> Cache {
        let spacings: Vec<Option<f64>> = (0..geometry.triangles.len()).map(spacing).collect();
        let cells = |factor: f64| -> Vec<u32> {
            let each = geometry.triangles.iter().zip(&spacings);
            each.map(|(triangle, spacing)| spacing.map_or(0, |spacing| along(triangle, factor * spacing))).collect()
        };
        let finest = cells(1.0);
        // Half of the points at most, so that the rest can go where light varies.
        let mut factor = START;
        let mut start = cells(factor);
        while own(&start) > most / 2 && start.iter().any(|&cells| cells > 1) {
            factor *= 1.5;
            start = cells(factor);
        }
        let finest_of: Vec<u32> = start.iter().zip(&finest).map(|(&cells, &end)| doubled(cells, end)).collect();
        let mut cache = Cache { finest, ..Cache::default() };
        cache.share(geometry, &start);
        if cache.shared == 0 {
            return Cache::default();
        }
        cache.fill(geometry, &start);
        cache.noise = vec![0.0; cache.points.len()];
        cache.room = cache.points.len().max(cache.shared + own(&finest_of).min(most));
        cache
    }

    /// Points at vertices, one for all corners that shade alike.
    fn share(&mut self, geometry: Geometry, cells: &[u32]) {
        let mut numbers = HashMap::new();
        for (index, &cells) in cells.iter().enumerate() {
            let mut lattice = Lattice { cells, ..Lattice::default() };
            if cells > 0 {
                for corner in 0..3 {
                    let next = self.points.len() as u32;
                    let number = *numbers.entry(alike(geometry, index, corner)).or_insert(next);
                    if number == next {
                        self.points.push(vertex(geometry, index, corner));
                    }
                    lattice.corners[corner] = number;
                }
            }
            self.lattices.push(lattice);
        }
        self.shared = self.points.len();
    }

    /// The other points, of as many cells.
    fn fill(&mut self, geometry: Geometry, cells: &[u32]) {
        for (index, (triangle, &cells)) in geometry.triangles.iter().zip(cells).enumerate() {
            let (first, lattice) = (self.points.len() as u32, &mut self.lattices[index]);
            (lattice.first, lattice.cells) = (first, cells);
            let [corner, edge1, edge2] = triangle.corner_and_edges();
            let normal = edge1.cross(edge2).normalize().as_vec3();
            for (i, j) in inner(cells) {
                let [b1, b2] = [i, j].map(|k| f64::from(k) / f64::from(cells));
                self.points.push(Cluster {
                    position: (corner + b1 * edge1 + b2 * edge2).as_vec3(),
                    normal,
                    area: 1.0,
                    set: triangle.set,
                    triangle: index as u32,
                    barycentric: vec2(b1 as f32, b2 as f32),
                    ..Cluster::default()
                });
            }
        }
    }

    /// Makes the lattices of `triangles` twice as fine. Light that is there stays.
    pub fn refine(&mut self, geometry: Geometry, triangles: &[usize]) {
        let old = std::mem::take(self);
        let mut cells: Vec<u32> = old.lattices.iter().map(|lattice| lattice.cells).collect();
        triangles.iter().for_each(|&index| cells[index] *= 2);
        *self = Cache {
            lattices: old.lattices.clone(),
            points: old.points[..old.shared].to_vec(),
            noise: old.noise[..old.shared].to_vec(),
            ..old
        };
        self.fill(geometry, &cells);
        self.noise.resize(self.points.len(), 0.0);
        for (before, now) in old.lattices.iter().zip(&self.lattices) {
            let step = if now.cells > before.cells { 2 } else { 1 };
            for (i, j) in inner(before.cells) {
                let (from, to) = (number(before, i, j) as usize, number(now, step * i, step * j) as usize);
                (self.points[to], self.noise[to]) = (old.points[from], old.noise[from]);
            }
        }
    }

    /// Triangles whose light differs between neighbouring points by more than `tolerance` of its root mean square over the
    /// vertices, and by more than noise explains; the most different first, as many as there is `room` for.
    pub fn coarse(&self, tolerance: f64, room: usize) -> Vec<usize> {
        let flux = |number: u32| self.points[number as usize].flux.as_dvec3();
        let whole: f64 = self.points[..self.shared].iter().map(|point| point.flux.as_dvec3().length_squared()).sum();
        let least = tolerance * tolerance * whole / (self.shared.max(1) as f64);
        let excess = |lattice: &Lattice| {
            let (mut largest, mut noise, mut count) = (0.0f64, 0.0, 0);
            for (a, b) in edges(lattice) {
                largest = largest.max(flux(a).distance_squared(flux(b)));
                noise += self.noise[a as usize] + self.noise[b as usize];
                count += 1;
            }
            // So much the largest of as many differences by noise alone hardly is (3 sigma for one).
            let explained = (9.0 + 2.0 * f64::from(count).ln()) * noise / f64::from(count);
            largest - explained
        };
        let may = self.lattices.iter().zip(&self.finest).enumerate().filter(|(_, (l, finest))| l.cells < **finest);
        let mut found: Vec<(f64, usize)> = may
            .map(|(index, (lattice, _))| (excess(lattice), index))
            .filter(|&(excess, _)| excess > least)
            .collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut left = room.saturating_sub(self.points.len());
        let fits = |&(_, index): &(f64, usize)| {
            let cells = self.lattices[index].cells;
            let more = points_of(2 * cells) - points_of(cells);
            left = left.checked_sub(more)?;
            Some(index)
        };
        found.iter().map_while(fits).collect()
    }
}

/// Cells along the edges of a triangle for a distance between points.
fn along(triangle: &Triangle, spacing: f64) -> u32 {
    let [_, edge1, edge2] = triangle.corner_and_edges();
    let longest = edge1.length().max(edge2.length()).max((edge2 - edge1).length());
    (longest / spacing).ceil().clamp(1.0, CELLS_MAX) as u32
}

/// Cells after so many doublings that there are at least `end`.
fn doubled(mut cells: u32, end: u32) -> u32 {
    while cells != 0 && cells < end {
        cells *= 2;
    }
    cells
}

/// Points of a lattice, without the corners.
fn points_of(cells: u32) -> usize {
    let n = cells as usize;
    if n == 0 { 0 } else { (n + 1) * (n + 2) / 2 - 3 }
}

fn own(cells: &[u32]) -> usize {
    cells.iter().map(|&cells| points_of(cells)).sum()
}

/// The points of a lattice in their order, without the corners.
fn inner(cells: u32) -> impl Iterator<Item = (u32, u32)> {
    let all = (0..=cells).flat_map(move |j| (0..=cells - j).map(move |i| (i, j)));
    all.filter(move |&(i, j)| (i, j) != (0, 0) && i != cells && j != cells)
}

/// Neighbours in a lattice.
fn edges(lattice: &Lattice) -> impl Iterator<Item = (u32, u32)> {
    let n = lattice.cells;
    let cells = (0..n).flat_map(move |j| (0..n - j).map(move |i| (i, j)));
    cells.flat_map(move |(i, j)| {
        let [a, b, c] = [(i, j), (i + 1, j), (i, j + 1)].map(|(i, j)| number(lattice, i, j));
        [(a, b), (a, c), (b, c)]
    })
}

/// What corners have in common that share a point: place, normal, material and, where there are textures, coordinates.
type Alike = ([u32; 3], [u32; 3], u32, [u32; 4]);

fn alike(Geometry { triangles, shadings, coordinates }: Geometry, index: usize, corner: usize) -> Alike {
    let bits = |v: Vec3| v.to_array().map(f32::to_bits);
    let uv = coordinates.get(index).map_or([0; 4], |c| {
        let [a, b] = [c.uv[corner], c.uv[3 + corner]];
        [a.x, a.y, b.x, b.y].map(f32::to_bits)
    });
    let shading = &shadings[index];
    (bits(triangles[index].vertices[corner]), bits(normals(shading)[corner]), shading.material, uv)
}

fn normals(shading: &Shading) -> [Vec3; 3] {
    [shading.normal0, shading.normal1, shading.normal2]
}

/// The point at a vertex, where surfaces that meet have the interpolated normal in common.
fn vertex(Geometry { triangles, shadings, .. }: Geometry, index: usize, corner: usize) -> Cluster {
    let triangle = &triangles[index];
    let [_, edge1, edge2] = triangle.corner_and_edges();
    let geometric: DVec3 = edge1.cross(edge2).normalize();
    let shading = normals(&shadings[index])[corner];
    let normal = if shading.as_dvec3().dot(geometric) > 0.0 { shading } else { geometric.as_vec3() };
    Cluster {
        position: triangle.vertices[corner],
        normal,
        area: 1.0,
        set: triangle.set,
        triangle: index as u32,
        barycentric: [vec2(0.0, 0.0), vec2(1.0, 0.0), vec2(0.0, 1.0)][corner],
        ..Cluster::default()
    }
}
