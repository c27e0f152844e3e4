//! What happens at surfaces and where light comes from: boundaries, phase functions, textures, lights.

use super::{
    Bound, Context, Roundings, Verdict, World,
    functions::{INPUTS, conditioned, conditioned_vector, direction, magnitude, number},
    roundings,
};
use crate::{
    error::Result,
    reference::{Inputs, boundary, emitter, light, math, rough, single, texture as twin},
    shared::*,
};
use glam::{DVec2, DVec3, Vec3, dvec3};
use rayon::prelude::*;

fn f64s(x: Vec3) -> [f64; 3] {
    x.as_dvec3().to_array()
}

/// Vectors of each invocation.
fn vectors(count: u32, of: impl Fn(u32) -> [Vec3; 3]) -> Vec<Shading> {
    let shading = |i: u32| {
        let [normal0, normal1, normal2] = of(i);
        Shading { normal0, normal1, normal2, material: 0 }
    };
    (0..count).map(shading).collect()
}

/// A scalar function of x and the first vectors, at as many inputs; `twin` gets x, then the vectors.
fn scalars(
    context: &mut Context,
    function: u32,
    bound: Roundings,
    world: &World,
    x: &[Vec3],
    twin: impl Fn(&Inputs, &[f64]) -> f64 + Sync,
    used: (usize, usize),
) -> Result<Verdict> {
    let inputs = world.inputs();
    let found = context.bench.evaluate(function, &inputs, &[], x, &[])?;
    let mut verdict = Verdict::new(Bound::Relative(bound));
    let expected: Vec<(Vec<f64>, f64, f64)> = (0..x.len())
        .into_par_iter()
        .map(|i| {
            let arguments = arguments(world, x, i, used);
            let value = twin(&inputs, &arguments);
            let scale = conditioned(bound, &arguments, |x| twin(&inputs, x));
            (arguments, value, scale)
        })
        .collect();
    for (found, (arguments, value, scale)) in found.iter().zip(expected) {
        verdict.compare(found.x, value, scale, || format!("{arguments:?}"));
    }
    Ok(verdict)
}

/// As [`scalars`], for a function whose value is a vector.
fn vector_valued(
    context: &mut Context,
    function: u32,
    bound: Roundings,
    world: &World,
    x: &[Vec3],
    twin: impl Fn(&Inputs, &[f64]) -> DVec3 + Sync,
    used: (usize, usize),
) -> Result<Verdict> {
    let inputs = world.inputs();
    let found = context.bench.evaluate(function, &inputs, &[], x, &[])?;
    let mut verdict = Verdict::new(Bound::Relative(bound));
    let expected: Vec<(Vec<f64>, DVec3, f64)> = (0..x.len())
        .into_par_iter()
        .map(|i| {
            let arguments = arguments(world, x, i, used);
            let value = twin(&inputs, &arguments);
            let scale = conditioned_vector(bound, &arguments, |x| twin(&inputs, x)).max(value.length());
            (arguments, value, scale)
        })
        .collect();
    for (found, (arguments, value, scale)) in found.iter().zip(expected) {
        verdict.vector(*found, value, scale, || format!("{arguments:?}"));
    }
    Ok(verdict)
}

/// The first `used.0` components of x, then the first `used.1` vectors.
fn arguments(world: &World, x: &[Vec3], i: usize, used: (usize, usize)) -> Vec<f64> {
    let mut all = f64s(x[i])[..used.0].to_vec();
    if let Some(shading) = world.shadings.get(i) {
        let of = [shading.normal0, shading.normal1, shading.normal2];
        all.extend(of[..used.1].iter().flat_map(|v| f64s(*v)));
    }
    all
}

fn vector_at(arguments: &[f64], start: usize) -> DVec3 {
    DVec3::from_slice(&arguments[start..start + 3])
}

/// Fresnel reflectance, also at n = 1 and beyond the critical angle of a rarer medium.
pub fn fresnel(context: &mut Context) -> Result<Verdict> {
    let iors = [0.7f32, 1.0, 1.2, 1.3, 1.5, 2.4];
    let x: Vec<Vec3> =
        (0..context.share(INPUTS)).map(|i| Vec3::new(iors[i as usize % 6], number(i, 1) as f32, 0.0)).collect();
    let twin = |_: &Inputs, x: &[f64]| 1.0 - boundary::transmittance(x[0], x[1].min(1.0));
    // Sums of squares around 1, a root, quotients of sums.
    scalars(context, FUNCTION_FRESNEL, roundings(16, 2, 1), &World::default(), &x, twin, (2, 0))
}

/// Transmittance of rough boundaries, and what radiance that leaves is multiplied by, from their tables: here any numbers.
pub fn crossing(context: &mut Context) -> Result<Verdict> {
    let boundaries = (0..2 * ROUGHNESS_ROWS * BOUNDARY_ROW).map(|i| 0.5 + 0.5 * number(i, 9) as f32).collect();
    let materials = [1, 2].map(|boundary| Material { ior: 1.4, boundary, ..Material::default() }).to_vec();
    let count = context.share(INPUTS);
    let x: Vec<Vec3> = (0..count).map(|i| Vec3::new(number(i, 1) as f32, number(i, 2) as f32, 0.0)).collect();
    let shadings = (0..count).map(|i| Shading { material: i % 2, ..Shading::default() }).collect();
    let features = Features { rough: ROUGHNESS_ROWS, ..Features::default() };
    let world = World { features, materials, shadings, boundaries, ..World::default() };
    let inputs = world.inputs();
    let found = context.bench.evaluate(FUNCTION_CROSSING, &inputs, &[], &x, &[])?;
    let bound = roundings(12, 1, 1);
    let mut verdict = Verdict::new(Bound::Relative(bound));
    for (i, (x, found)) in x.iter().zip(&found).enumerate() {
        let material = &inputs.materials[i % 2];
        let arguments = [f64::from(x.x), f64::from(x.y)];
        let parts: [(f32, &dyn Fn(&[f64]) -> f64); 2] = [
            (found.x, &|x| rough::crossing(&inputs, material, x[0].min(1.0), x[1].min(1.0))),
            (found.y, &|x| rough::leaving_share(&inputs, material, x[1].min(1.0))),
        ];
        for (part, (found, twin)) in parts.into_iter().enumerate() {
            let scale = conditioned(bound, &arguments, twin);
            verdict.compare(found, twin(&arguments), scale, || format!("part {part} at {}, {}", x.x, x.y));
        }
    }
    Ok(verdict)
}

/// GGX distribution and Smith's Lambda.
pub fn ggx(context: &mut Context) -> Result<Verdict> {
    let count = context.share(INPUTS);
    let bound = roundings(16, 2, 1);
    let shadings = vectors(count, |i| {
        let v = direction(i, 3);
        [v.with_z(v.z.abs().max(1e-3)).normalize().as_vec3(); 3]
    });
    let x: Vec<Vec3> = (0..count).map(|i| Vec3::new(magnitude(i, 1, 1e-3, 1.0) as f32, 0.0, 0.0)).collect();
    let world = World { shadings, ..World::default() };
    let found = context.bench.evaluate(FUNCTION_GGX, &world.inputs(), &[], &x, &[])?;
    let mut verdict = Verdict::new(Bound::Relative(bound));
    for (i, found) in found.iter().enumerate() {
        let arguments = arguments(&world, &x, i, (1, 1));
        let distribution = |x: &[f64]| boundary::ggx(x[0], vector_at(x, 1).normalize().z);
        let value = distribution(&arguments);
        let scale = conditioned(bound, &arguments, distribution);
        verdict.compare(found.x, value, scale, || format!("distribution {arguments:?}"));
        // Lambda is the difference of a root and 1.
        let root = |x: &[f64]| 1.0 / boundary::smith_g1(x[0], vector_at(x, 1).normalize().z);
        let scale = conditioned(bound, &arguments, root);
        verdict.compare(found.y, root(&arguments) - 1.0, scale, || format!("Lambda {arguments:?}"));
    }
    Ok(verdict)
}

/// Visible normals of GGX.
pub fn half_vector(context: &mut Context) -> Result<Verdict> {
    let count = context.share(INPUTS);
    let shadings = vectors(count, |i| {
        let v = direction(i, 3);
        [v.with_z(v.z.abs().max(1e-3)).normalize().as_vec3(); 3]
    });
    let u = |i: u32, k: u32| number(i, k) as f32;
    let x: Vec<Vec3> = (0..count).map(|i| Vec3::new(magnitude(i, 1, 1e-3, 1.0) as f32, u(i, 2), u(i, 5))).collect();
    let world = World { shadings, ..World::default() };
    let twin = |_: &Inputs, x: &[f64]| boundary::visible_normal(x[0], vector_at(x, 3), x[1].min(1.0), x[2]);
    vector_valued(context, FUNCTION_HALF_VECTOR, roundings(32, 3, 4), &world, &x, twin, (3, 1))
}

/// A direction above a normal: [direction, normal].
fn above(i: u32) -> [DVec3; 2] {
    let (w, n) = (direction(i, 3), direction(i, 6));
    [if w.dot(n) < 0.0 { -w } else { w }, n]
}

/// Refraction, to nothing beyond the critical angle.
pub fn refracted(context: &mut Context) -> Result<Verdict> {
    let count = context.share(INPUTS);
    let shadings = vectors(count, |i| {
        let [w, n] = above(i);
        [w.as_vec3(), n.as_vec3(), Vec3::ZERO]
    });
    let iors = [0.7f32, 1.0, 1.3, 2.0];
    let x: Vec<Vec3> = (0..count).map(|i| Vec3::new(iors[i as usize % 4], 0.0, 0.0)).collect();
    let world = World { shadings, ..World::default() };
    let twin = |_: &Inputs, x: &[f64]| single::refracted(vector_at(x, 1), vector_at(x, 4), x[0]).unwrap_or(DVec3::ZERO);
    let mut verdict = vector_valued(context, FUNCTION_REFRACTED, roundings(24, 2, 1), &world, &x, twin, (1, 2))?;
    // At the critical angle rounding decides whether there is a direction at all.
    verdict.exempt = 1e-4;
    Ok(verdict)
}

/// Mean cosines of phase functions.
const G: [f32; 5] = [0.0, 0.5, 0.9, -0.9, 0.99];

/// Henyey and Greenstein's phase function.
pub fn phase(context: &mut Context) -> Result<Verdict> {
    let count = context.share(INPUTS);
    let shadings = vectors(count, |i| {
        let d = direction(i, 3);
        // Half of them near the peak.
        let w = if i % 2 == 0 { direction(i, 6) } else { (d + 0.2 * direction(i, 6)).normalize() };
        [d.as_vec3(), w.as_vec3(), Vec3::ZERO]
    });
    let x: Vec<Vec3> = (0..count).map(|i| Vec3::new(G[i as usize % 5], 0.0, 0.0)).collect();
    let world = World { shadings, ..World::default() };
    // 1 - cosine as the vectors themselves have it, whose lengths are 1 but for rounding.
    let twin = |_: &Inputs, x: &[f64]| {
        let (g, d, w) = (x[0], vector_at(x, 1), vector_at(x, 4));
        let from_peak = if g < 0.0 { (w + d).length_squared() } else { (w - d).length_squared() };
        single::phase(g.abs(), 1.0 - 0.5 * from_peak)
    };
    scalars(context, FUNCTION_PHASE, roundings(20, 1, 1), &world, &x, twin, (1, 2))
}

/// Draws of its directions.
pub fn draw_phase(context: &mut Context) -> Result<Verdict> {
    let count = context.share(INPUTS);
    let shadings = vectors(count, |i| [direction(i, 3).as_vec3(); 3]);
    let x: Vec<Vec3> =
        (0..count).map(|i| Vec3::new(G[i as usize % 5], number(i, 1) as f32, number(i, 2) as f32)).collect();
    let world = World { shadings, ..World::default() };
    let twin = |_: &Inputs, x: &[f64]| single::draw_phase(x[0], vector_at(x, 3), (x[1].min(1.0), x[2]));
    vector_valued(context, FUNCTION_DRAW_PHASE, roundings(32, 3, 2), &world, &x, twin, (3, 1))
}

/// Lookups with every wrap, filter, encoding and transform.
pub fn texture(context: &mut Context) -> Result<Verdict> {
    let mut texels: Vec<u32> = (0..=255).map(|byte| (twin::decode(byte) as f32).to_bits()).collect();
    texels.extend((0..100).map(|i| crate::reference::random::hash(i + 77)));
    let mut textures = vec![];
    for (k, (width, height)) in (0u32..).zip([(1, 1), (2, 3), (7, 5)]) {
        for modes in 0..36 {
            let (wrap_u, wrap_v, linear, srgb) = (modes % 3, modes / 3 % 3, modes / 9 % 2, modes / 18);
            let row = |j: u32| Vec3::from([0, 1, 2].map(|c| (4.0 * number(900 + 40 * k + modes, j + c) - 2.0) as f32));
            let (row_u, row_v) = if modes % 5 == 0 { (Vec3::X, Vec3::Y) } else { (row(0), row(3)) };
            let offset = 256 + k;
            textures.push(Texture {
                width,
                height,
                offset,
                srgb,
                wrap_u,
                wrap_v,
                linear,
                row_u,
                row_v,
                ..Texture::default()
            });
        }
    }
    let features = Features { textures: 1, ..Features::default() };
    let world = World { features, texels, textures, ..World::default() };
    let inputs = world.inputs();
    let u = |i: u32, k: u32| (4.0 * number(i, k) - 2.0) as f32;
    let x: Vec<Vec3> = (0..context.share(INPUTS))
        .map(|i| Vec3::new(u(i, 1), u(i, 2), (i as usize % world.textures.len()) as f32))
        .collect();
    let color = context.bench.evaluate(FUNCTION_TEXTURE, &inputs, &[], &x, &[])?;
    let alpha = context.bench.evaluate(FUNCTION_TEXTURE_ALPHA, &inputs, &[], &x, &[])?;
    // A coordinate is a sum of three products, and between texels a value changes by 1 a texel at most.
    let mut verdict = Verdict::new(Bound::Relative(roundings(8, 0, 0)));
    // The nearest texel flips where rounding moves a coordinate over its edge.
    verdict.exempt = 1e-3;
    for (i, x) in x.iter().enumerate() {
        let texture = &world.textures[x.z as usize];
        let at = DVec2::new(x.x.into(), x.y.into());
        let expected = twin::at(&inputs, texture, at);
        let reach = f64::from(texture.row_u.abs().dot(Vec3::new(x.x.abs(), x.y.abs(), 1.0)))
            .max(f64::from(texture.row_v.abs().dot(Vec3::new(x.x.abs(), x.y.abs(), 1.0))));
        let scale = 1.0 + 2.0 * reach * f64::from(texture.width.max(texture.height));
        let name = || format!("texture {} at ({}, {})", x.z, x.x, x.y);
        verdict.vector(color[i], expected.truncate(), scale, name);
        verdict.compare(alpha[i].x, expected.w, scale, name);
    }
    Ok(verdict)
}

/// What arrives from delta lights, and whence.
pub fn delta_light(context: &mut Context) -> Result<Verdict> {
    let make = |kind: u32| Light {
        position: Vec3::new(0.3, 1.5, -0.7),
        direction: Vec3::new(0.2, -0.9, 0.3).normalize(),
        intensity: Vec3::new(3.0, 2.0, 1.0),
        kind,
        spot_scale: 4.0,
        spot_offset: -2.5,
        inverse_range: if kind == LIGHT_SPOT { 0.2 } else { 0.0 },
    };
    let lights = [LIGHT_POINT, LIGHT_SPOT, LIGHT_DIRECTIONAL].map(make).to_vec();
    let count = context.share(INPUTS);
    let shadings = (0..count).map(|i| Shading { material: i % 3, ..Shading::default() }).collect();
    let world = World { lights, shadings, ..World::default() };
    let x: Vec<Vec3> = (0..count).map(|i| (direction(i, 3) * magnitude(i, 5, 0.1, 4.0)).as_vec3()).collect();
    let bound = roundings(24, 2, 1);
    let mut verdict = Verdict::new(Bound::Relative(bound));
    for (part, function) in [FUNCTION_DELTA_LIGHT, FUNCTION_LIGHT_DIRECTION].into_iter().enumerate() {
        let found = context.bench.evaluate(function, &world.inputs(), &[], &x, &[])?;
        for (i, found) in found.iter().enumerate() {
            let light = &world.lights[i % 3];
            let twin = |x: &[f64]| {
                let incident = light::delta(light, vector_at(x, 0));
                if part == 0 { incident.irradiance } else { incident.wi }
            };
            let arguments = f64s(x[i]);
            let value = twin(&arguments);
            // Positions of lights round as those of surfaces do.
            let scale = conditioned_vector(bound, &arguments, twin).max(value.length());
            verdict.vector(*found, value, scale, || format!("light {} at {}", i % 3, x[i]));
        }
    }
    Ok(verdict)
}

/// A world under an image, turned.
fn under_image() -> World {
    let texel = |i: u32| Vec3::new(0.1 + (i % 7) as f32, 0.2 + (i % 5) as f32, 0.3 + (i % 11) as f32);
    let environment: Vec<Vec3> = (0..128).map(texel).collect();
    let (environment_cdf, density_width, density_height) = light::environment_cdf(&environment, 16, 8);
    let (sin, cos) = 0.7f32.sin_cos();
    let view = View {
        environment_scale: Vec3::new(0.5, 0.7, 1.0),
        environment_row0: Vec3::new(cos, 0.0, sin),
        environment_row1: Vec3::Y,
        environment_row2: Vec3::new(-sin, 0.0, cos),
        environment_width: 16,
        environment_height: 8,
        density_width,
        density_height,
        ..View::default()
    };
    let features = Features { environment: ENVIRONMENT_IMAGE, ..Features::default() };
    World { features, view, environment, environment_cdf, ..World::default() }
}

/// Radiance of an image. Its coordinates are angles, and a texel is a 16th of the circle.
pub fn environment(context: &mut Context) -> Result<Verdict> {
    let count = context.share(INPUTS);
    let world = World { shadings: vectors(count, |i| [direction(i, 3).as_vec3(); 3]), ..under_image() };
    let found =
        context.bench.evaluate(FUNCTION_ENVIRONMENT, &world.inputs(), &[], &vec![Vec3::ZERO; count as usize], &[])?;
    let mut verdict = Verdict::new(Bound::Relative(roundings(24, 3, 1)));
    for (shading, found) in world.shadings.iter().zip(&found) {
        let d = shading.normal0;
        let expected = light::environment(&world.inputs(), d.as_dvec3());
        // Near a pole a small turn goes around.
        let turn = 1.0 / f64::from(1.0 - d.y * d.y).max(1e-6).sqrt();
        verdict.vector(*found, expected, 16.0 * turn.min(100.0) + expected.length(), || format!("{d}"));
    }
    Ok(verdict)
}

/// Density of the draws of its directions.
pub fn environment_density(context: &mut Context) -> Result<Verdict> {
    let count = context.share(INPUTS);
    let world = World { shadings: vectors(count, |i| [direction(i, 3).as_vec3(); 3]), ..under_image() };
    let zeros = vec![Vec3::ZERO; count as usize];
    let twin = |inputs: &Inputs, x: &[f64]| light::environment_pdf(inputs, vector_at(x, 0).normalize());
    let bound = roundings(32, 4, 1);
    let mut verdict = scalars(context, FUNCTION_ENVIRONMENT_DENSITY, bound, &world, &zeros, twin, (0, 1))?;
    // The cell flips at its edge.
    verdict.exempt = 1e-3;
    Ok(verdict)
}

/// Draws of its directions.
pub fn draw_environment(context: &mut Context) -> Result<Verdict> {
    let world = under_image();
    let x: Vec<Vec3> =
        (0..context.share(INPUTS)).map(|i| Vec3::new(number(i, 1) as f32, number(i, 2) as f32, 0.0)).collect();
    let twin =
        |inputs: &Inputs, x: &[f64]| light::sample_environment(inputs, x[0].min(0.999_999_9), x[1].min(0.999_999_9));
    vector_valued(context, FUNCTION_DRAW_ENVIRONMENT, roundings(32, 4, 0), &world, &x, twin, (2, 0))
}

/// Draws of directions by the cosine.
pub fn draw_cosine(context: &mut Context) -> Result<Verdict> {
    let count = context.share(INPUTS);
    let world = World { shadings: vectors(count, |i| [direction(i, 3).as_vec3(); 3]), ..World::default() };
    let x: Vec<Vec3> = (0..count).map(|i| Vec3::new(number(i, 1) as f32, number(i, 2) as f32, 0.0)).collect();
    let twin = |_: &Inputs, x: &[f64]| math::cosine_direction(vector_at(x, 2), x[0].min(1.0), x[1]);
    vector_valued(context, FUNCTION_DRAW_COSINE, roundings(24, 1, 2), &world, &x, twin, (2, 1))
}

/// A few triangles that shine, each as it likes.
fn shining(count: u32) -> World {
    let mut world = World { materials: vec![], ..World::default() };
    for k in 0..7u32 {
        let corner = dvec3(f64::from(k) - 3.0, 2.0, 0.3 * f64::from(k));
        let edge = |j: u32| 0.5 * direction(k, j) + 0.1 * DVec3::Y;
        world.triangle([corner, corner + edge(1), corner + edge(3)]);
        world.shadings[k as usize].material = k;
        let emission = Vec3::new(1.0, 0.5, 0.2) * (k % 3) as f32;
        world.materials.push(Material { emission, flags: TWO_SIDED, ..Material::default() });
    }
    world.emitters = emitter::table(&world.triangles, &world.shadings, &world.materials);
    world.view.emitter_count = world.emitters.len() as u32;
    (world.view.emitters_centre, world.view.emitters_radius2) = emitter::ball(&world.triangles, &world.emitters);
    world.features.emitters = 1;
    // The vectors of the invocations follow; triangles have no need of normals here.
    let materials: Vec<u32> = world.shadings.iter().map(|shading| shading.material).collect();
    world.shadings =
        vectors(count.max(7), |i| [(0.5 * direction(i, 3)).as_vec3(), (1e-3 * direction(i, 5)).as_vec3(), Vec3::ZERO]);
    for (shading, material) in world.shadings.iter_mut().zip(materials) {
        shading.material = material;
    }
    world
}

/// Draws of points of emitters.
pub fn draw_emitter(context: &mut Context) -> Result<Verdict> {
    let count = context.share(INPUTS);
    let world = shining(count);
    let x: Vec<Vec3> = (0..count).map(|i| Vec3::new(number(i, 1) as f32, number(i, 2) as f32, 0.0)).collect();
    let found = context.bench.evaluate(FUNCTION_DRAW_EMITTER, &world.inputs(), &[], &x, &[])?;
    let mut verdict = Verdict::new(Bound::Relative(roundings(24, 2, 3)));
    for (i, found) in found.iter().enumerate() {
        let from = world.shadings[i].normal0.as_dvec3() + world.shadings[i].normal1.as_dvec3();
        let point = emitter::draw(&world.inputs(), from, x[i].x.into(), x[i].y.into());
        // Positions are of the order 5.
        verdict.vector(*found, point.wi * point.distance, point.distance + 5.0, || format!("{} from {from}", x[i]));
    }
    Ok(verdict)
}

/// Their density, found by the triangle, combined with another's.
pub fn emitter_density(context: &mut Context) -> Result<Verdict> {
    let count = context.share(INPUTS);
    let mut world = shining(count);
    for (i, shading) in (0..).zip(&mut world.shadings).skip(7) {
        (shading.normal0, shading.material) = (direction(i, 3).as_vec3(), i % 7);
    }
    let x: Vec<Vec3> =
        (0..count).map(|i| Vec3::new(magnitude(i, 1, 0.1, 10.0) as f32, number(i, 2) as f32, 0.0)).collect();
    let found = context.bench.evaluate(FUNCTION_EMITTER_DENSITY, &world.inputs(), &[], &x, &[])?;
    let bound = roundings(24, 2, 2);
    let mut verdict = Verdict::new(Bound::Relative(bound));
    let inputs = world.inputs();
    for (i, found) in found.iter().enumerate().skip(7) {
        let k = i as u32 % 7;
        // The cosine cancels but for the density per area.
        let twin = |x: &[f64]| 1.0 / (emitter::density(&inputs, k, vector_at(x, 2), x[0]) + x[1]);
        let mut arguments = f64s(x[i])[..2].to_vec();
        arguments.extend(f64s(world.shadings[i].normal0));
        let (value, scale) = (twin(&arguments), conditioned(bound, &arguments, twin));
        verdict.compare(found.x, value, scale, || format!("triangle {k}, {arguments:?}"));
    }
    Ok(verdict)
}
