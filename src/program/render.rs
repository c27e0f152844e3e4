//! `render`: a glTF scene becomes an EXR image, and a PNG where one is asked for.

use super::{Failure, INTERRUPTED, arguments, log, print, profile, scene::SceneOptions, tev::Viewer};
use clap::builder::PossibleValuesParser;
use indicatif::{ProgressBar, ProgressState, ProgressStyle};
use std::{
    fmt,
    iter::once,
    ops::{ControlFlow, Range},
    path::PathBuf,
    process::ExitCode,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};
use translucent::{
    Device, DeviceOptions, Error, Goal, Image, Outcome, Progress, Renderer, Settings, Stop,
    gpu::leave,
    image::{Attribute, check_writable},
    settings::Integrator,
    shared::BATCHES,
    timeline::{Timeline, begin},
};

/// The layers that `--aov` knows; R, G, B and A are always there.
const LAYERS: [&str; 8] = ["subsurface", "reflection", "variance", "N", "P", "Z", "samples", "material"];

/// Between copies of the sums from the device: what a lost device costs at most.
const KEEP_EVERY: Duration = Duration::from_secs(30);

#[derive(clap::Args)]
pub struct Render {
    #[command(flatten)]
    scene: SceneOptions,
    /// The EXR file to write; without it the scene's name with .exr, in the current folder.
    #[arg(short, long, value_name = "OUT.exr")]
    output: Option<PathBuf>,
    /// Samples of each pixel, 64 or, of a cloud, 4; A:B renders samples A to B-1, a part that `merge` puts together with
    /// others. With --error or --time the most samples, without end if not given.
    #[arg(long, value_name = "M|A:B", value_parser = arguments::samples)]
    samples: Option<arguments::Samples>,
    /// Stop when the estimated error of the image is below this: sqrt(relMSE), relMSE being the mean over pixels and RGB of
    /// (x-r)^2 / (r^2 + .01 mean(r)^2) against the converged image r. Pixels get the samples that they need.
    #[arg(long, value_name = "1%", value_parser = arguments::share)]
    error: Option<f64>,
    /// Stop when this time is used up, counted from the start of the program: 30s, 500ms, 2min, 1h.
    #[arg(long, value_name = "30s", value_parser = arguments::time)]
    time: Option<Duration>,
    /// Layers to write beside R, G, B and A: all, or some of subsurface, reflection, variance, N, P, Z, samples,
    /// material, separated by commas.
    #[arg(long, value_name = "LIST|all", default_value = "all", value_delimiter = ',',
          value_parser = PossibleValuesParser::new(LAYERS.into_iter().chain(["all"])), hide_possible_values = true)]
    aov: Vec<String>,
    /// Write an 8-bit PNG as well.
    #[arg(long, value_name = "FILE.png")]
    png: Option<PathBuf>,
    /// Exposure of the PNG in stops.
    #[arg(long, value_name = "EV", requires = "png", allow_negative_numbers = true, value_parser = arguments::finite)]
    exposure: Option<f64>,
    /// Most pixels on the device at a time, 2^18 where memory allows. With fewer a render takes less memory and longer; the
    /// image is the same, but with --error.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    band_pixels: Option<u32>,
    /// Key of all random numbers.
    #[arg(long, value_name = "S", default_value_t = 0, allow_negative_numbers = true)]
    seed: u32,
    /// Vulkan device by index, part of the name, or UUID (see `devices`); without it the best.
    #[arg(long, value_name = "INDEX|NAME|UUID")]
    device: Option<String>,
    /// Show the image while it is rendered in the viewer tev, which listens on port 14158. Without it the render goes on.
    #[arg(long, value_name = "HOST:PORT", value_parser = arguments::address)]
    tev: Option<String>,
    /// Time each kernel and what the host does: .json is a trace that Perfetto opens, .csv has a row for each kernel.
    /// May be repeated.
    #[arg(long, value_name = "FILE.json|.csv")]
    profile: Vec<PathBuf>,
    /// No progress, notes or warnings.
    #[arg(long)]
    quiet: bool,
}

impl Render {
    pub fn run(self) -> Result<ExitCode, Failure> {
        if self.quiet {
            log::quiet();
        }
        let begun = Instant::now();
        self.check_goal()?;
        let output = self.output()?;
        let stop = stop_on_interrupt("what there is")?;
        let timeline = (!self.profile.is_empty() || cfg!(feature = "tracy")).then(Timeline::new);
        let (scene, warnings) = self.scene.load(timeline.clone()).map_err(Failure::while_reading)?;
        warnings.iter().for_each(|warning| self.warn(warning));
        let profiling = timeline.is_some();
        let options = DeviceOptions { device: self.device.clone(), profiling, ..DeviceOptions::default() };
        let opening = begin(&timeline, "device");
        let device = Device::open(&options)?;
        drop(opening);
        let settings = Settings { timeline: timeline.clone(), ..self.settings() };
        let mut renderer = Renderer::new(&device, &scene, &settings)?;
        renderer.keep_every(KEEP_EVERY);
        renderer.prepared().warnings().for_each(|warning| self.warn(&warning));

        let bar = self.bar();
        let start = Instant::now();
        let reopen = |why: &Error| {
            bar.suspend(|| self.warn(&format!("{why}; going on with a new device")));
            Device::open(&options)
        };
        let mut viewer = self.tev.as_ref().and_then(|address| {
            let viewer = Viewer::connect(address, output.display().to_string());
            viewer.inspect_err(|error| self.warn(&format!("no tev at {address}: {error}"))).ok()
        });
        let deadline = self.time.and_then(|time| begun.checked_add(time));
        let (_, (outcome, seconds, mut image)) = renderer.with_recovery(&scene, reopen, |renderer| {
            let samples = self.samples();
            let outcome = loop {
                let mut shows = false;
                let mut progress = |progress: &Progress| {
                    let (done, total) = self.part_done(begun, progress);
                    bar.set_length(total);
                    bar.set_position(done);
                    if let Some(error) = progress.error {
                        bar.set_message(format!("error {:.2} %  ", 100.0 * error));
                    }
                    let stops = stop.load(Ordering::Relaxed);
                    shows = !stops && viewer.as_ref().is_some_and(Viewer::is_due);
                    if stops || shows { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
                };
                let outcome = if samples.start == 0 {
                    let goal = Goal { samples: samples.end, error: self.error, deadline };
                    renderer.render_until(&goal, &mut progress)?
                } else {
                    let finished = renderer.render_rest(samples.clone(), &mut progress)?;
                    Outcome { stop: if finished { Stop::Samples } else { Stop::Caller }, error: None }
                };
                if outcome.stop != Stop::Caller || !shows {
                    break outcome;
                }
                let since = Instant::now();
                let image = renderer.image()?;
                bar.suspend(|| self.show(&mut viewer, &image, since));
            };
            bar.finish_and_clear();
            let seconds = start.elapsed().as_secs_f64();
            Ok((outcome, seconds, renderer.take_image()?))
        })?;
        if let (Some(asked), Stop::Samples) = (self.error, outcome.stop) {
            let reached = outcome.error.map_or("unknown".into(), |error| format!("{:.3} %", 100.0 * error));
            self.warn(&format!("the error is {reached}, not {:.3} %, with all samples", 100.0 * asked));
        }
        let finished = outcome.stop != Stop::Caller;
        self.show(&mut viewer, &image, Instant::now());
        self.keep_asked(&mut image);
        if let Some(Attribute::Integer(invalid @ 1..)) = image.attributes.get("translucent.invalidSamples") {
            self.warn(&format!("samples left out because they were not finite or negative: {invalid}"));
        }
        let writing = begin(&timeline, "write");
        image.write(&output)?;
        if let Some(png) = &self.png {
            image.write_png(png, self.exposure.unwrap_or(0.0))?;
        }
        drop(writing);
        let (width, height) = (image.width, image.height);
        let samples = match image.attributes.get("translucent.samples") {
            Some(Attribute::Integer(samples)) => *samples,
            _ => 0,
        };
        let rate = f64::from(width) * f64::from(height) * f64::from(samples) / seconds * 1e-6;
        let error = outcome.error.map_or(String::new(), |error| format!(", error {:.3} %", 100.0 * error));
        let note = if finished { "" } else { ", interrupted" };
        print(&format!(
            "{}: {width}x{height}, {samples} samples, {seconds:.2} s, {rate:.3} Msamples/s{error}{note}\n",
            output.display()
        ))?;
        if let Some(timeline) = timeline.as_ref().filter(|_| !self.profile.is_empty()) {
            profile::write(timeline, &device, &self.profile)?;
            print(&profile::table(timeline))?;
        }
        Ok(if finished { ExitCode::SUCCESS } else { ExitCode::from(INTERRUPTED) })
    }

    /// Where the image goes; that it can, and that no file of the user's is in danger.
    fn output(&self) -> Result<PathBuf, Failure> {
        let output = match &self.output {
            Some(output) => output.clone(),
            None => {
                let file = &self.scene.subject.file;
                let name = file.file_stem();
                let name = name.ok_or_else(|| Failure::input(format!("{}: not a file", file.display())))?;
                PathBuf::from(format!("{}.exr", name.to_string_lossy()))
            }
        };
        let images = once((&output, &["exr"][..])).chain(self.png.as_ref().map(|png| (png, &["png"][..])));
        for (path, endings) in images.chain(self.profile.iter().map(|path| (path, &["json", "csv"][..]))) {
            if !path.extension().is_some_and(|e| endings.iter().any(|ending| e.eq_ignore_ascii_case(ending))) {
                let endings = endings.join(" or .");
                return Err(Failure::input(format!("{}: its name must end in .{endings}", path.display())));
            }
            check_writable(path)?;
            self.scene.keep_from(path)?;
        }
        Ok(output)
    }

    fn warn(&self, text: &str) {
        if !self.quiet {
            eprintln!("warning: {text}");
        }
    }

    /// Shows an image in the viewer, if it is still there.
    fn show(&self, viewer: &mut Option<Viewer>, image: &Image, since: Instant) {
        if let Some(Err(error)) = viewer.as_mut().map(|viewer| viewer.show(image, since)) {
            self.warn(&format!("tev shows no more: {error}"));
            *viewer = None;
        }
    }

    fn settings(&self) -> Settings {
        Settings {
            seed: self.seed,
            variance: self.wants("variance") && self.samples().len() >= BATCHES as usize,
            estimate_error: self.error.is_some(),
            band_pixels: self.band_pixels,
            ..self.scene.settings()
        }
    }

    fn samples(&self) -> Range<u32> {
        match (&self.samples, self.scene.method.integrator) {
            (Some(samples), _) => samples.range.clone(),
            _ if self.error.is_some() || self.time.is_some() => 0..arguments::MAX_SAMPLES,
            (None, Integrator::Cloud) => 0..4,
            (None, _) => 0..64,
        }
    }

    /// That the goal is one of a whole image.
    fn check_goal(&self) -> Result<(), Failure> {
        let part = self.samples.as_ref().is_some_and(|samples| samples.part);
        let goals = [(self.error.is_some(), "--error"), (self.time.is_some(), "--time")];
        match goals.iter().find(|(given, _)| *given && part) {
            Some((_, goal)) => Err(Failure::input(format!("{goal} is not for a part of the samples (--samples A:B)"))),
            None => Ok(()),
        }
    }

    /// How far the render is, of how much: by whichever goal is nearer.
    fn part_done(&self, begun: Instant, progress: &Progress) -> (u64, u64) {
        const WHOLE: f64 = 1000.0;
        let time = self.time.map(|time| begun.elapsed().as_secs_f64() / time.as_secs_f64());
        // The squared error falls with the samples.
        let error = self.error.and_then(|asked| Some((asked / progress.error?).powi(2)));
        match [time, error].into_iter().flatten().reduce(f64::max) {
            Some(part) => ((part.min(1.0) * WHOLE) as u64, WHOLE as u64),
            None if self.error.is_some() => (0, WHOLE as u64),
            None => (progress.done, progress.total),
        }
    }

    fn wants(&self, layer: &str) -> bool {
        self.aov.iter().any(|asked| asked == "all" || asked == layer)
    }

    fn keep_asked(&self, image: &mut Image) {
        image.channels.retain(|channel| {
            let layer = channel.name.split('.').next().unwrap_or_default();
            !LAYERS.contains(&layer) || self.wants(layer)
        });
    }

    fn bar(&self) -> ProgressBar {
        if self.quiet {
            return ProgressBar::hidden();
        }
        let samples = self.samples().len();
        let counted = self.error.is_none() && self.time.is_none();
        // Computed from the position, so that a line never shows two moments.
        let status = move |state: &ProgressState, out: &mut dyn fmt::Write| {
            let done = state.pos() as f64;
            let each = done / state.len().unwrap_or(1).max(1) as f64 * samples as f64;
            let rate = done / state.elapsed().as_secs_f64().max(1e-9) * 1e-6;
            // A line that cannot be drawn is no reason to stop.
            let _ = if counted { write!(out, "{each:.0}/{samples} samples  {rate:.3} Msamples/s") } else { Ok(()) };
        };
        // Draws to stderr, and nothing where that is no terminal. Without a length it would be drawn full.
        let bar = ProgressBar::new(1);
        let style = ProgressStyle::with_template("{bar:30} {percent:>3} %  {msg}{status}  {eta} left");
        style.map_or(bar.clone(), |style| bar.with_style(style.with_key("status", status)))
    }
}

/// A flag that the first Ctrl-C sets, saying that `what` is written; the second ends the program at once.
pub fn stop_on_interrupt(what: &'static str) -> Result<Arc<AtomicBool>, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            leave(1);
        }
        eprintln!("interrupted: writing {what} (again to abort)");
    })
    .map_err(|error| Failure { message: format!("Ctrl-C cannot be handled: {error}"), code: ExitCode::from(1) })?;
    Ok(stop)
}
