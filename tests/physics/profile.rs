//! The standard dipole: closed forms against quadrature, golden values, sampler against distribution.

use crate::common::{channels, standard};
use glam::{DVec3, dvec3};
use std::f64::consts::{PI, TAU};
use translucent::Normalisation;
use translucent::reference::boundary::{Side, diffuse_reflectance};
use translucent::reference::math::integrate;
use translucent::reference::profile::*;
use translucent::shared::{MODEL_STANDARD, TRANSLUCENT};

/// Matter of a stated albedo with sigma_t' = 1.
fn matter(albedo: f64, ior: f64) -> Dipole {
    Dipole::new(albedo, 1.0 - albedo, ior)
}

fn cases() -> impl Iterator<Item = (f64, f64, Dipole)> {
    [1.0, 1.3, 1.5, 0.8]
        .into_iter()
        .flat_map(|ior| [0.05, 0.5, 0.95, 0.9999].map(|albedo| (albedo, ior, matter(albedo, ior))))
}

/// Integral of f over [0, radius]; geometric panels, because the profile has two scales.
fn radial(radius: f64, f: impl Fn(f64) -> f64) -> f64 {
    let start = 1e-3f64.min(radius);
    let spread = (radius / start).ln();
    integrate(0.0, start, 2, &f) + integrate(0.0, spread, 200, |x| f(start * x.exp()) * start * x.exp())
}

#[test]
fn boundary_factor_is_exact() {
    assert_eq!(boundary_factor(1.0), 1.0);
    assert!((boundary_factor(1.3) - 2.600079).abs() < 5e-7);
    assert!((boundary_factor(1.5) - 3.954736).abs() < 5e-7);
}

#[test]
fn closed_forms_match_quadrature() {
    for (albedo, ior, dipole) in cases() {
        let far = dipole.radius_beyond(1e-14);
        let total = radial(far, |r| TAU * r * dipole.rd(r));
        assert!((dipole.total() / total - 1.0).abs() < 1e-10, "total, alpha' {albedo} n {ior}");
        let e = (3.0 * (1.0 - albedo)).sqrt();
        let form = albedo / 2.0 * (1.0 + (-4.0 / 3.0 * boundary_factor(ior) * e).exp()) * (-e).exp();
        assert!((dipole.total() / form - 1.0).abs() < 1e-10, "Jensen and Buhler's total, alpha' {albedo} n {ior}");
        for radius in [1e-3, 0.1, 1.0, 7.0] {
            let part = radial(radius, |r| TAU * r * dipole.rd(r));
            assert!((dipole.cdf(radius) / part - 1.0).abs() < 1e-10, "cdf({radius}), alpha' {albedo} n {ior}");
        }
    }
}

#[test]
fn response_to_a_cosine_matches_quadrature() {
    // Along the other axis the profile integrates to a line spread; its cosine transform is the MTF.
    let dipole = matter(0.95, 1.3);
    let bessel = |x: f64| integrate(0.0, PI, 8 + (x.abs() / 4.0) as usize, |t| (x * t.sin()).cos()) / PI;
    for k in [0.0, 0.3, 1.0, 2.0] {
        let expected = radial(60.0, |r| TAU * r * dipole.rd(r) * bessel(k * r));
        let beyond = dipole.total() - dipole.cdf(60.0);
        let difference = (dipole.mtf(k) - expected).abs();
        assert!(difference < 1e-10 + beyond, "k {k}: {difference}");
    }
}

#[test]
fn totals_of_known_matter() {
    // Diffuse reflectance of Jensen et al. 2001, table 1, recomputed: marble and ketchup.
    for (sigma_s, sigma_a, ior, expected) in
        [(2.19, 0.0021, 1.5, 0.830), (3.0, 0.0071, 1.5, 0.753), (0.18, 0.061, 1.3, 0.164), (11.6, 0.0, 1.3, 1.0)]
    {
        let total = Dipole::new(sigma_s, sigma_a, ior).total();
        assert!((total - expected).abs() < 5.01e-4, "{total} for {expected}");
    }
}

#[test]
fn inversion_of_the_total() {
    let golden = [
        (1.3, [(0.1, 0.591934548), (0.5, 0.972563550), (0.9, 0.999487726), (0.99, 0.999995479)]),
        (1.5, [(0.1, 0.597952842), (0.5, 0.981539772), (0.9, 0.999705251), (0.99, 0.999997442)]),
    ];
    for (ior, values) in golden {
        for (total, albedo) in values {
            let e = invert_total(total, ior);
            assert!((1.0 - e * e / 3.0 - albedo).abs() < 5.01e-10, "Rd {total} n {ior}: {}", 1.0 - e * e / 3.0);
        }
    }
    for ior in [1.0, 1.3, 1.5, 2.0] {
        for total in [1e-4, 0.003, 0.2, 0.5, 0.9, 0.999, 0.9999] {
            let e = invert_total(total, ior);
            let again = Dipole::new(1.0 - e * e / 3.0, e * e / 3.0, ior).total();
            assert!((again - total).abs() < 1e-9 * total, "Rd {total} n {ior}: {again}");
        }
        for total in [1e-12, 1e-9, 1e-6, 1.0 - 1e-6, 1.0 - 1e-9, 1.0 - 1e-12, 1.0 - 1e-15] {
            let e = invert_total(total, ior);
            let again = Dipole::new(1.0 - e * e / 3.0, e * e / 3.0, ior).total();
            assert!((again - total).abs() < 1e-15, "Rd {total} n {ior}: {again}");
        }
        assert_eq!(invert_total(1.0, ior), 0.0);
        assert!((invert_total(0.0, ior) - 3f64.sqrt()).abs() < 1e-15);
    }
}

#[test]
fn sampler_inverts_its_distribution() {
    for sigma in [0.0, 1e-9, 1e-3, 0.4, 1.0, 30.0] {
        for u in [0.0, 1e-12, 1e-6, 0.1, 0.5, 0.9, 0.999, 1.0 - 2f64.powi(-24)] {
            for z in [1.0, 4.0] {
                let source = Source { sigma, z };
                let (d, r) = (source.distance(u), source.radius(u));
                assert!(d >= z && d.is_finite());
                let rise = r * r / (d + z);
                let below = (-sigma * rise).exp() * rise / d - (-sigma * rise).exp_m1();
                assert!((below - u).abs() < 1e-12, "sigma {sigma} z {z} u {u}: {below}");
                assert!((r.hypot(z) / d - 1.0).abs() < 1e-14);
            }
        }
    }
    let white = Source { sigma: 0.0, z: 2.0 };
    assert!((white.distance(0.75) - 8.0).abs() < 1e-13, "sigma_tr = 0: d = z / (1 - u)");
}

#[test]
fn samples_follow_the_profile() {
    // Kolmogorov and Smirnov at 1e-6: sup |F_n - F| > sqrt(ln(2e6) / 2n) for a wrong sampler. u and the source come from
    // the golden ratio and a hash, which are not the sampler's own points.
    let dipole = matter(0.9, 1.3);
    let count = 20_000u32;
    let first = (-dipole.sigma_tr * dipole.z_real).exp() / dipole.mass();
    let mut radii: Vec<f64> = (0..count)
        .map(|i| {
            let u = f64::from(translucent::reference::random::hash(2 * i)) / 2f64.powi(32);
            let v = f64::from(translucent::reference::random::hash(2 * i + 1)) / 2f64.powi(32);
            dipole.radius(usize::from(v >= first), 0.0, u)
        })
        .collect();
    radii.sort_by(f64::total_cmp);
    let worst = radii.iter().enumerate().map(|(i, &r)| {
        let f = dipole.cdf(r) / dipole.total();
        (f - i as f64 / f64::from(count)).abs().max((f - (i + 1) as f64 / f64::from(count)).abs())
    });
    let worst = worst.fold(0.0, f64::max);
    let bound = (2e6f64.ln() / (2.0 * f64::from(count))).sqrt();
    assert!(worst < bound, "{worst} against {bound}");
}

#[test]
fn radius_of_a_tail() {
    for (albedo, ior, dipole) in cases() {
        for share in [0.5, 1e-3, 1e-6] {
            let outside = 1.0 - dipole.cdf(dipole.radius_beyond(share)) / dipole.total();
            assert!((outside - share).abs() < 1e-9, "alpha' {albedo} n {ior} share {share}: {outside}");
        }
        assert_eq!(dipole.radius_beyond(0.0), f64::INFINITY);
    }
}

#[test]
fn material_holds_the_profile() {
    let (sigma_s, sigma_a) = (dvec3(2.19, 0.0, 0.74), dvec3(0.0021, 1.0, 0.032));
    let material = standard(sigma_s, sigma_a, 1.5, Normalisation::Energy, 1e-6);
    assert_eq!(material.flags, TRANSLUCENT);
    assert_eq!(material.density.y, 0.0);
    assert_eq!(material.strength.y, 0.0);
    assert_eq!(material.component_cdf[1], material.component_cdf[5]);
    assert_eq!(material.component_cdf[8], 1.0);
    let chances = chances(&channels(sigma_s, sigma_a, 1.5).map(|channel| Profile::new(MODEL_STANDARD, &channel)));
    assert!((f64::from(material.component_cdf[1]) - chances[0]).abs() < 1e-6);
    let mut radius = 0f64;
    for c in [0, 2] {
        let dipole = Dipole::new(sigma_s[c], sigma_a[c], 1.5);
        assert!((f64::from(material.density[c]) * dipole.mass() - chances[c]).abs() < 1e-6);
        // Flux that leaves: strength times mass, over the hemisphere with the factor Ft.
        let leaving = PI * (1.0 - diffuse_reflectance(1.5, Side::Outside));
        assert!((f64::from(material.strength[c]) * dipole.mass() * leaving / dipole.total() - 1.0).abs() < 1e-6);
        radius = radius.max(dipole.radius_beyond(1e-6));
    }
    assert!((f64::from(material.radius_max) / radius - 1.0).abs() < 1e-6);
    assert_eq!(material.camera_rate, material.sigma_tr.x.min(material.sigma_tr.z));
    assert!(material.camera_rate > 0.0);

    let black = standard(DVec3::ZERO, DVec3::ONE, 1.3, Normalisation::Energy, 1e-6);
    assert_eq!(black.component_cdf, [0.0; 9]);
    assert_eq!(black.strength, glam::Vec3::ZERO);
    assert!(black.z_real.is_finite() && black.z_virtual.is_finite());

    let white = standard(DVec3::ONE, DVec3::ZERO, 1.3, Normalisation::Energy, 0.0);
    assert_eq!(white.radius_max, UNBOUNDED);
    assert_eq!(white.camera_rate, 0.0);
}

#[test]
fn jensen_is_darker_by_what_the_surface_reflects() {
    let of = |normalisation| standard(DVec3::ONE, DVec3::splat(0.1), 1.3, normalisation, 1e-6).strength.x;
    let ratio = f64::from(of(Normalisation::Jensen2001)) / f64::from(of(Normalisation::Energy));
    assert!((ratio - (1.0 - diffuse_reflectance(1.3, Side::Outside))).abs() < 2e-7, "{ratio}");
}
