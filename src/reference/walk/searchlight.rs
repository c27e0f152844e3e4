//! A thin beam onto a half-space: exitance by distance from where it entered.

use super::shape::HalfSpace;
use super::{End, Estimate, Matter, Random, Tally, entered, walk};
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// The direction of the beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Incidence {
    /// Angle from the normal (radians), 0 to pi/2; the beam travels towards +x.
    Angle(f64),
    /// Any direction, cosine-weighted.
    Lambertian,
}

/// What leaves per unit of flux that has entered.
#[derive(Clone, Debug)]
pub struct Searchlight {
    /// Ends of the rings, ascending.
    pub radii: Vec<f64>,
    /// Mean exitance of each ring [1/length^2].
    pub rings: Vec<Estimate>,
    /// All of it, 0 to 1.
    pub total: Estimate,
    /// What was scattered once.
    pub single: Estimate,
}

/// Follows `paths` paths, and weighs them for each of `absorptions` (sigma_a [1/length]; that of `matter` is ignored).
///
/// `radii` are the ends of the rings, ascending from 0. A sigma_a of 0 would need paths without end: all must be > 0.
pub fn searchlight(
    matter: Matter,
    absorptions: &[f64],
    incidence: Incidence,
    radii: &[f64],
    paths: u64,
    seed: u64,
) -> Vec<Searchlight> {
    let least = absorptions.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(least > 0.0, "a half-space without absorption keeps light forever");
    let matter = Matter { sigma_a: least, ..matter };
    let rings = radii.len() - 1;
    // Per absorption: the rings, the total, single scattering.
    let stride = rings + 2;
    let tally = Tally::run(stride * absorptions.len(), paths, seed, |random, tally| {
        let direction = enter(incidence, matter.ior, random);
        let End::Left(exit) = walk(&HalfSpace, &matter, DVec3::ZERO, direction, random) else { return };
        let ring = radii.partition_point(|&end| end <= exit.position.length());
        for (row, &sigma_a) in absorptions.iter().enumerate() {
            let weight = exit.weight(sigma_a);
            if (1..=rings).contains(&ring) {
                tally.add(row * stride + ring - 1, weight);
            }
            tally.add(row * stride + rings, weight);
            if exit.scatterings == 1 {
                tally.add(row * stride + rings + 1, weight);
            }
        }
    });
    let area = |ring: usize| PI * (radii[ring + 1] - radii[ring]) * (radii[ring + 1] + radii[ring]);
    let result = |row: usize| Searchlight {
        radii: radii.to_vec(),
        rings: (0..rings).map(|ring| tally.estimate(row * stride + ring).scaled(1.0 / area(ring))).collect(),
        total: tally.estimate(row * stride + rings),
        single: tally.estimate(row * stride + rings + 1),
    };
    (0..absorptions.len()).map(result).collect()
}

/// A direction inside of light that has entered.
fn enter(incidence: Incidence, ior: f64, random: &mut Random) -> DVec3 {
    loop {
        let outside = match incidence {
            Incidence::Angle(angle) => DVec3::new(angle.sin(), 0.0, -angle.cos()),
            Incidence::Lambertian => {
                let cos2 = 1.0 - random.next();
                let (s, c) = (TAU * random.next()).sin_cos();
                DVec3::new((1.0 - cos2).sqrt() * c, (1.0 - cos2).sqrt() * s, -cos2.sqrt())
            }
        };
        if let Some(inside) = entered(ior, outside, DVec3::Z, random) {
            return inside;
        }
    }
}
