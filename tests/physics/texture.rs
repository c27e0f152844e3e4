//! Textures: texels where they stand, ramps against the matter itself, and the bound on what darker matter weighs.

use crate::common::World;
use base64::Engine;
use glam::{DVec2, DVec3, Vec3};
use image::{ImageFormat, Rgba, RgbaImage};
use serde_json::json;
use translucent::{
    LoadOptions, Model, Scene, Settings,
    prepare::prepare,
    reference::{profile, texture},
    scene::AlbedoMapping,
    shared::*,
};

/// A picture of 3 x 2 grey texels, and a texture of it.
fn world(wrap: u32, linear: u32) -> (World, Texture) {
    let mut world = World::new(Material::default(), PROJECTION_MIS, 1);
    world.texels = [10, 20, 40, 80, 160, 240u8].map(|grey| u32::from_le_bytes([grey, grey, grey, 255])).to_vec();
    let texture = Texture {
        width: 3,
        height: 2,
        wrap_u: wrap,
        wrap_v: wrap,
        linear,
        row_u: Vec3::X,
        row_v: Vec3::Y,
        ..Texture::default()
    };
    (world, texture)
}

fn grey(wrap: u32, linear: u32, u: f64, v: f64) -> f64 {
    let (world, texture) = world(wrap, linear);
    // Places in texels.
    255.0 * texture::at(&world.inputs(), &texture, DVec2::new(u / 3.0, v / 2.0)).x
}

#[test]
fn bytes_decode_as_srgb() {
    // IEC 61966-2-1.
    for (byte, linear) in [(0, 0.0), (10, 0.003035269835), (11, 0.003346535764), (188, 0.502886458033), (255, 1.0)] {
        assert!((texture::decode(byte) - linear).abs() < 1e-11, "{byte}: {}", texture::decode(byte));
    }
}

#[test]
fn texels_stand_in_rows_from_the_upper_left() {
    for linear in [0, 1] {
        for (x, y, value) in [(0, 0, 10.0), (1, 0, 20.0), (2, 0, 40.0), (0, 1, 80.0), (2, 1, 240.0)] {
            let found = grey(WRAP_REPEAT, linear, f64::from(x) + 0.5, f64::from(y) + 0.5);
            assert!((found - value).abs() < 1e-9, "{x} {y}: {found}");
        }
    }
    // The nearest one fills its cell; between middles, the mean of two or of four.
    assert!((grey(WRAP_REPEAT, 0, 1.999, 0.001) - 20.0).abs() < 1e-9);
    assert!((grey(WRAP_REPEAT, 1, 1.0, 0.5) - 15.0).abs() < 1e-9);
    assert!((grey(WRAP_REPEAT, 1, 2.0, 1.0) - (20.0 + 40.0 + 160.0 + 240.0) / 4.0).abs() < 1e-9);
    assert!((grey(WRAP_REPEAT, 1, 0.75, 0.5) - 12.5).abs() < 1e-9);
}

#[test]
fn beyond_the_edge_each_mode_goes_on_its_own_way() {
    // Rows of the first line of texels from -4 to 6, by hand.
    let rows = [
        (WRAP_REPEAT, [40.0, 10.0, 20.0, 40.0, 10.0, 20.0, 40.0, 10.0, 20.0, 40.0, 10.0]),
        (WRAP_CLAMP, [10.0, 10.0, 10.0, 10.0, 10.0, 20.0, 40.0, 40.0, 40.0, 40.0, 40.0]),
        (WRAP_MIRROR, [40.0, 40.0, 20.0, 10.0, 10.0, 20.0, 40.0, 40.0, 20.0, 10.0, 10.0]),
    ];
    for (wrap, row) in rows {
        for (i, value) in row.into_iter().enumerate() {
            for linear in [0, 1] {
                let found = grey(wrap, linear, i as f64 - 3.5, 0.5);
                assert!((found - value).abs() < 1e-9, "mode {wrap}, place {}: {found}, not {value}", i as i32 - 4);
            }
        }
    }
    // Interpolation across the edge knows the mode too.
    assert!((grey(WRAP_REPEAT, 1, 0.0, 0.5) - 25.0).abs() < 1e-9);
    assert!((grey(WRAP_CLAMP, 1, 0.0, 0.5) - 10.0).abs() < 1e-9);
}

/// A triangle of matter whose colour a white texture scales, or does not.
fn scene(name: &str, rho: f64, g: f64, textured: bool, albedo_mapping: AlbedoMapping) -> Scene {
    let mut picture = std::io::Cursor::new(vec![]);
    RgbaImage::from_pixel(1, 1, Rgba([255; 4])).write_to(&mut picture, ImageFormat::Png).expect("a picture");
    let uri = |bytes: &[u8]| {
        format!("data:application/octet-stream;base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes))
    };
    let bytes: Vec<u8> = [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let mut file = json!({
        "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": uri(&bytes)}],
        "textures": [{"source": 0}], "images": [{"uri": uri(picture.get_ref())}],
        "materials": [{"extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1},
            "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 0.1,
                "attenuationColor": [0.1, 0.2, 0.3]},
            name: {"multiscatterColorFactor": [rho, 0.9 * rho, 0.2 * rho], "scatterStrengthFactor": 1,
                "scatterAnisotropy": g}}}]
    });
    if textured {
        file["materials"][0]["extensions"][name]["multiscatterColorTexture"] = json!({"index": 0});
    }
    let options = LoadOptions { albedo_mapping, ..LoadOptions::default() };
    Scene::from_bytes("test.gltf", file.to_string().as_bytes(), &options).expect("a sound scene")
}

fn materials(scene: &Scene) -> Vec<Material> {
    let settings = Settings { resolution: Some((1, 1)), model: Model::Standard, ..Settings::default() };
    prepare(scene, &settings).expect("settings that fit").materials
}

#[test]
fn a_share_of_the_colour_is_the_matter_of_that_colour() {
    let mut worst = 0f64;
    for name in ["KHR_materials_scatter", "KHR_materials_volume_scatter"] {
        for mapping in [AlbedoMapping::Gltf, AlbedoMapping::Surface] {
            for (rho, g) in [(0.8, 0.0), (1.0, 0.7), (0.99, -0.8)] {
                let ramp = materials(&scene(name, rho, g, true, mapping));
                assert_eq!((ramp.len(), ramp[0].ramp), (RAMP as usize + 2, 1));
                for share in [0.02, 0.1, 0.337, 0.5, 0.801, 0.95, 0.999, 1.0] {
                    let expected = materials(&scene(name, rho * share, g, false, mapping))[0];
                    let found = texture::medium_at(&ramp[0], &ramp[1..], DVec3::splat(share));
                    for c in 0..3 {
                        // Relative L1 error over the plane: r^2 d(ln r), from .01 to 30 lengths.
                        let of = |m: &Material, r: f64| f64::from(m.strength[c]) * profile::shapes(m.into(), r)[c];
                        let (mut difference, mut whole) = (0.0, 0.0);
                        for k in 0..80 {
                            let r = f64::from(expected.z_real[c]) * 10f64.powf(f64::from(k) * 3.5 / 80.0 - 2.0);
                            let (a, b) = (of(&found, r), of(&expected, r));
                            difference += (a - b).abs() * r * r;
                            whole += b * r * r;
                        }
                        worst = worst.max(difference / whole);
                    }
                }
                let black = texture::medium_at(&ramp[0], &ramp[1..], DVec3::ZERO);
                assert_eq!(black.strength, Vec3::ZERO);
                let white = texture::medium_at(&ramp[0], &ramp[1..], DVec3::ONE);
                assert_eq!((white.strength, white.sigma_tr), (ramp[0].strength, ramp[0].sigma_tr));
            }
        }
    }
    println!("ramps: {worst:.1e}");
    // Linear interpolation of smooth functions: the square of a step, 4e-6, times what curves most.
    assert!(worst < 1e-3, "{worst:e}");
}

#[test]
fn darker_matter_never_weighs_much_more_than_what_is_drawn() {
    let mut worst = [0f64; 2];
    for name in ["KHR_materials_scatter", "KHR_materials_volume_scatter"] {
        for mapping in [AlbedoMapping::Gltf, AlbedoMapping::Surface] {
            for g in [-0.9, -0.5, 0.0, 0.5, 0.9] {
                let ramp = materials(&scene(name, 0.95, g, true, mapping));
                for share in (1..20).map(|k| f64::from(k) / 20.0) {
                    let dark = texture::medium_at(&ramp[0], &ramp[1..], DVec3::splat(share));
                    for c in 0..3 {
                        let (z, dark_z) = (f64::from(ramp[0].z_real[c]), f64::from(dark.z_real[c]));
                        let bound = f64::from(dark.strength[c]) / f64::from(ramp[0].strength[c])
                            * (dark_z / z).max((z / dark_z).powi(2));
                        for k in 0..40 {
                            let r = z * 10f64.powf(f64::from(k) * 0.1 - 2.0);
                            let of = |m: &Material| f64::from(m.strength[c]) * profile::shapes(m.into(), r)[c];
                            let ratio = of(&dark) / of(&ramp[0]);
                            assert!(
                                ratio <= bound * 1.0001,
                                "{name} {mapping:?} g {g}, share {share}: {ratio} {bound}"
                            );
                            worst[usize::from(g != 0.0)] = worst[usize::from(g != 0.0)].max(ratio);
                        }
                    }
                }
            }
        }
    }
    println!("weights: {worst:?}");
    assert!(worst[0] <= 1.0 && worst[1] < 2.8, "{worst:?}");
}
