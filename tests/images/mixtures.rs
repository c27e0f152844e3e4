//! Sets of several materials: light travels by the profile of the matter that it entered.

use crate::{
    channel, mean_and_error, render,
    scenes::{Eye, Mesh, gltf, matter, scene, sun},
    twins::{both, differences},
};
use glam::DVec3;
use serde_json::{Value, json};
use std::f64::consts::PI;
use translucent::{
    Model, Normalisation, Projection, Scene, Settings, SingleScattering,
    reference::{
        area::{self, Lamp, Setting, leaving},
        math::integrate,
        profile::{Coefficients, Profile},
        rough::{Boundaries, interpolated},
    },
    scene::Environment,
    shared::{BOUNDARY_NODES, MODEL_STANDARD},
};

const IOR: f64 = 1.4;
/// Mean free paths that differ twentyfold, and other colours.
const MEDIA: [([f64; 3], [f64; 3]); 2] = [([1.0, 1.5, 2.0], [0.05, 0.2, 1.0]), ([20.0, 10.0, 30.0], [0.5, 0.01, 2.0])];

/// A medium of the set "body", with a model of its own.
fn medium(index: usize, model: &str) -> Value {
    let (sigma_s, sigma_a) = MEDIA[index];
    let mut material = matter(sigma_s, sigma_a, IOR);
    material["name"] = json!(format!("medium {index}"));
    material["extras"]["bssrdf"]["set"] = json!("body");
    material["extras"]["bssrdf"]["model"] = json!(model);
    material
}

/// A ball of two halves.
fn halves() -> [Mesh; 2] {
    let sphere = Mesh::sphere(1.0, 8);
    [false, true].map(|right| {
        let side = |t: &&[u32]| t.iter().map(|&i| sphere.positions[i as usize].x).sum::<f64>() > 0.0;
        let indices = sphere.indices.chunks_exact(3).filter(|t| side(t) == right).flatten().copied().collect();
        Mesh { indices, ..sphere.clone() }
    })
}

fn uniform(mut scene: Scene, radiance: f64) -> Scene {
    scene.set_environment(Environment::constant(DVec3::splat(radiance)).expect("valid")).expect("valid");
    scene
}

/// Mean of each channel and its standard error.
fn means(image: &translucent::Image) -> [(f64, f64); 3] {
    ["R", "G", "B"].map(|letter| {
        let values = channel(image, &format!("subsurface.{letter}"));
        mean_and_error(&values.iter().map(|x| f64::from(*x)).collect::<Vec<_>>())
    })
}

fn settings(size: u32) -> Settings {
    Settings {
        resolution: Some((size, size)),
        seed: 9,
        single_scattering: SingleScattering::Off,
        reuse: Some(1),
        ..Settings::default()
    }
}

#[test]
fn body_of_two_media_against_the_integrator() {
    let light = DVec3::new(-0.4, -0.5, -0.8);
    let halves = halves();
    let corners: Vec<area::Corners> = halves
        .iter()
        .flat_map(|mesh| mesh.indices.chunks_exact(3).map(|t| [0, 1, 2].map(|i| mesh.positions[t[i] as usize])))
        .collect();
    let lamps = [Lamp::Directional { direction: light.normalize(), irradiance: DVec3::splat(PI) }];
    for models in [[Model::Standard; 2], [Model::Burley, Model::Better]] {
        let of = |index: usize| area::Matter {
            sigma_s_prime: MEDIA[index].0.into(),
            sigma_a: MEDIA[index].1.into(),
            g: 0.0,
            ior: IOR,
            normalisation: Normalisation::Energy,
            model: models[index],
        };
        let entries: Vec<area::Matter> =
            halves.iter().enumerate().flat_map(|(k, mesh)| vec![of(k); mesh.indices.len() / 3]).collect();
        let setting = Setting {
            set: &corners,
            blockers: &[],
            matter: of(0),
            entries: &entries,
            lamps: &lamps,
            surrounding: DVec3::splat(0.3),
        };
        let materials = [0, 1].map(|index| medium(index, &models[index].to_string()));
        // On either side of the seam, where light of both arrives.
        for toward in [DVec3::new(-0.08, 0.4, 0.9), DVec3::new(0.06, 0.5, 0.9)] {
            let near = |t: &&area::Corners| t.iter().sum::<DVec3>().normalize().dot(toward.normalize());
            let [a, b, c] = *corners.iter().max_by(|s, t| near(s).total_cmp(&near(t))).expect("triangles");
            let (point, normal) = ((a + b + c) / 3.0, (b - a).cross(c - a).normalize());
            let eye = Eye { eye: point + 4.0 * normal + DVec3::new(1.0, 0.5, 0.2), at: point, lens: 1e-4 };
            let expected = leaving(&setting, point, normal, (eye.eye - point).normalize(), 1 << 18, 11);
            let meshes = [(halves[0].clone(), 0), (halves[1].clone(), 1)];
            let lights = [(sun(), -light, DVec3::ZERO)];
            let scene = uniform(scene(&gltf(&meshes, &materials, &lights, &eye)), 0.3);
            assert_eq!(scene.sets.len(), 1);
            for projection in [Projection::Mis, Projection::Normal] {
                if projection == Projection::Normal && models[0] != models[1] {
                    continue;
                }
                let image = render(&scene, &Settings { projection, ..settings(8) }, 256);
                for (c, (mean, error)) in means(&image).into_iter().enumerate() {
                    let error = error.hypot(expected.error[c]);
                    let what =
                        format!("{models:?}, {toward}, {projection:?}, channel {c}: {mean} and {}", expected.mean[c]);
                    assert!((mean - expected.mean[c]).abs() < 4.0 * error, "{what} +- {error}");
                    assert!(error < 0.07 * expected.mean[c], "{what}: no force at {error}");
                }
            }
        }
    }
}

/// Part of the light of a profile that leaves beyond the straight line at the distance s from where it entered.
fn beyond(profile: &Profile, s: f64) -> f64 {
    // r = s / cos a: a ring's share beyond the line is a / pi.
    let ring = |a: f64| {
        let r = s / a.cos();
        2.0 * r * profile.rd(r) * a * s * a.sin() / a.cos().powi(2)
    };
    integrate(0.0, PI / 2.0 - 1e-9, 400, ring)
}

#[test]
fn across_a_seam_of_a_plane_every_entry_sends_out_its_own_total() {
    // Medium 0 on the left, medium 1, rough and brown, on the right of a plane in uniform light.
    let (roughness, brown) = (0.6, DVec3::new(0.9, 0.5, 0.2));
    let size = 400.0;
    let mut left = Mesh::default();
    left.quad(DVec3::new(-size, -size, 0.0), DVec3::X * size, DVec3::Y * 2.0 * size);
    let mut right = Mesh::default();
    right.quad(DVec3::new(0.0, -size, 0.0), DVec3::X * size, DVec3::Y * 2.0 * size);
    let mut materials = [medium(0, "standard"), medium(1, "standard")];
    materials[1]["extras"]["bssrdf"]["surface"] = json!("rough");
    materials[1]["pbrMetallicRoughness"] = json!({"roughnessFactor": roughness});
    let mut boundaries = Boundaries::new(false, Normalisation::Energy);
    let (_, rho_rough) = boundaries.add(roughness * roughness, IOR);
    let of = |index: usize, c: usize| Coefficients {
        sigma_s_prime: MEDIA[index].0[c],
        sigma_a: MEDIA[index].1[c],
        g: 0.0,
        ior: IOR,
        rough: (index == 1).then_some(rho_rough),
        appearance: None,
    };
    let entering =
        [0, 1].map(|index| 1.0 - of(index, 0).diffuse_reflectance(translucent::reference::boundary::Side::Outside));
    for s in [-0.6, -0.1, 0.1, 0.6] {
        let at = DVec3::new(s, 0.1, 0.0);
        let eye = Eye { eye: at + DVec3::new(1.0, 2.0, 6.0), at, lens: 1e-5 };
        let meshes = [(left.clone(), 0), (right.clone(), 1)];
        let mut scene = uniform(scene(&gltf(&meshes, &materials, &[], &eye)), 1.0);
        (scene.materials[1].tinted, scene.materials[1].base_color) = (true, brown);
        let image = render(&scene, &Settings { directions: 2, ..settings(12) }, 512);
        let cos = (eye.eye - at).normalize().z;
        let own = usize::from(s > 0.0);
        let leaving = match own {
            0 => translucent::reference::boundary::transmittance(IOR, cos),
            _ => interpolated(&boundaries.values[..BOUNDARY_NODES as usize], cos),
        } / entering[own];
        let tints = [DVec3::ONE, brown];
        for (c, (mean, error)) in means(&image).into_iter().enumerate() {
            let shares = [0, 1].map(|k| {
                let profile = Profile::new(MODEL_STANDARD, &of(k, c));
                let across = beyond(&profile, s.abs());
                entering[k] * tints[k][c] * if k == own { profile.total() - across } else { across }
            });
            let expected = leaving * tints[own][c] * (shares[0] + shares[1]);
            assert!((mean - expected).abs() < 4.0 * error + 1e-3 * expected, "{s}, {c}: {mean} +- {error}, {expected}");
            assert!(error < 0.02 * expected, "{s}, {c}: no force at {mean} +- {error}");
        }
    }
}

#[test]
fn tables_with_curvature_are_the_twins() {
    let eye = Eye { eye: DVec3::new(0.0, 1.0, 4.0), at: DVec3::ZERO, lens: 0.55 };
    let meshes = halves().into_iter().zip([0, 1]).collect::<Vec<_>>();
    let lights = [(sun(), DVec3::new(3.0, 4.0, 2.0), DVec3::ZERO)];
    let scene = uniform(scene(&gltf(&meshes, &[medium(0, "table"), medium(1, "burley")], &lights, &eye)), 0.5);
    let mut all = vec![];
    for projection in [Projection::Mis, Projection::Camera] {
        let (image, twins) = both(&scene, &Settings { projection, ..settings(8) }, 8);
        all.extend(differences(&image, &twins));
    }
    all.sort_by(f64::total_cmp);
    let outside = all.iter().filter(|d| **d > 1e-4).count();
    assert!(all.len() > 60, "{} lit values", all.len());
    // As for one table: a radius is drawn from a distribution function in f32.
    assert!(outside * 100 <= all.len(), "{outside} of {}: {:?}", all.len(), &all[all.len() - outside..]);
}

#[test]
fn one_medium_in_two_materials_is_one_medium() {
    let eye = Eye { eye: DVec3::new(0.0, 1.0, 4.0), at: DVec3::ZERO, lens: 0.55 };
    let image = |materials: [usize; 2]| {
        let meshes = halves().into_iter().zip(materials).collect::<Vec<_>>();
        let media = [medium(0, "standard"), medium(0, "standard")];
        render(&uniform(scene(&gltf(&meshes, &media, &[], &eye)), 1.0), &settings(24), 16)
    };
    let (one, two) = (image([0, 0]), image([0, 1]));
    let [one, two] = [&one, &two].map(|image| channel(image, "subsurface.G"));
    assert!(one.iter().filter(|x| **x > 0.1).count() > 100);
    for (a, b) in one.iter().zip(two) {
        assert!((a - b).abs() <= 2e-5 * a, "{a} and {b}");
    }
}
