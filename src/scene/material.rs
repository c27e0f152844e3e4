//! Materials of a glTF file: surface factors, and the medium from presets, extras or extensions.

use super::frame::INTENSITY_MAX;
use super::json::Item;
use super::medium::{self, Mapping};
use super::presets::{Preset, preset};
use super::scattering::{Authored, warn_of_clear_matter};
use super::texture::Textures;
use super::unit::metres;
use super::{Appearance, LengthKind, LoadOptions, Material, Medium, Texture};
use crate::shared::{
    RAMP, TEXTURE_ALPHA, TEXTURE_BASE_COLOR, TEXTURE_EMISSION, TEXTURE_METALLIC_ROUGHNESS, TEXTURE_NORMAL,
    TEXTURE_SCATTER_COLOR, TEXTURE_SCATTER_STRENGTH,
};
use crate::{
    Error, Result,
    settings::{Directional, Model, SingleScattering},
};
use glam::DVec3;
use std::path::Path;

/// glTF's index of refraction where a material names none.
pub(super) const DEFAULT_IOR: f64 = 1.5;
/// Indices of refraction within which the Fresnel moments keep their digits.
pub(super) const IOR_RANGE: (f64, f64) = (0.1, 10.0);
/// Longest mean free path (m) and largest coefficient [1/m]: beyond, f32 kernels cannot hold the numbers.
const COEFFICIENT_MAX: f64 = 1e12;
pub(super) const LENGTH_RANGE: (f64, f64) = (1e-12, 1e12);

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
    "renormalise",
    "reciprocal",
    "kappa",
    "single_scattering",
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

/// Reads `materials[index]`. The medium is the first of: a preset among the options for the material's name,
/// `extras.bssrdf`, KHR_materials_scatter, KHR_materials_volume_scatter, none.
pub(super) fn read<'a>(
    item: &Item<'a>,
    index: usize,
    textures: &Textures<'a>,
    options: &LoadOptions,
    warnings: &mut Vec<String>,
) -> Result<Material> {
    let name = item.name()?.unwrap_or_else(|| format!("material {index}"));
    let mut material = Material { name, ..Material::default() };
    read_surface(item, textures, &mut material, warnings)?;
    let authored_ior = read_ior(item, warnings)?;
    material.ior = authored_ior.unwrap_or(DEFAULT_IOR);

    let chosen = options.materials.iter().rev().find(|(name, _)| *name == material.name);
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
        read_scattering(item, &scatter, Mapping::Scatter, textures, options, &mut material, warnings)?;
    } else if let Some(scatter) = volume_scatter {
        read_scattering(item, &scatter, Mapping::VolumeScatter, textures, options, &mut material, warnings)?;
    } else {
        warn_of_clear_matter(item, warnings)?;
    }
    if let Some(medium) = &material.medium {
        warn_of_absorption(item, medium, warnings);
        if !material.tinted && material.textures[TEXTURE_BASE_COLOR as usize].take().is_some() {
            let source = &medium.source;
            warnings.push(
                item.note(format!(
                    "{source} brings the colour of the matter; the texture of the base colour is not used"
                )),
            );
        }
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

/// A medium from either draft of the scattering extension, and its ramp where textures scale its colour.
fn read_scattering<'a>(
    item: &Item<'a>,
    scatter: &Item<'a>,
    mapping: Mapping,
    textures: &Textures<'a>,
    options: &LoadOptions,
    material: &mut Material,
    warnings: &mut Vec<String>,
) -> Result<()> {
    let color = textures.read(scatter, "multiscatterColorTexture")?;
    let mut strength = None;
    if mapping == Mapping::Scatter {
        let first = textures.read(scatter, "scatterStrengthTexture")?;
        strength = first.or(textures.read(scatter, "scatterTexture")?);
    }
    let authored = Authored::read(item, scatter, mapping, warnings)?;
    let Some(authored) = authored else { return Ok(()) };
    let media = |share: f64| authored.medium(share, material.ior, options.albedo_mapping);
    material.medium = Some(media(1.0));
    material.tinted = true;
    if color.is_some() || strength.is_some() {
        material.ramp = (0..=RAMP).map(|node| media(f64::from(node) / f64::from(RAMP))).collect();
    }
    material.textures[TEXTURE_SCATTER_COLOR as usize] = color;
    material.textures[TEXTURE_SCATTER_STRENGTH as usize] = strength;
    Ok(())
}

fn read_surface<'a>(
    item: &Item<'a>,
    textures: &Textures<'a>,
    material: &mut Material,
    warnings: &mut Vec<String>,
) -> Result<()> {
    let mut alpha = 1.0;
    if let Some(pbr) = item.get("pbrMetallicRoughness")? {
        if let Some(factor) = pbr.get("baseColorFactor")? {
            let [r, g, b, a] = factor.numbers_within(0.0, 1.0)?;
            material.base_color = DVec3::new(r, g, b);
            alpha = a;
        }
        material.metallic = pbr.get("metallicFactor")?.map_or(Ok(1.0), |factor| factor.within(0.0, 1.0))?;
        material.roughness = pbr.get("roughnessFactor")?.map_or(Ok(1.0), |factor| factor.within(0.0, 1.0))?;
        material.textures[TEXTURE_BASE_COLOR as usize] = textures.read(&pbr, "baseColorTexture")?;
        material.textures[TEXTURE_METALLIC_ROUGHNESS as usize] = textures.read(&pbr, "metallicRoughnessTexture")?;
    }
    material.textures[TEXTURE_NORMAL as usize] = textures.read(item, "normalTexture")?;
    material.textures[TEXTURE_EMISSION as usize] = textures.read(item, "emissiveTexture")?;
    if let Some(occlusion) = item.get("occlusionTexture")? {
        warnings.push(occlusion.note("shadows are traced; the texture is not used"));
    }
    for (extension, texture) in [
        ("KHR_materials_transmission", "transmissionTexture"),
        ("KHR_materials_diffuse_transmission", "diffuseTransmissionTexture"),
        ("KHR_materials_diffuse_transmission", "diffuseTransmissionColorTexture"),
    ] {
        if let Some(texture) = item.find(&["extensions", extension, texture])? {
            warnings.push(texture.note("this texture is not modelled; the factor alone is used"));
        }
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
            "MASK" => read_mask(item, alpha, material)?,
            "BLEND" => {
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

/// The cutoff of a mask: a surface is where factor x texture is at least that.
fn read_mask(item: &Item, factor: f64, material: &mut Material) -> Result<()> {
    let cutoff = item.get("alphaCutoff")?.map_or(Ok(0.5), |cutoff| cutoff.within(0.0, f64::INFINITY))?;
    match &material.textures[TEXTURE_BASE_COLOR as usize] {
        Some(texture) if factor > 0.0 && cutoff > 0.0 => {
            // Numbers that f32 holds; no alpha of a byte lies beyond them.
            let scale = (factor / cutoff).clamp(1e-9, 1e9);
            material.textures[TEXTURE_ALPHA as usize] = Some(Texture { scale, ..*texture });
        }
        _ => material.hidden = factor < cutoff,
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
pub(super) fn medium_of(preset: &Preset) -> Medium {
    Medium {
        sigma_s_prime: preset.sigma_s_prime * 1e3,
        sigma_a: preset.sigma_a * 1e3,
        g: preset.g,
        appearance: None,
        model: None,
        directional: None,
        single_scattering: SingleScattering::Auto,
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
        let source = "extras.bssrdf".into();
        let single_scattering = SingleScattering::Auto;
        material.medium = Some(Medium {
            sigma_s_prime,
            sigma_a,
            g,
            appearance,
            model: None,
            directional: None,
            single_scattering,
            source,
        });
    }

    if let Some(model) = item.get("model")? {
        let chosen: Model =
            super::json::shorten(model.string()?).parse().map_err(|problem: String| model.error(problem))?;
        if let Some(medium) = &mut material.medium {
            medium.model = Some(chosen);
        }
    }
    if let Some(medium) = &mut material.medium {
        medium.directional = read_directional(item)?;
    }
    if let Some(single) = item.get("single_scattering")? {
        let chosen = super::json::shorten(single.string()?).parse().map_err(|problem: String| single.error(problem))?;
        if let Some(medium) = &mut material.medium {
            medium.single_scattering = chosen;
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

/// `renormalise` and `reciprocal` (true or false) and `kappa` of the directional dipole; those left out are the defaults,
/// and nothing without any.
fn read_directional(item: &Item) -> Result<Option<Directional>> {
    let [renormalise, reciprocal, kappa] = ["renormalise", "reciprocal", "kappa"].map(|key| item.get(key));
    let (renormalise, reciprocal, kappa) = (renormalise?, reciprocal?, kappa?);
    if renormalise.is_none() && reciprocal.is_none() && kappa.is_none() {
        return Ok(None);
    }
    let default = Directional::default();
    Ok(Some(Directional {
        renormalise: renormalise.map_or(Ok(default.renormalise), |item| item.boolean())?,
        reciprocal: reciprocal.map_or(Ok(default.reciprocal), |item| item.boolean())?,
        kappa: kappa.map_or(Ok(default.kappa), |item| item.within(0.0, Directional::KAPPA_MAX))?,
    }))
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
pub(super) fn read_g(item: &Item) -> Result<DVec3> {
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
