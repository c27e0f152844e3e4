//! Light at points of the surface, before the first sample: those of the cloud and the tree above them, or those whose
//! light is kept for `accumulate`.

use super::{Renderer, SUBMISSION, assemble::whole, own, random};
use crate::{
    cache::{Cache, Geometry},
    error::Result,
    gpu::{download_to, upload},
    shared::{Cluster, Coordinates, IRRADIANCE_CACHED, MAX_RAYS, Shading, Slot, Step, Triangle},
    timeline::{self, Work},
};
use glam::DVec3;
use std::ops::Range;

impl Renderer {
    /// Lights what needs it, unless it is lit by the lights that there are.
    pub(super) fn light_points(&mut self) -> Result<()> {
        if !self.lit {
            if self.kernels.gather.is_some() {
                self.light_cloud()?;
            }
            if self.prepared.features.irradiance == IRRADIANCE_CACHED {
                self.light_cache()?;
            }
        }
        self.lit = true;
        Ok(())
    }

    fn light_cloud(&mut self) -> Result<()> {
        let _span = timeline::begin(&self.settings.timeline, "cloud");
        // Without light, also of a time before.
        self.send(Slot::Clusters, bytemuck::cast_slice(&self.prepared.clusters))?;
        let (leaves, rays) = (self.prepared.view.leaves, 0..self.prepared.ray_count);
        let samples = self.settings.cloud.samples;
        let whole = Step { node: leaves, pixel_count: leaves, range_end: samples, ..Step::default() };
        self.trace_to_points(whole, rays, 0..samples, "cloud")?;
        let Renderer { recorder, kernels, bindings, .. } = &mut *self;
        let recorder = own(recorder)?;
        recorder.begin()?;
        let mut node = leaves / 2;
        while node > 0 {
            let step = Step { node, pixel_count: node, ..whole };
            kernels.cluster.iter().for_each(|kernel| recorder.dispatch(kernel, bindings, node, &step));
            node /= 2;
        }
        recorder.submit_and_wait()?;
        self.note("cloud", Work { pixels: leaves, ..Work::default() });
        Ok(())
    }

    /// Lights points, adds more where light differs between neighbours, and so on until it is fine enough.
    fn light_cache(&mut self) -> Result<()> {
        let _span = timeline::begin(&self.settings.timeline, "cache");
        let triangles: Vec<Triangle> = whole(self, Slot::Triangles)?;
        let shadings: Vec<Shading> = whole(self, Slot::Shadings)?;
        let coordinates: Vec<Coordinates> = whole(self, Slot::Coordinates)?;
        let geometry = Geometry { triangles: &triangles, shadings: &shadings, coordinates: &coordinates };
        let stride = Slot::Clusters.stride() as u64;
        let room = self.buffer(Slot::Clusters).map_or(0, |buffer| buffer.bytes() / stride) as usize;
        let mut cache = self.prepared.cache.clone();
        for round in 0.. {
            self.light_new(&mut cache, round)?;
            let coarse = cache.coarse(self.settings.cache.tolerance, room);
            if coarse.is_empty() {
                break;
            }
            cache.refine(geometry, &coarse);
        }
        self.send(Slot::Lattices, bytemuck::cast_slice(&cache.lattices))
    }

    /// Lights the points of an area; they have none afterwards. `round` gives them random numbers of their own.
    fn light_new(&mut self, cache: &mut Cache, round: u32) -> Result<()> {
        self.send(Slot::Clusters, bytemuck::cast_slice(&cache.points))?;
        let (lights, rays) = (self.prepared.view.light_count, self.prepared.ray_count);
        let samples = self.settings.cache.samples;
        let count = cache.points.len() as u32;
        let step = Step { pixel_count: count, range_end: samples, first_row: round, ..Step::default() };
        // Delta lights have no noise; that of the rest is the difference of its halves.
        let mut flux = vec![];
        let halves = [0..samples / 2, samples / 2..samples];
        for (rays, samples) in [(0..lights, 0..1), (lights..rays, halves[0].clone()), (lights..rays, halves[1].clone())]
        {
            self.trace_to_points(step, rays, samples, "cache")?;
            let mut points = vec![Cluster::default(); cache.points.len()];
            let buffer = self.buffer(Slot::Clusters).expect("light is kept");
            download_to(&self.device, buffer, bytemuck::cast_slice_mut(&mut points))?;
            flux.push(points);
        }
        let [delta, half, all] = flux.try_into().expect("three times");
        let of = |points: &[Cluster], i: usize| -> DVec3 { points[i].flux.as_dvec3() };
        for (i, point) in cache.points.iter_mut().enumerate().filter(|(_, point)| point.area > 0.0) {
            let halves = [of(&half, i) - of(&delta, i), of(&all, i) - of(&half, i)];
            cache.noise[i] = halves[0].distance_squared(halves[1]);
            *point = Cluster { area: 0.0, ..all[i] };
        }
        Ok(())
    }

    /// Adds the light of shadow rays of `samples` to the points of a step; delta lights, the first rays, are the same in
    /// every sample.
    fn trace_to_points(
        &mut self,
        whole: Step,
        rays: Range<u32>,
        samples: Range<u32>,
        name: &'static str,
    ) -> Result<()> {
        let mut steps = vec![];
        for sample_index in samples {
            let begin = if sample_index == 0 { rays.start } else { rays.start.max(self.prepared.view.light_count) };
            for ray_begin in (begin..rays.end).step_by(MAX_RAYS as usize) {
                let ray_count = (rays.end - ray_begin).min(MAX_RAYS);
                steps.push(Step { sample_index, ray_begin, ray_count, point: random::point(sample_index), ..whole });
            }
        }
        let count = whole.pixel_count;
        let each = (SUBMISSION / u64::from(count)).max(1) as usize;
        for steps in steps.chunks(each) {
            let Renderer { recorder, kernels, bindings, .. } = &mut *self;
            let recorder = own(recorder)?;
            recorder.begin()?;
            for step in steps {
                kernels.irradiance.iter().for_each(|kernel| recorder.dispatch(kernel, bindings, count, step));
            }
            recorder.submit_and_wait()?;
            self.note(name, Work { pixels: count, ..Work::default() });
        }
        Ok(())
    }

    fn send(&self, slot: Slot, data: &[u8]) -> Result<()> {
        upload(&self.device, self.buffer(slot).expect("it has points"), data)
    }
}
