//! Light that is kept on surfaces: whether it can be, and where.

use crate::{
    cache::{self, Geometry},
    error::{Error, Result},
    scene::Scene,
    settings::{Cache, Integrator, Irradiance, Settings},
    shared::{MODEL_DIRECTIONAL, MODEL_LAMBERT, Material},
};

/// Points that are not lit yet; none where shadow rays find the light.
///
/// # Errors
/// [`Error::Setting`] for what light cannot be kept of.
pub(super) fn points(scene: &Scene, settings: &Settings, materials: &[Material]) -> Result<cache::Cache> {
    let Cache { points, samples, spacing, tolerance } = settings.cache;
    if settings.irradiance != Irradiance::Cached {
        return Ok(cache::Cache::default());
    }
    if points > Cache::POINTS_MAX {
        return Err(Error::setting("cache points", format!("{points} is more than {}", Cache::POINTS_MAX)));
    }
    if samples < 2 {
        return Err(Error::setting("cache samples", format!("{samples} is not at least 2")));
    }
    if !(spacing > 0.0 && spacing.is_finite()) {
        return Err(Error::setting("cache spacing", format!("{spacing} is not a number above 0")));
    }
    if !(tolerance >= 0.0 && tolerance.is_finite()) {
        return Err(Error::setting("cache tolerance", format!("{tolerance} is not a number from 0")));
    }
    let refuse = |problem: String| Err(Error::setting("irradiance cached", problem));
    if settings.integrator != Integrator::Sample {
        return refuse(format!("is for the integrator sample; {} finds its light otherwise", settings.integrator));
    }
    if settings.recording {
        return refuse("does not go into recordings; render with it, or record with direct".into());
    }
    let mut spacings = vec![];
    for (authored, material) in scene.materials.iter().zip(materials) {
        if authored.medium.is_some() && material.model == MODEL_DIRECTIONAL {
            let problem = "has the directional dipole, whose value depends on where light comes from: use direct";
            return refuse(format!("material `{}` {problem}", authored.name));
        }
        let spreads = authored.medium.as_ref().filter(|_| material.model != MODEL_LAMBERT);
        let extinction =
            spreads.map(|medium| (medium.sigma_s_prime + medium.sigma_a).max_element() / scene.frame.scale);
        spacings.push(extinction.filter(|&extinction| extinction > 0.0).map(|extinction| spacing / extinction));
    }
    let of_triangle = |index: usize| spacings[scene.shadings[index].material as usize];
    Ok(cache::Cache::new(Geometry::of(scene), of_triangle, points as usize))
}
