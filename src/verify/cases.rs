//! Small scenes, made in the program, on which kernels are tested.

use crate::{
    cache::{Cache, Geometry},
    error::Result,
    measure::scenes::{Eye, Mesh, gltf, matter, sun},
    prepare::{Prepared, prepare},
    reference::Inputs,
    scene::{Environment, EnvironmentMap, LoadOptions, Scene},
    settings::{
        Cloud, Directional, Integrator, Irradiance, Model, Precision, Projection, Reproject, Settings, SingleScattering,
    },
};
use glam::{DVec3, Vec3};
use serde_json::{Value, json};

/// A scene with what kernels read of it.
pub struct Case {
    pub name: String,
    pub scene: Scene,
    pub prepared: Prepared,
}

impl Case {
    /// # Errors
    /// As [`prepare`].
    pub fn new(name: impl Into<String>, scene: Scene, settings: &Settings) -> Result<Case> {
        let prepared = prepare(&scene, settings)?;
        Ok(Case { name: name.into(), scene, prepared })
    }

    pub fn inputs(&self) -> Inputs<'_> {
        self.prepared.inputs(&self.scene)
    }
}

/// Width and height of every case's image.
pub const SIZE: u32 = 24;

/// What is put on the table beside the ball.
#[derive(Clone, Copy, PartialEq)]
enum Light {
    Delta,
    Constant,
    Image,
    Emitters,
    /// Emitters in a constant environment.
    EmittersOutside,
}

/// A ball of matter, faceted finely enough to have a smooth rim, over an opaque table.
fn still_life(materials: &[Value], light: Light) -> Result<Scene> {
    let eye = Eye { eye: DVec3::new(1.0, 2.0, 4.0), at: DVec3::new(0.0, -0.2, 0.0), lens: 0.6 };
    let mut table = Mesh::default();
    table.quad(DVec3::new(-2.0, -1.0, 2.0), DVec3::X * 4.0, DVec3::Z * -4.0);
    let mut meshes = vec![(Mesh::sphere(1.0, 6), 0), (table, 1)];
    if matches!(light, Light::Emitters | Light::EmittersOutside) {
        let mut lamp = Mesh::default();
        lamp.quad(DVec3::new(-1.0, 2.5, 1.0), DVec3::X, DVec3::Z);
        lamp.quad(DVec3::new(1.5, 2.0, 1.0), DVec3::new(0.3, 0.4, 0.0), DVec3::Z);
        meshes.push((lamp, 2));
    }
    let lights = match light {
        Light::Delta => {
            let spot = json!({"type": "spot", "intensity": 40.0, "range": 12.0, "color": [1.0, 0.7, 0.4],
                "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.6}});
            let point = json!({"type": "point", "intensity": 20.0});
            let sun = (sun(), DVec3::new(3.0, 4.0, 2.0), DVec3::ZERO);
            vec![sun, (spot, DVec3::new(-2.0, 3.0, 2.0), DVec3::ZERO), (point, DVec3::new(2.0, 2.0, 2.0), DVec3::ZERO)]
        }
        _ => vec![(sun(), DVec3::new(3.0, 4.0, 2.0), DVec3::ZERO)],
    };
    let file = gltf(&meshes, materials, &lights, &eye).to_string();
    let mut scene = Scene::from_bytes("verify.gltf", file.as_bytes(), &LoadOptions::default())?;
    match light {
        Light::Constant | Light::EmittersOutside => {
            scene.set_environment(Environment::constant(DVec3::new(0.3, 0.5, 0.8))?)?
        }
        Light::Image => {
            let texel = |i: u32| Vec3::new(0.1 + (i % 7) as f32, 0.2 + (i % 5) as f32, 0.3 + (i % 11) as f32);
            let map = EnvironmentMap::Image { width: 16, height: 8, radiance: (0..128).map(texel).collect() };
            scene.set_environment(Environment { map, rotation: 40.0, scale: 0.3 })?;
        }
        Light::Delta | Light::Emitters => {}
    }
    Ok(scene)
}

fn materials() -> Vec<Value> {
    let table = json!({"name": "table", "pbrMetallicRoughness": {
        "baseColorFactor": [0.6, 0.4, 0.3, 1.0], "metallicFactor": 0.2, "roughnessFactor": 0.6}});
    let lamp = json!({"name": "lamp", "emissiveFactor": [1.0, 0.8, 0.6], "doubleSided": true,
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 5.0}}});
    vec![matter([4.0, 2.0, 1.0], [0.3, 0.2, 0.1], 1.4), table, lamp]
}

/// What all cases have in common.
fn settings(seed: u32) -> Settings {
    Settings {
        resolution: Some((SIZE, SIZE)),
        directions: 2,
        seed,
        show_environment: true,
        reuse: Some(1),
        single_scattering: SingleScattering::Off,
        ..Settings::default()
    }
}

/// Every model, projection and kind of light, once or more.
///
/// # Errors
/// None on sound builds: the scenes are valid.
pub fn cases() -> Result<Vec<Case>> {
    use Projection::{Camera, Mis, Normal};
    let list = [
        ("standard, mis, delta lights", Model::Standard, Mis, Light::Delta),
        ("standard, camera, emitters outside", Model::Standard, Camera, Light::EmittersOutside),
        ("better, normal, image", Model::Better, Normal, Light::Image),
        ("burley, mis, emitters", Model::Burley, Mis, Light::Emitters),
        ("directional, mis, delta lights", Model::Directional, Mis, Light::Delta),
        ("directional, camera, image", Model::Directional, Camera, Light::Image),
        ("table in full precision, mis, uniform light", Model::Table, Mis, Light::Constant),
        ("lambert, mis, emitters", Model::Lambert, Mis, Light::Emitters),
    ];
    let mut cases = vec![];
    for (seed, (name, model, projection, light)) in (3..).zip(list) {
        let mut materials = materials();
        // Tables of this matter come with the crate.
        materials[0]["extras"]["bssrdf"]["ior"] = json!(if model == Model::Table { 1.3 } else { 1.4 });
        if matches!(model, Model::Standard | Model::Better) {
            materials[0]["extras"]["bssrdf"]["g"] = json!(if projection == Normal { -0.6 } else { 0.7 });
        }
        if model == Model::Burley {
            // No longer smooth.
            if let Some(bssrdf) = materials[0]["extras"]["bssrdf"].as_object_mut() {
                bssrdf.remove("surface");
            }
            materials[0]["pbrMetallicRoughness"] = json!({"roughnessFactor": 0.6});
        }
        let scene = still_life(&materials, light)?;
        let single_scattering = match model {
            Model::Standard | Model::Better => SingleScattering::On,
            _ => SingleScattering::Off,
        };
        let directional = Some(Directional { reciprocal: projection == Mis, ..Directional::default() });
        let precision = Precision::Full;
        let settings = Settings { model, projection, directional, single_scattering, precision, ..settings(seed) };
        cases.push(Case::new(name, scene, &settings)?);
    }
    cases.push(mixed()?);
    cases.extend(tiled()?);
    cases.extend(looked_up()?);
    for mut case in kept()? {
        case.prepared.cache.points = super::cloud::lit(&case);
        cases.push(case);
    }
    Ok(cases)
}

/// What whole images are made of: the standard dipole under the sun and a uniform sky.
///
/// # Errors
/// As [`cases`].
pub fn portrait(projection: Projection) -> Result<(Scene, Settings)> {
    let scene = still_life(&materials(), Light::Constant)?;
    Ok((scene, Settings { resolution: Some((16, 16)), model: Model::Standard, projection, ..settings(4) }))
}

/// A ball of three media in one set.
fn mixed() -> Result<Case> {
    let mut scene = still_life(&materials(), Light::Delta)?;
    let mut members = vec![0];
    for (model, factor, roughness) in [(Model::Burley, 4.0, 0.0), (Model::Directional, 0.5, 0.7)] {
        let mut material = scene.materials[0].clone();
        material.roughness = roughness;
        if let Some(medium) = &mut material.medium {
            medium.model = Some(model);
            medium.sigma_s_prime *= factor;
            medium.sigma_a /= factor;
        }
        members.push(scene.materials.len());
        scene.materials.push(material);
    }
    let of_ball = scene.shadings.iter_mut().filter(|shading| shading.material == 0);
    for (index, shading) in of_ball.enumerate() {
        shading.material = members[index % 3] as u32;
    }
    if let Some(set) = scene.sets.iter_mut().find(|set| set.materials == [0]) {
        set.materials = members;
    }
    Case::new("three media, mis, delta lights", scene, &settings(12))
}

/// Scenes in which pixels of tiles share hits.
fn tiled() -> Result<Vec<Case>> {
    let list = [
        ("standard, tiles of 4, delta lights", Model::Standard, Light::Delta, 4),
        ("table, tiles of 8, image", Model::Table, Light::Image, 8),
    ];
    let mut cases = vec![];
    for (seed, (name, model, light, reuse)) in (23..).zip(list) {
        let mut materials = materials();
        materials[0]["extras"]["bssrdf"]["ior"] = json!(1.3);
        // What the table sees is not shared with what the ball sees beside it.
        materials[1] = matter([2.0, 3.0, 4.0], [0.3, 0.2, 0.1], 1.3);
        let scene = still_life(&materials, light)?;
        // Many hits are near where some of a tile's pixels no longer reach.
        cases.push(Case::new(
            name,
            scene,
            &Settings { model, reuse: Some(reuse), radius_tail: 0.09, ..settings(seed) },
        )?);
    }
    Ok(cases)
}

/// Scenes in which points are looked up in the G-buffer: radii of the profile and of the camera's exponential, and tiles.
fn looked_up() -> Result<Vec<Case>> {
    let list = [
        ("burley, screen, mis, uniform light", Model::Burley, Projection::Mis, Light::Constant, 1),
        ("standard, screen, camera, delta lights", Model::Standard, Projection::Camera, Light::Delta, 1),
        ("table, screen, tiles of 4, delta lights", Model::Table, Projection::Mis, Light::Delta, 4),
    ];
    let mut cases = vec![];
    for (seed, (name, model, projection, light, reuse)) in (31..).zip(list) {
        let mut materials = materials();
        materials[0]["extras"]["bssrdf"]["ior"] = json!(1.3);
        // Another set behind the ball's rim.
        materials[1] = matter([2.0, 3.0, 4.0], [0.3, 0.2, 0.1], 1.3);
        let scene = still_life(&materials, light)?;
        let reproject = Reproject::Screen;
        cases.push(Case::new(
            name,
            scene,
            &Settings { model, projection, reproject, reuse: Some(reuse), ..settings(seed) },
        )?);
    }
    Ok(cases)
}

/// Scenes in which light is kept at points of the surface, on lattices of one to four cells, some of them patches.
///
/// # Errors
/// As [`cases`].
pub(super) fn kept() -> Result<Vec<Case>> {
    let list = [
        ("table, kept light, delta lights", Model::Table, Light::Delta, 1),
        ("burley, kept light, tiles of 4, emitters", Model::Burley, Light::Emitters, 4),
    ];
    let mut cases = vec![];
    for (seed, (name, model, light, reuse)) in (37..).zip(list) {
        let mut materials = materials();
        materials[0]["extras"]["bssrdf"]["ior"] = json!(1.3);
        let scene = still_life(&materials, light)?;
        let irradiance = Irradiance::Cached;
        let mut case = Case::new(name, scene, &Settings { model, irradiance, reuse: Some(reuse), ..settings(seed) })?;
        let (cache, geometry) = (&mut case.prepared.cache, Geometry::of(&case.scene));
        // Some triangles are cut, as if they were larger.
        let spacing = |triangle: usize| {
            let of_ball = case.scene.shadings[triangle].material == 0;
            of_ball.then_some(if triangle.is_multiple_of(6) { 0.008 } else { 0.1 })
        };
        *cache = Cache::new(geometry, spacing, 100_000);
        let is_whole = |number: &usize| cache.lattices[cache.patches[*number].triangle].patches == 1;
        let whole: Vec<usize> = (0..cache.patches.len()).filter(is_whole).collect();
        cache.refine(geometry, &whole[..2 * whole.len() / 3]);
        cache.refine(geometry, &whole[..whole.len() / 3]);
        cases.push(case);
    }
    Ok(cases)
}

/// Scenes whose light is gathered: models, lights, a rough boundary.
///
/// # Errors
/// As [`cases`].
pub fn clouds() -> Result<Vec<Case>> {
    let list = [
        ("cloud, standard, delta lights", Model::Standard, Light::Delta, 0.0),
        ("cloud, burley, emitters outside", Model::Burley, Light::EmittersOutside, 0.5),
        ("cloud, table, image", Model::Table, Light::Image, 0.0),
    ];
    let mut cases = vec![];
    for (seed, (name, model, light, roughness)) in (17..).zip(list) {
        let mut scene = still_life(&materials(), light)?;
        scene.materials[0].roughness = roughness;
        let cloud = Cloud { points: 1500, opening: 0.4, samples: 3, ..Cloud::default() };
        let settings = Settings { model, integrator: Integrator::Cloud, cloud, ..settings(seed) };
        cases.push(Case::new(name, scene, &settings)?);
    }
    Ok(cases)
}
