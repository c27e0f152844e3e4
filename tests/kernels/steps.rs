//! No invocation comes near the 65,535 loop trips after which Mesa 22 silently ends it.

use crate::bench;
use translucent::{Renderer, Scene, Settings, shared::MAX_RAYS};

/// Trips that Mesa 22.3 grants to a group of lanes, over all loops of a dispatch.
const CAP: u32 = 65_535;

/// Most lanes of a group: LP_NATIVE_VECTOR_WIDTH=512. Lanes that diverge may take their trips one after another.
const LANES: u32 = 16;

#[test]
fn traversals_stay_far_below_the_cap() {
    let scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/demo.gltf")).expect("the shipped scene loads");
    let settings = Settings { resolution: Some((96, 96)), ..Settings::default() };
    let bench = bench();
    let mut renderer = Renderer::counting(&bench.device, &scene, &settings).expect("the renderer is made");
    renderer.render(8).expect("renders");
    let steps = renderer.largest_step_count().expect("the counter is read");
    println!("largest traversal: {steps} steps");
    assert!(steps > 10, "steps are counted");
    assert!(steps * LANES * MAX_RAYS < CAP, "{steps} steps");
}
