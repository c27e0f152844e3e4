//! Scenes of the caller's own vertices and materials.

use crate::{
    Failure, TranslucentResult, VkBool32, argument, create, read, scene::TranslucentScene, slice, text,
    update::TranslucentMatter,
};
use engine::{
    Scene,
    ash::vk,
    scene::{Material, Medium, Mesh},
};
use glam::{DAffine3, DMat4, DVec4};
use std::ffi::c_char;

/// A material. All that is 0 or null is black, smooth, opaque.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct TranslucentMaterial {
    /// sizeof(TranslucentMaterial).
    pub struct_size: usize,
    /// For messages; may be null.
    pub name: *const c_char,
    /// Name of measured matter such as "marble"; null: none.
    pub preset: *const c_char,
    /// What fills it, in place of a preset; null: nothing.
    pub matter: *const TranslucentMatter,
    /// The model of its matter, as in TranslucentSettings; null leaves the choice to the library.
    pub model: *const c_char,
    /// Linear colour of an opaque surface, 0 to 1.
    pub base_color: [f64; 3],
    /// 0 to 1.
    pub metallic: f64,
    /// 0 to 1.
    pub roughness: f64,
    /// Emitted radiance.
    pub emission: [f64; 3],
    /// VK_TRUE: both sides emit.
    pub two_sided: VkBool32,
}

/// Triangles of one material.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct TranslucentMesh {
    /// sizeof(TranslucentMesh).
    pub struct_size: usize,
    /// For messages; may be null.
    pub name: *const c_char,
    /// Three floats for each vertex.
    pub positions: *const f32,
    /// Three floats for each vertex, of any length; null: triangles are flat.
    pub normals: *const f32,
    pub vertex_count: u32,
    /// Three for each triangle, counter-clockwise seen from outside.
    pub indices: *const u32,
    pub index_count: u32,
    /// Index of the material.
    pub material: u32,
    /// Name of the set with whose matter it exchanges light; null: meshes of one material are one set where their
    /// borders meet.
    pub set: *const c_char,
    /// 4 x 4 numbers, column by column, from its positions to metres; null: they are metres.
    pub transform: *const f64,
}

/// Makes and checks a scene of vertices and materials, which are copied. Without lights (translucent_scene_set_lights,
/// translucent_scene_set_environment) it is dark; without a camera (translucent_scene_set_camera) one frames it. The
/// rules are those of glTF files, with each mesh a node: winding is repaired, triangles without area are dropped.
///
/// The BVH is built on the host: vertices that only a VkBuffer holds have to be read back by the caller, once.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_scene_create_from_meshes(
    meshes: *const TranslucentMesh,
    mesh_count: u32,
    materials: *const TranslucentMaterial,
    material_count: u32,
    out: *mut *mut TranslucentScene,
) -> TranslucentResult {
    let make = || {
        // SAFETY: the caller's pointers, as the header says.
        let (meshes, materials) = unsafe {
            (slice(meshes, mesh_count as usize, "meshes")?, slice(materials, material_count as usize, "materials")?)
        };
        // SAFETY: elements of the caller's arrays.
        let materials = materials.iter().map(|given| unsafe { material_of(given) }).collect::<Result<Vec<_>, _>>()?;
        // SAFETY: as above.
        let meshes = meshes.iter().map(|given| unsafe { mesh_of(given) }).collect::<Result<Vec<_>, _>>()?;
        Ok(TranslucentScene::of(Scene::from_meshes(&meshes, materials, vec![])?))
    };
    // SAFETY: as above.
    unsafe { create(out, make) }
}

/// # Safety
/// As [`read`]; the pointers within are valid.
unsafe fn mesh_of<'a>(given: *const TranslucentMesh) -> Result<Mesh<'a>, Failure> {
    // SAFETY: the caller's pointers, as the header says.
    unsafe {
        let given = read(given, "mesh")?;
        let vertices = given.vertex_count as usize;
        let vectors = |start: *const f32, name: &str| slice(start.cast::<[f32; 3]>(), vertices, name);
        let transform = match given.transform.is_null() {
            true => DAffine3::IDENTITY,
            false => {
                let matrix = DMat4::from_cols_slice(slice(given.transform, 16, "mesh.transform")?);
                if matrix.row(3) != DVec4::W {
                    return Err(argument("the last row of mesh.transform is not 0 0 0 1"));
                }
                DAffine3::from_mat4(matrix)
            }
        };
        Ok(Mesh {
            name: text(given.name, "mesh.name")?.unwrap_or(""),
            positions: vectors(given.positions, "mesh.positions")?,
            normals: if given.normals.is_null() { None } else { Some(vectors(given.normals, "mesh.normals")?) },
            indices: slice(given.indices, given.index_count as usize, "mesh.indices")?,
            material: given.material as usize,
            set: text(given.set, "mesh.set")?,
            transform,
            ..Mesh::default()
        })
    }
}

/// # Safety
/// As [`read`]; the pointers within are valid.
pub(crate) unsafe fn material_of(given: *const TranslucentMaterial) -> Result<Material, Failure> {
    // SAFETY: the caller's pointers, as the header says.
    let (given, name, preset, matter, model) = unsafe {
        let given = read(given, "material")?;
        let (name, preset) = (text(given.name, "material.name")?, text(given.preset, "material.preset")?);
        let matter = match given.matter.is_null() {
            true => None,
            false => Some(read(given.matter, "material.matter")?),
        };
        (given, name, preset, matter, text(given.model, "material.model")?)
    };
    let mut material = match (preset, matter) {
        (Some(_), Some(_)) => return Err(argument("material.preset and material.matter do not go together")),
        (Some(preset), None) => Material::from_preset(preset)?,
        (None, Some(matter)) => {
            let medium = Medium::new(matter.sigma_s_prime.into(), matter.sigma_a.into());
            Material::translucent("material", medium, matter.ior)
        }
        (None, None) => Material { name: "material".into(), ..Material::default() },
    };
    if let Some(name) = name {
        material.name = name.into();
    }
    if let (Some(medium), Some(model)) = (&mut material.medium, model) {
        medium.model = Some(model.parse().map_err(argument)?);
    }
    Ok(Material {
        base_color: given.base_color.into(),
        metallic: given.metallic,
        roughness: given.roughness,
        emission: given.emission.into(),
        two_sided: given.two_sided != vk::FALSE,
        ..material
    })
}
