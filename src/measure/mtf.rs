//! The modulation transfer of a plane, behind a grating.
//!
//! A grating of opaque bars, half of each period open, lets collimated light through to the irradiance
//!
//!   E(x) = E0 [1/2 + sum over odd m of 2 / (pi m) sin(pi m / 2) cos(m k x)],  k = 2 pi / period.
//!
//! Matter whose exitance under cos(k x) is M(k) cos(k x) therefore shows the mean E0 M(0) / 2 and the harmonics
//! E0 2 / (pi m) sin(pi m / 2) M(m k): a period of the image gives M at k, 3 k, ... .

use super::{
    Axis, CHANNELS, Figure, Matter, Panel, Point, Series, Setup, channel,
    figure::geometric,
    scene,
    scenes::{Eye, Mesh, gltf, sun},
};
use crate::{error::Result, image::Image, settings::Settings};
use glam::DVec3;
use serde_json::json;
use std::f64::consts::{PI, TAU};

/// Pixels: one period wide.
const SIZE: (u32, u32) = (64, 16);
/// Wave numbers over sigma_t' of the green channel, whose gratings are made.
const GRATINGS: [f64; 5] = [0.03, 0.1, 0.3, 1.0, 2.0];
/// Harmonics that are read.
const HARMONICS: [u32; 2] = [1, 3];

/// M(k).
pub fn mtf(setup: &Setup) -> Result<Figure> {
    let path = setup.matters[0].mean_free_path().y;
    let (mut series, mut notes) = (vec![], vec![]);
    for matter in setup.matters {
        let channels = setup.channels(matter);
        let mut points = vec![vec![]; channels.len()];
        for relative in GRATINGS {
            let image = image(setup, matter, TAU * path / relative)?;
            for ((c, _), points) in channels.iter().zip(&mut points) {
                points.extend(harmonics(matter, *c, &image, relative / path));
            }
        }
        for ((c, name), mut points) in channels.into_iter().zip(points) {
            points.sort_by(|a, b| a.x.total_cmp(&b.x));
            let range = geometric(0.5 * GRATINGS[0] / path, 8.0 / path, 200);
            let curve = range.into_iter().map(|k| (k, matter.profile(c).mtf(k))).collect();
            series.push(Series { name, points, curve }.up_to_where_known(matter));
        }
        notes.push(format!("{}: the body ends where {:.1e} of the light lies beyond", matter.model, matter.lost()));
    }
    let panel = Panel {
        name: "mtf".into(),
        x: Axis::logarithmic("wave number k [mm\u{207b}\u{b9}]"),
        y: Axis::logarithmic("M(k)"),
        series,
    };
    Ok(Figure { title: setup.title("Modulation transfer"), panels: vec![panel], notes })
}

/// One period of a plane behind a grating, seen from below the bars.
fn image(setup: &Setup, matter: &Matter, period: f64) -> Result<Image> {
    // The body reaches at least one period beyond what is seen.
    let half = matter.reach().max(period);
    let mut body = Mesh::default();
    body.cuboid(DVec3::new(-half, -half, -half), DVec3::new(half, half, 0.0), 1);
    let mut bars = Mesh::default();
    let count = (half / period).ceil() as i32 + 1;
    for bar in -count..count {
        // Open about x = 0; a bar lies between a quarter and three quarters of each period.
        let left = (f64::from(bar) + 0.25) * period;
        bars.quad(DVec3::new(left, -1.1 * half, 2.0 * period), DVec3::X * period / 2.0, DVec3::Y * 2.2 * half);
    }
    let light = (sun(), DVec3::Z * 4.0 * period, DVec3::ZERO);
    let lens = -period / 2.0 * f64::from(SIZE.1) / f64::from(SIZE.0);
    let eye = Eye { eye: DVec3::Z * period, at: DVec3::ZERO, lens };
    let opaque = json!({"name": "bars"});
    let scene = scene(&gltf(&[(body, 0), (bars, 1)], &[matter.material.clone(), opaque], &[light], &eye))?;
    setup.render(
        matter,
        &scene,
        Settings { resolution: Some(SIZE), reuse: Some(1), ..Settings::default() },
        setup.samples(1024),
    )
}

/// M at k and its harmonics.
fn harmonics(matter: &Matter, c: usize, image: &Image, k: f64) -> Vec<Point> {
    let light = channel(image, &format!("subsurface.{}", CHANNELS[c]));
    let variance = channel(image, &format!("variance.{}", CHANNELS[c]));
    // Collimated light of E0 = pi enters with Ft(1).
    let unit = PI * matter.transmittance(1.0) * matter.leaving();
    let point = |m: u32| {
        let (amplitude, error) = harmonic(&light, &variance, m);
        let order = f64::from(m);
        let irradiance = 2.0 / (PI * order) * (PI * order / 2.0).sin();
        let factor = 1.0 / (unit * irradiance * sinc(PI * order / f64::from(SIZE.0)));
        let expected = matter.profile(c).mtf(order * k);
        Point { x: order * k, measured: amplitude * factor, error: (error * factor).abs(), expected }
    };
    HARMONICS.map(point).into()
}

/// Amplitude of cos(m k x) over one period of columns, and its standard error from the pixels' variances.
fn harmonic(light: &[f64], variance: &[f64], m: u32) -> (f64, f64) {
    let pixels = light.len() as f64;
    let wave = |i: usize| {
        let x = ((i as u32 % SIZE.0) as f64 + 0.5) / f64::from(SIZE.0) - 0.5;
        2.0 / pixels * (TAU * f64::from(m) * x).cos()
    };
    let amplitude = light.iter().enumerate().map(|(i, value)| wave(i) * value).sum();
    let squared: f64 = variance.iter().enumerate().map(|(i, value)| wave(i) * wave(i) * value).sum();
    (amplitude, squared.sqrt())
}

/// What a pixel of its width leaves of a wave.
fn sinc(x: f64) -> f64 {
    x.sin() / x
}
