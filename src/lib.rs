//! translucent renders translucent matter in glTF scenes with raw Vulkan compute.

pub mod error;
pub mod gpu;
pub mod image;
pub mod prepare;
pub mod reference;
pub mod render;
pub mod scene;
pub mod settings;
pub mod shared;

pub use error::{Error, Result};
pub use gpu::{Device, DeviceInfo, DeviceOptions};
pub use image::Image;
pub use render::{Progress, Renderer};
pub use scene::{Environment, LoadOptions, Scene};
pub use settings::{CameraChoice, Normalisation, Projection, Settings};
