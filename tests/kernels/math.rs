//! The elementary functions of `math.glsl` against f64, over all that kernels ask of them.

use crate::common::World;
use glam::Vec3;
use translucent::{
    reference::random::{hash, unit},
    shared::*,
};

/// Bound on the errors of every function here.
const BOUND: f64 = 1.0 / (1 << 21) as f64;

/// The function's values at `x`, on the device.
fn evaluate(function: u32, x: &[Vec3]) -> Vec<Vec3> {
    crate::evaluate(function, &World::default().inputs(), &[], x)
}

/// 2^16 numbers in [0, 1), the k-th kind of them.
fn numbers(k: u32) -> impl Iterator<Item = f64> {
    (0..1 << 16).map(move |i| unit(hash(i ^ k << 20)))
}

fn arguments(values: impl Iterator<Item = f64>) -> Vec<Vec3> {
    values.map(|x| Vec3::new(x as f32, 0.0, 0.0)).collect()
}

fn assert_relative(what: &str, x: &[Vec3], y: &[Vec3], truth: impl Fn(f64) -> f64) {
    let error = |(x, y): (&Vec3, &Vec3)| {
        let truth = truth(f64::from(x.x));
        ((f64::from(y.x) - truth) / if truth == 0.0 { 1.0 } else { truth }).abs()
    };
    let worst = x.iter().zip(y).map(error).fold(0.0, f64::max);
    println!("{what}: {worst:.1e}");
    assert!(worst <= BOUND, "{what}: {worst:e}");
}

#[test]
fn exponential() {
    let x = arguments(numbers(0).map(|u| 174.0 * u - 86.5).chain(numbers(1).map(|u| u - 0.5)));
    assert_relative("exp", &x, &evaluate(FUNCTION_EXP, &x), f64::exp);
    // Beyond the range: nothing, or infinity; never less than nothing, never not a number.
    let far = evaluate(FUNCTION_EXP, &arguments([-1e30, -88.0, -87.1, 89.0, 1e30].into_iter()));
    assert_eq!(far.iter().map(|y| y.x).collect::<Vec<_>>(), [0.0, 0.0, 0.0, f32::INFINITY, f32::INFINITY]);
}

#[test]
fn one_minus_exponential() {
    let x = arguments(numbers(8).map(|u| 10f64.powf(32.0 * u - 30.0)).chain(numbers(9)).chain([1e30]));
    assert_relative("(1 - exp(-x)) / x", &x, &evaluate(FUNCTION_ONE_MINUS_EXP_OVER, &x), |x| -f64::exp_m1(-x) / x);
}

#[test]
fn logarithms() {
    // Over all magnitudes, and near 1, where a driver's own log has no digits.
    let magnitudes = numbers(2).map(|u| 10f64.powf(70.0 * u - 37.0));
    let x = arguments(magnitudes.chain(numbers(3).map(|u| 1.0 + (u - 0.5) * 1e-3)).chain([1.0]));
    assert_relative("log", &x, &evaluate(FUNCTION_LOG, &x), f64::ln);
    let x = arguments(numbers(4).map(|u| 10f64.powf(28.0 * u - 20.0)).chain([0.0]));
    assert_relative("log1p", &x, &evaluate(FUNCTION_LOG1P, &x), f64::ln_1p);
}

#[test]
fn circle() {
    let x = arguments(numbers(5).chain([0.0, 0.25, 0.5, 0.75, 1.0]));
    let error = |(x, y): (&Vec3, &Vec3)| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(x.x)).sin_cos();
        (f64::from(y.x) - cos).abs().max((f64::from(y.y) - sin).abs())
    };
    let worst = x.iter().zip(&evaluate(FUNCTION_COS_SIN, &x)).map(error).fold(0.0, f64::max);
    println!("cos, sin: {worst:.1e}");
    assert!(worst <= BOUND, "{worst:e}");

    let signed = |u: f64| (2.0 * u - 1.0) * 10f64.powf(8.0 * u - 6.0);
    let mut x: Vec<Vec3> =
        numbers(6).zip(numbers(7)).map(|(a, b)| Vec3::new(signed(a) as f32, signed(b) as f32, 0.0)).collect();
    x.extend([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (0.0, 0.0)].map(|(a, b)| Vec3::new(a, b, 0.0)));
    let error = |(x, y): (&Vec3, &Vec3)| {
        let truth = f64::from(x.y).atan2(f64::from(x.x));
        ((f64::from(y.x) - truth) / if truth == 0.0 { 1.0 } else { truth }).abs()
    };
    let worst = x.iter().zip(&evaluate(FUNCTION_ATAN2, &x)).map(error).fold(0.0, f64::max);
    println!("atan2: {worst:.1e}");
    assert!(worst <= BOUND, "{worst:e}");
}
