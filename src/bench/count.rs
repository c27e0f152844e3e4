//! What the kernels of a render do: bytes, operations and rays, counted on the device in one run with counters.

use super::instrument::{COUNTER_WORDS, Work, instrument};
use crate::{
    Error, Result,
    gpu::{Buffer, Device, Location, upload},
    render::{Renderer, SPIRV},
    scene::Scene,
    settings::Settings,
    shared::Slot,
    timeline::{KernelTimes, Timeline},
};
use serde_json::{Value, json};

/// What the dispatches of a kernel did.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Counts {
    pub kernel: String,
    /// Dispatches that were counted.
    pub launches: u64,
    /// All of them together.
    pub work: Work,
}

/// Which rays a kernel sends: `camera`, `probe` or `shadow`; `single` for those of single scattering, which go through the
/// matter and on to a light. None for kernels without.
pub fn rays_of(kernel: &str) -> Option<&'static str> {
    match kernel {
        "primary" => Some("camera"),
        "reproject" => Some("probe"),
        "accumulate" | "reflect" | "irradiance" => Some("shadow"),
        "single" => Some("single"),
        _ => None,
    }
}

impl Counts {
    /// A dispatch's mean work: loaded, stored, operations, rays.
    pub fn each(&self) -> [f64; 4] {
        let Work { loaded, stored, flops, rays } = self.work;
        [loaded, stored, flops, rays].map(|total| total as f64 / self.launches as f64)
    }

    pub(super) fn json(&self) -> Value {
        let Work { loaded, stored, flops, rays } = self.work;
        json!({
            "name": self.kernel, "launches": self.launches,
            "loadedBytes": loaded, "storedBytes": stored, "flops": flops, "rays": rays, "kind": rays_of(&self.kernel),
        })
    }

    pub(super) fn from_json(value: &Value) -> Option<Counts> {
        let count = |name: &str| value[name].as_u64();
        let work = Work {
            loaded: count("loadedBytes")?,
            stored: count("storedBytes")?,
            flops: count("flops")?,
            rays: count("rays")?,
        };
        Some(Counts { kernel: value["name"].as_str()?.into(), launches: count("launches")?, work })
    }
}

/// Renders `samples` samples and the image by kernels with counters and says what each did. Lists of pixels, branches and loops are those of the render. Nothing on a device without
/// timestamps, which say how often kernels were dispatched.
///
/// # Errors
/// As [`Renderer::new`] and [`Renderer::render`].
pub fn count(device: &Device, scene: &Scene, settings: &Settings, samples: u32) -> Result<Vec<Counts>> {
    // The first word is that of the traversal's steps.
    let place = |index: usize| 1 + COUNTER_WORDS * index as u32;
    let instrumented =
        SPIRV.iter().enumerate().map(|(i, (stem, spirv))| Ok((*stem, instrument(stem, spirv, place(i))?)));
    let modules = instrumented.collect::<Result<Vec<_>>>()?;
    let words = place(SPIRV.len());
    let zeros = vec![0u32; words as usize];
    let counters = Buffer::new(device, Slot::Counters.name(), 4 * u64::from(words), Location::Device)?;
    upload(device, &counters, bytemuck::cast_slice(&zeros))?;
    // Not the caller's: these times are no one's.
    let timeline = Timeline::new();
    let settings = Settings { timeline: Some(timeline.clone()), ..settings.clone() };
    let mut renderer = Renderer::instrumented(device, scene, &settings, &modules, counters)?;
    renderer.render(samples)?;
    renderer.image()?;
    let words = renderer.counters()?;
    let missing =
        || Error::Memory { step: "read the counters".into(), problem: "there are fewer than were made".into() };
    let counts = |times: KernelTimes| {
        let index = SPIRV.iter().position(|(stem, _)| *stem == times.kernel).ok_or_else(missing)?;
        let words = words.get(place(index) as usize..place(index + 1) as usize);
        let work = words.and_then(Work::of_words).ok_or_else(missing)?;
        Ok(Counts { kernel: times.kernel.into(), launches: times.count, work })
    };
    timeline.kernels().into_iter().map(counts).collect()
}
