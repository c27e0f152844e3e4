//! The radii that the sampling kernel draws on the device, beside R(r) and its distribution function.

use super::{Axis, Figure, Matter, Panel, Point, Series, Setup, figure::geometric, scene, scenes};
use crate::{
    error::Result,
    gpu::{Bindings, Buffer, Kernel, Layout, Location, Recorder, download, upload},
    prepare::prepare,
    reference::{profile::Profile, random, step},
    render::SPIRV,
    settings::{Projection, Settings},
    shared::{BATCHES, Probe, Slot, Step},
};
use glam::DVec3;
use std::f64::consts::PI;

/// Pixels of an edge; each draws one radius a sample.
const SIZE: u32 = 128;
/// Ends of the rings over the mean free path, and rings.
const RADII: (f64, f64) = (0.1, 30.0);
const RINGS: usize = 24;

/// R(r) and its distribution function, each channel alone.
pub fn profile(setup: &Setup) -> Result<Figure> {
    let (mut densities, mut shares, mut notes) = (vec![], vec![], vec![]);
    let path = setup.matters[0].mean_free_path();
    for matter in setup.matters {
        for (c, name) in setup.channels(matter) {
            let profile = matter.profile(c);
            let radii = radii(setup, &matter.grey(c))?;
            let ends = geometric(RADII.0 * path[c], RADII.1 * path[c], RINGS + 1);
            let fine = geometric(ends[0], ends[RINGS], 200);
            densities.push(Series {
                name: name.clone(),
                points: (0..RINGS).map(|ring| density(&profile, &radii, ends[ring], ends[ring + 1])).collect(),
                curve: fine.iter().map(|r| (*r, profile.rd(*r))).collect(),
            });
            shares.push(Series {
                name: name.clone(),
                points: ends.iter().step_by(2).map(|end| share(&profile, &radii, *end)).collect(),
                curve: fine.iter().map(|r| (*r, profile.cdf(*r))).collect(),
            });
            let (total, path, count) = (profile.total(), path[c], radii.len());
            notes.push(format!("{name}: total {total:.6}, mean free path {path:.4} mm, {count} radii drawn"));
        }
    }
    let density = Panel {
        name: "profile".into(),
        x: Axis::logarithmic("r [mm]"),
        y: Axis::logarithmic("R(r) [mm\u{207b}\u{b2}]"),
        series: densities,
    };
    let share = Panel {
        name: "within r".into(),
        x: Axis::logarithmic("r [mm]"),
        y: Axis::linear("light within r"),
        series: shares,
    };
    Ok(Figure { title: setup.title("Profile and sampler"), panels: vec![density, share], notes })
}

/// How many of ascending radii lie within one.
fn within(radii: &[f64], end: f64) -> f64 {
    radii.partition_point(|r| *r < end) as f64
}

/// Radii of a ring over its area, as R(r). Where few radii fall, the closed form's probability tells their spread.
fn density(profile: &Profile, radii: &[f64], a: f64, b: f64) -> Point {
    let (total, count) = (profile.total(), radii.len() as f64);
    let scale = total / (PI * (b - a) * (b + a));
    let p = (profile.cdf(b) - profile.cdf(a)) / total;
    let measured = (within(radii, b) - within(radii, a)) / count * scale;
    Point { x: (a * b).sqrt(), measured, error: (p * (1.0 - p) / count).sqrt() * scale, expected: p * scale }
}

/// Radii within one, as share of the light.
fn share(profile: &Profile, radii: &[f64], end: f64) -> Point {
    let (total, count) = (profile.total(), radii.len() as f64);
    let p = profile.cdf(end) / total;
    let error = total * (p * (1.0 - p) / count).sqrt();
    Point { x: end, measured: within(radii, end) / count * total, error, expected: p * total }
}

/// Radii [mm] that the kernel draws for grey matter, ascending.
fn radii(setup: &Setup, matter: &Matter) -> Result<Vec<f64>> {
    let size = matter.mean_free_path().x * 100.0;
    let mut mesh = scenes::Mesh::default();
    mesh.cuboid(DVec3::new(-size, -size, -size), DVec3::new(size, size, 0.0), 1);
    let eye = scenes::Eye { eye: DVec3::Z * size, at: DVec3::ZERO, lens: 0.1 };
    let scene = scene(&scenes::gltf(&[(mesh, 0)], std::slice::from_ref(&matter.material), &[], &eye))?;
    let settings = Settings {
        resolution: Some((SIZE, SIZE)),
        projection: Projection::Normal,
        radius_tail: 0.0,
        variance: false,
        seed: setup.seed,
        model: matter.model,
        reuse: Some(1),
        ..Settings::default()
    };
    let prepared = prepare(&scene, &settings)?;
    let pixels = SIZE * SIZE;
    let device = setup.device;
    let per_pixel = |slot: Slot, elements: u32| (slot, u64::from(elements) * slot.stride() as u64);
    let surfaces = per_pixel(Slot::Surfaces, pixels * BATCHES);
    let probes = per_pixel(Slot::Probes, pixels);
    let mut buffers = vec![];
    let data: [(Slot, &[u8]); 6] = [
        (Slot::Views, bytemuck::bytes_of(&prepared.view)),
        (Slot::Nodes, bytemuck::cast_slice(&scene.nodes)),
        (Slot::Triangles, bytemuck::cast_slice(&scene.triangles)),
        (Slot::Shadings, bytemuck::cast_slice(&scene.shadings)),
        (Slot::Materials, bytemuck::cast_slice(&prepared.materials)),
        (Slot::Profiles, bytemuck::cast_slice(&prepared.profiles)),
    ];
    for (slot, data) in data.into_iter().filter(|(_, data)| !data.is_empty()) {
        let buffer = Buffer::new(device, slot.name(), data.len() as u64, Location::Device)?;
        upload(device, &buffer, data)?;
        buffers.push((slot, buffer));
    }
    for (slot, bytes) in [surfaces, probes] {
        buffers.push((slot, Buffer::new(device, slot.name(), bytes, Location::Device)?));
    }
    let bound: Vec<_> = buffers.iter().map(|(slot, buffer)| (*slot, buffer)).collect();
    let bindings = Bindings::new(&Layout::new(device)?, &bound)?;
    let kernel = |stem: &'static str| {
        let (_, spirv) = SPIRV.iter().find(|(name, _)| *name == stem).expect("the kernel exists");
        Kernel::shared(device, stem, spirv, &prepared.features, settings.workgroup)
    };
    let (primary, sample) = (kernel("primary")?, kernel("sample")?);
    let mut recorder = Recorder::new(device)?;
    let mut radii = vec![];
    let (_, probes) = buffers.last().expect("the probes are the last");
    for sample_index in 0..setup.samples(16) {
        let step =
            Step { point: random::point(sample_index), ..step(&prepared.inputs(&scene), sample_index, 0..SIZE, 0..1) };
        recorder.begin()?;
        recorder.dispatch(&primary, &bindings, pixels, &step);
        recorder.dispatch(&sample, &bindings, pixels, &step);
        recorder.submit_and_wait()?;
        let drawn: Vec<Probe> = bytemuck::pod_collect_to_vec(&download(device, probes, probes.bytes())?);
        radii.extend(drawn.iter().map(|probe| f64::from(probe.radius) / scene.frame.scale / super::MM));
    }
    radii.sort_by(f64::total_cmp);
    Ok(radii)
}
