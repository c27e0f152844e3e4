//! The analytic unit sphere: who looks at it, where probes meet it, what it shows under uniform light.

use super::{World, coefficients};
use glam::{DVec3, dvec3};
use translucent::reference::profile::{Dipole, Radial};
use translucent::shared::{PROJECTION_CAMERA, Probe};

/// The cameras: at a distance in radii, orthographic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Eye {
    At(f64),
    Infinite,
}

pub const EYES: [Eye; 3] = [Eye::At(3.0), Eye::At(50.0), Eye::Infinite];

/// sigma_tr times the radius.
pub const SIGMAS: [f64; 4] = [0.5, 5.0, 30.0, 100.0];

pub const ALBEDO: f64 = 0.95;
pub const IOR: f64 = 1.3;

impl Eye {
    /// Angle between the silhouette and the camera's axis, z [degrees].
    pub fn silhouette(self) -> f64 {
        match self {
            Eye::At(distance) => (1.0 / distance).acos().to_degrees(),
            Eye::Infinite => 90.0,
        }
    }

    /// Places from the middle of the disk to .2 degrees from the silhouette [degrees from the axis].
    pub fn angles(self) -> [f64; 6] {
        let rim = self.silhouette();
        [0.0, 0.5 * rim, 0.9 * rim, rim - 5.0, rim - 1.0, rim - 0.2]
    }

    /// Turns the world's camera to the sphere.
    pub fn look(self, world: &mut World) {
        match self {
            Eye::At(distance) => world.look(DVec3::Z * distance, DVec3::ZERO, 1.0),
            Eye::Infinite => world.look_along(-DVec3::Z, DVec3::ZERO, 3.0, 1.0),
        }
    }
}

/// The point at `angle` [degrees] from z, out of the symmetric planes.
pub fn place(angle: f64) -> DVec3 {
    let (sin, cos) = angle.to_radians().sin_cos();
    dvec3(sin * 0.8, sin * 0.6, cos).normalize()
}

/// A small triangle that is tangent to the unit sphere at its first corner.
pub fn tangent(at: DVec3) -> [DVec3; 3] {
    let (x, y) = at.any_orthonormal_pair();
    let out = if x.cross(y).dot(at) > 0.0 { 1.0 } else { -1.0 };
    [at, at + 1e-3 * x, at + 1e-3 * out * y]
}

/// Where the probe of the point `position` meets the sphere, in order: t and the point; the camera projection's first.
pub fn meetings(position: DVec3, probe: &Probe, projection: u32) -> impl Iterator<Item = (f64, DVec3)> {
    let origin = position + probe.offset.as_dvec3();
    let direction = probe.direction.as_dvec3();
    let middle = -origin.dot(direction);
    // Not a number where the line passes by.
    let half = (1.0 - (origin + middle * direction).length_squared()).sqrt();
    let (t_min, t_max) = (f64::from(probe.t_min), f64::from(probe.t_max));
    [middle - half, middle + half]
        .into_iter()
        .filter(move |t| *t >= t_min && *t <= t_max)
        .take(if projection == PROJECTION_CAMERA { 1 } else { 2 })
        .map(move |t| (t, (origin + t * direction).normalize()))
}

/// What every point of the sphere shows under radiance 1, over Ft(wo).
pub fn flat(sigma_tr: f64) -> f64 {
    let (sigma_s, sigma_a) = coefficients(sigma_tr, ALBEDO);
    Dipole::new(sigma_s, sigma_a, IOR).cdf(2.0)
}
