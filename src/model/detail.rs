//! How much of a profile a picture and a body show.

use crate::scene::{Camera, Lens, Scene, Set};
use glam::DVec3;

/// What decides how much of a profile shows (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detail {
    /// Width of a pixel where the material comes nearest to the eye; 0 if it may touch it, or nothing is known of the
    /// picture; infinite where nothing of it is in front of the camera.
    pub pixel: f64,
    /// Thickness of its bodies; infinite where they are not closed, 0 where other matter is in the same set, with which it
    /// exchanges light however near.
    pub thickness: f64,
}

impl Detail {
    /// All of a profile shows.
    pub const ALL: Detail = Detail { pixel: 0.0, thickness: f64::INFINITY };

    /// What an image of this many rows shows of each material.
    pub fn of(scene: &Scene, camera: &Camera, height: u32) -> Vec<Detail> {
        let nothing = Detail { pixel: f64::INFINITY, thickness: f64::INFINITY };
        let mut details = vec![nothing; scene.materials.len()];
        let thicknesses = thicknesses(scene);
        let rows = f64::from(height);
        for (triangle, shading) in scene.triangles.iter().zip(&scene.shadings) {
            let corner = triangle.corner.as_dvec3();
            let corners = [corner, corner + triangle.edge1.as_dvec3(), corner + triangle.edge2.as_dvec3()];
            let depth = |p: DVec3| (p / scene.frame.scale + scene.frame.centre - camera.eye).dot(camera.forward);
            let depths = corners.map(depth);
            let nearest = depths.into_iter().fold(f64::INFINITY, f64::min).max(0.0);
            let detail = &mut details[shading.material as usize];
            if depths.iter().any(|&depth| depth > 0.0) {
                detail.pixel = detail.pixel.min(match camera.lens {
                    Lens::Perspective { yfov, .. } => 2.0 * (0.5 * yfov).tan() * nearest / rows,
                    Lens::Orthographic { ymag, .. } => 2.0 * ymag / rows,
                });
            }
            detail.thickness = detail.thickness.min(thicknesses[triangle.set as usize]);
        }
        for set in scene.sets.iter().filter(|set| set.materials.len() > 1) {
            let pixel = set.materials.iter().map(|&m| details[m].pixel).fold(f64::INFINITY, f64::min);
            for &material in &set.materials {
                let detail = &mut details[material];
                *detail = Detail { pixel: detail.pixel.min(pixel), thickness: 0.0 };
            }
        }
        details
    }
}

/// Twice the volume of each set over its area (m), which is the thickness of a plate; infinite where it is not closed.
fn thicknesses(scene: &Scene) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); scene.sets.len()];
    for triangle in &scene.triangles {
        let normal = triangle.edge1.as_dvec3().cross(triangle.edge2.as_dvec3());
        let (volume, area): &mut (f64, f64) = &mut sums[triangle.set as usize];
        *volume += normal.dot(triangle.corner.as_dvec3()) / 6.0;
        *area += normal.length() / 2.0;
    }
    let of = |(set, (volume, area)): (&Set, (f64, f64))| match set.open_edges + set.crowded_edges {
        0 => 2.0 * volume.abs() / area / scene.frame.scale,
        _ => f64::INFINITY,
    };
    scene.sets.iter().zip(sums).map(of).collect()
}
