//! Which camera looks: one of the file's, or one that frames the scene.

use super::{Camera, Lens, Scene};
use crate::{CameraChoice, Error, Result};
use glam::DVec3;

/// Vertical angle of the camera that frames the scene.
const FRAMING_YFOV: f64 = 40.0 * std::f64::consts::PI / 180.0;
/// From the scene's front (+Z, as glTF has it) towards +X, and above the horizon.
const FRAMING_AZIMUTH: f64 = 30.0 * std::f64::consts::PI / 180.0;
const FRAMING_ELEVATION: f64 = 15.0 * std::f64::consts::PI / 180.0;
/// Room around the bounding sphere.
const FRAMING_MARGIN: f64 = 1.05;

impl Scene {
    /// The chosen camera for an image of `aspect` = width / height. A file without cameras has one that frames the
    /// translucent part (all of the scene if there is none) from the front, a little from the side and from above.
    ///
    /// # Errors
    /// [`Error::Setting`] for a name or index that the scene does not have, with those it has.
    pub fn camera(&self, choice: &CameraChoice, aspect: f64) -> Result<Camera> {
        let found = match choice {
            CameraChoice::Default => {
                return Ok(self.cameras.first().cloned().unwrap_or_else(|| self.framing_camera(aspect)));
            }
            CameraChoice::Index(index) => self.cameras.get(*index),
            CameraChoice::Name(name) => {
                let object = |camera: &&Camera| camera.object_name.as_ref() == Some(name);
                self.cameras.iter().find(|camera| camera.name == *name).or_else(|| self.cameras.iter().find(object))
            }
        };
        found.cloned().ok_or_else(|| {
            let asked = match choice {
                CameraChoice::Index(index) => index.to_string(),
                CameraChoice::Name(name) => format!("`{name}`"),
                CameraChoice::Default => String::new(),
            };
            let mut names: Vec<String> = Vec::new();
            names.extend(self.cameras.iter().enumerate().map(|(index, camera)| format!("{index} `{}`", camera.name)));
            let listed = if names.is_empty() { "none".to_string() } else { names.join(", ") };
            Error::setting("camera", format!("{} has no camera {asked}; it has: {listed}", self.file.display()))
        })
    }

    fn framing_camera(&self, aspect: f64) -> Camera {
        let (sin, cos) = FRAMING_AZIMUTH.sin_cos();
        let (rise, run) = FRAMING_ELEVATION.sin_cos();
        let forward = -DVec3::new(sin * run, rise, cos * run);
        let right = forward.cross(DVec3::Y).normalize();
        let half = FRAMING_YFOV / 2.0;
        // The narrower of the two angles must hold the sphere.
        let narrow = if aspect < 1.0 { (aspect * half.tan()).atan() } else { half };
        let distance = FRAMING_MARGIN / self.frame.scale / narrow.sin();
        Camera {
            name: "framing".into(),
            object_name: None,
            eye: self.frame.centre - forward * distance,
            right,
            up: right.cross(forward),
            forward,
            lens: Lens::Perspective { yfov: FRAMING_YFOV, aspect: None },
        }
    }
}
