//! The random walk against what is known without it: energy, single scattering in closed form, an independent Monte
//! Carlo's totals, and shapes that must agree with each other. Seeds are fixed; tolerances are 4 standard errors of both
//! sides.

use glam::{DVec3, dvec3};
use std::f64::consts::{LN_2, PI};
use translucent::reference::boundary::{Side, diffuse_reflectance, fresnel};
use translucent::reference::walk::exitance::{Bins, Exitance, Light, exitance, seen};
use translucent::reference::walk::mesh::Mesh;
use translucent::reference::walk::searchlight::{Incidence, Searchlight, searchlight};
use translucent::reference::walk::shape::{Body, Slab, Sphere};
use translucent::reference::walk::*;

const ALBEDOS: [f64; 6] = [0.5, 0.8, 0.9, 0.95, 0.99, 0.999];

/// sigma_a that has the albedo beside sigma_s = 1.
fn absorption(albedo: f64) -> f64 {
    (1.0 - albedo) / albedo
}

fn matter(sigma_a: f64, g: f64, ior: f64) -> Matter {
    Matter { sigma_s: 1.0 / (1.0 - g), sigma_a, g, ior }
}

#[track_caller]
fn close(found: Estimate, expected: f64, error: f64, what: &str) {
    let tolerance = 4.0 * found.error.hypot(error);
    assert!((found.mean - expected).abs() < tolerance, "{what}: {found:?} for {expected} +- {error}");
}

fn totals(ior: f64, incidence: Incidence, paths: u64) -> Vec<Searchlight> {
    searchlight(matter(0.0, 0.0, ior), &ALBEDOS.map(absorption), incidence, &[0.0, 1e9], paths, 1)
}

#[test]
fn totals_of_an_independent_monte_carlo() {
    // 2e6 paths of another program, +- .0005, which is taken as its standard error; .0002 of the four-digit columns.
    let normal =
        [(1.0, [0.115, 0.285, 0.415, 0.536, 0.753, 0.913]), (1.3, [0.0635, 0.181, 0.291, 0.408, 0.656, 0.872])];
    for (ior, expected) in normal {
        for (found, expected) in totals(ior, Incidence::Angle(0.0), 60_000).iter().zip(expected) {
            close(found.total, expected, 5e-4, &format!("normal incidence, n {ior}"));
        }
    }
    let lambertian = [(1.0, [0.1464, 0.3419, 0.4779, 0.5961, 0.7946]), (1.3, [0.0690, 0.1944, 0.3074, 0.4262, 0.6716])];
    for (ior, expected) in lambertian {
        for (found, expected) in totals(ior, Incidence::Lambertian, 60_000).iter().zip(expected) {
            close(found.total, expected, 5e-4, &format!("Lambertian incidence, n {ior}"));
        }
    }
}

#[test]
fn single_scattering_is_lommel_seeligers() {
    // Index-matched half-space: alpha / 2 [1 - mu0 ln(1 + 1 / mu0)], and 2 / 3 (1 - ln 2) alpha in diffuse light.
    for mu in [1.0f64, 0.5, 0.1] {
        for (found, albedo) in totals(1.0, Incidence::Angle(mu.acos()), 40_000).iter().zip(ALBEDOS) {
            let expected = albedo / 2.0 * (1.0 - mu * (1.0 + 1.0 / mu).ln());
            close(found.single, expected, 0.0, &format!("mu0 {mu}, albedo {albedo}"));
        }
    }
    for (found, albedo) in totals(1.0, Incidence::Lambertian, 40_000).iter().zip(ALBEDOS) {
        close(found.single, 2.0 / 3.0 * (1.0 - LN_2) * albedo, 0.0, &format!("diffuse, albedo {albedo}"));
    }
}

#[test]
fn a_half_space_keeps_chandrasekhars_law() {
    // 1 - H(1) sqrt(1 - alpha) for isotropic scattering at n = 1 and normal incidence; H by its integral equation.
    for (found, albedo) in totals(1.0, Incidence::Angle(0.0), 60_000).iter().zip(ALBEDOS) {
        let steps = 400;
        let mu: Vec<f64> = (0..steps).map(|i| (f64::from(i) + 0.5) / f64::from(steps)).collect();
        let mut h = vec![1.0; mu.len()];
        for _ in 0..200 {
            let next = |m: &f64| {
                let integral: f64 = h.iter().zip(&mu).map(|(h, x)| x * h / (m + x)).sum::<f64>() / f64::from(steps);
                1.0 / ((1.0 - albedo).sqrt() + albedo / 2.0 * integral)
            };
            h = mu.iter().map(next).collect();
        }
        let at_one = 1.5 * h[h.len() - 1] - 0.5 * h[h.len() - 3];
        close(found.total, 1.0 - at_one * (1.0 - albedo).sqrt(), 1e-4, &format!("albedo {albedo}"));
    }
}

#[test]
fn what_enters_leaves_without_absorption() {
    let cube = Mesh::cuboid(dvec3(1.0, 2.0, 3.0), 1);
    for (g, ior) in [(0.0, 1.0), (0.0, 1.3), (0.8, 1.5), (-0.5, 0.8), (0.0, 2.0)] {
        for seed in 0..2000 {
            let mut random = Random::new(seed, 0);
            let below = |random: &mut Random| {
                let d = random.direction();
                dvec3(d.x, d.y, -d.z.abs())
            };
            let ends = [
                walk(&Slab { thickness: 2.0 }, &matter(0.0, g, ior), DVec3::ZERO, below(&mut random), &mut random),
                walk(&Sphere { radius: 2.0 }, &matter(0.0, g, ior), 2.0 * DVec3::Z, below(&mut random), &mut random),
                walk(&cube, &matter(0.0, g, ior), dvec3(0.1, 0.2, 1.5), below(&mut random), &mut random),
            ];
            for end in ends {
                let End::Left(exit) = end else { panic!("{end:?}: g {g} n {ior} seed {seed}") };
                assert_eq!(exit.weight(0.0), 1.0);
                assert!(exit.direction.dot(exit.normal) >= 0.0 && exit.direction.is_normalized());
            }
        }
    }
}

#[test]
fn late_absorption_is_unbiased() {
    // The same matter as the least absorbing one of a walk, where paths end, and as another, where they do not.
    let strong = absorption(0.5);
    let radii = [0.0, 0.5, 2.0, 8.0];
    let both = searchlight(matter(0.0, 0.3, 1.4), &[1e-2, strong], Incidence::Angle(0.0), &radii, 60_000, 2);
    let alone = searchlight(matter(0.0, 0.3, 1.4), &[strong], Incidence::Angle(0.0), &radii, 60_000, 3);
    for (a, b) in both[1].rings.iter().chain([&both[1].total]).zip(alone[0].rings.iter().chain([&alone[0].total])) {
        close(*a, b.mean, b.error, "with and without an earlier end");
    }
}

#[test]
fn threads_do_not_matter() {
    let run = || totals(1.3, Incidence::Angle(0.3), 2_000).iter().map(|s| (s.total, s.single)).collect::<Vec<_>>();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    assert_eq!(run(), pool.install(run));
}

#[test]
fn fresnel_and_refraction() {
    for ior in [0.8, 1.0, 1.3, 2.0] {
        for cos in [0.05, 0.3, 0.7, 1.0] {
            let (reflectance, refracted) = interface(ior, cos);
            if ior != 1.0 {
                assert!((reflectance - fresnel(ior, cos)).abs() < 1e-14, "n {ior} cos {cos}");
            }
            let sines = (1.0f64 - cos * cos).sqrt() - ior * (1.0f64 - refracted * refracted).sqrt();
            assert!(reflectance == 1.0 || sines.abs() < 1e-14, "Snell, n {ior} cos {cos}");
        }
    }
}

/// Light from +z, in bands of equal area from the lit pole.
fn sphere(
    body: &impl Body,
    matter: Matter,
    absorptions: &[f64],
    bands: usize,
    light: Light,
    paths: u64,
) -> Vec<Exitance> {
    let radius = body.ball().1;
    let band = move |z: f64| (((1.0 - z / radius) / 2.0 * bands as f64).max(0.0) as usize).min(bands - 1);
    let bins = Bins { count: bands, of: &|p, _| band(p.z) };
    exitance(body, matter, absorptions, light, bins, paths, 5)
}

const DOWN: Light = Light::Directional(DVec3::NEG_Z);

#[test]
fn entering_flux_is_the_fresnel_average() {
    // Directional and uniform light both enter a convex body with the share 1 - rho_e.
    let ior = 1.5;
    let share = 1.0 - diffuse_reflectance(ior, Side::Outside);
    let cube = Mesh::cuboid(DVec3::ONE, 1);
    let matter = Matter { sigma_s: 0.1, sigma_a: 100.0, g: 0.0, ior };
    let found = &sphere(&Sphere { radius: 2.0 }, matter, &[100.0], 1, DOWN, 40_000)[0];
    close(found.entered, 4.0 * PI * share, 0.0, "sphere");
    let uniform = exitance(&cube, matter, &[100.0], Light::Uniform, Bins { count: 1, of: &|_, _| 0 }, 40_000, 6);
    close(uniform[0].entered, PI * cube.area() * share, 0.0, "cube");
}

#[test]
fn a_fine_mesh_is_its_sphere() {
    let (ball, mesh) = (Sphere { radius: 3.0 }, Mesh::capsule(3.0, 0.0, 96));
    let matter = matter(0.0, 0.0, 1.3);
    let absorptions = [absorption(0.95), absorption(0.8)];
    let exact = sphere(&ball, matter, &absorptions, 6, DOWN, 60_000);
    let found = sphere(&mesh, matter, &absorptions, 6, DOWN, 60_000);
    for (exact, found) in exact.iter().zip(&found) {
        // Facets are (pi / 96)^2 / 2 = 5e-4 inside; their normals 2 degrees apart change nothing to first order.
        let pairs = exact.bins.iter().zip(&found.bins).chain([(&exact.scattered, &found.scattered)]);
        for (a, b) in pairs.chain([(&exact.straight, &found.straight)]) {
            close(*b, a.mean, a.error.hypot(1e-3 * a.mean), "mesh");
        }
        assert_eq!(found.lost, 0.0);
    }
}

#[test]
fn skin_on_a_ball() {
    // skin1 on a sphere of radius 10 in directional light, what leaves per flux that entered: peers' measurement, three
    // digits; so is the half-space beside it.
    for (sigma_s, sigma_a, expected) in [(0.74, 0.032, 0.597), (0.88, 0.17, 0.268), (1.01, 0.48, 0.138)] {
        let matter = Matter { sigma_s, sigma_a, g: 0.0, ior: 1.3 };
        let found = &sphere(&Sphere { radius: 10.0 }, matter, &[sigma_a], 1, DOWN, 60_000)[0];
        let share = 1.0 / found.entered.mean;
        let all = Estimate { mean: found.scattered.mean + found.straight.mean, error: found.scattered.error };
        close(all.scaled(share), expected, (5e-4f64).hypot(found.entered.error * share * expected), "skin1");
    }
}

#[test]
fn a_camera_sees_a_sphere_evenly() {
    // Bands about an axis across the view: the visible area and cosine of equal-area bands from the front pole,
    // without a boundary.
    let bins = Bins { count: 4, of: &|p, _| ((1.0 - p.z) * 2.0) as usize };
    let weights = seen(&Sphere { radius: 1.0 }, 1.0, DVec3::NEG_Z, bins, 400);
    let total: f64 = weights.iter().sum();
    for (weight, expected) in weights.iter().zip([0.75, 0.25, 0.0, 0.0]) {
        assert!((weight / total - expected).abs() < 2e-3, "{weights:?}");
    }
}
