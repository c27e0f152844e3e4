//! Scenes of a caller's own vertices.

use super::json::{Item, shorten};
use super::mesh::{self, Finished, Place, Placed};
use super::primitive::{self, Primitive};
use super::{Material, Picture, Scene, check, gltf::Raw};
use crate::Result;
use glam::{DAffine3, DVec3};
use std::path::Path;

/// Triangles of one material, as an application has them.
///
/// ```
/// use translucent::scene::{Material, Mesh, Scene};
/// # fn main() -> translucent::Result<()> {
/// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let indices = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3];
/// let mesh = Mesh { name: "tetrahedron", positions: &positions, indices: &indices, ..Mesh::default() };
/// let scene = Scene::from_meshes(&[mesh], vec![Material::from_preset("marble")?], vec![])?;
/// assert_eq!((scene.triangles.len(), scene.sets[0].open_edges), (4, 0));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Mesh<'a> {
    /// For messages, and the name of its set.
    pub name: &'a str,
    /// Before the transform.
    pub positions: &'a [[f32; 3]],
    /// Three vertices of each triangle, counter-clockwise seen from outside.
    pub indices: &'a [u32],
    /// Of each vertex, of any length; without them triangles are flat.
    pub normals: Option<&'a [[f32; 3]]>,
    /// Texture coordinates 0 and 1 of each vertex.
    pub uvs: [Option<&'a [[f32; 2]]>; 2],
    /// Directions of growing u of each vertex, and the sign of the bitangent, for normal maps; without them they are
    /// found from the coordinates.
    pub tangents: Option<&'a [[f32; 4]]>,
    /// Index of the material.
    pub material: usize,
    /// The set that its surfaces join; else the material's.
    pub set: Option<&'a str>,
    /// To the world, in metres.
    pub transform: DAffine3,
}

/// Where messages say that such a scene comes from.
const FILE: &str = "the caller's meshes";

impl Scene {
    /// A scene of vertices in memory, which are copied. A mesh counts as a node of a glTF file with one material: the
    /// same rules make [sets](super::Set) of meshes, repair their winding, drop triangles without area, and warn.
    /// Materials keep their numbers. There is no light and no camera (one frames the scene) until the caller fills the
    /// [lights](Scene::lights), [cameras](Scene::cameras) and the [environment](Scene::set_environment); they are
    /// checked when a renderer is made.
    ///
    /// The BVH over the triangles is built on the host. Vertices that only a buffer of the device holds have to be read
    /// back by the caller, once.
    ///
    /// # Errors
    /// [`Error::Scene`](crate::Error::Scene) that names the mesh and what it breaks: an index beyond its vertices, arrays of other lengths,
    /// numbers that are not finite; geometry that is empty or too large; matter of several indices of refraction in one
    /// set. [`Error::Setting`](crate::Error::Setting) for materials and pictures that are none. No input makes it panic.
    pub fn from_meshes(meshes: &[Mesh], materials: Vec<Material>, pictures: Vec<Picture>) -> Result<Scene> {
        let file = Path::new(FILE);
        materials.iter().try_for_each(check::check_material)?;
        let mut warnings = Vec::new();
        let mut placed = Placed::new(&materials);
        for (index, mesh) in meshes.iter().enumerate() {
            let label = if mesh.name.is_empty() { String::new() } else { format!(" ({})", shorten(mesh.name)) };
            let item = Item::of_caller(file, format!("meshes[{index}]{label}"));
            if mesh.material >= materials.len() {
                return Err(item.error(format!("has material {} of {}", mesh.material, materials.len())));
            }
            if mesh.set.is_some_and(str::is_empty) {
                return Err(item.error("must name a set, names none"));
            }
            mesh::check_transform(&item, &mesh.transform)?;
            let corners = primitive::corners(&item, mesh.indices, 4, mesh.positions.len())?;
            let vectors = |list: &[[f32; 3]]| list.iter().map(|&vector| DVec3::from(vector.map(f64::from))).collect();
            let tangents =
                |list: &[[f32; 4]]| list.iter().map(|vector| primitive::tangent(vector.map(f64::from))).collect();
            let needs = placed.needs[mesh.material];
            let primitive = Primitive {
                item: item.clone(),
                positions: vectors(mesh.positions),
                normals: mesh.normals.map(vectors),
                tangents: mesh.tangents.filter(|_| needs.tangents).map(tangents),
                coordinates: mesh.uvs.map(|uvs| uvs.map(<[_]>::to_vec)),
                joints: None,
                corners,
                material: mesh.material,
            };
            primitive.check(&needs, &mut warnings)?;
            if placed.is_hidden(mesh.material) {
                continue;
            }
            let name = if mesh.name.is_empty() { format!("mesh {index}") } else { mesh.name.to_string() };
            let group = placed.add_group(name, mesh.material, mesh.set.map(String::from));
            placed.place(&Place { node: &item, transform: &mesh.transform, unit: 1.0 }, &primitive, group)?;
        }
        let Finished { triangles, positions, coordinates, sets, dropped } =
            placed.finish(file, &materials, &mut warnings)?;
        let (lights, cameras) = (vec![], vec![]);
        let raw =
            Raw { triangles, positions, coordinates, dropped, materials, pictures, sets, lights, cameras, warnings };
        let scene = Scene::assemble(file, raw, &None)?;
        check::check_scene(&scene)?;
        Ok(scene)
    }
}
