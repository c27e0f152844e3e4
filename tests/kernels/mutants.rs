//! A few faults of each kind that `verify` must name; `cargo test --test mutants` plants all.

use crate::bench;

#[path = "../mutants/plant.rs"]
mod plant;
#[path = "../mutants/table.rs"]
mod table;

#[test]
fn some_planted_faults_are_named() {
    let mut bench = bench();
    let mut plantation = plant::Plantation::new();
    for named in ["random.hash", "math.log1p", "traversal.nearest", "kernel.resolve"] {
        let mutant = table::MUTANTS.iter().find(|mutant| mutant.named == named).expect("it is in the table");
        plantation.check(&mut bench, mutant).expect("the fault is named");
    }
}

#[test]
fn every_fault_has_its_place() {
    let plantation = plant::Plantation::new();
    let lost: Vec<_> = table::MUTANTS.iter().filter(|mutant| !plantation.has_place(mutant)).map(|m| m.text).collect();
    assert!(lost.is_empty(), "stands in its file no longer: {lost:#?}");
}
