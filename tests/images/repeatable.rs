//! The image is a function of scene, settings and samples alone.
#![allow(clippy::single_range_in_vec_init)] // lists of ranges, of which some hold one

use crate::{channel, device, scenes::standard};
use std::ops::ControlFlow;
use translucent::{Renderer, Scene, Settings, image::Image};

fn demo() -> Scene {
    Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/demo.gltf")).expect("the shipped scene loads")
}

fn settings() -> Settings {
    Settings { resolution: Some((60, 44)), seed: 7, ..standard() }
}

fn image(settings: &Settings, ranges: &[std::ops::Range<u32>]) -> Image {
    let device = device();
    let mut renderer = Renderer::new(&device, &demo(), settings).expect("the renderer is made");
    for range in ranges {
        let finished = renderer.render_range(range.clone(), &mut |_| ControlFlow::Continue(())).expect("renders");
        assert!(finished);
    }
    renderer.image().expect("the image is there")
}

fn assert_same(a: &Image, b: &Image, what: &str) {
    for channel in &a.channels {
        let other = b.channel(&channel.name).expect("the same channels");
        let same = channel.data.iter().zip(other).all(|(a, b)| a.to_bits() == b.to_bits());
        assert!(same, "{what}: channel {}", channel.name);
    }
}

#[test]
fn two_runs_bands_portions_and_workgroups_give_the_same_bits() {
    let whole = image(&settings(), &[3..27]);
    assert!(channel(&whole, "subsurface.R").iter().any(|x| *x > 0.0));
    assert_same(&whole, &image(&settings(), &[3..27]), "a second run");
    // One row, and some.
    for band_pixels in [1, 500] {
        let settings = Settings { band_pixels: Some(band_pixels), ..settings() };
        assert_same(&whole, &image(&settings, &[3..27]), &format!("bands of {band_pixels} pixels"));
    }
    assert_same(&whole, &image(&settings(), &[3..4, 4..20, 20..27]), "in portions");
    for workgroup in [1, 128] {
        let settings = Settings { workgroup, ..settings() };
        assert_same(&whole, &image(&settings, &[3..27]), &format!("workgroups of {workgroup}"));
    }
    // Tiles do not end at the edge of a band.
    let tiles = Settings { reuse: Some(8), ..settings() };
    let whole = image(&tiles, &[3..27]);
    assert_same(&whole, &image(&tiles, &[3..4, 4..20, 20..27]), "tiles in portions");
    assert_same(&whole, &image(&Settings { workgroup: 32, ..tiles.clone() }, &[3..27]), "tiles by other workgroups");
    for band_pixels in [1, 500, 900] {
        let settings = Settings { band_pixels: Some(band_pixels), ..tiles.clone() };
        assert_same(&whole, &image(&settings, &[3..27]), &format!("tiles in bands of {band_pixels} pixels"));
    }
}

#[test]
fn new_seed_is_a_new_render() {
    let device = device();
    let demo = demo();
    let mut renderer =
        Renderer::new(&device, &demo, &Settings { seed: 1, ..settings() }).expect("the renderer is made");
    renderer.render(5).expect("renders");
    renderer.reseed(settings().seed).expect("the seed is set");
    renderer.render(9).expect("renders");
    let reseeded = renderer.image().expect("the image is there");
    drop(renderer);
    drop(device);
    assert_same(&image(&settings(), &[0..9]), &reseeded, "another seed before");
}

#[test]
fn image_in_the_middle_changes_nothing() {
    let device = device();
    let mut renderer = Renderer::new(&device, &demo(), &settings()).expect("the renderer is made");
    renderer.render(10).expect("renders");
    renderer.image().expect("the image is there");
    renderer.render(10).expect("renders");
    let interrupted = renderer.image().expect("the image is there");
    drop(renderer);
    drop(device);
    assert_same(&image(&settings(), &[0..20]), &interrupted, "an image in between");
}

#[test]
fn crop_is_a_part_of_the_whole() {
    for reuse in [1, 4, 8] {
        crop_is_a_part(&Settings { reuse: Some(reuse), ..settings() });
    }
}

fn crop_is_a_part(settings: &Settings) {
    let whole = image(settings, &[0..8]);
    let [x0, y0, x1, y1] = [20, 10, 45, 33];
    let part = image(&Settings { crop: Some([x0, y0, x1, y1]), ..settings.clone() }, &[0..8]);
    assert_eq!((part.width, part.height, part.origin, part.full), (x1 - x0, y1 - y0, (x0, y0), (60, 44)));
    for name in ["R", "subsurface.G", "A", "P.Z", "variance.B"] {
        for y in y0..y1 {
            for x in x0..x1 {
                let inside = channel(&part, name)[((y - y0) * (x1 - x0) + x - x0) as usize];
                assert_eq!(inside.to_bits(), channel(&whole, name)[(y * 60 + x) as usize].to_bits(), "{name} {x},{y}");
            }
        }
    }
}

#[test]
fn stopped_render_leaves_every_pixel_with_samples() {
    let device = device();
    let settings = Settings { band_pixels: Some(600), ..settings() };
    let mut renderer = Renderer::new(&device, &demo(), &settings).expect("the renderer is made");
    let mut calls = 0;
    let finished = renderer
        .render_range(0..1000, &mut |_| {
            calls += 1;
            if calls > 1 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })
        .expect("renders");
    assert!(!finished);
    let image = renderer.image().expect("the image is there");
    assert!(channel(&image, "samples.Y").iter().all(|n| *n >= 1.0 && *n < 100.0));
    assert!(channel(&image, "A").contains(&1.0));
}

#[test]
fn fewer_samples_than_batches_have_no_variance() {
    let short = image(&settings(), &[0..7]);
    assert!(short.channel("variance.R").is_none() && short.attributes.contains_key("translucent.variance"));
    let enough = image(&settings(), &[0..8]);
    assert!(enough.channel("variance.R").is_some() && !enough.attributes.contains_key("translucent.variance"));
}
