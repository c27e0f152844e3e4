//! Light that is gathered from a cloud of points: against a closed form, and against what is sampled.

use crate::{
    channel, device, render,
    scenes::{Eye, Mesh, gltf, matter, scene, sun},
};
use glam::DVec3;
use serde_json::json;
use translucent::{
    Model, Renderer, Scene, Settings,
    settings::{Cloud, Integrator},
    shared::Slot,
};

fn settings(points: u32, opening: f64) -> Settings {
    let cloud = Cloud { points, opening, ..Cloud::default() };
    Settings {
        resolution: Some((20, 20)),
        model: Model::Standard,
        seed: 2,
        integrator: Integrator::Cloud,
        cloud,
        reuse: Some(1),
        ..Settings::default()
    }
}

#[test]
fn an_evenly_lit_plane_has_the_golden_radiance() {
    // As in `closed_forms`; what lies beyond 25 mean free paths is 1e-4 of the light.
    let mut mesh = Mesh::default();
    mesh.cuboid(DVec3::new(-25.0, -25.0, -25.0), DVec3::new(25.0, 25.0, 0.0), 1);
    let light = (sun(), DVec3::Z * 100.0, DVec3::ZERO);
    let eye = Eye { eye: DVec3::Z * 10.0, at: DVec3::ZERO, lens: 0.3 };
    let scene = scene(&gltf(&[(mesh, 0)], &[matter([0.95; 3], [0.05; 3], 1.3)], &[light], &eye));
    let spaced = |points, opening, spacing| {
        let cloud = Cloud { points, opening, spacing, ..Cloud::default() };
        let image = render(&scene, &Settings { cloud, ..settings(1, 0.0) }, 8);
        let squares = channel(&image, "subsurface.G").iter().map(|x| (f64::from(*x) / 0.418_550_831 - 1.0).powi(2));
        (squares.sum::<f64>() / 400.0).sqrt()
    };
    let error = |points, opening| spaced(points, opening, 0.5);
    // As the settings state it: of single points less than 1 % at spacings from two mean free paths to half of one, and of
    // groups by the default opening less than 2 %.
    let errors = [error(2000, 0.0), error(8000, 0.0), error(32000, 0.0), error(32000, 0.7)];
    println!("rms errors: {errors:?}");
    assert!(errors[..3].iter().all(|error| *error < 0.01) && errors[3] < 0.02, "{errors:?}");
    // No more points than the spacing asks for.
    let coarse = spaced(32000, 0.0, 2.0);
    assert!(coarse > errors[2], "{coarse}, not more than {}", errors[2]);
}

/// Two bodies that nearly touch, of different matter, one of them rough, under a lamp, the sun and a sky.
fn pair() -> Scene {
    let mut cube = Mesh::default();
    cube.cuboid(DVec3::new(-2.05, -1.0, -1.0), DVec3::new(-0.05, 1.0, 1.0), 1);
    let mut ball = Mesh::sphere(1.0, 8);
    ball.positions.iter_mut().for_each(|p| p.x += 1.0);
    let lamp = json!({"type": "point", "intensity": 5.0});
    let lights = [(lamp, DVec3::new(0.0, 2.0, 2.5), DVec3::ZERO), (sun(), DVec3::new(3.0, 4.0, 2.0), DVec3::ZERO)];
    let mut rough = matter([9.0, 6.0, 4.0], [0.5, 0.3, 0.1], 1.3);
    rough["extras"]["bssrdf"].as_object_mut().expect("matter").remove("surface");
    rough["pbrMetallicRoughness"] = json!({"roughnessFactor": 0.5});
    let materials = [matter([4.0, 5.0, 6.0], [0.1, 0.2, 0.4], 1.4), rough];
    let eye = Eye { eye: DVec3::new(1.0, 2.0, 8.0), at: DVec3::ZERO, lens: 0.45 };
    let mut scene = scene(&gltf(&[(cube, 0), (ball, 1)], &materials, &lights, &eye));
    let sky = translucent::scene::Environment::constant(DVec3::new(0.2, 0.3, 0.4)).expect("valid");
    scene.set_environment(sky).expect("valid");
    scene
}

#[test]
fn the_error_falls_with_spacing_and_opening() {
    for model in [Model::Standard, Model::Table] {
        let scene = pair();
        let sampled = Settings { integrator: Integrator::Sample, model, ..settings(1, 0.0) };
        let truth = render(&scene, &sampled, 1024);
        // Standard error of the mean over all pixels, which are independent.
        let pixels = truth.channel("A").expect("contract").len() as f64;
        let total = |values: &[f32]| values.iter().map(|x| f64::from(*x)).sum::<f64>() / pixels;
        let errors: Vec<(f64, f64)> = [(500, 1.0, 0.5), (4000, 0.5, 0.5), (16000, 0.1, 0.5), (64000, 0.1, 0.25)]
            .into_iter()
            .map(|(points, opening, spacing)| {
                let cloud = Cloud { points, opening, spacing, ..Cloud::default() };
                let image = render(&scene, &Settings { model, cloud, ..settings(1, 0.0) }, 48);
                let of = |name: &str| {
                    let (found, truth) = (channel(&image, name), channel(&truth, name));
                    let squares = found.iter().zip(truth).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
                    ((squares / pixels).sqrt() / total(truth), total(found) / total(truth) - 1.0)
                };
                let all = ["R", "G", "B"].map(|c| of(&format!("subsurface.{c}")));
                (all.iter().map(|x| x.0).fold(0.0, f64::max), all.iter().map(|x| x.1.abs()).fold(0.0, f64::max))
            })
            .collect();
        println!("{model}: rms over the mean, and error of the mean: {errors:?}");
        let noise = total(channel(&truth, "variance.R")).sqrt() / total(channel(&truth, "subsurface.R"));
        assert!(errors[2].0 < 0.02 + 2.0 * noise && errors[2].1 < 0.01, "{model}: {errors:?}, noise {noise}");
        assert!(errors[2].0 < errors[0].0 && errors[2].1 < errors[0].1, "{model}: {errors:?}");
        // As near as the sampled image tells.
        let error = noise / pixels.sqrt();
        assert!(errors[3].0 < errors[0].0 && errors[3].1 < 4.0 * error, "{model}: {errors:?} +- {error}");
    }
}

#[test]
fn new_lights_light_the_cloud_anew() {
    let scene = pair();
    let settings = settings(1000, 0.5);
    let device = device();
    let mut renderer = Renderer::new(&device, &scene, &settings).expect("the renderer is made");
    renderer.render(8).expect("the render finishes");
    let mut other = scene.clone();
    other.lights[0].intensity *= 3.0;
    renderer.set_lights(&other.lights).expect("as many");
    renderer.render(8).expect("the render finishes");
    let mut fresh = Renderer::new(&device, &other, &settings).expect("the renderer is made");
    fresh.render(8).expect("the render finishes");
    let [a, b] = [&mut renderer, &mut fresh].map(|renderer| renderer.image().expect("an image").channels);
    assert!(a == b);
    // Nothing of the other integrator is made.
    for absent in ["sample", "reproject", "accumulate"] {
        assert!(!fresh.kernels().contains(&absent), "{absent}");
    }
    assert!(fresh.buffers().iter().all(|(slot, _)| !matches!(slot, Slot::Probes | Slot::HitLists | Slot::Gathers)));
}

#[test]
fn what_cannot_be_gathered_is_refused_by_name() {
    let scene = pair();
    let device = device();
    let cloud = |points, opening, samples| {
        let cloud = Cloud { points, opening, samples, ..Cloud::default() };
        Settings { cloud, ..settings(9, 0.1) }
    };
    let spaced = |spacing| Settings { cloud: Cloud { spacing, ..Cloud::default() }, ..settings(9, 0.1) };
    let refused = [
        (Settings { model: Model::Directional, ..settings(9, 0.1) }, "directional dipole"),
        (Settings { recording: true, ..settings(9, 0.1) }, "recordings"),
        (cloud(0, 0.1, 1), "cloud points"),
        (cloud(9, 1.5, 1), "cloud opening"),
        (cloud(9, f64::NAN, 1), "cloud opening"),
        (cloud(9, 0.1, 0), "cloud samples"),
        (spaced(0.0), "cloud spacing"),
        (spaced(f64::NAN), "cloud spacing"),
    ];
    for (settings, word) in refused {
        let error = Renderer::new(&device, &scene, &settings).err().expect(word).to_string();
        assert!(error.contains(word), "{error}");
    }
}
