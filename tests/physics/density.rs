//! Densities of the techniques: Jacobians by finite differences, and expected hits against those that the sampler makes.

use crate::common::*;
use glam::{DVec3, dvec3};
use rayon::prelude::*;
use translucent::Normalisation::Energy;
use translucent::reference::math::{basis, integrate};
use translucent::reference::profile::plane_density;
use translucent::reference::projection::*;
use translucent::reference::reproject::reproject;
use translucent::reference::sample::sample;
use translucent::reference::step;
use translucent::shared::*;

/// Where the line of `technique` through the point (a, b) of its plane meets the unit sphere around `centre` nearest to
/// the plane (or first, for the camera); everything relative to xo = 0.
fn carry(technique: usize, seen: &Seen, a: f64, b: f64, centre: DVec3) -> DVec3 {
    let [n, t, s] = seen.axes;
    let (x, y, axis) = [(t, s, n), (s, n, t), (n, t, s), (t, s, n)][technique];
    let origin = a * x + b * y;
    let direction = if technique == CAMERA { (origin * seen.inverse_distance - seen.wo).normalize() } else { axis };
    let to = origin - centre;
    let middle = -to.dot(direction);
    let half = (1.0 - (to + middle * direction).length_squared()).sqrt();
    let (near, far) = (middle - half, middle + half);
    origin + direction * if technique != CAMERA && near.abs() > far.abs() { far } else { near }
}

#[test]
fn densities_are_the_planes_over_the_jacobian() {
    // A unit sphere below xo. |dx/da x dx/db| by central differences is dA / dA_plane.
    let material = matter(2.0, 0.9, 1.3, Energy);
    for (wo, inverse_distance) in [
        (dvec3(0.0, 0.0, 1.0), 0.0),
        (dvec3(0.3, 0.2, 1.0), 0.4),
        (dvec3(-0.8, 0.5, 0.6), 0.02),
        (dvec3(0.7, 0.0, 0.5), 0.0),
    ] {
        let wo = wo.normalize();
        let normal = dvec3(0.1, -0.2, 0.97).normalize();
        let (u, v) = basis(normal);
        let seen = Seen {
            position: DVec3::ZERO,
            wo,
            eye_distance: 1.0 / inverse_distance,
            inverse_distance,
            side: 1.0,
            normal,
            shading_normal: normal,
            axes: [normal, u, v],
        };
        for technique in [NORMAL, TANGENT_U, TANGENT_V, CAMERA] {
            for (a, b) in [(0.1f64, 0.2f64), (-0.3, 0.25), (0.02, -0.15)] {
                // The tangent planes cut the sphere only below xo.
                let (a, b) = match technique {
                    TANGENT_U => (a, -0.3 - b.abs()),
                    TANGENT_V => (-0.3 - a.abs(), b),
                    _ => (a, b),
                };
                let x = |a: f64, b: f64| carry(technique, &seen, a, b, -normal);
                let h = 1e-5;
                let da = (x(a + h, b) - x(a - h, b)) / (2.0 * h);
                let db = (x(a, b + h) - x(a, b - h)) / (2.0 * h);
                let expected = plane_density((&material).into(), a.hypot(b)) / da.cross(db).length();
                let at = x(a, b);
                let found = density(technique, (&material).into(), &seen, at, (at + normal).normalize());
                assert!(
                    (found / expected - 1.0).abs() < 1e-7,
                    "technique {technique} 1/l {inverse_distance} ({a}, {b}): {found} for {expected}"
                );
            }
        }
    }
}

#[test]
fn behind_the_eye_there_is_no_density() {
    let material = matter(2.0, 0.9, 1.3, Energy);
    let (world, surface) = plane(material, PROJECTION_MIS, 1, 0.3, true);
    let seen = seen(&world.inputs(), &surface);
    let behind = seen.wo * (seen.eye_distance * 1.01);
    assert_eq!(density(CAMERA, (&material).into(), &seen, behind, DVec3::Z), 0.0);
    assert!(density(CAMERA, (&material).into(), &seen, behind * 0.9, DVec3::Z) >= 0.0);
}

#[test]
fn a_density_is_one_over_the_plane() {
    // N and C each carry all points of their plane to it, U and V none.
    let material = matter(2.0, 0.9, 1.3, Energy);
    let (world, surface) = plane(material, PROJECTION_MIS, 1, 1.0, true);
    let seen = seen(&world.inputs(), &surface);
    let over_plane = |p: &dyn Fn(DVec3) -> f64| {
        integrate(-9.0, 5.0, 60, |x| {
            let r = x.exp();
            integrate(0.0, std::f64::consts::TAU, 2, |phi| p(dvec3(r * phi.cos(), r * phi.sin(), 0.0))) * r * r
        })
    };
    let expected = [1.0, 0.0, 0.0, 1.0];
    for (technique, expected) in expected.into_iter().enumerate() {
        let found = over_plane(&|delta| density(technique, (&material).into(), &seen, delta, DVec3::Z));
        assert!((found - expected).abs() < 1e-6, "technique {technique}: {found}");
    }
    let fractions = fractions(PROJECTION_MIS, seen.normal.dot(seen.wo));
    let mixture = over_plane(&|delta| mixture_density(PROJECTION_MIS, (&material).into(), &seen, delta, DVec3::Z));
    assert!((mixture - fractions[NORMAL] - fractions[CAMERA]).abs() < 1e-6);
}

#[test]
fn fractions_are_shares() {
    for cos in [0.0, 1e-3, 0.1, 0.2, 0.3, 1.0] {
        for projection in [PROJECTION_MIS, PROJECTION_CAMERA, PROJECTION_NORMAL] {
            let fractions = fractions(projection, cos);
            assert!((fractions.iter().sum::<f64>() - 1.0).abs() < 1e-15);
            assert!(fractions.iter().all(|&f| f >= 0.0));
        }
    }
    assert_eq!(fractions(PROJECTION_MIS, 0.0)[CAMERA], 0.0);
    assert!((fractions(PROJECTION_MIS, 1.0)[CAMERA] - 0.4).abs() < 1e-7);
    // No jump, no kink: the given cubic has slope 0 at both ends.
    assert!(fractions(PROJECTION_MIS, 1e-4)[CAMERA] < 1e-6);
    assert!(0.4 - fractions(PROJECTION_MIS, 0.3 - 1e-4)[CAMERA] < 1e-6);
}

#[test]
fn hits_arrive_with_the_mixture_density() {
    // The expected number of hits on a face of a cube is the integral of the density over it. Three views: from outside,
    // the orthographic camera at a grazing angle, and from inside.
    let material = {
        let (sigma_s, sigma_a) = coefficients(3.0, 0.9);
        standard(dvec3(sigma_s, 2.0 * sigma_s, 0.0), DVec3::splat(sigma_a), 1.3, Energy, 0.0)
    };
    let faces: Vec<[DVec3; 3]> = cuboid(-DVec3::ONE, DVec3::ONE);
    let at = dvec3(0.55, 0.3, 1.0);
    let views: [&dyn Fn(&mut World); 3] = [
        &|world| world.look(dvec3(2.5, 1.5, 4.0), at, 0.01),
        &|world| world.look_along(dvec3(-1.0, -0.4, -0.2), at, 8.0, 0.01),
        &|world| world.look(dvec3(-0.2, 0.1, -0.5), at, 0.01),
    ];
    for (number, view) in views.into_iter().enumerate() {
        let mut world = World::new(material, PROJECTION_MIS, 64);
        faces.iter().for_each(|t| world.triangle(*t));
        view(&mut world);
        let surface = world.surface(10, at);
        let inputs = world.inputs();
        let seen = seen(&inputs, &surface);
        assert_eq!(seen.side, if number == 2 { -1.0 } else { 1.0 });
        let expected: Vec<f64> = (0..6)
            .into_par_iter()
            .map(|face| {
                let [a, b, c] = faces[2 * face];
                let d = faces[2 * face + 1][2];
                assert_eq!(a + c, b + d);
                let normal = (b - a).cross(d - a).normalize();
                // Panels meet at xo's coordinates, around which the density is peaked.
                let split = |edge: DVec3| ((at - a).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
                let (su, sv) = (split(b - a), split(d - a));
                let half = |low: f64, high: f64, f: &dyn Fn(f64) -> f64| {
                    if high > low { integrate(low, high, 6, f) } else { 0.0 }
                };
                let both = |s: f64, f: &dyn Fn(f64) -> f64| half(0.0, s, f) + half(s, 1.0, f);
                both(su, &|u| {
                    both(sv, &|v| {
                        let x = a + (b - a) * u + (d - a) * v;
                        mixture_density(PROJECTION_MIS, (&material).into(), &seen, x - at, normal)
                    })
                }) * 4.0
            })
            .collect();
        for (face, expected) in expected.into_iter().enumerate() {
            let found = estimate(&world, 256, |index, step| {
                let probe = sample(&inputs, step, index, &surface);
                let hits = reproject(&inputs, step, index, &surface, &probe);
                let on_face = hits.triangle[..hits.count as usize].iter().filter(|&&t| t as usize / 2 == face);
                DVec3::splat(on_face.count() as f64)
            });
            // The density is smooth on the scale of the panels; seen from inside a face is divided by a pole of q.
            found.check(expected, 1e-3, &format!("view {number} face {face}"));
        }
    }
}

#[test]
fn probes_stay_in_the_ball() {
    for projection in [PROJECTION_MIS, PROJECTION_NORMAL] {
        let material = matter(3.0, 0.9, 1.3, Energy);
        let (world, surface) = plane(material, projection, 16, 1.2, true);
        let radius = f64::from(material.radius_max);
        let inputs = world.inputs();
        for sample_index in 0..2000 {
            let step = step(&inputs, sample_index, 0..1, 0..2000);
            let probe = sample(&inputs, &step, sample_index % 16, &surface);
            assert!((probe.direction.length() - 1.0).abs() < 1e-6);
            for t in [probe.t_min, probe.t_max] {
                let end = (probe.offset.as_dvec3() + f64::from(t) * probe.direction.as_dvec3()).length();
                assert!(probe.t_min > probe.t_max || (end / radius - 1.0).abs() < 1e-5, "{end} for {radius}");
            }
        }
    }
}
