//! Speed against accuracy: one scene rendered in many ways, each with its time and its error.
//!
//! An error has two parts, which are told apart. *Sampling error* is the distance from the converged image of the same
//! model: noise, and the bias of the integrator or projection. *Model error* is the distance of that converged image
//! from the one of the model that all are measured against, by default the table's, which is the nearest to a random
//! walk. The *total* is the distance of a variant's image from the latter. Each is given as the root of the relative
//! squared error ([`Image::relative_mse`]) and as FLIP ([`Image::flip`]).
//!
//! A converged image is the mean of two with random numbers of their own, by the integrator `sample` with all
//! projections combined and profiles stored in full; its own error is half of what lies between the two.
//!
//! What is rendered is kept in a folder, so that a run that was stopped, or is asked for more, renders only what is
//! missing.

mod converged;
mod front;
mod run;
mod store;
mod variant;

pub use converged::Converged;
pub use front::front;
pub use run::{Progress, run};
pub use variant::{AXES, AXIS_COUNT, Axis, Choice, Grid, Variant};

use crate::{Image, Model, Result};
use serde_json::{Value, json};
use std::path::PathBuf;

/// How long a variant took, in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Times {
    /// Everything that depends on pipelines and the driver: compiling, uploading, a first sample.
    pub start_up: f64,
    /// Making of the scene what kernels read.
    pub prepare: f64,
    /// From the first sample to the image; the median of up to five, where one is short.
    pub render: f64,
    /// Of that, in kernels; none on a device without timestamps.
    pub kernels: Option<f64>,
}

impl Times {
    /// What a variant is judged by: preparing and rendering.
    pub fn total(&self) -> f64 {
        self.prepare + self.render
    }

    fn json(&self) -> Value {
        json!({"startUp": self.start_up, "prepare": self.prepare, "render": self.render, "kernels": self.kernels})
    }

    fn from_json(value: &Value) -> Option<Times> {
        let number = |name: &str| value[name].as_f64();
        let [start_up, prepare, render] = [number("startUp")?, number("prepare")?, number("render")?];
        Some(Times { start_up, prepare, render, kernels: number("kernels") })
    }
}

/// The two measures of a distance between images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Root of the relative squared error.
    pub relative: f64,
    pub flip: f64,
}

impl Errors {
    /// # Errors
    /// As [`Image::relative_mse`].
    pub fn between(image: &Image, reference: &Image, exposure: f64) -> Result<Errors> {
        let relative = image.relative_mse(reference)?.mean.sqrt();
        Ok(Errors { relative, flip: image.flip(reference, exposure)?.mean })
    }

    pub fn of(&self, measure: Measure) -> f64 {
        match measure {
            Measure::Relative => self.relative,
            Measure::Flip => self.flip,
        }
    }
}

/// By what images are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    Relative,
    Flip,
}

/// What images are compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Against {
    /// The converged image of the same model.
    Sampling,
    /// The converged image of the model that all are measured against.
    Total,
}

/// A variant that was rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    pub times: Times,
    pub sampling: Errors,
    /// None without a model that all are measured against.
    pub total: Option<Errors>,
    /// Its image.
    pub file: PathBuf,
    /// It was there from an earlier run.
    pub kept: bool,
}

/// A variant with what came of it, or why it was refused.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub variant: Variant,
    pub outcome: std::result::Result<Measured, String>,
}

impl Row {
    /// Time (s) and error.
    pub fn point(&self, measure: Measure, against: Against) -> Option<(f64, f64)> {
        let measured = self.outcome.as_ref().ok()?;
        let errors = match against {
            Against::Sampling => Some(measured.sampling),
            Against::Total => measured.total,
        };
        Some((measured.times.total(), errors?.of(measure)))
    }
}

/// Everything that was measured.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Of models that were not refused.
    pub converged: Vec<Converged>,
    pub rows: Vec<Row>,
    /// The model that all are measured against, if it was not refused.
    pub against: Option<Model>,
    /// Nothing stopped it.
    pub finished: bool,
}

impl Outcome {
    /// Whether each row is on the Pareto front: of its model's rows for the sampling error, of all for the total.
    pub fn front(&self, measure: Measure, against: Against) -> Vec<bool> {
        let point = |row: &Row| row.point(measure, against).unwrap_or((f64::NAN, f64::NAN));
        let mut marked = vec![false; self.rows.len()];
        let group = |row: &Row| (against == Against::Sampling).then_some(row.variant.model);
        let mut groups: Vec<Option<Model>> = self.rows.iter().map(group).collect();
        groups.dedup();
        for one in groups {
            let members: Vec<usize> = (0..self.rows.len()).filter(|&i| group(&self.rows[i]) == one).collect();
            let points: Vec<(f64, f64)> = members.iter().map(|&i| point(&self.rows[i])).collect();
            front(&points).into_iter().zip(members).for_each(|(on, i)| marked[i] = on);
        }
        marked
    }

    /// The converged image of `model`.
    pub fn converged(&self, model: Model) -> Option<&Converged> {
        self.converged.iter().find(|converged| converged.model == model)
    }

    /// The converged image that all are measured against.
    pub fn yardstick(&self) -> Option<&Converged> {
        self.converged(self.against?)
    }
}
