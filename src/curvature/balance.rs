//! How much of a sphere's light a body gives back: the factor that keeps energy where the body is no sphere.
//!
//! The profile R_a of the sphere that a point is locally like has the total T(a) on that sphere, where the area within a
//! chord r is pi r^2. On a thin plate it is up to twice that, near a convex edge it is less. With
//!
//!   balance(x) = T(a) / int_body R_a(|x' - x|) dA',
//!
//! for each channel, the profile that is used at x has the total of the sphere: even light on all of the body comes out
//! everywhere as on the sphere, and as bright as it went in where nothing is absorbed. It is 1 on spheres and on planes; on
//! those of less than a mean free path whose facets cut off the end of the diameter, where the light leaves that crosses
//! them straight, it is above.
//! On an open surface light that leaves over the border is in the matter behind: there it is at most 1.
//!
//! # The integral
//! A triangle at the height h over x: with M(r) the light of R within r, and polar coordinates (rho, phi) about the foot
//! of x in its plane, r dr = rho drho, so that
//!
//!   int_triangle R dA = 1/2pi sum over edges of int (M(sqrt(h^2 + rho(phi)^2)) - M(h)) dphi,
//!
//! exact however steep R is at r = 0. Quadrature over phi; what neighbours have in common cancels. Groups of triangles
//! that are small beside their distance count with R at their centre (J. Barnes, P. Hut, Nature 324 (1986)): a group of
//! the radius s at the distance d is opened unless s (1 + d / 2 L) < [`OPENING`] d, L the diffuse mean free path. Since R
//! falls at most about as d^-3 e^(-d/L), a group errs by (3 s / d)^2 / 16 at most; the whole integral by less than 1 %, and
//! by up to 5 % where the ring at a small sphere's diameter, which holds the light that crosses it straight, ends on the
//! body (tests/physics/balance.rs).

use super::places::{Place, Places};
use crate::reference::profile::table::Local;
use crate::reference::walk::mesh::Corners;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::{
    f64::consts::{FRAC_PI_3, TAU},
    iter::Sum,
    ops::{Add, Mul, Sub},
};

/// Radius of a group over its distance below which its centre stands for it.
pub const OPENING: f64 = 0.4;

/// The balance of each channel at the three vertices of each triangle of one body.
///
/// `curvatures` are its [inverse radii](super::of_mesh), `length` the diffuse mean free path, `profile` the profile at a
/// curvature.
pub fn of_mesh<'a>(
    corners: &[Corners],
    curvatures: &[Vec3],
    open: bool,
    length: f64,
    profile: impl Fn(f64) -> Local<'a> + Sync,
) -> Vec<[Vec3; 3]> {
    let tree = Tree::new(corners);
    let at = |point: DVec3, curvature: f64| {
        let local = profile(curvature);
        let (total, found) = (local.total(), tree.integral(&local, point, length));
        let balance = DVec3::select(found.cmpgt(DVec3::ZERO), total / found, DVec3::ONE);
        if open { balance.min(DVec3::ONE) } else { balance }
    };
    let near = |place: &Place| {
        let curvature = curvatures[place.triangle].as_dvec3().dot(place.weights);
        at(place.point, curvature)
    };
    let places = Places::new(corners);
    let found: Vec<DVec3> = places.all.par_iter().map(near).collect();
    places.at_vertices(&found).into_iter().map(|values| values.map(|value| value.as_vec3())).collect()
}

/// Groups of triangles, each before what it holds.
pub struct Tree<'a> {
    corners: &'a [Corners],
    groups: Vec<Group>,
}

struct Group {
    /// Mean position, and the distance of the farthest vertex from it.
    centre: DVec3,
    radius: f64,
    area: f64,
    /// The first group that this one does not hold.
    next: u32,
    /// Of a group of one, its triangle.
    triangle: u32,
}

impl<'a> Tree<'a> {
    pub fn new(corners: &'a [Corners]) -> Tree<'a> {
        let mut tree = Tree { corners, groups: Vec::with_capacity(2 * corners.len()) };
        tree.add(&mut (0..corners.len() as u32).collect::<Vec<_>>());
        tree
    }

    fn add(&mut self, triangles: &mut [u32]) {
        let Some(&first) = triangles.first() else { return };
        let corners = self.corners;
        let middle = |index: u32| corners[index as usize].iter().sum::<DVec3>() / 3.0;
        let size = |index: u32| {
            let [a, b, c] = corners[index as usize];
            (b - a).cross(c - a).length() / 2.0
        };
        let area: f64 = triangles.iter().map(|&index| size(index)).sum();
        let centre = triangles.iter().map(|&index| middle(index) * size(index)).sum::<DVec3>() / area;
        let vertices = triangles.iter().flat_map(|&index| corners[index as usize]);
        let radius = vertices.map(|vertex| vertex.distance_squared(centre)).fold(0.0, f64::max).sqrt();
        let place = self.groups.len();
        self.groups.push(Group { centre, radius, area, next: 0, triangle: first });
        if triangles.len() > 1 {
            let low = triangles.iter().fold(DVec3::INFINITY, |low, &index| low.min(middle(index)));
            let high = triangles.iter().fold(DVec3::NEG_INFINITY, |high, &index| high.max(middle(index)));
            let axis = (high - low).max_position();
            let half = triangles.len() / 2;
            triangles.select_nth_unstable_by(half, |&a, &b| middle(a)[axis].total_cmp(&middle(b)[axis]));
            let (left, right) = triangles.split_at_mut(half);
            self.add(left);
            self.add(right);
        }
        self.groups[place].next = self.groups.len() as u32;
    }

    /// The triangles of which a part may be within `radius` of `point`.
    pub fn near(&self, point: DVec3, radius: f64) -> impl Iterator<Item = &Corners> {
        let mut place = 0;
        std::iter::from_fn(move || {
            loop {
                let group = self.groups.get(place)?;
                let far = group.centre.distance(point) - group.radius > radius;
                let one = group.next as usize == place + 1;
                place = if far { group.next as usize } else { place + 1 };
                if one && !far {
                    return Some(&self.corners[group.triangle as usize]);
                }
            }
        })
    }

    /// The integral of a profile, centred at `point`, over all triangles.
    pub fn integral(&self, profile: &Local, point: DVec3, length: f64) -> DVec3 {
        let end = profile.end();
        let mut sum = DVec3::ZERO;
        let mut place = 0;
        while let Some(group) = self.groups.get(place) {
            let squared = group.centre.distance_squared(point);
            let distance = squared.sqrt();
            let one = group.next as usize == place + 1;
            if distance - group.radius > end {
                place = group.next as usize;
            } else if group.radius * (1.0 + distance / (2.0 * length)) < OPENING * distance {
                sum += group.area * profile.value(squared);
                place = group.next as usize;
            } else {
                if one {
                    let corners = &self.corners[group.triangle as usize];
                    sum += triangle(&|squared| profile.inside(squared), point, corners);
                }
                place += 1;
            }
        }
        sum
    }
}

/// Numbers of several profiles, which are integrated together.
pub trait Profiles: Copy + Default + Add<Output = Self> + Sub<Output = Self> + Mul<f64, Output = Self> + Sum {}
impl<V: Copy + Default + Add<Output = V> + Sub<Output = V> + Mul<f64, Output = V> + Sum> Profiles for V {}

/// The integral over one triangle of profiles, of which `inside` is the mass within a squared distance.
pub fn triangle<V: Profiles>(inside: &impl Fn(f64) -> V, point: DVec3, corners: &Corners) -> V {
    let [a, b, c] = *corners;
    let Some(normal) = (b - a).cross(c - a).try_normalize() else { return V::default() };
    let height = (point - a).dot(normal);
    let foot = point - height * normal;
    let squared = height * height;
    let within = inside(squared);
    let edge = |from: DVec3, to: DVec3| {
        let along = (to - from).normalize();
        let (u, v) = (from - foot, to - foot);
        // Distance of the foot from the edge's line, positive inside.
        let away = normal.dot(along.cross(foot - from));
        if away == 0.0 {
            return V::default();
        }
        let angle = |w: DVec3| (w.dot(along) / away.abs()).atan();
        let (begin, end) = (angle(u), angle(v));
        let part = integral(begin, end, |phi| {
            let rho = away / phi.cos();
            inside(squared + rho * rho) - within
        });
        part * (away.signum() / TAU)
    };
    edge(a, b) + edge(b, c) + edge(c, a)
}

/// Four-point Gauss-Legendre quadrature in panels of at most sixty degrees.
fn integral<V: Profiles>(begin: f64, end: f64, f: impl Fn(f64) -> V) -> V {
    const RULE: [(f64, f64); 2] =
        [(0.339_981_043_584_856_26, 0.652_145_154_862_546_1), (0.861_136_311_594_052_6, 0.347_854_845_137_453_85)];
    let panels = ((end - begin) / FRAC_PI_3).ceil().max(1.0);
    let half = (end - begin) / panels / 2.0;
    let panel = |i: usize| {
        let middle = begin + (2 * i + 1) as f64 * half;
        RULE.iter().map(|(x, w)| (f(middle - half * x) + f(middle + half * x)) * *w).sum::<V>()
    };
    (0..panels as usize).map(panel).sum::<V>() * half
}
