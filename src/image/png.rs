//! PNG: 8 bit, sRGB, straight alpha.

use super::Image;
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use std::{fs::File, io::BufWriter};

/// R, G, B and A of every pixel, 0 to 255.
pub fn pixels(image: &Image, exposure: f64) -> Result<Vec<u8>, String> {
    let channel = |name: &str| image.channel(name).ok_or_else(|| format!("channel {name} is missing"));
    let [r, g, b, a] = [channel("R")?, channel("G")?, channel("B")?, channel("A")?];
    let gain = exposure.exp2();
    let opaque = (0..a.len()).any(|i| a[i] == 0.0 && (r[i] > 0.0 || g[i] > 0.0 || b[i] > 0.0));
    let mut bytes = Vec::with_capacity(4 * a.len());
    for i in 0..a.len() {
        let alpha = if opaque { 1.0 } else { f64::from(a[i]).clamp(0.0, 1.0) };
        let scale = if alpha > 0.0 { gain / alpha } else { 0.0 };
        bytes.extend([r[i], g[i], b[i]].map(|value| byte(srgb(f64::from(value) * scale))));
        bytes.push(byte(alpha));
    }
    Ok(bytes)
}

/// A value times 2^`exposure` through the sRGB transfer function, in 8 bits.
pub fn encode(value: f32, exposure: f64) -> u8 {
    byte(srgb(f64::from(value) * exposure.exp2()))
}

/// IEC 61966-2-1: linear to encoded, both 0 to 1.
fn srgb(linear: f64) -> f64 {
    let linear = linear.clamp(0.0, 1.0);
    if linear <= 0.0031308 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

fn byte(value: f64) -> u8 {
    (255.0 * value).round() as u8
}

pub fn write(image: &Image, pixels: &[u8], file: &File) -> Result<(), String> {
    let mut buffered = BufWriter::new(file);
    PngEncoder::new(&mut buffered)
        .write_image(pixels, image.width, image.height, ExtendedColorType::Rgba8)
        .map_err(|error| error.to_string())?;
    buffered.into_inner().map(|_| ()).map_err(|error| error.to_string())
}
