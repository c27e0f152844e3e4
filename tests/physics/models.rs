//! Every model: closed forms against quadrature and its printed formula, samplers against distributions, golden values.

use crate::common::*;
use glam::{DVec3, dvec3};
use std::f64::consts::{PI, TAU};
use translucent::Normalisation::{Energy, Jensen2001};
use translucent::reference::boundary::{Side, diffuse_reflectance, moment};
use translucent::reference::math::integrate;
use translucent::reference::profile::*;
use translucent::reference::random::{hash, unit};
use translucent::scene::LengthKind;
use translucent::settings;
use translucent::shared::{MODEL_BETTER, MODEL_BURLEY, MODEL_DIRECTIONAL, MODEL_STANDARD, RECIPROCAL};

const RADIAL: [u32; 3] = [MODEL_STANDARD, MODEL_BETTER, MODEL_BURLEY];

/// Matter with sigma_t' = 1.
fn matter(albedo: f64, ior: f64) -> Coefficients {
    Coefficients { sigma_s_prime: albedo, sigma_a: 1.0 - albedo, g: 0.0, ior, rough: None, appearance: None }
}

fn cases() -> impl Iterator<Item = (String, Profile)> {
    RADIAL.into_iter().flat_map(|model| {
        [1.0, 1.3, 0.8, 3.0].into_iter().flat_map(move |ior| {
            [0.05, 0.5, 0.95, 0.9999, 1.0].into_iter().map(move |albedo| {
                (format!("model {model}, alpha' {albedo}, n {ior}"), Profile::new(model, &matter(albedo, ior)))
            })
        })
    })
}

/// Integral of f over [a, b] with geometric panels.
fn radial(a: f64, b: f64, f: impl Fn(f64) -> f64) -> f64 {
    integrate(0.0, (b / a).ln(), 240, |x| f(a * x.exp()) * a * x.exp())
}

#[test]
fn closed_forms_match_quadrature() {
    for (name, profile) in cases() {
        let ring = |r: f64| TAU * r * profile.shape(r);
        for (a, b) in [(1e-9, 0.1), (0.1, 1.0), (1.0, 7.0), (7.0, 90.0)] {
            let found = radial(a, b, ring);
            let inside = profile.inside(b) - profile.inside(a);
            let outside = profile.outside(a) - profile.outside(b);
            assert!((found - inside).abs() < 1e-11 * profile.mass(), "{name}: {found} and {inside} from {a} to {b}");
            assert!((found - outside).abs() < 1e-11 * profile.mass(), "{name}: {found} and {outside} from {a} to {b}");
        }
        assert!((profile.outside(0.0) / profile.mass() - 1.0).abs() < 1e-13, "{name}");
        assert!((profile.response(0.0) / profile.mass() - 1.0).abs() < 1e-13, "{name}");
        assert!((profile.shape_shifted(0.7, 2.0) / profile.shape(0.7) - 2f64.exp()).abs() < 1e-12, "{name}");
    }
}

#[test]
fn responses_match_quadrature() {
    let bessel = |x: f64| integrate(0.0, PI, 8 + (x.abs() / 4.0) as usize, |t| (x * t.sin()).cos()) / PI;
    for model in RADIAL {
        let profile = Profile::new(model, &matter(0.9, 1.4));
        for k in [0.3, 1.0, 2.0] {
            let found = radial(1e-9, 60.0, |r| TAU * r * profile.shape(r) * bessel(k * r));
            let difference = (profile.response(k) - found).abs();
            assert!(difference < 1e-8 + profile.outside(60.0), "model {model}, k {k}: {difference}");
        }
    }
}

#[test]
fn better_dipole_is_the_printed_formula() {
    for (albedo, ior) in [(0.3, 1.0), (0.9, 1.3), (0.999, 1.5), (0.7, 0.8)] {
        let profile = BetterDipole::new(1.0 - albedo, 1.0, ior);
        let (c1, c2) = (moment(ior, 1, Side::Inside), moment(ior, 2, Side::Inside));
        let (c_phi, c_e) = ((1.0 - 2.0 * c1) / 4.0, (1.0 - 3.0 * c2) / 2.0);
        let d = (2.0 - albedo) / 3.0;
        let s = ((1.0 - albedo) / d).sqrt();
        let a = (1.0 + 3.0 * c2) / (1.0 - 2.0 * c1);
        for r in [0.0, 1e-3, 0.1, 1.0, 5.0] {
            let term = |z: f64| {
                let x = f64::hypot(r, z);
                (c_e * z * (1.0 + s * x) / (x * x) + c_phi / d) * (-s * x).exp() / x
            };
            let printed = albedo * albedo / (4.0 * PI) * (term(1.0) - term(-(1.0 + 4.0 * a * d)));
            assert!((profile.rd(r) / printed - 1.0).abs() < 1e-9, "alpha' {albedo} n {ior} r {r}");
        }
        let mu = ((1.0 - albedo) * (2.0 - albedo) / 3.0).sqrt();
        let decay = (-4.0 * a * mu).exp();
        let total = albedo * albedo / 2.0
            * (-(3.0 * (1.0 - albedo) / (2.0 - albedo)).sqrt()).exp()
            * (c_e * (1.0 + decay) + c_phi / mu * (1.0 - decay));
        assert!((profile.total() / total - 1.0).abs() < 1e-9, "total, alpha' {albedo} n {ior}");
    }
}

#[test]
fn better_dipole_has_its_known_totals() {
    // Monte Carlo's companion table: alpha' against the total without a boundary and at n = 1.3.
    for (albedo, totals) in [
        (0.5, [0.046, 0.0289]),
        (0.8, [0.199, 0.131]),
        (0.9, [0.344, 0.243]),
        (0.95, [0.486, 0.370]),
        (0.99, [0.738, 0.642]),
        (0.999, [0.911, 0.869]),
    ] {
        for (ior, expected) in [1.0, 1.3].into_iter().zip(totals) {
            let total = BetterDipole::new(1.0 - albedo, 1.0, ior).total();
            assert!((total - expected).abs() < 5.01e-4, "alpha' {albedo} n {ior}: {total}");
        }
    }
    for ior in [0.7, 1.0, 1.0 + 1e-6, 1.3, 3.0] {
        let total = BetterDipole::new(0.0, 2.0, ior).total();
        assert!((total - 1.0).abs() < 1e-12, "white at n {ior}: {total}");
    }
}

#[test]
fn better_dipole_keeps_its_digits_far_away() {
    // White matter: shape falls as 1 / r^3, sources z / (2 pi r^3) and the line k (z_v^2 - z_r^2) / (4 pi r^3).
    let white = BetterDipole::new(0.0, 1.0, 1.3);
    let (near, far) = (white.z_real, white.z_virtual);
    let coefficient = (near + far + white.fluence * (far * far - near * near) / 2.0) / TAU;
    assert!((white.shape(1e7) * 1e21 / coefficient - 1.0).abs() < 1e-12);
}

#[test]
fn burley_is_what_the_author_wrote() {
    for (kind, s) in [
        (LengthKind::MeanFreePath, 1.85 - 0.6 + 7.0 * 0.008),
        (LengthKind::DiffuseMeanFreePath, 3.5 + 100.0 * 0.27f64.powi(4)),
    ] {
        let authored = Coefficients { appearance: Some((0.6, 2.0, kind)), ..matter(0.9, 1.4) };
        let Profile::Burley(profile) = Profile::new(MODEL_BURLEY, &authored) else { panic!("a Burley profile") };
        assert_eq!(profile.total(), 0.6);
        assert!((profile.rate - s / 2.0).abs() < 1e-15);
        let x = s * 0.7 / 2.0;
        let printed = 0.6 * s / (8.0 * PI * 2.0 * 0.7) * ((-x).exp() + (-x / 3.0).exp());
        assert!((profile.rd(0.7) / printed - 1.0).abs() < 1e-14);
    }
    assert!((Fit::Diffuse.scale(0.5) - (1.4 + 3.5 * 0.09)).abs() < 1e-15);
    // Coefficients: the standard dipole's total and the diffuse mean free path; without absorption the mean free path.
    for ior in [1.0, 1.5] {
        let (burley, dipole) = (Profile::new(MODEL_BURLEY, &matter(0.8, ior)), Dipole::new(0.8, 0.2, ior));
        assert!((burley.total() / dipole.total() - 1.0).abs() < 1e-14);
        assert!((burley.rate() * 3.0 / dipole.sigma_tr - Fit::DiffuseMeanFreePath.scale(dipole.total())).abs() < 1e-12);
    }
    let white = Profile::new(MODEL_BURLEY, &matter(1.0, 1.5));
    assert_eq!(white.total(), 1.0);
    assert!((3.0 * white.rate() - Fit::Searchlight.scale(1.0)).abs() < 1e-15);
    assert!(white.shape(0.0).is_finite());
    let black =
        Coefficients { sigma_s_prime: 0.0, appearance: Some((0.0, 1.0, LengthKind::MeanFreePath)), ..matter(0.5, 1.3) };
    assert_eq!(Profile::new(MODEL_BURLEY, &black).total(), 0.0);
}

#[test]
fn an_authors_albedo_is_the_better_dipoles_total() {
    for ior in [1.0, 1.3, 1.5, 2.0] {
        for albedo in [1e-4, 0.003, 0.2, 0.5, 0.9, 0.999, 0.9999] {
            let t = better::invert_total(albedo, ior);
            let again = BetterDipole::new(t * t / (3.0 - t * t), 1.0, ior).total();
            assert!((again - albedo).abs() < 1e-9 * albedo, "Rd {albedo} n {ior}: {again}");
            for kind in [LengthKind::MeanFreePath, LengthKind::DiffuseMeanFreePath] {
                let authored = Coefficients { appearance: Some((albedo, 0.3, kind)), ..matter(0.9, ior) };
                let Profile::Better(profile) = Profile::new(MODEL_BETTER, &authored) else { panic!("a better dipole") };
                assert!((profile.total() - albedo).abs() < 1e-9 * albedo);
                let length = if kind == LengthKind::MeanFreePath { profile.z_real } else { 1.0 / profile.sigma_tr };
                assert!((length / 0.3 - 1.0).abs() < 1e-12, "{kind:?}: {length}");
            }
        }
        assert_eq!(better::invert_total(1.0, ior), 0.0);
        assert!((better::invert_total(0.0, ior) - 1.5f64.sqrt()).abs() < 1e-15);
    }
}

#[test]
fn wide_channels_are_drawn_more_often() {
    let profiles =
        channels(1e2 * dvec3(1.0, 4.0, 1e3), DVec3::ZERO, 1.4).map(|channel| Profile::new(MODEL_BURLEY, &channel));
    // Lengths of 1, 1/4 and 1/1000; a quarter is dealt out equally.
    let expected = [1.0, 0.25, 0.001].map(|length: f64| 1.0 / 12.0 + 0.75 * length / 1.251);
    let found = chances(&profiles);
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?} for {expected:?}");
    // Beyond the body all widths are alike.
    let wide = channels(dvec3(1e-3, 1e-2, 1e-1), DVec3::ZERO, 1.4).map(|channel| Profile::new(MODEL_BURLEY, &channel));
    assert!(chances(&wide).iter().all(|chance| (chance - 1.0 / 3.0).abs() < 1e-9));
    let black = channels(dvec3(1.0, 0.0, 2.0), DVec3::ONE, 1.4).map(|channel| Profile::new(MODEL_STANDARD, &channel));
    let found = chances(&black);
    assert!(found[1] == 0.0 && found[0] > found[2] && (found.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{found:?}");
}

#[test]
fn samplers_follow_the_profiles() {
    // Kolmogorov and Smirnov at 1e-6 as in `profile`, over all three channels of one material.
    let count = 20_000u32;
    let bound = (2e6f64.ln() / (2.0 * f64::from(count))).sqrt();
    let (scattering, absorption) = (dvec3(2.0, 0.5, 1.0), dvec3(0.01, 0.5, 0.0));
    for model in [MODEL_STANDARD, MODEL_BETTER, MODEL_BURLEY, MODEL_DIRECTIONAL] {
        let options = Options {
            normalisation: Energy,
            radius_tail: 0.0,
            directional: Default::default(),
            precision: Default::default(),
        };
        let material = modelled(model, scattering, absorption, 1.4, options);
        let profiles = channels(scattering, absorption, 1.4).map(|channel| Profile::new(model, &channel));
        let number = |i: u32| unit(hash(i.wrapping_mul(0x9e37_79b9) ^ 0x51ed));
        let mut radii: Vec<f64> =
            (0..count).map(|i| draw_radius((&material).into(), number(2 * i), number(2 * i + 1))).collect();
        radii.sort_by(f64::total_cmp);
        let chances = chances(&profiles);
        let expected =
            |r: f64| profiles.iter().zip(chances).map(|(p, chance)| chance * p.inside(r) / p.mass()).sum::<f64>();
        let worst = radii.iter().enumerate().map(|(i, &r)| {
            let f = expected(r);
            (f - i as f64 / f64::from(count)).abs().max((f - (i + 1) as f64 / f64::from(count)).abs())
        });
        let worst = worst.fold(0.0, f64::max);
        assert!(worst < bound, "model {model}: {worst} against {bound}");
        // And the density that kernels divide by is that of these radii.
        for (a, b) in [(0.01, 0.3), (0.3, 2.0), (2.0, 9.0)] {
            let found = radial(a, b, |r| TAU * r * plane_density((&material).into(), r));
            assert!((found - (expected(b) - expected(a))).abs() < 1e-6, "model {model} from {a} to {b}: {found}");
        }
    }
}

#[test]
fn materials_return_their_total() {
    for model in RADIAL {
        for normalisation in [Energy, Jensen2001] {
            let options = Options {
                normalisation,
                radius_tail: 1e-6,
                directional: Default::default(),
                precision: Default::default(),
            };
            let material = modelled(model, dvec3(2.0, 0.0, 1.0), dvec3(0.01, 0.5, 0.0), 1.4, options);
            assert_eq!((material.model, material.strength.y, material.density.y), (model, 0.0, 0.0));
            assert_eq!(material.component_cdf[8], 1.0);
            let leaving = if normalisation == Energy { 1.0 - diffuse_reflectance(1.4, Side::Outside) } else { 1.0 };
            for (c, matter) in channels(dvec3(2.0, 0.0, 1.0), dvec3(0.01, 0.5, 0.0), 1.4).iter().enumerate() {
                let profile = Profile::new(model, matter);
                if c == 1 {
                    assert_eq!(profile.total(), 0.0);
                    continue;
                }
                let total =
                    f64::from(material.strength[c]) * PI * leaving * Profile::unpack((&material).into(), c).mass();
                assert!((total / profile.total() - 1.0).abs() < 1e-6, "model {model}, channel {c}");
            }
        }
    }
}

/// The directional dipole of matter given by its unreduced scattering.
fn directional(sigma_s: f64, sigma_a: f64, g: f64, ior: f64, kappa: f64) -> Directional {
    let matter = Coefficients { sigma_s_prime: sigma_s * (1.0 - g), sigma_a, g, ior, rough: None, appearance: None };
    Directional::new(&matter, kappa)
}

#[test]
fn directional_dipole_has_its_golden_values() {
    // From three published implementations that agree, with exact moments. Neither regularisation touches them.
    let (sin, cos) = (0.75f64.sqrt(), 0.5);
    let tilted = dvec3(0.3, 0.2, 0.93273791).normalize();
    let cases = [
        ("A", (2.62, 0.0041, 0.0, 1.5), dvec3(1.0, 0.0, 0.0), DVec3::Z, DVec3::Z, 1.576432524e-2),
        ("B", (2.62, 0.0041, 0.0, 1.5), dvec3(0.5, 0.0, 0.0), dvec3(-sin, 0.0, cos), DVec3::Z, 6.024971489e-2),
        ("C", (2.62, 0.0041, 0.0, 1.5), dvec3(0.5, 0.0, 0.0), dvec3(sin, 0.0, cos), DVec3::Z, 3.115670914e-2),
        ("D", (10.0, 0.01, 0.9, 1.3), dvec3(0.2, 0.0, 0.0), DVec3::Z, DVec3::Z, 8.318438010e-2),
        ("E", (1.0, 0.01, 0.0, 1.3), dvec3(0.3, 0.0, -1.0), DVec3::Z, -DVec3::Z, 3.274425893e-2),
        ("F", (0.70, 0.009, 0.0, 1.3), dvec3(0.3, 0.2, -0.1), dvec3(0.6, 0.0, 0.8), tilted, 3.155625660e-2),
    ];
    for (name, (sigma_s, sigma_a, g, ior), x, wi, no, expected) in cases {
        for kappa in [0.0, 1.0] {
            let found = directional(sigma_s, sigma_a, g, ior, kappa).value(x, DVec3::Z, wi, no, 0.0);
            assert!((found / expected - 1.0).abs() < 1e-9, "{name}, kappa {kappa}: {found}");
        }
    }
}

#[test]
fn directional_dipole_has_its_known_totals() {
    // A perpendicular beam on a plane.
    for (albedo, totals) in [
        (0.5, [0.349, 0.224]),
        (0.8, [0.555, 0.356]),
        (0.9, [0.709, 0.475]),
        (0.95, [0.849, 0.602]),
        (0.99, [1.087, 0.871]),
        (0.999, [1.252, 1.103]),
    ] {
        for (ior, expected) in [1.0, 1.3].into_iter().zip(totals) {
            let total = directional(albedo, 1.0 - albedo, 0.0, ior, 1.0).total_at(1.0);
            assert!((total - expected).abs() < 2e-3, "alpha' {albedo} n {ior}: {total} for {expected}");
        }
    }
}

#[test]
fn renormalised_it_gives_the_standard_total() {
    let directional = settings::Directional { renormalise: true, ..Default::default() };
    let options = Options { normalisation: Energy, radius_tail: 1e-6, directional, precision: Default::default() };
    let (scattering, absorption) = (dvec3(2.0, 0.0, 1.0), dvec3(0.01, 0.5, 0.0));
    let material = modelled(MODEL_DIRECTIONAL, scattering, absorption, 1.4, options);
    assert_eq!(material.beam.y, 0.0);
    for c in [0, 2] {
        let found = Directional::unpack((&material).into(), c);
        let as_published = Directional::new(&channels(scattering, absorption, 1.4)[c], 1.0);
        let total = f64::from(material.beam[c]) / as_published.beam * as_published.diffuse_total();
        let expected = as_published.proposal.total();
        assert!((total / expected - 1.0).abs() < 1e-6, "channel {c}: {total} for {expected}");
        assert!((found.height / as_published.height - 1.0).abs() < 1e-6);
        assert!(as_published.diffuse_total() > 1.02 * expected, "there was something to take away");
    }
}

/// A point and unit vectors from a hash.
fn random_vectors(i: u32) -> [DVec3; 4] {
    let number = |k: u32| unit(hash(i.wrapping_mul(16) + k));
    let vector = |k: u32| {
        let (z, angle) = (2.0 * number(k) - 1.0, TAU * number(k + 1));
        let r = (1.0 - z * z).sqrt();
        dvec3(r * angle.cos(), r * angle.sin(), z)
    };
    let over = |n: DVec3, w: DVec3| if w.dot(n) < 0.0 { w - 2.0 * w.dot(n) * n } else { w };
    let (ni, no) = (vector(0), vector(2));
    let x = vector(4) * 10f64.powf(4.0 * number(6) - 3.0);
    [x, ni, over(ni, vector(8)), no]
}

#[test]
fn averaged_it_is_reciprocal() {
    let profile = directional(2.62, 0.0041, 0.0, 1.5, 1.0);
    let mut largest = 0f64;
    for i in 0..2000 {
        let [x, ni, wi, no] = random_vectors(i);
        let wo = random_vectors(i + 9000)[2];
        let wo = if wo.dot(no) < 0.0 { wo - 2.0 * wo.dot(no) * no } else { wo };
        let (there, back) = (profile.value(x, ni, wi, no, 0.0), profile.value(-x, no, wo, ni, 0.0));
        largest = largest.max((there - back).abs() / (there + back).max(1e-300));
        let average = |x: DVec3, ni: DVec3, wi: DVec3, no: DVec3, wo: DVec3| {
            (profile.value(x, ni, wi, no, 0.0) + profile.value(-x, no, wo, ni, 0.0)) / 2.0
        };
        let (a, b) = (average(x, ni, wi, no, wo), average(-x, no, wo, ni, wi));
        assert!((a - b).abs() <= 1e-12 * a, "{a} and {b}");
    }
    assert!(largest > 0.1, "as published it is not: {largest}");
    let directional = settings::Directional { reciprocal: true, ..Default::default() };
    let options = Options { normalisation: Energy, radius_tail: 1e-6, directional, precision: Default::default() };
    let flags = modelled(MODEL_DIRECTIONAL, DVec3::ONE, DVec3::ONE, 1.4, options).flags;
    assert_eq!(flags & RECIPROCAL, RECIPROCAL);
}

#[test]
fn regularised_it_is_bounded_and_continuous() {
    // Around the direction in which the refracted beam runs in the exit's tangent plane.
    let value = |profile: &Directional, r: f64, mu: f64| {
        let w = -DVec3::Z;
        let no = dvec3((1.0 - mu * mu).sqrt(), 0.0, mu);
        // With n = 1.3 and perpendicular light, w12 = -z whatever n is.
        assert!((-no.dot(w) - mu).abs() < 1e-15);
        profile.value(dvec3(0.0, r, 0.0), DVec3::Z, DVec3::Z, no, 0.0)
    };
    let (published, regular) = (directional(1.0, 0.01, 0.0, 1.3, 0.0), directional(1.0, 0.01, 0.0, 1.3, 1.0));
    let smooth = value(&regular, 1e-3, 1.0);
    for r in [1e-9, 1e-6, 1e-3, 0.1, 1.0] {
        let mut before = value(&regular, r, -0.1);
        for i in -999..=1000 {
            let now = value(&regular, r, f64::from(i) * 1e-4);
            assert!(now < 10.0 * smooth, "r {r}, mu {}: {now} against {smooth}", f64::from(i) * 1e-4);
            assert!((now - before).abs() < 2e-3 * smooth, "r {r}, mu {}: {before} to {now}", f64::from(i) * 1e-4);
            before = now;
        }
    }
    assert!(value(&published, 1e-3, 1e-3) > 1e3 * value(&published, 1e-3, -1e-3), "as published it jumps");
    // Where ni is along x, and at x = 0, it is finite.
    for (x, ni) in [(DVec3::ZERO, DVec3::Z), (dvec3(0.0, 0.0, 0.3), DVec3::Z), (dvec3(0.0, 0.0, -1e-12), DVec3::Z)] {
        assert!(regular.value(x, ni, dvec3(0.6, 0.0, 0.8), DVec3::Z, 0.0).is_finite());
    }
    // Light beyond the critical angle of a rarer medium does not enter.
    let rare = directional(1.0, 0.01, 0.0, 0.7, 1.0);
    assert_eq!(rare.value(DVec3::X, DVec3::Z, dvec3(0.8, 0.0, 0.6), DVec3::Z, 0.0), 0.0);
    assert!(rare.value(DVec3::X, DVec3::Z, DVec3::Z, DVec3::Z, 0.0) > 0.0);
}

#[test]
fn directional_dipole_keeps_its_digits_far_away() {
    // White matter at 1e6 mean free paths, against the expansion in 1 / r: fluence h^2 / (2 D r^3), and for perpendicular
    // light 3 h of C_phi, 2 x 3 D and h of C_E.
    let profile = directional(1.0, 0.0, 0.0, 1.3, 1.0);
    let (h, d) = (profile.height, profile.proposal.z_real / 3.0);
    let r = 1e6f64;
    let extrapolation = h * profile.c_phi / (1.0 - profile.c_e);
    let front = d * (d + 2.0 * extrapolation);
    let expected = profile.c_phi * ((h * h - front) / (2.0 * d) + 3.0 * h) + profile.c_e * (6.0 * d + h);
    let found = profile.value(dvec3(r, 0.0, 0.0), DVec3::Z, DVec3::Z, DVec3::Z, 0.0) * r.powi(3) / profile.beam;
    assert!((found / expected - 1.0).abs() < 1e-5, "{found} for {expected}");
}
