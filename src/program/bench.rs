//! `bench`: the time of fixed work, kernel by kernel, and whether two runs of it differ beyond noise.

use super::{
    Failure, arguments, print,
    scene::{Method, Subject},
    tables::{aligned, row, significant},
};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use indicatif::{ProgressBar, ProgressStyle};
use std::{
    fmt::Write,
    path::{Path, PathBuf},
    process::ExitCode,
};
use translucent::{
    Device, DeviceOptions, Scene, Settings,
    bench::{
        self, Axis, Bound, CONFIDENCE, Comparison, Difference, Effort, MAX_REPEATS, Point, Report, Scaling, Series,
        compare, rays_of, scalings_csv, scalings_json, statistics,
    },
    image::{check_writable, write_whole},
    timeline::{Timeline, begin},
};

#[derive(clap::Args)]
pub struct Bench {
    #[command(flatten)]
    scene: Option<Subject>,
    #[command(flatten)]
    method: Method,
    /// Samples of each pixel in a repeat.
    #[arg(long, value_name = "M", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..))]
    samples: u32,
    /// Repeats that are counted.
    #[arg(long, value_name = "N", default_value_t = 10,
          value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_REPEATS)))]
    repeat: u32,
    /// Repeats before, which are not: drivers compile at the first.
    #[arg(long, value_name = "N", default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(..=i64::from(MAX_REPEATS)))]
    warmup: u32,
    /// Key of all random numbers.
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u32,
    /// Vulkan device by index, part of the name, or UUID (see `devices`); without it the best.
    #[arg(long, value_name = "INDEX|NAME|UUID")]
    device: Option<String>,
    /// Count what the hardware can count of each kernel (VK_KHR_performance_query), for the JSON. Counting slows
    /// kernels down.
    #[arg(long)]
    counters: bool,
    /// Leave out what kernels do and how far they are from what the device gives at best, which take a slower sample with
    /// counters and two small kernels.
    #[arg(long)]
    no_roofline: bool,
    /// How time grows with what is named, in place of the rest: pixels and samples of the scene, triangles of a sphere,
    /// materials of 64 spheres, point lights around the scene. Minutes on a processor.
    #[arg(long, value_name = "all|resolution|samples|triangles|materials|lights", value_delimiter = ',',
          value_parser = axes(), conflicts_with_all = ["samples", "repeat", "warmup", "counters", "no_roofline", "compare"])]
    scaling: Vec<Vec<Axis>>,
    /// Values of each of --scaling, in place of its own.
    #[arg(long, value_name = "N,...", value_delimiter = ',', requires = "scaling",
          value_parser = clap::value_parser!(u32).range(1..))]
    values: Vec<u32>,
    /// Everything that was measured, as JSON; with --scaling JSON or CSV.
    #[arg(short, long, value_name = "OUT.json|.csv")]
    output: Option<PathBuf>,
    /// No progress.
    #[arg(long)]
    quiet: bool,
    /// Say in which kernels two runs of the same work differ beyond noise. Exit status 0: in none; 1: in some; 2: they
    /// cannot be compared.
    #[arg(long, value_names = ["A.json", "B.json"], num_args = 2,
          conflicts_with_all = ["file", "samples", "repeat", "warmup", "seed", "device", "counters", "no_roofline", "scaling", "values", "output"])]
    compare: Option<Vec<PathBuf>>,
    /// How sure it is that runs that do not differ are said not to, in per cent.
    #[arg(long, value_name = "PERCENT", requires = "compare", default_value = "99", value_parser = percentage)]
    confidence: f64,
    /// Least difference of times that counts, in per cent.
    #[arg(long, value_name = "PERCENT", requires = "compare", default_value = "0",
          value_parser = arguments::not_negative)]
    least: f64,
}

fn axes() -> impl TypedValueParser<Value = Vec<Axis>> {
    let names = Axis::NAMES.map(|(_, name)| name).into_iter().chain(["all"]);
    PossibleValuesParser::new(names).map(|text| {
        let all = Axis::NAMES.into_iter().filter(|(_, name)| text == "all" || *name == text);
        all.map(|(axis, _)| axis).collect()
    })
}

fn percentage(text: &str) -> Result<f64, String> {
    let value = arguments::positive(text).ok().filter(|value| *value < 100.0);
    value.ok_or("it is a number between 0 and 100".into())
}

impl Bench {
    pub fn run(self) -> Result<ExitCode, Failure> {
        match (&self.compare, &self.scene) {
            (Some(files), _) => self.compare(&files[0], &files[1]),
            (None, Some(scene)) => self.measure(scene),
            (None, None) => Err(Failure::input("bench: needs SCENE.gltf|.glb, or --compare A.json B.json")),
        }
    }

    fn measure(&self, options: &Subject) -> Result<ExitCode, Failure> {
        if let Some(output) = &self.output {
            let ends = |end: &str| output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(end));
            if !ends("json") && (self.scaling.is_empty() || !ends("csv")) {
                let wanted = if self.scaling.is_empty() { ".json" } else { ".json or .csv" };
                return Err(Failure::input(format!("{}: its name must end in {wanted}", output.display())));
            }
            check_writable(output)?;
            options.keep_from(output)?;
        }
        let timeline = Timeline::new();
        let (scene, warnings) = options.load(Some(timeline.clone())).map_err(Failure::while_reading)?;
        if !self.quiet {
            warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
        }
        let timeline = Some(timeline);
        let opening = begin(&timeline, "device");
        let counters = self.counters;
        let with = DeviceOptions { device: self.device.clone(), profiling: true, counters, ..DeviceOptions::default() };
        let device = Device::open(&with)?;
        if counters && !self.quiet && device.counters().is_empty() {
            eprintln!("warning: the device counts nothing: it lacks VK_KHR_performance_query, or counters of kernels");
        }
        drop(opening);
        let settings = Settings { seed: self.seed, timeline, ..self.method.settings(options.settings()) };
        if !self.scaling.is_empty() {
            return self.scale(&device, &scene, &settings);
        }
        let effort = Effort { samples: self.samples, warmup: self.warmup, repeat: self.repeat };
        let bar = self.bar(u64::from(self.warmup) + u64::from(self.repeat), "repeats");
        let mut report = bench::run(&device, &scene, &settings, effort, &mut |done| bar.set_position(u64::from(done)))?;
        if !self.no_roofline {
            bench::add_roofline(&mut report, &device, &scene, &settings)?;
        }
        bar.finish_and_clear();
        if let Some(output) = &self.output {
            write_whole(output, format!("{:#}\n", report.json()).as_bytes())?;
        }
        print(&text(&report))?;
        Ok(ExitCode::SUCCESS)
    }

    fn scale(&self, device: &Device, scene: &Scene, settings: &Settings) -> Result<ExitCode, Failure> {
        let mut axes: Vec<Axis> = vec![];
        self.scaling.iter().flatten().for_each(|axis| {
            if !axes.contains(axis) {
                axes.push(*axis);
            }
        });
        let values = |axis: Axis| if self.values.is_empty() { axis.values() } else { &self.values };
        let bar = self.bar(axes.iter().map(|axis| values(*axis).len() as u64).sum(), "points");
        let mut scalings = vec![];
        for axis in axes {
            scalings.push(bench::scaling(device, scene, settings, axis, values(axis), &mut |_| bar.inc(1))?);
        }
        bar.finish_and_clear();
        if let Some(output) = &self.output {
            let csv = output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
            let text = match csv {
                true => scalings_csv(&scalings),
                false => format!("{:#}\n", scalings_json(device, &scalings)),
            };
            write_whole(output, text.as_bytes())?;
        }
        print(&scalings.iter().map(scaled).collect::<Vec<_>>().join("\n"))?;
        Ok(ExitCode::SUCCESS)
    }

    fn bar(&self, count: u64, what: &str) -> ProgressBar {
        if self.quiet {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::new(count);
        let style = ProgressStyle::with_template(&format!("{{bar:30}} {{pos}}/{{len}} {what}  {{eta}} left"));
        style.map_or(bar.clone(), |style| bar.with_style(style))
    }

    fn compare(&self, a: &Path, b: &Path) -> Result<ExitCode, Failure> {
        let [first, second] =
            [Report::read(a).map_err(Failure::while_reading)?, Report::read(b).map_err(Failure::while_reading)?];
        let comparison = compare(&first, &second, self.confidence / 100.0, self.least / 100.0)?;
        print(&compared(&comparison))?;
        Ok(if comparison.differing().next().is_some() { ExitCode::from(1) } else { ExitCode::SUCCESS })
    }
}

/// A median time with its interval.
fn cells(name: &str, series: &Series, share: &str) -> Vec<String> {
    let between = |estimate: statistics::Estimate| {
        [significant(estimate.value), format!("{} to {}", significant(estimate.low), significant(estimate.high))]
    };
    let [median, interval] = series.median().map_or(["-".into(), "-".into()], between);
    let [mean, shortest, longest] = match series.extremes {
        Some([shortest, longest]) => [series.mean(), shortest, longest].map(significant),
        None => Default::default(),
    };
    row([name, &series.launches.to_string(), &median, &interval, share, &mean, &shortest, &longest])
}

/// What kernels do each second beside what the device gives at best.
fn roofline(report: &Report) -> String {
    let mut rows =
        vec![row(["", "GB/s", "OF COPY", "GFLOP/s", "OF PEAK", "FLOP/BYTE", "BOUND BY", "OF ROOF", "MRAYS/s"])];
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    for line in report.roofline() {
        let [memory, arithmetic] = line.shares.map_or(["-".into(), "-".into()], |shares| shares.map(percent));
        let (bound, share) = match line.bound() {
            Some((Bound::Memory, share)) => ("memory", percent(share)),
            Some((Bound::Arithmetic, share)) => ("arithmetic", percent(share)),
            None => ("-", "-".into()),
        };
        let intensity = if line.intensity.is_finite() { significant(line.intensity) } else { "-".into() };
        let rays = rays_of(&line.kernel).filter(|_| line.rays > 0.0);
        let rays = rays.map_or(String::new(), |kind| format!("{} {kind}", significant(line.rays * 1e-6)));
        let [bytes, flops] = [line.bandwidth, line.flops].map(|rate| significant(rate * 1e-9));
        rows.push(row([&line.kernel, &bytes, &memory, &flops, &arithmetic, &intensity, bound, &share, &rays]));
    }
    let mut text = aligned(&rows);
    if let Some(limits) = report.limits {
        // Text that cannot be written to a string does not exist; so below.
        let _ = writeln!(
            text,
            "\nat best: {} GB/s, copying {} MB; {} GFLOP/s of f32",
            significant(limits.bandwidth * 1e-9),
            significant(limits.copied as f64 * 1e-6),
            significant(limits.peak * 1e-9)
        );
    }
    for rays in report.rays() {
        let _ = writeln!(text, "{} rays: {} Mrays/s", rays.kind, significant(rays.rate * 1e-6));
    }
    text
}

fn text(report: &Report) -> String {
    let start: Vec<_> = report.start_up.iter().map(|(name, ms)| format!("{name} {}", significant(*ms))).collect();
    let mut text = format!("START-UP [ms]: {}\n\n", start.join(", "));
    let median = |series: &Series| series.median().map_or(0.0, |median| median.value);
    let all: f64 = report.kernels.iter().map(median).sum();
    let mut rows = vec![row(["", "LAUNCHES", "MEDIAN [ms]", "INTERVAL [ms]", "SHARE", "DISPATCH [ms]", "MIN", "MAX"])];
    let mut kernels: Vec<&Series> = report.kernels.iter().collect();
    kernels.sort_by(|a, b| median(b).total_cmp(&median(a)));
    let share = |series: &Series| if all > 0.0 { format!("{:.1} %", 100.0 * median(series) / all) } else { "-".into() };
    rows.extend(kernels.iter().map(|series| cells(&series.name, series, &share(series))));
    rows.extend(report.host.iter().map(|series| cells(&format!("host: {}", series.name), series, "")));
    text.push_str(&aligned(&rows));
    if !report.counts.is_empty() {
        text.push('\n');
        text.push_str(&roofline(report));
    }
    let intervals = report.host.first().and_then(Series::median).map_or(0.0, |median| median.confidence);
    let Effort { repeat, warmup, .. } = report.effort;
    // Text that cannot be written to a string does not exist.
    let _ = writeln!(text, "\n{repeat} repeats after {warmup}; intervals of the median at {:.1} %", 100.0 * intervals);
    if intervals < CONFIDENCE {
        let _ = writeln!(text, "too few repeats for {:.0} %", 100.0 * CONFIDENCE);
    }
    if let Some(rate) = report.rate() {
        let [value, low, high] = [rate.value, rate.low, rate.high].map(significant);
        let _ = writeln!(text, "{value} Msamples/s ({low} to {high})");
    }
    let megabytes = |bytes: u64| significant(bytes as f64 * 1e-6);
    let _ = write!(text, "memory: buffers {} MB", megabytes(report.device_bytes));
    if let Some(peak) = report.peak_bytes {
        let _ = write!(text, ", process {} MB at the peak", megabytes(peak));
    }
    text + "\n"
}

/// A table of one axis: milliseconds, of kernels those of a sample.
fn scaled(run: &Scaling) -> String {
    let mut kernels: Vec<&str> = vec![];
    for (name, _) in run.points.iter().flat_map(|point| &point.kernels) {
        if !kernels.contains(&name.as_str()) {
            kernels.push(name);
        }
    }
    // What is varied comes first, and once.
    let sizes: [(&str, fn(&Point) -> u64); 2] =
        [("triangles", |point| point.triangles), ("samples", |point| point.samples.into())];
    let sizes = || sizes.iter().filter(|(name, _)| *name != run.axis.name());
    let head = |name: &str| name.to_uppercase();
    let mut rows = vec![row([&head(run.axis.name())])];
    rows[0].extend(sizes().map(|(name, _)| head(name)));
    rows[0].extend(row(["SCENE [ms]", "RENDERER", "SAMPLE"]));
    rows[0].extend(kernels.iter().map(|name| name.to_string()));
    for point in &run.points {
        let mut cells = row([&point.value.to_string()]);
        cells.extend(sizes().map(|(_, size)| size(point).to_string()));
        cells.push(point.scene.map_or("-".into(), significant));
        cells.extend([point.renderer, point.sample()].map(significant));
        cells.extend(kernels.iter().map(|name| {
            let found = point.kernels.iter().find(|(named, _)| named == name);
            found.map_or("-".into(), |(_, ms)| significant(ms / f64::from(point.samples)))
        }));
        rows.push(cells);
    }
    let mut text = aligned(&rows);
    let (timed, grown) = match run.axis {
        Axis::Resolution => ("a sample", "pixels"),
        Axis::Samples => ("all samples", "samples"),
        other => ("a sample", other.name()),
    };
    if let (Some(exponent), Some(ratio)) = (run.exponent(), run.ratio()) {
        // Text that cannot be written to a string does not exist; so below.
        let _ = writeln!(
            text,
            "time of {timed}: {grown} to the power of {exponent:.2}; the last takes {} times as long as the first",
            significant(ratio)
        );
    }
    for (value, why) in &run.skipped {
        let _ = writeln!(text, "{value}: left out: {why}");
    }
    text
}

fn compared(comparison: &Comparison) -> String {
    let mut rows = vec![row(["", "A [ms]", "B [ms]", "B/A", "INTERVAL", ""])];
    let time = |ms: Option<f64>| ms.map_or("-".into(), significant);
    for difference in &comparison.differences {
        let [a, b] = difference.medians.map(time);
        let ratio = difference.ratio.map_or("-".into(), |ratio| format!("{:.4}", ratio.value));
        let interval = difference.ratio.map_or("-".into(), |ratio| format!("{:.4} to {:.4}", ratio.low, ratio.high));
        rows.push(row([&difference.name, &a, &b, &ratio, &interval, verdict(difference)]));
    }
    let differing: Vec<&str> = comparison.differing().map(|difference| difference.name.as_str()).collect();
    let confidence = significant(100.0 * comparison.confidence);
    let sentence = match differing.is_empty() {
        true => format!("no difference beyond noise, at {confidence} %\n"),
        false => format!("beyond noise, at {confidence} %: {}\n", differing.join(", ")),
    };
    aligned(&rows) + "\n" + &sentence
}

fn verdict(difference: &Difference) -> &'static str {
    match (difference.differs, difference.ratio, difference.medians) {
        (false, ..) => "",
        (true, Some(ratio), _) if ratio.value > 1.0 => "slower",
        (true, Some(_), _) => "faster",
        (true, None, [Some(_), _]) => "only in A",
        (true, None, _) => "only in B",
    }
}
