//! What comes from callers, not from files: cameras, lights, materials, and scenes that they changed.

use super::{
    Camera, Frame, Lens, Light, LightKind, Material, Medium, Scene, Texture, frame, material::IOR_RANGE,
    picture::SCENE_TEXELS_MAX,
};
use crate::shared::RAMP;
use crate::{Error, Result, settings::Directional};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI};

/// How far a direction may be from a unit vector, or two of them from a right angle.
const UNIT: f64 = 1e-6;

/// Refuses a camera that is none.
pub(crate) fn check_camera(camera: &Camera, frame: &Frame) -> Result<()> {
    let Camera { right, up, forward, .. } = *camera;
    let unit = |v: DVec3| (v.length_squared() - 1.0).abs() <= UNIT;
    let square = |a: DVec3, b: DVec3| a.dot(b).abs() <= UNIT;
    let basis = unit(right) && unit(up) && unit(forward) && square(right, up) && square(up, forward);
    let problem = if !camera.eye.is_finite() {
        Some("its eye is not finite".to_string())
    } else if !(basis && (right.cross(up) + forward).length() <= 3.0 * UNIT) {
        Some("right, up and -forward are not a rotation's axes".into())
    } else {
        let lens = match camera.lens {
            Lens::Perspective { yfov, .. } if yfov > 0.0 && yfov < PI => None,
            Lens::Perspective { yfov, .. } => Some(format!("its angle is {yfov} radians, not between 0 and pi")),
            Lens::Orthographic { xmag, ymag } if xmag > 0.0 && ymag > 0.0 => None,
            Lens::Orthographic { xmag, ymag } => Some(format!("its half sizes are {xmag} and {ymag} m")),
        };
        lens.or_else(|| frame::camera_beyond(frame, camera))
    };
    problem.map_or(Ok(()), |problem| Err(Error::setting(format!("camera `{}`", camera.name), problem)))
}

/// Refuses a light that is none.
pub(crate) fn check_light(light: &Light, frame: &Frame) -> Result<()> {
    let cone = match light.kind {
        LightKind::Spot { inner, outer } => 0.0 <= inner && inner < outer && outer <= FRAC_PI_2,
        LightKind::Point | LightKind::Directional => true,
    };
    let problem = if !light.position.is_finite() {
        Some("its position is not finite".to_string())
    } else if !(light.intensity.is_finite() && light.intensity.min_element() >= 0.0) {
        Some(format!("its intensity is {}", light.intensity))
    } else if !light.direction.is_finite() || (light.direction.length_squared() - 1.0).abs() > UNIT {
        Some("its direction is no unit vector".into())
    } else if !cone {
        Some("its angles are not 0 <= inner < outer <= pi/2".into())
    } else if light.range.is_some_and(|range| range.is_nan() || range <= 0.0) {
        Some("its range is not positive".into())
    } else {
        frame::light_beyond(frame, light)
    };
    problem.map_or(Ok(()), |problem| Err(Error::setting(format!("light `{}`", light.name), problem)))
}

/// Refuses a material with numbers out of their ranges. Which pictures there are is the scene's matter.
pub(crate) fn check_material(material: &Material) -> Result<()> {
    let unit = |v: DVec3| v.is_finite() && v.min_element() >= 0.0 && v.max_element() <= 1.0;
    let fraction = |x: f64| (0.0..=1.0).contains(&x);
    let Material { base_color, metallic, roughness, emission, ior, ramp, .. } = material;
    let problem = if !unit(*base_color) {
        Some(format!("its base colour is {base_color}, not from 0 to 1"))
    } else if !fraction(*metallic) || !fraction(*roughness) {
        Some(format!("metallic is {metallic} and roughness {roughness}, not from 0 to 1"))
    } else if !(emission.is_finite() && emission.min_element() >= 0.0 && emission.max_element() <= frame::INTENSITY_MAX)
    {
        Some(format!("its emission is {emission}; 0 to {:e} are possible", frame::INTENSITY_MAX))
    } else if !(IOR_RANGE.0..=IOR_RANGE.1).contains(ior) {
        Some(format!("its index of refraction is {ior}, not from {} to {}", IOR_RANGE.0, IOR_RANGE.1))
    } else if !(ramp.is_empty() || ramp.len() == RAMP as usize + 1 && material.medium.is_some()) {
        Some(format!("its ramp has {} media, not none or {} of a medium's", ramp.len(), RAMP + 1))
    } else {
        let texture = || material.textures.iter().flatten().find_map(texture_problem);
        material.medium.iter().chain(ramp).find_map(medium_problem).or_else(texture)
    };
    problem.map_or(Ok(()), |problem| Err(Error::setting(format!("material `{}`", material.name), problem)))
}

fn medium_problem(medium: &Medium) -> Option<String> {
    let positive = |v: DVec3| v.is_finite() && v.min_element() >= 0.0;
    let Medium { sigma_s_prime, sigma_a, g, appearance, directional, .. } = medium;
    if !(positive(*sigma_s_prime) && positive(*sigma_a)) {
        return Some(format!("sigma_s' {sigma_s_prime} and sigma_a {sigma_a} must be finite, not negative"));
    }
    if !(g.is_finite() && g.abs().max_element() < 1.0) {
        return Some(format!("g is {g}; it must be above -1 and below 1"));
    }
    if let Some(seen) = appearance {
        let albedo = seen.albedo.is_finite() && seen.albedo.min_element() >= 0.0 && seen.albedo.max_element() <= 1.0;
        if !(albedo && seen.length.is_finite() && seen.length.min_element() > 0.0) {
            return Some(format!("the albedo {} and length {} m are of no matter", seen.albedo, seen.length));
        }
    }
    let kappa = directional.map_or(0.0, |directional| directional.kappa);
    let known = (0.0..=Directional::KAPPA_MAX).contains(&kappa);
    (!known).then(|| format!("kappa is {kappa}, not from 0 to {}", Directional::KAPPA_MAX))
}

fn texture_problem(texture: &Texture) -> Option<String> {
    if texture.set > 1 {
        return Some(format!("a texture uses the coordinates {}; there are 0 and 1", texture.set));
    }
    let numbers = texture.rows.iter().all(|row| row.is_finite()) && texture.scale.is_finite();
    (!numbers).then(|| "a texture has a transform or scale that is not finite".into())
}

/// Refuses a scene that a caller made inconsistent.
pub(crate) fn check_scene(scene: &Scene) -> Result<()> {
    let Scene { materials, pictures, sets, .. } = scene;
    materials.iter().try_for_each(check_material)?;
    scene.lights.iter().try_for_each(|light| check_light(light, &scene.frame))?;
    scene.cameras.iter().try_for_each(|camera| check_camera(camera, &scene.frame))?;
    scene.environment.check()?;
    let shown = scene.shadings.iter().map(|shading| shading.material as usize);
    let last = shown.chain(sets.iter().flat_map(|set| set.materials.iter().copied())).max().unwrap_or(0);
    if last >= materials.len() {
        let problem = format!("there are {}; the geometry shows the index {last}", materials.len());
        return Err(Error::setting("materials", problem));
    }
    for set in sets {
        let iors = || set.materials.iter().map(|&material| materials[material].ior);
        if let Some((first, other)) = iors().next().and_then(|first| Some((first, iors().find(|ior| *ior != first)?))) {
            let problem = format!("its materials have the indices of refraction {first} and {other}");
            return Err(Error::setting(format!("set `{}`", set.name), problem));
        }
    }
    for (index, picture) in pictures.iter().enumerate() {
        let (texels, size) = (picture.texels.len(), u64::from(picture.width) * u64::from(picture.height));
        if size == 0 || size != texels as u64 {
            let problem = format!("{texels} texels are not {} x {}", picture.width, picture.height);
            return Err(Error::setting(format!("pictures[{index}]"), problem));
        }
    }
    if pictures.iter().map(|picture| picture.texels.len()).sum::<usize>() > SCENE_TEXELS_MAX {
        return Err(Error::setting("pictures", format!("have more than {SCENE_TEXELS_MAX} texels")));
    }
    for material in materials.iter().filter(|material| material.is_textured()) {
        let wrong = |problem: String| Err(Error::setting(format!("material `{}`", material.name), problem));
        if scene.coordinates.len() != scene.triangles.len() {
            return wrong("has a texture, but the scene was made without any".into());
        }
        for texture in material.textures.iter().flatten() {
            if texture.picture >= pictures.len() {
                return wrong(format!("shows picture {} of {}", texture.picture, pictures.len()));
            }
        }
    }
    Ok(())
}

/// What a caller puts into a scene, checked at once where the fields themselves are checked when a renderer is made.
/// Brings [`Scene::hash`] up to date.
impl Scene {
    /// Replaces the lights.
    ///
    /// # Errors
    /// [`Error::Setting`] for a light with numbers that are not finite, a negative intensity, no direction, a cone that
    /// is none, or that is too far away or too bright. Nothing was changed then.
    pub fn set_lights(&mut self, lights: Vec<Light>) -> Result<()> {
        lights.iter().try_for_each(|light| check_light(light, &self.frame))?;
        self.lights = lights;
        self.rehash();
        Ok(())
    }

    /// Replaces the cameras; without any, one frames the scene.
    ///
    /// # Errors
    /// [`Error::Setting`] for a camera that is no rotation, has no angle of view or is too far away. Nothing was
    /// changed then.
    pub fn set_cameras(&mut self, cameras: Vec<Camera>) -> Result<()> {
        cameras.iter().try_for_each(|camera| check_camera(camera, &self.frame))?;
        self.cameras = cameras;
        self.rehash();
        Ok(())
    }

    /// Replaces the material number `index`. Whether it is translucent, hidden or names a set decided on the geometry,
    /// and stays.
    ///
    /// # Errors
    /// [`Error::Setting`] for an index that there is not, another kind of material, numbers out of their ranges,
    /// pictures or coordinates that the scene does not have, another index of refraction than that of its set. Nothing
    /// was changed then.
    pub fn set_material(&mut self, index: usize, material: Material) -> Result<()> {
        let count = self.materials.len();
        let Some(place) = self.materials.get_mut(index) else {
            return Err(Error::setting("material", format!("there are {count}, none has the index {index}")));
        };
        if place.kind() != material.kind() {
            let problem = "whether it is translucent, hidden or names a set stays as it was when the scene was made";
            return Err(Error::setting(format!("material `{}`", material.name), problem));
        }
        let old = std::mem::replace(place, material);
        if let Err(error) = check_scene(self) {
            self.materials[index] = old;
            return Err(error);
        }
        self.rehash();
        Ok(())
    }
}

impl Material {
    /// What decides on sets, winding and frame.
    pub(crate) fn kind(&self) -> (bool, bool, Option<&str>) {
        (self.medium.is_some(), self.hidden, self.set.as_deref())
    }
}
