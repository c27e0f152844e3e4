//! Differences of images, against numbers by hand and NVIDIA's own implementation.

use std::collections::BTreeMap;
use translucent::{Error, Image, image::Channel};

/// An image whose colours are `colour(x, y, c)`.
fn image(width: u32, height: u32, colour: impl Fn(u32, u32, u32) -> f64) -> Image {
    let data = |c| (0..width * height).map(|i| colour(i % width, i / width, c) as f32).collect();
    let channels = ["R", "G", "B"].iter().zip(0..).map(|(name, c)| Channel { name: (*name).into(), data: data(c) });
    let channels = channels.collect();
    Image { width, height, origin: (0, 0), full: (width, height), channels, attributes: BTreeMap::new() }
}

#[test]
fn the_relative_error_is_that_of_numbers_by_hand() {
    // Two pixels: (1, 2, 3) and (0, 0, 0), of mean 1; deviations .5, 0, 1 and .1, 0, .3.
    let reference = image(2, 1, |x, _, c| if x == 0 { f64::from(c + 1) } else { 0.0 });
    let other = image(2, 1, |x, _, c| match x {
        0 => [1.5, 2.0, 2.0][c as usize],
        _ => [0.1, 0.0, 0.3][c as usize],
    });
    let difference = other.relative_mse(&reference).expect("of one size");
    let pixels = [(0.25 / 1.01 + 1.0 / 9.01) / 3.0, (0.01 + 0.09) / 0.01 / 3.0];
    assert!((difference.mean - (pixels[0] + pixels[1]) / 2.0).abs() < 1e-6, "{difference:?}");
    for (value, expected) in difference.map.iter().zip(pixels) {
        assert!((f64::from(*value) - expected).abs() < 1e-6, "{difference:?}");
    }
    // It does not depend on the unit of light.
    let scaled = |image: &Image| {
        let channels = image.channels.iter().map(|channel| Channel {
            name: channel.name.clone(),
            data: channel.data.iter().map(|value| 1024.0 * value).collect(),
        });
        Image { channels: channels.collect(), ..image.clone() }
    };
    assert_eq!(scaled(&other).relative_mse(&scaled(&reference)).expect("of one size"), difference);
    assert_eq!(other.relative_mse(&other).expect("of one size").mean, 0.0);
}

/// Computed by flip_evaluator 1.7 from PyPI, NVIDIA's own, of the same bytes; in f32, whose sums over 21 x 21
/// pixels have some 1e-5 of roundings.
#[test]
fn flip_is_that_of_its_authors() {
    let colour = |k: u32| {
        move |x: u32, y: u32, c: u32| f64::from((x * (3 + c) + y * (5 - c) + (x * y * 7 * k) % 23 * k) % 64) / 64.0
    };
    let near = |value: f64, expected: f64| assert!((value - expected).abs() < 2e-5, "{value}, not {expected}");
    let reference = image(40, 32, colour(0));
    let other = image(40, 32, colour(1)).flip(&reference, 0.0).expect("of one size");
    near(other.mean, 0.5449963808);
    for (x, y, expected) in [(0, 0, 0.2509986), (20, 15, 0.5273243), (39, 31, 0.6212947)] {
        near(f64::from(other.map[y * 40 + x]), expected);
    }
    let darker = image(40, 32, |x, y, c| 0.9 * colour(0)(x, y, c));
    near(darker.flip(&reference, 0.0).expect("of one size").mean, 0.1953289062);
    // Exposure scales both: twice half of the light is the light.
    let half = |image: &Image| {
        let channels = image.channels.iter().map(|channel| Channel {
            name: channel.name.clone(),
            data: channel.data.iter().map(|value| 0.5 * value).collect(),
        });
        Image { channels: channels.collect(), ..image.clone() }
    };
    let flip = |image: &Image, reference: &Image, exposure| image.flip(reference, exposure).expect("of one size");
    assert_eq!(flip(&half(&darker), &half(&reference), 1.0), flip(&darker, &reference, 0.0));
    assert_eq!(reference.flip(&reference, 0.0).expect("of one size").mean, 0.0);
}

#[test]
fn what_cannot_be_compared_is_refused_by_name() {
    let grey = |width, height| image(width, height, |_, _, _| 0.5);
    let refused = |result: translucent::Result<_>, expected: &str| match result {
        Err(error @ Error::Setting { .. }) => assert!(error.to_string().contains(expected), "{error}"),
        other => panic!("{other:?}"),
    };
    refused(grey(4, 4).relative_mse(&grey(4, 5)), "4x5");
    refused(grey(4, 4).flip(&grey(5, 4), 0.0), "5x4");
    refused(grey(4, 4).flip(&Image { origin: (1, 0), ..grey(4, 4) }, 0.0), "from 1,0");
    refused(grey(4, 4).relative_mse(&image(4, 4, |_, _, _| 0.0)), "black");
    let mut colourless = grey(4, 4);
    colourless.channels.pop();
    refused(colourless.flip(&grey(4, 4), 0.0), "channel B");
}
