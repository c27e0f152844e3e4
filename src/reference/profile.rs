//! The diffusion profile of matter: the standard dipole, its closed forms, its sampler and its inversion.
//!
//! # Profile
//! H. W. Jensen, S. R. Marschner, M. Levoy, P. Hanrahan, "A practical model for subsurface light transport", SIGGRAPH
//! 2001, section 2.3, in the form of C. Donner, H. W. Jensen, SIGGRAPH 2005, eqs. 1 to 5 (eq. 4 of 2001 is misprinted in
//! its second term). With sigma_t' = sigma_s' + sigma_a, alpha' = sigma_s' / sigma_t':
//!
//!   sigma_tr = sqrt(3 sigma_a sigma_t'),  z_r = 1 / sigma_t',  z_v = z_r (1 + 4 A / 3),  A = (1 + rho_i) / (1 - rho_i),
//!   Rd(r) = alpha' / 2 * shape(r),
//!   shape(r) = 1 / (2 pi) * sum over z in {z_r, z_v} of z (1 + sigma_tr d) e^(-sigma_tr d) / d^3,  d = sqrt(r^2 + z^2).
//!
//! Rd is exitance per unit of flux that has entered. What leaves towards wo is
//!
//!   S = Ft(wi) Ft(wo) Rd(r) / (pi (1 - rho_e)),
//!
//! whose last factor (E. d'Eon, "A better dipole", 2012) makes the light over all directions equal Rd; Jensen et al. 2001,
//! eq. 5, have 1 / pi.
//!
//! # Closed forms
//! With e = sigma_tr z_r = sqrt(3 (1 - alpha')), and since z (1 + s d) e^(-s d) r / d^3 is the derivative of
//! -(z / d) e^(-s d) by r:
//!
//!   mass = int 2 pi r shape dr = e^(-sigma_tr z_r) + e^(-sigma_tr z_v),
//!   total = alpha' / 2 * (1 + e^(-4 A e / 3)) e^(-e)                      (Jensen, Buhler 2002, eq. 11),
//!   cdf(R) = alpha' / 2 * sum of [e^(-sigma_tr z) - (z / d_R) e^(-sigma_tr d_R)],
//!   mtf(k) = alpha' / 2 * [e^(-z_r q) + e^(-z_v q)],  q = sqrt(sigma_tr^2 + k^2)    (Hankel transform).
//!
//! # Sampler
//! One source z alone has the distribution function 1 - (z / d) e^(-sigma_tr (d - z)). With d = z (1 + s) its inverse is
//!
//!   ln(1 + s) + sigma_tr z s = -ln(1 - u),
//!
//! that is d = W(sigma_tr z e^(sigma_tr z) / (1 - u)) / sigma_tr with Lambert's W, and d = z / (1 - u) at sigma_tr = 0.
//! The left side is concave, so Newton's method rises to the solution from any start.
//!
//! # Inversion
//! The total falls monotonically with e from 1 at e = 0; solving for e and not for alpha' = 1 - e^2 / 3 keeps digits
//! where the total is close to 1: there 1 - alpha' is the square of 1 - total.

use super::boundary::{Side, diffuse_reflectance};
use crate::settings::Normalisation;
use crate::shared::{self, TRANSLUCENT};
use glam::{DVec3, Vec3};
use std::f64::consts::{PI, TAU};

/// Radius that stands for "no ball".
pub const UNBOUNDED: f32 = 1e30;

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
    let rho = diffuse_reflectance(ior, Side::Inside);
    (1.0 + rho) / (1.0 - rho)
}

impl Dipole {
    /// From the coefficients [1/length], both >= 0, and the index of refraction, inside over outside, > 0.
    ///
    /// Matter that does not scatter has the albedo 0; its lengths are then arbitrary.
    pub fn new(sigma_s_prime: f64, sigma_a: f64, ior: f64) -> Dipole {
        if sigma_s_prime <= 0.0 {
            return Dipole { albedo: 0.0, sigma_tr: 0.0, z_real: 1.0, z_virtual: 1.0 };
        }
        let sigma_t_prime = sigma_s_prime + sigma_a;
        let z_real = 1.0 / sigma_t_prime;
        Dipole {
            albedo: sigma_s_prime / sigma_t_prime,
            sigma_tr: (3.0 * sigma_a * sigma_t_prime).sqrt(),
            z_real,
            z_virtual: z_real * (1.0 + 4.0 / 3.0 * boundary_factor(ior)),
        }
    }

    fn sources(&self) -> [f64; 2] {
        [self.z_real, self.z_virtual]
    }

    /// The profile over alpha'/2 [1/length^2].
    pub fn shape(&self, r: f64) -> f64 {
        let source = |z: f64| {
            let d = r.hypot(z);
            z * (1.0 + self.sigma_tr * d) * (-self.sigma_tr * d).exp() / (d * d * d)
        };
        self.sources().map(source).iter().sum::<f64>() / TAU
    }

    /// Integral of [`Dipole::shape`] over the plane.
    pub fn mass(&self) -> f64 {
        self.sources().map(|z| (-self.sigma_tr * z).exp()).iter().sum()
    }

    /// Exitance per unit flux that entered at distance r [1/length^2].
    pub fn rd(&self, r: f64) -> f64 {
        self.albedo / 2.0 * self.shape(r)
    }

    /// Total of the profile, 0 to 1.
    pub fn total(&self) -> f64 {
        self.albedo / 2.0 * self.mass()
    }

    /// Part of the total within `radius`.
    pub fn cdf(&self, radius: f64) -> f64 {
        let source = |z: f64| {
            let d = radius.hypot(z);
            // d - z without cancellation.
            let rise = radius * (radius / (d + z));
            let fall = (-self.sigma_tr * rise).exp();
            (-self.sigma_tr * z).exp() * (fall * rise / d - (-self.sigma_tr * rise).exp_m1())
        };
        self.albedo / 2.0 * self.sources().map(source).iter().sum::<f64>()
    }

    /// Amplitude of the exitance under the irradiance cos(k x).
    pub fn mtf(&self, k: f64) -> f64 {
        let q = self.sigma_tr.hypot(k);
        self.albedo / 2.0 * self.sources().map(|z| (-z * q).exp()).iter().sum::<f64>()
    }

    /// Distance d >= z from the source at height z of the point that the number u in [0, 1) picks.
    pub fn distance(&self, u: f64, z: f64) -> f64 {
        z * (1.0 + self.excess(u, z))
    }

    /// Radius in the plane of that point.
    pub fn radius(&self, u: f64, z: f64) -> f64 {
        let s = self.excess(u, z);
        z * (s * (s + 2.0)).sqrt()
    }

    /// s = d / z - 1 of the sampler.
    fn excess(&self, u: f64, z: f64) -> f64 {
        source_excess(self.sigma_tr * z, u)
    }

    /// Smallest radius beyond which at most `share` of the total lies; infinite for share <= 0.
    pub fn radius_beyond(&self, share: f64) -> f64 {
        if share <= 0.0 {
            return f64::INFINITY;
        }
        let tail = |radius: f64| {
            let source = |z: f64| {
                let d = radius.hypot(z);
                z / d * (-self.sigma_tr * d).exp()
            };
            self.sources().map(source).iter().sum::<f64>()
        };
        let allowed = share * self.mass();
        if tail(0.0) <= allowed {
            return 0.0;
        }
        let (mut below, mut above) = (0.0, self.z_virtual);
        while tail(above) > allowed {
            below = above;
            above *= 2.0;
        }
        while above - below > 1e-14 * above {
            let middle = (below + above) / 2.0;
            *(if tail(middle) > allowed { &mut below } else { &mut above }) = middle;
        }
        above
    }
}

/// Solves ln(1 + s) + k s = -ln(1 - u) for s >= 0, where k = sigma_tr z and u is in [0, 1).
pub(super) fn source_excess(k: f64, u: f64) -> f64 {
    let target = -(-u).ln_1p();
    // Without the second term, or without the first: the solution is below both.
    let mut s = target / (1.0 + k);
    for _ in 0..64 {
        let step = (target - s.ln_1p() - k * s) * (1.0 + s) / (1.0 + k * (1.0 + s));
        s += step;
        if step.abs() <= 1e-16 * s {
            break;
        }
    }
    s.max(0.0)
}

/// e = sqrt(3 (1 - alpha')) of the matter with the given total (0 to 1) and index of refraction.
///
/// sigma_t' = sigma_tr / e, alpha' = 1 - e^2 / 3. 1 at least gives 0, 0 at most gives sqrt(3).
pub fn invert_total(total: f64, ior: f64) -> f64 {
    let a = boundary_factor(ior);
    let of = |e: f64| (1.0 - e * e / 3.0) / 2.0 * (1.0 + (-4.0 / 3.0 * a * e).exp()) * (-e).exp();
    let (mut low, mut high) = (0.0, 3f64.sqrt());
    if total >= 1.0 {
        return low;
    }
    while high - low > 1e-16 * high {
        let middle = (low + high) / 2.0;
        if middle <= low || middle >= high {
            break;
        }
        *(if of(middle) > total { &mut low } else { &mut high }) = middle;
    }
    high
}

/// The BSSRDF part of a material as kernels read it; the rest is zero, for the caller to fill.
///
/// Coefficients in 1/internal unit. Channels that scatter are equally probable; within one, a source is as probable as
/// its part of the mass. `radius_tail` is the share of the energy beyond `radius_max`; 0 has no ball.
pub fn material(
    sigma_s_prime: DVec3,
    sigma_a: DVec3,
    ior: f64,
    normalisation: Normalisation,
    radius_tail: f64,
) -> shared::Material {
    let channels: [Dipole; 3] = std::array::from_fn(|c| Dipole::new(sigma_s_prime[c], sigma_a[c], ior));
    let scattering = || channels.iter().filter(|c| c.albedo > 0.0);
    let probability = 1.0 / scattering().count().max(1) as f64;
    let leaving = match normalisation {
        Normalisation::Energy => PI * (1.0 - diffuse_reflectance(ior, Side::Outside)),
        Normalisation::Jensen2001 => PI,
    };
    let vector = |f: &dyn Fn(&Dipole) -> f64| DVec3::from(channels.each_ref().map(f)).as_vec3();

    let mut cumulative = 0.0;
    let mut component_cdf = [0f32; 6];
    for (c, channel) in channels.iter().enumerate().filter(|(_, channel)| channel.albedo > 0.0) {
        for (s, z) in channel.sources().into_iter().enumerate() {
            cumulative += probability * (-channel.sigma_tr * z).exp() / channel.mass();
            component_cdf[2 * c + s..].fill(cumulative as f32);
        }
        // The last channel that scatters ends at 1 exactly.
        if channels[c + 1..].iter().all(|later| later.albedo == 0.0) {
            component_cdf[2 * c + 1..].fill(1.0);
        }
    }
    let radius_max = scattering().map(|c| c.radius_beyond(radius_tail)).fold(0.0, f64::max);
    let camera_rate = scattering().map(|c| c.sigma_tr).reduce(f64::min).unwrap_or(0.0);
    shared::Material {
        sigma_tr: vector(&|c| c.sigma_tr),
        z_real: vector(&|c| c.z_real),
        z_virtual: vector(&|c| c.z_virtual),
        strength: vector(&|c| c.albedo / 2.0 / leaving),
        density: vector(&|c| if c.albedo > 0.0 { probability / c.mass() } else { 0.0 }),
        component_cdf,
        radius_max: (radius_max as f32).min(UNBOUNDED),
        camera_rate: camera_rate as f32,
        ior: ior as f32,
        base_color: Vec3::ZERO,
        flags: TRANSLUCENT,
        ..Default::default()
    }
}
