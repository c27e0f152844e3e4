//! Light at points of the surface, the cloud's tree above them, and what pixels gather.

use super::{Bound, Context, Roundings, Verdict, cases, roundings};
use crate::{
    error::Result,
    prepare::Prepared,
    reference::{
        self, cluster::grow, gather as twin, irradiance::irradiance as twin_irradiance,
        primary::primary as twin_primary,
    },
    shared::*,
};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// As of the stages of the other integrator: geometry, profile, boundary and light.
const SHADING: Roundings = roundings(100, 6, 4);

/// Part of the points and pixels in which rounding may decide whether a ray passes an edge.
const CHOICES: f64 = 1e-3;

/// Samples that light points.
const SAMPLES: u32 = 2;

/// A case's clusters with the twin's light at the leaves and none above; or its points whose light is kept, with that.
pub(super) fn lit(case: &cases::Case) -> Vec<Cluster> {
    let inputs = case.inputs();
    let mut clusters = points(case).to_vec();
    let first = inputs.view.leaves as usize;
    clusters[first..].par_iter_mut().enumerate().filter(|(_, point)| point.area > 0.0).for_each(|(i, point)| {
        for sample in 0..SAMPLES {
            let [flux, oblique] = twin_irradiance(&inputs, &step(case, sample), i as u32, point);
            point.flux += flux.as_vec3();
            point.oblique += oblique.as_vec3();
        }
    });
    clusters
}

/// What Clusters holds.
fn points(case: &cases::Case) -> &[Cluster] {
    let Prepared { clusters, cache, .. } = &case.prepared;
    if clusters.is_empty() { &cache.points } else { clusters }
}

/// All rays in the first sample, those that are drawn in the others.
fn step(case: &cases::Case, sample_index: u32) -> Step {
    let inputs = case.inputs();
    let ray_begin = if sample_index == 0 { 0 } else { inputs.view.light_count };
    let ray_count = inputs.features.rays(inputs.view) - ray_begin;
    let node = inputs.view.leaves;
    let pixel_count = points(case).len() as u32 - node;
    Step { sample_index, ray_begin, ray_count, pixel_count, node, range_end: SAMPLES, ..Step::default() }
}

/// Light that enters at points.
///
/// # Errors
/// As [`super::Test::run`].
pub fn irradiance(context: &mut Context) -> Result<Verdict> {
    let mut verdict = Verdict::new(Bound::Relative(SHADING));
    verdict.exempt = CHOICES;
    for case in cases::clouds()?.into_iter().chain(cases::kept()?) {
        let inputs = reference::Inputs { kept: &[], ..case.inputs() };
        let expected = lit(&case);
        let mut found = points(&case).to_vec();
        for sample in 0..SAMPLES {
            let buffers: [(Slot, &[u8]); 1] = [(Slot::Clusters, bytemuck::cast_slice(&found))];
            let step = step(&case, sample);
            let loaded = context.bench.run("irradiance", &inputs, &case.scene.nodes, &step, &buffers)?;
            found = context.bench.read(&loaded, Slot::Clusters)?;
        }
        let mut bright = 0;
        for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let at = |what: &str| format!("{}, {what} of cluster {i}", case.name);
            let kept = Cluster { flux: Vec3::ZERO, oblique: Vec3::ZERO, ..*found };
            verdict.require(kept == points(&case)[i], || at("place"));
            let size = expected.flux.as_dvec3().length();
            bright += usize::from(size > 0.0);
            verdict.vector(found.flux, expected.flux.as_dvec3(), size, || at("flux"));
            verdict.vector(found.oblique, expected.oblique.as_dvec3(), size, || at("oblique flux"));
        }
        verdict.require(bright > 300, || format!("{}: only {bright} points are lit", case.name));
    }
    Ok(verdict)
}

/// Nodes above lit points.
///
/// # Errors
/// As [`super::Test::run`].
pub fn cluster(context: &mut Context) -> Result<Verdict> {
    // A mean of directions may lose digits where they are opposite; so may the difference of positions.
    let mut verdict = Verdict::new(Bound::Relative(roundings(24, 4, 0)));
    for case in cases::clouds()? {
        let mut expected = lit(&case);
        // Some in the dark, and points of another set.
        let leaves = expected.len() / 2;
        expected[leaves..leaves + 64].iter_mut().for_each(|point| point.flux = Vec3::ZERO);
        expected[leaves + 100..leaves + 128].iter_mut().filter(|p| p.area > 0.0).for_each(|point| point.set = 7);
        let mut found = expected.clone();
        grow(&mut expected);
        let mut node = leaves as u32 / 2;
        while node > 0 {
            let step = Step { node, pixel_count: node, ..Step::default() };
            let buffers: [(Slot, &[u8]); 1] = [(Slot::Clusters, bytemuck::cast_slice(&found))];
            let loaded = context.bench.run("cluster", &case.inputs(), &[], &step, &buffers)?;
            found = context.bench.read(&loaded, Slot::Clusters)?;
            node /= 2;
        }
        for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let at = |what: &str| format!("{}, {what} of node {i}", case.name);
            verdict.words(found.set, expected.set, || at("set"));
            verdict.vector(found.position, expected.position.as_dvec3(), 1.0, || at("position"));
            verdict.vector(found.normal, expected.normal.as_dvec3(), 1.0, || at("normal"));
            verdict.compare(found.radius, expected.radius.into(), 1.0, || at("radius"));
            verdict.compare(found.spread, expected.spread.into(), 1.0, || at("spread"));
            verdict.vector(found.flux, expected.flux.as_dvec3(), expected.flux.length().into(), || at("flux"));
            let size = expected.flux.length().into();
            verdict.vector(found.oblique, expected.oblique.as_dvec3(), size, || at("oblique flux"));
            verdict.relative(found.area, expected.area.into(), || at("area"));
        }
    }
    Ok(verdict)
}

/// What pixels gather, by two dispatches.
///
/// # Errors
/// As [`super::Test::run`].
pub fn gather(context: &mut Context) -> Result<Verdict> {
    let mut verdict = Verdict::new(Bound::Relative(SHADING));
    // A node may count as one to the one and not to the other.
    verdict.exempt = 10.0 * CHOICES;
    for case in cases::clouds()? {
        let inputs = case.inputs();
        let mut clusters = lit(&case);
        grow(&mut clusters);
        let mut step = reference::step(&inputs, 0, case.prepared.rows.clone(), 0..8);
        let pixels = step.pixel_count as usize;
        let surfaces: Vec<Surface> =
            (0..step.pixel_count).into_par_iter().map(|i| twin_primary(&inputs, &step, i)).collect();
        let mut all = surfaces.clone();
        all.resize(pixels * BATCHES as usize, Surface { triangle: MISS, ..Surface::default() });
        let mut gathers = vec![Gather::default(); pixels];
        let (sums, batch) = (vec![Sums::default(); pixels], vec![Vec3::ZERO; all.len()]);
        let mut loaded = None;
        for (node, first, last) in [(2, 1, 0), (3, 0, 1)] {
            (step.node, step.first, step.last, step.count) = (node, first, last, first);
            let buffers: [(Slot, &[u8]); 5] = [
                (Slot::Clusters, bytemuck::cast_slice(&clusters)),
                (Slot::Surfaces, bytemuck::cast_slice(&all)),
                (Slot::Gathers, bytemuck::cast_slice(&gathers)),
                (Slot::RunningSums, bytemuck::cast_slice(&sums)),
                (Slot::BatchSums, bytemuck::cast_slice(&batch)),
            ];
            let made = context.bench.run("gather", &inputs, &[], &step, &buffers)?;
            gathers = context.bench.read(&made, Slot::Gathers)?;
            loaded = Some(made);
        }
        let found: Vec<Sums> = context.bench.read(&loaded.expect("two dispatches"), Slot::RunningSums)?;
        let twins: Vec<_> = surfaces.par_iter().map(|surface| twin::gather(&inputs, &clusters, surface)).collect();
        let mut bright = 0;
        for (i, (found, twin)) in found.iter().zip(&twins).enumerate() {
            let at = || format!("{}, pixel {i}", case.name);
            verdict.require(found.invalid == u32::from(twin.invalid), || format!("{}: invalid", at()));
            bright += usize::from(twin.radiance != DVec3::ZERO);
            verdict.vector(found.subsurface, twin.radiance, twin.radiance.length(), at);
        }
        verdict.require(bright > 100, || format!("{}: only {bright} pixels are lit", case.name));
    }
    Ok(verdict)
}
