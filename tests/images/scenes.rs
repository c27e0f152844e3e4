//! Scenes with a known answer.

use serde_json::Value;
// Each test program uses its part.
#[allow(unused_imports)]
pub use translucent::measure::scenes::{Eye, Mesh, gltf, matter, sun};
use translucent::{Model, Scene, Settings, scene::LoadOptions};

/// The scene of a file in memory.
pub fn scene(file: &Value) -> Scene {
    Scene::from_bytes("test.gltf", file.to_string().as_bytes(), &LoadOptions::default()).expect("the scene is valid")
}

/// The default settings with the standard dipole, whose closed forms are known.
pub fn standard() -> Settings {
    Settings { model: Model::Standard, reuse: Some(1), ..Settings::default() }
}
