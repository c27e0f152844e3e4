//! What profiling costs. On: the same render in turns without and with a timeline, and the ratio of the two in wall time
//! and in time of all cores (Linux), with its interval. Off: how long it takes to ask whether there is a timeline, as
//! often as a timed render notes something.
//!
//!     cargo run --release --example profiling_cost -- assets/spot.glb [SIZE [SAMPLES [PAIRS]]]

use std::{error::Error, hint::black_box, time::Instant};
use translucent::{
    Device, DeviceOptions, Environment, Model, Renderer, Scene, Settings,
    bench::statistics::{Estimate, median},
    timeline::{self, Timeline},
};

/// Nanoseconds on a core so far, of all threads; 0 where the system does not tell.
fn cores() -> f64 {
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let times = tasks.filter_map(|task| {
        let text = std::fs::read_to_string(task.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse::<f64>().ok()
    });
    times.sum()
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, numbers @ ..] = arguments.as_slice() else {
        return Err("usage: profiling_cost SCENE [SIZE [SAMPLES [PAIRS]]]".into());
    };
    let number = |index: usize, otherwise| numbers.get(index).map_or(Ok(otherwise), |text| text.parse::<u32>());
    let (size, samples, pairs) = (number(0, 256)?, number(1, 16)?, number(2, 20)?);

    let device = Device::open(&DeviceOptions { profiling: true, ..DeviceOptions::default() })?;
    let mut scene = Scene::load(input)?;
    scene.set_environment(Environment::constant(glam::DVec3::ONE)?)?;
    let settings = Settings { resolution: Some((size, size)), model: Model::Standard, ..Settings::default() };
    let timeline = Timeline::new();
    let timed = Settings { timeline: Some(timeline.clone()), ..settings.clone() };
    let mut renderers = [Renderer::new(&device, &scene, &settings)?, Renderer::new(&device, &scene, &timed)?];
    let mut noted = 0;
    let mut render = |index: usize| -> Result<[f64; 2], Box<dyn Error>> {
        renderers[index].reset();
        let (wall, core) = (Instant::now(), cores());
        renderers[index].render(samples)?;
        let times = [wall.elapsed().as_secs_f64(), (cores() - core) * 1e-9];
        noted = noted.max(timeline.spans().len());
        timeline.clear();
        Ok(times)
    };
    // Drivers compile at the first.
    for index in [0, 1] {
        render(index)?;
    }
    let mut ratios = [vec![], vec![]];
    let mut least = f64::INFINITY;
    for pair in 0..pairs {
        // Each comes first as often as the other.
        let order = if pair % 2 == 0 { [0, 1] } else { [1, 0] };
        let mut times = [[0.0; 2]; 2];
        for index in order {
            times[index] = render(index)?;
        }
        least = least.min(times[0][0]);
        for (kind, ratios) in ratios.iter_mut().enumerate() {
            ratios.push(times[1][kind] / times[0][kind]);
        }
        println!(
            "{pair}: off {:.4} s, on {:.4} s; cores {:.4}, {:.4}",
            times[0][0], times[1][0], times[0][1], times[1][1]
        );
    }
    for (name, ratios) in ["wall", "cores"].iter().zip(&ratios) {
        let Some(Estimate { value, low, high, confidence }) = median(ratios, 0.95) else { continue };
        let [value, low, high] = [value, low, high].map(|ratio| 100.0 * (ratio - 1.0));
        println!("{name}: {value:+.2} % with profiling ({low:+.2} to {high:+.2} % at {:.1} %)", 100.0 * confidence);
    }
    const ASKED: u32 = 10_000_000;
    let start = Instant::now();
    for _ in 0..ASKED {
        drop(black_box(timeline::begin(black_box(&None), "asked")));
    }
    let each = start.elapsed().as_secs_f64() / f64::from(ASKED);
    let share = 100.0 * each * noted as f64 / least;
    println!("off: asked {noted} times, {:.1} ns each: {share:.6} % of a render", 1e9 * each);
    Ok(())
}
