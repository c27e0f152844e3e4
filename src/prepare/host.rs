//! What integrators on the host can do of a scene.

use crate::{
    error::{Error, Result},
    model::Advice,
    scene::Scene,
    settings::{Integrator, Model, Normalisation, Settings, SingleScattering},
    shared::{TEXTURE_ALPHA, TEXTURE_METALLIC_ROUGHNESS},
};
use std::borrow::Cow;

/// The settings that materials are made with. Walks have no model: boundaries are all that counts of their materials.
pub(super) fn effective(settings: &Settings) -> Cow<'_, Settings> {
    if settings.integrator != Integrator::Walk {
        return Cow::Borrowed(settings);
    }
    let (model, single_scattering) = (Model::Standard, SingleScattering::Off);
    Cow::Owned(Settings { model, single_scattering, normalisation: Normalisation::Energy, ..settings.clone() })
}

/// Takes back what is said about models where there is none.
pub(super) fn advise(settings: &Settings, advice: &mut [Option<Advice>]) {
    if settings.integrator != Integrator::Walk {
        return;
    }
    for advice in advice.iter_mut().flatten() {
        advice.warnings.clear();
        advice.error = None;
        advice.choice.why = "in name only: walks take no model".into();
    }
}

/// # Errors
/// [`Error::Setting`] for what the integrator is not for.
pub(super) fn check(scene: &Scene, settings: &Settings) -> Result<()> {
    let integrator = settings.integrator;
    if !integrator.is_on_host() {
        return Ok(());
    }
    let refuse = |problem: String| {
        let problem = format!("{problem}; use the integrator sample");
        Err(Error::setting(format!("integrator {integrator}"), problem))
    };
    if settings.recording {
        return refuse("does not go into recordings, since it computes on the host".into());
    }
    if integrator == Integrator::Area {
        return Ok(());
    }
    for set in &scene.sets {
        let Some(material) = set.materials.iter().map(|&m| &scene.materials[m]).find(|m| m.medium.is_some()) else {
            continue;
        };
        let (body, textured) = (&set.name, |kind: u32| material.textures[kind as usize].is_some());
        let problem = match () {
            _ if set.materials.len() > 1 => format!("set `{body}` holds several materials"),
            _ if set.open_edges + set.crowded_edges > 0 => {
                let edges = set.open_edges + set.crowded_edges;
                format!("the surface of `{body}` is not closed: {edges} of its edges have not two triangles")
            }
            _ if !material.ramp.is_empty() => format!("a texture changes the medium of material `{}`", material.name),
            _ if textured(TEXTURE_ALPHA) => format!("a texture makes holes in material `{}`", material.name),
            _ if textured(TEXTURE_METALLIC_ROUGHNESS) && material.roughness > 0.0 => {
                format!("a texture changes the roughness of material `{}`", material.name)
            }
            _ => continue,
        };
        return refuse(problem);
    }
    Ok(())
}
