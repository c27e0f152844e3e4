//! The kernels of the cloud on the scenes of `verify`.

use crate::{bench, check};
use translucent::{
    Result,
    verify::{Context, Verdict, cloud},
};

fn assert_passes(kernel: &str, test: fn(&mut Context) -> Result<Verdict>) {
    let mut bench = bench();
    let verdict = test(&mut Context::new(&mut bench)).expect("the device runs it");
    check(&bench);
    println!("{kernel}: {verdict}");
    assert!(verdict.passed() && verdict.values > 1000, "{kernel}: {verdict}");
}

#[test]
fn irradiance_adds_the_twins_light() {
    assert_passes("irradiance", cloud::irradiance);
}

#[test]
fn cluster_makes_the_twins_nodes() {
    assert_passes("cluster", cloud::cluster);
}

#[test]
fn gather_finds_the_twins_light() {
    assert_passes("gather", cloud::gather);
}
