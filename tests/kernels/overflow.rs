//! Probes with more hits than a list holds: which are kept, and what they weigh.

use crate::{
    assert_close, bench, case, check, run_case,
    scenes::{Eye, Mesh, gltf, matter, scene, standard, sun},
};
use glam::{DVec3, Vec3};
use translucent::{
    Settings,
    reference::{self, Inputs, accumulate::accumulate, intersect, reproject::reproject},
    shared::{BATCHES, Hits, MAX_HITS, Probe, Slot, Step, Sums, Surface},
    verify::Case,
};

const SHEETS: u32 = 20;
const PIXELS: u32 = 64;

/// Parallel sheets of one set; every probe meets all of them.
fn sheets() -> Case {
    let mut mesh = Mesh::default();
    for k in 0..SHEETS {
        mesh.quad(DVec3::new(-1.0, -1.0, f64::from(k) * 0.1 - 1.0), DVec3::X * 2.0, DVec3::Y * 2.0);
    }
    let eye = Eye { eye: DVec3::new(0.0, 0.0, 5.0), at: DVec3::ZERO, lens: 0.1 };
    let light = (sun(), DVec3::new(0.5, 0.3, 4.0), DVec3::ZERO);
    let file = gltf(&[(mesh, 0)], &[matter([2.0, 3.0, 1.0], [0.2; 3], 1.3)], &[light], &eye);
    case(scene(&file), &Settings { resolution: Some((PIXELS, 1)), seed: 5, ..standard() })
}

/// The uppermost sheet at a point of each pixel, and a probe that crosses all sheets there.
fn probes(inputs: &Inputs) -> (Vec<Surface>, Vec<Probe>) {
    let at = |pixel: u32| {
        let origin = DVec3::new(0.02 * (f64::from(pixel % 8) - 3.7), 0.025 * (f64::from(pixel / 8) - 3.2), 2.0);
        let hit = intersect::closest(inputs, origin, DVec3::NEG_Z, 0.0, 10.0).expect("the sheets are there");
        let surface = Surface {
            position: (origin - hit.t * DVec3::Z).as_vec3(),
            triangle: hit.triangle,
            barycentric: hit.barycentric.as_vec2(),
        };
        let probe = Probe {
            offset: Vec3::new(0.03, -0.02, 0.0),
            direction: Vec3::new(0.1, 0.2, -1.0).normalize(),
            t_min: -5.0,
            t_max: 5.0,
            radius: 0.0,
            ..Probe::default()
        };
        (surface, probe)
    };
    (0..PIXELS).map(at).unzip()
}

fn step(inputs: &Inputs, sample_index: u32) -> Step {
    reference::step(inputs, sample_index, 0..1, 0..1)
}

#[test]
fn long_lists_are_real_sorted_and_drawn_anew_for_each_sample() {
    let case = sheets();
    let inputs = case.inputs();
    let (surfaces, probes) = probes(&inputs);
    let all: Vec<Vec<intersect::Hit>> = surfaces
        .iter()
        .zip(&probes)
        .map(|(surface, probe)| {
            let origin = surface.position.as_dvec3() + probe.offset.as_dvec3();
            let (t_min, t_max) = (probe.t_min.into(), probe.t_max.into());
            intersect::hits(&inputs, origin, probe.direction.as_dvec3(), t_min, t_max).collect()
        })
        .collect();
    let mut bench = bench();
    let loaded = bench
        .load(
            &inputs,
            &case.scene.nodes,
            &[
                (Slot::Surfaces, bytemuck::cast_slice(&surfaces.repeat(BATCHES as usize))),
                (Slot::Probes, bytemuck::cast_slice(&probes)),
                (Slot::HitLists, &vec![0; PIXELS as usize * size_of::<Hits>()]),
            ],
        )
        .expect("load");
    // How often each hit is kept, in samples of one batch.
    let samples = 200;
    let mut kept = vec![[0u32; SHEETS as usize]; PIXELS as usize];
    for number in 0..samples {
        let step = step(&inputs, number * BATCHES + 3);
        bench.dispatch("reproject", &loaded, &step).expect("dispatch");
        let lists: Vec<Hits> = bench.read(&loaded, Slot::HitLists).expect("read");
        for (pixel, found) in lists.iter().enumerate() {
            let twin = reproject(&inputs, &step, pixel as u32, &surfaces[pixel], &probes[pixel]);
            assert_eq!((found.count, twin.count), (SHEETS, SHEETS));
            assert!(found.t.is_sorted_by(|a, b| a < b), "{:?}", found.t);
            for (t, triangle) in found.t.iter().zip(found.triangle) {
                let hit = all[pixel].iter().position(|hit| hit.triangle == triangle).expect("the hit is real");
                assert!((f64::from(*t) - all[pixel][hit].t).abs() < 1e-6);
                kept[pixel][hit] += 1;
            }
        }
    }
    check(&bench);
    // Pearson's statistic of each pixel over the variance of a choice without replacement has 19 degrees of freedom; the
    // sum has 1216 and the standard deviation 49. Five of them happen by chance once in a million. Were all samples of
    // the batch to decide alike, the sum would be 200 times as large.
    let expected = f64::from(samples * MAX_HITS) / f64::from(SHEETS);
    let variance = expected * (1.0 - f64::from(MAX_HITS) / f64::from(SHEETS));
    let squares: f64 = kept.iter().flatten().map(|&k| (f64::from(k) - expected).powi(2)).sum();
    let statistic = squares / variance * f64::from(SHEETS - 1) / f64::from(SHEETS);
    println!("chi square {statistic:.0} of 1216 +- 49");
    assert!((statistic - 1216.0).abs() < 5.0 * 49.4, "{statistic}");
}

#[test]
fn long_lists_weigh_what_the_twins_do() {
    let case = sheets();
    let inputs = case.inputs();
    let (surfaces, probes) = probes(&inputs);
    let mut errors = vec![];
    for sample_index in 0..64 {
        let step = step(&inputs, sample_index);
        let list = |pixel: usize| reproject(&inputs, &step, pixel as u32, &surfaces[pixel], &probes[pixel]);
        let hits: Vec<Hits> = (0..PIXELS as usize).map(list).collect();
        let out = run_case(
            &case,
            "accumulate",
            &step,
            &[
                (Slot::Surfaces, bytemuck::cast_slice(&surfaces.repeat(BATCHES as usize))),
                (Slot::Probes, bytemuck::cast_slice(&probes)),
                (Slot::HitLists, bytemuck::cast_slice(&hits)),
                (Slot::RunningSums, &vec![0; PIXELS as usize * size_of::<Sums>()]),
                (Slot::BatchSums, &vec![0; (PIXELS * BATCHES) as usize * size_of::<Vec3>()]),
            ],
        );
        for (pixel, sums) in out.get::<Sums>(Slot::RunningSums).iter().enumerate() {
            let twin =
                accumulate(&inputs, &step, pixel as u32, &surfaces[pixel], &probes[pixel], &hits[pixel]).radiance;
            // Only the uppermost sheet is lit.
            if twin != DVec3::ZERO || sums.subsurface != Vec3::ZERO {
                errors.push((sums.subsurface.as_dvec3() - twin).length() / twin.length());
            }
        }
    }
    assert!(errors.len() > 200, "{} lit samples", errors.len());
    assert_close("accumulate of long lists", &errors);
}
