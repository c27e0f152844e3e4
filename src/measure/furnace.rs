//! A plane under radiance 1 from everywhere: what is reflected and what comes out again, by angle.
//!
//! Fresnel reflection sends back F(wo); the matter sends out Ft(wo) R (physics: uniform light on a plane gives exitance R
//! whatever the profile). Without absorption R = 1, and the sum is 1 for every angle and index.

use super::{
    Axis, CHANNELS, Figure, Matter, Panel, Point, Series, Setup, channel,
    figure::even,
    mean_and_error, scene_in_uniform_light,
    scenes::{Eye, Mesh, gltf},
};
use crate::{error::Result, image::Image, settings::Settings};
use glam::DVec3;

/// Pixels: rows see different angles.
const SIZE: (u32, u32) = (8, 60);
/// Rows of a point.
const ROWS: usize = 4;
/// Half the vertical field of view (degrees); the middle looks 45 degrees from the normal.
const HALF_VIEW: f64 = 43.5;

/// F(wo) + Lo / Li by angle.
pub fn furnace(setup: &Setup) -> Result<Figure> {
    let mut series = vec![];
    let mut notes = vec![];
    for matter in setup.matters {
        let image = image(setup, matter)?;
        for (c, name) in setup.channels(matter) {
            series.push(by_angle(matter, c, name, &channel(&image, CHANNELS[c])));
        }
        let (model, lost) = (matter.model, matter.lost());
        notes.push(format!(
            "{model}: the body ends where {lost:.1e} of the light lies beyond, and so much may be missing"
        ));
    }
    let panel = Panel {
        name: "furnace".into(),
        x: Axis::linear("angle from the normal [degrees]"),
        y: Axis::linear("F + Lo / Li"),
        series,
    };
    Ok(Figure { title: setup.title("Furnace"), panels: vec![panel], notes })
}

fn image(setup: &Setup, matter: &Matter) -> Result<Image> {
    let reach = matter.reach();
    let mut mesh = Mesh::default();
    mesh.cuboid(DVec3::new(-reach, -reach, -reach), DVec3::new(reach, reach, 0.0), 1);
    // The most oblique ray meets the plane 40 heights away.
    let height = reach / 2000.0;
    let eye = Eye { eye: DVec3::new(0.0, -height, height), at: DVec3::ZERO, lens: 2.0 * HALF_VIEW.to_radians() };
    let scene = scene_in_uniform_light(&gltf(&[(mesh, 0)], std::slice::from_ref(&matter.material), &[], &eye))?;
    setup.render(
        matter,
        &scene,
        Settings { resolution: Some(SIZE), reuse: Some(1), ..Settings::default() },
        setup.samples(8192),
    )
}

/// Cosine between the normal and a ray, by place in the image (pixels).
fn cosine(x: f64, y: f64) -> f64 {
    let half = HALF_VIEW.to_radians().tan();
    let (width, height) = (f64::from(SIZE.0), f64::from(SIZE.1));
    let right = (2.0 * x / width - 1.0) * half * width / height;
    let up = (1.0 - 2.0 * y / height) * half;
    let (forward, upward) = (DVec3::new(0.0, 1.0, -1.0).normalize(), DVec3::new(0.0, 1.0, 1.0).normalize());
    -(forward + right * DVec3::X + up * upward).normalize().z
}

fn by_angle(matter: &Matter, c: usize, name: String, light: &[f64]) -> Series {
    let total = matter.profile(c).total();
    let form = |cosine: f64| 1.0 - matter.transmittance(cosine) * (1.0 - total);
    let point = |first: usize| {
        let (mut angles, mut expected, mut residuals) = (0.0, 0.0, vec![]);
        for row in first..first + ROWS {
            for column in 0..SIZE.0 as usize {
                let at = |x: f64, y: f64| cosine(column as f64 + x, row as f64 + y);
                // The mean over the pixel, which is what it shows.
                let middle = |k: i32| (f64::from(k) + 0.5) / 8.0;
                let mean = (0..64).map(|k| form(at(middle(k % 8), middle(k / 8)))).sum::<f64>() / 64.0;
                angles += at(0.5, 0.5).acos().to_degrees();
                expected += mean;
                residuals.push(light[row * SIZE.0 as usize + column] - mean);
            }
        }
        let count = residuals.len() as f64;
        let (residual, error) = mean_and_error(&residuals);
        let expected = expected / count;
        Point { x: angles / count, measured: expected + residual, error, expected }
    };
    let mut points: Vec<Point> = (0..SIZE.1 as usize).step_by(ROWS).map(point).collect();
    points.reverse();
    let curve = even(0.0, 90.0, 181).into_iter().map(|angle| (angle, form(angle.to_radians().cos()))).collect();
    Series { name, points, curve }.up_to_where_known(matter)
}
