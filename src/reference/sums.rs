//! The running sums of a pixel: twin of `sums.glsl`.
//!
//! Sums are compensated: D. E. Knuth's TwoSum finds the rounding error of each addition exactly and a second number
//! carries it (A. Neumaier, ZAMM 54 (1974)). A contribution with which a sum would exceed f32 is left out and counted.

use crate::shared::{MISS, Step, Sums, Surface};
use glam::{DVec3, Vec3};

/// What one dispatch adds to a pixel's sums.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contribution {
    /// Zero if invalid.
    pub radiance: DVec3,
    /// Whether it was not finite and non-negative.
    pub invalid: bool,
}

impl Contribution {
    pub(super) fn of(radiance: DVec3) -> Contribution {
        // As the kernel's sum sees it: what overflows f32 is not finite.
        let valid = radiance.as_vec3().is_finite() && radiance.cmpge(DVec3::ZERO).all();
        Contribution { radiance: if valid { radiance } else { DVec3::ZERO }, invalid: !valid }
    }

    /// Adds to the sums of a pixel as `accumulate.comp` does. `batch_sum` is the one of the sample's batch; where the
    /// kernel keeps none, a caller's to forget.
    pub fn add_subsurface(&self, step: &Step, surface: &Surface, sums: &mut Sums, batch_sum: &mut Vec3) {
        self.add_single(sums, batch_sum);
        if step.count != 0 {
            sums.covered += u32::from(surface.triangle != MISS);
        }
    }

    /// Adds to the sums of a pixel as `single.comp` does.
    pub fn add_single(&self, sums: &mut Sums, batch_sum: &mut Vec3) {
        let radiance = self.radiance.as_vec3();
        let fits = !self.invalid && (sums.subsurface + radiance).is_finite() && (*batch_sum + radiance).is_finite();
        if fits {
            add(&mut sums.subsurface, &mut sums.subsurface_carry, radiance);
            *batch_sum += radiance;
        }
        sums.invalid += u32::from(!fits);
    }

    /// Adds to the sums of a pixel as `reflect.comp` does. `batch_sum` is that of reflected light of the sample's batch;
    /// where the kernel keeps none, a caller's to forget.
    pub fn add_reflection(&self, sums: &mut Sums, batch_sum: &mut Vec3) {
        let radiance = self.radiance.as_vec3();
        let fits = !self.invalid && (sums.reflection + radiance).is_finite() && (*batch_sum + radiance).is_finite();
        if fits {
            add(&mut sums.reflection, &mut sums.reflection_carry, radiance);
            *batch_sum += radiance;
        }
        sums.invalid += u32::from(!fits);
    }
}

/// Compensated addition in f32: `sum + carry` grows by `x` up to a rounding of the carry.
pub fn add(sum: &mut Vec3, carry: &mut Vec3, x: Vec3) {
    let next = *sum + x;
    let added = next - *sum;
    *carry += (*sum - (next - added)) + (x - added);
    *sum = next;
}
