//! The points of the cloud, spread over the surfaces that exchange light, and the tree that they are the leaves of.
//!
//! Candidates go from triangle to triangle in the order of the BVH, which is one of places, so that small triangles share
//! them evenly; of those stay the ones that are far apart, and each stands for about the same area of its set.

use crate::{
    curvature::{
        self,
        balance::{Tree, triangle},
    },
    error::{Error, Result},
    reference::{gather::Near, profile::Matter, walk::mesh::Corners},
    scene::Scene,
    settings::{Cloud, Settings},
    shared::{Cluster, MODEL_DIRECTIONAL, MODEL_LAMBERT, MODEL_TABLE, Material, Triangle},
};
use glam::{DVec3, DVec4, Vec3, vec2};
use rayon::prelude::*;
use std::{
    collections::{BinaryHeap, HashMap},
    f64::consts::PI,
};

/// Radius within which light is interpolated, in distances between points.
const REACH: f64 = 2.5;
/// Size over distance of triangles below which the profile at their middle stands for them.
const SMALL: f64 = 0.2;
/// Candidates for each point.
const CANDIDATES: usize = 4;

/// The tree with its leaves set and no light yet. Materials get their reach.
///
/// # Errors
/// [`Error::Setting`] for what cannot be gathered.
pub(super) fn clusters(
    scene: &Scene,
    settings: &Settings,
    materials: &mut [Material],
    profiles: &[Vec3],
    thickness: &[Vec3],
) -> Result<Vec<Cluster>> {
    let Cloud { points, opening, spacing, samples } = settings.cloud;
    if !(1..=Cloud::POINTS_MAX).contains(&points) {
        return Err(Error::setting("cloud points", format!("{points} is not between 1 and {}", Cloud::POINTS_MAX)));
    }
    if !(0.0..=1.0).contains(&opening) {
        return Err(Error::setting("cloud opening", format!("{opening} is not in [0, 1]")));
    }
    if !(spacing > 0.0 && spacing.is_finite()) {
        return Err(Error::setting("cloud spacing", format!("{spacing} is not a number above 0")));
    }
    if samples == 0 {
        return Err(Error::setting("cloud samples", "must be at least 1"));
    }
    let refuse = |problem: String| Err(Error::setting("integrator cloud", problem));
    if settings.recording {
        return refuse("does not go into recordings; render with it, or record with the integrator sample".into());
    }
    // Surface of each set that light is gathered on, and its least mean free path.
    let mut sets: Vec<(u32, f64, f64)> = vec![];
    for (number, set) in scene.sets.iter().enumerate() {
        let named = |index: &usize| format!("material `{}`", scene.materials[*index].name);
        let Some(index) = set.materials.iter().find(|&&index| scene.materials[index].medium.is_some()) else {
            continue;
        };
        if set.materials.len() > 1 {
            return refuse(format!("set `{}` holds several materials; use the integrator sample", set.name));
        }
        if materials[*index].ramp != 0 {
            return refuse(format!("a texture changes the medium of {}; use the integrator sample", named(index)));
        }
        match materials[*index].model {
            MODEL_DIRECTIONAL => {
                let problem = "has the directional dipole, which does not factor into light and distance";
                return refuse(format!("{} {problem}; choose another model or integrator", named(index)));
            }
            MODEL_LAMBERT => continue,
            _ => {}
        }
        let of_set = scene.triangles.iter().filter(|triangle| triangle.set as usize == number);
        let area: f64 = of_set.map(area).sum();
        let medium = scene.materials[*index].medium.as_ref().expect("it was found by it");
        let extinction = (medium.sigma_s_prime + medium.sigma_a).max_element() / scene.frame.scale;
        sets.push((number as u32, area, 1.0 / extinction));
    }
    let wanted = |area: f64, path: f64| (area / (spacing * path).powi(2)).max(16.0);
    let all: f64 = sets.iter().map(|(_, area, path)| wanted(*area, *path)).sum();
    let share = (f64::from(points) / all).min(1.0);
    let mut leaves = vec![];
    for (number, area, path) in sets {
        let count = (wanted(area, path) * share).round().max(1.0);
        let candidates = spread(scene, number, area, CANDIDATES * count as usize);
        leaves.extend(thinned(candidates, count as usize, area));
        let index = scene.sets[number as usize].materials[0];
        // Sets of one material have the coarsest one's reach.
        materials[index].reach = materials[index].reach.max((REACH * (area / count).sqrt()) as f32);
    }
    for points in leaves.chunk_by_mut(|a: &Cluster, b: &Cluster| a.set == b.set) {
        let material = &materials[scene.sets[points[0].set as usize].materials[0]];
        weigh(scene, material, profiles, thickness, points);
    }
    Ok(tree(leaves))
}

fn area(triangle: &Triangle) -> f64 {
    let [_, edge1, edge2] = triangle.corner_and_edges();
    edge1.cross(edge2).length() / 2.0
}

/// Points on a set.
fn spread(scene: &Scene, set: u32, whole: f64, count: usize) -> Vec<Cluster> {
    let mut points = Vec::with_capacity(count);
    let mut below = 0.0;
    for (index, triangle) in scene.triangles.iter().enumerate().filter(|(_, triangle)| triangle.set == set) {
        let [corner, edge1, edge2] = triangle.corner_and_edges();
        let above = below + area(triangle);
        // Point k is where the area of those before is (k + 1/2) / count of the whole.
        let number = |area: f64| (area / whole * count as f64 + 0.5).floor() as usize;
        let own = number(above).min(count) - number(below).min(count);
        let places = lattice(own);
        for (b1, b2) in &places {
            points.push(Cluster {
                position: (corner + *b1 * edge1 + *b2 * edge2).as_vec3(),
                normal: edge1.cross(edge2).normalize().as_vec3(),
                // As many as there are share what stands for those that should be.
                area: (whole / count as f64 * own as f64 / places.len() as f64) as f32,
                set,
                triangle: index as u32,
                barycentric: vec2(*b1 as f32, *b2 as f32),
                ..Cluster::default()
            });
        }
        below = above;
    }
    points
}

/// About `count` places of a triangle, as weights of its second and third vertex: those of a lattice in the parallelogram,
/// twice as large, that fall into it. The lattice is that of the plastic number (M. Roberts, "The unreasonable effectiveness of
/// quasirandom sequences", 2018).
fn lattice(count: usize) -> Vec<(f64, f64)> {
    const PLASTIC: f64 = 1.324_717_957_244_746;
    if count == 1 {
        return vec![(1.0 / 3.0, 1.0 / 3.0)];
    }
    let place = |k: usize| {
        let along = |step: f64| ((k as f64 + 0.5) * step).fract();
        (along(1.0 / PLASTIC), along(1.0 / (PLASTIC * PLASTIC)))
    };
    let inside: Vec<_> = (0..2 * count).map(place).filter(|(b1, b2)| b1 + b2 < 1.0).collect();
    if inside.is_empty() { vec![(1.0 / 3.0, 1.0 / 3.0); count.min(1)] } else { inside }
}

/// The integral of profiles, of which `inside` is the mass within a squared distance up to `reach`, over the surface that
/// faces as a point does.
fn facing(tree: &Tree, point: &Cluster, reach: f64, inside: impl Fn(f64) -> DVec4) -> DVec4 {
    let (place, normal) = (point.position.as_dvec3(), point.normal.as_dvec3());
    let part = |corners: &Corners| {
        let [a, b, c] = *corners;
        let twice = (b - a).cross(c - a);
        if twice.dot(normal) <= 0.0 {
            return DVec4::ZERO;
        }
        let middle = (a + b + c) / 3.0;
        let squared = middle.distance_squared(place);
        let size = corners.map(|corner| corner.distance_squared(middle)).into_iter().fold(0.0, f64::max).sqrt();
        if size > SMALL * squared.sqrt() {
            return triangle(&inside, place, corners);
        }
        // The profile there, as its mean over a ring about as wide as the triangle.
        let half = size * squared.sqrt();
        twice.length() / (4.0 * PI * half) * (inside(squared + half) - inside(squared - half))
    };
    tree.near(place, reach).map(part).sum()
}

/// `count` of a set's candidates, which is its area divided by: those that are left when the one with the nearest neighbours
/// goes first, again and again (C. Yuksel, "Sample elimination", Computer Graphics Forum 34 (2015)).
fn thinned(mut points: Vec<Cluster>, count: usize, area: f64) -> Vec<Cluster> {
    // Twice the largest radius of as many discs that do not overlap.
    let reach = 2.0 * (area / (2.0 * 3f64.sqrt() * count as f64)).sqrt();
    let neighbours = neighbours(&points, reach, |squared| (1.0 - squared.sqrt() / reach).powi(8));
    let mut weights: Vec<f64> = neighbours.iter().map(|near| near.iter().map(|(_, weight)| weight).sum()).collect();
    // Weights only fall, so what comes out with an old one goes in again.
    let key = |weights: &[f64], index: usize| (weights[index].to_bits(), index);
    let mut heap: BinaryHeap<_> = (0..points.len()).map(|index| key(&weights, index)).collect();
    let mut left = points.len();
    while left > count
        && let Some((bits, index)) = heap.pop()
    {
        let weight = weights[index].max(0.0);
        if weight.to_bits() != bits {
            weights[index] = weight;
            heap.push(key(&weights, index));
            continue;
        }
        points[index].area = 0.0;
        left -= 1;
        for &(other, weight) in &neighbours[index] {
            weights[other] -= weight;
        }
    }
    points.retain(|point| point.area > 0.0);
    points.iter_mut().for_each(|point| point.area = (area / left as f64) as f32);
    points
}

/// For each point those within `reach` that face as it does, itself too, with what their squared distance weighs.
fn neighbours(points: &[Cluster], reach: f64, weight: impl Fn(f64) -> f64 + Sync) -> Vec<Vec<(usize, f64)>> {
    let cell = |place: DVec3| (place / reach).floor().to_array().map(|x| x as i64);
    let mut cells: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    for (index, point) in points.iter().enumerate() {
        cells.entry(cell(point.position.as_dvec3())).or_default().push(index);
    }
    let near = |point: &Cluster| {
        let place = point.position.as_dvec3();
        let [x, y, z] = cell(place);
        let around = (0..27).filter_map(|k| cells.get(&[x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1]));
        let facing = around.flatten().filter(|&&other| points[other].normal.dot(point.normal) > 0.0);
        let distances = facing.map(|&other| (other, points[other].position.as_dvec3().distance_squared(place)));
        let within = distances.filter(|(_, squared)| *squared < reach * reach);
        within.map(|(other, squared)| (other, weight(squared))).collect()
    };
    points.par_iter().map(near).collect()
}

/// Rounds in which areas are evened out.
const ROUNDS: usize = 8;

/// Mass of the near weight (1 - r^2 / reach^2)^2 within a squared distance.
fn near_area(squared: f64, reach: f64) -> f64 {
    let rest = 1.0 - (squared / (reach * reach)).min(1.0);
    PI / 3.0 * reach * reach * (1.0 - rest.powi(3))
}

/// Changes the areas that the points of a set stand for until those within the near weight of each have together what the
/// surface has there, `wanted`: they are not as far apart everywhere.
fn even_out(reach: f64, points: &mut [Cluster], wanted: impl Fn(usize) -> f64) {
    let neighbours = neighbours(points, reach, |squared| (1.0 - (squared / (reach * reach)).min(1.0)).powi(2));
    let mut areas: Vec<f64> = points.iter().map(|point| f64::from(point.area)).collect();
    for _ in 0..ROUNDS {
        let found =
            neighbours.iter().map(|near| near.iter().map(|&(other, weight)| weight * areas[other]).sum::<f64>());
        let shares: Vec<f64> = found.enumerate().map(|(index, found)| wanted(index) / found).collect();
        areas.iter_mut().zip(shares).for_each(|(area, share)| *area *= share);
    }
    points.iter_mut().zip(areas).for_each(|(point, area)| point.area = area as f32);
}

/// Sets areas and near masses of a set's points.
fn weigh(scene: &Scene, material: &Material, profiles: &[Vec3], thickness: &[Vec3], points: &mut [Cluster]) {
    let Some(set) = points.first().map(|point| point.set) else { return };
    let own = scene.triangles.iter().filter(|triangle| triangle.set == set);
    let corners: Vec<Corners> = own.map(curvature::corners).collect();
    let tree = Tree::new(&corners);
    let reach = f64::from(material.reach);
    let near = |curvature: f64| Near::new(Matter { material, tables: profiles, curvature }, reach);
    let flat = near(0.0);
    // Near masses over the area, and the area within the near weight.
    let of = |point: &Cluster| {
        let curvature = thickness.get(point.triangle as usize).map_or(0.0, |at| {
            let [b1, b2] = point.barycentric.to_array();
            at.dot(Vec3::new(1.0 - b1 - b2, b1, b2))
        });
        let curved = (material.model == MODEL_TABLE && curvature > 0.0).then(|| near(curvature.into()));
        let near = curved.as_ref().unwrap_or(&flat);
        facing(&tree, point, reach, |squared| near.inside(squared).extend(near_area(squared, reach)))
    };
    let masses: Vec<DVec4> = points.par_iter().map(of).collect();
    even_out(reach, points, |index| masses[index].w);
    for (point, mass) in points.iter_mut().zip(masses) {
        point.mass = (f64::from(point.area) * mass.truncate()).as_vec3();
    }
}

/// A tree of nodes with as many points on either side, one more or less; places without a point come second.
fn tree(mut points: Vec<Cluster>) -> Vec<Cluster> {
    if points.is_empty() {
        return vec![];
    }
    let leaves = points.len().next_power_of_two();
    let mut clusters = vec![Cluster::default(); 2 * leaves];
    place(&mut points, &mut clusters[leaves..]);
    clusters
}

fn place(points: &mut [Cluster], leaves: &mut [Cluster]) {
    if let ([point], [leaf]) = (&*points, &mut *leaves) {
        *leaf = *point;
    }
    if points.is_empty() || leaves.len() == 1 {
        return;
    }
    let half = points.len().div_ceil(2);
    // Sets apart first, as far as halves allow.
    if points.iter().any(|point| point.set != points[0].set) {
        points.sort_by_key(|point| point.set);
    } else {
        let low = points.iter().fold(Vec3::INFINITY, |low, point| low.min(point.position));
        let high = points.iter().fold(Vec3::NEG_INFINITY, |high, point| high.max(point.position));
        let axis = (high - low).max_position();
        points.select_nth_unstable_by(half - 1, |a, b| a.position[axis].total_cmp(&b.position[axis]));
    }
    let (left, right) = points.split_at_mut(half);
    let (below, above) = leaves.split_at_mut(leaves.len() / 2);
    place(left, below);
    place(right, above);
}
