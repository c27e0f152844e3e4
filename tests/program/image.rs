//! The library's images: what is written comes back, nothing half or not finite is written, parts merge as they must.

use crate::Folder;
use std::{fs, path::PathBuf};
use translucent::{
    Error, Image,
    image::{Attribute, Channel, check_writable},
};

fn channel(name: &str, data: &[f32]) -> Channel {
    Channel { name: name.into(), data: data.into() }
}

/// Three pixels of an image of 7 x 5.
fn three(channels: Vec<Channel>) -> Image {
    Image { width: 3, height: 1, origin: (2, 4), full: (7, 5), channels, attributes: Default::default() }
}

#[test]
fn what_is_written_comes_back() {
    let folder = Folder::new("round-trip");
    let mut image = three(vec![
        channel("A", &[0.0, 0.5, 1.0]),
        channel("P.X", &[-1e30, 1e-40, f32::MAX]),
        channel("R", &[0.1, 70_000.3, 1e-7]),
    ]);
    for (name, value) in [
        ("translucent.samples", Attribute::Integer(-3)),
        ("translucent.settings", Attribute::Text("{\"projection\":\"mis\"}".into())),
        ("translucent.device", Attribute::Text("Gerät".into())),
        ("translucent.seconds", Attribute::Float(0.1)),
        ("zzz", Attribute::Text(String::new())),
    ] {
        image.attributes.insert(name.into(), value);
    }
    image.write(folder.join("a.exr")).expect("writable");
    assert_eq!(folder.image("a.exr"), image);
    // Equal images, equal bytes; the order of channels in memory does not matter.
    image.channels.reverse();
    image.write(folder.join("b.exr")).expect("writable");
    let read = |name: &str| fs::read(folder.join(name)).expect("written");
    assert!(read("a.exr") == read("b.exr"));
    assert_eq!(folder.files(), ["a.exr", "b.exr"]);
}

#[test]
fn a_value_that_is_not_finite_is_refused_and_the_old_file_stays() {
    let folder = Folder::new("finite");
    let path = folder.join("a.exr");
    fs::write(&path, b"old").expect("writable");
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let image = three(["R", "G", "B", "A"].map(|name| channel(name, &[0.0, value, 0.0])).into());
        for error in [image.write(&path), image.write_png(&path, 0.0)] {
            let error = error.expect_err("it is not finite").to_string();
            assert!(error.contains("channel R") && error.contains("1,0") && error.contains("a.exr"), "{error}");
        }
    }
    let short = three(vec![channel("R", &[0.0])]);
    assert!(short.write(&path).is_err());
    assert!(three(vec![channel("R", &[0.0; 3])]).write_png(&path, 0.0).is_err());
    assert_eq!(fs::read(&path).expect("it is still there"), b"old");
    assert_eq!(folder.files(), ["a.exr"]);
}

#[test]
fn a_place_that_cannot_be_written_is_an_input_error() {
    let folder = Folder::new("places");
    fs::create_dir(folder.join("folder")).expect("writable");
    fs::write(folder.join("file"), b"").expect("writable");
    for path in ["nowhere/a.exr", "file/a.exr", "folder", "folder/.."] {
        let error = check_writable(folder.join(path)).expect_err("it cannot be written");
        assert!(error.is_input(), "{path}: {error}");
    }
    check_writable(folder.join("file")).expect("an old file can be replaced");
    check_writable(folder.join("folder/new.exr")).expect("a new one can be made");
    assert_eq!(folder.files(), ["file", "folder"]);
}

#[test]
fn files_that_are_no_images_are_errors() {
    let folder = Folder::new("not-images");
    let good = three(vec![channel("R", &[1.0, 2.0, 3.0])]);
    good.write(folder.join("good.exr")).expect("writable");
    let bytes = fs::read(folder.join("good.exr")).expect("written");
    // Cut short anywhere: an error, never a panic or an image.
    for length in 0..bytes.len() {
        fs::write(folder.join("cut.exr"), &bytes[..length]).expect("writable");
        assert!(matches!(Image::read(folder.join("cut.exr")), Err(Error::File { .. })), "{length} bytes");
    }
    assert!(matches!(Image::read(folder.join("none.exr")), Err(Error::File { .. })));
}

#[test]
fn the_png_is_srgb_with_straight_alpha() {
    let folder = Folder::new("srgb");
    let pixels = |image: &Image, exposure: f64| {
        image.write_png(folder.join("a.png"), exposure).expect("writable");
        ::image::open(folder.join("a.png")).expect("a PNG").into_rgba8().into_raw()
    };
    // IEC 61966-2-1: .5 is 188 (187.52), .18 is 118 (117.6), .002 is 7 (6.59, on the straight part).
    let image = three(vec![
        channel("R", &[0.5, 0.09, 0.0]),
        channel("G", &[0.18, 0.25, 0.0]),
        channel("B", &[0.002, 7.0, 0.0]),
        channel("A", &[1.0, 0.5, 0.0]),
    ]);
    assert_eq!(pixels(&image, 0.0), [188, 118, 7, 255, 118, 188, 255, 128, 0, 0, 0, 0]);
    // Two stops down: .125 is 99 (98.9), .045 is 60 (59.86), .0005 is 2 (1.65).
    assert_eq!(pixels(&image, -2.0)[..4], [99, 60, 2, 255]);
    // With the environment shown, an edge pixel is half surface and half background, and opaque as it is.
    let shown = three(vec![
        channel("R", &[0.5, 0.18, 0.5]),
        channel("G", &[0.5, 0.18, 0.5]),
        channel("B", &[0.5, 0.18, 0.5]),
        channel("A", &[1.0, 0.5, 0.0]),
    ]);
    assert_eq!(pixels(&shown, 0.0), [188, 188, 188, 255, 118, 118, 118, 255, 188, 188, 188, 255]);
}

/// A part with samples `begin..end`.
fn part(begin: i32, end: i32, channels: Vec<Channel>) -> (PathBuf, Image) {
    let mut image = three(channels);
    let integers = [("samples", end - begin), ("sampleBegin", begin), ("sampleEnd", end), ("invalidSamples", 1)];
    for (name, value) in integers {
        image.attributes.insert(format!("translucent.{name}"), Attribute::Integer(value));
    }
    image.attributes.insert("translucent.device".into(), Attribute::Text(format!("GPU {}", begin % 2)));
    (PathBuf::from(format!("{begin}.exr")), image)
}

#[test]
fn parts_are_weighted_by_their_samples() {
    let make = |begin, end, mean: f32, variance: f32| {
        let samples = channel("samples.Y", &[(end - begin) as f32; 3]);
        let layers = [channel("subsurface.G", &[mean; 3]), channel("variance.G", &[variance; 3]), samples];
        part(begin, end, [&layers[..], &[channel("Z", &[begin as f32; 3])]].concat())
    };
    // Weights 1/8, 3/8, 1/2 and values that make every sum exact.
    let parts = [make(5, 7, 8.0, 64.0), make(7, 13, 16.0, 128.0), make(13, 21, 2.0, 4.0)];
    for order in [[0, 1, 2], [2, 0, 1], [1, 2, 0]] {
        let image = Image::merge(order.map(|i| parts[i].clone()).into()).expect("they fit");
        let value = |name: &str| image.channel(name).expect("kept")[1];
        assert_eq!(value("subsurface.G"), 8.0 / 8.0 + 16.0 * 3.0 / 8.0 + 2.0 / 2.0);
        assert_eq!(value("variance.G"), 64.0 / 64.0 + 128.0 * 9.0 / 64.0 + 4.0 / 4.0);
        assert_eq!((value("samples.Y"), value("Z")), (16.0, 5.0));
        let attribute = |name: &str| image.attributes[&format!("translucent.{name}")].clone();
        assert_eq!(attribute("samples"), Attribute::Integer(16));
        assert_eq!(attribute("sampleBegin"), Attribute::Integer(5));
        assert_eq!(attribute("sampleEnd"), Attribute::Integer(21));
        assert_eq!(attribute("invalidSamples"), Attribute::Integer(3));
        assert_eq!(attribute("device"), Attribute::Text("GPU 1".into()));
    }
}

#[test]
fn variance_is_left_out_where_a_part_has_none() {
    let r = || channel("R", &[1.0; 3]);
    let with = part(0, 8, vec![r(), channel("variance.R", &[1.0; 3])]);
    let without = part(8, 9, vec![r()]);
    let image = Image::merge(vec![without, with]).expect("they fit");
    assert_eq!(image.channels, [r()]);
    assert!(matches!(&image.attributes["translucent.variance"], Attribute::Text(_)));
    assert_eq!(image.attributes["translucent.device"], Attribute::Text("GPU 0".into()));
}

#[test]
fn parts_of_nothing_are_refused() {
    let r = || vec![channel("R", &[1.0; 3])];
    assert!(Image::merge(vec![]).is_err());
    assert!(Image::merge(vec![part(3, 3, r())]).is_err());
    assert!(Image::merge(vec![("a.exr".into(), three(r()))]).is_err());
    assert!(Image::merge(vec![part(0, 1, vec![channel("odd.R", &[1.0; 3])])]).is_err());
    assert!(Image::merge(vec![part(0, 1, r()), part(1, 2, vec![channel("R", &[1.0])])]).is_err());
    assert!(Image::merge(vec![part(0, 1, r()), part(1, 2, r())]).is_ok());
}
