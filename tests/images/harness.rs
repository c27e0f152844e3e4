//! Renders for tests, on a few devices under the validation layer.

use crate::pool::{self, Pool};
use std::sync::{MutexGuard, OnceLock};
use translucent::{Device, DeviceOptions, Renderer, Scene, Settings, image::Image};

/// The device of this test, for it alone as long as it is held.
pub fn device() -> MutexGuard<'static, Device> {
    static DEVICES: Pool<Device> = [const { OnceLock::new() }; 2];
    let options = DeviceOptions { validation: true, ..DeviceOptions::default() };
    pool::own(&DEVICES, || Device::open(&options).expect("a Vulkan device and the validation layer"))
}

/// Renders `samples` samples and checks that validation has nothing to say and no sample was invalid.
pub fn render(scene: &Scene, settings: &Settings, samples: u32) -> Image {
    let device = device();
    let mut renderer = Renderer::new(&device, scene, settings).expect("the renderer is made");
    renderer.render(samples).expect("the render finishes");
    let image = renderer.image().expect("the image is there");
    let messages = device.validation_messages();
    assert!(messages.is_empty(), "{messages:#?}");
    assert_eq!(image.attributes["translucent.invalidSamples"], translucent::image::Attribute::Integer(0));
    image
}

/// A channel that the image must have.
pub fn channel<'a>(image: &'a Image, name: &str) -> &'a [f32] {
    image.channel(name).unwrap_or_else(|| panic!("channel {name}"))
}

/// Mean and standard error of the mean of independent values.
pub fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}
