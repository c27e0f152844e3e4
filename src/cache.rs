//! Light kept on surfaces: where its points are, and where more of them are needed.
//!
//! Light that enters is kept at the vertices, by all triangles around one that shade it alike, and on a lattice in each
//! triangle that is larger than the distance between points (C. Yuksel, J. Keyser, D. H. House, "Mesh colors", ACM TOG 29
//! (2010)). Triangles that are many points wide are cut into patches. Between points light is interpolated
//! ([`reference::cached`](crate::reference::cached)). The lattice of a triangle or patch is made twice as fine, and again, while
//! its light differs between neighbours.

use crate::{
    reference::cached::{number, patch},
    scene::Scene,
    shared::{Cluster, Coordinates, Lattice, Shading, Triangle},
};
use glam::{DVec2, DVec3, Vec3};
use std::collections::HashMap;

/// Distance between points at the start, in those at the end.
const START: f64 = 4.0;
/// Cells along an edge of a patch at the start, at most.
const PATCH: u32 = 8;
/// Most cells along an edge of a triangle at the end.
const CELLS_MAX: f64 = 4096.0;

/// Points whose light is kept.
#[derive(Clone, Debug, Default)]
pub struct Cache {
    /// One of each triangle, then those of patches.
    pub lattices: Vec<Lattice>,
    /// Those at vertices of triangles and patches, then those of the lattices. The area is 1 where light is still to come,
    /// else 0.
    pub points: Vec<Cluster>,
    /// What is known of each point's noise: the variance of its flux, all channels together. 0 before it is lit.
    pub noise: Vec<f64>,
    /// Points that there are at most, once refined.
    pub room: usize,
    /// What has points of its own: triangles that are not cut, and patches.
    pub patches: Vec<Patch>,
    /// Points at vertices.
    shared: usize,
}

/// A part of a triangle, or all of it, with a lattice of its own.
#[derive(Clone, Copy, Debug)]
pub struct Patch {
    pub triangle: usize,
    /// Its number among the lattices.
    lattice: usize,
    /// Weights of the triangle's second and third vertex at those of the patch.
    corners: [DVec2; 3],
    /// Cells beyond which it is fine enough.
    finest: u32,
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
        while start.iter().map(|&cells| points_of(cells)).sum::<usize>() > most / 2 && start.iter().any(|&n| n > 1) {
            factor *= 1.5;
            start = cells(factor);
        }
        let mut cache = Cache::default();
        let cells = cache.cut(geometry, &start, &finest);
        if cache.points.is_empty() {
            return Cache::default();
        }
        cache.fill(geometry, &cells);
        cache.noise = vec![0.0; cache.points.len()];
        let whole = |(patch, &cells): (&Patch, &u32)| points_of(doubled(cells, patch.finest));
        let whole: usize = cache.patches.iter().zip(&cells).map(whole).sum();
        cache.room = cache.points.len().max(cache.shared + whole.min(most));
        cache
    }

    /// Patches and the points at their vertices, of triangles of so many cells. The cells of each patch.
    fn cut(&mut self, geometry: Geometry, start: &[u32], finest: &[u32]) -> Vec<u32> {
        let (mut numbers, mut cells) = (HashMap::new(), vec![]);
        self.lattices = vec![Lattice { patches: 1, ..Lattice::default() }; geometry.triangles.len()];
        for (triangle, (&start, &finest)) in start.iter().zip(finest).enumerate() {
            if start == 0 {
                continue;
            }
            let n = start.div_ceil(PATCH);
            let corners = [0, 1, 2].map(|corner| {
                let next = self.points.len() as u32;
                let number = *numbers.entry(alike(geometry, triangle, corner)).or_insert(next);
                if number == next {
                    self.points.push(vertex(geometry, triangle, corner));
                }
                number
            });
            // The vertices of its patches are points of a lattice.
            let of_patches = Lattice { cells: n, corners, first: self.points.len() as u32, ..Lattice::default() };
            self.points.extend(inner(n).map(|(i, j)| point(geometry, triangle, share(i, j, n))));
            let first = self.lattices.len();
            self.lattices[triangle].patches = n;
            if n > 1 {
                self.lattices[triangle].first = first as u32;
                self.lattices.extend(vec![Lattice { patches: 1, ..Lattice::default() }; (n * n) as usize]);
            }
            for (i, j, upper) in parts(n) {
                let lattice = if n > 1 { first + patch(n, i, j, upper) as usize } else { triangle };
                let vertices = match upper {
                    true => [(i + 1, j + 1), (i, j + 1), (i + 1, j)],
                    false => [(i, j), (i + 1, j), (i, j + 1)],
                };
                self.lattices[lattice].corners = vertices.map(|(i, j)| number(&of_patches, i, j));
                let corners = vertices.map(|(i, j)| share(i, j, n));
                self.patches.push(Patch { triangle, lattice, corners, finest: finest.div_ceil(n) });
                cells.push(start.div_ceil(n));
            }
        }
        self.shared = self.points.len();
        cells
    }

    /// The points within patches of so many cells.
    fn fill(&mut self, geometry: Geometry, cells: &[u32]) {
        for (patch, &cells) in self.patches.iter().zip(cells) {
            let lattice = &mut self.lattices[patch.lattice];
            (lattice.first, lattice.cells) = (self.points.len() as u32, cells);
            let [a, b, c] = patch.corners;
            let place = |(i, j): (u32, u32)| {
                let weights = share(i, j, cells);
                point(geometry, patch.triangle, a + weights.x * (b - a) + weights.y * (c - a))
            };
            self.points.extend(inner(cells).map(place));
        }
    }

    fn cells(&self) -> Vec<u32> {
        self.patches.iter().map(|patch| self.lattices[patch.lattice].cells).collect()
    }

    /// Makes the lattices of patches, by number, twice as fine. Light that is there stays.
    pub fn refine(&mut self, geometry: Geometry, patches: &[usize]) {
        let (before, mut cells) = (self.lattices.clone(), self.cells());
        patches.iter().for_each(|&number| cells[number] *= 2);
        let old = self.points.split_off(self.shared);
        let noise = self.noise.split_off(self.shared);
        self.fill(geometry, &cells);
        self.noise.resize(self.points.len(), 0.0);
        for patch in &self.patches {
            let (before, now) = (&before[patch.lattice], &self.lattices[patch.lattice]);
            let step = if now.cells > before.cells { 2 } else { 1 };
            for (i, j) in inner(before.cells) {
                let from = number(before, i, j) as usize - self.shared;
                let to = number(now, step * i, step * j) as usize;
                (self.points[to], self.noise[to]) = (old[from], noise[from]);
            }
        }
    }

    /// Patches whose light differs between neighbouring points by more than `tolerance` of its root mean square over the
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
        let cells = self.cells();
        let may = self.patches.iter().enumerate().filter(|(number, patch)| cells[*number] < patch.finest);
        let mut found: Vec<(f64, usize)> = may
            .map(|(number, patch)| (excess(&self.lattices[patch.lattice]), number))
            .filter(|&(excess, _)| excess > least)
            .collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut left = room.saturating_sub(self.points.len());
        let fits = |&(_, number): &(f64, usize)| {
            left = left.checked_sub(points_of(2 * cells[number]) - points_of(cells[number]))?;
            Some(number)
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
    while cells < end {
        cells *= 2;
    }
    cells
}

/// Points of a lattice, without the corners.
fn points_of(cells: u32) -> usize {
    let n = cells as usize;
    if n == 0 { 0 } else { (n + 1) * (n + 2) / 2 - 3 }
}

/// The points of a lattice in their order, without the corners.
fn inner(cells: u32) -> impl Iterator<Item = (u32, u32)> {
    let all = (0..=cells).flat_map(move |j| (0..=cells - j).map(move |i| (i, j)));
    all.filter(move |&(i, j)| (i, j) != (0, 0) && i != cells && j != cells)
}

/// The parts that a triangle is cut into, lower and upper ones.
fn parts(n: u32) -> impl Iterator<Item = (u32, u32, bool)> {
    let lower = (0..n).flat_map(move |j| (0..n - j).map(move |i| (i, j)));
    lower.flat_map(move |(i, j)| [(i, j, false), (i, j, true)]).filter(move |&(i, j, upper)| !upper || i + j + 1 < n)
}

/// Weights of the second and third vertex.
fn share(i: u32, j: u32, cells: u32) -> DVec2 {
    DVec2::new(i.into(), j.into()) / f64::from(cells)
}

/// Neighbours in a lattice.
fn edges(lattice: &Lattice) -> impl Iterator<Item = (u32, u32)> {
    let cells = parts(lattice.cells).filter(|(_, _, upper)| !upper);
    cells.flat_map(move |(i, j, _)| {
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

/// A point of a triangle, not lit.
fn point(geometry: Geometry, index: usize, weights: DVec2) -> Cluster {
    let triangle = &geometry.triangles[index];
    let [corner, edge1, edge2] = triangle.corner_and_edges();
    Cluster {
        position: (corner + weights.x * edge1 + weights.y * edge2).as_vec3(),
        normal: edge1.cross(edge2).normalize().as_vec3(),
        area: 1.0,
        set: triangle.set,
        triangle: index as u32,
        barycentric: weights.as_vec2(),
        ..Cluster::default()
    }
}

/// The point at a vertex, where surfaces that meet have the interpolated normal in common.
fn vertex(geometry: Geometry, index: usize, corner: usize) -> Cluster {
    let point = point(geometry, index, [DVec2::ZERO, DVec2::X, DVec2::Y][corner]);
    let shading: DVec3 = normals(&geometry.shadings[index])[corner].as_dvec3();
    let normal = if shading.dot(point.normal.as_dvec3()) > 0.0 { shading.as_vec3() } else { point.normal };
    Cluster { position: geometry.triangles[index].vertices[corner], normal, ..point }
}
