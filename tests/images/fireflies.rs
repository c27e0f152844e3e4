//! The directional dipole where the published one has fireflies: light that runs along the exit's tangent plane, because
//! a normal map or the next face of a coarse mesh turned it there.

use crate::{
    channel, render,
    scenes::{Eye, Mesh, gltf, matter, scene, sun},
    textures::{add_coordinates, add_texture, noise},
};
use glam::{DVec2, DVec3};
use serde_json::json;
use translucent::{Model, Scene, Settings, prepare::prepare, settings::Directional, shared::RECIPROCAL};

/// The brightest pixel over the median.
fn largest_over_median(scene: &Scene, kappa: f64) -> f64 {
    let directional = Some(Directional { kappa, ..Directional::default() });
    let settings =
        Settings { resolution: Some((48, 48)), model: Model::Directional, directional, ..Settings::default() };
    let mut values: Vec<f32> = channel(&render(scene, &settings, 64), "subsurface.G").to_vec();
    values.retain(|value| *value > 0.0);
    values.sort_by(f32::total_cmp);
    assert!(values.len() > 700, "the body is seen: {}", values.len());
    f64::from(values[values.len() - 1]) / f64::from(values[values.len() / 2])
}

/// The regularised model has none beyond ten times the median, the published one has.
fn check(what: &str, scene: &Scene) {
    let (regular, published) = (largest_over_median(scene, 1.0), largest_over_median(scene, 0.0));
    println!("{what}: {regular:.1} times the median, as published {published:.1}");
    assert!(regular < 10.0, "{what}: {regular}");
    assert!(published > 10.0, "{what}: no force, {published}");
}

/// A mesh whose normals are noise of so many texels a unit, under a light 10 degrees above the plane z = 0.
fn bumpy(mesh: Mesh, texels: u32, filter: u32, sigma_s: f64, eye: &Eye) -> Scene {
    let elevation = 10f64.to_radians();
    let light = [(sun(), DVec3::new(elevation.cos(), 0.0, elevation.sin()), DVec3::ZERO)];
    let mut file = gltf(&[(mesh.clone(), 0)], &[matter([sigma_s; 3], [0.01 * sigma_s; 3], 1.3)], &light, eye);
    add_coordinates(&mut file, 0, mesh.positions.iter().map(|p| DVec2::new(p.x, p.y) / 2.0));
    let bumps = add_texture(&mut file, &noise(texels, 0), json!({"magFilter": filter}));
    file["materials"][0]["normalTexture"] = json!({"index": bumps});
    scene(&file)
}

#[test]
fn normal_maps_have_no_fireflies() {
    const NEAREST: u32 = 9728;
    const LINEAR: u32 = 9729;
    let eye = Eye { eye: DVec3::new(0.0, 0.0, 3.0), at: DVec3::ZERO, lens: 0.6 };
    // A plate; a texel is a sixth to two thirds of the mean free path, and two and a half.
    for (texels, filter, sigma_s) in [(64, NEAREST, 5.0), (64, LINEAR, 20.0), (16, LINEAR, 20.0)] {
        let mut plate = Mesh::default();
        plate.quad(DVec3::new(-1.0, -1.0, 0.0), DVec3::X * 2.0, DVec3::Y * 2.0);
        let scene = bumpy(plate, texels, filter, sigma_s, &eye);
        check(&format!("plate, {texels} texels, sigma_s {sigma_s}"), &scene);
    }
    // A coarse ball.
    for sigma_s in [1.0, 2.0] {
        let eye = Eye { eye: DVec3::new(2.0, 1.0, 3.0), ..eye };
        let scene = bumpy(Mesh::sphere(1.0, 2), 64, LINEAR, sigma_s, &eye);
        check(&format!("ball, sigma_s {sigma_s}"), &scene);
    }
}

#[test]
fn coarse_meshes_have_no_fireflies() {
    // Light that enters one face of a box nearly runs along the next.
    for (sigma_s, tilt) in [(1.0, 0.3), (2.0, 0.3)] {
        let mut cube = Mesh::default();
        cube.cuboid(DVec3::NEG_ONE, DVec3::ONE, 1);
        let light = [(sun(), DVec3::new(1.0, 0.01, tilt), DVec3::ZERO)];
        let eye = Eye { eye: DVec3::new(1.0, 0.5, 5.0), at: DVec3::ZERO, lens: 0.6 };
        let scene = scene(&gltf(&[(cube, 0)], &[matter([sigma_s; 3], [0.01 * sigma_s; 3], 1.3)], &light, &eye));
        check(&format!("box, sigma_s {sigma_s}, {tilt}"), &scene);
    }
}

#[test]
fn the_file_says_how_unless_the_settings_do() {
    let mut material = matter([5.0; 3], [0.1; 3], 1.3);
    let members = &mut material["extras"]["bssrdf"];
    (members["model"], members["reciprocal"], members["kappa"]) = ("directional".into(), true.into(), 0.25.into());
    let eye = Eye { eye: DVec3::Z * 3.0, at: DVec3::ZERO, lens: 0.6 };
    let scene = scene(&gltf(&[(Mesh::sphere(1.0, 2), 0)], &[material], &[], &eye));
    let made = |directional: Option<Directional>| {
        let settings = Settings { resolution: Some((4, 4)), directional, ..Settings::default() };
        let material = prepare(&scene, &settings).expect("valid").materials[0];
        (material.flags & RECIPROCAL != 0, material.floor.x / material.free_path.x)
    };
    assert_eq!(made(None), (true, 0.25));
    assert_eq!(made(Some(Directional::default())), (false, 1.0));
}
