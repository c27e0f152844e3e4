//! How long it takes to a relMSE of 1 %: a slab under a lamp, a ball of skin under a lamp and in the sun, and Spot in marble
//! of three densities, at 512x512. A new device, renderer and image for each number of samples, from meshes in memory to an
//! EXR file, the shortest of three runs, since what else a machine does only adds; relMSE (as `render --error` has it) is
//! against a converged image of another seed.
//!
//!     cargo run --release --example equal_error [SAMPLES OF THE CONVERGED IMAGE [SCENE [METHOD]]]
//!
//! Or the most memory that one such run takes, and its time:
//!
//!     cargo run --release --example equal_error peak SCENE METHOD SAMPLES [PIXELS OF A BAND]

use glam::{DAffine3, DVec3};
use std::{collections::HashMap, error::Error, f64::consts::PI, time::Instant};
use translucent::{
    Device, DeviceOptions, Image, Model, Renderer, Scene, Settings,
    scene::{Camera, Lens, Light, LightKind, Material, Medium, Mesh},
    settings::{Integrator, Irradiance},
};

const NAMES: [&str; 6] = ["slab", "ball", "ball in the sun", "dense Spot", "Spot", "thin Spot"];
/// Numbers of samples that are tried.
const SAMPLES: [u32; 16] = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 16, 20, 24, 32];
/// The relMSE that is enough.
const ENOUGH: f64 = 0.01;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Vertices (mm), normals and triangles.
#[derive(Clone, Default)]
struct Shape {
    positions: Vec<DVec3>,
    normals: Vec<DVec3>,
    triangles: Vec<[usize; 3]>,
}

impl Shape {
    /// A box from one corner to the opposite one.
    fn cuboid(low: DVec3, high: DVec3) -> Shape {
        let mut shape = Shape::default();
        for (axis, side) in (0..3).flat_map(|axis| [(axis, 0.0), (axis, 1.0)]) {
            let first = shape.positions.len();
            for (u, v) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
                let mut share = DVec3::ZERO;
                (share[axis], share[(axis + 1) % 3], share[(axis + 2) % 3]) = (side, u, v);
                shape.positions.push(low + share * (high - low));
                shape.normals.push(DVec3::AXES[axis] * (2.0 * side - 1.0));
            }
            let [b, d] = if side > 0.0 { [1, 3] } else { [3, 1] };
            shape.triangles.extend([[first, first + b, first + 2], [first, first + 2, first + d]]);
        }
        shape
    }

    /// An octahedron, divided and blown up: 8 x 4^`divisions` triangles.
    fn ball(radius: f64, divisions: u32) -> Shape {
        let mut shape = Shape { positions: [DVec3::AXES, DVec3::AXES.map(|axis| -axis)].concat(), ..Shape::default() };
        for octant in 0..8usize {
            let corner = |axis: usize| if octant >> axis & 1 == 0 { axis } else { axis + 3 };
            let [a, b, c] = [corner(0), corner(1), corner(2)];
            shape.triangles.push(if octant.count_ones() % 2 == 0 { [a, b, c] } else { [a, c, b] });
        }
        for _ in 0..divisions {
            shape = shape.divided();
        }
        shape.normals = shape.positions.iter().map(|point| point.normalize()).collect();
        shape.positions = shape.normals.iter().map(|normal| radius * *normal).collect();
        shape
    }

    /// Spot, its triangles divided twice by Loop's rules; its longest side is 20 mm, it stands upright along z.
    fn spot() -> Outcome<Shape> {
        let scene = Scene::load("assets/spot.glb")?;
        let mut places: HashMap<[u32; 3], usize> = HashMap::new();
        let mut shape = Shape::default();
        for triangle in &scene.triangles {
            let corners = triangle.vertices.map(|corner| {
                *places.entry(corner.to_array().map(f32::to_bits)).or_insert_with(|| {
                    shape.positions.push(corner.as_dvec3());
                    shape.positions.len() - 1
                })
            });
            shape.triangles.push(corners);
        }
        shape = shape.divided().divided();
        let low = shape.positions.iter().copied().reduce(DVec3::min).ok_or("an empty mesh")?;
        let high = shape.positions.iter().copied().reduce(DVec3::max).ok_or("an empty mesh")?;
        let scale = 20.0 / (high - low).max_element();
        let turn = glam::DMat3::from_rotation_z(-0.6);
        for point in &mut shape.positions {
            let at = scale * (*point - (low + high) / 2.0);
            *point = turn * DVec3::new(at.x, -at.z, at.y);
        }
        shape.normals = vec![DVec3::ZERO; shape.positions.len()];
        for corners in &shape.triangles {
            let [a, b, c] = corners.map(|index| shape.positions[index]);
            corners.iter().for_each(|&index| shape.normals[index] += (b - a).cross(c - a));
        }
        Ok(shape)
    }

    /// Four triangles for each (C. Loop, "Smooth subdivision surfaces based on triangles", 1987). The mesh is closed.
    fn divided(&self) -> Shape {
        let mut around = vec![(DVec3::ZERO, 0u32); self.positions.len()];
        let mut edges: HashMap<(usize, usize), (usize, DVec3)> = HashMap::new();
        let mut positions = self.positions.clone();
        for [a, b, c] in &self.triangles {
            for (from, to, opposite) in [(*a, *b, *c), (*b, *c, *a), (*c, *a, *b)] {
                around[from] = (around[from].0 + self.positions[to], around[from].1 + 1);
                let edge = edges.entry((from.min(to), from.max(to))).or_insert_with(|| {
                    positions.push(0.375 * (self.positions[from] + self.positions[to]));
                    (positions.len() - 1, DVec3::ZERO)
                });
                edge.1 += 0.125 * self.positions[opposite];
            }
        }
        for (place, opposite) in edges.values() {
            positions[*place] += *opposite;
        }
        for (place, (sum, count)) in around.iter().enumerate() {
            let count = f64::from(*count);
            let share = if count == 3.0 { 3.0 / 16.0 } else { 3.0 / (8.0 * count) };
            positions[place] = (1.0 - count * share) * self.positions[place] + share * *sum;
        }
        let middle = |from: usize, to: usize| edges[&(from.min(to), from.max(to))].0;
        let four = |&[a, b, c]: &[usize; 3]| {
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        };
        Shape { positions, normals: vec![], triangles: self.triangles.iter().flat_map(four).collect() }
    }

    /// A disc of 64 triangles with the area of a circle.
    fn disc(centre: DVec3, facing: DVec3, radius: f64) -> Shape {
        const SIDES: usize = 64;
        let normal = facing.normalize();
        let (u, v) = normal.any_orthonormal_pair();
        let (u, v) = if u.cross(v).dot(normal) > 0.0 { (u, v) } else { (v, u) };
        let step = 2.0 * PI / SIDES as f64;
        let outer = radius * (step / step.sin()).sqrt();
        let rim = (0..SIDES).map(|k| centre + outer * ((k as f64 * step).cos() * u + (k as f64 * step).sin() * v));
        Shape {
            positions: std::iter::once(centre).chain(rim).collect(),
            normals: vec![normal; SIDES + 1],
            triangles: (0..SIDES).map(|k| [0, 1 + k, 1 + (k + 1) % SIDES]).collect(),
        }
    }
}

type Arrays = (Vec<[f32; 3]>, Vec<[f32; 3]>, Vec<u32>);

/// What is rendered, as an application has it.
struct Subject {
    /// Positions, normals and indices of the body, and of a lamp.
    arrays: Vec<Arrays>,
    materials: Vec<Material>,
    lights: Vec<Light>,
    camera: Camera,
}

fn subject(name: &str) -> Outcome<Subject> {
    let marble = |density: f64| {
        let medium = Medium::new(
            1e3 * density * DVec3::new(2.19, 2.62, 3.0),
            1e3 * density * DVec3::new(0.0021, 0.0041, 0.0071),
        );
        Material::translucent("marble", medium, 1.5)
    };
    let far = |direction: DVec3| (100.0 * direction.normalize(), 36.4, 8.547);
    let aside = DVec3::new(-1.0, -0.5, 0.7);
    let (shape, matter, lamp) = match name {
        "slab" => {
            let shape = Shape::cuboid(DVec3::new(-100.0, -100.0, -100.0), DVec3::new(100.0, 100.0, 0.0));
            (shape, marble(1.0), Some((DVec3::new(0.0, 0.0, 6.0), 2.0, 50.0)))
        }
        "ball" => (Shape::ball(10.0, 6), Material::from_preset("skin1")?, Some(far(aside))),
        "ball in the sun" => (Shape::ball(10.0, 6), Material::from_preset("skin1")?, None),
        _ => {
            let density = if name == "dense Spot" {
                5.0
            } else if name == "Spot" {
                1.0
            } else {
                0.2
            };
            (Shape::spot()?, marble(density), Some(far(DVec3::new(-1.0, -0.3, 0.6))))
        }
    };
    let lamp = lamp.map(|(place, radius, radiance)| (Shape::disc(place, -place, radius), radiance));
    let mut materials = vec![matter];
    materials
        .extend(lamp.iter().map(|(_, radiance)| Material { emission: DVec3::splat(*radiance), ..Material::default() }));
    let shapes: Vec<&Shape> = std::iter::once(&shape).chain(lamp.iter().map(|(disc, _)| disc)).collect();
    let vectors = |list: &[DVec3]| -> Vec<[f32; 3]> { list.iter().map(|vector| vector.as_vec3().to_array()).collect() };
    let arrays: Vec<_> = shapes
        .iter()
        .map(|shape| {
            let indices: Vec<u32> = shape.triangles.iter().flatten().map(|&index| index as u32).collect();
            (vectors(&shape.positions), vectors(&shape.normals), indices)
        })
        .collect();
    let sun = Light {
        name: "sun".into(),
        position: DVec3::ZERO,
        direction: -aside.normalize(),
        intensity: DVec3::splat(PI),
        kind: LightKind::Directional,
        range: None,
    };
    let lights = if lamp.is_none() { vec![sun] } else { vec![] };
    let (eye, degrees) = match name {
        "slab" => (DVec3::new(0.0, -30.0, 30.0), 32.0f64),
        "ball" | "ball in the sun" => (DVec3::new(0.0, -60.0, 0.0), 24.0),
        _ => (DVec3::new(0.0, -60.0, 10.0), 24.0),
    };
    let lens = Lens::Perspective { yfov: degrees.to_radians(), aspect: Some(1.0) };
    Ok(Subject { arrays, materials, lights, camera: Camera::new("camera", 1e-3 * eye, -eye, DVec3::Z, lens) })
}

impl Subject {
    fn scene(&self) -> Outcome<Scene> {
        let numbered = self.arrays.iter().enumerate();
        let meshes: Vec<Mesh> = numbered
            .map(|(material, (positions, normals, indices))| Mesh {
                name: if material == 0 { "body" } else { "lamp" },
                positions,
                normals: Some(normals),
                indices,
                material,
                transform: DAffine3::from_scale(DVec3::splat(1e-3)),
                ..Mesh::default()
            })
            .collect();
        let mut scene = Scene::from_meshes(&meshes, self.materials.clone(), vec![])?;
        scene.lights.clone_from(&self.lights);
        scene.cameras = vec![self.camera.clone()];
        Ok(scene)
    }
}

fn render(scene: Scene, settings: &Settings, samples: u32) -> Outcome<Image> {
    let mut renderer = Renderer::new(&Device::open(&DeviceOptions::default())?, &scene, settings)?;
    // The renderer has what it needs of it.
    drop(scene);
    renderer.render(samples)?;
    Ok(renderer.finish()?)
}

/// What is compared: probes lit by shadow rays, the same with normalised diffusion, by kept light, and a cloud of points.
fn methods() -> [(&'static str, Settings); 4] {
    let sample = Settings { resolution: Some((512, 512)), ..Settings::default() };
    let burley = Settings { model: Model::Burley, ..sample.clone() };
    let cached = Settings { irradiance: Irradiance::Cached, ..sample.clone() };
    let cloud = Settings { integrator: Integrator::Cloud, ..sample.clone() };
    [("sample", sample), ("burley", burley), ("cached", cached), ("cloud", cloud)]
}

/// The most memory that this process had so far (MB), where Linux tells.
fn peak() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kib = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?.split_whitespace().next()?;
    Some(kib.parse::<f64>().ok()? * 1.024e-3)
}

/// From meshes in memory to an EXR file: the image, triangles and seconds.
fn run(subject: &Subject, settings: &Settings, samples: u32) -> Outcome<(Image, usize, f64)> {
    let file = std::env::temp_dir().join(format!("equal_error.{}.exr", std::process::id()));
    let start = Instant::now();
    let scene = subject.scene()?;
    let triangles = scene.triangles.len();
    let image = render(scene, settings, samples)?;
    image.write(&file)?;
    let time = start.elapsed().as_secs_f64();
    std::fs::remove_file(&file)?;
    Ok((image, triangles, time))
}

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [mode, scene, method, samples, band @ ..] = &arguments[..]
        && mode == "peak"
    {
        let (_, settings) = methods().into_iter().find(|(name, _)| name == method).ok_or("no such method")?;
        let settings = Settings { band_pixels: band.first().map(|text| text.parse()).transpose()?, ..settings };
        let (_, _, time) = run(&subject(scene)?, &settings, samples.parse()?)?;
        println!("{:.0} MB, {time:.2} s", peak().ok_or("only Linux tells")?);
        return Ok(());
    }
    let converged: u32 = arguments.first().map_or(Ok(128), |text| text.parse())?;
    println!("{:<16} {:<10} {:>9} {:>8} {:>8} {:>9}", "SCENE", "METHOD", "TRIANGLES", "SAMPLES", "TIME [s]", "relMSE");
    for name in NAMES.into_iter().filter(|name| arguments.get(1).is_none_or(|wanted| wanted == name)) {
        let subject = subject(name)?;
        // One for each model, by probes lit by shadow rays.
        let mut references: Vec<(Model, Image)> = vec![];
        let [(_, sample), ..] = methods();
        for (method, settings) in methods() {
            if arguments.get(2).is_some_and(|wanted| wanted != method) {
                continue;
            }
            let model = settings.model;
            if references.iter().all(|(made, _)| *made != model) {
                let settings = Settings { seed: 1000, model, ..sample.clone() };
                references.push((model, render(subject.scene()?, &settings, converged)?));
            }
            let (_, reference) = references.iter().find(|(made, _)| *made == model).ok_or("it was made")?;
            // Squared error falls by one over samples at best, but for chance: what is far from enough is not tried.
            let mut least = 0.0;
            for samples in SAMPLES {
                if f64::from(samples) < least {
                    continue;
                }
                let (image, triangles, mut time) = run(&subject, &settings, samples)?;
                let error = image.relative_mse(reference)?.mean;
                least = 0.8 * f64::from(samples) * error / ENOUGH;
                if error <= ENOUGH || samples == SAMPLES[SAMPLES.len() - 1] {
                    for _ in 1..3 {
                        time = time.min(run(&subject, &settings, samples)?.2);
                    }
                    println!("{name:<16} {method:<10} {triangles:>9} {samples:>8} {time:>8.2} {error:>9.5}");
                    break;
                }
            }
        }
    }
    Ok(())
}
