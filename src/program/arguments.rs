//! The forms in which values stand on the command line.

use std::{ops::Range, time::Duration};
use translucent::{CameraChoice, scene::parse_unit};

/// Most samples of a pixel: attributes of EXR files are 32-bit integers.
pub const MAX_SAMPLES: u32 = i32::MAX as u32;

/// What an environment is made from.
#[derive(Clone, Debug, PartialEq)]
pub enum EnvironmentSource {
    Constant([f64; 3]),
    File(std::path::PathBuf),
}

/// `512x512`.
pub fn resolution(text: &str) -> Result<(u32, u32), String> {
    let parts = text.split_once(['x', 'X']).and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    parts.filter(|&(w, h)| w > 0 && h > 0).ok_or("it is WIDTHxHEIGHT, such as 1024x768".into())
}

/// Samples that are asked for.
#[derive(Clone, Debug)]
pub struct Samples {
    pub range: Range<u32>,
    /// They are a part of a larger render, to be merged.
    pub part: bool,
}

/// `64`, or `64:128` for samples 64 to 127.
pub fn samples(text: &str) -> Result<Samples, String> {
    let range = match text.split_once(':') {
        None => text.parse().ok().map(|end| 0..end),
        Some((begin, end)) => begin.parse().ok().zip(end.parse().ok()).map(|(begin, end)| begin..end),
    };
    range
        .filter(|range| range.start < range.end && range.end <= MAX_SAMPLES)
        .map(|range| Samples { range, part: text.contains(':') })
        .ok_or(format!("it is M or A:B, with 0 <= A < B <= {MAX_SAMPLES}"))
}

/// An index or a name.
pub fn camera(text: &str) -> Result<CameraChoice, String> {
    Ok(text.parse().map_or_else(|_| CameraChoice::Name(text.into()), CameraChoice::Index))
}

/// `constant:R,G,B` or a file.
pub fn environment(text: &str) -> Result<EnvironmentSource, String> {
    let Some(values) = text.strip_prefix("constant:") else { return Ok(EnvironmentSource::File(text.into())) };
    let values = list::<f64, 3>(values).filter(|values| values.iter().all(|v| v.is_finite() && *v >= 0.0));
    values.map(EnvironmentSource::Constant).ok_or("it is constant:R,G,B with three values >= 0, or a file".into())
}

/// `NAME=PRESET`.
pub fn material(text: &str) -> Result<(String, String), String> {
    // A material's name may hold an equals sign, a preset's does not.
    let parts = text.rsplit_once('=').filter(|(_, preset)| !preset.is_empty());
    parts.map(|(name, preset)| (name.into(), preset.into())).ok_or("it is NAME=PRESET, such as skin=skin1".into())
}

/// A length such as `cm` or `29.2mm` (m).
pub fn unit(text: &str) -> Result<f64, String> {
    parse_unit(text).map_err(|error| error.to_string())
}

/// `X0,Y0,X1,Y1`.
pub fn crop(text: &str) -> Result<[u32; 4], String> {
    let corners = list::<u32, 4>(text).filter(|[x0, y0, x1, y1]| x0 < x1 && y0 < y1);
    corners.ok_or("it is X0,Y0,X1,Y1 in pixels, X0 < X1 and Y0 < Y1".into())
}

/// A finite number.
pub fn finite(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|value: &f64| value.is_finite()).ok_or("it is a finite number".into())
}

/// A finite number of at least 0.
pub fn not_negative(text: &str) -> Result<f64, String> {
    finite(text).ok().filter(|value| *value >= 0.0).ok_or("it is a finite number of at least 0".into())
}

/// A finite number above 0.
pub fn positive(text: &str) -> Result<f64, String> {
    finite(text).ok().filter(|value| *value > 0.0).ok_or("it is a finite number above 0".into())
}

/// `1%`, or the share `0.01`; above 0.
pub fn share(text: &str) -> Result<f64, String> {
    let value = match text.strip_suffix('%') {
        Some(number) => positive(number.trim_end()).map(|number| number / 100.0),
        None => positive(text),
    };
    value.map_err(|_| "it is a share above 0, such as 1% or 0.01".into())
}

/// `30s`, `500ms`, `2min`, `1h`, or a number of seconds; above 0.
pub fn time(text: &str) -> Result<Duration, String> {
    let split = text.find(|c: char| c.is_ascii_alphabetic() && c != 'e' && c != 'E').unwrap_or(text.len());
    let (number, unit) = text.split_at(split);
    let seconds = match unit {
        "" | "s" => 1.0,
        "ms" => 1e-3,
        "min" => 60.0,
        "h" => 3600.0,
        _ => f64::NAN,
    };
    let time = positive(number.trim_end()).ok().and_then(|n| Duration::try_from_secs_f64(n * seconds).ok());
    time.filter(|time| !time.is_zero()).ok_or("it is a time above 0, such as 30s, 500ms, 2min or 1h".into())
}

/// `HOST:PORT`.
pub fn address(text: &str) -> Result<String, String> {
    let split = text.rsplit_once(':').filter(|(host, port)| !host.is_empty() && port.parse::<u16>().is_ok());
    split.map(|_| text.into()).ok_or("it is HOST:PORT, such as localhost:14158".into())
}

/// `R,G,B`, or one number for all.
pub fn triple(text: &str) -> Result<[f64; 3], String> {
    let one = finite(text).ok().map(|value| [value; 3]);
    let three = list::<f64, 3>(text).filter(|values| values.iter().all(|value| value.is_finite()));
    one.or(three).ok_or("it is R,G,B or one number for all".into())
}

fn list<T: std::str::FromStr, const N: usize>(text: &str) -> Option<[T; N]> {
    let values: Option<Vec<T>> = text.split(',').map(|value| value.trim().parse().ok()).collect();
    values?.try_into().ok()
}
