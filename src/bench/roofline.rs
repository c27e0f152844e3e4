//! How far kernels are from what the device gives at best: the roofline model (S. Williams, A. Waterman, D. Patterson,
//! CACM 52(4), 2009).

use super::{Report, rays_of};
use serde_json::{Value, json};

/// What would hold a kernel back if nothing else did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
    Memory,
    Arithmetic,
}

/// A kernel beside the device's limits, by its median time and its counted work.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    pub kernel: String,
    /// Bytes a second that it asks for. Caches serve what is asked for again, so it may exceed the bandwidth of memory.
    pub bandwidth: f64,
    /// Operations on f32 a second.
    pub flops: f64,
    /// Operations for each byte; infinite for a kernel that asks for none.
    pub intensity: f64,
    /// Rays a second.
    pub rays: f64,
    /// Shares of the copy's bandwidth and of the peak; none where limits were not measured.
    pub shares: Option<[f64; 2]>,
}

impl Line {
    /// The limit that binds, and the part of it that is reached: the larger share, since min(peak, intensity x bandwidth)
    /// over what is done is the smaller of both inverses.
    pub fn bound(&self) -> Option<(Bound, f64)> {
        let [memory, arithmetic] = self.shares?;
        Some(if memory >= arithmetic { (Bound::Memory, memory) } else { (Bound::Arithmetic, arithmetic) })
    }

    pub(super) fn json(&self) -> Value {
        let mut value = json!({
            "name": self.kernel, "bytesPerSecond": self.bandwidth, "flopsPerSecond": self.flops,
            "flopsPerByte": Some(self.intensity).filter(|intensity| intensity.is_finite()),
        });
        if let Some(kind) = rays_of(&self.kernel) {
            value["rays"] = kind.into();
            value["raysPerSecond"] = self.rays.into();
        }
        if let (Some([memory, arithmetic]), Some((bound, share))) = (self.shares, self.bound()) {
            value["shareOfBandwidth"] = memory.into();
            value["shareOfPeak"] = arithmetic.into();
            value["bound"] = if bound == Bound::Memory { "memory" } else { "arithmetic" }.into();
            value["shareOfRoof"] = share.into();
        }
        value
    }
}

/// Rays of a kind: how many a repeat has, and how many kernels that send them do in a second.
#[derive(Clone, Debug, PartialEq)]
pub struct Rays {
    /// See [`rays_of`].
    pub kind: &'static str,
    pub count: f64,
    pub rate: f64,
}

impl Rays {
    pub(super) fn json(&self) -> Value {
        json!({"kind": self.kind, "raysOfRepeat": self.count, "megaraysPerSecond": self.rate * 1e-6})
    }
}

impl Report {
    /// A line for each kernel that was timed and counted; none that took no time.
    pub fn roofline(&self) -> Vec<Line> {
        let line = |(kernel, seconds, [loaded, stored, flops, rays]): (&str, f64, [f64; 4])| {
            let (bandwidth, flops) = ((loaded + stored) / seconds, flops / seconds);
            Line {
                kernel: kernel.into(),
                bandwidth,
                flops,
                intensity: flops / bandwidth,
                rays: rays / seconds,
                shares: self.limits.map(|limits| [bandwidth / limits.bandwidth, flops / limits.peak]),
            }
        };
        self.worked().map(line).collect()
    }

    /// Rays of each kind that there are.
    pub fn rays(&self) -> Vec<Rays> {
        let kind = |kind| {
            let of_kind = self.worked().filter(|(kernel, ..)| rays_of(kernel) == Some(kind));
            let (count, seconds) = of_kind.fold((0.0, 0.0), |sum, (_, time, work)| (sum.0 + work[3], sum.1 + time));
            Rays { kind, count, rate: count / seconds }
        };
        ["camera", "probe", "shadow", "single"].into_iter().map(kind).filter(|rays| rays.count > 0.0).collect()
    }

    /// Kernel, seconds and work of a repeat: loaded, stored, operations, rays.
    fn worked(&self) -> impl Iterator<Item = (&str, f64, [f64; 4])> {
        self.kernels.iter().filter_map(|series| {
            let counts = self.counts.iter().find(|counts| counts.kernel == series.name)?;
            let seconds = series.median()?.value * 1e-3;
            let work = counts.each().map(|each| each * series.launches as f64);
            (seconds > 0.0).then_some((series.name.as_str(), seconds, work))
        })
    }
}
