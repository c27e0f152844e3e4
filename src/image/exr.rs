//! EXR: one part, f32, ZIP, with the channels' literal names.

use super::{Attribute, Channel, Image};
use crate::{Error, Result};
use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Blocks, Compression, Encoding, FlatSamples, Image as Content,
    ImageAttributes, IntegerBounds, Layer, LayerAttributes, LineOrder, ReadChannels, ReadLayers, Text, Vec2,
    WritableImage, attribute::Chromaticities, read as reader,
};
use exr::{
    block::lines::LineRefMut,
    image::write::samples::{SamplesWriter, WritableSamples},
    math::RoundingMode,
    meta::{
        attribute::{LevelMode, SampleType},
        header::Header,
    },
};
use std::{
    collections::BTreeMap,
    fs::File,
    io::{Read, Seek, SeekFrom, Write},
    path::Path,
};

/// A channel's values as the exr crate takes them, not copied: images can fill most of the memory.
struct Values<'a>(&'a [f32]);

struct ValuesWriter<'a> {
    values: &'a [f32],
    width: usize,
}

impl<'a> WritableSamples<'a> for Values<'_> {
    type Writer = ValuesWriter<'a>;

    fn sample_type(&self) -> SampleType {
        SampleType::F32
    }

    fn infer_level_modes(&self) -> (LevelMode, RoundingMode) {
        (LevelMode::Singular, RoundingMode::Down)
    }

    fn create_samples_writer(&'a self, header: &Header) -> ValuesWriter<'a> {
        ValuesWriter { values: self.0, width: header.layer_size.width() }
    }
}

impl SamplesWriter for ValuesWriter<'_> {
    fn extract_line(&self, line: LineRefMut<'_>) {
        let start = line.location.position.y() * self.width + line.location.position.x();
        let values = &self.values[start..start + line.location.sample_count];
        line.write_samples_from_slice(values).expect("the line's memory has the line's size");
    }
}

/// Rec. ITU-R BT.709, white D65.
const REC709: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.30, 0.60),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.3290),
};

/// Most bytes of a header that [`sort_attributes`] looks at; ours take some thousand.
const HEADER_BYTES: u64 = 1 << 20;

pub fn write(image: &Image, mut file: &File) -> std::result::Result<(), String> {
    let channels = image.channels.iter().map(|channel| {
        let name = text(&channel.name)?;
        Ok(AnyChannel::new(name, Values(&channel.data)))
    });
    let channels = AnyChannels::sort(channels.collect::<std::result::Result<_, String>>()?);
    let mut attributes = LayerAttributes {
        layer_position: Vec2(coordinate(image.origin.0)?, coordinate(image.origin.1)?),
        software_name: Some(text(&format!("translucent {}", env!("CARGO_PKG_VERSION")))?),
        ..Default::default()
    };
    for (name, value) in &image.attributes {
        let value = match value {
            Attribute::Text(value) => AttributeValue::Text(text(value)?),
            Attribute::Integer(value) => AttributeValue::I32(*value),
            Attribute::Float(value) => AttributeValue::F64(*value),
        };
        attributes.other.insert(text(name)?, value);
    }
    // One order of lines, so that equal images give equal files.
    let encoding =
        Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let size = (image.width as usize, image.height as usize);
    let layer = Layer::new(size, attributes, encoding, channels);
    let full = IntegerBounds::from_dimensions((image.full.0 as usize, image.full.1 as usize));
    let attributes = ImageAttributes { chromaticities: Some(REC709), ..ImageAttributes::new(full) };
    let content = Content::empty(attributes).with_layer(layer);
    content.write().to_unbuffered(&mut file).map_err(|error| error.to_string())?;
    sort_attributes(file).map_err(|error| error.to_string())
}

/// Text of an attribute. EXR files written by this crate hold Latin-1; anything else becomes a question mark.
fn text(value: &str) -> std::result::Result<Text, String> {
    let value: String = value.chars().map(|c| if (c as u32) < 256 { c } else { '?' }).collect();
    Text::new_or_none(&value).ok_or_else(|| format!("{value:?} cannot be stored"))
}

fn coordinate(value: u32) -> std::result::Result<i32, String> {
    i32::try_from(value).map_err(|_| format!("coordinate {value} is beyond what EXR files hold"))
}

/// Sorts the attributes of the header by name, in place. The exr crate writes them in the order of a hash map, which
/// differs from run to run; their total length, and so every offset, stays.
fn sort_attributes(mut file: &File) -> std::io::Result<()> {
    // Magic number and version.
    const START: usize = 8;
    file.seek(SeekFrom::Start(0))?;
    let mut bytes = Vec::new();
    file.take(HEADER_BYTES).read_to_end(&mut bytes)?;
    let mut records = Vec::new();
    let mut at = START;
    // An attribute is name, 0, type, 0, length, value; an empty name ends the header.
    while bytes.get(at).is_some_and(|&byte| byte != 0) {
        let Some(end) = attribute_end(&bytes, at) else { return Ok(()) };
        records.push(bytes[at..end].to_vec());
        at = end;
    }
    records.sort();
    file.seek(SeekFrom::Start(START as u64))?;
    file.write_all(&records.concat())
}

/// Where the attribute that starts at `start` ends, if `bytes` hold it whole.
fn attribute_end(bytes: &[u8], start: usize) -> Option<usize> {
    let after_text = |at: usize| Some(at + bytes.get(at..)?.iter().position(|&byte| byte == 0)? + 1);
    let length = after_text(after_text(start)?)?;
    let value = length + 4;
    let size = u32::from_le_bytes(bytes.get(length..value)?.try_into().ok()?);
    let end = value.checked_add(size as usize)?;
    (end <= bytes.len()).then_some(end)
}

pub fn read(path: &Path) -> Result<Image> {
    let fail = |problem: String| Error::file(path, problem);
    let file = File::open(path).map_err(|error| fail(error.to_string()))?;
    let content = reader()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(std::io::BufReader::new(file))
        .map_err(|error| fail(format!("not a readable EXR file: {error}")))?;
    let layer = content.layer_data;
    let window = content.attributes.display_window;
    let corner = |data: i32, display: i32| u32::try_from(i64::from(data) - i64::from(display)).ok();
    let origin = corner(layer.attributes.layer_position.x(), window.position.x())
        .zip(corner(layer.attributes.layer_position.y(), window.position.y()))
        .ok_or_else(|| fail("the data window begins outside the display window".into()))?;
    let size = |value: usize| u32::try_from(value).map_err(|_| fail(format!("{value} pixels are too many")));
    let mut channels = Vec::new();
    for channel in layer.channel_data.list {
        if channel.sampling != Vec2(1, 1) {
            return Err(fail(format!("channel {} is subsampled", channel.name)));
        }
        let data = match channel.sample_data {
            FlatSamples::F32(data) => data,
            other => other.values_as_f32().collect(),
        };
        channels.push(Channel { name: channel.name.to_string(), data });
    }
    let mut attributes = BTreeMap::new();
    for (name, value) in content.attributes.other.iter().chain(&layer.attributes.other) {
        let value = match value {
            AttributeValue::Text(value) => Attribute::Text(value.to_string()),
            AttributeValue::I32(value) => Attribute::Integer(*value),
            AttributeValue::F32(value) => Attribute::Float(f64::from(*value)),
            AttributeValue::F64(value) => Attribute::Float(*value),
            _ => continue,
        };
        attributes.insert(name.to_string(), value);
    }
    Ok(Image {
        width: size(layer.size.width())?,
        height: size(layer.size.height())?,
        origin,
        full: (size(window.size.width())?, size(window.size.height())?),
        channels,
        attributes,
    })
}
