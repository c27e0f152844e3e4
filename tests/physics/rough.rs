//! Rough boundaries: the lobe's albedo against another quadrature, its table, and furnaces that close.

use crate::common::*;
use glam::DVec3;
use translucent::Normalisation::Energy;
use translucent::reference::boundary::{Side, diffuse_reflectance, fresnel, transmittance};
use translucent::reference::math::integrate;
use translucent::reference::profile::{self, Coefficients, Options};
use translucent::reference::reflect::reflect;
use translucent::reference::rough::{Boundaries, crossing, interpolated, leaving_share, reflected};
use translucent::shared::*;
use translucent::table::white::mean_obliqueness;

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
        let (_, rough) = Boundaries::new(false, Energy).add(1e-5, n);
        // What is left is the interpolation's.
        let rho_e = rough.reflectance;
        assert!((rough.obliqueness - mean_obliqueness(n)).abs() < 2e-4, "{n}: {}", rough.obliqueness);
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
            let mut boundaries = Boundaries::new(false, Energy);
            let (number, rough) = boundaries.add(alpha, n);
            assert_eq!((number, boundaries.add(alpha, n)), (1, (1, rough)), "known again");
            let (nodes, rho_e) = (&boundaries.values[..BOUNDARY_NODES as usize], rough.reflectance);
            for i in 0..100 {
                // Dense at grazing angles, and off the nodes.
                let cos = ((f64::from(i) + 0.5) / 100.0).powi(2);
                let error = interpolated(nodes, cos) - (1.0 - reflected(alpha, n, cos));
                worst = worst.max(error.abs());
                assert!(error.abs() < allowed, "n {n}, roughness {roughness}, cos {cos}: {error}");
            }
            let direct = integrate(0.0, 1.0, 8, |t| 4.0 * t.powi(3) * reflected(alpha, n, t * t));
            assert!((rho_e - direct).abs() < 3e-5, "n {n}, roughness {roughness}: {rho_e} for {direct}");
            assert!(nodes.iter().all(|t| (0.0..=1.0).contains(t)));
        }
    }
    println!("worst interpolation {worst:.1e}");
}

/// A white, rough half-space under a model; a texture's `share` of the roughness lies on all of it.
fn white(model: u32, roughness: f64, share: f64, ior: f64) -> (Material, Boundaries) {
    let alpha = roughness * roughness;
    let mut boundaries = Boundaries::new(share != 1.0, Energy);
    let (boundary, rough) = boundaries.add(alpha, ior);
    let matter = Coefficients { sigma_s_prime: 1e3, sigma_a: 0.0, g: 0.0, ior, rough: Some(rough), appearance: None };
    let options = Options {
        normalisation: Energy,
        radius_tail: 1e-6,
        directional: Default::default(),
        precision: Default::default(),
    };
    let material = profile::material(model, &[matter; 3], options);
    (Material { alpha: alpha as f32, boundary, ..material }, boundaries)
}

/// A half-space of this matter, looked at under a cosine.
fn half_space(material: Material, boundaries: Boundaries, share: f64, cos: f64) -> (World, Surface) {
    let (mut world, surface) = plane(material, PROJECTION_NORMAL, 64, cos.acos(), false);
    world.features.rough = boundaries.feature();
    world.boundaries = boundaries.values;
    if share != 1.0 {
        // One texel, whose green byte is the share.
        let texture = Texture { width: 1, height: 1, offset: 0, ..Texture::default() };
        let kind = TEXTURE_METALLIC_ROUGHNESS;
        world.features.textures = 1 << kind;
        world.texels = vec![((share * 255.0).round() as u32) << 8];
        world.textures = vec![Texture::default(); TEXTURE_KINDS as usize];
        world.textures[kind as usize] = texture;
        world.coordinates = vec![Coordinates::default(); world.triangles.len()];
    }
    (world, surface)
}

fn furnace(model: u32, roughness: f64, share: f64, ior: f64, cos: f64) -> (Estimate, String) {
    let (material, boundaries) = white(model, roughness, share, ior);
    let (world, surface) = half_space(material, boundaries, share, cos);
    let inputs = world.inputs();
    let found = estimate(&world, 128, |index, step| {
        subsurface(&inputs, step, index, &surface) + valid(reflect(&inputs, step, index, &surface))
    });
    let what = format!("model {model}, roughness {roughness} times {share}, n {ior}, cosine {cos}");
    assert!(found.error.x < 2e-3, "{what}: no force at {found:?}");
    (found, what)
}

#[test]
fn rough_white_furnace_closes() {
    for roughness in [0.1, 0.3, 0.6, 1.0] {
        for ior in [1.3, 1.5] {
            for cos in [0.1f64, 0.4, 1.0] {
                let (found, what) = furnace(MODEL_STANDARD, roughness, 1.0, ior, cos);
                // The errors of interpolation and quadrature, and what matter without absorption sends beyond 2e5 mean
                // free paths.
                let interpolation = if roughness < 0.2 { 3e-4 } else { 3e-5 };
                found.check(1.0, interpolation + 5e-5 + 3e-5, &what);
            }
        }
    }
    for cos in [0.1f64, 1.0] {
        let (found, what) = furnace(MODEL_BURLEY, 0.6, 1.0, 1.5, cos);
        found.check(1.0, 1.1e-4, &what);
    }
}

#[test]
fn furnace_closes_under_a_texture_of_the_roughness() {
    for (roughness, share, ior) in [(1.0, 0.4, 1.5), (0.8, 0.2, 1.3), (0.5, 0.8, 1.5)] {
        for cos in [0.1f64, 1.0] {
            let (found, what) = furnace(MODEL_STANDARD, roughness, share, ior, cos);
            found.check(1.0, BETWEEN_ROWS + 8e-5, &what);
        }
    }
}

/// Largest error of T that the interpolation in the roughness makes, from a roughness of .1.
const BETWEEN_ROWS: f64 = 1e-3;

#[test]
fn a_texture_of_the_roughness_has_its_boundary() {
    let mut worst: [f64; 2] = [0.0; 2];
    for (roughness, ior) in [(1.0, 1.3), (1.0, 1.5), (0.5, 1.5)] {
        let (material, boundaries) = white(MODEL_STANDARD, roughness, 0.5, ior);
        let (world, _) = half_space(material, boundaries, 0.5, 1.0);
        let inputs = world.inputs();
        for k in 1..40 {
            // Off the rows, whose roots are 1/32 apart.
            let share = (f64::from(k) / 40.0).powi(2);
            let here = (roughness * share).powi(2);
            for cos in [0.02, 0.1, 0.3, 0.6, 1.0] {
                let error = (crossing(&inputs, &material, cos, share) - (1.0 - reflected(here, ior, cos))).abs();
                let place = usize::from(roughness * share < 0.1);
                worst[place] = worst[place].max(error);
            }
            if k % 8 == 3 {
                let leaving = |alpha: f64| 1.0 - Boundaries::new(false, Energy).add(alpha, ior).1.reflectance;
                let expected = leaving(roughness * roughness) / leaving(here);
                let found = leaving_share(&inputs, &material, share);
                assert!((found / expected - 1.0).abs() < BETWEEN_ROWS, "{ior} {share}: {found} for {expected}");
            }
        }
        assert_eq!(leaving_share(&inputs, &material, 1.0), 1.0);
    }
    println!("between rows: {:.1e} from a roughness of .1, {:.1e} below", worst[0], worst[1]);
    assert!(worst[0] < BETWEEN_ROWS && worst[1] < 2e-3, "{worst:?}");
}
