//! A million random sets of matter, surface, light and camera through every kernel: nothing that comes out may be NaN,
//! infinite, or negative light, and all but a few agree with the twins.

use crate::{
    bench, case, check, run_case,
    scenes::{Eye, Mesh, gltf, matter, scene, standard, sun},
};
use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;
use serde_json::json;
use translucent::{
    Normalisation, Projection, Settings,
    reference::{
        self, Inputs,
        accumulate::accumulate,
        primary::primary,
        profile::{self, Coefficients, Options, SET_DIAMETER},
        random::{hash, unit},
        reflect::reflect,
        reproject::reproject,
        resolve::resolve,
        sample::sample,
    },
    scene::{Environment, EnvironmentMap},
    settings::Model,
    shared::{BATCHES, Hits, MISS, Material, Pixel, Probe, Slot, Step, Sums, Surface, Triangle},
    verify::Case,
};

const PIXELS: u32 = 1 << 14;
const TRIANGLES: usize = 24;

/// Numbers in [0, 1), from a hash.
struct Random(u32);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9);
        unit(hash(self.0))
    }

    fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[(self.next() * of.len() as f64) as usize]
    }

    /// Between two magnitudes, uniform in the logarithm.
    fn magnitude(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.next())
    }

    /// In the unit ball.
    fn point(&mut self) -> DVec3 {
        loop {
            let p = DVec3::from([0; 3].map(|_| 2.0 * self.next() - 1.0));
            if p.length_squared() < 1.0 {
                return p;
            }
        }
    }
}

/// Matter from the ends of every range, in internal units.
fn random_material(random: &mut Random, model: Model, projection: Projection) -> Material {
    let ior = random.pick(&[0.4, 0.7, 1.0 - 1e-6, 1.0, 1.0 + 1e-6, 1.3, 1.5, 3.0, 9.0]);
    // The camera projection refuses matter that absorbs nothing, and draws radii of 1 / sigma_tr: beyond some 1e3, what
    // comes back to the surface has no digits left.
    let (least, thinnest): (f64, f64) = if projection == Projection::Camera { (1e-3, 1.0) } else { (0.0, 1e-9) };
    let channels = [0; 3].map(|_| {
        let extinction = random.magnitude(thinnest, 131_072.0);
        let uniform = random.next();
        let absorbed = random.pick(&[1.0, 1.0 - 1e-6, uniform, uniform, 1e-3, least.max(0.5f64.powi(24)), least]);
        let g = random.pick(&[-0.999, 0.0, 0.0, 0.9, 0.999]);
        let (sigma_s_prime, sigma_a) = (extinction * (1.0 - absorbed), extinction * absorbed);
        Coefficients { sigma_s_prime, sigma_a, g, ior, rough: None, appearance: None }
    });
    let options = Options {
        normalisation: Normalisation::Energy,
        radius_tail: random.pick(&[1e-6, 0.0]),
        directional: Default::default(),
        precision: Default::default(),
    };
    let mut material = profile::material(profile::constant(model).expect("the model is built"), &channels, options);
    material.radius_max = material.radius_max.min(SET_DIAMETER);
    material.alpha = random.pick(&[0.0, 0.0, 1e-6, 1e-3, 0.1, 1.0]);
    material.base_color = random.point().abs().as_vec3();
    material.metallic = random.next() as f32;
    material
}

/// Random triangles, some of them slivers or small, all of one set, each of its own matter.
fn world(seed: u32) -> Case {
    let mut random = Random(hash(seed));
    let mut meshes = vec![];
    for index in 0..TRIANGLES {
        let (a, size) = (random.point(), random.pick(&[1.0, 1.0, 1e-3]));
        let (b, c) = (a + size * random.point(), a + size * random.point());
        let c = if index % 6 == 0 { a + 0.4 * (b - a) + 1e-4 * random.point() } else { c };
        let normal = (b - a).cross(c - a).normalize();
        let tilted = |random: &mut Random| (normal + 0.5 * random.point()).normalize();
        let normals = [0; 3].map(|_| tilted(&mut random)).to_vec();
        meshes.push((Mesh { positions: vec![a, b, c], normals, indices: vec![0, 1, 2] }, index));
    }
    let materials = vec![matter([1.0; 3], [0.1; 3], 1.3); TRIANGLES];
    let lamp = json!({"type": "point", "intensity": random.magnitude(1e-3, 1e3)});
    let lights = [(lamp, 3.0 * random.point().normalize(), DVec3::ZERO), (sun(), random.point() * 5.0, DVec3::ZERO)];
    let distance = random.pick(&[1.5, 4.0, 1e4]);
    let lens = if random.next() < 0.3 { -1.2 } else { 2.4 / distance };
    let eye = Eye { eye: random.point().normalize() * distance, at: 0.2 * random.point(), lens };
    let mut scene = scene(&gltf(&meshes, &materials, &lights, &eye));
    let texels = |i: u32| Vec3::splat(hash(i) as f32 / 1e9);
    let map = EnvironmentMap::Image { width: 8, height: 4, radiance: (0..32).map(texels).collect() };
    let environment = random.pick(&[None, Some(true), Some(false)]).map(|constant| match constant {
        true => Environment::constant(DVec3::ONE).expect("valid"),
        false => Environment { map, rotation: 70.0, scale: 1.0 },
    });
    if let Some(environment) = environment {
        scene.set_environment(environment).expect("valid");
    }
    scene.triangles.iter_mut().for_each(|triangle| triangle.set = 0);

    let projection = random.pick(&[Projection::Mis, Projection::Mis, Projection::Normal, Projection::Camera]);
    let built = [Model::Standard, Model::Better, Model::Burley, Model::Directional];
    let model = built[seed as usize % built.len()];
    let settings = Settings { resolution: Some((PIXELS / 8, 8)), projection, seed, ..standard() };
    let mut case = case(scene, &settings);
    for (index, material) in case.prepared.materials.iter_mut().enumerate() {
        // An eighth in the opaque limit, as of tables.
        let lambert = index % 8 == 7;
        *material = random_material(&mut random, if lambert { Model::Lambert } else { model }, projection);
        if lambert {
            (material.slope, material.obliqueness) = (0.5 * random.point().as_vec3(), random.next() as f32);
        }
    }
    let models = case.prepared.materials.iter().fold(0, |mask, material| mask | 1 << material.model);
    case.prepared.features.models = models;
    case
}

/// A point on a random triangle, seen by each pixel.
fn surfaces(inputs: &Inputs, seed: u32) -> Vec<Surface> {
    let mut random = Random(hash(seed ^ 0x5eed));
    let mut surface = || {
        let triangle = (random.next() * inputs.triangles.len() as f64) as u32;
        let t = &inputs.triangles[triangle as usize];
        let (mut u, mut v) = (random.next() as f32, random.next() as f32);
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let [a, b, c] = t.vertices;
        Surface { position: a + u * (b - a) + v * (c - a), triangle, barycentric: Vec2::new(u, v) }
    };
    (0..PIXELS).map(|_| surface()).collect()
}

/// Flatness below which a triangle is a sliver: rounding turns its normal by 2^-24 over that, 6e-6 or more, so that on its
/// length the shadow offset no longer clears it.
const SLIVER: f64 = 0.01;

fn sliver(triangle: &Triangle) -> bool {
    let [_, a, b] = triangle.corner_and_edges();
    a.cross(b).length() < SLIVER * a.length().max(b.length()).max((b - a).length()).powi(2)
}

/// Distance from which f32 loses where a line passes the set: rounded to 2^-24 of it, positions are known to 6e-6, as
/// much as the smallest triangles hold in f32 of their own size.
const FAR: f32 = 100.0;

/// What was found of one kernel.
#[derive(Default)]
struct Census {
    items: usize,
    /// Relative differences beyond 1e-3, or one of the two found nothing.
    apart: usize,
    /// Items to which f32 has no answer, of which only finite light is asked, and how many of those are apart.
    lost: usize,
    lost_apart: usize,
}

impl Census {
    fn add(&mut self, what: &str, gpu: Vec3, twin: Vec3) {
        self.add_of(what, gpu, twin, false);
    }

    fn add_of(&mut self, what: &str, gpu: Vec3, twin: Vec3, lost: bool) {
        assert!(gpu.is_finite() && gpu.min_element() >= 0.0, "{what}: {gpu}");
        assert!(twin.is_finite() && twin.min_element() >= 0.0, "{what}: twin {twin}");
        let (items, apart) = match lost {
            true => (&mut self.lost, &mut self.lost_apart),
            false => (&mut self.items, &mut self.apart),
        };
        *items += 1;
        // Below, the light is nothing beside what arrived: the Fresnel term of n = 1 + 1e-6 is 2e-13, in f32 1 - 1.
        let scale = gpu.length().max(twin.length()).max(1e-6);
        *apart += usize::from((gpu - twin).length() > 1e-3 * scale);
    }

    fn report(&self, kernel: &str, sets: usize, share: f64) {
        let Census { items, apart, lost, lost_apart } = self;
        println!(
            "{kernel}: {items} sets, {apart} differ from the twin by more than 1e-3; without an answer in f32 {lost}, {lost_apart}"
        );
        assert!(items + lost == sets && items > lost, "{kernel}: {items} and {lost} of {sets}");
        assert!(self.apart as f64 <= share * self.items as f64, "{kernel}: {} of {}", self.apart, self.items);
    }
}

fn vectors_are_finite(what: &str, vectors: &[Vec3]) {
    assert!(vectors.iter().all(|v| v.is_finite()), "{what}: {vectors:?}");
}

#[test]
fn a_hundred_thousand_sets_through_every_kernel() {
    sets_through_every_kernel(0..7);
}

/// Two minutes of one core.
#[test]
#[ignore = "./x verify-drivers runs it"]
fn a_million_sets_through_every_kernel() {
    sets_through_every_kernel(0..62);
}

fn sets_through_every_kernel(worlds: std::ops::Range<u32>) {
    let sets = worlds.len() * PIXELS as usize;
    let [mut found, mut drawn, mut carried, mut lit, mut reflected, mut resolved] = [0; 6].map(|_| Census::default());
    for seed in worlds {
        let case = world(seed);
        let inputs = case.inputs();
        let sample_index = hash(seed) % 4096;
        let step = reference::step(&inputs, sample_index, 0..8, 0..4096);
        let surfaces = surfaces(&inputs, seed);
        let pixels = (0..PIXELS).into_par_iter();
        let what = format!("world {seed}");

        let blank = vec![Surface { triangle: MISS, ..Surface::default() }; (PIXELS * BATCHES) as usize];
        let batch = (sample_index % BATCHES * PIXELS) as usize..((sample_index % BATCHES + 1) * PIXELS) as usize;
        let out = run_case(&case, "primary", &step, &[(Slot::Surfaces, bytemuck::cast_slice(&blank))]);
        let twins: Vec<_> = pixels.clone().map(|i| primary(&inputs, &step, i)).collect();
        for (gpu, twin) in out.get::<Surface>(Slot::Surfaces)[batch.clone()].iter().zip(&twins) {
            vectors_are_finite(&what, &[gpu.position, gpu.barycentric.extend(0.0)]);
            let of = |surface: &Surface| if surface.triangle == MISS { Vec3::ZERO } else { surface.position + 2.0 };
            found.add(&what, of(gpu), of(twin));
        }

        let mut g_buffers = blank;
        g_buffers[batch.clone()].copy_from_slice(&surfaces);
        let g_buffers: (Slot, &[u8]) = (Slot::Surfaces, bytemuck::cast_slice(&g_buffers));
        let probes = vec![Probe::default(); PIXELS as usize];
        let out = run_case(&case, "sample", &step, &[g_buffers, (Slot::Probes, bytemuck::cast_slice(&probes))]);
        let probes: Vec<_> = pixels.clone().map(|i| sample(&inputs, &step, i, &surfaces[i as usize])).collect();
        for (gpu, twin) in out.get::<Probe>(Slot::Probes).iter().zip(&probes) {
            vectors_are_finite(&what, &[gpu.offset, gpu.direction, Vec3::new(gpu.t_min, gpu.t_max, gpu.radius)]);
            let [gpu, twin] = [gpu, twin].map(|probe| Vec3::splat(probe.offset.length()));
            drawn.add_of(&what, gpu, twin, gpu.max(twin).x > FAR);
        }

        let probe_buffer: (Slot, &[u8]) = (Slot::Probes, bytemuck::cast_slice(&probes));
        let lists = vec![Hits::default(); PIXELS as usize];
        let buffers = [g_buffers, probe_buffer, (Slot::HitLists, bytemuck::cast_slice(&lists))];
        let out = run_case(&case, "reproject", &step, &buffers);
        let hits: Vec<_> = (pixels.clone())
            .map(|i| reproject(&inputs, &step, i, &surfaces[i as usize], &probes[i as usize]))
            .collect();
        for ((gpu, twin), probe) in out.get::<Hits>(Slot::HitLists).iter().zip(&hits).zip(&probes) {
            assert!(gpu.t[..gpu.count.min(8) as usize].iter().all(|t| t.is_finite()), "{what}");
            let far = probe.offset.length() > FAR;
            carried.add_of(&what, Vec3::splat(gpu.count as f32), Vec3::splat(twin.count as f32), far);
        }

        let sums = vec![Sums::default(); PIXELS as usize];
        let batch_sums = vec![Vec3::ZERO; (PIXELS * BATCHES) as usize];
        let buffers = [
            g_buffers,
            probe_buffer,
            (Slot::HitLists, bytemuck::cast_slice(&hits)),
            (Slot::RunningSums, bytemuck::cast_slice(&sums)),
            (Slot::BatchSums, bytemuck::cast_slice(&batch_sums)),
        ];
        let gpu = run_case(&case, "accumulate", &step, &buffers).get::<Sums>(Slot::RunningSums);
        let twins: Vec<_> = (pixels.clone())
            .map(|i| {
                let at = i as usize;
                accumulate(&inputs, &step, i, &surfaces[at], &probes[at], &hits[at])
            })
            .collect();
        for (index, (gpu, twin)) in gpu.iter().zip(&twins).enumerate() {
            assert_eq!((gpu.invalid, twin.invalid), (0, false), "{what}, pixel {index}");
            let kept = &hits[index].triangle[..hits[index].count.min(8) as usize];
            let thin = |triangle: &u32| sliver(&inputs.triangles[*triangle as usize]);
            let lost = probes[index].offset.length() > FAR || thin(&surfaces[index].triangle) || kept.iter().any(thin);
            lit.add_of(&what, gpu.subsurface, twin.radiance.as_vec3(), lost);
        }
        let gpu = run_case(&case, "reflect", &step, &buffers).get::<Sums>(Slot::RunningSums);
        let twins: Vec<_> = pixels.map(|i| reflect(&inputs, &step, i, &surfaces[i as usize])).collect();
        for (index, (gpu, twin)) in gpu.iter().zip(&twins).enumerate() {
            assert_eq!((gpu.invalid, twin.invalid), (0, false), "{what}, pixel {index}");
            // A highlight of width 1e-6 is as wide as the rounding of a half vector.
            let triangle = surfaces[index].triangle as usize;
            let alpha = inputs.materials[inputs.shadings[triangle].material as usize].alpha;
            let lost = alpha > 0.0 && alpha < 1e-4 || sliver(&inputs.triangles[triangle]);
            assert!(gpu.reflection.is_finite() && gpu.reflection.min_element() >= 0.0, "{what}, pixel {index}");
            reflected.add_of(&what, gpu.reflection, twin.radiance.as_vec3(), lost);
        }

        // Sums of every magnitude.
        let mut random = Random(hash(seed ^ 0x0dd5));
        let mut vector = || Vec3::splat(random.magnitude(1e-38, 1e38) as f32);
        let batch_sums: Vec<Vec3> = (0..PIXELS * BATCHES).map(|_| vector()).collect();
        let sums: Vec<Sums> = (0..PIXELS)
            .map(|i| {
                let (subsurface, reflection) = (vector(), vector());
                Sums { subsurface, reflection, samples: 4096, covered: i % 4097, ..Sums::default() }
            })
            .collect();
        let out = vec![Pixel::default(); PIXELS as usize];
        let step = Step { range_end: 4096, ..step };
        let buffers: [(Slot, &[u8]); 3] = [
            (Slot::RunningSums, bytemuck::cast_slice(&sums)),
            (Slot::BatchSums, bytemuck::cast_slice(&batch_sums)),
            (Slot::Pixels, bytemuck::cast_slice(&out)),
        ];
        let gpu = run_case(&case, "resolve", &step, &buffers).get::<Pixel>(Slot::Pixels);
        for (i, gpu) in gpu.iter().enumerate() {
            let mine: Vec<Vec3> = (0..BATCHES as usize).map(|b| batch_sums[b * PIXELS as usize + i]).collect();
            let twin = resolve(&inputs.features, &step, &sums[i], &mine);
            vectors_are_finite(&what, &[gpu.subsurface, gpu.reflection, gpu.variance]);
            resolved.add(&what, gpu.subsurface + gpu.reflection, twin.subsurface + twin.reflection);
        }
    }
    check(&bench());
    // A ray meets one of a world's 72 edges within rounding (2^-22) once in 1e5.
    found.report("primary", sets, 2e-5);
    drawn.report("sample", sets, 2e-5);
    carried.report("reproject", sets, 2e-5);
    // A sample has up to four rays; and either lamp's cosine, which is known to 2^-23, is below 1.2e-4 as often as that.
    lit.report("accumulate", sets, 3e-4);
    reflected.report("reflect", sets, 3e-4);
    resolved.report("resolve", sets, 0.0);
}
