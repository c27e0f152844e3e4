//! Named materials: the tables' numbers, through totals and another program's copy of them.

use crate::materials::dipole_total;
use translucent::scene::{preset, presets};

/// Diffuse reflectance that Jensen et al. 2001 print beside their coefficients (as recomputed with the exact Fresnel
/// moments): a slip in any of a row's digits shows.
const TOTALS: &[(&str, [f64; 3])] = &[
    ("apple", [0.846, 0.841, 0.528]),
    ("chicken1", [0.314, 0.156, 0.126]),
    ("chicken2", [0.321, 0.160, 0.108]),
    ("cream", [0.976, 0.900, 0.725]),
    ("ketchup", [0.164, 0.006, 0.002]),
    ("marble", [0.830, 0.791, 0.753]),
    ("potato", [0.764, 0.613, 0.213]),
    ("skimmilk", [0.815, 0.813, 0.682]),
    ("skin1", [0.436, 0.227, 0.131]),
    ("skin2", [0.623, 0.433, 0.343]),
    ("spectralon", [1.000, 1.000, 1.000]),
    ("wholemilk", [0.908, 0.881, 0.759]),
];

#[test]
fn jensen_totals() {
    for (name, totals) in TOTALS {
        let preset = preset(name).expect("in the table");
        for (channel, wanted) in totals.iter().enumerate() {
            let (scattering, absorption) = (preset.sigma_s_prime[channel], preset.sigma_a[channel]);
            let total = dipole_total(scattering / (scattering + absorption), preset.ior);
            assert!((total - wanted).abs() < 0.001, "{name} {channel}: {total}");
        }
    }
    assert_eq!(preset("marble").expect("in the table").ior, 1.5);
    assert_eq!(preset("skin1").expect("in the table").ior, 1.3);
}

#[test]
fn narasimhan_reduced_as_pbrt_prints_them() {
    // pbrt-v3, src/core/medium.cpp: sigma_s' to five digits.
    let reduced = [
        ("lowfat_milk", [0.89187, 1.5136, 2.532]),
        ("reduced_milk", [2.4858, 3.1669, 4.5214]),
        ("regular_milk", [4.5513, 5.8294, 7.136]),
        ("espresso", [0.72378, 0.84557, 1.0247]),
        ("mint_mocha_coffee", [0.31602, 0.38538, 0.48131]),
    ];
    for (name, wanted) in reduced {
        let preset = preset(name).expect("in the table");
        for (channel, wanted) in wanted.iter().enumerate() {
            let value = preset.sigma_s_prime[channel];
            assert!((value / wanted - 1.0).abs() < 5e-5, "{name} {channel}: {value} is not {wanted}");
        }
        assert_eq!(preset.ior, 1.33);
    }
}

#[test]
fn every_row_is_there_once_and_sane() {
    let all = presets();
    assert_eq!(all.len(), 12 + 35);
    for row in &all {
        assert_eq!(all.iter().filter(|other| other.name == row.name).count(), 1, "{}", row.name);
        assert!(row.sigma_s_prime.min_element() >= 0.0 && row.sigma_a.min_element() >= 0.0, "{}", row.name);
        assert!(row.g.min_element() >= 0.0 && row.g.max_element() < 1.0, "{}", row.name);
    }
}

#[test]
fn unknown_names_are_answered_with_close_ones() {
    let message = preset("skni1").expect_err("no such material");
    assert!(message.starts_with("unknown preset \"skni1\"; close names: skin1"), "{message}");
    let message = preset("Milk").expect_err("names are in lower case");
    assert!(message.contains("milk"), "{message}");
    assert!(preset(&"x".repeat(1 << 20)).expect_err("no such material").len() < 300);
}
