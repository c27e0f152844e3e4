//! What is rendered, how it is seen, and by which method: the options that commands share.

use super::{Failure, arguments, arguments::EnvironmentSource, keep};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use glam::DVec3;
use std::path::{Path, PathBuf};
use translucent::{
    CameraChoice, LoadOptions, Model, Normalisation, Projection, Scene, Settings, SingleScattering,
    scene::{AlbedoMapping, Environment, EnvironmentMap},
    settings::{Cache, Cloud, Directional, Integrator, Irradiance, Precision, Reproject},
    timeline::Timeline,
};

#[derive(clap::Args)]
pub struct SceneOptions {
    #[command(flatten)]
    pub subject: Subject,
    #[command(flatten)]
    pub method: Method,
}

/// What computes the light.
#[derive(clap::Args)]
pub struct Method {
    /// Incoming directions of the environment at each sampled position.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    directions: u32,
    /// What computes the light that comes out of matter: probes of each pixel (sample), or points on the surface that are lit
    /// once and gathered from (cloud), which leaves no noise. Slow references on the host: points uniform over the surface
    /// (area), and random walks through the matter, without a model (walk).
    #[arg(long, default_value = "sample", value_parser = integrators())]
    pub integrator: Integrator,
    /// How a sampled point is carried to the surface: all techniques combined, the camera ray alone (biased), the
    /// normal axis alone.
    #[arg(long, default_value = "mis", value_parser = projections())]
    projection: Projection,
    /// How surfaces are found: trace rays through the scene / look the point up in the G-buffer (screen: fast, sees only what
    /// the camera sees).
    #[arg(long, default_value = "trace", value_parser = named(&Reproject::NAMES))]
    reproject: Reproject,
    /// Light at the sampled point: traced for each sample, or looked up between points of the surface that are lit once
    /// (cached).
    #[arg(long, default_value = "direct", value_parser = named(&Irradiance::NAMES))]
    irradiance: Irradiance,
    /// Width in pixels of the tiles that share the hits they light, which divides noise among them; 1 shares none. Auto
    /// is 8, with --reproject screen 4.
    #[arg(long, value_name = "auto|1|2|4|8", default_value = "auto", value_parser = reuses())]
    reuse: Reuse,
    /// Tabulated profiles as they are stored: two values in one f32 (packed), or each in its own (full).
    #[arg(long, default_value = "packed", value_parser = named(&Precision::NAMES))]
    precision: Precision,
    /// How light spreads in every translucent material; auto is what the material says, else what `inspect`
    /// recommends; lambert is the opaque limit, where light leaves where it entered.
    #[arg(long, default_value = "auto", value_parser = models())]
    model: Model,
}

/// Everything but the method, which `tradeoff` varies.
#[derive(clap::Args)]
pub struct Subject {
    /// The scene, a glTF 2.0 file.
    #[arg(value_name = "SCENE.gltf|.glb")]
    pub file: PathBuf,
    /// Size of the full image in pixels; without it 1024 (`tradeoff`: 256) high, as wide as the camera's aspect ratio asks.
    #[arg(long, value_name = "WxH", value_parser = arguments::resolution)]
    resolution: Option<(u32, u32)>,
    /// Camera by name or index; without it the first, or one that frames the scene.
    #[arg(long, value_name = "NAME|INDEX", value_parser = arguments::camera)]
    camera: Option<CameraChoice>,
    /// Most points of the cloud.
    #[arg(long, value_name = "N", default_value_t = Cloud::default().points,
          value_parser = clap::value_parser!(u32).range(1..=Cloud::POINTS_MAX as i64))]
    cloud_points: u32,
    /// Size over distance below which points of the cloud count together, 0 to 1; 0 counts each.
    #[arg(long, value_name = "X", default_value_t = Cloud::default().opening, value_parser = arguments::not_negative)]
    cloud_opening: f64,
    /// Distance between points of the cloud that is fine enough, in mean free paths.
    #[arg(long, value_name = "X", default_value_t = Cloud::default().spacing, value_parser = arguments::not_negative)]
    cloud_spacing: f64,
    /// Samples that light each point of the cloud.
    #[arg(long, value_name = "M", default_value_t = Cloud::default().samples, value_parser = clap::value_parser!(u32).range(1..))]
    cloud_samples: u32,
    /// Most points that keep light (--irradiance cached), besides those at vertices.
    #[arg(long, value_name = "N", default_value_t = Cache::default().points,
          value_parser = clap::value_parser!(u32).range(0..=Cache::POINTS_MAX as i64))]
    cache_points: u32,
    /// Samples that light each of them.
    #[arg(long, value_name = "M", default_value_t = Cache::default().samples, value_parser = clap::value_parser!(u32).range(2..))]
    cache_samples: u32,
    /// Distance between them that is fine enough, in mean free paths.
    #[arg(long, value_name = "X", default_value_t = Cache::default().spacing, value_parser = arguments::not_negative)]
    cache_spacing: f64,
    /// Share of the light by which neighbouring points may differ before there are more between them.
    #[arg(long, value_name = "X", default_value_t = Cache::default().tolerance, value_parser = arguments::not_negative)]
    cache_tolerance: f64,
    /// Whether all light that enters and is not absorbed leaves again, or the darker constant of Jensen et al. 2001.
    #[arg(long, default_value = "energy", value_parser = normalisations())]
    normalisation: Normalisation,
    /// Scale the directional dipole so that it gives back no more light than the standard one. Each of this, --reciprocal
    /// and --kappa takes the place of all that the file says about it.
    #[arg(long)]
    renormalise: bool,
    /// Average the directional dipole with itself, light and eye exchanged.
    #[arg(long)]
    reciprocal: bool,
    /// Regularisation of the directional dipole near its source; 0 is the published model, with its fireflies.
    /// Without it 1.
    #[arg(long, value_name = "K", allow_negative_numbers = true, value_parser = arguments::not_negative)]
    kappa: Option<f64>,
    /// Whether the table model follows how thick the body is at each point, or takes every body for a half-space.
    #[arg(long, value_name = "on|off", default_value = "on", action = clap::ArgAction::Set, value_parser = on_off())]
    curvature: bool,
    /// Light that was scattered once, added to the standard or the better dipole: on, off, or auto, which is what the
    /// material says, else to a better dipole of matter with an albedo below .95.
    #[arg(long, value_name = "auto|on|off", default_value = "auto", value_parser = single_scattering())]
    single_scattering: SingleScattering,
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
    /// What the multi-scatter colour of glTF's scattering extensions is: the albedo of matter without a boundary that
    /// reflects, as the drafts have it, or the colour that is seen.
    #[arg(long, default_value = "gltf", value_parser = albedo_mappings())]
    albedo_mapping: AlbedoMapping,
    /// What one unit of the file's geometry is: m, cm, mm, 29.2mm.
    #[arg(long, value_name = "LENGTH", default_value = "m", value_parser = arguments::unit)]
    unit: f64,
    /// Render these pixels only; X1 and Y1 are exclusive.
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = arguments::crop)]
    crop: Option<[u32; 4]>,
}

/// One of the values by its name.
fn named<T: Copy + Send + Sync + 'static>(all: &'static [(T, &'static str)]) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(all.iter().map(|(_, name)| *name))
        .map(|text| all.iter().find(|(_, name)| *name == text).expect("the parser passes names alone").0)
}

pub fn integrators() -> impl TypedValueParser<Value = Integrator> {
    named(&Integrator::NAMES)
}

pub fn projections() -> impl TypedValueParser<Value = Projection> {
    PossibleValuesParser::new(["mis", "camera", "normal"]).map(|name| match name.as_str() {
        "camera" => Projection::Camera,
        "normal" => Projection::Normal,
        _ => Projection::Mis,
    })
}

/// None for auto.
#[derive(Clone, Copy, Debug)]
struct Reuse(Option<u32>);

fn reuses() -> impl TypedValueParser<Value = Reuse> {
    PossibleValuesParser::new(["auto", "1", "2", "4", "8"]).map(|width| Reuse(width.parse().ok()))
}

fn normalisations() -> impl TypedValueParser<Value = Normalisation> {
    PossibleValuesParser::new(["energy", "jensen2001"]).map(|name| match name.as_str() {
        "jensen2001" => Normalisation::Jensen2001,
        _ => Normalisation::Energy,
    })
}

pub fn models() -> impl TypedValueParser<Value = Model> {
    PossibleValuesParser::new(Model::NAMES.map(|(_, name)| name))
        .map(|name| name.parse().expect("the parser passes names alone"))
}

fn on_off() -> impl TypedValueParser<Value = bool> {
    PossibleValuesParser::new(["on", "off"]).map(|name| name == "on")
}

fn albedo_mappings() -> impl TypedValueParser<Value = AlbedoMapping> {
    PossibleValuesParser::new(["gltf", "surface"]).map(|name| match name.as_str() {
        "surface" => AlbedoMapping::Surface,
        _ => AlbedoMapping::Gltf,
    })
}

fn single_scattering() -> impl TypedValueParser<Value = SingleScattering> {
    PossibleValuesParser::new(SingleScattering::NAMES.map(|(_, name)| name))
        .map(|name| name.parse().expect("the parser passes names alone"))
}

impl SceneOptions {
    /// As [`Subject::load`].
    pub fn load(&self, timeline: Option<Timeline>) -> translucent::Result<(Scene, Vec<String>)> {
        self.subject.load(timeline)
    }

    /// The settings that follow from these options; the rest are the defaults.
    pub fn settings(&self) -> Settings {
        self.method.settings(self.subject.settings())
    }

    /// As [`Subject::keep_from`].
    pub fn keep_from(&self, output: &Path) -> Result<(), Failure> {
        self.subject.keep_from(output)
    }
}

impl Method {
    /// `settings` with these options.
    pub fn settings(&self, settings: Settings) -> Settings {
        let Method { directions, integrator, projection, reproject, irradiance, reuse, precision, model } = *self;
        let Reuse(reuse) = reuse;
        Settings { directions, integrator, projection, reproject, irradiance, reuse, precision, model, ..settings }
    }
}

impl Subject {
    /// The scene with its environment, and what a user should know about it.
    pub fn load(&self, timeline: Option<Timeline>) -> translucent::Result<(Scene, Vec<String>)> {
        let options = LoadOptions {
            unit: self.unit,
            materials: self.material.clone(),
            albedo_mapping: self.albedo_mapping,
            timeline,
        };
        let mut scene = Scene::load_with(&self.file, &options)?;
        let mut environment = match &self.environment {
            Some(EnvironmentSource::Constant(radiance)) => Some(Environment::constant(DVec3::from_array(*radiance))?),
            Some(EnvironmentSource::File(file)) => Some(Environment::load(file)?),
            None => None,
        };
        let mut warnings = Vec::new();
        if !scene.sets.iter().any(|set| scene.materials[set.materials[0]].medium.is_some()) {
            let names: Vec<&str> = scene.materials.iter().map(|material| material.name.as_str()).collect();
            let names = names.join(", ");
            warnings.push(format!(
                "no surface is translucent: give a material a preset with --material; there are: {names}"
            ));
        }
        let emits = scene.materials.iter().any(|material| material.emission != DVec3::ZERO);
        let dark = scene.lights.is_empty() && !emits && scene.environment.map == EnvironmentMap::None;
        if environment.is_none() && dark {
            warnings.push(
                "no light in the scene and no --environment: a constant environment of radiance 1 is used".into(),
            );
            environment = Some(Environment::constant(DVec3::ONE)?);
        }
        if let Some(mut environment) = environment {
            environment.rotation = self.environment_rotation.unwrap_or(0.0);
            environment.scale = self.environment_scale.unwrap_or(1.0);
            scene.set_environment(environment)?;
        }
        // Only now: some are about the environment.
        warnings.extend(scene.warnings.iter().cloned());
        Ok((scene, warnings))
    }

    /// The settings that follow from these options; the rest are the defaults.
    pub fn settings(&self) -> Settings {
        Settings {
            resolution: self.resolution,
            camera: self.camera.clone().unwrap_or_default(),
            crop: self.crop,
            cloud: Cloud {
                points: self.cloud_points,
                opening: self.cloud_opening,
                spacing: self.cloud_spacing,
                samples: self.cloud_samples,
            },
            cache: Cache {
                points: self.cache_points,
                samples: self.cache_samples,
                spacing: self.cache_spacing,
                tolerance: self.cache_tolerance,
            },
            normalisation: self.normalisation,
            directional: self.directional(),
            curvature: self.curvature,
            single_scattering: self.single_scattering,
            show_environment: self.show_environment,
            ..Settings::default()
        }
    }

    /// What the options say of the directional dipole, if any does.
    fn directional(&self) -> Option<Directional> {
        let Subject { renormalise, reciprocal, kappa, .. } = *self;
        let default = Directional::default();
        let asked = renormalise || reciprocal || kappa.is_some();
        asked.then(|| Directional { renormalise, reciprocal, kappa: kappa.unwrap_or(default.kappa) })
    }

    /// Refuses to write over a file that is read.
    pub fn keep_from(&self, output: &Path) -> Result<(), Failure> {
        keep(&self.file, output)?;
        match &self.environment {
            Some(EnvironmentSource::File(environment)) => keep(environment, output),
            _ => Ok(()),
        }
    }
}
