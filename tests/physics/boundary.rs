//! Fresnel moments against a published table and quadrature; microfacet densities against their integrals.

use glam::{DVec3, dvec3};
use std::f64::consts::{PI, TAU};
use translucent::reference::boundary::*;
use translucent::reference::math::integrate;

/// n, 2 C1 from outside, 2 C1 from inside, 3 C2 from outside, 3 C2 from inside; exact to the digits shown.
const MOMENTS: [[f64; 5]; 10] = [
    [1.05, 0.0138856490, 0.1055652145, 0.0041682793, 0.0355099296],
    [1.1, 0.0251573574, 0.1943449234, 0.0097793867, 0.0879197422],
    [1.2, 0.0442802662, 0.3363057404, 0.0221610688, 0.1984961781],
    [1.3, 0.0611318252, 0.4444567013, 0.0353498811, 0.3002669594],
    [1.33, 0.0659308493, 0.4719491488, 0.0394133021, 0.3282385236],
    [1.4, 0.0768115456, 0.5289854824, 0.0490386060, 0.3887828243],
    [1.5, 0.0917779593, 0.5963457597, 0.0630480578, 0.4644305221],
    [1.6, 0.1062455678, 0.6508771749, 0.0772415116, 0.5287773604],
    [2.0, 0.1605966371, 0.7901491593, 0.1339650831, 0.7048700560],
    [2.5, 0.2218665735, 0.8754986518, 0.2008475373, 0.8206402063],
];

#[test]
fn moments_match_the_table() {
    for [n, outside1, inside1, outside2, inside2] in MOMENTS {
        for (k, side, expected) in [
            (1, Side::Outside, outside1),
            (1, Side::Inside, inside1),
            (2, Side::Outside, outside2),
            (2, Side::Inside, inside2),
        ] {
            let moment = f64::from(k + 1) * moment(n, k, side);
            assert!((moment - expected).abs() < 1e-9, "n {n} C{k} {side:?}: {moment} for {expected}");
            // The same surface, looked at from the other medium.
            let other = if side == Side::Inside { Side::Outside } else { Side::Inside };
            let swapped = f64::from(k + 1) * translucent::reference::boundary::moment(1.0 / n, k, other);
            assert!((swapped - expected).abs() < 1e-9, "1/n {n} C{k}: {swapped} for {expected}");
        }
        assert!((diffuse_reflectance(n, Side::Outside) - outside1).abs() < 1e-9);
        assert!((diffuse_reflectance(n, Side::Inside) - inside1).abs() < 1e-9);
        assert!((diffuse_reflectance(1.0 / n, Side::Inside) - outside1).abs() < 1e-9);
    }
}

#[test]
fn closed_form_and_quadrature_agree_to_twelve_digits() {
    for n in [1.0300001, 1.05, 1.3, 1.5, 2.0, 4.0] {
        for side in [Side::Outside, Side::Inside] {
            let difference = diffuse_reflectance(n, side) - 2.0 * moment(n, 1, side);
            assert!(difference.abs() < 1e-12, "n {n} {side:?}: {difference}");
        }
    }
}

#[test]
fn moments_match_quadrature_in_the_cosine() {
    // F has a square root at the critical angle: substituting c = cc + (1 - cc) t^2 makes it smooth.
    for n in [1.3f64, 1.5, 2.0] {
        let critical = (1.0 - 1.0 / (n * n)).sqrt();
        let inside = integrate(0.0, 1.0, 64, |t| {
            let c = critical + (1.0 - critical) * t * t;
            fresnel(1.0 / n, c) * c * 2.0 * (1.0 - critical) * t
        }) + critical * critical / 2.0;
        let outside = integrate(0.0, 1.0, 64, |c| fresnel(n, c) * c);
        assert!((moment(n, 1, Side::Inside) - inside).abs() < 1e-12);
        assert!((moment(n, 1, Side::Outside) - outside).abs() < 1e-12);
    }
}

#[test]
fn an_index_matched_surface_does_not_reflect() {
    for side in [Side::Outside, Side::Inside] {
        assert_eq!(diffuse_reflectance(1.0, side), 0.0);
        // Continuous there, unlike published fits: the reflectance is of the order of n - 1.
        let near = diffuse_reflectance(1.0 + 1e-8, side);
        assert!(near > 0.0 && near < 1e-7, "{near}");
    }
    for cos in [0.0, 1e-9, 0.5, 1.0] {
        assert_eq!(transmittance(1.0, cos), 1.0);
    }
}

#[test]
fn fresnel_known_points() {
    for n in [1.3f64, 1.5, 2.0] {
        let normal = ((n - 1.0) / (n + 1.0)).powi(2);
        assert!((fresnel(n, 1.0) - normal).abs() < 1e-15);
        assert!((fresnel(1.0 / n, 1.0) - normal).abs() < 1e-15);
        assert_eq!(fresnel(n, 0.0), 1.0);
        // Brewster: half of r_s^2 = ((1 - n^2) / (1 + n^2))^2 is left.
        let brewster = 1.0 / (1.0 + n * n).sqrt();
        let s = (1.0 - n * n) / (1.0 + n * n);
        assert!((fresnel(n, brewster) - s * s / 2.0).abs() < 1e-15);
        // Total reflection just below the critical cosine.
        let critical = (1.0 - 1.0 / (n * n)).sqrt();
        assert_eq!(fresnel(1.0 / n, critical - 1e-9), 1.0);
        assert_eq!(transmittance(1.0 / n, critical - 1e-9), 0.0);
    }
    assert!((transmittance(1.3, 1.0) - 0.98298677).abs() < 1e-8);
}

#[test]
fn ggx_is_a_density_of_projected_area() {
    for alpha in [0.05f64, 0.3, 1.0] {
        // t = tan of the angle over alpha makes the peak wide whatever alpha is.
        let area = integrate(0.0, PI / 2.0, 64, |x| {
            let tan = alpha * x.tan();
            let cos = 1.0 / (1.0 + tan * tan).sqrt();
            let solid_angle = TAU * tan * cos.powi(3) * alpha / x.cos().powi(2);
            ggx(alpha, cos) * cos * solid_angle
        });
        assert!((area - 1.0).abs() < 1e-9, "alpha {alpha}: {area}");
    }
}

#[test]
fn visible_normals_have_their_density() {
    // The density integrates to 1 (all normals; reflections below the horizon are part of it), and the mean of the
    // drawn normals is the one under the density.
    let alpha = 0.4;
    let wo = dvec3(0.8, 0.1, 0.3).normalize();
    let density = |h: DVec3| ggx(alpha, h.z) * smith_g1(alpha, wo.z) * h.dot(wo).max(0.0) / wo.z;
    let over_sphere = |f: &dyn Fn(DVec3) -> f64| {
        integrate(0.0, 1.0, 40, |z| {
            let r = (1.0 - z * z).sqrt();
            integrate(0.0, TAU, 20, |phi| {
                let h = dvec3(r * phi.cos(), r * phi.sin(), z);
                density(h) * f(h)
            })
        })
    };
    let total = over_sphere(&|_| 1.0);
    assert!((total - 1.0).abs() < 1e-4, "{total}");
    let expected = DVec3::from([0, 1, 2].map(|axis| over_sphere(&|h| h[axis])));

    // A regular grid: the error of the mean falls with the cell, not with its root.
    let side = 400;
    let mut mean = DVec3::ZERO;
    for i in 0..side {
        for j in 0..side {
            let at = |k: i32| (f64::from(k) + 0.5) / f64::from(side);
            mean += visible_normal(alpha, wo, at(i), at(j));
        }
    }
    mean /= f64::from(side * side);
    assert!(mean.distance(expected) < 1e-3, "{mean} for {expected}");
}

#[test]
fn reflected_density_is_the_normals_over_the_jacobian() {
    let (alpha, wo) = (0.3, dvec3(0.6, 0.0, 0.8));
    let h = dvec3(0.1, 0.2, 1.0).normalize();
    let normals = ggx(alpha, h.z) * smith_g1(alpha, wo.z) * h.dot(wo) / wo.z;
    assert!((visible_normal_pdf(alpha, wo.z, h.z) - normals / (4.0 * h.dot(wo))).abs() < 1e-14);
}

#[test]
fn schlick_runs_from_f0_to_white() {
    let f0 = dvec3(0.04, 0.5, 1.0);
    assert_eq!(schlick(f0, 1.0), f0);
    assert_eq!(schlick(f0, 0.0), DVec3::ONE);
}
