//! A body in the light: what leaves each part of its surface.

use super::shape::{Body, Site};
use super::{End, Estimate, Matter, Random, Tally, entered, walk};
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Light from infinitely far away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Unit vector in which it shines; irradiance 1 across it.
    Directional(DVec3),
    /// Radiance 1 from everywhere.
    Uniform,
}

impl Light {
    /// Flux through the disk in which paths start.
    pub(super) fn flux(self, body: &impl Body) -> f64 {
        let (_, radius) = body.ball();
        match self {
            Light::Directional(_) => PI * radius * radius,
            Light::Uniform => 4.0 * PI * PI * radius * radius,
        }
    }
}

/// How a surface is divided.
#[derive(Clone, Copy)]
pub struct Bins<'a> {
    pub count: usize,
    /// The bin of a position and the shape's place there.
    pub of: &'a (dyn Fn(DVec3, usize) -> usize + Sync),
}

/// Flux [irradiance x area], by sigma_a.
#[derive(Clone, Debug)]
pub struct Exitance {
    /// Flux that leaves each bin, scattered or not; over the bin's area it is the mean exitance.
    pub bins: Vec<Estimate>,
    /// All that left.
    pub all: Estimate,
    /// All that was scattered and left.
    pub scattered: Estimate,
    /// What passed through without being scattered.
    pub straight: Estimate,
    /// What entered.
    pub entered: Estimate,
    /// Share of the paths that rounding or a hole in the mesh lost.
    pub lost: f64,
}

/// Follows `paths` paths from the light and weighs them for each of `absorptions` (sigma_a [1/length]; that of `matter`
/// is ignored).
///
/// Paths start uniformly in a disk across the light that covers the body, so shadows that it casts on itself are in.
pub fn exitance(
    body: &impl Body,
    matter: Matter,
    absorptions: &[f64],
    light: Light,
    bins: Bins,
    paths: u64,
    seed: u64,
) -> Vec<Exitance> {
    let least = absorptions.iter().copied().fold(f64::INFINITY, f64::min);
    let matter = Matter { sigma_a: least, ..matter };
    let Bins { count, of } = bins;
    let stride = count + 3;
    let all = stride * absorptions.len();
    let tally = Tally::run(all + 1, paths, seed, |random, tally| {
        let Some((site, _, inside)) = enter(body, matter.ior, light, random) else { return };
        tally.add(all, 1.0);
        let exit = match walk(body, &matter, site.position, inside, random) {
            End::Left(exit) => exit,
            End::Absorbed => return,
            End::Lost => {
                tally.lost += 1;
                return;
            }
        };
        for (row, &sigma_a) in absorptions.iter().enumerate() {
            let weight = exit.weight(sigma_a);
            tally.add(row * stride + of(exit.position, exit.place), weight);
            tally.add(row * stride + count, weight);
            tally.add(row * stride + count + if exit.scatterings == 0 { 2 } else { 1 }, weight);
        }
    });
    let flux = light.flux(body);
    let result = |row: usize| Exitance {
        bins: (0..count).map(|bin| tally.estimate(row * stride + bin).scaled(flux)).collect(),
        all: tally.estimate(row * stride + count).scaled(flux),
        scattered: tally.estimate(row * stride + count + 1).scaled(flux),
        straight: tally.estimate(row * stride + count + 2).scaled(flux),
        entered: tally.estimate(all).scaled(flux),
        lost: tally.lost as f64 / paths as f64,
    };
    (0..absorptions.len()).map(result).collect()
}

/// Where light enters, and its direction outside and inside; none if it misses the body or is reflected.
pub(super) fn enter(body: &impl Body, ior: f64, light: Light, random: &mut Random) -> Option<(Site, DVec3, DVec3)> {
    let travel = match light {
        Light::Directional(direction) => direction,
        Light::Uniform => random.direction(),
    };
    let origin = disk(body, travel, random.next(), random.next());
    let site = body.enter(origin, travel)?;
    let inside = entered(ior, travel, site.normal, random)?;
    Some((site, travel, inside))
}

/// A point of the disk across `travel` in front of the body, uniform for two uniform numbers in [0, 1).
fn disk(body: &impl Body, travel: DVec3, u: f64, v: f64) -> DVec3 {
    let (centre, radius) = body.ball();
    let (t, b) = travel.any_orthonormal_pair();
    let (s, c) = (TAU * v).sin_cos();
    // The start is outside of the ball, not on it.
    centre + radius * (u.sqrt() * (c * t + s * b) - 1.001 * travel)
}

/// How much each bin counts in the mean over what a camera at infinity sees: its visible area times cosine and Ft, since
/// the light towards a direction is exitance x Ft / (pi (1 - rho_e)).
///
/// `forward` is the unit vector of view. By `rays` x `rays` rays over the disk.
pub fn seen(body: &impl Body, ior: f64, forward: DVec3, bins: Bins, rays: u32) -> Vec<f64> {
    let mut weights = vec![0.0; bins.count];
    let place = |i: u32| (f64::from(i) + 0.5) / f64::from(rays);
    for (i, j) in (0..rays).flat_map(|i| (0..rays).map(move |j| (i, j))) {
        let origin = disk(body, forward, place(i), place(j));
        if let Some(site) = body.enter(origin, forward) {
            let (reflectance, _) = super::interface(ior, (-forward.dot(site.normal)).max(0.0));
            weights[(bins.of)(site.position, site.place)] += 1.0 - reflectance;
        }
    }
    weights
}
