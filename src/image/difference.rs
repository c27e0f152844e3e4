//! How far an image is from a reference.

use super::{Image, flip, png};
use crate::{Error, Result, reference::texture::decode};

/// A difference: its mean over all pixels, and that of each, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    pub mean: f64,
    pub map: Vec<f32>,
}

/// Share of the squared mean of the reference that is added below the fraction, so that dark pixels count little.
pub const FLOOR: f64 = 0.01;

pub fn relative_mse(image: &Image, reference: &Image) -> Result<Difference> {
    let [x, y] = colours(image, reference)?;
    let count = y[0].len();
    let mean = y.iter().flat_map(|channel| channel.iter()).map(|&value| f64::from(value)).sum::<f64>();
    let floor = FLOOR * (mean / (3 * count) as f64).powi(2);
    if floor <= 0.0 {
        return Err(Error::setting("reference", "is black: no error is relative to it"));
    }
    let squares = |i: usize| {
        let square = |c: usize| {
            let (value, expected) = (f64::from(x[c][i]), f64::from(y[c][i]));
            (value - expected).powi(2) / (expected * expected + floor)
        };
        (0..3).map(square).sum::<f64>() / 3.0
    };
    let squares: Vec<f64> = (0..count).map(squares).collect();
    let mean = squares.iter().sum::<f64>() / count as f64;
    Ok(Difference { mean, map: squares.into_iter().map(|square| square as f32).collect() })
}

pub fn flip(image: &Image, reference: &Image, exposure: f64) -> Result<Difference> {
    let displayed = |channels| -> Vec<[f64; 3]> {
        bytes(channels, exposure).chunks_exact(3).map(|rgb| [0, 1, 2].map(|c| decode(rgb[c]))).collect()
    };
    let [shown, expected] = colours(image, reference)?.map(displayed);
    let map = flip::flip(&shown, &expected, image.width as usize);
    Ok(Difference { mean: map.iter().map(|&value| f64::from(value)).sum::<f64>() / map.len() as f64, map })
}

pub fn encoded(image: &Image, exposure: f64) -> Result<Vec<u8>> {
    Ok(bytes(three(image)?, exposure))
}

fn bytes(channels: [&[f32]; 3], exposure: f64) -> Vec<u8> {
    (0..channels[0].len()).flat_map(|i| channels.map(|channel| png::encode(channel[i], exposure))).collect()
}

/// R, G and B of both, which show the same pixels.
fn colours<'a>(image: &'a Image, reference: &'a Image) -> Result<[[&'a [f32]; 3]; 2]> {
    let place = |image: &Image| [image.width, image.height, image.origin.0, image.origin.1, image.full.0, image.full.1];
    let [a, b] = [place(image), place(reference)];
    if a != b {
        let named =
            |[w, h, x, y, full_w, full_h]: [u32; 6]| format!("{w}x{h} pixels from {x},{y} of {full_w}x{full_h}");
        return Err(Error::setting("reference", format!("shows {}, the image {}", named(b), named(a))));
    }
    Ok([three(image)?, three(reference)?])
}

fn three(image: &Image) -> Result<[&[f32]; 3]> {
    let count = image.width as usize * image.height as usize;
    let channel = |name: &str| {
        let found = image.channel(name).filter(|data| data.len() == count && count > 0);
        found.ok_or_else(|| Error::setting("image", format!("channel {name} is missing, or has another size")))
    };
    Ok([channel("R")?, channel("G")?, channel("B")?])
}
