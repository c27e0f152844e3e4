//! Renders that end by an error or a time: what they state is what they have.

use crate::{
    channel, device, mean_and_error,
    scenes::{Eye, Mesh, gltf, matter, scene, standard, sun},
};
use glam::DVec3;
use serde_json::json;
use std::{
    ops::ControlFlow,
    time::{Duration, Instant},
};
use translucent::{
    Environment, Error, Goal, Image, Outcome, Renderer, Scene, Settings, Stop,
    settings::{Cloud, Integrator},
};

const SIZE: u32 = 32;
const GOAL: f64 = 0.08;

fn settings() -> Settings {
    Settings { resolution: Some((SIZE, SIZE)), estimate_error: true, reuse: Some(8), ..standard() }
}

fn goal(error: f64) -> Goal {
    Goal { samples: 100_000, error: Some(error), deadline: None }
}

fn asset(name: &str) -> Scene {
    Scene::load(format!("{}/assets/{name}", env!("CARGO_MANIFEST_DIR"))).expect("a shipped scene")
}

/// A slab under a lamp so near that its light falls by a hundred across the image.
fn lamp() -> Scene {
    let mut mesh = Mesh::default();
    mesh.cuboid(DVec3::new(-8.0, -8.0, -8.0), DVec3::new(8.0, 8.0, 0.0), 1);
    let lamp = json!({"type": "point", "intensity": 5.0});
    let eye = Eye { eye: DVec3::Z * 10.0, at: DVec3::ZERO, lens: 0.5 };
    let lights = [(lamp, DVec3::new(1.0, 0.0, 0.7), DVec3::ZERO)];
    scene(&gltf(&[(mesh, 0)], &[matter([4.0, 5.0, 6.0], [0.1, 0.2, 0.4], 1.4)], &lights, &eye))
}

/// A rough ball in the sun, whose highlight has noise of its own under a bright sky.
fn ball() -> Scene {
    let mut rough = matter([9.0, 6.0, 4.0], [0.5, 0.3, 0.1], 1.3);
    rough["extras"]["bssrdf"].as_object_mut().expect("matter").remove("surface");
    rough["pbrMetallicRoughness"] = json!({"roughnessFactor": 0.4});
    let eye = Eye { eye: DVec3::Z * 6.0, at: DVec3::ZERO, lens: 0.4 };
    let light = (sun(), DVec3::new(3.0, 4.0, 2.0), DVec3::ZERO);
    let mut scene = scene(&gltf(&[(Mesh::sphere(1.0, 4), 0)], &[rough], &[light], &eye));
    scene.environment = Environment::constant(DVec3::splat(2.0)).expect("a sky");
    scene
}

/// R, G and B of every pixel.
fn values(image: &Image) -> Vec<f64> {
    ["R", "G", "B"].iter().flat_map(|name| channel(image, name)).map(|&value| f64::from(value)).collect()
}

/// Over seeds the images spread as far as they state, and their mean is that of images without adaptive sampling.
fn states_its_error(scene: &Scene) {
    const SEEDS: u32 = 8;
    let device = device();
    let mut renderer = Renderer::new(&device, scene, &settings()).expect("the renderer is made");
    let mut images = |seeds: std::ops::Range<u32>, goal: &Goal| -> Vec<(Vec<f64>, Outcome)> {
        let image = |seed| {
            renderer.reseed(seed).expect("the seed is set");
            let outcome = renderer.render_until(goal, &mut |_| ControlFlow::Continue(())).expect("renders");
            (values(&renderer.image().expect("the image is there")), outcome)
        };
        seeds.map(image).collect()
    };
    let adaptive = images(0..SEEDS, &goal(GOAL));
    let uniform = images(100..100 + 4 * SEEDS, &Goal { samples: 32, error: None, deadline: None });
    assert!(adaptive.iter().all(|(_, outcome)| outcome.stop == Stop::Error));
    let n = f64::from(SEEDS);
    let stated = (adaptive.iter().map(|(_, o)| o.error.expect("an estimate").powi(2)).sum::<f64>() / n).sqrt();
    assert!(stated <= GOAL);
    let count = adaptive[0].0.len();
    let mean: Vec<f64> = (0..count).map(|i| adaptive.iter().map(|(x, _)| x[i]).sum::<f64>() / n).collect();
    let k = 0.01 * (mean.iter().sum::<f64>() / count as f64).powi(2);
    let spread = |i: usize| {
        let variance = adaptive.iter().map(|(x, _)| (x[i] - mean[i]).powi(2)).sum::<f64>() / (n - 1.0);
        variance / (mean[i].powi(2) + k)
    };
    let error = ((0..count).map(spread).sum::<f64>() / count as f64).sqrt();
    println!("stated {stated:.4}, is {error:.4}");
    // What the estimate promises; over 48 seeds the truth is 1.04 of it on Spot, and 1.14 on the demo, whose lamp makes
    // glints that few samples hit.
    assert!((stated / error).max(error / stated) < 1.2, "stated {stated}, is {error}");
    let light = |images: &[(Vec<f64>, Outcome)]| -> Vec<f64> { images.iter().map(|(x, _)| x.iter().sum()).collect() };
    let ((a, a_error), (b, b_error)) = (mean_and_error(&light(&adaptive)), mean_and_error(&light(&uniform)));
    // One run in a thousand has 5.41 with the seven degrees of freedom of eight seeds (Student's t); fixed ones have less.
    assert!((a - b).abs() < 5.41 * a_error.hypot(b_error), "{a} +- {a_error} and {b} +- {b_error}");
}

#[test]
fn the_error_of_the_demo_is_the_stated_one() {
    states_its_error(&asset("demo.gltf"));
}

#[test]
fn the_error_of_spot_is_the_stated_one() {
    let mut scene = asset("spot.glb");
    scene.environment = Environment::constant(DVec3::ONE).expect("a sky");
    states_its_error(&scene);
}

#[test]
fn the_error_under_a_near_lamp_is_the_stated_one() {
    states_its_error(&lamp());
}

#[test]
fn the_error_of_a_rough_ball_is_the_stated_one() {
    states_its_error(&ball());
}

#[test]
fn bands_and_interruptions_leave_it_right() {
    let (device, scene) = (device(), asset("demo.gltf"));
    // Tiles would end at the edges of bands.
    let settings = Settings { reuse: Some(1), ..settings() };
    let render = |band_pixels| {
        let settings = Settings { band_pixels, ..settings.clone() };
        let mut renderer = Renderer::new(&device, &scene, &settings).expect("the renderer is made");
        let outcome = renderer.render_until(&goal(0.1), &mut |_| ControlFlow::Continue(())).expect("renders");
        assert_eq!(outcome.stop, Stop::Error);
        let refused = renderer.render(1).expect_err("pixels differ");
        assert!(matches!(refused, Error::Setting { .. }), "{refused}");
        renderer.image().expect("the image is there").channels
    };
    let whole = render(None);
    let samples = &whole.iter().find(|channel| channel.name == "samples.Y").expect("it is there").data;
    assert!(samples.iter().any(|&n| n != samples[0]), "all pixels have {} samples", samples[0]);
    assert!(samples.iter().all(|&n| n >= 32.0 && n % 32.0 == 0.0));
    assert!(whole == render(Some(SIZE * 5)));

    // Called off at each step, and gone on with.
    let mut renderer = Renderer::new(&device, &scene, &settings).expect("the renderer is made");
    let mut calls = 0;
    let outcome = loop {
        let outcome = renderer.render_until(&goal(0.1), &mut |_| ControlFlow::Break(())).expect("renders");
        calls += 1;
        if outcome.stop != Stop::Caller {
            break outcome;
        }
        assert!(calls < 1000, "it never ends");
    };
    assert!(calls > 2 && outcome.error.expect("an estimate") <= 0.1);
    let image = renderer.image().expect("the image is there");
    assert!(channel(&image, "samples.Y").iter().all(|&n| n >= 32.0));
}

#[test]
fn time_ends_a_render_and_wrong_goals_are_refused() {
    let (device, scene) = (device(), asset("demo.gltf"));
    let mut renderer = Renderer::new(&device, &scene, &settings()).expect("the renderer is made");
    let mut until = |goal: Goal| renderer.render_until(&goal, &mut |_| ControlFlow::Continue(()));
    let deadline = Some(Instant::now() + Duration::from_millis(300));
    let outcome = until(Goal { samples: u32::MAX, error: None, deadline }).expect("renders");
    assert_eq!((outcome.stop, outcome.error), (Stop::Time, None));
    // A moment that has passed leaves a sample.
    renderer.reset();
    let mut until = |goal: Goal| renderer.render_until(&goal, &mut |_| ControlFlow::Continue(()));
    let outcome = until(Goal { samples: 9, error: Some(0.5), deadline: Some(Instant::now()) }).expect("renders");
    assert_eq!(outcome, Outcome { stop: Stop::Time, error: None });
    for wrong in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        until(goal(wrong)).expect_err("no error");
    }
    until(Goal { samples: 0, error: None, deadline: None }).expect_err("no samples");
    assert_eq!(renderer.samples(), 0..1);
    let others = [
        Settings { estimate_error: false, ..settings() },
        Settings { recording: true, ..settings() },
        Settings { integrator: Integrator::Cloud, cloud: Cloud { points: 200, ..Cloud::default() }, ..settings() },
    ];
    for other in others {
        let mut renderer = Renderer::new(&device, &scene, &other).expect("the renderer is made");
        let refused = renderer.render_until(&goal(0.1), &mut |_| ControlFlow::Continue(())).expect_err("no estimate");
        assert!(refused.to_string().contains("error"), "{refused}");
    }
}
