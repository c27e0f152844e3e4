//! The kernels in f64, written from the formulas: twins of `glsl/*.comp` and `glsl/*.glsl` under the same stems.
//!
//! A twin takes what one invocation of its kernel reads and returns what it writes, in the shared structs; inside it
//! computes in f64.

pub mod boundary;
pub mod math;
pub mod profile;
pub mod random;

use crate::shared::{Features, Light, Material, Shading, Triangle, View};
use glam::Vec3;

/// What every kernel may read: the buffers that do not change from sample to sample.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    pub features: Features,
    pub view: &'a View,
    /// In the order of the BVH's leaves.
    pub triangles: &'a [Triangle],
    pub shadings: &'a [Shading],
    pub materials: &'a [Material],
    pub lights: &'a [Light],
    /// Texels of the environment image, empty if there is none.
    pub environment: &'a [Vec3],
    /// Its sampling table; see [`Slot::EnvironmentCdf`](crate::shared::Slot::EnvironmentCdf).
    pub environment_cdf: &'a [f32],
}
