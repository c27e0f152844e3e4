//! The tabulated profile: against independent simulations, its sampler, its store.

use glam::{DVec2, DVec3};
use std::f64::consts::{PI, SQRT_2};

use translucent::reference::boundary::{Side, diffuse_reflectance};
use translucent::reference::math::integrate;
use translucent::reference::profile::{
    Coefficients, Matter, Options, Profile, draw_radius, plane_density, shapes, tabulated,
};
use translucent::settings::Directional;
use translucent::settings::Normalisation;
use translucent::settings::Precision;
use translucent::shared::MODEL_TABLE;
use translucent::table::{
    block::{pack, unpack},
    cache,
    single::Matter as Single,
    store,
    walk::{Incidence, Walk},
    white::White,
};

const OPTIONS: Options = Options {
    normalisation: Normalisation::Energy,
    radius_tail: 1e-4,
    directional: Directional { renormalise: false, reciprocal: false, kappa: 1.0 },
    precision: Precision::Packed,
};

fn matter(sigma_s_prime: f64, sigma_a: f64, ior: f64) -> Coefficients {
    Coefficients { sigma_s_prime, sigma_a, g: 0.0, ior, rough: None, appearance: None }
}

/// Independent Monte Carlo: a pencil of light that entered along the normal into a half-space with a smooth boundary,
/// isotropic scattering; exitance between two radii [mm] with its standard error [1/mm^2], as far as a table reaches.
struct Searchlight {
    sigma_s: f64,
    sigma_a: f64,
    ior: f64,
    total: f64,
    rings: &'static [[f64; 4]],
}

const MARBLE: Searchlight = Searchlight {
    sigma_s: 2.62,
    sigma_a: 0.0041,
    ior: 1.5,
    total: 0.799655,
    rings: &[
        [0.0, 0.00133352, 190.24, 2.6],
        [0.00133352, 0.00191095, 77.012, 1.4],
        [0.00191095, 0.00273842, 52.548, 0.86],
        [0.00273842, 0.00392419, 36.194, 0.52],
        [0.00392419, 0.00562341, 25.566, 0.31],
        [0.00562341, 0.00805842, 16.899, 0.18],
        [0.00805842, 0.0115478, 11.597, 0.091],
        [0.0115478, 0.0165482, 7.7739, 0.054],
        [0.0165482, 0.0237137, 5.0317, 0.032],
        [0.0237137, 0.0339821, 3.2988, 0.018],
        [0.0339821, 0.0486968, 2.1315, 0.0087],
        [0.0486968, 0.0697831, 1.3481, 0.0055],
        [0.0697831, 0.1, 0.84914, 0.003],
        [0.1, 0.143301, 0.53168, 0.0016],
        [0.143301, 0.205353, 0.33612, 0.00099],
        [0.205353, 0.294273, 0.21658, 0.00052],
        [0.294273, 0.421697, 0.1411, 0.00028],
        [0.421697, 0.604296, 0.091689, 0.00018],
        [0.604296, 0.865964, 0.05775, 0.0001],
        [0.865964, 1.24094, 0.034207, 4.3e-05],
        [1.24094, 1.77828, 0.01862, 2.3e-05],
        [1.77828, 2.5483, 0.0090695, 1.3e-05],
        [2.5483, 3.65174, 0.0039127, 5.1e-06],
        [3.65174, 5.23299, 0.0014784, 2.2e-06],
        [5.23299, 7.49894, 0.00048388, 8.5e-07],
        [7.49894, 10.7461, 0.0001341, 2.7e-07],
        [10.7461, 15.3993, 3.0313e-05, 8.1e-08],
        [15.3993, 22.0673, 5.1672e-06, 2.2e-08],
        [22.0673, 31.6228, 5.9633e-07, 3.6e-09],
        [31.6228, 45.3158, 3.8244e-08, 5.6e-10],
        [45.3158, 64.9382, 1.2477e-09, 6.7e-11],
        [64.9382, 93.0572, 1.0151e-11, 4.6e-12],
    ],
};

const SKIN: Searchlight = Searchlight {
    sigma_s: 0.74,
    sigma_a: 0.032,
    ior: 1.3,
    total: 0.439431,
    rings: &[
        [0.0, 0.00133352, 65.458, 0.92],
        [0.00133352, 0.00191095, 27.232, 0.44],
        [0.00191095, 0.00273842, 18.674, 0.25],
        [0.00273842, 0.00392419, 12.633, 0.15],
        [0.00392419, 0.00562341, 9.0203, 0.091],
        [0.00562341, 0.00805842, 6.2054, 0.056],
        [0.00805842, 0.0115478, 4.2115, 0.031],
        [0.0115478, 0.0165482, 2.8778, 0.018],
        [0.0165482, 0.0237137, 1.9742, 0.011],
        [0.0237137, 0.0339821, 1.3551, 0.0067],
        [0.0339821, 0.0486968, 0.9136, 0.0037],
        [0.0486968, 0.0697831, 0.61125, 0.0017],
        [0.0697831, 0.1, 0.39872, 0.0011],
        [0.1, 0.143301, 0.26121, 0.00066],
        [0.143301, 0.205353, 0.16745, 0.00033],
        [0.205353, 0.294273, 0.10586, 0.00018],
        [0.294273, 0.421697, 0.065912, 0.0001],
        [0.421697, 0.604296, 0.040166, 5.4e-05],
        [0.604296, 0.865964, 0.024392, 3.1e-05],
        [0.865964, 1.24094, 0.014587, 1.6e-05],
        [1.24094, 1.77828, 0.0085973, 7.9e-06],
        [1.77828, 2.5483, 0.0048635, 4.1e-06],
        [2.5483, 3.65174, 0.0025242, 2e-06],
        [3.65174, 5.23299, 0.001145, 8.5e-07],
        [5.23299, 7.49894, 0.00042754, 3.3e-07],
        [7.49894, 10.7461, 0.00012174, 1.2e-07],
        [10.7461, 15.3993, 2.447e-05, 3.3e-08],
        [15.3993, 22.0673, 3.0725e-06, 6.9e-09],
        [22.0673, 31.6228, 2.0717e-07, 1.1e-09],
    ],
};

#[test]
fn searchlight_is_that_of_an_independent_monte_carlo() {
    for light in [&MARBLE, &SKIN] {
        let profile = Profile::new(MODEL_TABLE, &matter(light.sigma_s, light.sigma_a, light.ior));
        let (mut difference, mut energy) = (0.0, 0.0);
        for &[r0, r1, expected, error] in light.rings {
            let area = PI * (r1 * r1 - r0 * r0);
            let mean = integrate(r0, r1, 1, |r| 2.0 * PI * r * profile.rd(r)) / area;
            assert!((mean - expected).abs() < 5.0 * error + 0.015 * expected, "{r0}: {mean} for {expected} +- {error}");
            difference += area * (mean - expected).abs();
            energy += area * expected;
        }
        // Its own noise and ours, some .3 % each.
        assert!(difference / energy < 0.01, "{}", difference / energy);
        assert!((profile.total() - light.total).abs() < 0.003 * light.total, "{} for {}", profile.total(), light.total);
    }
}

#[test]
fn tables_of_forward_scattering_are_what_the_random_walk_gives() {
    // alpha' = .9, g = .8, n = 1.4, lengths in 1 / sigma_t'; 4e6 paths of the independent walk.
    const RINGS: [[f64; 3]; 20] = [
        [0.05, 6.21162e-1, 4.4e-3],
        [0.05 * SQRT_2, 2.43514e-1, 2.7e-3],
        [0.1, 1.67551e-1, 1.6e-3],
        [0.1 * SQRT_2, 1.19396e-1, 9.3e-4],
        [0.2, 8.12077e-2, 5.4e-4],
        [0.2 * SQRT_2, 5.65138e-2, 3.1e-4],
        [0.4, 3.97401e-2, 1.8e-4],
        [0.4 * SQRT_2, 2.78820e-2, 1.0e-4],
        [0.8, 1.94028e-2, 6.0e-5],
        [0.8 * SQRT_2, 1.29291e-2, 3.3e-5],
        [1.6, 8.02756e-3, 1.8e-5],
        [1.6 * SQRT_2, 4.48792e-3, 8.8e-6],
        [3.2, 2.11703e-3, 3.9e-6],
        [3.2 * SQRT_2, 7.99888e-4, 1.5e-6],
        [6.4, 2.25050e-4, 4.9e-7],
        [6.4 * SQRT_2, 4.35461e-5, 1.2e-7],
        [12.8, 4.99281e-6, 2.1e-8],
        [12.8 * SQRT_2, 2.98583e-7, 2.4e-9],
        [25.6, 7.50446e-9, 1.6e-10],
        [25.6 * SQRT_2, 5.47273e-11, 8.2e-12],
    ];
    const TOTAL: (f64, f64) = (0.244571, 1.52e-4);
    let (albedo, scattering) = (0.9, 0.9);
    let profile = White::simulate(1.4, 0.8, &[f64::INFINITY], |_| 1 << 15).profile(albedo, f64::INFINITY);
    let total = profile.total();
    assert!((total.mean - TOTAL.0).abs() < 4.0 * total.error.hypot(TOTAL.1), "{total:?}");
    let (mut from, mut difference, mut energy, mut noise) = (0.0, 0.0, 0.0, 0.0);
    for [to, expected, error] in RINGS {
        let area = PI * (to * to - from * from);
        let ring = |r: f64| 2.0 * PI * r * scattering * scattering * profile.value(scattering * r);
        let mean = integrate(f64::max(from, 1e-9), to, 1, ring) / area;
        // A ring has four cells; where they are all noise the profile is continued.
        let own = profile.error(scattering * (from + to) / 2.0) * expected;
        if own < 0.1 * expected {
            let allowed = 5.0 * (own / 2.0).hypot(error);
            assert!((mean - expected).abs() < allowed, "{to}: {mean} for {expected} +- {error}, own {own}");
        }
        difference += area * (mean - expected).abs();
        energy += area * expected;
        noise += area * (own / 2.0).hypot(error);
        from = to;
    }
    assert!((energy - TOTAL.0).abs() < 5e-5, "the rings hold all light");
    // The mean of |x| is .8 standard deviations; twice that is beyond any chance in twenty rings.
    assert!(difference < 1.6 * noise, "{} of {}", difference / energy, noise / energy);
    assert!(noise < 0.05 * energy, "no force at {}", noise / energy);
}

#[test]
fn density_is_that_of_the_drawn_radii() {
    let channels = [matter(2.62, 0.0041, 1.5), matter(1.0, 0.5, 1.5), matter(0.3, 3.0, 1.5)];
    let mut tables = vec![];
    let material = tabulated(&channels, OPTIONS, &[], &mut tables);
    let matter = Matter { material: &material, tables: &tables, curvature: 0.0 };
    // The distribution of drawn radii is the integral of the density.
    let draws = 4096u32;
    for limit in [0.003, 0.1, 0.7, 2.0, 10.0] {
        let mut start = 0.0;
        let below: f64 = [0, 3, 6]
            .map(|component| {
                let end = f64::from(material.component_cdf[component]);
                let (chance, middle) = (end - start, (start + end) / 2.0);
                start = end;
                let within = |i: &u32| draw_radius(matter, middle, (f64::from(*i) + 0.5) / f64::from(draws)) < limit;
                chance * (0..draws).filter(within).count() as f64 / f64::from(draws)
            })
            .iter()
            .sum();
        let integral = integrate((1e-9f64).ln(), f64::ln(limit), 60, |x| {
            2.0 * PI * (2.0 * x).exp() * plane_density(matter, x.exp())
        });
        assert!((below - integral).abs() < 1.0 / f64::from(draws) + 2e-5, "{limit}: {below} for {integral}");
    }
    // On a plane every sample weighs the same in its own channel.
    for r in [1e-4, 0.01, 0.5, 3.0] {
        let weights = material.strength.as_dvec3() * shapes(matter, r) / plane_density(matter, r);
        let own = (material.strength / material.density).as_dvec3();
        assert!(weights.cmple(own * 1.0001).all(), "{weights} for {own}");
        assert!(weights.cmpge(DVec3::ZERO).all());
    }
}

/// Light within the diameter, of a grey material on a sphere of the radius [mean free paths of sigma_s'].
fn total_on_sphere(matter: &Coefficients, radius: f64) -> f64 {
    let mut tables = vec![];
    let exponent = (2.0 * (2.0 * radius).log2()).floor() as i32;
    let channels = [*matter; 3];
    let material = tabulated(&channels, OPTIONS, &[exponent, exponent + 1], &mut tables);
    let seen = Matter { material: &material, tables: &tables, curvature: 1.0 / radius };
    let leaving = PI * (1.0 - diffuse_reflectance(matter.ior, Side::Outside));
    integrate(1e-7f64.ln(), (2.0 * radius).ln(), 64, |x| {
        let r = x.exp();
        2.0 * PI * r * r * leaving * (material.strength.as_dvec3() * shapes(seen, r)).y
    })
}

#[test]
fn spheres_give_out_what_walks_in_them_do() {
    for (radius, sigma_a, ior) in [(1.2, 0.05, 1.5), (3.3, 0.3, 1.3), (10.0, 0.02, 1.3), (2.5, 1.0, 1.4)] {
        let matter = matter(1.0, sigma_a, ior);
        let walk = Walk { ior, g: 0.0, radius, incidence: Incidence::Normal, walks: 1 << 13, seed: 7 };
        let walked = walk.run(&[sigma_a]).remove(0).total;
        let here = Single { sigma_s: 1.0, sigma_a, g: 0.0, ior }.directly(radius);
        let (expected, found) = (walked.mean + here, total_on_sphere(&matter, radius));
        // 1 % for the interpolation between radii; on planes these totals are up to a third lower.
        let allowed = 4.0 * walked.error + 0.01 * expected;
        assert!((found - expected).abs() < allowed, "{radius}: {found} for {expected} +- {}", walked.error);
        let plane = Profile::new(MODEL_TABLE, &matter).total();
        assert!(expected - plane > 2.0 * allowed || radius > 5.0 || sigma_a >= 1.0, "{radius}: no force at {plane}");
    }
}

#[test]
fn density_is_that_of_the_drawn_radii_on_spheres() {
    let channels = [matter(2.0, 0.01, 1.3), matter(1.0, 0.5, 1.3), matter(4.0, 1.0, 1.3)];
    let mut tables = vec![];
    let material = tabulated(&channels, OPTIONS, &[0, 1, 2, 3], &mut tables);
    // Smaller than all, between two, between the largest and the half-space, a half-space.
    for curvature in [3.0, 1.2, 0.2, 0.0] {
        let matter = Matter { material: &material, tables: &tables, curvature };
        let draws = 256;
        for limit in [0.01, 0.3, 0.6, 1.5] {
            let numbers = (0..draws).flat_map(|i| (0..3 * draws).map(move |j| (i, j)));
            let below = numbers
                .filter(|&(i, j)| {
                    let number = |k: usize, n: usize| (k as f64 + 0.5) / n as f64;
                    draw_radius(matter, number(j, 3 * draws), number(i, draws)) < limit
                })
                .count() as f64
                / (3 * draws * draws) as f64;
            // The profile ends at the sphere's diameter.
            let end = if curvature > 0.0 { f64::min(limit, 2.0 / curvature) } else { limit };
            let integral = integrate((1e-9f64).ln(), end.ln(), 200, |x| {
                2.0 * PI * (2.0 * x).exp() * plane_density(matter, x.exp())
            });
            assert!((below - integral).abs() < 2.0 / draws as f64, "{curvature} {limit}: {below} for {integral}");
        }
    }
}

#[test]
fn cache_keeps_tables_and_survives_what_is_not_one() {
    let folder = std::env::temp_dir().join(format!("translucent-cache-{}", std::process::id()));
    let (ior, g, walks) = (1.45, 0.3, 320);
    let make = || cache::table(Some(&folder), ior, g, walks);
    // Writers at once: each gets the same table, and the file is whole.
    let tables: Vec<_> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..3).map(|_| scope.spawn(make)).collect();
        threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    });
    assert!(tables.iter().all(|table| *table == tables[0]));
    let file = cache::file(&folder, ior, g, walks);
    let bytes = std::fs::read(&file).expect("the table was kept");
    assert_eq!(std::fs::read_dir(&folder).expect("a folder").count(), 1, "parts are left over");
    assert_eq!(store::decode(&bytes).as_ref(), Some(&tables[0]));
    assert_eq!(store::encode(&tables[0]), bytes);
    // Truncated, changed or empty files are no tables, and are replaced.
    let mut changed = bytes.clone();
    changed[100] ^= 1;
    for wrong in [&bytes[..bytes.len() - 1], &changed, &[]] {
        assert_eq!(store::decode(wrong), None);
        std::fs::write(&file, wrong).expect("writable");
        assert!(make() == tables[0]);
        assert_eq!(std::fs::read(&file).expect("readable"), bytes);
    }
    let _ = std::fs::remove_dir_all(&folder);
    // A folder that cannot be made costs the cache alone.
    assert!(cache::table(Some(std::path::Path::new("/dev/null/none")), ior, g, walks) == tables[0]);
}

/// Two values in one f32: off by 1/4095 of the larger at most, and a number that no device takes for another.
#[test]
fn cells_keep_two_values() {
    let magnitudes = [0.0, 1e-45, 1e-30, 3e-7, 1.0 - 1e-9, 1.0, 4094.6, 4095.0, 4095.9, 1e20];
    for low in magnitudes {
        for high in magnitudes.into_iter().flat_map(|x| [x, low * 0.9999, low / 3.0]) {
            let values = DVec2::new(low, high);
            let cell = pack(values);
            assert!(cell.is_normal(), "{values}: {cell:e}");
            // Below what the least exponent resolves, values are 0.
            let bound = (values.max_element() / 4095.0).max(f64::from(f32::MIN_POSITIVE));
            assert!((unpack(cell) - values).abs().max_element() <= bound, "{values}: {}", unpack(cell));
        }
    }
}
