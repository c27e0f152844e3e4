//! The device's spans, summed up for each kernel.

use super::{Span, Track};
use std::collections::BTreeMap;

/// What a kernel took: nanoseconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KernelTimes {
    pub kernel: &'static str,
    /// How often it was dispatched.
    pub count: u64,
    pub total: f64,
    /// Of one dispatch.
    pub min: f64,
    /// Of one dispatch.
    pub max: f64,
    /// Of the time of all kernels, 0 to 1.
    pub share: f64,
}

impl KernelTimes {
    /// Mean of a dispatch (ns).
    pub fn mean(&self) -> f64 {
        self.total / self.count as f64
    }
}

pub(super) fn sums(spans: &[Span]) -> Vec<KernelTimes> {
    let mut sums: Vec<KernelTimes> = Vec::new();
    for span in spans.iter().filter(|span| span.track == Track::Device) {
        let time = span.end - span.begin;
        match sums.iter_mut().find(|sum| sum.kernel == span.name) {
            Some(sum) => {
                sum.count += 1;
                sum.total += time;
                sum.min = sum.min.min(time);
                sum.max = sum.max.max(time);
            }
            None => {
                sums.push(KernelTimes { kernel: span.name, count: 1, total: time, min: time, max: time, share: 0.0 })
            }
        }
    }
    let all: f64 = sums.iter().map(|sum| sum.total).sum();
    // A clock too coarse to see any of them leaves no shares.
    sums.iter_mut().for_each(|sum| sum.share = if all > 0.0 { sum.total / all } else { 0.0 });
    sums
}

/// Something that a device counted while it ran a kernel.
#[derive(Clone, Debug, PartialEq)]
pub struct Counted {
    pub kernel: &'static str,
    pub counter: String,
    /// Empty for a mere number.
    pub unit: &'static str,
    /// Of a dispatch.
    pub mean: f64,
}

/// Counters by kernel and name: unit, dispatches, sum.
#[derive(Default)]
pub(super) struct Sums(BTreeMap<(&'static str, String), (&'static str, u64, f64)>);

impl Sums {
    pub fn add<'a>(&mut self, kernel: &'static str, counters: impl Iterator<Item = (&'a str, &'static str, f64)>) {
        for (name, unit, value) in counters {
            let (_, count, sum) = self.0.entry((kernel, name.to_string())).or_insert((unit, 0, 0.0));
            *count += 1;
            *sum += value;
        }
    }

    pub fn means(&self) -> Vec<Counted> {
        let mean = |((kernel, counter), (unit, count, sum)): (&(&'static str, String), &(&'static str, u64, f64))| {
            Counted { kernel, counter: counter.clone(), unit, mean: sum / *count as f64 }
        };
        self.0.iter().map(mean).collect()
    }
}
