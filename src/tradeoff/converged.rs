//! Images so good that others are measured against them.

use super::Errors;
use crate::{Image, Model, Result};

/// The converged image of a model.
#[derive(Clone, Debug)]
pub struct Converged {
    pub model: Model,
    pub image: Image,
    pub samples: u32,
    /// What is left of its own noise, as estimated from its halves.
    pub own: Errors,
    /// How far it is from the converged image that all are measured against, if there is one.
    pub error: Option<Errors>,
}

impl Converged {
    /// The mean of two images of independent random numbers, and how far either is from it: half of their difference,
    /// whose square is on average that of the mean's own error.
    pub(super) fn of(model: Model, halves: [Image; 2], samples: u32, exposure: f64) -> Result<Converged> {
        let [first, second] = halves;
        let mut image = first.clone();
        for (channel, other) in image.channels.iter_mut().zip(&second.channels) {
            for (value, other) in channel.data.iter_mut().zip(&other.data) {
                *value = 0.5 * *value + 0.5 * other;
            }
        }
        let own = Errors::between(&first, &image, exposure)?;
        Ok(Converged { model, image, samples, own, error: None })
    }
}
