//! The 90-degree convex edge of a large block under radiance 1 from everywhere.

use super::{
    Axis, CHANNELS, Figure, Matter, Panel, Point, Series, Setup, channel,
    figure::even,
    mean_and_error, scene_in_uniform_light,
    scenes::{Eye, Mesh, gltf},
};
use crate::{error::Result, image::Image, settings::Settings};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI};

/// Pixels: columns lie at different distances from the edge.
const SIZE: (u32, u32) = (96, 24);
/// Columns of a point.
const COLUMNS: usize = 4;

/// What a point at the distance s from a 90-degree edge of infinite faces gathers of uniform irradiance, from the
/// distribution function of any radial profile and its total: 1 of the total far away and at s = 0, more between.
///
/// With d^2 = s^2 + r^2 over the half-plane of the other face, half of the circle 2 pi r dr = 2 pi d dd gives
/// (total - cdf(s)) / 2. The own face is the half-plane with its edge at s; by parts it is
/// total / 2 + 1/pi int_0^(pi/2) cdf(s / cos a) da.
pub fn closed_form(cdf: impl Fn(f64) -> f64, total: f64, s: f64) -> f64 {
    let own = total / 2.0 + midpoint(|angle| cdf(s / angle.cos()) / PI, FRAC_PI_2);
    own + (total - cdf(s)) / 2.0
}

/// int_0^end f.
fn midpoint(f: impl Fn(f64) -> f64, end: f64) -> f64 {
    const STEPS: u32 = 1024;
    (0..STEPS).map(|i| f((f64::from(i) + 0.5) / f64::from(STEPS) * end)).sum::<f64>() * end / f64::from(STEPS)
}

/// Exitance over a plane's, by distance from the edge.
pub fn edge(setup: &Setup) -> Result<Figure> {
    let width = width(&setup.matters[0]);
    let (mut series, mut notes) = (vec![], vec![]);
    for matter in setup.matters {
        let image = image(setup, matter, width)?;
        for (c, name) in setup.channels(matter) {
            let light = channel(&image, &format!("subsurface.{}", CHANNELS[c]));
            series.push(by_distance(matter, c, name, &light, width));
        }
        notes.push(format!("{}: the faces end where {:.1e} of the light lies beyond", matter.model, matter.lost()));
    }
    let panel = Panel {
        name: "edge".into(),
        x: Axis::linear("distance from the edge [mm]"),
        y: Axis::linear("exitance over a plane's"),
        series,
    };
    Ok(Figure { title: setup.title("Convex edge in uniform light"), panels: vec![panel], notes })
}

/// What is seen: five effective lengths of the channel that spreads farthest, or as many mean free paths as matter [mm].
fn width(matter: &Matter) -> f64 {
    let path = matter.mean_free_path();
    let spread = |c: usize| (1.0 / matter.profile(c).rate()).min(10.0 * path[c]);
    5.0 * (0..3).map(spread).fold(0.0, f64::max)
}

/// Looks along the normal; the edge is at the right.
fn image(setup: &Setup, matter: &Matter, width: f64) -> Result<Image> {
    let reach = matter.reach();
    let mut mesh = Mesh::default();
    mesh.cuboid(DVec3::new(-2.0 * reach, -reach, -2.0 * reach), DVec3::new(0.0, reach, 0.0), 1);
    let at = DVec3::new(-width / 2.0, 0.0, 0.0);
    let lens = -width / 2.0 * f64::from(SIZE.1) / f64::from(SIZE.0);
    let eye = Eye { eye: at + DVec3::Z * width, at, lens };
    let scene = scene_in_uniform_light(&gltf(&[(mesh, 0)], std::slice::from_ref(&matter.material), &[], &eye))?;
    setup.render(
        matter,
        &scene,
        Settings { resolution: Some(SIZE), reuse: Some(1), ..Settings::default() },
        setup.samples(2048),
    )
}

fn by_distance(matter: &Matter, c: usize, name: String, light: &[f64], width: f64) -> Series {
    let profile = matter.profile(c);
    let total = profile.total();
    let form = |s: f64| closed_form(|r| profile.cdf(r), total, s) / total;
    let s = |column: f64| width * (1.0 - column / f64::from(SIZE.0));
    // The mean over columns is what they show.
    let shown = |first: usize| {
        let within = (0..8).map(|k| form(s(first as f64 + (f64::from(k) + 0.5) / 8.0)));
        within.sum::<f64>() / 8.0
    };
    let point = |first: usize| {
        let (mut expected, mut residuals) = (0.0, vec![]);
        for column in first..first + COLUMNS {
            let own = shown(column);
            expected += own / COLUMNS as f64;
            let column = (0..SIZE.1 as usize).map(|row| light[row * SIZE.0 as usize + column]);
            residuals.extend(column.map(|light| light / (matter.transmittance(1.0) * total) - own));
        }
        let (residual, error) = mean_and_error(&residuals);
        Point { x: s(first as f64 + COLUMNS as f64 / 2.0), measured: expected + residual, error, expected }
    };
    let mut points: Vec<Point> = (0..SIZE.0 as usize).step_by(COLUMNS).map(point).collect();
    points.reverse();
    let curve = even(0.0, width, 200).into_iter().map(|s| (s, form(s))).collect();
    Series { name, points, curve }.up_to_where_known(matter)
}
