//! One kernel at a time on a device: buffers made of inputs, a dispatch, and what it left.

use crate::{
    error::{Error, Result},
    gpu::{Bindings, Buffer, Device, Kernel, Layout, Location, Recorder, download, upload},
    reference::Inputs,
    render::SPIRV,
    shared::*,
};
use bytemuck::Pod;
use glam::{UVec4, Vec3};
use std::{borrow::Cow, collections::HashMap};

/// The SPIR-V of `functions`, a kernel that evaluates the functions which the others share. No renderer has it.
pub const FUNCTIONS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/functions.spv"));

/// All that shared functions may ask for, so that `functions` is compiled once: a driver takes seconds for it.
const EVERYTHING: Features = Features {
    projection: PROJECTION_MIS,
    environment: ENVIRONMENT_IMAGE,
    batches: 0,
    counters: 0,
    emitters: 1,
    rough: ROUGHNESS_ROWS,
    textures: 1 << TEXTURE_BASE_COLOR,
    models: (1 << (MODEL_LAMBERT + 1)) - 1,
    curvature: 1,
    cell_vectors: 1,
    recorded: 0,
    listed: 0,
    mixtures: 0,
    reuse: 0,
    reproject: REPROJECT_TRACE,
    irradiance: IRRADIANCE_DIRECT,
    integrator: INTEGRATOR_SAMPLE,
};

/// A device, and kernels made on it of modules that can be replaced.
pub struct Bench {
    pub device: Device,
    layout: Layout,
    recorder: Recorder,
    modules: HashMap<&'static str, Cow<'static, [u8]>>,
    kernels: HashMap<(&'static str, Features), Kernel>,
    /// How often each dispatch runs, from the same buffers; what does not always leave the same is in `unrepeatable`.
    pub repeat: u32,
    /// Kernels that left different bytes when they ran again.
    pub unrepeatable: Vec<&'static str>,
    /// Every dispatch since this was set to an empty list; none are kept without.
    pub record: Option<Vec<Dispatch>>,
}

/// A dispatch, whole: what the driver was given, and what it made of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Dispatch {
    pub stem: &'static str,
    pub spirv: Vec<u8>,
    /// The specialization constants, but for number 0, the workgroup.
    pub features: Features,
    pub workgroup: u32,
    /// The push constants; `pixel_count` invocations are asked for.
    pub step: Step,
    /// What the buffers held before.
    pub before: Vec<(Slot, Vec<u8>)>,
    /// What they held afterwards.
    pub after: Vec<(Slot, Vec<u8>)>,
}

impl Bench {
    /// A bench with the modules that the build made.
    ///
    /// # Errors
    /// [`Error::Vulkan`], [`Error::Memory`].
    pub fn new(device: &Device) -> Result<Bench> {
        Ok(Bench {
            device: device.clone(),
            layout: Layout::new(device)?,
            recorder: Recorder::new(device)?,
            modules: built().collect(),
            kernels: HashMap::new(),
            repeat: 1,
            unrepeatable: vec![],
            record: None,
        })
    }

    /// The SPIR-V of a kernel.
    pub fn module(&self, stem: &str) -> Option<&[u8]> {
        self.modules.get(stem).map(AsRef::as_ref)
    }

    /// Uses other SPIR-V for a kernel from now on, or adds one. Like all SPIR-V that is given to a device it must be
    /// valid.
    pub fn replace(&mut self, stem: &'static str, spirv: impl Into<Cow<'static, [u8]>>) {
        self.kernels.retain(|(made, _), _| *made != stem);
        self.modules.insert(stem, spirv.into());
    }

    /// What kernels read of `inputs`, and `buffers`, on the device.
    ///
    /// # Errors
    /// [`Error::Vulkan`], [`Error::Memory`].
    pub fn load(&self, inputs: &Inputs, nodes: &[UVec4], buffers: &[(Slot, &[u8])]) -> Result<Loaded> {
        let fixed: [(Slot, &[u8]); 19] = [
            (Slot::Views, bytemuck::bytes_of(inputs.view)),
            (Slot::Nodes, bytemuck::cast_slice(nodes)),
            (Slot::Triangles, bytemuck::cast_slice(inputs.triangles)),
            (Slot::Shadings, bytemuck::cast_slice(inputs.shadings)),
            (Slot::Materials, bytemuck::cast_slice(inputs.materials)),
            (Slot::Lights, bytemuck::cast_slice(inputs.lights)),
            (Slot::Emitters, bytemuck::cast_slice(inputs.emitters)),
            (Slot::Boundaries, bytemuck::cast_slice(inputs.boundaries)),
            (Slot::Environment, bytemuck::cast_slice(inputs.environment)),
            (Slot::EnvironmentCdf, bytemuck::cast_slice(inputs.environment_cdf)),
            (Slot::Counters, &[0; 4]),
            (Slot::Texels, bytemuck::cast_slice(inputs.texels)),
            (Slot::Textures, bytemuck::cast_slice(inputs.textures)),
            (Slot::Coordinates, bytemuck::cast_slice(inputs.coordinates)),
            (Slot::Profiles, bytemuck::cast_slice(inputs.profiles)),
            (Slot::Balances, bytemuck::cast_slice(inputs.balances)),
            (Slot::Mixtures, bytemuck::cast_slice(inputs.mixtures)),
            (Slot::Clusters, bytemuck::cast_slice(inputs.kept)),
            (Slot::Lattices, bytemuck::cast_slice(inputs.lattices)),
        ];
        let given = fixed.into_iter().chain(buffers.iter().copied()).filter(|(_, data)| !data.is_empty());
        self.bind(inputs.features, given)
    }

    fn bind<'a>(&self, features: Features, buffers: impl Iterator<Item = (Slot, &'a [u8])>) -> Result<Loaded> {
        let make = |(slot, data): (Slot, &[u8])| {
            let buffer = Buffer::new(&self.device, slot.name(), data.len() as u64, Location::Device)?;
            upload(&self.device, &buffer, data)?;
            Ok((slot, buffer))
        };
        let buffers = buffers.map(make).collect::<Result<Vec<_>>>()?;
        let bound: Vec<_> = buffers.iter().map(|(slot, buffer)| (*slot, buffer)).collect();
        let bindings = Bindings::new(&self.layout, &bound)?;
        Ok(Loaded { features, bindings, buffers })
    }

    /// Runs one kernel, with `step.pixel_count` invocations.
    ///
    /// # Errors
    /// [`Error::Setting`] for a kernel that does not exist; [`Error::Vulkan`], [`Error::Memory`].
    pub fn dispatch(&mut self, stem: &'static str, loaded: &Loaded, step: &Step) -> Result<()> {
        let kernel = self.kernel(stem, &loaded.features)?;
        if self.record.is_none() && self.repeat <= 1 {
            return self.submit(&kernel, loaded, step);
        }
        let before = self.contents(loaded)?;
        self.submit(&kernel, loaded, step)?;
        let after = self.contents(loaded)?;
        for _ in 1..self.repeat {
            before.iter().try_for_each(|(slot, data)| upload(&self.device, loaded.buffer(*slot), data))?;
            self.submit(&kernel, loaded, step)?;
            if self.contents(loaded)? != after {
                self.unrepeatable.push(stem);
            }
        }
        let spirv = self.module(stem).unwrap_or_default().to_vec();
        let (features, workgroup) = (loaded.features, WORKGROUP);
        if let Some(record) = &mut self.record {
            record.push(Dispatch { stem, spirv, features, workgroup, step: *step, before, after });
        }
        Ok(())
    }

    /// Runs a dispatch again, from what its buffers held before; what they hold then. Its SPIR-V must be valid, and made
    /// for buffers of these sizes.
    ///
    /// # Errors
    /// [`Error::Setting`] for a workgroup that the device cannot do; [`Error::Vulkan`], [`Error::Memory`].
    pub fn replay(&mut self, dispatch: &Dispatch) -> Result<Vec<(Slot, Vec<u8>)>> {
        let Dispatch { stem, spirv, features, workgroup, step, before, .. } = dispatch;
        let kernel = Kernel::new(&self.layout, stem, spirv, features, *workgroup)?;
        let loaded = self.bind(*features, before.iter().map(|(slot, data)| (*slot, data.as_slice())))?;
        self.submit(&kernel, &loaded, step)?;
        self.contents(&loaded)
    }

    /// Loads, runs one kernel once, and returns the buffers as it left them.
    ///
    /// # Errors
    /// As [`Bench::load`] and [`Bench::dispatch`].
    pub fn run(
        &mut self,
        stem: &'static str,
        inputs: &Inputs,
        nodes: &[UVec4],
        step: &Step,
        buffers: &[(Slot, &[u8])],
    ) -> Result<Loaded> {
        let loaded = self.load(inputs, nodes, buffers)?;
        self.dispatch(stem, &loaded, step)?;
        Ok(loaded)
    }

    /// Values of a shared function, one of FUNCTION_*, at the arguments `x`; further ones are in `inputs.shadings`, and in
    /// `buffers` where the function reads surfaces and probes.
    ///
    /// # Errors
    /// As [`Bench::run`].
    pub fn evaluate(
        &mut self,
        function: u32,
        inputs: &Inputs,
        nodes: &[UVec4],
        x: &[Vec3],
        buffers: &[(Slot, &[u8])],
    ) -> Result<Vec<Vec3>> {
        let step = Step { pixel_count: x.len() as u32, ray_begin: function, ..Step::default() };
        // Every invocation reads its own.
        let mut shadings = inputs.shadings.to_vec();
        shadings.resize(shadings.len().max(x.len()), Shading::default());
        let inputs = Inputs { features: EVERYTHING, shadings: &shadings, ..*inputs };
        let buffers: Vec<_> =
            [(Slot::BatchSums, bytemuck::cast_slice(x))].into_iter().chain(buffers.iter().copied()).collect();
        let loaded = self.run("functions", &inputs, nodes, &step, &buffers)?;
        self.read(&loaded, Slot::BatchSums)
    }

    /// Uses the SPIR-V that the build made of a kernel again.
    pub fn restore(&mut self, stem: &'static str) {
        if let Some((_, spirv)) = built().find(|(built, _)| *built == stem) {
            self.replace(stem, spirv);
        }
    }

    /// Overwrites the start of a buffer.
    ///
    /// # Errors
    /// [`Error::Vulkan`], [`Error::Memory`].
    ///
    /// # Panics
    /// If the slot was not loaded or is shorter.
    pub fn write<T: Pod>(&self, loaded: &Loaded, slot: Slot, data: &[T]) -> Result<()> {
        upload(&self.device, loaded.buffer(slot), bytemuck::cast_slice(data))
    }

    /// What a buffer holds.
    ///
    /// # Errors
    /// [`Error::Vulkan`], [`Error::Memory`].
    ///
    /// # Panics
    /// If the slot was not loaded, or does not hold whole elements.
    pub fn read<T: Pod>(&self, loaded: &Loaded, slot: Slot) -> Result<Vec<T>> {
        let buffer = loaded.buffer(slot);
        Ok(bytemuck::pod_collect_to_vec(&download(&self.device, buffer, buffer.bytes())?))
    }

    fn kernel(&mut self, stem: &'static str, features: &Features) -> Result<Kernel> {
        if let Some(kernel) = self.kernels.get(&(stem, *features)) {
            return Ok(kernel.clone());
        }
        let Some(spirv) = self.modules.get(stem) else {
            return Err(Error::setting("kernel", format!("there is none called `{stem}`")));
        };
        let kernel = Kernel::new(&self.layout, stem, spirv, features, WORKGROUP)?;
        self.kernels.insert((stem, *features), kernel.clone());
        Ok(kernel)
    }

    fn submit(&mut self, kernel: &Kernel, loaded: &Loaded, step: &Step) -> Result<()> {
        self.recorder.begin()?;
        self.recorder.dispatch(kernel, &loaded.bindings, step.pixel_count, step);
        self.recorder.submit_and_wait()
    }

    fn contents(&self, loaded: &Loaded) -> Result<Vec<(Slot, Vec<u8>)>> {
        let content = |(slot, buffer): &(Slot, Buffer)| Ok((*slot, download(&self.device, buffer, buffer.bytes())?));
        loaded.buffers.iter().map(content).collect()
    }
}

/// The modules that the build made.
fn built() -> impl Iterator<Item = (&'static str, Cow<'static, [u8]>)> {
    SPIRV.iter().copied().chain([("functions", FUNCTIONS)]).map(|(stem, spirv)| (stem, Cow::Borrowed(spirv)))
}

/// Buffers on the device, for kernels of some features.
pub struct Loaded {
    features: Features,
    bindings: Bindings,
    buffers: Vec<(Slot, Buffer)>,
}

impl Loaded {
    fn buffer(&self, slot: Slot) -> &Buffer {
        let (_, buffer) = self.buffers.iter().find(|(s, _)| *s == slot).expect("the slot was bound");
        buffer
    }
}
