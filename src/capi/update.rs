//! What changes between recordings: cameras, lights and matter of renderers and of scenes.

use crate::{
    Failure, TranslucentResult, argument, exclusive, guard, meshes::TranslucentMaterial, meshes::material_of, read,
    reference, renderer::TranslucentRenderer, scene::TranslucentScene, slice,
};
use engine::scene::{Camera, Lens, Light, LightKind};
use glam::DVec3;

/// Renders another state of the scene from now on: the one that the renderer was made of, with other materials, lights,
/// cameras or environment (translucent_scene_set_*), whose geometry stays. It is written into the buffers that there
/// are; what is large and not where the host reaches it goes through the device's queue and is waited for. Sums are
/// forgotten. INPUT, with the reason, for what needs a new renderer: nothing was changed then.
///
/// A model that was chosen for a material stays, where neither settings nor material name one. There is room for the
/// tables of any matter, as many lights, and no more of the environment than at first.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_renderer_update(
    renderer: *mut TranslucentRenderer,
    scene: *const TranslucentScene,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers, as the header says.
        let (renderer, scene) = unsafe { (exclusive(renderer, "renderer")?, reference(scene, "scene")?) };
        Ok(renderer.renderer.update(&scene.scene)?)
    })
}

/// From which sample the ranges of recordings count. No execution may be going on, here and in the functions below.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_renderer_set_first_sample(
    renderer: *mut TranslucentRenderer,
    first: u32,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointer, as the header says.
        Ok(unsafe { exclusive(renderer, "renderer")? }.renderer.set_first_sample(first)?)
    })
}

/// A camera; lengths in metres.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct TranslucentCamera {
    /// sizeof(TranslucentCamera).
    pub struct_size: usize,
    pub eye: [f64; 3],
    /// Where it looks, of any length but 0.
    pub forward: [f64; 3],
    /// What is up in the image; not parallel to forward.
    pub up: [f64; 3],
    /// Full vertical angle (radians); 0: orthographic.
    pub yfov: f64,
    /// Orthographic: half width and half height.
    pub xmag: f64,
    pub ymag: f64,
}

impl TranslucentCamera {
    fn to_engine(self) -> Camera {
        let lens = match self.yfov {
            0.0 => Lens::Orthographic { xmag: self.xmag, ymag: self.ymag },
            yfov => Lens::Perspective { yfov, aspect: None },
        };
        Camera::new("caller's", self.eye.into(), self.forward.into(), self.up.into(), lens)
    }
}

/// Looks through another camera. Sums are forgotten.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_renderer_set_camera(
    renderer: *mut TranslucentRenderer,
    camera: *const TranslucentCamera,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers, as the header says.
        let (renderer, given) = unsafe { (exclusive(renderer, "renderer")?, read(camera, "camera")?) };
        Ok(renderer.renderer.set_camera(&given.to_engine())?)
    })
}

/// Kind of a light.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TranslucentLightKind {
    /// intensity is W/sr.
    Point = 0,
    /// As a point light, within a cone.
    Spot = 1,
    /// intensity is W/m^2 on a plane across the direction.
    Directional = 2,
}

/// A light; lengths in metres.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct TranslucentLight {
    /// sizeof(TranslucentLight).
    pub struct_size: usize,
    /// A TranslucentLightKind.
    pub kind: u32,
    /// Point and spot.
    pub position: [f64; 3],
    /// Spot and directional: where it shines, of any length but 0.
    pub direction: [f64; 3],
    pub intensity: [f64; 3],
    /// Spot: angles from the axis (radians), 0 <= inner < outer <= pi/2.
    pub inner: f64,
    pub outer: f64,
    /// How far it reaches, as KHR_lights_punctual has it; 0: infinitely far.
    pub range: f64,
}

unsafe fn lights_of(given: &[TranslucentLight]) -> Result<Vec<Light>, Failure> {
    let light = |given: &TranslucentLight| {
        // SAFETY: an element of the caller's array.
        let given = unsafe { read(given, "light") }?;
        let direction = DVec3::from(given.direction).normalize_or_zero();
        let (kind, direction) = match given.kind {
            k if k == TranslucentLightKind::Point as u32 => (LightKind::Point, DVec3::NEG_Z),
            k if k == TranslucentLightKind::Spot as u32 => {
                (LightKind::Spot { inner: given.inner, outer: given.outer }, direction)
            }
            k if k == TranslucentLightKind::Directional as u32 => (LightKind::Directional, direction),
            k => return Err(argument(format!("{k} is no TranslucentLightKind"))),
        };
        Ok(Light {
            name: "caller's".into(),
            position: given.position.into(),
            direction,
            intensity: given.intensity.into(),
            kind,
            range: Some(given.range).filter(|range| *range != 0.0),
        })
    };
    given.iter().map(light).collect()
}

/// Replaces the scene's lights by as many others; one that is switched off has the intensity 0. Sums are forgotten.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_renderer_set_lights(
    renderer: *mut TranslucentRenderer,
    lights: *const TranslucentLight,
    count: u32,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers, as the header says.
        let (renderer, given) = unsafe { (exclusive(renderer, "renderer")?, slice(lights, count as usize, "lights")?) };
        // SAFETY: as above.
        let lights = unsafe { lights_of(given) }?;
        Ok(renderer.renderer.set_lights(&lights)?)
    })
}

/// What fills a translucent material.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct TranslucentMatter {
    /// sizeof(TranslucentMatter).
    pub struct_size: usize,
    /// Reduced scattering coefficient of red, green and blue [1/m].
    pub sigma_s_prime: [f64; 3],
    /// Absorption coefficient [1/m].
    pub sigma_a: [f64; 3],
    /// Index of refraction.
    pub ior: f64,
}

/// Gives a translucent material other matter, under the model that it has. Sums are forgotten.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_renderer_set_matter(
    renderer: *mut TranslucentRenderer,
    material: u32,
    matter: *const TranslucentMatter,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers, as the header says.
        let (renderer, given) = unsafe { (exclusive(renderer, "renderer")?, read(matter, "matter")?) };
        let index = material as usize;
        let old = renderer.renderer.material(index);
        let mut new = old.cloned().ok_or_else(|| argument(format!("the scene has no material {material}")))?;
        let medium = new.medium.as_mut().ok_or_else(|| argument(format!("material {material} is opaque")))?;
        medium.sigma_s_prime = given.sigma_s_prime.into();
        medium.sigma_a = given.sigma_a.into();
        medium.appearance = None;
        new.ior = given.ior;
        Ok(renderer.renderer.set_material(index, &new)?)
    })
}

/// Replaces the cameras of a scene by one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_scene_set_camera(
    scene: *mut TranslucentScene,
    camera: *const TranslucentCamera,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers, as the header says.
        let (scene, given) = unsafe { (exclusive(scene, "scene")?, read(camera, "camera")?) };
        Ok(scene.scene.set_cameras(vec![given.to_engine()])?)
    })
}

/// Replaces the lights of a scene.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_scene_set_lights(
    scene: *mut TranslucentScene,
    lights: *const TranslucentLight,
    count: u32,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers, as the header says.
        let (scene, given) = unsafe { (exclusive(scene, "scene")?, slice(lights, count as usize, "lights")?) };
        // SAFETY: as above.
        Ok(scene.scene.set_lights(unsafe { lights_of(given) }?)?)
    })
}

/// Replaces a material of a scene by another without textures; its name stays, and whether it is translucent must.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_scene_set_material(
    scene: *mut TranslucentScene,
    index: u32,
    material: *const TranslucentMaterial,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers, as the header says.
        let (scene, mut new) = unsafe { (exclusive(scene, "scene")?, material_of(material)?) };
        if let Some(old) = scene.scene.materials.get(index as usize) {
            (new.name, new.set, new.hidden) = (old.name.clone(), old.set.clone(), old.hidden);
        }
        Ok(scene.scene.set_material(index as usize, new)?)
    })
}
