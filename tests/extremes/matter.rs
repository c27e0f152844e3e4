//! Matter at the ends of its ranges: many balls in one image, each of its own matter.

use crate::{
    channel, render,
    scenes::{Eye, Mesh, gltf, matter, scene, standard, sun},
};
use glam::DVec3;
use serde_json::Value;
use translucent::{
    Scene, Settings,
    reference::{
        boundary::{Side, diffuse_reflectance, transmittance},
        profile::{self, Coefficients, Dipole, Profile, Radial},
    },
    scene::Environment,
    settings::{Model, SingleScattering},
};

/// Balls of radius 1 in rows of `columns`, 2.5 apart, seen along -z; a cell of 8 x 8 pixels each. In depth they are 40
/// apart, so that each hides less than 1e-3 of the others' sky.
fn balls(materials: &[Value], columns: usize, mesh: &Mesh) -> (Scene, Settings) {
    let rows = materials.len().div_ceil(columns);
    let place = |i: usize| DVec3::new(2.5 * (i % columns) as f64, -2.5 * (i / columns) as f64, -40.0 * i as f64);
    let meshes: Vec<_> = (0..materials.len())
        .map(|i| {
            let mut ball = mesh.clone();
            ball.positions.iter_mut().for_each(|p| *p += place(i));
            (ball, i)
        })
        .collect();
    let middle = DVec3::new(1.25 * (columns - 1) as f64, -1.25 * (rows - 1) as f64, 0.0);
    let eye = Eye { eye: middle + DVec3::Z * 10.0, at: middle, lens: -1.25 * rows as f64 };
    let resolution = (8 * columns as u32, 8 * rows as u32);
    let settings = Settings { resolution: Some(resolution), seed: 11, ..standard() };
    (scene(&gltf(&meshes, materials, &[], &eye)), settings)
}

/// Mean of a function of the cosine over the middle 2 x 2 pixels of a cell, .3125 from the ball's axis.
fn mean_over_middle(f: impl Fn(f64) -> f64) -> f64 {
    let at = |i: i32| 0.3125 * (2.0 * (f64::from(i) + 0.5) / 16.0 - 1.0);
    let values = (0..256).map(|k| f((1.0 - at(k % 16).powi(2) - at(k / 16).powi(2)).sqrt()));
    values.sum::<f64>() / 256.0
}

/// A mean of many deviations with their standard errors; the three channels of a ball, of the same radii, count as one.
#[derive(Clone, Copy, Default)]
struct Mean {
    sum: f64,
    squares: f64,
    count: f64,
}

impl Mean {
    fn add(&mut self, deviation: f64, error: f64) {
        self.sum += deviation;
        self.squares += 3.0 * error * error;
        self.count += 1.0;
    }

    fn get(self) -> (f64, f64) {
        (self.sum / self.count, self.squares.sqrt() / self.count)
    }
}

#[test]
fn every_matter_has_its_radiance() {
    let albedos = [[0.0, 1e-6, 0.5], [0.999, 1.0 - 0.5f64.powi(24), 1.0]];
    let mut cases = vec![];
    for extinction in [1e-6, 1.0, 1e9] {
        for ior in [0.7, 1.0 - 1e-6, 1.0, 1.0 + 1e-6, 1.3, 3.0] {
            cases.extend(albedos.map(|albedo| (extinction, ior, albedo)));
        }
    }
    let mesh = Mesh::sphere(1.0, 20);
    // The share of the true sphere's area that the polyhedron lacks.
    let area: f64 = (mesh.indices.chunks_exact(3))
        .map(|t| {
            let p = |i: usize| mesh.positions[t[i] as usize];
            0.5 * (p(1) - p(0)).cross(p(2) - p(0)).length()
        })
        .sum();
    let deficit = 1.0 - area / (4.0 * std::f64::consts::PI);
    for model in [Model::Standard, Model::Better, Model::Burley, Model::Directional] {
        let materials: Vec<Value> = (cases.iter())
            .map(|(extinction, ior, albedo)| {
                matter(albedo.map(|a| extinction * a), albedo.map(|a| extinction * (1.0 - a)), *ior)
            })
            .collect();
        let (mut scene, settings) = balls(&materials, 6, &mesh);
        scene.set_environment(Environment::constant(DVec3::ONE).expect("valid")).expect("valid");
        // No sample is invalid, as `render` checks.
        let image = render(&scene, &Settings { model, single_scattering: SingleScattering::Off, ..settings }, 1280);
        assert!(image.channels.iter().all(|channel| channel.data.iter().all(|x| x.is_finite())));
        // The directional dipole has no closed form on a ball.
        let (Some(constant), false) = (profile::constant(model), model == Model::Directional) else { continue };
        let mut relative = [Mean::default(); 2];
        for (index, (extinction, ior, albedo)) in cases.iter().enumerate() {
            let leaving = mean_over_middle(|cos| transmittance(*ior, cos));
            for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
                let (light, variance) =
                    (channel(&image, &format!("subsurface.{name}")), channel(&image, &format!("variance.{name}")));
                let pixels =
                    [(3, 3), (4, 3), (3, 4), (4, 4)].map(|(x, y)| (index / 6 * 8 + y) * 48 + index % 6 * 8 + x);
                let mean = pixels.iter().map(|p| f64::from(light[*p])).sum::<f64>() / 4.0;
                let error = pixels.iter().map(|p| f64::from(variance[*p])).sum::<f64>().sqrt() / 4.0;
                // Kernels resolve mean free paths of 2^-17 internal units.
                let kept = extinction.min(131_072.0 * scene.frame.scale);
                let (sigma_s_prime, sigma_a) = (kept * albedo[c], kept * (1.0 - albedo[c]));
                let matter = Coefficients { sigma_s_prime, sigma_a, g: 0.0, ior: *ior, appearance: None, rough: None };
                let expected = leaving * Profile::new(constant, &matter).cdf(2.0);
                let what = format!("{model}, sigma_t' {extinction}, n {ior}, alpha' {}: {mean} +- {error}", albedo[c]);
                if albedo[c] == 0.0 {
                    assert_eq!(mean, 0.0, "{what}");
                }
                // 648 values, each within 5 of its standard errors (28 degrees of freedom): by chance one in 50 seeds.
                // A ball of a millionth of a mean free path gives at most a millionth, which no sample may find.
                let unseen = if *extinction < 1.0 { 1e-6 } else { 0.0 };
                let allowed = 5.0 * error + (deficit + 1e-3) * expected + unseen;
                assert!((mean - expected).abs() <= allowed, "{what}, not {expected}");
                if *extinction >= 1.0 && expected > 0.0 {
                    assert!(error <= expected / 8.0, "{what}: no force");
                    relative[usize::from(*extinction > 1.0)].add(mean / expected - 1.0, error / expected);
                }
            }
        }
        for (mean, least) in relative.iter().zip([0.025, 0.012]) {
            let (mean, error) = mean.get();
            println!("{model}: all matter together is {mean:.4} +- {error:.4} off");
            assert!(mean.abs() <= 4.0 * error + deficit + 1e-3, "{model}: {mean} +- {error}");
            assert!(error < least, "{model}: {error} has no force");
        }
    }
}

#[test]
fn tables_and_what_auto_takes_of_every_matter_are_finite() {
    let mut materials = vec![];
    for extinction in [1e-6, 1.0, 1e9] {
        for ior in [1.0, 1.3, 1.5] {
            for albedo in [[0.0, 1e-6, 0.5], [0.999, 1.0 - 0.5f64.powi(24), 1.0]] {
                let (scattering, absorption) = (albedo.map(|a| extinction * a), albedo.map(|a| extinction * (1.0 - a)));
                materials.push(matter(scattering, absorption, ior));
            }
        }
    }
    let (mut scene, settings) = balls(&materials, 6, &Mesh::sphere(1.0, 6));
    scene.set_environment(Environment::constant(DVec3::ONE).expect("valid")).expect("valid");
    for model in [Model::Table, Model::Auto] {
        let image = render(&scene, &Settings { model, ..settings.clone() }, 64);
        for name in ["R", "G", "B"] {
            let light = channel(&image, &format!("subsurface.{name}"));
            assert!(light.iter().all(|x| x.is_finite() && *x >= 0.0), "{model}, {name}: {light:?}");
            // Balls of a mean free path and more: what comes back of light 1 is at most that, but for the third too much
            // that the table gives there, and noise.
            let most = light[light.len() / 3..].iter().copied().fold(0.0, f32::max);
            assert!(most < 2.0 && (most > 0.4 || name == "R"), "{model}, {name}: {most}");
        }
    }
}

#[test]
fn index_matched_matter_is_continuous() {
    let image_of = |ior: f64| {
        let (mut scene, settings) = balls(&[matter([0.5, 3.0, 9.9], [0.5, 0.3, 0.1], ior)], 1, &Mesh::sphere(1.0, 8));
        scene.set_environment(Environment::constant(DVec3::ONE).expect("valid")).expect("valid");
        let image = render(&scene, &settings, 32);
        ["R", "G", "B"].map(|name| channel(&image, name).iter().map(|x| f64::from(*x)).collect::<Vec<_>>()).concat()
    };
    let matched = image_of(1.0);
    let total: f64 = matched.iter().sum();
    for ior in [1.0 - 1e-6, 1.0 + 1e-6] {
        // The same random numbers.
        let difference: f64 = image_of(ior).iter().zip(&matched).map(|(a, b)| (a - b).abs()).sum();
        assert!(total > 1.0 && difference < 1e-4 * total, "n = {ior}: {difference} of {total}");
    }
}

#[test]
fn grazing_light_enters_by_its_cosine() {
    // A wide slab; Lo = E_perp cos / pi Ft(i) Ft(o) Rd / (1 - rho_e).
    let ior = 1.3;
    let mut mesh = Mesh::default();
    mesh.cuboid(DVec3::new(-300.0, -300.0, -300.0), DVec3::new(300.0, 300.0, 0.0), 1);
    let eye = Eye { eye: DVec3::Z * 10.0, at: DVec3::ZERO, lens: 0.02 };
    let total = Dipole::new(0.95, 0.05, ior).total() / (1.0 - diffuse_reflectance(ior, Side::Outside));
    for elevation in [1.0f64, 0.01, 0.001] {
        let angle = elevation.to_radians();
        let light = (sun(), DVec3::new(angle.cos(), 0.0, angle.sin()) * 100.0, DVec3::ZERO);
        let scene = scene(&gltf(&[(mesh.clone(), 0)], &[matter([0.95; 3], [0.05; 3], ior)], &[light], &eye));
        let image = render(&scene, &Settings { resolution: Some((4, 4)), seed: 1, ..standard() }, 128);
        let values = channel(&image, "subsurface.G");
        let mean = values.iter().map(|x| f64::from(*x)).sum::<f64>() / values.len() as f64;
        let cos = angle.sin();
        let expected = cos * transmittance(ior, cos) * transmittance(ior, 1.0) * total;
        // f32 holds the direction to 6e-8, of a cosine of 1.7e-5.
        assert!((mean / expected - 1.0).abs() < 0.02, "{elevation} degrees: {mean}, not {expected}");
    }
}
