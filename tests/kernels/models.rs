//! Every model's functions on the device against their twins, over random matter of all magnitudes: 2^20 sets of matter,
//! radius and directions for each, none of which may give what is not finite or negative.

use crate::{common::*, evaluate};
use glam::{DVec3, Vec3, dvec3};
use rayon::prelude::*;
use std::f64::consts::TAU;
use translucent::{
    Normalisation,
    reference::{
        profile::{Coefficients, Directional, Matter, Options, Profile, draw_radius, material, shapes_shifted},
        random::{hash, unit},
    },
    shared::*,
    verify::profiles::directional_scale,
};

/// Materials of a model, and evaluations: 2^20 in all.
const MATERIALS: u32 = 1 << 12;
const EACH: u32 = 1 << 8;

fn number(i: u32, k: u32) -> f64 {
    unit(hash(hash(i) ^ k.wrapping_mul(0x9e37_79b9)))
}

/// Matter whose mean free path, albedo, anisotropy and index of refraction are all that kernels accept.
fn random_material(model: u32, i: u32) -> Material {
    let ior = [1.0, 1.0 - 1e-6, 1.0 + 1e-6, 0.7, 1.3, 3.0][(number(i, 0) * 6.0) as usize];
    let matter = [0, 1, 2].map(|c| {
        let u = |k: u32| number(i, 1 + 8 * c + k);
        let extinction = 10f64.powf(14.0 * u(0) - 9.0).min(1e5);
        // Absorption from nothing at all over 2^-24 to nearly all.
        let absorbed = if u(1) < 0.1 { 0.0 } else { 2f64.powf(-24.0 * u(2)) };
        let absorbed = absorbed.min(1.0 - 1e-4);
        let g = if u(3) < 0.3 { 0.0 } else { 0.999 * (2.0 * u(4) - 1.0) };
        Coefficients {
            sigma_s_prime: extinction * (1.0 - absorbed),
            sigma_a: extinction * absorbed,
            g,
            ior,
            rough: None,
            appearance: None,
        }
    });
    let options = Options {
        normalisation: Normalisation::Energy,
        radius_tail: 0.0,
        directional: Default::default(),
        precision: Default::default(),
    };
    material(model, &matter, options)
}

struct Sweep {
    /// Materials, and directions in the place of normals.
    world: World,
    /// Radius in one channel's mean free paths, and two numbers in [0, 1).
    arguments: Vec<Vec3>,
}

impl Sweep {
    fn new(model: u32) -> Sweep {
        let materials: Vec<Material> = (0..MATERIALS).into_par_iter().map(|i| random_material(model, i)).collect();
        let argument = |i: u32| {
            let m = &materials[(i / EACH) as usize];
            let u = |k: u32| number(i, 100 + k);
            let length = if model == MODEL_BURLEY { 1.0 / m.sigma_tr.x } else { m.z_real.x };
            let r = if u(0) < 0.03 { 0.0 } else { f64::from(length) * 10f64.powf(10.0 * u(1) - 7.0) };
            Vec3::new((r as f32).min(1e15), u(2) as f32 * 0.999_999_94, u(3) as f32 * 0.999_999_94)
        };
        let arguments = (0..MATERIALS * EACH).into_par_iter().map(argument).collect();
        let directions = (0..MATERIALS * EACH).into_par_iter().map(directions).collect();
        Sweep::of(materials, arguments, directions)
    }

    fn of(materials: Vec<Material>, arguments: Vec<Vec3>, shadings: Vec<Shading>) -> Sweep {
        // The kernel of a scene with all models asks each material.
        let models = 1 << MODEL_STANDARD | 1 << MODEL_BETTER | 1 << MODEL_DIRECTIONAL | 1 << MODEL_BURLEY;
        let features = Features { models, ..Features::default() };
        Sweep { world: World { features, materials, shadings, ..World::default() }, arguments }
    }

    /// What the device gives for a function at `arguments`.
    fn evaluate(&self, function: u32, arguments: &[Vec3]) -> Vec<Vec3> {
        evaluate(function, &self.world.inputs(), &[], arguments)
    }

    /// The model's shapes at the radii of `arguments`.
    fn shapes(&self) -> Vec<Vec3> {
        let unshifted: Vec<Vec3> = self.arguments.iter().map(|x| Vec3::new(x.x, 0.0, 0.0)).collect();
        self.evaluate(FUNCTION_SHAPE, &unshifted)
    }

    fn material(&self, i: usize) -> &Material {
        &self.world.materials[i / EACH as usize]
    }
}

/// Normals and a direction above the first of them: at random, along each other, or grazing.
fn directions(i: u32) -> Shading {
    let u = |k: u32| number(i, 200 + k);
    let vector = |k: u32| {
        let (z, angle) = (2.0 * u(k) - 1.0, TAU * u(k + 1));
        let r = (1.0 - z * z).sqrt();
        dvec3(r * angle.cos(), r * angle.sin(), z)
    };
    let ni = vector(0);
    let wi = if u(6) < 0.1 { (vector(2) - vector(2).dot(ni) * ni).normalize() + 1e-6 * ni } else { vector(2) };
    let wi = if wi.dot(ni) < 0.0 { wi - 2.0 * wi.dot(ni) * ni } else { wi };
    let no = if u(7) < 0.3 { ni } else { vector(4) };
    Shading { normal0: ni.as_vec3(), normal1: wi.normalize().as_vec3(), normal2: no.as_vec3(), material: i / EACH }
}

/// Exponent from which a power counts as 0 on the device.
const NOTHING: f64 = 86.0;

/// Error relative to `scale`, over what an exponent brings along: x has the error x 2^-24 and carries it into the power.
fn error(found: f32, expected: f64, scale: f64, exponent: f64) -> f64 {
    let difference = (f64::from(found) - expected).abs();
    if difference < 1e-36 || exponent > NOTHING { 0.0 } else { difference / scale.max(1e-36) / (1.0 + 0.1 * exponent) }
}

fn assert_quantiles(what: &str, mut errors: Vec<f64>, all: f64, most: f64) {
    assert!(errors.iter().all(|error| !error.is_nan()), "{what}: NaN");
    errors.sort_by(f64::total_cmp);
    let (nearly, worst) = (errors[errors.len() - 1 - errors.len() / 10_000], errors[errors.len() - 1]);
    println!(
        "{what}: {} errors, median {:.1e}, .9999 below {nearly:.1e}, worst {worst:.1e}",
        errors.len(),
        errors[errors.len() / 2]
    );
    assert!(nearly <= most && worst <= all, "{what}: .9999 of the errors are below {nearly:e}, the worst is {worst:e}");
}

/// Finite and not negative.
fn assert_valid(what: &str, values: &[Vec3], sweep: &Sweep) {
    let bad = values.iter().position(|y| !(y.is_finite() && y.min_element() >= 0.0));
    if let Some(i) = bad {
        panic!("{what}: {} at {} of {:?}", values[i], sweep.arguments[i], sweep.material(i));
    }
}

#[test]
fn radial_profiles_at_all_magnitudes() {
    for model in [MODEL_STANDARD, MODEL_BETTER, MODEL_BURLEY] {
        let sweep = Sweep::new(model);
        let found = sweep.shapes();
        assert_valid(&format!("model {model}"), &found, &sweep);
        let errors = found.par_iter().enumerate().map(|(i, found)| {
            let (m, r) = (sweep.material(i), f64::from(sweep.arguments[i].x));
            let expected = shapes_shifted(Matter::from(m), r, 0.0);
            let depth = |c: usize| if model == MODEL_BURLEY { r / 3.0 } else { r.hypot(f64::from(m.z_virtual[c])) };
            let channel = |c: usize| error(found[c], expected[c], expected[c], f64::from(m.sigma_tr[c]) * depth(c));
            (0..3).map(channel).fold(0.0, f64::max)
        });
        assert_quantiles(&format!("shape of model {model}"), errors.collect(), 1e-5, 1e-5);
    }
}

#[test]
fn radii_at_all_magnitudes() {
    for model in [MODEL_STANDARD, MODEL_BETTER, MODEL_BURLEY] {
        let sweep = Sweep::new(model);
        let found = sweep.evaluate(FUNCTION_RADIUS, &sweep.arguments);
        assert_valid(&format!("model {model}"), &found, &sweep);
        let errors = found.par_iter().enumerate().map(|(i, found)| {
            let (m, x) = (sweep.material(i), sweep.arguments[i].as_dvec3());
            let expected = draw_radius(Matter::from(m), x.y, x.z);
            error(found.x, expected, expected, 0.0)
        });
        // The choice of a component may go either way at its end.
        assert_quantiles(&format!("radius of model {model}"), errors.collect(), f64::INFINITY, 1e-4);
    }
}

#[test]
fn directional_dipole_at_all_magnitudes() {
    let mut sweep = Sweep::new(MODEL_DIRECTIONAL);
    // Towards anywhere, along the normal, or at the entry itself.
    let places = sweep.arguments.iter().zip(&sweep.world.shadings).enumerate().map(|(i, (x, directions))| {
        let u = |k: u32| number(i as u32, 300 + k);
        let away = match (u(0) * 10.0) as u32 {
            0 => directions.normal0,
            1 => directions.normal1.cross(directions.normal0).normalize_or_zero(),
            _ => dvec3(u(1) - 0.5, u(2) - 0.5, u(3) - 0.5).normalize().as_vec3(),
        };
        away * x.x
    });
    sweep.arguments = places.collect();
    let found = sweep.evaluate(FUNCTION_DIRECTIONAL, &sweep.arguments);
    assert_valid("directional", &found, &sweep);
    let errors = found.par_iter().enumerate().map(|(i, found)| {
        let (m, x) = (sweep.material(i), sweep.arguments[i].as_dvec3());
        let d = &sweep.world.shadings[i];
        let [ni, wi, no]: [DVec3; 3] = [d.normal0, d.normal1, d.normal2].map(|v| v.as_dvec3());
        let channel = |c: usize| {
            let profile = Directional::unpack(Matter::from(m), c);
            let [expected, scale] = directional_scale(&profile, x, ni, wi, no);
            let exponent = profile.proposal.sigma_tr * x.length().hypot(profile.height);
            error(found[c], expected, scale, exponent)
        };
        (0..3).map(channel).fold(0.0, f64::max)
    });
    // At the critical angle of a rarer medium light enters on one side and not on the other.
    assert_quantiles("directional", errors.collect(), f64::INFINITY, 1e-4);
}

#[test]
fn golden_values_on_the_device() {
    let (sin, cos) = (0.75f64.sqrt(), 0.5);
    let tilted = dvec3(0.3, 0.2, 0.93273791).normalize();
    let cases = [
        ((2.62, 0.0041, 0.0, 1.5), dvec3(1.0, 0.0, 0.0), DVec3::Z, DVec3::Z, 1.576432524e-2),
        ((2.62, 0.0041, 0.0, 1.5), dvec3(0.5, 0.0, 0.0), dvec3(-sin, 0.0, cos), DVec3::Z, 6.024971489e-2),
        ((2.62, 0.0041, 0.0, 1.5), dvec3(0.5, 0.0, 0.0), dvec3(sin, 0.0, cos), DVec3::Z, 3.115670914e-2),
        ((10.0, 0.01, 0.9, 1.3), dvec3(0.2, 0.0, 0.0), DVec3::Z, DVec3::Z, 8.318438010e-2),
        ((1.0, 0.01, 0.0, 1.3), dvec3(0.3, 0.0, -1.0), DVec3::Z, -DVec3::Z, 3.274425893e-2),
        ((0.70, 0.009, 0.0, 1.3), dvec3(0.3, 0.2, -0.1), dvec3(0.6, 0.0, 0.8), tilted, 3.155625660e-2),
    ];
    let options = Options {
        normalisation: Normalisation::Energy,
        radius_tail: 0.0,
        directional: Default::default(),
        precision: Default::default(),
    };
    let mut sweep = Sweep::of(vec![], vec![], vec![]);
    for (i, ((sigma_s, sigma_a, g, ior), x, wi, no, _)) in cases.into_iter().enumerate() {
        let matter =
            Coefficients { sigma_s_prime: sigma_s * (1.0 - g), sigma_a, g, ior, rough: None, appearance: None };
        sweep.world.materials.push(material(MODEL_DIRECTIONAL, &[matter; 3], options));
        sweep.arguments.push(x.as_vec3());
        sweep.world.shadings.push(Shading {
            normal0: Vec3::Z,
            normal1: wi.as_vec3(),
            normal2: no.as_vec3(),
            material: i as u32,
        });
    }
    for (found, (.., expected)) in sweep.evaluate(FUNCTION_DIRECTIONAL, &sweep.arguments).iter().zip(&cases) {
        assert!((f64::from(found.x) / expected - 1.0).abs() < 1e-5, "{found} for {expected}");
    }

    // The radial models against their twins from the coefficients, not from f32.
    for model in [MODEL_STANDARD, MODEL_BETTER, MODEL_BURLEY] {
        let [matter, ..] = channels(DVec3::splat(2.62), DVec3::splat(0.0041), 1.5);
        let radii = [0.01f32, 0.1, 1.0, 5.0, 20.0];
        let sweep = Sweep::of(
            vec![material(model, &[matter; 3], options)],
            radii.iter().map(|&r| Vec3::splat(r)).collect(),
            vec![Shading::default(); radii.len()],
        );
        let profile = Profile::new(model, &matter);
        for (r, found) in radii.iter().zip(sweep.shapes()) {
            let expected = profile.shape(f64::from(*r));
            assert!((f64::from(found.x) / expected - 1.0).abs() < 1e-5, "model {model} r {r}: {found} for {expected}");
        }
    }
}
