//! Primitives that were placed: triangles in metres, with normals, materials and sets.

use super::json::Item;
use super::primitive::{Needs, Primitive};
use super::sets::{self, Group};
use super::{Material, Set, Texture};
use crate::shared::{Coordinates, TEXTURE_NORMAL};
use crate::{Error, Result};
use glam::{DAffine3, DMat3, DVec3, Vec2, Vec3};
use std::path::Path;

/// Most triangles of a scene: their numbers, and those of the BVH's nodes, must fit into 32 bits.
pub(super) const TRIANGLES_MAX: usize = 100_000_000;
/// A triangle is dropped as one of zero area if twice its area is below this share of its longest edge squared:
/// edges rounded to f32 would then say little about its normal.
const FLATNESS_MIN: f64 = 1e-6;
/// Most vertices.
pub(super) const VERTICES_MAX: usize = 4 * TRIANGLES_MAX;
/// Largest coordinate (m), and largest number of a transform.
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
    /// Index of what textures need of it.
    coordinates: Option<u32>,
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

/// Where a primitive is shown.
pub(super) struct Place<'n, 'a> {
    /// What shows it, for messages.
    pub node: &'n Item<'a>,
    pub transform: &'n DAffine3,
    /// Metres of a unit of its positions.
    pub unit: f64,
}

/// All that was placed so far.
pub(super) struct Placed {
    /// What the textures of each material need.
    pub needs: Vec<Needs>,
    normal_maps: Vec<Option<Texture>>,
    hidden: Vec<bool>,
    /// Sets that materials name.
    sets: Vec<Option<String>>,
    textured: bool,
    /// Placed vertices (m).
    positions: Vec<DVec3>,
    triangles: Vec<Triangle>,
    groups: Vec<Group>,
    /// What textures need of triangles.
    coordinates: Vec<Coordinates>,
    dropped: u64,
    /// Vertices of triangles below which their normal points.
    below: u64,
}

impl Placed {
    pub fn new(materials: &[Material]) -> Placed {
        let needs = |material: &Material| {
            let mut needs = Needs { tangents: normal_map(material).is_some(), ..Needs::default() };
            material.textures.iter().flatten().for_each(|texture| needs.sets[texture.set as usize] = true);
            needs
        };
        Placed {
            textured: materials.iter().any(Material::is_textured),
            needs: materials.iter().map(needs).collect(),
            normal_maps: materials.iter().map(normal_map).collect(),
            hidden: materials.iter().map(|material| material.hidden).collect(),
            sets: materials.iter().map(|material| material.set.clone()).collect(),
            positions: Vec::new(),
            triangles: Vec::new(),
            groups: Vec::new(),
            coordinates: Vec::new(),
            dropped: 0,
            below: 0,
        }
    }

    /// Whether a material has no surface.
    pub fn is_hidden(&self, material: usize) -> bool {
        self.hidden[material]
    }

    /// The number of a new group: the triangles of a material on what has this name and may name a set.
    pub fn add_group(&mut self, node: String, material: usize, set: Option<String>) -> u32 {
        let set = set.or_else(|| self.sets[material].clone());
        self.groups.push(Group { node, material, set });
        self.groups.len() as u32 - 1
    }

    /// Adds the triangles of a primitive that was checked.
    pub fn place(&mut self, place: &Place, primitive: &Primitive, group: u32) -> Result<()> {
        let Place { node, transform, unit: metres } = *place;
        if self.triangles.len() + primitive.corners.len() > TRIANGLES_MAX {
            return Err(node.error(format!("the scene has more than {TRIANGLES_MAX} triangles")));
        }
        if self.positions.len() + primitive.positions.len() > VERTICES_MAX {
            return Err(node.error(format!("the scene has more than {VERTICES_MAX} vertices")));
        }
        let linear = transform.matrix3 * metres;
        let translation = transform.translation * metres;
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
                let problem = format!("{} places a vertex beyond {COORDINATE_MAX} m", node.path);
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
            let edges = [edge1, edge2];
            let coordinates = self.textured.then(|| {
                self.coordinates.push(self.coordinates_of(primitive, order, &linear, mirrored, edges, geometric));
                self.coordinates.len() as u32 - 1
            });
            self.triangles.push(Triangle {
                corner,
                edge1,
                edge2,
                normals,
                material: primitive.material as u32,
                set: group,
                vertices: order.map(|vertex| first + vertex as u32),
                coordinates,
                opposed,
                turned: false,
            });
        }
        Ok(())
    }

    /// What textures need of the triangle of three vertices.
    fn coordinates_of(
        &self,
        primitive: &Primitive,
        order: [usize; 3],
        linear: &DMat3,
        mirrored: bool,
        edges: [DVec3; 2],
        geometric: DVec3,
    ) -> Coordinates {
        let mut out = Coordinates { handedness: 1.0, ..Coordinates::default() };
        for (set, coordinates) in primitive.coordinates.iter().enumerate() {
            let Some(coordinates) = coordinates else { continue };
            order.iter().enumerate().for_each(|(i, &corner)| out.uv[3 * set + i] = Vec2::from(coordinates[corner]));
        }
        let Some(map) = &self.normal_maps[primitive.material] else { return out };
        if let Some(tangents) = &primitive.tangents {
            out.tangent = order.map(|corner| unit(*linear * tangents[corner].0).unwrap_or(DVec3::ZERO).as_vec3());
            out.handedness = (tangents[order[0]].1 * if mirrored { -1.0 } else { 1.0 }) as f32;
        } else if let Some((tangent, handedness)) = tangent(map, &out, edges, geometric) {
            out.tangent = [tangent.as_vec3(); 3];
            out.handedness = handedness;
        }
        out
    }

    /// What textures need of a triangle as it is wound in the end.
    fn final_coordinates(&self, triangle: &Triangle) -> Option<Coordinates> {
        let mut out = self.coordinates[triangle.coordinates? as usize];
        out.material = triangle.material;
        if triangle.turned {
            [(1, 2), (4, 5)].into_iter().for_each(|(a, b)| out.uv.swap(a, b));
            out.tangent.swap(1, 2);
            out.handedness = -out.handedness;
        }
        Some(out)
    }

    /// Removes materials that no triangle uses.
    pub fn drop_unused(&mut self, materials: &mut Vec<Material>) {
        let mut used = vec![false; materials.len()];
        for triangle in &self.triangles {
            used[triangle.material as usize] = true;
        }
        let numbers = renumber(materials, &used);
        for triangle in &mut self.triangles {
            triangle.material = numbers[triangle.material as usize];
        }
        for group in &mut self.groups {
            group.material = numbers[group.material] as usize;
        }
    }

    /// All that was placed.
    ///
    /// # Errors
    /// If there is no triangle, or matter of different indices of refraction is in one set.
    pub fn finish(mut self, file: &Path, materials: &[Material], warnings: &mut Vec<String>) -> Result<Finished> {
        if self.triangles.is_empty() {
            let dropped = if self.dropped == 0 { String::new() } else { format!(" but {} of zero area", self.dropped) };
            return Err(Error::scene(file, "scene", format!("has no triangles{dropped}")));
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
        let coordinates = match materials.iter().any(Material::is_textured) {
            true => self.triangles.iter().filter_map(|triangle| self.final_coordinates(triangle)).collect(),
            false => Vec::new(),
        };
        let Placed { triangles, positions, dropped, .. } = self;
        Ok(Finished { triangles, positions, coordinates, sets, dropped })
    }
}

/// Refuses a transform to the world that is not finite, or huge.
pub(super) fn check_transform(item: &Item, transform: &DAffine3) -> Result<()> {
    match transform.is_finite() && transform.to_cols_array().iter().all(|value| value.abs() <= COORDINATE_MAX) {
        true => Ok(()),
        false => Err(item.error(format!("its transform to the world exceeds {COORDINATE_MAX}"))),
    }
}

/// All triangles of a scene.
pub(super) struct Finished {
    pub triangles: Vec<Triangle>,
    /// Placed vertices (m).
    pub positions: Vec<DVec3>,
    /// One for each triangle, or none without textures.
    pub coordinates: Vec<Coordinates>,
    pub sets: Vec<Set>,
    /// Triangles of zero area.
    pub dropped: u64,
}

fn normal_map(material: &Material) -> Option<Texture> {
    material.textures[TEXTURE_NORMAL as usize]
}

/// The direction of growing u of a normal map on a triangle, and the sign with which normal x tangent points up the
/// picture, against growing v: x and y of a map's normals are right and up. None where the map is folded to a line.
fn tangent(map: &Texture, at: &Coordinates, [edge1, edge2]: [DVec3; 2], normal: DVec3) -> Option<(DVec3, f32)> {
    let uv = |i: usize| {
        let uv = at.uv[3 * map.set as usize + i].as_dvec2().extend(1.0);
        glam::DVec2::new(map.rows[0].dot(uv), map.rows[1].dot(uv))
    };
    let (d1, d2) = (uv(1) - uv(0), uv(2) - uv(0));
    let determinant = d1.perp_dot(d2);
    let along = unit((edge1 * d2.y - edge2 * d1.y) * determinant.signum()).filter(|_| determinant != 0.0)?;
    let up = (edge1 * d2.x - edge2 * d1.x) * determinant.signum();
    Some((along, if normal.cross(along).dot(up) < 0.0 { -1.0 } else { 1.0 }))
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
pub(super) fn cofactors(matrix: &DMat3) -> DMat3 {
    let DMat3 { x_axis, y_axis, z_axis } = *matrix;
    DMat3::from_cols(y_axis.cross(z_axis), z_axis.cross(x_axis), x_axis.cross(y_axis))
}
