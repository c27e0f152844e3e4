//! The least and the greatest that a scene and settings may ask for.

use crate::{
    channel, device,
    scenes::{Eye, Mesh, gltf, matter, scene, standard, sun},
    twins::{assert_agree, layer, opaque, table},
};
use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use translucent::{
    Renderer, Scene, Settings,
    image::{Attribute, Image},
    scene::{Environment, EnvironmentMap, LoadOptions},
    shared::MAX_RAYS,
};

fn eye() -> Eye {
    Eye { eye: DVec3::new(1.0, 2.0, 4.0), at: DVec3::ZERO, lens: 0.7 }
}

fn light() -> (Value, DVec3, DVec3) {
    (sun(), DVec3::new(3.0, 4.0, 2.0), DVec3::ZERO)
}

fn milky() -> Value {
    matter([4.0, 2.0, 1.0], [0.3, 0.2, 0.1], 1.4)
}

fn ball(lights: &[(Value, DVec3, DVec3)]) -> Scene {
    scene(&gltf(&[(Mesh::sphere(1.0, 4), 0), (table(), 1)], &[milky(), opaque()], lights, &eye()))
}

fn one_triangle() -> Mesh {
    Mesh {
        positions: vec![DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, -1.0, 0.0), DVec3::new(0.0, 1.0, 0.0)],
        normals: vec![DVec3::Z; 3],
        indices: vec![0, 1, 2],
    }
}

fn uniform(mut scene: Scene, radiance: DVec3) -> Scene {
    scene.set_environment(Environment::constant(radiance).expect("valid")).expect("valid");
    scene
}

fn settings(width: u32, height: u32) -> Settings {
    Settings { resolution: Some((width, height)), seed: 6, show_environment: true, ..standard() }
}

fn lit(image: &Image, name: &str) -> bool {
    (0..image.channels[0].data.len()).any(|i| layer(image, name, i) != Vec3::ZERO)
}

#[test]
fn one_pixel() {
    let image = assert_agree("1x1", &uniform(ball(&[light()]), DVec3::ONE), &settings(1, 1), 33);
    assert!(lit(&image, "subsurface"));
}

#[test]
fn odd_crops_and_bands() {
    let scene = uniform(ball(&[light()]), DVec3::ONE);
    // Wider and narrower than a workgroup, never a multiple of it; bands of unequal size.
    for (crop, band_pixels) in [([3, 2, 4, 11], 2), ([1, 4, 14, 7], 20), ([0, 6, 67, 8], 67)] {
        let settings = Settings { crop: Some(crop), band_pixels: Some(band_pixels), ..settings(67, 13) };
        assert_agree(&format!("{crop:?}"), &scene, &settings, 9);
    }
}

#[test]
fn one_triangle_of_either_kind() {
    for (material, name) in [(milky(), "subsurface"), (opaque(), "reflection")] {
        let scene = uniform(scene(&gltf(&[(one_triangle(), 0)], &[material], &[light()], &eye())), DVec3::ONE);
        let image = assert_agree(name, &scene, &settings(7, 5), 8);
        assert!(lit(&image, name), "{name}");
        assert_eq!(lit(&image, "subsurface"), name == "subsurface");
    }
}

#[test]
fn no_light_at_all() {
    for file in [gltf(&[(table(), 0)], &[opaque()], &[], &eye()), gltf(&[(table(), 0)], &[milky()], &[], &eye())] {
        let image = assert_agree("dark", &scene(&file), &settings(9, 9), 8);
        assert!(channel(&image, "A").contains(&1.0));
        assert!(!lit(&image, "subsurface") && !lit(&image, "reflection"));
    }
}

#[test]
fn more_rays_than_a_dispatch_traces() {
    let lights: Vec<_> = (0..5).map(|i| (sun(), DVec3::new(f64::from(i) - 2.0, 3.0, 2.0), DVec3::ZERO)).collect();
    let scene = uniform(ball(&lights), DVec3::ONE);
    // 5 + 16 rays: full portions and a part; 5 + 3: full ones only; 5 + 4: one ray left over.
    assert_eq!((MAX_RAYS, 8 % MAX_RAYS), (4, 0));
    for directions in [16, 3, 4] {
        let settings = Settings { directions, ..settings(6, 6) };
        let image = assert_agree(&format!("{directions} directions"), &scene, &settings, 8);
        assert!(lit(&image, "subsurface") && lit(&image, "reflection"));
    }
}

#[test]
fn environments_of_one_texel_or_row() {
    for (width, height) in [(1, 1), (1, 3), (3, 1)] {
        let texel = |i: u32| Vec3::new(1.0, 0.5, 0.2) * (1 + i) as f32;
        let radiance = (0..width * height).map(texel).collect();
        let map = EnvironmentMap::Image { width, height, radiance };
        let mut scene = ball(&[]);
        scene.set_environment(Environment { map, rotation: 30.0, scale: 1.0 }).expect("valid");
        let image = assert_agree(&format!("{width}x{height} texels"), &scene, &settings(5, 5), 8);
        assert!(lit(&image, "subsurface") && lit(&image, "reflection"));
    }
}

/// An image whose values are finite and, where they are light, not negative; and the number of its invalid samples.
fn sane(what: &str, scene: &Scene, samples: u32) -> (Image, i32) {
    let device = device();
    let mut renderer = Renderer::new(&device, scene, &settings(12, 12)).expect("the renderer is made");
    renderer.render(samples).expect("the render finishes");
    let image = renderer.image().expect("the image is there");
    for part in &image.channels {
        assert!(part.data.iter().all(|x| x.is_finite()), "{what}: {} is not finite", part.name);
        let light = ["R", "G", "B", "A"].contains(&part.name.as_str())
            || ["subsurface", "reflection", "variance"].iter().any(|layer| part.name.starts_with(layer));
        assert!(!light || part.data.iter().all(|x| *x >= 0.0), "{what}: {} is negative", part.name);
    }
    let Attribute::Integer(invalid) = image.attributes["translucent.invalidSamples"] else { panic!("a number") };
    (image, invalid)
}

#[test]
fn variance_beyond_f32_is_its_largest_number() {
    let (image, invalid) = sane("1e25", &uniform(ball(&[]), DVec3::splat(1e25)), 16);
    assert_eq!(invalid, 0);
    assert!(lit(&image, "subsurface"));
    assert!(channel(&image, "variance.G").contains(&f32::MAX));
    // A uniform factor is one: the light itself is that of radiance 1.
    let (unit, _) = sane("1", &uniform(ball(&[]), DVec3::ONE), 16);
    for (bright, dim) in channel(&image, "subsurface.G").iter().zip(channel(&unit, "subsurface.G")) {
        assert!((bright / 1e25 - dim).abs() <= 1e-5 * dim, "{bright} {dim}");
    }
}

#[test]
fn environments_beyond_f32_are_named() {
    // As bright as may be.
    let (_, invalid) = sane("1e30", &uniform(ball(&[]), DVec3::splat(1e30)), 24);
    assert_eq!(invalid, 0);
    let mut radiance = vec![Vec3::ZERO; 32];
    radiance[3] = Vec3::splat(1e10);
    let map = EnvironmentMap::Image { width: 8, height: 4, radiance };
    for (environment, valid) in [
        (Environment { map: EnvironmentMap::Constant(DVec3::splat(3e38)), rotation: 0.0, scale: 1.0 }, false),
        (Environment { map: map.clone(), rotation: 0.0, scale: 1e19 }, true),
        (Environment { map, rotation: 0.0, scale: 1e300 }, false),
    ] {
        let mut scene = ball(&[]);
        assert_eq!(scene.set_environment(environment).is_ok(), valid);
    }
}

#[test]
fn lamps_beyond_f32_are_named_or_left_out() {
    let lamp = |intensity: f64, position: DVec3| {
        let light = (json!({"type": "point", "intensity": intensity}), position, DVec3::ZERO);
        gltf(&[(Mesh::sphere(1.0, 4), 0)], &[milky()], &[light], &eye()).to_string()
    };
    let load = |file: String| Scene::from_bytes("lamp.gltf", file.as_bytes(), &LoadOptions::default());
    let error = load(lamp(1e38, DVec3::new(2.0, 2.0, 2.0))).expect_err("too bright for f32");
    assert!(error.to_string().contains("brighter than"), "{error}");
    // As bright as may be; then in the surface itself, where 1 / d^2 has no bound.
    let (_, far) = sane("far", &load(lamp(1e30, DVec3::new(2.0, 2.0, 2.0))).expect("valid"), 24);
    assert_eq!(far, 0);
    sane("near", &load(lamp(1e30, DVec3::new(0.0, 0.0, 1.000_001))).expect("valid"), 24);
}
