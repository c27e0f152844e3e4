//! glTF texts built in code, and what tests ask of them.

use base64::Engine;
use glam::DVec3;
use serde_json::{Value, json};
use translucent::Error;
use translucent::scene::{LoadOptions, Scene};

/// The corners of a closed tetrahedron, wound outward, of about unit size; no coordinate repeats by chance.
pub const CORNERS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.125], [0.25, 1.0, 0.0], [0.0, 0.375, 1.0]];
pub const FACES: [u16; 12] = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3];

/// A `data:` URI.
pub fn data_uri(bytes: &[u8]) -> String {
    format!("data:application/octet-stream;base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes))
}

/// The tetrahedron as one mesh with one scattering material on one node; buffer 0 holds positions, then indices.
pub fn tetrahedron() -> Value {
    let mut bytes = Vec::new();
    CORNERS.iter().flatten().for_each(|value| bytes.extend(value.to_le_bytes()));
    FACES.iter().for_each(|index| bytes.extend(index.to_le_bytes()));
    json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "thing", "mesh": 0}],
        "meshes": [{"name": "tetrahedron", "primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"name": "matter", "extras": {"bssrdf": {"preset": "skin1"}}}],
        "buffers": [{"byteLength": 72, "uri": data_uri(&bytes)}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 24}
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}
        ]
    })
}

/// The tetrahedron with the members of `patch` put over it (RFC 7396: objects merge, null removes, the rest replaces).
pub fn patched(patch: Value) -> Value {
    let mut json = tetrahedron();
    merge(&mut json, patch);
    json
}

fn merge(target: &mut Value, patch: Value) {
    match (target, patch) {
        (Value::Object(target), Value::Object(patch)) => {
            for (key, value) in patch {
                if value.is_null() {
                    target.remove(&key);
                } else {
                    merge(target.entry(key).or_insert(Value::Null), value);
                }
            }
        }
        (target, patch) => *target = patch,
    }
}

/// The tetrahedron with other bytes in its buffer: positions, then indices.
pub fn with_bytes(positions: &[[f32; 3]], indices: &[u16]) -> Value {
    let mut bytes = Vec::new();
    positions.iter().flatten().for_each(|value| bytes.extend(value.to_le_bytes()));
    let split = bytes.len();
    indices.iter().for_each(|index| bytes.extend(index.to_le_bytes()));
    patched(json!({
        "buffers": [{"byteLength": bytes.len(), "uri": data_uri(&bytes)}],
        "bufferViews": [
            {"buffer": 0, "byteLength": split},
            {"buffer": 0, "byteOffset": split, "byteLength": bytes.len() - split}
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": positions.len(), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": indices.len(), "type": "SCALAR"}
        ]
    }))
}

/// The tetrahedron with a material of its own.
pub fn with_material(mut material: Value) -> Value {
    material["name"] = json!("matter");
    patched(json!({"materials": [material]}))
}

pub fn load_with(json: &Value, options: &LoadOptions) -> Result<Scene, Error> {
    Scene::from_bytes("test.gltf", json.to_string().as_bytes(), options)
}

pub fn load(json: &Value) -> Scene {
    load_with(json, &LoadOptions::default()).expect("this file obeys all rules")
}

/// The message with which a file is refused.
pub fn refusal(json: &Value) -> String {
    match load_with(json, &LoadOptions::default()) {
        Ok(_) => panic!("accepted: {json}"),
        Err(error) => {
            assert!(error.is_input(), "{error} is not the input's fault");
            error.to_string()
        }
    }
}

/// The vertices of every triangle in metres, in no order: what the internal geometry stands for.
pub fn metres(scene: &Scene) -> Vec<[DVec3; 3]> {
    let back = |internal: DVec3| internal / scene.frame.scale + scene.frame.centre;
    scene.triangles.iter().map(|triangle| triangle.vertices.map(|vertex| back(vertex.as_dvec3()))).collect()
}

/// Whether two scenes hold the same triangles within `tolerance` metres, in any order and starting at any vertex.
pub fn same_triangles(a: &[[DVec3; 3]], b: &[[DVec3; 3]], tolerance: f64) -> bool {
    let close = |x: &[DVec3; 3], y: &[DVec3; 3]| {
        (0..3).any(|turn| (0..3).all(|i| x[i].distance(y[(i + turn) % 3]) <= tolerance))
    };
    a.len() == b.len() && a.iter().all(|x| b.iter().filter(|y| close(x, y)).count() == 1)
}

/// The volume that a closed surface bounds: positive if its triangles are wound outward.
pub fn volume(triangles: &[[DVec3; 3]]) -> f64 {
    triangles.iter().map(|[a, b, c]| a.dot(b.cross(*c)) / 6.0).sum()
}

/// Numbers for tests: a fixed sequence (SplitMix64).
pub struct Numbers(pub u64);

impl Numbers {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e3779b97f4a7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58476d1ce4e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d049bb133111eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    /// Uniform in [-1, 1).
    pub fn signed(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// The JSON and the binary chunk of the shipped scene.
pub fn spot() -> (Value, Vec<u8>) {
    let bytes = std::fs::read("assets/spot.glb").expect("the shipped scene is there");
    let length = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes")) as usize;
    let json = serde_json::from_slice(&bytes[20..20 + length(12)]).expect("the shipped scene is valid");
    (json, bytes[28 + length(12)..].to_vec())
}

/// A GLB container.
pub fn glb(json: &Value, binary: &[u8]) -> Vec<u8> {
    let chunk = |kind: &[u8; 4], contents: &[u8], padding: u8| {
        let mut contents = contents.to_vec();
        contents.resize(contents.len().next_multiple_of(4), padding);
        [&(contents.len() as u32).to_le_bytes()[..], kind, &contents].concat()
    };
    let chunks = [chunk(b"JSON", json.to_string().as_bytes(), b' '), chunk(b"BIN\0", binary, 0)].concat();
    [b"glTF", &2u32.to_le_bytes()[..], &(chunks.len() as u32 + 12).to_le_bytes(), &chunks].concat()
}

/// Appends a buffer, a view and an accessor.
pub fn push_bytes(json: &mut Value, bytes: &[u8], component: u32, count: usize, kind: &str) {
    let push = |json: &mut Value, list: &str, item: Value| {
        json[list].as_array_mut().expect("a list").push(item);
        json[list].as_array().map_or(0, Vec::len) - 1
    };
    let buffer = push(json, "buffers", json!({"byteLength": bytes.len(), "uri": data_uri(bytes)}));
    let view = push(json, "bufferViews", json!({"buffer": buffer, "byteLength": bytes.len()}));
    push(json, "accessors", json!({"bufferView": view, "componentType": component, "count": count, "type": kind}));
}
