//! What may change between recordings without a new renderer: written into buffers that stay.

use super::Renderer;
use crate::{
    error::{Error, Result},
    gpu::upload,
    prepare::{delta_light, replaced, view_of},
    scene::{self, Camera, Light},
    shared::{Progress, Slot, View},
};

/// Nothing of it allocates device memory or submits in a renderer that records. No recording may be executing. Sums of
/// what was before are forgotten: the next recording, or `render`, starts new ones.
impl Renderer {
    /// Looks through another camera.
    ///
    /// # Errors
    /// [`Error::Setting`] for a camera that is no rotation, has no angle of view or is too far away.
    pub fn set_camera(&mut self, camera: &Camera) -> Result<()> {
        scene::check_camera(camera, &self.frame)?;
        let old = self.prepared.view;
        let new = view_of(camera, self.frame, old.width, old.height);
        self.prepared.camera = camera.clone();
        let View { pivot, right, up, forward, perspective, reach, .. } = new;
        self.prepared.view = View { pivot, right, up, forward, perspective, reach, ..old };
        let view = self.prepared.view;
        self.write(Slot::Views, bytemuck::bytes_of(&view))
    }

    /// Replaces the lights by as many others; one that is switched off has the intensity 0.
    ///
    /// # Errors
    /// [`Error::Setting`] for another number of lights, and for a light with numbers that are not finite, a negative
    /// intensity, no direction, a cone that is none, or that is too far away or too bright.
    pub fn set_lights(&mut self, lights: &[Light]) -> Result<()> {
        if lights.len() != self.prepared.lights.len() {
            let (new, old) = (lights.len(), self.prepared.lights.len());
            return Err(Error::setting("lights", format!("{new} in place of {old}: that needs a new renderer")));
        }
        lights.iter().try_for_each(|light| scene::check_light(light, &self.frame))?;
        self.prepared.lights = lights.iter().map(|light| delta_light(light, self.frame)).collect();
        let bytes = bytemuck::cast_slice(&self.prepared.lights).to_vec();
        if bytes.is_empty() { Ok(()) } else { self.write(Slot::Lights, &bytes) }
    }

    /// The material number `index` of the scene, as it is now.
    pub fn material(&self, index: usize) -> Option<&scene::Material> {
        self.authored.get(index)
    }

    /// Gives the material number `index` of the scene other parameters: coefficients, index of refraction, colours. The
    /// model stays as it was chosen.
    ///
    /// # Errors
    /// [`Error::Setting`] for an index that the scene does not have, for numbers out of range, and where the renderer was
    /// made for something else: opaque matter for translucent, other textures, emission or sets, another roughness of
    /// translucent matter, the table model, sets of several materials, single scattering where there was none.
    pub fn set_material(&mut self, index: usize, material: &scene::Material) -> Result<()> {
        let Some(old) = self.authored.get(index) else {
            let problem = format!("there are {}, none has the index {index}", self.authored.len());
            return Err(Error::setting("material", problem));
        };
        let new = replaced(&self.prepared, &self.settings, self.frame, index, old, material)?;
        self.prepared.materials[index] = new;
        self.authored[index] = material.clone();
        let bytes = bytemuck::cast_slice(&self.prepared.materials).to_vec();
        self.write(Slot::Materials, &bytes)
    }

    /// From which sample the ranges of recordings count: `record(.., 0..8)` then computes `first..first + 8`. The sums
    /// are kept: they go on if those samples follow them.
    ///
    /// # Errors
    /// [`Error::Setting`] for a renderer that was made without `recording`.
    pub fn set_first_sample(&mut self, first: u32) -> Result<()> {
        self.output()?;
        self.set_count(Progress { first, ..self.count().unwrap_or_default() });
        Ok(())
    }

    fn write(&mut self, slot: Slot, bytes: &[u8]) -> Result<()> {
        self.reset();
        upload(&self.device, self.buffer(slot).expect("every renderer has it"), bytes)
    }
}
