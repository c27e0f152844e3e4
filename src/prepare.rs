//! A scene and settings become what kernels read: f64 metres in, shared structs in internal units out.

mod cloud;
mod host;
mod kept;
mod matter;
mod sets;

pub(crate) use matter::replaced;

use matter::Matter;

use crate::{
    cache::Cache,
    error::{Error, Result},
    model::{self, Advice, Detail},
    reference::{Inputs, emitter, light, texture},
    scene::{self, Camera, EnvironmentMap, Frame, Lens, LightKind, Scene, Wrap},
    settings::{Directional, Integrator, Projection, Reproject, Settings},
    shared::{
        self, Balance, Cluster, Coordinates, Emitter, Features, Light, MODEL_LAMBERT, Material, Mixture, Shading,
        TRANSLUCENT, Texture, Triangle, View,
    },
};
use glam::Vec3;

/// Everything that kernels read and that a scene and its settings determine, but for the geometry.
#[derive(Clone, Debug)]
pub struct Prepared {
    pub features: Features,
    pub view: View,
    pub materials: Vec<Material>,
    pub lights: Vec<Light>,
    pub emitters: Vec<Emitter>,
    /// Tables of rough boundaries.
    pub boundaries: Vec<f32>,
    pub environment: Vec<Vec3>,
    pub environment_cdf: Vec<f32>,
    /// Texels and textures as their slots hold them; none without textures.
    pub texels: Vec<u32>,
    pub textures: Vec<Texture>,
    /// Tabulated profiles, none without the table model.
    pub profiles: Vec<Vec3>,
    /// Balances of profiles and triangles, none where no profile depends on curvatures.
    pub balances: Vec<Balance>,
    /// Media of each set, none where no set holds several materials.
    pub mixtures: Vec<Mixture>,
    /// The cloud's tree, not lit yet; none without light that is gathered.
    pub clusters: Vec<Cluster>,
    /// Points whose light is kept, not lit yet, and room for those that come; none where shadow rays find the light.
    pub cache: Cache,
    /// The model of each material and why it; none for opaque ones.
    pub advice: Vec<Option<Advice>>,
    /// The camera that looks, for what is said about the image.
    pub camera: Camera,
    /// Rows that are rendered: from the first, exclusive of the last.
    pub rows: std::ops::Range<u32>,
    /// The part of the image that is asked for: x0, y0, x1, y1, exclusive of x1 and y1.
    pub shown: [u32; 4],
    /// Whether any material that is shown scatters light: otherwise `accumulate` does not run.
    pub has_translucent: bool,
    /// Whether any of those is not in the opaque limit: otherwise `sample` and `reproject` do not run either.
    pub has_probes: bool,
    /// Whether the light that comes out of matter is computed on the host; [`Integrator::is_on_host`].
    pub on_host: bool,
    /// Whether light that was scattered once is added to a material's.
    pub has_single: bool,
    /// Whether light can leave a first surface without having entered it, or the environment is shown: otherwise
    /// `reflect` does not run.
    pub has_reflection: bool,
    /// Shadow rays of one position: one for each delta light, N directions if there is an environment or an emitter.
    pub ray_count: u32,
}

impl Prepared {
    /// What a user should know of the models that were chosen.
    pub fn warnings(&self) -> impl Iterator<Item = String> {
        self.advice.iter().flatten().flat_map(|advice| advice.warnings.clone())
    }

    /// The buffers as the twins read them.
    pub fn inputs<'a>(&'a self, scene: &'a Scene) -> Inputs<'a> {
        self.inputs_of(&scene.triangles, &scene.shadings, &scene.coordinates)
    }

    /// The same with the scene's geometry alone.
    pub(crate) fn inputs_of<'a>(
        &'a self,
        triangles: &'a [Triangle],
        shadings: &'a [Shading],
        coordinates: &'a [Coordinates],
    ) -> Inputs<'a> {
        Inputs {
            features: self.features,
            view: &self.view,
            triangles,
            shadings,
            materials: &self.materials,
            lights: &self.lights,
            emitters: &self.emitters,
            boundaries: &self.boundaries,
            environment: &self.environment,
            environment_cdf: &self.environment_cdf,
            texels: &self.texels,
            textures: &self.textures,
            coordinates,
            profiles: &self.profiles,
            balances: &self.balances,
            mixtures: &self.mixtures,
            kept: &self.cache.points,
            lattices: &self.cache.lattices,
            tree: None,
        }
    }
}

/// Width and height of the full image that `settings` ask for.
pub fn resolution(scene: &Scene, settings: &Settings) -> Result<(u32, u32)> {
    let (width, height) = match settings.resolution {
        Some(resolution) => resolution,
        None => {
            let camera = scene.camera(&settings.camera, 1.0)?;
            let aspect = match camera.lens {
                Lens::Perspective { aspect, .. } => aspect.unwrap_or(1.0),
                Lens::Orthographic { xmag, ymag } => xmag / ymag,
            };
            (((1024.0 * aspect).round()).clamp(1.0, MAX_SIDE as f64) as u32, 1024)
        }
    };
    if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE {
        return Err(Error::setting(
            "resolution",
            format!("{width}x{height} is not between 1x1 and {MAX_SIDE}x{MAX_SIDE}"),
        ));
    }
    Ok((width, height))
}

/// Longest side of an image (pixels).
pub const MAX_SIDE: u32 = 65_536;

/// Checks the settings against the scene and fills the shared structs.
///
/// Fails with [`Error::Setting`] if the resolution, crop, camera, directions, projection or environment cannot be had,
/// and for materials, lights or cameras that a caller put into the scene and that are none.
pub fn prepare(scene: &Scene, settings: &Settings) -> Result<Prepared> {
    prepare_again(scene, settings, None)
}

/// What was made of a scene's materials before they changed.
#[derive(Clone, Copy)]
pub(crate) struct Before<'a> {
    pub prepared: &'a Prepared,
    pub authored: &'a [scene::Material],
}

/// As [`prepare`], for the same geometry and settings as before. The models of materials stay as they were chosen,
/// unless settings or materials ask for one; of the same materials nothing is made anew.
pub(crate) fn prepare_again(scene: &Scene, settings: &Settings, before: Option<Before>) -> Result<Prepared> {
    scene::check_scene(scene)?;
    host::check(scene, settings)?;
    let settings = &host::effective(settings);
    let (width, height) = resolution(scene, settings)?;
    let [x0, y0, x1, y1] = settings.crop.unwrap_or([0, 0, width, height]);
    if x0 >= x1 || y0 >= y1 || x1 > width || y1 > height {
        let problem = format!("{x0},{y0},{x1},{y1} is not a part of {width}x{height} pixels");
        return Err(Error::setting("crop", problem));
    }
    if let Some(width) = settings.reuse
        && ![1, 2, 4, 8].contains(&width)
    {
        return Err(Error::setting("reuse", format!("{width} is not 1, 2, 4 or 8")));
    }
    let looks_up = settings.reproject == Reproject::Screen;
    if looks_up && settings.integrator != Integrator::Sample {
        let problem = format!("is for the probes of the integrator sample; {} has none", settings.integrator);
        return Err(Error::setting("reproject screen", problem));
    }
    if looks_up && settings.projection == Projection::Normal {
        let problem = "knows what camera rays meet; the projection normal needs others: use mis or camera";
        return Err(Error::setting("reproject screen", problem));
    }
    if !(1..=65_536).contains(&settings.directions) {
        return Err(Error::setting("directions", format!("{} is not between 1 and 65536", settings.directions)));
    }
    if let Some(Directional { kappa, .. }) = settings.directional
        && !(0.0..=Directional::KAPPA_MAX).contains(&kappa)
    {
        return Err(Error::setting("kappa", format!("{kappa} is not in [0, {}]", Directional::KAPPA_MAX)));
    }
    if !(settings.radius_tail >= 0.0 && settings.radius_tail < 0.1) {
        return Err(Error::setting("radius tail", format!("{} is not in [0, 0.1)", settings.radius_tail)));
    }

    let frame = scene.frame;
    let camera = scene.camera(&settings.camera, f64::from(width) / f64::from(height))?;
    let details = Detail::of(scene, &camera, height);
    let made = |index: usize| Some(&before?.prepared.advice.get(index)?.as_ref()?.choice);
    let advice = |(index, (material, detail))| model::advise(settings, material, detail, made(index));
    let mut advice: Vec<_> = scene.materials.iter().zip(details).enumerate().map(advice).collect();
    host::advise(settings, &mut advice);
    let matter = match before.filter(|before| before.has(scene, &advice)) {
        Some(Before { prepared, .. }) => Matter::of(prepared),
        None => Matter::new(scene, settings, &advice)?,
    };
    let Matter { materials, profiles, boundaries, rough_rows, balances, mixtures, clusters, cache } = matter;
    let lights: Vec<Light> = scene.lights.iter().map(|l| delta_light(l, frame)).collect();
    let emitters = emitter::table(&scene.triangles, &scene.shadings, &materials);

    let mut view = view_of(&camera, frame, width, height);
    view.seed = settings.seed;
    view.directions = settings.directions;
    view.light_count = lights.len() as u32;
    view.emitter_count = emitters.len() as u32;
    (view.emitters_centre, view.emitters_radius2) = emitter::ball(&scene.triangles, &emitters);
    view.groups = 2 * scene.sets.len() as u32;
    view.leaves = clusters.len() as u32 / 2;
    view.opening = settings.cloud.opening as f32;
    view.show_environment = u32::from(settings.show_environment);

    let map = &scene.environment;
    let scale = map.scale as f32;
    let rotation = glam::DMat3::from_rotation_y(-map.rotation.to_radians());
    view.environment_row0 = rotation.row(0).as_vec3();
    view.environment_row1 = rotation.row(1).as_vec3();
    view.environment_row2 = rotation.row(2).as_vec3();
    let (kind, environment, environment_cdf) = match &map.map {
        EnvironmentMap::None => (shared::ENVIRONMENT_NONE, vec![], vec![]),
        EnvironmentMap::Constant(radiance) => {
            view.environment_scale = radiance.as_vec3() * scale;
            (shared::ENVIRONMENT_CONSTANT, vec![], vec![])
        }
        EnvironmentMap::Image { width, height, radiance } => {
            let (table, density_width, density_height) = light::environment_cdf(radiance, *width, *height);
            view.environment_scale = Vec3::splat(scale);
            (view.environment_width, view.environment_height) = (*width, *height);
            (view.density_width, view.density_height) = (density_width, density_height);
            (shared::ENVIRONMENT_IMAGE, radiance.clone(), table)
        }
    };

    if !view.environment_scale.is_finite() {
        let problem = format!("its radiance times the scale {} is more than a kernel's number holds", map.scale);
        return Err(Error::setting("environment", problem));
    }

    let (texels, textures, kinds) = textures(scene);
    let opaque = scene.sets.iter().any(|set| scene.materials[set.materials[0]].medium.is_none());
    let rough = scene.materials.iter().any(|m| m.roughness > 0.0);
    let shown = scene.sets.iter().flat_map(|set| &set.materials).map(|&index| &materials[index]);
    let translucent = shown.filter(|material| material.flags & TRANSLUCENT != 0);
    let models: u32 = translucent.fold(0, |mask, material| mask | 1 << material.model);
    let emits = !emitters.is_empty();
    let has_probes = models & !(1 << MODEL_LAMBERT) != 0 && settings.integrator == Integrator::Sample;
    let features = Features {
        projection: settings.projection as u32,
        environment: kind,
        batches: u32::from(settings.variance || settings.estimate_error),
        models,
        emitters: u32::from(emits),
        textures: kinds,
        rough: rough_rows,
        curvature: u32::from(!balances.is_empty()),
        cell_vectors: if profiles.is_empty() { 0 } else { settings.precision.cell_vectors() },
        recorded: u32::from(settings.recording),
        mixtures: u32::from(!mixtures.is_empty()),
        integrator: settings.integrator as u32,
        reproject: if has_probes { settings.reproject as u32 } else { shared::REPROJECT_TRACE },
        irradiance: if has_probes { settings.irradiance as u32 } else { shared::IRRADIANCE_DIRECT },
        reuse: if has_probes && shares_hits(settings, models, kinds, &mixtures) { settings.tile_width() } else { 0 },
        ..Features::default()
    };
    // Whole tiles, so that the pixels shown do not depend on the crop; a recording's buffers hold these alone.
    let margin = if settings.recording { 0 } else { features.reuse.saturating_sub(1) };
    let columns = x0.saturating_sub(margin)..(x1 + margin).min(width);
    (view.crop_x, view.crop_width) = (columns.start, columns.end - columns.start);
    Ok(Prepared {
        features,
        view,
        has_single: materials.iter().any(|material| material.scattering != Vec3::ZERO),
        materials,
        has_translucent: models != 0,
        has_probes,
        on_host: models & !(1 << MODEL_LAMBERT) != 0 && settings.integrator.is_on_host(),
        has_reflection: opaque
            || emits
            || settings.show_environment
            || kind != shared::ENVIRONMENT_NONE
            || !lights.is_empty() && rough,
        ray_count: features.rays(&view),
        lights,
        emitters,
        boundaries,
        environment,
        environment_cdf,
        texels,
        textures,
        profiles,
        balances,
        mixtures,
        clusters,
        cache,
        advice,
        camera,
        rows: y0.saturating_sub(margin)..(y1 + margin).min(height),
        shown: [x0, y0, x1, y1],
    })
}

/// Whether pixels of a tile may share their hits: all have the same value of a hit, but for its distance.
fn shares_hits(settings: &Settings, models: u32, textures: u32, mixtures: &[shared::Mixture]) -> bool {
    let of_medium = 1 << shared::TEXTURE_SCATTER_COLOR | 1 << shared::TEXTURE_SCATTER_STRENGTH;
    settings.tile_width() > 1
        && settings.projection == Projection::Mis
        && models & (1 << shared::MODEL_DIRECTIONAL) == 0
        && textures & of_medium == 0
        && mixtures.is_empty()
}

/// The camera's part of a View, in internal units.
pub(crate) fn view_of(camera: &Camera, frame: Frame, width: u32, height: u32) -> View {
    let eye = (camera.eye - frame.centre) * frame.scale;
    // Rays start on a plane near the scene, so that a far eye costs no digits; a near eye needs no such plane.
    let depth = (-eye).dot(camera.forward).max(1.0);
    let aspect = f64::from(width) / f64::from(height);
    let (half_height, forward, perspective) = match camera.lens {
        Lens::Perspective { yfov, .. } => (depth * (0.5 * yfov).tan(), camera.forward * depth, 1.0),
        Lens::Orthographic { ymag, .. } => (ymag * frame.scale, camera.forward, 0.0),
    };
    View {
        pivot: (eye + camera.forward * depth).as_vec3(),
        right: (camera.right * half_height * aspect).as_vec3(),
        up: (camera.up * half_height).as_vec3(),
        forward: forward.as_vec3(),
        perspective,
        reach: depth as f32,
        width,
        height,
        ..View::default()
    }
}

/// A light in internal units.
pub(crate) fn delta_light(light: &crate::scene::Light, frame: Frame) -> Light {
    let mut out = Light {
        position: ((light.position - frame.centre) * frame.scale).as_vec3(),
        direction: light.direction.as_vec3(),
        inverse_range: light.range.map_or(0.0, |range| 1.0 / (range * frame.scale)) as f32,
        ..Light::default()
    };
    // Intensity over squared distance, with the distance in internal units.
    let squared_scale = frame.scale * frame.scale;
    match light.kind {
        LightKind::Directional => {
            out.kind = shared::LIGHT_DIRECTIONAL;
            out.intensity = light.intensity.as_vec3();
        }
        LightKind::Point => {
            out.kind = shared::LIGHT_POINT;
            out.intensity = (light.intensity * squared_scale).as_vec3();
        }
        LightKind::Spot { inner, outer } => {
            out.kind = shared::LIGHT_SPOT;
            out.intensity = (light.intensity * squared_scale).as_vec3();
            // The factor of KHR_lights_punctual, with its least width of the cone's edge.
            let scale = 1.0 / (inner.cos() - outer.cos()).max(0.001);
            out.spot_scale = scale as f32;
            out.spot_offset = (-outer.cos() * scale) as f32;
        }
    }
    out
}

/// Texels, textures and the set of their kinds, as kernels read them; nothing without textures.
fn textures(scene: &Scene) -> (Vec<u32>, Vec<Texture>, u32) {
    if !scene.materials.iter().any(scene::Material::is_textured) {
        return (vec![], vec![], 0);
    }
    let mut texels: Vec<u32> = (0..=255).map(|byte| (texture::decode(byte) as f32).to_bits()).collect();
    let mut offsets = vec![];
    for picture in &scene.pictures {
        offsets.push(texels.len() as u32);
        texels.extend(&picture.texels);
    }
    let mut kinds = 0;
    let mut textures = vec![];
    for (kind, authored) in scene.materials.iter().flat_map(|material| (0u32..).zip(&material.textures)) {
        let Some(authored) = authored else {
            textures.push(Texture::default());
            continue;
        };
        kinds |= 1 << kind;
        let picture = &scene.pictures[authored.picture];
        let color =
            matches!(kind, shared::TEXTURE_BASE_COLOR | shared::TEXTURE_EMISSION | shared::TEXTURE_SCATTER_COLOR);
        let [wrap_u, wrap_v] = authored.wrap.map(|wrap| match wrap {
            Wrap::Repeat => shared::WRAP_REPEAT,
            Wrap::Clamp => shared::WRAP_CLAMP,
            Wrap::Mirror => shared::WRAP_MIRROR,
        });
        textures.push(Texture {
            width: picture.width,
            height: picture.height,
            offset: offsets[authored.picture],
            srgb: u32::from(color),
            wrap_u,
            wrap_v,
            linear: u32::from(!authored.nearest),
            set: authored.set,
            row_u: authored.rows[0].as_vec3(),
            row_v: authored.rows[1].as_vec3(),
            scale: authored.scale as f32,
        });
    }
    (texels, textures, kinds)
}
