//! Which profile a material gets, and why: the setting, else what its file says, else what is recommended.

use crate::scene::Medium;
use crate::settings::{Model, Settings};

/// A model that was chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// Never [`Model::Auto`].
    pub model: Model,
    /// Who chose it, for people.
    pub why: String,
}

/// The model of a medium.
pub fn resolve(settings: &Settings, medium: &Medium) -> Choice {
    let asked = |model: Option<Model>, why: &str| {
        model.filter(|&model| model != Model::Auto).map(|model| Choice { model, why: why.into() })
    };
    asked(Some(settings.model), "as the settings ask")
        .or_else(|| asked(medium.model, "as the file asks"))
        .unwrap_or_else(|| recommend(medium))
}

/// What `auto` means for a medium.
pub fn recommend(_medium: &Medium) -> Choice {
    Choice { model: Model::Standard, why: "the standard dipole unless something else is asked for".into() }
}
