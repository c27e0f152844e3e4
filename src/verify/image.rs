//! Whole small images by a renderer, with its own submissions and barriers, beside the twins' image of the same samples.

use super::{Bound, Context, Verdict, cases, roundings};
use crate::{error::Result, reference, render::Renderer, settings::Projection};
use glam::Vec3;

/// Samples of a pixel: one of each batch.
const SAMPLES: u32 = 8;

fn image(context: &mut Context, projection: Projection) -> Result<Verdict> {
    let (scene, settings) = cases::portrait(projection)?;
    let case = cases::Case::new(format!("{projection:?}"), scene, &settings)?;
    let twins = reference::render(&case.inputs(), case.prepared.rows.clone(), 0..SAMPLES);
    let mut renderer = Renderer::new(&context.bench.device, &case.scene, &settings)?;
    renderer.render(SAMPLES)?;
    let image = renderer.image()?;

    // As of kernels; the mean of some samples has the errors of one at most.
    let mut verdict = Verdict::new(Bound::Relative(roundings(100, 6, 4)));
    // In one of a thousand samples rounding decides a choice, and a pixel has some.
    verdict.exempt = 8e-3;
    let channel = |name: &str, i: usize| image.channel(name).and_then(|data| data.get(i)).copied().unwrap_or(f32::NAN);
    for (i, twin) in twins.iter().enumerate() {
        verdict.require(channel("samples.Y", i) == twin.samples as f32, || format!("pixel {i}: samples"));
        verdict.compare(channel("A", i), twin.alpha.into(), 1.0, || format!("alpha of pixel {i}"));
        for (layer, expected) in [("subsurface", twin.subsurface), ("reflection", twin.reflection)] {
            let found = Vec3::from(["R", "G", "B"].map(|letter| channel(&format!("{layer}.{letter}"), i)));
            if found != Vec3::ZERO || expected != Vec3::ZERO {
                let scale = f64::from(found.length().max(expected.length()));
                verdict.vector(found, expected.as_dvec3(), scale, || format!("{layer} of pixel {i}"));
            }
        }
    }
    let worst = verdict.worst.as_ref().map_or(0.0, |worst| worst.relative);
    // A choice moves a pixel by a sample's share, not more.
    verdict.require(worst < 0.5, || format!("an error of {worst}"));
    Ok(verdict)
}

/// With all techniques.
pub fn mis(context: &mut Context) -> Result<Verdict> {
    image(context, Projection::Mis)
}

/// With the camera's projection.
pub fn camera(context: &mut Context) -> Result<Verdict> {
    image(context, Projection::Camera)
}

/// With the normal's.
pub fn normal(context: &mut Context) -> Result<Verdict> {
    image(context, Projection::Normal)
}
