//! The limit of a vanishing mean free path.

use crate::{
    channel, render,
    scenes::{Eye, Mesh, gltf, matter, scene, sun},
};
use glam::DVec3;
use translucent::{
    Settings,
    reference::{
        boundary::{Side, diffuse_reflectance, transmittance},
        profile::{Dipole, Radial},
    },
};

/// Pixels across the image, which shows the ball from -1.05 to 1.05.
const SIDE: usize = 40;

#[test]
fn short_paths_tend_to_lambert() {
    let ior = 1.3;
    let towards = DVec3::new(1.0, 0.4, 0.8).normalize();
    let mesh = Mesh::sphere(1.0, 60);
    // Lambert's law behind a smooth surface, the mean over each pixel that is wholly on the ball.
    let total = Dipole::new(0.9, 0.1, ior).total() / (1.0 - diffuse_reflectance(ior, Side::Outside));
    let lambert = |x: f64, y: f64| {
        let normal = DVec3::new(x, y, (1.0 - x * x - y * y).sqrt());
        let cos = normal.dot(towards).max(0.0);
        cos * transmittance(ior, cos) * transmittance(ior, normal.z) * total
    };
    let coordinate =
        |pixel: usize, k: usize| 1.05 * (2.0 * (pixel as f64 + (k as f64 + 0.5) / 8.0) / SIDE as f64 - 1.0);
    let expected: Vec<f64> = (0..SIDE * SIDE)
        .map(|i| {
            let points = (0..64).map(|k| lambert(coordinate(i % SIDE, k % 8), -coordinate(i / SIDE, k / 8)));
            points.sum::<f64>() / 64.0
        })
        .collect();
    // Where the cosine to the eye is above .5 throughout the pixel.
    let inside = |i: usize| coordinate(i % SIDE, 4).powi(2) + coordinate(i / SIDE, 4).powi(2) < 0.7;
    let scale = (0..SIDE * SIDE).filter(|i| inside(*i)).map(|i| expected[i]).sum::<f64>();

    let error_of = |mean_free_path: f64| {
        let sigma = 1.0 / mean_free_path;
        let eye = Eye { eye: DVec3::Z * 10.0, at: DVec3::ZERO, lens: -1.05 };
        let light = (sun(), towards * 100.0, DVec3::ZERO);
        let scene =
            scene(&gltf(&[(mesh.clone(), 0)], &[matter([0.9 * sigma; 3], [0.1 * sigma; 3], ior)], &[light], &eye));
        let resolution = Some((SIDE as u32, SIDE as u32));
        let image = render(&scene, &Settings { resolution, seed: 4, ..Settings::default() }, 128);
        // Signed means over blocks of 4 x 4 pixels, so that noise averages out.
        let mut blocks = vec![0.0; SIDE * SIDE / 16];
        for i in (0..SIDE * SIDE).filter(|i| inside(*i)) {
            let values = ["R", "G", "B"].map(|name| f64::from(channel(&image, &format!("subsurface.{name}"))[i]));
            blocks[i / SIDE / 4 * (SIDE / 4) + i % SIDE / 4] += values.iter().sum::<f64>() / 3.0 - expected[i];
        }
        blocks.iter().map(|b| b.abs()).sum::<f64>() / scale
    };
    let errors = [0.2, 0.05, 0.0125, 1e-9].map(error_of);
    println!("mean difference from Lambert at 1/5, 1/20, 1/80, 1e-9 radii: {errors:.4?}");
    // A quarter of the path, a quarter of the error; at no path, what noise and mesh leave.
    let floor = errors[3];
    assert!(floor < 0.005, "{floor}");
    for pair in errors[..3].windows(2) {
        let ratio = (pair[1] - floor).max(0.0) / (pair[0] - floor);
        assert!(ratio < 0.4, "{errors:?}");
    }
}
