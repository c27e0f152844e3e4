//! The finished image: means and variance from `resolve`, AOVs at the pixels' centres, and what made it. Every value is
//! finite: what exceeds f32 is its largest number.

use super::{Band, Renderer, spirv_hash};
use crate::{
    error::Result,
    gpu::{Buffer, download_to, give_back_freed},
    image::{Attribute, Channel, Image},
    settings::{Cache, Cloud, Integrator, Irradiance},
    shared::{BATCHES, MISS, Pixel, Shading, Slot, Step, Surface, Triangle},
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

    // The device has the geometry already, so the host need not keep it while rendering.
    let geometry = Geometry { triangles: copy(renderer, Slot::Triangles)?, shadings: copy(renderer, Slot::Shadings)? };
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
        for (index, (pixel, surface)) in (first..).zip(resolved[own.clone()].iter().zip(&surfaces[own])) {
            invalid += u64::from(pixel.invalid);
            total += u64::from(pixel.samples);
            most = most.max(pixel.samples);
            channels.set(index, pixel, &centre(renderer, &geometry, surface));
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

/// The same where the host does not read them in place.
fn copy<T: bytemuck::Pod>(renderer: &Renderer, slot: Slot) -> Result<Option<Vec<T>>> {
    if renderer.buffer(slot).is_some_and(Buffer::is_mapped) { Ok(None) } else { whole(renderer, slot).map(Some) }
}

/// An element of a slot, or of its copy.
fn element<T: bytemuck::Pod>(renderer: &Renderer, slot: Slot, copy: &Option<Vec<T>>, index: u32) -> T {
    let in_place = || renderer.buffer(slot).expect("it is mapped").read_one(index as usize);
    copy.as_ref().map_or_else(in_place, |elements| elements[index as usize])
}

/// Copies of the scene's triangles where there have to be.
struct Geometry {
    triangles: Option<Vec<Triangle>>,
    shadings: Option<Vec<Shading>>,
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

fn centre(renderer: &Renderer, geometry: &Geometry, surface: &Surface) -> Centre {
    if surface.triangle == MISS {
        return Centre { normal: Vec3::ZERO, position: DVec3::ZERO, depth: 0.0, material: -1 };
    }
    let triangle = element(renderer, Slot::Triangles, &geometry.triangles, surface.triangle);
    let shading = element(renderer, Slot::Shadings, &geometry.shadings, surface.triangle);
    let [b1, b2] = surface.barycentric.to_array();
    let normal = (shading.normal0 * (1.0 - b1 - b2) + shading.normal1 * b1 + shading.normal2 * b2).normalize();
    let frame = renderer.frame;
    let position = surface.position.as_dvec3() / frame.scale + frame.centre;
    let camera = &renderer.prepared.camera;
    // Towards the eye, as the kernels turn it.
    let view = &renderer.prepared.view;
    let to = view.forward + view.perspective * (surface.position - view.pivot);
    let [_, edge1, edge2] = triangle.corner_and_edges();
    let inner = edge1.cross(edge2).dot(to.as_dvec3()) > 0.0;
    Centre {
        normal: if inner { -normal } else { normal },
        position,
        depth: (position - camera.eye).dot(camera.forward),
        material: shading.material as i32,
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
    has_variance: bool,
}

impl Channels {
    fn new(count: usize, has_variance: bool) -> Channels {
        let channel = |name: &'static str| Channel { name: name.into(), data: vec![0.0; count] };
        Channels { list: names(has_variance).map(channel).collect(), has_variance }
    }

    fn set(&mut self, index: usize, pixel: &Pixel, centre: &Centre) {
        // Two finite layers may exceed f32 together.
        let light = (pixel.subsurface + pixel.reflection).min(Vec3::MAX);
        let position = centre.position.as_vec3();
        let mut values = Vec::with_capacity(self.list.len());
        values.extend(light.to_array());
        values.push(pixel.alpha);
        values.extend(pixel.subsurface.to_array());
        values.extend(pixel.reflection.to_array());
        values.extend(centre.normal.to_array());
        values.extend(position.to_array());
        values.extend([centre.depth as f32, pixel.samples as f32, centre.material as f32]);
        if self.has_variance {
            values.extend(pixel.variance.to_array());
        }
        for (channel, value) in self.list.iter_mut().zip(values) {
            channel.data[index] = value;
        }
    }
}

/// The settings that must agree between parts of one image; the seed stands apart.
pub fn described(renderer: &Renderer) -> serde_json::Value {
    let settings = &renderer.settings;
    serde_json::json!({
        "resolution": [renderer.prepared.view.width, renderer.prepared.view.height],
        "camera": renderer.prepared.camera.name,
        "directions": settings.directions,
        "integrator": settings.integrator.to_string(),
        // Points, opening, spacing and samples.
        "cloud": (settings.integrator == Integrator::Cloud).then(|| {
            let Cloud { points, opening, spacing, samples } = settings.cloud;
            serde_json::json!([points, opening, spacing, samples])
        }),
        "reuse": settings.tile_width(),
        "precision": settings.precision.to_string(),
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
