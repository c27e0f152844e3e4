//! What a render takes against what there is, asked before any of it is made: drivers and operating systems give out
//! more memory than they have.

use super::{
    Limits, assemble,
    bands::{self, Band},
    plan,
    sums::SUMS,
};
use crate::{
    error::{Error, Result},
    prepare::Prepared,
    scene::Scene,
    shared::Slot,
};

/// Something that takes memory.
struct Need {
    what: String,
    bytes: u64,
    /// What makes it less.
    remedy: &'static str,
}

/// Bytes of the sums that a render keeps on the host for these bands, before they are packed.
pub fn waiting_bytes(prepared: &Prepared, bands: impl Iterator<Item = u32>) -> u64 {
    let made = bands::slots(prepared);
    let each: u64 = SUMS
        .into_iter()
        .filter(|slot| made.contains(slot))
        .map(|slot| bands::bytes_per_pixel(slot, &prepared.features))
        .sum();
    bands.map(|pixels| u64::from(pixels) * each).sum()
}

/// # Errors
/// [`Error::Memory`] if the device or the host has less left than is needed: how much that is, for what, and which
/// setting makes it less.
pub fn check(limits: Limits, scene: &Scene, prepared: &Prepared, bands: &[Band]) -> Result<()> {
    let largest = bands.iter().map(|band| band.pixels).max().unwrap_or(0);
    let of_slot = |(slot, bytes): (Slot, u64)| Need { what: slot.name().into(), bytes, remedy: remedy(slot) };
    let device: Vec<Need> = plan::sizes(scene, prepared, largest).into_iter().map(of_slot).collect();
    refuse(&device, limits.heap_bytes, "the device's memory", "")?;

    let pixels: u64 = bands.iter().map(|band| band.own.len() as u64).sum();
    let image = pixels * assemble::bytes_per_pixel(prepared.features.batches != 0);
    let waiting = waiting_bytes(prepared, bands.iter().map(|band| band.pixels));
    // `finish` frees the sums of a band when its part of the image is there.
    let (what, bytes) = if image > waiting { ("image", image) } else { ("sums of all pixels", waiting) };
    let mut host = vec![Need { what: what.into(), bytes, remedy: remedy(Slot::Pixels) }];
    if limits.shared {
        host.extend(device);
    }
    let beside = if limits.shared { ", beside what the driver takes" } else { "" };
    refuse(&host, limits.host_bytes, &format!("{}{beside}", limits.host_limit), ", or raise that limit")
}

fn refuse(needs: &[Need], left: u64, limit: &str, otherwise: &str) -> Result<()> {
    let sum: u64 = needs.iter().map(|need| need.bytes).sum();
    if sum <= left {
        return Ok(());
    }
    let mut needs: Vec<&Need> = needs.iter().collect();
    needs.sort_by_key(|need| std::cmp::Reverse(need.bytes));
    let megabytes = |bytes: u64| format!("{:.1} MB", bytes as f64 * 1e-6);
    let list: Vec<String> =
        needs.iter().take(4).map(|need| format!("{} {}", need.what, megabytes(need.bytes))).collect();
    let problem = format!(
        "{} are needed ({}{}), {} are left by {limit}; {}{otherwise}",
        megabytes(sum),
        list.join(", "),
        if needs.len() > 4 { ", ..." } else { "" },
        megabytes(left),
        needs[0].remedy
    );
    Err(Error::Memory { step: "plan the render".into(), problem })
}

/// What makes a buffer smaller.
fn remedy(slot: Slot) -> &'static str {
    match slot {
        Slot::Nodes | Slot::Triangles | Slot::Shadings | Slot::Coordinates => "use a mesh of fewer triangles",
        Slot::Texels | Slot::Textures => "use smaller textures",
        Slot::Environment | Slot::EnvironmentCdf => "use a smaller image as environment",
        Slot::Profiles | Slot::Balances => "take a model without tables (--model burley)",
        _ => "lower the resolution or crop",
    }
}
