//! The comparison of models with the walk: a model in the place of the walk against closed forms, and the table in the
//! documentation against a smaller run.

use glam::{DVec3, dvec3};
use translucent::model_errors::{Effort, Row, Scene, corners, csv, matters, on_body, on_plane};
use translucent::reference::boundary::{Side, diffuse_reflectance};
use translucent::reference::profile::{Dipole, Radial};
use translucent::reference::walk::Estimate;
use translucent::reference::walk::exitance::{Bins, Light};
use translucent::reference::walk::mesh::Mesh;
use translucent::reference::walk::model::{Transfer, predict};
use translucent::reference::walk::shape::{Body, Sphere};

const LENGTHS: [f64; 3] = [0.1, 1.0, 3.0];

#[track_caller]
fn close(found: Estimate, expected: f64, what: &str) {
    assert!((found.mean - expected).abs() < 4.0 * found.error, "{what}: {found:?} for {expected}");
}

#[test]
fn a_sphere_sends_back_what_its_diameter_holds() {
    // The area within a chord r is pi r^2: cdf(2 a) leaves per flux that enters, under any light; evenly under uniform
    // light.
    let dipole = Dipole::new(0.95, 0.05, 1.3);
    let rd = |r: f64| dipole.rd(r);
    let models: [&dyn Transfer; 1] = [&rd];
    let entering = 1.0 - diffuse_reflectance(1.3, Side::Outside);
    for radius in [0.5, 3.0, 30.0] {
        let ball = Sphere { radius };
        let band = |p: DVec3, _| (((1.0 - p.z / radius) * 2.0) as usize).min(3);
        let bins = Bins { count: 4, of: &band };
        let run = |light| predict(&ball, 1.3, &models, light, bins, LENGTHS, (40_000, 1)).remove(0);
        let share = dipole.cdf(2.0 * radius) * entering * ball.area();
        let directional = run(Light::Directional(DVec3::NEG_Z));
        close(directional.all, share / 4.0, &format!("radius {radius}"));
        let uniform = run(Light::Uniform);
        close(uniform.all, share * std::f64::consts::PI, &format!("radius {radius}, uniform"));
        for bin in uniform.bins {
            close(bin, share * std::f64::consts::PI / 4.0, &format!("radius {radius}, a band"));
        }
    }
}

#[test]
fn a_mesh_is_integrated_like_its_sphere() {
    let dipole = Dipole::new(0.95, 0.05, 1.3);
    let rd = |r: f64| dipole.rd(r);
    let models: [&dyn Transfer; 1] = [&rd];
    let light = Light::Directional(dvec3(0.6, 0.0, -0.8));
    let band = |p: DVec3, _| (((1.0 - p.z / 3.0) * 2.0).max(0.0) as usize).min(3);
    let bins = Bins { count: 4, of: &band };
    let exact = predict(&Sphere { radius: 3.0 }, 1.3, &models, light, bins, LENGTHS, (100_000, 1)).remove(0);
    let found = predict(&Mesh::capsule(3.0, 0.0, 96), 1.3, &models, light, bins, LENGTHS, (100_000, 2)).remove(0);
    for (a, b) in exact.bins.iter().zip(&found.bins) {
        // 5e-4 of the radius is cut off by the facets.
        let both = Estimate { mean: b.mean, error: a.error.hypot(b.error).hypot(2e-3 * a.mean / 4.0) };
        close(both, a.mean, "a band");
    }
}

#[test]
fn parts_cover_a_mesh() {
    let mesh = Mesh::cuboid(dvec3(1.0, 2.0, 4.0), 4);
    let (parts, areas) = mesh.parts(20);
    assert!((areas.iter().sum::<f64>() / mesh.area() - 1.0).abs() < 1e-12);
    assert!(areas.iter().all(|area| *area <= mesh.area() / 20.0 * (1.0 + 1e-6)));
    for (part, area) in areas.iter().enumerate() {
        let own = (0..mesh.len()).filter(|&t| parts[t] == part);
        let facets: Vec<_> = own.map(|t| mesh.facet(t)).collect();
        assert!((facets.iter().map(|f| f.0).sum::<f64>() - area).abs() < 1e-12);
        assert!(facets.iter().all(|f| f.1.dot(facets[0].1) > 0.99), "part {part} faces two ways");
    }
    assert!((mesh.volume() - 8.0).abs() < 1e-12 && (mesh.area() - 28.0).abs() < 1e-12);
}

/// The committed numbers of a row: all, its error, l1.
fn published(row: &Row) -> Option<(f64, f64, f64)> {
    let text = include_str!("../../src/docs/model_errors.csv");
    let start = format!("\"{}\",\"{}\",{},", row.matter, row.scene, row.model);
    let line = text.lines().find_map(|line| line.strip_prefix(&start))?;
    let values: Vec<f64> = line.split(',').map(|value| value.parse().unwrap_or(f64::NAN)).collect();
    Some((values[2], values[3], values[6]))
}

#[test]
fn the_published_table_is_what_is_measured() {
    let red = matters()[1];
    let effort = Effort { paths: 20_000, samples: 20_000, seed: 5 };
    let mut rows = on_plane(red, effort);
    for scene in [Scene::sphere(3.0), Scene::capsule(3.0, 18.0)] {
        rows.extend(on_body(red, &scene, effort));
    }
    assert!(rows.len() >= 4);
    for row in rows {
        let (all, error, l1) = published(&row).unwrap_or_else(|| panic!("no row for {row:?}"));
        let tolerance = 4.0 * row.all.error.hypot(error) + 1e-5;
        assert!((row.all.mean - all).abs() < tolerance, "{row:?}: published {all} +- {error}");
        if let Some(found) = row.l1 {
            // Noise adds at most what it would make alone.
            assert!((found.mean - l1).abs() < found.error + tolerance, "{row:?}: published {l1}");
        }
    }
}

#[test]
fn spot_is_closed_and_loses_nothing() {
    let scene = translucent::Scene::load("assets/spot.glb").expect("spot");
    let corners = corners(&scene);
    let spot = Scene::mesh("spot", &corners, 10.0);
    let row = on_body(matters()[1], &spot, Effort { paths: 2_000, samples: 200, seed: 1 });
    assert!(row.iter().all(|row| row.lost == 0.0), "{row:?}");
    assert!(csv(&row).lines().count() == row.len() + 1);
}
