//! Each kernel alone against its f64 twin, fed with the twin's output of the stage before; under the validation layer
//! with synchronization checks.

mod shared;
mod stages;
mod steps;

use bytemuck::Pod;
use glam::UVec4;
use std::sync::{Mutex, MutexGuard, OnceLock};
use translucent::{
    Device, DeviceOptions, Scene, Settings,
    gpu::{Bindings, Buffer, Kernel, Layout, Location, Recorder, download, upload},
    prepare::{Prepared, prepare},
    reference::Inputs,
    render::SPIRV,
    shared::{Slot, Step},
};

/// The device that all tests share, one test at a time.
pub fn device() -> MutexGuard<'static, Device> {
    static DEVICE: OnceLock<Mutex<Device>> = OnceLock::new();
    let open = || {
        let options = DeviceOptions { validation: true, ..DeviceOptions::default() };
        Mutex::new(Device::open(&options).expect("a Vulkan device and the validation layer"))
    };
    DEVICE.get_or_init(open).lock().unwrap_or_else(|poisoned| poisoned.into_inner())
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
pub struct Outputs(Vec<(Slot, Vec<u8>)>);

impl Outputs {
    pub fn get<T: Pod>(&self, slot: Slot) -> Vec<T> {
        let (_, bytes) = self.0.iter().find(|(s, _)| *s == slot).expect("the slot was bound");
        bytemuck::pod_collect_to_vec(bytes)
    }
}

pub fn run(stem: &'static str, inputs: &Inputs, nodes: &[UVec4], step: &Step, buffers: &[(Slot, &[u8])]) -> Outputs {
    let device = device();
    let outputs = dispatch(&device, stem, inputs, nodes, step, buffers);
    let messages = device.validation_messages();
    assert!(messages.is_empty(), "{stem}: {messages:#?}");
    outputs
}

fn dispatch(
    device: &Device,
    stem: &'static str,
    inputs: &Inputs,
    nodes: &[UVec4],
    step: &Step,
    buffers: &[(Slot, &[u8])],
) -> Outputs {
    let (_, spirv) = SPIRV.iter().find(|(name, _)| *name == stem).expect("the kernel exists");
    let layout = Layout::new(device).expect("layout");
    let kernel = Kernel::new(&layout, stem, spirv, &inputs.features, 64).expect("kernel");
    let fixed: [(Slot, &[u8]); 9] = [
        (Slot::Views, bytemuck::bytes_of(inputs.view)),
        (Slot::Nodes, bytemuck::cast_slice(nodes)),
        (Slot::Triangles, bytemuck::cast_slice(inputs.triangles)),
        (Slot::Shadings, bytemuck::cast_slice(inputs.shadings)),
        (Slot::Materials, bytemuck::cast_slice(inputs.materials)),
        (Slot::Lights, bytemuck::cast_slice(inputs.lights)),
        (Slot::Environment, bytemuck::cast_slice(inputs.environment)),
        (Slot::EnvironmentCdf, bytemuck::cast_slice(inputs.environment_cdf)),
        (Slot::Counters, &[0; 4]),
    ];
    let mut made = Vec::new();
    for (slot, data) in fixed.into_iter().chain(buffers.iter().copied()).filter(|(_, data)| !data.is_empty()) {
        let buffer = Buffer::new(device, slot.name(), data.len() as u64, Location::Device).expect("buffer");
        upload(device, &buffer, data).expect("upload");
        made.push((slot, buffer));
    }
    let bound: Vec<_> = made.iter().map(|(slot, buffer)| (*slot, buffer)).collect();
    let bindings = Bindings::new(&layout, &bound).expect("bindings");
    let mut recorder = Recorder::new(device).expect("recorder");
    recorder.begin().expect("begin");
    recorder.dispatch(&kernel, &bindings, step.pixel_count, step);
    recorder.submit_and_wait().expect("submit");
    let read = |buffer: &Buffer| download(device, buffer, buffer.bytes()).expect("download");
    Outputs(made.iter().map(|(slot, buffer)| (*slot, read(buffer))).collect())
}

/// Asserts that the relative `errors` of all items are within 1e-5 but for one in a thousand, and those are few and finite.
/// A hit or a choice that flips at an edge is such an exception.
pub fn assert_close(what: &str, errors: &[f64]) {
    let outside = errors.iter().filter(|e| !(**e <= 1e-5)).count();
    let mut sorted: Vec<f64> = errors.to_vec();
    sorted.sort_by(f64::total_cmp);
    let median = sorted[sorted.len() / 2];
    println!(
        "{what}: {} items, median {median:.1e}, {outside} beyond 1e-5, worst {:.1e}",
        errors.len(),
        sorted[sorted.len() - 1]
    );
    assert!(errors.iter().all(|e| !e.is_nan()), "{what}: NaN");
    assert!(outside * 1000 <= errors.len(), "{what}: {outside} of {} items differ by more than 1e-5", errors.len());
}
