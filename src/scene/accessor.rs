//! Arrays of a glTF file: buffers, views and accessors, every range checked before a byte is read.

use super::json::Item;
use crate::Result;
use base64::Engine;
use glam::DVec3;
use std::borrow::Cow;
use std::io::Read;

/// Most elements of an accessor that no bytes back: a guard against files that ask for memory out of nothing.
const UNBACKED_LIMIT: usize = 1 << 24;

/// How to decode compressed geometry.
pub(super) const DECODE: &str = "decode the file first: `gltf-transform cp IN.glb OUT.glb`, or import it into Blender and \
    export it without compression";
/// Extensions that compress what a view holds.
const VIEW_COMPRESSIONS: &[&str] = &["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// The bytes of a file's buffers and the lists that point into them.
pub(super) struct Arrays<'a> {
    buffers: Vec<Cow<'a, [u8]>>,
    views: Vec<Item<'a>>,
    accessors: Vec<Item<'a>>,
}

/// Checked elements: `count` of them, `stride` bytes apart in `bytes`; zeros if there are no bytes.
struct Elements<'a> {
    bytes: Option<&'a [u8]>,
    count: usize,
    stride: usize,
    component: Component,
}

#[derive(Clone, Copy, PartialEq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn read(item: &Item) -> Result<Self> {
        Ok(match item.whole()? {
            5120 => Component::I8,
            5121 => Component::U8,
            5122 => Component::I16,
            5123 => Component::U16,
            5125 => Component::U32,
            5126 => Component::F32,
            other => return Err(item.error(format!("{other} is no component type"))),
        })
    }

    fn size(self) -> usize {
        match self {
            Component::I8 | Component::U8 => 1,
            Component::I16 | Component::U16 => 2,
            Component::U32 | Component::F32 => 4,
        }
    }

    /// The component at the start of `bytes`, which hold at least `size()`.
    fn value(self, bytes: &[u8], normalized: bool) -> f64 {
        let (value, largest) = match self {
            Component::I8 => (i8::from_le_bytes([bytes[0]]) as f64, i8::MAX as f64),
            Component::U8 => (bytes[0] as f64, u8::MAX as f64),
            Component::I16 => (i16::from_le_bytes([bytes[0], bytes[1]]) as f64, i16::MAX as f64),
            Component::U16 => (u16::from_le_bytes([bytes[0], bytes[1]]) as f64, u16::MAX as f64),
            Component::U32 => (u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as f64, u32::MAX as f64),
            Component::F32 => (f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as f64, 1.0),
        };
        if normalized && self != Component::F32 { (value / largest).max(-1.0) } else { value }
    }
}

impl<'a> Arrays<'a> {
    /// Reads the buffers: the container's own, `data:` URIs, and files beside the scene's.
    pub fn new(root: &Item<'a>, binary: Option<&'a [u8]>) -> Result<Self> {
        let mut buffers = Vec::new();
        for (index, item) in root.list("buffers")?.iter().enumerate() {
            let length = item.need("byteLength")?.whole()?;
            if item.get("uri")?.is_none() && compression(item)?.is_some() {
                // The place of decoded data, which whoever asks for them is told.
                buffers.push(Cow::Borrowed(&[][..]));
                continue;
            }
            let mut bytes = match item.get("uri")? {
                Some(uri) => Cow::Owned(fetch(&uri, length)?),
                None if index == 0 && binary.is_some() => Cow::Borrowed(binary.unwrap_or_default()),
                None => return Err(item.error("has no `uri`, and the file holds no binary chunk for it")),
            };
            if bytes.len() < length {
                return Err(item.error(format!("byteLength is {length}, but there are {} bytes", bytes.len())));
            }
            match &mut bytes {
                Cow::Owned(bytes) => bytes.truncate(length),
                Cow::Borrowed(bytes) => *bytes = &bytes[..length],
            }
            buffers.push(bytes);
        }
        Ok(Arrays { buffers, views: root.list("bufferViews")?, accessors: root.list("accessors")? })
    }

    /// The elements of an accessor of `N` components of any type, named `kind`.
    pub fn numbers<const N: usize>(&self, reference: &Item, kind: &str) -> Result<Vec<[f64; N]>> {
        let item = self.accessor(reference, kind)?;
        let normalized = item.get("normalized")?.map_or(Ok(false), |flag| flag.boolean())?;
        self.collect(&item, N, [0.0; N], |bytes, component| {
            std::array::from_fn(|i| component.value(&bytes[i * component.size()..], normalized))
        })
    }

    /// The vectors of a VEC3 accessor, of any component type.
    pub fn vectors(&self, reference: &Item) -> Result<Vec<DVec3>> {
        Ok(self.numbers(reference, "VEC3")?.into_iter().map(DVec3::from_array).collect())
    }

    /// The extension that compresses what an accessor points at, if one does.
    pub fn compression(&self, reference: &Item) -> Result<Option<&'static str>> {
        let accessor = &self.accessors[reference.index(self.accessors.len(), "accessors")?];
        let Some(view) = accessor.get("bufferView")? else { return Ok(None) };
        compression(&self.views[view.index(self.views.len(), "bufferViews")?])
    }

    /// The bytes of a view.
    pub fn view(&self, reference: &Item) -> Result<&[u8]> {
        let view = &self.views[reference.index(self.views.len(), "bufferViews")?];
        if let Some(extension) = compression(view)? {
            return Err(view.error(format!("is compressed ({extension}), which is not supported: {DECODE}")));
        }
        let bytes = &self.buffers[view.need("buffer")?.index(self.buffers.len(), "buffers")?];
        let offset = view.get("byteOffset")?.map_or(Ok(0), |offset| offset.whole())?;
        let length = view.need("byteLength")?.whole()?;
        offset
            .checked_add(length)
            .and_then(|end| bytes.get(offset..end))
            .ok_or_else(|| view.error(format!("bytes {offset} + {length} reach beyond the buffer's {}", bytes.len())))
    }

    /// The numbers of a SCALAR accessor of unsigned integers.
    pub fn indices(&self, reference: &Item) -> Result<Vec<u32>> {
        let item = self.accessor(reference, "SCALAR")?;
        let component = item.need("componentType")?;
        if !matches!(Component::read(&component)?, Component::U8 | Component::U16 | Component::U32) {
            return Err(component.error("indices must be unsigned integers"));
        }
        self.collect(&item, 1, 0, |bytes, component| component.value(bytes, false) as u32)
    }

    fn accessor(&self, reference: &Item, kind: &str) -> Result<Item<'a>> {
        let item = self.accessors[reference.index(self.accessors.len(), "accessors")?].clone();
        let found = item.need("type")?;
        if found.string()? != kind {
            return Err(found.error(format!("must be {kind} for {}", reference.path)));
        }
        Ok(item)
    }

    fn collect<T: Clone>(
        &self,
        item: &Item<'a>,
        components: usize,
        zero: T,
        value: impl Fn(&[u8], Component) -> T,
    ) -> Result<Vec<T>> {
        let component = Component::read(&item.need("componentType")?)?;
        let count = item.need("count")?.whole()?;
        let elements = self.elements(item, component, count, components)?;
        let mut values = match elements.bytes {
            None => vec![zero; count],
            Some(_) => elements.iter().map(|bytes| value(bytes, component)).collect(),
        };
        if let Some(sparse) = item.get("sparse")? {
            let count = sparse.need("count")?.whole()?;
            let indices = sparse.need("indices")?;
            let kind = Component::read(&indices.need("componentType")?)?;
            let places = self.elements(&backed(indices)?, kind, count, 1)?;
            let replacements = self.elements(&backed(sparse.need("values")?)?, component, count, components)?;
            for (place, bytes) in places.iter().zip(replacements.iter()) {
                let place = kind.value(place, false);
                let length = values.len();
                let target = if place >= 0.0 { values.get_mut(place as usize) } else { None };
                *target.ok_or_else(|| sparse.error(format!("index {place} in an accessor of {length}")))? =
                    value(bytes, component);
            }
        }
        Ok(values)
    }

    /// The bytes that `item` (an accessor, or a part of a sparse one) points at.
    fn elements(&self, item: &Item<'a>, component: Component, count: usize, components: usize) -> Result<Elements<'_>> {
        let size = component.size() * components;
        let Some(reference) = item.get("bufferView")? else {
            if count > UNBACKED_LIMIT {
                return Err(item.error(format!("{count} elements without a bufferView")));
            }
            return Ok(Elements { bytes: None, count, stride: size, component });
        };
        let view = &self.views[reference.index(self.views.len(), "bufferViews")?];
        let bytes = self.view(&reference)?;
        let length = bytes.len();
        let stride = view.get("byteStride")?.map_or(Ok(size), |stride| stride.whole())?;
        if stride < size {
            return Err(view.error(format!("byteStride is {stride}, less than an element's {size} bytes")));
        }
        let start = item.get("byteOffset")?.map_or(Ok(0), |offset| offset.whole())?;
        let needed = count.saturating_sub(1).checked_mul(stride).and_then(|last| last.checked_add(size));
        let end = needed.and_then(|needed| start.checked_add(if count == 0 { 0 } else { needed }));
        let bytes = end.and_then(|end| bytes.get(start..end)).ok_or_else(|| {
            item.error(format!(
                "{count} elements {stride} bytes apart from byte {start} on reach beyond the view's {length} bytes"
            ))
        })?;
        Ok(Elements { bytes: Some(bytes), count, stride, component })
    }
}

impl Elements<'_> {
    /// The bytes of each element.
    fn iter(&self) -> impl Iterator<Item = &[u8]> {
        let bytes = self.bytes.unwrap_or_default();
        debug_assert!(self.bytes.is_some() && self.component.size() <= self.stride);
        (0..self.count).map(move |index| &bytes[index * self.stride..])
    }
}

/// The extension that compresses a view or stands for a buffer of decoded data, if one does.
fn compression(item: &Item) -> Result<Option<&'static str>> {
    for name in VIEW_COMPRESSIONS {
        if item.extension(name)?.is_some() {
            return Ok(Some(name));
        }
    }
    Ok(None)
}

/// A part of a sparse accessor, which must name its view.
fn backed<'a>(item: Item<'a>) -> Result<Item<'a>> {
    item.need("bufferView")?;
    Ok(item)
}

/// The bytes behind a buffer's URI, `length` at most.
pub(super) fn fetch(uri: &Item, length: usize) -> Result<Vec<u8>> {
    let text = uri.string()?;
    if let Some(data) = text.strip_prefix("data:") {
        let (_, encoded) =
            data.split_once(";base64,").ok_or_else(|| uri.error("is a data URI, but not one in base64"))?;
        return base64::engine::general_purpose::STANDARD
            .decode(encoded)
            .map_err(|error| uri.error(format!("its base64 is broken: {error}")));
    }
    let decoded = percent_decoded(text).ok_or_else(|| uri.error("its percent encoding is broken"))?;
    let relative = std::path::Path::new(&decoded);
    if relative.is_absolute() || decoded.contains("://") {
        return Err(uri.error("only `data:` URIs and paths relative to the scene's file are read"));
    }
    let path = uri.file.parent().unwrap_or(std::path::Path::new("")).join(relative);
    let failed = |problem: String| uri.error(format!("{}: {problem}", path.display()));
    // Anything but a regular file might never end.
    if !std::fs::metadata(&path).map_err(|error| failed(error.to_string()))?.is_file() {
        return Err(failed("is not a regular file".to_string()));
    }
    let mut bytes = Vec::new();
    let file = std::fs::File::open(&path).map_err(|error| failed(error.to_string()))?;
    file.take(length as u64).read_to_end(&mut bytes).map_err(|error| failed(error.to_string()))?;
    Ok(bytes)
}

fn percent_decoded(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&first, tail)) = rest.split_first() {
        rest = tail;
        if first == b'%' {
            let digits = std::str::from_utf8(rest.get(..2)?).ok()?;
            bytes.push(u8::from_str_radix(digits, 16).ok()?);
            rest = &rest[2..];
        } else {
            bytes.push(first);
        }
    }
    String::from_utf8(bytes).ok()
}
