//! Vectors and quadrature that the twins share.

use glam::DVec3;

/// Two unit vectors that make a right-handed orthonormal basis with the unit vector `n`.
///
/// T. Duff et al., "Building an orthonormal basis, revisited", JCGT 6 (2017), listing 3.
pub fn basis(n: DVec3) -> (DVec3, DVec3) {
    // Not the sign bit: of a zero, it depends on how a cross product was rounded.
    let sign = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), DVec3::new(b, sign + n.y * n.y * a, -n.y))
}

/// The vector of coordinates `local` in the basis of `n`.
pub fn from_local(n: DVec3, local: DVec3) -> DVec3 {
    let (t, b) = basis(n);
    t * local.x + b * local.y + n * local.z
}

/// Cosine-weighted unit vector about `n` from two numbers in [0, 1); its density is cos / pi.
pub fn cosine_direction(n: DVec3, u1: f64, u2: f64) -> DVec3 {
    let (sin, cos) = (std::f64::consts::TAU * u2).sin_cos();
    let r = u1.sqrt();
    from_local(n, DVec3::new(r * cos, r * sin, (1.0 - u1).sqrt()))
}

/// Luminance of a linear Rec.709 colour.
pub fn luminance(c: DVec3) -> f64 {
    c.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

/// Integral of a smooth `f` over [a, b], by 16-point Gauss-Legendre quadrature in each of `panels` equal panels.
pub fn integrate(a: f64, b: f64, panels: usize, f: impl Fn(f64) -> f64) -> f64 {
    // Positive nodes and their weights.
    const RULE: [(f64, f64); 8] = [
        (0.095_012_509_837_637_44, 0.189_450_610_455_068_5),
        (0.281_603_550_779_258_9, 0.182_603_415_044_923_59),
        (0.458_016_777_657_227_39, 0.169_156_519_395_002_54),
        (0.617_876_244_402_643_7, 0.149_595_988_816_576_73),
        (0.755_404_408_355_003, 0.124_628_971_255_533_87),
        (0.865_631_202_387_831_7, 0.095_158_511_682_492_78),
        (0.944_575_023_073_232_6, 0.062_253_523_938_647_89),
        (0.989_400_934_991_649_9, 0.027_152_459_411_754_095),
    ];
    let half = (b - a) / panels as f64 / 2.0;
    let panel = |i: usize| {
        let middle = a + (2 * i + 1) as f64 * half;
        half * RULE.iter().map(|(x, w)| w * (f(middle - half * x) + f(middle + half * x))).sum::<f64>()
    };
    (0..panels).map(panel).sum()
}

/// Where a function that falls from 1 at 0 has come down to `value`, to the last bit, by bisection: 0 for a value of 1 at
/// least, `high` if it does not come down so far before.
pub fn solve_falling(value: f64, high: f64, f: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, high);
    if value >= 1.0 {
        return low;
    }
    while high - low > 1e-16 * high {
        let middle = (low + high) / 2.0;
        if middle <= low || middle >= high {
            break;
        }
        *(if f(middle) > value { &mut low } else { &mut high }) = middle;
    }
    high
}
