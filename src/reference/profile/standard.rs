//! The standard dipole: its closed forms and its inversion. Twin of `profile_standard.glsl`.
//!
//! # Profile
//! H. W. Jensen, S. R. Marschner, M. Levoy, P. Hanrahan, "A practical model for subsurface light transport", SIGGRAPH
//! 2001, section 2.3, in the form of C. Donner, H. W. Jensen, SIGGRAPH 2005, eqs. 1 to 5 (eq. 4 of 2001 is misprinted in
//! its second term). With sigma_t' = sigma_s' + sigma_a, alpha' = sigma_s' / sigma_t':
//!
//!   sigma_tr = sqrt(3 sigma_a sigma_t'),  z_r = 1 / sigma_t',  z_v = z_r (1 + 4 A / 3),  A = (1 + rho_i) / (1 - rho_i),
//!   Rd(r) = alpha' / 2 * shape(r),
//!   shape(r) = the sum of the [sources](super::Source) at z_r and z_v, which are also the sampler's components.
//!
//! # Closed forms
//! With e = sigma_tr z_r = sqrt(3 (1 - alpha')):
//!
//!   mass = e^(-sigma_tr z_r) + e^(-sigma_tr z_v),
//!   total = alpha' / 2 * (1 + e^(-4 A e / 3)) e^(-e)                      (Jensen, Buhler 2002, eq. 11),
//!   cdf(R) = alpha' / 2 * sum of [e^(-sigma_tr z) - (z / d_R) e^(-sigma_tr d_R)],
//!   mtf(k) = alpha' / 2 * [e^(-z_r q) + e^(-z_v q)],  q = sqrt(sigma_tr^2 + k^2)    (Hankel transform).
//!
//! # Inversion
//! The total falls monotonically with e from 1 at e = 0; solving for e and not for alpha' = 1 - e^2 / 3 keeps digits
//! where the total is close to 1: there 1 - alpha' is the square of 1 - total.

use super::super::boundary::{Side, diffuse_reflectance};
use super::super::math::solve_falling;
use super::{COMPONENTS, Coefficients, Matter, Options, Radial, Source};
use crate::shared::Material;

/// The standard dipole of one channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dipole {
    /// Reduced single scattering albedo alpha', 0 to 1.
    pub albedo: f64,
    /// Effective transport coefficient [1/length].
    pub sigma_tr: f64,
    /// Depth of the real source, a length.
    pub z_real: f64,
    /// Height of the virtual source, a length.
    pub z_virtual: f64,
}

/// A of the boundary condition: (1 + rho_i) / (1 - rho_i).
pub fn boundary_factor(ior: f64) -> f64 {
    factor(diffuse_reflectance(ior, Side::Inside))
}

fn factor(rho_i: f64) -> f64 {
    (1.0 + rho_i) / (1.0 - rho_i)
}

impl Dipole {
    /// From the coefficients [1/length], both >= 0, and the index of refraction, inside over outside, > 0.
    ///
    /// Matter that does not scatter has the albedo 0; its lengths are then arbitrary.
    pub fn new(sigma_s_prime: f64, sigma_a: f64, ior: f64) -> Dipole {
        Dipole::with_factor(sigma_s_prime, sigma_a, boundary_factor(ior))
    }

    fn with_factor(sigma_s_prime: f64, sigma_a: f64, a: f64) -> Dipole {
        if sigma_s_prime <= 0.0 {
            return Dipole { albedo: 0.0, sigma_tr: 0.0, z_real: 1.0, z_virtual: 1.0 };
        }
        let sigma_t_prime = sigma_s_prime + sigma_a;
        let z_real = 1.0 / sigma_t_prime;
        Dipole {
            albedo: sigma_s_prime / sigma_t_prime,
            sigma_tr: (3.0 * sigma_a * sigma_t_prime).sqrt(),
            z_real,
            z_virtual: z_real * (1.0 + 4.0 / 3.0 * a),
        }
    }

    pub(super) fn of(matter: &Coefficients) -> Dipole {
        let a = factor(matter.diffuse_reflectance(Side::Inside));
        Dipole::with_factor(matter.sigma_s_prime, matter.sigma_a, a)
    }

    pub(super) fn unpack(matter: Matter, c: usize) -> Dipole {
        let material = matter.material;
        Dipole {
            albedo: 2.0,
            sigma_tr: f64::from(material.sigma_tr[c]),
            z_real: f64::from(material.z_real[c]),
            z_virtual: f64::from(material.z_virtual[c]),
        }
    }

    /// The real and the virtual source.
    pub fn sources(&self) -> [Source; 2] {
        [self.z_real, self.z_virtual].map(|z| Source { sigma: self.sigma_tr, z })
    }

    fn sum(&self, f: impl Fn(Source) -> f64) -> f64 {
        self.sources().map(f).iter().sum()
    }
}

impl Radial for Dipole {
    fn shape_shifted(&self, r: f64, exponent: f64) -> f64 {
        self.sum(|source| source.shape_shifted(r, exponent))
    }

    fn strength(&self) -> f64 {
        self.albedo / 2.0
    }

    fn masses(&self) -> [f64; COMPONENTS] {
        let [real, mirrored] = self.sources().map(|source| source.mass());
        [real, mirrored, 0.0]
    }

    fn inside(&self, radius: f64) -> f64 {
        self.sum(|source| source.inside(radius))
    }

    fn outside(&self, radius: f64) -> f64 {
        self.sum(|source| source.outside(radius))
    }

    fn response(&self, k: f64) -> f64 {
        self.sum(|source| source.response(k))
    }

    fn radius(&self, component: usize, _share: f64, u: f64) -> f64 {
        self.sources()[component].radius(u)
    }

    fn rate(&self) -> f64 {
        self.sigma_tr
    }

    fn pack(&self, c: usize, _options: &Options, material: &mut Material) {
        material.sigma_tr[c] = self.sigma_tr as f32;
        material.z_real[c] = self.z_real as f32;
        material.z_virtual[c] = self.z_virtual as f32;
    }
}

/// e = sqrt(3 (1 - alpha')) of the matter with the given total (0 to 1) and index of refraction.
///
/// sigma_t' = sigma_tr / e, alpha' = 1 - e^2 / 3. 1 at least gives 0, 0 at most gives sqrt(3). The total of the result is within
/// 1e-15 of the one asked for, which is nine digits of it from 1e-6 up and of 1 - total up to 1 - 1e-6.
pub fn invert_total(total: f64, ior: f64) -> f64 {
    let a = boundary_factor(ior);
    let of = |e: f64| (1.0 - e * e / 3.0) / 2.0 * (1.0 + (-4.0 / 3.0 * a * e).exp()) * (-e).exp();
    solve_falling(total, 3f64.sqrt(), of)
}
