//! Puts the parts of a larger render together.

use super::{Attribute, Channel, Image};
use crate::{Error, Result};
use std::{
    ops::Range,
    path::{Path, PathBuf},
};

/// What must be the same in all parts, and what it means when it is not.
const IDENTITY: [(&str, &str); 5] = [
    ("translucent.sceneHash", "is of another scene"),
    ("translucent.settings", "was rendered with other settings"),
    ("translucent.seed", "was rendered with another seed"),
    ("translucent.spirvHash", "was rendered by other kernels"),
    ("translucent.version", "was rendered by another version"),
];

struct Part {
    file: PathBuf,
    image: Image,
    range: Range<i32>,
}

pub fn merge(parts: Vec<(PathBuf, Image)>) -> Result<Image> {
    let mut parts = parts
        .into_iter()
        .map(|(file, image)| Ok(Part { range: range(&file, &image)?, file, image }))
        .collect::<Result<Vec<_>>>()?;
    parts.sort_by_key(|part| (part.range.start, part.range.end));
    for pair in parts.windows(2) {
        follows(&pair[0], &pair[1])?;
    }
    let Some(first) = parts.first() else { return Err(Error::setting("merge", "needs at least one part")) };
    for part in &parts[1..] {
        same(first, part)?;
    }
    let has_variance = parts.iter().all(|part| part.image.channels.iter().any(|c| layer(c) == "variance"));
    let total = f64::from(parts.iter().map(|part| part.range.end - part.range.start).sum::<i32>());
    let weights: Vec<f64> = parts.iter().map(|part| f64::from(part.range.end - part.range.start) / total).collect();

    let mut merged = Image { channels: Vec::new(), ..first.image.clone() };
    let kept = first.image.channels.iter().filter(|channel| has_variance || layer(channel) != "variance");
    for channel in kept {
        let sources: Vec<&[f32]> = parts.iter().filter_map(|part| part.image.channel(&channel.name)).collect();
        let combine = |weight: fn(f64) -> f64| {
            let sum = |i| sources.iter().zip(&weights).map(|(data, &w)| weight(w) * f64::from(data[i])).sum::<f64>();
            (0..channel.data.len()).map(|i| sum(i) as f32).collect()
        };
        let data = match layer(channel) {
            "R" | "G" | "B" | "A" | "subsurface" | "reflection" => combine(|w| w),
            "variance" => combine(|w| w * w),
            "samples" => combine(|_| 1.0),
            "N" | "P" | "Z" | "material" => channel.data.clone(),
            _ => return Err(Error::file(&first.file, format!("channel {} cannot be merged", channel.name))),
        };
        merged.channels.push(Channel { name: channel.name.clone(), data });
    }
    describe(&mut merged, &parts);
    if !has_variance {
        let why = Attribute::Text("absent: a part has none".into());
        merged.attributes.insert("translucent.variance".into(), why);
    }
    Ok(merged)
}

/// `subsurface` of `subsurface.R`, `R` of `R`.
fn layer(channel: &Channel) -> &str {
    channel.name.split('.').next().unwrap_or_default()
}

fn integer(image: &Image, name: &str) -> Option<i32> {
    match image.attributes.get(name) {
        Some(Attribute::Integer(value)) => Some(*value),
        _ => None,
    }
}

/// The samples in a part, which must be at least one, and the same of all pixels.
fn range(file: &Path, image: &Image) -> Result<Range<i32>> {
    let bound = |name: &str| {
        let missing = || Error::file(file, format!("has no attribute {name}: not a render of translucent"));
        integer(image, name).ok_or_else(missing)
    };
    let range = bound("translucent.sampleBegin")?..bound("translucent.sampleEnd")?;
    if range.is_empty() || range.start < 0 {
        return Err(Error::file(file, format!("holds samples {}:{}", range.start, range.end)));
    }
    if image.attributes.contains_key("translucent.adaptive") {
        return Err(Error::file(file, "its pixels have different numbers of samples: parts need the same of all"));
    }
    let count = image.width as usize * image.height as usize;
    match image.channels.iter().find(|channel| channel.data.len() != count) {
        Some(channel) => Err(Error::file(file, format!("channel {} has another size than the image", channel.name))),
        None => Ok(range),
    }
}

fn follows(before: &Part, after: &Part) -> Result<()> {
    let (end, start) = (before.range.end, after.range.start);
    let name = before.file.display();
    if start < end {
        let problem = format!("overlaps {name}: both hold samples {start}:{}", end.min(after.range.end));
        return Err(Error::file(&after.file, problem));
    }
    if start > end {
        return Err(Error::file(&after.file, format!("samples {end}:{start} are missing between it and {name}")));
    }
    Ok(())
}

fn same(first: &Part, part: &Part) -> Result<()> {
    let fail = |problem: &str| Err(Error::file(&part.file, format!("{problem} than {}", first.file.display())));
    let (a, b) = (&first.image, &part.image);
    for (name, problem) in IDENTITY {
        if a.attributes.get(name) != b.attributes.get(name) {
            return fail(problem);
        }
    }
    if (a.width, a.height, a.origin, a.full) != (b.width, b.height, b.origin, b.full) {
        return fail("shows another part of the image or has another resolution");
    }
    let names = |image: &Image| {
        let mut names: Vec<_> =
            image.channels.iter().filter(|c| layer(c) != "variance").map(|c| c.name.clone()).collect();
        names.sort();
        names
    };
    if names(a) != names(b) { fail("has other channels") } else { Ok(()) }
}

/// Sums up the attributes: the range is the union, texts that differ (devices) are listed, other values that differ go.
fn describe(merged: &mut Image, parts: &[Part]) {
    let images = || parts.iter().map(|part| &part.image);
    let names: Vec<String> = merged.attributes.keys().cloned().collect();
    for name in names {
        let mut values: Vec<&Attribute> = images().filter_map(|image| image.attributes.get(&name)).collect();
        values.dedup();
        if values.len() == 1 {
            continue;
        }
        let mut texts: Vec<&str> = Vec::new();
        for value in &values {
            match value {
                Attribute::Text(text) if !texts.contains(&text.as_str()) => texts.push(text),
                _ => {}
            }
        }
        if texts.is_empty() {
            merged.attributes.remove(&name);
        } else {
            merged.attributes.insert(name, Attribute::Text(texts.join("; ")));
        }
    }
    let begin = parts.first().map_or(0, |part| part.range.start);
    let end = parts.last().map_or(0, |part| part.range.end);
    let invalid =
        images().filter_map(|image| integer(image, "translucent.invalidSamples")).fold(0i32, i32::saturating_add);
    for (name, value) in
        [("samples", end - begin), ("sampleBegin", begin), ("sampleEnd", end), ("invalidSamples", invalid)]
    {
        merged.attributes.insert(format!("translucent.{name}"), Attribute::Integer(value));
    }
}
