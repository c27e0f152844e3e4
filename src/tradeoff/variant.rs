//! The ways in which a scene is rendered.

use crate::settings::{Integrator, Irradiance, Model, Projection, Reproject, Settings};

/// A value of an axis by its name on the command line, and what it changes in the settings.
pub type Choice = (&'static str, fn(&mut Settings));

/// How surfaces are found, the default first.
pub const REPROJECT: &[Choice] = &[
    ("trace", |settings| settings.reproject = Reproject::Trace),
    ("screen", |settings| settings.reproject = Reproject::Screen),
];

/// How light at the sampled point is found, the default first.
pub const IRRADIANCE: &[Choice] = &[
    ("direct", |settings| settings.irradiance = Irradiance::Direct),
    ("cached", |settings| settings.irradiance = Irradiance::Cached),
];

/// What is varied; every combination is a [`Variant`].
#[derive(Clone, Debug)]
pub struct Grid {
    pub models: Vec<Model>,
    pub integrators: Vec<Integrator>,
    pub projections: Vec<Projection>,
    pub reproject: Vec<Choice>,
    pub irradiance: Vec<Choice>,
    pub directions: Vec<u32>,
    pub samples: Vec<u32>,
    /// Samples of a converged image, in two halves; none for sixteen times the most samples of a variant, so that its
    /// error is a fourth of that one's noise.
    pub converged_samples: Option<u32>,
    /// The model whose converged image all are measured against.
    pub against: Option<Model>,
    /// Exposure at which FLIP looks at images, in stops.
    pub exposure: f64,
}

impl Grid {
    /// Samples of each half of a converged image.
    pub(super) fn half(&self) -> u32 {
        let most = self.samples.iter().max().copied().unwrap_or(1);
        self.converged_samples.unwrap_or(most.saturating_mul(16)).div_ceil(2)
    }

    /// Directions of a converged image.
    pub(super) fn most_directions(&self) -> u32 {
        self.directions.iter().max().copied().unwrap_or(1)
    }

    /// The variants of `model`, those that differ in samples alone together. Only `sample` draws probes, so that other
    /// integrators are rendered with the default of what changes probes.
    pub fn groups(&self, model: Model) -> Vec<Vec<Variant>> {
        let mut groups = Vec::new();
        for &integrator in &self.integrators {
            let probes = integrator == Integrator::Sample;
            let projections = if probes { &self.projections[..] } else { &[Projection::Mis] };
            let reprojects = if probes { &self.reproject[..] } else { &REPROJECT[..1] };
            let irradiances = if probes { &self.irradiance[..] } else { &IRRADIANCE[..1] };
            for &projection in projections {
                for &reproject in reprojects {
                    for &irradiance in irradiances {
                        groups.extend(self.directions.iter().map(|&directions| {
                            let variant = |&samples| Variant {
                                model,
                                integrator,
                                projection,
                                reproject,
                                irradiance,
                                directions,
                                samples,
                            };
                            self.samples.iter().map(variant).collect()
                        }));
                    }
                }
            }
        }
        groups
    }
}

/// One way to render.
#[derive(Clone, Copy, Debug)]
pub struct Variant {
    pub model: Model,
    pub integrator: Integrator,
    pub projection: Projection,
    pub reproject: Choice,
    pub irradiance: Choice,
    pub directions: u32,
    pub samples: u32,
}

impl PartialEq for Variant {
    fn eq(&self, other: &Variant) -> bool {
        self.name() == other.name()
    }
}

impl Variant {
    /// Every choice by name: `standard-sample-mis-trace-direct-1x64`.
    pub fn name(&self) -> String {
        let Variant { model, reproject: (reproject, _), irradiance: (irradiance, _), directions, samples, .. } = self;
        let (integrator, projection) = (self.integrator, self.projection());
        format!("{model}-{integrator}-{projection}-{reproject}-{irradiance}-{directions}x{samples}")
    }

    /// The projection's name.
    pub fn projection(&self) -> String {
        format!("{:?}", self.projection).to_lowercase()
    }

    /// The options of `render` that give it; defaults are left out where there is no choice.
    pub fn options(&self) -> String {
        let Variant { model, integrator, directions, samples, .. } = self;
        let mut text = format!("--model {model} --integrator {integrator}");
        if *integrator == Integrator::Sample {
            text += &format!(" --projection {}", self.projection());
        }
        for ((name, _), option, default) in
            [(self.reproject, "reproject", REPROJECT[0].0), (self.irradiance, "irradiance", IRRADIANCE[0].0)]
        {
            if name != default {
                text += &format!(" --{option} {name}");
            }
        }
        text + &format!(" --directions {directions} --samples {samples}")
    }

    /// `settings` with its choices.
    pub fn settings(&self, settings: &Settings) -> Settings {
        let Variant { model, integrator, projection, directions, .. } = *self;
        let mut settings = Settings { model, integrator, projection, directions, ..settings.clone() };
        (self.reproject.1)(&mut settings);
        (self.irradiance.1)(&mut settings);
        settings
    }
}
