//! Light that was scattered once, against its closed form.

use crate::{
    channel, mean_and_error, render,
    scenes::{Eye, Mesh, gltf, matter, scene, sun},
};
use glam::DVec3;
use translucent::{Model, Settings, SingleScattering};

#[test]
fn a_plane_follows_lommel_and_seeliger() {
    // Isotropic matter whose boundary does nothing: L = alpha / (4 pi) mu0 / (mu0 + mu) E, here with E = pi (H. von
    // Seeliger 1887; S. Chandrasekhar, "Radiative Transfer", 1950, as the first order in alpha of the law of diffuse
    // reflection).
    let albedo = [0.2, 0.5, 0.9];
    let mut slab = Mesh::default();
    slab.cuboid(DVec3::splat(-200.0), DVec3::new(200.0, 200.0, 0.0), 1);
    let towards = |degrees: f64, turn: f64| {
        let angle = degrees.to_radians();
        DVec3::new(angle.sin() * turn.cos(), angle.sin() * turn.sin(), angle.cos())
    };
    for (light, eye) in [(0.0, 0.0), (60.0, 0.0), (30.0, 70.0), (85.0, 85.0)] {
        let at = DVec3::new(3.0, 7.0, 0.0);
        let eye_at = Eye { eye: at + 10.0 * towards(eye, 2.0), at, lens: 1e-3 };
        let lights = [(sun(), towards(light, 0.0), DVec3::ZERO)];
        let scene =
            scene(&gltf(&[(slab.clone(), 0)], &[matter(albedo, albedo.map(|a| 1.0 - a), 1.0)], &lights, &eye_at));
        let [with, without] = [SingleScattering::On, SingleScattering::Off].map(|single_scattering| {
            let model = Model::Standard;
            let settings = Settings {
                resolution: Some((8, 8)),
                seed: 3,
                model,
                single_scattering,
                reuse: Some(1),
                ..Settings::default()
            };
            render(&scene, &settings, 128)
        });
        let (mu0, mu) = (light.to_radians().cos(), eye.to_radians().cos());
        for (alpha, name) in albedo.into_iter().zip(["subsurface.R", "subsurface.G", "subsurface.B"]) {
            // What was scattered more often is the same in both images, sample by sample.
            let pairs = channel(&with, name).iter().zip(channel(&without, name));
            let once: Vec<f64> = pairs.map(|(with, without)| f64::from(*with) - f64::from(*without)).collect();
            let (mean, error) = mean_and_error(&once);
            let expected = alpha / 4.0 * mu0 / (mu0 + mu);
            // The view's angle, by half the lens.
            let slack = 1e-3 * expected + 1e-6;
            let what = format!("light at {light}, eye at {eye}, alpha {alpha}: {mean} +- {error}, not {expected}");
            assert!((mean - expected).abs() < 4.0 * error + slack, "{what}");
            assert!(error < 0.02 * expected, "no force: {what}");
        }
    }
}
