//! Points looked up in the G-buffer: the light of rays where the camera sees all that matters, less where it does not.

use crate::{
    channel, device, mean_and_error, render,
    scenes::{Eye, Mesh, gltf, matter, scene, standard, sun},
    twins::{both, differences},
};
use glam::DVec3;
use std::f64::consts::PI;
use translucent::{
    Error, Projection, Renderer, Scene, Settings,
    reference::{
        boundary::transmittance,
        profile::{Dipole, Radial},
    },
    scene::Environment,
    settings::{Integrator, Reproject},
};

/// A slab that fills the image, seen at an angle, under the sun. Its mean free path is 1 m: edges and back are beyond the
/// ball.
fn slab(eye: DVec3, lens: f64) -> Scene {
    let mut mesh = Mesh::default();
    mesh.cuboid(DVec3::splat(-100.0), DVec3::new(100.0, 100.0, 0.0), 4);
    let light = (sun(), DVec3::new(30.0, 20.0, 60.0), DVec3::ZERO);
    let matter = matter([0.9, 0.8, 0.6], [0.1, 0.2, 0.4], 1.3);
    scene(&gltf(&[(mesh, 0)], &[matter], &[light], &Eye { eye, at: DVec3::ZERO, lens }))
}

/// A ball of 1 m in even light, from far away.
fn ball(sigma_s_prime: f64, sigma_a: f64) -> Scene {
    let eye = Eye { eye: DVec3::Z * 10.0, at: DVec3::ZERO, lens: -1.05 };
    let matter = matter([sigma_s_prime; 3], [sigma_a; 3], 1.3);
    let mut scene = scene(&gltf(&[(Mesh::sphere(1.0, 40), 0)], &[matter], &[], &eye));
    scene.set_environment(Environment::constant(DVec3::ONE).expect("valid")).expect("valid");
    scene
}

fn settings(projection: Projection, reproject: Reproject) -> Settings {
    Settings { resolution: Some((48, 48)), projection, reproject, seed: 3, ..standard() }
}

/// The light through matter of the pixels of an inner square, `margin` pixels from the edges, as one number each.
fn inner(scene: &Scene, settings: &Settings, samples: u32, margin: usize) -> Vec<f64> {
    let image = render(scene, settings, samples);
    let colors = ["R", "G", "B"].map(|c| channel(&image, &format!("subsurface.{c}")).to_vec());
    let inside = |i: &usize| (margin..48 - margin).contains(&(i % 48)) && (margin..48 - margin).contains(&(i / 48));
    (0..48 * 48).filter(inside).map(|i| colors.iter().map(|color| f64::from(color[i])).sum()).collect()
}

/// The plane is where the G-buffer says, to rounding, so nothing is missing but light from outside the image: .4 % of the
/// least absorbing channel's comes from beyond 9 m, the least distance of the inner pixels from the image's edge.
#[test]
fn a_plane_that_fills_the_image_is_that_of_rays() {
    for (eye, lens) in [(DVec3::new(0.0, -8.0, 30.0), 0.9), (DVec3::new(0.0, -40.0, 30.0), -12.0)] {
        let scene = slab(eye, lens);
        for projection in [Projection::Mis, Projection::Camera] {
            let estimate = |reproject| mean_and_error(&inner(&scene, &settings(projection, reproject), 64, 19));
            let ((traced, traced_error), (looked_up, error)) =
                (estimate(Reproject::Trace), estimate(Reproject::Screen));
            let apart = traced_error.hypot(error);
            println!(
                "{projection:?}, lens {lens}: traced {traced} +- {traced_error}, looked up {looked_up} +- {error}"
            );
            assert!((looked_up - traced).abs() < 4.0 * apart + 0.004 * traced, "{projection:?}, lens {lens}");
            assert!(apart < 0.02 * traced, "{projection:?}: the test has no force at +- {apart}");
        }
    }
}

/// Of light that entered evenly, a point of a sphere gets from within the distance d the profile's cdf(d), evenly from all
/// around. At cosine c to a far eye, the part of the circle at the angle a that the eye sees is
/// arccos(-c cos a / (sin a sqrt(1 - c^2))) / pi: 1 in the middle, half at the rim.
fn seen_part(dipole: &Dipole, c: f64) -> f64 {
    const STEPS: u32 = 400;
    let at = |k: u32| 2.0 * (f64::from(k) / f64::from(STEPS)).powi(2);
    let ring = |k: u32| {
        // Between two distances, on the unit sphere.
        let (near, far) = (at(k), at(k + 1));
        let d = 0.5 * (near + far);
        let cos = 1.0 - d * d / 2.0;
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let edge = -c * cos / (sin * (1.0 - c * c).sqrt());
        (dipole.cdf(far) - dipole.cdf(near)) * edge.clamp(-1.0, 1.0).acos() / PI
    };
    (0..STEPS).map(ring).sum()
}

/// What is missing is the light of the side that the camera does not see, by the closed form; what else the places of hits
/// within pixels do, with pixels of 13 and 44 % of the diffuse mean free path 1 / sigma_tr, is at most .9 % as measured.
#[test]
fn a_ball_lacks_the_light_of_the_side_that_is_not_seen() {
    for (sigma_s_prime, sigma_a) in [(7.0, 0.41), (23.0, 1.4)] {
        let scene = ball(sigma_s_prime, sigma_a);
        let dipole = Dipole::new(sigma_s_prime, sigma_a, 1.3);
        let cosine = |i: usize| {
            let at = |k: usize| 1.05 * ((k as f64 + 0.5) / 24.0 - 1.0);
            (1.0 - at(i % 48).powi(2) - at(i / 48).powi(2)).sqrt()
        };
        let image = |reproject| inner(&scene, &settings(Projection::Mis, reproject), 256, 0);
        let (traced, looked_up) = (image(Reproject::Trace), image(Reproject::Screen));
        for (least, most) in [(0.7, 1.0), (0.3, 0.7)] {
            let pixels: Vec<usize> = (0..48 * 48).filter(|&i| (least..most).contains(&cosine(i))).collect();
            let apart: Vec<f64> = pixels.iter().map(|&i| looked_up[i] - traced[i]).collect();
            let (difference, error) = mean_and_error(&apart);
            let mean = pixels.iter().map(|&i| traced[i]).sum::<f64>() / pixels.len() as f64;
            let (found, error) = (1.0 + difference / mean, error / mean);
            let leaving = |&i: &usize| transmittance(1.3, cosine(i));
            let seen = pixels.iter().map(|i| leaving(i) * seen_part(&dipole, cosine(*i))).sum::<f64>();
            let expected = seen / pixels.iter().map(leaving).sum::<f64>() / dipole.cdf(2.0);
            println!("sigma_s' {sigma_s_prime}, cosines {least} to {most}: {found} +- {error}, not {expected}");
            assert!((found - expected).abs() < 4.0 * error + 0.01, "{found} +- {error}, not {expected}");
            assert!(error < 0.01, "the test has no force at +- {error}");
        }
    }
}

/// The same random numbers: what differs is on which side of a pixel's edge a point falls.
#[test]
fn image_is_the_twins() {
    let mut all = vec![];
    for (projection, reuse) in [(Projection::Mis, 1), (Projection::Camera, 1), (Projection::Mis, 4)] {
        let settings =
            Settings { resolution: Some((24, 24)), reuse: Some(reuse), ..settings(projection, Reproject::Screen) };
        let (image, twins) = both(&ball(3.0, 0.3), &settings, 8);
        let found = differences(&image, &twins);
        assert!(found.len() > 300, "{projection:?}: {} lit values", found.len());
        all.extend(found);
    }
    all.sort_by(f64::total_cmp);
    let outside = all.iter().filter(|d| **d > 1e-5).count();
    println!("{} values, {outside} beyond 1e-5, worst {:.1e}", all.len(), all[all.len() - 1]);
    assert!(outside * 100 <= all.len(), "{outside} of {}: {:?}", all.len(), &all[all.len() - outside..]);
}

/// Whatever number of pixels is asked for.
#[test]
fn the_image_is_one_band() {
    let scene = ball(3.0, 0.3);
    let whole = settings(Projection::Mis, Reproject::Screen);
    let image = |settings: &Settings| channel(&render(&scene, settings, 4), "subsurface.G").to_vec();
    assert_eq!(image(&whole), image(&Settings { band_pixels: Some(100), ..whole.clone() }));
}

#[test]
fn what_a_g_buffer_does_not_hold_is_refused() {
    let device = device();
    let gathered = Settings { integrator: Integrator::Cloud, ..settings(Projection::Mis, Reproject::Screen) };
    for (settings, word) in [(settings(Projection::Normal, Reproject::Screen), "normal"), (gathered, "cloud")] {
        let refused = Renderer::new(&device, &ball(3.0, 0.3), &settings).err().expect("it is refused");
        assert!(matches!(&refused, Error::Setting { .. }) && refused.to_string().contains(word), "{refused}");
    }
}
