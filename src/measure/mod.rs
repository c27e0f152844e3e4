//! Numeric experiments: what the kernels give on scenes with a known answer, beside that answer.
//!
//! Each experiment builds its scene in memory, lets a [`Renderer`] or a kernel work on it as on any other, and returns a
//! [`Figure`]: measured points with standard errors, closed forms as curves. Lengths are in mm.
//!
//! | experiment | measured | closed form |
//! | --- | --- | --- |
//! | [`profile()`] | radii that the sampling kernel draws | R(r) and its distribution function |
//! | [`searchlight()`] | light of a ring on a plane, seen at its centre | R(r) averaged over the ring |
//! | [`furnace()`] | F(wo) + Lo / Li under uniform light, by angle | F(wo) + Ft(wo) R, which is 1 without absorption |
//! | [`sphere()`] | Lo / (Ft Li) of a sphere under uniform light | distribution function at the diameter |
//! | [`edge()`] | the same near the 90-degree edge of a large block | see [`edge::closed_form`] |
//! | [`mtf()`] | harmonics of light behind a grating | the profile's Hankel transform |

pub mod edge;
mod figure;
mod furnace;
mod matter;
mod mtf;
mod profile;
pub mod scenes;
mod searchlight;
mod sphere;

pub use edge::edge;
pub use figure::{Axis, Figure, Panel, Point, Scale, Series};
pub use furnace::furnace;
pub use matter::Matter;
pub use mtf::mtf;
pub use profile::profile;
pub use searchlight::searchlight;
pub use sphere::sphere;

use crate::{
    error::Result,
    gpu::Device,
    image::Image,
    render::Renderer,
    scene::{Environment, LoadOptions, Scene},
    settings::{Model, Settings, SingleScattering},
};
use glam::DVec3;
use serde_json::Value;

/// Metres of a millimetre.
const MM: f64 = 1e-3;

/// What every experiment needs.
#[derive(Clone, Debug)]
pub struct Setup<'a> {
    pub device: &'a Device,
    /// The same matter under one model or several. Of several, one channel is shown.
    pub matters: &'a [Matter],
    /// Factor on the number of samples; standard errors fall with its square root.
    pub effort: f64,
    pub seed: u32,
}

impl Setup<'_> {
    /// `samples` times the effort, at least 8, so that there is a variance.
    fn samples(&self, samples: u32) -> u32 {
        (f64::from(samples) * self.effort).clamp(8.0, 1e6) as u32
    }

    /// The channels that are shown, and the name of their series.
    fn channels(&self, matter: &Matter) -> Vec<(usize, String)> {
        if self.matters.len() > 1 {
            return vec![(1, matter.model.to_string())];
        }
        let channels = matter.channels();
        let name = |c: usize| if channels.len() == 1 { matter.model.to_string() } else { CHANNELS[c].into() };
        channels.iter().map(|c| (*c, name(*c))).collect()
    }

    /// Distinguishes series of several models.
    fn prefix(&self, matter: &Matter) -> String {
        if self.matters.len() > 1 { format!("{}, ", matter.model) } else { String::new() }
    }

    /// What stands above a figure.
    fn title(&self, experiment: &str) -> String {
        let matter = &self.matters[0];
        let models: Vec<String> = self.matters.iter().map(|matter| matter.model.to_string()).collect();
        let channel = if self.matters.len() > 1 { ", green" } else { "" };
        format!("{experiment}: {}{channel}, n = {}, {}", matter.name, matter.ior, models.join(", "))
    }

    /// Renders a scene whose geometry is in mm.
    fn render(&self, matter: &Matter, scene: &Scene, settings: Settings, samples: u32) -> Result<Image> {
        // Closed forms are of the profile alone.
        let single_scattering = SingleScattering::Off;
        let settings = Settings { seed: self.seed, model: matter.model, single_scattering, ..settings };
        let mut renderer = Renderer::new(self.device, scene, &settings)?;
        renderer.render(samples)?;
        renderer.finish()
    }
}

/// A scene in memory whose geometry is in mm.
fn scene(file: &Value) -> Result<Scene> {
    let options = LoadOptions { unit: MM, ..LoadOptions::default() };
    Scene::from_bytes("measure.gltf", file.to_string().as_bytes(), &options)
}

/// The same under radiance 1 from everywhere.
fn scene_in_uniform_light(file: &Value) -> Result<Scene> {
    let mut scene = scene(file)?;
    scene.set_environment(Environment::constant(DVec3::ONE)?)?;
    Ok(scene)
}

impl Series {
    /// The series of an experiment whose closed form holds for profiles that depend on the distance alone, not on the
    /// directions of light and eye.
    fn up_to_where_known(mut self, matter: &Matter) -> Series {
        if matches!(matter.model, Model::Directional | Model::Table) {
            self.curve.clear();
            self.points.iter_mut().for_each(|point| point.expected = f64::NAN);
        }
        self
    }
}

/// A channel of an image, as f64.
fn channel(image: &Image, name: &str) -> Vec<f64> {
    let data = image.channel(name).expect("every image with eight samples has this channel");
    data.iter().map(|value| f64::from(*value)).collect()
}

/// Mean of values and its standard error, from their spread.
fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// Names of the colour channels.
pub const CHANNELS: [&str; 3] = ["R", "G", "B"];
