//! Normalised diffusion. Twin of `profile_burley.glsl`.
//!
//! # Profile
//! P. H. Christensen, B. Burley, "Approximate reflectance profiles for efficient subsurface scattering", Pixar technical
//! memo 15-04, 2015. With the surface albedo A, a length l and d = l / s:
//!
//!   Rd(r) = A * shape(r),  shape(r) = (e^(-r/d) + e^(-r/(3d))) / (8 pi d r),
//!
//! whose total is A exactly. s is one of three [fits](Fit) to Monte Carlo of half-spaces without a refracting boundary.
//! At r = 0 it is infinite and integrable: what is below [`BURLEY_RADIUS_MIN`] counts as there, in value and density
//! alike, which changes no weight by more than the share of the light that is so close, 1e-8 at most.
//!
//! # Which length
//! An author's albedo and length are A and l. Of matter given by coefficients, A is the standard dipole's total and l the
//! diffuse mean free path 1 / sigma_tr, whose fit errs least where the boundary refracts; without absorption that is
//! infinite, and l is the mean free path 1 / sigma_t'.
//!
//! # Closed forms and sampler
//! Each exponential is a component: mass 1/4, r = -d ln(1 - u), and mass 3/4, r = -3 d ln(1 - u). The Hankel transform is
//! [1 / sqrt(1 + k^2 d^2) + 3 / sqrt(1 + 9 k^2 d^2)] / 4.

use super::{COMPONENTS, Coefficients, Dipole, Matter, Options, Radial};
use crate::scene::LengthKind;
use crate::shared::{BURLEY_RADIUS_MIN, Material};
use std::f64::consts::PI;

/// How s depends on the albedo A, by what the length is and how light enters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fit {
    /// Perpendicular beam, mean free path: s = 1.85 - A + 7 |A - 0.8|^3 (eq. 5).
    Searchlight,
    /// Diffuse light, mean free path: s = 1.9 - A + 3.5 (A - 0.8)^2 (eq. 6).
    Diffuse,
    /// Perpendicular beam, diffuse mean free path: s = 3.5 + 100 (A - 0.33)^4 (eq. 8).
    DiffuseMeanFreePath,
}

impl Fit {
    /// s for an albedo of 0 to 1.
    pub fn scale(self, albedo: f64) -> f64 {
        match self {
            Fit::Searchlight => 1.85 - albedo + 7.0 * (albedo - 0.8).abs().powi(3),
            Fit::Diffuse => 1.9 - albedo + 3.5 * (albedo - 0.8).powi(2),
            Fit::DiffuseMeanFreePath => 3.5 + 100.0 * (albedo - 0.33).powi(4),
        }
    }
}

/// Normalised diffusion in one channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Burley {
    /// Total of the profile, 0 to 1.
    pub albedo: f64,
    /// 1 / d [1/length].
    pub rate: f64,
}

impl Burley {
    /// From the albedo (0 to 1), a length and the fit that goes with it.
    pub fn new(albedo: f64, length: f64, fit: Fit) -> Burley {
        Burley { albedo, rate: fit.scale(albedo) / length }
    }

    pub(super) fn of(matter: &Coefficients) -> Burley {
        if matter.sigma_s_prime <= 0.0 {
            return Burley { albedo: 0.0, rate: 1.0 };
        }
        if let Some((albedo, length, kind)) = matter.appearance {
            let fit = match kind {
                LengthKind::MeanFreePath => Fit::Searchlight,
                LengthKind::DiffuseMeanFreePath => Fit::DiffuseMeanFreePath,
            };
            return Burley::new(albedo, length, fit);
        }
        let dipole = Dipole::of(matter);
        if dipole.sigma_tr > 0.0 {
            Burley::new(dipole.total(), 1.0 / dipole.sigma_tr, Fit::DiffuseMeanFreePath)
        } else {
            Burley::new(1.0, dipole.z_real, Fit::Searchlight)
        }
    }

    pub(super) fn unpack(matter: Matter, c: usize) -> Burley {
        Burley { albedo: 1.0, rate: f64::from(matter.material.sigma_tr[c]) }
    }
}

impl Radial for Burley {
    fn shape_shifted(&self, r: f64, exponent: f64) -> f64 {
        let r = r.max(f64::from(BURLEY_RADIUS_MIN));
        let x = self.rate * r;
        ((exponent - x).exp() + (exponent - x / 3.0).exp()) * self.rate / (8.0 * PI * r)
    }

    fn strength(&self) -> f64 {
        self.albedo
    }

    fn masses(&self) -> [f64; COMPONENTS] {
        [0.25, 0.75, 0.0]
    }

    fn inside(&self, radius: f64) -> f64 {
        let x = self.rate * radius;
        -((-x).exp_m1() + 3.0 * (-x / 3.0).exp_m1()) / 4.0
    }

    fn outside(&self, radius: f64) -> f64 {
        let x = self.rate * radius;
        ((-x).exp() + 3.0 * (-x / 3.0).exp()) / 4.0
    }

    fn response(&self, k: f64) -> f64 {
        let x = k / self.rate;
        (1.0 / x.hypot(1.0) + 3.0 / (3.0 * x).hypot(1.0)) / 4.0
    }

    fn radius(&self, component: usize, _share: f64, u: f64) -> f64 {
        -(-u).ln_1p() / self.rate * if component == 0 { 1.0 } else { 3.0 }
    }

    fn rate(&self) -> f64 {
        self.rate / 3.0
    }

    fn pack(&self, c: usize, _options: &Options, material: &mut Material) {
        material.sigma_tr[c] = self.rate as f32;
    }
}
