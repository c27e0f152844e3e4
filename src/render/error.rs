//! The error of an image, estimated from its batches.
//!
//! Of an image x with the converged image r, over P pixels and three channels,
//!
//!   E^2 = relMSE = 1 / (3 P) sum (x - r)^2 / (r^2 + k),   k = .01 m^2,   m = mean of r.
//!
//! x in place of r would make noise look small: where x happens to be large, so does its variance. Therefore each batch b
//! with the mean x_b of n_b samples stands against the mean y of the others, which does not know it. With the variance v
//! of a sample, (x_b - y)^2 is on average v (1 / n_b + 1 / (n - n_b)), and (x - r)^2 is v / n. The mean of 1 / (y^2 + k)
//! is that of 1 / (r^2 + k) times 1 + a V / (r^2 + k) to first order, with the variance V of y and
//! a = (3 r^2 - k) / (r^2 + k); so what stands in the denominator is
//!
//!   y^2 + k + max(a, 0) V,   a at y, V from the spread of the other batches.
//!
//! To first order in V that is unbiased; beyond it, where noise is as large as light, it errs on the safe side.

use crate::{
    reference::resolve::batch_count,
    shared::{BATCHES, Sums},
};
use glam::{DVec3, Vec3};

const B: usize = BATCHES as usize;

/// All light of a pixel.
pub fn light(sums: &Sums) -> DVec3 {
    let total = [sums.subsurface, sums.subsurface_carry, sums.reflection, sums.reflection_carry];
    total.into_iter().map(|sum| sum.as_dvec3()).sum::<DVec3>() / f64::from(sums.samples.max(1))
}

/// 3 P times a pixel's part of E^2: `batches` are the sums of its batches, of all light; `k` as above. 0 with fewer samples
/// than batches.
pub fn part(samples: u32, batches: &[DVec3; B], k: f64) -> f64 {
    if samples < BATCHES {
        return 0.0;
    }
    let n = f64::from(samples);
    let counts: [f64; B] = std::array::from_fn(|b| f64::from(batch_count(0, samples, b as u32)));
    let means: [DVec3; B] = std::array::from_fn(|b| batches[b] / counts[b]);
    let total: DVec3 = batches.iter().sum();
    let of_batch = |b: usize| {
        let others = n - counts[b];
        let y = (total - batches[b]) / others;
        let spread = |j: usize| if j == b { DVec3::ZERO } else { counts[j] * (means[j] - y).powf(2.0) };
        let v = (0..B).map(spread).sum::<DVec3>() / (B - 2) as f64 / others;
        let base = y * y + k;
        let a = ((3.0 * y * y - k) / base).max(DVec3::ZERO);
        let ratio = (means[b] - y).powf(2.0) / (n * (1.0 / counts[b] + 1.0 / others)) / (base + a * v);
        ratio.element_sum()
    };
    (0..B).map(of_batch).sum::<f64>() / B as f64
}

/// The sums of each batch of a band's pixel: of subsurface light, and of reflected light where the kernels keep it apart.
pub fn batches(sums: &[Vec3], pixels: usize, index: usize) -> [DVec3; B] {
    std::array::from_fn(|b| sums.iter().skip(b * pixels + index).step_by(B * pixels).map(|sum| sum.as_dvec3()).sum())
}
