//! Arithmetic, random numbers and elementary functions. Here is also what tests of other functions have in common.

use super::{Bound, Context, Roundings, Verdict, World, roundings};
use crate::{
    error::Result,
    reference::{
        math,
        random::{self, unit},
    },
    shared::*,
};
use glam::{DVec3, Vec3, dvec3};
use std::f64::consts::TAU;

/// Inputs of a function.
pub const INPUTS: u32 = 1 << 14;

/// A number in [0, 1), the k-th that belongs to i.
pub fn number(i: u32, k: u32) -> f64 {
    unit(random::hash(random::hash(i) ^ k.wrapping_mul(0x9e37_79b9)))
}

/// A unit vector, uniform on the sphere.
pub fn direction(i: u32, k: u32) -> DVec3 {
    let (z, angle) = (2.0 * number(i, k) - 1.0, TAU * number(i, k + 1));
    let r = (1.0 - z * z).sqrt();
    dvec3(r * angle.cos(), r * angle.sin(), z)
}

/// A number between two magnitudes, uniform in the logarithm.
pub fn magnitude(i: u32, k: u32, low: f64, high: f64) -> f64 {
    low * (high / low).powf(number(i, k))
}

/// How much of its bound a function may be off where its arguments are rounded by as much: its value, and for each
/// argument by how much the value changes then. So a function may return what is right for arguments that are.
pub fn conditioned(bound: Roundings, x: &[f64], f: impl Fn(&[f64]) -> f64) -> f64 {
    let (step, value) = (bound.relative(), f(x));
    let mut moved = x.to_vec();
    let mut scale = value.abs();
    for k in 0..x.len() {
        let change = [1.0 - step, 1.0 + step].map(|factor| {
            moved[k] = x[k] * factor;
            (f(&moved) - value).abs()
        });
        moved[k] = x[k];
        scale += change[0].max(change[1]) / step;
    }
    scale
}

/// As [`conditioned`], for the component of a vector that is off most.
pub fn conditioned_vector(bound: Roundings, x: &[f64], f: impl Fn(&[f64]) -> DVec3) -> f64 {
    (0..3).map(|c| conditioned(bound, x, |x| f(x)[c])).fold(0.0, f64::max)
}

impl Context<'_> {
    /// The function's values where nothing of a scene is needed.
    fn values(&mut self, function: u32, x: &[Vec3]) -> Result<Vec<Vec3>> {
        self.bench.evaluate(function, &World::default().inputs(), &[], x, &[])
    }

    /// Values of a function of one number, in the first component.
    fn scalar(&mut self, function: u32, x: impl Iterator<Item = f64>) -> Result<(Vec<f32>, Vec<Vec3>)> {
        let x: Vec<f32> = x.map(|x| x as f32).collect();
        let arguments: Vec<Vec3> = x.iter().map(|&x| Vec3::new(x, 0.0, 0.0)).collect();
        let y = self.values(function, &arguments)?;
        Ok((x, y))
    }

    fn relative(
        &mut self,
        function: u32,
        bound: Roundings,
        x: impl Iterator<Item = f64>,
        truth: impl Fn(f64) -> f64,
    ) -> Result<Verdict> {
        let (x, y) = self.scalar(function, x)?;
        let mut verdict = Verdict::new(Bound::Relative(bound));
        for (x, y) in x.iter().zip(&y) {
            let expected = truth(f64::from(*x));
            let scale = if expected == 0.0 { 1.0 } else { expected.abs() };
            verdict.compare(y.x, expected, scale, || format!("{x:e}"));
        }
        Ok(verdict)
    }

    /// Operands of basic arithmetic: of all magnitudes, with sums that cancel.
    fn operands(&self) -> Vec<Vec3> {
        let signed = |i: u32, k: u32| (2.0 * number(i, k) - 1.0) * magnitude(i, k + 20, 1e-6, 1e6);
        let operand = |i: u32| {
            let (x, y) = (signed(i, 1) as f32, signed(i, 2) as f32);
            let z = if i.is_multiple_of(2) { signed(i, 3) as f32 } else { -x * y * (1.0 + 1e-3 * number(i, 4) as f32) };
            Vec3::new(x, y, z)
        };
        (0..self.share(INPUTS)).map(operand).collect()
    }
}

/// Whether + - * / and square roots are rounded as IEEE 754 has it, none fused.
pub fn is_exact(context: &mut Context) -> Result<bool> {
    let x = context.operands();
    let y = context.values(FUNCTION_ARITHMETIC, &x)?;
    let exact = |(x, y): (&Vec3, &Vec3)| *y == Vec3::new(x.x * x.y + x.z, x.x / x.y, x.x.abs().sqrt());
    let basic = x.iter().zip(&y).all(exact);
    Ok(basic && dot(context)?.worst.is_none_or(|worst| worst.relative == 0.0))
}

/// x y + z must be rounded twice, or once where the driver fuses.
pub fn add_multiply(context: &mut Context) -> Result<Verdict> {
    let x = context.operands();
    let y = context.values(FUNCTION_ARITHMETIC, &x)?;
    let mut verdict = Verdict::new(Bound::Exact);
    let mut fused = 0;
    for (x, y) in x.iter().zip(&y) {
        let (twice, once) = (x.x * x.y + x.z, x.x.mul_add(x.y, x.z));
        let is_fused = y.x != twice && y.x == once;
        fused += usize::from(is_fused);
        verdict.bits(y.x, if is_fused { once } else { twice }, f64::from(twice.abs()), || format!("{x}"));
    }
    verdict.notes.push(format!("{fused} fused"));
    Ok(verdict)
}

fn arithmetic(
    context: &mut Context,
    bound: Roundings,
    component: usize,
    exact: impl Fn(Vec3) -> f64,
) -> Result<Verdict> {
    let x = context.operands();
    let y = context.values(FUNCTION_ARITHMETIC, &x)?;
    let mut verdict = Verdict::new(Bound::Relative(bound));
    let mut rounded = 0;
    for (x, y) in x.iter().zip(&y) {
        let expected = exact(*x);
        rounded += usize::from(y[component] == expected as f32);
        verdict.relative(y[component], expected, || format!("{x}"));
    }
    verdict.notes.push(format!("{rounded} correctly rounded"));
    Ok(verdict)
}

/// Quotients.
pub fn divide(context: &mut Context) -> Result<Verdict> {
    arithmetic(context, roundings(0, 1, 0), 1, |x| f64::from(x.x) / f64::from(x.y))
}

/// Square roots.
pub fn root(context: &mut Context) -> Result<Verdict> {
    arithmetic(context, roundings(0, 0, 1), 2, |x| f64::from(x.x).abs().sqrt())
}

/// Scalar product, length and cross product: sums of products, in any order.
pub fn dot(context: &mut Context) -> Result<Verdict> {
    let count = context.share(INPUTS);
    let vector = |i: u32, k: u32| (direction(i, k) * magnitude(i, k + 7, 1e-3, 1e3)).as_vec3();
    let x: Vec<Vec3> = (0..count).map(|i| vector(i, 1)).collect();
    let shadings: Vec<Shading> = (0..count).map(|i| Shading { normal0: vector(i, 3), ..Shading::default() }).collect();
    let world = World { shadings, ..World::default() };
    let y = context.bench.evaluate(FUNCTION_DOT, &world.inputs(), &[], &x, &[])?;
    let mut verdict = Verdict::new(Bound::Relative(roundings(5, 0, 1)));
    for ((x, shading), y) in x.iter().zip(&world.shadings).zip(&y) {
        let a = shading.normal0;
        // In the order of the components; where that is the device's, without an error.
        let strict = Vec3::new(x.dot(a), x.length(), x.cross(a).y);
        let scale = f64::from(x.length() * a.length()).max(f64::from(x.length()));
        for c in 0..3 {
            verdict.compare(y[c], strict[c].into(), scale, || format!("{x} and {a}, component {c}"));
        }
    }
    Ok(verdict)
}

/// Integers in halves, as the kernel takes and returns them.
fn halves(word: u32) -> Vec3 {
    Vec3::new((word & 0xffff) as f32, (word >> 16) as f32, 0.0)
}

fn word(halves: Vec3) -> u32 {
    halves.x as u32 | (halves.y as u32) << 16
}

/// Words with few bits set, with many, and random ones; the second is a key.
fn words(context: &Context) -> Vec<(u32, u32)> {
    let random = (0..context.share(INPUTS)).map(|i| (random::hash(i), random::hash(!i)));
    let bits = (0..32).flat_map(|b| [(1 << b, 77), (!(1 << b), 1 << b), (1 << b, 0), (0, 1 << b), (u32::MAX, 1 << b)]);
    bits.chain([(0, 0), (u32::MAX, u32::MAX)]).chain(random).collect()
}

/// Values for words whose key, and a third number, are the invocation's.
fn of_words(context: &mut Context, function: u32, words: &[(u32, u32)], third: fn(u32) -> u32) -> Result<Vec<Vec3>> {
    let x: Vec<Vec3> = words.iter().map(|(w, key)| halves(*w).with_z(third(*key) as f32)).collect();
    let shadings = words.iter().map(|&(_, material)| Shading { material, ..Shading::default() }).collect();
    let world = World { shadings, ..World::default() };
    context.bench.evaluate(function, &world.inputs(), &[], &x, &[])
}

fn integers(context: &mut Context, function: u32, twin: fn(u32, u32) -> u32) -> Result<Verdict> {
    let words = words(context);
    let found = of_words(context, function, &words, |_| 0)?;
    let mut verdict = Verdict::new(Bound::Exact);
    for ((w, key), found) in words.iter().zip(found) {
        verdict.words(word(found), twin(*w, *key), || format!("{w:#x}, {key:#x}"));
    }
    Ok(verdict)
}

/// The integer hash.
pub fn hash(context: &mut Context) -> Result<Verdict> {
    integers(context, FUNCTION_HASH, |w, _| random::hash(w))
}

/// Nested uniform scrambling.
pub fn scramble(context: &mut Context) -> Result<Verdict> {
    integers(context, FUNCTION_SCRAMBLE, random::scramble)
}

/// The second dimension of Sobol's sequence.
pub fn sobol(context: &mut Context) -> Result<Verdict> {
    integers(context, FUNCTION_SOBOL, |w, _| random::sobol(w, 1))
}

fn batch_of(key: u32) -> u32 {
    key % BATCHES
}

/// Keys of pixels, batches and dimensions.
pub fn key(context: &mut Context) -> Result<Verdict> {
    let words = words(context);
    let found = of_words(context, FUNCTION_KEY, &words, batch_of)?;
    let mut verdict = Verdict::new(Bound::Exact);
    for (&(w, seed), found) in words.iter().zip(found) {
        let expected = random::key(seed, w & 0xffff, w >> 16, batch_of(seed), DIM_LIGHT);
        verdict.words(word(found), expected, || format!("pixel {w:#x}, seed {seed:#x}"));
    }
    Ok(verdict)
}

/// Points in two dimensions, of which a number in [0, 1) is exact in f32.
pub fn point(context: &mut Context) -> Result<Verdict> {
    let words = words(context);
    let found = of_words(context, FUNCTION_POINT, &words, batch_of)?;
    let mut verdict = Verdict::new(Bound::Exact);
    for (&(index, pixel_key), found) in words.iter().zip(found) {
        for d in 0..2 {
            let key = random::hash(pixel_key ^ (batch_of(pixel_key) << 8 | (DIM_EMITTER + d)));
            let expected = unit(random::scramble(random::sobol(index, d as usize), key));
            let found = found[d as usize];
            verdict.bits(found, expected as f32, 1.0, || format!("point {index}, key {pixel_key:#x}, {d}"));
        }
    }
    Ok(verdict)
}

/// Of each function of `math.glsl`: the polynomial's own error is one rounding, what enters it and its last steps six.
const ELEMENTARY: Roundings = roundings(8, 0, 0);

/// The exponential over the range of f32, around 0, and beyond, where nothing or infinity is right.
pub fn exp(context: &mut Context) -> Result<Verdict> {
    let n = context.share(INPUTS);
    let x = (0..n).map(|i| if i % 2 == 0 { 174.0 * number(i, 1) - 86.5 } else { number(i, 2) - 0.5 });
    let mut verdict = context.relative(FUNCTION_EXP, ELEMENTARY, x, f64::exp)?;
    let (far, y) = context.scalar(FUNCTION_EXP, [-1e30, -88.0, -87.1, 89.0, 1e30].into_iter())?;
    for ((x, y), expected) in far.iter().zip(&y).zip([0.0, 0.0, 0.0, f64::INFINITY, f64::INFINITY]) {
        verdict.compare(y.x, expected, 0.0, || format!("{x:e}"));
    }
    Ok(verdict)
}

/// The logarithm over all magnitudes, and near 1, where drivers' own have no digits.
pub fn log(context: &mut Context) -> Result<Verdict> {
    let n = context.share(INPUTS);
    let x = (0..n).map(|i| match i % 2 {
        0 => magnitude(i, 1, 1e-37, 1e33),
        _ => 1.0 + (number(i, 2) - 0.5) * 1e-3,
    });
    context.relative(FUNCTION_LOG, ELEMENTARY, x.chain([1.0]), f64::ln)
}

/// log(1 + x); its correction is divided, but far below the result.
pub fn log1p(context: &mut Context) -> Result<Verdict> {
    let n = context.share(INPUTS);
    let x = (0..n).map(|i| magnitude(i, 1, 1e-20, 1e8)).chain([0.0]);
    context.relative(FUNCTION_LOG1P, ELEMENTARY, x, f64::ln_1p)
}

/// (1 - e^-x) / x: beyond .34 the difference of 1 and a power of at most .71, which is divided.
pub fn one_minus_exp_over(context: &mut Context) -> Result<Verdict> {
    let n = context.share(INPUTS);
    let x = (0..n).map(|i| if i % 2 == 0 { magnitude(i, 1, 1e-30, 1e2) } else { number(i, 2) }).chain([1e30]);
    context.relative(FUNCTION_ONE_MINUS_EXP_OVER, roundings(8, 1, 0), x, |x| -f64::exp_m1(-x) / x)
}

/// Cosine and sine of turns, relative to 1.
pub fn cos_sin(context: &mut Context) -> Result<Verdict> {
    let n = context.share(INPUTS);
    let x = (0..n).map(|i| number(i, 1)).chain([0.0, 0.25, 0.5, 0.75, 1.0]);
    let (x, y) = context.scalar(FUNCTION_COS_SIN, x)?;
    let mut verdict = Verdict::new(Bound::Relative(ELEMENTARY));
    for (x, y) in x.iter().zip(&y) {
        let (sin, cos) = (TAU * f64::from(*x)).sin_cos();
        verdict.compare(y.x, cos, 1.0, || format!("cosine of {x} turns"));
        verdict.compare(y.y, sin, 1.0, || format!("sine of {x} turns"));
    }
    Ok(verdict)
}

/// The angle of a vector; it is a quotient's, or the quotient of a difference and a sum of it.
pub fn atan2(context: &mut Context) -> Result<Verdict> {
    let signed = |i: u32, k: u32| (2.0 * number(i, k) - 1.0) * magnitude(i, k + 9, 1e-6, 1e2);
    let n = context.share(INPUTS);
    let mut x: Vec<Vec3> = (0..n).map(|i| Vec3::new(signed(i, 1) as f32, signed(i, 2) as f32, 0.0)).collect();
    x.extend([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (0.0, 0.0)].map(|(a, b)| Vec3::new(a, b, 0.0)));
    let y = context.values(FUNCTION_ATAN2, &x)?;
    let mut verdict = Verdict::new(Bound::Relative(roundings(8, 2, 0)));
    for (x, y) in x.iter().zip(&y) {
        let expected = f64::from(x.y).atan2(f64::from(x.x));
        let scale = if expected == 0.0 { 1.0 } else { expected.abs() };
        verdict.compare(y.x, expected, scale, || format!("({}, {})", x.x, x.y));
    }
    Ok(verdict)
}

/// Coordinates in the frame of a unit vector, relative to the longest: the divisor is at least 1.
pub fn basis(context: &mut Context) -> Result<Verdict> {
    let count = context.share(INPUTS);
    let vector = |i: u32| direction(i, 5).as_vec3();
    let mut normals: Vec<Vec3> = (0..count).map(vector).collect();
    normals.extend([Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z]);
    let x: Vec<Vec3> = (0..normals.len() as u32).map(|i| direction(i, 1).as_vec3()).collect();
    let shadings = normals.iter().map(|&normal0| Shading { normal0, ..Shading::default() }).collect();
    let world = World { shadings, ..World::default() };
    let y = context.bench.evaluate(FUNCTION_BASIS, &world.inputs(), &[], &x, &[])?;
    let mut verdict = Verdict::new(Bound::Relative(roundings(12, 1, 0)));
    for ((x, n), y) in x.iter().zip(&normals).zip(&y) {
        verdict.vector(*y, math::from_local(n.as_dvec3(), x.as_dvec3()), 1.0, || format!("{x} about {n}"));
    }
    Ok(verdict)
}
