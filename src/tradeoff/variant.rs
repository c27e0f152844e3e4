//! The ways in which a scene is rendered.

use crate::settings::{Integrator, Irradiance, Model, Precision, Projection, Reproject, Settings};

/// A value of an axis by its name on the command line, and what it changes in the settings.
pub type Choice = (&'static str, fn(&mut Settings));

/// What is varied beside model, integrator, projection, directions and samples.
#[derive(Debug)]
pub struct Axis {
    /// Of the option.
    pub name: &'static str,
    /// The default first.
    pub choices: &'static [Choice],
    /// Whether it changes what the integrator makes of the model; where not, it is left at the default.
    matters: fn(Model, Integrator) -> bool,
}

/// Number of [`AXES`].
pub const AXIS_COUNT: usize = 4;

/// In the order in which they are named.
pub const AXES: [Axis; AXIS_COUNT] = [
    Axis {
        name: "reproject",
        choices: &[
            ("trace", |settings| settings.reproject = Reproject::Trace),
            ("screen", |settings| settings.reproject = Reproject::Screen),
        ],
        matters: probes,
    },
    Axis {
        name: "irradiance",
        choices: &[
            ("direct", |settings| settings.irradiance = Irradiance::Direct),
            ("cached", |settings| settings.irradiance = Irradiance::Cached),
        ],
        matters: probes,
    },
    Axis {
        name: "reuse",
        choices: &[
            ("auto", |settings| settings.reuse = None),
            ("1", |settings| settings.reuse = Some(1)),
            ("2", |settings| settings.reuse = Some(2)),
            ("4", |settings| settings.reuse = Some(4)),
            ("8", |settings| settings.reuse = Some(8)),
        ],
        matters: probes,
    },
    Axis {
        name: "precision",
        choices: &[
            ("packed", |settings| settings.precision = Precision::Packed),
            ("full", |settings| settings.precision = Precision::Full),
        ],
        matters: |model, integrator| matches!(model, Model::Auto | Model::Table) && integrator != Integrator::Walk,
    },
];

/// Only `sample` draws probes.
fn probes(_: Model, integrator: Integrator) -> bool {
    integrator == Integrator::Sample
}

/// What is varied; every combination is a [`Variant`].
#[derive(Clone, Debug)]
pub struct Grid {
    pub models: Vec<Model>,
    pub integrators: Vec<Integrator>,
    pub projections: Vec<Projection>,
    /// Of each of [`AXES`].
    pub choices: [Vec<Choice>; AXIS_COUNT],
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

    /// The variants of `model`, those that differ in samples alone together.
    pub fn groups(&self, model: Model) -> Vec<Vec<Variant>> {
        let mut groups = Vec::new();
        for &integrator in &self.integrators {
            let probes = integrator == Integrator::Sample;
            let projections = if probes { &self.projections[..] } else { &[Projection::Mis] };
            let varied = self.varied(model, integrator);
            for &projection in projections {
                for &choices in &varied {
                    groups.extend(self.directions.iter().map(|&directions| {
                        let variant =
                            |&samples| Variant { model, integrator, projection, choices, directions, samples };
                        self.samples.iter().map(variant).collect()
                    }));
                }
            }
        }
        groups
    }

    /// Every combination of the axes that matter, the last of them varying fastest.
    fn varied(&self, model: Model, integrator: Integrator) -> Vec<[Choice; AXIS_COUNT]> {
        let mut all = vec![DEFAULTS];
        for (number, axis) in AXES.iter().enumerate() {
            if (axis.matters)(model, integrator) {
                let with = |choices: [Choice; AXIS_COUNT]| {
                    self.choices[number].iter().map(move |&choice| {
                        let mut choices = choices;
                        choices[number] = choice;
                        choices
                    })
                };
                all = all.into_iter().flat_map(with).collect();
            }
        }
        all
    }
}

/// The default of each axis.
pub(super) const DEFAULTS: [Choice; AXIS_COUNT] =
    [AXES[0].choices[0], AXES[1].choices[0], AXES[2].choices[0], AXES[3].choices[0]];

/// One way to render.
#[derive(Clone, Copy, Debug)]
pub struct Variant {
    pub model: Model,
    pub integrator: Integrator,
    pub projection: Projection,
    /// Of each of [`AXES`].
    pub choices: [Choice; AXIS_COUNT],
    pub directions: u32,
    pub samples: u32,
}

impl PartialEq for Variant {
    fn eq(&self, other: &Variant) -> bool {
        self.name() == other.name()
    }
}

impl Variant {
    /// Every choice by name: `standard-sample-mis-trace-direct-auto-packed-1x64`.
    pub fn name(&self) -> String {
        let Variant { model, integrator, directions, samples, .. } = self;
        let choices = self.choices.map(|(name, _)| name).join("-");
        format!("{model}-{integrator}-{}-{choices}-{directions}x{samples}", self.projection())
    }

    /// The projection's name.
    pub fn projection(&self) -> String {
        format!("{:?}", self.projection).to_lowercase()
    }

    /// Names of axes and of the choices that are not their defaults.
    pub fn chosen(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        let of = |(axis, (name, _)): (&Axis, Choice)| (axis.choices[0].0 != name).then_some((axis.name, name));
        AXES.iter().zip(self.choices).filter_map(of)
    }

    /// The options of `render` that give it; defaults are left out where there is no choice.
    pub fn options(&self) -> String {
        let Variant { model, integrator, directions, samples, .. } = self;
        let mut text = format!("--model {model} --integrator {integrator}");
        if *integrator == Integrator::Sample {
            text += &format!(" --projection {}", self.projection());
        }
        text.extend(self.chosen().map(|(axis, name)| format!(" --{axis} {name}")));
        text + &format!(" --directions {directions} --samples {samples}")
    }

    /// `settings` with its choices.
    pub fn settings(&self, settings: &Settings) -> Settings {
        let Variant { model, integrator, projection, directions, .. } = *self;
        let mut settings = Settings { model, integrator, projection, directions, ..settings.clone() };
        self.choices.iter().for_each(|(_, choose)| choose(&mut settings));
        settings
    }
}
