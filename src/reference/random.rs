//! Random numbers: a counter-based hash, nested uniform scrambling, and Sobol points. Integers only, the same bits
//! everywhere.
//!
//! A point of the sequence is computed once per sample and is the same for all pixels; each pixel, batch and dimension
//! scrambles it with a key of its own. Nested uniform (Owen) scrambling keeps every elementary interval of a (0, m, 2)
//! net and makes each coordinate uniform, so that any estimator of it is unbiased.
//!
//! - Sobol integers: S. Joe, F. Y. Kuo, "Constructing Sobol sequences with better two-dimensional projections", SIAM J.
//!   Sci. Comput. 30 (2008), parameters new-joe-kuo-6.21201. With direction numbers v_k = m_k 2^(32 - k) and a primitive
//!   polynomial of degree s and inner coefficients a, v_k = v_(k-s) ^ v_(k-s) >> s ^ sum over the set a_i of v_(k-i);
//!   the integer of point i is the exclusive or of v_k over the bits k - 1 that are set in i.
//! - Scrambling: S. Laine, T. Karras, "Stratified sampling for stochastic transparency", CGF 30 (2011), section 3: an
//!   integer permutation in which a bit depends on lower bits alone, applied to the reversed bits. Constants by N.
//!   Vegdahl, "Building a better LK hash" (2021).
//! - Hash: `lowbias32` by C. Wellons with the constants of TheIronBorn (bias 0.108).

use crate::shared::{BATCHES, DIMENSIONS, Features, INTEGRATOR_CLOUD, STRATUM};

/// (degree s, inner coefficients a, initial m) of dimensions 1 to 6; dimension 0 is the van der Corput sequence.
const JOE_KUO: [(usize, u32, [u32; 4]); 6] = [
    (1, 0, [1, 0, 0, 0]),
    (2, 1, [1, 3, 0, 0]),
    (3, 1, [1, 3, 1, 0]),
    (3, 2, [1, 1, 1, 0]),
    (4, 1, [1, 1, 3, 3]),
    (4, 4, [1, 3, 5, 13]),
];

/// Dimensions of the sequence that exist here.
pub const SOBOL_DIMENSIONS: usize = JOE_KUO.len() + 1;

/// Direction numbers by dimension and bit of the index.
pub const DIRECTIONS: [[u32; 32]; SOBOL_DIMENSIONS] = directions();

const fn directions() -> [[u32; 32]; SOBOL_DIMENSIONS] {
    let mut table = [[0; 32]; SOBOL_DIMENSIONS];
    let mut bit = 0;
    while bit < 32 {
        table[0][bit] = 1 << (31 - bit);
        bit += 1;
    }
    let mut dimension = 1;
    while dimension < SOBOL_DIMENSIONS {
        let (degree, inner, initial) = JOE_KUO[dimension - 1];
        let mut k = 0;
        while k < 32 {
            table[dimension][k] = if k < degree {
                initial[k] << (31 - k)
            } else {
                let mut v = table[dimension][k - degree] ^ (table[dimension][k - degree] >> degree);
                let mut i = 1;
                while i < degree {
                    if (inner >> (degree - 1 - i)) & 1 == 1 {
                        v ^= table[dimension][k - i];
                    }
                    i += 1;
                }
                v
            };
            k += 1;
        }
        dimension += 1;
    }
    table
}

/// Coordinate `dimension` (0 to 6) of Sobol point `index`, as a fraction of 2^32.
pub fn sobol(index: u32, dimension: usize) -> u32 {
    let columns = DIRECTIONS[dimension].iter().enumerate();
    columns.filter(|(bit, _)| (index >> bit) & 1 == 1).fold(0, |sum, (_, v)| sum ^ v)
}

/// Integer hash: a bijection of the 32-bit integers.
pub fn hash(x: u32) -> u32 {
    let x = (x ^ (x >> 16)).wrapping_mul(0x21f0_aaad);
    let x = (x ^ (x >> 15)).wrapping_mul(0xd35a_2d97);
    x ^ (x >> 15)
}

/// Key of one dimension of one batch at a pixel (absolute coordinates in the full image).
pub fn key(seed: u32, px: u32, py: u32, batch: u32, dimension: u32) -> u32 {
    hash(hash(hash(hash(seed) ^ px).wrapping_add(py)) ^ (batch << 8 | dimension))
}

/// Nested uniform scrambling of `v` by `key`: a bijection that keeps the digital net.
pub fn scramble(v: u32, key: u32) -> u32 {
    let mut x = v.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(key);
    x = x.wrapping_mul((key >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// The number in [0, 1 - 2^-24] of a random integer; exact in f32.
pub fn unit(v: u32) -> f64 {
    f64::from(v >> 8) / f64::from(1 << 24)
}

/// The unscrambled estimator dimensions of a sample: [`Step::point`](crate::shared::Step).
pub fn point(sample_index: u32) -> [u32; DIMENSIONS as usize] {
    std::array::from_fn(|k| sobol(sample_index / BATCHES, k + 2))
}

/// Batch to which a sample belongs.
pub fn batch(sample_index: u32) -> u32 {
    sample_index % BATCHES
}

/// Number, within its batch, of the sub-pixel stratum of a sample. Gathering is the same in all of a stratum, so there
/// each sample has its own.
pub fn stratum(features: &Features, sample_index: u32) -> u32 {
    let samples = if features.integrator == INTEGRATOR_CLOUD { 1 } else { STRATUM };
    sample_index / BATCHES / samples
}
