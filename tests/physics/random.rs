//! The points: stratification of the net, scrambling, independence of keys.

use translucent::reference::random::*;
use translucent::shared::Features;

/// Points 0 to 2^m - 1 of two dimensions, scrambled with two keys.
fn points(m: u32, dimensions: [usize; 2], keys: Option<[u32; 2]>) -> Vec<[u32; 2]> {
    let coordinate = |i, j: usize| match keys {
        Some(keys) => scramble(sobol(i, dimensions[j]), keys[j]),
        None => sobol(i, dimensions[j]),
    };
    (0..1u32 << m).map(|i| [coordinate(i, 0), coordinate(i, 1)]).collect()
}

/// Whether every elementary interval of area 2^-m holds exactly one of the 2^m points.
fn is_net(points: &[[u32; 2]], m: u32) -> bool {
    (0..=m).all(|a| {
        let mut seen = vec![false; points.len()];
        // Shifts by 32 are split in two.
        points.iter().for_each(|p| {
            seen[((((p[0] >> 1) >> (31 - a)) << (m - a)) | ((p[1] >> 1) >> (31 - (m - a)))) as usize] = true
        });
        seen.into_iter().all(|s| s)
    })
}

#[test]
fn first_two_dimensions_are_a_net_scrambled_or_not() {
    for m in [1, 4, 8, 11] {
        assert!(is_net(&points(m, [0, 1], None), m), "2^{m}");
        for seed in 0..8 {
            let keys = [key(seed, 3, 4, 5, 0), key(seed, 3, 4, 5, 1)];
            assert!(is_net(&points(m, [0, 1], Some(keys)), m), "2^{m} scrambled with seed {seed}");
        }
    }
}

#[test]
fn every_dimension_is_stratified() {
    for dimension in 0..SOBOL_DIMENSIONS {
        for m in [1, 5, 10] {
            for key in [None, Some(0x1234_5678), Some(hash(9))] {
                let mut seen = vec![false; 1 << m];
                for i in 0..1 << m {
                    let v = sobol(i, dimension);
                    seen[(key.map_or(v, |k| scramble(v, k)) >> (32 - m)) as usize] = true;
                }
                assert!(seen.into_iter().all(|s| s), "dimension {dimension}, 2^{m}, {key:x?}");
            }
        }
    }
}

#[test]
fn published_points() {
    // Points 1 to 3 of new-joe-kuo-6.21201 (the program's output, Gray code undone), as fractions of 8.
    let eighths = |i| -> [u32; 7] { std::array::from_fn(|d| sobol(i, d) >> 29) };
    assert_eq!(eighths(1), [4; 7]);
    assert_eq!(eighths(2), [2, 6, 6, 6, 2, 2, 6]);
    assert_eq!(eighths(3), [6, 2, 2, 2, 6, 6, 2]);
}

#[test]
fn scrambling_is_a_nested_bijection() {
    for key in [0, 1, 0xdead_beef, hash(77)] {
        for i in 0..2000u32 {
            let v = hash(i);
            let bit = i % 32;
            // Two numbers that agree in exactly the leading 31 - bit bits still do after scrambling.
            let difference = scramble(v, key) ^ scramble(v ^ (1 << bit), key);
            assert_eq!(difference.leading_zeros(), 31 - bit, "key {key:x} bit {bit}");
        }
    }
}

#[test]
fn scrambled_coordinates_are_uniform_over_keys() {
    // Chi-square over 64 cells, 63 degrees of freedom: above 129 has probability 2e-6.
    for point in [0, 1, 7] {
        let mut cells = [0f64; 64];
        let keys = 64 * 400;
        for seed in 0..keys {
            cells[(scramble(sobol(point, 2), key(seed, 1, 2, 3, 0)) >> 26) as usize] += 1.0;
        }
        let chi2: f64 = cells.iter().map(|n| (n - 400.0).powi(2) / 400.0).sum();
        assert!(chi2 < 129.0, "point {point}: {chi2}");
    }
}

#[test]
fn keys_differ_between_neighbours() {
    let mut keys = std::collections::HashSet::new();
    for (seed, x, y) in (0..4).flat_map(|s| (0..8).flat_map(move |x| (0..8).map(move |y| (s, x, y)))) {
        for (batch, dimension) in (0..8).flat_map(|b| (0..12).map(move |d| (b, d))) {
            keys.insert(key(seed, x, y, batch, dimension));
        }
    }
    // 24,576 draws of 2^32 collide .07 times on average; three or more have probability 5e-5.
    assert!(keys.len() >= 4 * 64 * 96 - 2, "{}", keys.len());
}

#[test]
fn hash_is_a_bijection() {
    // Undone step by step: both multipliers are odd and each shift is undone by repeating it.
    let inverse = |m: u32| (0..5).fold(m, |x, _| x.wrapping_mul(2u32.wrapping_sub(m.wrapping_mul(x))));
    for i in 0..1000u32 {
        let v = i.wrapping_mul(0x9e37_79b9);
        let mut x = hash(v);
        x ^= x >> 15 ^ x >> 30;
        x = x.wrapping_mul(inverse(0xd35a_2d97));
        x ^= x >> 15 ^ x >> 30;
        x = x.wrapping_mul(inverse(0x21f0_aaad));
        x ^= x >> 16;
        assert_eq!(x, v);
    }
}

#[test]
fn units_are_below_one() {
    assert_eq!(unit(u32::MAX), 1.0 - 2f64.powi(-24));
    assert_eq!(unit(0xff), 0.0);
    assert_eq!(unit(u32::MAX) as f32, 1.0 - 2f32.powi(-24));
}

#[test]
fn sample_indices_split_into_batches_and_strata() {
    assert_eq!((batch(13), stratum(&Features::default(), 13)), (5, 0));
    assert_eq!((batch(32), stratum(&Features::default(), 32)), (0, 1));
    assert_eq!(point(17), std::array::from_fn(|k| sobol(2, k + 2)));
}
