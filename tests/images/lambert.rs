//! The opaque limit: against closed forms and the twins, beside other models, and where `auto` picks it.

use crate::{
    channel, mean_and_error, render,
    scenes::{Eye, Mesh, gltf, matter, scene, standard, sun},
    twins::{both, differences, opaque, table},
};
use glam::DVec3;
use serde_json::Value;
use translucent::{
    Model, Scene, Settings,
    prepare::prepare,
    reference::{
        boundary::transmittance,
        profile::{Coefficients, Profile},
    },
    scene::Environment,
    shared::{MODEL_LAMBERT, MODEL_TABLE},
    table::{self as tables, white::mean_obliqueness},
};

fn uniform(mut scene: Scene) -> Scene {
    scene.set_environment(Environment::constant(DVec3::ONE).expect("valid")).expect("valid");
    scene
}

/// The material with a model of its own.
fn modelled(mut material: Value, model: &str) -> Value {
    material["extras"]["bssrdf"]["model"] = model.into();
    material
}

/// Matter with a mean free path of .1 um, of whose total diffusion is not sure.
fn dense() -> Value {
    matter([6e6, 7e6, 8e6], [4e6, 3e6, 2e6], 1.3)
}

fn settings(side: u32) -> Settings {
    Settings { resolution: Some((side, side)), seed: 8, reuse: Some(1), ..Settings::default() }
}

#[test]
fn mixed_scenes_are_the_twins() {
    // Four balls on a table: the limit as asked for and as found, and two models that look for surfaces.
    let mut materials = vec![
        modelled(matter([8.0, 4.0, 2.0], [0.3, 0.2, 0.1], 1.4), "lambert"),
        dense(),
        modelled(matter([8.0, 4.0, 2.0], [0.3, 0.2, 0.1], 1.4), "standard"),
        modelled(matter([8.0, 4.0, 2.0], [0.3, 0.2, 0.1], 1.4), "burley"),
        opaque(),
    ];
    materials[1]["pbrMetallicRoughness"] = serde_json::json!({"roughnessFactor": 0.5});
    materials[1]["extras"]["bssrdf"]["surface"] = "rough".into();
    let ball = |i: usize| {
        let mut mesh = Mesh::sphere(0.45, 6);
        let place = DVec3::new([-0.5, 0.5][i % 2], -0.55, [-0.5, 0.5][i / 2]);
        mesh.positions.iter_mut().for_each(|p| *p += place);
        (mesh, i)
    };
    let meshes: Vec<_> = (0..4).map(ball).chain([(table(), 4)]).collect();
    let eye = Eye { eye: DVec3::new(0.5, 2.0, 2.5), at: DVec3::new(0.0, -0.5, 0.0), lens: 0.6 };
    let scene = uniform(scene(&gltf(&meshes, &materials, &[(sun(), DVec3::new(3.0, 4.0, 2.0), DVec3::ZERO)], &eye)));
    let settings = Settings { directions: 2, ..settings(24) };
    let prepared = prepare(&scene, &settings).expect("valid");
    let limits: Vec<_> = prepared.advice.iter().flatten().map(|a| (a.choice.model, a.choice.limit_of)).collect();
    let expected = [(Model::Lambert, Model::Standard), (Model::Lambert, Model::Table)];
    assert_eq!(limits[..2], expected);
    assert!(prepared.materials[1].slope != glam::Vec3::ZERO);
    let (image, twins) = both(&scene, &settings, 8);
    let mut all = differences(&image, &twins);
    all.sort_by(f64::total_cmp);
    let outside = all.iter().filter(|d| **d > 1e-5).count();
    assert!(all.len() > 500 && outside * 100 <= all.len(), "{outside} of {}: {:?}", all.len(), &all[all.len() - 5..]);
}

#[test]
fn white_furnace_closes() {
    for ior in [1.0, 1.3, 1.5] {
        let mut mesh = Mesh::default();
        mesh.cuboid(DVec3::NEG_ONE, DVec3::new(1.0, 1.0, 0.0), 1);
        let eye = Eye { eye: DVec3::new(0.0, -5.0, 5.0), at: DVec3::ZERO, lens: 0.02 };
        let scene = uniform(scene(&gltf(&[(mesh, 0)], &[matter([1.0; 3], [0.0; 3], ior)], &[], &eye)));
        let image = render(&scene, &Settings { model: Model::Lambert, directions: 4, ..settings(4) }, 512);
        for name in ["R", "G", "B"] {
            let values: Vec<f64> = channel(&image, name).iter().map(|x| f64::from(*x)).collect();
            let (mean, error) = mean_and_error(&values);
            assert!((mean - 1.0).abs() < 4.0 * error + 1e-5, "n = {ior}: {mean} +- {error}");
            assert!(error < 5e-4, "n = {ior}: no force at +- {error}");
        }
    }
}

#[test]
fn the_limit_of_a_table_has_its_total_and_its_slope() {
    // Seen obliquely under uniform light: Lo = Ft(wo) T (1 + k (1 - mu')).
    let ior = 1.3;
    let mut mesh = Mesh::default();
    mesh.cuboid(DVec3::NEG_ONE, DVec3::new(1.0, 1.0, 0.0), 1);
    for tilt in [0.0, 1.2f64] {
        let eye = Eye { eye: DVec3::new(0.0, -5.0 * tilt.sin(), 5.0 * tilt.cos()), at: DVec3::ZERO, lens: 0.02 };
        let scene = uniform(scene(&gltf(&[(mesh.clone(), 0)], &[dense()], &[], &eye)));
        let settings = Settings { directions: 4, ..settings(4) };
        let advice = prepare(&scene, &settings).expect("valid").advice;
        assert_eq!(advice[0].as_ref().map(|a| a.choice.limit_of), Some(Model::Table));
        let image = render(&scene, &settings, 512);
        for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
            let medium = scene.materials[0].medium.as_ref().expect("matter");
            let matter = Coefficients::of(medium, ior, c);
            let profile = tables::channel(&matter).expect("it scatters").profile(f64::INFINITY);
            let total = Profile::new(MODEL_TABLE, &matter).total();
            let inside = (1.0 - (tilt.sin() / ior).powi(2)).sqrt();
            let expected = transmittance(ior, tilt.cos()) * total * (1.0 + profile.slope() * (1.0 - inside));
            assert!((profile.slope() * mean_obliqueness(ior)).abs() > 1e-3, "no force");
            let values: Vec<f64> =
                channel(&image, &format!("subsurface.{name}")).iter().map(|x| f64::from(*x)).collect();
            let (mean, error) = mean_and_error(&values);
            assert!((mean - expected).abs() < 4.0 * error + 1e-5, "{tilt}, {name}: {mean} +- {error}, not {expected}");
        }
    }
}

#[test]
fn auto_finds_it_by_the_width_of_pixels_and_the_thickness_of_walls() {
    // Light travels some 3 mm in matter like marble.
    let marble = || matter([2620.0; 3], [4.1; 3], 1.5);
    let chosen = |mesh: Mesh, distance: f64| {
        let eye = Eye { eye: DVec3::new(0.0, 0.0, distance), at: DVec3::ZERO, lens: 0.6 };
        let prepared = prepare(&scene(&gltf(&[(mesh, 0)], &[marble()], &[], &eye)), &settings(64)).expect("valid");
        let lambert = prepared.features.models == 1 << MODEL_LAMBERT;
        assert_eq!((prepared.has_translucent, prepared.has_probes), (true, !lambert));
        prepared.advice[0].as_ref().expect("translucent").choice.model
    };
    // Pixels of 2 mm, 2 cm and half a metre.
    assert_eq!(chosen(Mesh::sphere(0.1, 4), 0.3), Model::Table);
    assert_eq!(chosen(Mesh::sphere(1.0, 4), 3.0), Model::Better);
    assert_eq!(chosen(Mesh::sphere(20.0, 4), 80.0), Model::Lambert);
    let plate = |thickness: f64| {
        let mut mesh = Mesh::default();
        mesh.cuboid(DVec3::new(-20.0, -20.0, -thickness), DVec3::new(20.0, 20.0, 0.0), 2);
        mesh
    };
    assert_eq!(chosen(plate(10.0), 80.0), Model::Lambert);
    // A wall through which light comes.
    assert_ne!(chosen(plate(0.1), 80.0), Model::Lambert);
    // As the settings ask.
    let eye = Eye { eye: DVec3::new(0.0, 0.0, 80.0), at: DVec3::ZERO, lens: 0.6 };
    let far = scene(&gltf(&[(Mesh::sphere(20.0, 4), 0)], &[marble()], &[], &eye));
    assert_eq!(prepare(&far, &standard()).expect("valid").features.models, 1);
}
