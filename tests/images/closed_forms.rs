//! Scenes whose radiance is known: planes, furnaces, spheres.

use crate::{
    channel, mean_and_error, render,
    scenes::{Eye, Mesh, gltf, matter, scene, standard, sun},
};
use glam::DVec3;
use translucent::{
    CameraChoice, Normalisation, Projection, Settings,
    reference::{
        boundary::{Side, diffuse_reflectance, transmittance},
        profile::{Dipole, Radial},
    },
    scene::{Environment, Lens},
};

/// Half the side of the slab and its thickness [m], for a mean free path of 1 m: edges and back are beyond the ball.
const SLAB: f64 = 200.0;

fn slab() -> Mesh {
    let mut mesh = Mesh::default();
    mesh.cuboid(DVec3::new(-SLAB, -SLAB, -SLAB), DVec3::new(SLAB, SLAB, 0.0), 1);
    mesh
}

fn above(tilt: f64) -> Eye {
    Eye { eye: DVec3::new(0.0, -10.0 * tilt.sin(), 10.0 * tilt.cos()), at: DVec3::ZERO, lens: 0.02 }
}

/// Direction of a point `distance` away in the plane y = 0, `angle` from +z.
fn sun_at(angle_degrees: f64) -> DVec3 {
    let angle = angle_degrees.to_radians();
    DVec3::new(angle.sin(), 0.0, angle.cos()) * 100.0
}

fn settings() -> Settings {
    Settings { resolution: Some((4, 4)), seed: 1, ..standard() }
}

#[test]
fn plane_under_collimated_light_has_the_golden_radiance() {
    // physics: E_perp = pi, n = 1.3, alpha' = .95, view along the normal.
    let expected = [(0.0, 0.418_550_831, 0.392_964_054), (60.0, 0.201_528_868, 0.189_209_041)];
    let rho_e = diffuse_reflectance(1.3, Side::Outside);
    for (angle, energy, jensen) in expected {
        let light = (sun(), sun_at(angle), DVec3::ZERO);
        let scene = scene(&gltf(&[(slab(), 0)], &[matter([0.95; 3], [0.05; 3], 1.3)], &[light], &above(0.0)));
        for projection in [Projection::Mis, Projection::Normal, Projection::Camera] {
            let image = render(&scene, &Settings { projection, ..settings() }, 512);
            let (mean, error) = mean_and_error(&to_f64(channel(&image, "subsurface.G")));
            // The pixels are independent; the view deviates from the normal by up to .01 rad, which changes Ft by less
            // than 1e-8; the ball leaves out 1e-6.
            assert!(
                (mean - energy).abs() < 4.0 * error + 2e-6,
                "{projection:?} at {angle} degrees: {mean} +- {error}, not {energy}"
            );
            let jensen_settings = Settings { projection, normalisation: Normalisation::Jensen2001, ..settings() };
            let image = render(&scene, &jensen_settings, 512);
            let (darker, _) = mean_and_error(&to_f64(channel(&image, "subsurface.G")));
            // The same samples: the ratio is exact to rounding.
            assert!((darker / mean - (1.0 - rho_e)).abs() < 1e-5, "{darker} / {mean}");
            assert!((darker - jensen).abs() < 4.0 * error + 2e-6);
        }
    }
}

fn to_f64(values: &[f32]) -> Vec<f64> {
    values.iter().map(|x| f64::from(*x)).collect()
}

#[test]
fn white_furnace_closes() {
    for ior in [1.0, 1.3, 1.5] {
        for tilt in [0.0, 0.7, 1.4] {
            // Without absorption the profile falls as r^-3: at the slab's edges, 1e4 mean free paths away, 3e-4 is lost.
            let mut mesh = Mesh::default();
            mesh.cuboid(DVec3::new(-1e4, -1e4, -1e4), DVec3::new(1e4, 1e4, 0.0), 1);
            let file = gltf(&[(mesh, 0)], &[matter([1.0; 3], [0.0; 3], ior)], &[], &above(tilt));
            let mut scene = scene(&file);
            scene.set_environment(Environment::constant(DVec3::ONE).expect("valid")).expect("valid");
            let image = render(&scene, &Settings { directions: 4, ..settings() }, 1024);
            for name in ["R", "G", "B"] {
                let (mean, error) = mean_and_error(&to_f64(channel(&image, name)));
                assert!((mean - 1.0).abs() < 0.002 + 4.0 * error, "n = {ior}, tilt {tilt}: {mean} +- {error}");
                assert!(error < 0.002, "n = {ior}, tilt {tilt}: the test has no force at +- {error}");
            }
        }
    }
}

#[test]
fn sphere_in_uniform_light_is_flat() {
    let radius = 1.0;
    // Area over the true sphere's: the polyhedron's deficit is the tolerance.
    let subdivision = 80;
    let mesh = Mesh::sphere(radius, subdivision);
    let area: f64 = mesh
        .indices
        .chunks_exact(3)
        .map(|t| {
            let p = |i: usize| mesh.positions[t[i] as usize];
            0.5 * (p(1) - p(0)).cross(p(2) - p(0)).length()
        })
        .sum();
    let deficit = 1.0 - area / (4.0 * std::f64::consts::PI * radius * radius);
    assert!(deficit > 0.0 && deficit < 2e-3, "{deficit}");
    // How far a triangle's middle lies below the true sphere: at cosine c that moves the cosine by up to depth / c.
    let middle = |t: &[u32]| t.iter().map(|i| mesh.positions[*i as usize]).sum::<DVec3>().length() / 3.0;
    let depth = 1.0 - mesh.indices.chunks_exact(3).map(middle).fold(1.0, f64::min);
    let eye = Eye { eye: DVec3::Z, at: DVec3::ZERO, lens: 1.0 };
    let mut scene = scene(&gltf(&[(mesh, 0)], &[matter([1.0; 3], [1.0; 3], 1.3)], &[], &eye));
    scene.set_environment(Environment::constant(DVec3::ONE).expect("valid")).expect("valid");
    for (distance, lens) in [(3.0, 0.75), (50.0, 0.042), (10.0, -1.05)] {
        scene.cameras[0].eye = DVec3::Z * distance;
        scene.cameras[0].lens = match lens > 0.0 {
            true => Lens::Perspective { yfov: lens, aspect: None },
            false => Lens::Orthographic { xmag: -lens, ymag: -lens },
        };
        for sigma_tr_radius in [0.5, 5.0, 30.0] {
            // alpha' = .95 has sigma_tr = sigma_t' sqrt(.15).
            let sigma_t = sigma_tr_radius / 0.15f64.sqrt();
            let dipole = Dipole::new(0.95 * sigma_t, 0.05 * sigma_t, 1.3);
            let medium = scene.materials[0].medium.as_mut().expect("the matter scatters");
            medium.sigma_s_prime = DVec3::splat(0.95 * sigma_t);
            medium.sigma_a = DVec3::splat(0.05 * sigma_t);
            let image = render(&scene, &Settings { resolution: Some((48, 48)), seed: 5, ..standard() }, 64);
            let expected = dipole.cdf(2.0 * radius);
            // Cosine at which a ray through column x and row y meets the true sphere; not a number where it does not.
            let cosine = |x: f64, y: f64| {
                let ndc = DVec3::new(x / 24.0 - 1.0, 1.0 - y / 24.0, 0.0);
                let (origin, direction) = if lens > 0.0 {
                    (DVec3::Z * distance, (ndc * (lens / 2.0).tan() - DVec3::Z).normalize())
                } else {
                    (DVec3::Z * distance - ndc * lens, -DVec3::Z)
                };
                (1.0 - origin.cross(direction).length_squared()).sqrt()
            };
            // By cosine at the pixel's centre, where the pixel is wholly inside: three classes down to .1.
            const LEAST: [f64; 3] = [0.6, 0.3, 0.1];
            let mut classes = vec![vec![]; 3];
            for i in 0..48 * 48 {
                let at = |name: &str| f64::from(channel(&image, name)[i]);
                let (x, y) = ((i % 48) as f64, (i / 48) as f64);
                let Some(class) = LEAST.iter().position(|least| cosine(x + 0.5, y + 0.5) > *least) else { continue };
                // The mean of Ft over the pixel, which is what the pixel shows.
                let within = (0..256)
                    .map(|k| cosine(x + (f64::from(k % 16) + 0.5) / 16.0, y + (f64::from(k / 16) + 0.5) / 16.0));
                let leaving = within.map(|c| transmittance(1.3, c)).sum::<f64>() / 256.0;
                if at("A") < 1.0 || leaving.is_nan() {
                    continue;
                }
                let mean = (at("subsurface.R") + at("subsurface.G") + at("subsurface.B")) / 3.0;
                classes[class].push(mean / leaving / expected);
            }
            for (class, values) in classes.iter().enumerate() {
                let (mean, error) = mean_and_error(values);
                // What the mesh's depth does to Ft where the class sees it most obliquely.
                let (c, moved) = (LEAST[class], depth / LEAST[class]);
                let oblique = 1.0 - transmittance(1.3, c - moved) / transmittance(1.3, c);
                assert!(oblique < 0.02, "{oblique}");
                assert!(
                    (mean - 1.0).abs() < 4.0 * error + deficit + oblique,
                    "distance {distance}, sigma_tr R = {sigma_tr_radius}, class {class}: {mean} +- {error}, {oblique}"
                );
                assert!(values.len() > 20 && error < 0.03, "class {class}: {} values, +- {error}", values.len());
            }
        }
    }
}

#[test]
fn sphere_emits_what_enters_it() {
    // Under a directional light of E_perp = pi, the flux that enters is 2 pi R^2 E_perp int Ft c dc from 0 to 1, and of it
    // cdf(2R) leaves, whatever its distribution (physics A1.6).
    let (radius, sigma_t, ior) = (1.0, 4.0, 1.3);
    let dipole = Dipole::new(0.9 * sigma_t, 0.1 * sigma_t, ior);
    let rho_e = diffuse_reflectance(ior, Side::Outside);
    let pi = std::f64::consts::PI;
    let entered = pi * radius * radius * pi * (1.0 - rho_e);
    let expected = dipole.cdf(2.0 * radius) * entered;
    let materials = [matter([0.9 * sigma_t; 3], [0.1 * sigma_t; 3], ior)];
    let mesh = Mesh::sphere(radius, 40);
    let light = (sun(), DVec3::new(3.0, 4.0, 5.0), DVec3::ZERO);
    let (mut flux, mut variance) = (0.0, 0.0);
    let resolution = 120;
    let eye = Eye { eye: DVec3::Z, at: DVec3::ZERO, lens: -1.05 };
    let mut scene = scene(&gltf(&[(mesh, 0)], &materials, &[light], &eye));
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        for direction in [axis, -axis] {
            let camera = &mut scene.cameras[0];
            (camera.eye, camera.forward) = (direction * 10.0, -direction);
            (camera.up, camera.right) = camera.forward.any_orthonormal_pair();
            let settings = Settings { resolution: Some((resolution, resolution)), seed: 9, ..standard() };
            let image = render(&scene, &settings, 16);
            let pixel_area = (2.1 / f64::from(resolution)).powi(2);
            for i in 0..(resolution * resolution) as usize {
                let at = |name: &str| f64::from(channel(&image, name)[i]);
                if at("material.Y") < 0.0 {
                    continue;
                }
                let cos = DVec3::new(at("N.X"), at("N.Y"), at("N.Z")).dot(direction);
                // Exitance from radiance; cos^2 over six views is a partition of unity, and dA cos the pixel's area.
                let factor = pi * (1.0 - rho_e) / transmittance(ior, cos) * cos * pixel_area;
                flux += at("subsurface.G") * factor;
                variance += at("variance.G") * factor * factor;
            }
        }
    }
    let error = variance.sqrt();
    // Pixels on the rim whose middle misses the sphere are left out. Within half a pixel of the rim cos is below .13, and
    // int cos^2 dA up to there is .13^3 of the whole: .2 %. The mesh adds as much.
    assert!((flux - expected).abs() < 4.0 * error + 0.004 * expected, "{flux} +- {error}, not {expected}");
    assert!(error < 0.005 * expected, "{error} of {expected}");
}

#[test]
fn lit_pixels_do_not_depend_on_size_or_place() {
    // The same scene 1e-3 to 1e3 times as large with the matter scaled along, and moved by 1e5 units through a parent node.
    let mut mesh = Mesh::sphere(1.0, 8);
    mesh.cuboid(DVec3::new(-1.0, -3.0, -1.0), DVec3::new(1.0, -1.2, 1.0), 2);
    let eye = |s: f64| Eye { eye: DVec3::new(2.0, 3.0, 6.0) * s, at: DVec3::new(0.0, -1.0, 0.0) * s, lens: 0.9 };
    let render_scaled = |scale: f64, offset: f64| {
        let mut scaled = mesh.clone();
        scaled.positions.iter_mut().for_each(|p| *p *= scale);
        let lamp = serde_json::json!({"type": "point", "intensity": 30.0 * scale * scale});
        let light = (lamp, DVec3::new(3.0, 4.0, 2.0) * scale, DVec3::ZERO);
        let materials = [matter([4.0 / scale, 2.0 / scale, 1.0 / scale], [0.3 / scale; 3], 1.4)];
        let mut file = gltf(&[(scaled, 0)], &materials, &[light], &eye(scale));
        // A parent that moves everything.
        let children = file["scenes"][0]["nodes"].clone();
        let nodes = file["nodes"].as_array_mut().expect("nodes");
        nodes.push(serde_json::json!({"children": children, "translation": [offset, -offset, offset * 0.5]}));
        let parent = nodes.len() - 1;
        file["scenes"][0]["nodes"] = serde_json::json!([parent]);
        let settings = Settings { resolution: Some((32, 32)), camera: CameraChoice::Index(0), seed: 2, ..standard() };
        let image = render(&scene(&file), &settings, 16);
        to_f64(channel(&image, "subsurface.G"))
    };
    let reference = render_scaled(1.0, 0.0);
    let total: f64 = reference.iter().sum();
    assert!(total > 1.0);
    for (scale, offset) in [(1e-3, 0.0), (1e3, 0.0), (1.0, 1e5), (1e-3, 1e2), (1e3, 1e8)] {
        let image = render_scaled(scale, offset);
        let difference: f64 = image.iter().zip(&reference).map(|(a, b)| (a - b).abs()).sum();
        assert!(difference / total < 1e-4, "scale {scale}, offset {offset}: {:e}", difference / total);
    }
}
