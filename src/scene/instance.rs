//! Meshes of a glTF file, shown by its nodes.

use super::accessor::Arrays;
use super::json::Item;
use super::mesh::{Place, Placed, VERTICES_MAX};
use super::primitive::{self, Primitive};
use super::skin;
use crate::Result;
use glam::DAffine3;
use std::collections::HashMap;
use std::rc::Rc;

/// A node that shows a mesh.
pub(super) struct Instance<'n, 'a> {
    pub node: &'n Item<'a>,
    pub name: String,
    /// The set that the node names for its surfaces.
    pub set: Option<String>,
    pub transform: &'n DAffine3,
    /// Metres of a unit of the file.
    pub unit: f64,
    /// The matrices of its skin's joints, which then place it and not the node's transform.
    pub joints: Option<Vec<DAffine3>>,
}

/// Reads meshes when they are first shown.
pub(super) struct Meshes<'r, 'a> {
    arrays: &'r Arrays<'a>,
    items: Vec<Item<'a>>,
    loaded: HashMap<(usize, Vec<u64>, bool), Rc<Vec<Primitive<'a>>>>,
    vertices: usize,
}

impl<'r, 'a> Meshes<'r, 'a> {
    pub fn new(root: &Item<'a>, arrays: &'r Arrays<'a>) -> Result<Self> {
        Ok(Meshes { arrays, items: root.list("meshes")?, loaded: HashMap::new(), vertices: 0 })
    }

    /// Places the mesh at `reference` as `instance` shows it. The last material is the default one.
    pub fn place(
        &mut self,
        instance: &Instance,
        reference: &Item<'a>,
        placed: &mut Placed,
        warnings: &mut Vec<String>,
    ) -> Result<()> {
        let index = reference.index(self.items.len(), "meshes")?;
        let weights = match instance.node.get("weights")? {
            Some(weights) => Some(weights),
            None => self.items[index].get("weights")?,
        };
        let weights = weights.map_or(Ok(Vec::new()), |weights| {
            weights.elements()?.iter().map(|weight| weight.number()).collect::<Result<Vec<_>>>()
        })?;
        let primitives = self.load(index, &weights, instance.joints.is_some(), placed, warnings)?;
        let mut groups: HashMap<usize, u32> = HashMap::new();
        for primitive in primitives.iter() {
            let material = primitive.material;
            if placed.is_hidden(material) {
                continue;
            }
            let group = *groups
                .entry(material)
                .or_insert_with(|| placed.add_group(instance.name.clone(), material, instance.set.clone()));
            let place = Place { node: instance.node, transform: instance.transform, unit: instance.unit };
            match &instance.joints {
                None => placed.place(&place, primitive, group)?,
                Some(joints) => {
                    let posed = skin::posed(primitive, joints)?;
                    placed.place(&Place { transform: &DAffine3::IDENTITY, ..place }, &posed, group)?;
                }
            }
        }
        Ok(())
    }

    /// The primitives of a mesh whose morph targets have these weights.
    fn load(
        &mut self,
        index: usize,
        weights: &[f64],
        skinned: bool,
        placed: &Placed,
        warnings: &mut Vec<String>,
    ) -> Result<Rc<Vec<Primitive<'a>>>> {
        let key = (index, weights.iter().map(|weight| weight.to_bits()).collect::<Vec<_>>(), skinned);
        if let Some(primitives) = self.loaded.get(&key) {
            return Ok(primitives.clone());
        }
        let mesh = self.items[index].clone();
        let mut primitives = Vec::new();
        for item in mesh.need("primitives")?.elements()? {
            if let Some(primitive) = primitive::read(self.arrays, item, weights, skinned, &placed.needs, warnings)? {
                self.vertices = self.vertices.saturating_add(primitive.positions.len() + primitive.corners.len());
                if self.vertices > VERTICES_MAX {
                    return Err(mesh.error(format!("the scene has more than {VERTICES_MAX} vertices")));
                }
                primitives.push(primitive);
            }
        }
        let primitives = Rc::new(primitives);
        self.loaded.insert(key, primitives.clone());
        Ok(primitives)
    }
}
