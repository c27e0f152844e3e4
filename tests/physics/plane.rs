//! The infinite plane (a large square): collimated light, uniform light, white furnace.

use crate::common::*;
use glam::DVec3;
use translucent::Normalisation::{Energy, Jensen2001};
use translucent::reference::boundary::{Side, diffuse_reflectance, transmittance};
use translucent::reference::profile::material;
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
            let white = material(DVec3::splat(1e3), DVec3::ZERO, ior, Energy, 1e-5);
            let (world, surface) = plane(white, projection, 64, f64::to_radians(angle), angle == 0.0);
            let inputs = world.inputs();
            let light = estimate(&world, 256, |index, step| subsurface(&inputs, step, index, &surface));
            let reflected = 1.0 - transmittance(ior, f64::to_radians(angle).cos());
            let sum = reflected + light.mean.x;
            assert!((sum - 1.0).abs() < 2e-3, "n {ior} projection {projection} at {angle} degrees: {sum}");
        }
    }
}

#[test]
fn uniform_light_leaves_alike_in_all_directions() {
    let grey = matter(1.0, 0.95, 1.3, Energy);
    let total =
        translucent::reference::profile::Dipole::new(coefficients(1.0, 0.95).0, coefficients(1.0, 0.95).1, 1.3).total();
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
