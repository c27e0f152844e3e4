//! Sums of a pixel at the start of a recording: twin of `clear.comp`.

use crate::shared::{Progress, Sums};
use glam::Vec3;

/// Leaves the sums, and those of the batches, or forgets them where the recording starts new ones.
pub fn clear(progress: &Progress, sums: &mut Sums, batch_sums: &mut [Vec3]) {
    if progress.restart != 0 {
        *sums = Sums::default();
        batch_sums.fill(Vec3::ZERO);
    }
}
