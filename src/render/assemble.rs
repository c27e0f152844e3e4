//! The finished image: means and variance from `resolve`, AOVs at the pixels' centres, and what made it. Every value is
//! finite: what exceeds f32 is its largest number.

use super::{Band, Renderer, spirv_hash};
use crate::{
    error::Result,
    gpu::{Buffer, download_to, give_back_freed},
    image::{Attribute, Channel, Image},
    scene::{Camera, Frame},
    settings::{Cache, Cloud, Integrator, Irradiance},
    shared::{BATCHES, MISS, Pixel, Shading, Slot, Step, Surface, Triangle, View},
    timeline::{self, Work},
};
use glam::{DVec3, Vec3};
use std::collections::BTreeMap;

/// What becomes of the sums when an image is made of them.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Sums {
    Kept,
    Freed,
}

/// Resolves every band and gathers the channels of `interface`: RGBA, subsurface, reflection, variance, N, P, Z,
/// samples, material.
pub fn image(renderer: &mut Renderer, sums: Sums) -> Result<Image> {
    let _span = timeline::begin(&renderer.settings.timeline, "image");
    renderer.catch_up();
    let view = renderer.prepared.view;
    let rows = renderer.prepared.rows.clone();
    let count = (view.crop_width * (rows.end - rows.start)) as usize;
    let range = renderer.samples();
    let has_variance = renderer.prepared.features.batches != 0 && range.end - range.start >= BATCHES;
    let mut channels = Channels::new(count, has_variance);
    let (mut invalid, mut total, mut most) = (0u64, 0u64, 0);
    // First the band on the device, which need not go to the host then.
    let mut order: Vec<usize> = (0..renderer.bands.len()).collect();
    order.sort_by_key(|band| renderer.resident != Some(*band));
    for band in order {
        renderer.make_resident(band)?;
        let Band { pixels, first_row, ref own, .. } = renderer.bands[band];
        let own = own.start as usize..own.end as usize;
        let first = ((first_row - rows.start) * view.crop_width) as usize + own.start;
        let step =
            Step { first_row, pixel_count: pixels, pixel_centre: 1, range_begin: range.start, ..Step::default() };
        // The G-buffer of batch 0 is overwritten; its stratum is traced anew before the next sample.
        renderer.strata[0] = None;
        let Renderer { recorder, kernels, bindings, .. } = renderer;
        let recorder = super::own(recorder)?;
        recorder.begin()?;
        for kernel in [&kernels.resolve, &kernels.primary].into_iter().flatten() {
            recorder.dispatch(kernel, bindings, pixels, &step);
        }
        recorder.submit_and_wait()?;
        renderer.note("resolve", Work { band: band as u32, pixels, ..Work::default() });
        let span = timeline::begin(&renderer.settings.timeline, "download");
        let resolved: Vec<Pixel> = read(renderer, Slot::Pixels, pixels as usize)?;
        let surfaces: Vec<Surface> = read(renderer, Slot::Surfaces, pixels as usize)?;
        drop(span);
        let (resolved, surfaces) = (&resolved[own.clone()], &surfaces[own]);
        for pixel in resolved {
            invalid += u64::from(pixel.invalid);
            total += u64::from(pixel.samples);
            most = most.max(pixel.samples);
        }
        let centres = Centres::of(renderer)?;
        for (block, first) in (0..resolved.len()).step_by(BLOCK).zip((first..).step_by(BLOCK)) {
            let block = block..(block + BLOCK).min(resolved.len());
            let made = resolved[block.clone()].iter().zip(&surfaces[block]);
            let made = made.map(|(pixel, surface)| values(pixel, &centres.at(surface)));
            channels.set(first, &made.collect::<Vec<_>>());
        }
        if sums == Sums::Freed {
            renderer.resident = None;
            renderer.bands[band].free(range.start);
            give_back_freed();
        }
    }
    let counts = if renderer.adaptive {
        Counts { begin: range.start, end: range.start + most, mean: (total as f64 / count as f64).round() as u32 }
    } else {
        Counts { begin: range.start, end: range.end, mean: range.end - range.start }
    };
    let [x0, y0, x1, y1] = renderer.prepared.shown;
    let mut channels = channels.list;
    if count != ((x1 - x0) * (y1 - y0)) as usize {
        let width = view.crop_width as usize;
        let columns = (x0 - view.crop_x) as usize..(x1 - view.crop_x) as usize;
        let shown = (y0 - rows.start) as usize..(y1 - rows.start) as usize;
        for channel in &mut channels {
            let of_row = |row| &channel.data[row * width..][columns.clone()];
            channel.data = shown.clone().flat_map(of_row).copied().collect();
        }
    }
    Ok(Image {
        width: x1 - x0,
        height: y1 - y0,
        origin: (x0, y0),
        full: (view.width, view.height),
        channels,
        attributes: attributes(renderer, &counts, invalid, has_variance),
    })
}

fn read<T: bytemuck::Pod>(renderer: &Renderer, slot: Slot, count: usize) -> Result<Vec<T>> {
    let Some(buffer) = renderer.buffer(slot) else { return Ok(vec![]) };
    let mut elements = vec![T::zeroed(); count];
    download_to(&renderer.device, buffer, bytemuck::cast_slice_mut(&mut elements))?;
    Ok(elements)
}

/// All elements of a slot.
pub(super) fn whole<T: bytemuck::Pod>(renderer: &Renderer, slot: Slot) -> Result<Vec<T>> {
    let bytes = renderer.buffer(slot).map_or(0, Buffer::bytes) as usize;
    read(renderer, slot, bytes / size_of::<T>())
}

/// Elements of a slot: in place where the host reads it so, else copied.
enum Elements<'a, T> {
    Mapped(&'a Buffer),
    Copied(Vec<T>),
}

impl<'a, T: bytemuck::Pod> Elements<'a, T> {
    fn of(renderer: &'a Renderer, slot: Slot) -> Result<Elements<'a, T>> {
        match renderer.buffer(slot).filter(|buffer| buffer.is_mapped()) {
            Some(buffer) => Ok(Elements::Mapped(buffer)),
            None => whole(renderer, slot).map(Elements::Copied),
        }
    }

    fn get(&self, index: u32) -> T {
        match self {
            Elements::Mapped(buffer) => buffer.read_one(index as usize),
            Elements::Copied(elements) => elements[index as usize],
        }
    }
}

/// What the middle of a pixel shows.
struct Centre {
    normal: Vec3,
    /// World position (m).
    position: DVec3,
    /// Distance along the view axis (m).
    depth: f64,
    /// Index of the material, -1 for none.
    material: i32,
}

/// What the middles of pixels are made of.
struct Centres<'a> {
    view: &'a View,
    camera: &'a Camera,
    frame: Frame,
    // The device has the geometry already, so the host need not keep it while rendering.
    triangles: Elements<'a, Triangle>,
    shadings: Elements<'a, Shading>,
}

impl<'a> Centres<'a> {
    fn of(renderer: &'a Renderer) -> Result<Centres<'a>> {
        let prepared = &renderer.prepared;
        Ok(Centres {
            view: &prepared.view,
            camera: &prepared.camera,
            frame: renderer.frame,
            triangles: Elements::of(renderer, Slot::Triangles)?,
            shadings: Elements::of(renderer, Slot::Shadings)?,
        })
    }

    fn at(&self, surface: &Surface) -> Centre {
        if surface.triangle == MISS {
            return Centre { normal: Vec3::ZERO, position: DVec3::ZERO, depth: 0.0, material: -1 };
        }
        let (triangle, shading) = (self.triangles.get(surface.triangle), self.shadings.get(surface.triangle));
        let [b1, b2] = surface.barycentric.to_array();
        let normal = (shading.normal0 * (1.0 - b1 - b2) + shading.normal1 * b1 + shading.normal2 * b2).normalize();
        let position = surface.position.as_dvec3() / self.frame.scale + self.frame.centre;
        // Towards the eye, as the kernels turn it.
        let to = self.view.forward + self.view.perspective * (surface.position - self.view.pivot);
        let [_, edge1, edge2] = triangle.corner_and_edges();
        let inner = edge1.cross(edge2).dot(to.as_dvec3()) > 0.0;
        Centre {
            normal: if inner { -normal } else { normal },
            position,
            depth: (position - self.camera.eye).dot(self.camera.forward),
            material: shading.material as i32,
        }
    }
}

const NAMES: [&str; 19] = [
    "R",
    "G",
    "B",
    "A",
    "subsurface.R",
    "subsurface.G",
    "subsurface.B",
    "reflection.R",
    "reflection.G",
    "reflection.B",
    "N.X",
    "N.Y",
    "N.Z",
    "P.X",
    "P.Y",
    "P.Z",
    "Z",
    "samples.Y",
    "material.Y",
];

/// Pixels whose values are put into the channels at a time: some megabytes, which caches hold.
const BLOCK: usize = 1 << 14;
const MOST_CHANNELS: usize = NAMES.len() + VARIANCE.len();

const VARIANCE: [&str; 3] = ["variance.R", "variance.G", "variance.B"];

/// Names of the channels in the order in which they are filled.
fn names(has_variance: bool) -> impl Iterator<Item = &'static str> {
    NAMES.into_iter().chain(VARIANCE.into_iter().filter(move |_| has_variance))
}

/// Bytes of the image for each pixel.
pub fn bytes_per_pixel(has_variance: bool) -> u64 {
    (names(has_variance).count() * size_of::<f32>()) as u64
}

/// The channels in the order in which they are filled.
struct Channels {
    list: Vec<Channel>,
}

impl Channels {
    fn new(count: usize, has_variance: bool) -> Channels {
        let channel = |name: &'static str| Channel { name: name.into(), data: vec![0.0; count] };
        Channels { list: names(has_variance).map(channel).collect() }
    }

    /// Sets the pixels from `first` on.
    fn set(&mut self, first: usize, pixels: &[[f32; MOST_CHANNELS]]) {
        for (number, channel) in self.list.iter_mut().enumerate() {
            let data = &mut channel.data[first..first + pixels.len()];
            data.iter_mut().zip(pixels).for_each(|(value, pixel)| *value = pixel[number]);
        }
    }
}

/// A pixel's values in the order of [`NAMES`], then [`VARIANCE`].
fn values(pixel: &Pixel, centre: &Centre) -> [f32; MOST_CHANNELS] {
    // Two finite layers may exceed f32 together.
    let light = (pixel.subsurface + pixel.reflection).min(Vec3::MAX);
    let of_centre = [centre.normal, centre.position.as_vec3()];
    let mut values = [0.0; MOST_CHANNELS];
    values[..3].copy_from_slice(&light.to_array());
    values[3] = pixel.alpha;
    for (at, vector) in (4..).step_by(3).zip([pixel.subsurface, pixel.reflection].into_iter().chain(of_centre)) {
        values[at..at + 3].copy_from_slice(&vector.to_array());
    }
    values[16..19].copy_from_slice(&[centre.depth as f32, pixel.samples as f32, centre.material as f32]);
    values[19..].copy_from_slice(&pixel.variance.to_array());
    values
}

/// The settings that must agree between parts of one image; the seed stands apart.
pub fn described(renderer: &Renderer) -> serde_json::Value {
    let settings = &renderer.settings;
    serde_json::json!({
        "resolution": [renderer.prepared.view.width, renderer.prepared.view.height],
        "camera": renderer.prepared.camera.name,
        "directions": settings.directions,
        "integrator": settings.integrator.to_string(),
        // Points, opening and samples.
        "cloud": (settings.integrator == Integrator::Cloud).then(|| {
            let Cloud { points, opening, samples } = settings.cloud;
            serde_json::json!([points, opening, samples])
        }),
        "reuse": settings.reuse,
        "reproject": settings.reproject.to_string(),
        "irradiance": settings.irradiance.to_string(),
        // Points, samples, spacing and tolerance.
        "cache": (settings.irradiance == Irradiance::Cached).then(|| {
            let Cache { points, samples, spacing, tolerance } = settings.cache;
            serde_json::json!([points, samples, spacing, tolerance])
        }),
        "projection": format!("{:?}", settings.projection).to_lowercase(),
        "normalisation": format!("{:?}", settings.normalisation).to_lowercase(),
        "model": settings.model.to_string(),
        // Null where the file decides.
        "renormalise": settings.directional.map(|directional| directional.renormalise),
        "reciprocal": settings.directional.map(|directional| directional.reciprocal),
        "kappa": settings.directional.map(|directional| directional.kappa),
        "curvature": settings.curvature,
        "singleScattering": settings.single_scattering.to_string(),
        "radiusTail": settings.radius_tail,
        "showEnvironment": settings.show_environment,
    })
}

/// Samples of an image.
struct Counts {
    begin: u32,
    /// Of the pixel with the most.
    end: u32,
    mean: u32,
}

fn attributes(renderer: &Renderer, counts: &Counts, invalid: u64, has_variance: bool) -> BTreeMap<String, Attribute> {
    let settings = &renderer.settings;
    let info = renderer.device.info();
    let mut attributes: Vec<(&str, Attribute)> = vec![
        ("samples", Attribute::Integer(counts.mean as i32)),
        ("sampleBegin", Attribute::Integer(counts.begin as i32)),
        ("sampleEnd", Attribute::Integer(counts.end as i32)),
        // EXR has no unsigned integers.
        ("seed", Attribute::Text(settings.seed.to_string())),
        ("version", Attribute::Text(env!("CARGO_PKG_VERSION").into())),
        ("spirvHash", Attribute::Text(spirv_hash())),
        ("device", Attribute::Text(info.name.clone())),
        ("driver", Attribute::Text(info.driver.clone())),
        ("sceneHash", Attribute::Text(renderer.scene_hash.clone())),
        ("settings", Attribute::Text(described(renderer).to_string())),
        ("invalidSamples", Attribute::Integer(invalid.min(i32::MAX as u64) as i32)),
    ];
    if let Some(outcome) = renderer.outcome {
        attributes.push(("stop", Attribute::Text(format!("{:?}", outcome.stop).to_lowercase())));
        attributes.extend(outcome.error.map(|error| ("error", Attribute::Float(error))));
    }
    if renderer.adaptive {
        attributes.push(("adaptive", Attribute::Text("pixels have different numbers of samples: samples.Y".into())));
    }
    if !has_variance {
        let why = format!("absent: fewer than {BATCHES} samples");
        attributes.push(("variance", Attribute::Text(why)));
    }
    attributes.into_iter().map(|(name, value)| (format!("translucent.{name}"), value)).collect()
}
