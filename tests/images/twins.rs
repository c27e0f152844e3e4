//! Whole renders against the same pipeline of twins in f64, with the same random numbers.

use crate::{
    channel, device,
    scenes::{Eye, Mesh, gltf, matter, scene, standard, sun},
};
use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use translucent::{
    Projection, Renderer, Scene, Settings, image::Image, prepare::prepare, reference, scene::Environment, shared::Pixel,
};

/// The image and what the twins make of the same samples.
pub fn both(scene: &Scene, settings: &Settings, samples: u32) -> (Image, Vec<Pixel>) {
    let prepared = prepare(scene, settings).expect("the settings fit the scene");
    let twins = reference::render(&prepared.inputs(scene), prepared.rows.clone(), 0..samples);
    let device = device();
    let mut renderer = Renderer::new(&device, scene, settings).expect("the renderer is made");
    renderer.render(samples).expect("the render finishes");
    let image = renderer.image().expect("the image is there");
    let messages = device.validation_messages();
    assert!(messages.is_empty(), "{messages:#?}");
    assert_eq!(image.channels[0].data.len(), twins.len());
    (image, twins)
}

/// A layer of three channels at pixel `i`.
pub fn layer(image: &Image, name: &str, i: usize) -> Vec3 {
    let at = |letter: &str| channel(image, &format!("{name}.{letter}"))[i];
    Vec3::new(at("R"), at("G"), at("B"))
}

/// Relative differences of both layers at every pixel that has light; what is no sum of f32 rounding must agree exactly.
pub fn differences(image: &Image, twins: &[Pixel]) -> Vec<f64> {
    let mut found = vec![];
    for (i, twin) in twins.iter().enumerate() {
        assert_eq!(channel(image, "samples.Y")[i], twin.samples as f32, "pixel {i}");
        assert!((channel(image, "A")[i] - twin.alpha).abs() < 1e-6, "pixel {i}");
        for (name, expected) in [("subsurface", twin.subsurface), ("reflection", twin.reflection)] {
            let value = layer(image, name, i);
            if value != Vec3::ZERO || expected != Vec3::ZERO {
                let scale = value.as_dvec3().length().max(expected.as_dvec3().length());
                found.push((value.as_dvec3() - expected.as_dvec3()).length() / scale);
            }
        }
    }
    found
}

/// Renders few pixels by both; all must agree within 1e-5. Returns the image.
pub fn assert_agree(what: &str, scene: &Scene, settings: &Settings, samples: u32) -> Image {
    let (image, twins) = both(scene, settings, samples);
    let worst = differences(&image, &twins).into_iter().fold(0.0, f64::max);
    assert!(worst <= 1e-5, "{what}: {worst:.1e}");
    let invalid = twins.iter().map(|pixel| pixel.invalid as i32).sum();
    assert_eq!(image.attributes["translucent.invalidSamples"], translucent::image::Attribute::Integer(invalid));
    image
}

pub fn opaque() -> Value {
    json!({"name": "table", "pbrMetallicRoughness": {
        "baseColorFactor": [0.6, 0.4, 0.3, 1.0], "metallicFactor": 0.2, "roughnessFactor": 0.6}})
}

pub fn table() -> Mesh {
    let mut mesh = Mesh::default();
    mesh.quad(DVec3::new(-2.0, -1.0, 2.0), DVec3::X * 4.0, DVec3::Z * -4.0);
    mesh
}

/// A sphere of 512 triangles on a table, under the sun and an uniform sky.
fn still_life() -> Scene {
    let eye = Eye { eye: DVec3::new(1.0, 2.0, 4.0), at: DVec3::new(0.0, -0.2, 0.0), lens: 0.6 };
    let materials = [matter([4.0, 2.0, 1.0], [0.3, 0.2, 0.1], 1.4), opaque()];
    let light = (sun(), DVec3::new(3.0, 4.0, 2.0), DVec3::ZERO);
    let mut scene = scene(&gltf(&[(Mesh::sphere(1.0, 8), 0), (table(), 1)], &materials, &[light], &eye));
    scene.set_environment(Environment::constant(DVec3::new(0.3, 0.5, 0.8)).expect("valid")).expect("valid");
    scene
}

#[test]
fn image_is_the_twins() {
    let scene = still_life();
    let mut all = vec![];
    for projection in [Projection::Mis, Projection::Camera, Projection::Normal] {
        let settings = Settings {
            resolution: Some((24, 24)),
            seed: 4,
            projection,
            directions: 2,
            show_environment: true,
            ..standard()
        };
        let (image, twins) = both(&scene, &settings, 8);
        let found = differences(&image, &twins);
        assert!(found.len() > 700, "{projection:?}: {} lit values", found.len());
        all.extend(found);
    }
    all.sort_by(f64::total_cmp);
    let outside = all.iter().filter(|d| **d > 1e-5).count();
    println!(
        "{} values, median {:.1e}, {outside} beyond 1e-5, worst {:.1e}",
        all.len(),
        all[all.len() / 2],
        all[all.len() - 1]
    );
    // A shadow ray or probe that flips at an edge moves a pixel by a sample's share.
    assert!(outside * 1000 <= all.len(), "{outside} of {}: {:?}", all.len(), &all[all.len() - outside..]);
    assert!(all[all.len() - 1] < 0.5, "{:?}", &all[all.len() - outside..]);
}
