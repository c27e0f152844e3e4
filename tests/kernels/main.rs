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
mod watertight;

use bytemuck::Pod;
use glam::{UVec4, Vec3};
use std::sync::{Mutex, MutexGuard, OnceLock};
use translucent::{
    Device, DeviceOptions, Scene, Settings,
    prepare::{Prepared, prepare},
    reference::Inputs,
    shared::{Slot, Step, glsl},
    verify::{Bench, Loaded},
};

/// The bench that all tests share, one test at a time.
pub fn bench() -> MutexGuard<'static, Bench> {
    static BENCH: OnceLock<Mutex<Bench>> = OnceLock::new();
    let make = || {
        let options = DeviceOptions { validation: true, ..DeviceOptions::default() };
        let device = Device::open(&options).expect("a Vulkan device and the validation layer");
        Mutex::new(Bench::new(&device).expect("bench"))
    };
    BENCH.get_or_init(make).lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}

/// Validation must have had nothing to say.
pub fn check(bench: &Bench) {
    let messages = bench.device.validation_messages();
    assert!(messages.is_empty(), "{messages:#?}");
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
        bench().read(&self.0, slot).expect("read")
    }
}

pub fn run(stem: &'static str, inputs: &Inputs, nodes: &[UVec4], step: &Step, buffers: &[(Slot, &[u8])]) -> Outputs {
    let mut bench = bench();
    let loaded = bench.run(stem, inputs, nodes, step, buffers).expect("run");
    check(&bench);
    Outputs(loaded)
}

/// Runs a kernel that only a test has over `numbers` in BatchSums and returns what it leaves there. `source` is its GLSL,
/// `function` the `step_.ray_begin` by which it may tell what to compute.
pub fn evaluate(
    stem: &'static str,
    source: &str,
    inputs: &Inputs,
    nodes: &[UVec4],
    function: u32,
    numbers: &[Vec3],
) -> Vec<Vec3> {
    let mut bench = bench();
    if bench.module(stem).is_none() {
        bench.replace(stem, compile(source));
    }
    let found = bench.evaluate(stem, inputs, nodes, function, numbers).expect("evaluate");
    check(&bench);
    found
}

/// SPIR-V of GLSL that may include what kernels do.
fn compile(source: &str) -> Vec<u8> {
    let compiler = shaderc::Compiler::new().expect("shaderc starts");
    let mut options = shaderc::CompileOptions::new().expect("shaderc starts");
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
    options.set_include_callback(|name, _, _, _| {
        let content = match name {
            "shared.glsl" => glsl(),
            _ => std::fs::read_to_string(format!("{}/glsl/{name}", env!("CARGO_MANIFEST_DIR")))
                .map_err(|error| error.to_string())?,
        };
        Ok(shaderc::ResolvedInclude { resolved_name: name.into(), content })
    });
    let compiled =
        compiler.compile_into_spirv(source.trim_start(), shaderc::ShaderKind::Compute, "test", "main", Some(&options));
    compiled.expect("the kernel compiles").as_binary_u8().to_vec()
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
