//! Which profile a material gets, and why: the setting, else what its file says, else what is recommended.
//!
//! # What is recommended
//! What the scene requires, no more, by the [errors] that a random walk shows:
//!
//! - The error that a pixel can show is the model's error of the total, and of the light that it puts in the wrong place
//!   the part min(1, m / p) that crosses a pixel of width p, where m is the mean distance that light travels inside.
//! - The diffusion model with the least such error is enough where that is at most `ENOUGH`.
//! - Else the tabulated profile.
//! - Where no pixel shows the profile at all, and light crosses no wall, its opaque limit takes its place.
//!
//! # How light spreads below a pixel
//! Across the edge of a shadow, m / pi of the light of a unit of its length changes sides (the mean of |x| is 2 m / pi
//! for a radial profile, and half of it lies on either side), so of the light in the pixel m / (pi p). The same for a
//! wall of the thickness t in place of p: without absorption that share of the light, roughly, comes out behind it.

mod detail;
pub mod errors;
mod grid;

pub use detail::Detail;

use crate::reference::boundary::{Side, diffuse_reflectance};
use crate::reference::math::integrate;
use crate::reference::profile::{self, Coefficients, Dipole, Directional, Profile, Radial};
use crate::scene::{Material, Medium};
use crate::settings::{Model, Settings, SingleScattering};
use errors::Error;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Error that a diffusion model may show.
const ENOUGH: f64 = 0.05;

/// Part of a pixel's light beside the edge of a shadow that nobody sees: half a step of an 8-bit image.
const UNSEEN: f64 = 1.0 / 512.0;

/// Errors from which on a model's choice brings a warning: of the total, and of place or amount.
const WARNED: Error = Error { total: 0.1, l1: 0.5 };

/// Mean free paths below which a body is thin.
const THIN: f64 = 3.0;

/// A model that was chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// Never [`Model::Auto`].
    pub model: Model,
    /// Of the opaque limit, the model whose limit it is, and so whose total it has; else the same.
    pub limit_of: Model,
    /// Who chose it, for people.
    pub why: String,
}

/// A choice with what is known about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Advice {
    pub choice: Choice,
    /// What would be recommended.
    pub recommended: Choice,
    /// Error of the chosen model on a plane, of the channel where it is largest; none where it is not known.
    pub error: Option<Error>,
    /// Where that is too much to go unsaid, and where a body is too thin for the model.
    pub warnings: Vec<String>,
}

/// The model of a material that shows this much of it; none for an opaque one. Where neither settings nor file ask for
/// one, a choice that was `made` before stays.
pub fn advise(settings: &Settings, material: &Material, detail: Detail, made: Option<&Choice>) -> Option<Advice> {
    let medium = material.medium.as_ref()?;
    let channels: Vec<Coefficients> = (0..3).map(|c| Coefficients::of(medium, material.ior, c)).collect();
    let recommended = recommend(&channels, detail);
    let asked = |model: Option<Model>, why: &str| {
        let model = model.filter(|&model| model != Model::Auto)?;
        let limit_of = if model == Model::Lambert { Model::Standard } else { model };
        Some(Choice { model, limit_of, why: why.into() })
    };
    let choice = asked(Some(settings.model), "as the settings ask")
        .or_else(|| asked(medium.model, "as the file asks"))
        .or_else(|| made.cloned())
        .unwrap_or_else(|| recommended.clone());
    let error = worst(&channels, choice.limit_of, |error| error.l1).map(|error| match choice.model {
        // All light is where it entered, which does not show, or is all in the wrong place.
        Model::Lambert if hidden(spread(&channels), detail) => Error { l1: error.total.abs(), ..error },
        Model::Lambert => Error { l1: 2.0 + error.total, ..error },
        _ => error,
    });
    let (name, model) = (&material.name, choice.model);
    let wrong = error.filter(|error| error.l1 > WARNED.l1 || error.total.abs() > WARNED.total).map(|error| {
        let advice =
            if recommended.model == model { String::new() } else { format!("; {} errs less", recommended.model) };
        format!("{name}: a plane with the {model} model {error}{advice}")
    });
    let thin = thin(&channels, detail).zip(errors::on_thin_bodies(model, settings.curvature));
    let thin = thin.map(|(paths, [balls, plates])| {
        let range = |(least, most): (f64, f64)| format!("{:+.0} to {:+.0} %", 100.0 * least, 100.0 * most);
        format!(
            "{name}: its bodies are {paths:.1} mean free paths thick; on those of one, the {model} model's light is off by {} \
             (balls) and {} (plates)",
            range(balls),
            range(plates)
        )
    });
    let warnings = wrong.into_iter().chain(thin).collect();
    Some(Advice { choice, recommended, error, warnings })
}

/// What `auto` means for matter that shows this much.
fn recommend(channels: &[Coefficients], detail: Detail) -> Choice {
    if detail.pixel == f64::INFINITY {
        let why = "nothing of it is in front of the camera".into();
        return Choice { model: Model::Lambert, limit_of: Model::Standard, why };
    }
    let spread = spread(channels);
    let crossing = if detail.pixel > 0.0 { (spread / detail.pixel).min(1.0) } else { 1.0 };
    let seen = |error: &Error| {
        let total = error.total.abs();
        total + (error.l1 - total).max(0.0) * crossing
    };
    let diffusion = [Model::Standard, Model::Better, Model::Burley];
    let known = diffusion.into_iter().filter_map(|model| Some((model, seen(&worst(channels, model, seen)?))));
    let Some((least, error)) = known.min_by(|a, b| a.1.total_cmp(&b.1)) else {
        let why = "matter that does not scatter has no profile".into();
        return Choice { model: Model::Standard, limit_of: Model::Standard, why };
    };
    let picture = match detail.pixel {
        0.0 => String::new(),
        pixel => format!("in pixels of {}, ", length(pixel)),
    };
    let shown = format!("light that travels {} on average shows {:.0} % of error", length(spread), 100.0 * error);
    let (model, reason) = match error <= ENOUGH {
        true => (least, format!("the diffusion model that errs least: {picture}{shown}")),
        false => (Model::Table, format!("diffusion is not enough: {picture}{shown} with {least}")),
    };
    if hidden(spread, detail) {
        let why = format!("{picture}light that travels {} on average leaves where it entered", length(spread));
        return Choice { model: Model::Lambert, limit_of: model, why: format!("{why}; total of the {model} model") };
    }
    Choice { model, limit_of: model, why: reason }
}

/// Whether nothing shows of light that travels this far (m) on average.
fn hidden(distance: f64, detail: Detail) -> bool {
    distance < UNSEEN * PI * detail.pixel.min(detail.thickness)
}

/// Thickness in mean free paths of the channel that scatters with the longest one, where that is little.
fn thin(channels: &[Coefficients], detail: Detail) -> Option<f64> {
    let scattering = channels.iter().filter(|channel| channel.sigma_s_prime > 0.0);
    let least = scattering.map(|channel| channel.sigma_s_prime + channel.sigma_a).reduce(f64::min)?;
    Some(detail.thickness * least).filter(|&paths| paths < THIN)
}

/// The mean distance that light travels in the channel where it travels farthest.
fn spread(channels: &[Coefficients]) -> f64 {
    channels.iter().map(mean_distance).fold(0.0, f64::max)
}

/// The error of the channel in which a model errs most; none if it is not built, not known, or nothing scatters.
fn worst(channels: &[Coefficients], model: Model, how_much: impl Fn(&Error) -> f64) -> Option<Error> {
    profile::constant(model)?;
    let scattering = channels.iter().filter(|channel| channel.sigma_s_prime > 0.0);
    let errors = scattering.map(|channel| {
        let albedo = channel.sigma_s_prime / (channel.sigma_s_prime + channel.sigma_a);
        errors::of(model, albedo, channel.ior)
    });
    errors.collect::<Option<Vec<_>>>()?.into_iter().max_by(|a, b| how_much(a).total_cmp(&how_much(b)))
}

/// Mean distance between where light enters and leaves a plane, by the standard dipole; but for the millionth that goes
/// farthest, which without absorption would make it infinite. In the unit of the coefficients.
fn mean_distance(channel: &Coefficients) -> f64 {
    if channel.sigma_s_prime <= 0.0 {
        return 0.0;
    }
    let dipole = Dipole::new(channel.sigma_s_prime, channel.sigma_a, channel.ior);
    let (near, far) = (1e-3 * dipole.z_real, dipole.radius_beyond(1e-6));
    // The mean is the integral of what lies beyond r.
    const STEPS: u32 = 256;
    let step = (far / near).ln() / f64::from(STEPS);
    let beyond = |i: u32| {
        let r = near * ((f64::from(i) + 0.5) * step).exp();
        dipole.outside(r) / dipole.mass() * r * step
    };
    near + (0..STEPS).map(beyond).sum::<f64>()
}

/// A length of metres in words.
fn length(metres: f64) -> String {
    match metres {
        m if m < 1e-4 => format!("{:.2} um", m * 1e6),
        m if m < 1e-2 => format!("{:.3} mm", m * 1e3),
        m if m < 1.0 => format!("{:.2} mm", m * 1e3),
        m => format!("{m:.2} m"),
    }
}

/// What a model sends out of a plane within a radius, per flux that entered along the normal; lengths in the unit of the
/// coefficients. None for a model that is not built.
pub fn beam(model: Model, matter: &Coefficients) -> Option<Box<dyn Fn(f64) -> f64>> {
    let constant = profile::constant(model)?;
    if model == Model::Directional {
        // Its profile is where samples come from; what it sends out depends on the direction.
        let directional = Directional::new(matter, 1.0);
        let leaving = PI * (1.0 - diffuse_reflectance(matter.ior, Side::Outside));
        let start = 1e-3 * directional.proposal.z_real;
        return Some(Box::new(move |radius: f64| {
            if radius.is_infinite() {
                return directional.total_at(1.0);
            }
            let ring = |r: f64| TAU * r * leaving * directional.value(r * DVec3::X, DVec3::Z, DVec3::Z, DVec3::Z, 0.0);
            let inner = integrate(0.0, radius.min(start), 1, ring);
            let end = (radius / start).ln().max(0.0);
            inner + integrate(0.0, end, 8, |t| ring(start * t.exp()) * start * t.exp())
        }));
    }
    let profile = Profile::new(constant, matter);
    Some(Box::new(move |r: f64| if r.is_finite() { profile.cdf(r) } else { profile.total() }))
}

/// Reduced albedo from which on single scattering makes the better dipole's total worse. Its total on a half-space is too
/// dark by the light that was scattered once, but it errs to the bright side in what was scattered more: without and with
/// the term, errors of the total are -39 % and +5 % at alpha' = .68, -24 and +6 at .84, -8 and +9 at .96 (n = 1.3), and
/// -1 and +6 above .99 (n = 1.5), by a Monte Carlo simulation.
const SINGLE_ALBEDO_MAX: f64 = 0.95;

/// Whether light that was scattered once is added to the light of a model: where the settings, else the file ask for it,
/// else to the better dipole if a channel that scatters has a reduced albedo below .95. The standard dipole's total is that of all light, though
/// it has little at short distances; directional dipole, normalised diffusion and tables hold it.
pub fn adds_single_scattering(settings: &Settings, medium: &Medium, model: Model) -> bool {
    let asked = match settings.single_scattering {
        SingleScattering::Auto => medium.single_scattering,
        asked => asked,
    };
    let albedo = |c: usize| medium.sigma_s_prime[c] / (medium.sigma_s_prime[c] + medium.sigma_a[c]);
    let absorbs = || (0..3).any(|c| medium.sigma_s_prime[c] > 0.0 && albedo(c) < SINGLE_ALBEDO_MAX);
    match (model, asked) {
        (Model::Standard | Model::Better, SingleScattering::On) => true,
        (Model::Better, SingleScattering::Auto) => absorbs(),
        _ => false,
    }
}
