//! Samples of a pixel, and its sums at the start of a recording: twin of `count.comp`.

use crate::shared::{Progress, Step, Sums};
use glam::Vec3;

/// Adds the step's samples to a pixel's; forgets the sums before, and those of the batches, where a recording starts new
/// ones.
pub fn count(step: &Step, progress: &Progress, sums: &mut Sums, batch_sums: &mut [Vec3]) {
    if progress.restart != 0 {
        *sums = Sums::default();
        batch_sums.fill(Vec3::ZERO);
    }
    sums.samples += step.count;
}
