//! Every stage of the pipeline on real scenes.

use crate::{Case, assert_close, scenes::standard};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::sync::OnceLock;
use translucent::{
    Model, Projection, Scene, Settings, SingleScattering,
    reference::{
        self, Inputs, accumulate::accumulate, primary::primary, reflect::reflect, reproject::reproject, sample::sample,
        single::single,
    },
    scene::{Environment, EnvironmentMap, LightKind},
    settings::Directional,
    shared::{BATCHES, Hits, MISS, Pixel, Probe, Slot, Step, Sums, Surface},
};

/// The full image, and the part of it that is tested: what the animal fills.
const FULL: (u32, u32) = (92, 92);
const CROP: [u32; 4] = [26, 16, 66, 56];

/// The shipped scene under each kind of light, with each projection. Its lamps stand near the camera: where light grazes,
/// the cosine has no more digits than the normals that both sides read.
fn cases() -> Vec<(String, Case)> {
    let mut demo =
        Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/demo.gltf")).expect("the shipped scene loads");
    let places = [DVec3::new(-0.15, 0.3, -0.3), DVec3::new(0.1, 0.25, -0.35)];
    for (light, place) in demo.lights.iter_mut().zip(places) {
        light.position = place;
        light.direction = (DVec3::new(0.0, 0.05, 0.0) - place).normalize();
        if let LightKind::Spot { inner, outer } = &mut light.kind {
            (*inner, *outer) = (0.3, 0.6);
        }
    }
    for medium in demo.materials.iter_mut().filter_map(|material| material.medium.as_mut()) {
        medium.g = DVec3::new(0.0, 0.7, -0.8);
    }
    let constant = Environment::constant(DVec3::new(0.5, 0.7, 1.0)).expect("valid");
    let texel = |i: u32| Vec3::new(0.1 + (i % 7) as f32, 0.2 + (i % 5) as f32, 0.3 + (i % 11) as f32);
    let image = Environment {
        map: EnvironmentMap::Image { width: 16, height: 8, radiance: (0..128).map(texel).collect() },
        rotation: 40.0,
        scale: 0.3,
    };
    // The animal and what it stands on shine; the animal is rough.
    let mut shining = demo.clone();
    for (index, material) in shining.materials.iter_mut().enumerate() {
        material.emission = DVec3::new(0.3, 0.2, 0.1) * (1 + 3 * index) as f64;
        material.two_sided = index == 0;
        material.roughness = 0.6;
    }
    let mut cases = vec![];
    for environment in [None, Some(&image)] {
        let mut scene = shining.clone();
        scene.lights.truncate(1);
        if let Some(environment) = environment {
            scene.set_environment(environment.clone()).expect("the environment is valid");
        }
        let settings = Settings {
            resolution: Some(FULL),
            crop: Some(CROP),
            seed: 3,
            single_scattering: SingleScattering::On,
            ..standard()
        };
        cases.push((format!("emitters, {}", scene.lights.len()), Case::new(scene, &settings)));
    }
    for projection in [Projection::Mis, Projection::Normal, Projection::Camera] {
        for (name, environment) in [("delta", None), ("constant", Some(&constant)), ("image", Some(&image))] {
            let mut scene = demo.clone();
            if let Some(environment) = environment {
                scene.set_environment(environment.clone()).expect("the environment is valid");
                scene.lights.truncate(1);
            }
            let settings = Settings {
                resolution: Some(FULL),
                crop: Some(CROP),
                projection,
                directions: 2,
                seed: 3,
                show_environment: true,
                single_scattering: SingleScattering::On,
                ..standard()
            };
            cases.push((format!("{projection:?}, {name}"), Case::new(scene, &settings)));
        }
    }
    // The other models, each under one light.
    let others = [
        (Model::Better, Projection::Mis, None),
        (Model::Burley, Projection::Camera, Some(&constant)),
        (Model::Directional, Projection::Mis, None),
        (Model::Directional, Projection::Camera, Some(&constant)),
        (Model::Lambert, Projection::Mis, None),
        (Model::Lambert, Projection::Camera, Some(&constant)),
    ];
    for (model, projection, environment) in others {
        let mut scene = demo.clone();
        if let Some(environment) = environment {
            scene.set_environment(environment.clone()).expect("the environment is valid");
            scene.lights.truncate(1);
        }
        let directional = Directional { reciprocal: projection == Projection::Mis, ..Directional::default() };
        let settings = Settings {
            resolution: Some(FULL),
            crop: Some(CROP),
            projection,
            seed: 4,
            model,
            directional,
            ..Settings::default()
        };
        cases.push((format!("{model}, {projection:?}"), Case::new(scene, &settings)));
    }
    for projection in [Projection::Mis, Projection::Normal, Projection::Camera] {
        let single_scattering = SingleScattering::On;
        let (resolution, crop) = (Some(FULL), Some(CROP));
        let settings = Settings { resolution, crop, projection, seed: 6, single_scattering, ..Settings::default() };
        cases.push((format!("{projection:?}, three media"), Case::new(mixed(&demo), &settings)));
    }
    cases
}

/// The animal of three media in one set, under three models, of which one is rough.
fn mixed(demo: &Scene) -> Scene {
    let mut scene = demo.clone();
    let translucent = |material: &usize| demo.materials[*material].medium.is_some();
    let animal = demo.sets.iter().position(|set| set.materials.iter().all(translucent)).expect("a translucent set");
    let mut materials = vec![demo.sets[animal].materials[0]];
    for (model, factor, roughness) in [(Model::Burley, 4.0, 0.0), (Model::Directional, 0.5, 0.7)] {
        let mut material = demo.materials[materials[0]].clone();
        let medium = material.medium.as_mut().expect("it is translucent");
        medium.model = Some(model);
        medium.sigma_s_prime *= factor;
        medium.sigma_a /= factor;
        material.roughness = roughness;
        materials.push(scene.materials.len());
        scene.materials.push(material);
    }
    let of_animal = scene.triangles.iter().zip(&mut scene.shadings).filter(|(t, _)| t.set as usize == animal);
    for (index, (_, shading)) in of_animal.enumerate() {
        shading.material = materials[index % 3] as u32;
    }
    scene.sets[animal].materials = materials;
    scene
}

/// What the twins give for one sample of every pixel.
struct Stages {
    step: Step,
    surfaces: Vec<Surface>,
    probes: Vec<Probe>,
    hits: Vec<Hits>,
}

/// Samples from different batches and strata, by turns.
const SAMPLES: [u32; 2] = [37, 1003];

fn stages(inputs: &Inputs, sample_index: u32) -> Stages {
    let step = reference::step(inputs, sample_index, CROP[1]..CROP[3], 0..2048);
    let pixels = (0..step.pixel_count).into_par_iter();
    let surfaces: Vec<_> = pixels.clone().map(|i| primary(inputs, &step, i)).collect();
    let probes: Vec<_> = pixels.clone().map(|i| sample(inputs, &step, i, &surfaces[i as usize])).collect();
    let hits = pixels.map(|i| reproject(inputs, &step, i, &surfaces[i as usize], &probes[i as usize])).collect();
    Stages { step, surfaces, probes, hits }
}

/// The G-buffers of all batches, of which the step's batch holds `surfaces`.
fn g_buffers(step: &Step, surfaces: &[Surface]) -> Vec<Surface> {
    let mut all = vec![Surface { triangle: MISS, ..Surface::default() }; surfaces.len() * BATCHES as usize];
    let start = (step.sample_index % BATCHES) as usize * surfaces.len();
    all[start..start + surfaces.len()].copy_from_slice(surfaces);
    all
}

fn for_each_case(mut test: impl FnMut(&str, &Case, &Stages)) {
    // Computed once for all tests: the twins search every triangle.
    static CASES: OnceLock<Vec<(String, Case, Stages)>> = OnceLock::new();
    let compute = || {
        let with_stages = |(index, (name, case)): (usize, (String, Case))| {
            let sample_index = SAMPLES[index % SAMPLES.len()];
            let stages = stages(&case.inputs(), sample_index);
            (format!("{name}, sample {sample_index}"), case, stages)
        };
        cases().into_iter().enumerate().map(with_stages).collect()
    };
    CASES.get_or_init(compute).iter().for_each(|(name, case, stages)| test(name, case, stages));
}

/// Length of the difference over `scale`.
fn error(gpu: Vec3, twin: Vec3, scale: f64) -> f64 {
    (gpu.as_dvec3() - twin.as_dvec3()).length() / scale
}

#[test]
fn primary_finds_the_twins_surface() {
    let mut errors = vec![];
    for_each_case(|_, case, stages| {
        let surfaces = vec![Surface::default(); (stages.step.pixel_count * BATCHES) as usize];
        let out = case.run("primary", &stages.step, &[(Slot::Surfaces, bytemuck::cast_slice(&surfaces))]);
        let start = (stages.step.sample_index % BATCHES * stages.step.pixel_count) as usize;
        let found = &out.get::<Surface>(Slot::Surfaces)[start..];
        for (gpu, twin) in found.iter().zip(&stages.surfaces) {
            if gpu.triangle == MISS && twin.triangle == MISS {
                continue;
            }
            // An edge between two triangles may go either way; the position is the same.
            let both = (gpu.triangle == MISS) == (twin.triangle == MISS);
            let scale = f64::from(twin.position.length()).max(1.0);
            errors.push(if both { error(gpu.position, twin.position, scale) } else { f64::INFINITY });
        }
    });
    assert_close("primary", &errors);
}

#[test]
fn sample_draws_the_twins_probe() {
    let mut errors = vec![];
    for_each_case(|_, case, stages| {
        let surfaces = g_buffers(&stages.step, &stages.surfaces);
        let probes = vec![Probe::default(); stages.probes.len()];
        let buffers: [(Slot, &[u8]); 2] =
            [(Slot::Surfaces, bytemuck::cast_slice(&surfaces)), (Slot::Probes, bytemuck::cast_slice(&probes))];
        let out = case.run("sample", &stages.step, &buffers).get::<Probe>(Slot::Probes);
        for (gpu, twin) in out.iter().zip(&stages.probes) {
            let chord = |p: &Probe| p.t_min <= p.t_max;
            assert_eq!(chord(gpu), chord(twin));
            if !chord(twin) {
                continue;
            }
            // Lengths against the probe's own size.
            let scale = f64::from(twin.t_max - twin.t_min).min(1.0).max(f64::from(twin.offset.length()));
            let ends = f64::from((gpu.t_min - twin.t_min).abs().max((gpu.t_max - twin.t_max).abs()));
            let ends =
                if twin.t_max < 1e29 { ends } else { f64::from((gpu.t_min - twin.t_min).abs() / twin.t_min.abs()) };
            let offset = error(gpu.offset, twin.offset, scale);
            let radius = f64::from((gpu.radius - twin.radius).abs()) / scale;
            errors.push(offset.max(error(gpu.direction, twin.direction, 1.0)).max(ends / scale).max(radius));
        }
    });
    assert_close("sample", &errors);
}

#[test]
fn reproject_finds_the_twins_hits() {
    let mut errors = vec![];
    let mut several = 0;
    for_each_case(|_, case, stages| {
        let surfaces = g_buffers(&stages.step, &stages.surfaces);
        let hits = vec![STALE; stages.hits.len()];
        let buffers: [(Slot, &[u8]); 3] = [
            (Slot::Surfaces, bytemuck::cast_slice(&surfaces)),
            (Slot::Probes, bytemuck::cast_slice(&stages.probes)),
            (Slot::HitLists, bytemuck::cast_slice(&hits)),
        ];
        let out = case.run("reproject", &stages.step, &buffers).get::<Hits>(Slot::HitLists);
        for ((gpu, twin), probe) in out.iter().zip(&stages.hits).zip(&stages.probes) {
            several += usize::from(twin.count > 1);
            if gpu.count == 0 && twin.count == 0 {
                continue;
            }
            if gpu.count != twin.count {
                errors.push(f64::INFINITY);
                continue;
            }
            // Positions along the ray, against the probe's size.
            let scale = f64::from(probe.t_max - probe.t_min).min(1.0).max(f64::from(probe.offset.length()));
            let hit = |i: usize| f64::from((gpu.t[i] - twin.t[i]).abs()) / scale;
            errors.push((0..twin.count.min(8) as usize).map(hit).fold(0.0, f64::max));
        }
    });
    assert!(several > 100, "probes with several hits are tested");
    assert_close("reproject", &errors);
}

/// What an earlier sample may have left: hits of triangles that do not exist.
const STALE: Hits = Hits { count: 99, t: [1.0; 8], triangle: [MISS; 8] };

/// The new sums over what they were, for a kernel that adds to them.
fn run_sums(case: &Case, stem: &'static str, stages: &Stages) -> (Vec<Sums>, Vec<Vec3>) {
    let surfaces = g_buffers(&stages.step, &stages.surfaces);
    let sums = vec![Sums::default(); stages.surfaces.len()];
    let batch_sums = vec![Vec3::ZERO; stages.surfaces.len() * BATCHES as usize];
    // A pixel without a probe has no hits, whatever its list says.
    let lists = stages.hits.iter().zip(&stages.probes);
    let hits: Vec<Hits> = lists.map(|(hits, probe)| if probe.t_min <= probe.t_max { *hits } else { STALE }).collect();
    let buffers: [(Slot, &[u8]); 5] = [
        (Slot::Surfaces, bytemuck::cast_slice(&surfaces)),
        (Slot::Probes, bytemuck::cast_slice(&stages.probes)),
        (Slot::HitLists, bytemuck::cast_slice(&hits)),
        (Slot::RunningSums, bytemuck::cast_slice(&sums)),
        (Slot::BatchSums, bytemuck::cast_slice(&batch_sums)),
    ];
    let out = case.run(stem, &stages.step, &buffers);
    let start = (stages.step.sample_index % BATCHES) as usize * stages.surfaces.len();
    let batch = out.get::<Vec3>(Slot::BatchSums)[start..start + stages.surfaces.len()].to_vec();
    (out.get(Slot::RunningSums), batch)
}

#[test]
fn accumulate_adds_the_twins_radiance() {
    let mut errors = vec![];
    for_each_case(|name, case, stages| {
        let (sums, batch) = run_sums(case, "accumulate", stages);
        let inputs = case.inputs();
        let twins: Vec<_> = (0..sums.len())
            .into_par_iter()
            .map(|i| {
                let (surface, probe, hits) = (&stages.surfaces[i], &stages.probes[i], &stages.hits[i]);
                accumulate(&inputs, &stages.step, i as u32, surface, probe, hits)
            })
            .collect();
        for (index, (sums, twin)) in sums.iter().zip(&twins).enumerate() {
            let surface = &stages.surfaces[index];
            assert_eq!((sums.samples, sums.covered), (1, u32::from(surface.triangle != MISS)), "{name}");
            assert_eq!(sums.invalid, u32::from(twin.invalid), "{name}");
            assert_eq!(batch[index], sums.subsurface, "{name}");
            if twin.radiance == DVec3::ZERO && sums.subsurface == Vec3::ZERO {
                continue;
            }
            errors.push((sums.subsurface.as_dvec3() - twin.radiance).length() / twin.radiance.length());
        }
    });
    assert!(errors.len() > 3000, "{} lit samples", errors.len());
    assert_close("accumulate", &errors);
}

/// The shipped scene where what is not translucent shines. (Light of the matter's own surface comes from so near that the
/// rounding of positions shows.)
fn lit_from_below() -> (String, Case, Stages) {
    let mut scene =
        Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/demo.gltf")).expect("the shipped scene loads");
    scene.lights.truncate(1);
    for material in &mut scene.materials {
        match &mut material.medium {
            Some(medium) => medium.g = DVec3::new(0.0, 0.7, -0.8),
            None => material.emission = DVec3::new(0.3, 0.2, 0.1),
        }
    }
    let settings = Settings {
        resolution: Some(FULL),
        crop: Some(CROP),
        seed: 5,
        single_scattering: SingleScattering::On,
        ..standard()
    };
    let case = Case::new(scene, &settings);
    let stages = stages(&case.inputs(), SAMPLES[1]);
    ("lit from below".into(), case, stages)
}

#[test]
fn single_adds_the_twins_radiance() {
    let mut errors = vec![];
    let mut test = |name: &str, case: &Case, stages: &Stages| {
        let inputs = case.inputs();
        let (sums, batch) = run_sums(case, "single", stages);
        let twins: Vec<_> = (0..sums.len())
            .into_par_iter()
            .map(|i| single(&inputs, &stages.step, i as u32, &stages.surfaces[i]))
            .collect();
        // An exponential of many mean free paths, or of a way that grazes the surface, has lost digits; what it leaves is
        // little beside the mean.
        let lit = twins.iter().filter(|twin| twin.radiance != DVec3::ZERO);
        let mean = lit.clone().map(|twin| twin.radiance.length()).sum::<f64>() / lit.count() as f64;
        for (index, (sums, twin)) in sums.iter().zip(&twins).enumerate() {
            assert_eq!((sums.samples, sums.invalid), (0, u32::from(twin.invalid)), "{name}");
            assert_eq!(batch[index], sums.subsurface, "{name}");
            if twin.radiance == DVec3::ZERO && sums.subsurface == Vec3::ZERO {
                continue;
            }
            // A length of matter is known to two roundings of a position.
            let shading = &inputs.shadings[stages.surfaces[index].triangle as usize];
            let extinction = inputs.materials[shading.material as usize].extinction;
            let rounding = f64::from(extinction.max_element()) * 2f64.powi(-23);
            let error = (sums.subsurface.as_dvec3() - twin.radiance).length() / twin.radiance.length().max(mean);
            errors.push(error / (1.0 + 1e5 * rounding));
        }
    };
    for_each_case(|name, case, stages| {
        // No projection has a say, and no model.
        if name.starts_with("Mis") {
            test(name, case, stages);
        }
    });
    let (name, case, stages) = lit_from_below();
    assert!(case.inputs().features.emitters != 0 && case.prepared.has_single);
    test(&name, &case, &stages);
    assert!(errors.len() > 3000, "{} lit samples", errors.len());
    assert_close("single", &errors);
}

#[test]
fn reflect_adds_the_twins_radiance() {
    let mut errors = vec![];
    for_each_case(|name, case, stages| {
        let (sums, _) = run_sums(case, "reflect", stages);
        let inputs = case.inputs();
        let twins: Vec<_> = (0..sums.len())
            .into_par_iter()
            .map(|i| reflect(&inputs, &stages.step, i as u32, &stages.surfaces[i]))
            .collect();
        for (sums, twin) in sums.iter().zip(&twins) {
            assert_eq!(sums.invalid, u32::from(twin.invalid), "{name}");
            if twin.radiance == DVec3::ZERO && sums.reflection == Vec3::ZERO {
                continue;
            }
            errors.push((sums.reflection.as_dvec3() - twin.radiance).length() / twin.radiance.length());
        }
    });
    assert!(errors.len() > 3000, "{} lit samples", errors.len());
    assert_close("reflect", &errors);
}

#[test]
fn resolve_gives_the_twins_pixel() {
    let (_, case) = &cases()[0];
    let range = (5, 41);
    let pixels = 500;
    let step = Step {
        pixel_count: pixels,
        range_begin: range.0,
        range_end: range.1,
        ..reference::step(&case.inputs(), 0, 0..1, 0..1)
    };
    // Numbers of many magnitudes, from a hash; for every tenth pixel near the end of f32.
    let number = |i: u32| 10f32.powf((reference::random::hash(i) % 4000) as f32 / 1000.0 - 2.0);
    let greatness = |i: u32| if (i % pixels).is_multiple_of(10) { 3e36 } else { 1.0 };
    let vector = |i: u32| Vec3::new(number(3 * i), number(3 * i + 1), number(3 * i + 2)) * greatness(i);
    let sums: Vec<Sums> = (0..pixels)
        .map(|i| Sums {
            subsurface: vector(i),
            subsurface_carry: vector(i + 7000) * 1e-7,
            reflection: vector(i + 1000),
            reflection_carry: vector(i + 9000) * 1e-7,
            samples: range.1 - range.0,
            covered: i % (range.1 - range.0 + 1),
            invalid: i,
        })
        .collect();
    let batch_sums: Vec<Vec3> = (0..pixels * BATCHES).map(|i| vector(i + 20_000)).collect();
    let out = vec![Pixel::default(); pixels as usize];
    let buffers: [(Slot, &[u8]); 3] = [
        (Slot::RunningSums, bytemuck::cast_slice(&sums)),
        (Slot::BatchSums, bytemuck::cast_slice(&batch_sums)),
        (Slot::Pixels, bytemuck::cast_slice(&out)),
    ];
    let out = case.run("resolve", &step, &buffers).get::<Pixel>(Slot::Pixels);
    let mut errors = vec![];
    for (i, gpu) in out.iter().enumerate() {
        let mine: Vec<Vec3> = (0..BATCHES as usize).map(|b| batch_sums[b * pixels as usize + i]).collect();
        let twin = reference::resolve::resolve(&case.inputs().features, &step, &sums[i], &mine);
        assert_eq!((gpu.samples, gpu.invalid), (twin.samples, twin.invalid));
        assert!((gpu.alpha - twin.alpha).abs() <= 1e-6);
        let relative = |a: Vec3, b: Vec3| error(a, b, b.as_dvec3().length());
        errors.push(relative(gpu.subsurface, twin.subsurface));
        errors.push(relative(gpu.reflection, twin.reflection));
        errors.push(relative(gpu.variance, twin.variance));
    }
    assert!(out.iter().filter(|gpu| gpu.variance.max_element() == f32::MAX).count() > 20, "variances overflow");
    assert_close("resolve", &errors);
}
