//! A thin beam onto a plane, and how much light comes out how far away: R(r) as a searchlight shows it.
//!
//! A beam that is thin enough is met by one sample in a thousand. A plane is the same everywhere and in every direction,
//! so the light that a ring of radius r receives and its centre sends out is what a beam at the centre sends out along
//! the ring. An opaque plate with a ring-shaped slit is held over the plane, collimated light falls through it, and the
//! camera below the plate looks at the centre: the exitance there is E times int R dA over the ring.

use super::{
    Axis, CHANNELS, Figure, Matter, Panel, Point, Series, Setup, channel,
    figure::geometric,
    mean_and_error, scene,
    scenes::{Eye, Mesh, gltf, sun},
};
use crate::{
    error::Result,
    reference::walk::{
        self, Estimate,
        searchlight::{Incidence, Searchlight},
    },
    settings::{Model, Settings},
};
use glam::DVec3;
use serde_json::json;
use std::f64::consts::{PI, TAU};

/// Pixels; all see the centre.
const SIZE: u32 = 16;
/// Ends of the rings over the mean free path.
const RADII: (f64, f64) = (0.125, 22.6);
const RINGS: usize = 15;
/// Corners of the slit's circles.
const CORNERS: u32 = 256;
/// Paths of the random walk.
const PATHS: u32 = 100_000;
/// The channel that is measured.
const CHANNEL: usize = 1;

/// R(r) by the kernels and by a random walk through the matter.
pub fn searchlight(setup: &Setup) -> Result<Figure> {
    let first = &setup.matters[0];
    let path = first.mean_free_path()[CHANNEL];
    let ends = geometric(RADII.0 * path, RADII.1 * path, RINGS + 1);
    let middle = |ring: usize| (ends[ring] * ends[ring + 1]).sqrt();
    let fine = geometric(ends[0], ends[RINGS], 200);
    let (mut series, mut notes) = (vec![], vec![]);

    for matter in setup.matters {
        let matter = matter.grey(CHANNEL);
        let inside = matter.beam(CHANNEL);
        let mut points = vec![];
        for ring in 0..RINGS {
            let (a, b) = (ends[ring], ends[ring + 1]);
            let (light, error) = lit_ring(setup, &matter, a, b)?;
            let (area, expected) = (area(a, b), inside(b) - inside(a));
            let [measured, error, expected] = [light, error, expected].map(|value| value / area);
            points.push(Point { x: middle(ring), measured, error, expected });
        }
        // A ring of a hundredth of its radius on either side.
        let ring = |r: f64| (inside(1.01 * r) - inside(0.99 * r)) / area(0.99 * r, 1.01 * r);
        let curve = fine.iter().map(|r| (*r, ring(*r))).collect();
        let mut shown = Series { name: matter.model.to_string(), points, curve };
        if matter.model == Model::Table {
            // Its profile depends on the directions too.
            shown = shown.up_to_where_known(&matter);
        }
        series.push(shown);
        notes.push(format!("{}: the body ends where {:.1e} of the light lies beyond", matter.model, matter.lost()));
    }

    // The beam itself, without a model.
    let truth = first.walk(CHANNEL);
    if truth.sigma_a > 0.0 {
        let radii: Vec<f64> = std::iter::once(0.0).chain(ends.iter().copied()).collect();
        let paths = u64::from(setup.samples(PATHS));
        let (absorption, seed) = ([truth.sigma_a], setup.seed.into());
        let beam = walk::searchlight::searchlight(truth, &absorption, Incidence::Angle(0.0), &radii, paths, seed);
        let beam = &beam[0];
        let points = (0..RINGS).map(|ring| {
            let walked = beam.rings[ring + 1];
            Point { x: middle(ring), measured: walked.mean, error: walked.error, expected: f64::NAN }
        });
        series.push(Series { name: "random walk".into(), points: points.collect(), curve: vec![] });
        let Estimate { mean, error } = beam.total;
        notes.push(format!("random walk: {paths} paths, total {mean:.4} +- {error:.4}; models against it:"));
        notes.extend(setup.matters.iter().map(|matter| errors(matter, path, beam)));
    }
    let panel = Panel {
        name: "searchlight".into(),
        x: Axis::logarithmic("r [mm]"),
        y: Axis::logarithmic("R(r) [mm\u{207b}\u{b2}]"),
        series,
    };
    let title = setup.title("Searchlight");
    let title = if setup.matters.len() > 1 { title } else { title.replacen(", ", ", green, ", 1) };
    Ok(Figure { title, panels: vec![panel], notes })
}

fn area(a: f64, b: f64) -> f64 {
    PI * (b - a) * (b + a)
}

/// A model's errors against the walk: of the total; of all rings and what lies beyond, weighted by energy (L1); root mean
/// square of the relative error of rings from .5 to 16 mean free paths.
fn errors(matter: &Matter, path: f64, beam: &Searchlight) -> String {
    let inside = matter.beam(CHANNEL);
    let total = inside(f64::INFINITY);
    let (mut l1, mut walked_inside, mut squares) = (0.0, 0.0, vec![]);
    for (ends, walked) in beam.radii.windows(2).zip(&beam.rings) {
        let (a, b) = (ends[0], ends[1]);
        let (model, walked) = (inside(b) - inside(a), walked.mean * area(a, b));
        l1 += (model - walked).abs();
        walked_inside += walked;
        let middle = (a * b).sqrt();
        if (0.5 * path..=16.0 * path).contains(&middle) {
            squares.push((model / walked - 1.0).powi(2));
        }
    }
    let modelled_inside = inside(beam.radii[beam.radii.len() - 1]);
    l1 += ((total - modelled_inside) - (beam.total.mean - walked_inside)).abs();
    let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    format!(
        "  {}: total {:+.1} %, L1 {:.1} %, rms from .5 to 16 mean free paths {:.1} %",
        matter.model,
        100.0 * (total / beam.total.mean - 1.0),
        100.0 * l1 / beam.total.mean,
        100.0 * rms,
    )
}

/// int R dA over the ring between two radii [mm], by the kernels, and its standard error.
fn lit_ring(setup: &Setup, matter: &Matter, inner: f64, outer: f64) -> Result<(f64, f64)> {
    let reach = matter.reach().max(2.0 * outer);
    let mut body = Mesh::default();
    body.cuboid(DVec3::new(-reach, -reach, -reach), DVec3::new(reach, reach, 0.0), 1);
    // The corners lie so far out that the polygon has the circle's area.
    let angle = TAU / f64::from(CORNERS);
    let stretch = (angle / angle.sin()).sqrt();
    let height = inner;
    let mut plate = Mesh::default();
    annulus(&mut plate, 0.0, inner * stretch, height);
    annulus(&mut plate, outer * stretch, 3.0 * reach, height);
    let light = (sun(), DVec3::Z * 2.0 * reach, DVec3::ZERO);
    let eye = Eye { eye: DVec3::Z * height / 2.0, at: DVec3::ZERO, lens: 2e-3 };
    let materials = [matter.material.clone(), json!({"name": "plate"})];
    let file = gltf(&[(body, 0), (plate, 1)], &materials, &[light], &eye);
    let settings = Settings { resolution: Some((SIZE, SIZE)), reuse: Some(1), ..Settings::default() };
    let image = setup.render(matter, &scene(&file)?, settings, setup.samples(512))?;
    let light = channel(&image, &format!("subsurface.{}", CHANNELS[CHANNEL]));
    let (mean, error) = mean_and_error(&light);
    // Collimated light of E = pi enters with Ft(1).
    let unit = PI * matter.transmittance(1.0) * matter.leaving();
    Ok((mean / unit, error / unit))
}

/// Adds the flat ring between two radii at a height.
fn annulus(mesh: &mut Mesh, inner: f64, outer: f64, height: f64) {
    let first = mesh.positions.len() as u32;
    for i in 0..CORNERS {
        let (sin, cos) = (TAU * f64::from(i) / f64::from(CORNERS)).sin_cos();
        for radius in [inner, outer] {
            mesh.positions.push(DVec3::new(radius * cos, radius * sin, height));
            mesh.normals.push(DVec3::Z);
        }
        let [a, b] = [i, (i + 1) % CORNERS].map(|corner| first + 2 * corner);
        mesh.indices.extend([a, a + 1, b + 1, a, b + 1, b]);
    }
}
