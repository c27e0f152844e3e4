//! The infinite plane (a large square): collimated light, uniform light, white furnace.

use crate::common::*;
use glam::DVec3;
use translucent::Normalisation::{Energy, Jensen2001};
use translucent::reference::boundary::{Side, diffuse_reflectance, transmittance};
use translucent::reference::profile::{Dipole, Radial};
use translucent::shared::*;

const PROJECTIONS: [u32; 3] = [PROJECTION_MIS, PROJECTION_CAMERA, PROJECTION_NORMAL];

/// Values for alpha' = .95, n = 1.3, E = pi, seen along the normal, at 0 and 60 degrees of incidence.
const GOLDEN: [(f64, f64); 2] = [(0.0, 0.418550831), (60.0, 0.201528868)];

#[test]
fn collimated_light() {
    for projection in PROJECTIONS {
        for (angle, expected) in GOLDEN {
            let normalised = [Energy, Jensen2001].map(|normalisation| {
                let (mut world, surface) = plane(matter(1.0, 0.95, 1.3, normalisation), projection, 64, 0.0, true);
                world.features.environment = ENVIRONMENT_NONE;
                let (sin, cos) = f64::to_radians(angle).sin_cos();
                world.light(sun(DVec3::new(sin, 0.0, -cos), std::f64::consts::PI));
                let inputs = world.inputs();
                estimate(&world, 256, |index, step| subsurface(&inputs, step, index, &surface))
            });
            // f32 materials; 1e-6 of the energy lies outside the ball.
            normalised[0].check(expected, 3e-6, &format!("projection {projection} at {angle} degrees"));
            let ratio = normalised[1].mean.x / normalised[0].mean.x;
            let rho = diffuse_reflectance(1.3, Side::Outside);
            assert!((ratio - (1.0 - rho)).abs() < 3e-7, "jensen2001 / energy: {ratio}");
        }
    }
}

#[test]
fn exact_sampling_has_no_variance_on_a_plane() {
    let (mut world, surface) = plane(matter(1.0, 0.95, 1.3, Energy), PROJECTION_NORMAL, 8, 0.0, true);
    world.features.environment = ENVIRONMENT_NONE;
    world.light(sun(-DVec3::Z, std::f64::consts::PI));
    let inputs = world.inputs();
    let spread = estimate(&world, 64, |index, step| {
        let one = subsurface(&inputs, step, index, &surface).x;
        // Points beyond the ball, 1e-6 of them, are zero; none is among these.
        assert!((one / GOLDEN[0].1 - 1.0).abs() < 3e-6, "{one}");
        DVec3::splat(one)
    });
    assert!(spread.error.x < 1e-6);
}

#[test]
fn white_furnace() {
    // No absorption: what is not reflected comes back, F + Lo / Li = 1. The mean free path is short, because a third of
    // a percent of the energy lies beyond 1,000 of them.
    for ior in [1.0, 1.3, 1.5] {
        for (projection, angle) in
            [(PROJECTION_MIS, 0.0), (PROJECTION_MIS, 75.0), (PROJECTION_NORMAL, 0.0), (PROJECTION_NORMAL, 75.0)]
        {
            let white = standard(DVec3::splat(1e3), DVec3::ZERO, ior, Energy, 1e-5);
            let (world, surface) = plane(white, projection, 64, f64::to_radians(angle), angle == 0.0);
            let inputs = world.inputs();
            let light = estimate(&world, 256, |index, step| subsurface(&inputs, step, index, &surface));
            // What enters comes out, but for what lies beyond the ball.
            let entered = transmittance(ior, f64::to_radians(angle).cos());
            light.check(entered, 2e-5, &format!("n {ior} projection {projection} at {angle} degrees"));
            assert!(light.error.x < 2e-3, "{light:?}");
        }
    }
}

#[test]
fn uniform_light_leaves_alike_in_all_directions() {
    let grey = matter(1.0, 0.95, 1.3, Energy);
    let total = Dipole::new(coefficients(1.0, 0.95).0, coefficients(1.0, 0.95).1, 1.3).total();
    for projection in PROJECTIONS {
        for angle in [0.0f64, 60.0, 85.0] {
            // The eye is far: on a plane even the exponential of the method as given is unbiased, and finite.
            let (world, surface) = plane(grey, projection, 64, angle.to_radians(), angle < 70.0);
            let inputs = world.inputs();
            let light = estimate(&world, 512, |index, step| subsurface(&inputs, step, index, &surface));
            let expected = transmittance(1.3, angle.to_radians().cos()) * total;
            light.check(expected, 1e-5, &format!("projection {projection} at {angle} degrees"));
            assert!(light.error.x < 5e-3 * expected, "{light:?}");
        }
    }
}

/// What a plane with the interpolated normal `shading` shows under a lamp at `wi`, over E Rd / (pi (1 - rho_e)).
fn shaded(shading: DVec3, wo_angle: f64, wi: DVec3) -> f64 {
    let (mut world, surface) = plane(matter(1.0, 0.95, 1.3, Energy), PROJECTION_MIS, 64, wo_angle, false);
    for s in &mut world.shadings {
        (s.normal0, s.normal1, s.normal2) = (shading.as_vec3(), shading.as_vec3(), shading.as_vec3());
    }
    world.features.environment = ENVIRONMENT_NONE;
    world.light(sun(-wi, 1.0));
    let inputs = world.inputs();
    let found = estimate(&world, 256, |index, step| subsurface(&inputs, step, index, &surface));
    let (sigma_s, sigma_a) = coefficients(1.0, 0.95);
    let total = Dipole::new(sigma_s, sigma_a, 1.3).total();
    let scale = total / (std::f64::consts::PI * (1.0 - diffuse_reflectance(1.3, Side::Outside)));
    assert!(found.error.x <= 2e-3 * found.mean.x, "{found:?}");
    found.mean.x / scale
}

#[test]
fn interpolated_normals_are_in_fresnel_and_cosines_alone() {
    let shading = DVec3::new(0.5, 0.1, 1.0).normalize();
    let toward = |x: f64, z: f64| DVec3::new(x, 0.0, z).normalize();
    let entering = |n: DVec3, wi: DVec3| transmittance(1.3, n.dot(wi)) * n.dot(wi);
    let close = |found: f64, expected: f64, what: &str| {
        assert!((found - expected).abs() <= 0.01 * expected, "{what}: {found} for {expected}");
    };
    let wi = toward(-0.4, 1.0);
    let wo = |angle: f64| DVec3::new(angle.sin(), 0.0, angle.cos());
    let leaving = |n: DVec3, angle: f64| transmittance(1.3, n.dot(wo(angle)));
    close(shaded(shading, 0.4, wi), leaving(shading, 0.4) * entering(shading, wi), "tilted");
    // Below the geometric horizon, and above it but below the interpolated one.
    assert_eq!(shaded(shading, 0.4, toward(1.0, -0.05)), 0.0);
    assert_eq!(shaded(shading, 0.4, toward(-1.0, 0.2)), 0.0);
    // Seen from where the interpolated normal faces away, the exit uses the geometric one.
    close(shaded(shading, -1.4, wi), leaving(DVec3::Z, -1.4) * entering(shading, wi), "seen from behind");
}

#[test]
fn interpolated_normals_are_those_of_the_hit() {
    // Matter with a mean free path of 1e-3 is lit where it is seen: the irradiance there follows the three normals.
    let (sigma_s, sigma_a) = coefficients(2e3, 0.95);
    let dense = standard(DVec3::splat(sigma_s), DVec3::splat(sigma_a), 1.0, Energy, 1e-6);
    let mut world = World::new(dense, PROJECTION_MIS, 64);
    world.features.environment = ENVIRONMENT_NONE;
    world.triangle([DVec3::ZERO, DVec3::X * 4.0, DVec3::Y * 4.0]);
    let normals = [(0.0, 0.0), (0.6, 0.0), (0.0, -0.5)].map(|(x, y)| DVec3::new(x, y, 1.0).normalize());
    let s = &mut world.shadings[0];
    (s.normal0, s.normal1, s.normal2) = (normals[0].as_vec3(), normals[1].as_vec3(), normals[2].as_vec3());
    let wi = DVec3::new(0.5, -0.3, 1.0).normalize();
    world.light(sun(-wi, 1.0));
    let total = Dipole::new(sigma_s, sigma_a, 1.0).total();
    for weights in [[0.2, 0.5, 0.3], [0.6, 0.1, 0.3]] {
        let at = DVec3::new(4.0 * weights[1], 4.0 * weights[2], 0.0);
        world.look(at + 3.0 * DVec3::Z, at, 1e-4);
        let surface = world.surface(0, at);
        let inputs = world.inputs();
        let found = estimate(&world, 128, |index, step| subsurface(&inputs, step, index, &surface));
        let normal = (0..3).map(|k| normals[k] * weights[k]).sum::<DVec3>().normalize();
        found.check(normal.dot(wi) * total / std::f64::consts::PI, 1e-3, "interpolated");
        assert!(found.error.x < 5e-3 * found.mean.x);
    }
}

#[test]
fn light_below_the_geometric_horizon_counts_nothing() {
    // A hit on a triangle so small that it does not shade itself, with an interpolated normal that leans over.
    let mut world = World::new(matter(1.0, 0.95, 1.3, Energy), PROJECTION_NORMAL, 1);
    world.features.environment = ENVIRONMENT_NONE;
    world.triangle([DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, -1.0, 0.0), DVec3::new(0.0, 1.0, 0.0)]);
    let at = DVec3::X * 3.0;
    world.triangle([at, at + 1e-5 * DVec3::X, at + 1e-5 * DVec3::Y]);
    let leaning = DVec3::new(1.0, 0.0, 1.0).normalize().as_vec3();
    let s = &mut world.shadings[1];
    (s.normal0, s.normal1, s.normal2) = (leaning, leaning, leaning);
    world.look(DVec3::Z * 5.0, DVec3::ZERO, 1e-3);
    let surface = world.surface(0, DVec3::ZERO);
    let probe = Probe {
        offset: (at + DVec3::Z).as_vec3(),
        direction: -glam::Vec3::Z,
        t_min: -10.0,
        t_max: 10.0,
        radius: 3.0,
        ..Probe::default()
    };
    let mut hits = Hits { count: 1, ..Default::default() };
    (hits.t[0], hits.triangle[0]) = (1.0, 1);
    for (height, lit) in [(0.05, true), (-0.05, false)] {
        let mut world = world.clone();
        world.light(sun(DVec3::new(-1.0, 0.0, -height), 1.0));
        let inputs = world.inputs();
        let step = translucent::reference::step(&inputs, 0, 0..1, 0..1);
        let found = translucent::reference::accumulate::accumulate(&inputs, &step, 0, &surface, &probe, &hits);
        assert_eq!(valid(found).x > 0.0, lit, "height {height}: {found:?}");
    }
}
