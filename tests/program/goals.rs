//! Renders that end by an error or a time.

use crate::{Folder, integer, stderr};
use std::time::{Duration, Instant};
use translucent::image::Attribute;

#[test]
fn an_error_ends_a_render_whose_pixels_get_what_they_need() {
    let folder = Folder::new("error");
    let summary = folder.done("render SPOT --resolution 32x32 --environment constant:1,1,1 --error 20% -o out.exr");
    assert!(summary.contains(", error "), "{summary}");
    let image = folder.image("out.exr");
    let Some(Attribute::Float(error)) = image.attributes.get("translucent.error") else { panic!("no estimate") };
    assert!(*error > 0.0 && *error <= 0.2, "{error}");
    assert_eq!(image.attributes["translucent.stop"], Attribute::Text("error".into()));
    let samples = image.channel("samples.Y").expect("contract");
    let most = samples.iter().copied().fold(0.0, f32::max);
    assert!(samples.iter().any(|&n| n < most), "all pixels have {most} samples");
    assert_eq!((integer(&image, "sampleBegin"), integer(&image, "sampleEnd")), (0, most as i32));

    let refused = folder.run("merge out.exr -o merged.exr");
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("different numbers of samples"), "{}", stderr(&refused));

    // Too few samples for the error: an image, and a warning that says which error it has.
    let output = folder.run("render SPOT --resolution 32x32 --error .001% --samples 64 -o few.exr");
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stderr(&output).contains("not 0.001 %"), "{}", stderr(&output));
    assert_eq!(integer(&folder.image("few.exr"), "samples"), 64);
    assert_eq!(folder.files(), ["few.exr", "out.exr"]);
}

#[test]
fn a_time_ends_a_render() {
    let folder = Folder::new("time");
    let start = Instant::now();
    folder.done("render SPOT --resolution 32x32 --time 3s -o out.exr");
    // No limit that a busy machine breaks: without an end it would take days.
    assert!(start.elapsed() < Duration::from_secs(60));
    let image = folder.image("out.exr");
    assert_eq!(image.attributes["translucent.stop"], Attribute::Text("time".into()));
    assert!(!image.attributes.contains_key("translucent.error"));
    let samples = integer(&image, "samples");
    assert!(image.channel("samples.Y").expect("contract").iter().all(|&n| n == samples as f32));
}
