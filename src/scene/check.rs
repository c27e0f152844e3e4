//! Cameras and lights that come from callers, not from files.

use super::{Camera, Frame, Lens, Light, LightKind, frame};
use crate::{Error, Result};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI};

/// How far a direction may be from a unit vector, or two of them from a right angle.
const UNIT: f64 = 1e-6;

/// Refuses a camera that is none.
pub(crate) fn check_camera(camera: &Camera, frame: &Frame) -> Result<()> {
    let Camera { right, up, forward, .. } = *camera;
    let unit = |v: DVec3| (v.length_squared() - 1.0).abs() <= UNIT;
    let square = |a: DVec3, b: DVec3| a.dot(b).abs() <= UNIT;
    let basis = unit(right) && unit(up) && unit(forward) && square(right, up) && square(up, forward);
    let problem = if !camera.eye.is_finite() {
        Some("its eye is not finite".to_string())
    } else if !(basis && (right.cross(up) + forward).length() <= 3.0 * UNIT) {
        Some("right, up and -forward are not a rotation's axes".into())
    } else {
        let lens = match camera.lens {
            Lens::Perspective { yfov, .. } if yfov > 0.0 && yfov < PI => None,
            Lens::Perspective { yfov, .. } => Some(format!("its angle is {yfov} radians, not between 0 and pi")),
            Lens::Orthographic { xmag, ymag } if xmag > 0.0 && ymag > 0.0 => None,
            Lens::Orthographic { xmag, ymag } => Some(format!("its half sizes are {xmag} and {ymag} m")),
        };
        lens.or_else(|| frame::camera_beyond(frame, camera))
    };
    problem.map_or(Ok(()), |problem| Err(Error::setting(format!("camera `{}`", camera.name), problem)))
}

/// Refuses a light that is none.
pub(crate) fn check_light(light: &Light, frame: &Frame) -> Result<()> {
    let cone = match light.kind {
        LightKind::Spot { inner, outer } => 0.0 <= inner && inner < outer && outer <= FRAC_PI_2,
        LightKind::Point | LightKind::Directional => true,
    };
    let problem = if !light.position.is_finite() {
        Some("its position is not finite".to_string())
    } else if !(light.intensity.is_finite() && light.intensity.min_element() >= 0.0) {
        Some(format!("its intensity is {}", light.intensity))
    } else if !light.direction.is_finite() || (light.direction.length_squared() - 1.0).abs() > UNIT {
        Some("its direction is no unit vector".into())
    } else if !cone {
        Some("its angles are not 0 <= inner < outer <= pi/2".into())
    } else if light.range.is_some_and(|range| range.is_nan() || range <= 0.0) {
        Some("its range is not positive".into())
    } else {
        frame::light_beyond(frame, light)
    };
    problem.map_or(Ok(()), |problem| Err(Error::setting(format!("light `{}`", light.name), problem)))
}
