//! What a device gives at best: bytes a second from memory, and operations on f32.

use crate::{
    Error, Result,
    gpu::{Bindings, Buffer, Device, Kernel, Layout, Location, Recorder},
    shared::{Features, Slot, Step, WORKGROUP},
};
use glam::UVec4;
use serde_json::{Value, json};
use std::time::Instant;

/// More than any processor's caches hold, and than a GPU's.
const COPY_BYTES: u64 = 256 << 20;

/// Dispatches that are timed; the fastest counts.
const TRIES: u32 = 6;

/// Multiply-adds of an invocation of `peak` in one trip of its loop.
const CHAINED: u64 = 8 * 16;

/// Trips of that loop, below Mesa 22's cap of 65,535.
const TRIPS: u32 = 1024;

/// A dispatch of arithmetic is at least that long (ns), so that its start does not count.
const LONG: f64 = 10e6;

/// The best that was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Bytes a second, read and written, of a copy within the device's memory: by a kernel or by a transfer, whichever is
    /// faster.
    pub bandwidth: f64,
    /// Operations on f32 a second of a kernel of independent multiply-adds, two operations each.
    pub peak: f64,
    /// Bytes of the buffer, of which one half is copied to the other.
    pub copied: u64,
}

impl Limits {
    /// Measures them; none on a device without timestamps.
    ///
    /// # Errors
    /// [`Error::Vulkan`], [`Error::Memory`].
    pub fn measure(device: &Device) -> Result<Option<Limits>> {
        if !device.has_timestamps() {
            return Ok(None);
        }
        // A quarter of what is left, where that is little.
        let left = device.heap_left().min(device.host_left().0) / 4;
        let copied = COPY_BYTES.min(device.max_storage_buffer_range()).min(left) / 64 * 64;
        if copied == 0 {
            let problem = "nothing is left for the buffer that is copied".into();
            return Err(Error::Memory { step: "measure the device's limits".into(), problem });
        }
        let buffer = Buffer::new(device, "copied", copied, Location::Scratch)?;
        let layout = Layout::new(device)?;
        let bindings = Bindings::new(&layout, &[(Slot::Nodes, &buffer)])?;
        let mut recorder = Recorder::profiled(device)?;
        let features = Features::default();
        let mut best = |kernel: &Kernel, invocations: u32, step: &Step| -> Result<f64> {
            recorder.begin()?;
            recorder.fill(&buffer, 0);
            (0..TRIES).for_each(|_| recorder.dispatch(kernel, &bindings, invocations, step));
            recorder.submit_and_wait()?;
            let timing = recorder.timing();
            let times = timing.iter().flat_map(|timing| &timing.scopes).map(|scope| scope.end - scope.begin);
            // A clock too coarse to see it shows one tick at best.
            Ok(times.fold(f64::INFINITY, f64::min).max(1.0))
        };
        let copy =
            Kernel::new(&layout, "copy", include_bytes!(concat!(env!("OUT_DIR"), "/copy.spv")), &features, WORKGROUP)?;
        let words = (copied / 2 / size_of::<UVec4>() as u64) as u32;
        let time = best(&copy, words, &Step { pixel_count: words, ..Step::default() })?;
        let bandwidth = (copied as f64 / time * 1e9).max(transfer(device, &buffer)?);

        let peak =
            Kernel::new(&layout, "peak", include_bytes!(concat!(env!("OUT_DIR"), "/peak.spv")), &features, WORKGROUP)?;
        let mut invocations = 1u32 << 10;
        let mut rate: f64 = 0.0;
        loop {
            let point = [0.875f32.to_bits(), 0.125f32.to_bits(), 0, 0, 0];
            let time =
                best(&peak, invocations, &Step { pixel_count: invocations, count: TRIPS, point, ..Step::default() })?;
            rate = rate.max((2 * CHAINED * u64::from(TRIPS) * u64::from(invocations)) as f64 / time * 1e9);
            if time >= LONG || invocations >= 1 << 22 {
                break;
            }
            invocations *= 4;
        }
        Ok(Some(Limits { bandwidth, peak: rate, copied }))
    }

    pub(super) fn json(&self) -> Value {
        json!({"copyBytesPerSecond": self.bandwidth, "flopsPerSecond": self.peak, "copiedBytes": self.copied})
    }

    pub(super) fn from_json(value: &Value) -> Option<Limits> {
        Some(Limits {
            bandwidth: value["copyBytesPerSecond"].as_f64()?,
            peak: value["flopsPerSecond"].as_f64()?,
            copied: value["copiedBytes"].as_u64()?,
        })
    }
}

/// Bytes a second of a transfer of half of the buffer to another, by the host's clock.
fn transfer(device: &Device, buffer: &Buffer) -> Result<f64> {
    let half = buffer.bytes() / 2;
    let target = Buffer::new(device, "copy", half, Location::Scratch)?;
    let mut recorder = Recorder::new(device)?;
    let mut best = 0.0;
    for _ in 0..TRIES {
        recorder.begin()?;
        (0..TRIES).for_each(|_| recorder.copy(buffer, &target, half));
        let start = Instant::now();
        recorder.submit_and_wait()?;
        let seconds = start.elapsed().as_secs_f64();
        best = f64::max(best, (2 * half * u64::from(TRIES)) as f64 / seconds);
    }
    Ok(best)
}
