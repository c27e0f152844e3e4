//! The sphere for which a point of a surface takes its body, seen from inside.
//!
//! A profile of the half-space loses light on small and thin bodies; one of a sphere that is locally alike does not. Which
//! sphere? With l the distance to the surface along a direction inside, l' that along the direction opposite across the
//! normal, and a length L,
//!
//!   G = mean of ((e^(-l/2L) + e^(-l'/2L)) / 2)^2 over directions by their cosines.
//!
//! A sphere of radius a has l = l' = 2 a cos, so G = 2 (1 - (1 + x) e^(-x)) / x^2, x = 2 a / L.
//!
//! 1 / a is what this inverts to. It is exact on spheres for every L, and a plane has 0. [`balance`] sees to it that as much
//! light leaves as from that sphere, so that a decides on the total. In a body much smaller than L only the mean of l
//! counts, which is 4 V / S with this weight (A.-L. Cauchy), and so is the mean way of light in weakly absorbing matter of
//! any scattering (S. Blanco, R. Fournier, Europhys. Lett. 61 (2003)): a plate of thickness h is like a sphere of 1.5 h. On
//! the flat side of a thick body 1 / a is to fall like the light that comes back from the other side, e^(-h/D) with the
//! diffuse mean free path D, while G = 2 E_3(h/L): L = D / 2. Near the boundary light is not yet diffuse; 2/3 of a reduced
//! mean free path, the extrapolation length, more makes the totals of plates right within 2 % for alpha' > .95, and
//! within 10 % at alpha' = .84 ([`reach`]).
//!
//! Beside an edge l is short on one side alone, and less light comes out than of a sphere with that mean of e^(-l/L). Hence
//! l and l' are averaged between the arithmetic mean and the geometric one, which sees no edges: by the power 1/2, with
//! which cubes have about the walk's total (`translucent::model_errors`). On plates, spheres and cylinders l' = l.

pub mod balance;
mod inside;
pub mod places;

use crate::reference::walk::mesh::Corners;
use crate::shared::Triangle;
use glam::{DVec3, Vec3};
use inside::Inside;
use places::{Place, Places};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// L for the diffuse mean free path 1 / sigma_tr and the reduced mean free path 1 / sigma_t'.
pub fn reach(diffuse: f64, reduced: f64) -> f64 {
    diffuse / 2.0 + 2.0 / 3.0 * reduced
}

/// Directions from a point: at most and at least, and how many rays a scene may cost between them.
const DIRECTIONS: (usize, usize) = (64, 32);
const RAYS: usize = 1 << 20;
/// Distance, over L, beyond which a surface is out of sight: e^(-20/2) = 5e-5.
const SIGHT: f64 = 20.0;
/// Vertices closer than an internal unit over this are one, and no sphere is smaller.
const GRID: f64 = (1 << 20) as f64;

/// 1 / a [1/internal unit] at the three vertices of each triangle, in their order; a set's entry of `lengths` is its L (>
/// 0; it may be infinite). A set without one has 0.
///
/// Rays start from [places](Places) on triangles, at their own normals; a vertex has the mean of those around it. A ray
/// that finds no surface counts as unbounded, so open meshes are surfaces of matter
/// that goes on behind them.
pub fn inverse_radii(triangles: &[Triangle], lengths: &[Option<f64>]) -> Vec<Vec3> {
    let mut sets: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (index, triangle) in triangles.iter().enumerate() {
        sets.entry(triangle.set).or_default().push(index);
    }
    let wanted = sets.iter().filter_map(|(set, members)| Some((members, lengths[*set as usize]?.min(1e6))));
    let of_set = |(members, length): (&Vec<usize>, f64)| -> (_, Vec<Corners>, _) {
        (members.clone(), members.iter().map(|&index| corners(&triangles[index])).collect(), length)
    };
    let bodies: Vec<_> = wanted.map(of_set).collect();
    let places: Vec<Places> = bodies.iter().map(|(_, corners, _)| Places::new(corners)).collect();
    let count: usize = places.iter().map(|places| places.all.len()).sum();
    let directions = (RAYS / count.max(1)).clamp(DIRECTIONS.1, DIRECTIONS.0);
    let mut radii = vec![Vec3::ZERO; triangles.len()];
    for ((members, corners, length), places) in bodies.iter().zip(&places) {
        for (index, found) in members.iter().zip(at_vertices(corners, places, *length, directions)) {
            radii[*index] = found;
        }
    }
    radii
}

/// The vertices of a triangle.
pub fn corners(triangle: &Triangle) -> Corners {
    triangle.vertices.map(|vertex| vertex.as_dvec3())
}

/// 1 / a at the three vertices of each triangle of one body.
pub fn of_mesh(corners: &[Corners], length: f64, directions: usize) -> Vec<Vec3> {
    at_vertices(corners, &Places::new(corners), length, directions)
}

fn at_vertices(corners: &[Corners], places: &Places, length: f64, directions: usize) -> Vec<Vec3> {
    let inside = Inside::new(corners);
    let of = |place: &Place| DVec3::splat(inverse_radius(&inside, place.point, place.normal, length, directions));
    let found: Vec<DVec3> = places.all.par_iter().map(of).collect();
    let vertices = places.at_vertices(&found).into_iter();
    vertices.map(|values| Vec3::from(values.map(|value| value.x as f32))).collect()
}

/// 1 / a at a point inside or on the surface, whose normal points outward.
fn inverse_radius(inside: &Inside, point: DVec3, normal: DVec3, length: f64, directions: usize) -> f64 {
    let (u, v) = normal.any_orthonormal_pair();
    // 1 - e^(-l/2L), whose digits remain when L is long.
    let missed = |direction: DVec3| match inside.distance(point, direction, SIGHT * length) {
        Some(distance) => -(-distance / (2.0 * length)).exp_m1(),
        None => 1.0,
    };
    // Pairs on opposite sides of the normal, along a spiral.
    let pairs = directions / 2;
    let pair = |k: usize| {
        let cos = ((k as f64 + 0.5) / pairs as f64).sqrt();
        let (s, c) = (TAU * 0.618_033_988_749_895 * k as f64).sin_cos();
        let aside = (1.0 - cos * cos).sqrt() * (c * u + s * v);
        let mean = (missed(aside - cos * normal) + missed(-aside - cos * normal)) / 2.0;
        mean * (2.0 - mean)
    };
    let missed = (0..pairs).map(pair).sum::<f64>() / pairs as f64;
    // Between the inner faces of two bodies that touch there is nothing; but 1 / a is to be a number.
    (length * diameter(missed) / 2.0).max(1.0 / GRID).recip()
}

/// x with 1 - 2 (1 - (1 + x) e^(-x)) / x^2 = `missed`, 0 < missed <= 1.
fn diameter(missed: f64) -> f64 {
    let of = |x: f64| {
        // The difference loses digits where x is small.
        let series = 2.0 * x / 3.0 - x * x / 4.0 + x * x * x / 15.0;
        if x < 1e-2 { series } else { 1.0 - 2.0 * (-(-x).exp_m1() - x * (-x).exp()) / (x * x) }
    };
    if missed >= 1.0 {
        return f64::INFINITY;
    }
    // x / (3/2 + x) <= missed <= 2 x / 3 for the solution.
    let (mut low, mut high) = (1.5 * missed, 1.5 * missed / (1.0 - missed));
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        *(if of(middle) < missed { &mut low } else { &mut high }) = middle;
    }
    high
}
