//! Emissive triangles as lights, and rough boundaries: closed forms, lights of equal power, the independent integrator.

use crate::{
    channel, mean_and_error, render,
    scenes::{Eye, Mesh, gltf, matter, scene},
};
use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use std::f64::consts::PI;
use translucent::{
    Normalisation, Settings,
    reference::{
        area::{Corners, Lamp, Matter, Setting, leaving},
        boundary::{Side, diffuse_reflectance, transmittance},
        math::integrate,
        profile::{Dipole, Radial},
    },
    scene::{Environment, EnvironmentMap},
    settings::Model,
};

/// Diffuse reflectance of [`plaster`].
const WHITE: f64 = 0.5;

/// An opaque material without a highlight near the normal: F0 = 0.
fn plaster() -> Value {
    json!({"pbrMetallicRoughness": {"baseColorFactor": [WHITE, WHITE, WHITE, 1.0], "metallicFactor": 0.0},
        "extensions": {"KHR_materials_ior": {"ior": 1.0}}})
}

/// A black surface that emits.
fn lamp(radiance: f64, two_sided: bool) -> Value {
    json!({"pbrMetallicRoughness": {"baseColorFactor": [0.0, 0.0, 0.0, 1.0], "metallicFactor": 0.0},
        "emissiveFactor": [1.0, 1.0, 1.0], "doubleSided": two_sided,
        "extensions": {"KHR_materials_ior": {"ior": 1.0},
            "KHR_materials_emissive_strength": {"emissiveStrength": radiance}}})
}

/// A disk around (0, 0, height) with the area of radius 1, which faces down, or up.
fn disk(height: f64, up: bool) -> Mesh {
    let corners = 96;
    let step = 2.0 * PI / f64::from(corners);
    let radius = (step / step.sin()).sqrt();
    let normal = if up { DVec3::Z } else { -DVec3::Z };
    let mut mesh = Mesh { positions: vec![DVec3::Z * height], normals: vec![normal], indices: vec![] };
    for i in 0..corners {
        let angle = f64::from(i) * step;
        mesh.positions.push(DVec3::new(radius * angle.cos(), radius * angle.sin(), height));
        mesh.normals.push(normal);
        let (this, next) = (1 + i, 1 + (i + 1) % corners);
        mesh.indices.extend(if up { [0, this, next] } else { [0, next, this] });
    }
    mesh
}

/// Mean and standard error of a channel over independent pixels.
fn mean(file: &Value, settings: &Settings, samples: u32, name: &str) -> (f64, f64) {
    let image = render(&scene(file), settings, samples);
    let values: Vec<f64> = channel(&image, name).iter().map(|&x| f64::from(x)).collect();
    mean_and_error(&values)
}

fn settings() -> Settings {
    Settings { resolution: Some((16, 16)), seed: 3, model: Model::Standard, reuse: Some(1), ..Settings::default() }
}

/// A block below z = 0.
fn block(half: f64) -> Mesh {
    let mut mesh = Mesh::default();
    mesh.cuboid(DVec3::new(-half, -half, -half), DVec3::new(half, half, 0.0), 1);
    mesh
}

#[test]
fn a_disk_lights_a_plane() {
    // E = pi L r^2 / (r^2 + h^2) below the centre. Highlights: Schlick's term is below 1e-4 at these angles.
    let (height, radiance) = (2.0, 3.0);
    let eye = Eye { eye: DVec3::new(2.2, 0.0, 3.0), at: DVec3::ZERO, lens: 1e-4 };
    let share = 1.0 / (1.0 + height * height);
    for (up, two_sided, lit) in [(false, false, 1.0), (true, true, 1.0), (true, false, 0.0)] {
        let file = gltf(&[(block(5.0), 0), (disk(height, up), 1)], &[plaster(), lamp(radiance, two_sided)], &[], &eye);
        let (found, error) = mean(&file, &settings(), 64, "reflection.G");
        let expected = lit * WHITE * radiance * share;
        assert!((found - expected).abs() <= 4.0 * error + 3e-4 * expected, "{up} {two_sided}: {found} +- {error}");
        assert!(error <= 3e-3 * expected, "no force: {found} +- {error}");
    }
    // Matter whose mean free path is far below the disk's distance: what enters is int Ft L cos dw over the cone.
    let (ior, sigma_t) = (1.4, 1e3);
    let file = gltf(
        &[(block(5.0), 0), (disk(height, false), 1)],
        &[matter([0.9 * sigma_t; 3], [0.1 * sigma_t; 3], ior), lamp(radiance, false)],
        &[],
        &eye,
    );
    let (found, error) = mean(&file, &settings(), 128, "subsurface.G");
    let edge = (1.0 - share).sqrt();
    let entering = 2.0 * PI * radiance * integrate(edge, 1.0, 4, |c| transmittance(ior, c) * c);
    let view = 3.0 / 2.2f64.hypot(3.0);
    let total = Dipole::new(0.9, 0.1, ior).total();
    let expected = transmittance(ior, view) * total * entering / (PI * (1.0 - diffuse_reflectance(ior, Side::Outside)));
    assert!((found - expected).abs() < 4.0 * error + 3e-4 * expected, "{found} +- {error}, not {expected}");
    assert!(error < 5e-3 * expected, "no force: {found} +- {error}");
}

#[test]
fn lights_of_equal_power_agree() {
    // A point light, a sphere that emits as much and a patch of the environment that is seen as bright: far away, and
    // an inclination at which Fresnel's factor and the cosine matter.
    let (width, height, x, y) = (128u32, 64u32, 41u32, 13u32);
    let (phi, theta) =
        (2.0 * PI * ((f64::from(x) + 0.5) / f64::from(width) - 0.5), PI * (f64::from(y) + 0.5) / f64::from(height));
    let towards = DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
    let turn = glam::DQuat::from_rotation_arc(DVec3::Z, DVec3::Y);
    let mut ground = block(5.0);
    ground.positions.iter_mut().for_each(|p| *p = turn * *p);
    ground.normals.iter_mut().for_each(|n| *n = turn * *n);
    let eye = Eye { eye: DVec3::new(1.0, 10.0, 0.0), at: DVec3::ZERO, lens: 1e-4 };
    let (distance, intensity) = (200.0, 4e4);
    let mut ball = Mesh::sphere(1.0, 8);
    let area: f64 = ball
        .indices
        .chunks_exact(3)
        .map(|t| {
            let [a, b, c] = [0, 1, 2].map(|i| ball.positions[t[i] as usize]);
            (b - a).cross(c - a).length() / 2.0
        })
        .sum();
    ball.positions.iter_mut().for_each(|p| *p += towards * distance);
    // pi L A = 4 pi I.
    let radiance = 4.0 * intensity / area;
    // The lookup is bilinear, so that a texel shines as a tent of its own solid angle.
    let texel = 2.0 * PI / f64::from(width) * PI / f64::from(height) * theta.sin();
    let bright = (intensity / (distance * distance) / texel) as f32;
    let patch = EnvironmentMap::Image {
        width,
        height,
        radiance: (0..width * height)
            .map(|i| if i == y * width + x { Vec3::splat(bright) } else { Vec3::ZERO })
            .collect(),
    };
    let point = (json!({"type": "point", "intensity": intensity}), towards * distance, DVec3::ZERO);
    let settings = Settings { directions: 4, ..settings() };
    for ground_material in [matter([900.0; 3], [100.0; 3], 1.4), plaster()] {
        let name = if ground_material["extras"].is_null() { "reflection.G" } else { "subsurface.G" };
        let materials = [ground_material, lamp(radiance, false)];
        let by_point =
            mean(&gltf(&[(ground.clone(), 0)], &materials, std::slice::from_ref(&point), &eye), &settings, 256, name);
        let both = [(ground.clone(), 0), (ball.clone(), 1)];
        let by_sphere = mean(&gltf(&both, &materials, &[], &eye), &settings, 256, name);
        let mut lit = scene(&gltf(&[(ground.clone(), 0)], &materials, &[], &eye));
        lit.set_environment(Environment { map: patch.clone(), ..Environment::default() }).expect("valid");
        let image = render(&lit, &settings, 256);
        let values: Vec<f64> = channel(&image, name).iter().map(|&x| f64::from(x)).collect();
        for (light, (found, error)) in [("sphere", by_sphere), ("patch", mean_and_error(&values))] {
            let off = (found / by_point.0 - 1.0).abs();
            let error = error.hypot(by_point.1) / by_point.0;
            println!("{name}, {light}: {:.5} +- {error:.5}", found / by_point.0);
            assert!(off < 0.01 && error < 0.0025, "{name}, {light}: {off} +- {error}");
        }
    }
}

#[test]
fn near_emitters_agree_with_the_integrator() {
    // A cube; a quad that emits, close to it and tilted, so that both techniques have a part; and a wall between.
    let (sigma_s, sigma_a, ior) = ([2.0, 4.0, 6.0], [0.1, 0.5, 2.0], 1.4);
    let mut cube = Mesh::default();
    cube.cuboid(DVec3::splat(-1.0), DVec3::splat(1.0), 1);
    let mut quad = Mesh::default();
    quad.quad(DVec3::new(0.2, -0.8, 1.1), DVec3::new(0.0, 1.2, 0.1), DVec3::new(1.4, 0.0, 0.6));
    let mut wall = Mesh::default();
    wall.quad(DVec3::new(-0.1, -1.0, 1.02), DVec3::Y * 1.5, DVec3::Z * 0.2);
    let corners = |mesh: &Mesh| -> Vec<Corners> {
        mesh.indices.chunks_exact(3).map(|t| [0, 1, 2].map(|i| mesh.positions[t[i] as usize])).collect()
    };
    // Wound counter-clockwise from below, where the cube is.
    let normal = quad.normals[0];
    assert!(normal.z < 0.0);
    let set = corners(&cube);
    let blockers = [corners(&quad), corners(&wall)].concat();
    for (two_sided, surrounding) in [(false, 0.0), (true, 0.4)] {
        let lamps: Vec<Lamp> = corners(&quad)
            .into_iter()
            .map(|corners| Lamp::Triangle { corners, radiance: DVec3::splat(5.0), two_sided })
            .collect();
        let setting = Setting {
            set: &set,
            blockers: &blockers,
            entries: &[],
            matter: Matter {
                sigma_s_prime: sigma_s.into(),
                sigma_a: sigma_a.into(),
                g: 0.0,
                ior,
                normalisation: Normalisation::Energy,
                model: Model::Standard,
            },
            lamps: &lamps,
            surrounding: DVec3::splat(surrounding),
        };
        for (point, normal) in [(DVec3::new(-0.5, 0.1, 1.0), DVec3::Z), (DVec3::new(0.3, 1.0, 0.4), DVec3::Y)] {
            let eye = Eye { eye: point + 4.0 * normal + DVec3::new(-2.0, 0.5, 0.3), at: point, lens: 1e-4 };
            let expected = leaving(&setting, point, normal, (eye.eye - point).normalize(), 1 << 19, 11);
            let meshes = [(cube.clone(), 0), (quad.clone(), 1), (wall.clone(), 2)];
            let black = json!({"pbrMetallicRoughness": {"baseColorFactor": [0.0, 0.0, 0.0, 1.0]}});
            let materials = [matter(sigma_s, sigma_a, ior), lamp(5.0, two_sided), black];
            let mut scene = scene(&gltf(&meshes, &materials, &[], &eye));
            if surrounding > 0.0 {
                scene.set_environment(Environment::constant(DVec3::splat(surrounding)).expect("valid")).expect("valid");
            }
            let image = render(&scene, &Settings { resolution: Some((24, 24)), ..settings() }, 512);
            for (c, letter) in ["R", "G", "B"].into_iter().enumerate() {
                let values = channel(&image, &format!("subsurface.{letter}"));
                let (mean, error) = mean_and_error(&values.iter().map(|x| f64::from(*x)).collect::<Vec<_>>());
                let error = error.hypot(expected.error[c]);
                let what = format!("{point}, {surrounding}, {letter}: {mean} and {} +- {error}", expected.mean[c]);
                assert!((mean - expected.mean[c]).abs() < 4.0 * error, "{what}");
                assert!(error < 0.05 * expected.mean[c], "no force: {what}");
            }
        }
    }
}

#[test]
fn a_rough_white_furnace_closes() {
    for (roughness, ior, tilt) in [(0.3, 1.5, 1.4f64), (0.6, 1.3, 0.7), (1.0, 1.5, 0.0)] {
        let mut material = matter([1.0; 3], [0.0; 3], ior);
        material["extras"]["bssrdf"]["surface"] = json!("rough");
        material["pbrMetallicRoughness"] = json!({"roughnessFactor": roughness});
        // Off the diagonal, along which rays may pass between two triangles.
        let at = DVec3::new(500.0, -900.0, 0.0);
        let eye = Eye { eye: at + DVec3::new(0.0, -10.0 * tilt.sin(), 10.0 * tilt.cos()), at, lens: 1e-4 };
        // At the block's edges, 1e4 mean free paths away, 3e-4 of the light are lost.
        let mut furnace = scene(&gltf(&[(block(1e4), 0)], &[material], &[], &eye));
        furnace.set_environment(Environment::constant(DVec3::ONE).expect("valid")).expect("valid");
        let image = render(&furnace, &Settings { directions: 4, ..settings() }, 128);
        let (found, error) = mean_and_error(&channel(&image, "G").iter().map(|&x| f64::from(x)).collect::<Vec<_>>());
        println!("roughness {roughness}, n {ior}, tilt {tilt}: {found:.5} +- {error:.5}");
        assert!((found - 1.0).abs() < 1e-3 + 4.0 * error, "{roughness} {ior} {tilt}: {found} +- {error}");
        assert!(error < 2e-3, "no force: {found} +- {error}");
    }
}

#[test]
fn the_back_of_a_lamp_is_dark() {
    let eye = Eye { eye: DVec3::Z * 3.0, at: DVec3::ZERO, lens: 1e-2 };
    for (up, two_sided, radiance) in [(true, false, 2.0), (false, false, 0.0), (false, true, 2.0)] {
        let file = gltf(&[(disk(0.0, up), 0)], &[lamp(2.0, two_sided)], &[], &eye);
        let image = render(&scene(&file), &settings(), 4);
        let seen = channel(&image, "reflection.R");
        assert!(seen.iter().all(|light| *light == radiance), "{up}, {two_sided}: {seen:?}");
    }
}
