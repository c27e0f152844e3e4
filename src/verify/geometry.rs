//! Projection, traversal and sums.

use super::{
    Bound, Context, Verdict, World,
    functions::{INPUTS, conditioned, direction, magnitude, number},
    roundings,
};
use crate::{
    error::Result,
    reference::{
        profile::{self, Coefficients, Options},
        projection,
        strict::{self, Ray},
        sums,
    },
    settings::Normalisation,
    shared::*,
};
use glam::{DVec3, Vec3, vec2};
use rayon::prelude::*;

/// Fractions of the techniques by the cosine to the eye.
pub fn fractions(context: &mut Context) -> Result<Verdict> {
    let x: Vec<Vec3> = (0..context.share(INPUTS)).map(|i| Vec3::new(number(i, 1) as f32, 0.0, 0.0)).collect();
    let found = context.bench.evaluate(FUNCTION_FRACTIONS, &World::default().inputs(), &[], &x, &[])?;
    let mut verdict = Verdict::new(Bound::Relative(roundings(10, 2, 0)));
    for (x, found) in x.iter().zip(&found) {
        let [normal, u, _, camera] = projection::fractions(PROJECTION_MIS, x.x.into());
        verdict.vector(*found, DVec3::new(normal, u, camera), 1.0, || format!("cosine {}", x.x));
    }
    Ok(verdict)
}

/// Triangles, each with a surface on it, seen by a perspective camera or an orthographic one.
fn seen_world(count: u32, perspective: bool) -> (World, Vec<Surface>) {
    let matter = [0.5, 1.0, 2.0].map(|sigma_a| Coefficients {
        sigma_s_prime: 10.0 * sigma_a,
        sigma_a: 0.1,
        g: 0.0,
        ior: 1.3,
        rough: None,
        appearance: None,
    });
    let options = Options {
        normalisation: Normalisation::Energy,
        radius_tail: 0.0,
        directional: Default::default(),
        precision: Default::default(),
    };
    let mut world = World::new(profile::material(MODEL_STANDARD, &matter, options), PROJECTION_MIS, count);
    let eye = DVec3::new(1.0, 2.0, 4.0);
    match perspective {
        true => world.look(eye, DVec3::ZERO, 1.0),
        false => world.look_along(-eye, DVec3::ZERO, eye.length(), 1.0),
    }
    let mut surfaces = vec![];
    for i in 0..count {
        let corner = direction(i, 1) * number(i, 3);
        let edge = |k: u32| direction(i, k) * magnitude(i, k + 2, 0.1, 0.5);
        world.triangle([corner, corner + edge(4), corner + edge(8)]);
        let shading = &mut world.shadings[i as usize];
        let flat = shading.normal0.as_dvec3();
        [shading.normal0, shading.normal1, shading.normal2] =
            [12, 14, 16].map(|k| (flat + 0.3 * direction(i, k)).normalize().as_vec3());
        let (b1, b2) = (0.5 * number(i, 18), 0.5 * number(i, 19));
        let [a, u, v] = world.triangles[i as usize].corner_and_edges();
        let barycentric = vec2(b1 as f32, b2 as f32);
        surfaces.push(Surface { position: (a + b1 * u + b2 * v).as_vec3(), triangle: i, barycentric });
    }
    (world, surfaces)
}

/// The surface that a pixel sees: direction and distance of the eye, and the normals on its side.
pub fn seen(context: &mut Context) -> Result<Verdict> {
    let count = context.share(INPUTS / 2);
    let mut verdict = Verdict::new(Bound::Relative(roundings(16, 2, 2)));
    // Seen from its own plane, a surface has two sides.
    verdict.exempt = 1e-4;
    for perspective in [true, false] {
        let (world, surfaces) = seen_world(count, perspective);
        let inputs = world.inputs();
        for part in 0..3u32 {
            let x = vec![Vec3::new(part as f32, 0.0, 0.0); count as usize];
            let buffers: [(Slot, &[u8]); 1] = [(Slot::Surfaces, bytemuck::cast_slice(&surfaces))];
            let found = context.bench.evaluate(FUNCTION_SEEN, &inputs, &[], &x, &buffers)?;
            for (surface, found) in surfaces.iter().zip(&found) {
                let seen = projection::seen(&inputs, surface);
                let expected = match part {
                    0 => seen.wo,
                    1 => seen.shading_normal,
                    _ => DVec3::new(seen.eye_distance, seen.inverse_distance, seen.side),
                };
                // Of vertices and positions of the order 1.
                let scale = if part == 2 { 8.0 } else { 4.0 };
                verdict.vector(*found, expected, scale, || format!("surface {}, part {part}", surface.triangle));
            }
        }
    }
    Ok(verdict)
}

/// Density of a projected point over all techniques, with the camera's Jacobian.
pub fn density(context: &mut Context) -> Result<Verdict> {
    let count = context.share(INPUTS / 2);
    let bound = roundings(96, 8, 8);
    let mut verdict = Verdict::new(Bound::Relative(bound));
    // As above; and the eye may be within rounding of a tangent plane.
    verdict.exempt = 1e-3;
    for perspective in [true, false] {
        let (world, surfaces) = seen_world(count, perspective);
        let inputs = world.inputs();
        let probe = |i: u32| Probe {
            offset: (direction(i, 30) * magnitude(i, 32, 0.01, 1.0)).as_vec3(),
            direction: direction(i, 33).as_vec3(),
            ..Probe::default()
        };
        let probes: Vec<Probe> = (0..count).map(probe).collect();
        let buffers: [(Slot, &[u8]); 2] =
            [(Slot::Surfaces, bytemuck::cast_slice(&surfaces)), (Slot::Probes, bytemuck::cast_slice(&probes))];
        let zeros = vec![Vec3::ZERO; count as usize];
        let found = context.bench.evaluate(FUNCTION_DENSITY, &inputs, &[], &zeros, &buffers)?;
        let expected: Vec<[f64; 4]> = surfaces
            .par_iter()
            .zip(&probes)
            .map(|(surface, probe)| {
                let seen = projection::seen(&inputs, surface);
                let material = &inputs.materials[0];
                let (delta, normal) = (probe.offset.as_dvec3(), probe.direction.as_dvec3());
                // The squared distance from an axis is known to roundings of the whole.
                let of = |x: &[f64]| {
                    let (delta, normal) = (DVec3::from_slice(&x[..3]), DVec3::from_slice(&x[3..]));
                    projection::mixture_density(PROJECTION_MIS, material.into(), &seen, delta, normal)
                };
                let arguments: Vec<f64> = delta.to_array().into_iter().chain(normal.to_array()).collect();
                let inverse = projection::inverse_scale(&seen, delta);
                let ratio = if inverse > 0.0 { 1.0 / inverse } else { 0.0 };
                let grazing = 1.0 / seen.wo.dot(seen.normal).abs();
                let ratio_scale = ratio * (1.0 + (1.0 + inverse.abs()) * ratio * grazing);
                let scale = conditioned(bound, &arguments, of) * (1.0 + grazing);
                [of(&arguments), scale, ratio, ratio_scale]
            })
            .collect();
        for (i, (found, [density, scale, ratio, ratio_scale])) in found.iter().zip(expected).enumerate() {
            verdict.compare(found.x, density, scale, || format!("density {i}, {:?}", probes[i]));
            verdict.compare(found.y, ratio, ratio_scale, || format!("ratio {i}, {:?}", probes[i]));
        }
    }
    Ok(verdict)
}

/// Rays through a scene with a ball: most from near it, some along an axis, some along edges.
fn rays(count: u32) -> Vec<Ray> {
    let ray = |i: u32| {
        let from = direction(i, 1) * 1.5 * number(i, 3);
        let to =
            if i.is_multiple_of(8) { from + DVec3::AXES[i as usize / 8 % 3] } else { direction(i, 4) * number(i, 6) };
        let offset = 1e-3 * direction(i, 7);
        let reach = if i.is_multiple_of(4) { 0.5 } else { 1e30 };
        let t_min = if i.is_multiple_of(3) { -reach } else { 0.0 };
        Ray {
            base: from.as_vec3(),
            offset: offset.as_vec3(),
            direction: (to - from).normalize().as_vec3(),
            t_min: t_min as f32,
            t_max: reach as f32,
        }
    };
    (0..count).map(ray).collect()
}

/// Which of a scene's sets an invocation asks for.
fn set_of(i: usize) -> u32 {
    if i.is_multiple_of(5) { 0 } else { u32::MAX }
}

/// Runs one mode of `traverse` on all rays; `entries` are the parts of the result.
fn traverse(
    context: &mut Context,
    function: u32,
    entries: &[u32],
    mut judge: impl FnMut(&mut Verdict, usize, &[Vec3], Vec<strict::Hit>, &[Triangle]),
) -> Result<Verdict> {
    let staged = super::staged()?;
    let case = &staged[0].case;
    let rays = rays(context.share(INPUTS / 4));
    let shadings: Vec<Shading> = (rays.iter().enumerate())
        .map(|(i, ray)| Shading { normal0: ray.base, normal1: ray.offset, normal2: ray.direction, material: set_of(i) })
        .collect();
    let inputs = case.inputs();
    let features = Features { textures: 0, ..inputs.features };
    let given = crate::reference::Inputs { shadings: &shadings, features, ..inputs };
    let mut found = vec![];
    for &entry in entries {
        let x: Vec<Vec3> = rays.iter().map(|ray| Vec3::new(ray.t_min, ray.t_max, entry as f32)).collect();
        found.push(context.bench.evaluate(function, &given, &case.scene.nodes, &x, &[])?);
    }
    // Distances and weights are quotients of sums of three products of differences.
    let mut verdict = context.exact(roundings(24, 2, 0))?;
    let expected: Vec<Vec<strict::Hit>> = rays
        .par_iter()
        .enumerate()
        .map(|(i, ray)| {
            let mut hits: Vec<strict::Hit> = ray.hits(inputs.triangles).collect();
            hits.retain(|hit| set_of(i) == u32::MAX || inputs.triangles[hit.triangle as usize].set == set_of(i));
            hits.sort_by(|a, b| a.t.total_cmp(&b.t));
            hits
        })
        .collect();
    for (i, hits) in expected.into_iter().enumerate() {
        let parts: Vec<Vec3> = found.iter().map(|part| part[i]).collect();
        judge(&mut verdict, i, &parts, hits, inputs.triangles);
    }
    let hit = found[0].iter().filter(|y| y.x > 0.0).count();
    verdict.require(4 * hit > found[0].len(), || format!("only {hit} rays hit"));
    if verdict.bound != Bound::Exact {
        // A ray within rounding of an edge.
        verdict.exempt = 1e-3;
    }
    Ok(verdict)
}

/// The nearest hit: distance, triangle and weights.
pub fn nearest(context: &mut Context) -> Result<Verdict> {
    traverse(context, FUNCTION_CLOSEST, &[0, MAX_HITS], |verdict, i, parts, hits, _| {
        let name = || format!("ray {i}");
        verdict.words(parts[0].x as u32, u32::from(!hits.is_empty()), name);
        let Some(first) = hits.first().filter(|_| parts[0].x > 0.0) else { return };
        verdict.bits(parts[0].y, first.t, 4.0 + f64::from(first.t.abs()), || format!("distance of ray {i}"));
        // Of several at one distance either may be found.
        let tied = hits.iter().take_while(|hit| hit.t == first.t);
        let same = tied.clone().find(|hit| hit.triangle == parts[0].z as u32).unwrap_or(first);
        verdict.words(parts[0].z as u32, same.triangle, || format!("triangle of ray {i}"));
        for c in 0..2 {
            let found = parts[1][c + 1];
            verdict.bits(found, same.barycentric[c], 64.0, || format!("weight {c} of ray {i}"));
        }
    })
}

/// Whether anything is hit.
pub fn any(context: &mut Context) -> Result<Verdict> {
    traverse(context, FUNCTION_ANY, &[0], |verdict, i, parts, hits, _| {
        verdict.words(parts[0].x as u32, u32::from(!hits.is_empty()), || format!("ray {i}"));
    })
}

/// All hits, in any order.
pub fn all(context: &mut Context) -> Result<Verdict> {
    traverse(context, FUNCTION_ALL, &[0, 1, 2, 3], |verdict, i, parts, hits, _| {
        verdict.words(parts[0].x as u32, hits.len() as u32, || format!("hits of ray {i}"));
        if hits.len() > parts.len() || parts[0].x as usize != hits.len() {
            return;
        }
        let mut found: Vec<Vec3> = parts[..hits.len()].to_vec();
        found.sort_by(|a, b| a.y.total_cmp(&b.y).then(a.z.total_cmp(&b.z)));
        let mut hits = hits;
        hits.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle)));
        for (found, hit) in found.iter().zip(&hits) {
            verdict.bits(found.y, hit.t, 4.0 + f64::from(hit.t.abs()), || format!("distance of ray {i}"));
            verdict.words(found.z as u32, hit.triangle, || format!("triangle of ray {i}"));
        }
    })
}

/// Compensated sums: exact operations, whose errors are what is carried.
pub fn add(context: &mut Context) -> Result<Verdict> {
    let count = context.share(INPUTS);
    let vector = |i: u32, k: u32, low: f64| Vec3::from([0, 1, 2].map(|c| magnitude(i, k + c, low, 1e4) as f32));
    let mut verdict = Verdict::new(Bound::Exact);
    for part in 0..2 {
        let shading = |i: u32| Shading {
            normal0: vector(i, 1, 1e-4),
            normal1: vector(i, 4, 1e-4) * 1e-7,
            material: part,
            ..Shading::default()
        };
        let world = World { shadings: (0..count).map(shading).collect(), ..World::default() };
        let x: Vec<Vec3> = (0..count).map(|i| vector(i, 7, 1e-8)).collect();
        let found = context.bench.evaluate(FUNCTION_ADD, &world.inputs(), &[], &x, &[])?;
        for (i, found) in found.iter().enumerate() {
            let (mut sum, mut carry) = (world.shadings[i].normal0, world.shadings[i].normal1);
            sums::add(&mut sum, &mut carry, x[i]);
            let expected = if part == 0 { sum } else { carry };
            for c in 0..3 {
                verdict
                    .bits(found[c], expected[c], f64::from(sum[c]), || format!("sum {i}, component {c}, part {part}"));
            }
        }
    }
    Ok(verdict)
}
