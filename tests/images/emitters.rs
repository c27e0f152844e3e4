//! Emissive triangles as lights, against closed forms.

use crate::{
    channel, mean_and_error, render,
    scenes::{Eye, Mesh, gltf, matter, scene},
};
use glam::DVec3;
use serde_json::{Value, json};
use std::f64::consts::PI;
use translucent::{
    Settings,
    reference::{
        boundary::{Side, diffuse_reflectance, transmittance},
        math::integrate,
        profile::{Dipole, Radial},
    },
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
    Settings { resolution: Some((16, 16)), seed: 3, model: Model::Standard, ..Settings::default() }
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
