//! How an image is cut into bands of rows that fit the device, and where a band's sums are.

use super::Limits;
use crate::{
    error::{Error, Result},
    prepare::Prepared,
    settings::Settings,
    shared::{ACTIVE_HEADER, BATCHES, Features, GATHER_POINTS, REPROJECT_SCREEN, Slot},
};

/// Pixels of a band where nothing else limits it: enough to fill a GPU, few enough for a processor's caches.
const BAND_PIXELS: u32 = 1 << 18;

/// The same where the host computes light: few enough for progress to be seen.
const HOST_PIXELS: u32 = 1 << 14;

/// Workgroups of one dimension that every device allows (Vulkan 1.3, table 58).
const GROUPS: u64 = 65_535;

// Of each batch an indirect dispatch's arguments, and a count.
const _: () = assert!(ACTIVE_HEADER == 4 * BATCHES);

/// Consecutive rows that the device works on at a time.
pub struct Band {
    /// In the full image.
    pub first_row: u32,
    pub pixels: u32,
    /// End of the samples in its sums.
    pub end: u32,
    pub film: Film,
    /// RunningSums and BatchSums as bytes, as they last were on the host. Allocated once: bands that take turns would
    /// leave the allocator holes that it does not give back.
    pub sums: [Vec<u8>; 2],
    /// End of the samples in `sums`; none before they were on the host.
    pub kept: Option<u32>,
    /// Samples were added since.
    pub changed: bool,
}

impl Band {
    /// Goes back to what the host has, where the device's sums cannot be had or trusted; without any, to `begin`.
    pub fn roll_back(&mut self, begin: u32) {
        (self.film, self.end) = match self.kept {
            Some(end) => (Film::OnHost, end),
            None => (Film::Empty, begin),
        };
        self.changed = false;
    }

    /// Gives the memory of the sums back.
    pub fn free(&mut self, begin: u32) {
        self.sums = Default::default();
        self.kept = None;
        self.roll_back(begin);
    }
}

/// Where a band's sums are.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Film {
    /// No sample yet.
    Empty,
    OnDevice,
    OnHost,
}

/// The buffers with elements for each pixel of a band that a render needs.
pub fn slots(prepared: &Prepared) -> Vec<Slot> {
    let mut slots = vec![Slot::Surfaces, Slot::RunningSums, Slot::Pixels];
    if prepared.has_probes {
        slots.extend([Slot::Probes, Slot::HitLists]);
    }
    if prepared.view.leaves > GATHER_POINTS {
        slots.push(Slot::Gathers);
    }
    if prepared.features.batches != 0 {
        slots.push(Slot::BatchSums);
    }
    if prepared.features.recorded != 0 {
        slots.push(Slot::Colors);
    }
    if prepared.features.listed != 0 {
        slots.push(Slot::Actives);
    }
    slots
}

/// Bytes that a slot takes for each pixel of a band.
pub fn bytes_per_pixel(slot: Slot, features: &Features) -> u64 {
    let elements = match slot {
        Slot::Surfaces => BATCHES,
        Slot::BatchSums => BATCHES * features.batches,
        Slot::Actives => BATCHES + 1,
        _ => 1,
    };
    u64::from(elements) * slot.stride() as u64
}

/// Bytes of a slot for a band of `pixels`.
pub fn bytes(slot: Slot, features: &Features, pixels: u32) -> u64 {
    let header = if slot == Slot::Actives { ACTIVE_HEADER } else { 0 };
    u64::from(header) * slot.stride() as u64 + bytes_per_pixel(slot, features) * u64::from(pixels)
}

/// Cuts the rendered rows into bands of nearly equal size.
pub fn split(limits: Limits, prepared: &Prepared, settings: &Settings) -> Result<Vec<Band>> {
    let slots = slots(prepared);
    let each = |slot: &Slot| bytes_per_pixel(*slot, &prepared.features);
    let widest = slots.iter().map(each).max().unwrap_or(1);
    let whole: u64 = slots.iter().map(each).sum();
    // An indirect dispatch has one dimension, of the workgroups that every device allows.
    let dispatched = if prepared.features.listed != 0 { GROUPS * u64::from(settings.workgroup) } else { u64::MAX };
    let limit = (limits.buffer_bytes / widest).min(dispatched);
    let width = prepared.view.crop_width;
    // Half of the memory is left to the scene and to others. Whether it suffices at all is asked later.
    let memory = limits.heap_bytes.min(if limits.shared { limits.host_bytes } else { u64::MAX });
    let pixels = if prepared.on_host { HOST_PIXELS } else { BAND_PIXELS };
    // A point may lie in any pixel of the G-buffer.
    let looks_up = prepared.features.reproject == REPROJECT_SCREEN;
    let wanted = match settings.recording || looks_up {
        true => u64::MAX,
        false => u64::from(settings.band_pixels.unwrap_or(pixels)).min(memory / 2 / whole),
    };
    if u64::from(width) > limit {
        return Err(Error::Memory {
            step: "cut the image into bands".into(),
            problem: format!("a row of {width} pixels needs more than the device binds; lower the resolution or crop"),
        });
    }
    let rows = prepared.rows.end - prepared.rows.start;
    let most = (wanted.min(limit) / u64::from(width)).clamp(1, u64::from(rows)) as u32;
    let count = rows.div_ceil(most);
    if (settings.recording || looks_up) && count > 1 {
        let problem =
            format!("{rows} rows of {width} pixels need more than the device binds; lower the resolution or crop");
        let step = format!("make one band for {}", if looks_up { "reproject screen" } else { "recordings" });
        return Err(Error::Memory { step, problem });
    }
    Ok((0..count)
        .map(|band| {
            let edge = |band: u32| (u64::from(rows) * u64::from(band) / u64::from(count)) as u32;
            let (first, end) = (edge(band), edge(band + 1));
            let pixels = (end - first) * width;
            let first_row = prepared.rows.start + first;
            Band { first_row, pixels, end: 0, film: Film::Empty, sums: Default::default(), kept: None, changed: false }
        })
        .collect())
}
