//! Integrators on the host: the device's kernels do all but the light that comes out of matter, which is computed here and
//! added to its sums, sample by sample.

use super::{Renderer, bands, find};
use crate::{
    error::Result,
    gpu::{download_to, upload},
    prepare::Prepared,
    reference::{
        self, Inputs,
        pixel::position,
        random,
        sums::Contribution,
        uniform::{Area, uniform},
        walk::{
            Random,
            mesh::Mesh,
            radiance::{Body, Filling, radiance},
        },
    },
    scene::{self, Scene},
    settings::Integrator,
    shared::{BATCHES, Coordinates, MISS, Shading, Slot, Step, Sums, Surface, Triangle},
    timeline,
};
use glam::Vec3;
use rayon::prelude::*;

/// What the host keeps of a scene, and room for a band's buffers.
pub(super) struct Host {
    triangles: Vec<Triangle>,
    shadings: Vec<Shading>,
    coordinates: Vec<Coordinates>,
    tree: Mesh,
    sets: Sets,
    surfaces: Vec<Surface>,
    sums: Vec<Sums>,
    batch_sums: Vec<Vec3>,
}

/// What each set is to the integrator; none for opaque ones.
enum Sets {
    Areas(Vec<Option<Area>>),
    Bodies(Vec<Option<Body>>),
}

impl Host {
    /// None where the device does all.
    pub fn new(scene: &Scene, prepared: &Prepared, integrator: Integrator) -> Option<Host> {
        if !prepared.on_host {
            return None;
        }
        fn each<T>(scene: &Scene, of: impl Fn(&[Triangle], u32) -> T) -> Vec<Option<T>> {
            let translucent = |set: &scene::Set| set.materials.iter().any(|&m| scene.materials[m].medium.is_some());
            let shown = |number: u32| scene.triangles.iter().any(|triangle| triangle.set == number);
            let make = |(number, set)| (translucent(set) && shown(number)).then(|| of(&scene.triangles, number));
            (0u32..).zip(&scene.sets).map(make).collect()
        }
        let corners: Vec<_> = scene.triangles.iter().map(|t| t.vertices.map(|vertex| vertex.as_dvec3())).collect();
        Some(Host {
            triangles: scene.triangles.clone(),
            shadings: scene.shadings.clone(),
            coordinates: scene.coordinates.clone(),
            tree: Mesh::new(&corners),
            sets: match integrator {
                Integrator::Walk => Sets::Bodies(each(scene, Body::new)),
                _ => Sets::Areas(each(scene, Area::new)),
            },
            surfaces: vec![],
            sums: vec![],
            batch_sums: vec![],
        })
    }
}

impl Renderer {
    /// Adds what the device left out of a sample of the band that it has.
    pub(super) fn add_on_host(&mut self, band: usize, sample_index: u32) -> Result<()> {
        let Some(host) = &mut self.host else { return Ok(()) };
        let _span = timeline::begin(&self.settings.timeline, "host");
        let (prepared, bands::Band { first_row, pixels, .. }) = (&self.prepared, &self.bands[band]);
        let features = &prepared.features;
        let count = *pixels as usize;
        let slot = |slot: Slot| find(&self.buffers, slot);
        let [surfaces, sums] = [Slot::Surfaces, Slot::RunningSums].map(|s| slot(s).expect("every band has it"));
        let batch_sums = slot(Slot::BatchSums);
        host.surfaces.resize(count * BATCHES as usize, Surface::default());
        host.sums.resize(count, Sums::default());
        host.batch_sums.resize(count * (BATCHES * features.batches) as usize, Vec3::ZERO);
        download_to(&self.device, surfaces, bytemuck::cast_slice_mut(&mut host.surfaces))?;
        download_to(&self.device, sums, bytemuck::cast_slice_mut(&mut host.sums))?;
        if let Some(buffer) = batch_sums {
            download_to(&self.device, buffer, bytemuck::cast_slice_mut(&mut host.batch_sums))?;
        }

        let inputs =
            Inputs { tree: Some(&host.tree), ..prepared.inputs_of(&host.triangles, &host.shadings, &host.coordinates) };
        let fillings: Vec<_> = self.authored.iter().map(|m| Filling::of(m, self.frame.scale)).collect();
        let batch = random::batch(sample_index) as usize;
        let step = Step {
            first_row: *first_row,
            pixel_count: *pixels,
            ..reference::step(&inputs, sample_index, 0..0, sample_index..sample_index + 1)
        };
        let sets = &host.sets;
        let light = |index: u32, surface: &Surface| {
            if surface.triangle == MISS {
                return Contribution::default();
            }
            let (px, py) = position(inputs.view, &step, index);
            // Unique for each sample of each pixel: no image is wider than 2^16.
            let stream = u64::from(py << 16 | px) << 32 | u64::from(sample_index);
            let mut random = Random::new(inputs.view.seed.into(), stream);
            let set = inputs.triangles[surface.triangle as usize].set as usize;
            let material = inputs.shadings[surface.triangle as usize].material as usize;
            match sets {
                Sets::Areas(areas) => {
                    areas[set].as_ref().map(|area| uniform(&inputs, &step, index, surface, area, &mut random))
                }
                Sets::Bodies(bodies) => bodies[set]
                    .as_ref()
                    .zip(fillings[material].as_ref())
                    .map(|body| radiance(&inputs, &step, index, surface, body, &mut random)),
            }
            .unwrap_or_default()
        };
        let surfaces = &host.surfaces[batch * count..][..count];
        // What each pixel's sum needs lies apart: contributions first.
        let found: Vec<Contribution> = (0..*pixels)
            .into_par_iter()
            .with_min_len(16)
            .map(|index| light(index, &surfaces[index as usize]))
            .collect();
        for (index, (contribution, own)) in found.iter().zip(&mut host.sums).enumerate() {
            let mut none = Vec3::ZERO;
            let batch_sum = host.batch_sums.get_mut(batch * count + index).unwrap_or(&mut none);
            contribution.add_subsurface(&step, &surfaces[index], own, batch_sum);
        }
        upload(&self.device, sums, bytemuck::cast_slice(&host.sums))?;
        if let Some(buffer) = batch_sums {
            upload(&self.device, buffer, bytemuck::cast_slice(&host.batch_sums))?;
        }
        Ok(())
    }
}
