//! Rough boundaries of translucent matter: how much light crosses, by the cosine outside. Twin of `rough.glsl`.
//!
//! # Transmittance
//! What the surface of translucent matter reflects is the dielectric GGX lobe of [`reflect`](super::reflect), whose
//! directional albedo at the cosine c is
//!
//!   E(c) = int f cos_i dw_i = int_disc F(wo.h) G2 / G1(wo) dp / pi,   h the visible normal that a point p of the disc picks
//!
//! (E. Heitz, JCGT 7 (2018)), without what would go below the horizon. What it does not reflect crosses, both ways:
//!
//!   T(c) = 1 - E(c),   1 - rho_e = 2 int T c dc,   n^2 (1 - rho_i) = 1 - rho_e,
//!
//! the last because light in equilibrium crosses alike from both sides, whatever the boundary. So reflected and
//! transmitted light add up to what arrives at every angle, roughness and index, and S stays reciprocal. The meaning of
//! the choice: light that one reflection would send into a neighbouring facet, which a single-scattering lobe drops,
//! enters. A dielectric facet does transmit most of it. T tends to 1 - F without roughness.
//!
//! # Table
//! BOUNDARY_NODES values of T, linear between them in the root of the cosine, which resolves grazing light. rho_e is the
//! exact integral of that interpolation, so that a furnace sums to 1 but for the errors of T at the eye's angle. For n from
//! 1.3 to 1.5 the interpolation's is below 3e-4 from roughness .1 and 3e-5 from .3 (tests/physics/rough.rs); below .1 it
//! reaches 1e-3 and more where the cosine is of the order of alpha.
//!
//! Where a texture changes the roughness, boundary and rho_e are those of the material's factor. Models but the
//! standard dipole keep the inner moments of the smooth boundary, and the directional dipole and the table its rho_e in the
//! dependence on direction: with them T is rough, too, but a furnace closes only about as well as T is like 1 - F.

use super::Inputs;
use super::boundary::{smith_g1, smith_g2, transmittance};
use super::math::integrate;
use crate::shared::{BOUNDARY_NODES, Material};
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};

/// Directional albedo E of the dielectric GGX lobe of width `alpha` > 0, seen from outside at the cosine `cos`, 0 to 1.
///
/// To 5e-5 for roughness (the root of alpha) from .1 and n > 1; for n < 1 the critical angle leaves up to 3e-3.
pub fn reflected(alpha: f64, n: f64, cos: f64) -> f64 {
    // In the tangent plane itself quotients are 0/0; this close to it they have their limits.
    let cos = cos.max(1e-9);
    let sin = ((1.0 - cos) * (1.0 + cos)).sqrt();
    // The view (s, 0, c) where the surface, stretched, has a sphere's normals; L is its length before.
    let length = (alpha * sin).hypot(cos);
    let (s, c) = (alpha * sin / length, cos / length);
    // Cosines of the view to the microfacet's normal and of the reflected light: normals lie at x across the plane of
    // incidence, on an arc of radius q at the angle psi from the view.
    let cosines = |x: f64, q: f64, psi: f64| {
        let half =
            DVec3::new(alpha * q * (psi.cos() * s - psi.sin() * c), alpha * x, q * (psi.cos() * c + psi.sin() * s));
        let norm = half.length();
        let cos_h = length * q * psi.cos() / norm;
        (cos_h, 2.0 * cos_h * half.z / norm - cos)
    };
    let arc = |a: f64| {
        let (x, q) = a.sin_cos();
        let light = |psi: f64| {
            let (cos_h, cos_i) = cosines(x, q, psi);
            let cos_i = cos_i.max(1e-300);
            let reflectance = 1.0 - transmittance(n, cos_h.clamp(0.0, 1.0));
            reflectance * smith_g2(alpha, cos, cos_i) / smith_g1(alpha, cos) * psi.cos()
        };
        let above = intervals(-c.asin(), FRAC_PI_2, |psi| cosines(x, q, psi).1);
        q * q * above.map(|(low, high)| integrate(low, high, 2, light)).sum::<f64>()
    };
    // dp = cos^2 a da cos psi dpsi over the visible part of the disc, (1 + c) / 2 of it, and pi / 2 of its half.
    2.0 / PI * integrate(0.0, FRAC_PI_2, 2, arc) / ((1.0 + c) / 2.0)
}

/// Where a smooth function that is negative at both ends is positive.
fn intervals(low: f64, high: f64, f: impl Fn(f64) -> f64) -> impl Iterator<Item = (f64, f64)> {
    const STEPS: u32 = 16;
    let at = |i: u32| low + (high - low) * f64::from(i) / f64::from(STEPS);
    let mut ends = vec![];
    for i in 0..STEPS {
        let (mut a, mut b) = (at(i), at(i + 1));
        let rising = f(b) > 0.0;
        if (f(a) > 0.0) == rising {
            continue;
        }
        for _ in 0..30 {
            let middle = (a + b) / 2.0;
            *(if (f(middle) > 0.0) == rising { &mut b } else { &mut a }) = middle;
        }
        ends.push((a + b) / 2.0);
    }
    if ends.len() % 2 == 1 {
        ends.push(high);
    }
    (0..ends.len() / 2).map(move |k| (ends[2 * k], ends[2 * k + 1]))
}

/// The tables of a scene's rough boundaries.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Boundaries {
    /// BOUNDARY_NODES values for each.
    pub nodes: Vec<f32>,
    /// (alpha, n, rho_e) of each.
    known: Vec<(f64, f64, f64)>,
}

impl Boundaries {
    /// [`Material::boundary`] of a roughness `alpha` > 0 and index of refraction, and the diffuse reflectance rho_e from
    /// outside.
    pub fn add(&mut self, alpha: f64, n: f64) -> (u32, f64) {
        if let Some(place) = self.known.iter().position(|known| (known.0, known.1) == (alpha, n)) {
            return (place as u32 + 1, self.known[place].2);
        }
        let last = f64::from(BOUNDARY_NODES - 1);
        let nodes: Vec<f32> = (0..BOUNDARY_NODES)
            .into_par_iter()
            .map(|i| (1.0 - reflected(alpha, n, (f64::from(i) / last).powi(2))) as f32)
            .collect();
        // With c = t^2; a polynomial of degree 4 between nodes.
        let part = |i: u32| {
            let (t0, t1) = (f64::from(i) / last, f64::from(i + 1) / last);
            integrate(t0, t1, 1, |t| 4.0 * t.powi(3) * interpolated(&nodes, t * t))
        };
        let rho_e = 1.0 - (0..BOUNDARY_NODES - 1).map(part).sum::<f64>();
        self.nodes.extend(&nodes);
        self.known.push((alpha, n, rho_e));
        (self.known.len() as u32, rho_e)
    }
}

/// T at a cosine, from one table.
pub fn interpolated(nodes: &[f32], cos: f64) -> f64 {
    let x = cos.clamp(0.0, 1.0).sqrt() * (nodes.len() - 1) as f64;
    let i = (x as usize).min(nodes.len() - 2);
    let (low, high) = (f64::from(nodes[i]), f64::from(nodes[i + 1]));
    low + (x - i as f64) * (high - low)
}

/// Share of the light at a cosine outside that crosses the surface of a translucent material.
pub fn crossing(inputs: &Inputs, material: &Material, cos: f64) -> f64 {
    if material.boundary == 0 {
        return transmittance(material.ior.into(), cos);
    }
    let nodes = BOUNDARY_NODES as usize;
    interpolated(&inputs.boundaries[(material.boundary as usize - 1) * nodes..][..nodes], cos)
}
