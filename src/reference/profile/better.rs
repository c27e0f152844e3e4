//! The better dipole: Grosjean's diffusion with a boundary condition for flux and fluence. Twin of `profile_better.glsl`.
//!
//! # Profile
//! E. d'Eon, "A better dipole", 2012. With b = 1 - alpha' = sigma_a / sigma_t' and the internal moments of Fresnel's
//! equations C_1, C_2:
//!
//!   D = (1 + b) / (3 sigma_t'),  sigma_tr = sqrt(sigma_a / D) = sigma_t' sqrt(3 b / (1 + b)),
//!   C_phi = (1 - 2 C_1) / 4,  C_E = (1 - 3 C_2) / 2,  A = (1 - C_E) / (2 C_phi),
//!   z_r = 1 / sigma_t',  z_v = z_r + 4 A D (a height, positive),
//!   Rd(r) = alpha'^2 C_E / 2 * shape(r),
//!   shape(r) = source(z_r) + source(z_v) + k / (2 pi) [e^(-s d_r) / d_r - e^(-s d_v) / d_v],
//!
//! where source(z) is that of [`Source`], s = sigma_tr and k = C_phi / (C_E D). It contains light that was scattered more
//! than once alone, hence alpha'^2.
//!
//! The bracket subtracts nearly equal numbers where r is large. With d_v - d_r = (z_v^2 - z_r^2) / (d_v + d_r) and
//! phi(x) = (1 - e^(-x)) / x it is
//!
//!   e^(-s d_r) (d_v - d_r) / d_v [1 / d_r + s phi(s (d_v - d_r))].
//!
//! # Sampler
//! d/dz of e^(-s d) / d is -(z / d) (1 + s d) e^(-s d) / d^2: the bracket over 2 pi is the integral of source(z) over the
//! heights from z_r to z_v. So shape is a mixture of sources: one at z_r, one at z_v, and a line of the weight k per
//! length between them, each height of which has the mass e^(-s z). The third component draws a height y above z_r from
//! that truncated exponential, s y = -ln(1 - u (1 - e^(-s L))) with L = z_v - z_r, then a radius from its source: exact.
//!
//! # Closed forms
//!   mass = e^(-s z_r) + e^(-s z_v) + k L e^(-s z_r) phi(s L),
//!   response(q) = e^(-z_r q) + e^(-z_v q) + k L e^(-z_r q) phi(q L),  q = sqrt(s^2 + k_x^2);
//!
//! at sigma_a = 0 the total is C_E + 2 A C_phi = 1.
//!
//! # Inversion
//! By t = sigma_tr z_r, which rises with b = t^2 / (3 - t^2) from 0 to sqrt(3/2).

use super::super::boundary::{Side, moment};
use super::super::math::solve_falling;
use super::{COMPONENTS, Coefficients, Matter, Options, Radial, Source};
use crate::scene::LengthKind;
use crate::shared::Material;
use std::f64::consts::TAU;

/// The better dipole of one channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BetterDipole {
    /// Rd over shape: alpha'^2 C_E / 2.
    pub strength: f64,
    /// Effective transport coefficient [1/length].
    pub sigma_tr: f64,
    /// Depth of the real source, a length.
    pub z_real: f64,
    /// Height of the virtual source, a length.
    pub z_virtual: f64,
    /// k = C_phi / (C_E D) [1/length].
    pub fluence: f64,
}

/// C_phi and C_E of an index of refraction, inside over outside.
pub fn boundary_constants(ior: f64) -> (f64, f64) {
    ((1.0 - 2.0 * moment(ior, 1, Side::Inside)) / 4.0, (1.0 - 3.0 * moment(ior, 2, Side::Inside)) / 2.0)
}

/// (1 - e^(-x)) / x.
pub(super) fn phi(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { -(-x).exp_m1() / x }
}

impl BetterDipole {
    /// From b = sigma_a / sigma_t' (0 to 1), sigma_t' [1/length] and the index of refraction, inside over outside.
    pub fn new(b: f64, sigma_t_prime: f64, ior: f64) -> BetterDipole {
        let (c_phi, c_e) = boundary_constants(ior);
        let z_real = 1.0 / sigma_t_prime;
        let diffusion = (1.0 + b) / 3.0 * z_real;
        BetterDipole {
            strength: (1.0 - b).powi(2) * c_e / 2.0,
            sigma_tr: sigma_t_prime * (3.0 * b / (1.0 + b)).sqrt(),
            z_real,
            z_virtual: z_real + 2.0 * (1.0 - c_e) / c_phi * diffusion,
            fluence: c_phi / (c_e * diffusion),
        }
    }

    /// As the coefficients have it; where an author gave albedo and length, so that they are its total and length.
    pub(super) fn of(matter: &Coefficients) -> BetterDipole {
        let sigma_t_prime = matter.sigma_s_prime + matter.sigma_a;
        if matter.sigma_s_prime <= 0.0 {
            return BetterDipole { strength: 0.0, ..BetterDipole::new(0.0, 1.0, matter.ior) };
        }
        let Some((albedo, length, kind)) = matter.appearance else {
            return BetterDipole::new(matter.sigma_a / sigma_t_prime, sigma_t_prime, matter.ior);
        };
        let t = invert_total(albedo, matter.ior);
        let sigma_t_prime = match kind {
            LengthKind::DiffuseMeanFreePath if t > 0.0 => 1.0 / (length * t),
            _ => 1.0 / length,
        };
        BetterDipole::new(t * t / (3.0 - t * t), sigma_t_prime, matter.ior)
    }

    pub(super) fn unpack(matter: Matter, c: usize) -> BetterDipole {
        let material = matter.material;
        BetterDipole {
            strength: 1.0,
            sigma_tr: f64::from(material.sigma_tr[c]),
            z_real: f64::from(material.z_real[c]),
            z_virtual: f64::from(material.z_virtual[c]),
            fluence: f64::from(material.fluence[c]),
        }
    }

    fn source(&self, z: f64) -> Source {
        Source { sigma: self.sigma_tr, z }
    }

    fn sum(&self, f: impl Fn(Source) -> f64) -> f64 {
        f(self.source(self.z_real)) + f(self.source(self.z_virtual))
    }

    /// d_r, d_v and their difference.
    fn distances(&self, r: f64) -> (f64, f64, f64) {
        let (near, far) = (r.hypot(self.z_real), r.hypot(self.z_virtual));
        (near, far, (self.z_virtual - self.z_real) * ((self.z_virtual + self.z_real) / (near + far)))
    }
}

impl Radial for BetterDipole {
    fn shape_shifted(&self, r: f64, exponent: f64) -> f64 {
        let s = self.sigma_tr;
        let (near, far, gap) = self.distances(r);
        let line = (exponent - s * near).exp() * (gap / far) * (1.0 / near + s * phi(s * gap));
        self.sum(|source| source.shape_shifted(r, exponent)) + self.fluence * line / TAU
    }

    fn strength(&self) -> f64 {
        self.strength
    }

    fn masses(&self) -> [f64; COMPONENTS] {
        let (near, far) = (self.source(self.z_real).mass(), self.source(self.z_virtual).mass());
        let length = self.z_virtual - self.z_real;
        [near, far, self.fluence * near * length * phi(self.sigma_tr * length)]
    }

    fn inside(&self, radius: f64) -> f64 {
        // The integral over heights above z: (e^(-s z) - e^(-s d)) / s.
        let above = |z: f64| {
            let rise = radius * (radius / (radius.hypot(z) + z));
            (-self.sigma_tr * z).exp() * rise * phi(self.sigma_tr * rise)
        };
        self.sum(|source| source.inside(radius)) + self.fluence * (above(self.z_real) - above(self.z_virtual))
    }

    fn outside(&self, radius: f64) -> f64 {
        let (near, _, gap) = self.distances(radius);
        let line = (-self.sigma_tr * near).exp() * gap * phi(self.sigma_tr * gap);
        self.sum(|source| source.outside(radius)) + self.fluence * line
    }

    fn response(&self, k: f64) -> f64 {
        let q = self.sigma_tr.hypot(k);
        let length = self.z_virtual - self.z_real;
        self.sum(|source| source.response(k)) + self.fluence * (-self.z_real * q).exp() * length * phi(q * length)
    }

    fn radius(&self, component: usize, share: f64, u: f64) -> f64 {
        let z = match component {
            0 => self.z_real,
            1 => self.z_virtual,
            _ => {
                let length = self.z_virtual - self.z_real;
                let x = self.sigma_tr * length;
                let part = if x < 1e-9 { share } else { -(share * (-x).exp_m1()).ln_1p() / x };
                self.z_real + length * part
            }
        };
        self.source(z).radius(u)
    }

    fn rate(&self) -> f64 {
        self.sigma_tr
    }

    fn pack(&self, c: usize, _options: &Options, material: &mut Material) {
        material.sigma_tr[c] = self.sigma_tr as f32;
        material.z_real[c] = self.z_real as f32;
        material.z_virtual[c] = self.z_virtual as f32;
        material.fluence[c] = self.fluence as f32;
    }
}

/// t = sigma_tr / sigma_t' of the matter with the given total (0 to 1) and index of refraction.
///
/// 1 at least gives 0, 0 at most gives sqrt(3/2). The total of the result is within 1e-15 of the one asked for.
pub fn invert_total(total: f64, ior: f64) -> f64 {
    solve_falling(total, 1.5f64.sqrt(), |t| BetterDipole::new(t * t / (3.0 - t * t), 1.0, ior).total())
}
