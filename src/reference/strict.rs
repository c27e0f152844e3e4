//! Rays in f32, operation by operation as the kernels have them: for tests that compare bits.
//!
//! The twins are written from the formulas in f64, and can show errors down to rounding. But + - * / and square roots are
//! correctly rounded on software drivers, and nothing else is between a ray and its hit, so there the kernel's result has
//! no error at all beside the same operations in the same order, and a single wrong bit is a fault of the compiler. This
//! is that order: the only place where it is told twice. Mathematics and source are in [`intersect`](super::intersect) and
//! [`primary`](super::primary).

use super::Inputs;
use super::pixel::position;
use super::random::{batch, key, scramble, sobol, stratum, unit};
use crate::shared::{DIM_PIXEL, MISS, PROJECTION_CAMERA, Probe, SCREEN_REACH, Step, Surface, Triangle};
use glam::{Vec2, Vec3, Vec3Swizzles, vec2};

/// What stands for the area of a ray through an edge.
const EDGE: f32 = 1e-36;

/// All points base + offset + t direction, t in [t_min, t_max].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    pub base: Vec3,
    pub offset: Vec3,
    pub direction: Vec3,
    pub t_min: f32,
    pub t_max: f32,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    pub t: f32,
    /// Index of the triangle.
    pub triangle: u32,
    /// Weights of the second and third vertex.
    pub barycentric: Vec2,
}

impl Ray {
    fn axis(&self) -> usize {
        let d = self.direction.abs();
        if d.x >= d.y.max(d.z) { 0 } else { 1 + usize::from(d.y < d.z) }
    }

    fn meets(&self, axis: usize, slope: Vec2, triangle: &Triangle) -> Option<(f32, Vec2)> {
        let [a, b, c] = triangle.vertices.map(|vertex| {
            let to = turned((vertex - self.base) - self.offset, axis);
            to.xy() - slope * to.z
        });
        let area = Vec3::new(side_of_edge(b, c), side_of_edge(c, a), side_of_edge(a, b));
        let barycentric = area.yz() / (area.x + area.y + area.z);
        let [corner, second, third] = triangle.vertices;
        let normal = (second - corner).cross(third - corner);
        let rate = normal.dot(self.direction);
        let t = normal.dot((corner - self.base) - self.offset) / rate;
        let through = area.min_element() > 0.0 || area.max_element() < 0.0;
        (through && rate != 0.0 && t >= self.t_min && t <= self.t_max).then_some((t, barycentric))
    }

    /// Every hit, in the order of the triangles.
    pub fn hits(&self, triangles: &[Triangle]) -> impl Iterator<Item = Hit> {
        let axis = self.axis();
        let turned = turned(self.direction, axis);
        let slope = turned.xy() / turned.z;
        (0..).zip(triangles).filter_map(move |(index, triangle)| {
            let (t, barycentric) = self.meets(axis, slope, triangle)?;
            Some(Hit { t, triangle: index, barycentric })
        })
    }
}

/// Turns an axis to z.
fn turned(v: Vec3, axis: usize) -> Vec3 {
    match axis {
        0 => v.yzx(),
        1 => v.zxy(),
        _ => v,
    }
}

/// Twice the area of (0, a, b), never 0.
fn side_of_edge(a: Vec2, b: Vec2) -> f32 {
    let area = a.x * b.y - a.y * b.x;
    let rises = a.y < b.y || a.y == b.y && a.x < b.x;
    match area != 0.0 {
        true => area,
        false if rises => EDGE,
        false => -EDGE,
    }
}

/// As [`primary`](super::primary::primary), in scenes whose textures cut nothing out. Of hits at one distance the last
/// triangle's is returned; a kernel may find any of them.
pub fn primary(inputs: &Inputs, step: &Step, index: u32) -> Surface {
    let view = inputs.view;
    let (px, py) = position(view, step, index);
    let coordinate = |d: u32| {
        let point = sobol(stratum(&inputs.features, step.sample_index), d as usize);
        unit(scramble(point, key(view.seed, px, py, batch(step.sample_index), DIM_PIXEL + d))) as f32
    };
    let within = if step.pixel_centre != 0 { Vec2::splat(0.5) } else { vec2(coordinate(0), coordinate(1)) };
    let size = vec2(view.width as f32, view.height as f32);
    let ndc = 2.0 * (vec2(px as f32, py as f32) + within) / size - 1.0;
    let on_plane = ndc.x * view.right - ndc.y * view.up;
    let to = view.forward + view.perspective * on_plane;
    let length = to.length();
    let reach = if view.perspective != 0.0 { length } else { view.reach };
    let (base, offset, direction) = (view.pivot + on_plane, Vec3::ZERO, to / length);
    let ray = Ray { base, offset, direction, t_min: -reach, t_max: 1e30 };
    let Some(hit) = ray.hits(inputs.triangles).min_by(|a, b| a.t.total_cmp(&b.t)) else {
        return Surface { triangle: MISS, ..Surface::default() };
    };
    let [corner, second, third] = inputs.triangles[hit.triangle as usize].vertices;
    let from_corner = hit.barycentric.x * (second - corner) + hit.barycentric.y * (third - corner);
    Surface { position: corner + from_corner, triangle: hit.triangle, barycentric: hit.barycentric }
}

/// As [`look_up`](super::screen::look_up).
pub fn look_up(inputs: &Inputs, step: &Step, index: u32, surfaces: &[Surface], probe: &Probe) -> Vec<Hit> {
    let view = inputs.view;
    if probe.t_min > probe.t_max {
        return vec![];
    }
    let own = &surfaces[index as usize];
    let depth =
        |from_pivot: Vec3| 1.0 + view.perspective * (from_pivot.dot(view.forward) / view.forward.dot(view.forward));
    let from_pivot = (own.position - view.pivot) + probe.offset;
    let x = from_pivot.dot(view.right) / view.right.dot(view.right) / depth(from_pivot);
    let y = from_pivot.dot(view.up) / view.up.dot(view.up) / depth(from_pivot);
    let column = (0.5 + 0.5 * x) * view.width as f32 - view.crop_x as f32;
    let row = (0.5 - 0.5 * y) * view.height as f32 - step.first_row as f32;
    let (columns, rows) = (view.crop_width as f32, (step.pixel_count / view.crop_width) as f32);
    if !(depth(from_pivot) > 0.0 && (0.0..columns).contains(&column) && (0.0..rows).contains(&row)) {
        return vec![];
    }
    let there = &surfaces[row as usize * view.crop_width as usize + column as usize];
    let set = |surface: &Surface| inputs.triangles[surface.triangle as usize].set;
    if there.triangle == MISS || set(there) != set(own) {
        return vec![];
    }
    let to = (there.position - own.position) - probe.offset;
    let [corner, second, third] = inputs.triangles[there.triangle as usize].vertices;
    let normal = (second - corner).cross(third - corner);
    let in_plane = normal.dot(to) / normal.dot(probe.direction);
    let apart = in_plane * probe.direction - to;
    let width = 2.0 * view.right.length() / view.width as f32 * depth(there.position - view.pivot) * SCREEN_REACH;
    let t = if apart.dot(apart) <= width * width { in_plane } else { to.dot(probe.direction) };
    let found = t >= probe.t_min && t <= probe.t_max;
    let hit = Hit { t, triangle: there.triangle, barycentric: there.barycentric };
    found.then_some(hit).into_iter().collect()
}

/// All hits of [`reproject`](super::reproject::reproject), by distance.
pub fn reproject(inputs: &Inputs, surface: &Surface, probe: &Probe) -> Vec<Hit> {
    if probe.t_min > probe.t_max {
        return vec![];
    }
    let set = inputs.triangles[surface.triangle as usize].set;
    let Probe { offset, direction, t_min, t_max, .. } = *probe;
    let ray = Ray { base: surface.position, offset, direction, t_min, t_max };
    let mut hits: Vec<Hit> = ray.hits(inputs.triangles).collect();
    hits.retain(|hit| inputs.triangles[hit.triangle as usize].set == set);
    hits.sort_by(|a, b| a.t.total_cmp(&b.t));
    if inputs.features.projection == PROJECTION_CAMERA {
        hits.truncate(1);
    }
    hits
}
