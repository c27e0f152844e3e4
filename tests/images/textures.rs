//! Textured scenes: against the twins, against closed forms, against the same scene made of geometry.

use crate::{
    channel, mean_and_error, render,
    scenes::{Eye, Mesh, gltf, matter, scene, standard, sun},
    twins::both,
};
use base64::Engine;
use glam::{DVec2, DVec3};
use image::{ImageFormat, Rgba, RgbaImage};
use serde_json::{Value, json};
use translucent::{
    Scene, Settings,
    reference::{
        boundary::{Side, diffuse_reflectance, transmittance},
        profile::{Dipole, Radial},
    },
    scene::Environment,
    settings::Model,
};

fn data_uri(bytes: &[u8]) -> String {
    format!("data:application/octet-stream;base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes))
}

/// Adds a picture with a sampler; the index of its texture.
pub fn add_texture(file: &mut Value, picture: &RgbaImage, sampler: Value) -> usize {
    let mut bytes = std::io::Cursor::new(vec![]);
    picture.write_to(&mut bytes, ImageFormat::Png).expect("a picture in memory");
    let mut push = |list: &str, item: Value| {
        if file[list].is_null() {
            file[list] = json!([]);
        }
        let items = file[list].as_array_mut().expect("a list");
        items.push(item);
        items.len() - 1
    };
    let source = push("images", json!({"uri": data_uri(bytes.get_ref())}));
    let sampler = push("samplers", sampler);
    push("textures", json!({"source": source, "sampler": sampler}))
}

/// Gives the vertices of a mesh texture coordinates.
pub fn add_coordinates(file: &mut Value, mesh: usize, uv: impl Iterator<Item = DVec2>) {
    let uv: Vec<[f32; 2]> = uv.map(|uv| uv.as_vec2().to_array()).collect();
    let bytes: &[u8] = bytemuck::cast_slice(&uv);
    let mut push = |list: &str, item: Value| {
        let items = file[list].as_array_mut().expect("a list");
        items.push(item);
        items.len() - 1
    };
    let buffer = push("buffers", json!({"uri": data_uri(bytes), "byteLength": bytes.len()}));
    let view = push("bufferViews", json!({"buffer": buffer, "byteLength": bytes.len()}));
    let accessor =
        push("accessors", json!({"bufferView": view, "componentType": 5126, "count": uv.len(), "type": "VEC2"}));
    file["meshes"][mesh]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(accessor);
}

/// A picture whose texels are numbers of a hash, none of them below `least`.
pub fn noise(size: u32, least: u8) -> RgbaImage {
    let byte = |i: u32| least + (translucent::reference::random::hash(i) % (256 - u32::from(least))) as u8;
    RgbaImage::from_fn(size, size, |x, y| {
        let i = 4 * (size * y + x);
        Rgba([byte(i), byte(i + 1), byte(i + 2), byte(i + 3)])
    })
}

/// Matter of KHR_materials_scatter with sigma_t in 1/m.
fn scattering(rho: [f64; 3], sigma_t: f64) -> Value {
    let e = (-1f64).exp();
    json!({"pbrMetallicRoughness": {"roughnessFactor": 0.0, "metallicFactor": 0.0}, "extensions": {
        "KHR_materials_transmission": {"transmissionFactor": 1},
        "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 1.0 / sigma_t,
            "attenuationColor": [e, e, e]},
        "KHR_materials_ior": {"ior": 1.3},
        "KHR_materials_scatter": {"scatterStrengthFactor": 1, "multiscatterColorFactor": rho}}})
}

/// A sphere whose matter, tint, roughness and normals are noise, half of it cut away by alpha, on a noisy table.
fn noisy() -> Scene {
    let eye = Eye { eye: DVec3::new(1.0, 2.0, 4.0), at: DVec3::new(0.0, -0.2, 0.0), lens: 0.6 };
    let mut ball = scattering([0.9, 0.8, 0.7], 5.0);
    let mut table = json!({"emissiveFactor": [0.1, 0.2, 0.3]});
    let mut mesh = Mesh::default();
    mesh.quad(DVec3::new(-2.0, -1.0, 2.0), DVec3::X * 4.0, DVec3::Z * -4.0);
    let sphere = Mesh::sphere(1.0, 6);
    let light = (sun(), DVec3::new(3.0, 4.0, 2.0), DVec3::ZERO);
    let mut file = gltf(&[(sphere.clone(), 0), (mesh.clone(), 1)], &[json!({}), json!({})], &[light], &eye);
    add_coordinates(&mut file, 0, sphere.positions.iter().map(|p| DVec2::new(p.x * 0.7 + 0.1, p.y - 0.3 * p.z)));
    add_coordinates(&mut file, 1, mesh.positions.iter().map(|p| DVec2::new(p.x, p.z)));
    let smooth = add_texture(&mut file, &noise(8, 60), json!({"wrapS": 33648}));
    let blocks = add_texture(&mut file, &noise(5, 30), json!({"magFilter": 9728, "wrapT": 33071}));
    let bumps = add_texture(&mut file, &noise(7, 90), json!({}));
    let turned =
        json!({"index": smooth, "extensions": {"KHR_texture_transform": {"rotation": 0.4, "scale": [1.5, 0.7]}}});
    ball["extensions"]["KHR_materials_scatter"]["multiscatterColorTexture"] = turned;
    ball["extensions"]["KHR_materials_scatter"]["scatterStrengthTexture"] = json!({"index": bumps});
    ball["pbrMetallicRoughness"] = json!({"baseColorFactor": [0.9, 0.9, 0.8, 1], "baseColorTexture": {"index": blocks},
        "roughnessFactor": 0.5, "metallicRoughnessTexture": {"index": bumps}});
    ball["alphaMode"] = json!("MASK");
    for (material, scale) in [(&mut ball, 0.4), (&mut table, 0.8)] {
        material["normalTexture"] = json!({"index": bumps, "scale": scale});
    }
    table["pbrMetallicRoughness"] = json!({"baseColorTexture": {"index": smooth}, "metallicFactor": 0.5,
        "metallicRoughnessTexture": {"index": blocks}});
    table["emissiveTexture"] = json!({"index": blocks});
    file["materials"] = json!([ball, table]);
    let mut scene = scene(&file);
    scene.set_environment(Environment::constant(DVec3::new(0.3, 0.5, 0.8)).expect("valid")).expect("valid");
    scene
}

#[test]
fn image_is_the_twins() {
    let scene = noisy();
    let settings = Settings { resolution: Some((20, 20)), seed: 4, show_environment: true, ..standard() };
    let (image, twins) = both(&scene, &settings, 8);
    let mut found = vec![];
    for (i, twin) in twins.iter().enumerate() {
        for (name, expected) in [("subsurface", twin.subsurface), ("reflection", twin.reflection)] {
            let value = crate::twins::layer(&image, name, i).as_dvec3();
            let scale = value.length().max(expected.as_dvec3().length());
            if scale > 0.0 {
                found.push((value - expected.as_dvec3()).length() / scale);
            }
        }
    }
    found.sort_by(f64::total_cmp);
    // Coordinates have fewer digits than positions: a texel's edge may be taken for the other side's.
    let outside = found.iter().filter(|d| **d > 3e-5).count();
    println!("{} values, median {:.1e}, {outside} beyond 3e-5", found.len(), found[found.len() / 2]);
    assert!(found.len() > 300 && found[found.len() / 2] < 3e-6);
    assert!(outside * 100 <= found.len(), "{outside} of {}: {:?}", found.len(), &found[found.len() - outside..]);
}

#[test]
fn white_textures_change_no_bit() {
    let eye = Eye { eye: DVec3::new(1.0, 2.0, 4.0), at: DVec3::ZERO, lens: 0.6 };
    let mesh = Mesh::sphere(1.0, 8);
    let light = (sun(), DVec3::new(3.0, 4.0, 2.0), DVec3::ZERO);
    let mut file = gltf(&[(mesh.clone(), 0)], &[scattering([0.9, 0.8, 0.7], 5.0)], &[light], &eye);
    file["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = json!(0.4);
    let settings = Settings { resolution: Some((24, 24)), seed: 4, ..standard() };
    let plain = render(&scene(&file), &settings, 8);
    add_coordinates(&mut file, 0, mesh.positions.iter().map(|p| DVec2::new(p.x, p.y)));
    let white = add_texture(&mut file, &RgbaImage::from_pixel(3, 2, Rgba([255; 4])), json!({}));
    let material = &mut file["materials"][0];
    material["extensions"]["KHR_materials_scatter"]["multiscatterColorTexture"] = json!({"index": white});
    material["extensions"]["KHR_materials_scatter"]["scatterStrengthTexture"] = json!({"index": white});
    material["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": white});
    material["pbrMetallicRoughness"]["metallicRoughnessTexture"] = json!({"index": white});
    material["emissiveTexture"] = json!({"index": white});
    material["alphaMode"] = json!("MASK");
    let textured = render(&scene(&file), &settings, 8);
    for name in ["R", "G", "B", "subsurface.G", "reflection.G", "variance.G", "A"] {
        let (a, b) = (channel(&plain, name), channel(&textured, name));
        assert!(a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits()), "{name}");
        assert!(a.iter().any(|a| *a != 0.0), "{name}");
    }
}

/// Of a mean free path of 1 m and the drafts' albedo of a channel, as they print it; g = 0.
fn dipole(rho: f64) -> Dipole {
    let s = 4.09712 + 4.20863 * rho - (9.59217 + 41.6808 * rho + 17.7126 * rho * rho).sqrt();
    Dipole::new(1.0 - s * s, s * s, 1.3)
}

/// Radiance of a plane of homogeneous matter under a light of E_perp = pi at the cosine `c`, seen along its normal.
fn plane_radiance(rho: f64, c: f64) -> f64 {
    let dipole = dipole(rho);
    let rho_e = diffuse_reflectance(1.3, Side::Outside);
    transmittance(1.3, 1.0) * transmittance(1.3, c) * c * dipole.total() / (1.0 - rho_e)
}

/// A slab in z < 0 whose coordinates u, v run along x, y from 0 to 1, and its file.
fn slab(material: Value, at: DVec3, light: DVec3) -> Value {
    let mut mesh = Mesh::default();
    mesh.cuboid(DVec3::new(-200.0, -200.0, -200.0), DVec3::new(200.0, 200.0, 0.0), 1);
    let eye = Eye { eye: at + DVec3::Z * 10.0, at, lens: 0.02 };
    let mut file = gltf(&[(mesh.clone(), 0)], &[material], &[(sun(), light, DVec3::ZERO)], &eye);
    add_coordinates(&mut file, 0, mesh.positions.iter().map(|p| DVec2::new(p.x, -p.y) / 400.0 + 0.5));
    file
}

fn mean_of(file: &Value, samples: u32) -> (f64, f64) {
    mean_by(Model::Standard, file, samples)
}

fn mean_by(model: Model, file: &Value, samples: u32) -> (f64, f64) {
    let settings = Settings { resolution: Some((4, 4)), seed: 1, model, ..Settings::default() };
    let image = render(&scene(file), &settings, samples);
    let values: Vec<f64> = channel(&image, "subsurface.G").iter().map(|x| f64::from(*x)).collect();
    mean_and_error(&values)
}

#[test]
fn two_albedos_far_from_their_border_are_two_closed_forms() {
    // 1 m is a mean free path; the border is 100 of them away.
    let (factor, bytes) = (0.9, [Rgba([60, 188, 10, 255]), Rgba([200, 255, 0, 255])]);
    // IEC 61966-2-1 at 188 and 255.
    for (x, texel) in [(-100.0, 0.502_886_458), (100.0, 1.0)] {
        let mut file = slab(scattering([factor; 3], 1.0), DVec3::new(x, 13.0, 0.0), DVec3::new(0.0, 60.0, 100.0));
        let picture = RgbaImage::from_fn(2, 1, |x, _| bytes[x as usize]);
        let texture = add_texture(&mut file, &picture, json!({"magFilter": 9728}));
        file["materials"][0]["extensions"]["KHR_materials_scatter"]["multiscatterColorTexture"] =
            json!({"index": texture});
        let expected = plane_radiance(factor * texel, 100.0 / 60f64.hypot(100.0));
        let (mean, error) = mean_of(&file, 512);
        // Six digits of the drafts' constants; the ramp's interpolation; what comes from beyond the border and the end.
        let dipole = dipole(factor * texel);
        let slack = (2e-5 + dipole.outside(100.0) / dipole.mass()) * expected;
        assert!((mean - expected).abs() < 4.0 * error + slack, "{x}: {mean} +- {error}, not {expected} +- {slack}");
        assert!(slack < 1e-3 * expected, "{slack}");
        assert!(error < 0.01 * expected, "{error}");
    }
}

#[test]
fn base_colour_tints_both_crossings() {
    let light = DVec3::new(0.0, 60.0, 100.0);
    let file = slab(scattering([0.8; 3], 1.0), DVec3::ZERO, light);
    let (plain, _) = mean_of(&file, 32);
    let mut factor = file.clone();
    factor["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([1, 0.5, 1, 1]);
    assert!((mean_of(&factor, 32).0 / plain - 0.25).abs() < 1e-5, "the same samples: the ratio is exact to rounding");
    let directional = mean_by(Model::Directional, &factor, 32).0 / mean_by(Model::Directional, &file, 32).0;
    assert!((directional - 0.25).abs() < 1e-5, "{directional}");
    let mut both = factor.clone();
    let texture = add_texture(&mut both, &RgbaImage::from_pixel(1, 1, Rgba([0, 188, 0, 255])), json!({}));
    both["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": texture});
    let expected = (0.5f64 * 0.502_886_458).powi(2);
    assert!((mean_of(&both, 32).0 / plain / expected - 1.0).abs() < 1e-5);
    // Measured matter has its own colour.
    both["materials"][0] = matter([1.0; 3], [0.1; 3], 1.3);
    let (own, _) = mean_of(&both, 32);
    both["materials"][0]["pbrMetallicRoughness"] = json!({"baseColorFactor": [1, 0.5, 1, 1]});
    assert_eq!(mean_of(&both, 32).0, own);
}

#[test]
fn normal_maps_turn_cosines_and_nothing_else() {
    // Normals of a byte each: (x, y, z) = 2 c - 1. The light stands along +y of the picture, which is +y here.
    let bytes = [128u8, 180, 240];
    let v = DVec3::from(bytes.map(|b| 2.0 * f64::from(b) / 255.0 - 1.0));
    let light = DVec3::new(0.0, 60.0, 100.0);
    let mut file = slab(scattering([0.8; 3], 1.0), DVec3::ZERO, light);
    let (plain, plain_error) = mean_of(&file, 256);
    let c = light.normalize().z;
    assert!((plain - plane_radiance(0.8, c)).abs() < 4.0 * plain_error + 2e-5 * plain);
    let [r, g, b] = bytes;
    let texture = add_texture(&mut file, &RgbaImage::from_pixel(1, 1, Rgba([r, g, b, 255])), json!({}));
    for scale in [1.0, -0.5] {
        file["materials"][0]["normalTexture"] = json!({"index": texture, "scale": scale});
        let n = DVec3::new(scale * v.x, scale * v.y, v.z).normalize();
        // The sampled radii are the same ones, so that the ratio has no noise but the shading of the view.
        let (turned, _) = mean_of(&file, 256);
        let ratio = transmittance(1.3, n.z) / transmittance(1.3, 1.0)
            * transmittance(1.3, n.dot(light.normalize()))
            * n.dot(light.normalize())
            / (transmittance(1.3, c) * c);
        assert!((turned / plain / ratio - 1.0).abs() < 2e-5, "{scale}: {} {ratio}", turned / plain);
        assert!((ratio - 1.0).abs() > 0.05, "the test has force");
    }
}

#[test]
fn a_light_below_either_horizon_lights_nothing() {
    // The map leans towards a light below the true horizon, and away from one above it.
    let texture = |file: &mut Value, green: u8| {
        let index = add_texture(file, &RgbaImage::from_pixel(1, 1, Rgba([128, green, 140, 255])), json!({}));
        file["materials"][0]["normalTexture"] = json!({"index": index});
    };
    for (light, green) in [(DVec3::new(0.0, 100.0, -10.0), 255), (DVec3::new(0.0, 100.0, 10.0), 0)] {
        // A sheet: a slab's own sides would cast the shadow.
        let mut sheet = Mesh::default();
        sheet.quad(DVec3::new(-50.0, -50.0, 0.0), DVec3::X * 100.0, DVec3::Y * 100.0);
        let eye = Eye { eye: DVec3::Z * 10.0, at: DVec3::ZERO, lens: 0.02 };
        for material in [scattering([0.8; 3], 1.0), json!({"pbrMetallicRoughness": {"metallicFactor": 0.0}})] {
            let mut file = gltf(&[(sheet.clone(), 0)], &[material], &[(sun(), light, DVec3::ZERO)], &eye);
            add_coordinates(&mut file, 0, sheet.positions.iter().map(|p| DVec2::new(p.x, -p.y)));
            texture(&mut file, green);
            let settings = Settings { resolution: Some((4, 4)), ..standard() };
            let image = render(&scene(&file), &settings, 16);
            assert!(channel(&image, "G").iter().all(|x| *x == 0.0), "{light}");
        }
    }
}

#[test]
fn a_mask_is_its_geometry() {
    // A quad of which a mask leaves every other column, over a table; and the columns themselves.
    let eye = Eye { eye: DVec3::new(1.0, 4.0, 6.0), at: DVec3::ZERO, lens: 0.5 };
    let mut table = Mesh::default();
    table.quad(DVec3::new(-3.0, -1.0, 3.0), DVec3::X * 6.0, DVec3::Z * -6.0);
    let paint = json!({"pbrMetallicRoughness": {"metallicFactor": 0.0}});
    let light = (sun(), DVec3::new(1.0, 4.0, 0.5), DVec3::ZERO);
    let settings = Settings { resolution: Some((40, 40)), seed: 3, ..standard() };
    for glowing in [scattering([0.8; 3], 20.0), paint.clone()] {
        let mut whole = Mesh::default();
        whole.quad(DVec3::new(-1.0, 0.0, 1.0), DVec3::X * 2.0, DVec3::Z * -2.0);
        let mut columns = Mesh::default();
        for i in 0..4 {
            let left = DVec3::new(-1.0 + 0.5 * f64::from(i), 0.0, 1.0);
            columns.quad(left, DVec3::X * 0.25, DVec3::Z * -2.0);
        }
        let mut masked = gltf(
            &[(whole.clone(), 0), (table.clone(), 1)],
            &[glowing.clone(), paint.clone()],
            std::slice::from_ref(&light),
            &eye,
        );
        add_coordinates(&mut masked, 0, whole.positions.iter().map(|p| DVec2::new(2.0 * (p.x + 1.0), p.z)));
        let picture = RgbaImage::from_fn(2, 1, |x, _| Rgba([255, 255, 255, if x == 0 { 200 } else { 100 }]));
        let texture = add_texture(&mut masked, &picture, json!({"magFilter": 9728}));
        masked["materials"][0]["alphaMode"] = json!("MASK");
        masked["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": texture});
        let made =
            gltf(&[(columns, 0), (table.clone(), 1)], &[glowing, paint.clone()], std::slice::from_ref(&light), &eye);
        let (a, b) = (render(&scene(&masked), &settings, 16), render(&scene(&made), &settings, 16));
        let (a, b) = (channel(&a, "reflection.G"), channel(&b, "reflection.G"));
        let shadow = b.iter().filter(|x| **x == 0.0).count();
        let other = a.iter().zip(b).filter(|(a, b)| (*a - *b).abs() > 1e-4 * b.abs().max(1e-3)).count();
        assert!(shadow > 100, "{shadow} pixels in shadow");
        assert!(other <= 16, "{other} of {} pixels differ: edges alone may", a.len());
    }
}
