//! Models on the half-space: a thin beam along the normal, and light from everywhere.

use crate::reference::math::integrate;
use crate::reference::walk::model::Transfer;
use crate::reference::walk::searchlight::{Incidence, Searchlight, searchlight};
use crate::reference::walk::shape::Site;
use crate::reference::walk::{Estimate, Matter, interface};
use glam::{DVec3, dvec3};
use std::f64::consts::PI;

/// Ends of the rings: within a hundredth of a mean free path, then five a decade to 100, then the rest.
fn radii() -> Vec<f64> {
    let middle = (0..=20).map(|i| 10f64.powf(f64::from(i) / 5.0 - 2.0));
    [0.0].into_iter().chain(middle).chain([1e4]).collect()
}

/// What leaves a half-space, by rings, per flux that entered.
pub struct Truth {
    beam: Searchlight,
    even: Estimate,
}

/// What a model makes of it.
pub struct Verdict {
    /// Error of the total of a thin beam, relative.
    pub beam: Estimate,
    /// Light that a thin beam leaves in the wrong place, over all that leaves, and what noise adds to it.
    pub l1: Estimate,
    /// Error under light from everywhere.
    pub even: Estimate,
}

impl Truth {
    /// By `paths` paths for each kind of light.
    pub fn new(matter: Matter, paths: u64, seed: u64) -> Truth {
        let run = |incidence, seed| searchlight(matter, &[matter.sigma_a], incidence, &radii(), paths, seed).remove(0);
        Truth { beam: run(Incidence::Angle(0.0), seed), even: run(Incidence::Lambertian, seed + 1).total }
    }

    pub fn judge(&self, ior: f64, model: &dyn Transfer) -> Verdict {
        let rings = rings(model, DVec3::NEG_Z);
        let true_rings: Vec<Estimate> = self
            .beam
            .rings
            .iter()
            .zip(radii().windows(2))
            .map(|(r, ends)| r.scaled(PI * (ends[1].powi(2) - ends[0].powi(2))))
            .collect();
        let wrong: f64 = rings.iter().zip(&true_rings).map(|(a, b)| (a - b.mean).abs()).sum();
        let noise: f64 = true_rings.iter().map(|ring| ring.error).sum();
        let relative =
            |found: f64, truth: Estimate| Estimate { mean: found / truth.mean - 1.0, error: truth.error / truth.mean };
        let share = integrate(0.0, 1.0, 4, |cos| 2.0 * cos * (1.0 - interface(ior, cos).0));
        let of_angle = |cos: f64| rings_total(model, dvec3((1.0 - cos * cos).sqrt(), 0.0, -cos));
        let even = integrate(0.0, 1.0, 1, |cos| 2.0 * cos * (1.0 - interface(ior, cos).0) * of_angle(cos)) / share;
        let total = self.beam.total;
        Verdict {
            beam: relative(rings.iter().sum(), total),
            l1: Estimate { mean: wrong / total.mean, error: (2.0 / PI).sqrt() * noise / total.mean },
            even: relative(even, self.even),
        }
    }
}

fn rings_total(model: &dyn Transfer, travel: DVec3) -> f64 {
    rings(model, travel).iter().sum()
}

/// Flux that leaves each ring by a model.
fn rings(model: &dyn Transfer, travel: DVec3) -> Vec<f64> {
    let from = Site { position: DVec3::ZERO, normal: DVec3::Z, place: 0 };
    let at = |r: f64| {
        let value = |angle: f64| {
            let to = Site { position: r * dvec3(angle.cos(), angle.sin(), 0.0), ..from };
            model.transfer(&from, travel, &to)
        };
        r * 2.0 * integrate(0.0, PI, 1, value)
    };
    let radii = radii();
    let ring = |ends: &[f64]| match ends[0] {
        // r R(r) is finite at 0.
        0.0 => integrate(0.0, ends[1], 1, at),
        start => integrate(start.ln(), ends[1].ln(), 1 + (ends[1] / start / 10.0) as usize, |x| x.exp() * at(x.exp())),
    };
    radii.windows(2).map(ring).collect()
}
