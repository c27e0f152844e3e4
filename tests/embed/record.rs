//! Recordings into a caller's command buffer against `render` on a device of our own.

use super::app::App;
use glam::{DVec3, Vec4};
use translucent::{
    Device, Environment, Image, Model, Renderer, Scene, Settings,
    ash::vk,
    gpu::{Buffer, Location, RawDevice, Timestamps, download},
    shared::{Pixel, Progress, Slot},
};

pub const SIZE: u32 = 8;

pub fn settings() -> Settings {
    Settings { seed: 7, resolution: Some((SIZE, SIZE)), model: Model::Standard, recording: true, ..Settings::default() }
}

pub fn scene() -> Scene {
    let mut scene = Scene::load("assets/spot.glb").expect("the asset");
    scene.set_environment(Environment::constant(DVec3::ONE).expect("a radiance")).expect("an environment");
    scene
}

/// The image of `samples` by a device of our own, without recordings.
fn rendered(scene: &Scene, samples: std::ops::Range<u32>) -> Image {
    let device = Device::open(&Default::default()).expect("a device");
    let settings = Settings { recording: false, ..settings() };
    let mut renderer = Renderer::new(&device, scene, &settings).expect("a renderer");
    renderer.render_range(samples, &mut |_| std::ops::ControlFlow::Continue(())).expect("a render");
    renderer.image().expect("an image")
}

/// Fails unless both have the same channels, bit for bit.
#[track_caller]
pub fn same(one: &Image, two: &Image) {
    for (a, b) in one.channels.iter().zip(&two.channels) {
        assert!(a.name == b.name && a.data == b.data, "channel {}", a.name);
    }
    assert_eq!(one.channels.len(), two.channels.len());
}

pub fn record(app: &App, renderer: &Renderer, samples: std::ops::Range<u32>) -> vk::CommandBuffer {
    app.commands(|commands| unsafe { renderer.record(commands, samples).expect("it can be recorded") })
}

#[test]
fn a_recording_is_the_render_however_often_and_however_cut() {
    let app = App::new();
    let device = app.open();
    let scene = scene();
    let mut renderer = Renderer::new(&device, &scene, &settings()).expect("a renderer");
    let expected = rendered(&scene, 0..40);
    let whole = record(&app, &renderer, 0..40);
    app.submit(&[whole]);
    assert_eq!(renderer.samples(), 0..40);
    same(&renderer.image().expect("an image"), &expected);
    // Again, and twice in one submission: nothing is counted twice.
    app.submit(&[whole, whole]);
    same(&renderer.image().expect("an image"), &expected);
    // In parts, which cut strata and batches.
    let parts = [0..3, 3..35, 35..40].map(|part| record(&app, &renderer, part));
    app.submit(&parts);
    same(&renderer.image().expect("an image"), &expected);
    // A part that does not follow starts anew.
    app.submit(&[parts[2], parts[1]]);
    assert_eq!(renderer.samples(), 3..35);
    same(&renderer.image().expect("an image"), &rendered(&scene, 3..35));
    // One recording whose samples are numbered by a word on the device.
    let four = record(&app, &renderer, 0..4);
    for first in (0..40).step_by(4) {
        renderer.set_first_sample(first).expect("it records");
        app.submit(&[four]);
    }
    assert_eq!(renderer.samples(), 0..40);
    same(&renderer.image().expect("an image"), &expected);
    // Rendering goes on where recordings stopped, and the other way round.
    renderer.set_first_sample(0).expect("it records");
    app.submit(&parts[..1]);
    renderer.render(32).expect("a render");
    app.submit(&parts[2..]);
    same(&renderer.image().expect("an image"), &expected);
    drop((renderer, device));
    app.close();
}

/// The four f32 of each pixel.
fn colors(device: &Device, renderer: &Renderer) -> Vec<Vec4> {
    let bytes = u64::from(SIZE * SIZE) * 16;
    let buffer = unsafe { Buffer::of_caller(device, renderer.output().expect("it records").colors, bytes) };
    bytemuck::pod_collect_to_vec(&download(device, &buffer, bytes).expect("a queue"))
}

#[test]
fn colours_are_those_of_the_image_in_a_buffer_an_image_and_the_callers_memory() {
    let app = App::new();
    let device = app.open_with_create_info();
    let scene = scene();
    let bytes = u64::from(SIZE * SIZE) * 16;
    // Rows of an image in the caller's own memory, where the device can reach it.
    let pages = super::device::Pages::new(4096);
    let start = std::ptr::NonNull::new(pages.start()).expect("memory");
    let imported = unsafe { Buffer::import_host(&device, "my image", start, 4096) };
    let given: Vec<_> = imported.into_iter().map(|buffer| (Slot::Colors, buffer)).collect();
    let in_place = !given.is_empty();
    let mut renderer = Renderer::with_buffers(&device, &scene, &settings(), given).expect("a renderer");
    let output = renderer.output().expect("it records");
    assert_eq!((output.width, output.height), (SIZE, SIZE));

    let image = app.image(SIZE, SIZE);
    let back = Buffer::new(&device, "back", bytes, Location::Readback).expect("memory");
    app.run(|commands| unsafe {
        renderer.record(commands, 0..8).expect("it can be recorded");
        app.to_layout(commands, image.0, vk::ImageLayout::UNDEFINED, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
        renderer.record_copy(commands, image.0, vk::ImageLayout::TRANSFER_DST_OPTIMAL).expect("it can be recorded");
        app.to_layout(commands, image.0, vk::ImageLayout::TRANSFER_DST_OPTIMAL, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
        app.read_image(commands, image.0, back.raw(), SIZE, SIZE);
    });
    let file = renderer.image().expect("an image");
    let channels = ["R", "G", "B", "A"].map(|name| file.channel(name).expect("every image has it"));
    let expected: Vec<Vec4> =
        (0..(SIZE * SIZE) as usize).map(|i| Vec4::from_array(channels.map(|channel| channel[i]))).collect();
    assert!(expected.iter().any(|color| color.w == 1.0 && color.x > 0.1));
    assert_eq!(colors(&device, &renderer), expected);
    assert_eq!(back.read::<Vec4>(), expected);
    if in_place {
        let seen = unsafe { std::slice::from_raw_parts(pages.start().cast::<Vec4>(), expected.len()) };
        assert_eq!(seen, expected);
    } else {
        println!("in the caller's memory: skipped, the device has no VK_EXT_external_memory_host");
    }
    app.destroy_image(image);
    drop((back, renderer, device));
    app.close();
}

#[test]
fn camera_lights_and_matter_change_in_place() {
    let app = App::new();
    let device = app.open();
    let mut scene = Scene::load("assets/spot.glb").expect("the asset");
    scene.lights.push(translucent::scene::Light {
        name: "sun".into(),
        position: DVec3::ZERO,
        direction: DVec3::NEG_Z,
        intensity: DVec3::ONE,
        kind: translucent::scene::LightKind::Directional,
        range: None,
    });
    let mut renderer = Renderer::new(&device, &scene, &settings()).expect("a renderer");
    let commands = record(&app, &renderer, 0..8);
    app.submit(&[commands]);
    let before = renderer.image().expect("an image");
    same(&before, &rendered(&scene, 0..8));

    // The same recording, another picture: that of a renderer made for it.
    let mut other = scene.clone();
    let mut camera = scene.camera(&Default::default(), 1.0).expect("every scene has one");
    camera.eye += 0.02 * camera.right;
    other.cameras = vec![camera.clone()];
    other.lights[0].direction = DVec3::new(0.6, 0.0, -0.8);
    other.lights[0].intensity = DVec3::new(1.0, 2.0, 3.0);
    let (index, material) = scene
        .materials
        .iter()
        .enumerate()
        .find(|(_, material)| material.medium.is_some())
        .expect("spot is translucent");
    let mut material = material.clone();
    material.medium.as_mut().expect("found by it").sigma_a *= 3.0;
    other.materials[index] = material.clone();
    renderer.set_camera(&camera).expect("a camera");
    renderer.set_lights(&other.lights).expect("as many");
    renderer.set_material(index, &material).expect("the same kind");
    assert_eq!(renderer.samples(), 0..0);
    app.submit(&[commands]);
    let after = renderer.image().expect("an image");
    same(&after, &rendered(&other, 0..8));
    assert!(after.channel("R") != before.channel("R"));

    // What would need other kernels or buffers is refused, and changes nothing.
    let refused = [
        renderer.set_lights(&[]),
        renderer.set_lights(&[translucent::scene::Light { intensity: DVec3::splat(-1.0), ..other.lights[0].clone() }]),
        renderer.set_camera(&translucent::scene::Camera { right: DVec3::ZERO, ..camera.clone() }),
        renderer.set_material(99, &material),
        renderer.set_material(index, &translucent::scene::Material { medium: None, ..material.clone() }),
        renderer.set_material(index, &translucent::scene::Material { emission: DVec3::ONE, ..material.clone() }),
        renderer.set_material(index, &translucent::scene::Material { ior: f64::NAN, ..material.clone() }),
    ];
    assert!(refused.iter().all(|result| result.as_ref().is_err_and(|error| error.is_input())), "{refused:?}");
    assert_eq!(renderer.samples(), 0..8);
    drop((renderer, device));
    app.close();
}

#[test]
fn times_of_every_dispatch_are_at_their_slots() {
    let app = App::new();
    let device = app.open();
    let renderer = Renderer::new(&device, &scene(), &settings()).expect("a renderer");
    let names = renderer.timestamp_layout(4..6).expect("it records");
    assert_eq!(names[..3], ["begin", "count", "primary"]);
    assert_eq!(names.last(), Some(&"resolve"));
    assert_eq!(names.iter().filter(|name| **name == "sample").count(), 2);
    const FIRST: u32 = 3;
    let queries = 2 * names.len() as u32;
    let pool = app.timestamps(FIRST + queries + 1);
    app.run(|commands| unsafe {
        renderer.record_timed(commands, 4..6, Timestamps { pool, first: FIRST }).expect("it can be recorded");
    });
    let mut ticks = vec![0u64; queries as usize];
    unsafe { app.device.get_query_pool_results(pool, FIRST, &mut ticks, vk::QueryResultFlags::TYPE_64) }
        .expect("every query was written");
    assert!(ticks.is_sorted() && ticks[0] > 0 && ticks[0] < ticks[ticks.len() - 1], "{ticks:?}");
    unsafe { app.device.destroy_query_pool(pool, None) };
    drop((renderer, device));
    app.close();
}

#[test]
fn renderers_stand_side_by_side_in_one_recording_and_on_threads() {
    let app = App::new();
    let device = app.open();
    let scene = scene();
    let seeds = [7, 8];
    let mut renderers = std::thread::scope(|scope| {
        let make = |seed| {
            let settings = Settings { seed, ..settings() };
            let (device, scene) = (&device, &scene);
            scope.spawn(move || Renderer::new(device, scene, &settings).expect("a renderer"))
        };
        seeds.map(make).map(|thread| thread.join().expect("no panic"))
    });
    app.run(|commands| unsafe {
        renderers[0].record(commands, 0..4).expect("it can be recorded");
        renderers[1].record(commands, 0..8).expect("it can be recorded");
        renderers[0].record(commands, 4..8).expect("it can be recorded");
    });
    let images = renderers.each_mut().map(|renderer| renderer.image().expect("an image"));
    same(&images[0], &rendered(&scene, 0..8));
    assert!(images[0].channel("R") != images[1].channel("R"));
    drop((renderers, device));
    app.close();
}

#[test]
fn what_cannot_be_recorded_is_an_error() {
    let app = App::new();
    let device = app.open();
    let scene = scene();
    let renderer = Renderer::new(&device, &scene, &settings()).expect("a renderer");
    for range in [3..3, 0..4097] {
        let error = renderer.timestamp_layout(range).expect_err("too few or too many");
        assert!(error.is_input(), "{error}");
    }
    let plain = Settings { recording: false, ..settings() };
    let plain = Renderer::new(&device, &scene, &plain).expect("a renderer");
    app.run(|commands| {
        let error = unsafe { plain.record(commands, 0..1) }.expect_err("it was not made for it");
        assert!(error.to_string().contains("recording"), "{error}");
    });
    for slot in [Slot::Progresses, Slot::Colors, Slot::Emitters] {
        let small = Buffer::new(&device, "small", 8, Location::Device).expect("memory");
        let error = Renderer::with_buffers(&device, &scene, &settings(), vec![(slot, small)]).err();
        assert!(error.is_some_and(|error| error.is_input() && error.to_string().contains(slot.name())));
    }
    drop((renderer, plain, device));
    app.close();
}

#[test]
fn geometry_in_the_callers_buffers_on_a_device_without_a_queue_is_the_same_image() {
    let app = App::new();
    let device = unsafe { Device::from_raw(RawDevice { queue: None, ..app.raw() }) }.expect("the device is fit");
    let scene = scene();
    let given = [Slot::Nodes, Slot::Triangles, Slot::Shadings].map(|slot| {
        let bytes = match slot {
            Slot::Nodes => size_of_val(&scene.nodes[..]),
            Slot::Triangles => size_of_val(&scene.triangles[..]),
            _ => size_of_val(&scene.shadings[..]),
        };
        (slot, Buffer::new(&device, "mine", bytes as u64, Location::Upload).expect("memory"))
    });
    let mut renderer = Renderer::with_buffers(&device, &scene, &settings(), given.into()).expect("a renderer");
    let back = Buffer::new(&device, "back", u64::from(SIZE * SIZE) * 48, Location::Readback).expect("memory");
    let counts = Buffer::new(&device, "counts", 16, Location::Readback).expect("memory");
    app.run(|commands| unsafe {
        renderer.record(commands, 2..11).expect("it can be recorded");
        let output = renderer.output().expect("it records");
        let copy = |from, to: &Buffer| {
            app.device.cmd_copy_buffer(commands, from, to.raw(), &[vk::BufferCopy::default().size(to.bytes())]);
        };
        copy(output.pixels, &back);
        copy(output.progress, &counts);
        app.for_the_host(commands);
    });
    assert_eq!(counts.read::<Progress>(), [Progress { first: 0, begin: 2, end: 11, restart: 1 }]);
    let expected = rendered(&scene, 2..11);
    let pixels = back.read::<Pixel>();
    let greens: Vec<f32> = pixels.iter().map(|pixel| pixel.subsurface.y).collect();
    assert_eq!(expected.channel("subsurface.G"), Some(&greens[..]));
    let variances: Vec<f32> = pixels.iter().map(|pixel| pixel.variance.x).collect();
    assert_eq!(expected.channel("variance.R"), Some(&variances[..]));
    let error = renderer.render(1).expect_err("there is no queue");
    assert!(error.to_string().contains("without a queue"), "{error}");
    drop((renderer, back, counts, device));
    app.close();
}
