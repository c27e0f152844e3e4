//! Each kernel alone against its f64 twin, fed with the twin's output of the stage before; under the validation layer
//! with synchronization checks.

// Each test program uses its part.
#[allow(dead_code)]
#[path = "../common/mod.rs"]
mod common;
mod math;
mod models;
mod overflow;
mod recording;
#[allow(dead_code)]
#[path = "../images/scenes.rs"]
mod scenes;
mod shared;
mod sphere;
mod stages;
mod steps;
mod sweep;
mod textures;

use bytemuck::Pod;
use glam::UVec4;
use std::{
    collections::HashMap,
    sync::{Mutex, MutexGuard, OnceLock},
};
use translucent::{
    Device, DeviceOptions, Scene, Settings,
    gpu::{Bindings, Buffer, Kernel, Layout, Location, Recorder, download, upload},
    prepare::{Prepared, prepare},
    reference::Inputs,
    render::SPIRV,
    shared::{Features, Slot, Step},
};

/// The device that all tests share, one test at a time, and the kernels made on it.
pub struct Bench {
    pub device: Device,
    layout: Layout,
    recorder: Recorder,
    kernels: HashMap<(&'static str, Features), Kernel>,
}

pub fn bench() -> MutexGuard<'static, Bench> {
    static BENCH: OnceLock<Mutex<Bench>> = OnceLock::new();
    let make = || {
        let options = DeviceOptions { validation: true, ..DeviceOptions::default() };
        let device = Device::open(&options).expect("a Vulkan device and the validation layer");
        let layout = Layout::new(&device).expect("layout");
        let recorder = Recorder::new(&device).expect("recorder");
        Mutex::new(Bench { device, layout, recorder, kernels: HashMap::new() })
    };
    BENCH.get_or_init(make).lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}

impl Bench {
    /// What kernels read of `inputs`, and `buffers`, on the device.
    pub fn load(&self, inputs: &Inputs, nodes: &[UVec4], buffers: &[(Slot, &[u8])]) -> Loaded {
        let fixed: [(Slot, &[u8]); 19] = [
            (Slot::Views, bytemuck::bytes_of(inputs.view)),
            (Slot::Nodes, bytemuck::cast_slice(nodes)),
            (Slot::Triangles, bytemuck::cast_slice(inputs.triangles)),
            (Slot::Shadings, bytemuck::cast_slice(inputs.shadings)),
            (Slot::Materials, bytemuck::cast_slice(inputs.materials)),
            (Slot::Lights, bytemuck::cast_slice(inputs.lights)),
            (Slot::Emitters, bytemuck::cast_slice(inputs.emitters)),
            (Slot::EmitterCdf, bytemuck::cast_slice(inputs.emitter_cdf)),
            (Slot::Boundaries, bytemuck::cast_slice(inputs.boundaries)),
            (Slot::Environment, bytemuck::cast_slice(inputs.environment)),
            (Slot::EnvironmentCdf, bytemuck::cast_slice(inputs.environment_cdf)),
            (Slot::Counters, &[0; 4]),
            (Slot::Texels, bytemuck::cast_slice(inputs.texels)),
            (Slot::Textures, bytemuck::cast_slice(inputs.textures)),
            (Slot::Coordinates, bytemuck::cast_slice(inputs.coordinates)),
            (Slot::Profiles, bytemuck::cast_slice(inputs.profiles)),
            (Slot::Thickness, bytemuck::cast_slice(inputs.thickness)),
            (Slot::Balances, bytemuck::cast_slice(inputs.balances)),
            (Slot::Mixtures, bytemuck::cast_slice(inputs.mixtures)),
        ];
        let given = fixed.into_iter().chain(buffers.iter().copied()).filter(|(_, data)| !data.is_empty());
        let make = |(slot, data): (Slot, &[u8])| {
            let buffer = Buffer::new(&self.device, slot.name(), data.len() as u64, Location::Device).expect("buffer");
            upload(&self.device, &buffer, data).expect("upload");
            (slot, buffer)
        };
        let buffers: Vec<_> = given.map(make).collect();
        let bound: Vec<_> = buffers.iter().map(|(slot, buffer)| (*slot, buffer)).collect();
        let bindings = Bindings::new(&self.layout, &bound).expect("bindings");
        Loaded { features: inputs.features, bindings, buffers }
    }

    /// Adds a kernel that only tests have.
    pub fn add(&mut self, stem: &'static str, spirv: &[u8], features: &Features) {
        let kernel = Kernel::new(&self.layout, stem, spirv, features, 64).expect("kernel");
        self.kernels.insert((stem, *features), kernel);
    }

    /// Runs one kernel once.
    pub fn dispatch(&mut self, stem: &'static str, loaded: &Loaded, step: &Step) {
        let Bench { layout, recorder, kernels, .. } = self;
        let kernel = kernels.entry((stem, loaded.features)).or_insert_with(|| {
            let (_, spirv) = SPIRV.iter().find(|(name, _)| *name == stem).expect("the kernel exists");
            Kernel::new(layout, stem, spirv, &loaded.features, 64).expect("kernel")
        });
        recorder.begin().expect("begin");
        recorder.dispatch(kernel, &loaded.bindings, step.pixel_count, step);
        recorder.submit_and_wait().expect("submit");
    }

    pub fn write<T: Pod>(&self, loaded: &Loaded, slot: Slot, data: &[T]) {
        upload(&self.device, loaded.buffer(slot), bytemuck::cast_slice(data)).expect("upload");
    }

    pub fn read<T: Pod>(&self, loaded: &Loaded, slot: Slot) -> Vec<T> {
        let buffer = loaded.buffer(slot);
        bytemuck::pod_collect_to_vec(&download(&self.device, buffer, buffer.bytes()).expect("download"))
    }

    /// Validation must have had nothing to say.
    pub fn check(&self) {
        let messages = self.device.validation_messages();
        assert!(messages.is_empty(), "{messages:#?}");
    }
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

/// A scene with what kernels read of it.
pub struct Case {
    pub scene: Scene,
    pub prepared: Prepared,
}

impl Case {
    pub fn new(scene: Scene, settings: &Settings) -> Case {
        let prepared = prepare(&scene, settings).expect("the settings fit the scene");
        Case { scene, prepared }
    }

    pub fn inputs(&self) -> Inputs<'_> {
        self.prepared.inputs(&self.scene)
    }

    /// Runs one kernel once and returns what `buffers` then hold.
    pub fn run(&self, stem: &'static str, step: &Step, buffers: &[(Slot, &[u8])]) -> Outputs {
        run(stem, &self.inputs(), &self.scene.nodes, step, buffers)
    }
}

/// Buffers after a dispatch.
pub struct Outputs(Loaded);

impl Outputs {
    pub fn get<T: Pod>(&self, slot: Slot) -> Vec<T> {
        bench().read(&self.0, slot)
    }
}

pub fn run(stem: &'static str, inputs: &Inputs, nodes: &[UVec4], step: &Step, buffers: &[(Slot, &[u8])]) -> Outputs {
    let mut bench = bench();
    let loaded = bench.load(inputs, nodes, buffers);
    bench.dispatch(stem, &loaded, step);
    bench.check();
    Outputs(loaded)
}

/// Asserts that the relative `errors` of all items are within 1e-5 but for one in a thousand, and that none is not a number.
/// A hit or a choice that flips at an edge is such an exception, by whatever amount.
pub fn assert_close(what: &str, errors: &[f64]) {
    assert!(errors.iter().all(|e| !e.is_nan()), "{what}: NaN");
    let outside = errors.iter().filter(|e| **e > 1e-5).count();
    let mut sorted: Vec<f64> = errors.to_vec();
    sorted.sort_by(f64::total_cmp);
    let median = sorted[sorted.len() / 2];
    println!(
        "{what}: {} items, median {median:.1e}, {outside} beyond 1e-5, worst {:.1e}",
        errors.len(),
        sorted[sorted.len() - 1]
    );
    assert!(outside * 1000 <= errors.len(), "{what}: {outside} of {} items differ by more than 1e-5", errors.len());
}
