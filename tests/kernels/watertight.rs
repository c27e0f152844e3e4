//! Rays through the edges and vertices that triangles share meet exactly one of them, on the device and in its twin.

use crate::{
    case, evaluate,
    scenes::{Eye, Mesh, gltf, matter, scene},
};
use glam::{DQuat, DVec3, EulerRot, Vec3};
use serde_json::json;
use translucent::{
    Settings,
    reference::{
        Inputs, intersect,
        random::{hash, unit},
    },
    shared::{FUNCTION_ALL, Shading},
    verify::Case,
};

const RAYS: u32 = 1 << 16;

fn number(i: u32, k: u32) -> f64 {
    unit(hash(hash(i) ^ k.wrapping_mul(0x9e37_79b9)))
}

fn vector(i: u32, k: u32) -> DVec3 {
    let component = |j: u32| 2.0 * number(i, k + j) - 1.0;
    DVec3::new(component(0), component(1), component(2))
}

/// A ray from `base + offset` to `target`; base, offset and direction stand in the place of normals, and its set in that of
/// a material.
fn ray(base: DVec3, offset: DVec3, target: DVec3, set: u32) -> Shading {
    let (base, offset) = (base.as_vec3(), offset.as_vec3());
    let direction = (target - base.as_dvec3() - offset.as_dvec3()).normalize().as_vec3();
    Shading { normal0: base, normal1: offset, normal2: direction, material: set }
}

/// Fails unless each ray meets one triangle of its set.
fn assert_one_hit(what: &str, case: &Case, rays: &[Shading], whole_line: bool) {
    let inputs = case.inputs();
    let t_min = if whole_line { -1e30 } else { 0.0 };
    let ends = vec![Vec3::new(t_min, 1e30, 0.0); rays.len()];
    let given = Inputs { shadings: rays, ..inputs };
    let found = evaluate(FUNCTION_ALL, &given, &case.scene.nodes, &ends);
    for (found, ray) in found.iter().zip(rays) {
        assert_eq!(found.x, 1.0, "{what}: {ray:?}");
    }
    for ray in rays.iter().step_by(16) {
        let origin = ray.normal0.as_dvec3() + ray.normal1.as_dvec3();
        let t_min = if whole_line { f64::NEG_INFINITY } else { 0.0 };
        let hits = intersect::hits(&inputs, origin, ray.normal2.as_dvec3(), t_min, f64::INFINITY);
        let count = hits.filter(|hit| inputs.triangles[hit.triangle as usize].set == ray.material).count();
        assert_eq!(count, 1, "{what}, twin: {ray:?}");
    }
}

fn of_meshes(meshes: &[(Mesh, usize)]) -> Case {
    let eye = Eye { eye: DVec3::Z * 20.0, at: DVec3::ZERO, lens: 0.5 };
    let materials = [matter([1.0; 3], [1.0; 3], 1.3), json!({})];
    case(scene(&gltf(meshes, &materials, &[], &eye)), &Settings::default())
}

#[test]
fn no_ray_passes_the_diagonal_of_a_quad() {
    for (round, half) in (0..).zip([1e-4, 1.0, 1e4]) {
        for (kind, turn) in [("flat", DQuat::IDENTITY), ("tilted", DQuat::from_euler(EulerRot::XYZ, 0.3, 0.5, 0.7))] {
            let mut quad = Mesh::default();
            quad.quad(DVec3::new(-half, -half, 0.0), DVec3::X * 2.0 * half, DVec3::Y * 2.0 * half);
            quad.positions.iter_mut().for_each(|p| *p = turn * *p + DVec3::new(0.1, -0.2, 0.3));
            // A ball of radius 1 in whose units the quad is huge or tiny.
            let case = of_meshes(&[(Mesh::sphere(1.0, 4), 0), (quad, 1)]);
            let inputs = case.inputs();
            let quad = inputs.triangles.iter().zip(inputs.shadings).filter(|(_, shading)| shading.material == 1);
            let quad: Vec<_> = quad.map(|(triangle, _)| *triangle).collect();
            let shared: Vec<DVec3> = (quad[0].vertices.iter())
                .filter(|vertex| quad[1].vertices.contains(vertex))
                .map(|vertex| vertex.as_dvec3())
                .collect();
            let [a, b] = shared[..] else { panic!("two triangles with a diagonal") };
            let (middle, along) = ((a + b) / 2.0, (b - a).normalize());
            let reach = 0.9 * (b - a).length().min(2.0) / 2.0;
            let normal = turn * DVec3::Z;
            let rays: Vec<Shading> = (0..RAYS)
                .map(|i| {
                    let u = |k: u32| number(i + round * RAYS, k);
                    let target = middle + along * reach * (2.0 * u(0) - 1.0);
                    // On the diagonal, or some roundings away from it.
                    let target = target + vector(i, 10) * (f64::from(i % 3) * 2f64.powi(-24) * half.min(1e-3 * reach));
                    let base = if i % 2 == 0 { target + reach * 0.1 * vector(i, 20) } else { vector(i, 20) };
                    ray(base, vector(i, 30) * reach, target, quad[0].set)
                })
                // Rounded corners fold the quad a little, so that a ray along it may truly meet none or both.
                .filter(|ray| ray.normal2.as_dvec3().dot(normal).abs() > 0.05)
                .collect();
            assert_one_hit(&format!("{kind}, {half}"), &case, &rays, true);
        }
    }
}

#[test]
fn no_ray_leaves_a_closed_mesh() {
    for (kind, stretch) in
        [("ball", DVec3::ONE), ("needle", DVec3::new(1e-3, 1.0, 1e-2)), ("disk", DVec3::new(1.0, 1e-3, 1.0))]
    {
        let mut ball = Mesh::sphere(1.0, 6);
        ball.positions.iter_mut().for_each(|p| *p *= stretch);
        let case = of_meshes(&[(ball, 0)]);
        let triangles = case.inputs().triangles;
        // In the units of kernels, from inside through a vertex, a point of an edge, or near one.
        let widest = stretch.max_element();
        let rays: Vec<Shading> = (0..RAYS)
            .map(|i| {
                let u = |k: u32| number(i, k);
                let triangle = &triangles[(u(0) * triangles.len() as f64) as usize];
                let [a, b, _] = triangle.vertices.map(|vertex| vertex.as_dvec3());
                let target = match i % 3 {
                    0 => a,
                    1 => a + (b - a) * u(1),
                    _ => a + (b - a) * u(1) + vector(i, 10) * stretch / widest * 1e-7,
                };
                let inside = vector(i, 20) * stretch / widest * 0.3;
                ray(inside * 0.5, inside * 0.5, target, triangle.set)
            })
            .collect();
        assert_one_hit(kind, &case, &rays, false);
    }
}
