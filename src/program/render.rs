//! `render`: a glTF scene becomes an EXR image, and a PNG where one is asked for.

use super::{Failure, INTERRUPTED, arguments, log, print, profile, scene::SceneOptions};
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
    Device, DeviceOptions, Error, Image, Renderer, Settings,
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
    /// others.
    #[arg(long, value_name = "M|A:B", value_parser = arguments::samples)]
    samples: Option<Range<u32>>,
    /// How surfaces are found: rays traced through the scene.
    #[arg(long, default_value = "trace", value_parser = ["trace"])]
    reproject: String,
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
    /// Key of all random numbers.
    #[arg(long, value_name = "S", default_value_t = 0, allow_negative_numbers = true)]
    seed: u32,
    /// Vulkan device by index, part of the name, or UUID (see `devices`); without it the best.
    #[arg(long, value_name = "INDEX|NAME|UUID")]
    device: Option<String>,
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
        let output = self.output()?;
        let stop = stop_on_interrupt()?;
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
        let (_, (finished, seconds, samples, mut image)) = renderer.with_recovery(&scene, reopen, |renderer| {
            let finished = renderer.render_rest(self.samples(), &mut |progress| {
                if bar.length() != Some(progress.total) {
                    bar.set_length(progress.total);
                }
                bar.set_position(progress.done);
                if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            })?;
            bar.finish_and_clear();
            let (seconds, samples) = (start.elapsed().as_secs_f64(), renderer.samples().len());
            Ok((finished, seconds, samples, renderer.take_image()?))
        })?;
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
        let rate = f64::from(width) * f64::from(height) * samples as f64 / seconds * 1e-6;
        let note = if finished { "" } else { ", interrupted" };
        print(&format!(
            "{}: {width}x{height}, {samples} samples, {seconds:.2} s, {rate:.3} Msamples/s{note}\n",
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
                let file = &self.scene.file;
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

    fn settings(&self) -> Settings {
        Settings {
            seed: self.seed,
            variance: self.wants("variance") && self.samples().len() >= BATCHES as usize,
            ..self.scene.settings()
        }
    }

    fn samples(&self) -> Range<u32> {
        self.samples.clone().unwrap_or(match self.scene.integrator {
            Integrator::Sample => 0..64,
            Integrator::Cloud => 0..4,
        })
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
        // Computed from the position, so that a line never shows two moments.
        let status = move |state: &ProgressState, out: &mut dyn fmt::Write| {
            let done = state.pos() as f64;
            let each = done / state.len().unwrap_or(1).max(1) as f64 * samples as f64;
            let rate = done / state.elapsed().as_secs_f64().max(1e-9) * 1e-6;
            // A line that cannot be drawn is no reason to stop.
            let _ = write!(out, "{each:.0}/{samples} samples  {rate:.3} Msamples/s");
        };
        // Draws to stderr, and nothing where that is no terminal. Without a length it would be drawn full.
        let bar = ProgressBar::new(1);
        let style = ProgressStyle::with_template("{bar:30} {percent:>3} %  {status}  {eta} left");
        style.map_or(bar.clone(), |style| bar.with_style(style.with_key("status", status)))
    }
}

/// A flag that the first Ctrl-C sets; the second ends the program at once.
fn stop_on_interrupt() -> Result<Arc<AtomicBool>, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            leave(1);
        }
        eprintln!("interrupted: writing what there is (again to abort)");
    })
    .map_err(|error| Failure { message: format!("Ctrl-C cannot be handled: {error}"), code: ExitCode::from(1) })?;
    Ok(stop)
}
