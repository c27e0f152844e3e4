//! Every rule that a file must obey, broken once: the message names the file, the item and the problem.

use crate::build::*;
use serde_json::{Value, json};
use translucent::scene::{LoadOptions, Scene};

/// Refused with a message that begins with the file and the item and holds the problem.
fn assert_refused(json: &Value, item: &str, problem: &str) {
    let message = refusal(json);
    assert!(message.starts_with(&format!("test.gltf: {item}: ")), "{message}\n  should name {item}");
    assert!(message.contains(problem), "{message}\n  should say {problem}");
}

/// The tetrahedron with the value at a JSON pointer replaced.
fn with(pointer: &str, value: Value) -> Value {
    let mut json = tetrahedron();
    let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
    let parent = json.pointer_mut(parent).expect("a place in the tetrahedron");
    match parent {
        Value::Array(items) => items[key.parse::<usize>().expect("an index")] = value,
        other => other[key] = value,
    }
    json
}

#[test]
fn containers() {
    let bytes = glb(&spot().0, &spot().1);
    let refused = |bytes: &[u8]| {
        Scene::from_bytes("test.glb", bytes, &LoadOptions::default()).expect_err("a broken container").to_string()
    };
    assert!(refused(&bytes[..100]).contains("test.glb: GLB container: says it has"));
    assert!(refused(&bytes[..6]).contains("ends within its header"));
    for broken in [
        &b"glTF\x01\0\0\0\x0c\0\0\0"[..],
        b"glTF\x02\0\0\0\x0b\0\0\0",
        b"glTF\x02\0\0\0\x0c\0\0\0",
        b"glTF\x02\0\0\0\x0f\0\0\0abc",
        b"glTF\x02\0\0\0\x14\0\0\0\xff\xff\xff\xffJSON",
    ] {
        let message = refused(broken);
        assert!(message.starts_with("test.glb: GLB container: "), "{message}");
    }
    assert!(refused(b"").contains("glTF: is not valid JSON"));
    assert!(refused(b"solid thing").contains("is not valid JSON"));
    assert!(refused(&[b'['; 100_000]).contains("recursion limit"));
    let missing = Scene::load("no/such.gltf").expect_err("no such file").to_string();
    assert!(missing.starts_with("no/such.gltf: "), "{missing}");
}

#[test]
fn versions_and_extensions() {
    assert_refused(&with("/asset", json!({"version": "1.0"})), "asset.version", "only glTF 2 is read");
    assert_refused(&patched(json!({"asset": null})), "glTF", "has no `asset`");
    let requiring = |name: &str| patched(json!({"extensionsRequired": [name], "extensionsUsed": [name]}));
    for supported in [
        "KHR_lights_punctual",
        "KHR_materials_ior",
        "KHR_materials_volume",
        "KHR_materials_volume_scatter",
        "KHR_materials_scatter",
        "KHR_materials_transmission",
        "KHR_materials_diffuse_transmission",
        "KHR_materials_emissive_strength",
        "KHR_mesh_quantization",
    ] {
        assert_eq!(load(&requiring(supported)).warnings, Vec::<String>::new(), "{supported}");
    }
    // Looks that do not change the matter load with a word.
    let variants = load(&requiring("KHR_materials_variants")).warnings;
    assert!(variants[0].contains("the extension KHR_materials_variants is not modelled"), "{variants:?}");
    assert_refused(&requiring("ACME_portal"), "extensionsRequired[0]", "required extension ACME_portal is not supp");
    assert_refused(&requiring("EXT_mesh_gpu_instancing"), "extensionsRequired[0]", "is not supported");
}

#[test]
fn compressed_data_name_their_mesh_and_the_way_out() {
    // Required, but nowhere used: nothing is missing.
    for name in ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_texture_basisu", "EXT_texture_webp"] {
        let json = patched(json!({"extensionsRequired": [name], "extensionsUsed": [name]}));
        assert_eq!(load(&json).warnings, Vec::<String>::new(), "{name}");
    }
    let mut draco = tetrahedron();
    draco["meshes"][0]["primitives"][0]["extensions"] = json!({"KHR_draco_mesh_compression": {"bufferView": 0}});
    let primitive = "meshes[0] (tetrahedron).primitives[0]";
    assert_refused(&draco, primitive, "compressed with Draco (KHR_draco_mesh_compression)");
    assert_refused(&draco, primitive, "`gltf-transform cp IN.glb OUT.glb`");
    for name in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        let meshopt = with("/bufferViews/0/extensions", json!({name: {}}));
        assert_refused(&meshopt, &format!("{primitive}.attributes.POSITION"), &format!("is compressed ({name})"));
        assert_refused(&meshopt, &format!("{primitive}.attributes.POSITION"), "gltf-transform cp");
        // The buffer of decoded data has no bytes.
        let mut fallback = with("/bufferViews/1/extensions", json!({name: {}}));
        fallback["buffers"]
            .as_array_mut()
            .expect("buffers")
            .push(json!({"byteLength": 24, "extensions": {name: {"fallback": true}}}));
        fallback["bufferViews"][1]["buffer"] = json!(1);
        assert_refused(&fallback, &format!("{primitive}.indices"), &format!("is compressed ({name})"));
    }
}

#[test]
fn arrays() {
    let table = [
        ("/buffers/0/byteLength", json!(73), "buffers[0]", "byteLength is 73, but there are 72 bytes"),
        ("/buffers/0/uri", json!("data:text/plain,x"), "buffers[0].uri", "not one in base64"),
        ("/buffers/0/uri", json!("data:;base64,%"), "buffers[0].uri", "base64 is broken"),
        ("/buffers/0/uri", json!("/etc/passwd"), "buffers[0].uri", "relative to the scene's file"),
        ("/buffers/0/uri", json!("https://a.b/c.bin"), "buffers[0].uri", "relative to the scene's file"),
        ("/buffers/0/uri", json!("no%2"), "buffers[0].uri", "percent encoding"),
        ("/buffers/0/uri", json!("nowhere.bin"), "buffers[0].uri", "nowhere.bin"),
        ("/buffers/0/uri", json!("src"), "buffers[0].uri", "src: is not a regular file"),
        ("/bufferViews/0/byteLength", json!(100), "bufferViews[0]", "reach beyond the buffer's 72"),
        ("/bufferViews/0/byteOffset", json!(u64::MAX), "bufferViews[0]", "reach beyond the buffer's 72"),
        ("/bufferViews/0/byteOffset", json!(-1), "bufferViews[0].byteOffset", "must be a whole number"),
        ("/bufferViews/0/byteStride", json!(8), "bufferViews[0]", "byteStride is 8, less than an element's 12"),
        ("/bufferViews/0/buffer", json!(1), "bufferViews[0].buffer", "is 1, but `buffers` holds 1"),
        ("/accessors/0/count", json!(5), "accessors[0]", "reach beyond the view's 48 bytes"),
        ("/accessors/0/count", json!(u64::MAX), "accessors[0]", "reach beyond the view's 48 bytes"),
        ("/accessors/0/byteOffset", json!(4), "accessors[0]", "reach beyond the view's 48 bytes"),
        ("/accessors/0/bufferView", json!(9), "accessors[0].bufferView", "is 9, but `bufferViews` holds 2"),
        ("/accessors/0/type", json!("VEC2"), "accessors[0].type", "must be VEC3"),
        ("/accessors/0/componentType", json!(5124), "accessors[0].componentType", "5124 is no component type"),
        ("/accessors/1/componentType", json!(5122), "accessors[1].componentType", "must be unsigned"),
        (
            "/accessors/0",
            json!({"count": 1u64 << 40, "componentType": 5126, "type": "VEC3"}),
            "accessors[0]",
            "elements without a bufferView",
        ),
        (
            "/meshes/0/primitives/0/attributes",
            json!({"POSITION": 7}),
            "meshes[0] (tetrahedron).primitives[0].attributes.POSITION",
            "is 7, but `accessors` holds 2",
        ),
    ];
    for (pointer, value, item, problem) in table {
        assert_refused(&with(pointer, value), item, problem);
    }
    let sparse = |sparse: Value| with("/accessors/0/sparse", sparse);
    let beyond = json!({"count": 1, "indices": {"bufferView": 0, "componentType": 5121, "byteOffset": 15},
        "values": {"bufferView": 0}});
    // Byte 15 is the last of the float 1.0: 63.
    assert_refused(&sparse(beyond), "accessors[0].sparse", "index 63 in an accessor of 4");
    let unbacked = json!({"count": 1, "indices": {"componentType": 5121}, "values": {"bufferView": 0}});
    assert_refused(&sparse(unbacked), "accessors[0].sparse.indices", "has no `bufferView`");
}

#[test]
fn geometry() {
    let primitive = "meshes[0] (tetrahedron).primitives[0]";
    let mut bent = CORNERS;
    bent[2][1] = f32::NAN;
    assert_refused(&with_bytes(&bent, &FACES), primitive, "the position of vertex 2 is [0.25, NaN, 0.0]");
    bent[2][1] = f32::INFINITY;
    assert_refused(&with_bytes(&bent, &FACES), primitive, "the position of vertex 2 is");
    let mut normals = with_bytes(&bent, &FACES);
    normals["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(2);
    normals["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(0);
    let accessors = normals["accessors"].as_array_mut().expect("an array");
    accessors.push(json!({"componentType": 5126, "count": 4, "type": "VEC3"}));
    assert_refused(&normals, primitive, "the normal of vertex 2 is");
    normals["accessors"][2]["count"] = json!(5);
    assert_refused(&normals, primitive, "has 4 normals for 5 positions");

    let mut indices = FACES;
    indices[7] = 4;
    assert_refused(&with_bytes(&CORNERS, &indices), primitive, "index 7 is 4, but there are 4 vertices");
    assert_refused(&with_bytes(&CORNERS, &FACES[..11]), primitive, "11 vertices are no whole number of triangles");
    let mode = with("/meshes/0/primitives/0/mode", json!(7));
    assert_refused(&mode, &format!("{primitive}.mode"), "is 7");
    assert_refused(&with("/meshes/0/primitives", json!([])), "scene", "has no triangles");
    assert_refused(&with_bytes(&CORNERS, &[0, 0, 0, 1, 1, 2]), "scene", "has no triangles but 2 of zero area");
    assert_refused(&patched(json!({"nodes": [{"mesh": 0, "scale": [0, 0, 1]}]})), "scene", "4 of zero area");
    assert_refused(&patched(json!({"scenes": [{}]})), "scene", "has no triangles");
    let opposed = with_bytes(&CORNERS, &FACES.map(|index| 3 - index));
    assert!(load(&opposed).warnings.is_empty(), "flat normals follow the winding, whatever it is");
    let tiny = patched(json!({"nodes": [{"mesh": 0, "scale": [1e-14, 1e-14, 1e-14]}]}));
    assert_refused(&tiny, "scene", "its radius is");
    let wide = patched(json!({"scenes": [{"nodes": [0, 1]}], "nodes": [{"mesh": 0},
        {"mesh": 0, "translation": [1e13, 0, 0]}]}));
    assert_refused(&wide, "scene", "its radius is");
    let primitive_of = |material: Value| json!({"attributes": {"POSITION": 0}, "indices": 1, "material": material});
    let far = patched(json!({"scenes": [{"nodes": [0, 1]}], "nodes": [{"mesh": 0}, {"mesh": 1,
        "translation": [1e10, 0, 0]}], "meshes": [{"primitives": [primitive_of(json!(0))]},
        {"primitives": [primitive_of(json!(1))]}],
        "materials": [{"extras": {"bssrdf": {"preset": "skin1"}}}, {}]}));
    assert_refused(&far, "scene", "times as far as the translucent part's radius");
}

#[test]
fn nodes() {
    let nodes = |nodes: Value| patched(json!({"nodes": nodes}));
    assert_refused(&nodes(json!([{"mesh": 1}])), "nodes[0].mesh", "is 1, but `meshes` holds 1");
    assert_refused(&nodes(json!([{"children": [1]}])), "nodes[0].children[0]", "is 1, but `nodes` holds 1");
    assert_refused(&nodes(json!([{"children": [0]}])), "nodes[0]", "is reached twice");
    assert_refused(&nodes(json!([{"children": [1]}, {"children": [0]}])), "nodes[0]", "is reached twice");
    let shared = json!([{"children": [1, 2]}, {"children": [3]}, {"children": [3]}, {"name": "child", "mesh": 0}]);
    assert_refused(&nodes(shared), "nodes[3] (child)", "is reached twice: a node has one parent at most");
    assert_refused(&patched(json!({"scene": 1})), "scene", "is 1, but `scenes` holds 1");
    assert_refused(&patched(json!({"scenes": [{"nodes": [7]}]})), "scenes[0].nodes[0]", "is 7");
    assert_refused(&nodes(json!([{"mesh": 0, "rotation": [0, 0, 0, 0]}])), "nodes[0].rotation", "unit quaternion");
    assert_refused(&nodes(json!([{"mesh": 0, "rotation": [0, 0, 1]}])), "nodes[0].rotation", "array of 4 numbers");
    assert_refused(&nodes(json!([{"mesh": 0, "scale": [1, "a", 1]}])), "nodes[0].scale[1]", "must be a number");
    let matrix = [1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
    assert_refused(&nodes(json!([{"mesh": 0, "matrix": matrix}])), "nodes[0].matrix", "last row must be 0 0 0 1");
    let huge = json!([{"scale": [1e200, 1, 1], "children": [1]}, {"mesh": 0, "scale": [1e200, 1, 1]}]);
    assert_refused(&nodes(huge), "nodes[0]", "its transform to the world exceeds");
    assert_refused(&nodes(json!([{"mesh": 0, "camera": 0}])), "nodes[0].camera", "is 0, but `cameras` holds 0");
    let light = json!([{"mesh": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}]);
    assert_refused(&nodes(light), "nodes[0].extensions.KHR_lights_punctual.light", "but `lights` holds 0");

    // As deep as one likes.
    let depth = 100_000;
    let mut chain: Vec<Value> = (1..depth).map(|child| json!({"children": [child]})).collect();
    chain.push(json!({"mesh": 0}));
    assert_eq!(load(&nodes(json!(chain))).triangles.len(), 4);
}

#[test]
fn cameras_and_lights() {
    let camera = |camera: Value| patched(json!({"nodes": [{"mesh": 0, "camera": 0}], "cameras": [camera]}));
    let perspective = |members: Value| camera(json!({"type": "perspective", "perspective": members}));
    assert_refused(&perspective(json!({"yfov": 0})), "cameras[0].perspective.yfov", "must be above 0");
    assert_refused(&perspective(json!({"yfov": 3.135})), "cameras[0].perspective.yfov", "must be at most 3.13");
    assert_refused(&perspective(json!({})), "cameras[0].perspective", "has no `yfov`");
    let aspect = perspective(json!({"yfov": 1, "aspectRatio": -1}));
    assert_refused(&aspect, "cameras[0].perspective.aspectRatio", "must be above 0");
    let flat = camera(json!({"type": "orthographic", "orthographic": {"xmag": 0, "ymag": 1}}));
    assert_refused(&flat, "cameras[0].orthographic.xmag", "must be above 0");
    assert_refused(&camera(json!({"type": "fisheye"})), "cameras[0].type", "is \"fisheye\"");
    let mut no_direction = perspective(json!({"yfov": 1}));
    no_direction["nodes"] = json!([{"mesh": 0, "children": [1]}, {"camera": 0, "scale": [0, 0, 0]}]);
    assert_refused(&no_direction, "nodes[1]", "leaves a light or camera no direction");

    let light = |light: Value| {
        patched(json!({
            "nodes": [{"mesh": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}],
            "extensions": {"KHR_lights_punctual": {"lights": [light]}}
        }))
    };
    let item = "extensions.KHR_lights_punctual.lights[0]";
    let table = [
        (json!({"type": "point", "intensity": -1}), ".intensity", "must be from 0"),
        (json!({"type": "point", "color": [1, -1, 1]}), ".color[1]", "must be from 0"),
        (json!({"type": "point", "range": 0}), ".range", "must be above 0"),
        (json!({"type": "area"}), ".type", "must be point, spot or directional"),
        (json!({}), "", "has no `type`"),
        (json!({"type": "spot", "spot": {"outerConeAngle": 1.6}}), ".spot.outerConeAngle", "must be from 0"),
        (json!({"type": "spot", "spot": {"innerConeAngle": -0.1}}), ".spot.innerConeAngle", "must be from 0"),
        (json!({"type": "spot", "spot": {"innerConeAngle": 0.9}}), "", "must be below outerConeAngle"),
    ];
    for (json, member, problem) in table {
        assert_refused(&light(json), &format!("{item}{member}"), problem);
    }
    assert_refused(&light(json!({"type": "point", "intensity": 1e35})), "light `light 0`", "is brighter than 1e30");
    let far = |node: Value| {
        let mut json = light(json!({"type": "point", "name": "star"}));
        json["nodes"] = json!([{"mesh": 0, "children": [1]}, {"translation": [0, 1e12, 0]}]);
        node.as_object().expect("an object").iter().for_each(|(key, value)| json["nodes"][1][key] = value.clone());
        json["cameras"] = json!([{"name": "eye", "type": "perspective", "perspective": {"yfov": 1}}]);
        json
    };
    let node = json!({"extensions": {"KHR_lights_punctual": {"light": 0}}});
    assert_refused(&far(node), "light `star`", "times as far as the translucent part's radius");
    assert_refused(&far(json!({"camera": 0})), "camera `eye`", "times as far as the translucent part's radius");
}

#[test]
fn materials() {
    let extension = |name: &str, members: Value| {
        let mut extensions = json!({
            "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 0.01,
                "attenuationColor": [0.5, 0.5, 0.5]},
            "KHR_materials_volume_scatter": {"multiscatterColorFactor": [0.5, 0.5, 0.5]}
        });
        for (key, value) in members.as_object().expect("an object") {
            extensions[name][key] = value.clone();
        }
        json!({"extensions": extensions})
    };
    let bssrdf = |members: Value| json!({"extras": {"bssrdf": members}});
    let volume = "extensions.KHR_materials_volume";
    let scatter = "extensions.KHR_materials_volume_scatter";
    let table = [
        (
            json!({"pbrMetallicRoughness": {"baseColorFactor": [1, 2, 1, 1]}}),
            "pbrMetallicRoughness.baseColorFactor[1]",
            "must be from 0 to 1, is 2",
        ),
        (
            json!({"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1]}}),
            "pbrMetallicRoughness.baseColorFactor",
            "must be an array of 4 numbers, is an array of 3",
        ),
        (json!({"pbrMetallicRoughness": {"metallicFactor": -1}}), "pbrMetallicRoughness.metallicFactor", "is -1"),
        (
            json!({"pbrMetallicRoughness": {"roughnessFactor": "x"}}),
            "pbrMetallicRoughness.roughnessFactor",
            "must be a number, is a string",
        ),
        (json!({"emissiveFactor": [0, 0, -1]}), "emissiveFactor[2]", "is -1"),
        (json!({"alphaMode": "GLOW"}), "alphaMode", "must be OPAQUE, MASK or BLEND"),
        (
            json!({"extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": -1}}}),
            "extensions.KHR_materials_emissive_strength.emissiveStrength",
            "is -1",
        ),
        (json!({"extensions": {"KHR_materials_ior": {"ior": -1}}}), "extensions.KHR_materials_ior.ior", "is -1"),
        (
            json!({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 2}}}),
            "extensions.KHR_materials_transmission.transmissionFactor",
            "is 2",
        ),
        (
            extension("KHR_materials_volume", json!({"attenuationDistance": -1})),
            &format!("{volume}.attenuationDistance"),
            "must be above 0, is -1",
        ),
        (
            extension("KHR_materials_volume", json!({"attenuationDistance": 0})),
            &format!("{volume}.attenuationDistance"),
            "must be above 0, is 0",
        ),
        (
            extension("KHR_materials_volume", json!({"attenuationDistance": 1e-20})),
            &format!("{volume}.attenuationDistance"),
            "must be from",
        ),
        (
            extension("KHR_materials_volume", json!({"attenuationColor": [2, 0, 0]})),
            &format!("{volume}.attenuationColor[0]"),
            "must be from 0 to 1, is 2",
        ),
        (
            extension("KHR_materials_volume", json!({"thicknessFactor": -1})),
            &format!("{volume}.thicknessFactor"),
            "must be at least 0, is -1",
        ),
        (
            extension("KHR_materials_volume_scatter", json!({"multiscatterColorFactor": [0, 1.5, 0]})),
            &format!("{scatter}.multiscatterColorFactor[1]"),
            "is 1.5",
        ),
        (
            extension("KHR_materials_volume_scatter", json!({"scatterAnisotropy": 1})),
            &format!("{scatter}.scatterAnisotropy"),
            "must be above -1 and below 1",
        ),
        (
            extension("KHR_materials_scatter", json!({"scatterStrengthFactor": 1.5})),
            "extensions.KHR_materials_scatter.scatterStrengthFactor",
            "is 1.5",
        ),
        (
            json!({"extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 1e31}}}),
            "extensions.KHR_materials_emissive_strength.emissiveStrength",
            "is 10000000000000000000000000000000",
        ),
        (bssrdf(json!({"preset": "skin3"})), "extras.bssrdf.preset", "unknown preset \"skin3\"; close names: skin"),
        (bssrdf(json!({"preset": "skin1", "sigma_a": 1})), "extras.bssrdf.sigma_a", "go together with `preset`"),
        (bssrdf(json!({"preset": "skin1", "color": 1})), "extras.bssrdf", "unknown member `color`; known: preset"),
        (bssrdf(json!({"preset": "skin1", "model": "magic"})), "extras.bssrdf.model", "unknown model \"magic\""),
        (bssrdf(json!({"preset": "skin1", "kappa": -1})), "extras.bssrdf.kappa", "must be from 0 to 100, is -1"),
        (bssrdf(json!({"preset": "skin1", "kappa": "1"})), "extras.bssrdf.kappa", "must be a number, is a string"),
        (
            bssrdf(json!({"preset": "skin1", "reciprocal": 1})),
            "extras.bssrdf.reciprocal",
            "must be true or false, is 1",
        ),
        (bssrdf(json!({"preset": "skin1", "renormalise": 0})), "extras.bssrdf.renormalise", "must be true or false"),
        (bssrdf(json!({"preset": "skin1", "surface": "wet"})), "extras.bssrdf.surface", "must be \"smooth\""),
        (bssrdf(json!({"preset": "skin1", "ior": 0})), "extras.bssrdf.ior", "must be from 0.1 to 10, is 0"),
        (bssrdf(json!({"preset": "skin1", "g": -1})), "extras.bssrdf.g", "must be above -1 and below 1"),
        (bssrdf(json!({})), "extras.bssrdf", "needs `preset`"),
        (bssrdf(json!(7)), "extras.bssrdf", "must be an object, is 7"),
        (bssrdf(json!({"sigma_s_prime": 1, "sigma_a": 1})), "extras.bssrdf", "has no `unit` (1/mm, 1/cm or 1/m)"),
        (
            bssrdf(json!({"sigma_s_prime": 1, "sigma_a": 1, "unit": "mm"})),
            "extras.bssrdf.unit",
            "must be 1/mm, 1/cm or 1/m, is \"mm\"",
        ),
        (bssrdf(json!({"sigma_s_prime": -1, "sigma_a": 1, "unit": "1/mm"})), "extras.bssrdf.sigma_s_prime", "is -1"),
        (
            bssrdf(json!({"sigma_s_prime": 1, "sigma_a": [1, 1, -2], "unit": "1/mm"})),
            "extras.bssrdf.sigma_a[2]",
            "is -2",
        ),
        (bssrdf(json!({"sigma_a": 1, "unit": "1/mm"})), "extras.bssrdf", "but no `sigma_s_prime`"),
        (bssrdf(json!({"sigma_s": 1, "sigma_a": 1, "unit": "1/mm"})), "extras.bssrdf", "has `sigma_s`, but no `g`"),
        (
            bssrdf(json!({"sigma_s": 1, "sigma_s_prime": 1, "sigma_a": 1, "unit": "1/mm"})),
            "extras.bssrdf.sigma_s",
            "does not go together",
        ),
        (bssrdf(json!({"albedo": 0.5, "unit": "mm"})), "extras.bssrdf", "but no `mean_free_path`"),
        (bssrdf(json!({"albedo": 0.5, "mean_free_path": 1})), "extras.bssrdf", "has no `unit` (mm, cm or m)"),
        (bssrdf(json!({"albedo": 0.5, "mean_free_path": 1, "unit": "1/mm"})), "extras.bssrdf.unit", "mm, cm or m"),
        (bssrdf(json!({"albedo": 1.5, "mean_free_path": 1, "unit": "mm"})), "extras.bssrdf.albedo", "is 1.5"),
        (
            bssrdf(json!({"albedo": 0.5, "mean_free_path": 0, "unit": "mm"})),
            "extras.bssrdf.mean_free_path",
            "must be at least",
        ),
        (bssrdf(json!({"albedo": 0.5, "mean_free_path": -1, "unit": "mm"})), "extras.bssrdf.mean_free_path", "-1"),
        (
            bssrdf(json!({"albedo": 1, "diffuse_mean_free_path": 1, "unit": "mm"})),
            "extras.bssrdf.albedo",
            "infinite diffuse mean free path",
        ),
        (
            bssrdf(json!({"albedo": 0.5, "mean_free_path": 1, "diffuse_mean_free_path": 1, "unit": "mm"})),
            "extras.bssrdf.diffuse_mean_free_path",
            "does not go together",
        ),
        (
            bssrdf(json!({"albedo": 0.5, "mean_free_path": 1, "sigma_a": 1, "unit": "mm"})),
            "extras.bssrdf.sigma_a",
            "does not go together with `albedo`",
        ),
    ];
    for (material, member, problem) in table {
        let dot = if member.is_empty() { "" } else { "." };
        assert_refused(&with_material(material), &format!("materials[0] (matter){dot}{member}"), problem);
    }
    let other = with("/meshes/0/primitives/0/material", json!(1));
    assert_refused(&other, "meshes[0] (tetrahedron).primitives[0].material", "is 1, but `materials` holds 1");
}

#[test]
fn overrides() {
    let refused = |name: &str, preset: &str| {
        let options = LoadOptions { materials: vec![(name.into(), preset.into())], ..LoadOptions::default() };
        load_with(&tetrahedron(), &options).expect_err("an override that does not fit").to_string()
    };
    assert_eq!(refused("marter", "skin1"), "material: test.gltf has no material `marter`; it has: matter");
    assert!(refused("matter", "skin9").starts_with("material: unknown preset \"skin9\"; close names: skin1"));
}

#[test]
fn names_cannot_garble_messages() {
    let name = "x\n\u{1b}[2J".repeat(1000);
    let message = refusal(&patched(json!({"materials": [{"name": name, "alphaMode": 1}]})));
    assert!(message.len() < 400 && !message.contains('\n') && !message.contains('\u{1b}'), "{message:?}");
}
