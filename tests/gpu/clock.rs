//! From timestamps to the host's clock, by hand.

use translucent::gpu::{Clock, Moment};

const NANOSECONDS: Clock = Clock { period: 1.0, bits: 64 };

#[test]
fn timestamps_are_counted_in_their_valid_bits_and_across_the_wrap() {
    assert_eq!(NANOSECONDS.between(5, 12), 7.0);
    assert_eq!(NANOSECONDS.between(12, 5), -7.0);
    assert_eq!(NANOSECONDS.between(u64::MAX - 2, 4), 7.0);
    let clock = Clock { period: 52.083, bits: 36 };
    let top = 0xabcd << 36;
    assert_eq!(clock.between(top + 5, 12), 7.0 * 52.083);
    assert_eq!(clock.between((1 << 36) - 3, top + 4), 7.0 * 52.083);
    assert_eq!(clock.between(top + 4, (1 << 36) - 3), -7.0 * 52.083);
}

#[test]
fn work_is_where_the_common_moment_says_and_never_outside_of_submission_and_end() {
    let ticks = [1_000, 1_600];
    let place = |common| NANOSECONDS.place(ticks, [200.0, 1_000.0], common);
    // 200 ns to spare.
    assert_eq!(place(None), Moment { ticks: 1_000, host: 300.0, deviation: 100.0 });
    let known = |host| Some(Moment { ticks: 1_500, host, deviation: 7.0 });
    assert_eq!(place(known(750.0)), Moment { ticks: 1_000, host: 250.0, deviation: 7.0 });
    assert_eq!(place(known(650.0)).host, 200.0);
    assert_eq!(place(known(1_000.0)).host, 400.0);
    assert_eq!(NANOSECONDS.host(place(known(750.0)), 1_600), 850.0);
    // Clocks that run apart: longer than there was time for.
    assert_eq!(NANOSECONDS.place(ticks, [0.0, 500.0], known(750.0)).host, -50.0);
}
