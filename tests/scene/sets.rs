//! Which surfaces exchange light, and the repair of their winding.

use crate::build::{Numbers, metres, same_triangles, volume};
use crate::scenes::{Eye, Mesh, gltf, matter, scene};
use glam::DVec3;
use serde_json::{Value, json};
use translucent::{Scene, Settings, prepare::prepare, scene::LoadOptions};

const EYE: Eye = Eye { eye: DVec3::new(0.0, 0.0, 9.0), at: DVec3::ZERO, lens: 0.5 };

fn wax() -> Value {
    matter([2.0; 3], [0.1; 3], 1.4)
}

fn file(meshes: &[Mesh], materials: &[Value]) -> Value {
    let meshes: Vec<_> =
        meshes.iter().enumerate().map(|(i, mesh)| (mesh.clone(), i.min(materials.len() - 1))).collect();
    gltf(&meshes, materials, &[], &EYE)
}

fn load(meshes: &[Mesh]) -> Scene {
    scene(&file(meshes, &[wax()]))
}

fn names(scene: &Scene) -> Vec<&str> {
    scene.sets.iter().map(|set| set.name.as_str()).collect()
}

fn cuboid(low: DVec3, high: DVec3) -> Mesh {
    let mut mesh = Mesh::default();
    mesh.cuboid(low, high, 2);
    mesh
}

/// The triangles of a mesh whose numbers are in `range`.
fn part(mesh: &Mesh, range: std::ops::Range<usize>) -> Mesh {
    Mesh { indices: mesh.indices[3 * range.start..3 * range.end].to_vec(), ..mesh.clone() }
}

fn moved(mesh: &Mesh, by: DVec3) -> Mesh {
    Mesh { positions: mesh.positions.iter().map(|position| position + by).collect(), ..mesh.clone() }
}

fn joined(a: &Mesh, b: &Mesh) -> Mesh {
    let mut sum = a.clone();
    sum.indices.extend(b.indices.iter().map(|index| index + a.positions.len() as u32));
    sum.positions.extend(&b.positions);
    sum.normals.extend(&b.normals);
    sum
}

/// Turns the triangles that `which` chooses.
fn turned(mesh: &Mesh, which: impl Fn(usize) -> bool) -> Mesh {
    let mut mesh = mesh.clone();
    mesh.indices.chunks_exact_mut(3).enumerate().filter(|(i, _)| which(*i)).for_each(|(_, corners)| corners.swap(1, 2));
    mesh
}

fn turned_warning(count: usize) -> String {
    format!("translucent triangles wound against their neighbours, or inside out, were turned: {count}")
}

#[test]
fn an_object_cut_along_seams_is_one_set() {
    let sphere = Mesh::sphere(1.0, 6);
    let count = sphere.indices.len() / 3;
    let cuts = [0, 50, 171, count];
    let mut parts: Vec<Mesh> = cuts.windows(2).map(|cut| part(&sphere, cut[0]..cut[1])).collect();
    let together = load(&parts);
    assert_eq!(names(&together), ["object 0 and 2 more, matter"]);
    assert_eq!((together.sets[0].open_edges, together.sets[0].crowded_edges), (0, 0));
    assert_eq!(together.warnings, Vec::<String>::new());

    // Under a node of its own, its vertices are rounded elsewhere.
    let by = DVec3::new(0.3, -0.7, 0.11);
    parts[1] = moved(&parts[1], -by);
    let mut json = file(&parts, &[wax()]);
    json["nodes"][1]["translation"] = json!(by.to_array());
    let apart = scene(&json);
    assert_ne!(metres(&apart), metres(&together));
    assert_eq!((names(&apart).len(), apart.sets[0].open_edges), (1, 0));

    // One of another material, and one that is too far: two borders a set.
    let border = |scene: &Scene| scene.sets.iter().map(|set| set.open_edges).sum::<u64>();
    parts[1] = moved(&parts[1], by);
    assert_eq!(names(&scene(&file(&parts, &[wax(), json!({"name": "paint"})]))).len(), 3);
    parts[1] = moved(&parts[1], DVec3::X * 1e-4);
    let far = load(&parts);
    assert_eq!(names(&far).len(), 2, "{:?}", names(&far));
    assert!(border(&far) > 20);
}

#[test]
fn closed_objects_stay_apart_even_where_they_touch() {
    let left = cuboid(DVec3::splat(-1.0), DVec3::new(0.0, 1.0, 1.0));
    let right = cuboid(DVec3::new(0.0, -1.0, -1.0), DVec3::splat(1.0));
    let touching = load(&[left.clone(), right.clone()]);
    assert_eq!(names(&touching), ["object 0, matter", "object 1, matter"]);
    // Without the wall between them, they are two halves of one.
    let open = |mesh: &Mesh| {
        let at_wall = |corners: &[u32]| corners.iter().all(|&corner| mesh.positions[corner as usize].x == 0.0);
        let kept = mesh.indices.chunks_exact(3).filter(|corners| !at_wall(corners)).flatten().copied().collect();
        Mesh { indices: kept, ..mesh.clone() }
    };
    let halves = load(&[open(&left), open(&right)]);
    assert_eq!((names(&halves).len(), halves.sets[0].open_edges), (1, 0));
    let half = load(&[open(&left), right]);
    assert_eq!((names(&half).len(), half.sets[0].open_edges, half.sets[1].open_edges), (2, 8, 0));
}

#[test]
fn names_join_materials_and_nodes() {
    let spheres = [0.0, 3.0, 6.0].map(|x| moved(&Mesh::sphere(1.0, 2), DVec3::X * x));
    let named = |name: &str, set: &str| {
        let mut material = wax();
        material["name"] = json!(name);
        material["extras"]["bssrdf"]["set"] = json!(set);
        material
    };
    let materials = [named("skin", "face"), named("lips", "face"), named("wood", "table")];
    let scene = scene(&file(&spheres, &materials));
    assert_eq!(names(&scene), ["face", "table"]);
    assert_eq!((&scene.sets[0].materials, &scene.sets[1].materials), (&vec![0, 1], &vec![2]));
    for (triangle, shading) in scene.triangles.iter().zip(&scene.shadings) {
        assert_eq!(triangle.set, u32::from(shading.material == 2));
    }
    // A node says more than its material.
    let mut json = file(&spheres, &materials);
    json["nodes"][1]["extras"] = json!({"bssrdf": {"set": "other"}, "anything": 3});
    assert_eq!(names(&crate::scenes::scene(&json)), ["face", "other", "table"]);
    json["nodes"][2]["extras"] = json!({"bssrdf": {"set": "other"}});
    assert_eq!(names(&crate::scenes::scene(&json)), ["face", "other"]);
    // The matter may come from elsewhere.
    json["materials"][0]["extras"]["bssrdf"] = json!({"set": "face"});
    let options = LoadOptions { materials: vec![("skin".into(), "skin1".into())], ..LoadOptions::default() };
    let overridden = Scene::from_bytes("test.gltf", json.to_string().as_bytes(), &options).expect("a valid file");
    assert_eq!((names(&overridden), overridden.materials[0].ior), (vec!["face", "other"], 1.3));
}

#[test]
fn names_that_cannot_be() {
    let sphere = Mesh::sphere(1.0, 1);
    let refused = |edit: &dyn Fn(&mut Value)| {
        let mut json = file(&[sphere.clone(), moved(&sphere, DVec3::X)], &[wax(), wax()]);
        edit(&mut json);
        Scene::from_bytes("test.gltf", json.to_string().as_bytes(), &LoadOptions::default())
            .map(|_| ())
            .expect_err("a broken rule")
            .to_string()
    };
    let set = |json: &mut Value, index: usize, set: Value| json["materials"][index]["extras"]["bssrdf"]["set"] = set;
    let two = refused(&|json| {
        set(json, 0, json!("one"));
        set(json, 1, json!("one"));
        json["materials"][1]["extras"]["bssrdf"]["ior"] = json!(1.2);
    });
    assert!(two.contains("test.gltf: set `one`: holds the indices of refraction 1.4") && two.contains("1.2"), "{two}");
    let empty = refused(&|json| set(json, 0, json!("")));
    assert!(empty.contains("materials[0] (matter).extras.bssrdf.set: must name a set"), "{empty}");
    let number = refused(&|json| set(json, 0, json!(3)));
    assert!(number.contains("extras.bssrdf.set: must be a string"), "{number}");
    let unknown = refused(&|json| json["nodes"][0]["extras"] = json!({"bssrdf": {"preset": "skin1"}}));
    assert!(unknown.contains("nodes[0] (object 0).extras.bssrdf: has an unknown member `preset`"), "{unknown}");
}

#[test]
fn winding_is_repaired() {
    let sphere = Mesh::sphere(1.0, 5);
    let count = sphere.indices.len() / 3;
    let right = load(std::slice::from_ref(&sphere));
    let mut numbers = Numbers(3);
    let random: Vec<bool> = (0..count).map(|_| numbers.below(3) == 0).collect();
    let some = random.iter().filter(|turned| **turned).count();
    type Which<'a> = &'a dyn Fn(usize) -> bool;
    let cases: [(&str, Which, usize); 4] = [
        ("a third", &|i| random[i], some),
        ("two thirds", &|i| !random[i], count - some),
        ("all", &|_| true, count),
        ("one", &|i| i == 7, 1),
    ];
    for (name, which, turns) in cases {
        let repaired = load(&[turned(&sphere, which)]);
        assert_eq!((&repaired.hash, &repaired.nodes), (&right.hash, &right.nodes), "{name}");
        assert_eq!(repaired.warnings, [turned_warning(turns)], "{name}");
    }
    // On a sheet, which has no volume, the more count; parts that are cut along a seam are one surface.
    let mut sheet = Mesh::default();
    (0..6).for_each(|i| sheet.quad(DVec3::X * f64::from(i), DVec3::X, DVec3::Y));
    let wanted = load(std::slice::from_ref(&sheet));
    let repaired = load(&[turned(&sheet, |i| i % 3 == 0)]);
    assert_eq!((wanted.hash, repaired.warnings), (repaired.hash, vec![turned_warning(4)]));
    let halves = load(&[part(&sheet, 0..7), turned(&part(&sheet, 7..12), |_| true)]);
    assert_eq!((halves.sets.len(), &halves.warnings[..]), (1, &[turned_warning(5)][..]));
    assert_eq!(wanted.sets[0].open_edges, 14);
}

#[test]
fn cavities_stay_and_objects_inside_out_are_turned() {
    let outer = Mesh::sphere(1.0, 4);
    let count = outer.indices.len() / 3;
    let inner = Mesh::sphere(0.5, 4);
    let size = |scene: &Scene| volume(&metres(scene));
    let (one, half) = (size(&load(std::slice::from_ref(&outer))), size(&load(std::slice::from_ref(&inner))));
    let near = |volume: f64, wanted: f64| assert!((volume - wanted).abs() < 1e-5, "{volume} is not {wanted}");

    let hollow = load(&[joined(&outer, &turned(&inner, |_| true))]);
    near(size(&hollow), one - half);
    // Its normals are turned, its winding is not.
    assert_eq!((hollow.sets.len(), hollow.warnings.len()), (1, 1));
    assert!(hollow.warnings[0].contains("whose normals point against their winding"), "{:?}", hollow.warnings);
    let beside = load(&[joined(&outer, &moved(&turned(&inner, |_| true), DVec3::X * 3.0))]);
    near(size(&beside), one + half);
    assert_eq!(beside.warnings, [turned_warning(count)]);
    // Nodes are sets of their own: what is around another set's surface says nothing about it.
    let two = load(&[outer, turned(&inner, |_| true)]);
    near(size(&two), one + half);
}

#[test]
fn bad_meshes_are_told() {
    // Three faces at one edge.
    let mut book = Mesh::default();
    for page in [DVec3::X, DVec3::Z, DVec3::new(-1.0, 0.0, 0.5)] {
        book.quad(DVec3::ZERO, DVec3::Y, page);
    }
    let book = load(&[book]);
    assert_eq!((book.sets[0].crowded_edges, book.sets[0].open_edges), (1, 9));
    assert_eq!(book.warnings, Vec::<String>::new());

    // Every triangle twice: once is enough. Its back is another surface.
    let sphere = Mesh::sphere(1.0, 3);
    let count = sphere.indices.len() / 3;
    let single = load(std::slice::from_ref(&sphere));
    let double = load(&[joined(&sphere, &sphere)]);
    assert!(same_triangles(&metres(&double), &metres(&single), 0.0));
    assert_eq!(double.warnings, [format!("translucent triangles that lie twice in a set were dropped: {count}")]);
    let sides = load(&[joined(&sphere, &turned(&sphere, |_| true))]);
    assert_eq!((sides.triangles.len(), sides.sets[0].crowded_edges), (2 * count, 3 * count as u64 / 2));
    assert_eq!((volume(&metres(&sides)), sides.warnings.len()), (0.0, 1), "{:?}", sides.warnings);

    // A strip with half a turn has one side.
    let mut strip = Mesh::default();
    let at = |i: u32, side: f64| {
        let turn = f64::from(i) / 12.0 * std::f64::consts::PI;
        let along = DVec3::new((2.0 * turn).cos(), 0.0, (2.0 * turn).sin());
        along * (1.0 + 0.3 * side * turn.cos()) + DVec3::Y * (0.3 * side * turn.sin())
    };
    for i in 0..12 {
        // The last pair of corners is the first, turned.
        let (c, d) = if i < 11 { (at(i + 1, 1.0), at(i + 1, -1.0)) } else { (at(0, -1.0), at(0, 1.0)) };
        let first = strip.positions.len() as u32;
        strip.positions.extend([at(i, -1.0), at(i, 1.0), c, d]);
        strip.normals.extend([DVec3::Y; 4]);
        strip.indices.extend([0, 1, 2, 0, 2, 3].map(|corner| first + corner));
    }
    let strip = load(&[strip]);
    let told = "translucent triangles on surfaces with only one side, where no winding says where the matter is: 24";
    assert!(strip.warnings.contains(&told.to_string()), "{:?}", strip.warnings);
    assert_eq!(strip.sets[0].open_edges, 24);
}

#[test]
fn a_set_has_a_limited_number_of_media() {
    let sphere = Mesh::sphere(1.0, 6);
    let media = |count: usize, distinct: usize| {
        let material = |i: usize| {
            let mut material = matter([2.0 + (i % distinct) as f64; 3], [0.1; 3], 1.4);
            material["extras"]["bssrdf"]["set"] = json!("body");
            material
        };
        let parts: Vec<Mesh> = (0..count).map(|i| part(&sphere, 8 * i..8 * i + 8)).collect();
        scene(&file(&parts, &(0..count).map(material).collect::<Vec<_>>()))
    };
    let settings = Settings { resolution: Some((4, 4)), ..Settings::default() };
    for (count, distinct) in [(8, 8), (12, 3)] {
        let prepared = prepare(&media(count, distinct), &settings).expect("not too many");
        assert_eq!((prepared.mixtures.len(), prepared.mixtures[0].count as usize), (1, distinct));
    }
    let error = prepare(&media(9, 9), &settings).expect_err("one too many").to_string();
    assert!(error.contains("set `body`") && error.contains("holds 9 media"), "{error}");
    // One material needs none.
    assert!(prepare(&load(&[sphere]), &settings).expect("valid").mixtures.is_empty());
}
