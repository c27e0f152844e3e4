//! Where a probe's point lies, looked up in the G-buffer instead of traced: twin of `screen.glsl`.
//!
//! Every probe takes the camera's technique ([`projection`](super::projection)): the camera ray through the point
//! y = xo + offset of the tangent plane meets the surface that the pixel there sees. Its column and row come from
//! y's distance along the view axis, k = 1 + (y - pivot).F / |F|^2 in units of the pivot's (1 for an orthographic camera),
//!
//!   x = (y - pivot).R / |R|^2 / k,   column = (1 + x) / 2 width,
//!
//! and the row likewise. A G-buffer knows one point P of that pixel, on the triangle T, seen through another place of the
//! pixel than y. The hit is where the ray crosses the plane of T, which is exact where T fills the pixel, if that is within
//! [`SCREEN_REACH`] pixels' widths of P; else, with T nearly edge-on or a rim, the point of the ray nearest to P.
//!
//! # Bias
//! What the camera does not see brings no light: half of a sphere at its silhouette, nothing on a plane that fills the
//! image. A pixel with two surfaces has them by turns, as its strata do, so that their shares hold in the mean. The place of
//! a hit is wrong by about a pixel's width where several triangles share it; where those meet in a hollow, the extended plane
//! lies below the surface, and may be in its shadow: an error that would fall with a pixel over the triangles' size, as what
//! is measured does.

use super::{Inputs, reproject as traced};
use crate::shared::{Hits, MISS, Probe, REPROJECT_SCREEN, SCREEN_REACH, Step, Surface, View};
use glam::DVec3;

/// The hits of the probe of pixel `index` of the band, traced or looked up. `surfaces` are those of the band.
pub fn reproject(inputs: &Inputs, step: &Step, index: u32, surfaces: &[Surface], probe: &Probe) -> Hits {
    match inputs.features.reproject {
        REPROJECT_SCREEN => look_up(inputs, step, index, surfaces, probe).unwrap_or_default(),
        _ => traced::reproject(inputs, step, index, &surfaces[index as usize], probe),
    }
}

/// The hit of the probe of pixel `index` of the band, whose surfaces are `surfaces`; none where no surface of the set is
/// seen.
pub fn look_up(inputs: &Inputs, step: &Step, index: u32, surfaces: &[Surface], probe: &Probe) -> Option<Hits> {
    if probe.t_min > probe.t_max {
        return None;
    }
    let own = &surfaces[index as usize];
    let (offset, direction) = (probe.offset.as_dvec3(), probe.direction.as_dvec3());
    let origin = own.position.as_dvec3() + offset;
    let there = &surfaces[pixel_that_sees(inputs.view, step, origin)?];
    let set = |surface: &Surface| inputs.triangles[surface.triangle as usize].set;
    if there.triangle == MISS || set(there) != set(own) {
        return None;
    }
    let to = there.position.as_dvec3() - origin;
    let [_, edge1, edge2] = inputs.triangles[there.triangle as usize].corner_and_edges();
    let normal = edge1.cross(edge2);
    let in_plane = normal.dot(to) / normal.dot(direction);
    let near = (in_plane * direction - to).length() <= f64::from(SCREEN_REACH) * pixel_width(inputs.view, there);
    let t = if near { in_plane } else { to.dot(direction) };
    if !(f64::from(probe.t_min)..=f64::from(probe.t_max)).contains(&t) {
        return None;
    }
    let mut hits = Hits { count: 1, ..Hits::default() };
    (hits.t[0], hits.triangle[0]) = (t as f32, there.triangle);
    Some(hits)
}

/// Distance along the view axis in units of the pivot's; 1 for an orthographic camera.
fn depth(view: &View, point: DVec3) -> f64 {
    let forward = view.forward.as_dvec3();
    1.0 + f64::from(view.perspective) * (point - view.pivot.as_dvec3()).dot(forward) / forward.length_squared()
}

/// The pixel of the band whose camera rays pass the point.
fn pixel_that_sees(view: &View, step: &Step, point: DVec3) -> Option<usize> {
    let from_pivot = point - view.pivot.as_dvec3();
    let depth = depth(view, point);
    let along = |axis: glam::Vec3| from_pivot.dot(axis.as_dvec3()) / axis.as_dvec3().length_squared() / depth;
    let column = 0.5 * (1.0 + along(view.right)) * f64::from(view.width) - f64::from(view.crop_x);
    let row = 0.5 * (1.0 - along(view.up)) * f64::from(view.height) - f64::from(step.first_row);
    let (columns, rows) = (f64::from(view.crop_width), f64::from(step.pixel_count / view.crop_width));
    let seen = depth > 0.0 && (0.0..columns).contains(&column) && (0.0..rows).contains(&row);
    seen.then(|| row as usize * view.crop_width as usize + column as usize)
}

/// Width of a pixel at the distance of a surface.
fn pixel_width(view: &View, surface: &Surface) -> f64 {
    2.0 * view.right.as_dvec3().length() / f64::from(view.width) * depth(view, surface.position.as_dvec3())
}
