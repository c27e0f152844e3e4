//! The surface between the outside and the matter: Fresnel reflectance, its moments, and the GGX microfacet model.
//!
//! # Fresnel
//! Relative index e = n_transmitted / n_incident, cosines c and c' = sqrt(1 - (1 - c^2) / e^2) of incidence and
//! refraction. For unpolarised light at a smooth dielectric
//!
//!   F(e, c) = (r_s^2 + r_p^2) / 2,  r_s = (c - e c') / (c + e c'),  r_p = (e c - c') / (e c + c'),
//!
//! and F = 1 where c' is imaginary (total reflection). `n` is inside over outside, so light from outside sees e = n.
//!
//! # Moments
//! C_k = int_0^1 F(e, c) c^k dc. The diffuse reflectance is rho = 2 C_1: rho_e for light from outside (e = n), rho_i for
//! light from inside (e = 1/n). For n > 1 (J. W. T. Walsh 1926; S. Q. Duntley, JOSA 32 (1942))
//!
//!   rho_e = 1/2 + (n-1)(3n+1) / (6 (n+1)^2) + n^2 (n^2-1)^2 / (n^2+1)^3 ln((n-1)/(n+1))
//!           - 2 n^3 (n^2+2n-1) / ((n^2+1)(n^4-1)) + 8 n^4 (n^4+1) / ((n^2+1)(n^4-1)^2) ln n,
//!
//! and, since n^2 (1 - rho_i) = 1 - rho_e (the same rays, counted from both sides), rho_i follows. For n < 1 the sides
//! change places. The closed form subtracts terms of size 1 / (n - 1), so close to 1 quadrature takes over.
//!
//! Quadrature: with cc = sqrt(1 - 1/n^2), the cosine of the critical angle, the rays that cross are c_i = cc cosh x
//! inside and c_e = n cc sinh x outside. There r_s = e^(-2x) and r_p = (cosh x - n^2 sinh x) / (cosh x + n^2 sinh x):
//! entire functions but for a far pole, for every n. Inside, cosines below cc are reflected totally:
//!
//!   C_k(inside) = cc^(k+1) [1 / (k+1) + int F cosh^k x sinh x dx],  C_k(outside) = (n cc)^(k+1) int F sinh^k x cosh x dx,
//!
//! x from 0 to arcosh(1/cc).
//!
//! # Microfacets
//! GGX with Smith's height-correlated masking-shadowing: B. Walter et al., "Microfacet models for refraction through
//! rough surfaces", EGSR 2007, eq. 33; E. Heitz, "Understanding the masking-shadowing function", JCGT 3 (2014), eqs. 72
//! and 99; visible normals by E. Heitz, "Sampling the GGX distribution of visible normals", JCGT 7 (2018), listing 1.
//! Fresnel of metallic-roughness materials: C. Schlick, "An inexpensive BRDF model", CGF 13 (1994), eq. 24.

use super::math::integrate;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Unpolarised reflectance of a smooth dielectric. `e` is the index beyond the surface over the index before it, `cos`
/// the cosine of incidence, 0 to 1.
pub fn fresnel(e: f64, cos: f64) -> f64 {
    let refracted = 1.0 - (1.0 - cos * cos) / (e * e);
    if refracted <= 0.0 {
        return 1.0;
    }
    let refracted = refracted.sqrt();
    let s = (cos - e * refracted) / (cos + e * refracted);
    let p = (e * cos - refracted) / (e * cos + refracted);
    (s * s + p * p) / 2.0
}

/// Transmittance 1 - F seen from outside: 0 at grazing incidence and, for n < 1, beyond the critical angle.
pub fn transmittance(n: f64, cos: f64) -> f64 {
    // At n = 1 nothing reflects, down to grazing incidence, where F is 0/0.
    if n == 1.0 { 1.0 } else { 1.0 - fresnel(n, cos) }
}

/// Which side of the surface light comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    Outside,
    Inside,
}

/// C_k = int F c^k dc over the cosines of one side; `n` > 0 is inside over outside.
pub fn moment(n: f64, k: i32, side: Side) -> f64 {
    if n == 1.0 {
        return 0.0;
    }
    // The denser side is the one with total reflection.
    let (dense, inside) = if n > 1.0 { (n, side == Side::Inside) } else { (1.0 / n, side == Side::Outside) };
    let critical = ((dense - 1.0) * (dense + 1.0)).sqrt() / dense;
    let reflectance = |x: f64| {
        let p = (x.cosh() - dense * dense * x.sinh()) / (x.cosh() + dense * dense * x.sinh());
        ((-4.0 * x).exp() + p * p) / 2.0
    };
    let end = (1.0 / critical).acosh();
    if inside {
        let crossing = integrate(0.0, end, 8, |x| reflectance(x) * x.cosh().powi(k) * x.sinh());
        critical.powi(k + 1) * (1.0 / f64::from(k + 1) + crossing)
    } else {
        let crossing = integrate(0.0, end, 8, |x| reflectance(x) * x.sinh().powi(k) * x.cosh());
        (dense * critical).powi(k + 1) * crossing
    }
}

/// Cosine of refraction of light that arrives from outside at the cosine `cos`; 0 where it does not enter.
pub fn cos_refracted(n: f64, cos: f64) -> f64 {
    (1.0 - (1.0 - cos) * (1.0 + cos) / (n * n)).max(0.0).sqrt()
}

/// Diffuse reflectance of the surface for light from `side`, 2 C_1, 0 to 1.
pub fn diffuse_reflectance(n: f64, side: Side) -> f64 {
    let dense = if n > 1.0 { n } else { 1.0 / n };
    // Below, the closed form keeps fewer than 13 digits.
    if dense < 1.03 {
        return 2.0 * moment(n, 1, side);
    }
    let (n1, n2) = (dense, dense * dense);
    let n4 = n2 * n2;
    let outside = 0.5
        + (n1 - 1.0) * (3.0 * n1 + 1.0) / (6.0 * (n1 + 1.0).powi(2))
        + n2 * (n2 - 1.0).powi(2) / (n2 + 1.0).powi(3) * ((n1 - 1.0) / (n1 + 1.0)).ln()
        - 2.0 * n1 * n2 * (n2 + 2.0 * n1 - 1.0) / ((n2 + 1.0) * (n4 - 1.0))
        + 8.0 * n4 * (n4 + 1.0) / ((n2 + 1.0) * (n4 - 1.0).powi(2)) * n1.ln();
    if (n > 1.0) == (side == Side::Outside) { outside } else { 1.0 - (1.0 - outside) / n2 }
}

/// Density of microfacet normals, per projected area and solid angle; `cos` is the normal's cosine.
pub fn ggx(alpha: f64, cos: f64) -> f64 {
    if cos <= 0.0 {
        return 0.0;
    }
    // 1 - cos^2 (1 - alpha^2), in a form that keeps alpha^2 where cos is 1.
    let d = (1.0 - cos) * (1.0 + cos) + (alpha * cos).powi(2);
    alpha * alpha / (PI * d * d)
}

fn smith_lambda(alpha: f64, cos: f64) -> f64 {
    let tan2 = (1.0 - cos * cos).max(0.0) / (cos * cos);
    ((1.0 + alpha * alpha * tan2).sqrt() - 1.0) / 2.0
}

/// Share of the microfacets that is visible from a direction with this cosine.
pub fn smith_g1(alpha: f64, cos: f64) -> f64 {
    1.0 / (1.0 + smith_lambda(alpha, cos))
}

/// Share that is both visible and lit; height-correlated.
pub fn smith_g2(alpha: f64, cos_o: f64, cos_i: f64) -> f64 {
    1.0 / (1.0 + smith_lambda(alpha, cos_o) + smith_lambda(alpha, cos_i))
}

/// Microfacet normal drawn among those visible from `wo` (z is the surface's normal), from two numbers in [0, 1).
pub fn visible_normal(alpha: f64, wo: DVec3, u1: f64, u2: f64) -> DVec3 {
    let stretched = DVec3::new(alpha * wo.x, alpha * wo.y, wo.z).normalize();
    let length2 = stretched.x * stretched.x + stretched.y * stretched.y;
    let t = if length2 > 0.0 { DVec3::new(-stretched.y, stretched.x, 0.0) / length2.sqrt() } else { DVec3::X };
    let b = stretched.cross(t);
    let r = u1.sqrt();
    let (sin, cos) = (TAU * u2).sin_cos();
    let x = r * cos;
    let s = (1.0 + stretched.z) / 2.0;
    let y = (1.0 - s) * (1.0 - x * x).max(0.0).sqrt() + s * r * sin;
    let h = x * t + y * b + (1.0 - x * x - y * y).max(0.0).sqrt() * stretched;
    DVec3::new(alpha * h.x, alpha * h.y, h.z.max(0.0)).normalize()
}

/// Density, per solid angle of the reflected direction, of reflecting about [`visible_normal`].
pub fn visible_normal_pdf(alpha: f64, cos_o: f64, cos_h: f64) -> f64 {
    ggx(alpha, cos_h) * smith_g1(alpha, cos_o) / (4.0 * cos_o)
}

/// Schlick's reflectance; `f0` is the one at normal incidence.
pub fn schlick(f0: DVec3, cos: f64) -> DVec3 {
    f0 + (DVec3::ONE - f0) * (1.0 - cos).clamp(0.0, 1.0).powi(5)
}
