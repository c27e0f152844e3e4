//! Each model's value, density and draw of the radius.

use super::{
    Bound, Context, Roundings, Verdict, World,
    functions::{INPUTS, conditioned, direction, magnitude, number},
    roundings,
};
use crate::{
    error::Result,
    reference::{
        mixture as twin_mixture,
        profile::{
            self, Coefficients, Directional, Matter, Options, draw_radius, lambert::limit, obliqueness, plane_density,
            shapes_shifted, tabulated,
        },
    },
    settings::Normalisation,
    shared::*,
};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Media of a test.
const MEDIA: u32 = 16;

const OPTIONS: Options = Options {
    normalisation: Normalisation::Energy,
    radius_tail: 0.0,
    directional: crate::settings::Directional { renormalise: false, reciprocal: false, kappa: 1.0 },
    precision: crate::settings::Precision::Packed,
};

/// Three channels of matter, with mean free paths from a hundredth to ten.
fn coefficients(i: u32, ior: f64) -> [Coefficients; 3] {
    [0, 1, 2].map(|c| {
        let extinction = magnitude(i, 10 + c, 0.1, 100.0);
        let absorbed = magnitude(i, 20 + c, 1e-4, 0.5);
        let (sigma_s_prime, sigma_a) = (extinction * (1.0 - absorbed), extinction * absorbed);
        Coefficients { sigma_s_prime, sigma_a, g: 0.0, ior, rough: None, appearance: None }
    })
}

/// Media of a model, and one for each invocation.
fn world(model: u32, count: u32) -> World {
    let mut profiles = vec![];
    let materials = (0..MEDIA).map(|i| {
        // Tables of these indices come with the crate.
        let ior = [1.3, 1.5, 1.0, 1.4][i as usize % 4];
        let matter = coefficients(i, ior);
        match model {
            MODEL_TABLE => tabulated(&matter, OPTIONS, &[0, 4, 8], &mut profiles),
            MODEL_LAMBERT => limit(MODEL_TABLE, &matter, OPTIONS),
            _ => profile::material(model, &matter, OPTIONS),
        }
    });
    let materials = materials.collect();
    let shading = |i: u32| Shading { material: i % MEDIA, ..Shading::default() };
    let shadings: Vec<Shading> = (0..count).map(shading).collect();
    let of_table = u32::from(model == MODEL_TABLE);
    let features = Features { models: 1 << model, curvature: of_table, cell_vectors: of_table, ..Features::default() };
    let mut world = World { features, materials, shadings, profiles, ..World::default() };
    if model == MODEL_TABLE {
        // The curvature at each invocation: half-spaces, and spheres of many sizes.
        let of = |i: u32| if i.is_multiple_of(4) { 0.0 } else { magnitude(i, 30, 1e-2, 10.0) as f32 };
        let at = |i: u32| Balance { at: [Vec3::ONE; 3], curvature: Vec3::splat(of(i)) };
        world.balances = (0..count).map(at).collect();
    }
    world
}

impl World {
    fn matter(&self, i: usize) -> Matter<'_> {
        let material = &self.materials[self.shadings[i].material as usize];
        let curvature = self.balances.get(i).map_or(0.0, |balance| f64::from(balance.curvature.x));
        Matter { material, tables: &self.profiles, curvature }
    }
}

/// Largest exponent of the profile's exponentials at a radius: a rounding of it is so many of the value.
fn exponent(m: &Material, c: usize, r: f64) -> f64 {
    f64::from(m.sigma_tr[c]) * r.hypot(f64::from(m.z_virtual[c]))
}

/// Value, density and radii of a model.
fn model(context: &mut Context, model: u32) -> Result<Verdict> {
    let count = context.share(INPUTS);
    let world = world(model, count);
    let inputs = world.inputs();
    // Distances and squares of them, three quotients, an exponential or, of a table, an interpolation.
    let bound = roundings(48, 4, 3);
    let mut verdict = Verdict::new(Bound::Relative(bound));
    let radius = |i: u32| {
        let m = &world.materials[(i % MEDIA) as usize];
        let length = if matches!(model, MODEL_BURLEY | MODEL_TABLE) { 1.0 / m.camera_rate } else { m.z_real.x };
        (f64::from(length) * magnitude(i, 1, 1e-3, 20.0)) as f32
    };

    let shift = |i: u32| (4.0 * number(i, 2)) as f32;
    let x: Vec<Vec3> = (0..count).map(|i| Vec3::new(radius(i), shift(i), 0.0)).collect();
    let found = context.bench.evaluate(FUNCTION_SHAPE, &inputs, &[], &x, &[])?;
    let expected: Vec<(DVec3, DVec3)> = (0..count as usize)
        .into_par_iter()
        .map(|i| {
            let (matter, r, shift) = (world.matter(i), f64::from(x[i].x), f64::from(x[i].y));
            let value = shapes_shifted(matter, r, shift);
            let of = |x: &[f64], c: usize| shapes_shifted(matter, x[0], x[1])[c];
            let scale =
                |c: usize| conditioned(bound, &[r, shift], |x| of(x, c)) + value[c] * exponent(matter.material, c, r);
            (value, DVec3::new(scale(0), scale(1), scale(2)))
        })
        .collect();
    for (i, (found, (value, scale))) in found.iter().zip(&expected).enumerate() {
        for c in 0..3 {
            // What exp_ calls nothing.
            let tiny = value[c].abs() < 1e-30;
            verdict.compare(found[c], value[c], if tiny { 1e-30 } else { scale[c] }, || {
                format!("medium {}, r {:e}, shift {}, channel {c}", i as u32 % MEDIA, x[i].x, x[i].y)
            });
        }
    }

    let u = |i: u32, k: u32| number(i, k) as f32;
    let x: Vec<Vec3> = (0..count).map(|i| Vec3::new(radius(i), u(i, 3), u(i, 4))).collect();
    let found = context.bench.evaluate(FUNCTION_RADIUS, &inputs, &[], &x, &[])?;
    let expected: Vec<[f64; 4]> = (0..count as usize)
        .into_par_iter()
        .map(|i| {
            let (matter, r) = (world.matter(i), f64::from(x[i].x));
            let last = 1.0 - 2f64.powi(-24);
            let draw = |x: &[f64]| draw_radius(matter, x[0].min(last), x[1].min(last));
            let drawn = [f64::from(x[i].y), f64::from(x[i].z)];
            let density = |x: &[f64]| plane_density(matter, x[0]);
            let deepest = (0..3).map(|c| exponent(matter.material, c, r)).fold(0.0, f64::max);
            let scale = conditioned(bound, &[r], density) + density(&[r]) * deepest;
            [draw(&drawn), conditioned(bound, &drawn, draw), density(&[r]), scale]
        })
        .collect();
    for (i, (found, [draw, draw_scale, density, scale])) in found.iter().zip(expected).enumerate() {
        let medium = i as u32 % MEDIA;
        verdict.compare(found.x, draw, draw_scale, || format!("medium {medium}, radius from {}, {}", x[i].y, x[i].z));
        verdict.compare(found.y, density, scale.max(1e-30), || format!("medium {medium}, density at {:e}", x[i].x));
    }
    // A component, a cell of a table or one of its spheres flips at its edge.
    verdict.exempt = 1e-3;
    Ok(verdict)
}

/// The standard dipole.
pub fn standard(context: &mut Context) -> Result<Verdict> {
    model(context, MODEL_STANDARD)
}

/// The better dipole.
pub fn better(context: &mut Context) -> Result<Verdict> {
    model(context, MODEL_BETTER)
}

/// Normalised diffusion.
pub fn burley(context: &mut Context) -> Result<Verdict> {
    model(context, MODEL_BURLEY)
}

/// Tabulated profiles of half-spaces and spheres, and what they make of oblique light.
pub fn table(context: &mut Context) -> Result<Verdict> {
    let mut verdict = model(context, MODEL_TABLE)?;
    oblique(context, &world(MODEL_TABLE, context.share(INPUTS)), &mut verdict)?;
    Ok(verdict)
}

/// The opaque limit of the table.
pub fn lambert(context: &mut Context) -> Result<Verdict> {
    let mut verdict = Verdict::new(Bound::Relative(roundings(16, 3, 1)));
    oblique(context, &world(MODEL_LAMBERT, context.share(INPUTS)), &mut verdict)?;
    Ok(verdict)
}

/// The factor on light at an angle, entering and leaving.
fn oblique(context: &mut Context, world: &World, verdict: &mut Verdict) -> Result<()> {
    let x: Vec<Vec3> =
        (0..world.shadings.len() as u32).map(|i| Vec3::new(number(i, 5) as f32, (i / MEDIA % 2) as f32, 0.0)).collect();
    let found = context.bench.evaluate(FUNCTION_OBLIQUENESS, &world.inputs(), &[], &x, &[])?;
    for (i, (x, found)) in x.iter().zip(&found).enumerate() {
        let value = obliqueness(world.matter(i), x.x.into(), x.y > 0.5);
        // Of numbers around 1, but for the cosine inside: the root of a difference of such.
        let ior = f64::from(world.matter(i).material.ior);
        let inside = (1.0 - (1.0 - f64::from(x.x).powi(2)) / (ior * ior)).max(1e-6).sqrt();
        verdict.vector(*found, value, (1.0 + value.length()) * (1.0 + 1.0 / inside), || {
            format!("obliqueness {i} at {}", x.x)
        });
    }
    Ok(())
}

/// What a term of the directional dipole is made of, before what cancels in it: distance and the product of its place and
/// direction.
fn magnitude_of(profile: &Directional, d: f64, x: f64) -> f64 {
    let (s, z) = (profile.proposal.sigma_tr, profile.proposal.z_real);
    let (sd, k) = (s * d, 1.0 + s * d);
    let flux = z * k + (k + z * (3.0 * k + sd * sd) / (d * d) * x) * x;
    (-sd).exp() / d.powi(3) * (profile.c_phi * (3.0 * d * d / z + 3.0 * k * x) + profile.c_e * flux)
}

/// The directional dipole's value between a place and a direction, and the sum of the magnitudes of all that is added and
/// subtracted in it.
pub fn directional_scale(profile: &Directional, x: DVec3, ni: DVec3, wi: DVec3, no: DVec3) -> [f64; 2] {
    let expected = profile.value(x, ni, wi, no, 0.0);
    let (h, r) = (profile.height, x.length());
    let near = r.hypot(profile.nearest(x, ni, wi, no));
    let scale = profile.beam * (magnitude_of(profile, near, r) + magnitude_of(profile, r.hypot(h), r + h));
    [expected, scale.max(expected)]
}

/// The directional dipole between points and directions.
pub fn directional(context: &mut Context) -> Result<Verdict> {
    let count = context.share(INPUTS);
    let mut world = world(MODEL_DIRECTIONAL, count);
    for (i, shading) in (0..).zip(&mut world.shadings) {
        let (ni, wi) = (direction(i, 1), direction(i, 3));
        let wi = if wi.dot(ni) < 0.0 { -wi } else { wi };
        let no = if i % 3 == 0 { ni } else { direction(i, 5) };
        (shading.normal0, shading.normal1, shading.normal2) = (ni.as_vec3(), wi.as_vec3(), no.as_vec3());
    }
    let place = |i: u32| {
        let length = world.materials[(i % MEDIA) as usize].z_real.x;
        (direction(i, 7) * f64::from(length) * magnitude(i, 9, 1e-2, 10.0)).as_vec3()
    };
    let x: Vec<Vec3> = (0..count).map(place).collect();
    let found = context.bench.evaluate(FUNCTION_DIRECTIONAL, &world.inputs(), &[], &x, &[])?;
    let bound: Roundings = roundings(64, 6, 4);
    let mut verdict = Verdict::new(Bound::Relative(bound));
    // At the critical angle light enters on one side and not on the other.
    verdict.exempt = 1e-4;
    for (i, found) in found.iter().enumerate() {
        let d = &world.shadings[i];
        let [ni, wi, no] = [d.normal0, d.normal1, d.normal2].map(|v| v.as_dvec3());
        for c in 0..3 {
            let profile = Directional::unpack(world.matter(i), c);
            let [value, scale] = directional_scale(&profile, x[i].as_dvec3(), ni, wi, no);
            let exponent = profile.proposal.sigma_tr * x[i].as_dvec3().length().hypot(profile.height);
            verdict.compare(found[c], value, (scale * (1.0 + exponent)).max(1e-30), || {
                format!("medium {}, {} {ni} {wi} {no}, channel {c}", i as u32 % MEDIA, x[i])
            });
        }
    }
    Ok(verdict)
}

/// Which medium of a set a number picks, and its place within that share.
pub fn mixture(context: &mut Context) -> Result<Verdict> {
    let count = context.share(INPUTS);
    let mixtures: Vec<Mixture> = (1..=MAX_MEMBERS).map(|count| Mixture { count, ..Mixture::default() }).collect();
    let shading = |i: u32| Shading { material: i % MAX_MEMBERS, ..Shading::default() };
    let world = World { mixtures, shadings: (0..count).map(shading).collect(), ..World::default() };
    let x: Vec<Vec3> = (0..count).map(|i| Vec3::new(number(i, 1) as f32, 0.0, 0.0)).collect();
    let found = context.bench.evaluate(FUNCTION_PICK, &world.inputs(), &[], &x, &[])?;
    let mut verdict = Verdict::new(Bound::Relative(roundings(2, 0, 0)));
    // At the edge of a share the next one begins.
    verdict.exempt = 1e-4;
    for (i, (x, found)) in x.iter().zip(&found).enumerate() {
        let members: Vec<Material> =
            (0..=i as u32 % MAX_MEMBERS).map(|model| Material { model, ..Material::default() }).collect();
        let (member, rest) = twin_mixture::pick(&members, x.x.into());
        verdict.compare(found.x, member.model.into(), 1.0, || format!("member for {}", x.x));
        verdict.compare(found.y, rest, members.len() as f64, || format!("its place for {}", x.x));
    }
    Ok(verdict)
}
