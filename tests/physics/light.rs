//! Light that arrives and light that the first surface reflects: delta lights, the environment's density, both lobes.

use crate::common::*;
use glam::{DMat3, DVec3, Vec3, dvec3, vec3};
use std::f64::consts::{PI, TAU};
use translucent::Normalisation::Energy;
use translucent::reference::boundary::{fresnel, transmittance};
use translucent::reference::emitter::{ball, share};
use translucent::reference::light::*;
use translucent::reference::math::cosine_direction;
use translucent::reference::profile::{Dipole, Radial};
use translucent::reference::random::hash;
use translucent::reference::reflect::reflect;
use translucent::shared::*;

/// Installs an environment image, rotated about a skew axis.
fn install(world: &mut World, width: u32, height: u32, radiance: Vec<Vec3>) {
    let (cdf, density_width, density_height) = environment_cdf(&radiance, width, height);
    let rows = DMat3::from_axis_angle(dvec3(1.0, 2.0, -0.5).normalize(), 0.7).transpose().as_mat3();
    world.features.environment = ENVIRONMENT_IMAGE;
    (world.environment, world.environment_cdf) = (radiance, cdf);
    let view = &mut world.view;
    (view.environment_width, view.environment_height) = (width, height);
    (view.density_width, view.density_height) = (density_width, density_height);
    (view.environment_row0, view.environment_row1, view.environment_row2) = (rows.x_axis, rows.y_axis, rows.z_axis);
}

/// 16 x 8 texels of a sky with one bright texel and a black row.
fn sky() -> Vec<Vec3> {
    (0..128u32)
        .map(|i| match (i % 16, i / 16) {
            (5, 2) => vec3(40.0, 30.0, 20.0),
            (_, 6) => Vec3::ZERO,
            _ => vec3(0.2, 0.5, 1.0) * (hash(i) % 100) as f32 / 100.0,
        })
        .collect()
}

fn on_plane(projection: u32) -> (World, Surface) {
    plane(matter(1.0, 0.95, 1.3, Energy), projection, 64, 0.5, true)
}

#[test]
fn delta_lights_fall_off() {
    let point = Light { position: vec3(0.0, 0.0, 2.0), intensity: Vec3::splat(8.0), ..Default::default() };
    let at = |light: &Light, x: DVec3| delta(light, x);
    let found = at(&point, DVec3::ZERO);
    assert_eq!((found.wi, found.irradiance, found.distance), (DVec3::Z, DVec3::splat(2.0), 2.0));
    let ranged = Light { inverse_range: 0.25, ..point };
    assert!((at(&ranged, DVec3::ZERO).irradiance.x - 2.0 * (1.0 - 1.0 / 16.0)).abs() < 1e-12);
    assert_eq!(at(&ranged, dvec3(0.0, 0.0, -3.0)).irradiance, DVec3::ZERO);
    // Inner and outer cosine .9 and .7: scale 5, offset -3.5.
    let spot = Light { kind: LIGHT_SPOT, direction: -Vec3::Z, spot_scale: 5.0, spot_offset: -3.5, ..point };
    for (cos, factor) in [(0.95f64, 1.0), (0.8, 0.25), (0.6, 0.0)] {
        let x = dvec3((1.0 - cos * cos).sqrt(), 0.0, 2.0 - cos) * dvec3(2.0, 2.0, 2.0) - dvec3(0.0, 0.0, 2.0);
        let found = at(&spot, x);
        assert!((found.irradiance.x - 2.0 * factor).abs() < 1e-6, "cos {cos}: {found:?}");
    }
    let found = at(&sun(dvec3(0.0, 3.0, -4.0), 7.0), dvec3(9.0, 9.0, 9.0));
    assert!(found.wi.distance(dvec3(0.0, -0.6, 0.8)) < 1e-7);
    assert_eq!((found.irradiance, found.distance), (DVec3::splat(7.0), FAR));
}

#[test]
fn environment_is_looked_up_where_it_lies() {
    let (mut world, _) = on_plane(PROJECTION_MIS);
    install(&mut world, 16, 8, sky());
    world.view.environment_scale = Vec3::splat(2.0);
    let rows = [world.view.environment_row0, world.view.environment_row1, world.view.environment_row2];
    let direction = |u: f64, v: f64| {
        let (phi, theta) = (TAU * (u - 0.5), PI * v);
        let e = [theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin()];
        rows.iter().zip(e).map(|(row, e)| row.as_dvec3() * e).sum::<DVec3>()
    };
    let texel = |i: usize, j: usize| 2.0 * world.environment[j * 16 + i].as_dvec3();
    let look = |u: f64, v: f64| environment(&world.inputs(), direction(u, v));
    let close = |a: DVec3, b: DVec3| assert!(a.distance(b) < 1e-4, "{a} for {b}");
    close(look(5.5 / 16.0, 2.5 / 8.0), texel(5, 2));
    close(look(6.0 / 16.0, 2.5 / 8.0), (texel(5, 2) + texel(6, 2)) / 2.0);
    close(look(5.5 / 16.0, 3.0 / 8.0), (texel(5, 2) + texel(5, 3)) / 2.0);
    // u wraps, v ends.
    close(look(1e-7, 2.5 / 8.0), (texel(15, 2) + texel(0, 2)) / 2.0);
    close(look(3.5 / 16.0, 0.2 / 8.0), texel(3, 0));
}

#[test]
fn environment_density_is_a_density_and_is_sampled() {
    let (mut world, _) = on_plane(PROJECTION_MIS);
    install(&mut world, 16, 8, sky());
    let inputs = world.inputs();
    // Over the sphere in cells of the image: 8 x 4 points in each.
    let rows = [world.view.environment_row0, world.view.environment_row1, world.view.environment_row2];
    let mut total = 0.0;
    let mut mean = DVec3::ZERO;
    let (columns, lines) = (128, 256);
    for i in 0..columns {
        for j in 0..lines {
            let (u, v) = ((f64::from(i) + 0.5) / f64::from(columns), (f64::from(j) + 0.5) / f64::from(lines));
            let (phi, theta) = (TAU * (u - 0.5), PI * v);
            let e = [theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin()];
            let d = rows.iter().zip(e).map(|(row, e)| row.as_dvec3() * e).sum::<DVec3>();
            let weight = environment_pdf(&inputs, d) * 2.0 * PI * PI * theta.sin() / f64::from(columns * lines);
            total += weight;
            mean += d * weight;
        }
    }
    assert!((total - 1.0).abs() < 1e-5, "{total}");
    let side = 256;
    let mut sampled = DVec3::ZERO;
    for i in 0..side * side {
        let (u1, u2) = (f64::from(i % side) + 0.5, f64::from(i / side) + 0.5);
        let d = sample_environment(&inputs, u1 / f64::from(side), u2 / f64::from(side));
        assert!((d.length() - 1.0).abs() < 1e-6);
        assert!(environment_pdf(&inputs, d) > 0.0);
        sampled += d / f64::from(side * side);
    }
    // A grid of 256^2 points against quadrature with 128 x 256: both within a cell's width / 256.
    assert!(sampled.distance(mean) < 3e-3, "{sampled} for {mean}");
}

#[test]
fn environment_table_is_reduced_by_area() {
    // 1,500 texels over 1,024 cells do not divide; a constant image still has equal cells, and one texel its part.
    let (table, width, height) = environment_cdf(&vec![Vec3::ONE; 1500 * 3], 1500, 3);
    assert_eq!((width, height), (1024, 3));
    assert_eq!(table.len(), 4 + 3 * 1025);
    let marginal = [0.0, 0.25, 0.75, 1.0];
    assert!(table[..4].iter().zip(marginal).all(|(a, b)| (a - b).abs() < 1e-6), "sin theta of three rows");
    for row in table[4..].chunks(1025) {
        assert!(row.iter().enumerate().all(|(i, &c)| (c - i as f32 / 1024.0).abs() < 1e-6));
    }
    let mut one = vec![Vec3::ZERO; 2048];
    one[7] = Vec3::ONE;
    let (table, _, _) = environment_cdf(&one, 2048, 1);
    // As a tent of half width 1 about 7.5: an eighth of it lies beyond 8.
    assert_eq!((table[2 + 3], table[2 + 4], table[2 + 5]), (0.0, 0.875, 1.0), "texel 7 is in cells 3 and 4");
    let (black, _, _) = environment_cdf(&[Vec3::ZERO; 8], 4, 2);
    assert_eq!(black, [0.0, 0.5, 1.0, 0.0, 0.25, 0.5, 0.75, 1.0, 0.0, 0.25, 0.5, 0.75, 1.0], "uniform");
}

#[test]
fn environment_density_follows_the_bilinear_lookup() {
    // Bright texels beside black ones, on the seam and at the pole too: radiance over density stays within that of a
    // cell's mean over its corner, 16 with bilinear weights, and 2 more for sin theta within the row.
    let (width, height) = (16, 8);
    let mut radiance = vec![Vec3::ZERO; width * height];
    for (x, y) in [(0, 0), (0, 4), (15, 6), (7, 3)] {
        radiance[y * width + x] = Vec3::ONE;
    }
    let (mut world, _) = on_plane(PROJECTION_MIS);
    install(&mut world, width as u32, height as u32, radiance);
    let inputs = world.inputs();
    let (mut total, mut worst) = (0.0, 0f64);
    let (columns, lines) = (256, 256);
    for i in 0..columns {
        for j in 0..lines {
            let (u, v) = ((f64::from(i) + 0.5) / f64::from(columns), (f64::from(j) + 0.5) / f64::from(lines));
            let (phi, theta) = (TAU * (u - 0.5), PI * v);
            let e = [theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin()];
            let rows = [world.view.environment_row0, world.view.environment_row1, world.view.environment_row2];
            let d = rows.iter().zip(e).map(|(row, e)| row.as_dvec3() * e).sum::<DVec3>();
            let light = environment(&inputs, d).x;
            total += light * 2.0 * PI * PI * theta.sin() / f64::from(columns * lines);
            if light > 0.0 {
                worst = worst.max(light / environment_pdf(&inputs, d));
            }
        }
    }
    assert!(worst < 32.0 * total, "{worst} of {total}");
}

#[test]
fn light_of_an_image_enters_a_plane() {
    // Uniform over the plane: Lo = Ft(wo) Rd / (pi (1 - rho_e)) int Ft cos L dw, by quadrature. Eight directions.
    let (mut world, surface) = on_plane(PROJECTION_NORMAL);
    install(&mut world, 16, 8, sky());
    world.view.directions = 8;
    let inputs = world.inputs();
    let entering: DVec3 = {
        let side = 1000;
        let cell = |i: i32| {
            let (u1, u2) =
                ((f64::from(i % side) + 0.5) / f64::from(side), (f64::from(i / side) + 0.5) / f64::from(side));
            let wi = cosine_direction(DVec3::Z, u1, u2);
            environment(&inputs, wi) * transmittance(1.3, wi.z) * PI
        };
        (0..side * side).map(cell).sum::<DVec3>() / f64::from(side * side)
    };
    let (sigma_s, sigma_a) = coefficients(1.0, 0.95);
    let total = Dipole::new(sigma_s, sigma_a, 1.3).total();
    let expected = transmittance(1.3, 0.5f64.cos()) * total / (PI * (1.0 - 0.0611318252)) * entering;
    let found = estimate(&world, 128, |index, step| subsurface(&inputs, step, index, &surface));
    for c in 0..3 {
        assert!(
            (found.mean[c] - expected[c]).abs() < 4.0 * found.error[c] + 1e-4 * expected[c],
            "{found:?} {expected}"
        );
    }
    assert!(found.error.x < 0.01 * expected.x, "{found:?}");
}

#[test]
fn what_stands_above_shades() {
    let (mut world, surface) = on_plane(PROJECTION_MIS);
    world.light(sun(-DVec3::Z, 1.0));
    let blocker = [(-1.0, -1.0), (3.0, -1.0), (-1.0, 3.0)].map(|(x, y)| dvec3(x, y, 0.0) * 1e4 + DVec3::Z);
    world.triangle(blocker);
    world.triangles[2].set = 1;
    let inputs = world.inputs();
    let dark = estimate(&world, 16, |index, step| {
        subsurface(&inputs, step, index, &surface) + valid(reflect(&inputs, step, index, &surface))
    });
    // The blocker is finite: light from within 1e-4 of the horizon passes.
    assert!(dark.mean.x < 1e-5, "{dark:?}");
}

/// Materials of the first surface: rough and smooth translucent, glossy metal, coloured matt.
fn surfaces() -> [Material; 3] {
    let translucent = Material { alpha: 0.3, ..matter(1.0, 0.95, 1.5, Energy) };
    let opaque = Material {
        ior: 1.5,
        alpha: 0.2,
        base_color: vec3(0.9, 0.5, 0.2),
        metallic: 1.0,
        component_cdf: [0.0; 9],
        ..Default::default()
    };
    [translucent, opaque, Material { metallic: 0.25, alpha: 0.5, ..opaque }]
}

/// What `surface` (on z = 0) reflects of `radiance`, summed over side x side directional lights.
fn reflected_by_lamps(world: &World, surface: &Surface, side: i32, radiance: impl Fn(DVec3) -> DVec3) -> DVec3 {
    let mut world = world.clone();
    world.features.environment = ENVIRONMENT_NONE;
    world.light(sun(-DVec3::Z, 1.0));
    let step = translucent::reference::step(&world.inputs(), 0, 0..1, 0..1);
    let mut sum = DVec3::ZERO;
    for i in 0..side * side {
        let at = |k: i32| (f64::from(k) + 0.5) / f64::from(side);
        let wi = cosine_direction(DVec3::Z, at(i % side), at(i / side));
        world.lights[0] = sun(-wi, 1.0);
        sum += valid(reflect(&world.inputs(), &step, 0, surface)) * radiance(wi) * PI / wi.z;
    }
    sum / f64::from(side * side)
}

#[test]
fn reflection_of_lamps_and_of_the_environment_agree() {
    // The environment's estimator, with each of its densities, against a sum over directional lights, which share
    // nothing with it but the scattering function. The sum's error is about 1 / side^2 of the lobe's width.
    for (number, material) in surfaces().into_iter().enumerate() {
        let (mut world, surface) = plane(material, PROJECTION_MIS, 64, 0.6, true);
        let check = |world: &World, samples: u32, expected: DVec3| {
            let inputs = world.inputs();
            let found = estimate(world, samples, |index, step| valid(reflect(&inputs, step, index, &surface)));
            for c in 0..3 {
                let allowed = 4.0 * found.error[c] + 2e-3 * expected[c];
                assert!((found.mean[c] - expected[c]).abs() < allowed, "material {number}: {found:?} {expected}");
            }
            assert!(found.error.x < 0.02 * expected.x, "material {number}, weak: {found:?}");
        };
        let uniform = reflected_by_lamps(&world, &surface, 200, |_| DVec3::ONE);
        assert!(uniform.max_element() < 1.0, "more than arrives: {uniform}");
        check(&world, 256, uniform);

        install(&mut world, 16, 8, sky());
        let inputs = world.inputs();
        check(&world, 512, reflected_by_lamps(&world, &surface, 400, |wi| environment(&inputs, wi)));
    }
}

#[test]
fn mirror_shows_the_environment() {
    let smooth = matter(1.0, 0.95, 1.5, Energy);
    let (mut world, surface) = plane(smooth, PROJECTION_MIS, 4, 0.7, true);
    install(&mut world, 16, 8, sky());
    world.view.directions = 3;
    world.light(sun(-DVec3::Z, 5.0));
    let inputs = world.inputs();
    let wi = dvec3(-(0.7f64.sin()), 0.0, 0.7f64.cos());
    let expected = fresnel(1.5, 0.7f64.cos()) * environment(&inputs, wi);
    for sample_index in 0..8 {
        let step = translucent::reference::step(&inputs, sample_index, 0..1, 0..8);
        let found = valid(reflect(&inputs, &step, 0, &surface));
        assert!(found.distance(expected) < 1e-5 * expected.length(), "{found} for {expected}");
    }
}

#[test]
fn a_smooth_metal_reflects_what_arrives() {
    let metal = Material { alpha: 0.02, metallic: 1.0, base_color: Vec3::ONE, ior: 1.5, ..Default::default() };
    let (world, surface) = plane(metal, PROJECTION_MIS, 64, 0.4, true);
    let inputs = world.inputs();
    let found = estimate(&world, 128, |index, step| valid(reflect(&inputs, step, index, &surface)));
    // Masking without multiple scattering loses of the order of alpha^2.
    found.check(1.0, 2e-3, "white metal");
}

#[test]
fn emission_and_background_are_added_once() {
    let glowing = Material { emission: vec3(1.0, 2.0, 3.0), base_color: Vec3::ZERO, ior: 1.0, ..Default::default() };
    let (mut world, surface) = plane(glowing, PROJECTION_MIS, 1, 0.4, true);
    world.features.environment = ENVIRONMENT_NONE;
    world.view.show_environment = 1;
    let mut step = translucent::reference::step(&world.inputs(), 0, 0..1, 0..1);
    let miss = Surface { triangle: MISS, ..Default::default() };
    assert_eq!(valid(reflect(&world.inputs(), &step, 0, &surface)), dvec3(1.0, 2.0, 3.0));
    assert_eq!(valid(reflect(&world.inputs(), &step, 0, &miss)), DVec3::ZERO);
    world.features.environment = ENVIRONMENT_CONSTANT;
    assert_eq!(valid(reflect(&world.inputs(), &step, 0, &miss)), DVec3::ONE);
    step.first = 0;
    step.ray_count = 0;
    assert_eq!(valid(reflect(&world.inputs(), &step, 0, &surface)), DVec3::ZERO);
    assert_eq!(valid(reflect(&world.inputs(), &step, 0, &miss)), DVec3::ZERO);
}

#[test]
fn rays_go_to_emitters_where_these_are_far() {
    let (mut world, _) = on_plane(PROJECTION_MIS);
    world.features.environment = ENVIRONMENT_NONE;
    assert_eq!(share(&world.inputs(), DVec3::ZERO), 0.0);
    world.features.emitters = 1;
    let first = world.triangles.len() as u32;
    let (x, y) = (DVec3::X * 0.6, DVec3::Y * 0.8);
    let middle = DVec3::Z * 3.0;
    world.triangle([middle - x, middle + x, middle - y]);
    world.triangle([middle - x, middle + y, middle + x]);
    let emitters = [0, 1].map(|k| Emitter { triangle: first + k, ..Default::default() });
    let (centre, radius2) = ball(&world.triangles, &emitters);
    assert!(centre.distance(vec3(0.0, 0.0, 3.0)) < 1e-6 && (radius2 - 0.64).abs() < 1e-6, "{centre} {radius2}");
    (world.view.emitters_centre, world.view.emitters_radius2) = (centre, radius2);
    let far = share(&world.inputs(), DVec3::ZERO);
    assert!((far - (1.0 - 0.5 * (0.64f64 / 9.0).powi(2))).abs() < 1e-6, "{far}");
    assert_eq!(share(&world.inputs(), dvec3(0.3, 0.2, 2.5)), 0.5);
    world.features.environment = ENVIRONMENT_CONSTANT;
    assert_eq!(share(&world.inputs(), DVec3::ZERO), 0.5);
}
