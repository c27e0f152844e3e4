//! The grid of squared distances on which profiles are tabulated: four cells an octave of r^2, eight an octave of r.
//!
//! A cell is the exponent of an f32 and the two highest bits of its mantissa, so that host and device find it with a
//! shift and agree to the bit. Node i is the smallest number of cell i.

/// Bits of an f32 below those that number the cell.
pub const SHIFT: u32 = crate::shared::TABLE_SHIFT;

/// Cell of the squared distance s >= 0.
pub fn cell(s: f32) -> u32 {
    s.to_bits() >> SHIFT
}

/// Smallest squared distance of a cell.
pub fn node(cell: u32) -> f32 {
    f32::from_bits(cell << SHIFT)
}

/// The cell that begins with 2^exponent.
pub const fn octave(exponent: i32) -> u32 {
    ((exponent + 127) as u32) << 2
}
