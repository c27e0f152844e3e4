//! Rough boundaries: the lobe's albedo against another quadrature, its table, and furnaces that close.

use crate::common::*;
use glam::DVec3;
use translucent::Normalisation::Energy;
use translucent::reference::boundary::{Side, diffuse_reflectance, fresnel, transmittance};
use translucent::reference::math::integrate;
use translucent::reference::profile::{self, Coefficients, Options};
use translucent::reference::reflect::reflect;
use translucent::reference::rough::{Boundaries, interpolated, reflected};
use translucent::shared::*;

/// The lobe's albedo over a grid of outgoing directions: no visible normals, no disc.
fn by_directions(alpha: f64, n: f64, cos: f64, grid: i32) -> f64 {
    let wo = DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    let lambda = |c: f64| ((1.0 + alpha * alpha * (1.0 / (c * c) - 1.0)).sqrt() - 1.0) / 2.0;
    let mut sum = 0.0;
    for i in 0..grid {
        let c = (f64::from(i) + 0.5) / f64::from(grid);
        let s = (1.0 - c * c).sqrt();
        for j in 0..grid {
            let phi = std::f64::consts::PI * (f64::from(j) + 0.5) / f64::from(grid);
            let half = (wo + DVec3::new(s * phi.cos(), s * phi.sin(), c)).normalize();
            let d = alpha * alpha / std::f64::consts::PI / (half.z * half.z * (alpha * alpha - 1.0) + 1.0).powi(2);
            sum += d * fresnel(n, half.dot(wo).min(1.0)) / (1.0 + lambda(cos) + lambda(c)) / (4.0 * cos);
        }
    }
    sum * 2.0 * std::f64::consts::PI / f64::from(grid * grid)
}

#[test]
fn albedo_is_that_of_the_lobe() {
    for (roughness, n) in [(0.6f64, 1.3), (0.6, 1.5), (1.0, 1.5), (0.8, 0.7)] {
        for cos in [0.05, 0.3, 0.7, 1.0] {
            let alpha = roughness * roughness;
            let (found, expected) = (reflected(alpha, n, cos), by_directions(alpha, n, cos, 600));
            // The midpoint rule's own error falls with the square of the grid.
            let error = (by_directions(alpha, n, cos, 300) - expected).abs();
            assert!(
                (found - expected).abs() < error + 5e-5 + 3e-3 * f64::from(u8::from(n < 1.0)),
                "{roughness} {n} {cos}: {found} for {expected} +- {error}"
            );
            assert!(error < 1e-3, "no force: {error}");
        }
    }
}

#[test]
fn without_roughness_it_is_fresnel() {
    for n in [1.3, 1.5, 3.0] {
        for cos in [0.01, 0.1, 0.5, 1.0] {
            // Facets within alpha of the surface: the difference falls with alpha^2.
            let smooth = 1.0 - transmittance(n, cos);
            let [far, near] = [1e-3, 1e-4].map(|alpha| (reflected(alpha, n, cos) - smooth).abs());
            assert!(near < 3e-5 + 0.02 * far, "{n} {cos}: {near} {far}");
        }
        let mut boundaries = Boundaries::default();
        let (_, rho_e) = boundaries.add(1e-5, n);
        // What is left is the interpolation's.
        assert!((rho_e - diffuse_reflectance(n, Side::Outside)).abs() < 2e-4, "{n}: {rho_e}");
    }
    assert_eq!(reflected(0.3, 1.0, 0.2), 0.0, "matched indices");
}

#[test]
fn table_holds_its_promise() {
    let mut worst: f64 = 0.0;
    for n in [1.3, 1.5] {
        for (roughness, allowed) in [(0.1f64, 3e-4), (0.3, 3e-5), (0.6, 3e-5), (1.0, 3e-5)] {
            let alpha = roughness * roughness;
            let mut boundaries = Boundaries::default();
            let (number, rho_e) = boundaries.add(alpha, n);
            assert_eq!((number, boundaries.add(alpha, n)), (1, (1, rho_e)), "known again");
            for i in 0..100 {
                // Dense at grazing angles, and off the nodes.
                let cos = ((f64::from(i) + 0.5) / 100.0).powi(2);
                let error = interpolated(&boundaries.nodes, cos) - (1.0 - reflected(alpha, n, cos));
                worst = worst.max(error.abs());
                assert!(error.abs() < allowed, "n {n}, roughness {roughness}, cos {cos}: {error}");
            }
            let direct = integrate(0.0, 1.0, 8, |t| 4.0 * t.powi(3) * reflected(alpha, n, t * t));
            assert!((rho_e - direct).abs() < 3e-5, "n {n}, roughness {roughness}: {rho_e} for {direct}");
            assert!(boundaries.nodes.iter().all(|t| (0.0..=1.0).contains(t)));
        }
    }
    println!("worst interpolation {worst:.1e}");
}

/// A white, rough half-space.
fn white(roughness: f64, ior: f64) -> (Material, Vec<f32>) {
    let alpha = roughness * roughness;
    let mut boundaries = Boundaries::default();
    let (boundary, rho_e) = boundaries.add(alpha, ior);
    let matter = Coefficients { sigma_s_prime: 1e3, sigma_a: 0.0, g: 0.0, ior, rough: Some(rho_e), appearance: None };
    let options = Options { normalisation: Energy, radius_tail: 1e-6, directional: Default::default() };
    let material = profile::material(MODEL_STANDARD, &[matter; 3], options);
    (Material { alpha: alpha as f32, boundary, ..material }, boundaries.nodes)
}

#[test]
fn rough_white_furnace_closes() {
    for roughness in [0.1, 0.3, 0.6, 1.0] {
        for ior in [1.3, 1.5] {
            for cos in [0.1f64, 0.4, 1.0] {
                let (material, nodes) = white(roughness, ior);
                let (mut world, surface) = plane(material, PROJECTION_NORMAL, 64, cos.acos(), false);
                world.boundaries = nodes;
                world.features.rough = 1;
                let inputs = world.inputs();
                let found = estimate(&world, 128, |index, step| {
                    subsurface(&inputs, step, index, &surface) + valid(reflect(&inputs, step, index, &surface))
                });
                let what = format!("roughness {roughness}, n {ior}, cosine {cos}");
                // The errors of interpolation and quadrature, and what matter without absorption sends beyond 2e5 mean
                // free paths.
                let interpolation = if roughness < 0.2 { 3e-4 } else { 3e-5 };
                found.check(1.0, interpolation + 5e-5 + 3e-5, &what);
                assert!(found.error.x < 2e-3, "{what}: no force at {found:?}");
            }
        }
    }
}
