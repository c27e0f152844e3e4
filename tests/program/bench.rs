//! `bench`: intervals that hold what they say, runs that are told apart, and what the program writes.

use crate::{Folder, stderr};
use glam::{DAffine3, DVec3};
use serde_json::{Value, json};
use std::fs;
use translucent::{
    CameraChoice, Device, DeviceOptions, Model, Scene, Settings,
    bench::{
        Axis, Bound, Counts, Effort, Limits, Point, Report, Scaling, Series, Work, compare, count, scalings_csv,
        statistics::{median, ratio},
    },
    scene::{Camera, Lens, Light, LightKind, Material, Mesh},
};

/// Numbers between 0 and 1: splitmix64 (G. Steele, D. Lea, C. Flood 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as f64 / 2f64.powi(64)
    }

    /// Times about `ms` as machines give them: a spread of 3 % to the slow side, now and then much slower.
    fn times(&mut self, count: usize, ms: f64) -> Vec<f64> {
        let noise = |random: &mut Random| if random.next() < 0.05 { 0.5 } else { -0.03 * (1.0 - random.next()).ln() };
        (0..count).map(|_| ms * (1.0 + noise(self))).collect()
    }
}

const KERNELS: [(&str, f64); 5] =
    [("primary", 2.0), ("sample", 3.0), ("reproject", 10.0), ("accumulate", 30.0), ("resolve", 0.1)];

/// A report whose kernels take these times, up to noise.
fn synthetic(random: &mut Random, repeat: usize, factor: impl Fn(&str) -> f64) -> Report {
    let series = |name: &str, times| Series { name: name.into(), launches: 16, times, extremes: None };
    let kernels: Vec<_> =
        KERNELS.iter().map(|(name, ms)| series(name, random.times(repeat, ms * factor(name)))).collect();
    Report {
        about: json!({"device": "imaginary"}),
        work: json!({"sceneHash": "ab", "samples": 16, "pixels": 4096, "settings": {"seed": 0, "model": "auto"}}),
        effort: Effort { samples: 16, warmup: 1, repeat: repeat as u32 },
        start_up: vec![("load".into(), 12.5)],
        host: vec![series("render", random.times(repeat, 50.0))],
        kernels,
        executables: Value::Null,
        counters: Value::Null,
        counts: vec![],
        limits: None,
        device_bytes: 1 << 20,
        peak_bytes: None,
    }
}

#[test]
fn intervals_are_those_of_the_tables() {
    // k and confidence for n values: D. B. Owen, Handbook of Statistical Tables, 1962 (sign test).
    for (count, k, confidence) in [(6, 1, 0.96875), (8, 1, 0.9921875), (10, 2, 0.978515625), (20, 6, 0.95861053)] {
        let values: Vec<f64> = (1..=count).rev().map(f64::from).collect();
        let estimate = median(&values, 0.95).expect("there are values");
        assert_eq!((estimate.low, estimate.high), (f64::from(k), f64::from(count + 1 - k)));
        assert!((estimate.confidence - confidence).abs() < 1e-8, "{estimate:?}");
        assert_eq!(estimate.value, f64::from(count + 1) / 2.0);
    }
    let few = median(&[3.0, 1.0, 2.0], 0.95).expect("there are values");
    assert_eq!((few.value, few.low, few.high, few.confidence), (2.0, 1.0, 3.0, 0.75));
    assert!(median(&[], 0.95).is_none());
    // More than f64's smallest power of 1/2.
    let many: Vec<f64> = (0..2000).map(f64::from).collect();
    let estimate = median(&many, 0.95).expect("there are values");
    // 1.96 standard deviations of sqrt(n)/2 to each side.
    assert!((estimate.high - estimate.low - 1.96 * 2000f64.sqrt()).abs() < 3.0, "{estimate:?}");

    // Largest U that rejects at 5 % in both tails: H. B. Mann, D. R. Whitney 1947; their tables give 2, 8 and 23.
    for (count, critical) in [(5, 2), (7, 8), (10, 23)] {
        // Distinct ratios, so that each has its rank.
        let a: Vec<f64> = (0..count).map(|i| 1.0 + 0.01 * f64::from(i)).collect();
        let b: Vec<f64> = (0..count).map(|i| 2.0 + 0.00317 * f64::from(i * i + 1)).collect();
        let mut ratios: Vec<f64> = a.iter().flat_map(|a| b.iter().map(move |b| b / a)).collect();
        ratios.sort_by(f64::total_cmp);
        let estimate = ratio(&a, &b, 0.95).expect("enough values");
        let last = ratios.len() - 1;
        assert_eq!((estimate.low, estimate.high), (ratios[critical], ratios[last - critical]));
        assert!(estimate.confidence >= 0.95);
    }
    // 2 / C(10, 5) is all that five values and five can be sure of.
    assert!(ratio(&[1.0; 5], &[1.0; 5], 1.0 - 2.0 / 252.0).is_some());
    assert!(ratio(&[1.0; 5], &[1.0; 5], 1.0 - 1.9 / 252.0).is_none());
}

#[test]
fn intervals_hold_the_truth_as_often_as_they_say() {
    const TRIALS: u32 = 4000;
    let mut random = Random(1);
    // The median of the noise, by many values.
    let mut many = random.times(200_001, 1.0);
    many.sort_by(f64::total_cmp);
    let truth = many[100_000];
    let (mut missed, mut apart) = (0, 0);
    for _ in 0..TRIALS {
        let (a, b) = (random.times(10, 1.0), random.times(12, 1.2));
        let estimate = median(&a, 0.95).expect("there are values");
        missed += u32::from(truth < estimate.low || truth > estimate.high);
        let factor = ratio(&a, &b, 0.95).expect("enough values");
        apart += u32::from(factor.low > 1.2 || factor.high < 1.2);
    }
    // Four standard errors of a proportion. The median's interval says .9785, and the ratio's at least .95.
    let most = |rate: f64| rate + 4.0 * (rate * (1.0 - rate) / f64::from(TRIALS)).sqrt();
    let [missed, apart] = [missed, apart].map(|count| f64::from(count) / f64::from(TRIALS));
    println!("median missed {missed}, ratio {apart}");
    assert!(missed <= most(1.0 - 0.978515625) && missed >= 0.5 * (1.0 - 0.978515625), "{missed}");
    assert!(apart <= most(0.05) && apart >= 0.5 * 0.05, "{apart}");
}

#[test]
fn a_slower_kernel_is_named_and_noise_is_not() {
    let mut random = Random(2);
    let base = synthetic(&mut random, 10, |_| 1.0);
    let same = compare(&base, &base, 0.99, 0.0).expect("the same work");
    assert_eq!(same.differing().count(), 0);
    let slow = synthetic(&mut random, 10, |name| if name == "reproject" { 1.2 } else { 1.0 });
    let found = compare(&base, &slow, 0.99, 0.0).expect("the same work");
    let names: Vec<_> = found.differing().map(|difference| difference.name.as_str()).collect();
    assert_eq!(names, ["reproject"]);
    let factor = found.differing().next().and_then(|difference| difference.ratio).expect("both runs have it");
    assert!(factor.low < 1.2 && 1.2 < factor.high, "{factor:?}");
    // The same the other way about, and not where only more than that counts.
    let back = compare(&slow, &base, 0.99, 0.0).expect("the same work");
    assert!(back.differing().all(|difference| difference.ratio.is_some_and(|ratio| ratio.high < 1.0)));
    assert_eq!(compare(&base, &slow, 0.99, 0.25).expect("the same work").differing().count(), 0);

    // Pairs that differ by noise alone.
    const PAIRS: u32 = 2000;
    let mut alarms = 0;
    for _ in 0..PAIRS {
        let [a, b] = [(); 2].map(|()| synthetic(&mut random, 10, |_| 1.0));
        alarms += u32::from(compare(&a, &b, 0.95, 0.0).expect("the same work").differing().count() > 0);
    }
    let (rate, promised) = (f64::from(alarms) / f64::from(PAIRS), 0.05);
    println!("{rate} of the pairs alarm for nothing");
    assert!(rate <= promised + 4.0 * (promised * (1.0 - promised) / f64::from(PAIRS)).sqrt(), "{rate}");
    // A test that never alarms would be none.
    assert!(rate > 0.2 * promised, "{rate}");
}

#[test]
fn a_kernel_that_one_run_lacks_differs_and_too_few_repeats_are_refused() {
    let mut random = Random(3);
    let a = synthetic(&mut random, 10, |_| 1.0);
    let mut b = a.clone();
    b.kernels[1].name = "draw".into();
    let found = compare(&a, &b, 0.99, 0.0).expect("the same work");
    let names: Vec<_> = found.differing().map(|difference| difference.name.as_str()).collect();
    assert_eq!(names, ["sample", "draw"]);
    let few = synthetic(&mut random, 4, |_| 1.0);
    let error = compare(&few, &few, 0.99, 0.0).expect_err("4 and 4 tell nothing apart");
    assert!(error.is_input() && error.to_string().contains("repeats"), "{error}");
}

#[test]
fn the_program_compares_files_and_refuses_other_work() {
    let folder = Folder::new("compare");
    let mut random = Random(4);
    let mut write = |name: &str, factor: f64, change: &dyn Fn(&mut Value)| {
        let mut report = synthetic(&mut random, 10, |kernel| if kernel == "accumulate" { factor } else { 1.0 }).json();
        change(&mut report);
        fs::write(folder.join(name), report.to_string()).expect("writable");
    };
    write("a.json", 1.0, &|_| {});
    write("b.json", 1.2, &|report| report["about"]["device"] = "another".into());
    write("seed.json", 1.0, &|report| report["work"]["settings"]["seed"] = 7.into());
    write("samples.json", 1.0, &|report| report["work"]["samples"] = 32.into());
    write("broken.json", 1.0, &|report| report["kernels"][0]["timesMs"] = "fast".into());
    fs::write(folder.join("text.json"), "no report").expect("writable");
    fs::write(folder.join("other.json"), "{}").expect("writable");
    assert!(folder.done("bench --compare a.json a.json").contains("no difference"));
    let output = folder.run("bench --compare a.json b.json");
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(said.lines().last(), Some("beyond noise, at 99 %: accumulate"));
    assert!(said.lines().any(|line| line.starts_with("accumulate") && line.ends_with("slower")), "{said}");
    assert!(folder.done("bench --compare a.json b.json --least 40").contains("no difference"));
    for (other, named) in [
        ("seed.json", "settings.seed is 0 in the first and 7 in the second"),
        ("samples.json", "samples is 16 in the first and 32"),
        ("broken.json", "not a whole one"),
        ("text.json", "text.json"),
        ("other.json", "schema"),
    ] {
        let output = folder.run(&format!("bench --compare a.json {other}"));
        assert_eq!(output.status.code(), Some(2), "{other}: {}", stderr(&output));
        assert!(stderr(&output).contains(named), "{other}: {}", stderr(&output));
    }
}

#[test]
fn the_program_measures_what_it_says() {
    let folder = Folder::new("bench");
    let bench = "bench SPOT --model standard --resolution 12x10 --environment constant:1,1,1 --quiet";
    let said = folder.done(&format!("{bench} --samples 3 --repeat 2 --warmup 1 --counters -o a.json"));
    assert!(said.contains("2 repeats after 1; intervals of the median at 50.0 %"), "{said}");
    let report = Report::read(folder.join("a.json")).expect("a report");
    assert_eq!(report.effort, Effort { samples: 3, warmup: 1, repeat: 2 });
    assert_eq!(report.work["pixels"], 120);
    assert_eq!(report.work["settings"]["resolution"], json!([12, 10]));
    assert!(report.host.iter().chain(&report.kernels).all(|series| series.times.len() == 2));
    assert_eq!(report.host.iter().map(|series| series.name.as_str()).collect::<Vec<_>>(), ["render", "image"]);
    let parts: Vec<_> = report.start_up.iter().map(|(name, _)| name.as_str()).collect();
    for part in ["load", "bvh", "device", "prepare", "pipelines", "upload", "first dispatch"] {
        assert!(parts.contains(&part), "{part} of {parts:?}");
    }
    // Where there is nothing to count or tell, nothing is made up.
    assert!(report.counters.is_null() || report.counters.is_array());
    assert!(report.executables.is_null() || report.executables.is_object());
    // Each kernel's work and rays, and limits that are numbers: where there are timestamps, all or nothing.
    assert_eq!(report.counts.len(), report.kernels.len());
    assert_eq!(report.limits.is_some(), !report.kernels.is_empty());
    assert!(report.limits.is_none_or(|limits| limits.bandwidth > 0.0 && limits.peak > 0.0));
    assert!(report.kernels.is_empty() || said.contains("camera rays: ") && said.contains("OF ROOF"), "{said}");
    for series in &report.kernels {
        let [shortest, longest] = series.extremes.expect("kernels have dispatches");
        assert!(shortest <= series.mean() && series.mean() <= longest, "{series:?}");
    }
    assert!(report.device_bytes > 0 && report.rate().is_some_and(|rate| rate.value > 0.0));
    if cfg!(target_os = "linux") {
        // At least what the buffers of a software driver take.
        assert!(report.peak_bytes.is_some_and(|bytes| bytes > 1 << 20));
    }
    // The same work in each repeat: as many dispatches of a kernel as one render makes.
    for series in &report.kernels {
        let launches = match series.name.as_str() {
            "primary" => 4,
            "resolve" => 1,
            // Once in each submission; the first has one sample.
            "count" => 2,
            _ => 3,
        };
        assert_eq!(series.launches, launches, "{}", series.name);
        assert!(said.lines().any(|line| line.starts_with(&series.name)), "{said}");
    }
}

/// A square of 2 x 2 m that faces a camera which sees 4 x 4 m of it and its surroundings, under lights that shine in these
/// directions.
fn square(material: Material, lights: &[DVec3]) -> Scene {
    let positions = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
    let mesh = Mesh {
        name: "square",
        positions: &positions,
        indices: &[0, 1, 2, 0, 2, 3],
        transform: DAffine3::IDENTITY,
        ..Mesh::default()
    };
    let mut scene = Scene::from_meshes(&[mesh], vec![material], vec![]).expect("a scene");
    let light = |&direction: &DVec3| Light {
        name: "sun".into(),
        position: DVec3::ZERO,
        direction,
        intensity: DVec3::ONE,
        kind: LightKind::Directional,
        range: None,
    };
    scene.lights = lights.iter().map(light).collect();
    let lens = Lens::Orthographic { xmag: 2.0, ymag: 2.0 };
    scene.cameras = vec![Camera::new("front", DVec3::new(0.0, 0.0, 3.0), -DVec3::Z, DVec3::Y, lens)];
    scene
}

#[test]
fn what_is_counted_is_what_kernels_do() {
    let device = Device::open(&DeviceOptions::default()).expect("a device");
    if !device.has_timestamps() {
        println!("skipped: the device has no timestamps");
        return;
    }
    const PIXELS: u64 = 16 * 16;
    // Pixels are squares of 1/4 m, so that an eighth by an eighth of them lies within the square, wherever samples fall.
    const COVERED: u64 = 8 * 8;
    let counted = |material: &Material, lights: &[DVec3]| {
        let camera = CameraChoice::Name("front".into());
        let settings = Settings { resolution: Some((16, 16)), camera, model: Model::Standard, ..Settings::default() };
        count(&device, &square(material.clone(), lights), &settings, 3).expect("it is counted")
    };
    let find = |counts: &[Counts], kernel: &str| {
        let found = counts.iter().find(|counts| counts.kernel == kernel);
        found.map_or(Work::default(), |counts| counts.work)
    };
    let (front, behind) = (-DVec3::Z, DVec3::Z);
    let opaque = Material::default();
    let counts = counted(&opaque, &[front, behind]);
    // Once for each of two submissions: the word `samples` is read and written.
    assert_eq!(find(&counts, "count"), Work { loaded: 2 * 4 * PIXELS, stored: 2 * 4 * PIXELS, flops: 0, rays: 0 });
    // Of each pixel: a Sums of 60 bytes, and twice 8 batches of 12; a Pixel of 48. Operations: 3 components of two quotients
    // and a sum for each of two layers; for each batch 3 of quotient and sum, 3 of quotient and difference, 3 of one quotient,
    // two products and a sum; 4 + 6 of the variance and 1 of alpha.
    let resolve = Work { loaded: (60 + 2 * 8 * 12) * PIXELS, stored: 48 * PIXELS, flops: 221 * PIXELS, rays: 0 };
    assert_eq!(find(&counts, "resolve"), resolve);
    // Three samples, and the pixels' centres for the image.
    assert_eq!(find(&counts, "primary").rays, 4 * PIXELS);
    // Of two lights the one in front of the surface.
    assert_eq!(find(&counts, "reflect").rays, 3 * COVERED);
    assert_eq!(find(&counted(&opaque, &[behind]), "reflect").rays, 0);
    assert_eq!(find(&counted(&opaque, &[front, front]), "reflect").rays, 2 * 3 * COVERED);

    let marble = Material::from_preset("marble").expect("a preset");
    let lit = counted(&marble, &[front]);
    let [probes, shadows] = ["reproject", "accumulate"].map(|kernel| find(&lit, kernel).rays);
    assert!(0 < shadows && shadows <= probes && probes <= 3 * COVERED, "{shadows} of {probes}");
    let dark = counted(&marble, &[behind]);
    assert_eq!(find(&dark, "accumulate").rays, 0);
    assert_eq!(find(&dark, "reproject").rays, probes);
}

#[test]
fn the_roofline_is_the_lower_of_two_limits() {
    let mut random = Random(5);
    let mut report = synthetic(&mut random, 1, |_| 1.0);
    report.limits = Some(Limits { bandwidth: 10e9, peak: 100e9, copied: 1 << 20 });
    let counts = |kernel: &str, work| Counts { kernel: kernel.into(), launches: 2, work };
    // 16 launches of a repeat are eight times those two.
    let [slow, quick] =
        [Work { loaded: 800, stored: 200, flops: 100, rays: 7 }, Work { flops: 50_000, ..Work::default() }];
    report.counts =
        vec![counts("primary", Work { flops: 1000, ..slow }), counts("sample", slow), counts("resolve", quick)];
    let lines = report.roofline();
    let seconds = |name: &str| {
        let series = report.kernels.iter().find(|series| series.name == name).expect("it is there");
        series.times[0] * 1e-3
    };
    let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
    for (line, work, intensity, bound) in [
        (&lines[0], [8000.0, 8000.0], 1.0, Bound::Memory),
        (&lines[1], [8000.0, 800.0], 0.1, Bound::Memory),
        (&lines[2], [0.0, 400_000.0], f64::INFINITY, Bound::Arithmetic),
    ] {
        let time = seconds(&line.kernel);
        assert!(near(line.flops, work[1] / time) && (line.intensity == intensity || near(line.intensity, intensity)));
        let roof = (intensity * 10e9).min(100e9);
        let (found, share) = line.bound().expect("there are limits");
        assert_eq!(found, bound);
        assert!(near(share, line.flops / roof), "{line:?}");
    }
    let rays = report.rays();
    assert_eq!(rays.iter().map(|rays| (rays.kind, rays.count)).collect::<Vec<_>>(), [("camera", 56.0)]);
    assert!(near(rays[0].rate, 56.0 / seconds("primary")));
}

#[test]
fn scaling_varies_what_it_says() {
    let folder = Folder::new("scaling");
    let bench = "bench SPOT --model standard --resolution 24x16 --environment constant:1,1,1 --quiet --scaling";
    let said = folder.done(&format!("{bench} lights,materials,triangles --values 2,5 -o a.json"));
    let report: Value = serde_json::from_slice(&fs::read(folder.join("a.json")).expect("written")).expect("JSON");
    let runs = report["scalings"].as_array().expect("an array");
    let all = |name: &str| {
        runs.iter()
            .map(|run| run["points"].as_array().expect("points").iter().map(|p| p[name].clone()).collect())
            .collect::<Vec<Vec<Value>>>()
    };
    assert_eq!(runs.iter().map(|run| &run["axis"]).collect::<Vec<_>>(), ["lights", "materials", "triangles"]);
    // A sphere has 12 triangles at least, 64 spheres of 300 each.
    assert_eq!(all("value"), [[json!(2), json!(5)], [json!(2), json!(5)], [json!(12), json!(12)]]);
    assert_eq!(all("triangles")[1], [json!(64 * 300), json!(64 * 300)]);
    assert!(all("pixels").iter().flatten().all(|pixels| *pixels == 24 * 16));
    assert!(said.contains("LIGHTS") && said.contains("MATERIALS") && said.contains("TRIANGLES"), "{said}");
    folder.done(&format!("{bench} resolution,samples --values 8,16 -o a.csv"));
    let csv = fs::read_to_string(folder.join("a.csv")).expect("written");
    let fields = |line: &str| line.split(',').map(String::from).collect::<Vec<_>>();
    let whole: Vec<_> = csv.lines().skip(1).map(fields).filter(|fields| fields[7].is_empty()).collect();
    let sizes: Vec<_> = whole.iter().map(|fields| [&fields[0], &fields[1], &fields[3], &fields[4]]).collect();
    assert_eq!(
        sizes,
        [
            ["resolution", "8", "64", "4"],
            ["resolution", "16", "256", "4"],
            ["samples", "8", "384", "8"],
            ["samples", "16", "384", "16"]
        ]
    );
}

#[test]
fn the_exponent_is_that_of_a_power() {
    let point = |value: u64, render: f64| Point {
        value,
        triangles: 1,
        pixels: value * value,
        samples: 1,
        scene: None,
        renderer: 1.0,
        render,
        kernels: vec![("primary".into(), render)],
        device_bytes: 4,
    };
    let points = |power: f64| [10, 30, 500].map(|value| point(value, 0.7 * (value as f64).powf(power))).to_vec();
    let near = |a: Option<f64>, b: f64| a.is_some_and(|a| (a - b).abs() < 1e-12 * b.abs().max(1.0));
    for power in [0.0, 0.3, 1.0, 2.0] {
        let samples = Scaling { axis: Axis::Samples, points: points(power), skipped: vec![] };
        assert!(near(samples.exponent(), power) && near(samples.ratio(), 50f64.powf(power)), "{samples:?}");
        // Against pixels, not their root.
        let resolution = Scaling { axis: Axis::Resolution, ..samples };
        assert!(near(resolution.exponent(), power / 2.0), "{resolution:?}");
    }
    // Points of fewer samples are no faster for it.
    let mut lights = Scaling { axis: Axis::Lights, points: points(1.0), skipped: vec![] };
    (lights.points[0].samples, lights.points[0].render) = (4, 4.0 * lights.points[0].render);
    assert!(near(lights.exponent(), 1.0) && near(lights.ratio(), 50.0), "{lights:?}");
    let one = Scaling { axis: Axis::Lights, points: vec![point(1, 1.0)], skipped: vec![] };
    assert_eq!((one.exponent(), one.ratio()), (None, Some(1.0)));
    // Two rows, whole and kernel, below the head.
    assert_eq!(scalings_csv(&[one]).lines().count(), 3);
}
