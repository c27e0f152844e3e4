//! The tests of `verify` on this device, all of which must pass.

use crate::{bench, check};
use translucent::verify::{Context, TESTS};

#[test]
fn every_test_passes() {
    let mut bench = bench();
    let mut context = Context::new(&mut bench);
    // Of functions, whose every input `math` and `models` have more of.
    context.fraction = 4;
    let mut failed = vec![];
    for test in TESTS {
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
