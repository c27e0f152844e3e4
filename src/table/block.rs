//! The profiles of a material as kernels read them: values and distribution functions on the cells of [`grid`].
//!
//! # Interpolation
//! Between the nodes of the grid a profile is linear in r^2. So its integral over an annulus is exact, its inverse a
//! square root, and the light drawn from the distribution function has the profile as its density. Below the first node
//! it is constant with the right integral (it grows like 1/r there); beyond the last it is zero. The values at the nodes
//! are those for which each pair of cells holds the light of the simulation's profile.
//!
//! # Layout
//! All are vectors, mostly of the three channels: a device without a gather instruction takes as long for one as for a number.
//! Node by node of the curvature: (1/a, the number of cells that the sphere reaches, vectors of a cell), 1 / mass, slope of the
//! total in 1 - mu'; then the value below the first node, as a cell, the cells of the grid, and the light within its nodes.
//! A profile is divided by the total of the half-space, which is in the material's strength. After the last curvature comes
//! what tiles weigh hits by: for each cell the half-space's values at its two nodes, not divided, summed over channels.
//!
//! # Cells
//! A cell holds a channel's values at both of its nodes: [`Precision::Full`] in two vectors, [`Precision::Packed`] in the bits of
//! one f32 ([`pack`]), two numbers of [`TABLE_BITS`] bits and the exponent that they share, so that one load serves for what is
//! between. Each is off by at most 1/4095 of the larger, 1.2e-4 rms or less, which the simulation's own .2 to .6 % covers. The
//! light within is that of the stored values, and the strength of the material that for which the half-space still has its total.

use super::grid;
use super::white::{Profile, White};
use crate::settings::Precision;
use crate::shared::TABLE_BITS;
use glam::{DVec2, DVec3, Vec3};
use std::f64::consts::PI;
use std::sync::Arc;

/// Vectors before the values of a curvature.
pub const HEADER: usize = crate::shared::TABLE_HEADER as usize;
/// Light that may lie beyond the table.
const BEYOND: f64 = 1e-6;
/// Most cells of a table, whatever the range of its channels' mean free paths.
pub const MOST_CELLS: u32 = 500;

/// One channel of matter with its table.
#[derive(Clone, Debug)]
pub struct Channel {
    pub table: Arc<White>,
    /// alpha', above 0.
    pub albedo: f64,
    /// sigma_s' [1/length].
    pub scattering: f64,
}

impl Channel {
    /// R(r) on a sphere of the radius; lengths within in units of 1 / sigma_s'.
    pub fn profile(&self, radius: f64) -> Profile {
        self.table.profile(self.albedo, radius * self.scattering)
    }
}

/// The tables of a material's channels. A channel that does not scatter has none.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// First cell of the squared distance.
    pub first: u32,
    pub cells: u32,
    pub precision: Precision,
    /// Totals of the half-space over the integrals of its profiles as they are stored.
    pub totals: DVec3,
    pub nodes: u32,
    /// The vectors, in the order of the layout.
    pub data: Vec<Vec3>,
}

/// One channel on one sphere.
struct Column {
    total: f64,
    slope: f64,
    values: Vec<f64>,
    within: Vec<f64>,
}

/// A column as it is stored, over the half-space's total.
struct Stored {
    slope: f64,
    /// What is below the first node, and the cells.
    cells: Vec<Cell>,
    within: Vec<f64>,
    mass: f64,
}

impl Block {
    /// The tables of three channels on spheres of the radii 2^(i/2 - 1) (length), i ascending, and on the half-space.
    pub fn new(channels: &[Option<Channel>; 3], spheres: &[i32], precision: Precision) -> Block {
        let present = || channels.iter().flatten();
        let finest = present().map(|c| 1.0 / (c.scattering / c.albedo)).fold(f64::INFINITY, f64::min);
        let farthest = present().map(|c| c.table.tail(c.albedo, BEYOND) / c.scattering).fold(0.0, f64::max);
        let smallest = spheres.first().map_or(f64::INFINITY, |&i| sphere(i));
        let low = if finest.is_finite() { finest.min(smallest) / 4096.0 } else { 1.0 };
        let first = grid::cell((low * low) as f32);
        let end = grid::cell((farthest * farthest) as f32) + 1;
        let cells = end.saturating_sub(first).clamp(1, MOST_CELLS);
        let nodes = spheres.len() as u32 + 1;
        let mut block = Block { first, cells, precision, totals: DVec3::ZERO, nodes, data: vec![] };
        let plane = channels.each_ref().map(|c| c.as_ref().map(|c| block.column(c, f64::INFINITY, cells)));
        let totals = plane.each_ref().map(|column| column.as_ref().map_or(0.0, |column| column.total));
        for &exponent in spheres {
            let radius = sphere(exponent);
            let reached = (grid::cell((4.0 * radius * radius) as f32).saturating_sub(first)).clamp(1, cells);
            let columns = channels.each_ref().map(|c| c.as_ref().map(|c| block.column(c, radius, reached)));
            block.push(1.0 / radius, reached, &columns, totals);
        }
        block.totals = DVec3::from(totals) / block.push(0.0, cells, &plane, totals);
        let sum = |i: usize| plane.iter().flatten().map(|column| column.values[i]).sum::<f64>() as f32;
        block.data.extend((0..cells as usize).map(|i| Vec3::new(sum(i), sum(i + 1), 0.0)));
        block
    }

    /// Vectors of one curvature, with so many in a cell.
    pub fn stride(cells: u32, cell_vectors: u32) -> usize {
        HEADER + (cell_vectors as usize + 1) * (cells as usize + 1)
    }

    /// Vectors of a block.
    pub fn size(nodes: u32, cells: u32, cell_vectors: u32) -> usize {
        nodes as usize * Block::stride(cells, cell_vectors) + cells as usize
    }

    /// Adds a curvature; gives the integrals of the profiles that were stored, 1 for none.
    fn push(&mut self, curvature: f64, reached: u32, columns: &[Option<Column>; 3], totals: [f64; 3]) -> DVec3 {
        let inner = PI * f64::from(grid::node(self.first));
        let area = |i: usize| PI * f64::from(grid::node(self.first + i as u32 + 1) - grid::node(self.first + i as u32));
        let stored = [0, 1, 2].map(|c| {
            let column = columns[c].as_ref()?;
            let value = |i: usize| column.values[i] / totals[c];
            let below = DVec2::splat(column.within[0] / totals[c] / inner);
            let ends = (0..self.cells as usize).map(|i| match i < reached as usize {
                true => DVec2::new(value(i), value(i + 1)),
                false => DVec2::ZERO,
            });
            let cells: Vec<Cell> =
                std::iter::once(below).chain(ends).map(|ends| Cell::of(ends, self.precision)).collect();
            let mut within = vec![inner * cells[0].ends().x];
            for (i, cell) in cells[1..].iter().enumerate() {
                within.push(within[i] + area(i) * cell.ends().element_sum() / 2.0);
            }
            Some(Stored { slope: column.slope, cells, mass: within[within.len() - 1], within })
        });
        let vector = |none: f32, of: &dyn Fn(&Stored) -> f32| {
            Vec3::from(stored.each_ref().map(|stored| stored.as_ref().map_or(none, of)))
        };
        let (dark, vectors) = (Cell::of(DVec2::ZERO, self.precision), self.precision.cell_vectors());
        self.data.extend([
            Vec3::new(curvature as f32, reached as f32, vectors as f32),
            vector(0.0, &|stored| (1.0 / stored.mass) as f32),
            vector(0.0, &|stored| stored.slope as f32),
        ]);
        let numbers = (0..=self.cells as usize).flat_map(|i| (0..vectors as usize).map(move |k| (i, k)));
        self.data.extend(numbers.map(|(i, k)| vector(dark.numbers()[k], &|stored| stored.cells[i].numbers()[k])));
        self.data.extend((0..=self.cells as usize).map(|i| vector(0.0, &|stored| stored.within[i] as f32)));
        DVec3::from(stored.map(|stored| stored.map_or(1.0, |stored| stored.mass)))
    }

    /// One channel on a sphere that reaches a number of cells.
    fn column(&self, channel: &Channel, radius: f64, reached: u32) -> Column {
        let profile = channel.profile(radius);
        let k = channel.scattering;
        let value = |s: f64| k * k * profile.value((s.sqrt() * k).min(2.0 * radius * k));
        let node = |i: usize| f64::from(grid::node(self.first + i as u32));
        let reached = reached as usize;
        let mut values: Vec<f64> = (0..=reached).map(|i| value(node(i))).collect();
        let areas: Vec<f64> = (0..reached).map(|i| PI * (node(i + 1) - node(i))).collect();
        // Light of each cell by Simpson's rule in r, and of what lies below: R falls like 1/r there.
        let light: Vec<f64> = (0..reached)
            .map(|i| {
                let (a, b) = (node(i).sqrt(), node(i + 1).sqrt());
                let middle = (a + b) / 2.0;
                PI / 3.0 * (b - a) * (a * values[i] + 4.0 * middle * value(middle * middle) + b * values[i + 1])
            })
            .collect();
        let inner = 2.0 * PI * node(0) * values[0];
        for _ in 0..3 {
            let ratio: Vec<f64> = (0..reached)
                .map(|i| {
                    let linear = areas[i] * (values[i] + values[i + 1]) / 2.0;
                    if linear > 0.0 { light[i] / linear } else { 1.0 }
                })
                .collect();
            for (i, value) in values.iter_mut().enumerate() {
                *value *= (ratio[i.saturating_sub(1)] + ratio[i.min(reached - 1)]) / 2.0;
            }
        }
        values[reached] += 2.0 * profile.pencil() / areas[reached - 1];
        let mut within = vec![inner];
        for i in 0..reached {
            within.push(within[i] + areas[i] * (values[i] + values[i + 1]) / 2.0);
        }
        let total = profile.total().mean;
        let scale = total / within[reached];
        values.iter_mut().chain(&mut within).for_each(|x| *x *= scale);
        values.resize(self.cells as usize + 1, 0.0);
        within.resize(self.cells as usize + 1, total);
        Column { total, slope: profile.slope(), values, within }
    }
}

/// A channel's values at the nodes of a cell, as they are stored.
#[derive(Clone, Copy)]
pub enum Cell {
    Packed(f32),
    Full([f32; 2]),
}

impl Cell {
    /// Of the values at the two nodes.
    fn of(ends: DVec2, precision: Precision) -> Cell {
        match precision {
            Precision::Packed => Cell::Packed(pack(ends)),
            Precision::Full => Cell::Full(ends.as_vec2().to_array()),
        }
    }

    /// The cell of channel c whose vectors these are.
    pub fn read(vectors: &[Vec3], c: usize) -> Cell {
        match *vectors {
            [packed] => Cell::Packed(packed[c]),
            [low, high, ..] => Cell::Full([low[c], high[c]]),
            [] => unreachable!("a cell has vectors"),
        }
    }

    /// The channel's numbers in the cell's vectors.
    fn numbers(&self) -> &[f32] {
        match self {
            Cell::Packed(number) => std::slice::from_ref(number),
            Cell::Full(numbers) => numbers,
        }
    }

    /// The values at the two nodes.
    pub fn ends(self) -> DVec2 {
        match self {
            Cell::Packed(number) => unpack(number),
            Cell::Full([low, high]) => DVec2::new(low.into(), high.into()),
        }
    }
}

/// Largest of the two integers of a packed cell.
const MOST: u32 = (1 << TABLE_BITS) - 1;
/// Two values at least 0 in the bits of one f32 that is neither denormal, infinite nor NaN: 2^(e - 127) times two integers of
/// [`TABLE_BITS`] bits, e in the place of the exponent, the second integer in the low bits, the first above it, but for its
/// lowest bit, which is the sign.
pub fn pack(values: DVec2) -> f32 {
    let exponent = (values.max_element() / f64::from(MOST)).log2().ceil().max(-126.0);
    let [low, high] = (values / exponent.exp2()).to_array().map(|x| (x.round() as u32).min(MOST));
    f32::from_bits(low << 31 | ((exponent as i32 + 127) as u32) << 23 | low >> 1 << TABLE_BITS | high)
}

/// The two values of a cell.
pub fn unpack(cell: f32) -> DVec2 {
    let bits = cell.to_bits();
    let low = bits >> (TABLE_BITS - 1) & (MOST - 1) | bits >> 31;
    let scale = f64::from(f32::from_bits(bits & f32::INFINITY.to_bits()));
    scale * DVec2::new(low.into(), (bits & MOST).into())
}

/// The radius 2^(i/2 - 1), whose diameter ends a cell.
pub fn sphere(exponent: i32) -> f64 {
    2f64.powf(f64::from(exponent) / 2.0 - 1.0)
}
