//! The renderer: buffers made once per scene and resolution, and the order of the kernels.

mod adaptive;
mod assemble;
mod bands;
mod budget;
mod error;
mod host;
mod irradiance;
mod plan;
mod record;
mod sums;
mod timing;
mod update;

pub use adaptive::{Goal, Outcome, Stop};
pub use plan::{BufferUse, KernelUse, Limits, Plan, value_name};
pub use record::Output;

use crate::{
    error::{Error, Result},
    gpu::{Bindings, Buffer, Device, Extent, Kernel, Layout, Location, Recorder, download, give_back_freed, upload},
    image::Image,
    prepare::{Prepared, prepare},
    reference::random,
    scene::{self, Frame, Scene},
    settings::Settings,
    shared::{BATCHES, GATHER_POINTS, MAX_RAYS, MAX_SINGLE, NO_SAMPLES, Progress as Count, STRATUM, Slot, Step},
    timeline::{self, Work},
};
use bands::Band;
use rayon::prelude::*;
use std::{
    ops::{ControlFlow, Range},
    time::{Duration, Instant},
};

/// Samples between two visits of a band when an image has several: each batch passes through one stratum.
const PASS: u32 = BATCHES * STRATUM;

/// Pixel samples of one submission: about a second of software Vulkan, milliseconds of a GPU.
const SUBMISSION: u64 = 1 << 20;

/// What the host writes between recordings.
const WRITTEN: [Slot; 4] = [Slot::Views, Slot::Lights, Slot::Materials, Slot::Progresses];

macro_rules! kernels {
    ($($stem:ident),*) => {
        /// The compute pipelines that a scene needs, specialised to its features; none of the others.
        struct Kernels { $($stem: Option<Kernel>,)* }

        impl Kernels {
            /// Side by side: a driver translates each on one core.
            fn new(device: &Device, prepared: &Prepared, workgroup: u32, others: &Modules) -> Result<Kernels> {
                let mut made = SPIRV.par_iter().map(|&(stem, spirv)| {
                    let other = others.iter().find(|(named, _)| *named == stem);
                    match (plan::needs(prepared, stem).0, other) {
                        (false, _) => Ok(None),
                        (true, None) => Kernel::shared(device, stem, spirv, &prepared.features, workgroup).map(Some),
                        (true, Some((_, spirv))) => {
                            Kernel::new(&Layout::new(device)?, stem, spirv, &prepared.features, workgroup).map(Some)
                        }
                    }
                }).collect::<Result<Vec<_>>>()?.into_iter();
                Ok(Kernels { $($stem: made.next().expect("one for each"),)* })
            }

            fn made(&self) -> impl Iterator<Item = &Kernel> {
                [$(&self.$stem,)*].into_iter().flatten()
            }
        }

        /// Stem and SPIR-V of every kernel.
        pub const SPIRV: &[(&str, &[u8])] =
            &[$((stringify!($stem), include_bytes!(concat!(env!("OUT_DIR"), "/", stringify!($stem), ".spv"))),)*];
    };
}
kernels!(
    begin, irradiance, cluster, primary, sample, reproject, accumulate, reuse, gather, reflect, single, count, resolve
);

/// SPIR-V that takes the place of kernels', by stem.
pub(crate) type Modules = [(&'static str, Vec<u8>)];

/// How far a render is.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Pixel samples done, over all bands.
    pub done: u64,
    /// Pixel samples asked for; where an error is, those that it is expected to take.
    pub total: u64,
    /// The estimated error of the image, sqrt(relMSE), where one is asked for; none before the first estimate.
    pub error: Option<f64>,
}

/// Renders one scene with one set of settings. Samples add up over calls until [`Renderer::reset`].
///
/// It may move to another thread, and be used by one at a time; several renderers, on one device or several, may be
/// used at once.
pub struct Renderer {
    device: Device,
    frame: Frame,
    /// [`Scene::hash`], as the scene is now.
    scene_hash: String,
    geometry: scene::Geometry,
    /// The scene's materials as authored.
    authored: Vec<scene::Material>,
    settings: Settings,
    prepared: Prepared,
    kernels: Kernels,
    bindings: Bindings,
    /// None on a caller's device without a queue.
    recorder: Option<Recorder>,
    buffers: Vec<(Slot, Buffer)>,
    bands: Vec<Band>,
    /// Band and samples whose G-buffers the device holds: batch b is at stratum `strata[b]`.
    resident: Option<usize>,
    strata: [Option<u32>; BATCHES as usize],
    /// First sample of the sums.
    begin: Option<u32>,
    /// Points of the surface are lit, and by the lights that there are.
    lit: bool,
    /// Where the host computes light.
    host: Option<host::Host>,
    /// Pixels have different numbers of samples.
    adaptive: bool,
    /// What [`Renderer::render_until`] found last.
    outcome: Option<Outcome>,
    pace: adaptive::Pace,
    /// Samples were submitted before, so the driver has compiled what it puts off until then.
    warm: bool,
    /// How often the sums of the band on the device are copied to the host, and when they last were.
    keep_every: Option<Duration>,
    kept_at: Instant,
    /// Where sums are copied to before they are packed. Allocated once: bands that take turns would leave the allocator
    /// holes that it does not give back.
    spare: Vec<u8>,
    /// Writing failed midway: the buffers are of two scenes.
    torn: bool,
}

impl Renderer {
    /// Checks the settings, uploads the scene and makes every buffer and pipeline that rendering needs.
    ///
    /// Fails if the settings do not fit the scene, or a buffer does not fit the device.
    pub fn new(device: &Device, scene: &Scene, settings: &Settings) -> Result<Renderer> {
        Renderer::with_buffers(device, scene, settings, vec![])
    }

    /// As [`Renderer::new`], with buffers of the caller's in place of our own: geometry, results, or any slot but
    /// `Progresses` and `Actives`, as [`Plan`] lists them. Elements are laid out as [`crate::shared`] says, without padding. What the
    /// scene determines is written to them here: the BVH and the order of its triangles are made on the host. Vertices
    /// that only a buffer of the caller's holds are read back by him, once, for [`Scene::from_meshes`].
    ///
    /// # Errors
    /// As [`Renderer::new`]; [`Error::Setting`] for a buffer that is too small, and for one that has to be filled on a
    /// device without a queue where the host does not reach it.
    pub fn with_buffers(
        device: &Device,
        scene: &Scene,
        settings: &Settings,
        buffers: Vec<(Slot, Buffer)>,
    ) -> Result<Renderer> {
        Renderer::with_features(device, scene, settings, |_| {}, buffers, &[])
    }

    /// As [`Renderer::new`], with traversal steps counted.
    pub fn counting(device: &Device, scene: &Scene, settings: &Settings) -> Result<Renderer> {
        Renderer::with_features(device, scene, settings, |prepared| prepared.features.counters = 1, vec![], &[])
    }

    /// As [`Renderer::counting`], with other modules, which count in a buffer of their own; its first word is that of
    /// [`Renderer::largest_step_count`].
    pub(crate) fn instrumented(
        device: &Device,
        scene: &Scene,
        settings: &Settings,
        modules: &Modules,
        counters: Buffer,
    ) -> Result<Renderer> {
        let change = |prepared: &mut Prepared| prepared.features.counters = 1;
        Renderer::with_features(device, scene, settings, change, vec![(Slot::Counters, counters)], modules)
    }

    /// The words of the counters, those of [`Renderer::instrumented`] after the first; none without.
    pub(crate) fn counters(&self) -> Result<Vec<u32>> {
        let Some(counters) = self.buffer(Slot::Counters) else { return Ok(vec![]) };
        Ok(bytemuck::pod_collect_to_vec(&download(&self.device, counters, counters.bytes())?))
    }

    fn with_features(
        device: &Device,
        scene: &Scene,
        settings: &Settings,
        change: impl FnOnce(&mut Prepared),
        given: Vec<(Slot, Buffer)>,
        modules: &Modules,
    ) -> Result<Renderer> {
        if !(1..=128).contains(&settings.workgroup) {
            return Err(Error::setting("workgroup", format!("{} is not between 1 and 128", settings.workgroup)));
        }
        let span = timeline::begin(&settings.timeline, "prepare");
        let mut prepared = prepared(scene, settings)?;
        change(&mut prepared);
        give_back_freed();
        drop(span);
        let limits = Limits::of(device);
        let bands = bands::split(limits, &prepared, settings)?;
        budget::check(limits, scene, &prepared, &bands)?;
        Renderer::with_bands(device, scene, settings, prepared, given, bands, modules)
    }

    fn with_bands(
        device: &Device,
        scene: &Scene,
        settings: &Settings,
        prepared: Prepared,
        mut given: Vec<(Slot, Buffer)>,
        bands: Vec<Band>,
        modules: &Modules,
    ) -> Result<Renderer> {
        let span = timeline::begin(&settings.timeline, "pipelines");
        let kernels = Kernels::new(device, &prepared, settings.workgroup, modules)?;
        drop(span);
        let _span = timeline::begin(&settings.timeline, "upload");
        let recording = settings.recording;
        let mut take = |slot: Slot, bytes: u64, location: Location| {
            let Some(position) = given.iter().position(|(named, _)| *named == slot) else {
                let location = if recording && WRITTEN.contains(&slot) { Location::Upload } else { location };
                return Buffer::new(device, slot.name(), bytes, location);
            };
            let (_, buffer) = given.swap_remove(position);
            let problem = match slot {
                Slot::Progresses | Slot::Actives => "must be the renderer's own".into(),
                _ if buffer.bytes() < bytes => format!("has {} bytes; {bytes} are needed", buffer.bytes()),
                _ => return Ok(buffer),
            };
            Err(Error::setting(format!("the caller's buffer {}", slot.name()), problem))
        };
        let pixels = bands.iter().map(|band| band.pixels).max().unwrap_or(0);
        let sizes = plan::sizes(scene, &prepared, pixels);
        let mut buffers = Vec::new();
        for (slot, data) in plan::scene_data(scene, &prepared) {
            let limit = device.max_storage_buffer_range();
            if data.len() as u64 > limit {
                let (count, most) = (data.len() / slot.stride(), limit / slot.stride() as u64);
                let problem = format!(
                    "{count} of them take {} bytes; the device binds {limit} bytes at most, which {most} fit in",
                    data.len()
                );
                return Err(Error::Memory { step: format!("create buffer {}", slot.name()), problem });
            }
            let (_, bytes) = sizes.iter().find(|(sized, _)| *sized == slot).expect("every slot has a size");
            let buffer = take(slot, *bytes, Location::Device)?;
            upload(device, &buffer, data)?;
            buffers.push((slot, buffer));
        }
        for (slot, bytes) in sizes {
            if buffers.iter().all(|(made, _)| *made != slot) {
                buffers.push((slot, take(slot, bytes, Location::Scratch)?));
            }
        }
        if let Some((slot, _)) = given.first() {
            return Err(Error::setting(format!("the caller's buffer {}", slot.name()), "the scene does not need it"));
        }
        if let Some((_, counts)) = buffers.iter().find(|(slot, _)| *slot == Slot::Progresses) {
            counts.write(&[Count { end: NO_SAMPLES, ..Count::default() }]);
        }
        if let Some((_, counters)) = buffers.iter().find(|(slot, _)| *slot == Slot::Counters) {
            upload(device, counters, bytemuck::bytes_of(&0u32))?;
        }
        let bound: Vec<_> = buffers.iter().map(|(slot, buffer)| (*slot, buffer)).collect();
        let bindings = Bindings::new(&Layout::new(device)?, &bound)?;
        let recorder = match (device.has_queue(), &settings.timeline) {
            (false, _) => None,
            (true, None) => Some(Recorder::new(device)?),
            (true, Some(_)) => Some(Recorder::profiled(device)?),
        };
        let geometry = scene::geometry(scene);
        let host = host::Host::new(scene, &prepared, settings.integrator);
        Ok(Renderer {
            device: device.clone(),
            frame: scene.frame,
            scene_hash: scene::hash(scene, geometry),
            geometry,
            authored: scene.materials.clone(),
            settings: settings.clone(),
            prepared,
            kernels,
            bindings,
            recorder,
            buffers,
            bands,
            // The sums of recordings never leave the device.
            resident: recording.then_some(0),
            strata: [None; BATCHES as usize],
            begin: None,
            lit: false,
            host,
            adaptive: false,
            outcome: None,
            pace: Default::default(),
            warm: false,
            keep_every: None,
            kept_at: Instant::now(),
            spare: vec![],
            torn: false,
        })
    }

    /// The buffers on the device: slot and bytes.
    pub fn buffers(&self) -> Vec<(Slot, u64)> {
        self.buffers.iter().map(|(slot, buffer)| (*slot, buffer.bytes())).collect()
    }

    /// Stems of the kernels that were made.
    pub fn kernels(&self) -> Vec<&'static str> {
        self.kernels.made().map(Kernel::stem).collect()
    }

    /// What kernels read, but for the geometry.
    pub fn prepared(&self) -> &Prepared {
        &self.prepared
    }

    /// Adds the next `samples` samples.
    pub fn render(&mut self, samples: u32) -> Result<()> {
        let begin = self.samples().end;
        self.render_range(begin..begin.saturating_add(samples), &mut |_| ControlFlow::Continue(()))?;
        Ok(())
    }

    /// The samples that every pixel has. After an interruption some bands of several may have up to 32 more: those
    /// samples count in their means and variances, and their number is in the image's channel `samples.Y`.
    pub fn samples(&self) -> Range<u32> {
        if let Some(count) = self.count() {
            return if count.end == NO_SAMPLES { 0..0 } else { count.begin..count.end };
        }
        let begin = self.begin.unwrap_or(0);
        begin..self.bands.iter().map(|band| band.end).min().unwrap_or(begin)
    }

    /// Forgets every sample.
    pub fn reset(&mut self) {
        self.begin = None;
        (self.adaptive, self.outcome) = (false, None);
        self.resident = self.settings.recording.then_some(0);
        self.set_count(Count { end: NO_SAMPLES, ..self.count().unwrap_or_default() });
        for band in &mut self.bands {
            band.kept = None;
            band.roll_back(0);
        }
    }

    /// Forgets every sample and draws from `seed` from now on.
    pub fn reseed(&mut self, seed: u32) -> Result<()> {
        self.reset();
        self.settings.seed = seed;
        self.lit = false;
        self.prepared.view.seed = seed;
        let views = self.buffer(Slot::Views).expect("every renderer has a view");
        upload(&self.device, views, bytemuck::bytes_of(&self.prepared.view))
    }

    /// Adds the samples of `range`, which follows what is there. `progress` is called after each submission and may
    /// stop the render; then each pixel has at least one sample. Returns whether the range was finished.
    ///
    /// After an error the renderer has the samples of [`Renderer::samples`] and some bands of several more, so that
    /// [`Renderer::render_rest`] goes on where that is possible; nothing is counted twice.
    pub fn render_range(
        &mut self,
        range: Range<u32>,
        progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<bool> {
        let _span = timeline::begin(&self.settings.timeline, "render");
        self.catch_up();
        if range.start >= range.end {
            return Err(Error::setting("samples", format!("{}:{} holds no sample", range.start, range.end)));
        }
        if self.adaptive {
            return Err(Error::setting("samples", "of the pixels differ in number: none can follow them all"));
        }
        if self.begin.is_some() && self.samples().end != range.start {
            let problem = format!("{}:{} does not follow {:?}", range.start, range.end, self.samples());
            return Err(Error::setting("samples", problem));
        }
        if self.begin.is_none() {
            self.begin = Some(range.start);
            self.bands.iter_mut().for_each(|band| band.end = range.start);
        }
        let pixels: u64 = self.bands.iter().map(|band| band.own.len() as u64).sum();
        let total = pixels * u64::from(range.end - range.start);
        let mut state = Progress { done: 0, total, error: None };
        let early = |band: &Band| band.own.len() as u64 * u64::from(band.end.min(range.end) - range.start);
        state.done += self.bands.iter().map(early).sum::<u64>();
        self.light_points()?;
        let mut stop = false;
        let mut pass = range.start..range.start + 1;
        while !pass.is_empty() {
            for band in 0..self.bands.len() {
                // Some are ahead after an interruption or an error.
                let mut next = pass.start.max(self.bands[band].end);
                if next < pass.end {
                    self.make_resident(band)?;
                }
                while next < pass.end && !(stop && pass.start > range.start) {
                    let pixels = self.bands[band].pixels;
                    let Some(count) = self.pace.samples(pixels).or((pass.start == range.start).then_some(1)) else {
                        stop = true;
                        break;
                    };
                    let count = if self.host.is_some() { 1 } else { count };
                    let end = pass.end.min(next.saturating_add(count));
                    self.submit_samples(band, next..end, None).inspect_err(|_| self.distrust(band))?;
                    self.keep_in_time()?;
                    state.done += self.bands[band].own.len() as u64 * u64::from(end - next);
                    next = end;
                    stop |= progress(&state).is_break();
                }
            }
            if stop {
                break;
            }
            // A single band has no reason to pause; several meet at multiples of PASS.
            let end = if self.bands.len() == 1 { range.end } else { (pass.end / PASS + 1).saturating_mul(PASS) };
            pass = pass.end..end.min(range.end);
        }
        Ok(self.samples().end == range.end)
    }

    /// Adds samples to a band: to all of its pixels, or to so many that Actives lists.
    fn submit_samples(&mut self, band: usize, samples: Range<u32>, listed: Option<u32>) -> Result<()> {
        let start = Instant::now();
        let Renderer { kernels, bindings, prepared, strata, bands, .. } = self;
        let recorder = own(&mut self.recorder)?;
        recorder.begin()?;
        let Band { first_row, pixels, .. } = bands[band];
        let traced = listed.unwrap_or(0);
        if let Some(count) = count(&self.buffers) {
            let range = samples.start.wrapping_sub(count.first)..samples.end.wrapping_sub(count.first);
            kernels.recording(prepared, &bands[band], range, &mut |kernel, invocations, step| {
                recorder.dispatch(kernel, bindings, invocations, step);
            });
        } else {
            let actives = find(&self.buffers, Slot::Actives).expect("kernels work on lists");
            let base = Step { first_row, pixel_count: pixels, traced, ..Step::default() };
            let whole = Extent::Invocations(listed.unwrap_or(pixels));
            if prepared.features.reuse != 0 {
                // Stamps of other bands, and of sums that are forgotten, mean nothing here.
                recorder.fill(find(&self.buffers, Slot::Probes).expect("tiles have probes"), 0);
            }
            for sample_index in samples.clone() {
                let step = Step { sample_index, point: random::point(sample_index), ..base };
                let stratum = Some(random::stratum(&prepared.features, sample_index));
                let batch = random::batch(sample_index);
                let resident = &mut strata[batch as usize];
                // No pixel of the batch is known to see anything: no workgroups, but one in the other directions.
                let arguments = u64::from(16 * batch);
                if *resident != stratum {
                    recorder.update(actives, arguments, &[0, 1, 1, 0]);
                }
                kernels.sample(prepared, step, *resident != stratum, &mut |kernel, all, step| {
                    let extent = if all { whole } else { Extent::Indirect(actives, arguments) };
                    recorder.dispatch_extent(kernel, bindings, extent, step);
                });
                *resident = stratum;
            }
            let step = Step { count: samples.end - samples.start, ..base };
            kernels.count.iter().for_each(|kernel| recorder.dispatch_extent(kernel, bindings, whole, &step));
        }
        recorder.submit_and_wait()?;
        bands[band].changed = true;
        self.add_on_host(band, samples.start)?;
        // Of listed pixels others are behind.
        if listed.is_none() {
            self.bands[band].end = samples.end;
        }
        let worked = listed.unwrap_or(pixels);
        self.pace.note(start, u64::from(worked) * samples.len() as u64);
        let name = if self.warm { "submission" } else { "first dispatch" };
        if !std::mem::replace(&mut self.warm, true) {
            // What drivers take to translate, and what the caller has dropped since.
            give_back_freed();
        }
        self.note(name, Work { band: band as u32, pixels: worked, samples });
        Ok(())
    }

    /// The image of the samples so far, with every channel and attribute. Every value is finite: a mean or variance
    /// beyond f32 is its largest number, and samples that would overflow a sum are left out and counted
    /// (`invalidSamples`).
    pub fn image(&mut self) -> Result<Image> {
        assemble::image(self, assemble::Sums::Kept)
    }

    /// As [`Renderer::image`], and forgets every sample: each band's sums are freed once they are read, so that a large
    /// image needs the memory of its sums and not that of its channels on top.
    pub fn take_image(&mut self) -> Result<Image> {
        let image = assemble::image(self, assemble::Sums::Freed)?;
        self.reset();
        Ok(image)
    }

    /// As [`Renderer::take_image`], for the last time.
    pub fn finish(mut self) -> Result<Image> {
        self.take_image()
    }

    /// The largest number of loop trips of any traversal so far; 0 unless made by [`Renderer::counting`].
    pub fn largest_step_count(&self) -> Result<u32> {
        let Some(counters) = self.buffer(Slot::Counters) else { return Ok(0) };
        Ok(bytemuck::pod_read_unaligned(&download(&self.device, counters, 4)?))
    }

    fn buffer(&self, slot: Slot) -> Option<&Buffer> {
        find(&self.buffers, slot)
    }
}

impl Kernels {
    /// The dispatches of one sample of a band, in order: kernel, whether it works on pixels that see nothing too,
    /// constants. `primary` is among them unless the G-buffer of the sample's batch holds.
    fn sample(
        &self,
        prepared: &Prepared,
        mut step: Step,
        primary: bool,
        dispatch: &mut dyn FnMut(&Kernel, bool, &Step),
    ) {
        // The host counts for itself.
        (step.first, step.count) = (1, u32::from(!prepared.on_host));
        if primary {
            self.primary.iter().for_each(|kernel| dispatch(kernel, true, &step));
        }
        let mut dispatch = |kernel: &Option<Kernel>, step: &Step| {
            kernel.iter().for_each(|kernel| dispatch(kernel, false, step));
            kernel.is_some()
        };
        // By parts, so that no invocation loops without end.
        let parts = prepared.view.leaves.div_ceil(GATHER_POINTS);
        for part in 0..parts {
            (step.node, step.first, step.last) = (parts + part, (part == 0).into(), (part + 1 == parts).into());
            if dispatch(&self.gather, &step) {
                step.count = 0;
            }
        }
        step.first = 1;
        dispatch(&self.sample, &step);
        dispatch(&self.reproject, &step);
        // Shadow rays in portions, so that no invocation loops without end; a scene without light has one empty
        // portion.
        for begin in (0..prepared.ray_count.max(1)).step_by(MAX_RAYS as usize) {
            step.ray_begin = begin;
            step.ray_count = (prepared.ray_count - begin.min(prepared.ray_count)).min(MAX_RAYS);
            for kernel in [&self.accumulate, &self.reflect] {
                if dispatch(kernel, &step) {
                    step.count = 0;
                }
            }
            step.first = 0;
        }
        dispatch(&self.reuse, &step);
        for begin in (0..prepared.ray_count).step_by(MAX_SINGLE as usize) {
            step.ray_begin = begin;
            step.ray_count = (prepared.ray_count - begin).min(MAX_SINGLE);
            dispatch(&self.single, &step);
        }
    }
}

/// What kernels read, and which of their features a renderer uses.
fn prepared(scene: &Scene, settings: &Settings) -> Result<Prepared> {
    let mut prepared = prepare(scene, settings)?;
    let features = &mut prepared.features;
    features.listed = u32::from(!settings.recording);
    if settings.estimate_error && prepared.has_reflection {
        features.batches = 2;
    }
    Ok(prepared)
}

/// The recorder of a device with a queue.
fn own(recorder: &mut Option<Recorder>) -> Result<&mut Recorder> {
    let none = || Error::Device("the caller's device was given without a queue: record instead of rendering".into());
    recorder.as_mut().ok_or_else(none)
}

fn find(buffers: &[(Slot, Buffer)], slot: Slot) -> Option<&Buffer> {
    buffers.iter().find(|(s, _)| *s == slot).map(|(_, buffer)| buffer)
}

/// Which samples the sums hold, where recordings keep count of them.
fn count(buffers: &[(Slot, Buffer)]) -> Option<Count> {
    find(buffers, Slot::Progresses).map(|counts| counts.read()[0])
}

/// Hex SHA-256 over the SPIR-V of all kernels.
pub fn spirv_hash() -> String {
    use sha2::{Digest, Sha256};
    let mut hash = Sha256::new();
    for (stem, spirv) in SPIRV {
        hash.update(stem.as_bytes());
        hash.update(spirv);
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}
