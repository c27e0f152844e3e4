//! Primitives of a glTF mesh: checked arrays of vertices, with morph targets at their weights, and triangles.

use super::accessor::{Arrays, DECODE};
use super::json::Item;
use crate::Result;
use glam::DVec3;

/// A primitive as the file holds it, its vertices where the weights of its morph targets have them.
#[derive(Clone)]
pub(super) struct Primitive<'a> {
    pub item: Item<'a>,
    pub positions: Vec<DVec3>,
    pub normals: Option<Vec<DVec3>>,
    /// Directions of growing u, and handedness.
    pub tangents: Option<Vec<(DVec3, f64)>>,
    /// TEXCOORD_0 and TEXCOORD_1, where a texture needs them.
    pub coordinates: [Option<Vec<[f32; 2]>>; 2],
    /// (joint, weight) pairs of each vertex.
    pub joints: Option<Vec<Vec<(usize, f64)>>>,
    pub corners: Vec<[u32; 3]>,
    pub material: usize,
}

/// Names of the coordinates.
const TEXCOORDS: [&str; 2] = ["TEXCOORD_0", "TEXCOORD_1"];

/// What a material's textures need of a primitive.
#[derive(Clone, Copy, Default)]
pub(super) struct Needs {
    pub sets: [bool; 2],
    pub tangents: bool,
}

/// Reads a primitive; none if it has no triangles. `needs` says what the material of an index needs, and the last one is
/// the default material.
pub(super) fn read<'a>(
    arrays: &Arrays<'a>,
    item: Item<'a>,
    weights: &[f64],
    skinned: bool,
    needs: &[Needs],
    warnings: &mut Vec<String>,
) -> Result<Option<Primitive<'a>>> {
    let mode = item.get("mode")?.map_or(Ok(4), |mode| mode.index(7, "primitive modes"))?;
    if mode < 4 {
        warnings.push(item.note("points and lines are not modelled; the primitive is left out"));
        return Ok(None);
    }
    if item.extension("KHR_draco_mesh_compression")?.is_some() {
        let problem =
            format!("is compressed with Draco (KHR_draco_mesh_compression), which is not supported: {DECODE}");
        return Err(item.error(problem));
    }
    let attributes = item.need("attributes")?;
    for key in attributes.keys()? {
        let reference = attributes.need(key)?;
        if let Some(extension) = arrays.compression(&reference)? {
            return Err(reference.error(format!("is compressed ({extension}), which is not supported: {DECODE}")));
        }
    }
    if attributes.get("COLOR_0")?.is_some() {
        warnings.push(attributes.note("vertex colours are not modelled"));
    }
    let Some(positions) = attributes.get("POSITION")? else {
        warnings.push(item.note("has no POSITION; the primitive is left out"));
        return Ok(None);
    };
    let material = match item.get("material")? {
        Some(material) => material.index(needs.len() - 1, "materials")?,
        None => needs.len() - 1,
    };
    let mut positions = arrays.vectors(&positions)?;
    let count = positions.len();
    let mut normals = attributes.get("NORMAL")?.map(|normals| arrays.vectors(&normals)).transpose()?;
    let mut tangents = None;
    if needs[material].tangents
        && let Some(reference) = attributes.get("TANGENT")?
    {
        let numbers = arrays.numbers::<4>(&reference, "VEC4")?;
        tangents = Some(numbers.into_iter().map(tangent).collect::<Vec<_>>());
    }
    morph(arrays, &item, weights, &mut positions, normals.as_deref_mut(), tangents.as_deref_mut())?;
    let mut coordinates = [None, None];
    for (set, key) in TEXCOORDS.into_iter().enumerate().filter(|(set, _)| needs[material].sets[*set]) {
        if let Some(reference) = attributes.get(key)? {
            let numbers = arrays.numbers::<2>(&reference, "VEC2")?;
            coordinates[set] = Some(numbers.iter().map(|pair| pair.map(|number| number as f32)).collect());
        }
    }
    let joints = if skinned { Some(read_joints(arrays, &item, &attributes, count)?) } else { None };
    let corners = read_corners(arrays, &item, mode, count)?;
    let primitive = Primitive { item, positions, normals, tangents, coordinates, joints, corners, material };
    primitive.check(&needs[material], warnings)?;
    Ok(Some(primitive))
}

/// A direction with handedness, of which the sign counts.
pub(super) fn tangent([x, y, z, w]: [f64; 4]) -> (DVec3, f64) {
    (DVec3::new(x, y, z), if w < 0.0 { -1.0 } else { 1.0 })
}

impl Primitive<'_> {
    /// Refuses arrays that do not fit one another, and numbers that are not finite; says what textures lack.
    pub fn check(&self, needs: &Needs, warnings: &mut Vec<String>) -> Result<()> {
        let Primitive { item, positions, normals, tangents, coordinates, .. } = self;
        let count = positions.len();
        let vectors = |what: &str, vectors: &mut dyn ExactSizeIterator<Item = DVec3>| {
            if vectors.len() != count {
                return Err(item.error(format!("has {} {what}s for {count} positions", vectors.len())));
            }
            match vectors.enumerate().find(|(_, vector)| !vector.is_finite()) {
                None => Ok(()),
                Some((at, vector)) => Err(item.error(format!("the {what} of vertex {at} is {:?}", vector.to_array()))),
            }
        };
        vectors("position", &mut positions.iter().copied())?;
        if let Some(normals) = normals {
            vectors("normal", &mut normals.iter().copied())?;
        }
        if let Some(tangents) = tangents {
            vectors("tangent", &mut tangents.iter().map(|(tangent, _)| *tangent))?;
        }
        for (set, key) in TEXCOORDS.into_iter().enumerate().filter(|(set, _)| needs.sets[*set]) {
            let Some(uv) = &coordinates[set] else {
                warnings.push(item.note(format!("has no {key}, so its textures show one texel")));
                continue;
            };
            if uv.len() != count {
                return Err(item.error(format!("has {} {key} for {count} positions", uv.len())));
            }
            if let Some(vertex) = uv.iter().position(|uv| !uv.iter().all(|number| number.is_finite())) {
                return Err(item.error(format!("{key} of vertex {vertex} is {:?}", uv[vertex])));
            }
        }
        Ok(())
    }
}

/// Adds the displacements of the morph targets, times their weights.
fn morph(
    arrays: &Arrays,
    item: &Item,
    weights: &[f64],
    positions: &mut [DVec3],
    normals: Option<&mut [DVec3]>,
    tangents: Option<&mut [(DVec3, f64)]>,
) -> Result<()> {
    let targets = item.list("targets")?;
    if !weights.is_empty() && weights.len() != targets.len() {
        return Err(item.error(format!("has {} morph targets, but {} weights", targets.len(), weights.len())));
    }
    let active: Vec<(&Item, f64)> = targets.iter().zip(weights.iter().copied()).filter(|(_, w)| *w != 0.0).collect();
    let displacements = |target: &Item, key: &str, count: usize| -> Result<Vec<DVec3>> {
        let Some(reference) = target.get(key)? else { return Ok(Vec::new()) };
        if let Some(extension) = arrays.compression(&reference)? {
            return Err(reference.error(format!("is compressed ({extension}), which is not supported: {DECODE}")));
        }
        let found = arrays.vectors(&reference)?;
        match found.len() == count {
            true => Ok(found),
            false => Err(reference.error(format!("has {} displacements for {count} vertices", found.len()))),
        }
    };
    let count = positions.len();
    for (target, weight) in &active {
        positions.iter_mut().zip(displacements(target, "POSITION", count)?).for_each(|(x, d)| *x += *weight * d);
    }
    if let Some(normals) = normals {
        for (target, weight) in &active {
            normals.iter_mut().zip(displacements(target, "NORMAL", count)?).for_each(|(n, d)| *n += *weight * d);
        }
    }
    if let Some(tangents) = tangents {
        for (target, weight) in &active {
            tangents.iter_mut().zip(displacements(target, "TANGENT", count)?).for_each(|(t, d)| t.0 += *weight * d);
        }
    }
    Ok(())
}

/// The joints of each vertex and their weights, which are made to sum to 1.
fn read_joints(arrays: &Arrays, item: &Item, attributes: &Item, count: usize) -> Result<Vec<Vec<(usize, f64)>>> {
    let mut joints: Vec<Vec<(usize, f64)>> = vec![Vec::new(); count];
    for set in 0.. {
        let (names, shares) = (attributes.get(&format!("JOINTS_{set}"))?, attributes.get(&format!("WEIGHTS_{set}"))?);
        let (Some(names), Some(shares)) = (names, shares) else { break };
        let (names, shares) = (arrays.numbers::<4>(&names, "VEC4")?, arrays.numbers::<4>(&shares, "VEC4")?);
        if names.len() != count || shares.len() != count {
            let (names, shares) = (names.len(), shares.len());
            return Err(item.error(format!("has {names} joints and {shares} weights for {count} positions")));
        }
        for ((vertex, names), shares) in joints.iter_mut().zip(names).zip(shares) {
            vertex.extend(names.into_iter().map(|name| name as usize).zip(shares).filter(|(_, share)| *share != 0.0));
        }
    }
    for (index, vertex) in joints.iter_mut().enumerate() {
        let sum = vertex.iter().map(|(_, share)| share).sum::<f64>() + 0.0;
        if !(sum > 0.0 && sum.is_finite() && vertex.iter().all(|(_, share)| *share >= 0.0)) {
            return Err(item.error(format!("vertex {index} of a skin has joint weights of sum {sum}")));
        }
        vertex.iter_mut().for_each(|(_, share)| *share /= sum);
    }
    Ok(joints)
}

/// The vertices of each triangle.
fn read_corners(arrays: &Arrays, item: &Item, mode: usize, count: usize) -> Result<Vec<[u32; 3]>> {
    let order = match item.get("indices")? {
        Some(indices) => {
            if let Some(extension) = arrays.compression(&indices)? {
                return Err(indices.error(format!("is compressed ({extension}), which is not supported: {DECODE}")));
            }
            arrays.indices(&indices)?
        }
        None => (0..u32::try_from(count).map_err(|_| item.error("has too many vertices"))?).collect(),
    };
    corners(item, &order, mode, count)
}

/// The vertices of each triangle of a glTF mode: a list (4), strip or fan.
pub(super) fn corners(item: &Item, order: &[u32], mode: usize, count: usize) -> Result<Vec<[u32; 3]>> {
    if let Some(place) = order.iter().position(|&index| index as usize >= count) {
        return Err(item.error(format!("index {place} is {}, but there are {count} vertices", order[place])));
    }
    Ok(match mode {
        4 if !order.len().is_multiple_of(3) => {
            return Err(item.error(format!("{} vertices are no whole number of triangles", order.len())));
        }
        4 => order.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
        5 => {
            (0..order.len().saturating_sub(2)).map(|i| [order[i], order[i + 1 + i % 2], order[i + 2 - i % 2]]).collect()
        }
        _ => (1..order.len().saturating_sub(1)).map(|i| [order[i], order[i + 1], order[0]]).collect(),
    })
}
