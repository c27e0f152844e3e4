//! What a benchmark found, and its JSON.

use super::{CONFIDENCE, Counts, Effort, Limits, Line, Rays, statistics};
use crate::{Error, Result, timeline::KernelTimes};
use serde_json::{Value, json};
use std::path::Path;

/// The form of the JSON. Members are only ever added to it; whatever else changes gets another number.
const SCHEMA: &str = "translucent.bench/1";

/// Everything about a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Version, device, driver, hash of the kernels: what may differ between runs that are compared.
    pub about: Value,
    /// Scene hash, settings, samples, pixels: what must not.
    pub work: Value,
    pub effort: Effort,
    /// Parts of the time before the first samples: name and milliseconds. `bvh` is a part of `load`.
    pub start_up: Vec<(String, f64)>,
    /// Wall time of rendering the samples and of making the image.
    pub host: Vec<Series>,
    /// Time on the device, none where it has no timestamps.
    pub kernels: Vec<Series>,
    /// What the driver tells of the compiled kernels, by name; null where it tells nothing.
    pub executables: Value,
    /// What the hardware counted, mean of a dispatch in the last repeat; null where it counted nothing.
    pub counters: Value,
    /// What each kernel did in a run that counted; empty where there was none.
    pub counts: Vec<Counts>,
    /// What the device gives at best, where that was measured.
    pub limits: Option<Limits>,
    /// Of all buffers.
    pub device_bytes: u64,
    /// Most memory that the process had, where the system tells. On a software driver that is the device's as well.
    pub peak_bytes: Option<u64>,
}

/// One time for each repeat.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    pub name: String,
    /// Dispatches of a repeat; 1 for the host's.
    pub launches: u64,
    /// Milliseconds.
    pub times: Vec<f64>,
    /// Shortest and longest dispatch of all repeats (ms); none for the host's, and in reports of older versions.
    pub extremes: Option<[f64; 2]>,
}

impl Series {
    /// The median time (ms) at [`CONFIDENCE`].
    pub fn median(&self) -> Option<statistics::Estimate> {
        statistics::median(&self.times, CONFIDENCE)
    }

    /// Mean of a dispatch, over all repeats (ms).
    pub fn mean(&self) -> f64 {
        self.times.iter().sum::<f64>() / (self.launches * self.times.len() as u64).max(1) as f64
    }

    fn json(&self) -> Value {
        let total: f64 = self.times.iter().sum();
        let mut value =
            json!({ "name": self.name, "launches": self.launches, "timesMs": self.times, "totalMs": total });
        if let Some([shortest, longest]) = self.extremes {
            value["dispatchMs"] = json!({ "mean": self.mean(), "min": shortest, "max": longest });
        }
        if let Some(median) = self.median() {
            value["medianMs"] = median.value.into();
            value["intervalMs"] = json!([median.low, median.high]);
            value["confidence"] = median.confidence.into();
        }
        value
    }

    fn from_json(value: &Value) -> Option<Series> {
        let times = value["timesMs"].as_array()?.iter();
        Some(Series {
            name: value["name"].as_str()?.to_string(),
            launches: value["launches"].as_u64()?,
            times: times.map(|time| time.as_f64().filter(|ms| *ms >= 0.0)).collect::<Option<_>>()?,
            extremes: [&value["dispatchMs"]["min"], &value["dispatchMs"]["max"]]
                .map(Value::as_f64)
                .into_iter()
                .collect::<Option<Vec<f64>>>()
                .and_then(|both| both.try_into().ok()),
        })
    }
}

impl Report {
    pub(super) fn new(about: Value, work: Value, effort: Effort) -> Report {
        Report {
            about,
            work,
            effort,
            start_up: vec![],
            host: vec![],
            kernels: vec![],
            executables: Value::Null,
            counters: Value::Null,
            counts: vec![],
            limits: None,
            device_bytes: 0,
            peak_bytes: None,
        }
    }

    pub(super) fn add_host(&mut self, name: &str, ms: f64) {
        add(&mut self.host, name, 1, ms);
    }

    pub(super) fn add_kernel(&mut self, times: &KernelTimes) {
        let series = add(&mut self.kernels, times.kernel, times.count, times.total * 1e-6);
        let [shortest, longest] = series.extremes.unwrap_or([f64::INFINITY, 0.0]);
        series.extremes = Some([shortest.min(times.min * 1e-6), longest.max(times.max * 1e-6)]);
    }

    /// Millions of pixel samples a second, by the median time of rendering.
    pub fn rate(&self) -> Option<statistics::Estimate> {
        let samples = self.work["pixels"].as_f64()? * self.work["samples"].as_f64()?;
        let median = self.host.iter().find(|series| series.name == "render")?.median()?;
        let rate = |ms: f64| samples / ms * 1e-3;
        Some(statistics::Estimate {
            value: rate(median.value),
            low: rate(median.high),
            high: rate(median.low),
            confidence: median.confidence,
        })
    }

    /// The whole as JSON.
    pub fn json(&self) -> Value {
        let series = |list: &[Series]| list.iter().map(Series::json).collect::<Vec<_>>();
        let rate = self.rate();
        json!({
            "schema": SCHEMA,
            "about": self.about,
            "work": self.work,
            "effort": {
                "samples": self.effort.samples, "warmup": self.effort.warmup, "repeat": self.effort.repeat,
            },
            "startUpMs": self.start_up.iter().map(|(name, ms)| (name.clone(), (*ms).into()))
                .collect::<serde_json::Map<_, _>>(),
            "host": series(&self.host),
            "kernels": series(&self.kernels),
            "executables": self.executables,
            "counters": self.counters,
            "counts": self.counts.iter().map(Counts::json).collect::<Vec<_>>(),
            "limits": self.limits.map(|limits| limits.json()),
            "roofline": self.roofline().iter().map(Line::json).collect::<Vec<_>>(),
            "rays": self.rays().iter().map(Rays::json).collect::<Vec<_>>(),
            "megasamplesPerSecond": rate.map(|rate| json!({
                "median": rate.value, "interval": [rate.low, rate.high], "confidence": rate.confidence,
            })),
            "memory": { "deviceBytes": self.device_bytes, "peakBytes": self.peak_bytes },
        })
    }

    /// Reads a file that [`Report::json`] fills.
    ///
    /// # Errors
    /// [`Error::File`] if it cannot be read or is something else.
    pub fn read(path: impl AsRef<Path>) -> Result<Report> {
        let path = path.as_ref();
        let bytes = std::fs::read(path).map_err(|error| Error::file(path, error))?;
        let value: Value = serde_json::from_slice(&bytes).map_err(|error| Error::file(path, error))?;
        if value["schema"] != SCHEMA {
            return Err(Error::file(path, format!("is no report of a benchmark: its schema is not {SCHEMA}")));
        }
        Report::from_json(&value).ok_or_else(|| Error::file(path, "is a report of a benchmark, but not a whole one"))
    }

    fn from_json(value: &Value) -> Option<Report> {
        let series =
            |name: &str| value[name].as_array()?.iter().map(Series::from_json).collect::<Option<Vec<Series>>>();
        let count = |name: &str| value["effort"][name].as_u64().and_then(|count| u32::try_from(count).ok());
        let start_up = value["startUpMs"].as_object()?.iter();
        Some(Report {
            about: value["about"].clone(),
            work: value["work"].clone(),
            effort: Effort { samples: count("samples")?, warmup: count("warmup")?, repeat: count("repeat")? },
            start_up: start_up.map(|(name, ms)| Some((name.clone(), ms.as_f64()?))).collect::<Option<_>>()?,
            host: series("host")?,
            kernels: series("kernels")?,
            executables: value["executables"].clone(),
            counters: value["counters"].clone(),
            // Older reports have none of these two.
            counts: value["counts"]
                .as_array()
                .map_or(Some(vec![]), |list| list.iter().map(Counts::from_json).collect())?,
            limits: Limits::from_json(&value["limits"]),
            device_bytes: value["memory"]["deviceBytes"].as_u64()?,
            peak_bytes: value["memory"]["peakBytes"].as_u64(),
        })
    }
}

fn add<'a>(list: &'a mut Vec<Series>, name: &str, launches: u64, ms: f64) -> &'a mut Series {
    let place = list.iter().position(|series| series.name == name).unwrap_or_else(|| {
        list.push(Series { name: name.into(), launches, times: vec![], extremes: None });
        list.len() - 1
    });
    list[place].times.push(ms);
    &mut list[place]
}
