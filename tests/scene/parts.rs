//! Scenes of vertices in memory.

use super::build::spot;
use glam::{DAffine3, DVec2, DVec3, EulerRot};
use translucent::{
    Scene,
    scene::{Appearance, Camera, LengthKind, Lens, Light, LightKind, Material, Medium, Mesh, Picture, Texture, preset},
    shared::{RAMP, TEXTURE_BASE_COLOR, TEXTURE_NORMAL},
};

const CORNERS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
const FACES: [u32; 12] = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3];

fn tetrahedron() -> Mesh<'static> {
    Mesh { name: "tetrahedron", positions: &CORNERS, indices: &FACES, ..Mesh::default() }
}

fn wax() -> Material {
    Material::translucent("wax", Medium::new(DVec3::splat(1000.0), DVec3::ONE), 1.4)
}

#[test]
fn the_vertices_of_a_file_are_its_scene() {
    let (_, binary) = spot();
    let file = Scene::load("assets/spot.glb").expect("the asset");
    let vectors = |bytes: &[u8]| bytemuck::pod_collect_to_vec::<u8, [f32; 3]>(bytes);
    let (positions, normals) = (vectors(&binary[..35160]), vectors(&binary[35160..70320]));
    let indices: Vec<u32> = bytemuck::pod_collect_to_vec(&binary[70320..70320 + 4 * 17568]);
    let mesh =
        Mesh { name: "spot", positions: &positions, normals: Some(&normals), indices: &indices, ..Mesh::default() };
    let scene = Scene::from_meshes(&[mesh], file.materials.clone(), vec![]).expect("a scene");
    assert!(scene.triangles == file.triangles && scene.shadings == file.shadings && scene.nodes == file.nodes);
    assert_eq!((scene.frame, &scene.sets, &scene.hash), (file.frame, &file.sets, &file.hash));
    assert_eq!(scene.warnings, Vec::<String>::new());

    // Inside out, mirrored, and in two parts with a seam: the same repairs and sets.
    let turned: Vec<u32> = indices.chunks_exact(3).flat_map(|t| [t[0], t[2], t[1]]).collect();
    let (left, right) = turned.split_at(indices.len() / 6 * 3);
    let transform = DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0));
    let part = |name, indices| Mesh { name, indices, normals: None, transform, ..mesh };
    let parts = Scene::from_meshes(&[part("a", left), part("b", right)], file.materials.clone(), vec![]);
    let parts = parts.expect("a scene");
    assert_eq!((parts.sets.len(), parts.sets[0].open_edges), (1, 0), "{:?}", parts.sets);
    assert_eq!(parts.warnings.len(), 1, "{:?}", parts.warnings);
    let volume = |scene: &Scene| -> f64 {
        let of = |[corner, edge1, edge2]: [DVec3; 3]| edge1.cross(edge2).dot(corner);
        scene.triangles.iter().map(|triangle| of(triangle.corner_and_edges())).sum()
    };
    assert!((volume(&parts) / volume(&scene) - 1.0).abs() < 1e-5 && volume(&scene) > 0.0);
}

#[test]
fn materials_keep_their_numbers_and_come_without_json() {
    let marble = Material::from_preset("marble").expect("it is in the table");
    let found = preset("marble").expect("it is in the table");
    let medium = marble.medium.as_ref().expect("it scatters");
    assert_eq!((medium.sigma_s_prime, medium.sigma_a), (found.sigma_s_prime * 1e3, found.sigma_a * 1e3));
    assert_eq!((marble.ior, marble.roughness, marble.name.as_str()), (1.5, 0.0, "marble"));
    assert!(Material::from_preset("marbel").expect_err("no such").to_string().contains("close names: marble"));
    let seen = Appearance { albedo: DVec3::splat(0.5), length: DVec3::splat(1e-3), kind: LengthKind::MeanFreePath };
    let soap = Medium::from_appearance(seen, 1.3).expect("albedo and length");
    assert!((soap.sigma_s_prime + soap.sigma_a - 1e3).abs().max_element() < 1e-9, "{soap:?}");
    for (albedo, length, ior) in [(1.5, 1.0, 1.3), (f64::NAN, 1.0, 1.3), (0.5, 0.0, 1.3), (0.5, 1.0, f64::NAN)] {
        let seen = Appearance { albedo: DVec3::splat(albedo), length: DVec3::splat(length), ..seen };
        assert!(Medium::from_appearance(seen, ior).expect_err("no matter").is_input());
    }

    let materials = vec![Material::default(), marble.clone(), wax()];
    let scene = Scene::from_meshes(&[Mesh { material: 2, ..tetrahedron() }], materials.clone(), vec![]).expect("one");
    assert_eq!((&scene.materials, scene.shadings[0].material), (&materials, 2));
    assert_eq!(scene.sets[0].name, "tetrahedron, wax");
    // A hidden one shows nothing.
    let hidden = Material { hidden: true, ..wax() };
    let error = Scene::from_meshes(&[tetrahedron()], vec![hidden], vec![]).expect_err("nothing to see").to_string();
    assert!(error.contains("has no triangles"), "{error}");
}

fn picture(width: u32) -> Picture {
    Picture { width, height: 1, texels: vec![!0; width as usize] }
}

fn textured() -> Material {
    let mut material = Material::default();
    material.textures[TEXTURE_BASE_COLOR as usize] = Some(Texture { picture: 1, set: 1, ..Texture::default() });
    material.textures[TEXTURE_NORMAL as usize] = Some(Texture::default());
    material
}

#[test]
fn textures_have_coordinates_and_tangents() {
    let uvs = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.5]];
    let tangents = [[1.0, 0.0, 0.0, -1.0]; 4];
    let mesh = Mesh { uvs: [Some(&uvs), Some(&uvs)], tangents: Some(&tangents), ..tetrahedron() };
    let scene = Scene::from_meshes(&[mesh], vec![textured()], vec![picture(2), picture(3)]).expect("a scene");
    assert_eq!((scene.coordinates.len(), scene.pictures.len()), (4, 2));
    let first = &scene.coordinates[0];
    assert_eq!((first.handedness, first.tangent[0].x), (-1.0, 1.0));
    let sum: f32 = scene.coordinates.iter().flat_map(|c| c.uv[3..].iter()).map(|uv| uv.element_sum()).sum();
    assert_eq!(sum, 9.0, "three faces show each corner");
    let bare = Scene::from_meshes(&[tetrahedron()], vec![textured()], vec![picture(2), picture(3)]).expect("a scene");
    assert!(bare.warnings.iter().all(|warning| warning.starts_with("meshes[0] (tetrahedron): has no TEXCOORD_")));
    assert_eq!(bare.warnings.len(), 2, "{:?}", bare.warnings);
}

/// Fails unless it is refused with these words.
#[track_caller]
fn refused(meshes: &[Mesh], materials: Vec<Material>, pictures: Vec<Picture>, wanted: &str) {
    let error = Scene::from_meshes(meshes, materials, pictures).expect_err(wanted);
    assert!(error.is_input() && error.to_string().contains(wanted), "{error} for {wanted}");
}

#[test]
fn what_is_no_scene_is_refused_by_name() {
    let mesh = tetrahedron();
    let nan = [[0.0, f32::NAN, 0.0]; 4];
    let (short, huge, flat) = ([[1.0; 3]; 3], [[f32::MAX; 3]; 4], [[0.0; 3]; 4]);
    let uvs = [[f32::INFINITY; 2]; 4];
    let scaled = |scale: f64| DAffine3::from_scale(DVec3::splat(scale));
    for (mesh, wanted) in [
        (
            Mesh { indices: &[0, 1, 4], ..mesh },
            "the caller's meshes: meshes[0] (tetrahedron): index 2 is 4, but there are 4",
        ),
        (Mesh { indices: &FACES[..11], ..mesh }, "11 vertices are no whole number of triangles"),
        (Mesh { positions: &nan, ..mesh }, "the position of vertex 0 is [0.0, NaN, 0.0]"),
        (Mesh { normals: Some(&nan), ..mesh }, "the normal of vertex 0 is"),
        (Mesh { normals: Some(&short), ..mesh }, "has 3 normals for 4 positions"),
        (Mesh { material: 1, ..mesh }, "has material 1 of 1"),
        (Mesh { set: Some(""), ..mesh }, "must name a set"),
        (Mesh { transform: scaled(f64::NAN), ..mesh }, "its transform to the world exceeds"),
        (Mesh { transform: scaled(1e29), positions: &huge, ..mesh }, "places a vertex beyond"),
        (Mesh { transform: scaled(1e-20), ..mesh }, "its radius is"),
        (Mesh { transform: scaled(0.0), ..mesh }, "has no triangles but 4 of zero area"),
        (Mesh { positions: &flat, ..mesh }, "has no triangles but 4 of zero area"),
        (Mesh { positions: &[], indices: &[], ..mesh }, "has no triangles"),
    ] {
        refused(&[mesh], vec![wax()], vec![], wanted);
    }
    refused(&[], vec![], vec![], "has no triangles");
    let water = Material { name: "water".into(), ior: 1.33, ..wax() };
    let joined = [0, 1].map(|material| Mesh { set: Some("glass"), material, ..mesh });
    refused(&joined, vec![wax(), water], vec![], "set `glass`: holds the indices of refraction 1.4");
    let odd = |change: fn(&mut Material)| {
        let mut material = wax();
        change(&mut material);
        vec![material]
    };
    refused(&[mesh], odd(|m| m.ior = 0.0), vec![], "material `wax`: its index of refraction is 0");
    refused(&[mesh], odd(|m| m.roughness = -0.1), vec![], "material `wax`: metallic");
    refused(&[mesh], odd(|m| m.emission.x = f64::INFINITY), vec![], "material `wax`: its emission");
    refused(&[mesh], odd(|m| m.ramp = vec![m.medium.clone().expect("wax"); RAMP as usize]), vec![], "its ramp has");
    refused(&[mesh], odd(|m| m.medium.as_mut().expect("wax").g.y = 1.0), vec![], "material `wax`: g is");
    let two = || vec![picture(1), picture(1)];
    refused(&[mesh], vec![textured()], vec![picture(1)], "material `default`: shows picture 1 of 1");
    refused(&[mesh], vec![textured()], vec![picture(1), Picture { height: 2, ..picture(1) }], "pictures[1]: 1 texels");
    refused(&[mesh], vec![textured()], vec![picture(1), picture(0)], "pictures[1]: 0 texels");
    refused(&[Mesh { uvs: [Some(&uvs); 2], ..mesh }], vec![textured()], two(), "TEXCOORD_0 of vertex 0 is");
    let third = |set: u32| {
        let mut material = textured();
        material.textures[0] = Some(Texture { set, rows: [DVec3::X; 2], ..Texture::default() });
        vec![material]
    };
    refused(&[mesh], third(2), two(), "uses the coordinates 2");
}

#[test]
fn no_input_panics() {
    let mut state = 1u32;
    let mut random = move |below: u32| {
        state = state.wrapping_mul(747796405).wrapping_add(2891336453);
        (state >> 8) % below
    };
    let numbers = [0.0, 1.0, -1.0, 0.5, 1e-30, 1e30, f32::MAX, f32::NAN, f32::INFINITY, 1e-7];
    let mut made = 0;
    for _ in 0..4000 {
        let count = 3 + random(5);
        // Mostly small numbers: others end it soon.
        let mut number = || {
            let all = random(8) == 0;
            numbers[random(if all { 10 } else { 4 }) as usize]
        };
        let [positions, normals] = [(); 2].map(|_| (0..count).map(|_| [(); 3].map(|_| number())).collect::<Vec<_>>());
        let indices: Vec<u32> = (0..3 * random(6)).map(|_| random(count) + u32::from(random(64) == 0)).collect();
        let angle = f64::from(random(7));
        let scale = [1.0, -1.0, 1e3, 1e-3, 0.0, 1e20][random(6) as usize];
        let transform = DAffine3::from_mat3(glam::DMat3::from_euler(EulerRot::XYZ, angle, scale, 0.0) * scale);
        let uvs: Vec<[f32; 2]> =
            normals.iter().map(|n| DVec2::new(n[0].into(), n[1].into()).as_vec2().to_array()).collect();
        let mesh = Mesh {
            positions: &positions,
            normals: (random(2) == 0).then_some(&normals),
            indices: &indices,
            uvs: [Some(&uvs), None],
            material: random(3) as usize,
            transform,
            ..Mesh::default()
        };
        let meshes = [mesh, Mesh { material: random(2) as usize, set: Some("one"), ..mesh }];
        let shown = &meshes[..1 + random(2) as usize];
        made += usize::from(Scene::from_meshes(shown, vec![wax(), textured()], vec![picture(1), picture(2)]).is_ok());
    }
    assert!(made > 100, "{made} of them are scenes");
}

#[test]
fn setters_refuse_what_is_none_and_bring_the_hash_up_to_date() {
    let mut scene = Scene::from_meshes(&[tetrahedron()], vec![wax()], vec![]).expect("a scene");
    let before = scene.clone();
    let lens = Lens::Perspective { yfov: 0.7, aspect: None };
    let camera = Camera::new("mine", DVec3::Z * 3.0, DVec3::NEG_Z, DVec3::Y, lens);
    let light = Light {
        name: "sun".into(),
        position: DVec3::ZERO,
        direction: DVec3::NEG_Z,
        intensity: DVec3::ONE,
        kind: LightKind::Directional,
        range: None,
    };
    let refused = [
        scene.set_cameras(vec![camera.clone(), Camera::new("flat", DVec3::ZERO, DVec3::Y, DVec3::Y, lens)]),
        scene.set_cameras(vec![Camera { eye: DVec3::splat(1e12), ..camera.clone() }]),
        scene.set_lights(vec![light.clone(), Light { direction: DVec3::ZERO, ..light.clone() }]),
        scene.set_lights(vec![Light { intensity: DVec3::splat(f64::NAN), ..light.clone() }]),
        scene.set_material(1, wax()),
        scene.set_material(0, Material::default()),
        scene.set_material(0, Material { set: Some("other".into()), ..wax() }),
        scene.set_material(0, Material { ior: 100.0, ..wax() }),
        scene.set_material(0, Material { textures: textured().textures, ..wax() }),
    ];
    for result in &refused {
        assert!(result.as_ref().is_err_and(|error| error.is_input()), "{refused:?}");
    }
    assert_eq!((&scene.hash, &scene.materials), (&before.hash, &before.materials));
    let mut hashes = vec![scene.hash.clone()];
    scene.set_cameras(vec![camera]).expect("a camera");
    hashes.push(scene.hash.clone());
    scene.set_lights(vec![light]).expect("a light");
    hashes.push(scene.hash.clone());
    scene.set_material(0, Material { roughness: 0.5, ..wax() }).expect("matter");
    hashes.push(scene.hash.clone());
    hashes.dedup();
    assert_eq!(hashes.len(), 4);
}
