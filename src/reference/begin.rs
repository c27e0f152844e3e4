//! Count of the samples of a recording: twin of `begin.comp`. Integers only.
//!
//! A recording of the range a..b computes the samples f + a to f + b, where f is a word that may change between its
//! executions. If the sums hold the samples before those, it adds to them, otherwise it starts new sums; so they are
//! always the sums of one range, in which every sample is counted once.

use super::random;
use crate::shared::{NO_SAMPLES, Progress, Sample, Step};

/// The samples of the recording, and what its start leaves in `progress`. Numbers wrap at 2^32.
pub fn begin(progress: Progress, step: &Step) -> (Progress, Vec<Sample>) {
    let start = progress.first.wrapping_add(step.sample_index);
    let samples = (0..step.pixel_count).map(|position| {
        let index = start.wrapping_add(position);
        Sample { index, point: random::point(index) }
    });
    let follows = progress.end == start && progress.end != NO_SAMPLES;
    let after = Progress {
        begin: if follows { progress.begin } else { start },
        end: start.wrapping_add(step.pixel_count),
        restart: u32::from(!follows),
        ..progress
    };
    (after, samples.collect())
}
