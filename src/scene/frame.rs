//! From metres to internal units: centre, scale, and the geometry in f32.

use super::json::shorten;
use super::mesh::Triangle;
use super::{Camera, Frame, Lens, Light, LightKind, Material};
use crate::{Error, Result, shared};
use glam::{DVec3, Vec3};
use std::path::Path;

/// Radii of the frame's geometry (m) whose squares f64 and f32 can hold.
const RADIUS_RANGE: (f64, f64) = (1e-12, 1e12);
/// Largest internal coordinate: beyond it, f32 boxes and areas lose their meaning.
const COORDINATE_MAX: f64 = 1e9;
/// Largest intensity, irradiance or radiance in internal units: sums over many samples stay far below f32's largest
/// number.
pub(super) const INTENSITY_MAX: f64 = 1e30;
/// Least twice-area in internal units of which f32 can form a normal.
const AREA_MIN: f64 = 1e-18;

/// The frame in which the translucent triangles (all of them, if none is) are centred on 0 with radius 1.
///
/// The centre is that of their bounding box; the radius is the distance of the farthest vertex from it.
pub(super) fn around(file: &Path, triangles: &[Triangle], materials: &[Material]) -> Result<Frame> {
    let translucent = |triangle: &&Triangle| materials[triangle.material as usize].medium.is_some();
    let any = triangles.iter().any(|triangle| translucent(&triangle));
    let framed: Vec<&Triangle> = triangles.iter().filter(|triangle| !any || translucent(triangle)).collect();
    let mut low = DVec3::INFINITY;
    let mut high = DVec3::NEG_INFINITY;
    for vertex in framed.iter().flat_map(|triangle| vertices(triangle)) {
        low = low.min(vertex);
        high = high.max(vertex);
    }
    let centre = 0.5 * (low + high);
    let square = |vertex: DVec3| (vertex - centre).length_squared();
    let radius = framed.iter().flat_map(|triangle| vertices(triangle)).map(square).fold(0.0, f64::max).sqrt();
    if !(RADIUS_RANGE.0..=RADIUS_RANGE.1).contains(&radius) {
        let (low, high) = RADIUS_RANGE;
        return Err(Error::scene(file, "scene", format!("its radius is {radius} m, not from {low} to {high}")));
    }
    Ok(Frame { centre, scale: 1.0 / radius })
}

/// The geometry in internal units.
pub(super) struct Internal {
    pub triangles: Vec<shared::Triangle>,
    pub shadings: Vec<shared::Shading>,
    pub coordinates: Vec<shared::Coordinates>,
    /// Triangles that were left out.
    pub too_small: u64,
}

/// The geometry in internal units, without triangles too small for them. `positions` are those of the triangles' vertices
/// (m), `coordinates` are none or one each.
pub(super) fn internal(
    file: &Path,
    frame: &Frame,
    triangles: &[Triangle],
    positions: &[DVec3],
    coordinates: &[shared::Coordinates],
) -> Result<Internal> {
    let mut kept = Vec::with_capacity(triangles.len());
    let mut shadings = Vec::with_capacity(triangles.len());
    let mut kept_coordinates = Vec::with_capacity(coordinates.len());
    let mut dropped = 0;
    for (index, triangle) in triangles.iter().enumerate() {
        for vertex in vertices(triangle) {
            let reach = ((vertex - frame.centre) * frame.scale).abs().max_element();
            if reach > COORDINATE_MAX {
                let problem = format!("reaches {reach:e} times as far as the translucent part's radius");
                return Err(Error::scene(file, "scene", problem));
            }
        }
        // From the placed vertex and not from the triangle's edges, so that all triangles there have the same bits.
        let vertices = triangle.vertices.map(|v| ((positions[v as usize] - frame.centre) * frame.scale).as_vec3());
        let kept_triangle = shared::Triangle { vertices, set: triangle.set };
        let [_, edge1, edge2] = kept_triangle.corner_and_edges();
        if edge1.cross(edge2).length() <= AREA_MIN {
            dropped += 1;
            continue;
        }
        kept_coordinates.extend(coordinates.get(index));
        kept.push(kept_triangle);
        let [normal0, normal1, normal2]: [Vec3; 3] = triangle.normals;
        shadings.push(shared::Shading { normal0, normal1, normal2, material: triangle.material });
    }
    if kept.is_empty() {
        return Err(Error::scene(file, "scene", "has no triangle large enough for its size"));
    }
    Ok(Internal { triangles: kept, shadings, coordinates: kept_coordinates, too_small: dropped })
}

/// Refuses lights and cameras whose internal numbers f32 could not hold.
pub(super) fn check_nodes(file: &Path, frame: &Frame, lights: &[Light], cameras: &[Camera]) -> Result<()> {
    for light in lights {
        if let Some(problem) = light_beyond(frame, light) {
            return Err(Error::scene(file, format!("light `{}`", shorten(&light.name)), problem));
        }
    }
    for camera in cameras {
        if let Some(problem) = camera_beyond(frame, camera) {
            return Err(Error::scene(file, format!("camera `{}`", shorten(&camera.name)), problem));
        }
    }
    Ok(())
}

/// What f32 could not hold of a light.
pub(super) fn light_beyond(frame: &Frame, light: &Light) -> Option<String> {
    let (position, factor) = match light.kind {
        LightKind::Directional => (frame.centre, 1.0),
        LightKind::Point | LightKind::Spot { .. } => (light.position, frame.scale * frame.scale),
    };
    let bright = light.intensity.max_element() * factor > INTENSITY_MAX;
    let bright = bright.then(|| format!("is brighter than {INTENSITY_MAX:e} in internal units"));
    far(frame, position).or(bright)
}

/// What f32 could not hold of a camera.
pub(super) fn camera_beyond(frame: &Frame, camera: &Camera) -> Option<String> {
    let wide = match camera.lens {
        Lens::Perspective { .. } => false,
        Lens::Orthographic { xmag, ymag } => xmag.max(ymag) * frame.scale > COORDINATE_MAX,
    };
    let wide = wide.then(|| format!("sees more than {COORDINATE_MAX:e} times the translucent part's radius"));
    far(frame, camera.eye).or(wide)
}

fn far(frame: &Frame, position: DVec3) -> Option<String> {
    let reach = ((position - frame.centre) * frame.scale).abs().max_element();
    (reach > COORDINATE_MAX).then(|| format!("is {reach:e} times as far as the translucent part's radius"))
}

fn vertices(triangle: &Triangle) -> [DVec3; 3] {
    [triangle.corner, triangle.corner + triangle.edge1, triangle.corner + triangle.edge2]
}
