//! Draws the probe ray of a sample: radius, angle, channel and technique. Twin of `sample.comp`.
//!
//! `mis` and `normal` draw the radius from the profile itself ([`draw_radius`]; of a set of several materials, from one of
//! its [media](super::mixture)), so that on a plane every sample has the same weight, and look for surfaces in the ball of radius `radius_max`: the same
//! region for every technique, as the balance heuristic requires. `camera` draws it from
//! sigma e^(-sigma r) / (2 pi r) with the one rate `camera_rate`, and follows the camera ray from the eye.

use super::profile::{self, Matter, draw_radius};
use super::projection::{CAMERA, fractions, matter_at, seen, techniques};
use super::shared_hit::reach;
use super::tile::{Place, coordinate, first_share};
use super::{Inputs, mixture};
use crate::shared::{
    DIM_ANGLE, DIM_COMPONENT, DIM_RADIUS, DIM_TECHNIQUE, MISS, MODEL_TABLE, PROJECTION_CAMERA, Probe, Step, Surface,
    TRANSLUCENT,
};
use std::f64::consts::TAU;

/// Half the length of an unbounded probe.
const UNBOUNDED: f64 = profile::UNBOUNDED as f64;

/// No probe: an empty interval.
pub const NONE: Probe = Probe {
    offset: glam::Vec3::ZERO,
    direction: glam::Vec3::ZERO,
    t_min: 1.0,
    t_max: 0.0,
    radius: 0.0,
    seat: glam::UVec4::ZERO,
    table_node: 0,
    table_weight: 1.0,
    table_bend: glam::Vec2::ZERO,
    table_scale: 0.0,
    hit: glam::Vec3::ZERO,
    hit_r2: 0.0,
    lit: glam::UVec4::ZERO,
};

/// The probe of pixel `index` of the band, whose first surface is `surface`.
pub fn sample(inputs: &Inputs, step: &Step, index: u32, surface: &Surface) -> Probe {
    if surface.triangle == MISS {
        return NONE;
    }
    let matter = matter_at(inputs, surface);
    let members = mixture::members(inputs, matter.material, surface.triangle);
    if matter.material.flags & TRANSLUCENT == 0 || members.is_empty() {
        return NONE;
    }
    let seen = seen(inputs, surface);
    let place = Place::of(inputs, step, index);
    let u = |dimension| coordinate(inputs, step, place, dimension);
    let (material, u_component) = mixture::pick(&members, u(DIM_COMPONENT));
    let given = inputs.features.projection == PROJECTION_CAMERA;

    let fractions = fractions(techniques(&inputs.features), seen.normal.dot(seen.wo));
    let technique = first_above(u(DIM_TECHNIQUE), &fractions);

    let r = if given {
        -(-u(DIM_RADIUS)).ln_1p() / f64::from(material.camera_rate)
    } else {
        draw_radius(Matter { material, ..matter }, u_component, u(DIM_RADIUS))
    };

    let [n, tangent, bitangent] = seen.axes;
    let (axis, x, y) = match technique {
        1 => (tangent, bitangent, n),
        2 => (bitangent, n, tangent),
        _ => (-n, tangent, bitangent),
    };
    let (sin, cos) = (TAU * u(DIM_ANGLE)).sin_cos();
    let offset = r * (cos * x + sin * y);
    let direction = if technique == CAMERA { (offset * seen.inverse_distance - seen.wo).normalize() } else { axis };

    let mut none = NONE;
    if inputs.features.reuse != 0 {
        let inside = u32::from(seen.side < 0.0);
        none.lit.w = first_share(inputs, step) + 2 * inputs.triangles[surface.triangle as usize].set + inside;
        let [x, y, z] = surface.position.to_array().map(f32::to_bits);
        none.seat = glam::UVec4::new(x, y, z, (reach(matter).powi(2) as f32).to_bits());
        if matter.material.model == MODEL_TABLE {
            let placement = profile::table::placement(matter);
            (none.table_node, none.table_weight) = (placement.node, placement.weight as f32);
            (none.table_bend, none.table_scale) = (placement.bend.as_vec2(), placement.scale as f32);
        }
    }
    let (mut t_min, mut t_max) = (-UNBOUNDED, UNBOUNDED);
    if !given && material.radius_max < profile::UNBOUNDED {
        let radius = f64::from(material.radius_max);
        let middle = -offset.dot(direction);
        let half = middle * middle - (offset.length_squared() - radius * radius);
        if half < 0.0 {
            return none;
        }
        (t_min, t_max) = (middle - half.sqrt(), middle + half.sqrt());
    }
    if technique == CAMERA {
        let from_eye = if inputs.view.perspective > 0.0 {
            (offset - seen.wo * seen.eye_distance).length()
        } else {
            seen.eye_distance + offset.dot(inputs.view.forward.as_dvec3())
        };
        t_min = t_min.max(-from_eye);
    }
    Probe {
        offset: offset.as_vec3(),
        direction: direction.as_vec3(),
        t_min: t_min as f32,
        t_max: t_max as f32,
        radius: r as f32,
        ..none
    }
}

/// The first entry whose cumulative share exceeds u; rounding may leave none, then the last that has a share.
fn first_above(u: f64, shares: &[f64]) -> usize {
    let mut sum = 0.0;
    let found = shares.iter().position(|share| {
        sum += share;
        u < sum
    });
    found.or_else(|| shares.iter().rposition(|&share| share > 0.0)).unwrap_or(0)
}
