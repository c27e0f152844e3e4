//! Meshes against the independent integrator, and it against closed forms: sphere, convex edge, slab, concave corner.

use crate::common::*;
use glam::{DVec3, Vec3, dvec3};
use translucent::Model;
use translucent::Normalisation::{self, Energy};
use translucent::reference::area::{self, Corners, Lamp, Matter, Setting};
use translucent::reference::boundary::{Side, diffuse_reflectance, transmittance};
use translucent::reference::profile::{Dipole, Radial};
use translucent::shared::*;

fn medium(sigma_tr: f64, albedo: f64, ior: f64, normalisation: Normalisation) -> Matter {
    let (sigma_s, sigma_a) = coefficients(sigma_tr, albedo);
    Matter {
        sigma_s_prime: DVec3::splat(sigma_s),
        sigma_a: DVec3::splat(sigma_a),
        g: 0.0,
        ior,
        normalisation,
        model: Model::Standard,
    }
}

fn setting<'a>(set: &'a [Corners], matter: Matter, lamps: &'a [Lamp], surrounding: f64) -> Setting<'a> {
    Setting { set, blockers: &[], entries: &[], matter, lamps, surrounding: DVec3::splat(surrounding) }
}

/// Fails if an area estimate is more than 4 standard errors (once in 16,000) and `slack` of the value away.
#[track_caller]
fn check(found: area::Estimate, expected: f64, slack: f64, what: &str) {
    let allowed = 4.0 * found.error.x + slack * expected;
    assert!((found.mean.x - expected).abs() <= allowed, "{what}: {} +- {} for {expected}", found.mean.x, found.error.x);
    assert!(found.error.x < 0.02 * expected, "{what}: the test is weak: {found:?}");
}

#[test]
fn area_integrator_on_a_sphere() {
    // 1,280 faces: areas and chords differ from the sphere's by about (edge length)^2 / 8 < .3 %.
    let sphere = icosphere(3);
    for (sigma_tr, ior) in [(0.5, 1.3), (5.0, 1.3), (5.0, 1.0)] {
        let matter = medium(sigma_tr, 0.95, ior, Energy);
        let normal = sphere[700].iter().sum::<DVec3>().normalize();
        let wo = (normal + dvec3(0.3, 0.2, -0.4)).normalize();
        let lit = setting(&sphere, matter, &[], 1.0);
        let found = area::leaving(&lit, normal, normal, wo, 400_000, 1);
        let mass = Dipole::new(matter.sigma_s_prime.x, matter.sigma_a.x, ior).cdf(2.0);
        check(found, transmittance(ior, normal.dot(wo)) * mass, 5e-3, &format!("{sigma_tr} n {ior}"));
    }
}

#[test]
fn area_integrator_keeps_energy_under_a_lamp() {
    // What enters a sphere under directional light: pi R^2 E, less what Fresnel reflects.
    let sphere = icosphere(3);
    let lamps = [Lamp::Directional { direction: -DVec3::Z, irradiance: DVec3::ONE }];
    let lit = setting(&sphere, medium(5.0, 0.95, 1.3, Energy), &lamps, 0.0);
    let entering = area::entering_flux(&lit, 400_000, 2);
    // int Ft(cos) cos dA over the lit half = pi (1 - rho_e), the diffuse transmittance in another guise.
    check(entering, std::f64::consts::PI * (1.0 - diffuse_reflectance(1.3, Side::Outside)), 5e-3, "entering flux");
}

#[test]
fn area_integrator_on_a_plane() {
    let set = quad([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| dvec3(x, y, 0.0) * 12.0));
    let (sin, cos) = 60f64.to_radians().sin_cos();
    for (normalisation, expected) in [(Energy, 0.201528868), (Normalisation::Jensen2001, 0.189209041)] {
        let lamps =
            [Lamp::Directional { direction: dvec3(sin, 0.0, -cos), irradiance: DVec3::splat(std::f64::consts::PI) }];
        let lit = setting(&set, medium(1.0, 0.95, 1.3, normalisation), &lamps, 0.0);
        // e^-12 of the light is beyond the square.
        check(
            area::leaving(&lit, DVec3::ZERO, DVec3::Z, DVec3::Z, 2_000_000, 3),
            expected,
            1e-4,
            "plane at 60 degrees",
        );
    }
}

/// Exitance near a right-angled convex edge over that of the plane, uniform light, by distance sigma_tr s from the edge:
/// of both faces, and of the point's own face alone; alpha' = .95, n = 1.3.
const EDGE: [(f64, f64, f64); 5] =
    [(0.1, 1.0720, 0.590), (0.5, 1.1059, 0.823), (1.0, 1.0656, 0.925), (2.0, 1.0237, 0.982), (4.0, 1.0027, 0.999)];

/// Two half planes, x <= 0 of z = 0 and z <= 0 of x = 0.
fn wedge(size: f64) -> Vec<Corners> {
    let top = [(-1.0, -1.0), (0.0, -1.0), (0.0, 1.0), (-1.0, 1.0)].map(|(x, y)| dvec3(x, y, 0.0) * size);
    let side = [(-1.0, -1.0), (-1.0, 1.0), (0.0, 1.0), (0.0, -1.0)].map(|(z, y)| dvec3(0.0, y, z) * size);
    let wedge: Vec<Corners> = quad(top).into_iter().chain(quad(side)).collect();
    assert!(wedge.iter().all(|[a, b, c]| (b - a).cross(c - a).dot(dvec3(1.0, 0.0, 1.0)) > 0.0));
    wedge
}

#[test]
fn convex_edge() {
    let full = Dipole::new(coefficients(1.0, 0.95).0, coefficients(1.0, 0.95).1, 1.3).total();
    let wedge = wedge(12.0);
    for (distance, ratio, own) in EDGE {
        let at = dvec3(-distance, 0.1, 0.0);
        let wo = dvec3(0.3, 0.1, 1.0).normalize();
        let expected = ratio * full * transmittance(1.3, wo.z);
        let what = format!("distance {distance}");

        let lit = setting(&wedge, medium(1.0, 0.95, 1.3, Energy), &[], 1.0);
        check(area::leaving(&lit, at, DVec3::Z, wo, 1_500_000, 4), expected, 1e-4, &what);

        for projection in [PROJECTION_MIS, PROJECTION_NORMAL] {
            let mut world = World::new(matter(1.0, 0.95, 1.3, Energy), projection, 64);
            wedge.iter().for_each(|t| world.triangle(*t));
            world.look(at + 20.0 * wo, at, 1e-3);
            let surface = world.surface(if 0.1 < at.x + 12.0 { 0 } else { 1 }, at);
            let inputs = world.inputs();
            let found = estimate(&world, 512, |index, step| subsurface(&inputs, step, index, &surface));
            if projection == PROJECTION_MIS {
                // Four decimals are given.
                found.check(expected, 6e-5, &what);
                assert!(found.error.x < 5e-3 * expected, "{what}: {found:?}");
            } else {
                // A normal probe runs along the other face, so never meets it: the black edge. Three decimals.
                found.check(expected / ratio * own, 1e-3, &what);
            }
        }
    }
}

/// An L: a bar along x and one that stands on its left end.
fn concave() -> Vec<Corners> {
    let outline = [(-1.0, -1.0), (1.0, -1.0), (1.0, -0.4), (-0.4, -0.4), (-0.4, 1.0), (-1.0, 1.0)];
    let at = |(x, y): (f64, f64), z: f64| dvec3(x, y, z);
    let mut faces = Vec::new();
    for i in 0..6 {
        let (a, b) = (outline[i], outline[(i + 1) % 6]);
        faces.extend(quad([at(a, -0.5), at(b, -0.5), at(b, 0.5), at(a, 0.5)]));
    }
    for [i, j, k, l] in [[0, 1, 2, 3], [0, 3, 4, 5]] {
        faces.extend(quad([i, j, k, l].map(|v| at(outline[v], 0.5))));
        faces.extend(quad([l, k, j, i].map(|v| at(outline[v], -0.5))));
    }
    faces
}

/// The twins and the area integrator at a point of a mesh (triangle and weights of its corners), under two lamps and
/// uniform light, in three channels. `blockers` belong to another set.
fn compare(set: &[Corners], blockers: &[Corners], (triangle, weights): (usize, [f64; 3]), wo: DVec3, sun_to: DVec3) {
    let (sigma_s, sigma_a) = (dvec3(4.0, 8.0, 2.0), dvec3(0.3, 0.1, 0.02));
    let material = standard(sigma_s, sigma_a, 1.4, Energy, 1e-6);
    let [a, b, c] = set[triangle];
    let at = a * weights[0] + b * weights[1] + c * weights[2];
    let normal = (b - a).cross(c - a).normalize();
    let wo = wo.normalize();
    assert!(normal.dot(wo) > 0.0);

    let matter =
        Matter { sigma_s_prime: sigma_s, sigma_a, g: 0.0, ior: 1.4, normalisation: Energy, model: Model::Standard };
    let lamps = [
        Lamp::Directional { direction: sun_to.normalize(), irradiance: DVec3::splat(2.0) },
        Lamp::Point { position: dvec3(1.0, 3.0, 2.0), intensity: DVec3::splat(5.0) },
    ];

    let mut world = World::new(material, PROJECTION_MIS, 64);
    set.iter().chain(blockers).for_each(|t| world.triangle(*t));
    world.triangles[set.len()..].iter_mut().for_each(|t| t.set = 1);
    world.view.environment_scale = Vec3::splat(0.5);
    world.light(sun(sun_to, 2.0));
    world.light(Light { position: Vec3::new(1.0, 3.0, 2.0), intensity: Vec3::splat(5.0), ..Default::default() });
    world.look(at + 6.0 * wo, at, 1e-3);
    let surface = world.surface(triangle as u32, at);
    // Out of the twins' own triangles, so that both see the same.
    let (own, others) = area::corners(&world.triangles, 0);
    assert_eq!((own.len(), others.len()), (set.len(), blockers.len()));
    let lit = Setting { blockers: &others, ..setting(&own, matter, &lamps, 0.5) };
    let expected = area::leaving(&lit, at, normal, wo, 500_000, 5);
    let inputs = world.inputs();
    let found = estimate(&world, 128, |index, step| subsurface(&inputs, step, index, &surface));
    for c in 0..3 {
        let error = found.error[c].hypot(expected.error[c]);
        let difference = (found.mean[c] - expected.mean[c]).abs();
        let what = format!("triangle {triangle} channel {c}: {found:?} {expected:?}");
        assert!(difference < 4.0 * error, "{what}");
        assert!(error < 0.03 * expected.mean[c], "the test is weak: {what}");
    }
}

#[test]
fn concave_corner() {
    let set = concave();
    let area: f64 = set.iter().map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum();
    assert!((area - (8.0 * 1.0 + 2.0 * (2.0 * 0.6 + 1.4 * 0.6))).abs() < 1e-12, "{area}");
    // In the inner corner, where one arm shades the other; and on the front.
    compare(&set, &[], (4, [0.1, 0.3, 0.6]), dvec3(0.4, 1.0, 0.3), dvec3(1.0, -0.6, -0.3));
    compare(&set, &[], (12, [0.2, 0.3, 0.5]), dvec3(0.1, 0.2, 1.0), dvec3(0.2, -0.5, -1.0));
}

#[test]
fn thin_slab_and_backlight() {
    // Light from behind arrives through the matter; the front's own light is not the whole.
    let set = cuboid(dvec3(-0.5, -0.5, -0.05), dvec3(0.5, 0.5, 0.05));
    compare(&set, &[], (10, [0.2, 0.5, 0.3]), dvec3(0.3, -0.2, 1.0), dvec3(0.1, 0.2, 1.0));
}

#[test]
fn two_touching_objects() {
    // As one set they exchange light; as two, one only shades the other.
    let first = cuboid(dvec3(-1.0, -0.5, -0.5), dvec3(0.0, 0.5, 0.5));
    let second = cuboid(dvec3(0.0, -0.3, -0.5), dvec3(0.7, 0.3, 0.2));
    let both: Vec<Corners> = first.iter().chain(&second).copied().collect();
    let (at, wo, sun) = ((10, [0.1, 0.5, 0.4]), dvec3(0.5, 0.1, 0.8), dvec3(-0.5, 0.3, -1.0));
    compare(&both, &[], at, wo, sun);
    compare(&first, &second, at, wo, sun);
}
