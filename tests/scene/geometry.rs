//! Geometry: every way a file may hold triangles, node transforms, and the internal frame.

use crate::build::*;
use glam::{DAffine3, DMat4, DQuat, DVec3};
use serde_json::{Value, json};
use translucent::scene::{LoadOptions, Scene};

/// Rounding of a coordinate of size 1 to f32, twice (corner and edge), with room for the way back.
const TOLERANCE: f64 = 3e-7;

/// How the warning about turned triangles begins.
const TURNED: &str = "translucent triangles wound against their neighbours, or inside out, were turned: ";

/// The tetrahedron's triangles under a transform.
fn expected(transform: DAffine3) -> Vec<[DVec3; 3]> {
    let vertex =
        |index: &u16| transform.transform_point3(DVec3::from_array(CORNERS[*index as usize].map(|value| value as f64)));
    FACES.chunks(3).map(|face| [vertex(&face[0]), vertex(&face[1]), vertex(&face[2])]).collect()
}

fn assert_tetrahedron(json: &Value) {
    assert!(same_triangles(&metres(&load(json)), &expected(DAffine3::IDENTITY), TOLERANCE), "{json}");
}

#[test]
fn indexed_triangles() {
    let scene = load(&tetrahedron());
    assert!(same_triangles(&metres(&scene), &expected(DAffine3::IDENTITY), TOLERANCE));
    assert_eq!((scene.materials.len(), scene.sets.len(), scene.dropped_triangles), (1, 1, 0));
    assert_eq!(scene.sets[0].name, "thing, matter");
    assert_eq!(scene.warnings, Vec::<String>::new());
    assert!(volume(&metres(&scene)) > 0.1);
}

#[test]
fn plain_strip_and_fan() {
    let plain: Vec<[f32; 3]> = FACES.iter().map(|&index| CORNERS[index as usize]).collect();
    let mut json = with_bytes(&plain, &[0]);
    json["meshes"][0]["primitives"][0].as_object_mut().expect("an object").remove("indices");
    assert_tetrahedron(&json);
    // A strip of four triangles around the tetrahedron: faces 0 2 1, 2 3 1 (turned), 1 3 0, 3 2 0 (turned).
    let mut strip = with_bytes(&CORNERS, &[0, 2, 1, 3, 0, 2]);
    strip["meshes"][0]["primitives"][0]["mode"] = json!(5);
    assert_tetrahedron(&strip);
    let mut fan = with_bytes(&CORNERS, &[0, 2, 1, 3, 2]);
    fan["meshes"][0]["primitives"][0]["mode"] = json!(6);
    let three = [[0, 2, 1], [0, 1, 3], [0, 3, 2]];
    let three = three.map(|face| face.map(|i: usize| DVec3::from_array(CORNERS[i].map(|value| value as f64))));
    assert!(same_triangles(&metres(&load(&fan)), &three, TOLERANCE));
}

#[test]
fn interleaved_quantised_and_sparse() {
    // Stride 16, from byte 4 on.
    let mut bytes = vec![0xff; 4];
    for corner in CORNERS {
        corner.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        bytes.extend([0xff; 4]);
    }
    let split = bytes.len();
    FACES.iter().for_each(|index| bytes.extend(index.to_le_bytes()));
    let buffer = json!([{"byteLength": bytes.len(), "uri": data_uri(&bytes)}]);
    assert_tetrahedron(&patched(json!({
        "buffers": buffer,
        "bufferViews": [
            {"buffer": 0, "byteLength": split, "byteStride": 16},
            {"buffer": 0, "byteOffset": split, "byteLength": 24}
        ],
        "accessors": [
            {"bufferView": 0, "byteOffset": 4, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}
        ]
    })));

    // Eighths as normalised bytes under a node that scales by 127/8: all corners are whole eighths.
    let mut bytes = Vec::new();
    for corner in CORNERS {
        bytes.extend(corner.map(|value| (value * 8.0) as i8 as u8));
        bytes.push(0);
    }
    bytes.extend(FACES.map(|index| index as u8));
    assert_tetrahedron(&patched(json!({
        "extensionsRequired": ["KHR_mesh_quantization"],
        "extensionsUsed": ["KHR_mesh_quantization"],
        "nodes": [{"mesh": 0, "scale": [127.0 / 8.0, 127.0 / 8.0, 127.0 / 8.0]}],
        "buffers": [{"byteLength": 28, "uri": data_uri(&bytes)}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 16, "byteStride": 4},
            {"buffer": 0, "byteOffset": 16, "byteLength": 12}
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5120, "normalized": true, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5121, "count": 12, "type": "SCALAR"}
        ]
    })));

    // Zeros, with all corners but the first (which is 0) put in.
    let mut bytes = vec![1, 2, 3, 0];
    CORNERS[1..].iter().flatten().for_each(|value| bytes.extend(value.to_le_bytes()));
    FACES.iter().for_each(|index| bytes.extend(index.to_le_bytes()));
    assert_tetrahedron(&patched(json!({
        "buffers": [{"byteLength": bytes.len(), "uri": data_uri(&bytes)}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 3},
            {"buffer": 0, "byteOffset": 4, "byteLength": 36},
            {"buffer": 0, "byteOffset": 40, "byteLength": 24}
        ],
        "accessors": [
            {"componentType": 5126, "count": 4, "type": "VEC3", "sparse": {
                "count": 3,
                "indices": {"bufferView": 0, "componentType": 5121},
                "values": {"bufferView": 1}
            }},
            {"bufferView": 2, "componentType": 5123, "count": 12, "type": "SCALAR"}
        ]
    })));
}

#[test]
fn containers_and_files() {
    let (json, binary) = spot();
    let shipped = Scene::load("assets/spot.glb").expect("the shipped scene loads");
    let again = Scene::from_bytes("x.glb", &glb(&json, &binary), &LoadOptions::default()).expect("the same scene");
    assert_eq!(shipped.hash, again.hash);
    assert_eq!(shipped.warnings, Vec::<String>::new());

    let directory = std::env::temp_dir().join(format!("translucent-scene-{}", std::process::id()));
    std::fs::create_dir_all(&directory).expect("a temporary directory");
    std::fs::write(directory.join("the cow.bin"), &binary).expect("a temporary file");
    let mut beside = json;
    beside["buffers"][0]["uri"] = json!("the%20cow.bin");
    std::fs::write(directory.join("cow.gltf"), beside.to_string()).expect("a temporary file");
    let loaded = Scene::load(directory.join("cow.gltf")).expect("buffers lie beside the file");
    std::fs::write(directory.join("the cow.bin"), &binary[1..]).expect("a temporary file");
    let short = Scene::load(directory.join("cow.gltf")).expect_err("a buffer that is too short").to_string();
    std::fs::remove_dir_all(&directory).expect("our own directory");
    assert_eq!(shipped.hash, loaded.hash);
    assert!(short.contains("cow.gltf: buffers[0]: byteLength is 140592, but there are 140591 bytes"), "{short}");
}

#[test]
fn node_transforms() {
    let (scale, rotation) = (DVec3::new(2.0, 0.5, 3.0), DQuat::from_xyzw(0.48, 0.6, 0.0, 0.64));
    let translation = DVec3::new(5.0, -6.0, 7.0);
    let local = DAffine3::from_scale_rotation_translation(scale, rotation, translation);
    let parent = DAffine3::from_scale(DVec3::new(1.0, 2.0, 1.0));
    let by_parts = patched(json!({
        "nodes": [{"scale": [1, 2, 1], "children": [1]}, {"mesh": 0, "scale": scale.to_array(),
            "rotation": rotation.to_array(), "translation": translation.to_array()}]
    }));
    let matrix = DMat4::from(local).to_cols_array();
    let by_matrix = patched(json!({
        "nodes": [{"scale": [1, 2, 1], "children": [1]}, {"mesh": 0, "matrix": matrix}]
    }));
    for json in [by_parts, by_matrix] {
        let triangles = metres(&load(&json));
        assert!(same_triangles(&triangles, &expected(parent * local), 10.0 * TOLERANCE));
        assert!(volume(&triangles) > 0.0);
    }
}

#[test]
fn mirrored_nodes_stay_outward() {
    let flat = load(&tetrahedron());
    for scale in [[-1.0, 1.0, 1.0], [2.0, -0.5, 1.0], [-1.0, -1.0, -1.0]] {
        let mirrored = load(&patched(json!({"nodes": [{"mesh": 0, "scale": scale}]})));
        let triangles = metres(&mirrored);
        let factor: f64 = scale.iter().product();
        let wanted = volume(&metres(&flat)) * factor.abs();
        assert!((volume(&triangles) - wanted).abs() < 1e-5 * wanted, "{scale:?}");
        for (triangle, shading) in mirrored.triangles.iter().zip(&mirrored.shadings) {
            let [_, edge1, edge2] = triangle.corner_and_edges();
            let normal = edge1.cross(edge2).normalize().as_vec3();
            assert!(normal.dot(shading.normal0) > 0.999, "flat normals follow the winding");
        }
    }
}

#[test]
fn no_normal_points_below_its_triangle() {
    // Between normals on both sides of a triangle there is one of length zero.
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let stored = |third: f32| [[0.0, 0.6, 0.8], [0.0, 0.0, 2.0], [0.6, 0.0, 0.8 * third]];
    for (third, below) in [(1.0, 0), (-1.0, 1)] {
        let mut json = with_bytes(&[corners, stored(third)].concat(), &[0, 1, 2]);
        json["accessors"][0]["count"] = json!(3);
        let normals = json!({"bufferView": 0, "byteOffset": 36, "componentType": 5126, "count": 3, "type": "VEC3"});
        json["accessors"].as_array_mut().expect("accessors").push(normals);
        json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(2);
        let scene = load(&json);
        let shading = scene.shadings[0];
        assert!([shading.normal0, shading.normal1, shading.normal2].iter().all(|normal| normal.z > 0.5));
        let warned = scene.warnings.iter().filter(|warning| warning.contains("below their triangle")).count();
        assert_eq!(warned, below, "{:?}", scene.warnings);
    }
}

#[test]
fn normals_follow_the_surface() {
    // A sphere's points and normals under a non-uniform, mirrored, sheared transform: normals of an ellipsoid.
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    let rings = 24;
    for row in 0..=rings {
        for column in 0..=2 * rings {
            let (theta, phi) = (row as f64, column as f64);
            let (theta, phi) = (theta / rings as f64 * std::f64::consts::PI, phi / rings as f64 * std::f64::consts::PI);
            positions.push([theta.sin() * phi.cos(), theta.cos(), -theta.sin() * phi.sin()].map(|value| value as f32));
            if row < rings && column < 2 * rings {
                let at = (row * (2 * rings + 1) + column) as u16;
                let below = at + 2 * rings as u16 + 1;
                indices.extend([at, below, below + 1, at, below + 1, at + 1]);
            }
        }
    }
    let mut json = with_bytes(&positions, &indices);
    json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(0);
    let matrix = [-2.0, 0.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.25, 0.5, 0.0, 1.0, 2.0, 3.0, 1.0];
    json["nodes"] = json!([{"mesh": 0, "matrix": matrix}]);
    let scene = load(&json);
    assert!(scene.dropped_triangles > 0, "the poles have triangles of zero area");
    let to_world = DAffine3::from_mat4(DMat4::from_cols_array(&matrix));
    let to_normal = to_world.matrix3.inverse().transpose();
    for (shading, [a, ..]) in scene.shadings.iter().zip(metres(&scene)) {
        let sphere = to_world.inverse().transform_point3(a);
        let wanted = (to_normal * sphere).normalize();
        assert!(shading.normal0.as_dvec3().dot(wanted) > 0.9999, "{} is not {wanted}", shading.normal0);
        assert!((shading.normal0.length() - 1.0).abs() < 1e-6);
    }
    assert!(!scene.warnings.iter().any(|warning| warning.contains("against their winding")));
    let mut turned = with_bytes(&positions, &indices.iter().rev().copied().collect::<Vec<_>>());
    turned["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(0);
    let turned = load(&turned);
    let count = turned.triangles.len();
    assert!(turned.warnings.contains(&format!("{TURNED}{count}")), "{:?}", turned.warnings);
    assert!(!turned.warnings.iter().any(|warning| warning.contains("against their winding")), "the normals were right");
    assert!((volume(&metres(&turned)) / volume(&metres(&scene)) - 1.0).abs() < 1e-6);
    let unmirrored = [2.0, 0.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.25, 0.5, 0.0, 1.0, 2.0, 3.0, 1.0];
    json["nodes"] = json!([{"mesh": 0, "matrix": unmirrored}]);
    assert!(volume(&metres(&load(&json))) > 0.0);
}

#[test]
fn instances_are_sets_of_their_own() {
    let scene = load(&patched(json!({
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"name": "a", "mesh": 0}, {"name": "b", "mesh": 0, "translation": [3, 0, 0]}]
    })));
    assert_eq!(scene.triangles.len(), 8);
    assert_eq!(scene.sets.iter().map(|set| set.name.as_str()).collect::<Vec<_>>(), ["a, matter", "b, matter"]);
    for (triangle, [a, b, c]) in scene.triangles.iter().zip(metres(&scene)) {
        let second = (a + b + c).x / 3.0 > 2.0;
        assert_eq!(triangle.set, u32::from(second));
    }
    // Two primitives of one material on one node are one set; of two materials, two.
    let primitive = |material: usize| json!({"attributes": {"POSITION": 0}, "indices": 1, "material": material});
    let scene = load(&patched(json!({
        "meshes": [{"primitives": [primitive(0), primitive(1), primitive(0)]}],
        "materials": [{"name": "matter", "extras": {"bssrdf": {"preset": "skin1"}}}, {"name": "paint"}]
    })));
    assert_eq!((scene.sets.len(), scene.materials.len()), (2, 2));
    // They lie in the same place, where light would count twice.
    assert_eq!(scene.triangles.len(), 8);
    assert_eq!(scene.warnings, ["translucent triangles that lie twice in a set were dropped: 4"]);
}

#[test]
fn scenes_and_what_is_not_in_them() {
    let several = |scene: Value| {
        let mut json = patched(json!({
            "scenes": [{"nodes": [0]}, {"name": "other", "nodes": [1]}],
            "nodes": [{"name": "first", "mesh": 0}, {"name": "second", "mesh": 0}],
            "materials": [{"name": "matter", "extras": {"bssrdf": {"preset": "skin1"}}}, {"name": "unused"}]
        }));
        json["scene"] = scene;
        load(&json)
    };
    let second = several(json!(1));
    assert_eq!((second.sets.len(), second.sets[0].name.as_str()), (1, "second, matter"));
    assert!(second.warnings[0].contains("scenes[1] (other) is shown"), "{:?}", second.warnings);
    assert_eq!(several(json!(0)).sets[0].name, "first, matter");
    assert_eq!(second.materials.len(), 1, "materials that nothing uses are left out");
    // Without scenes: the nodes that have no parent.
    let mut json = patched(json!({"scene": null, "scenes": null}));
    json["nodes"] = json!([{"name": "child", "mesh": 0}, {"children": [0], "translation": [1, 0, 0]}]);
    assert!(same_triangles(&metres(&load(&json)), &expected(DAffine3::from_translation(DVec3::X)), TOLERANCE));
}

#[test]
fn zero_area_triangles_leave_no_trace() {
    let clean = load(&with_bytes(&CORNERS, &FACES));
    let mut positions = CORNERS.to_vec();
    // Far away, so that a frame that counted them would show it: a point, a line, a repeated index.
    positions.extend([[9.0, 9.0, 9.0], [10.0, 9.0, 9.0], [11.0, 9.0, 9.0]]);
    let indices = [&FACES[..], &[4, 4, 4, 4, 5, 6, 4, 5, 4]].concat();
    let dirty = load(&with_bytes(&positions, &indices));
    assert_eq!(dirty.dropped_triangles, 3);
    assert_eq!((dirty.hash, dirty.nodes), (clean.hash, clean.nodes));
    assert_eq!(dirty.warnings, ["triangles of zero area were dropped: 3"]);
}

#[test]
fn the_frame_surrounds_translucent_matter() {
    let table = json!({"nodes": [{"mesh": 0}, {"mesh": 1, "scale": [50, 50, 50]}], "scenes": [{"nodes": [0, 1]}],
    "meshes": [
        {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]},
        {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}
    ]});
    let (alone, scene) = (load(&tetrahedron()), load(&patched(table)));
    assert_eq!(alone.frame, scene.frame);
    assert_eq!(scene.triangles.len(), 8);
    let farthest = metres(&alone).iter().flatten().map(|v| v.distance(alone.frame.centre)).fold(0.0, f64::max);
    assert!((farthest * alone.frame.scale - 1.0).abs() < 1e-6);
}

/// Internal geometry is the same to one rounding of f32 (`relative`), or within `absolute` near zero.
fn assert_same_inside(a: &Scene, b: &Scene, absolute: f32) {
    assert_eq!(a.triangles.len(), b.triangles.len());
    let same = |x: glam::Vec3, y: glam::Vec3| {
        (0..3).all(|i| (x[i] - y[i]).abs() <= (x[i].abs() * 2f32.powi(-23)).max(absolute))
    };
    for (x, y) in a.triangles.iter().zip(&b.triangles) {
        assert!(x.vertices.iter().zip(y.vertices).all(|(x, y)| same(*x, y)), "{x:?} {y:?}");
        assert_eq!(x.set, y.set);
    }
    for (x, y) in a.shadings.iter().zip(&b.shadings) {
        assert!(same(x.normal0, y.normal0) && same(x.normal1, y.normal1) && same(x.normal2, y.normal2));
    }
}

#[test]
fn far_tiny_and_huge_scenes_are_the_same_inside() {
    let (json, binary) = spot();
    let under = |parent: Value| {
        let mut json = json.clone();
        json["nodes"] = json!([json["nodes"][0], parent]);
        json["nodes"][1]["children"] = json!([0]);
        json["scenes"][0]["nodes"] = json!([1]);
        Scene::from_bytes("spot.glb", &glb(&json, &binary), &LoadOptions::default()).expect("a moved scene loads")
    };
    let near = under(json!({}));
    // A coordinate of 1e5 m is known to 2^-37 m; the scene's internal unit is about 0.07 m: 4e-10, for two of them.
    let far = under(json!({"translation": [1e5, -1e5, 1e5]}));
    assert_same_inside(&near, &far, 1e-9);
    for scale in [1e-3, 0.3, 1e3] {
        assert_same_inside(&near, &under(json!({"scale": [scale, scale, scale]})), 1e-12);
    }
    for unit in [1e-3, 0.0292, 1e3] {
        let options = LoadOptions { unit, ..LoadOptions::default() };
        let scaled = Scene::from_bytes("spot.glb", &glb(&json, &binary), &options).expect("a scaled scene loads");
        assert_same_inside(&near, &scaled, 1e-12);
        assert!((scaled.frame.scale * unit / near.frame.scale - 1.0).abs() < 1e-12);
        assert_eq!(scaled.materials, near.materials, "coefficients do not know the unit");
    }
}
