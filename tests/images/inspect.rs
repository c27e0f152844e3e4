//! What `inspect` says a scene requires is what a renderer makes.

use crate::{
    device,
    scenes::{Eye, Mesh, gltf, matter, scene, standard, sun},
};
use glam::DVec3;
use serde_json::json;
use translucent::{
    Model, Renderer, Scene, Settings,
    inspect::Inspection,
    render::Limits,
    scene::{Environment, EnvironmentMap},
    shared::Slot,
};

/// Compares both; returns the stems of the kernels and the slots of the buffers.
fn check(scene: &Scene, settings: &Settings) -> (Vec<&'static str>, Vec<Slot>) {
    let device = device();
    let renderer = Renderer::new(&device, scene, settings).expect("the renderer is made");
    let inspection = Inspection::new(scene, settings, Limits::of(&device)).expect("the scene is valid");
    let plan = &inspection.plan;
    let kernels: Vec<_> = plan.kernels.iter().filter(|kernel| kernel.used).map(|kernel| kernel.stem).collect();
    assert_eq!(kernels, renderer.kernels());
    let said: Vec<_> = plan.buffers.iter().filter(|b| b.bytes > 0).map(|b| (b.slot, b.bytes)).collect();
    let mut made = renderer.buffers();
    made.sort_by_key(|(slot, _)| *slot as u32);
    assert_eq!(said, made);
    assert_eq!(plan.device_bytes(), made.iter().map(|(_, bytes)| bytes).sum::<u64>());
    assert_eq!(plan.prepared.features, renderer.prepared().features);
    assert!(plan.buffers.iter().all(|buffer| !buffer.why.is_empty()));
    (kernels, made.into_iter().map(|(slot, _)| slot).collect())
}

#[test]
fn inspect_lists_the_buffers_and_kernels_that_a_renderer_makes() {
    let mut cube = Mesh::default();
    cube.cuboid(DVec3::NEG_ONE, DVec3::ONE, 1);
    let eye = Eye { eye: DVec3::new(0.0, 0.0, 5.0), at: DVec3::ZERO, lens: 0.6 };
    let light = (sun(), DVec3::Z, DVec3::ZERO);
    let lit = |material: serde_json::Value| {
        scene(&gltf(&[(cube.clone(), 0)], &[material], std::slice::from_ref(&light), &eye))
    };
    let smooth = || lit(matter([1.0; 3], [0.1; 3], 1.3));
    let settings = Settings { resolution: Some((40, 30)), ..standard() };

    // A delta light on smooth matter: no highlight, no environment.
    let (kernels, slots) = check(&smooth(), &settings);
    assert_eq!(kernels, ["primary", "sample", "reproject", "accumulate", "count", "resolve"]);
    assert!(slots.contains(&Slot::Lights) && slots.contains(&Slot::Probes) && slots.contains(&Slot::BatchSums));
    for absent in [Slot::Environment, Slot::EnvironmentCdf, Slot::Counters] {
        assert!(!slots.contains(&absent), "{absent:?}");
    }

    // Nothing is sampled where all that is translucent is in the opaque limit.
    let (kernels, slots) = check(&smooth(), &Settings { model: Model::Lambert, ..settings.clone() });
    assert_eq!(kernels, ["primary", "accumulate", "count", "resolve"]);
    assert!(!slots.contains(&Slot::Probes) && !slots.contains(&Slot::HitLists));

    // No variance, several bands.
    let (_, slots) = check(&smooth(), &Settings { variance: false, band_pixels: Some(200), ..settings.clone() });
    assert!(!slots.contains(&Slot::BatchSums));

    // Opaque.
    let (kernels, slots) = check(&lit(json!({"name": "chalk"})), &settings);
    assert_eq!(kernels, ["primary", "reflect", "count", "resolve"]);
    assert!(!slots.contains(&Slot::Probes) && !slots.contains(&Slot::HitLists));

    // An image for an environment.
    let mut lit_by_image = smooth();
    let radiance = vec![glam::Vec3::ONE; 32];
    let map = EnvironmentMap::Image { width: 8, height: 4, radiance };
    lit_by_image.set_environment(Environment { map, ..Environment::default() }).expect("valid");
    let (kernels, slots) = check(&lit_by_image, &settings);
    assert!(kernels.contains(&"reflect"));
    assert!(slots.contains(&Slot::Environment) && slots.contains(&Slot::EnvironmentCdf));
}
