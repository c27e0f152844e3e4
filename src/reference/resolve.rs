//! Sums into a pixel: twin of `resolve.comp`.
//!
//! The variance of the mean comes from the B independently scrambled batches. Batch b has the sum S_b of n_b samples, in
//! all n; if its mean has the variance v / n_b, an unbiased estimate of v / n is
//!
//!   sum of n_b (S_b / n_b - m)^2 / (B - 1) / n,   m = sum of S_b / n.
//!
//! The spread inside one scrambled sequence would overstate it many times, because its points avoid each other. Means and
//! variances beyond f32 become its largest number.

use crate::shared::{BATCHES, Features, Pixel, Step, Sums};
use glam::{DVec3, Vec3};

/// Samples of `batch` among the sample indices `begin..end`.
pub fn batch_count(begin: u32, end: u32, batch: u32) -> u32 {
    let before = |index: u32| (index / BATCHES) + u32::from(index % BATCHES > batch);
    before(end) - before(begin)
}

/// The pixel of its sums; `batch_sums` is empty or holds one sum per batch.
pub fn resolve(features: &Features, step: &Step, sums: &Sums, batch_sums: &[Vec3]) -> Pixel {
    let count = f64::from(sums.samples.max(1));
    let mean = |sum: Vec3, carry: Vec3| finite((sum.as_dvec3() + carry.as_dvec3()) / count);
    Pixel {
        subsurface: mean(sums.subsurface, sums.subsurface_carry),
        reflection: mean(sums.reflection, sums.reflection_carry),
        variance: if features.batches != 0 { finite(variance(step, sums.samples, batch_sums)) } else { Vec3::ZERO },
        alpha: (f64::from(sums.covered) / count) as f32,
        samples: sums.samples,
        invalid: sums.invalid,
    }
}

/// In f32, whose largest number stands for all beyond it.
fn finite(x: DVec3) -> Vec3 {
    x.min(DVec3::splat(f32::MAX.into())).as_vec3()
}

fn variance(step: &Step, samples: u32, batch_sums: &[Vec3]) -> DVec3 {
    let total = f64::from(samples);
    if total < f64::from(BATCHES) {
        return DVec3::ZERO;
    }
    let mean = batch_sums.iter().map(|s| s.as_dvec3()).sum::<DVec3>() / total;
    let spread = |(batch, sum): (u32, &Vec3)| {
        let count = f64::from(batch_count(step.range_begin, step.range_begin + samples, batch));
        count * (sum.as_dvec3() / count - mean).powf(2.0)
    };
    (0..).zip(batch_sums).map(spread).sum::<DVec3>() / f64::from(BATCHES - 1) / total
}
