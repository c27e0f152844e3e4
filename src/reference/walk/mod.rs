//! A random walk through the matter itself: what every diffusion model approximates. It shares no code with the models.
//!
//! Light enters through a smooth dielectric surface, is scattered and absorbed inside one homogeneous body, and leaves
//! through the same surface. With sigma_s, sigma_a [1/length], phase function of mean cosine g and relative index n:
//!
//! - a free path is -ln(1 - u) / sigma_s, so absorption does not end a path: over the length L it weighs e^(-sigma_a L).
//!   One walk therefore serves every sigma_a, and the weight is computed once, where the light leaves;
//! - the angle of scattering follows L. G. Henyey, J. L. Greenstein, ApJ 93 (1941), eq. 2, whose distribution function
//!   inverts to cos = (1 + g^2 - ((1 - g^2) / (1 - g + 2 g u))^2) / (2 g);
//! - at the surface, Fresnel's equations decide between reflection and refraction, so a path leaves once and as a whole:
//!   without absorption everything that enters leaves;
//! - a path whose weight for the least absorbing channel has fallen to `LATE` is absorbed at that channel's rate from
//!   there on: its end is drawn before it starts, and survivors weigh as much more as they are fewer.
//!
//! Nothing is cut off and nothing is approximated, so the only error is the stated standard error. Light that leaves does
//! not enter again elsewhere on a concave body: the renderer does not model that either.
//!
//! A light without extent cannot be met by a path that leaves through a smooth surface. So the walk goes from the light:
//! [`exitance`] counts what leaves each part of a surface. [`searchlight`] does so for one thin beam onto a half-space.
//! [`radiance`] goes from the eye, and says what it does instead.

pub mod boundary;
pub mod exitance;
pub mod mesh;
pub mod model;
pub mod radiance;
pub mod searchlight;
pub mod shape;

use boundary::{Boundary, Onward};
use glam::DVec3;
use rayon::prelude::*;
use shape::{Met, Shape};
use std::f64::consts::TAU;

/// Weight from which on a path may end inside.
const LATE: f64 = 1e-2;

/// Independent streams into which the paths are divided: results do not depend on threads.
const STREAMS: u64 = 256;

/// Homogeneous matter of one channel; coefficients in 1/length of the geometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Matter {
    /// Scattering coefficient, not reduced, > 0.
    pub sigma_s: f64,
    /// Absorption coefficient, >= 0.
    pub sigma_a: f64,
    /// Mean cosine of the phase function, -1 < g < 1.
    pub g: f64,
    /// Index of refraction, inside over outside, > 0.
    pub ior: f64,
}

impl Matter {
    /// Scattering of the albedo alpha' (0 < alpha' <= 1) and the reduced mean free path 1 / sigma_t' = 1, isotropic.
    pub fn isotropic(albedo: f64, ior: f64) -> Matter {
        Matter { sigma_s: albedo, sigma_a: 1.0 - albedo, g: 0.0, ior }
    }

    /// sigma_s (1 - g).
    pub fn sigma_s_prime(&self) -> f64 {
        self.sigma_s * (1.0 - self.g)
    }

    /// alpha' = sigma_s' / (sigma_s' + sigma_a).
    pub fn albedo(&self) -> f64 {
        self.sigma_s_prime() / (self.sigma_s_prime() + self.sigma_a)
    }
}

/// A path that has left the matter.
#[derive(Clone, Copy, Debug)]
pub struct Exit {
    /// On the surface.
    pub position: DVec3,
    /// Outward, unit.
    pub normal: DVec3,
    /// Outside, after refraction; unit.
    pub direction: DVec3,
    /// Part of the surface, as the shape counts them.
    pub place: usize,
    /// Length of the path inside.
    pub length: f64,
    /// Times it was scattered.
    pub scatterings: u64,
    /// Probability with which a path lives that long.
    survival: f64,
}

impl Exit {
    /// What is left of the light that entered; `sigma_a` at least that of the matter that was walked.
    pub fn weight(&self, sigma_a: f64) -> f64 {
        (-sigma_a * self.length).exp() / self.survival
    }
}

/// How a path ends.
#[derive(Clone, Copy, Debug)]
pub enum End {
    Left(Exit),
    Absorbed,
    /// Rounding carried it through a surface; meshes that are not closed lose light.
    Lost,
}

/// Follows light inside `shape` from `position` on its surface in the unit vector `direction`, which points inside. The
/// surface is smooth.
pub fn walk(shape: &impl Shape, matter: &Matter, position: DVec3, direction: DVec3, random: &mut Random) -> End {
    walk_behind(&Boundary { ior: matter.ior, alpha: 0.0 }, shape, matter, position, direction, random)
}

/// As [`walk`], behind a surface that may be rough.
pub fn walk_behind(
    boundary: &Boundary,
    shape: &impl Shape,
    matter: &Matter,
    position: DVec3,
    direction: DVec3,
    random: &mut Random,
) -> End {
    let Matter { sigma_s, sigma_a, g, .. } = *matter;
    let late = -LATE.ln() / sigma_a;
    let end = late + random.exponential() / sigma_a;
    let (mut position, mut direction) = (position, direction);
    let (mut length, mut scatterings) = (0.0, 0);
    let mut free = random.exponential() / sigma_s;
    while length <= end {
        match shape.leave(position, direction, free) {
            Met::Nothing => {
                position += direction * free;
                length += free;
                scatterings += 1;
                direction = scattered(direction, g, random);
                free = random.exponential() / sigma_s;
            }
            Met::Surface { distance, normal, place } => {
                position += direction * distance;
                length += distance;
                free -= distance;
                if length > end {
                    break;
                }
                let direction = match boundary.from_inside(direction, normal, random) {
                    Onward::Out(direction) => direction,
                    Onward::Back(back) => {
                        direction = back;
                        continue;
                    }
                };
                let survival = if length > late { (-sigma_a * (length - late)).exp() } else { 1.0 };
                return End::Left(Exit { position, normal, direction, place, length, scatterings, survival });
            }
            Met::Outside => return End::Lost,
        }
    }
    End::Absorbed
}

/// The direction inside of light that travels along `direction` onto a surface of outward `normal`; none if it is
/// reflected, which Fresnel's equations decide.
pub fn entered(ior: f64, direction: DVec3, normal: DVec3, random: &mut Random) -> Option<DVec3> {
    let cos = -direction.dot(normal);
    let (reflectance, refracted) = interface(ior, cos);
    (cos > 0.0 && random.next() >= reflectance)
        .then(|| ((direction + cos * normal) / ior - refracted * normal).normalize())
}

/// Unpolarised Fresnel reflectance, and the cosine of refraction; `n` is the index beyond over the index before.
pub fn interface(n: f64, cos: f64) -> (f64, f64) {
    if n == 1.0 {
        return (0.0, cos);
    }
    let sin2 = (1.0 - cos * cos) / (n * n);
    if sin2 >= 1.0 {
        return (1.0, 0.0);
    }
    let refracted = (1.0 - sin2).sqrt();
    let parallel = (n * cos - refracted) / (n * cos + refracted);
    let perpendicular = (cos - n * refracted) / (cos + n * refracted);
    ((parallel * parallel + perpendicular * perpendicular) / 2.0, refracted)
}

fn scattered(direction: DVec3, g: f64, random: &mut Random) -> DVec3 {
    if g == 0.0 {
        return random.direction();
    }
    let u = random.next();
    let ratio = (1.0 - g * g) / (1.0 - g + 2.0 * g * u);
    let cos = ((1.0 + g * g - ratio * ratio) / (2.0 * g)).clamp(-1.0, 1.0);
    let sin = (1.0 - cos * cos).sqrt();
    let (s, c) = (TAU * random.next()).sin_cos();
    let (t, b) = direction.any_orthonormal_pair();
    (cos * direction + sin * (c * t + s * b)).normalize()
}

/// xoshiro256++ (D. Blackman, S. Vigna, ACM TOMS 47 (2021)), seeded by SplitMix64.
#[derive(Clone, Debug)]
pub struct Random([u64; 4]);

impl Random {
    pub fn new(seed: u64, stream: u64) -> Random {
        let mut state = seed.wrapping_mul(0xd134_2543_de82_ef95).wrapping_add(stream);
        Random(std::array::from_fn(|_| {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            z ^ (z >> 31)
        }))
    }

    fn bits(&mut self) -> u64 {
        let s = &mut self.0;
        let out = s[0].wrapping_add(s[3]).rotate_left(23).wrapping_add(s[0]);
        let t = s[1] << 17;
        s[2] ^= s[0];
        s[3] ^= s[1];
        s[1] ^= s[2];
        s[0] ^= s[3];
        s[2] ^= t;
        s[3] = s[3].rotate_left(45);
        out
    }

    /// In [0, 1).
    #[allow(clippy::should_implement_trait)]
    pub fn next(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Of mean 1, > 0.
    pub fn exponential(&mut self) -> f64 {
        -(((self.bits() >> 12) as f64 + 0.5) / (1u64 << 52) as f64).ln()
    }

    /// Uniform over the unit sphere.
    pub fn direction(&mut self) -> DVec3 {
        let z = 2.0 * self.next() - 1.0;
        let r = (1.0 - z * z).sqrt();
        let (s, c) = (TAU * self.next()).sin_cos();
        DVec3::new(r * c, r * s, z)
    }
}

/// A mean and its standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    pub mean: f64,
    pub error: f64,
}

impl Estimate {
    /// Mean and error times a constant.
    pub fn scaled(self, factor: f64) -> Estimate {
        Estimate { mean: self.mean * factor, error: self.error * factor }
    }
}

/// Sums over paths, by bin.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    paths: f64,
    /// Sum and sum of squares.
    bins: Vec<(f64, f64)>,
    /// Paths that were lost.
    pub lost: u64,
}

impl Tally {
    /// Runs `paths` paths (rounded up to whole streams); `path` follows one and adds what it brings, at most once to each
    /// bin.
    pub fn run(bins: usize, paths: u64, seed: u64, path: impl Fn(&mut Random, &mut Tally) + Sync) -> Tally {
        let stream = |stream: u64| {
            let mut random = Random::new(seed, stream);
            let mut tally = Tally { bins: vec![(0.0, 0.0); bins], ..Tally::default() };
            for _ in 0..paths.div_ceil(STREAMS) {
                path(&mut random, &mut tally);
                tally.paths += 1.0;
            }
            tally
        };
        let parts: Vec<Tally> = (0..STREAMS).into_par_iter().map(stream).collect();
        let mut sum = Tally { bins: vec![(0.0, 0.0); bins], ..Tally::default() };
        for part in parts {
            sum.paths += part.paths;
            sum.lost += part.lost;
            for (sum, part) in sum.bins.iter_mut().zip(part.bins) {
                *sum = (sum.0 + part.0, sum.1 + part.1);
            }
        }
        sum
    }

    pub fn add(&mut self, bin: usize, weight: f64) {
        let (sum, squares) = &mut self.bins[bin];
        *sum += weight;
        *squares += weight * weight;
    }

    /// Mean per path.
    pub fn estimate(&self, bin: usize) -> Estimate {
        let (sum, squares) = self.bins[bin];
        let mean = sum / self.paths;
        let variance = (squares / self.paths - mean * mean).max(0.0);
        Estimate { mean, error: (variance / (self.paths - 1.0)).sqrt() }
    }
}
