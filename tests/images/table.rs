//! The table model in whole renders: against the twins, and where its totals are known.

use crate::{
    channel, mean_and_error, render,
    scenes::{Eye, Mesh, gltf, matter, scene, sun},
    twins::{both, differences},
};
use glam::DVec3;
use translucent::{
    Image, Model, Projection, Scene, Settings,
    reference::boundary::transmittance,
    scene::Environment,
    settings::{Integrator, Precision},
};

fn settings(size: u32) -> Settings {
    Settings { resolution: Some((size, size)), seed: 5, model: Model::Table, reuse: Some(1), ..Settings::default() }
}

fn uniform(mut scene: Scene) -> Scene {
    scene.set_environment(Environment::constant(DVec3::ONE).expect("valid")).expect("valid");
    scene
}

/// A ball of the radius 1 m.
fn ball(sigma_s: [f64; 3], sigma_a: [f64; 3], ior: f64, lit: bool) -> Scene {
    let eye = Eye { eye: DVec3::new(0.0, 0.0, 4.0), at: DVec3::ZERO, lens: 0.55 };
    let light = (sun(), DVec3::new(3.0, 4.0, 2.0), DVec3::ZERO);
    let lights = if lit { vec![light] } else { vec![] };
    scene(&gltf(&[(Mesh::sphere(1.0, 16), 0)], &[matter(sigma_s, sigma_a, ior)], &lights, &eye))
}

#[test]
fn image_is_the_twins() {
    let mut all = vec![];
    for (projection, precision) in [
        (Projection::Mis, Precision::Packed),
        (Projection::Mis, Precision::Full),
        (Projection::Camera, Precision::Packed),
    ] {
        let scene = uniform(ball([8.0, 4.0, 2.0], [0.3, 0.2, 0.1], 1.4, true));
        let (image, twins) = both(&scene, &Settings { projection, precision, directions: 2, ..settings(16) }, 4);
        all.extend(differences(&image, &twins));
    }
    all.sort_by(f64::total_cmp);
    let outside = all.iter().filter(|d| **d > 1e-4).count();
    assert!(all.len() > 200, "{} lit values", all.len());
    // A radius is drawn from a distribution function in f32, whose cells hold down to 1e-4 of the light.
    assert!(outside * 100 <= all.len(), "{outside} of {}: {:?}", all.len(), &all[all.len() - outside..]);
}

#[test]
fn packed_cells_change_images_within_their_rounding() {
    let scene = uniform(ball([8.0, 4.0, 2.0], [0.3, 0.2, 0.1], 1.4, true));
    for (integrator, reuse) in [(Integrator::Cloud, Some(1)), (Integrator::Sample, Some(1)), (Integrator::Sample, None)]
    {
        let image = |precision| render(&scene, &Settings { integrator, reuse, precision, ..settings(48) }, 32);
        let [packed, full] = [Precision::Packed, Precision::Full].map(image);
        let mean = |image: &Image| channel(image, "subsurface.G").iter().map(|x| f64::from(*x)).sum::<f64>();
        let bias = mean(&packed) / mean(&full) - 1.0;
        let between = packed.relative_mse(&full).expect("of one size").mean.sqrt();
        println!("{integrator}, reuse {reuse:?}: mean {bias:+.1e}, root of relMSE {between:.1e}");
        // The rms rounding of a value: of integers up to 4095 and half of that or more.
        let rounding = (1.0 / 12f64).sqrt() / 2048.0;
        assert!(bias.abs() < rounding, "{integrator}, reuse {reuse:?}: {bias}");
        // Probes come out elsewhere by that much, some of them beyond the edge of a shadow.
        assert!(between < rounding || integrator == Integrator::Sample, "{integrator}: {between}");
        assert!(between > 0.0, "{integrator}: the precision changes nothing");
    }
}

#[test]
fn white_furnace_closes() {
    for ior in [1.0, 1.3, 1.5] {
        let mut mesh = Mesh::default();
        mesh.cuboid(DVec3::new(-1e4, -1e4, -1e4), DVec3::new(1e4, 1e4, 0.0), 1);
        let eye = Eye { eye: DVec3::new(0.0, -5.0, 5.0), at: DVec3::ZERO, lens: 0.02 };
        let scene = uniform(scene(&gltf(&[(mesh, 0)], &[matter([1.0; 3], [0.0; 3], ior)], &[], &eye)));
        let image = render(&scene, &Settings { directions: 4, ..settings(4) }, 512);
        let values: Vec<f64> = channel(&image, "subsurface.G").iter().map(|x| f64::from(*x)).collect();
        let (mean, error) = mean_and_error(&values);
        let expected = transmittance(ior, 0.5f64.sqrt());
        // The ball leaves out 1e-4, the slab's edges some 3e-4.
        assert!((mean - expected).abs() < 0.002 + 4.0 * error, "n = {ior}: {mean} +- {error} for {expected}");
        assert!(error < 0.002, "n = {ior}: {error}");
    }
}
