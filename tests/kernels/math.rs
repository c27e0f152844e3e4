//! The elementary functions of `math.glsl` against f64, over all that kernels ask of them.

use crate::bench;
use glam::Vec3;
use translucent::{
    reference::{
        Inputs,
        random::{hash, unit},
    },
    shared::{self, Features, Slot, Step, View},
};

/// Bound on the errors of every function here.
const BOUND: f64 = 1.0 / (1 << 21) as f64;

/// One invocation evaluates the function that `step_.ray_begin` names.
const KERNEL: &str = r#"
#version 460
#include "shared.glsl"
#include "math.glsl"
BATCH_SUMS(read_write);
void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= step_.pixel_count) return;
    vec3 x = batch_sums[i];
    vec2 y = vec2(0.0);
    if (step_.ray_begin == 0) y.x = exp_(x.x);
    if (step_.ray_begin == 1) y.x = log_(x.x);
    if (step_.ray_begin == 2) y.x = log1p_(x.x);
    if (step_.ray_begin == 3) y = cos_sin_2pi(x.x);
    if (step_.ray_begin == 4) y.x = atan2_(x.y, x.x);
    if (step_.ray_begin == 5) y.x = one_minus_exp_over(x.x);
    batch_sums[i] = vec3(y, 0.0);
}
"#;

/// SPIR-V of a kernel that only a test has.
pub fn compile(source: &str) -> Vec<u8> {
    let compiler = shaderc::Compiler::new().expect("shaderc starts");
    let mut options = shaderc::CompileOptions::new().expect("shaderc starts");
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
    options.set_include_callback(|name, _, _, _| {
        let content = match name {
            "shared.glsl" => shared::glsl(),
            _ => std::fs::read_to_string(format!("{}/glsl/{name}", env!("CARGO_MANIFEST_DIR")))
                .map_err(|error| error.to_string())?,
        };
        Ok(shaderc::ResolvedInclude { resolved_name: name.into(), content })
    });
    let compiled =
        compiler.compile_into_spirv(source.trim_start(), shaderc::ShaderKind::Compute, "test", "main", Some(&options));
    compiled.expect("the kernel compiles").as_binary_u8().to_vec()
}

/// The function's values at `x`, on the device.
fn evaluate(function: u32, x: &[Vec3]) -> Vec<Vec3> {
    let view = View::default();
    let inputs = Inputs {
        features: Features::default(),
        view: &view,
        triangles: &[],
        shadings: &[],
        materials: &[],
        lights: &[],
        emitters: &[],
        emitter_cdf: &[],
        boundaries: &[],
        environment: &[],
        environment_cdf: &[],
        texels: &[],
        textures: &[],
        coordinates: &[],
        profiles: &[],
        thickness: &[],
        balances: &[],
        mixtures: &[],
    };
    let mut bench = bench();
    bench.add("math", &compile(KERNEL), &inputs.features);
    let loaded = bench.load(&inputs, &[], &[(Slot::BatchSums, bytemuck::cast_slice(x))]);
    let step = Step { pixel_count: x.len() as u32, ray_begin: function, ..Step::default() };
    bench.dispatch("math", &loaded, &step);
    bench.check();
    bench.read(&loaded, Slot::BatchSums)
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
    assert_relative("exp", &x, &evaluate(0, &x), f64::exp);
    // Beyond the range: nothing, or infinity; never less than nothing, never not a number.
    let far = evaluate(0, &arguments([-1e30, -88.0, -87.1, 89.0, 1e30].into_iter()));
    assert_eq!(far.iter().map(|y| y.x).collect::<Vec<_>>(), [0.0, 0.0, 0.0, f32::INFINITY, f32::INFINITY]);
}

#[test]
fn one_minus_exponential() {
    let x = arguments(numbers(8).map(|u| 10f64.powf(32.0 * u - 30.0)).chain(numbers(9)).chain([1e30]));
    assert_relative("(1 - exp(-x)) / x", &x, &evaluate(5, &x), |x| -f64::exp_m1(-x) / x);
}

#[test]
fn logarithms() {
    // Over all magnitudes, and near 1, where a driver's own log has no digits.
    let magnitudes = numbers(2).map(|u| 10f64.powf(70.0 * u - 37.0));
    let x = arguments(magnitudes.chain(numbers(3).map(|u| 1.0 + (u - 0.5) * 1e-3)).chain([1.0]));
    assert_relative("log", &x, &evaluate(1, &x), f64::ln);
    let x = arguments(numbers(4).map(|u| 10f64.powf(28.0 * u - 20.0)).chain([0.0]));
    assert_relative("log1p", &x, &evaluate(2, &x), f64::ln_1p);
}

#[test]
fn circle() {
    let x = arguments(numbers(5).chain([0.0, 0.25, 0.5, 0.75, 1.0]));
    let error = |(x, y): (&Vec3, &Vec3)| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(x.x)).sin_cos();
        (f64::from(y.x) - cos).abs().max((f64::from(y.y) - sin).abs())
    };
    let worst = x.iter().zip(&evaluate(3, &x)).map(error).fold(0.0, f64::max);
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
    let worst = x.iter().zip(&evaluate(4, &x)).map(error).fold(0.0, f64::max);
    println!("atan2: {worst:.1e}");
    assert!(worst <= BOUND, "{worst:e}");
}
