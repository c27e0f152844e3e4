//! Lights and cameras: where nodes put them, which camera is chosen, and the one that frames a scene.

use crate::build::*;
use glam::DVec3;
use serde_json::{Value, json};
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_4};
use translucent::CameraChoice;
use translucent::scene::{Lens, LightKind, LoadOptions, Scene};

/// A node turned by 90 degrees about Y: -Z becomes -X.
const TURNED: [f64; 4] = [0.0, FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2];

fn with_light(light: Value) -> Value {
    patched(json!({
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensionsRequired": ["KHR_lights_punctual"],
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0}, {"name": "holder", "translation": [1, 2, 3], "scale": [4, 4, 4], "children": [2]},
            {"name": "lamp", "rotation": TURNED, "translation": [1, 0, 0],
             "extensions": {"KHR_lights_punctual": {"light": 0}}}],
        "extensions": {"KHR_lights_punctual": {"lights": [light]}}
    }))
}

#[test]
fn lights() {
    let options = LoadOptions { unit: 0.01, ..LoadOptions::default() };
    let light = |light: Value| load_with(&with_light(light), &options).expect("a light").lights[0].clone();
    let point = light(json!({"type": "point", "color": [1, 0.5, 0.25], "intensity": 8, "range": 20}));
    assert_eq!(point.name, "lamp");
    assert!(point.position.distance(DVec3::new(0.05, 0.02, 0.03)) < 1e-15, "nodes' scale and the unit move a light");
    assert_eq!(point.intensity, DVec3::new(8.0, 4.0, 2.0), "candela do not depend on scale or unit");
    assert_eq!(point.range, Some(0.2), "a range is in units of the file, whatever the node's scale");
    assert_eq!(point.kind, LightKind::Point);

    let directional = light(json!({"type": "directional"}));
    assert!(directional.direction.distance(DVec3::NEG_X) < 1e-15);
    assert_eq!((directional.intensity, directional.range), (DVec3::ONE, None));

    let spot = light(json!({"type": "spot"}));
    assert_eq!(spot.kind, LightKind::Spot { inner: 0.0, outer: FRAC_PI_4 });
    let spot = light(json!({"type": "spot", "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.3}}));
    assert_eq!(spot.kind, LightKind::Spot { inner: 0.2, outer: 0.3 });
}

fn with_cameras() -> Value {
    patched(json!({
        "scenes": [{"nodes": [2, 0, 1]}],
        "nodes": [
            {"mesh": 0},
            {"name": "front", "camera": 0, "translation": [0, 0, 5]},
            {"camera": 1, "rotation": TURNED, "translation": [7, 0, 0], "scale": [-3, 2, 1]}
        ],
        "cameras": [
            {"name": "lens", "type": "perspective", "perspective": {"yfov": 0.7, "aspectRatio": 1.5, "znear": 0.1}},
            {"name": "plan", "type": "orthographic",
             "orthographic": {"xmag": 2, "ymag": 3, "znear": 0, "zfar": 10}}
        ]
    }))
}

#[test]
fn cameras() {
    let options = LoadOptions { unit: 0.5, ..LoadOptions::default() };
    let scene = load_with(&with_cameras(), &options).expect("cameras");
    let [front, plan] = &scene.cameras[..] else { panic!("two cameras") };
    assert_eq!((front.name.as_str(), plan.name.as_str()), ("front", "plan"));
    assert_eq!(front.eye, DVec3::new(0.0, 0.0, 2.5));
    assert_eq!((front.right, front.up, front.forward), (DVec3::X, DVec3::Y, DVec3::NEG_Z));
    assert_eq!(front.lens, Lens::Perspective { yfov: 0.7, aspect: Some(1.5) });
    assert_eq!(plan.lens, Lens::Orthographic { xmag: 1.0, ymag: 1.5 }, "the unit scales a camera, its node does not");
    assert!(plan.forward.distance(DVec3::NEG_X) < 1e-15 && plan.up.distance(DVec3::Y) < 1e-15);
    assert!(plan.right.distance(DVec3::NEG_Z) < 1e-15, "a mirrored node does not mirror the image");
}

#[test]
fn cameras_are_chosen_by_name_or_number() {
    let scene = load(&with_cameras());
    let name = |choice: CameraChoice| scene.camera(&choice, 1.0).map(|camera| camera.name);
    assert_eq!(name(CameraChoice::Default).ok().as_deref(), Some("front"));
    assert_eq!(name(CameraChoice::Index(1)).ok().as_deref(), Some("plan"));
    assert_eq!(name(CameraChoice::Name("plan".into())).ok().as_deref(), Some("plan"));
    assert_eq!(
        name(CameraChoice::Name("lens".into())).ok().as_deref(),
        Some("front"),
        "the camera object is named too"
    );
    for (choice, asked) in [(CameraChoice::Index(2), "2"), (CameraChoice::Name("back".into()), "`back`")] {
        let message = name(choice).expect_err("no such camera").to_string();
        let wanted = format!("camera: test.gltf has no camera {asked}; it has: 0 `front`, 1 `plan`");
        assert_eq!(message, wanted);
    }
    let message = load(&tetrahedron()).camera(&CameraChoice::Index(0), 1.0).expect_err("no camera").to_string();
    assert!(message.contains("it has: none"), "{message}");
}

#[test]
fn a_scene_without_cameras_is_framed() {
    let scene = Scene::load("assets/spot.glb").expect("the shipped scene loads");
    for aspect in [0.5, 1.0, 2.0] {
        let camera = scene.camera(&CameraChoice::Default, aspect).expect("a framing camera");
        let Lens::Perspective { yfov, .. } = camera.lens else { panic!("a perspective camera") };
        for (a, b) in [(camera.right, camera.up), (camera.up, camera.forward), (camera.forward, camera.right)] {
            assert!(a.dot(b).abs() < 1e-12 && (a.length() - 1.0).abs() < 1e-12);
        }
        assert!(camera.right.cross(camera.up).distance(-camera.forward) < 1e-12, "right-handed");
        assert!(camera.eye.z > 0.0 && camera.eye.y > scene.frame.centre.y, "from the front and above");
        let slope = (yfov / 2.0).tan();
        let mut largest: f64 = 0.0;
        for vertex in metres(&scene).iter().flatten() {
            let to = *vertex - camera.eye;
            let depth = to.dot(camera.forward);
            let (x, y) = (to.dot(camera.right) / depth / slope / aspect, to.dot(camera.up) / depth / slope);
            assert!(depth > 0.0);
            largest = largest.max(x.abs()).max(y.abs());
        }
        assert!((0.5..1.0).contains(&largest), "fills the image without leaving it: {largest}");
    }
}
