//! Pictures of textures: bytes from a view, a `data:` URI or a file beside the scene, decoded within limits.

use super::accessor::{Arrays, fetch};
use super::json::Item;
use super::{Picture, texture};
use crate::Result;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use std::borrow::Cow;
use std::io::Cursor;

/// Longest side of a picture, and most texels (8192 x 8192).
const SIDE_MAX: u32 = 32_768;
const TEXELS_MAX: u64 = 1 << 26;
/// Most texels of a scene: their places must fit into 32 bits.
pub(super) const SCENE_TEXELS_MAX: usize = 1 << 31;
/// Most bytes of a file.
const FILE_MAX: usize = 1 << 30;
/// Most bytes that a decoder may allocate beside the texels.
const DECODER_MAX: u64 = 1 << 30;

/// Reads `images[index]`. Depths of 16 bits are rounded to 8; colour profiles are ignored, as glTF has it.
pub(super) fn read(item: &Item, arrays: &Arrays) -> Result<Picture> {
    let bytes = match (item.get("uri")?, item.get("bufferView")?) {
        (Some(uri), _) => Cow::Owned(fetch(&uri, FILE_MAX)?),
        (None, Some(view)) => Cow::Borrowed(arrays.view(&view)?),
        (None, None) => return Err(item.error("has neither `uri` nor `bufferView`")),
    };
    let format = match image::guess_format(&bytes) {
        Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg)) => format,
        _ => return Err(item.error(texture::other_picture(&bytes))),
    };
    let broken = |error: image::ImageError| {
        let text: String = error.to_string().chars().map(|c| if c.is_control() { ' ' } else { c }).take(200).collect();
        item.error(format!("cannot be decoded: {text}"))
    };
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(SIDE_MAX), Some(SIDE_MAX));
    limits.max_alloc = Some(DECODER_MAX);
    let mut reader = ImageReader::with_format(Cursor::new(&bytes[..]), format);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(broken)?;
    let (width, height) = decoder.dimensions();
    if width == 0 || height == 0 || u64::from(width) * u64::from(height) > TEXELS_MAX {
        return Err(item.error(format!("is {width}x{height}; 1 to {TEXELS_MAX} texels are read")));
    }
    // Eight texels a byte, and no more than 1,032 bytes of one: what deflate can do at best.
    if format == ImageFormat::Png && u64::from(width) * u64::from(height) > 8 * 1032 * bytes.len() as u64 {
        return Err(item.error(format!("cannot be decoded: {} bytes cannot hold {width}x{height} texels", bytes.len())));
    }
    let decoded = DynamicImage::from_decoder(decoder).map_err(broken)?.into_rgba8();
    let texels = decoded.pixels().map(|pixel| u32::from_le_bytes(pixel.0)).collect();
    Ok(Picture { width, height, texels })
}
