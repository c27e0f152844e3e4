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
//! Where a texture changes the roughness, the table has ROUGHNESS_ROWS such rows, at equal steps of the root of its share
//! from 0, and is linear between them, too, to 1e-3 of T from a roughness of .1. T is that of the place where light enters,
//! T and 1 - rho_e those of the place where it leaves. Inside, matter knows one boundary, that of the material's factor.
//!
//! The standard dipole takes its inner moment from rho_e; other models keep those of the smooth boundary. The directional
//! dipole keeps rho_e in its dependence on direction: with it a furnace closes only about as well as T is like 1 - F.

use super::Inputs;
use super::boundary::{Side, cos_refracted, diffuse_reflectance, smith_g1, smith_g2, transmittance};
use super::math::integrate;
use crate::Normalisation;
use crate::shared::{BOUNDARY_NODES, BOUNDARY_ROW, Material, ROUGHNESS_ROWS};
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

/// What matter knows of a rough boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rough {
    /// Diffuse reflectance rho_e from outside.
    pub reflectance: f64,
    /// Mean of 1 - mu' over diffuse light that has entered, mu' the cosine of refraction.
    pub obliqueness: f64,
}

/// The tables of a scene's rough boundaries.
#[derive(Clone, Debug, PartialEq)]
pub struct Boundaries {
    /// Rows of BOUNDARY_ROW numbers, for each boundary as many.
    pub values: Vec<f32>,
    /// 1, or ROUGHNESS_ROWS where textures change the roughness.
    rows: u32,
    normalisation: Normalisation,
    /// alpha, n and what came of them.
    known: Vec<(f64, f64, Rough)>,
}

impl Boundaries {
    /// No boundary yet; `textured` where textures change the roughness.
    pub fn new(textured: bool, normalisation: Normalisation) -> Boundaries {
        let rows = if textured { ROUGHNESS_ROWS } else { 1 };
        Boundaries { values: vec![], rows, normalisation, known: vec![] }
    }

    /// [`Features::rough`](crate::shared::Features::rough).
    pub fn feature(&self) -> u32 {
        if self.known.is_empty() { 0 } else { self.rows }
    }

    /// [`Material::boundary`] of a roughness `alpha` > 0 and index of refraction, and what matter knows of it.
    pub fn add(&mut self, alpha: f64, n: f64) -> (u32, Rough) {
        if let Some(place) = self.known.iter().position(|known| (known.0, known.1) == (alpha, n)) {
            return (place as u32 + 1, self.known[place].2);
        }
        let mut rough = Rough { reflectance: 0.0, obliqueness: 0.0 };
        for row in 1..=self.rows {
            // The last row is the factor's; roughness is the root of alpha.
            let root = if self.rows == 1 { 1.0 } else { f64::from(row - 1) / f64::from(self.rows - 1) };
            let nodes = nodes(alpha * root.powi(4), n);
            let crossing = mean(&nodes, |_| 1.0);
            rough.reflectance = 1.0 - crossing;
            rough.obliqueness = mean(&nodes, |cos| 1.0 - cos_refracted(n, cos)) / crossing;
            self.values.extend(&nodes);
            self.values.push(match self.normalisation {
                Normalisation::Energy => crossing as f32,
                Normalisation::Jensen2001 => 1.0,
            });
        }
        self.known.push((alpha, n, rough));
        (self.known.len() as u32, rough)
    }
}

/// T at the nodes; without roughness that of Fresnel.
fn nodes(alpha: f64, n: f64) -> Vec<f32> {
    let crossing = |cos: f64| if alpha > 0.0 { 1.0 - reflected(alpha, n, cos) } else { transmittance(n, cos) };
    let last = f64::from(BOUNDARY_NODES - 1);
    (0..BOUNDARY_NODES).into_par_iter().map(|i| crossing((f64::from(i) / last).powi(2)) as f32).collect()
}

/// 2 int T f c dc, by the interpolation of T.
fn mean(nodes: &[f32], f: impl Fn(f64) -> f64) -> f64 {
    let last = f64::from(BOUNDARY_NODES - 1);
    // With c = t^2; T is a polynomial of degree 1 in t between nodes.
    let part = |i: u32| {
        let (t0, t1) = (f64::from(i) / last, f64::from(i + 1) / last);
        integrate(t0, t1, 1, |t| 4.0 * t.powi(3) * interpolated(nodes, t * t) * f(t * t))
    };
    (0..BOUNDARY_NODES - 1).map(part).sum()
}

/// T at a cosine, from one table.
pub fn interpolated(nodes: &[f32], cos: f64) -> f64 {
    let x = cos.clamp(0.0, 1.0).sqrt() * (nodes.len() - 1) as f64;
    let i = (x as usize).min(nodes.len() - 2);
    let (low, high) = (f64::from(nodes[i]), f64::from(nodes[i + 1]));
    low + (x - i as f64) * (high - low)
}

/// Rows of a material's boundary around a share of its roughness, and the weight of the second.
fn rows<'a>(inputs: &Inputs<'a>, material: &Material, share: f64) -> ([&'a [f32]; 2], f64) {
    let rows = inputs.features.rough as usize;
    let row = |i: usize| &inputs.boundaries[i * BOUNDARY_ROW as usize..][..BOUNDARY_ROW as usize];
    let first = (material.boundary as usize - 1) * rows;
    if rows == 1 {
        return ([row(first); 2], 0.0);
    }
    let y = share.clamp(0.0, 1.0).sqrt() * (rows - 1) as f64;
    let below = (y as usize).min(rows - 2);
    ([row(first + below), row(first + below + 1)], y - below as f64)
}

/// Share of the light at a cosine outside that crosses the surface of a translucent material, where the texture has this
/// share of its roughness.
pub fn crossing(inputs: &Inputs, material: &Material, cos: f64, share: f64) -> f64 {
    if material.boundary == 0 {
        return transmittance(material.ior.into(), cos);
    }
    let (rows, above) = rows(inputs, material, share);
    let [low, high] = rows.map(|row| interpolated(&row[..BOUNDARY_NODES as usize], cos));
    low + above * (high - low)
}

/// 1 - rho_e of a material's boundary: the share of diffuse light that enters. (With [`Normalisation::Jensen2001`] a rough
/// one's is not kept, and 1.)
pub fn entering_share(inputs: &Inputs, material: &Material) -> f64 {
    if material.boundary == 0 {
        return 1.0 - diffuse_reflectance(material.ior.into(), Side::Outside);
    }
    let ([_, factor], _) = rows(inputs, material, 1.0);
    f64::from(factor[BOUNDARY_NODES as usize])
}

/// What a texture of the roughness makes of radiance that leaves, besides its crossing: rho_e is that of the place.
pub fn leaving_share(inputs: &Inputs, material: &Material, share: f64) -> f64 {
    if material.boundary == 0 {
        return 1.0;
    }
    let last = |row: &[f32]| f64::from(row[BOUNDARY_NODES as usize]);
    let ([low, high], above) = rows(inputs, material, share);
    let ([_, factor], _) = rows(inputs, material, 1.0);
    last(factor) / (last(low) + above * (last(high) - last(low)))
}
