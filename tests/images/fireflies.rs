//! The directional dipole on meshes coarser than its mean free path, with interpolated normals: no pixel stands out.

use crate::{
    channel, render,
    scenes::{Eye, Mesh, gltf, matter, scene, sun},
};
use glam::DVec3;
use translucent::{Model, Settings, settings::Directional};

/// Largest radiance of the lit part of a coarse ball over its median, with a sample in which few meet.
fn largest_over_median(kappa: f64, sigma_s: f64) -> f64 {
    let eye = Eye { eye: DVec3::new(2.0, 1.5, 3.0), at: DVec3::ZERO, lens: 0.6 };
    let materials = [matter([sigma_s; 3], [0.01 * sigma_s; 3], 1.3)];
    let light = [(sun(), DVec3::new(1.0, 3.0, 2.0), DVec3::ZERO)];
    let scene = scene(&gltf(&[(Mesh::sphere(1.0, 2), 0)], &materials, &light, &eye));
    let directional = Directional { kappa, ..Directional::default() };
    let settings =
        Settings { resolution: Some((48, 48)), model: Model::Directional, directional, ..Settings::default() };
    let mut values: Vec<f32> = channel(&render(&scene, &settings, 64), "subsurface.G").to_vec();
    values.retain(|value| *value > 0.0);
    values.sort_by(f32::total_cmp);
    assert!(values.len() > 700, "the ball is seen: {}", values.len());
    f64::from(values[values.len() - 1]) / f64::from(values[values.len() / 2])
}

#[test]
fn coarse_meshes_have_no_fireflies() {
    // The mean free path from a fifth of an edge to twice the ball's radius.
    for sigma_s in [0.5, 2.0, 8.0] {
        let regular = largest_over_median(1.0, sigma_s);
        println!(
            "sigma_s {sigma_s}: {regular:.2} times the median, as published {:.2}",
            largest_over_median(0.0, sigma_s)
        );
        assert!(regular < 10.0, "sigma_s {sigma_s}: {regular}");
    }
}
