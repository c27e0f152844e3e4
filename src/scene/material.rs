//! Materials of a glTF file: surface factors, and the medium from presets, extras or extensions.

use super::frame::INTENSITY_MAX;
use super::json::Item;
use super::medium::{self, Mapping};
use super::presets::{Preset, preset};
use super::unit::metres;
use super::{Appearance, LengthKind, Material, Medium};
use crate::{Error, Result, settings::Model};
use glam::DVec3;
use std::path::Path;

/// glTF's index of refraction where a material names none.
const DEFAULT_IOR: f64 = 1.5;
/// Indices of refraction within which the Fresnel moments keep their digits.
const IOR_RANGE: (f64, f64) = (0.1, 10.0);
/// Stands for an attenuation colour of 0, which would be an infinite extinction.
const DARKEST_ATTENUATION: f64 = 1e-4;
/// Longest mean free path (m) and largest coefficient [1/m]: beyond, f32 kernels cannot hold the numbers.
const COEFFICIENT_MAX: f64 = 1e12;
const LENGTH_RANGE: (f64, f64) = (1e-12, 1e12);

/// Reduced albedo below which diffusion theory is far from the truth.
const DIFFUSION_ALBEDO_MIN: f64 = 0.5;

/// Members of `extras.bssrdf`.
const BSSRDF_KEYS: &[&str] = &[
    "preset",
    "sigma_s_prime",
    "sigma_s",
    "sigma_a",
    "albedo",
    "mean_free_path",
    "diffuse_mean_free_path",
    "unit",
    "ior",
    "g",
    "model",
    "surface",
    "set",
];

/// Extensions of materials whose effect is left out.
pub(super) const UNMODELLED: &[(&str, &str)] = &[
    ("KHR_materials_specular", "specular factors"),
    ("KHR_materials_clearcoat", "clear coat"),
    ("KHR_materials_sheen", "sheen"),
    ("KHR_materials_iridescence", "iridescence"),
    ("KHR_materials_anisotropy", "anisotropic highlights"),
    ("KHR_materials_dispersion", "dispersion"),
    ("KHR_materials_pbrSpecularGlossiness", "specular-glossiness factors"),
    ("KHR_materials_unlit", "unlit shading"),
    ("KHR_materials_subsurface", "KHR_materials_subsurface"),
    ("KHR_materials_sss", "KHR_materials_sss"),
];

/// The material of a primitive that names none.
pub(super) fn default_material() -> Material {
    Material {
        name: "default".into(),
        base_color: DVec3::ONE,
        metallic: 1.0,
        roughness: 1.0,
        emission: DVec3::ZERO,
        two_sided: false,
        ior: DEFAULT_IOR,
        medium: None,
        set: None,
    }
}

/// Reads `materials[index]`. The medium is the first of: a preset in `overrides` for the material's name,
/// `extras.bssrdf`, KHR_materials_scatter, KHR_materials_volume_scatter, none.
pub(super) fn read(
    item: &Item,
    index: usize,
    overrides: &[(String, String)],
    warnings: &mut Vec<String>,
) -> Result<Material> {
    let name = item.name()?.unwrap_or_else(|| format!("material {index}"));
    let mut material = Material { name, ..default_material() };
    read_surface(item, &mut material, warnings)?;
    let authored_ior = read_ior(item, warnings)?;
    material.ior = authored_ior.unwrap_or(DEFAULT_IOR);

    let chosen = overrides.iter().rev().find(|(name, _)| *name == material.name);
    let bssrdf = extras_bssrdf(item)?;
    if let Some(bssrdf) = &bssrdf {
        material.set = read_set(bssrdf)?;
    }
    // With a set alone, it says nothing about the matter.
    let bssrdf = match bssrdf {
        Some(bssrdf) if bssrdf.keys()? != ["set"] => Some(bssrdf),
        _ => None,
    };
    let scatter = item.extension("KHR_materials_scatter")?;
    let volume_scatter = item.extension("KHR_materials_volume_scatter")?;
    if let Some((_, preset_name)) = chosen {
        let found = preset(preset_name).map_err(|problem| Error::setting("material", problem))?;
        material.medium = Some(medium_of(&found));
        material.ior = found.ior;
    } else if let Some(bssrdf) = bssrdf {
        read_bssrdf(&bssrdf, authored_ior, &mut material)?;
    } else if let Some(scatter) = scatter {
        material.medium = read_scattering(item, &scatter, Mapping::Scatter, warnings)?;
    } else if let Some(scatter) = volume_scatter {
        material.medium = read_scattering(item, &scatter, Mapping::VolumeScatter, warnings)?;
    } else {
        warn_of_clear_matter(item, warnings)?;
    }
    if let Some(medium) = &material.medium {
        warn_of_absorption(item, medium, warnings);
    }
    Ok(material)
}

/// `extras.bssrdf` of a material or a node; other extras may be anything.
pub(super) fn extras_bssrdf<'a>(item: &Item<'a>) -> Result<Option<Item<'a>>> {
    match item.find(&["extras"])? {
        Some(extras) if extras.keys().is_ok() => extras.get("bssrdf"),
        _ => Ok(None),
    }
}

/// The name of the set that `extras.bssrdf` names.
pub(super) fn read_set(bssrdf: &Item) -> Result<Option<String>> {
    let Some(set) = bssrdf.get("set")? else { return Ok(None) };
    if set.string()?.is_empty() {
        return Err(set.error("must name a set, is empty"));
    }
    Ok(Some(set.string()?.to_string()))
}

/// Refuses an override whose material the file does not have, or whose preset we do not know.
pub(super) fn check_overrides(file: &Path, materials: &[Item], overrides: &[(String, String)]) -> Result<()> {
    for (name, preset_name) in overrides {
        preset(preset_name).map_err(|problem| Error::setting("material", problem))?;
        let mut names = Vec::new();
        for (index, item) in materials.iter().enumerate() {
            names.push(item.name()?.unwrap_or_else(|| format!("material {index}")));
        }
        if !names.contains(name) {
            let listed = if names.is_empty() { "none".to_string() } else { names.join(", ") };
            let problem = format!("{} has no material `{name}`; it has: {listed}", file.display());
            return Err(Error::setting("material", problem));
        }
    }
    Ok(())
}

fn read_surface(item: &Item, material: &mut Material, warnings: &mut Vec<String>) -> Result<()> {
    let mut textured = item.get("normalTexture")?.is_some()
        || item.get("occlusionTexture")?.is_some()
        || item.get("emissiveTexture")?.is_some();
    if let Some(pbr) = item.get("pbrMetallicRoughness")? {
        if let Some(factor) = pbr.get("baseColorFactor")? {
            let [r, g, b, _] = factor.numbers_within(0.0, 1.0)?;
            material.base_color = DVec3::new(r, g, b);
        }
        material.metallic = pbr.get("metallicFactor")?.map_or(Ok(1.0), |factor| factor.within(0.0, 1.0))?;
        material.roughness = pbr.get("roughnessFactor")?.map_or(Ok(1.0), |factor| factor.within(0.0, 1.0))?;
        textured |= pbr.get("baseColorTexture")?.is_some() || pbr.get("metallicRoughnessTexture")?.is_some();
    }
    if textured {
        warnings.push(item.note("textures are not modelled; the factors alone are used"));
    }
    if let Some(factor) = item.get("emissiveFactor")? {
        material.emission = DVec3::from_array(factor.numbers_within(0.0, 1.0)?);
    }
    if let Some(extension) = item.extension("KHR_materials_emissive_strength")?
        && let Some(strength) = extension.get("emissiveStrength")?
    {
        material.emission *= strength.within(0.0, INTENSITY_MAX)?;
    }
    material.two_sided = item.get("doubleSided")?.map_or(Ok(false), |sides| sides.boolean())?;
    if let Some(mode) = item.get("alphaMode")? {
        match mode.string()? {
            "OPAQUE" => {}
            "MASK" | "BLEND" => {
                warnings.push(mode.note("transparency by alpha is not modelled; the surface is taken as whole"));
            }
            other => return Err(mode.error(format!("must be OPAQUE, MASK or BLEND, is {other:?}"))),
        }
    }
    for (extension, effect) in UNMODELLED {
        if item.extension(extension)?.is_some() {
            warnings.push(item.note(format!("{effect} ({extension}): not modelled")));
        }
    }
    Ok(())
}

/// The index of refraction of KHR_materials_ior, if the material has that extension.
fn read_ior(item: &Item, warnings: &mut Vec<String>) -> Result<Option<f64>> {
    let Some(extension) = item.extension("KHR_materials_ior")? else { return Ok(None) };
    let Some(ior) = extension.get("ior")? else { return Ok(Some(DEFAULT_IOR)) };
    if ior.number()? == 0.0 {
        warnings.push(ior.note(format!("0 (a full reflector, for specular-glossiness) is taken as {DEFAULT_IOR}")));
        return Ok(Some(DEFAULT_IOR));
    }
    ior.within(IOR_RANGE.0, IOR_RANGE.1).map(Some)
}

/// A table's material, from 1/mm to 1/m.
fn medium_of(preset: &Preset) -> Medium {
    Medium {
        sigma_s_prime: preset.sigma_s_prime * 1e3,
        sigma_a: preset.sigma_a * 1e3,
        g: preset.g,
        appearance: None,
        model: None,
        source: format!("preset {}", preset.name),
    }
}

/// `extras.bssrdf`: a preset, or coefficients, or an albedo with a length.
fn read_bssrdf(item: &Item, authored_ior: Option<f64>, material: &mut Material) -> Result<()> {
    for key in item.keys()? {
        if !BSSRDF_KEYS.contains(&key) {
            let key = super::json::shorten(key);
            return Err(item.error(format!("has an unknown member `{key}`; known: {}", BSSRDF_KEYS.join(", "))));
        }
    }
    let own_ior = item.get("ior")?.map(|ior| ior.within(IOR_RANGE.0, IOR_RANGE.1)).transpose()?;
    let g = item.get("g")?.map(|g| read_g(&g)).transpose()?;
    let refuse = |keys: &[&str], with: &str| -> Result<()> {
        for key in keys {
            if let Some(extra) = item.get(key)? {
                return Err(extra.error(format!("does not go together with `{with}`")));
            }
        }
        Ok(())
    };

    if let Some(name) = item.get("preset")? {
        refuse(
            &["sigma_s_prime", "sigma_s", "sigma_a", "albedo", "mean_free_path", "diffuse_mean_free_path"],
            "preset",
        )?;
        let found = preset(name.string()?).map_err(|problem| name.error(problem))?;
        let medium = medium_of(&found);
        material.ior = own_ior.or(authored_ior).unwrap_or(found.ior);
        material.medium = Some(Medium { g: g.unwrap_or(medium.g), ..medium });
    } else {
        material.ior = own_ior.or(authored_ior).unwrap_or(DEFAULT_IOR);
        let g = g.unwrap_or(DVec3::ZERO);
        let mut appearance = None;
        let (sigma_s_prime, sigma_a) = if let Some(albedo) = item.get("albedo")? {
            refuse(&["sigma_s_prime", "sigma_s", "sigma_a"], "albedo")?;
            let read = read_albedo(item, &albedo)?;
            appearance = Some(read);
            medium::channels(|c| {
                medium::from_albedo(read.albedo[c], read.length[c], read.kind, material.ior)
                    .map_err(|problem| albedo.error(problem))
            })?
        } else if item.get("sigma_a")?.is_some() {
            refuse(&["mean_free_path", "diffuse_mean_free_path"], "sigma_a")?;
            read_coefficients(item, g)?
        } else {
            return Err(item.error("needs `preset`, or `sigma_a` with `sigma_s_prime`, or `albedo` with a length"));
        };
        material.medium =
            Some(Medium { sigma_s_prime, sigma_a, g, appearance, model: None, source: "extras.bssrdf".into() });
    }

    if let Some(model) = item.get("model")? {
        let chosen: Model =
            super::json::shorten(model.string()?).parse().map_err(|problem: String| model.error(problem))?;
        if let Some(medium) = &mut material.medium {
            medium.model = Some(chosen);
        }
    }
    if let Some(surface) = item.get("surface")? {
        match surface.string()? {
            "smooth" => material.roughness = 0.0,
            "rough" => {}
            other => {
                let other = super::json::shorten(other);
                return Err(surface.error(format!("must be \"smooth\" or \"rough\", is \"{other}\"")));
            }
        }
    }
    Ok(())
}

/// Says where a medium scatters too little for the model.
fn warn_of_absorption(item: &Item, medium: &Medium, warnings: &mut Vec<String>) {
    if medium.sigma_s_prime == DVec3::ZERO {
        warnings.push(item.note("scatters nothing, so no light comes back out of it"));
        return;
    }
    let absorbing = (0..3).filter(|&channel| {
        let (scattering, absorption) = (medium.sigma_s_prime[channel], medium.sigma_a[channel]);
        scattering > 0.0 && scattering < DIFFUSION_ALBEDO_MIN * (scattering + absorption)
    });
    let names: Vec<&str> = absorbing.map(|channel| ["red", "green", "blue"][channel]).collect();
    if !names.is_empty() {
        let (names, source) = (names.join(", "), &medium.source);
        warnings.push(
            item.note(format!("{source} absorbs more than it scatters in {names}: diffusion theory is rough there")),
        );
    }
}

/// Mean cosines, one for all channels or one each, above -1 and below 1.
fn read_g(item: &Item) -> Result<DVec3> {
    let g = item.channels_within(-1.0, 1.0)?;
    if g.abs().max_element() >= 1.0 {
        return Err(item.error("must be above -1 and below 1"));
    }
    Ok(g)
}

/// The factor from the authored unit to metres (lengths) or 1/metres (coefficients).
fn read_unit(item: &Item, inverse: bool) -> Result<f64> {
    let wanted = if inverse { "1/mm, 1/cm or 1/m" } else { "mm, cm or m" };
    let unit = item.get("unit")?.ok_or_else(|| item.error(format!("has no `unit` ({wanted})")))?;
    let text = unit.string()?;
    let wrong = || unit.error(format!("must be {wanted}, is \"{}\"", super::json::shorten(text)));
    if inverse {
        Ok(1.0 / text.strip_prefix("1/").and_then(metres).ok_or_else(wrong)?)
    } else {
        metres(text).ok_or_else(wrong)
    }
}

fn read_coefficients(item: &Item, g: DVec3) -> Result<(DVec3, DVec3)> {
    let factor = read_unit(item, true)?;
    let sigma_a = item.need("sigma_a")?.channels_within(0.0, COEFFICIENT_MAX)?;
    let sigma_s_prime = match (item.get("sigma_s_prime")?, item.get("sigma_s")?) {
        (Some(reduced), None) => reduced.channels_within(0.0, COEFFICIENT_MAX)?,
        (None, Some(plain)) => {
            let sigma_s = plain.channels_within(0.0, COEFFICIENT_MAX)?;
            if item.get("g")?.is_none() {
                return Err(item.error("has `sigma_s`, but no `g`"));
            }
            sigma_s * (1.0 - g)
        }
        (Some(_), Some(plain)) => return Err(plain.error("does not go together with `sigma_s_prime`")),
        (None, None) => return Err(item.error("has `sigma_a`, but no `sigma_s_prime` (or `sigma_s` and `g`)")),
    };
    Ok((sigma_s_prime * factor, sigma_a * factor))
}

fn read_albedo(item: &Item, albedo: &Item) -> Result<Appearance> {
    let factor = read_unit(item, false)?;
    let (length, kind) = match (item.get("mean_free_path")?, item.get("diffuse_mean_free_path")?) {
        (Some(length), None) => (length, LengthKind::MeanFreePath),
        (None, Some(length)) => (length, LengthKind::DiffuseMeanFreePath),
        (Some(_), Some(other)) => return Err(other.error("does not go together with `mean_free_path`")),
        (None, None) => return Err(item.error("has `albedo`, but no `mean_free_path` or `diffuse_mean_free_path`")),
    };
    let albedos = albedo.channels_within(0.0, 1.0)?;
    let lengths = length.channels_within(0.0, LENGTH_RANGE.1)? * factor;
    if lengths.min_element() < LENGTH_RANGE.0 {
        return Err(length.error(format!("must be at least {} m", LENGTH_RANGE.0)));
    }
    Ok(Appearance { albedo: albedos, length: lengths, kind })
}

/// Either draft of the scattering extension, over KHR_materials_volume.
fn read_scattering(
    material: &Item,
    item: &Item,
    mapping: Mapping,
    warnings: &mut Vec<String>,
) -> Result<Option<Medium>> {
    let (name, default_color) = match mapping {
        Mapping::Scatter => ("KHR_materials_scatter", DVec3::ONE),
        Mapping::VolumeScatter => ("KHR_materials_volume_scatter", DVec3::ZERO),
    };
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
    for texture in ["multiscatterColorTexture", "scatterStrengthTexture", "scatterTexture"] {
        if let Some(texture) = item.get(texture)? {
            warnings.push(texture.note("textures are not modelled; the factor alone is used"));
        }
    }
    let sigma_t = read_extinction(material, warnings)?;
    let nothing = |reason: &str| item.note(format!("{reason}, so nothing scatters; the material is taken as opaque"));
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
    let (sigma_s_prime, sigma_a) =
        medium::channels(|channel| Ok(mapping.coefficients(sigma_t[channel], rho[channel], g[channel])))?;
    Ok(Some(Medium { sigma_s_prime, sigma_a, g, appearance: None, model: None, source: name.into() }))
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

fn warn_of_clear_matter(material: &Item, warnings: &mut Vec<String>) -> Result<()> {
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
