//! The cloud's light: shadow rays at each of its points, then the tree above them.

use super::{Renderer, SUBMISSION, own, random};
use crate::{
    error::Result,
    gpu::upload,
    shared::{MAX_RAYS, Slot, Step},
    timeline::{self, Work},
};

impl Renderer {
    /// Lights the cloud, unless it is lit by the lights that there are.
    pub(super) fn light_cloud(&mut self) -> Result<()> {
        if self.lit || self.kernels.gather.is_none() {
            return Ok(());
        }
        let _span = timeline::begin(&self.settings.timeline, "cloud");
        // Without light, also of a time before.
        upload(
            &self.device,
            self.buffer(Slot::Clusters).expect("a cloud"),
            bytemuck::cast_slice(&self.prepared.clusters),
        )?;
        let (leaves, lights, rays) =
            (self.prepared.view.leaves, self.prepared.view.light_count, self.prepared.ray_count);
        let whole = Step { pixel_count: leaves, range_end: self.settings.cloud.samples, ..Step::default() };
        let mut steps = vec![];
        for sample_index in 0..self.settings.cloud.samples {
            // Delta lights are the same in every sample.
            let begin = if sample_index == 0 { 0 } else { lights };
            for ray_begin in (begin..rays).step_by(MAX_RAYS as usize) {
                let ray_count = (rays - ray_begin).min(MAX_RAYS);
                steps.push(Step { sample_index, ray_begin, ray_count, point: random::point(sample_index), ..whole });
            }
        }
        let each = (SUBMISSION / u64::from(leaves)).max(1) as usize;
        let work = Work { pixels: leaves, ..Work::default() };
        for steps in steps.chunks(each) {
            let Renderer { recorder, kernels, bindings, .. } = &mut *self;
            let recorder = own(recorder)?;
            recorder.begin()?;
            for step in steps {
                kernels.irradiance.iter().for_each(|kernel| recorder.dispatch(kernel, bindings, leaves, step));
            }
            recorder.submit_and_wait()?;
            self.note("cloud", work.clone());
        }
        let Renderer { recorder, kernels, bindings, .. } = &mut *self;
        let recorder = own(recorder)?;
        recorder.begin()?;
        let mut node = leaves / 2;
        while node > 0 {
            let step = Step { node, pixel_count: node, ..whole };
            kernels.cluster.iter().for_each(|kernel| recorder.dispatch(kernel, bindings, node, &step));
            node /= 2;
        }
        recorder.submit_and_wait()?;
        self.lit = true;
        self.note("cloud", work);
        Ok(())
    }
}
