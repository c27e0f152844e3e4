//! The tests that `verify` alone has, on this device; `./x verify-drivers` runs all of them on all drivers.

use crate::{bench, check};
use translucent::verify::{Context, TESTS};

#[test]
fn functions_and_recordings_pass() {
    let mut bench = bench();
    let mut context = Context::new(&mut bench);
    // Of functions, whose every input `math` and `models` have more of.
    context.fraction = 4;
    let mut failed = vec![];
    // The kernels of every render are tested in `stages`, images in another program.
    let recording = |name: &str| ["kernel.begin", "kernel.count"].contains(&name);
    let elsewhere = |name: &str| name.starts_with("image.") || name.starts_with("kernel.") && !recording(name);
    for test in TESTS.iter().filter(|test| !elsewhere(test.name)) {
        let start = std::time::Instant::now();
        let verdict = test.run(&mut context).expect("the device runs it");
        println!("{} {:.2} s: {verdict}", test.name, start.elapsed().as_secs_f64());
        if !verdict.passed() {
            failed.push(test.name);
        }
    }
    check(&bench);
    assert!(failed.is_empty(), "{failed:?}");
}
