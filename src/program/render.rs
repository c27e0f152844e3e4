//! `render`: a glTF scene becomes an EXR image, and a PNG where one is asked for.

use super::{Failure, INTERRUPTED, arguments, arguments::EnvironmentSource, keep, print};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use glam::DVec3;
use indicatif::{ProgressBar, ProgressState, ProgressStyle};
use std::{
    fmt,
    ops::{ControlFlow, Range},
    path::PathBuf,
    process::ExitCode,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Instant,
};
use translucent::{
    CameraChoice, Device, DeviceOptions, Image, LoadOptions, Normalisation, Projection, Renderer, Scene, Settings,
    image::{Attribute, check_writable},
    scene::{Environment, EnvironmentMap},
    shared::BATCHES,
};

/// The layers that `--aov` knows; R, G, B and A are always there.
const LAYERS: [&str; 8] = ["subsurface", "reflection", "variance", "N", "P", "Z", "samples", "material"];

#[derive(clap::Args)]
pub struct Render {
    /// The scene, a glTF 2.0 file.
    #[arg(value_name = "SCENE.gltf|.glb")]
    scene: PathBuf,
    /// The EXR file to write; without it the scene's name with .exr, in the current folder.
    #[arg(short, long, value_name = "OUT.exr")]
    output: Option<PathBuf>,
    /// Size of the full image in pixels; without it 1024 high, as wide as the camera's aspect ratio asks.
    #[arg(long, value_name = "WxH", value_parser = arguments::resolution)]
    resolution: Option<(u32, u32)>,
    /// Camera by name or index; without it the first, or one that frames the scene.
    #[arg(long, value_name = "NAME|INDEX", value_parser = arguments::camera)]
    camera: Option<CameraChoice>,
    /// Samples of each pixel; A:B renders samples A to B-1, a part that `merge` puts together with others.
    #[arg(long, value_name = "M|A:B", default_value = "64", value_parser = arguments::samples)]
    samples: Range<u32>,
    /// Incoming directions of the environment at each sampled position.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    directions: u32,
    /// How a sampled point is carried to the surface: all techniques combined, the camera ray alone (biased), the
    /// normal axis alone.
    #[arg(long, default_value = "mis", value_parser = projections())]
    projection: Projection,
    /// Whether all light that enters and is not absorbed leaves again, or the darker constant of Jensen et al. 2001.
    #[arg(long, default_value = "energy", value_parser = normalisations())]
    normalisation: Normalisation,
    /// Profile of every material; auto is what the material says, which is the standard dipole.
    #[arg(long, default_value = "auto", value_parser = ["auto", "standard"])]
    model: String,
    /// How surfaces are found: rays traced through the scene.
    #[arg(long, default_value = "trace", value_parser = ["trace"])]
    reproject: String,
    /// Light from infinitely far away: a latitude-longitude image or one radiance.
    #[arg(long, value_name = "FILE.hdr|.exr|constant:R,G,B", value_parser = arguments::environment)]
    environment: Option<EnvironmentSource>,
    /// Turns the environment about the up axis, counter-clockwise seen from above, in degrees.
    #[arg(long, value_name = "DEG", requires = "environment", allow_negative_numbers = true,
          value_parser = arguments::finite)]
    environment_rotation: Option<f64>,
    /// Factor on the environment's radiance.
    #[arg(long, value_name = "S", requires = "environment", allow_negative_numbers = true, value_parser = arguments::not_negative)]
    environment_scale: Option<f64>,
    /// Show the environment where no surface is.
    #[arg(long)]
    show_environment: bool,
    /// Gives a material of the file the properties of a preset (see `presets`); may be repeated.
    #[arg(long, value_name = "NAME=PRESET", value_parser = arguments::material)]
    material: Vec<(String, String)>,
    /// What one unit of the file's geometry is: m, cm, mm, 29.2mm.
    #[arg(long, value_name = "LENGTH", default_value = "m", value_parser = arguments::unit)]
    unit: f64,
    /// Render these pixels only; X1 and Y1 are exclusive.
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = arguments::crop)]
    crop: Option<[u32; 4]>,
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
    /// No progress and no warnings.
    #[arg(long)]
    quiet: bool,
}

fn projections() -> impl TypedValueParser<Value = Projection> {
    PossibleValuesParser::new(["mis", "camera", "normal"]).map(|name| match name.as_str() {
        "camera" => Projection::Camera,
        "normal" => Projection::Normal,
        _ => Projection::Mis,
    })
}

fn normalisations() -> impl TypedValueParser<Value = Normalisation> {
    PossibleValuesParser::new(["energy", "jensen2001"]).map(|name| match name.as_str() {
        "jensen2001" => Normalisation::Jensen2001,
        _ => Normalisation::Energy,
    })
}

impl Render {
    pub fn run(self) -> Result<ExitCode, Failure> {
        let output = self.output()?;
        let stop = stop_on_interrupt()?;
        let scene = self.load().map_err(Failure::while_reading)?;
        let options = DeviceOptions { device: self.device.clone(), ..DeviceOptions::default() };
        let device = Device::open(&options)?;
        let mut renderer = Renderer::new(&device, &scene, &self.settings())?;

        let bar = self.bar();
        let start = Instant::now();
        let finished = renderer.render_range(self.samples.clone(), &mut |progress| {
            if bar.length() != Some(progress.total) {
                bar.set_length(progress.total);
            }
            bar.set_position(progress.done);
            if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })?;
        bar.finish_and_clear();
        let seconds = start.elapsed().as_secs_f64();
        let samples = renderer.samples().len();
        let mut image = renderer.finish()?;
        self.keep_asked(&mut image);
        if let Some(Attribute::Integer(invalid @ 1..)) = image.attributes.get("translucent.invalidSamples") {
            self.warn(&format!("samples left out because they were not finite or negative: {invalid}"));
        }
        image.write(&output)?;
        if let Some(png) = &self.png {
            image.write_png(png, self.exposure.unwrap_or(0.0))?;
        }
        let (width, height) = (image.width, image.height);
        let rate = f64::from(width) * f64::from(height) * samples as f64 / seconds * 1e-6;
        let note = if finished { "" } else { ", interrupted" };
        print(&format!(
            "{}: {width}x{height}, {samples} samples, {seconds:.2} s, {rate:.3} Msamples/s{note}\n",
            output.display()
        ))?;
        Ok(if finished { ExitCode::SUCCESS } else { ExitCode::from(INTERRUPTED) })
    }

    /// Where the image goes; that it can, and that no file of the user's is in danger.
    fn output(&self) -> Result<PathBuf, Failure> {
        let output = match &self.output {
            Some(output) => output.clone(),
            None => {
                let name = self.scene.file_stem();
                let name = name.ok_or_else(|| Failure::input(format!("{}: not a file", self.scene.display())))?;
                PathBuf::from(format!("{}.exr", name.to_string_lossy()))
            }
        };
        for (path, extension) in std::iter::once((&output, "exr")).chain(self.png.as_ref().map(|png| (png, "png"))) {
            if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension)) {
                return Err(Failure::input(format!("{}: its name must end in .{extension}", path.display())));
            }
            check_writable(path)?;
            keep(&self.scene, path)?;
            if let Some(EnvironmentSource::File(environment)) = &self.environment {
                keep(environment, path)?;
            }
        }
        Ok(output)
    }

    fn load(&self) -> translucent::Result<Scene> {
        let options = LoadOptions { unit: self.unit, materials: self.material.clone() };
        let mut scene = Scene::load_with(&self.scene, &options)?;
        let mut environment = match &self.environment {
            Some(EnvironmentSource::Constant(radiance)) => Some(Environment::constant(DVec3::from_array(*radiance))?),
            Some(EnvironmentSource::File(file)) => Some(Environment::load(file)?),
            None => None,
        };
        if !scene.sets.iter().any(|set| scene.materials[set.material].medium.is_some()) {
            let names: Vec<&str> = scene.materials.iter().map(|material| material.name.as_str()).collect();
            let names = names.join(", ");
            self.warn(&format!(
                "no surface is translucent: give a material a preset with --material; there are: {names}"
            ));
        }
        if environment.is_none() && scene.lights.is_empty() && scene.environment.map == EnvironmentMap::None {
            self.warn("no light in the scene and no --environment: a constant environment of radiance 1 is used");
            environment = Some(Environment::constant(DVec3::ONE)?);
        }
        if let Some(mut environment) = environment {
            environment.rotation = self.environment_rotation.unwrap_or(0.0);
            environment.scale = self.environment_scale.unwrap_or(1.0);
            scene.set_environment(environment)?;
        }
        // Only now: some are about the environment.
        for warning in &scene.warnings {
            self.warn(warning);
        }
        Ok(scene)
    }

    fn warn(&self, text: &str) {
        if !self.quiet {
            eprintln!("warning: {text}");
        }
    }

    fn settings(&self) -> Settings {
        Settings {
            resolution: self.resolution,
            camera: self.camera.clone().unwrap_or_default(),
            crop: self.crop,
            directions: self.directions,
            projection: self.projection,
            normalisation: self.normalisation,
            seed: self.seed,
            show_environment: self.show_environment,
            variance: self.wants("variance") && self.samples.len() >= BATCHES as usize,
            ..Settings::default()
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
        let samples = self.samples.len();
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
            std::process::exit(1);
        }
        eprintln!("interrupted: writing what there is (again to abort)");
    })
    .map_err(|error| Failure { message: format!("Ctrl-C cannot be handled: {error}"), code: ExitCode::from(1) })?;
    Ok(stop)
}
