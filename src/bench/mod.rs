//! Fixed work, timed again and again: the same scene, settings, samples and random numbers, so that two runs, two
//! drivers or two commits can be compared, and [`compare`] says which kernels differ beyond noise.
//!
//! A [`Report`] holds a time for each kernel and repeat, so that whoever reads it can do his own statistics. What is
//! said here assumes that repeats are independent. What all repeats of one process have in common (where its memory
//! lies, what else the machine did meanwhile) is no noise to them: a difference beyond noise is one between the two
//! runs, and between the commits only if the machine was idle and the order of runs does not matter. Run them in turns
//! to be sure.

mod compare;
mod count;
mod instrument;
mod limits;
mod report;
mod roofline;
mod scaling;
pub mod statistics;

pub use compare::{Comparison, Difference, compare};
pub use count::{Counts, count, rays_of};
pub use instrument::Work;
pub use limits::Limits;
pub use report::{Report, Series};
pub use roofline::{Bound, Line, Rays};
pub use scaling::{Axis, Point, Scaling, scaling, scalings_csv, scalings_json};

use crate::{
    Error, Result,
    gpu::{Device, Executable, Statistic},
    render::{Renderer, spirv_hash},
    scene::Scene,
    settings::Settings,
    timeline::{Counted, Span, Track},
};
use serde_json::{Value, json};
use std::time::Instant;

/// Of every interval of a median.
pub const CONFIDENCE: f64 = 0.95;

/// Most repeats of a run, and of one that is compared: the exact distribution of more takes too long.
pub const MAX_REPEATS: u32 = 200;

/// How much is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effort {
    /// Samples of each pixel in a repeat, from sample 0.
    pub samples: u32,
    /// Repeats that are not counted, 0 to [`MAX_REPEATS`]: drivers compile at the first.
    pub warmup: u32,
    /// Repeats that are, 1 to [`MAX_REPEATS`].
    pub repeat: u32,
}

/// Renders `scene` again and again, image included. What [`Settings::timeline`] holds so far, such as the time of
/// loading and opening, becomes a part of the report's start-up; it is cleared between repeats. `progress` hears how
/// many repeats are done, those of the warm-up first.
///
/// # Errors
/// As [`Renderer::new`] and [`Renderer::render`]; [`Error::Setting`] for a number of samples or repeats that cannot be.
pub fn run(
    device: &Device,
    scene: &Scene,
    settings: &Settings,
    effort: Effort,
    progress: &mut dyn FnMut(u32),
) -> Result<Report> {
    let Effort { samples, warmup, repeat } = effort;
    if samples == 0 || !(1..=MAX_REPEATS).contains(&repeat) || warmup > MAX_REPEATS {
        let problem = format!("needs a sample or more, 1 to {MAX_REPEATS} repeats, and no more of them before");
        return Err(Error::setting("bench", problem));
    }
    let timeline = settings.timeline.clone().unwrap_or_default();
    let settings = Settings { timeline: Some(timeline.clone()), ..settings.clone() };
    let mut renderer = Renderer::new(device, scene, &settings)?;
    let mut report = Report::new(about(device), renderer.work(samples), effort);
    for done in 0..warmup + repeat {
        let start = Instant::now();
        renderer.reset();
        renderer.render(samples)?;
        let rendered = start.elapsed();
        renderer.image()?;
        let whole = start.elapsed();
        if done == 0 {
            report.start_up = start_up(&timeline.spans());
        }
        if done >= warmup {
            let ms = |time: std::time::Duration| time.as_secs_f64() * 1e3;
            report.add_host("render", ms(rendered));
            report.add_host("image", ms(whole - rendered));
            for times in timeline.kernels() {
                report.add_kernel(&times);
            }
        }
        report.counters = counters(&timeline.counters());
        timeline.clear();
        progress(done + 1);
    }
    report.executables = executables(&renderer)?;
    report.device_bytes = renderer.buffers().iter().map(|(_, bytes)| bytes).sum();
    report.peak_bytes = peak_bytes();
    Ok(report)
}

/// Adds to a report of this work what its kernels do ([`count`], one sample) and what the device gives at best
/// ([`Limits::measure`]), neither of which its times have anything of.
///
/// # Errors
/// As [`count`] and [`Limits::measure`].
pub fn add_roofline(report: &mut Report, device: &Device, scene: &Scene, settings: &Settings) -> Result<()> {
    report.counts = count(device, scene, settings, 1)?;
    report.limits = Limits::measure(device)?;
    Ok(())
}

/// What makes the numbers: version, hash of the kernels, device, driver. It may differ between runs that are compared.
pub fn about(device: &Device) -> Value {
    let info = device.info();
    json!({
        "version": env!("CARGO_PKG_VERSION"), "spirvHash": spirv_hash(),
        "device": info.name, "driver": info.driver, "uuid": info.uuid, "kind": info.kind.to_string(),
        "vulkan": info.api_version,
    })
}

/// What the driver tells of each kernel, as JSON; null where it tells nothing.
fn executables(renderer: &Renderer) -> Result<Value> {
    let statistic = |found: &Statistic| json!({"name": found.name, "value": found.value, "about": found.description});
    let executable = |found: &Executable| {
        json!({
            "name": found.name, "about": found.description, "subgroup": found.subgroup,
            "statistics": found.statistics.iter().map(statistic).collect::<Vec<_>>(),
        })
    };
    let found = renderer.executables()?.into_iter().filter(|(_, list)| !list.is_empty());
    let named = found.map(|(stem, list)| (stem.to_string(), list.iter().map(executable).collect()));
    let named: serde_json::Map<String, Value> = named.collect();
    Ok(if named.is_empty() { Value::Null } else { named.into() })
}

/// What was counted, as JSON; null where nothing was.
fn counters(counted: &[Counted]) -> Value {
    let each = |counted: &Counted| {
        json!({
            "kernel": counted.kernel, "counter": counted.counter, "unit": counted.unit, "mean": counted.mean,
        })
    };
    if counted.is_empty() { Value::Null } else { counted.iter().map(each).collect() }
}

/// The host's spans until the first submission of samples ended: name and milliseconds, in order of their beginnings.
fn start_up(spans: &[Span]) -> Vec<(String, f64)> {
    let mut parts: Vec<&Span> = spans.iter().filter(|span| span.track == Track::Host).collect();
    parts.sort_by(|a, b| a.begin.total_cmp(&b.begin));
    let names = ["load", "bvh", "device", "prepare", "pipelines", "upload", "first dispatch"];
    let parts = parts.into_iter().filter(|span| names.contains(&span.name));
    parts.map(|span| (span.name.to_string(), (span.end - span.begin) * 1e-6)).collect()
}

/// Most memory that this process had so far (bytes), where the system tells: /proc of Linux.
fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok().map(|kilobytes| kilobytes * 1024)
}
