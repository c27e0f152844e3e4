//! Meshes of a glTF file, placed by their nodes: triangles in metres, with normals, materials and sets.

use super::accessor::Arrays;
use super::json::Item;
use super::sets::{self, Group};
use super::{Material, Set};
use crate::Result;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use std::collections::HashMap;
use std::path::Path;
use std::rc::Rc;

/// Most triangles of a scene: their numbers, and those of the BVH's nodes, must fit into 32 bits.
const TRIANGLES_MAX: usize = 100_000_000;
/// A triangle is dropped as one of zero area if twice its area is below this share of its longest edge squared:
/// edges rounded to f32 would then say little about its normal.
const FLATNESS_MIN: f64 = 1e-6;
/// Largest coordinate (m).
const COORDINATE_MAX: f64 = 1e30;

/// A triangle in metres.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Triangle {
    pub corner: DVec3,
    /// Formed before the node's translation is added, so that a far scene keeps its digits.
    pub edge1: DVec3,
    pub edge2: DVec3,
    /// Unit normals at the vertices.
    pub normals: [Vec3; 3],
    pub material: u32,
    /// Index of the set; while meshes are placed, of the group.
    pub set: u32,
    /// Indices of the placed vertices.
    pub vertices: [u32; 3],
    /// Whether its normals all pointed against its winding, and were turned.
    pub opposed: bool,
    /// Whether its winding was turned.
    pub turned: bool,
}

impl Triangle {
    /// Makes the other side the outer one.
    pub fn turn(&mut self) {
        std::mem::swap(&mut self.edge1, &mut self.edge2);
        self.normals = [0, 2, 1].map(|corner| -self.normals[corner]);
        self.vertices.swap(1, 2);
        self.turned = !self.turned;
    }
}

/// A node that shows a mesh.
pub(super) struct Instance<'n, 'a> {
    pub node: &'n Item<'a>,
    pub name: String,
    /// The set that the node names for its surfaces.
    pub set: Option<String>,
    pub transform: &'n DAffine3,
    /// Metres of a unit of the file.
    pub unit: f64,
}

/// A primitive as the file holds it.
struct Primitive<'a> {
    item: Item<'a>,
    positions: Vec<DVec3>,
    normals: Option<Vec<DVec3>>,
    corners: Vec<[u32; 3]>,
    material: usize,
}

/// Reads meshes when they are first shown, and collects triangles.
pub(super) struct Meshes<'r, 'a> {
    arrays: &'r Arrays<'a>,
    items: Vec<Item<'a>>,
    default_material: usize,
    loaded: HashMap<usize, Rc<Vec<Primitive<'a>>>>,
    vertices: usize,
    /// Placed vertices (m).
    positions: Vec<DVec3>,
    triangles: Vec<Triangle>,
    groups: Vec<Group>,
    dropped: u64,
    /// Vertices of triangles below which their normal points.
    below: u64,
}

impl<'r, 'a> Meshes<'r, 'a> {
    /// `default_material` is the index after the file's last material.
    pub fn new(root: &Item<'a>, arrays: &'r Arrays<'a>, default_material: usize) -> Result<Self> {
        Ok(Meshes {
            arrays,
            items: root.list("meshes")?,
            default_material,
            loaded: HashMap::new(),
            vertices: 0,
            positions: Vec::new(),
            triangles: Vec::new(),
            groups: Vec::new(),
            dropped: 0,
            below: 0,
        })
    }

    /// Adds the triangles of the mesh at `reference`, as `instance` shows it.
    pub fn place(&mut self, instance: &Instance, reference: &Item<'a>, warnings: &mut Vec<String>) -> Result<()> {
        let index = reference.index(self.items.len(), "meshes")?;
        let primitives = match self.loaded.get(&index) {
            Some(primitives) => primitives.clone(),
            None => {
                let primitives = Rc::new(self.load(index, warnings)?);
                self.loaded.insert(index, primitives.clone());
                primitives
            }
        };
        let mut groups: HashMap<usize, usize> = HashMap::new();
        for primitive in primitives.iter() {
            let group = *groups.entry(primitive.material).or_insert_with(|| {
                let (node, set) = (instance.name.clone(), instance.set.clone());
                self.groups.push(Group { node, material: primitive.material, set });
                self.groups.len() - 1
            });
            self.place_primitive(instance, primitive, group as u32)?;
        }
        Ok(())
    }

    fn place_primitive(&mut self, instance: &Instance, primitive: &Primitive, group: u32) -> Result<()> {
        if self.triangles.len() + primitive.corners.len() > TRIANGLES_MAX {
            return Err(instance.node.error(format!("the scene has more than {TRIANGLES_MAX} triangles")));
        }
        let linear = instance.transform.matrix3 * instance.unit;
        let translation = instance.transform.translation * instance.unit;
        let mirrored = linear.determinant() < 0.0;
        let normal_matrix = cofactors(&linear) * if mirrored { -1.0 } else { 1.0 };
        let first = self.positions.len() as u32;
        self.positions.extend(primitive.positions.iter().map(|&position| linear * position + translation));
        for corners in &primitive.corners {
            let mut order = corners.map(|corner| corner as usize);
            if mirrored {
                order.swap(1, 2);
            }
            let [a, b, c] = order.map(|corner| primitive.positions[corner]);
            let corner = linear * a + translation;
            let (edge1, edge2) = (linear * (b - a), linear * (c - a));
            let inside = |vector: DVec3| vector.is_finite() && vector.abs().max_element() < COORDINATE_MAX;
            if !(inside(corner) && inside(edge1) && inside(edge2)) {
                let problem = format!("{} places a vertex beyond {COORDINATE_MAX} m", instance.node.path);
                return Err(primitive.item.error(problem));
            }
            let Some(geometric) = normal(edge1, edge2) else {
                self.dropped += 1;
                continue;
            };
            let mut normals = [geometric.as_vec3(); 3];
            let mut opposed = false;
            if let Some(authored) = &primitive.normals {
                let mut authored = order.map(|corner| unit(normal_matrix * authored[corner]).unwrap_or(geometric));
                if authored.iter().all(|normal| normal.dot(geometric) < 0.0) {
                    // The winding says where the matter is.
                    authored = authored.map(|normal| -normal);
                    opposed = true;
                }
                for (normal, authored) in normals.iter_mut().zip(authored) {
                    // Normals on both sides of a triangle could cancel between its vertices.
                    if authored.dot(geometric) > 0.0 {
                        *normal = authored.as_vec3();
                    } else {
                        self.below += 1;
                    }
                }
            }
            self.triangles.push(Triangle {
                corner,
                edge1,
                edge2,
                normals,
                material: primitive.material as u32,
                set: group,
                vertices: order.map(|vertex| first + vertex as u32),
                opposed,
                turned: false,
            });
        }
        Ok(())
    }

    fn load(&mut self, index: usize, warnings: &mut Vec<String>) -> Result<Vec<Primitive<'a>>> {
        let mesh = self.items[index].clone();
        let mut primitives = Vec::new();
        for item in mesh.need("primitives")?.elements()? {
            if let Some(primitive) = self.load_primitive(item, warnings)? {
                self.vertices = self.vertices.saturating_add(primitive.positions.len() + primitive.corners.len());
                if self.vertices > 4 * TRIANGLES_MAX {
                    return Err(mesh.error(format!("the scene has more than {} vertices", 4 * TRIANGLES_MAX)));
                }
                primitives.push(primitive);
            }
        }
        Ok(primitives)
    }

    fn load_primitive(&self, item: Item<'a>, warnings: &mut Vec<String>) -> Result<Option<Primitive<'a>>> {
        let mode = item.get("mode")?.map_or(Ok(4), |mode| mode.index(7, "primitive modes"))?;
        if mode < 4 {
            warnings.push(item.note("points and lines are not modelled; the primitive is left out"));
            return Ok(None);
        }
        if item.extension("KHR_draco_mesh_compression")?.is_some() {
            return Err(item.error(
                "is compressed with Draco, which is not supported: decode the file first, for example by importing it \
                 into Blender and exporting it without compression",
            ));
        }
        if !item.list("targets")?.is_empty() {
            warnings.push(item.note("morph targets are not modelled; the rest pose is shown"));
        }
        let attributes = item.need("attributes")?;
        if attributes.get("COLOR_0")?.is_some() {
            warnings.push(attributes.note("vertex colours are not modelled"));
        }
        let Some(positions) = attributes.get("POSITION")? else {
            warnings.push(item.note("has no POSITION; the primitive is left out"));
            return Ok(None);
        };
        let positions = self.arrays.vectors(&positions)?;
        if let Some(vertex) = positions.iter().position(|position| !position.is_finite()) {
            return Err(item.error(format!("the position of vertex {vertex} is {:?}", positions[vertex].to_array())));
        }
        let normals = attributes.get("NORMAL")?.map(|normals| self.arrays.vectors(&normals)).transpose()?;
        if let Some(normals) = &normals {
            if normals.len() != positions.len() {
                let (normals, positions) = (normals.len(), positions.len());
                return Err(item.error(format!("has {normals} normals for {positions} positions")));
            }
            if let Some(vertex) = normals.iter().position(|normal| !normal.is_finite()) {
                return Err(item.error(format!("the normal of vertex {vertex} is {:?}", normals[vertex].to_array())));
            }
        }
        let order = match item.get("indices")? {
            Some(indices) => self.arrays.indices(&indices)?,
            None => (0..u32::try_from(positions.len()).map_err(|_| item.error("has too many vertices"))?).collect(),
        };
        if let Some(place) = order.iter().position(|&index| index as usize >= positions.len()) {
            let (index, count) = (order[place], positions.len());
            return Err(item.error(format!("index {place} is {index}, but there are {count} vertices")));
        }
        let corners: Vec<[u32; 3]> = match mode {
            4 if order.len() % 3 != 0 => {
                return Err(item.error(format!("{} vertices are no whole number of triangles", order.len())));
            }
            4 => order.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
            5 => (0..order.len().saturating_sub(2))
                .map(|i| [order[i], order[i + 1 + i % 2], order[i + 2 - i % 2]])
                .collect(),
            _ => (1..order.len().saturating_sub(1)).map(|i| [order[i], order[i + 1], order[0]]).collect(),
        };
        let material = match item.get("material")? {
            Some(material) => material.index(self.default_material, "materials")?,
            None => self.default_material,
        };
        Ok(Some(Primitive { item, positions, normals, corners, material }))
    }

    /// The triangles, their sets and the count of dropped ones. Materials that no triangle uses are removed.
    ///
    /// # Errors
    /// If matter of different indices of refraction is in one set.
    pub fn finish(
        mut self,
        file: &Path,
        materials: &mut Vec<Material>,
        warnings: &mut Vec<String>,
    ) -> Result<(Vec<Triangle>, Vec<Set>, u64)> {
        let mut used = vec![false; materials.len()];
        for triangle in &self.triangles {
            used[triangle.material as usize] = true;
        }
        for group in &mut self.groups {
            group.set = group.set.take().or_else(|| materials[group.material].set.clone());
        }
        let numbers = renumber(materials, &used);
        for triangle in &mut self.triangles {
            triangle.material = numbers[triangle.material as usize];
        }
        for group in &mut self.groups {
            group.material = numbers[group.material] as usize;
        }
        let sets = sets::resolve(file, &mut self.triangles, &self.positions, &self.groups, materials, warnings)?;
        if self.dropped > 0 {
            warnings.push(format!("triangles of zero area were dropped: {}", self.dropped));
        }
        let count = self.triangles.iter().filter(|triangle| triangle.opposed && !triangle.turned).count();
        if count > 0 {
            let inside_out = 2 * count > self.triangles.len();
            let guess = if inside_out { "; the file may be inside out" } else { "" };
            warnings
                .push(format!("triangles whose normals point against their winding, and were turned: {count}{guess}"));
        }
        if self.below > 0 {
            warnings.push(format!(
                "vertex normals below their triangle were replaced by the triangle's own: {}",
                self.below
            ));
        }
        Ok((self.triangles, sets, self.dropped))
    }
}

/// Keeps the used items of a list; the new index of each.
fn renumber<T>(items: &mut Vec<T>, used: &[bool]) -> Vec<u32> {
    let mut next = 0;
    let numbers = used
        .iter()
        .map(|&used| {
            next += u32::from(used);
            next.saturating_sub(1)
        })
        .collect();
    let mut keep = used.iter();
    items.retain(|_| keep.next().copied().unwrap_or(false));
    numbers
}

/// The unit normal of a triangle, or none for one of (nearly) zero area.
fn normal(edge1: DVec3, edge2: DVec3) -> Option<DVec3> {
    let longest = edge1.length_squared().max(edge2.length_squared()).max((edge2 - edge1).length_squared());
    let cross = edge1.cross(edge2);
    // Lengths outside the range of f64's squares have no normal we could form; they are dropped too.
    let area = cross.length();
    if !(area > FLATNESS_MIN * longest && area > 0.0 && area.is_finite()) {
        return None;
    }
    unit(cross)
}

/// The vector at unit length, whatever its length was.
fn unit(vector: DVec3) -> Option<DVec3> {
    let largest = vector.abs().max_element();
    if largest > 0.0 && largest.is_finite() { (vector / largest).try_normalize() } else { None }
}

/// The matrix of cofactors, det(M) times the inverse transpose: it carries normals, even where M is singular.
fn cofactors(matrix: &DMat3) -> DMat3 {
    let DMat3 { x_axis, y_axis, z_axis } = *matrix;
    DMat3::from_cols(y_axis.cross(z_axis), z_axis.cross(x_axis), x_axis.cross(y_axis))
}
