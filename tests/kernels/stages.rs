//! Every stage of the pipeline on real scenes.

use crate::{bench, check, scenes::standard};
use glam::{DVec3, Vec3};
use std::sync::OnceLock;
use translucent::{
    Model, Projection, Result, Scene, Settings, SingleScattering,
    scene::{Environment, EnvironmentMap, LightKind},
    settings::{Directional, Reproject},
    verify::{
        Case, Context, Verdict,
        stages::{self, SAMPLES, Staged},
    },
};

/// The full image, and the part of it that is tested: what the animal fills.
const FULL: (u32, u32) = (92, 92);
const CROP: [u32; 4] = [26, 16, 66, 56];

fn case(name: String, scene: Scene, settings: &Settings) -> Case {
    Case::new(name, scene, settings).expect("the settings fit the scene")
}

/// The shipped scene under each kind of light, with each projection. Its lamps stand near the camera: where light grazes,
/// the cosine has no more digits than the normals that both sides read.
fn cases() -> Vec<Case> {
    let mut demo =
        Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/demo.gltf")).expect("the shipped scene loads");
    let places = [DVec3::new(-0.15, 0.3, -0.3), DVec3::new(0.1, 0.25, -0.35)];
    for (light, place) in demo.lights.iter_mut().zip(places) {
        light.position = place;
        light.direction = (DVec3::new(0.0, 0.05, 0.0) - place).normalize();
        if let LightKind::Spot { inner, outer } = &mut light.kind {
            (*inner, *outer) = (0.3, 0.6);
        }
    }
    for medium in demo.materials.iter_mut().filter_map(|material| material.medium.as_mut()) {
        medium.g = DVec3::new(0.0, 0.7, -0.8);
    }
    let constant = Environment::constant(DVec3::new(0.5, 0.7, 1.0)).expect("valid");
    let texel = |i: u32| Vec3::new(0.1 + (i % 7) as f32, 0.2 + (i % 5) as f32, 0.3 + (i % 11) as f32);
    let image = Environment {
        map: EnvironmentMap::Image { width: 16, height: 8, radiance: (0..128).map(texel).collect() },
        rotation: 40.0,
        scale: 0.3,
    };
    // The animal and what it stands on shine; the animal is rough.
    let mut shining = demo.clone();
    for (index, material) in shining.materials.iter_mut().enumerate() {
        material.emission = DVec3::new(0.3, 0.2, 0.1) * (1 + 3 * index) as f64;
        material.two_sided = index == 0;
        material.roughness = 0.6;
    }
    let mut cases = vec![];
    for environment in [None, Some(&image)] {
        let mut scene = shining.clone();
        scene.lights.truncate(1);
        if let Some(environment) = environment {
            scene.set_environment(environment.clone()).expect("the environment is valid");
        }
        let settings = Settings {
            resolution: Some(FULL),
            crop: Some(CROP),
            seed: 3,
            single_scattering: SingleScattering::On,
            ..standard()
        };
        cases.push(case(format!("emitters, {}", scene.lights.len()), scene, &settings));
    }
    for projection in [Projection::Mis, Projection::Normal, Projection::Camera] {
        for (name, environment) in [("delta", None), ("constant", Some(&constant)), ("image", Some(&image))] {
            let mut scene = demo.clone();
            if let Some(environment) = environment {
                scene.set_environment(environment.clone()).expect("the environment is valid");
                scene.lights.truncate(1);
            }
            let settings = Settings {
                resolution: Some(FULL),
                crop: Some(CROP),
                projection,
                directions: 2,
                seed: 3,
                show_environment: true,
                single_scattering: SingleScattering::On,
                ..standard()
            };
            cases.push(case(format!("{projection:?}, {name}"), scene, &settings));
        }
    }
    // The other models, each under one light.
    let others = [
        (Model::Better, Projection::Mis, None),
        (Model::Burley, Projection::Camera, Some(&constant)),
        (Model::Directional, Projection::Mis, None),
        (Model::Directional, Projection::Camera, Some(&constant)),
        (Model::Lambert, Projection::Mis, None),
        (Model::Lambert, Projection::Camera, Some(&constant)),
    ];
    for (model, projection, environment) in others {
        let mut scene = demo.clone();
        if let Some(environment) = environment {
            scene.set_environment(environment.clone()).expect("the environment is valid");
            scene.lights.truncate(1);
        }
        let directional = Some(Directional { reciprocal: projection == Projection::Mis, ..Directional::default() });
        let settings = Settings {
            resolution: Some(FULL),
            crop: Some(CROP),
            projection,
            seed: 4,
            model,
            directional,
            ..Settings::default()
        };
        cases.push(case(format!("{model}, {projection:?}"), scene, &settings));
    }
    for projection in [Projection::Mis, Projection::Camera] {
        let settings = Settings {
            resolution: Some(FULL),
            crop: Some(CROP),
            projection,
            reproject: Reproject::Screen,
            seed: 7,
            ..standard()
        };
        cases.push(case(format!("{projection:?}, screen"), demo.clone(), &settings));
    }
    for projection in [Projection::Mis, Projection::Normal, Projection::Camera] {
        let single_scattering = SingleScattering::On;
        let (resolution, crop) = (Some(FULL), Some(CROP));
        let settings = Settings { resolution, crop, projection, seed: 6, single_scattering, ..Settings::default() };
        cases.push(case(format!("{projection:?}, three media"), mixed(&demo), &settings));
    }
    cases
}

/// The animal of three media in one set, under three models, of which one is rough.
fn mixed(demo: &Scene) -> Scene {
    let mut scene = demo.clone();
    let translucent = |material: &usize| demo.materials[*material].medium.is_some();
    let animal = demo.sets.iter().position(|set| set.materials.iter().all(translucent)).expect("a translucent set");
    let mut materials = vec![demo.sets[animal].materials[0]];
    for (model, factor, roughness) in [(Model::Burley, 4.0, 0.0), (Model::Directional, 0.5, 0.7)] {
        let mut material = demo.materials[materials[0]].clone();
        let medium = material.medium.as_mut().expect("it is translucent");
        medium.model = Some(model);
        medium.sigma_s_prime *= factor;
        medium.sigma_a /= factor;
        material.roughness = roughness;
        materials.push(scene.materials.len());
        scene.materials.push(material);
    }
    let of_animal = scene.triangles.iter().zip(&mut scene.shadings).filter(|(t, _)| t.set as usize == animal);
    for (index, (_, shading)) in of_animal.enumerate() {
        shading.material = materials[index % 3] as u32;
    }
    scene.sets[animal].materials = materials;
    scene
}

/// The cases with their twins, computed once for all tests: the twins search every triangle.
fn staged() -> &'static [Staged] {
    static CASES: OnceLock<Vec<Staged>> = OnceLock::new();
    let compute = || cases().into_iter().enumerate().map(|(i, case)| Staged::new(case, SAMPLES[i % 2])).collect();
    CASES.get_or_init(compute)
}

fn assert_passes(kernel: &str, staged: &[Staged], stage: fn(&mut Context, &[Staged]) -> Result<Verdict>) {
    let mut bench = bench();
    let verdict = stage(&mut Context::new(&mut bench), staged).expect("the device runs it");
    check(&bench);
    println!("{kernel}: {verdict}");
    assert!(verdict.passed() && verdict.values > 3000, "{kernel}: {verdict}");
}

#[test]
fn primary_finds_the_twins_surface() {
    assert_passes("primary", staged(), stages::primary);
}

#[test]
fn sample_draws_the_twins_probe() {
    assert_passes("sample", staged(), stages::sample);
}

#[test]
fn reproject_finds_the_twins_hits() {
    assert_passes("reproject", staged(), stages::reproject);
}

#[test]
fn accumulate_adds_the_twins_radiance() {
    assert_passes("accumulate", staged(), stages::accumulate);
}

/// The shipped scene where what is not translucent shines. (Light of the matter's own surface comes from so near that the
/// rounding of positions shows.)
fn lit_from_below() -> Staged {
    let mut scene =
        Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/demo.gltf")).expect("the shipped scene loads");
    scene.lights.truncate(1);
    for material in &mut scene.materials {
        match &mut material.medium {
            Some(medium) => medium.g = DVec3::new(0.0, 0.7, -0.8),
            None => material.emission = DVec3::new(0.3, 0.2, 0.1),
        }
    }
    let settings = Settings {
        resolution: Some(FULL),
        crop: Some(CROP),
        seed: 5,
        single_scattering: SingleScattering::On,
        ..standard()
    };
    let case = case("lit from below".into(), scene, &settings);
    assert!(case.inputs().features.emitters != 0 && case.prepared.has_single);
    Staged::new(case, SAMPLES[1])
}

#[test]
fn single_adds_the_twins_radiance() {
    assert_passes("single", staged(), stages::single);
    assert_passes("single", &[lit_from_below()], stages::single);
}

#[test]
fn reflect_adds_the_twins_radiance() {
    assert_passes("reflect", staged(), stages::reflect);
}
