//! A checked, immutable scene: plain data in f64 metres, and geometry in f32 internal units. No Vulkan.

use crate::shared;
use glam::DVec3;
use std::path::PathBuf;

/// A scene that passed every check of [`Scene::load`].
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
    /// Compressed wide BVH over `triangles`, five words a node.
    pub nodes: Vec<glam::UVec4>,
    pub materials: Vec<Material>,
    /// Surfaces that exchange light; `Triangle::set` is an index into it.
    pub sets: Vec<Set>,
    pub lights: Vec<Light>,
    pub cameras: Vec<Camera>,
    pub environment: Environment,
    /// What the file asks for and we do not model, one sentence each.
    pub warnings: Vec<String>,
    /// Hex SHA-256 of everything that determines the image.
    pub hash: String,
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

/// One material on one instance of a mesh: the surfaces that exchange light through the matter they bound.
#[derive(Clone, Debug, PartialEq)]
pub struct Set {
    /// Node and material, for messages.
    pub name: String,
    pub material: usize,
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
    /// Index of refraction, inside over outside, > 0.
    pub ior: f64,
    /// What fills it; none for an opaque material.
    pub medium: Option<Medium>,
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
    /// Where the numbers came from: "preset skin1", "extras.bssrdf", "KHR_materials_scatter", ...
    pub source: String,
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
    /// Angles from the axis [radians], 0 <= inner < outer <= pi/2.
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
        /// Full vertical angle [radians].
        yfov: f64,
        /// Width over height, if the file fixes it.
        aspect: Option<f64>,
    },
    Orthographic {
        /// Half width and half height [m].
        xmag: f64,
        ymag: f64,
    },
}

/// Light from infinitely far away.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Environment {
    pub map: EnvironmentMap,
    /// Rotation about +Y [degrees], counter-clockwise seen from above.
    pub rotation: f64,
    /// Factor on the radiance.
    pub scale: f64,
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
