//! From a glTF or GLB file to metres: container, extensions, nodes, lights, cameras. Nothing here trusts the file.
//!
//! The `gltf` crate opens the container. The JSON in it is read as it is, not through that crate's structs: node
//! transforms keep their 64 bits, errors name the item, and no required extension is refused but by our own list.

use super::accessor::Arrays;
use super::instance::{Instance, Meshes};
use super::json::{Item, shorten};
use super::mesh::{self, Finished, Placed};
use super::texture::Textures;
use super::{Camera, Lens, Light, LightKind, LoadOptions, Material, Picture, Set, material, picture, skin};
use crate::shared::Coordinates;
use crate::{Error, Result};
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};
use serde_json::Value;
use std::{borrow::Cow, collections::BTreeMap, path::Path};

/// What a file holds, or a caller gives, in metres.
pub(super) struct Raw {
    pub triangles: Vec<mesh::Triangle>,
    /// Placed vertices (m).
    pub positions: Vec<glam::DVec3>,
    /// One for each triangle, or none without textures.
    pub coordinates: Vec<Coordinates>,
    pub dropped: u64,
    pub materials: Vec<Material>,
    pub pictures: Vec<Picture>,
    pub sets: Vec<Set>,
    pub lights: Vec<Light>,
    pub cameras: Vec<Camera>,
    pub warnings: Vec<String>,
}

/// Extensions that a file may require: their effect is modelled, or a word where they are used says what is not.
const SUPPORTED: &[&str] = &[
    "KHR_lights_punctual",
    "KHR_materials_ior",
    "KHR_materials_volume",
    "KHR_materials_volume_scatter",
    "KHR_materials_scatter",
    "KHR_materials_transmission",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_emissive_strength",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_texture_basisu",
    "EXT_texture_webp",
    "EXT_texture_avif",
    "KHR_draco_mesh_compression",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
];

/// Extensions that a file may require though they are left out: the matter and its shape are right without them.
const LEFT_OUT: &[&str] = &[
    "KHR_materials_specular",
    "KHR_materials_clearcoat",
    "KHR_materials_sheen",
    "KHR_materials_iridescence",
    "KHR_materials_anisotropy",
    "KHR_materials_dispersion",
    "KHR_materials_variants",
];

/// Largest vertical angle of a camera (radians): at pi, its picture would be infinitely wide.
const YFOV_MAX: f64 = 3.13;

/// Reads a whole file that lies (or would lie) at `file`.
pub(super) fn read(file: &Path, bytes: &[u8], options: &LoadOptions) -> Result<Raw> {
    let (json, binary) = split(file, bytes)?;
    let value: Value = serde_json::from_slice(&json)
        .map_err(|error| Error::scene(file, "glTF", format!("is not valid JSON: {error}")))?;
    let root = Item::root(file, &value);
    let mut warnings = Vec::new();
    check_asset(&root, &mut warnings)?;

    let materials = root.list("materials")?;
    material::check_overrides(file, &materials, &options.materials)?;
    let textures = Textures::new(&root)?;
    let mut materials: Vec<Material> = materials
        .iter()
        .enumerate()
        .map(|(index, item)| material::read(item, index, &textures, options, &mut warnings))
        .collect::<Result<_>>()?;
    materials.push(Material::default());

    let arrays = Arrays::new(&root, binary.as_deref())?;
    let nodes = root.list("nodes")?;
    let transforms = place_nodes(&root, &nodes, &mut warnings)?;
    let mut meshes = Meshes::new(&root, &arrays)?;
    let mut placed = Placed::new(&materials);
    let mut lights = Vec::new();
    let mut cameras = Vec::new();
    for (index, (node, transform)) in nodes.iter().zip(&transforms).enumerate() {
        let Some(transform) = transform else { continue };
        let name = node.name()?;
        if let Some(reference) = node.get("mesh")? {
            let joints = match node.get("skin")? {
                None => None,
                Some(reference) => {
                    let list = root.list("skins")?;
                    let item = &list[reference.index(list.len(), "skins")?];
                    Some(skin::joint_matrices(item, &arrays, &nodes, &transforms)?)
                }
            };
            if let Some(instancing) = node.extension("EXT_mesh_gpu_instancing")? {
                warnings.push(instancing.note("instances are not modelled; the mesh is shown once"));
            }
            let name = name.clone().unwrap_or_else(|| format!("node {index}"));
            let set = read_set(node)?;
            let instance = Instance { node, name, set, transform, unit: options.unit, joints };
            meshes.place(&instance, &reference, &mut placed, &mut warnings)?;
        }
        if let Some(reference) = node.get("camera")? {
            let list = root.list("cameras")?;
            let item = &list[reference.index(list.len(), "cameras")?];
            cameras.push(read_camera(node, item, name.clone(), cameras.len(), transform, options.unit)?);
        }
        if let Some(reference) = node.find(&["extensions", "KHR_lights_punctual", "light"])? {
            let list = root.find(&["extensions", "KHR_lights_punctual", "lights"])?;
            let list = list.map_or(Ok(Vec::new()), |list| list.elements())?;
            let item = &list[reference.index(list.len(), "lights")?];
            let name = name.map_or_else(|| item.name(), |name| Ok(Some(name)))?;
            let name = name.unwrap_or_else(|| format!("light {}", lights.len()));
            lights.push(read_light(node, item, name, transform, options.unit)?);
        }
    }
    placed.drop_unused(&mut materials);
    let Finished { triangles, positions, coordinates, sets, dropped } =
        placed.finish(file, &materials, &mut warnings)?;
    let pictures = read_pictures(&root, &arrays, &mut materials)?;
    Ok(Raw { triangles, positions, coordinates, dropped, materials, pictures, sets, lights, cameras, warnings })
}

/// The pictures that the materials' textures show, which are numbered anew.
fn read_pictures(root: &Item, arrays: &Arrays, materials: &mut [Material]) -> Result<Vec<Picture>> {
    let list = root.list("images")?;
    let mut numbers: BTreeMap<usize, usize> = BTreeMap::new();
    let mut pictures: Vec<Picture> = Vec::new();
    for texture in materials.iter_mut().flat_map(|material| material.textures.iter_mut()).flatten() {
        texture.picture = match numbers.get(&texture.picture) {
            Some(number) => *number,
            None => {
                let item = &list[texture.picture];
                pictures.push(picture::read(item, arrays)?);
                let texels: usize = pictures.iter().map(|picture| picture.texels.len()).sum();
                if texels > picture::SCENE_TEXELS_MAX {
                    return Err(item.error(format!("the scene has more than {} texels", picture::SCENE_TEXELS_MAX)));
                }
                numbers.insert(texture.picture, pictures.len() - 1);
                pictures.len() - 1
            }
        };
    }
    Ok(pictures)
}

/// JSON text and binary chunk of a file.
type Chunks<'a> = (Cow<'a, [u8]>, Option<Cow<'a, [u8]>>);

/// Those of a GLB container, or the whole file as JSON.
fn split<'a>(file: &Path, bytes: &'a [u8]) -> Result<Chunks<'a>> {
    let error = |problem: String| Error::scene(file, "GLB container", problem);
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes.into(), None));
    }
    // The crate subtracts the header's size from this unchecked.
    let Some(&[a, b, c, d]) = bytes.get(8..12) else { return Err(error("ends within its header".into())) };
    let length = u32::from_le_bytes([a, b, c, d]) as usize;
    if length < 12 || length > bytes.len() {
        return Err(error(format!("says it has {length} bytes, but has {}", bytes.len())));
    }
    let container = ::gltf::binary::Glb::from_slice(&bytes[..length]).map_err(|problem| error(problem.to_string()))?;
    Ok((container.json, container.bin))
}

/// Version and extensions.
fn check_asset(root: &Item, warnings: &mut Vec<String>) -> Result<()> {
    let version = root.need("asset")?.need("version")?;
    if version.string()?.split('.').next() != Some("2") {
        return Err(version.error(format!("{}; only glTF 2 is read", shorten(version.string()?))));
    }
    for required in root.list("extensionsRequired")? {
        let name = required.string()?;
        if !SUPPORTED.contains(&name) && !LEFT_OUT.contains(&name) {
            return Err(required.error(format!("the required extension {} is not supported", shorten(name))));
        }
    }
    for used in root.list("extensionsUsed")? {
        let name = used.string()?;
        // Materials and nodes say themselves what is left out of them.
        let told = name == "EXT_mesh_gpu_instancing" || material::UNMODELLED.iter().any(|(known, _)| *known == name);
        if !SUPPORTED.contains(&name) && !told {
            warnings.push(used.note(format!("the extension {} is not modelled", shorten(name))));
        }
    }
    if !root.list("animations")?.is_empty() {
        warnings.push("animations are not modelled; the scene is shown as it rests".into());
    }
    Ok(())
}

/// The transform of each node to the world, none for nodes outside the scene. Without recursion: a file may nest
/// nodes as deep as it likes.
fn place_nodes(root: &Item, nodes: &[Item], warnings: &mut Vec<String>) -> Result<Vec<Option<DAffine3>>> {
    let scenes = root.list("scenes")?;
    let chosen = match root.get("scene")? {
        Some(scene) => Some(scene.index(scenes.len(), "scenes")?),
        None if scenes.is_empty() => None,
        None => Some(0),
    };
    let mut children = Vec::with_capacity(nodes.len());
    for node in nodes {
        let list = node.list("children")?;
        children.push(list.iter().map(|child| child.index(nodes.len(), "nodes")).collect::<Result<Vec<_>>>()?);
    }
    let roots: Vec<usize> = match chosen {
        Some(scene) => {
            let list = scenes[scene].list("nodes")?;
            list.iter().map(|node| node.index(nodes.len(), "nodes")).collect::<Result<_>>()?
        }
        None => {
            let mut is_root = vec![true; nodes.len()];
            children.iter().flatten().for_each(|&child| is_root[child] = false);
            (0..nodes.len()).filter(|&node| is_root[node]).collect()
        }
    };
    if let Some(chosen) = chosen.filter(|_| scenes.len() > 1) {
        warnings.push(format!("{} is shown; the file's other scenes are left out", scenes[chosen].path));
    }
    let mut transforms: Vec<Option<DAffine3>> = vec![None; nodes.len()];
    let mut waiting: Vec<(usize, DAffine3)> = roots.iter().rev().map(|&node| (node, DAffine3::IDENTITY)).collect();
    while let Some((node, parent)) = waiting.pop() {
        if transforms[node].is_some() {
            return Err(nodes[node].error("is reached twice: a node has one parent at most, and no cycle"));
        }
        let transform = parent * local_transform(&nodes[node])?;
        mesh::check_transform(&nodes[node], &transform)?;
        transforms[node] = Some(transform);
        waiting.extend(children[node].iter().rev().map(|&child| (child, transform)));
    }
    Ok(transforms)
}

/// A node's own transform, from its matrix or from translation, rotation and scale.
fn local_transform(node: &Item) -> Result<DAffine3> {
    if let Some(item) = node.get("matrix")? {
        let matrix = DMat4::from_cols_array(&item.numbers()?);
        if matrix.row(3) != glam::DVec4::W {
            return Err(item.error("its last row must be 0 0 0 1"));
        }
        return Ok(DAffine3::from_mat4(matrix));
    }
    let translation = node.get("translation")?.map_or(Ok([0.0; 3]), |item| item.numbers())?;
    let scale = node.get("scale")?.map_or(Ok([1.0; 3]), |item| item.numbers())?;
    let rotation = match node.get("rotation")? {
        None => DQuat::IDENTITY,
        Some(item) => {
            let rotation = DQuat::from_array(item.numbers()?);
            // Exporters round to a few digits; anything farther from 1 is a mistake.
            if (rotation.length() - 1.0).abs() > 0.01 {
                return Err(item.error(format!("must be a unit quaternion, has length {}", rotation.length())));
            }
            rotation.normalize()
        }
    };
    Ok(DAffine3::from_scale_rotation_translation(scale.into(), rotation, translation.into()))
}

/// The set that a node names: `extras.bssrdf.set`.
fn read_set(node: &Item) -> Result<Option<String>> {
    let Some(bssrdf) = material::extras_bssrdf(node)? else { return Ok(None) };
    for key in bssrdf.keys()? {
        if key != "set" {
            return Err(bssrdf.error(format!("has an unknown member `{}`; a node's known: set", shorten(key))));
        }
    }
    material::read_set(&bssrdf)
}

/// The direction in which `axis` of the node points, whatever the node's scale.
fn axis(node: &Item, linear: &DMat3, axis: DVec3) -> Result<DVec3> {
    // Scaled first: the square of a tiny or huge column would leave the range of f64.
    let largest = linear.to_cols_array().iter().fold(0f64, |largest, value| largest.max(value.abs()));
    let direction = (*linear * (1.0 / largest)) * axis;
    direction.try_normalize().ok_or_else(|| node.error("its transform leaves a light or camera no direction"))
}

fn read_camera(
    node: &Item,
    item: &Item,
    node_name: Option<String>,
    index: usize,
    transform: &DAffine3,
    unit: f64,
) -> Result<Camera> {
    let object_name = item.name()?;
    let kind = item.need("type")?;
    let lens = match kind.string()? {
        "perspective" => {
            let lens = item.need("perspective")?;
            let yfov = lens.need("yfov")?;
            let angle = yfov.positive()?;
            if angle > YFOV_MAX {
                return Err(yfov.error(format!("must be at most {YFOV_MAX}, is {angle}")));
            }
            let aspect = lens.get("aspectRatio")?.map(|aspect| aspect.positive()).transpose()?;
            Lens::Perspective { yfov: angle, aspect }
        }
        "orthographic" => {
            let lens = item.need("orthographic")?;
            let (xmag, ymag) = (lens.need("xmag")?.positive()?, lens.need("ymag")?.positive()?);
            Lens::Orthographic { xmag: xmag * unit, ymag: ymag * unit }
        }
        other => {
            return Err(kind.error(format!("must be perspective or orthographic, is \"{}\"", shorten(other))));
        }
    };
    let forward = axis(node, &transform.matrix3, DVec3::NEG_Z)?;
    let up = axis(node, &transform.matrix3, DVec3::Y)?;
    let up = (up - forward * up.dot(forward)).try_normalize();
    let up = up.ok_or_else(|| node.error("its transform leaves the camera no upward direction"))?;
    Ok(Camera {
        name: node_name.or_else(|| object_name.clone()).unwrap_or_else(|| format!("camera {index}")),
        object_name,
        eye: transform.translation * unit,
        right: forward.cross(up),
        up,
        forward,
        lens,
    })
}

fn read_light(node: &Item, item: &Item, name: String, transform: &DAffine3, unit: f64) -> Result<Light> {
    let color = item.get("color")?.map_or(Ok([1.0; 3]), |color| color.numbers_within(0.0, f32::MAX as f64))?;
    let intensity = item.get("intensity")?.map_or(Ok(1.0), |value| value.within(0.0, f32::MAX as f64))?;
    let range = item.get("range")?.map(|range| range.positive()).transpose()?;
    let kind = item.need("type")?;
    let kind = match kind.string()? {
        "point" => LightKind::Point,
        "directional" => LightKind::Directional,
        "spot" => {
            let spot = item.get("spot")?;
            let angle = |key: &str, default: f64| -> Result<f64> {
                let angle = spot.as_ref().map_or(Ok(None), |spot| spot.get(key))?;
                angle.map_or(Ok(default), |angle| angle.within(0.0, std::f64::consts::FRAC_PI_2))
            };
            let (inner, outer) = (angle("innerConeAngle", 0.0)?, angle("outerConeAngle", std::f64::consts::FRAC_PI_4)?);
            if inner >= outer {
                return Err(item.error(format!("innerConeAngle {inner} must be below outerConeAngle {outer}")));
            }
            LightKind::Spot { inner, outer }
        }
        other => return Err(kind.error(format!("must be point, spot or directional, is \"{}\"", shorten(other)))),
    };
    Ok(Light {
        name,
        position: transform.translation * unit,
        direction: match kind {
            LightKind::Point => DVec3::NEG_Z,
            _ => axis(node, &transform.matrix3, DVec3::NEG_Z)?,
        },
        intensity: DVec3::from_array(color) * intensity,
        kind,
        range: range.map(|range| range * unit),
    })
}
