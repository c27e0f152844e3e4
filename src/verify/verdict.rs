//! What a test found: the worst error and its input, its bound, and how many values are wrong in which way.

use glam::{DVec3, Vec3};
use std::fmt;

/// Half a unit in the last place of an f32, relative: what one rounding costs at most.
pub const ROUNDING: f64 = 1.0 / (1 << 24) as f64;

/// Roundings along the longest chain of operations of what is tested. Each costs [`ROUNDING`], but for the operations that
/// Vulkan (1.4, "Precision and operation of SPIR-V instructions") allows more: a division 2.5 ULP, a square root the 2 ULP
/// of inversesqrt and a division.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Roundings {
    /// Additions, multiplications, conversions, and the roundings that arguments bring along.
    pub plain: u32,
    pub divisions: u32,
    pub roots: u32,
}

/// As many additions and multiplications, divisions and square roots.
pub const fn roundings(plain: u32, divisions: u32, roots: u32) -> Roundings {
    Roundings { plain, divisions, roots }
}

impl Roundings {
    /// The relative error that they may add up to.
    pub fn relative(self) -> f64 {
        f64::from(self.plain + 5 * self.divisions + 9 * self.roots) * ROUNDING
    }
}

/// How near the device must come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// The same bits.
    Exact,
    /// So many roundings, relative to the magnitude that the test names; without another, the value's own.
    Relative(Roundings),
}

impl Bound {
    /// Error allowed beside a magnitude of 1.
    pub fn relative(self) -> f64 {
        match self {
            Bound::Exact => 0.0,
            Bound::Relative(roundings) => roundings.relative(),
        }
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Bound::Relative(Roundings { plain, divisions, roots }) = self else { return write!(f, "bit for bit") };
        write!(f, "{:.2e} = {plain} roundings", self.relative())?;
        for (count, one, many) in [(*divisions, "division", "divisions"), (*roots, "root", "roots")] {
            match count {
                0 => {}
                1 => write!(f, " + 1 {one}")?,
                _ => write!(f, " + {count} {many}")?,
            }
        }
        Ok(())
    }
}

/// The value with the largest error.
#[derive(Clone, Debug, PartialEq)]
pub struct Worst {
    pub input: String,
    pub found: f32,
    pub expected: f64,
    /// Distance in units of the last place of the expected value.
    pub ulp: f64,
    /// Distance over the magnitude to which the bound refers.
    pub relative: f64,
}

/// Values that are wrong, by class.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Census {
    /// Not a number, or a number where none is expected.
    pub nan: usize,
    /// Infinite, or finite where infinity is expected.
    pub infinity: usize,
    /// The expected or the found value is below the normal numbers.
    pub denormal: usize,
    /// Both are normal numbers, farther apart than the bound.
    pub finite: usize,
    /// Number of the first wrong value.
    pub first: Option<usize>,
}

impl Census {
    /// Counts a wrong value, the one with this number.
    pub fn add(&mut self, index: usize, found: f32, expected: f32) {
        self.first.get_or_insert(index);
        let class = match () {
            () if found.is_nan() || expected.is_nan() => &mut self.nan,
            () if found.is_infinite() || expected.is_infinite() => &mut self.infinity,
            () if found.is_subnormal() || expected.is_subnormal() => &mut self.denormal,
            () => &mut self.finite,
        };
        *class += 1;
    }

    /// Wrong values in all.
    pub fn total(&self) -> usize {
        self.nan + self.infinity + self.denormal + self.finite
    }
}

impl fmt::Display for Census {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Census { nan, infinity, denormal, finite, first } = self;
        write!(f, "{}", self.total())?;
        match first {
            Some(first) => {
                write!(f, " (NaN {nan}, infinity {infinity}, denormal {denormal}, finite {finite}; first {first})")
            }
            None => Ok(()),
        }
    }
}

/// What a test found.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    pub bound: Bound,
    /// Share of the values that may be wrong: discrete choices which rounding turns, where the test says why.
    pub exempt: f64,
    /// Values compared.
    pub values: usize,
    pub worst: Option<Worst>,
    pub census: Census,
    /// What else does not hold.
    pub problems: Vec<String>,
    /// What a reader should know, such as that a bound had to be wider.
    pub notes: Vec<String>,
}

impl Verdict {
    /// Nothing compared yet; every value must be within `bound`.
    pub fn new(bound: Bound) -> Verdict {
        Verdict {
            bound,
            exempt: 0.0,
            values: 0,
            worst: None,
            census: Census::default(),
            problems: vec![],
            notes: vec![],
        }
    }

    /// Compares a value whose error the bound limits relative to `scale`.
    pub fn compare(&mut self, found: f32, expected: f64, scale: f64, input: impl FnOnce() -> String) {
        let distance = (f64::from(found) - expected).abs();
        let rounded = expected as f32;
        let relative = match found == rounded || found.is_nan() && rounded.is_nan() {
            _ if scale > 0.0 && distance.is_finite() => distance / scale,
            true => 0.0,
            false => f64::INFINITY,
        };
        self.record(relative > self.bound.relative(), relative, found, expected, input);
    }

    /// Compares a value whose error the bound limits relative to itself.
    pub fn relative(&mut self, found: f32, expected: f64, input: impl FnOnce() -> String) {
        self.compare(found, expected, expected.abs(), input);
    }

    /// Compares each component; the bound refers to `scale`.
    pub fn vector(&mut self, found: Vec3, expected: DVec3, scale: f64, input: impl Fn() -> String) {
        for c in 0..3 {
            self.compare(found[c], expected[c], scale, || format!("{}, component {c}", input()));
        }
    }

    /// Compares bits where the bound asks for them, else as [`Verdict::compare`].
    pub fn bits(&mut self, found: f32, expected: f32, scale: f64, input: impl FnOnce() -> String) {
        if self.bound != Bound::Exact {
            return self.compare(found, expected.into(), scale, input);
        }
        let wrong = found.to_bits() != expected.to_bits() && !(found.is_nan() && expected.is_nan());
        let distance = (f64::from(found) - f64::from(expected)).abs() / scale.max(f64::MIN_POSITIVE);
        self.record(wrong, if wrong && distance > 0.0 { distance } else { 0.0 }, found, expected.into(), input);
    }

    /// Compares integers.
    pub fn words(&mut self, found: u32, expected: u32, input: impl FnOnce() -> String) {
        let input = || format!("{}: {found:#x}, not {expected:#x}", input());
        let relative = if found == expected { 0.0 } else { f64::INFINITY };
        self.record(found != expected, relative, found as f32, expected.into(), input);
    }

    fn record(&mut self, wrong: bool, relative: f64, found: f32, expected: f64, input: impl FnOnce() -> String) {
        let index = self.values;
        self.values += 1;
        if self.worst.as_ref().is_none_or(|worst| relative > worst.relative) || wrong && self.census.total() == 0 {
            let ulp = if relative == 0.0 { 0.0 } else { (f64::from(found) - expected).abs() / ulp(expected) };
            self.worst = Some(Worst { input: input(), found, expected, ulp, relative });
        }
        if wrong {
            self.census.add(index, found, expected as f32);
        }
    }

    /// Something else that must hold.
    pub fn require(&mut self, holds: bool, problem: impl FnOnce() -> String) {
        if !holds {
            self.problems.push(problem());
        }
    }

    /// Whether all is within the bound, but for the share that is exempt, and all else holds.
    pub fn passed(&self) -> bool {
        self.problems.is_empty() && self.values > 0 && self.census.total() as f64 <= self.exempt * self.values as f64
    }
}

impl fmt::Display for Verdict {
    /// One line.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Verdict { values, bound, census, .. } = self;
        write!(f, "{values} values, bound {bound}")?;
        if let Some(worst) = &self.worst {
            let Worst { input, found, expected, ulp, relative } = worst;
            write!(f, "; worst {ulp:.2} ULP, relative {relative:.2e}, at {input}: {found:e} for {expected:e}")?;
        }
        write!(f, "; wrong {census}")?;
        if self.exempt > 0.0 {
            write!(f, ", {:.2e} of all may be", self.exempt)?;
        }
        self.problems.iter().take(3).try_for_each(|problem| write!(f, "; {problem}"))?;
        self.notes.iter().try_for_each(|note| write!(f, "; {note}"))
    }
}

/// Distance between the f32 around a value.
pub fn ulp(x: f64) -> f64 {
    let exponent = x.abs().log2().floor().clamp(-126.0, 127.0);
    (exponent - 23.0).exp2()
}
