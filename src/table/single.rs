//! Light that leaves after exactly one collision, for normal incidence on a half-space or a sphere: an integral.
//!
//! A pencil of light runs from the entry at the pole along the axis. Light that a collision at the axis point p sends
//! straight to the exit x, at the chord r from the pole and the angle theta from it as seen from the centre, has at x
//!
//!   R1(r) = sigma_s int e^(-sigma_t (z + d)) p(cos gamma) cos i (1 - F(cos i)) / d^2 dz,
//!
//! z the depth of p, d = |x - p|, gamma the angle of scattering, i the angle of incidence at x. With h the distance of x
//! from the axis and psi the elevation of p as seen from x, dz / d^2 = -d psi / h, psi = theta - pi/2 + i: an integral of
//! a smooth function over i, which diverges like 1 / r at r = 0. The plane has theta = 0, h = r.

use crate::reference::boundary::transmittance;
use crate::reference::math::integrate;
use std::f64::consts::{FRAC_PI_2, PI};

/// Panels of the quadrature on each side of the normal.
const PANELS: usize = 4;

/// Matter in units of one length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Matter {
    pub sigma_s: f64,
    pub sigma_a: f64,
    pub g: f64,
    /// Index of refraction, inside over outside.
    pub ior: f64,
}

impl Matter {
    /// R1 [1/length^2] at the chord r > 0 on a sphere of the radius, which may be infinite; 0 beyond its diameter.
    pub fn single(&self, r: f64, radius: f64) -> f64 {
        let half_sine = r / (2.0 * radius);
        if half_sine >= 1.0 {
            return 0.0;
        }
        let theta = 2.0 * half_sine.asin();
        let half_cosine = ((1.0 - half_sine) * (1.0 + half_sine)).sqrt();
        // Distance from the axis, and depth below the pole.
        let (h, below) = (r * half_cosine, r * half_sine);
        // The widest angle at which light leaves; ends of the axis as angles of incidence.
        let open = if self.ior > 1.0 { (1.0 / self.ior).asin() } else { FRAC_PI_2 };
        let highest = (FRAC_PI_2 - theta / 2.0).min(open);
        let lowest = (-theta / 2.0).max(-open);
        let sigma_t = self.sigma_s + self.sigma_a;
        let integrand = |i: f64| {
            let psi = theta - FRAC_PI_2 + i;
            let (sin, cos) = psi.sin_cos();
            if cos <= 0.0 {
                return 0.0;
            }
            let d = h / cos;
            let z = below - d * sin;
            // The pencil runs down, light leaves p towards x: cos gamma = sin psi.
            (-sigma_t * (z + d)).exp() * self.phase(sin) * i.cos() * transmittance(1.0 / self.ior, i.cos())
        };
        // The root of the transmittance at the widest angle is smooth in t, i = end (1 - t^2).
        let side = |end: f64| {
            let smooth = |t: f64| integrand(end * (1.0 - t * t)) * 2.0 * t;
            end.abs() * integrate(0.0, 1.0, PANELS, smooth)
        };
        self.sigma_s * (side(highest) + side(lowest)) / h
    }

    /// Part of the light that crosses a sphere along its axis and leaves at the far pole.
    pub fn pencil(&self, radius: f64) -> f64 {
        (-2.0 * radius * (self.sigma_s + self.sigma_a)).exp() * transmittance(1.0 / self.ior, 1.0)
    }

    /// Part of the light that leaves after one collision or none, before any reflection.
    pub fn directly(&self, radius: f64) -> f64 {
        // R1 is 1/r near the entry, e^(-sigma_t r) far from it: smooth in ln r.
        let scale = 1.0 / (self.sigma_s + self.sigma_a);
        let (low, high) = ((1e-7 * scale).ln(), (40.0 * scale).min(2.0 * radius).ln());
        let once = integrate(low, high, 6, |x| 2.0 * PI * (2.0 * x).exp() * self.single(x.exp(), radius));
        let inner = PI * (2.0 * low).exp() * 2.0 * self.single(low.exp(), radius);
        once + inner + self.pencil(radius)
    }

    /// Henyey-Greenstein phase function [1/sr].
    fn phase(&self, cos: f64) -> f64 {
        let g = self.g;
        (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * cos).powf(1.5))
    }
}
