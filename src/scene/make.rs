//! Materials, media and cameras that callers make, without a file.

use super::material::{DEFAULT_IOR, IOR_RANGE, medium_of};
use super::medium::{channels, from_albedo};
use super::{Appearance, Camera, Lens, Material, Medium, preset};
use crate::{Error, Result, settings::SingleScattering};
use glam::DVec3;

impl Default for Material {
    /// glTF's: opaque, white, metallic, rough.
    fn default() -> Material {
        Material {
            name: "default".into(),
            base_color: DVec3::ONE,
            metallic: 1.0,
            roughness: 1.0,
            emission: DVec3::ZERO,
            two_sided: false,
            ior: DEFAULT_IOR,
            medium: None,
            set: None,
            tinted: false,
            ramp: Vec::new(),
            textures: Default::default(),
            hidden: false,
        }
    }
}

impl Material {
    /// Matter under a smooth boundary.
    pub fn translucent(name: impl Into<String>, medium: Medium, ior: f64) -> Material {
        let name = name.into();
        Material { name, medium: Some(medium), ior, metallic: 0.0, roughness: 0.0, ..Material::default() }
    }

    /// A [measured](super::presets) material under a smooth boundary, called by its name.
    ///
    /// # Errors
    /// [`Error::Setting`] for an unknown name, with those that are close.
    pub fn from_preset(name: &str) -> Result<Material> {
        let found = preset(name).map_err(|problem| Error::setting("material", problem))?;
        Ok(Material::translucent(name, medium_of(&found), found.ior))
    }
}

impl Medium {
    /// Matter of these coefficients [1/m] with isotropic scattering, under the model that is recommended for it.
    pub fn new(sigma_s_prime: DVec3, sigma_a: DVec3) -> Medium {
        Medium {
            sigma_s_prime,
            sigma_a,
            g: DVec3::ZERO,
            appearance: None,
            model: None,
            directional: None,
            single_scattering: SingleScattering::Auto,
            source: "the caller".into(),
        }
    }

    /// Matter of a surface albedo and a length under a boundary of this index of refraction.
    ///
    /// # Errors
    /// [`Error::Setting`] for albedos outside of 0 to 1, lengths that are not positive, an index that is out of its
    /// range, and a diffuse mean free path with an albedo of 1.
    pub fn from_appearance(appearance: Appearance, ior: f64) -> Result<Medium> {
        let Appearance { albedo, length, kind } = appearance;
        let wrong = |problem: String| Error::setting("appearance", problem);
        let fraction = albedo.is_finite() && albedo.min_element() >= 0.0 && albedo.max_element() <= 1.0;
        if !(fraction && length.is_finite() && length.min_element() > 0.0) {
            return Err(wrong(format!("the albedo {albedo} and length {length} m are of no matter")));
        }
        if !(IOR_RANGE.0..=IOR_RANGE.1).contains(&ior) {
            return Err(wrong(format!(
                "its index of refraction is {ior}, not from {} to {}",
                IOR_RANGE.0, IOR_RANGE.1
            )));
        }
        let channel = |c: usize| from_albedo(albedo[c], length[c], kind, ior).map_err(wrong);
        let (sigma_s_prime, sigma_a) = channels(channel)?;
        Ok(Medium { appearance: Some(appearance), ..Medium::new(sigma_s_prime, sigma_a) })
    }
}

impl Camera {
    /// A camera at `eye` (m) that looks `forward`, with `up` upward in the image; both of any length. One whose axes do
    /// not span a space is refused where it is used.
    pub fn new(name: impl Into<String>, eye: DVec3, forward: DVec3, up: DVec3, lens: Lens) -> Camera {
        let forward = forward.normalize_or_zero();
        let right = forward.cross(up).normalize_or_zero();
        Camera { name: name.into(), object_name: None, eye, right, up: right.cross(forward), forward, lens }
    }
}
