//! The surface that a camera ray meets first: twin of `primary.comp`.
//!
//! A pixel's value is the mean over its area (box filter); the position in the pixel is a point of a (0, 2) sequence
//! per stratum of samples.

use super::pixel::position;
use super::random::{batch, key, scramble, sobol, stratum, unit};
use super::{Inputs, intersect};
use crate::shared::{DIM_PIXEL, Features, MISS, Step, Surface, View};
use glam::{DVec3, Vec2};

/// A ray of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraRay {
    /// A point of the plane through the pivot.
    pub origin: DVec3,
    /// Unit vector, away from the camera.
    pub direction: DVec3,
    /// Distance from the camera to the origin.
    pub reach: f64,
}

/// The ray of pixel `index` of the band, through its centre or through the point of the sample's stratum.
pub fn camera_ray(features: &Features, view: &View, step: &Step, index: u32) -> CameraRay {
    let (px, py) = position(view, step, index);
    let coordinate = |d: u32| {
        let point = sobol(stratum(features, step.sample_index), d as usize);
        unit(scramble(point, key(view.seed, px, py, batch(step.sample_index), DIM_PIXEL + d)))
    };
    let (u, v) = if step.pixel_centre != 0 { (0.5, 0.5) } else { (coordinate(0), coordinate(1)) };
    let x = 2.0 * (f64::from(px) + u) / f64::from(view.width) - 1.0;
    let y = 1.0 - 2.0 * (f64::from(py) + v) / f64::from(view.height);
    let from_pivot = x * view.right.as_dvec3() + y * view.up.as_dvec3();
    let to = view.forward.as_dvec3() + f64::from(view.perspective) * from_pivot;
    let reach = if view.perspective > 0.0 { to.length() } else { f64::from(view.reach) };
    CameraRay { origin: view.pivot.as_dvec3() + from_pivot, direction: to.normalize(), reach }
}

/// The first surface of pixel `index` of the band.
pub fn primary(inputs: &Inputs, step: &Step, index: u32) -> Surface {
    let ray = camera_ray(&inputs.features, inputs.view, step, index);
    match intersect::closest(inputs, ray.origin, ray.direction, -ray.reach, f64::INFINITY) {
        None => Surface { triangle: MISS, ..Default::default() },
        Some(hit) => {
            let triangle = &inputs.triangles[hit.triangle as usize];
            let [corner, edge1, edge2] = triangle.corner_and_edges();
            let position = corner + hit.barycentric.x * edge1 + hit.barycentric.y * edge2;
            let barycentric = Vec2::new(hit.barycentric.x as f32, hit.barycentric.y as f32);
            Surface { position: position.as_vec3(), triangle: hit.triangle, barycentric }
        }
    }
}
