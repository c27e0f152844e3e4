//! Recordings into a caller's command buffer: the same kernels in the same order, with the count of samples on the
//! device.

use super::{Band, Kernels, Renderer, count};
use crate::{
    error::{Error, Result},
    gpu::{Commands, Extent, Kernel, Timestamps},
    prepare::Prepared,
    shared::{MAX_RECORDED, NO_SAMPLES, Pixel, Progress, Slot, Step},
};
use ash::vk;
use glam::Vec4;
use std::ops::Range;

/// What recordings leave behind, valid as long as the renderer. Rows run from the top, `width` pixels each, without
/// padding; layouts are those of [`crate::shared`].
#[derive(Clone, Copy, Debug)]
pub struct Output {
    pub width: u32,
    pub height: u32,
    /// Four f32 for each pixel: linear Rec.709 light, and alpha; not premultiplied.
    pub colors: vk::Buffer,
    /// A [`Pixel`] each: layers, variance, samples.
    pub pixels: vk::Buffer,
    /// One [`Progress`]: which samples the sums hold, and from which sample recordings count theirs. A caller's
    /// transfer may write the word `first` between recordings.
    pub progress: vk::Buffer,
}

impl Renderer {
    /// Records `samples` samples and the image they make into `commands`; never submits, waits or changes this value,
    /// so one renderer may record any number of command buffers, and each may be recorded once and submitted again and
    /// again. Needs [`Settings::recording`](crate::Settings::recording).
    ///
    /// *What an execution does.* With f = [`Progress::first`] (0 unless [`Renderer::set_first_sample`] or a transfer
    /// changed it), it computes the samples f + start to f + end. Where the sums hold the samples just before those,
    /// they are added to them; otherwise the sums start anew. So nothing is ever counted twice: 0..64 executed twice is
    /// the same image twice, bit for bit, and 0..8, 8..16 one after the other is the image of 0..16. Camera, lights and
    /// materials are read from buffers when it executes ([`Renderer::set_camera`] and so on). The dispatches do not
    /// depend on any of it.
    ///
    /// *Synchronisation.* On entry, what compute shaders and transfers earlier on the same queue wrote is waited for
    /// and visible. On exit, all that was written is visible to compute shaders, transfers and the host; anything else,
    /// such as sampling the image while drawing, needs a barrier of the caller's from the stage COMPUTE_SHADER and the
    /// access SHADER_STORAGE_WRITE ([`Renderer::record_copy`]: ALL_TRANSFER and TRANSFER_WRITE). Executions of one
    /// renderer must not overlap: on one queue they do not; between queues semaphores see to it.
    ///
    /// *State.* Compute pipeline, descriptor set 0 and push constants are other ones afterwards.
    ///
    /// # Errors
    /// [`Error::Setting`] for a range that is empty or of more than [`MAX_RECORDED`] samples, or a renderer that was
    /// made without `recording`.
    ///
    /// # Safety
    /// `commands` is of this device and queue family, in the recording state, outside of a render pass, and used by no
    /// other thread meanwhile. The renderer lives until every execution has ended; it is not used by `&mut` while one
    /// is going on.
    #[expect(unsafe_code, reason = "the command buffer is the caller's, and so is its contract")]
    pub unsafe fn record(&self, commands: vk::CommandBuffer, samples: Range<u32>) -> Result<()> {
        // SAFETY: as the caller promises.
        unsafe { self.record_with(commands, samples, None) }
    }

    /// As [`Renderer::record`], with the time before and after each dispatch written as
    /// [`Renderer::timestamp_layout`] says. The recording resets the queries that it writes.
    ///
    /// # Errors
    /// As [`Renderer::record`]; [`Error::Device`] where the queue family has no timestamps.
    ///
    /// # Safety
    /// As [`Renderer::record`]; the pool is of timestamps, has the queries, and lives as long.
    #[expect(unsafe_code, reason = "the command buffer is the caller's, and so is its contract")]
    pub unsafe fn record_timed(
        &self,
        commands: vk::CommandBuffer,
        samples: Range<u32>,
        times: Timestamps,
    ) -> Result<()> {
        if !self.device.has_timestamps() {
            return Err(Error::Device("the queue family has no timestamps".into()));
        }
        // SAFETY: as the caller promises.
        unsafe { self.record_with(commands, samples, Some(times)) }
    }

    #[expect(unsafe_code, reason = "the command buffer is the caller's, and so is its contract")]
    unsafe fn record_with(
        &self,
        commands: vk::CommandBuffer,
        samples: Range<u32>,
        times: Option<Timestamps>,
    ) -> Result<()> {
        let names = self.timestamp_layout(samples.clone())?;
        // SAFETY: as the caller promises.
        let commands = unsafe { Commands::of(&self.device, commands) };
        commands.begin_label(c"translucent");
        if let Some(times) = times {
            commands.reset_queries(times, 2 * names.len() as u32);
        }
        // Buffers persist, so what earlier recordings wrote must be seen here.
        commands.barrier();
        let mut next = times;
        self.dispatches(samples, &mut |kernel, invocations, step| {
            commands.dispatch(kernel, &self.bindings, Extent::Invocations(invocations), step, next);
            next = next.map(|times| Timestamps { first: times.first + 2, ..times });
        });
        commands.host_barrier();
        commands.end_label();
        Ok(())
    }

    /// The kernel of each dispatch that such a recording makes, in order: number i writes the queries `first + 2 i` and
    /// `first + 2 i + 1` of [`Timestamps`].
    ///
    /// # Errors
    /// As [`Renderer::record`].
    pub fn timestamp_layout(&self, samples: Range<u32>) -> Result<Vec<&'static str>> {
        self.need_recording()?;
        if samples.is_empty() || samples.len() > MAX_RECORDED as usize {
            let problem = format!("{}:{} are not 1 to {MAX_RECORDED} in one recording", samples.start, samples.end);
            return Err(Error::setting("samples", problem));
        }
        let mut names = vec![];
        self.dispatches(samples, &mut |kernel, _, _| names.push(kernel.stem()));
        Ok(names)
    }

    /// Records a copy of [`Output::colors`] to the upper left of an image: first level and layer, a format of four f32,
    /// in the layout TRANSFER_DST_OPTIMAL or GENERAL.
    ///
    /// # Errors
    /// [`Error::Setting`] for a renderer that was made without `recording`.
    ///
    /// # Safety
    /// As [`Renderer::record`]; the image has the format, the usage TRANSFER_DST and at least the size of [`Output`],
    /// and is in that layout when this executes.
    #[expect(unsafe_code, reason = "command buffer and image are the caller's, and so is their contract")]
    pub unsafe fn record_copy(
        &self,
        commands: vk::CommandBuffer,
        image: vk::Image,
        layout: vk::ImageLayout,
    ) -> Result<()> {
        let Output { width, height, .. } = self.output()?;
        // SAFETY: as the caller promises.
        let commands = unsafe { Commands::of(&self.device, commands) };
        let colors = self.buffer(Slot::Colors).expect("a renderer that records has colours");
        commands.begin_label(c"translucent: copy");
        commands.barrier();
        commands.copy_to_image(colors, size_of::<Vec4>() as u64, image, layout, [width, height]);
        commands.end_label();
        Ok(())
    }

    /// The buffers with the result.
    ///
    /// # Errors
    /// [`Error::Setting`] for a renderer that was made without `recording`.
    pub fn output(&self) -> Result<Output> {
        self.need_recording()?;
        let raw = |slot| self.buffer(slot).expect("a renderer that records has it").raw();
        Ok(Output {
            width: self.prepared.view.crop_width,
            height: self.prepared.rows.end - self.prepared.rows.start,
            colors: raw(Slot::Colors),
            pixels: raw(Slot::Pixels),
            progress: raw(Slot::Progresses),
        })
    }

    fn need_recording(&self) -> Result<()> {
        match self.settings.recording {
            true => Ok(()),
            false => Err(Error::setting("recording", "must be set in the renderer's settings")),
        }
    }

    fn dispatches(&self, samples: Range<u32>, dispatch: &mut dyn FnMut(&Kernel, u32, &Step)) {
        self.kernels.recording(&self.prepared, &self.bands[0], samples, dispatch);
    }

    /// Which samples the sums hold, where recordings keep count of them.
    pub(super) fn count(&self) -> Option<Progress> {
        count(&self.buffers)
    }

    pub(super) fn set_count(&mut self, count: Progress) {
        if let Some(counts) = self.buffer(Slot::Progresses) {
            counts.write(&[count]);
        }
    }

    /// Takes note of what recordings did.
    pub(super) fn catch_up(&mut self) {
        if let Some(Progress { begin, end, .. }) = self.count() {
            let any = end != NO_SAMPLES;
            self.begin = any.then_some(begin);
            self.bands[0].end = if any { end } else { 0 };
        }
    }
}

impl Kernels {
    /// The dispatches of a recording, in order: kernel, invocations, constants.
    pub(super) fn recording(
        &self,
        prepared: &Prepared,
        band: &Band,
        samples: Range<u32>,
        dispatch: &mut dyn FnMut(&Kernel, u32, &Step),
    ) {
        let count = samples.end.wrapping_sub(samples.start);
        let base = Step { first_row: band.first_row, pixel_count: band.pixels, ..Step::default() };
        let begin = Step { sample_index: samples.start, pixel_count: count, ..base };
        for (kernel, step) in [(&self.begin, begin), (&self.count, Step { count, ..base })] {
            kernel.iter().for_each(|kernel| dispatch(kernel, step.pixel_count, &step));
        }
        for position in 0..count {
            let mut all = |kernel: &Kernel, _, step: &Step| dispatch(kernel, band.pixels, step);
            self.sample(prepared, Step { sample_index: position, ..base }, true, &mut all);
        }
        self.resolve.iter().for_each(|kernel| dispatch(kernel, band.pixels, &base));
    }
}

// Four f32, as the layout of `Output::colors` says.
const _: () = assert!(size_of::<Vec4>() == 16 && size_of::<Pixel>() == 48);
