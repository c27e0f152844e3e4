//! What sets of surfaces need: the spheres that their bodies are locally like, and the media that they mix.

use crate::{
    curvature,
    error::{Error, Result},
    model::Advice,
    reference::profile::{Coefficients, Matter, table::Local},
    scene::{Medium, Scene, Set},
    settings::{Model, Settings},
    shared::{Balance, MAX_MEMBERS, MODEL_TABLE, Material, Mixture, TABLE_NODES},
};
use glam::Vec3;

/// Whether a set holds several materials.
pub(super) fn is_mixed(set: &Set) -> bool {
    set.materials.len() > 1
}

/// The media of each set, if one holds several materials. A medium that several materials have counts once.
///
/// # Errors
/// If a set has more than [`MAX_MEMBERS`].
pub(super) fn mixtures(scene: &Scene, materials: &[Material]) -> Result<Vec<Mixture>> {
    if !scene.sets.iter().any(is_mixed) {
        return Ok(vec![]);
    }
    let mixture = |set: &Set| {
        let mut members: Vec<usize> = Vec::new();
        for &index in set.materials.iter().filter(|&&index| materials[index].component_cdf[8] > 0.0) {
            if !members.iter().any(|&member| same_medium(scene, materials, member, index)) {
                members.push(index);
            }
        }
        if members.len() > MAX_MEMBERS as usize {
            let problem = format!("holds {} media; light is exchanged between {MAX_MEMBERS} at most", members.len());
            return Err(Error::scene(&scene.file, format!("set `{}`", set.name), problem));
        }
        let each = || members.iter().map(|&member| &materials[member]);
        let mut out = Mixture {
            count: members.len() as u32,
            radius_max: each().map(|m| m.radius_max).fold(0.0, f32::max),
            camera_rate: each().map(|m| m.camera_rate).reduce(f32::min).unwrap_or(0.0),
            ..Mixture::default()
        };
        for (place, member) in out.members.iter_mut().zip(members) {
            *place = member as u32;
        }
        Ok(out)
    };
    scene.sets.iter().map(mixture).collect()
}

/// Whether radii in two materials have the same density.
fn same_medium(scene: &Scene, materials: &[Material], a: usize, b: usize) -> bool {
    let coefficients = |index: usize| {
        let medium = scene.materials[index].medium.as_ref()?;
        Some((medium.sigma_s_prime, medium.sigma_a, medium.g, medium.appearance))
    };
    let kernel = |index: usize| (materials[index].model, materials[index].boundary);
    coefficients(a) == coefficients(b) && kernel(a) == kernel(b)
}

/// Curvatures at the vertices of the triangles, if a material has the table model and settings ask for them.
pub(super) fn thickness(scene: &Scene, settings: &Settings, advice: &[Option<Advice>]) -> Vec<Vec3> {
    let tabulated = |m: &usize| advice[*m].as_ref().is_some_and(|a| a.choice.model == Model::Table);
    // Where a set holds several media, the first one's light says how far to look around.
    let length = |set: &Set| {
        let medium = scene.materials[set.materials.iter().copied().find(tabulated)?].medium.as_ref()?;
        Some(curvature::reach(diffuse_mean_free_path(medium), reduced_mean_free_path(medium)) * scene.frame.scale)
    };
    let lengths: Vec<Option<f64>> = scene.sets.iter().map(length).collect();
    let wanted = settings.curvature && lengths.iter().any(Option::is_some);
    if wanted { curvature::inverse_radii(&scene.triangles, &lengths) } else { vec![] }
}

/// Balances of every set for each of its materials that has the table model, and where each material finds its own: those
/// of one set lie apart.
pub(super) fn balances(
    scene: &Scene,
    materials: &mut [Material],
    profiles: &[Vec3],
    thickness: &[Vec3],
) -> Vec<Balance> {
    if thickness.is_empty() {
        return vec![];
    }
    let count = scene.triangles.len();
    let even: Vec<Balance> = thickness.iter().map(|&curvature| Balance { at: [Vec3::ONE; 3], curvature }).collect();
    let mut places: Vec<Option<usize>> = vec![None; scene.materials.len()];
    let mut all = even.clone();
    for index in 0..scene.materials.len() {
        if materials[index].model != MODEL_TABLE {
            continue;
        }
        let with = || scene.sets.iter().enumerate().filter(|(_, set)| set.materials.contains(&index));
        let taken: Vec<usize> = with().flat_map(|(_, set)| set.materials.iter().filter_map(|&m| places[m])).collect();
        let place = (0..).find(|place| !taken.contains(place)).expect("a number that is free");
        places[index] = Some(place);
        materials[index].balance = (place * count) as u32;
        if all.len() == place * count {
            all.extend_from_slice(&even);
        }
        let Some(medium) = &scene.materials[index].medium else { continue };
        let length = diffuse_mean_free_path(medium) * scene.frame.scale;
        let material = &materials[index];
        let local = |curvature: f64| Local::new(Matter { material, tables: profiles, curvature });
        for (number, set) in with() {
            let own: Vec<usize> = (0..count).filter(|&t| scene.triangles[t].set as usize == number).collect();
            let corners: Vec<_> = own.iter().map(|&t| curvature::corners(&scene.triangles[t])).collect();
            let curvatures: Vec<Vec3> = own.iter().map(|&t| thickness[t]).collect();
            let found = curvature::balance::of_mesh(&corners, &curvatures, set.open_edges > 0, length, local);
            for (triangle, at) in own.into_iter().zip(found) {
                all[place * count + triangle].at = at;
            }
        }
    }
    all
}

/// 1 / sigma_tr (m), the geometric mean of the channels that scatter and absorb; infinite where none does.
fn diffuse_mean_free_path(medium: &Medium) -> f64 {
    mean_length([0, 1, 2].map(|c| {
        let (scattering, absorption) = (medium.sigma_s_prime[c], medium.sigma_a[c]);
        if scattering > 0.0 { (3.0 * absorption * (scattering + absorption)).sqrt() } else { 0.0 }
    }))
}

/// 1 / sigma_t' (m), the geometric mean of the channels that scatter; infinite where none does.
fn reduced_mean_free_path(medium: &Medium) -> f64 {
    mean_length([0, 1, 2].map(|c| {
        let (scattering, absorption) = (medium.sigma_s_prime[c], medium.sigma_a[c]);
        if scattering > 0.0 { scattering + absorption } else { 0.0 }
    }))
}

/// 1 over the geometric mean of the rates that are not 0.
fn mean_length(rates: [f64; 3]) -> f64 {
    let logarithms: Vec<f64> = rates.into_iter().filter(|&rate| rate > 0.0).map(f64::ln).collect();
    if logarithms.is_empty() {
        return f64::INFINITY;
    }
    (-logarithms.iter().sum::<f64>() / logarithms.len() as f64).exp()
}

/// Radii 2^(i/2 - 1) of the spheres between which a material's profiles are interpolated: those around the curvatures of
/// the scene, up to 128 mean free paths, beyond which the half-space is next.
pub(super) fn spheres(thickness: &[Vec3], channels: &[Coefficients; 3]) -> Vec<i32> {
    let all = || thickness.iter().flat_map(|c| c.to_array()).filter(|&c| c > 0.0).map(f64::from);
    let (Some(least), Some(most)) = (all().reduce(f64::min), all().reduce(f64::max)) else { return vec![] };
    let longest = channels.iter().filter(|c| c.sigma_s_prime > 0.0).map(|c| 1.0 / c.sigma_s_prime).fold(0.0, f64::max);
    if longest == 0.0 {
        return vec![];
    }
    let number = |radius: f64| 2.0 * (2.0 * radius).log2();
    let last = number((1.0 / least).min(128.0 * longest)).ceil() as i32;
    let first = number(1.0 / most).floor() as i32;
    // Bodies thinner than the first are interpolated as it is.
    (first.max(last - (TABLE_NODES as i32 - 2))..=last).collect()
}
