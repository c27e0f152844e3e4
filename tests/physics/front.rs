//! The Pareto front of times and errors.

use translucent::tradeoff::front;

#[test]
fn the_front_holds_what_nothing_beats() {
    let none = f64::NAN;
    // Fast and bad, slow and good, and between them; one beaten in both, one as fast but worse, one slower and no better.
    let points = [(1.0, 9.0), (8.0, 1.0), (3.0, 4.0), (4.0, 5.0), (3.0, 6.0), (9.0, 1.0), (none, 0.0), (0.0, none)];
    assert_eq!(front(&points), [true, true, true, false, false, false, false, false]);
    // Equals stand side by side.
    assert_eq!(front(&[(2.0, 2.0), (2.0, 2.0), (1.0, 3.0)]), [true; 3]);
    assert_eq!(front(&[]), [false; 0]);
}

/// Against the definition, for every pair.
#[test]
fn the_front_is_that_of_its_definition() {
    let at = |i: u32| (f64::from(i * 7919 % 23), f64::from(i * 104_729 % 29));
    let points: Vec<(f64, f64)> = (0..120).map(at).collect();
    let beaten = |p: &(f64, f64)| points.iter().any(|q| q.0 <= p.0 && q.1 <= p.1 && q != p);
    let expected: Vec<bool> = points.iter().map(|point| !beaten(point)).collect();
    assert!(expected.contains(&true));
    assert_eq!(front(&points), expected);
}
