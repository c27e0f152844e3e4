//! What of a render a [`Timeline`](crate::timeline::Timeline) is told.

use super::{Renderer, assemble};
use crate::{
    error::Result,
    gpu::{Executable, Recorder, Scope},
    timeline::{Span, Track, Work},
};
use serde_json::{Value, json};
use std::iter::once;

impl Renderer {
    /// What the driver tells of each kernel, by stem; see [`Kernel::executables`](crate::gpu::Kernel::executables).
    ///
    /// # Errors
    /// [`Error::Vulkan`](crate::Error::Vulkan).
    pub fn executables(&self) -> Result<Vec<(&'static str, Vec<Executable>)>> {
        self.kernels.made().map(|kernel| Ok((kernel.stem(), kernel.executables()?))).collect()
    }

    /// What two renders of `samples` samples must agree in to be the same work.
    pub(crate) fn work(&self, samples: u32) -> Value {
        let view = self.prepared.view;
        let rows = self.prepared.rows.clone();
        let mut settings = assemble::described(self);
        settings["seed"] = self.settings.seed.into();
        settings["crop"] = json!(self.settings.crop);
        settings["variance"] = self.settings.variance.into();
        json!({
            "sceneHash": self.scene_hash, "settings": settings, "samples": samples,
            "pixels": u64::from(view.crop_width) * rows.len() as u64,
        })
    }

    /// Notes when the last submission ran, and each of its dispatches. What it dispatched for one sample is of that
    /// sample alone.
    pub(super) fn note(&self, name: &'static str, work: Work) {
        let timing = self.recorder.as_ref().and_then(Recorder::timing);
        let (Some(timeline), Some(timing)) = (&self.settings.timeline, timing) else { return };
        let start = timeline.at(timing.submitted);
        let host = Span { track: Track::Host, name, begin: start, end: start + timing.ended, work: Some(work.clone()) };
        // Recordings count their samples on the device.
        let counted = self.settings.recording;
        let device = timing.scopes.iter().map(|scope: &Scope| {
            let sample = scope.step.sample_index;
            let one = !counted && work.samples.contains(&sample);
            let samples = if one { sample..sample + 1 } else { work.samples.clone() };
            Span {
                track: Track::Device,
                name: scope.kernel,
                begin: start + scope.begin,
                end: start + scope.end,
                work: Some(Work { samples, ..work.clone() }),
            }
        });
        timeline.note(once(host).chain(device), timing.deviation);
        let counters = self.device.counters();
        for (scope, values) in timing.scopes.iter().zip(timing.counters.chunks_exact(counters.len().max(1))) {
            let named = counters.iter().zip(values).map(|(counter, value)| (&*counter.name, counter.unit, *value));
            timeline.count(scope.kernel, named);
        }
    }
}
