//! Light kept at points of the surface: that of shadow rays where it is linear, near it elsewhere, with points where it
//! varies.

use crate::{
    channel, device, render,
    scenes::{Eye, Mesh, gltf, matter, scene, standard, sun},
};
use glam::DVec3;
use serde_json::{Value, json};
use translucent::{
    Error, Model, Renderer, Scene, Settings,
    cache::Geometry,
    prepare::prepare,
    scene::Environment,
    settings::{Cache, Integrator, Irradiance},
};

fn settings(irradiance: Irradiance) -> Settings {
    Settings { resolution: Some((32, 32)), irradiance, seed: 3, ..standard() }
}

/// Light through matter of each pixel, all channels together.
fn light(scene: &Scene, settings: &Settings, samples: u32) -> Vec<f64> {
    let image = render(scene, settings, samples);
    let colors = ["R", "G", "B"].map(|c| channel(&image, &format!("subsurface.{c}")).to_vec());
    (0..colors[0].len()).map(|i| colors.iter().map(|color| f64::from(color[i])).sum()).collect()
}

/// A slab whose mean free path is 1 m, 28 of them wide, seen from above: the image is 20 m wide.
fn slab(above: &[(Mesh, usize)], materials: &[Value], light: Value, at: DVec3) -> Scene {
    let mut mesh = Mesh::default();
    mesh.cuboid(DVec3::splat(-14.0), DVec3::new(14.0, 14.0, 0.0), 1);
    let mut meshes = vec![(mesh, 0)];
    meshes.extend_from_slice(above);
    let eye = Eye { eye: DVec3::Z * 30.0, at: DVec3::ZERO, lens: -10.0 };
    scene(&gltf(&meshes, materials, &[(light, at, DVec3::ZERO)], &eye))
}

fn marble() -> Value {
    matter([0.9, 0.8, 0.6], [0.1, 0.2, 0.4], 1.3)
}

/// The same random numbers but for light, which is the same everywhere on the plane: images agree to rounding.
#[test]
fn even_light_is_interpolated_exactly() {
    let scene = slab(&[], &[marble()], sun(), DVec3::Z * 100.0);
    for model in [Model::Standard, Model::Table] {
        for reuse in [1, 4] {
            let of = |irradiance| light(&scene, &Settings { model, reuse: Some(reuse), ..settings(irradiance) }, 4);
            let (direct, cached) = (of(Irradiance::Direct), of(Irradiance::Cached));
            assert!(direct.iter().filter(|light| **light > 0.0).count() > 900, "{model}: the plane is lit");
            for (direct, cached) in direct.iter().zip(&cached) {
                assert!((cached - direct).abs() <= 2e-5 * direct, "{model}, tiles of {reuse}: {cached}, not {direct}");
            }
        }
    }
}

/// A screen with a straight edge in the sun: the edge of its shadow falls between points, which moves it by up to half
/// their distance. The error of the profile's mean over it falls with that.
#[test]
fn the_error_of_a_shadow_s_edge_falls_with_the_spacing() {
    let errors = |edge: f64, caches: &[Cache]| -> Vec<f64> {
        let mut screen = Mesh::default();
        screen.quad(DVec3::new(edge, -30.0, 5.0), DVec3::X * 30.0, DVec3::Y * 60.0);
        let black = json!({"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0}});
        let scene = slab(&[(screen, 1)], &[marble(), black], sun(), DVec3::Z * 100.0);
        // The edge runs along columns.
        let columns = |irradiance, cache| -> Vec<f64> {
            let pixels = light(&scene, &Settings { cache, ..settings(irradiance) }, 64);
            (0..32).map(|x| pixels[x..].iter().step_by(32).sum::<f64>() / 32.0).collect()
        };
        let direct = columns(Irradiance::Direct, Cache::default());
        let error = |&cache: &Cache| {
            let cached = columns(Irradiance::Cached, cache);
            let squares = direct.iter().zip(&cached).map(|(direct, cached)| (cached - direct).powi(2));
            (32.0 * squares.sum::<f64>()).sqrt() / direct.iter().sum::<f64>()
        };
        caches.iter().map(error).collect()
    };
    let whole = Cache { points: Cache::POINTS_MAX, ..Cache::default() };
    let finer = Cache { spacing: 0.125, ..whole };
    // At the start points are two mean free paths apart.
    let blind = Cache { tolerance: 10.0, ..whole };
    let few = Cache { points: 1000, ..whole };
    let found: Vec<_> = [0.37, 1.13, 1.92].map(|edge| errors(edge, &[finer, whole, blind, few])).to_vec();
    let rms = |k: usize| (found.iter().map(|errors| errors[k].powi(2)).sum::<f64>() / found.len() as f64).sqrt();
    let [finer, default, blind, few] = [0, 1, 2, 3].map(rms);
    println!("relative rms error: {finer} by 1/8 mean free path, {default} by 1/2, {blind} by 2, {few} by few points");
    assert!(default < 0.02 && finer < default / 2.0 && blind > 1.5 * default && few > default, "{found:?}");
}

/// Two balls that shade each other under a sky, the sun and a lamp, one with texture, roughness and normals that differ
/// from the facets': means agree within the noise, and what interpolation does is little beside a facet's light.
#[test]
fn a_scene_has_its_light() {
    let scene = pair();
    for (model, directions) in [(Model::Burley, 1), (Model::Table, 2)] {
        let means = |irradiance| {
            let seeds = 0..6;
            let of = |seed| {
                let settings = Settings { seed, model, directions, ..settings(irradiance) };
                let pixels = light(&scene, &settings, 64);
                pixels.iter().sum::<f64>() / pixels.len() as f64
            };
            crate::mean_and_error(&seeds.map(of).collect::<Vec<_>>())
        };
        let ((direct, direct_error), (cached, error)) = (means(Irradiance::Direct), means(Irradiance::Cached));
        let apart = direct_error.hypot(error) / direct;
        println!("{model}: direct {direct}, cached {:+.4} of it, s.e. {apart:.4}", cached / direct - 1.0);
        // 4 standard errors, and .5 % for interpolation.
        assert!((cached / direct - 1.0).abs() < 4.0 * apart + 0.005, "{model}: {cached}, not {direct}");
        assert!(apart < 0.01, "the test has no force at {apart}");
    }
}

fn pair() -> Scene {
    let mut left = Mesh::sphere(1.0, 12);
    left.positions.iter_mut().for_each(|p| p.x -= 1.1);
    let mut right = Mesh::sphere(1.0, 12);
    right.positions.iter_mut().for_each(|p| p.x += 1.1);
    let lamp = json!({"type": "point", "intensity": 20.0});
    let lights = [(lamp, DVec3::new(0.0, 2.0, 2.5), DVec3::ZERO), (sun(), DVec3::new(3.0, 4.0, 2.0), DVec3::ZERO)];
    let mut rough = matter([9.0, 6.0, 4.0], [0.5, 0.3, 0.1], 1.3);
    rough["extras"]["bssrdf"].as_object_mut().expect("matter").remove("surface");
    rough["pbrMetallicRoughness"] = json!({"roughnessFactor": 0.5});
    let eye = Eye { eye: DVec3::new(1.0, 2.0, 8.0), at: DVec3::ZERO, lens: 0.3 };
    let mut scene = scene(&gltf(&[(left, 0), (right, 1)], &[marble(), rough], &lights, &eye));
    scene.set_environment(Environment::constant(DVec3::new(0.5, 0.7, 1.0)).expect("valid")).expect("valid");
    scene
}

/// What two seeds differ by when the image's own noise is gone: the noise that points were lit with, which falls with
/// their samples.
#[test]
fn the_points_noise_falls_with_their_samples() {
    let mut lamp = Mesh::default();
    lamp.quad(DVec3::new(-16.0, -4.0, 4.0), DVec3::Y * 8.0, DVec3::new(4.0, 0.0, 4.0));
    let bright = json!({"emissiveFactor": [1, 1, 1], "doubleSided": true});
    let scene = slab(&[(lamp, 1)], &[marble(), bright], json!({"type": "point", "intensity": 0.0}), DVec3::Z * 9.0);
    let apart = |samples| {
        let cache = Cache { samples, tolerance: 10.0, ..Cache::default() };
        let of = |seed| light(&scene, &Settings { seed, cache, reuse: Some(8), ..settings(Irradiance::Cached) }, 64);
        let (a, b) = (of(1), of(2));
        let squares = a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        (squares / a.iter().map(|a| a * a).sum::<f64>()).sqrt()
    };
    let (few, many) = (apart(2), apart(128));
    println!("two seeds differ by {few} after 2 samples, {many} after 128");
    assert!(many < few / 2.0, "{few}, {many}");
}

/// A sheet seen from its inner side, where shadow rays find the light: nothing changes.
#[test]
fn the_inner_side_is_as_it_was() {
    let mut sheet = Mesh::default();
    sheet.quad(DVec3::new(-25.0, -25.0, 0.0), DVec3::Y * 50.0, DVec3::X * 50.0);
    let eye = Eye { eye: DVec3::Z * 30.0, at: DVec3::ZERO, lens: -10.0 };
    let scene = scene(&gltf(&[(sheet, 0)], &[marble()], &[(sun(), DVec3::Z * 100.0, DVec3::ZERO)], &eye));
    let (direct, cached) =
        (light(&scene, &settings(Irradiance::Direct), 4), light(&scene, &settings(Irradiance::Cached), 4));
    assert!(direct.iter().filter(|light| **light > 0.0).count() > 900, "the sheet is lit");
    assert_eq!(direct, cached);
}

/// Points go where light varies, as many as there may be, and none where it does not.
#[test]
fn points_go_where_light_varies() {
    let scene = pair();
    let prepared = prepare(&scene, &settings(Irradiance::Cached)).expect("valid");
    let mut cache = prepared.cache;
    let corners = cache.points.len();
    // A smooth sphere shares its vertices, but where its coordinates begin again.
    assert!(cache.lattices.iter().all(|lattice| lattice.cells == 1), "triangles are smaller than two mean free paths");
    assert!(
        cache.patches.len() == scene.triangles.len() && corners * 4 < cache.lattices.len() * 3,
        "{corners} points of {} triangles",
        cache.lattices.len()
    );
    // Light on one side, with an edge across the middle.
    for point in &mut cache.points {
        let lit = point.position.y > 0.0;
        point.flux = if lit { glam::Vec3::ONE } else { glam::Vec3::ZERO };
    }
    let coarse = cache.coarse(0.1, usize::MAX);
    // The other ball's triangles are smaller than half a mean free path.
    let cut = |index: usize| {
        let triangle = cache.patches[index].triangle;
        if scene.shadings[triangle].material == 0 {
            return false;
        }
        let above = scene.triangles[triangle].vertices.iter().filter(|vertex| vertex.y > 0.0).count();
        (1..3).contains(&above)
    };
    let fine: Vec<usize> = (0..cache.patches.len()).filter(|&index| cut(index)).collect();
    let mut found = coarse.clone();
    found.sort_unstable();
    assert_eq!(found, fine, "those that the edge cuts");
    // Three more for each, so far as there is room.
    assert_eq!(cache.coarse(0.1, corners + 10).len(), 3);
    // Noise of that size explains it.
    let mut noisy = cache.clone();
    noisy.noise.fill(1.0);
    assert!(noisy.coarse(0.1, usize::MAX).is_empty());
    cache.refine(Geometry::of(&scene), &coarse);
    assert_eq!(cache.points.len(), corners + 3 * fine.len());
    assert!(cache.points[..corners].iter().any(|point| point.flux != glam::Vec3::ZERO), "light stays");
}

#[test]
fn what_cannot_be_kept_is_refused() {
    let device = device();
    let refused = |settings: Settings, word: &str| {
        let error = Renderer::new(&device, &pair(), &settings).err().expect("it is refused");
        assert!(matches!(&error, Error::Setting { .. }) && error.to_string().contains(word), "{error}");
    };
    let cached = settings(Irradiance::Cached);
    refused(Settings { model: Model::Directional, ..cached.clone() }, "directional dipole");
    refused(Settings { recording: true, ..cached.clone() }, "recordings");
    refused(Settings { integrator: Integrator::Cloud, ..cached.clone() }, "integrator sample");
    refused(Settings { cache: Cache { samples: 1, ..Cache::default() }, ..cached.clone() }, "cache samples");
    refused(Settings { cache: Cache { spacing: 0.0, ..Cache::default() }, ..cached.clone() }, "cache spacing");
    refused(Settings { cache: Cache { tolerance: f64::NAN, ..Cache::default() }, ..cached.clone() }, "cache tolerance");
    refused(Settings { cache: Cache { points: u32::MAX, ..Cache::default() }, ..cached }, "cache points");
}
