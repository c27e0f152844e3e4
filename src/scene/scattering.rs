//! The two drafts of a scattering extension, over KHR_materials_volume.

use super::json::Item;
use super::material::{LENGTH_RANGE, read_g};
use super::medium::Mapping;
use super::{AlbedoMapping, Medium};
use crate::{Result, settings::SingleScattering};
use glam::DVec3;

/// Stands for an attenuation colour of 0, which would be an infinite extinction.
const DARKEST_ATTENUATION: f64 = 1e-4;

/// What an author says of the medium.
pub(super) struct Authored {
    mapping: Mapping,
    /// [1/m].
    sigma_t: DVec3,
    /// Multi-scatter colour times strength.
    rho: DVec3,
    g: DVec3,
}

impl Authored {
    /// Reads the extension at `item`; none where nothing scatters.
    pub fn read(
        material: &Item,
        item: &Item,
        mapping: Mapping,
        warnings: &mut Vec<String>,
    ) -> Result<Option<Authored>> {
        let default_color = if mapping == Mapping::Scatter { DVec3::ONE } else { DVec3::ZERO };
        let color = match (item.get("multiscatterColorFactor")?, item.get("multiscatterColor")?) {
            (Some(color), _) | (None, Some(color)) => DVec3::from_array(color.numbers_within(0.0, 1.0)?),
            (None, None) => default_color,
        };
        let strength = match (mapping, item.get("scatterStrengthFactor")?, item.get("scatterFactor")?) {
            (Mapping::VolumeScatter, ..) => 1.0,
            (Mapping::Scatter, Some(strength), _) | (Mapping::Scatter, None, Some(strength)) => {
                strength.within(0.0, 1.0)?
            }
            (Mapping::Scatter, None, None) => 0.0,
        };
        let g = item.get("scatterAnisotropy")?.map_or(Ok(DVec3::ZERO), |g| {
            g.number()?;
            read_g(&g)
        })?;
        let sigma_t = read_extinction(material, warnings)?;
        let nothing =
            |reason: &str| item.note(format!("{reason}, so nothing scatters; the material is taken as opaque"));
        let rho = color * strength;
        if strength == 0.0 {
            warnings.push(nothing("the scatter strength (scatterStrengthFactor, default 0) is 0"));
            return Ok(None);
        }
        if rho == DVec3::ZERO {
            warnings.push(nothing("the multi-scatter colour is black"));
            return Ok(None);
        }
        if sigma_t == DVec3::ZERO {
            warnings.push(nothing("KHR_materials_volume gives no extinction (attenuationDistance, attenuationColor)"));
            return Ok(None);
        }
        warn_of_share(material, item, warnings)?;
        Ok(Some(Authored { mapping, sigma_t, rho, g }))
    }

    /// The medium at a share of the colour, 0 to 1.
    pub fn medium(&self, share: f64, ior: f64, albedo: AlbedoMapping) -> Medium {
        let (mut sigma_s_prime, mut sigma_a) = (DVec3::ZERO, DVec3::ZERO);
        for c in 0..3 {
            let rho = self.rho[c] * share;
            (sigma_s_prime[c], sigma_a[c]) = self.mapping.coefficients(self.sigma_t[c], rho, self.g[c], albedo, ior);
        }
        let source = match self.mapping {
            Mapping::Scatter => "KHR_materials_scatter",
            Mapping::VolumeScatter => "KHR_materials_volume_scatter",
        };
        Medium {
            sigma_s_prime,
            sigma_a,
            g: self.g,
            appearance: None,
            model: None,
            directional: None,
            single_scattering: SingleScattering::Auto,
            source: source.into(),
        }
    }
}

/// sigma_t = -ln(attenuationColor) / attenuationDistance [1/m]; 0 without KHR_materials_volume.
fn read_extinction(material: &Item, warnings: &mut Vec<String>) -> Result<DVec3> {
    let Some(volume) = material.extension("KHR_materials_volume")? else { return Ok(DVec3::ZERO) };
    let thickness = volume.get("thicknessFactor")?.map_or(Ok(0.0), |thickness| thickness.within(0.0, f64::INFINITY))?;
    if thickness == 0.0 {
        warnings.push(volume.note("a thin wall (thicknessFactor 0) is not modelled; the matter is taken as solid"));
    }
    let color = volume.get("attenuationColor")?;
    let mut factor = color.as_ref().map_or(Ok([1.0; 3]), |color| color.numbers_within(0.0, 1.0))?;
    if let Some(color) = color.filter(|_| factor.contains(&0.0)) {
        warnings.push(color.note(format!("0 would be an infinite extinction; {DARKEST_ATTENUATION} is used")));
        factor = factor.map(|channel| if channel == 0.0 { DARKEST_ATTENUATION } else { channel });
    }
    let Some(distance) = volume.get("attenuationDistance")? else { return Ok(DVec3::ZERO) };
    let length = distance.positive()?;
    if !(LENGTH_RANGE.0..=LENGTH_RANGE.1).contains(&length) {
        return Err(distance.error(format!("must be from {} to {} m, is {length}", LENGTH_RANGE.0, LENGTH_RANGE.1)));
    }
    // `+ 0.0` turns the -0 of a white channel into 0.
    Ok(DVec3::from_array(factor.map(|channel| -channel.ln() / length + 0.0)))
}

/// The share of transmission in a material that scatters.
fn warn_of_share(material: &Item, item: &Item, warnings: &mut Vec<String>) -> Result<()> {
    let share = transmitted(material)?;
    if share < 1.0 {
        warnings.push(item.note(format!(
            "a material that transmits {share} of the light is taken as wholly translucent; mixtures are not modelled"
        )));
    }
    Ok(())
}

pub(super) fn warn_of_clear_matter(material: &Item, warnings: &mut Vec<String>) -> Result<()> {
    if transmitted(material)? > 0.0 {
        warnings.push(material.note(
            "transmits light without scattering it; refraction through clear matter is not modelled, it is opaque",
        ));
    }
    // The ranges hold for matter that only absorbs, too.
    let mut unheard = Vec::new();
    read_extinction(material, &mut unheard)?;
    Ok(())
}

/// The larger of the two transmission factors; 0 without their extensions.
fn transmitted(material: &Item) -> Result<f64> {
    let mut share: f64 = 0.0;
    for (extension, factor) in [
        ("KHR_materials_transmission", "transmissionFactor"),
        ("KHR_materials_diffuse_transmission", "diffuseTransmissionFactor"),
    ] {
        if let Some(factor) = material.find(&["extensions", extension, factor])? {
            share = share.max(factor.within(0.0, 1.0)?);
        }
    }
    Ok(share)
}
