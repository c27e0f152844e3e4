//! Each kernel alone against its f64 twin, fed with the twin's output of the stage before; under the validation layer
//! with synchronization checks.

// Each test program uses its part.
mod cloud;
#[allow(dead_code)]
#[path = "../common/mod.rs"]
mod common;
mod math;
mod models;
mod mutants;
mod overflow;
#[path = "../common/pool.rs"]
mod pool;
#[allow(dead_code)]
#[path = "../images/scenes.rs"]
mod scenes;
mod shared;
mod sphere;
mod stages;
mod steps;
mod sweep;
mod textures;
mod verify;
mod watertight;

use bytemuck::Pod;
use glam::{UVec4, Vec3};
use pool::Pool;
use std::sync::{MutexGuard, OnceLock};
use translucent::{
    Device, DeviceOptions, Scene, Settings,
    reference::Inputs,
    shared::{Slot, Step},
    verify::{Bench, Case, Loaded},
};

/// The bench of this test, for it alone as long as it is held.
pub fn bench() -> MutexGuard<'static, Bench> {
    static BENCHES: Pool<Bench> = [const { OnceLock::new() }; 2];
    pool::own(&BENCHES, || {
        let options = DeviceOptions { validation: true, ..DeviceOptions::default() };
        let device = Device::open(&options).expect("a Vulkan device and the validation layer");
        Bench::new(&device).expect("bench")
    })
}

/// Validation must have had nothing to say.
pub fn check(bench: &Bench) {
    let messages = bench.device.validation_messages();
    assert!(messages.is_empty(), "{messages:#?}");
}

/// A scene with what kernels read of it.
pub fn case(scene: Scene, settings: &Settings) -> Case {
    Case::new("", scene, settings).expect("the settings fit the scene")
}

/// Runs one kernel once on a case and returns what `buffers` then hold.
pub fn run_case(case: &Case, stem: &'static str, step: &Step, buffers: &[(Slot, &[u8])]) -> Outputs {
    run(stem, &case.inputs(), &case.scene.nodes, step, buffers)
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

/// Values of a shared function, one of FUNCTION_*, at the arguments `x`.
pub fn evaluate(function: u32, inputs: &Inputs, nodes: &[UVec4], x: &[Vec3]) -> Vec<Vec3> {
    let mut bench = bench();
    let found = bench.evaluate(function, inputs, nodes, x, &[]).expect("evaluate");
    check(&bench);
    found
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
