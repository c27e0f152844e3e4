//! Materials as kernels read them, with all that their matter brings: profiles, rough boundaries, curvatures, mixtures.

use super::{Before, Prepared, cloud, kept, sets};
use crate::{
    cache::Cache,
    error::{Error, Result},
    model::{self, Advice, Choice},
    reference::{
        boundary::Side,
        profile::{self, Coefficients, Dipole, Radial, lambert},
        rough::Boundaries,
        single::Scattering,
        texture,
    },
    scene::{self, Frame, Medium, Scene},
    settings::{Integrator, Model, Projection, Settings},
    shared::{self, Balance, Cluster, Material, Mixture, TWO_SIDED},
};
use glam::{DVec3, Vec3};

/// What the materials of a scene become; the fields are those of [`Prepared`].
pub(super) struct Matter {
    pub materials: Vec<Material>,
    pub profiles: Vec<Vec3>,
    pub boundaries: Vec<f32>,
    /// [`Features::rough`](shared::Features::rough).
    pub rough_rows: u32,
    pub balances: Vec<Balance>,
    pub mixtures: Vec<Mixture>,
    pub clusters: Vec<Cluster>,
    pub cache: Cache,
}

impl Matter {
    pub fn new(scene: &Scene, settings: &Settings, advice: &[Option<Advice>]) -> Result<Matter> {
        let thickness = sets::thickness(scene, settings, advice);
        let (mut profiles, mut boundaries) = (vec![], boundaries(scene, settings));
        let mut materials = materials(scene, settings, advice, &thickness, &mut profiles, &mut boundaries)?;
        let balances = sets::balances(scene, &mut materials, &profiles, &thickness);
        let mixtures = sets::mixtures(scene, &materials)?;
        let clusters = match settings.integrator {
            Integrator::Cloud => cloud::clusters(scene, settings, &mut materials, &profiles, &thickness)?,
            _ => vec![],
        };
        let cache = kept::points(scene, settings, &materials)?;
        let rough_rows = boundaries.feature();
        let boundaries = boundaries.values;
        Ok(Matter { materials, profiles, boundaries, rough_rows, balances, mixtures, clusters, cache })
    }

    /// The same as before.
    pub fn of(prepared: &Prepared) -> Matter {
        Matter {
            materials: prepared.materials.clone(),
            profiles: prepared.profiles.clone(),
            boundaries: prepared.boundaries.clone(),
            rough_rows: prepared.features.rough,
            balances: prepared.balances.clone(),
            mixtures: prepared.mixtures.clone(),
            clusters: prepared.clusters.clone(),
            cache: prepared.cache.clone(),
        }
    }
}

impl Before<'_> {
    /// Whether its materials are those of `scene`, under the same models.
    pub(super) fn has(&self, scene: &Scene, advice: &[Option<Advice>]) -> bool {
        let choices = |advice: &[Option<Advice>]| -> Vec<_> {
            advice.iter().map(|advice| advice.as_ref().map(|a| (a.choice.model, a.choice.limit_of))).collect()
        };
        self.authored == scene.materials && choices(&self.prepared.advice) == choices(advice)
    }
}

/// Mean free paths that kernels resolve [internal units]. Below, the rounding of positions would move a hit by more than
/// the profile is wide; above, its cubes leave f32. Matter outside is taken as one inside with the same albedo: its light
/// moves by less than 1e-4 of the radius, or is as good as lost.
const MEAN_FREE_PATH: (f64, f64) = (1.0 / (1 << 17) as f64, 1e9);

/// No rough boundary yet; a row for each step of the roughness where a texture changes that of translucent matter.
fn boundaries(scene: &Scene, settings: &Settings) -> Boundaries {
    let textured = |m: &scene::Material| {
        m.medium.is_some() && m.roughness > 0.0 && m.textures[shared::TEXTURE_METALLIC_ROUGHNESS as usize].is_some()
    };
    Boundaries::new(scene.materials.iter().any(textured), settings.normalisation)
}

/// Channel `c` of a medium in internal units, of which a metre has `scale`, with a mean free path that kernels resolve.
fn coefficients(medium: &Medium, ior: f64, scale: f64, c: usize) -> Coefficients {
    let authored = Coefficients::of(medium, ior, c).in_units(scale);
    let extinction = authored.sigma_s_prime + authored.sigma_a;
    let kept = extinction.clamp(1.0 / MEAN_FREE_PATH.1, 1.0 / MEAN_FREE_PATH.0);
    if extinction > 0.0 { authored.in_units(extinction / kept) } else { authored }
}

/// Materials in the scene's order, then the ramps of those that have one.
fn materials(
    scene: &Scene,
    settings: &Settings,
    advice: &[Option<Advice>],
    thickness: &[Vec3],
    profiles: &mut Vec<Vec3>,
    boundaries: &mut Boundaries,
) -> Result<Vec<Material>> {
    let mixed = scene.sets.iter().any(sets::is_mixed);
    let common = Common { frame: scene.frame, settings, thickness, mixed };
    let choice = |advice: &'_ Option<Advice>| advice.as_ref().map(|advice| advice.choice.clone());
    let mut each =
        |(m, advice): (&scene::Material, &Option<Advice>)| material(m, choice(advice), common, profiles, boundaries);
    let mut out = scene.materials.iter().zip(advice).map(&mut each).collect::<Result<Vec<_>>>()?;
    for (index, authored) in scene.materials.iter().enumerate().filter(|(_, authored)| !authored.ramp.is_empty()) {
        out[index].ramp = out.len() as u32;
        let whole = out[index];
        let choice = choice(&advice[index]);
        if choice.as_ref().is_some_and(|choice| choice.limit_of == Model::Table) {
            out.extend(totals(authored).map(|total| Material { strength: whole.strength * total, ..whole }));
            continue;
        }
        let first = out.len();
        for medium in &authored.ramp {
            let node = scene::Material { medium: Some(medium.clone()), ..authored.clone() };
            out.push(each((&node, &advice[index]))?);
        }
        // Black matter has no lengths of its own.
        let mut next = out[first + 1];
        let black = &mut out[first];
        for c in 0..3 {
            if black.strength[c] == 0.0 {
                texture::medium_fields().iter().for_each(|field| field(black)[c] = field(&mut next)[c]);
                (black.strength[c], black.beam[c]) = (0.0, 0.0);
            }
        }
    }
    Ok(out)
}

/// The material number `index` with other parameters, where the same kernels and buffers do for it.
pub(crate) fn replaced(
    prepared: &Prepared,
    settings: &Settings,
    frame: Frame,
    index: usize,
    old: &scene::Material,
    new: &scene::Material,
) -> Result<Material> {
    let refuse = |problem: &str| {
        Err(Error::setting(format!("material `{}`", new.name), format!("{problem}: update the scene instead")))
    };
    let of = |m: &scene::Material| (m.medium.is_some(), m.two_sided, m.hidden, m.tinted, m.set.clone(), m.emission);
    scene::check_material(new)?;
    let choice = prepared.advice[index].as_ref().map(|advice| advice.choice.clone());
    let translucent = new.medium.is_some();
    if of(old) != of(new) || old.textures != new.textures || !old.ramp.is_empty() {
        return refuse("another kind of matter, emission, texture or set is more than one material's numbers");
    }
    if choice.as_ref().is_some_and(|choice| choice.limit_of == Model::Table) {
        return refuse("the table model's profile is made for its matter");
    }
    if translucent && !prepared.clusters.is_empty() {
        return refuse("the cloud's near masses are made for its matter");
    }
    if translucent && prepared.features.mixtures != 0 {
        return refuse("its medium is one of several that exchange light");
    }
    let same_boundary = old.roughness == new.roughness && (old.ior == new.ior || old.roughness == 0.0);
    if translucent && !same_boundary || (old.roughness > 0.0) != (new.roughness > 0.0) {
        return refuse("another rough boundary needs another table");
    }
    let mut boundaries = Boundaries::new(false, settings.normalisation);
    let common = Common { frame, settings, thickness: &[], mixed: false };
    let mut made = material(new, choice, common, &mut vec![], &mut boundaries)?;
    // The same roughness and index have the same table.
    let before = &prepared.materials[index];
    made.boundary = before.boundary;
    if made.scattering != Vec3::ZERO && !prepared.has_single {
        return refuse("light scattered once needs a kernel that is not there");
    }
    Ok(made)
}

/// Totals along a ramp over that at its end. A tabulated profile keeps its shape there: one for each share of the colour
/// would have to be simulated; its total falls as that of the standard dipole.
fn totals(authored: &scene::Material) -> impl Iterator<Item = Vec3> {
    let total = |medium: &Medium| {
        DVec3::from([0, 1, 2].map(|c| {
            let Coefficients { sigma_s_prime, sigma_a, ior, .. } = Coefficients::of(medium, authored.ior, c);
            Dipole::new(sigma_s_prime, sigma_a, ior).total()
        }))
    };
    let end = authored.ramp.last().map_or(DVec3::ONE, total);
    authored.ramp.iter().map(move |medium| {
        let share = total(medium) / end;
        DVec3::select(end.cmpgt(DVec3::ZERO), share, DVec3::ZERO).as_vec3()
    })
}

/// What all materials of a scene are made with.
#[derive(Clone, Copy)]
struct Common<'a> {
    frame: Frame,
    settings: &'a Settings,
    thickness: &'a [Vec3],
    /// Whether a set holds several materials.
    mixed: bool,
}

fn material(
    material: &scene::Material,
    choice: Option<Choice>,
    Common { frame, settings, thickness, mixed }: Common,
    profiles: &mut Vec<Vec3>,
    boundaries: &mut Boundaries,
) -> Result<Material> {
    let alpha = material.roughness * material.roughness;
    let alpha = if alpha < f64::from(shared::MIRROR_ALPHA) { 0.0 } else { alpha as f32 };
    let mut out = match material.medium.as_ref().zip(choice) {
        None => Material::default(),
        Some((medium, choice)) => {
            let constant = |model: Model| profile::constant(model).expect("a choice is a built model");
            let rough = (alpha > 0.0).then(|| boundaries.add(alpha.into(), material.ior));
            let coefficients = [0, 1, 2].map(|c| Coefficients {
                rough: rough.map(|(_, rough)| rough),
                ..coefficients(medium, material.ior, frame.scale, c)
            });
            let options = profile::Options {
                normalisation: settings.normalisation,
                radius_tail: settings.radius_tail,
                directional: settings.directional.or(medium.directional).unwrap_or_default(),
                precision: settings.precision,
            };
            let mut out = match choice.model {
                Model::Table => {
                    profile::tabulated(&coefficients, options, &sets::spheres(thickness, &coefficients), profiles)
                }
                Model::Lambert => lambert::limit(constant(choice.limit_of), &coefficients, options),
                model => profile::material(constant(model), &coefficients, options),
            };
            out.radius_max = out.radius_max.min(profile::SET_DIAMETER);
            out.boundary = rough.map_or(0, |(table, _)| table);
            if mixed {
                // What belongs to the exit is another material's, there.
                let leaving = options.leaving(coefficients[0].diffuse_reflectance(Side::Outside)) as f32;
                out.strength *= leaving;
                out.beam *= leaving;
                out.exit = Vec3::splat(1.0 / leaving);
            }
            if model::adds_single_scattering(settings, medium, choice.model) {
                let vector = |value: fn(&Coefficients) -> f64| glam::DVec3::from(coefficients.each_ref().map(value));
                let scattering = Scattering::new(vector(|c| c.sigma_s_prime), vector(|c| c.sigma_a), vector(|c| c.g));
                out.extinction = scattering.extinction.as_vec3();
                out.scattering = scattering.scattering.as_vec3();
                out.g = scattering.g.as_vec3();
            }
            if settings.projection == Projection::Camera && out.component_cdf[8] > 0.0 && out.camera_rate <= 0.0 {
                let problem = format!(
                    "camera needs sigma_tr > 0 in every channel, but material \"{}\" ({}) absorbs nothing in one; use mis or normal",
                    material.name, medium.source
                );
                return Err(Error::setting("projection", problem));
            }
            out
        }
    };
    if material.tinted {
        // Light is tinted where it enters and where it leaves.
        let twice = (material.base_color * material.base_color).as_vec3();
        let tint = if mixed { material.base_color.as_vec3() } else { twice };
        out.strength *= tint;
        out.beam *= tint;
        out.exit *= material.base_color.as_vec3();
        out.scattering *= twice;
    }
    out.ior = material.ior as f32;
    out.alpha = alpha;
    out.base_color = material.base_color.as_vec3();
    out.metallic = material.metallic as f32;
    out.emission = material.emission.as_vec3();
    if material.two_sided {
        out.flags |= TWO_SIDED;
    }
    Ok(out)
}
