//! Integrators on the host: points uniform over the surface against what is sampled, walks against closed forms and against
//! walks from the light.

use crate::{
    channel, device, mean_and_error, render,
    scenes::{Eye, Mesh, gltf, matter, scene, standard, sun},
};
use glam::DVec3;
use serde_json::{Value, json};
use std::f64::consts::PI;
use translucent::{
    Goal, Model, Renderer, Scene, Settings, SingleScattering,
    image::Image,
    reference::{
        Inputs, intersect,
        walk::{
            self, Random,
            exitance::{Bins, Light, exitance},
            shape::Body,
        },
    },
    scene::Environment,
    settings::Integrator,
    shared::Slot,
};

fn settings(integrator: Integrator) -> Settings {
    // Noise of one pixel alone: errors are those of independent pixels.
    Settings { resolution: Some((20, 20)), seed: 3, integrator, reuse: Some(1), ..standard() }
}

fn lit(mut scene: Scene, radiance: f64) -> Scene {
    scene.set_environment(Environment::constant(DVec3::splat(radiance)).expect("valid")).expect("valid");
    scene
}

/// A body of a cube and a ball under a lamp, the sun and a sky. Light travels about as far as the body is wide.
fn pair(materials: &[Value]) -> Scene {
    let mut cube = Mesh::default();
    cube.cuboid(DVec3::new(-2.05, -1.0, -1.0), DVec3::new(-0.05, 1.0, 1.0), 1);
    let mut ball = Mesh::sphere(1.0, 6);
    ball.positions.iter_mut().for_each(|p| p.x += 1.0);
    let lamp = json!({"type": "point", "intensity": 5.0});
    let lights = [(lamp, DVec3::new(0.0, 2.0, 2.5), DVec3::ZERO), (sun(), DVec3::new(3.0, 4.0, 2.0), DVec3::ZERO)];
    let eye = Eye { eye: DVec3::new(1.0, 2.0, 8.0), at: DVec3::ZERO, lens: 0.45 };
    let last = materials.len() - 1;
    lit(scene(&gltf(&[(cube, 0), (ball, last)], materials, &lights, &eye)), 0.3)
}

fn clear() -> Value {
    matter([1.0, 1.5, 2.0], [0.1, 0.2, 0.4], 1.4)
}

fn rough() -> Value {
    let mut rough = matter([2.0, 1.5, 1.0], [0.5, 0.3, 0.1], 1.4);
    rough["name"] = json!("rough");
    rough["extras"]["bssrdf"].as_object_mut().expect("matter").remove("surface");
    rough["pbrMetallicRoughness"] = json!({"roughnessFactor": 0.5});
    rough
}

#[test]
fn area_shows_what_is_sampled() {
    let mixed = [clear(), rough()].map(|mut matter| {
        matter["extras"]["bssrdf"]["set"] = json!("both");
        matter
    });
    let cases: [(&[Value], Model, SingleScattering); 5] = [
        (&[clear()], Model::Better, SingleScattering::On),
        (&[rough()], Model::Burley, SingleScattering::Off),
        (&[clear()], Model::Directional, SingleScattering::Off),
        (&[clear(), rough()], Model::Table, SingleScattering::Off),
        (&mixed, Model::Standard, SingleScattering::Off),
    ];
    for (materials, model, single_scattering) in cases {
        let scene = pair(materials);
        let [area, sample] = [(Integrator::Area, 512), (Integrator::Sample, 128)].map(|(integrator, samples)| {
            render(&scene, &Settings { model, single_scattering, ..settings(integrator) }, samples)
        });
        // Squares of 4 x 4 pixels: 4.5 standard errors in 375 comparisons happen by chance with a probability of .003.
        for letter in ["R", "G", "B"] {
            let light = [&area, &sample].map(|image| channel(image, &format!("subsurface.{letter}")));
            let variance = [&area, &sample].map(|image| channel(image, &format!("variance.{letter}")));
            let (mut compared, mut all) = (0, [0.0; 3]);
            for square in 0..25 {
                let pixels = (0..16).map(|i| (square / 5 * 4 + i / 4) * 20 + square % 5 * 4 + i % 4);
                let sum = |values: &[f32]| pixels.clone().map(|i| f64::from(values[i])).sum::<f64>();
                let [a, b] = light.map(sum);
                let error = (sum(variance[0]) + sum(variance[1])).sqrt();
                assert!((a - b).abs() <= 4.5 * error, "{model}, {letter}, {square}: {a} and {b} +- {error}");
                compared += u32::from(b > 0.0);
                all = [all[0] + a, all[1] + b, all[2] + error * error];
            }
            let [a, b, error] = [all[0], all[1], all[2].sqrt()];
            println!("{model} {letter}: {a:.3} {b:.3} +- {error:.3}, {compared} squares");
            assert!((a - b).abs() < 4.0 * error, "{model}, {letter}: {a} and {b} +- {error}");
            assert!(compared > 8 && error < 0.03 * b, "{model}, {letter}: no force at {b} +- {error}");
        }
    }
}

#[test]
fn a_white_furnace_closes_without_noise() {
    let mut mesh = Mesh::default();
    mesh.cuboid(DVec3::splat(-1.0), DVec3::ONE, 1);
    let eye = Eye { eye: DVec3::new(2.0, 3.0, 6.0), at: DVec3::ZERO, lens: 0.1 };
    for ior in [1.0, 1.5] {
        // Forward, isotropic and backward scattering; a channel that scatters nothing.
        let mut white = matter([3.0, 1.0, 0.0], [0.0; 3], ior);
        white["extras"]["bssrdf"]["g"] = json!([0.8, -0.5, 0.0]);
        let image = render(
            &lit(scene(&gltf(&[(mesh.clone(), 0)], &[white.clone()], &[], &eye)), 1.0),
            &settings(Integrator::Walk),
            8,
        );
        for name in ["R", "G", "B"] {
            let worst = channel(&image, name).iter().map(|x| (x - 1.0).abs()).fold(0.0, f32::max);
            // Fresnel's equations in f32 here and f64 there.
            assert!(worst < 1e-5, "n = {ior}, {name}: off by {worst}");
            assert!(channel(&image, &format!("subsurface.{name}")).iter().all(|x| *x > 0.9));
        }
        // Walls that glow are as good a furnace.
        let mut walls = Mesh::default();
        walls.cuboid(DVec3::splat(-20.0), DVec3::splat(20.0), 1);
        let glowing = json!({"emissiveFactor": [1.0, 1.0, 1.0], "doubleSided": true});
        let walled = scene(&gltf(&[(mesh.clone(), 0), (walls, 1)], &[white, glowing], &[], &eye));
        let walled = render(&walled, &settings(Integrator::Walk), 8);
        for name in ["subsurface.R", "subsurface.G", "subsurface.B"] {
            let differ = channel(&image, name).iter().zip(channel(&walled, name)).any(|(a, b)| (a - b).abs() > 1e-6);
            assert!(!differ, "n = {ior}, {name}");
        }
    }
    // What a rough surface reflects is noise, and what comes through its table's.
    let mut white = rough();
    white["extras"]["bssrdf"]["sigma_a"] = json!([0.0, 0.0, 0.0]);
    let image = render(&lit(scene(&gltf(&[(mesh, 0)], &[white], &[], &eye)), 1.0), &settings(Integrator::Walk), 64);
    let values: Vec<f64> = channel(&image, "G").iter().map(|x| f64::from(*x)).collect();
    let (mean, error) = mean_and_error(&values);
    assert!((mean - 1.0).abs() < 4.0 * error + 3e-4 && error < 1e-3, "{mean} +- {error}");
}

const SIGMA_S_PRIME: [f64; 3] = [2.0, 4.0, 4.0];
const SIGMA_A: [f64; 3] = [0.1, 0.3, 1.0];
const IOR: f64 = 1.4;

/// A ball from very far away, lit by these lights.
fn ball(lights: &[(Value, DVec3, DVec3)]) -> Scene {
    let eye = Eye { eye: DVec3::new(3.0, 1.0, 8.0), at: DVec3::ZERO, lens: -1.05 };
    let mut matter = matter(SIGMA_S_PRIME, SIGMA_A, IOR);
    matter["extras"]["bssrdf"]["g"] = json!([0.5, 0.0, 0.0]);
    scene(&gltf(&[(Mesh::sphere(1.0, 16), 0)], &[matter], lights, &eye))
}

/// Mean light of what is covered, by channel, and its standard error.
fn means(image: &Image) -> [(f64, f64); 3] {
    let sum = |name: &str| channel(image, name).iter().map(|x| f64::from(*x)).sum::<f64>();
    let covered = sum("A");
    ["R", "G", "B"].map(|c| (sum(&format!("subsurface.{c}")) / covered, sum(&format!("variance.{c}")).sqrt() / covered))
}

#[test]
fn walks_from_the_eye_bring_what_walks_from_the_light_do() {
    // Seen from one side a ball in even light shows each angle as often as all its surface does to all sides: the mean is
    // the flux that leaves it over pi times its area.
    let scene = lit(ball(&[]), 1.0);
    let image = render(&scene, &Settings { resolution: Some((48, 48)), ..settings(Integrator::Walk) }, 40);
    let shape = walk::shape::Sphere { radius: 1.0 };
    for (c, (mean, error)) in means(&image).into_iter().enumerate() {
        let g = if c == 0 { 0.5 } else { 0.0 };
        let matter = walk::Matter { sigma_s: SIGMA_S_PRIME[c] / (1.0 - g), sigma_a: 0.0, g, ior: IOR };
        let bins = Bins { count: 1, of: &|_, _| 0 };
        let all = exitance(&shape, matter, &[SIGMA_A[c]], Light::Uniform, bins, 100_000, 5)[0].all;
        let expected = all.scaled(1.0 / (PI * shape.area()));
        let error = error.hypot(expected.error);
        println!("{c}: {mean:.4} and {:.4} +- {error:.4}", expected.mean);
        // The mesh encloses .4 % less than the ball: light is absorbed on paths shorter by .1 %.
        assert!((mean - expected.mean).abs() < 4.0 * error + 2e-3 * expected.mean, "{c}: {mean}, {expected:?}");
        assert!(error < 0.01 * mean, "{c}: no force at +- {error}");
    }
}

#[test]
fn suns_all_around_are_an_even_sky_to_walks() {
    // Evenly on a spiral; light that passes straight through, which only a sky has, is below 1e-3.
    const SUNS: u32 = 32;
    let golden = PI * (3.0 - 5f64.sqrt());
    let lights: Vec<_> = (0..SUNS)
        .map(|k| {
            let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(SUNS);
            let (sin, cos) = (golden * f64::from(k)).sin_cos();
            let r = (1.0 - z * z).sqrt();
            let light = json!({"type": "directional", "intensity": 4.0 * PI / f64::from(SUNS)});
            (light, 5.0 * DVec3::new(r * cos, r * sin, z), DVec3::ZERO)
        })
        .collect();
    let settings = Settings { resolution: Some((24, 24)), ..settings(Integrator::Walk) };
    let [suns, sky] = [render(&ball(&lights), &settings, 40), render(&lit(ball(&[]), 1.0), &settings, 160)];
    for ((suns, a), (sky, b)) in means(&suns).into_iter().zip(means(&sky)) {
        println!("{suns:.4} +- {a:.4}, {sky:.4} +- {b:.4}");
        assert!((suns - sky).abs() < 4.0 * a.hypot(b) + 0.01 * sky, "{suns} +- {a} and {sky} +- {b}");
        assert!(a.hypot(b) < 0.01 * sky);
    }
}

#[test]
fn threads_bands_and_portions_change_no_bit() {
    let scene = pair(&[clear(), rough()]);
    for integrator in [Integrator::Area, Integrator::Walk] {
        let render = |threads: usize, band_pixels: Option<u32>, portions: &[u32]| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| {
                let device = device();
                let settings = Settings { band_pixels, crop: Some([2, 3, 18, 17]), ..settings(integrator) };
                let mut renderer = Renderer::new(&device, &scene, &settings).expect("the renderer is made");
                portions.iter().for_each(|&samples| renderer.render(samples).expect("the render finishes"));
                for absent in ["sample", "reproject", "accumulate"] {
                    assert!(!renderer.kernels().contains(&absent), "{absent}");
                }
                let buffers = renderer.buffers();
                assert!(buffers.iter().all(|(slot, _)| !matches!(slot, Slot::Probes | Slot::HitLists)));
                renderer.image().expect("an image").channels
            })
        };
        let whole = render(1, None, &[10]);
        assert!(whole == render(3, Some(50), &[10]), "{integrator}: threads and bands");
        assert!(whole == render(2, Some(16), &[1, 9]), "{integrator}: portions");
    }
}

#[test]
fn the_tree_finds_what_a_look_at_all_triangles_does() {
    let scene = pair(&[clear()]);
    let device = device();
    let renderer = Renderer::new(&device, &scene, &settings(Integrator::Sample)).expect("the renderer is made");
    let all = renderer.prepared().inputs(&scene);
    let corners: Vec<_> = scene.triangles.iter().map(|t| t.vertices.map(|vertex| vertex.as_dvec3())).collect();
    let tree = walk::mesh::Mesh::new(&corners);
    let fast = Inputs { tree: Some(&tree), ..all };
    let mut random = Random::new(1, 1);
    let mut found = 0;
    for _ in 0..3000 {
        let (origin, direction, reach) = (0.7 * random.direction(), random.direction(), 2.0 * random.next());
        let [a, b] = [all, fast].map(|inputs| intersect::closest(&inputs, origin, direction, 0.0, reach));
        assert_eq!(a, b);
        assert_eq!(a.is_some(), intersect::any(&fast, origin, direction, 0.0, reach));
        found += u32::from(a.is_some());
    }
    assert!((500..2500).contains(&found), "{found}");
}

#[test]
fn what_the_host_cannot_do_is_refused_by_name() {
    let mut open = Mesh::sphere(1.0, 2);
    open.indices.truncate(open.indices.len() - 3);
    let eye = Eye { eye: DVec3::Z * 5.0, at: DVec3::ZERO, lens: 0.5 };
    let open = lit(scene(&gltf(&[(open, 0)], &[clear()], &[], &eye)), 1.0);
    let mixed = pair(&[clear(), rough()].map(|mut matter| {
        matter["extras"]["bssrdf"]["set"] = json!("both");
        matter
    }));
    let mut holes = pair(&[clear()]);
    let closed = holes.clone();
    holes.materials[0].ramp = vec![holes.materials[0].medium.clone().expect("matter"); 513];
    let record = |integrator| Settings { recording: true, ..settings(integrator) };
    let device = device();
    for (scene, settings, word) in [
        (&open, settings(Integrator::Walk), "not closed"),
        (&mixed, settings(Integrator::Walk), "several materials"),
        (&holes, settings(Integrator::Walk), "changes the medium"),
        (&closed, record(Integrator::Walk), "recordings"),
        (&closed, record(Integrator::Area), "recordings"),
    ] {
        let error = Renderer::new(&device, scene, &settings).err().expect(word).to_string();
        assert!(error.contains(word) && error.contains(&settings.integrator.to_string()), "{error}");
    }
    for integrator in [Integrator::Area, Integrator::Walk] {
        let settings = Settings { estimate_error: true, ..settings(integrator) };
        let mut renderer = Renderer::new(&device, &closed, &settings).expect("the renderer is made");
        let goal = Goal { samples: 64, error: Some(0.1), deadline: None };
        let error = renderer.render_until(&goal, &mut |_| std::ops::ControlFlow::Continue(())).err();
        assert!(error.expect("a refusal").to_string().contains(&format!("integrator {integrator}")));
    }
}
