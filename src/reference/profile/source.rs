//! One source of a dipole: flux through the surface from a point at the distance z below or above it.
//!
//!   shape(r) = z (1 + s d) e^(-s d) / (2 pi d^3),  d = sqrt(r^2 + z^2),  s = sigma_tr.
//!
//! Since z (1 + s d) e^(-s d) r / d^3 is the derivative of -(z / d) e^(-s d) by r, the mass is e^(-s z), the part beyond
//! R is (z / d_R) e^(-s d_R), and the Hankel transform is e^(-z q) with q = sqrt(s^2 + k^2).
//!
//! # Sampler
//! The distribution function is 1 - (z / d) e^(-s (d - z)). With d = z (1 + t) its inverse is
//!
//!   ln(1 + t) + s z t = -ln(1 - u),
//!
//! that is d = W(s z e^(s z) / (1 - u)) / s with Lambert's W, and d = z / (1 - u) at s = 0. The left side is concave, so
//! Newton's method rises to the solution from any start.

use std::f64::consts::TAU;

/// A source of strength 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Source {
    /// Effective transport coefficient [1/length].
    pub sigma: f64,
    /// Distance from the surface, a length, > 0.
    pub z: f64,
}

impl Source {
    /// shape(r) e^exponent [1/length^2].
    pub fn shape_shifted(&self, r: f64, exponent: f64) -> f64 {
        let d = r.hypot(self.z);
        self.z * (1.0 + self.sigma * d) * (exponent - self.sigma * d).exp() / (d * d * d) / TAU
    }

    /// Integral of shape over the plane.
    pub fn mass(&self) -> f64 {
        (-self.sigma * self.z).exp()
    }

    /// Integral of shape within a radius.
    pub fn inside(&self, radius: f64) -> f64 {
        let d = radius.hypot(self.z);
        // d - z without cancellation.
        let rise = radius * (radius / (d + self.z));
        let fall = (-self.sigma * rise).exp();
        self.mass() * (fall * rise / d - (-self.sigma * rise).exp_m1())
    }

    /// Integral of shape beyond a radius.
    pub fn outside(&self, radius: f64) -> f64 {
        let d = radius.hypot(self.z);
        self.z / d * (-self.sigma * d).exp()
    }

    /// Hankel transform of shape.
    pub fn response(&self, k: f64) -> f64 {
        (-self.z * self.sigma.hypot(k)).exp()
    }

    /// Distance d >= z from the source of the point that the number u in [0, 1) picks.
    pub fn distance(&self, u: f64) -> f64 {
        self.z * (1.0 + self.excess(u))
    }

    /// Radius in the plane of that point.
    pub fn radius(&self, u: f64) -> f64 {
        let t = self.excess(u);
        self.z * (t * (t + 2.0)).sqrt()
    }

    /// t = d / z - 1 of the sampler.
    fn excess(&self, u: f64) -> f64 {
        let k = self.sigma * self.z;
        let target = -(-u).ln_1p();
        // Without the second term, or without the first: the solution is below both.
        let mut t = target / (1.0 + k);
        for _ in 0..64 {
            let step = (target - t.ln_1p() - k * t) * (1.0 + t) / (1.0 + k * (1.0 + t));
            t += step;
            if step.abs() <= 1e-16 * t {
                break;
            }
        }
        t.max(0.0)
    }
}
