//! No invocation comes near the 65,535 loop trips after which Mesa 22 silently ends it.

use crate::{bench, scenes::standard};
use base64::Engine;
use translucent::{
    LoadOptions, Renderer, Scene, Settings,
    reference::random::hash,
    shared::{MAX_RAYS, MAX_SINGLE},
};

/// Trips that Mesa 22.3 grants to a group of lanes, over all loops of a dispatch.
const CAP: u32 = 65_535;

/// Most lanes of a group: LP_NATIVE_VECTOR_WIDTH=512. Lanes that diverge may take their trips one after another.
const LANES: u32 = 16;

/// Largest number of steps of one traversal in a render.
fn largest_step_count(scene: &Scene) -> u32 {
    let settings = Settings { resolution: Some((96, 96)), ..standard() };
    let bench = bench();
    let mut renderer = Renderer::counting(&bench.device, scene, &settings).expect("the renderer is made");
    renderer.render(8).expect("renders");
    renderer.largest_step_count().expect("the counter is read")
}

fn assert_below_cap(scene: &Scene, what: &str) {
    let steps = largest_step_count(scene);
    println!("{what}: the largest traversal takes {steps} steps");
    assert!(steps > 10, "{what}: steps are counted");
    assert!(steps * LANES * (MAX_RAYS.max(2 * MAX_SINGLE + 1)) < CAP, "{what}: {steps} steps");
}

#[test]
fn traversals_stay_far_below_the_cap() {
    let demo = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/demo.gltf");
    assert_below_cap(&Scene::load(demo).expect("the shipped scene loads"), "demo");
}

#[test]
fn traversals_of_a_rough_mesh_stay_far_below_the_cap() {
    // A height field of 80,000 triangles, rough enough that rays run along it.
    const N: u32 = 200;
    let height = |i: u32, j: u32| 0.02 * f64::from(hash(i * 1000 + j) % 1000) / 1000.0;
    let vertex = |i: u32, j: u32| {
        let at = |k: u32| (f64::from(k) / f64::from(N) - 0.5) as f32;
        [at(i), height(i, j) as f32, at(j)]
    };
    let mut bytes = vec![];
    for (i, j) in (0..N).flat_map(|i| (0..N).map(move |j| (i, j))) {
        for (a, b) in [(0, 0), (0, 1), (1, 1), (0, 0), (1, 1), (1, 0)] {
            bytes.extend(vertex(i + a, j + b).into_iter().flat_map(f32::to_le_bytes));
        }
    }
    let count = bytes.len() / 12;
    let uri = base64::engine::general_purpose::STANDARD.encode(&bytes);
    let file = serde_json::json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0}, {"translation": [0.1, 0.5, 0.6], "extensions": {"KHR_lights_punctual": {"light": 0}}}],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 1.0}]}},
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "materials": [{"extras": {"bssrdf": {"sigma_s_prime": [100.0, 100.0, 100.0], "sigma_a": [1.0, 1.0, 1.0], "unit": "1/m"}}}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3",
            "min": [-0.5, 0.0, -0.5], "max": [0.5, 0.02, 0.5]}],
        "bufferViews": [{"buffer": 0, "byteLength": bytes.len()}],
        "buffers": [{"byteLength": bytes.len(), "uri": format!("data:application/octet-stream;base64,{uri}")}],
    });
    let scene = Scene::from_bytes("rough.gltf", file.to_string().as_bytes(), &LoadOptions::default());
    assert_below_cap(&scene.expect("the scene is valid"), "rough mesh");
}
