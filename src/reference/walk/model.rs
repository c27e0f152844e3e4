//! A model in the place of the walk: light enters as it does there, and the model says where it leaves.
//!
//! What a bin receives is int int T(x_i, x_o) dPhi(x_i) dA_o. The entry x_i is drawn from the light like the walk's; the
//! exit x_o once uniformly over the surface and once on the normal's line through a point of the tangent plane at x_i,
//! all its hits counted. With the densities p_1 = 1 / A and p_2 = q(r) |n_i . n_o|, where r is the distance in the plane,
//! each weighs T / (p_1 + p_2) (balance heuristic). q mixes e^(-r/s) / (2 pi r s) over three lengths s, so that neither the
//! 1 / r of a profile nor its tail makes large weights.

use super::exitance::{Bins, Light, enter};
use super::shape::{Body, Site};
use super::{Estimate, Tally};
use glam::DVec3;
use std::f64::consts::TAU;

/// A BSSRDF without its Fresnel factors.
pub trait Transfer: Sync {
    /// Exitance at `to` [1/length^2] per flux that entered at `from`, having travelled along the unit vector `travel`.
    fn transfer(&self, from: &Site, travel: DVec3, to: &Site) -> f64;
}

/// A function of the distance alone.
impl<F: Fn(f64) -> f64 + Sync> Transfer for F {
    fn transfer(&self, from: &Site, _: DVec3, to: &Site) -> f64 {
        self(from.position.distance(to.position))
    }
}

/// Flux that leaves each bin, and in all, by a model; units as in [`exitance`](super::exitance::exitance).
#[derive(Clone, Debug)]
pub struct Prediction {
    pub bins: Vec<Estimate>,
    pub all: Estimate,
}

/// Lets `models` carry the light; `lengths` are scales of their profiles.
pub fn predict(
    body: &impl Body,
    ior: f64,
    models: &[&dyn Transfer],
    light: Light,
    bins: Bins,
    lengths: [f64; 3],
    (paths, seed): (u64, u64),
) -> Vec<Prediction> {
    let Bins { count, of } = bins;
    let stride = count + 1;
    let uniform = 1.0 / body.area();
    let tally = Tally::run(stride * models.len(), paths, seed, |random, tally| {
        let Some((from, travel, _)) = enter(body, ior, light, random) else { return };
        let mut exits = vec![body.sample(random)];
        let (u, v) = from.normal.any_orthonormal_pair();
        let r = random.exponential() * lengths[(random.next() * 3.0) as usize];
        let (sin, cos) = (TAU * random.next()).sin_cos();
        body.meetings(from.position + r * (cos * u + sin * v), from.normal, &mut exits);
        // Sums by bin first: the variance is that of whole paths.
        let places: Vec<(usize, f64)> = exits
            .iter()
            .map(|to| {
                let offset = to.position - from.position;
                let r = (offset - offset.dot(from.normal) * from.normal).length();
                let plane = lengths.map(|s| (-r / s).exp() / (3.0 * TAU * r * s)).iter().sum::<f64>();
                ((of)(to.position, to.place), 1.0 / (uniform + plane * to.normal.dot(from.normal).abs()))
            })
            .collect();
        for (row, model) in models.iter().enumerate() {
            let mut all = 0.0;
            for (i, &(bin, _)) in places.iter().enumerate() {
                if places[..i].iter().any(|&(earlier, _)| earlier == bin) {
                    continue;
                }
                let same = places.iter().zip(&exits).filter(|((other, _), _)| *other == bin);
                let sum = same.map(|((_, weight), to)| weight * model.transfer(&from, travel, to)).sum();
                tally.add(row * stride + bin, sum);
                all += sum;
            }
            tally.add(row * stride + count, all);
        }
    });
    let flux = light.flux(body);
    let result = |row: usize| Prediction {
        bins: (0..count).map(|bin| tally.estimate(row * stride + bin).scaled(flux)).collect(),
        all: tally.estimate(row * stride + count).scaled(flux),
    };
    (0..models.len()).map(result).collect()
}
