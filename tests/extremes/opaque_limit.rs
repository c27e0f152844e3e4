//! The limit of a vanishing mean free path: Lambert's law, which every model approaches.

use crate::{
    channel, render,
    scenes::{Eye, Mesh, gltf, matter, scene, sun},
};
use glam::DVec3;
use translucent::{
    Model, Settings,
    prepare::prepare,
    reference::{
        boundary::{Side, diffuse_reflectance, transmittance},
        profile::{Dipole, Radial},
    },
};

/// Pixels across the image, which shows the ball from -1.05 to 1.05.
const SIDE: usize = 40;

/// A ball of the radius 1 whose matter has this mean free path, lit from the side: radiance by pixel.
fn ball(mean_free_path: f64, albedo: f64, model: Model) -> Vec<f64> {
    let (scattering, absorption) = (albedo / mean_free_path, (1.0 - albedo) / mean_free_path);
    let eye = Eye { eye: DVec3::Z * 10.0, at: DVec3::ZERO, lens: -1.05 };
    let light = (sun(), towards() * 100.0, DVec3::ZERO);
    let scene =
        scene(&gltf(&[(Mesh::sphere(1.0, 40), 0)], &[matter([scattering; 3], [absorption; 3], IOR)], &[light], &eye));
    let resolution = Some((SIDE as u32, SIDE as u32));
    // Of half-spaces, whose limit it is.
    let settings = Settings { resolution, seed: 4, model, curvature: false, reuse: Some(1), ..Settings::default() };
    if model == Model::Auto {
        let advice = prepare(&scene, &settings).expect("valid").advice;
        let choice = &advice[0].as_ref().expect("translucent").choice;
        assert_eq!((choice.model, choice.limit_of), (Model::Lambert, Model::Table));
    }
    let image = render(&scene, &settings, 128);
    let mean = |i: usize| ["R", "G", "B"].map(|name| f64::from(channel(&image, &format!("subsurface.{name}"))[i]));
    (0..SIDE * SIDE).map(|i| mean(i).iter().sum::<f64>() / 3.0).collect()
}

const IOR: f64 = 1.3;

fn towards() -> DVec3 {
    DVec3::new(1.0, 0.4, 0.8).normalize()
}

/// Place of a pixel's column or row.
fn coordinate(pixel: usize, k: usize) -> f64 {
    1.05 * (2.0 * (pixel as f64 + (k as f64 + 0.5) / 8.0) / SIDE as f64 - 1.0)
}

/// Difference of two images over the light of the second, where the cosine to the eye is above .5 throughout the pixel:
/// signed means over blocks of 4 x 4 pixels, so that noise averages out.
fn difference(image: &[f64], expected: &[f64]) -> f64 {
    let inside = |i: &usize| coordinate(i % SIDE, 4).powi(2) + coordinate(i / SIDE, 4).powi(2) < 0.7;
    let (mut blocks, mut light) = (vec![0.0; SIDE * SIDE / 16], 0.0);
    for i in (0..SIDE * SIDE).filter(inside) {
        blocks[i / SIDE / 4 * (SIDE / 4) + i % SIDE / 4] += image[i] - expected[i];
        light += expected[i];
    }
    blocks.iter().map(|b| b.abs()).sum::<f64>() / light
}

#[test]
fn short_paths_tend_to_lambert() {
    // Lambert's law behind a smooth surface, the mean over each pixel that is wholly on the ball.
    let total = Dipole::new(0.9, 0.1, IOR).total() / (1.0 - diffuse_reflectance(IOR, Side::Outside));
    let law = |x: f64, y: f64| {
        let normal = DVec3::new(x, y, (1.0 - x * x - y * y).sqrt());
        let cos = normal.dot(towards()).max(0.0);
        cos * transmittance(IOR, cos) * transmittance(IOR, normal.z) * total
    };
    let expected: Vec<f64> = (0..SIDE * SIDE)
        .map(|i| {
            let points = (0..64).map(|k| law(coordinate(i % SIDE, k % 8), -coordinate(i / SIDE, k / 8)));
            points.sum::<f64>() / 64.0
        })
        .collect();
    let limit = ball(1.0, 0.9, Model::Lambert);
    let floor = difference(&limit, &expected);
    println!("the opaque limit differs from Lambert's law by {floor:.4}");
    assert!(floor < 0.005, "{floor}");

    // A quarter of the path, a quarter of the difference.
    let converges = |model: Model, albedo: f64, limit: &[f64]| {
        let errors = [0.2, 0.05, 0.0125, 1e-9].map(|path| difference(&ball(path, albedo, model), limit));
        println!("{model} from its limit at 1/5, 1/20, 1/80, 1e-9 radii: {errors:.4?}");
        // What noise leaves of no path.
        let floor = errors[3];
        assert!(floor < 0.01, "{floor}");
        for pair in errors[..3].windows(2) {
            assert!((pair[1] - floor).max(0.0) < 0.4 * (pair[0] - floor), "{model}: {errors:?}");
        }
    };
    converges(Model::Standard, 0.9, &limit);
    // Of such matter `auto` takes the table.
    converges(Model::Table, 0.7, &ball(1e-9, 0.7, Model::Auto));
}
