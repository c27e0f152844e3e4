//! FLIP: how much somebody sees who flips between two images. P. Andersson et al., Proc. ACM Comput. Graph. Interact.
//! Tech. 3, 2 (HPG 2020), with the constants of its authors' program, version 1.x; images of 8 bits as they are displayed.

use rayon::prelude::*;
use std::f64::consts::PI;

/// Pixels per degree of sight: .7 m from a display .7 m wide with 3840 pixels across.
const PIXELS_PER_DEGREE: f64 = 67.020_643_276_582_25;

/// Contrast sensitivity of the channels Y, Cx, Cz: sums of a sqrt(pi / b) exp(-pi^2 r^2 / b), r in degrees.
const SENSITIVITY: [&[[f64; 2]]; 3] = [&[[1.0, 0.0047]], &[[1.0, 0.0053]], &[[34.1, 0.04], [13.5, 0.025]]];

/// Largest b, which sets the filters' size.
const WIDEST: f64 = 0.04;

/// Exponents of the differences of colour and of features.
const COLOUR_EXPONENT: f64 = 0.7;
const FEATURE_EXPONENT: f64 = 0.5;

/// Where differences of colour bend, as a part of their largest; and what they are mapped to there.
const BEND: [f64; 2] = [0.4, 0.95];

/// Width of the eye's edge and point detectors (degrees).
const FEATURE_WIDTH: f64 = 0.082;

/// Linear Rec.709 to XYZ.
const XYZ: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

/// The difference at each pixel, 0 to 1, of two images of linear colours from 0 to 1, `width` pixels wide.
pub fn flip(image: &[[f64; 3]], reference: &[[f64; 3]], width: usize) -> Vec<f32> {
    let [colours, other_colours] = [image, reference].map(|pixels| seen(pixels, width));
    let [features, other_features] = [image, reference].map(|pixels| features(pixels, width));
    let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(hunt);
    let largest = hyab(green, blue).powf(COLOUR_EXPONENT);
    let bend = BEND[0] * largest;
    let difference = |i: usize| {
        let distance = hyab(colours[i], other_colours[i]).powf(COLOUR_EXPONENT);
        let colour = match distance < bend {
            true => BEND[1] / bend * distance,
            false => BEND[1] + (distance - bend) / (largest - bend) * (1.0 - BEND[1]),
        };
        let apart = |k: usize| (features[k][i] - other_features[k][i]).abs();
        let feature = (apart(0).max(apart(1)) / 2f64.sqrt()).powf(FEATURE_EXPONENT);
        colour.powf(1.0 - feature) as f32
    };
    (0..image.len()).into_par_iter().map(difference).collect()
}

/// L*a*b* of what the eye leaves of an image, less colourful where it is dark.
fn seen(pixels: &[[f64; 3]], width: usize) -> Vec<[f64; 3]> {
    let reach = (3.0 * (WIDEST / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
    let opponents: Vec<[f64; 3]> = pixels.iter().map(|&pixel| opponent(pixel)).collect();
    let filtered: [Vec<f64>; 3] = std::array::from_fn(|c| {
        let channel: Vec<f64> = opponents.iter().map(|pixel| pixel[c]).collect();
        let mut sum = vec![0.0; channel.len()];
        let mut weight = 0.0;
        for [a, b] in SENSITIVITY[c] {
            let kernel = kernel(reach, |x| (-PI * PI / b * (x / PIXELS_PER_DEGREE).powi(2)).exp());
            let scale = a * (PI / b).sqrt();
            weight += scale * kernel.iter().sum::<f64>().powi(2);
            let part = convolved(&channel, width, &kernel, &kernel);
            sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += scale * part);
        }
        sum.iter_mut().for_each(|sum| *sum /= weight);
        sum
    });
    (0..pixels.len()).map(|i| hunt(displayed([filtered[0][i], filtered[1][i], filtered[2][i]]))).collect()
}

/// Strength of edges and of points in the lightness of an image.
fn features(pixels: &[[f64; 3]], width: usize) -> [Vec<f64>; 2] {
    let deviation = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
    let reach = (3.0 * deviation).ceil() as i32;
    let bell = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
    let lightness: Vec<f64> = pixels.iter().map(|&pixel| (opponent(pixel)[0] + 16.0) / 116.0).collect();
    let mut across = kernel(reach, bell);
    let sum: f64 = across.iter().sum();
    across.iter_mut().for_each(|weight| *weight /= sum);
    let edge = kernel(reach, |x| -x * bell(x));
    let point = kernel(reach, |x| (x * x / (deviation * deviation) - 1.0) * bell(x));
    [edge, point].map(|mut along| {
        // Each sign of weights adds up to one.
        for sign in [1.0, -1.0] {
            let sum: f64 = along.iter().map(|weight| (sign * weight).max(0.0)).sum();
            along.iter_mut().filter(|weight| sign * **weight > 0.0).for_each(|weight| *weight /= sum);
        }
        let [x, y] = [(&along, &across), (&across, &along)].map(|(x, y)| convolved(&lightness, width, x, y));
        x.iter().zip(&y).map(|(x, y)| x.hypot(*y)).collect()
    })
}

fn kernel(reach: i32, weight: impl Fn(f64) -> f64) -> Vec<f64> {
    (-reach..=reach).map(|x| weight(x.into())).collect()
}

/// Weights `x` along rows, then `y` along columns; the outermost pixels go on for ever.
fn convolved(values: &[f64], width: usize, x: &[f64], y: &[f64]) -> Vec<f64> {
    let height = values.len() / width;
    let sum = |weights: &[f64], at: usize, size: usize, value: &dyn Fn(usize) -> f64| -> f64 {
        let place = |k: usize| (at + k).saturating_sub(weights.len() / 2).min(size - 1);
        weights.iter().enumerate().map(|(k, weight)| weight * value(place(k))).sum()
    };
    let pixels = || (0..values.len()).into_par_iter();
    let rows: Vec<f64> =
        pixels().map(|i| sum(x, i % width, width, &|column| values[i / width * width + column])).collect();
    pixels().map(|i| sum(y, i / width, height, &|row| rows[row * width + i % width])).collect()
}

/// XYZ relative to white.
fn relative_xyz(pixel: [f64; 3]) -> [f64; 3] {
    XYZ.map(|row| (0..3).map(|c| row[c] * pixel[c]).sum::<f64>() / row.iter().sum::<f64>())
}

/// YCxCz.
fn opponent(pixel: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = relative_xyz(pixel);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// The linear colour of YCxCz, as far as a display can show it.
fn displayed([luminance, cx, cz]: [f64; 3]) -> [f64; 3] {
    let y = (luminance + 16.0) / 116.0;
    let relative = [cx / 500.0 + y, y, y - cz / 200.0];
    let xyz: [f64; 3] = std::array::from_fn(|c| relative[c] * XYZ[c].iter().sum::<f64>());
    let inverse = glam::DMat3::from_cols_array_2d(&XYZ).transpose().inverse();
    (inverse * glam::DVec3::from(xyz)).clamp(glam::DVec3::ZERO, glam::DVec3::ONE).into()
}

/// L*a*b*, with a* and b* in proportion to L*.
fn hunt(pixel: [f64; 3]) -> [f64; 3] {
    const DELTA: f64 = 6.0 / 29.0;
    let root = |t: f64| if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
    let [x, y, z] = relative_xyz(pixel).map(root);
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}

/// Distance in lightness plus that in colour.
fn hyab(p: [f64; 3], q: [f64; 3]) -> f64 {
    (p[0] - q[0]).abs() + (p[1] - q[1]).hypot(p[2] - q[2])
}
