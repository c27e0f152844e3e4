//! `verify` finds every fault that is planted in the kernels, and names the function or kernel that has it. This takes
//! minutes; run it by name: `cargo test --test mutants`.

#[allow(dead_code)]
#[path = "../embed/app.rs"]
mod app;
mod barriers;
mod plant;
mod table;

use plant::Plantation;
use table::MUTANTS;
use translucent::{Device, DeviceOptions, verify::Bench};

#[test]
fn every_planted_fault_is_named() {
    assert!(MUTANTS.len() >= 30);
    let device = Device::open(&DeviceOptions::default()).expect("a Vulkan device");
    let mut bench = Bench::new(&device).expect("bench");
    let mut plantation = Plantation::new();
    let only = std::env::var("MUTANT").unwrap_or_default();
    let wanted = MUTANTS.iter().filter(|mutant| mutant.named.contains(&only) || mutant.file.contains(&only));
    let missed: Vec<String> = wanted.filter_map(|mutant| plantation.check(&mut bench, mutant).err()).collect();
    assert!(missed.is_empty(), "{} of {} are missed:\n{}", missed.len(), MUTANTS.len(), missed.join("\n"));
}
