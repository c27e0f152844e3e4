//! Scenes: glTF files, on disk or in memory.

use crate::{Failure, TranslucentResult, argument, create, destroy, exclusive, guard, read, reference, slice, text};
use engine::{
    Environment, LoadOptions, Scene,
    scene::{EnvironmentMap, Material},
};
use glam::DVec3;
use std::ffi::{CString, c_char, c_void};

/// A .gltf or .glb file.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct TranslucentSceneInfo {
    /// sizeof(TranslucentSceneInfo).
    pub struct_size: usize,
    /// Its name; beside it buffers and images are looked for.
    pub file: *const c_char,
    /// Its contents; null: they are read from the file. They are copied.
    pub data: *const c_void,
    /// Bytes of data.
    pub size: usize,
    /// Metres of one unit of its geometry; 0 stands for 1.
    pub unit: f64,
}

/// A checked scene, without Vulkan. May be used from several threads at once, but not while it changes.
pub struct TranslucentScene {
    pub(crate) scene: Scene,
    names: Vec<CString>,
}

/// Reads and checks a scene.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_scene_create(
    info: *const TranslucentSceneInfo,
    out: *mut *mut TranslucentScene,
) -> TranslucentResult {
    // SAFETY: the caller's pointers, as the header says.
    unsafe { create(out, || load(info)) }
}

unsafe fn load(info: *const TranslucentSceneInfo) -> Result<TranslucentScene, Failure> {
    // SAFETY: the caller's pointers, as the header says.
    let (info, file) = unsafe {
        let info = read(info, "info")?;
        (info, text(info.file, "info.file")?.ok_or_else(|| argument("info.file is null"))?)
    };
    let options = LoadOptions { unit: if info.unit == 0.0 { 1.0 } else { info.unit }, ..LoadOptions::default() };
    let scene = if info.data.is_null() {
        Scene::load_with(file, &options)?
    } else {
        // SAFETY: as above.
        Scene::from_bytes(file, unsafe { slice(info.data.cast(), info.size, "info.data") }?, &options)?
    };
    Ok(TranslucentScene::of(scene))
}

impl TranslucentScene {
    pub(crate) fn of(scene: Scene) -> TranslucentScene {
        let name = |material: &Material| CString::new(material.name.replace('\0', " ")).unwrap_or_default();
        let names = scene.materials.iter().map(name).collect();
        TranslucentScene { scene, names }
    }
}

/// Lights the scene with the same radiance (R, G, B) from everywhere.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_scene_set_constant_environment(
    scene: *mut TranslucentScene,
    radiance: *const f64,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers, as the header says: three numbers.
        let (scene, radiance) = unsafe { (exclusive(scene, "scene")?, slice(radiance, 3, "radiance")?) };
        Ok(scene.scene.set_environment(Environment::constant(DVec3::from_slice(radiance))?)?)
    })
}

/// Lights the scene with an image: width x height x 3 floats of linear Rec.709 radiance, rows from the zenith down, the
/// middle is the direction +X, columns run towards +Z. It is copied. rotation (degrees) turns it about +Y,
/// counter-clockwise seen from above; scale multiplies it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_scene_set_environment(
    scene: *mut TranslucentScene,
    width: u32,
    height: u32,
    radiance: *const f32,
    rotation: f64,
    scale: f64,
) -> TranslucentResult {
    guard(|| {
        let count = 3 * width as usize * height as usize;
        // SAFETY: the caller's pointers, as the header says: that many numbers.
        let (scene, radiance) = unsafe { (exclusive(scene, "scene")?, slice(radiance, count, "radiance")?) };
        let radiance = radiance.chunks_exact(3).map(glam::Vec3::from_slice).collect();
        let map = EnvironmentMap::Image { width, height, radiance };
        Ok(scene.scene.set_environment(Environment { map, rotation, scale })?)
    })
}

/// Number of materials.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_scene_material_count(
    scene: *const TranslucentScene,
    count: *mut u32,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers, as the header says.
        unsafe { *exclusive(count, "count")? = reference(scene, "scene")?.names.len() as u32 };
        Ok(())
    })
}

/// Name of a material; the text lasts as long as the scene.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_scene_material_name(
    scene: *const TranslucentScene,
    index: u32,
    name: *mut *const c_char,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers, as the header says.
        let (scene, name) = unsafe { (reference(scene, "scene")?, exclusive(name, "name")?) };
        let found = scene.names.get(index as usize);
        *name = found.ok_or_else(|| argument(format!("the scene has no material {index}")))?.as_ptr();
        Ok(())
    })
}

/// Destroys it; renderers live on. Null is ignored.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_scene_destroy(scene: *mut TranslucentScene) {
    // SAFETY: the caller's handle, as the header says.
    unsafe { destroy(scene) }
}
