//! Random walks of light in a half-space or a sphere with a smooth boundary, for every absorption at once.
//!
//! # Estimator
//! Lengths are in units of 1 / sigma_s', so that free paths have the mean 1 - g. A walk absorbs nothing; matter with the
//! absorption a = sigma_a / sigma_s' weights what leaves after the path L with e^(-a L) (E. Alerstam, S.
//! Andersson-Engels, T. Svensson, "White Monte Carlo for time-resolved photon migration", J. Biomed. Opt. 13 (2008)).
//! Light leaving is counted by distance from the entry and by L, in cells fine enough for the weights.
//!
//! Light enters at the origin. What it deposits outside is an expectation wherever that is cheap:
//! - after a collision, the chance e^(-sigma_s d) (1 - F) to leave along a direction is deposited, and not the light that
//!   happens to leave. For g = 0 this direction is independent of the walk and lies in the cone that total reflection
//!   leaves open around the axis to the surface; else it is the walk's own.
//! - at the boundary a walk goes on with the probability F. A second passage of the boundary within one flight is
//!   counted as it happens.
//! - Light that leaves before any reflection after one collision, or none, is left out for normal incidence:
//!   [`single`](super::single) has its integral.
//! - Far down, estimates are made with a probability of 1/8 or less, and walks longer than 256 4^k go on with the
//!   probability 1/4, with weights that keep the expectation.
//!
//! Henyey-Greenstein phase function: L. G. Henyey, J. L. Greenstein, Astrophys. J. 93 (1941).

use super::grid;
use crate::reference::boundary::{fresnel, transmittance};
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// First cell of the squared distance, 2^-18.
pub const FIRST: u32 = grid::octave(-18);
/// Cells of the squared distance, up to 2^16.
pub const CELLS: usize = 34 * 4;
/// Path lengths: 32 cells an octave from 2^-10 to 2^20.
const LENGTH_SHIFT: u32 = 23 - 5;
const FIRST_LENGTH: u32 = (127 - 10) << 5;
const LENGTHS: usize = 30 << 5;
/// Walks are made in this many independent parts, from which standard errors come.
const PARTS: u64 = 32;

/// How light enters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Incidence {
    /// Along the normal; light that leaves before any reflection after one collision, or none, is left out.
    Normal,
    /// From all directions equally; only totals are of interest.
    Diffuse,
}

/// What is simulated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walk {
    /// Index of refraction, inside over outside, > 0.
    pub ior: f64,
    /// Mean cosine of scattering, within (-1, 1).
    pub g: f64,
    /// Radius of the sphere in units of 1 / sigma_s'; infinite for the half-space.
    pub radius: f64,
    pub incidence: Incidence,
    /// Walks in all.
    pub walks: u64,
    pub seed: u64,
}

/// A mean and its standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    pub mean: f64,
    pub error: f64,
}

/// What leaves per unit of light that entered, at one absorption.
#[derive(Clone, Debug, PartialEq)]
pub struct Leaving {
    /// All of it, at whatever distance.
    pub total: Estimate,
    /// Part of it in each of [`CELLS`] cells of the squared distance.
    pub cells: Vec<Estimate>,
}

impl Walk {
    /// Walks, and what leaves at each of the absorptions sigma_a / sigma_s'. The result does not depend on the number of
    /// threads.
    pub fn run(&self, absorptions: &[f64]) -> Vec<Leaving> {
        let weights: Vec<Vec<f64>> =
            absorptions.iter().map(|a| (0..LENGTHS).map(|i| (-a * length(i)).exp()).collect()).collect();
        // Part by part: for each absorption the cells, then the total.
        let parts: Vec<Vec<Vec<f64>>> = (0..PARTS)
            .into_par_iter()
            .map(|part| {
                let mut tracer = Tracer::new(self, part);
                let walks = self.walks / PARTS;
                for _ in 0..walks {
                    tracer.walk();
                }
                weights.iter().map(|weights| tracer.weighted(weights, walks.max(1))).collect()
            })
            .collect();
        (0..absorptions.len())
            .map(|a| {
                let estimate = |cell: usize| {
                    let n = PARTS as f64;
                    let mean = parts.iter().map(|part| part[a][cell]).sum::<f64>() / n;
                    let spread = parts.iter().map(|part| (part[a][cell] - mean).powi(2)).sum::<f64>();
                    Estimate { mean, error: (spread / (n * (n - 1.0))).sqrt() }
                };
                Leaving { total: estimate(CELLS), cells: (0..CELLS).map(estimate).collect() }
            })
            .collect()
    }
}

/// Cells within the diameter of a sphere, at least 1.
pub fn reached(radius: f64) -> usize {
    let end = (4.0 * radius * radius) as f32;
    // A diameter at which a cell begins ends with the cell before.
    let last = grid::cell(end.next_down()) + 1;
    (last.saturating_sub(FIRST) as usize).clamp(1, CELLS)
}

/// Middle of a cell of path lengths.
fn length(cell: usize) -> f64 {
    let edge = |cell: u32| f64::from(f32::from_bits((FIRST_LENGTH + cell) << LENGTH_SHIFT));
    (edge(cell as u32) + edge(cell as u32 + 1)) / 2.0
}

/// One part of the walks.
struct Tracer<'a> {
    set: &'a Walk,
    /// Mean free path.
    path: f64,
    state: u64,
    /// Last cell that the sphere reaches.
    last: usize,
    /// Light by cell of the distance (the last row is whatever lies outside the grid) and cell of the path.
    light: Vec<f32>,
}

impl<'a> Tracer<'a> {
    fn new(set: &'a Walk, part: u64) -> Tracer<'a> {
        let mut tracer = Tracer {
            set,
            path: 1.0 - set.g,
            state: set.seed,
            last: reached(set.radius) - 1,
            light: vec![0.0; (CELLS + 1) * LENGTHS],
        };
        // Parts begin far apart in the one sequence of 2^64.
        tracer.state = tracer.bits().wrapping_add(part.wrapping_mul(0x5851_f42d_4c95_7f2d));
        tracer
    }

    /// Sums over the path: light in each cell, then all of it, per walk.
    fn weighted(&self, weights: &[f64], walks: u64) -> Vec<f64> {
        let sum = |row: &[f32]| {
            row.iter().zip(weights).map(|(&light, weight)| f64::from(light) * weight).sum::<f64>() / walks as f64
        };
        let mut sums: Vec<f64> = self.light.chunks_exact(LENGTHS).map(sum).collect();
        sums[CELLS] = sums.iter().sum();
        sums
    }

    /// SplitMix64: G. L. Steele, D. Lea, C. H. Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014.
    fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in (0, 1].
    fn random(&mut self) -> f64 {
        ((self.bits() >> 11) + 1) as f64 / (1u64 << 53) as f64
    }

    fn plane(&self) -> bool {
        self.set.radius.is_infinite()
    }

    /// Counts light that leaves at q after the path.
    fn deposit(&mut self, q: DVec3, path: f64, light: f64) {
        let z = if self.plane() { 0.0 } else { q.z + self.set.radius };
        let s = (q.x * q.x + q.y * q.y + z * z) as f32;
        let cell = (grid::cell(s).wrapping_sub(FIRST) as usize).min(CELLS);
        // The far pole lies where the last cell of a sphere ends.
        let cell = if cell < CELLS { cell.min(self.last) } else { cell };
        let bits = ((path as f32).to_bits() >> LENGTH_SHIFT).max(FIRST_LENGTH) - FIRST_LENGTH;
        self.light[cell * LENGTHS + (bits as usize).min(LENGTHS - 1)] += light as f32;
    }

    /// Distance from q to the boundary along w.
    fn distance(&self, q: DVec3, w: DVec3) -> f64 {
        if self.plane() {
            return if w.z < 0.0 { q.z / -w.z } else { f64::INFINITY };
        }
        let (a, b, rho) = (self.set.radius, q.dot(w), q.length());
        (-b + (b * b + ((a - rho) * (a + rho)).max(0.0)).sqrt()).max(0.0)
    }

    /// Outward normal at a point of the boundary.
    fn normal(&self, q: DVec3) -> DVec3 {
        if self.plane() { -DVec3::Z } else { q.normalize() }
    }

    /// Share of the light along w that leaves at the boundary point q.
    fn leaves(&self, q: DVec3, w: DVec3) -> f64 {
        transmittance(1.0 / self.set.ior, self.normal(q).dot(w).clamp(0.0, 1.0))
    }

    /// The unit vector at the angle whose cosine is given from `axis`.
    fn around(&mut self, axis: DVec3, cos: f64) -> DVec3 {
        let (sin_angle, cos_angle) = (TAU * self.random()).sin_cos();
        let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
        let (x, y) = axis.any_orthonormal_pair();
        sin * (cos_angle * x + sin_angle * y) + cos * axis
    }

    /// Direction of light that enters at the origin.
    fn enter(&mut self) -> DVec3 {
        let n = self.set.ior;
        if self.set.incidence == Incidence::Normal {
            return DVec3::Z;
        }
        loop {
            let cos = self.random().sqrt();
            if self.random() <= 1.0 - fresnel(n, cos) || n == 1.0 {
                return self.around(DVec3::Z, (1.0 - (1.0 - cos) * (1.0 + cos) / (n * n)).sqrt());
            }
        }
    }

    /// A direction after scattering.
    fn scatter(&mut self, w: DVec3) -> DVec3 {
        let g = self.set.g;
        let u = self.random();
        if g == 0.0 {
            return self.around(DVec3::Z, 2.0 * u - 1.0);
        }
        let f = (1.0 - g * g) / (1.0 - g + 2.0 * g * u);
        self.around(w, ((1.0 + g * g - f * f) / (2.0 * g)).clamp(-1.0, 1.0))
    }

    /// Deposits what leaves from q along w.
    fn expect(&mut self, q: DVec3, w: DVec3, path: f64, light: f64) {
        let d = self.distance(q, w);
        if d.is_finite() {
            let exit = q + d * w;
            let light = light * (-d / self.path).exp() * self.leaves(exit, w);
            if light > 0.0 {
                self.deposit(exit, path + d, light);
            }
        }
    }

    /// Deposits what leaves from an isotropic collision at q: along one direction within the cones that are open.
    fn expect_isotropic(&mut self, q: DVec3, path: f64, mut light: f64) {
        let (rho, a) = (q.length(), self.set.radius);
        let depth = if self.plane() { q.z } else { a - rho };
        let rare = if depth > 8.0 {
            64.0
        } else if depth > 3.0 {
            8.0
        } else {
            1.0
        };
        if rare > 1.0 {
            if self.random() * rare > 1.0 {
                return;
            }
            light *= rare;
        }
        // sin^2 of the widest angle to the axis at which light leaves.
        let sin2 = (if self.plane() { 1.0 } else { a / rho } / self.set.ior).powi(2);
        let closed = if sin2 < 1.0 { (1.0 - sin2).sqrt() } else { 0.0 };
        let cos = closed + (1.0 - closed) * self.random();
        let mut axis = if self.plane() { -DVec3::Z } else { q.normalize_or(DVec3::Z) };
        light *= (1.0 - closed) / 2.0;
        if !self.plane() {
            // The far side of the sphere, in proportion to what arrives there along the axis.
            let far = 1.0 / (1.0 + (2.0 * rho).min(500.0).exp());
            let back = self.random() <= far;
            light /= if back { far } else { 1.0 - far };
            axis = if back { -axis } else { axis };
        }
        let w = self.around(axis, cos);
        self.expect(q, w, path, light);
    }

    fn walk(&mut self) {
        let isotropic = self.set.g == 0.0;
        let mut q = if self.plane() { DVec3::ZERO } else { DVec3::new(0.0, 0.0, -self.set.radius) };
        let mut w = self.enter();
        let (mut path, mut light, mut limit) = (0.0, 1.0, 256.0);
        let mut collisions = 0u32;
        // Light that leaves after the first collision is counted elsewhere, unless it was reflected before.
        let mut counted = self.set.incidence == Incidence::Diffuse;
        loop {
            if (counted || collisions > 1) && (collisions == 0 || !isotropic) {
                self.expect(q, w, path, light);
            }
            let mut first = true;
            loop {
                let free = -self.random().ln() * self.path;
                let d = self.distance(q, w);
                if free < d {
                    q += free * w;
                    path += free;
                    break;
                }
                q += d * w;
                path += d;
                if self.plane() {
                    q.z = 0.0;
                }
                let normal = self.normal(q);
                let leaves = self.leaves(q, w);
                if !first && leaves > 0.0 {
                    self.deposit(q, path, light * leaves);
                }
                if leaves > 0.0 && self.random() <= leaves {
                    return;
                }
                first = false;
                counted |= collisions == 0;
                w -= 2.0 * w.dot(normal) * normal;
            }
            while path > limit {
                limit *= 4.0;
                if self.random() > 0.25 {
                    return;
                }
                light *= 4.0;
            }
            collisions += 1;
            if isotropic && (counted || collisions > 1) {
                self.expect_isotropic(q, path, light);
            }
            w = self.scatter(w);
        }
    }
}
