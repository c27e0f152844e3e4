//! Broken files: whatever is changed in a file, it is refused or becomes a sound scene; nothing panics or hangs.

use crate::build::*;
use crate::textures::{encoded, picture};
use image::ImageFormat;
use serde_json::{Value, json};
use translucent::scene::{LoadOptions, Scene};

/// A small file that uses all that is read: materials of every kind, lights, cameras, matrices, sparse accessors.
fn rich() -> Value {
    let mut json = patched(json!({
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_volume"],
        "extensionsRequired": ["KHR_materials_volume"],
        "scenes": [{"nodes": [0, 3, 4]}],
        "nodes": [
            {"name": "thing", "mesh": 0, "translation": [1, 2, 3], "rotation": [0, 0, 0, 1], "scale": [1, -1, 2],
                "children": [1, 2]},
            {"mesh": 1, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1]},
            {"camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"camera": 1, "extensions": {"KHR_lights_punctual": {"light": 1}}},
            {"mesh": 2, "skin": 0}
        ],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]},
            {"weights": [0.5, 0], "primitives": [
                {"targets": [{"POSITION": 0}, {"NORMAL": 0}], "attributes": {"POSITION": 2, "NORMAL": 0}, "indices": 1, "material": 1, "mode": 5},
                {"attributes": {"POSITION": 0}, "indices": 1, "material": 2, "targets": [{}, {}]},
                {"attributes": {"POSITION": 0, "TEXCOORD_0": 3, "TEXCOORD_1": 3}, "indices": 1, "material": 3, "mode": 6,
                    "targets": [{"POSITION": 0}, {"NORMAL": 0}]},
                {"attributes": {"POSITION": 0}, "indices": 1, "material": 4, "targets": [{}, {}]}
            ]},
            {"primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 4, "WEIGHTS_0": 5}, "indices": 1, "material": 4}]}
        ],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": 6}],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": 9987}],
        "images": [{"uri": data_uri(&encoded(&picture(), ImageFormat::Png)), "mimeType": "image/png"}],
        "cameras": [
            {"name": "c", "type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 1.5, "znear": 0.1}},
            {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0, "zfar": 9}}
        ],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "spot", "color": [1, 1, 0], "intensity": 3, "range": 9,
                "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.2}},
            {"type": "directional"}
        ]}},
        "materials": [
            {"name": "matter", "extras": {"bssrdf": {"albedo": [0.8, 0.5, 0.3], "mean_free_path": [1.2, 0.6, 0.3],
                "unit": "mm", "ior": 1.4, "g": 0.1, "model": "standard", "surface": "smooth"}}},
            {"extras": {"bssrdf": {"sigma_s": [7, 8, 9], "sigma_a": [1, 2, 3], "g": [0.1, 0.2, 0.3], "unit": "1/mm"}}},
            {"extensions": {
                "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 0.1,
                    "attenuationColor": [0.1, 0.2, 0.3]},
                "KHR_materials_ior": {"ior": 1.3},
                "KHR_materials_transmission": {"transmissionFactor": 1},
                "KHR_materials_scatter": {"scatterStrengthFactor": 1, "multiscatterColorFactor": [0.1, 0.2, 0.3],
                    "scatterAnisotropy": 0.3, "multiscatterColorTexture": {"index": 0}}}},
            {"pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.2, 1], "metallicFactor": 0.1, "roughnessFactor": 0.2},
                "emissiveFactor": [1, 0, 0], "alphaMode": "MASK", "alphaCutoff": 0.3,
                "normalTexture": {"index": 0, "scale": 0.5, "extensions": {"KHR_texture_transform":
                    {"offset": [0.1, 0.2], "rotation": 1, "scale": [2, 2], "texCoord": 0}}},
                "emissiveTexture": {"index": 0, "texCoord": 1},
                "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 3}}},
            {"extras": {"bssrdf": {"albedo": 0.9, "diffuse_mean_free_path": 3, "unit": "cm"}}}
        ]
    }));
    let sparse = json!({"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "normalized": false,
        "sparse": {"count": 1, "indices": {"bufferView": 1, "byteOffset": 0, "componentType": 5123},
            "values": {"bufferView": 0, "byteOffset": 0}}});
    json["accessors"].as_array_mut().expect("an array").push(sparse);
    push_bytes(&mut json, bytemuck::cast_slice(&[0.0f32, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0]), 5126, 4, "VEC2");
    push_bytes(&mut json, &[0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 1, 0, 0], 5121, 4, "VEC4");
    push_bytes(&mut json, bytemuck::cast_slice(&[[0.75f32, 0.25, 0.0, 0.0]; 4]), 5126, 4, "VEC4");
    let unit = glam::Mat4::IDENTITY.to_cols_array();
    push_bytes(&mut json, bytemuck::cast_slice(&[unit, unit]), 5126, 2, "MAT4");
    json
}

/// Refused with a message on one line, or all that a sound scene promises.
fn check(result: Result<Scene, translucent::Error>) {
    let scene = match result {
        Ok(scene) => scene,
        Err(error) => {
            let message = error.to_string();
            assert!(error.is_input() && !message.contains('\n') && message.len() < 1000, "{message}");
            return;
        }
    };
    assert!(!scene.triangles.is_empty() && scene.triangles.len() == scene.shadings.len());
    for (triangle, shading) in scene.triangles.iter().zip(&scene.shadings) {
        // In f32, as kernels form it.
        let [a, b, c] = triangle.vertices;
        let normal = (b - a).cross(c - a).normalize();
        assert!(a.is_finite() && normal.is_finite(), "{triangle:?}");
        for normal in [shading.normal0, shading.normal1, shading.normal2] {
            assert!((normal.length() - 1.0).abs() < 1e-5, "{shading:?}");
        }
        assert!(scene.sets[triangle.set as usize].materials.contains(&(shading.material as usize)));
        assert!((shading.material as usize) < scene.materials.len());
    }
    for material in &scene.materials {
        assert!(material.base_color.is_finite() && material.emission.is_finite() && material.ior >= 0.1);
        if let Some(medium) = &material.medium {
            for coefficients in [medium.sigma_s_prime, medium.sigma_a] {
                assert!(coefficients.is_finite() && coefficients.min_element() >= 0.0, "{material:?}");
            }
        }
    }
    for light in &scene.lights {
        assert!(light.position.is_finite() && light.intensity.is_finite() && light.intensity.min_element() >= 0.0);
        assert!((light.direction.length() - 1.0).abs() < 1e-9);
    }
    for camera in &scene.cameras {
        assert!(camera.eye.is_finite() && camera.right.cross(camera.up).distance(-camera.forward) < 1e-9);
    }
    assert!(scene.frame.centre.is_finite() && scene.frame.scale.is_finite() && scene.frame.scale > 0.0);
    crate::bvh::check(&scene);
    let textured = scene.materials.iter().any(|material| material.is_textured());
    assert_eq!(scene.coordinates.len(), if textured { scene.triangles.len() } else { 0 });
    for (coordinates, shading) in scene.coordinates.iter().zip(&scene.shadings) {
        assert_eq!(coordinates.material, shading.material);
        assert!(coordinates.uv.iter().all(|uv| uv.is_finite()) && coordinates.tangent.iter().all(|t| t.is_finite()));
    }
    for texture in scene.materials.iter().flat_map(|material| &material.textures).flatten() {
        let picture = &scene.pictures[texture.picture];
        assert!(!picture.texels.is_empty() && picture.texels.len() == (picture.width * picture.height) as usize);
    }
}

fn load_bytes(bytes: &[u8]) -> Result<Scene, translucent::Error> {
    Scene::from_bytes("test.glb", bytes, &LoadOptions::default())
}

/// The JSON pointers of all values in a file.
fn pointers(value: &Value, path: String, found: &mut Vec<String>) {
    match value {
        Value::Array(items) => {
            items.iter().enumerate().for_each(|(i, item)| pointers(item, format!("{path}/{i}"), found));
        }
        Value::Object(members) => {
            members.iter().for_each(|(key, item)| pointers(item, format!("{path}/{key}"), found));
        }
        _ => {}
    }
    found.push(path);
}

#[test]
fn every_value_replaced_by_others() {
    let file = rich();
    assert_eq!(load(&file).materials.len(), 5, "the file is sound before it is broken");
    let others = [
        json!(null),
        json!(true),
        json!("x"),
        json!(""),
        json!(0),
        json!(1),
        json!(2),
        json!(-1),
        json!(0.5),
        json!(1e308),
        json!(-1e308),
        json!(1e-308),
        json!(255),
        json!(4294967295u64),
        json!(u64::MAX),
        json!([]),
        json!({}),
        json!([0]),
        json!([1e308, -1e308, 1e308]),
        json!([[[[]]]]),
    ];
    let mut places = Vec::new();
    pointers(&file, String::new(), &mut places);
    assert!(places.len() > 200, "{}", places.len());
    for place in places {
        for other in &others {
            let mut broken = file.clone();
            *broken.pointer_mut(&place).expect("a place in the file") = other.clone();
            check(load_with(&broken, &LoadOptions::default()));
        }
        // Removed, too.
        if let Some((parent, key)) = place.rsplit_once('/') {
            let mut broken = file.clone();
            match broken.pointer_mut(parent).expect("a place in the file") {
                Value::Object(members) => drop(members.remove(key)),
                Value::Array(items) => drop(items.remove(key.parse().expect("an index"))),
                _ => unreachable!("only arrays and objects have members"),
            }
            check(load_with(&broken, &LoadOptions::default()));
        }
    }
}

#[test]
fn bytes_changed_in_text_and_container() {
    let text = rich().to_string().into_bytes();
    let mut json = tetrahedron();
    json["buffers"][0].as_object_mut().expect("an object").remove("uri");
    let mut binary = Vec::new();
    CORNERS.iter().flatten().for_each(|value| binary.extend(value.to_le_bytes()));
    FACES.iter().for_each(|index| binary.extend(index.to_le_bytes()));
    let container = glb(&json, &binary);
    assert!(load_bytes(&container).is_ok(), "the container is sound before it is broken");
    let mut numbers = Numbers(1);
    for bytes in [text, container] {
        for length in (0..bytes.len()).step_by(7) {
            assert!(load_bytes(&bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
        }
        for _ in 0..2000 {
            let mut broken = bytes.clone();
            for _ in 0..1 + numbers.below(3) {
                let place = numbers.below(broken.len());
                broken[place] = match numbers.below(3) {
                    0 => broken[place] ^ (1 << numbers.below(8)),
                    1 => b"0123456789-e.,:[]{}\""[numbers.below(20)],
                    _ => numbers.next() as u8,
                };
            }
            check(load_bytes(&broken));
        }
    }
}

#[test]
fn the_shipped_scene_broken() {
    let (json, binary) = spot();
    let sound = glb(&json, &binary);
    let binary_at = sound.len() - binary.len();
    let mut numbers = Numbers(2);
    for round in 0..60 {
        let mut broken = sound.clone();
        if round % 2 == 0 {
            // Hundreds of coordinates and indices at once.
            for _ in 0..numbers.below(500) {
                let place = binary_at + numbers.below(binary.len());
                broken[place] = numbers.next() as u8;
            }
        } else {
            let place = numbers.below(binary_at);
            broken[place] ^= 1 << numbers.below(8);
        }
        check(load_bytes(&broken));
    }
    for _ in 0..100 {
        assert!(load_bytes(&sound[..numbers.below(sound.len())]).is_err());
    }
}
