//! Where each band's sums are: on the device or on the host; and how a render goes on when the device fails.

use super::{
    Progress, Renderer,
    bands::{self, Band, Film},
    find, own,
};
use crate::{
    error::{Error, Result},
    gpu::{Device, download_to, upload},
    scene::{self, Scene},
    shared::{BATCHES, Slot},
    timeline,
};
use std::{
    ops::{ControlFlow, Range},
    time::{Duration, Instant},
};

/// What a band takes along when it leaves the device.
pub(super) const SUMS: [Slot; 2] = [Slot::RunningSums, Slot::BatchSums];

impl Renderer {
    /// Brings a band's sums onto the device, and those of the band that was there back to the host. If it fails, no
    /// sums are lost.
    pub(super) fn make_resident(&mut self, band: usize) -> Result<()> {
        if self.resident == Some(band) {
            return Ok(());
        }
        let _span = timeline::begin(&self.settings.timeline, "band");
        self.keep()?;
        if let Some(leaves) = self.resident.take() {
            self.bands[leaves].film = Film::OnHost;
        }
        let on_host = self.bands[band].film == Film::OnHost;
        let recorder = own(&mut self.recorder)?;
        recorder.begin()?;
        for (index, slot) in SUMS.into_iter().enumerate() {
            let Some((_, buffer)) = self.buffers.iter().find(|(s, _)| *s == slot) else { continue };
            if on_host {
                upload(&self.device, buffer, &bands::unpack(&self.bands[band].sums[index]))?;
            } else {
                recorder.fill(buffer, 0);
            }
        }
        recorder.submit_and_wait()?;
        self.bands[band].film = Film::OnDevice;
        self.resident = Some(band);
        self.strata = [None; BATCHES as usize];
        Ok(())
    }

    /// Copies the sums of the band on the device to the host.
    pub(super) fn keep(&mut self) -> Result<()> {
        let Some(band) = self.resident else { return Ok(()) };
        let Band { pixels, end, sums, kept, changed, .. } = &mut self.bands[band];
        if !*changed && kept.is_some() {
            return Ok(());
        }
        // A copy that may fail must not take the place of what is there: half new and half old it would be of no use.
        let mut copies: [Vec<u8>; 2] = Default::default();
        for (copy, slot) in copies.iter_mut().zip(SUMS) {
            let Some(buffer) = find(&self.buffers, slot) else { continue };
            self.spare.resize(bands::bytes(slot, &self.prepared.features, *pixels) as usize, 0);
            download_to(&self.device, buffer, &mut self.spare)?;
            *copy = bands::pack(&self.spare);
        }
        *sums = copies;
        (*kept, *changed) = (Some(*end), false);
        self.kept_at = Instant::now();
        Ok(())
    }

    /// Keeps the sums where it is time.
    pub(super) fn keep_in_time(&mut self) -> Result<()> {
        if self.keep_every.is_some_and(|every| self.kept_at.elapsed() >= every) { self.keep() } else { Ok(()) }
    }

    /// A submission of samples to `band` failed: nobody knows which of them its sums have.
    pub(super) fn distrust(&mut self, band: usize) {
        if self.settings.recording {
            return self.reset();
        }
        self.resident = None;
        self.bands[band].roll_back(self.begin.unwrap_or(0));
    }

    /// As [`Renderer::render_range`], without the samples of `range` that are there already.
    pub fn render_rest(
        &mut self,
        range: Range<u32>,
        progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<bool> {
        self.catch_up();
        let there = self.samples();
        if self.begin.is_none() || there.start != range.start {
            return self.render_range(range, progress);
        }
        if there.end >= range.end { Ok(true) } else { self.render_range(there.end..range.end, progress) }
    }

    /// Copies the sums of the band on the device to the host at intervals of `every` while it renders, so that
    /// [`Renderer::resume`] has them. Those of the other bands are there anyway.
    pub fn keep_every(&mut self, every: Duration) {
        (self.keep_every, self.kept_at) = (Some(every), Instant::now());
    }

    /// Goes on with `device` after the one it had was lost: makes anew what was on it, and keeps the samples whose sums
    /// are on the host. Those are the sums of all bands but the one that was on the device; that band goes back to when
    /// it came there, or to the last copy ([`Renderer::keep_every`]). So [`Renderer::samples`] may be fewer afterwards;
    /// [`Renderer::render_rest`] makes up for them, and the image is the same.
    ///
    /// Buffers of the caller's ([`Renderer::with_buffers`]) are of the lost device: own ones take their place. What
    /// recordings left is lost.
    ///
    /// # Errors
    /// As [`Renderer::new`]; [`Error::Setting`] for a scene that is not the one it was made of.
    pub fn resume(self, device: &Device, scene: &Scene) -> Result<Renderer> {
        if scene::hash(scene, scene::geometry(scene)) != self.scene_hash {
            return Err(Error::setting("scene", "is not the one that was rendered"));
        }
        let Renderer { kernels, bindings, recorder, buffers, device: lost, .. } = self;
        // First, so that both are never there at once.
        drop((kernels, bindings, recorder, buffers, lost));
        let Renderer { settings, prepared, mut bands, begin, adaptive, authored, keep_every, .. } = self;
        for band in bands.iter_mut().filter(|band| band.film == Film::OnDevice) {
            band.roll_back(begin.unwrap_or(0));
        }
        let resumed = Renderer::with_bands(device, scene, &settings, prepared, vec![], bands, &[])?;
        Ok(Renderer { begin, adaptive, authored, keep_every, ..resumed })
    }

    /// Calls `work`; if the device is lost meanwhile, once more with the renderer resumed on the device that `reopen`
    /// gives. `work` therefore must go on from the samples that there are ([`Renderer::render_rest`]).
    ///
    /// # Errors
    /// Those of `work` and `reopen`, and of [`Renderer::resume`]. A device that is lost again is the last.
    pub fn with_recovery<T>(
        mut self,
        scene: &Scene,
        reopen: impl FnOnce(&Error) -> Result<Device>,
        mut work: impl FnMut(&mut Renderer) -> Result<T>,
    ) -> Result<(Renderer, T)> {
        let done = match work(&mut self) {
            Err(error) if error.is_device_lost() => {
                self = self.resume(&reopen(&error)?, scene)?;
                work(&mut self)?
            }
            other => other?,
        };
        Ok((self, done))
    }
}
