//! A checked scene: plain data in f64 metres, and geometry in f32 internal units. No Vulkan.

mod accessor;
pub(crate) mod bvh;
mod camera;
mod check;
mod environment;
mod frame;
mod gltf;
mod hash;
mod instance;
mod json;
mod make;
mod material;
mod medium;
mod mesh;
mod parts;
mod picture;
mod presets;
mod primitive;
mod scattering;
mod sets;
mod skin;
mod texture;
mod unit;

pub use parts::Mesh;
pub use presets::{Preset, preset, presets};
pub use unit::parse_unit;

pub(crate) use check::{check_camera, check_light, check_material, check_scene};
pub(crate) use hash::{Geometry, geometry, hash};

use crate::{
    Error, Result,
    settings::{Directional, Model, SingleScattering},
    shared,
    timeline::{self, Timeline},
};
use glam::DVec3;
use std::path::{Path, PathBuf};

/// A scene that passed every check of [`Scene::load`] or [`Scene::from_meshes`].
///
/// Its geometry stays. Materials, lights, cameras and pictures may be changed or filled in by the caller; what breaks a
/// rule then is refused when a renderer is made or [updated](crate::Renderer::update).
#[derive(Clone, Debug)]
pub struct Scene {
    /// Where it came from, for messages.
    pub file: PathBuf,
    /// From metres to internal units.
    pub frame: Frame,
    /// Triangles in leaf order, internal units.
    pub triangles: Vec<shared::Triangle>,
    /// Normals and material of each triangle, in the same order.
    pub shadings: Vec<shared::Shading>,
    /// Texture coordinates and tangents of each triangle, in the same order; none in a scene without textures.
    pub coordinates: Vec<shared::Coordinates>,
    /// Compressed wide BVH over `triangles`, five words a node.
    pub nodes: Vec<glam::UVec4>,
    pub materials: Vec<Material>,
    /// Pictures of the materials' textures.
    pub pictures: Vec<Picture>,
    /// Surfaces that exchange light; `Triangle::set` is an index into it.
    pub sets: Vec<Set>,
    pub lights: Vec<Light>,
    pub cameras: Vec<Camera>,
    pub environment: Environment,
    /// What the file asks for and we do not model, one sentence each.
    pub warnings: Vec<String>,
    /// Triangles of zero area, which were left out.
    pub dropped_triangles: u64,
    /// Hex SHA-256 of everything that determines the image, as it was loaded.
    pub hash: String,
}

/// How a file is to be read.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadOptions {
    /// Metres of one unit of the file's geometry, cameras and lights. Coefficients, attenuation distances, candela and
    /// lux do not depend on it.
    pub unit: f64,
    /// (name of a material, name of a preset that replaces its medium and index of refraction); the last one counts.
    pub materials: Vec<(String, String)>,
    /// What the multi-scatter colour of the scattering extensions means.
    pub albedo_mapping: AlbedoMapping,
    /// Where it is noted how long the parts of loading take.
    pub timeline: Option<Timeline>,
}

/// What the multi-scatter colour rho of KHR_materials_scatter and KHR_materials_volume_scatter means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AlbedoMapping {
    /// As the drafts have it: the diffuse albedo of matter without a boundary that reflects. With one it is seen darker:
    /// at an index of 1.5, .5 as .29.
    #[default]
    Gltf,
    /// The colour that is seen: the total of the standard dipole with its boundary is rho, so that in uniform white light
    /// of radiance 1 a plane shows Ft rho, and F of the surface on top, as a diffuse material of that base colour does.
    Surface,
}

/// How warnings about the environment begin; a new environment takes them back.
const ENVIRONMENT_WARNING: &str = "environment: ";

impl Default for LoadOptions {
    fn default() -> Self {
        LoadOptions { unit: 1.0, materials: Vec::new(), albedo_mapping: AlbedoMapping::Gltf, timeline: None }
    }
}

impl Scene {
    /// Reads a .gltf or .glb file with the default options.
    ///
    /// # Errors
    /// As [`Scene::load_with`].
    pub fn load(path: impl AsRef<Path>) -> Result<Scene> {
        Scene::load_with(path, &LoadOptions::default())
    }

    /// Reads a .gltf or .glb file.
    ///
    /// # Errors
    /// [`Error::File`] if it cannot be read; [`Error::Scene`] with file, item and problem for every rule that its
    /// contents break; [`Error::Setting`] for options that do not fit it. No input makes it panic.
    pub fn load_with(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Scene> {
        let path = path.as_ref();
        let _load = timeline::begin(&options.timeline, "load");
        let bytes = std::fs::read(path).map_err(|error| Error::file(path, error))?;
        Scene::from_bytes(path, &bytes, options)
    }

    /// Reads the contents of a .gltf or .glb file; buffers that they name are looked for beside `file`.
    ///
    /// # Errors
    /// As [`Scene::load_with`].
    pub fn from_bytes(file: impl AsRef<Path>, bytes: &[u8], options: &LoadOptions) -> Result<Scene> {
        let file = file.as_ref();
        if !(1e-9..=1e9).contains(&options.unit) {
            return Err(Error::setting("unit", format!("must be from 1e-9 to 1e9 metres, is {}", options.unit)));
        }
        Scene::assemble(file, gltf::read(file, bytes, options)?, &options.timeline)
    }

    /// From metres to internal units, with the BVH.
    fn assemble(file: &Path, raw: gltf::Raw, timeline: &Option<Timeline>) -> Result<Scene> {
        let gltf::Raw {
            triangles,
            positions,
            coordinates,
            dropped,
            materials,
            pictures,
            sets,
            lights,
            cameras,
            mut warnings,
        } = raw;
        let frame = frame::around(file, &triangles, &materials)?;
        frame::check_nodes(file, &frame, &lights, &cameras)?;
        let frame::Internal { triangles, shadings, coordinates, too_small } =
            frame::internal(file, &frame, &triangles, &positions, &coordinates)?;
        if too_small > 0 {
            warnings.push(format!("triangles too small for the scene's size were dropped: {too_small}"));
        }
        let building = timeline::begin(timeline, "bvh");
        let (nodes, order) = bvh::build(file, &triangles)?;
        drop(building);
        let mut scene = Scene {
            file: file.to_path_buf(),
            frame,
            triangles: order.iter().map(|&index| triangles[index as usize]).collect(),
            shadings: order.iter().map(|&index| shadings[index as usize]).collect(),
            coordinates: match coordinates.is_empty() {
                true => vec![],
                false => order.iter().map(|&index| coordinates[index as usize]).collect(),
            },
            nodes,
            materials,
            pictures,
            sets,
            lights,
            cameras,
            environment: Environment::default(),
            warnings,
            dropped_triangles: dropped + too_small,
            hash: String::new(),
        };
        scene.rehash();
        Ok(scene)
    }

    /// Replaces the light from infinitely far away, and brings [`Scene::hash`] up to date.
    ///
    /// Negative texels of an image (filters leave some around bright spots) become 0, with a warning that counts them.
    ///
    /// # Errors
    /// [`Error::Setting`] for radiance that is not finite, a constant that is negative, an image with more negative
    /// light than a hundredth of the positive or whose size does not fit its texels, a rotation that is not finite, a
    /// scale that is negative or not finite.
    pub fn set_environment(&mut self, mut environment: Environment) -> Result<()> {
        environment.check()?;
        self.warnings.retain(|warning| !warning.starts_with(ENVIRONMENT_WARNING));
        let raised = environment.raise_negative();
        if raised > 0 {
            self.warnings.push(format!("{ENVIRONMENT_WARNING}{raised} texels of negative radiance are taken as 0"));
        }
        self.environment = environment;
        self.rehash();
        Ok(())
    }

    fn rehash(&mut self) {
        self.hash = hash(self, geometry(self));
    }
}

/// Internal position = (metres - centre) * scale. Chosen so that the translucent geometry (all geometry if there is
/// none) is centred on 0 with radius 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Metres.
    pub centre: DVec3,
    /// Internal units per metre.
    pub scale: f64,
}

/// The surfaces that exchange light through the matter they bound: what a file names as one (`extras.bssrdf.set`), or one
/// material on one node and on other nodes where their borders meet it.
///
/// An open edge is a surface's border: the surface is rendered as that of matter which goes on behind it. At an edge of
/// three or more, as inside of doubled or self-intersecting surfaces, each triangle is lit as it is wound.
#[derive(Clone, Debug, PartialEq)]
pub struct Set {
    /// The name in the file, or node and material, for messages.
    pub name: String,
    /// Indices of the materials, ascending.
    pub materials: Vec<usize>,
    /// Edges of one triangle, if translucent.
    pub open_edges: u64,
    /// Edges of three triangles or more, if translucent.
    pub crowded_edges: u64,
}

/// A material as authored, lengths in metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    pub name: String,
    /// Linear base colour, 0 to 1.
    pub base_color: DVec3,
    /// 0 to 1.
    pub metallic: f64,
    /// 0 to 1; alpha = roughness^2.
    pub roughness: f64,
    /// Emitted radiance, >= 0.
    pub emission: DVec3,
    /// glTF's `doubleSided`: emission lights both sides. The camera sees both sides of everything.
    pub two_sided: bool,
    /// Index of refraction, inside over outside, > 0.
    pub ior: f64,
    /// What fills it; none for an opaque material.
    pub medium: Option<Medium>,
    /// The set that its surfaces join, wherever they are.
    pub set: Option<String>,
    /// Whether the base colour tints light where it crosses the surface of translucent matter: where an extension of glTF
    /// names the medium. Measured matter and coefficients have their own colour.
    pub tinted: bool,
    /// Media for the shares 0, 1/RAMP, ... 1 of the multi-scatter colour, if a texture scales it; else none.
    pub ramp: Vec<Medium>,
    /// By kind, TEXTURE_*. The texture of alpha has the scale factor / cutoff.
    pub textures: [Option<Texture>; shared::TEXTURE_KINDS as usize],
    /// Alpha is below the cutoff everywhere: there is no surface.
    pub hidden: bool,
}

impl Material {
    /// Whether it has any texture.
    pub fn is_textured(&self) -> bool {
        self.textures.iter().any(Option::is_some)
    }
}

/// A texture of a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texture {
    /// Index into [`Scene::pictures`].
    pub picture: usize,
    /// TEXCOORD_0 or TEXCOORD_1.
    pub set: u32,
    /// Across and down.
    pub wrap: [Wrap; 2],
    /// The nearest texel, not an interpolation.
    pub nearest: bool,
    /// Rows of the affine map from the mesh's coordinates to the picture's.
    pub rows: [DVec3; 2],
    /// Scale of a normal map's x and y.
    pub scale: f64,
}

impl Default for Texture {
    fn default() -> Self {
        let rows = [DVec3::X, DVec3::Y];
        Texture { picture: 0, set: 0, wrap: [Wrap::Repeat; 2], nearest: false, rows, scale: 1.0 }
    }
}

/// How a texture goes on beyond its edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    Repeat,
    Clamp,
    Mirror,
}

/// A decoded picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    pub width: u32,
    pub height: u32,
    /// From the upper left, row by row: red in the lowest byte, alpha in the highest.
    pub texels: Vec<u32>,
}

/// A scattering medium, per channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Medium {
    /// Reduced scattering coefficient [1/m], >= 0.
    pub sigma_s_prime: DVec3,
    /// Absorption coefficient [1/m], >= 0.
    pub sigma_a: DVec3,
    /// Mean cosine of the phase function, -1 to 1.
    pub g: DVec3,
    /// The surface albedo and length from which the coefficients came, if the file gives those.
    pub appearance: Option<Appearance>,
    /// The profile that the file names.
    pub model: Option<Model>,
    /// What the file says about the directional dipole.
    pub directional: Option<Directional>,
    /// What the file says about light scattered once.
    pub single_scattering: SingleScattering,
    /// Where the numbers came from: "preset skin1", "extras.bssrdf", "KHR_materials_scatter", ...
    pub source: String,
}

/// Matter as artists describe it, per channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Appearance {
    /// Total of the profile, 0 to 1.
    pub albedo: DVec3,
    /// Metres.
    pub length: DVec3,
    /// What the length is.
    pub kind: LengthKind,
}

/// A length that scales a profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LengthKind {
    /// 1 / sigma_t'.
    MeanFreePath,
    /// 1 / sigma_tr.
    DiffuseMeanFreePath,
}

/// A delta light, in metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    pub name: String,
    pub position: DVec3,
    /// Unit vector in which the light shines.
    pub direction: DVec3,
    /// Colour times intensity: W/sr (point, spot) or W/m^2 (directional).
    pub intensity: DVec3,
    pub kind: LightKind,
    /// Metres; none is infinite.
    pub range: Option<f64>,
}

/// What KHR_lights_punctual knows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    Point,
    /// Angles from the axis (radians), 0 <= inner < outer <= pi/2.
    Spot {
        inner: f64,
        outer: f64,
    },
    Directional,
}

/// A camera, in metres, looking along `forward`.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// The node's name, or the camera's.
    pub name: String,
    /// The name of the file's camera object, which several nodes may show; it chooses too.
    pub object_name: Option<String>,
    pub eye: DVec3,
    /// Orthonormal: right, up, forward.
    pub right: DVec3,
    pub up: DVec3,
    pub forward: DVec3,
    pub lens: Lens,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    Perspective {
        /// Full vertical angle (radians).
        yfov: f64,
        /// Width over height, if the file fixes it.
        aspect: Option<f64>,
    },
    Orthographic {
        /// Half width and half height (m).
        xmag: f64,
        ymag: f64,
    },
}

/// Light from infinitely far away.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    pub map: EnvironmentMap,
    /// Rotation about +Y (degrees), counter-clockwise seen from above.
    pub rotation: f64,
    /// Factor on the radiance.
    pub scale: f64,
}

impl Default for Environment {
    fn default() -> Self {
        Environment { map: EnvironmentMap::None, rotation: 0.0, scale: 1.0 }
    }
}

#[derive(Clone, Debug, Default, PartialEq)]
pub enum EnvironmentMap {
    #[default]
    None,
    /// The same radiance from everywhere.
    Constant(DVec3),
    /// A latitude-longitude image: rows from +Y down to -Y; the centre of the image is the direction +X,
    /// columns run towards +Z (u = 1/2 + atan2(z, x) / 2 pi).
    Image { width: u32, height: u32, radiance: Vec<glam::Vec3> },
}
