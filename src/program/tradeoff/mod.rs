//! `tradeoff`: speed against accuracy of one scene, as a table, plots and a page.

mod csv;
mod page;
mod picture;

use super::{
    Failure, INTERRUPTED, arguments, log, print,
    render::stop_on_interrupt,
    scene::{Subject, integrators, models, projections},
    tables::{aligned, row, significant},
};
use clap::{
    Args,
    builder::{PossibleValuesParser, TypedValueParser},
};
use indicatif::{ProgressBar, ProgressStyle};
use std::{
    fs,
    ops::ControlFlow,
    path::{Path, PathBuf},
    process::ExitCode,
    sync::atomic::{AtomicBool, Ordering},
};
use translucent::{
    Device, DeviceOptions, Model, Projection, Scene, Settings,
    image::write_whole,
    prepare,
    settings::Integrator,
    tradeoff::{self, AXES, Against, Axis, Choice, Grid, Measure, Outcome, Progress},
};

/// Height of the image where none is asked for.
const HEIGHT: u32 = 256;

#[derive(clap::Args)]
pub struct Tradeoff {
    #[command(flatten)]
    subject: Subject,
    /// Folder for tradeoff.csv, plots, report.html and the images; without it the scene's name with -tradeoff, in the
    /// current folder. What is there from an earlier run is not rendered again.
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Models to compare.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = models(),
          default_value = "standard,better,directional,burley,table")]
    models: Vec<Model>,
    /// Integrators to compare. A walk takes no model: what it differs from one counts as its sampling error.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = integrators(),
          default_value = "sample,cloud")]
    integrators: Vec<Integrator>,
    /// Projections to compare, of the integrator sample.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = projections(),
          default_value = "mis,camera,normal")]
    projections: Vec<Projection>,
    /// How surfaces are found, of the integrator sample.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = choices(&AXES[0]),
          default_value = AXES[0].choices[0].0)]
    reproject: Vec<Choice>,
    /// How light at the sampled points is found, of the integrator sample.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = choices(&AXES[1]),
          default_value = AXES[1].choices[0].0)]
    irradiance: Vec<Choice>,
    /// Widths of the tiles that share hits, of the integrator sample.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = choices(&AXES[2]),
          default_value = AXES[2].choices[0].0)]
    reuse: Vec<Choice>,
    /// How tabulated profiles are stored. The converged images have them in full.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = choices(&AXES[3]),
          default_value = AXES[3].choices[0].0)]
    precision: Vec<Choice>,
    /// Numbers of samples of each pixel.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "1,4,16,64",
          value_parser = clap::value_parser!(u32).range(1..=MOST))]
    samples: Vec<u32>,
    /// Numbers of incoming directions of the environment at each sampled position.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "1",
          value_parser = clap::value_parser!(u32).range(1..))]
    directions: Vec<u32>,
    /// Samples of each model's converged image; without it sixteen times the most of --samples, so that its error is
    /// about a fourth of that one's noise.
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u32).range(2..=MOST))]
    reference_samples: Option<u32>,
    /// The model whose converged image all are measured against, or none.
    #[arg(long, value_name = "MODEL|none", default_value = "table", value_parser = against())]
    against: Compared,
    /// Exposure at which FLIP looks at the images, and the report shows them, in stops.
    #[arg(long, value_name = "EV", default_value = "0", allow_negative_numbers = true,
          value_parser = arguments::finite)]
    exposure: f64,
    /// Key of all random numbers.
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u32,
    /// Vulkan device by index, part of the name, or UUID (see `devices`); without it the best.
    #[arg(long, value_name = "INDEX|NAME|UUID")]
    device: Option<String>,
    /// No progress, notes or warnings.
    #[arg(long)]
    quiet: bool,
}

/// Most samples: those of EXR's attributes, over the samples of a converged image.
const MOST: i64 = 1 << 26;

#[derive(Clone, Copy, Debug)]
struct Compared(Option<Model>);

fn against() -> impl TypedValueParser<Value = Compared> {
    PossibleValuesParser::new(Model::NAMES.iter().map(|(_, name)| *name).chain(["none"]))
        .map(|name| Compared(name.parse().ok()))
}

fn choices(axis: &'static Axis) -> impl TypedValueParser<Value = Choice> {
    PossibleValuesParser::new(axis.choices.iter().map(|(name, _)| *name))
        .map(|name| *axis.choices.iter().find(|(known, _)| *known == name).expect("the parser passes names alone"))
}

/// What the files say beside the numbers.
pub struct About<'a> {
    /// The scene's file.
    scene: String,
    /// The command that this was, but for what is varied.
    command: String,
    device: String,
    size: (u32, u32),
    exposure: f64,
    outcome: &'a Outcome,
}

impl Tradeoff {
    pub fn run(self) -> Result<ExitCode, Failure> {
        if self.quiet {
            log::quiet();
        }
        let folder = self.folder()?;
        let stop = stop_on_interrupt("what was measured so far")?;
        let (scene, warnings) = self.subject.load(None).map_err(Failure::while_reading)?;
        if !self.quiet {
            warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
        }
        let options = DeviceOptions { device: self.device.clone(), profiling: true, ..DeviceOptions::default() };
        let device = Device::open(&options)?;
        let settings = self.settings(&scene)?;
        let bar = self.bar();
        let mut kept = 0;
        let outcome = tradeoff::run(&device, &scene, &settings, &self.grid(), &folder, &mut |progress| {
            kept += usize::from(progress.kept);
            show(&bar, &progress, &stop)
        })?;
        bar.finish_and_clear();
        if outcome.rows.is_empty() {
            print(&format!("{}: nothing to show yet\n", folder.display()))?;
            return Ok(ExitCode::from(INTERRUPTED));
        }
        let about = About {
            scene: self.subject.file.display().to_string(),
            command: command(),
            device: format!("{}, {}", device.info().name, device.info().driver),
            size: settings.resolution.expect("it was set"),
            exposure: self.exposure,
            outcome: &outcome,
        };
        about.write(&folder)?;
        print(&about.text())?;
        let found = if kept > 0 { format!("; {kept} images were there from an earlier run") } else { String::new() };
        print(&format!("{}{found}\n", folder.join("report.html").display()))?;
        Ok(if outcome.finished { ExitCode::SUCCESS } else { ExitCode::from(INTERRUPTED) })
    }

    /// Where everything goes; that it can.
    fn folder(&self) -> Result<PathBuf, Failure> {
        let folder = match &self.output {
            Some(folder) => folder.clone(),
            None => {
                let file = &self.subject.file;
                let name = file.file_stem();
                let name = name.ok_or_else(|| Failure::input(format!("{}: not a file", file.display())))?;
                PathBuf::from(format!("{}-tradeoff", name.to_string_lossy()))
            }
        };
        let parent = folder.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if folder.exists() && !folder.is_dir() {
            return Err(Failure::input(format!("{}: exists and is not a folder", folder.display())));
        }
        if !parent.is_dir() {
            return Err(Failure::input(format!(
                "{}: the folder {} does not exist",
                folder.display(),
                parent.display()
            )));
        }
        Ok(folder)
    }

    fn settings(&self, scene: &Scene) -> Result<Settings, Failure> {
        let settings = Settings { seed: self.seed, ..self.subject.settings() };
        let (width, height) = prepare::resolution(scene, &settings)?;
        let resolution = settings.resolution.unwrap_or(((width * HEIGHT / height).max(1), HEIGHT));
        Ok(Settings { resolution: Some(resolution), ..settings })
    }

    fn grid(&self) -> Grid {
        let mut samples = self.samples.clone();
        samples.sort();
        samples.dedup();
        Grid {
            models: distinct(&self.models, |a, b| a == b),
            integrators: distinct(&self.integrators, |a, b| a == b),
            projections: distinct(&self.projections, |a, b| a == b),
            choices: [&self.reproject, &self.irradiance, &self.reuse, &self.precision]
                .map(|list| distinct(list, |a, b| a.0 == b.0)),
            directions: distinct(&self.directions, |a, b| a == b),
            samples,
            converged_samples: self.reference_samples,
            against: self.against.0,
            exposure: self.exposure,
        }
    }

    fn bar(&self) -> ProgressBar {
        if self.quiet {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::new(1);
        let style = ProgressStyle::with_template("{bar:30} {percent:>3} %  {eta} left  {msg}");
        style.map_or(bar.clone(), |style| bar.with_style(style))
    }
}

fn distinct<T: Copy>(list: &[T], same: impl Fn(&T, &T) -> bool) -> Vec<T> {
    let mut found: Vec<T> = Vec::new();
    for item in list {
        if !found.iter().any(|other| same(item, other)) {
            found.push(*item);
        }
    }
    found
}

fn show(bar: &ProgressBar, progress: &Progress, stop: &AtomicBool) -> ControlFlow<()> {
    bar.set_length(progress.total);
    bar.set_position(progress.done);
    if bar.message() != progress.name {
        bar.set_message(progress.name.to_string());
    }
    if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

/// The words that `render` is to have in common with this run: the scene and what is said of it.
fn command() -> String {
    let all = Tradeoff::augment_args(clap::Command::new("tradeoff"));
    let shared = Subject::augment_args(clap::Command::new("subject"));
    let mut words = Vec::new();
    let mut given = std::env::args().skip(2);
    while let Some(word) = given.next() {
        let (name, inline) = word.split_once('=').map_or((word.as_str(), false), |(name, _)| (name, true));
        let short = |arg: &&clap::Arg| arg.get_short().is_some_and(|short| word.starts_with(&format!("-{short}")));
        let option = match name.strip_prefix("--") {
            Some(long) => all.get_arguments().find(|arg| arg.get_long() == Some(long)),
            None => all.get_arguments().find(short),
        };
        let Some(option) = option else {
            words.push(shell(&word));
            continue;
        };
        let apart = option.get_action().takes_values() && !inline && (name.starts_with("--") || word.len() == 2);
        let value = apart.then(|| given.next()).flatten();
        let id = option.get_id();
        if id == "seed" || (id != "resolution" && shared.get_arguments().any(|arg| arg.get_id() == id)) {
            words.extend([Some(word), value].into_iter().flatten().map(|word| shell(&word)));
        }
    }
    words.join(" ")
}

/// A word as a shell takes it.
fn shell(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./,:=+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) { word.into() } else { format!("'{}'", word.replace('\'', r"'\''")) }
}

impl About<'_> {
    fn write(&self, folder: &Path) -> Result<(), Failure> {
        let failed = |what: &str, error: &dyn std::fmt::Display| Failure {
            message: format!("{what}: {error}"),
            code: ExitCode::from(1),
        };
        fs::create_dir_all(folder).map_err(|error| failed(&folder.display().to_string(), &error))?;
        write_whole(folder.join("tradeoff.csv"), csv::text(self.outcome).as_bytes())?;
        for (measure, name) in [(Measure::Relative, "relative"), (Measure::Flip, "flip")] {
            let [svg, png] = ["svg", "png"].map(|ending| folder.join(format!("tradeoff-{name}.{ending}")));
            let text = picture::svg(self, measure).map_err(|error| failed("plot", &error))?;
            write_whole(svg, text.as_bytes())?;
            let bytes = picture::png(self, measure).map_err(|error| failed("plot", &error))?;
            write_whole(png, &bytes)?;
        }
        write_whole(folder.join("report.html"), page::html(self)?.as_bytes())?;
        Ok(())
    }

    /// The command that renders a variant.
    fn command(&self, variant: &tradeoff::Variant) -> String {
        let (width, height) = self.size;
        format!("translucent render {} --resolution {width}x{height} {}", self.command, variant.options())
    }

    /// The front on the terminal.
    fn text(&self) -> String {
        let against = if self.outcome.yardstick().is_some() { Against::Total } else { Against::Sampling };
        let marked = self.outcome.front(Measure::Relative, against);
        let percent = |value: Option<f64>| value.map_or("-".into(), |value| significant(100.0 * value));
        let mut rows = vec![row(["ON THE FRONT", "TIME [s]", "SAMPLING [%]", "MODEL [%]", "TOTAL [%]", "FLIP, TOTAL"])];
        let mut front: Vec<_> =
            self.outcome.rows.iter().zip(marked).filter(|(_, on)| *on).map(|(row, _)| row).collect();
        let time = |row: &tradeoff::Row| row.point(Measure::Relative, against).map_or(0.0, |(time, _)| time);
        front.sort_by(|a, b| time(a).total_cmp(&time(b)));
        for one in front {
            let Ok(measured) = &one.outcome else { continue };
            let model = self.outcome.converged(one.variant.model).and_then(|converged| converged.error);
            rows.push(row([
                &one.variant.options(),
                &significant(measured.times.total()),
                &percent(Some(measured.sampling.relative)),
                &percent(model.map(|error| error.relative)),
                &percent(measured.total.map(|error| error.relative)),
                &measured.total.map_or("-".into(), |error| significant(error.flip)),
            ]));
        }
        let mut text = aligned(&rows);
        for converged in &self.outcome.converged {
            let own = significant(100.0 * converged.own.relative);
            text +=
                &format!("converged image of {}: {} samples, own error {own} %\n", converged.model, converged.samples);
        }
        let refused = self.outcome.rows.iter().filter(|row| row.outcome.is_err()).count();
        if refused > 0 {
            text += &format!("{refused} variants were refused; tradeoff.csv says why\n");
        }
        text
    }
}
