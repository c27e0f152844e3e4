//! What may change between recordings without a new renderer: written into buffers that stay.

use super::{
    Renderer, SPIRV,
    plan::{self, prepared_data},
};
use crate::{
    error::{Error, Result},
    gpu::upload,
    prepare::{Before, Prepared, delta_light, prepare_again, replaced, view_of},
    scene::{self, Camera, Light, Scene},
    shared::{Progress, Slot, View},
};

/// Nothing of it allocates device memory or makes pipelines, and but for [`Renderer::update`] nothing submits in a
/// renderer that records. No recording may be executing. Sums of what was before are forgotten: the next recording, or
/// `render`, starts new ones.
impl Renderer {
    /// Renders `scene` from now on: the one that it was made of, or a clone, of which the caller changed fields.
    /// Materials, lights, cameras, environment and pictures may be other ones; geometry and sets stay. What is
    /// different is written into the buffers that there are, also where [`Renderer::set_camera`] and the like had
    /// changed it.
    ///
    /// *Models.* Where settings and materials leave the model to us, the one that was chosen for a material stays, so
    /// that kernels do; a new renderer might choose another. Ask for a model
    /// ([`Medium::model`](scene::Medium::model)) that suits a range of matter.
    ///
    /// *Time.* If no material is another one, what is made of the rest: milliseconds, and the environment's table. Else
    /// that of a new renderer without its kernels: tables are interpolated (or simulated, half a minute, for an index
    /// or g that is not among those shipped), and where profiles depend on curvatures those are balanced over the whole
    /// body, which takes seconds for thousands of triangles. [`Renderer::set_material`] is for matter that changes with
    /// every frame.
    ///
    /// *Room.* A renderer with [`Settings::recording`](crate::Settings::recording) has room for the tables of any
    /// matter and for a rough boundary of each material. Other buffers have the size of what they first held, or of the
    /// caller's ([`Renderer::with_buffers`]): as many lights, no more texels, environment or emitting triangles.
    ///
    /// *Submissions.* Camera, lights and materials of such a renderer are in memory that the host writes. The rest,
    /// where it is different and the host does not reach it, goes through the device's queue and is waited for.
    ///
    /// # Errors
    /// [`Error::Setting`], which names it, for a scene that has other geometry, breaks a rule, or needs another
    /// pipeline or a larger buffer, such as the first emitter, another kind of environment or model, opaque matter for
    /// translucent. Nothing was changed then. After [`Error::Vulkan`] or [`Error::Memory`] of a copy, an update or
    /// [`Renderer::resume`] brings the device up to date.
    pub fn update(&mut self, scene: &Scene) -> Result<()> {
        let geometry = scene::geometry(scene);
        if geometry != self.geometry {
            return refuse("geometry", "it is another scene's");
        }
        if scene.materials.len() != self.authored.len() {
            let (new, old) = (scene.materials.len(), self.authored.len());
            return refuse("materials", format!("{new} in place of {old}"));
        }
        if let Some((_, new)) = self.authored.iter().zip(&scene.materials).find(|(old, new)| old.kind() != new.kind()) {
            return refuse(format!("material `{}`", new.name), "its kind of matter or set decides on the geometry");
        }
        let before = Before { prepared: &self.prepared, authored: &self.authored };
        let mut new = prepare_again(scene, &self.settings, Some(before))?;
        new.features.counters = self.prepared.features.counters;
        new.features.listed = self.prepared.features.listed;
        new.features.batches = self.prepared.features.batches;
        self.check_fit(&new)?;

        self.reset();
        let old = prepared_data(&self.prepared);
        for pair in prepared_data(&new) {
            if !self.torn && old.contains(&pair) {
                continue;
            }
            let (slot, data) = pair;
            let buffer = self.buffer(slot).expect("it was found above");
            if let Err(error) = upload(&self.device, buffer, data) {
                self.torn = true;
                return Err(error);
            }
        }
        self.torn = false;
        self.lit = false;
        self.prepared = new;
        self.authored = scene.materials.clone();
        self.scene_hash = scene::hash(scene, geometry);
        Ok(())
    }

    /// Refuses what needs other pipelines, dispatches or buffers.
    fn check_fit(&self, new: &Prepared) -> Result<()> {
        let old = &self.prepared;
        let size = |prepared: &Prepared| (prepared.view.width, prepared.view.height);
        if size(new) != size(old) {
            return refuse("camera", format!("its image has {:?} pixels in place of {:?}", size(new), size(old)));
        }
        if new.lights.len() != old.lights.len() {
            return refuse("lights", format!("{} in place of {}", new.lights.len(), old.lights.len()));
        }
        let (asked, made) = (new.features.named(), old.features.named());
        if let Some((new, old)) = asked.iter().zip(&made).find(|(new, old)| new != old) {
            let problem = format!("{} in place of {} ({})", new.value, old.value, new.about.trim_end_matches('.'));
            return refuse(format!("feature {}", new.name), problem);
        }
        for (stem, _) in SPIRV {
            let ((needed, why), (made, _)) = (plan::needs(new, stem), plan::needs(old, stem));
            if needed != made {
                return refuse(format!("kernel {stem}"), why);
            }
        }
        for (slot, data) in prepared_data(new) {
            let room = self.buffer(slot).map_or(0, |buffer| buffer.bytes());
            if data.len() as u64 > room {
                let problem = format!("{} bytes, for which it has room for {room}", data.len());
                return refuse(format!("buffer {}", slot.name()), problem);
            }
        }
        Ok(())
    }

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
            return refuse("lights", format!("{} in place of {}", lights.len(), self.prepared.lights.len()));
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
    /// model stays as it was chosen. Writes a few hundred bytes, where [`Renderer::update`] prepares a whole scene.
    ///
    /// # Errors
    /// [`Error::Setting`] for an index that the scene does not have, for numbers out of range, and where more than one
    /// material's numbers would change: opaque matter for translucent, other textures, emission or sets, another
    /// roughness of translucent matter, the table model, sets of several materials, single scattering where there was
    /// none. [`Renderer::update`] does most of those.
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
        // A camera changes no light.
        self.lit &= slot == Slot::Views;
        upload(&self.device, self.buffer(slot).expect("every renderer has it"), bytes)
    }
}

fn refuse<T>(what: impl Into<String>, problem: impl std::fmt::Display) -> Result<T> {
    Err(Error::setting(what, format!("{problem}: that needs a new renderer")))
}
