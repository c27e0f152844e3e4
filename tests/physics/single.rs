//! Single scattering: the phase function, half-spaces against closed forms and quadrature, a sphere against a line
//! integral.

use crate::common::{World, estimate, icosphere, plane, quad, sun, valid};
use glam::{DVec3, Vec3};
use std::f64::consts::{LN_2, PI, TAU};
use translucent::reference::{
    boundary::transmittance,
    emitter::{ball, table},
    light::environment_cdf,
    math::integrate,
    single::{Scattering, phase, refracted, single},
};
use translucent::shared::*;

/// Three albedos and extinctions, of which the second is that of the tests' closed forms.
const ALBEDO: [f64; 3] = [0.9, 0.6, 0.3];
const EXTINCTION: [f64; 3] = [0.5, 2.0, 30.0];

fn matter(ior: f64, g: f64) -> Material {
    let scattering = DVec3::from(ALBEDO) * DVec3::from(EXTINCTION);
    let absorption = DVec3::from(EXTINCTION) - scattering;
    let of = Scattering::new(scattering * (1.0 - g), absorption, DVec3::splat(g));
    Material {
        ior: ior as f32,
        extinction: of.extinction.as_vec3(),
        scattering: of.scattering.as_vec3(),
        g: of.g.as_vec3(),
        flags: TRANSLUCENT,
        ..Default::default()
    }
}

/// The plane seen at an angle, in the dark.
fn half_space(ior: f64, g: f64, angle: f64) -> (World, Surface) {
    let (mut world, surface) = plane(matter(ior, g), PROJECTION_MIS, 64, angle, false);
    world.features.environment = ENVIRONMENT_NONE;
    (world, surface)
}

/// Mean over samples and pixels of the three channels, which must be the expected ones.
fn check(world: &World, surface: &Surface, samples: u32, expected: DVec3, what: &str) {
    let found = estimate(world, samples, |index, step| valid(single(&world.inputs(), step, index, surface)));
    for c in 0..3 {
        let (mean, error) = (found.mean[c], found.error[c]);
        assert!(
            (mean - expected[c]).abs() <= 4.5 * error + 1e-6 * expected[c],
            "{what}, {c}: {mean} +- {error} for {expected}"
        );
        assert!(error < 0.05 * expected[c], "{what}, {c}: {mean} +- {error} has no force");
    }
}

/// The closed form for parallel light of irradiance E = 1 from wi: albedo times this.
fn parallel(ior: f64, g: f64, wi: DVec3, wo: DVec3) -> f64 {
    let (inner, outer) = (refracted(wi, DVec3::Z, ior), refracted(wo, DVec3::Z, ior));
    let (Some(i), Some(o)) = (inner, outer) else { return 0.0 };
    let flux = transmittance(ior, wi.z) * transmittance(ior, wo.z) / (ior * ior);
    flux * phase(g, -i.dot(o)) * wi.z / (i.z + o.z)
}

fn direction(angle: f64, azimuth: f64) -> DVec3 {
    DVec3::new(angle.sin() * azimuth.cos(), angle.sin() * azimuth.sin(), angle.cos())
}

#[test]
fn phase_function() {
    for g in [0.0, 0.3, -0.9, 0.9, 0.999, -0.999] {
        // In the logarithm of the distance from the peak, which resolves it.
        let over = |f: &dyn Fn(f64) -> f64| {
            integrate(-40.0, LN_2, 96, |x| {
                let t = x.exp();
                let cos = if g < 0.0 { t - 1.0 } else { 1.0 - t };
                TAU * t * phase(g, cos) * f(cos)
            })
        };
        assert!((over(&|_| 1.0) - 1.0).abs() < 1e-2 * (1.0 - g.abs()) + 1e-6, "{g}: {}", over(&|_| 1.0));
        assert!((over(&|cos| cos) - g).abs() < 1e-2 * (1.0 - g.abs()) + 1e-6, "{g}: {}", over(&|cos| cos));
    }
}

#[test]
fn unreduced_coefficients() {
    let of = Scattering::new(DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.5, 0.0, 1.0), DVec3::new(0.0, 0.5, -0.5));
    assert_eq!(of.scattering, DVec3::new(1.0, 4.0, 2.0));
    assert_eq!(of.extinction, DVec3::new(1.5, 4.0, 3.0));
    let peaked = Scattering::new(DVec3::ONE, DVec3::ONE, DVec3::splat(0.99999));
    assert!((peaked.scattering * (1.0 - peaked.g) - 1.0).abs().max_element() < 1e-12, "sigma_s' is kept");
}

#[test]
fn lommel_and_seeliger() {
    for (mu0, mu) in [(1.0, 1.0), (0.5, 0.8), (0.1, 0.3), (0.9, 0.05)] {
        let (mut world, surface) = half_space(1.0, 0.0, f64::acos(mu));
        world.light(sun(-direction(f64::acos(mu0), 2.0), PI));
        check(&world, &surface, 512, DVec3::from(ALBEDO) / 4.0 * mu0 / (mu0 + mu), &format!("{mu0} {mu}"));
    }
}

#[test]
fn parallel_light_behind_a_boundary() {
    for ior in [1.0, 1.3, 1.5, 0.8] {
        for g in [0.0, 0.9, -0.9, 0.999, -0.999] {
            let (wi, wo) = (direction(0.7, 2.5), direction(0.4, 0.0));
            let (mut world, surface) = half_space(ior, g, 0.4);
            world.light(sun(-wi, 1.0));
            check(&world, &surface, 128, DVec3::from(ALBEDO) * parallel(ior, g, wi, wo), &format!("{ior} {g}"));
        }
    }
}

/// Light under radiance 1 from everywhere, over the albedo: over directions as the phase function has them about its peak.
fn uniform(ior: f64, g: f64, wo: DVec3) -> f64 {
    let Some(o) = refracted(wo, DVec3::Z, ior) else { return 0.0 };
    let peak = if g < 0.0 { o } else { -o };
    let (x, y) = peak.any_orthonormal_pair();
    let k = 1.0 - g.abs();
    let at = |u: f64, turn: f64| {
        // The inverse distribution function of the distance from the peak.
        let b = k + 2.0 * g.abs() * (1.0 - u);
        let t = k * u / b * (k * (1.0 + g.abs()) / b + k);
        let r = (t * (2.0 - t)).max(0.0).sqrt();
        let i = peak * (1.0 - t) + r * (x * (TAU * turn).cos() + y * (TAU * turn).sin());
        let sin2 = ior * ior * (1.0 - i.z * i.z);
        if i.z <= 0.0 || sin2 >= 1.0 { 0.0 } else { transmittance(ior, (1.0 - sin2).sqrt()) * i.z / (i.z + o.z) }
    };
    transmittance(ior, wo.z) * integrate(0.0, 1.0, 48, |u| integrate(0.0, 1.0, 6, |turn| at(u, turn)))
}

#[test]
fn uniform_light() {
    // An image of one colour is the same light, found by other directions.
    let texels = vec![Vec3::ONE; 32];
    for (image, ior, g) in [
        (false, 1.0, 0.0),
        (true, 1.0, 0.5),
        (false, 1.3, 0.4),
        (true, 1.5, -0.9),
        (false, 1.5, 0.0),
        (false, 1.5, -0.999),
        (true, 0.9, 0.3),
    ] {
        let (mut world, surface) = half_space(ior, g, 0.8);
        world.features.environment = if image { ENVIRONMENT_IMAGE } else { ENVIRONMENT_CONSTANT };
        world.environment = texels.clone();
        let (cdf, width, height) = environment_cdf(&texels, 8, 4);
        world.environment_cdf = cdf;
        (world.view.environment_width, world.view.environment_height) = (8, 4);
        (world.view.density_width, world.view.density_height) = (width, height);
        let expected = uniform(ior, g, direction(0.8, 0.0));
        // The discontinuous slopes of the quadrature.
        let slack = 3e-4;
        let found = estimate(&world, 512, |index, step| valid(single(&world.inputs(), step, index, &surface)));
        for c in 0..3 {
            let expected = ALBEDO[c] * expected;
            let (mean, error) = (found.mean[c], found.error[c]);
            let what = format!("{image} {ior} {g} {c}: {mean} +- {error} for {expected}");
            assert!((mean - expected).abs() <= 4.5 * error + slack * expected && error < 0.05 * expected, "{what}");
        }
    }
}

#[test]
fn an_emitter_is_a_light() {
    // So far and small that its light is parallel, and one so near that directions find it too.
    for (distance, size, samples) in [(60.0, 0.5, 128), (3.0, 2.0, 512)] {
        let (mut world, surface) = half_space(1.3, 0.3, 0.4);
        let wi = direction(0.7, 2.5);
        let middle = surface.position.as_dvec3() + distance * wi;
        let (x, y) = (wi.any_orthonormal_pair().0 * size, wi.any_orthonormal_pair().1 * size);
        let corners = [middle - x - y, middle + x - y, middle + x + y, middle - x + y];
        for corners in quad(corners) {
            // It shines towards the plane, and belongs to another set.
            let [a, b, c] = corners;
            let inwards = (b - a).cross(c - a).dot(wi) < 0.0;
            world.triangle(if inwards { [a, b, c] } else { [a, c, b] });
            let last = world.triangles.len() - 1;
            world.triangles[last].set = 1;
            world.shadings[last].material = 1;
        }
        world.materials.push(Material { emission: Vec3::ONE, ..Default::default() });
        let emitters = table(&world.triangles, &world.shadings, &world.materials);
        (world.view.emitter_count, world.features.emitters) = (emitters.len() as u32, 1);
        (world.view.emitters_centre, world.view.emitters_radius2) = ball(&world.triangles, &emitters);
        world.emitters = emitters;
        // Over the emitter's area, as seen from the plane; the depth of the scattering is nothing beside the distance.
        world.materials[0].extinction *= 1e3;
        world.materials[0].scattering *= 1e3;
        let wo = direction(0.4, 0.0);
        let at = |u: f64, v: f64| {
            let to = middle + u * x + v * y - surface.position.as_dvec3();
            let w = to.normalize();
            size * size * w.dot(wi) / to.length_squared() * parallel(1.3, 0.3, w, wo)
        };
        let expected = integrate(-1.0, 1.0, 1, |u| integrate(-1.0, 1.0, 1, |v| at(u, v)));
        let found = estimate(&world, samples, |index, step| valid(single(&world.inputs(), step, index, &surface)));
        for c in 0..3 {
            let (mean, error, expected) = (found.mean[c], found.error[c], ALBEDO[c] * expected);
            // The scattering lies up to 1e-2 deep.
            let allowed = 4.5 * error + 2e-3 * expected;
            assert!((mean - expected).abs() <= allowed, "{distance}, {c}: {mean} +- {error} for {expected}");
            assert!(error < 0.05 * expected, "{distance}, {c}: {mean} +- {error}");
        }
    }
}

#[test]
fn totals() {
    // Over view directions by quadrature: the closed forms are those of Lommel and Seeliger.
    let mu0 = 0.6f64;
    let collimated = TAU
        * integrate(0.0, 1.0, 16, |mu| mu * parallel(1.0, 0.0, direction(mu0.acos(), 0.0), direction(mu.acos(), 1.0)));
    let expected = mu0 / 2.0 * (1.0 - mu0 * (1.0 + 1.0 / mu0).ln());
    assert!((collimated - expected).abs() < 1e-5, "{collimated} {expected}");
    let lambert = 2.0 * integrate(0.0, 1.0, 4, |mu| mu * uniform(1.0, 0.0, direction(mu.acos(), 0.0)));
    let expected = 2.0 / 3.0 * (1.0 - LN_2);
    assert!((lambert - expected).abs() < 1e-4, "{lambert} {expected}");
}

#[test]
fn extreme_extinctions() {
    // The plane is 400 wide, so that even long paths end at it.
    for scale in [1e-1, 1.0, 1e3, 1e5, 1e7] {
        let (mut world, surface) = half_space(1.3, 0.2, 0.4);
        world.materials[0].extinction *= scale;
        world.materials[0].scattering *= scale;
        let wi = direction(0.7, 2.5);
        world.light(sun(-wi, 1.0));
        // In the thinnest matter the farthest light comes in beside the plane; of the densest, the position's rounding.
        let expected = parallel(1.3, 0.2, wi, direction(0.4, 0.0));
        let found = estimate(&world, 128, |index, step| valid(single(&world.inputs(), step, index, &surface)));
        for c in 0..3 {
            let (mean, error, expected) = (found.mean[c], found.error[c], ALBEDO[c] * expected);
            assert!(
                (mean - expected).abs() <= 4.5 * error + 1e-4 * expected,
                "{scale}, {c}: {mean} +- {error} for {expected}"
            );
        }
    }
}

#[test]
fn sphere_without_a_boundary() {
    // sigma_s p E int e^(-sigma (s + s_i)) ds along the ray through a unit sphere, s_i to the surface by geometry.
    let mut world = World::new(matter(1.0, 0.4), PROJECTION_MIS, 64);
    world.features.environment = ENVIRONMENT_NONE;
    icosphere(4).into_iter().for_each(|corners| world.triangle(corners));
    let [a, b, c] = icosphere(4)[70];
    let point = (a + b + c) / 3.0;
    let (x, y) = point.normalize().any_orthonormal_pair();
    let (wo, wi) = ((point + 0.6 * x).normalize(), (0.7 * point + y - 0.5 * x).normalize());
    world.light(sun(-wi, 1.0));
    world.look_along(-wo, point, 5.0, 1e-6);
    let surface = world.surface(70, point);
    let length = 2.0 * point.dot(wo);
    let sphere = |sigma: f64| {
        integrate(0.0, length, 32, |s| {
            let p = point - s * wo;
            let b = p.dot(wi);
            let out = -b + (b * b + 1.0 - p.length_squared()).max(0.0).sqrt();
            sigma * (-sigma * (s + out)).exp()
        })
    };
    let found = estimate(&world, 48, |index, step| valid(single(&world.inputs(), step, index, &surface)));
    for c in 0..3 {
        let expected = ALBEDO[c] * phase(0.4, -wi.dot(wo)) * sphere(EXTINCTION[c]);
        let (mean, error) = (found.mean[c], found.error[c]);
        // The mesh lies up to 1e-3 below the sphere.
        let slack = 3e-3 * EXTINCTION[c].min(10.0);
        assert!((mean - expected).abs() <= 4.5 * error + slack * expected, "{c}: {mean} +- {error} for {expected}");
        assert!(error < 0.05 * expected, "{c}: {mean} +- {error}");
    }
}
