//! How an image is cut into bands of rows that fit the device, and where a band's sums are.

use super::Limits;
use crate::{
    error::{Error, Result},
    prepare::Prepared,
    settings::Settings,
    shared::{ACTIVE_HEADER, BATCHES, Features, GATHER_POINTS, REPROJECT_SCREEN, Slot},
};
use std::ops::Range;

/// Pixels of a band where nothing else limits it: enough to fill a GPU, few enough for a processor's caches.
const BAND_PIXELS: u32 = 1 << 18;

/// Rows of a band, if that is more: those beside it, which are rendered twice, are to be an eighth at most.
const BAND_ROWS: u32 = 128;

/// The same where the host computes light: few enough for progress to be seen.
const HOST_PIXELS: u32 = 1 << 14;

/// Workgroups of one dimension that every device allows (Vulkan 1.3, table 58).
const GROUPS: u64 = 65_535;

// Of each batch an indirect dispatch's arguments, and a count.
const _: () = assert!(ACTIVE_HEADER == 4 * BATCHES);

/// Consecutive rows that the device works on at a time.
pub struct Band {
    /// In the full image: that of the first pixel.
    pub first_row: u32,
    pub pixels: u32,
    /// Those of them that the image gets; before and after are rows of tiles that reach out of these.
    pub own: Range<u32>,
    /// End of the samples in its sums.
    pub end: u32,
    pub film: Film,
    /// RunningSums and BatchSums as they last were on the host, [`pack`]ed.
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

/// The bytes of sums in less: pixels that see nothing are alike.
pub fn pack(bytes: &[u8]) -> Vec<u8> {
    let mut packed = lz4_flex::block::compress_prepend_size(bytes);
    packed.shrink_to_fit();
    packed
}

/// What was [`pack`]ed; nothing of nothing.
pub fn unpack(packed: &[u8]) -> Vec<u8> {
    if packed.is_empty() {
        return vec![];
    }
    lz4_flex::block::decompress_size_prepended(packed).expect("it was packed here")
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

/// Cuts the rendered rows into bands of nearly equal size. Pixels share hits with those of their
/// [tile](crate::reference::tile), so rows of tiles that a band cuts are rendered with it, and the image is the same whatever
/// the bands are. Where pixels differ in their numbers of samples their tiles do too, and are cut.
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
    let reach = if settings.estimate_error { 0 } else { prepared.features.reuse.saturating_sub(1) };
    let pixels = match reach {
        _ if prepared.on_host => HOST_PIXELS,
        0 => BAND_PIXELS,
        _ => BAND_PIXELS.max(width.saturating_mul(BAND_ROWS)),
    };
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
    let Range { start, end } = prepared.rows;
    let rows = end - start;
    let of = |pixels: u64| (pixels / u64::from(width)).clamp(1, u64::from(rows)) as u32;
    let most = of(wanted.min(limit));
    // Of a few rows as many again may be rendered beside them, and more only where the device binds it.
    let margin = if most < rows { reach.min((of(limit) - 1) / 2) } else { 0 };
    let count = rows.div_ceil(most.saturating_sub(2 * margin).max(most.div_ceil(2)).min(of(limit) - 2 * margin));
    if (settings.recording || looks_up) && count > 1 {
        let problem =
            format!("{rows} rows of {width} pixels need more than the device binds; lower the resolution or crop");
        let step = format!("make one band for {}", if looks_up { "reproject screen" } else { "recordings" });
        return Err(Error::Memory { step, problem });
    }
    Ok((0..count)
        .map(|band| {
            let edge = |band: u32| start + (u64::from(rows) * u64::from(band) / u64::from(count)) as u32;
            let first_row = edge(band).saturating_sub(margin).max(start);
            let place = |row: u32| (row - first_row) * width;
            let (own, pixels) = (place(edge(band))..place(edge(band + 1)), place((edge(band + 1) + margin).min(end)));
            let (film, sums) = (Film::Empty, Default::default());
            Band { first_row, pixels, own, end: 0, film, sums, kept: None, changed: false }
        })
        .collect())
}
