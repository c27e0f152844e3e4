//! Morph targets at their weights, and skins where the scene's joints stand.

use crate::build::*;
use glam::{DAffine3, DMat4, DQuat, DVec3};
use serde_json::{Value, json};

const TOLERANCE: f64 = 1e-6;

fn faces(vertex: impl Fn(usize) -> DVec3) -> Vec<[DVec3; 3]> {
    FACES.chunks(3).map(|face| [0, 1, 2].map(|i| vertex(face[i] as usize))).collect()
}

fn corner(vertex: usize) -> DVec3 {
    DVec3::from_array(CORNERS[vertex].map(f64::from))
}

/// The tetrahedron with two morph targets.
fn morphed() -> Value {
    let mut json = tetrahedron();
    let moves = [[[0.5f32, 0.0, 0.0]; 4], [[0.0, 0.0, 0.25], [0.0; 3], [0.0; 3], [0.0, 1.0, 0.0]]];
    moves.iter().for_each(|target| push_bytes(&mut json, bytemuck::cast_slice(target), 5126, 4, "VEC3"));
    json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": 2}, {"POSITION": 3}]);
    json
}

#[test]
fn morph_targets_have_the_weights_of_node_or_mesh() {
    let expected = |a: f64, b: f64| {
        faces(|i| {
            let second = [DVec3::Z * 0.25, DVec3::ZERO, DVec3::ZERO, DVec3::Y][i];
            corner(i) + a * DVec3::X * 0.5 + b * second
        })
    };
    let mut json = morphed();
    assert!(same_triangles(&metres(&load(&json)), &expected(0.0, 0.0), TOLERANCE), "weights are 0 by default");
    json["meshes"][0]["weights"] = json!([1, 0.5]);
    assert!(same_triangles(&metres(&load(&json)), &expected(1.0, 0.5), TOLERANCE));
    assert_eq!(load(&json).warnings, Vec::<String>::new());
    json["nodes"][0]["weights"] = json!([0, -0.5]);
    assert!(same_triangles(&metres(&load(&json)), &expected(0.0, -0.5), TOLERANCE), "a node's weights win");
    // Two nodes show the mesh in two shapes.
    json["nodes"] = json!([{"mesh": 0, "weights": [1, 0]}, {"mesh": 0, "weights": [0, 1]}]);
    json["scenes"] = json!([{"nodes": [0, 1]}]);
    let both = [expected(1.0, 0.0), expected(0.0, 1.0)].concat();
    assert!(same_triangles(&metres(&load(&json)), &both, TOLERANCE));

    let mut wrong = morphed();
    wrong["meshes"][0]["weights"] = json!([1]);
    let message = refusal(&wrong);
    assert!(message.contains("primitives[0]: has 2 morph targets, but 1 weights"), "{message}");
    let mut short = morphed();
    short["accessors"][2]["count"] = json!(3);
    short["meshes"][0]["weights"] = json!([1, 1]);
    let message = refusal(&short);
    assert!(message.contains("targets[0].POSITION: has 3 displacements for 4 vertices"), "{message}");
}

/// The tetrahedron on two joints: vertex 0 on the first, 1 and 2 on the second, 3 on both.
fn skinned(first: DAffine3, second: DAffine3, binds: [DAffine3; 2]) -> Value {
    let mut json = tetrahedron();
    push_bytes(&mut json, &[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0], 5121, 4, "VEC4");
    let weights: [[f32; 4]; 4] =
        [[1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.5, 1.5, 0.0, 0.0]];
    push_bytes(&mut json, bytemuck::cast_slice(&weights), 5126, 4, "VEC4");
    let binds: Vec<f32> = binds.iter().flat_map(|m| DMat4::from(*m).as_mat4().to_cols_array()).collect();
    push_bytes(&mut json, bytemuck::cast_slice(&binds), 5126, 2, "MAT4");
    let attributes = &mut json["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(2);
    attributes["WEIGHTS_0"] = json!(3);
    let matrix = |transform: DAffine3| json!(DMat4::from(transform).to_cols_array());
    // The node's own place does not count.
    json["nodes"] = json!([
        {"mesh": 0, "skin": 0, "translation": [100, 0, 0]},
        {"matrix": matrix(first), "children": [2]},
        {"matrix": matrix(second)}
    ]);
    json["scenes"] = json!([{"nodes": [0, 1]}]);
    json["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": 4}]);
    json
}

#[test]
fn skins_stand_where_their_joints_do() {
    let first = DAffine3::from_rotation_translation(DQuat::from_rotation_x(0.4), DVec3::new(1.0, 2.0, 3.0));
    let second = DAffine3::from_scale_rotation_translation(
        DVec3::new(1.0, 1.5, 1.0),
        DQuat::from_rotation_z(-0.2),
        DVec3::new(0.1, 0.0, -0.2),
    );
    let binds = [DAffine3::from_translation(DVec3::NEG_X * 0.25), DAffine3::from_rotation_y(0.5)];
    let json = skinned(first, second, binds);
    let scene = load(&json);
    assert_eq!(scene.warnings, Vec::<String>::new());
    let joints = [first * binds[0], first * second * binds[1]];
    let expected = faces(|i| {
        let (a, b) = (joints[0].transform_point3(corner(i)), joints[1].transform_point3(corner(i)));
        // The weights of vertex 3 sum to 2.
        [a, b, b, 0.25 * a + 0.75 * b][i]
    });
    assert!(same_triangles(&metres(&scene), &expected, 3e-6));
    assert!(volume(&metres(&scene)) > 0.0);

    // Bound as it stands, it is where it was; mirrored, its matter stays inside.
    let bound = skinned(first, second, [first.inverse(), (first * second).inverse()]);
    assert!(same_triangles(&metres(&load(&bound)), &faces(corner), 3e-6));
    let mirror = DAffine3::from_scale(DVec3::new(1.0, -1.0, 1.0));
    assert!(volume(&metres(&load(&skinned(mirror, DAffine3::IDENTITY, [DAffine3::IDENTITY; 2])))) > 0.0);

    let refused = |change: &dyn Fn(&mut Value), problem: &str| {
        let mut broken = json.clone();
        change(&mut broken);
        let message = refusal(&broken);
        assert!(message.contains(problem), "{message}");
    };
    refused(&|json| json["nodes"][0]["skin"] = json!(3), "nodes[0].skin: is 3, but `skins` holds 1");
    refused(&|json| json["skins"][0]["joints"] = json!([1]), "vertex 1 names joint 1 of a skin of 1");
    refused(&|json| json["skins"][0]["joints"] = json!([1, 9]), "skins[0].joints[1]: is 9, but `nodes` holds 3");
    refused(&|json| json["scenes"][0]["nodes"] = json!([0, 2]), "nodes[1] is not in the scene");
    refused(&|json| json["accessors"][4]["count"] = json!(1), "inverseBindMatrices: holds 1 matrices for 2 joints");
    refused(
        &|json| {
            let attributes = json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().expect("attributes");
            attributes.remove("WEIGHTS_0");
        },
        "vertex 0 of a skin has joint weights of sum 0",
    );
}
