//! How time grows with the size of the work: pixels, samples, triangles, materials, lights.

use super::about;
use crate::{
    Error, Result,
    gpu::Device,
    render::Renderer,
    scene::{Camera, Environment, Lens, Light, LightKind, Material, Medium, Mesh, Scene},
    settings::{CameraChoice, Settings},
    timeline::Timeline,
};
use glam::{DAffine3, DVec3};
use serde_json::{Value, json};
use std::{
    f64::consts::TAU,
    fmt::Write,
    time::{Duration, Instant},
};

/// Repeats of a point, the median of which counts; fewer where they take longer than [`LONG`].
const REPEATS: usize = 3;
const LONG: Duration = Duration::from_secs(3);

/// Largest image that is rendered once beforehand, so that drivers have compiled; larger ones come after smaller ones with
/// the same kernels.
const WARMED: u64 = 1 << 20;

/// Spheres of the scene whose materials are varied, in a row and in all.
const ROW: usize = 8;
const SPHERES: usize = ROW * ROW;

/// What is varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Width and height in pixels; the scene is the caller's.
    Resolution,
    /// Samples of each pixel; the scene is the caller's.
    Samples,
    /// Triangles of one sphere of marble in even light.
    Triangles,
    /// Materials of 64 spheres in even light; the geometry stays.
    Materials,
    /// Point lights around the caller's scene, in place of its own.
    Lights,
}

impl Axis {
    pub const NAMES: [(Axis, &'static str); 5] = [
        (Axis::Resolution, "resolution"),
        (Axis::Samples, "samples"),
        (Axis::Triangles, "triangles"),
        (Axis::Materials, "materials"),
        (Axis::Lights, "lights"),
    ];

    pub fn name(self) -> &'static str {
        let found = Axis::NAMES.into_iter().find(|(axis, _)| *axis == self);
        found.map_or("", |(_, name)| name)
    }

    /// What is tried; of triangles about that many.
    pub fn values(self) -> &'static [u32] {
        match self {
            Axis::Resolution => &[128, 256, 512, 1024, 2048, 4096],
            Axis::Samples => &[1, 4, 16, 64, 256],
            Axis::Triangles => &[10_000, 100_000, 1_000_000],
            Axis::Materials | Axis::Lights => &[1, 4, 16, 64],
        }
    }

    /// Samples of each pixel in a repeat.
    fn samples(self, value: u32) -> u32 {
        match self {
            Axis::Resolution if value > 512 => 1,
            Axis::Samples => value,
            _ => 4,
        }
    }
}

/// Times at one value.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Pixels of a side, samples, triangles, materials or lights.
    pub value: u64,
    pub triangles: u64,
    pub pixels: u64,
    pub samples: u32,
    /// Making the scene with its BVH (ms); none where it is the caller's.
    pub scene: Option<f64>,
    /// Making the renderer: preparation, pipelines, buffers (ms).
    pub renderer: f64,
    /// Rendering all samples (ms), the median of the repeats.
    pub render: f64,
    /// Each kernel's time of all samples (ms), of the same repeat; none on a device without timestamps.
    pub kernels: Vec<(String, f64)>,
    /// Bytes of all buffers on the device.
    pub device_bytes: u64,
}

impl Point {
    /// Of one sample (ms).
    pub fn sample(&self) -> f64 {
        self.render / f64::from(self.samples)
    }
}

/// The points of an axis, and values that could not be.
#[derive(Clone, Debug, PartialEq)]
pub struct Scaling {
    pub axis: Axis,
    pub points: Vec<Point>,
    /// Value, and what stood in its way: memory.
    pub skipped: Vec<(u32, String)>,
}

impl Scaling {
    /// The power of the number of pixels, triangles, materials or lights that the time of a sample grows with, or of the
    /// number of samples that the time of all grows with: the slope of a line through the logarithms, by least squares.
    /// None for fewer than two points.
    pub fn exponent(&self) -> Option<f64> {
        let size = |point: &Point| match self.axis {
            Axis::Resolution => point.pixels as f64,
            _ => point.value as f64,
        };
        slope(self.points.iter().map(|point| (size(point).ln(), self.time(point).ln())))
    }

    /// The last point's such time over the first's.
    pub fn ratio(&self) -> Option<f64> {
        Some(self.time(self.points.last()?) / self.time(self.points.first()?))
    }

    /// What grows: the time of all samples where those are varied; else of one, as not all points have as many.
    fn time(&self, point: &Point) -> f64 {
        if self.axis == Axis::Samples { point.render } else { point.sample() }
    }

    fn json(&self) -> Value {
        let point = |point: &Point| {
            json!({
                "value": point.value, "triangles": point.triangles, "pixels": point.pixels, "samples": point.samples,
                "sceneMs": point.scene, "rendererMs": point.renderer, "renderMs": point.render,
                "sampleMs": point.sample(), "deviceBytes": point.device_bytes,
                "kernelsMs": point.kernels.iter().map(|(name, ms)| (name.clone(), (*ms).into()))
                    .collect::<serde_json::Map<_, _>>(),
            })
        };
        let skipped = |(value, why): &(u32, String)| json!({"value": value, "why": why});
        json!({
            "axis": self.axis.name(), "exponent": self.exponent(), "ratio": self.ratio(),
            "points": self.points.iter().map(point).collect::<Vec<_>>(),
            "skipped": self.skipped.iter().map(skipped).collect::<Vec<_>>(),
        })
    }
}

fn slope(points: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let points: Vec<(f64, f64)> = points.filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
    let count = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(|point| point.0), mean(|point| point.1));
    let square: f64 = points.iter().map(|point| (point.0 - x).powi(2)).sum();
    let product: f64 = points.iter().map(|point| (point.0 - x) * (point.1 - y)).sum();
    (square > 0.0).then(|| product / square)
}

/// Several axes as JSON.
pub fn scalings_json(device: &Device, scalings: &[Scaling]) -> Value {
    json!({
        "schema": "translucent.scaling/1", "about": about(device),
        "scalings": scalings.iter().map(Scaling::json).collect::<Vec<_>>(),
    })
}

/// The same as CSV: a row for each kernel of each point, and one for the whole, whose kernel is empty. Times in ms.
pub fn scalings_csv(scalings: &[Scaling]) -> String {
    let mut text =
        String::from("axis,value,triangles,pixels,samples,scene_ms,renderer_ms,kernel,all_samples_ms,sample_ms\r\n");
    for (axis, point) in scalings.iter().flat_map(|run| run.points.iter().map(|point| (run.axis.name(), point))) {
        let Point { value, triangles, pixels, samples, renderer, .. } = point;
        let scene = point.scene.map_or(String::new(), |ms| ms.to_string());
        let whole = std::iter::once(("", point.render));
        for (kernel, ms) in whole.chain(point.kernels.iter().map(|(name, ms)| (name.as_str(), *ms))) {
            let each = ms / f64::from(*samples);
            // Text that cannot be written to a string does not exist.
            let _ = write!(
                text,
                "{axis},{value},{triangles},{pixels},{samples},{scene},{renderer},{kernel},{ms},{each}\r\n"
            );
        }
    }
    text
}

/// Renders with each of `values` ([`Axis::values`]) and takes the time. Resolution is the settings', or 256 x 256, of
/// samples 128 x 128; a crop and, where the scene is not the caller's, a camera count for nothing. `progress` hears of each
/// value that is done.
///
/// # Errors
/// As [`Renderer::new`] and [`Renderer::render`], but for what memory does not suffice for: that is left out and said;
/// [`Error::Setting`] for values that cannot be.
pub fn scaling(
    device: &Device,
    scene: &Scene,
    settings: &Settings,
    axis: Axis,
    values: &[u32],
    progress: &mut dyn FnMut(u32),
) -> Result<Scaling> {
    let mut found = Scaling { axis, points: vec![], skipped: vec![] };
    for &value in values {
        match point(device, scene, settings, axis, value) {
            Ok(point) => found.points.push(point),
            Err(error @ Error::Memory { .. }) => found.skipped.push((value, error.to_string())),
            Err(error) => return Err(error),
        }
        progress(value);
    }
    Ok(found)
}

fn point(device: &Device, scene: &Scene, settings: &Settings, axis: Axis, value: u32) -> Result<Point> {
    if value == 0 {
        return Err(Error::setting("scaling", format!("{} cannot be 0", axis.name())));
    }
    let timeline = Timeline::new();
    let side = if axis == Axis::Samples { 128 } else { 256 };
    let resolution = match axis {
        Axis::Resolution => Some((value, value)),
        _ => Some(settings.resolution.unwrap_or((side, side))),
    };
    let mut settings = Settings { timeline: Some(timeline.clone()), resolution, crop: None, ..settings.clone() };
    let start = Instant::now();
    let made = match axis {
        Axis::Resolution | Axis::Samples => None,
        Axis::Triangles => Some(spheres(1, 1, value)?),
        Axis::Materials => Some(spheres(SPHERES, value as usize, 300 * SPHERES as u32)?),
        Axis::Lights => Some(lit(scene, value)),
    };
    let own = matches!(axis, Axis::Triangles | Axis::Materials);
    let scene_time = own.then(|| ms(start));
    if own {
        settings.camera = CameraChoice::default();
    }
    let scene = made.as_ref().unwrap_or(scene);
    let start = Instant::now();
    let mut renderer = Renderer::new(device, scene, &settings)?;
    let renderer_time = ms(start);
    let pixels = resolution.map_or(0, |(width, height)| u64::from(width) * u64::from(height));
    if pixels <= WARMED {
        renderer.render(1)?;
    }
    let samples = axis.samples(value);
    let mut repeats: Vec<(f64, Vec<(String, f64)>)> = Vec::new();
    let begin = Instant::now();
    while repeats.is_empty() || repeats.len() < REPEATS && begin.elapsed() < LONG {
        renderer.reset();
        timeline.clear();
        let start = Instant::now();
        renderer.render(samples)?;
        let time = ms(start);
        let kernels = timeline.kernels().into_iter().map(|times| (times.kernel.to_string(), times.total * 1e-6));
        repeats.push((time, kernels.collect()));
    }
    repeats.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (render, kernels) = repeats.swap_remove((repeats.len() - 1) / 2);
    let triangles = scene.triangles.len() as u64;
    Ok(Point {
        value: if axis == Axis::Triangles { triangles } else { value.into() },
        triangles,
        pixels,
        samples,
        scene: scene_time,
        renderer: renderer_time,
        render,
        kernels,
        device_bytes: renderer.buffers().iter().map(|(_, bytes)| bytes).sum(),
    })
}

fn ms(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// The scene under `count` point lights on a circle above it, which shine as much together as one of them.
fn lit(scene: &Scene, count: u32) -> Scene {
    let distance = 3.0 / scene.frame.scale;
    let light = |index: u32| {
        let angle = TAU * f64::from(index) / f64::from(count);
        let away = DVec3::new(angle.cos(), 1.0, angle.sin()).normalize();
        Light {
            name: format!("light {index}"),
            position: scene.frame.centre + distance * away,
            direction: -away,
            intensity: DVec3::splat(distance * distance / f64::from(count)),
            kind: LightKind::Point,
            range: None,
        }
    };
    Scene { lights: (0..count).map(light).collect(), ..scene.clone() }
}

/// Spheres in rows, of about so many triangles together, of so many materials in turn: marble, ever denser.
fn spheres(count: usize, materials: usize, triangles: u32) -> Result<Scene> {
    let row = (count as f64).sqrt().ceil() as usize;
    // A cube's six faces, each of twice n x n triangles.
    let n = (f64::from(triangles) / (12.0 * count as f64)).sqrt().round().max(1.0) as u32;
    let (positions, indices) = sphere(n);
    let mesh = |index: usize| {
        let place = [index % row, index / row].map(|i| 2.5 * (i as f64 - 0.5 * (row as f64 - 1.0)));
        Mesh {
            name: "sphere",
            positions: &positions,
            normals: Some(&positions),
            indices: &indices,
            material: index % materials,
            // A radius of a centimetre.
            transform: DAffine3::from_scale(DVec3::splat(0.01))
                * DAffine3::from_translation(DVec3::new(place[0], place[1], 0.0)),
            ..Mesh::default()
        }
    };
    let marble = Material::from_preset("marble")?;
    let matter = |index: usize| {
        let denser = 1.0 + index as f64 / materials as f64;
        let medium =
            marble.medium.as_ref().map(|medium| Medium::new(medium.sigma_s_prime * denser, medium.sigma_a * denser));
        Material { name: format!("marble {index}"), medium, ..marble.clone() }
    };
    let meshes: Vec<Mesh> = (0..count).map(mesh).collect();
    let mut scene = Scene::from_meshes(&meshes, (0..materials).map(matter).collect(), vec![])?;
    scene.set_environment(Environment::constant(DVec3::ONE)?)?;
    let half = 0.01 * (1.25 * row as f64);
    let lens = Lens::Orthographic { xmag: half, ymag: half };
    scene.cameras = vec![Camera::new("front", DVec3::new(0.0, 0.0, 1.0), -DVec3::Z, DVec3::Y, lens)];
    Ok(scene)
}

/// The unit sphere as a cube of n x n squares a face, blown up: vertices of two faces are the same to the bit.
fn sphere(n: u32) -> (Vec<[f32; 3]>, Vec<u32>) {
    let (mut positions, mut indices) = (vec![], vec![]);
    let at = |i: u32| 2.0 * f64::from(i) / f64::from(n) - 1.0;
    for face in 0..6 {
        let (axis, side) = (face % 3, if face < 3 { 1.0 } else { -1.0 });
        let first = positions.len() as u32;
        for j in 0..=n {
            for i in 0..=n {
                let mut point = DVec3::ZERO;
                point[axis] = side;
                point[(axis + 1) % 3] = at(i);
                point[(axis + 2) % 3] = at(j);
                positions.push(point.normalize().as_vec3().to_array());
            }
        }
        for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
            let a = first + j * (n + 1) + i;
            let (b, c, d) = (a + 1, a + n + 2, a + n + 1);
            indices.extend(if side > 0.0 { [a, b, c, a, c, d] } else { [a, c, b, a, d, c] });
        }
    }
    (positions, indices)
}
