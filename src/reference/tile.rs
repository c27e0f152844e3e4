//! Tiles of pixels that share the hits that they light, and the points that are drawn for their places: twin of
//! `tile.glsl`. What is shared, and why: [`reuse`](mod@super::reuse).
//!
//! # Points
//! The W x W places of a tile take points of one net, so that a tile covers each dimension evenly with every sample, and a
//! pixel of it with all of its samples. Coordinate d of the sample at place p is the exclusive or of two scrambled numbers,
//! the sample's own point and that of the place:
//!
//!   scramble(s_d(sample), key_d)  ^  scramble(q_d(p), key'_d).
//!
//! Either alone is uniform, so every pixel's points are; for one sample the places are a digitally shifted net, for one
//! place the samples are. With p of 2b digits and p' its digits reversed, q is for radius and component the (0, 2)-sequence
//! of Sobol at p, for angle and technique that at p': radius, component and angle are a (0, 2b, 3)-net (the sequence's first
//! points with p / W^2 as the third coordinate: H. Niederreiter, Random Number Generation and Quasi-Monte Carlo Methods,
//! SIAM 1992, lemma 3.7). For the hit and the lights it is that at a random permutation of the places.

use super::Inputs;
use super::pixel::position;
use super::random::{batch, hash, key, scramble, sobol, unit};
use crate::shared::{BATCHES, DIM_ANGLE, DIM_COMPONENT, DIM_HIT, DIM_PLACE, DIM_TECHNIQUE, GOLDEN, Step};

/// A pixel's tile, and where in it the pixel is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    pub tile: (u32, u32),
    pub at: u32,
    /// Of the tile; 0 for a tile of one.
    width: u32,
}

impl Place {
    /// A tile of one, at that column and row.
    pub fn alone(tile: (u32, u32)) -> Place {
        Place { tile, at: 0, width: 0 }
    }

    /// The first place of a tile.
    pub fn first(inputs: &Inputs, tile: (u32, u32)) -> Place {
        Place { tile, at: 0, width: inputs.features.reuse }
    }

    /// Of pixel `index` of the band.
    pub fn of(inputs: &Inputs, step: &Step, index: u32) -> Place {
        let width = inputs.features.reuse;
        let (px, py) = position(inputs.view, step, index);
        if width == 0 {
            return Place::alone((px, py));
        }
        let (dx, dy) = offset(width, step.sample_index);
        let (x, y) = (px + dx, py + dy);
        Place { tile: (x / width, y / width), at: y % width * width + x % width, width }
    }
}

/// The first [`Probe::share`](crate::shared::Probe::share) of the step's sample.
pub fn first_share(inputs: &Inputs, step: &Step) -> u32 {
    (step.sample_index + 1).wrapping_mul(inputs.view.groups)
}

/// By how much the tiles of the sample's batch are moved to the left and up.
fn offset(width: u32, sample_index: u32) -> (u32, u32) {
    let batch = batch(sample_index);
    (3 * batch % width, 5 * batch % width)
}

/// Positions in the band of the pixels of a tile, row by row.
pub fn members(inputs: &Inputs, step: &Step, place: Place) -> Vec<u32> {
    let width = inputs.features.reuse;
    let (dx, dy) = offset(width, step.sample_index);
    let (columns, rows) = (inputs.view.crop_width, step.pixel_count / inputs.view.crop_width);
    let range = |tile: u32, offset: u32, first: u32, count: u32| {
        let start = i64::from(tile * width) - i64::from(offset) - i64::from(first);
        start.max(0) as u32..(start + i64::from(width)).clamp(0, i64::from(count)) as u32
    };
    let across = range(place.tile.0, dx, inputs.view.crop_x, columns);
    let down = range(place.tile.1, dy, step.first_row, rows);
    down.flat_map(|y| across.clone().map(move |x| y * columns + x)).collect()
}

/// A permutation of the places, by three rounds of a Feistel network.
fn shuffled(at: u32, width: u32, key: u32) -> u32 {
    let (x, y) = (at % width, at / width);
    let x = x.wrapping_add(hash(key ^ y)) % width;
    let y = y.wrapping_add(hash(key ^ (width + x))) % width;
    let x = x.wrapping_add(hash(key ^ (2 * width + y))) % width;
    y * width + x
}

/// Coordinate `dimension` (one of the estimator's) of the step's sample at a place.
pub fn coordinate(inputs: &Inputs, step: &Step, place: Place, dimension: u32) -> f64 {
    let key = |d: u32| key(inputs.view.seed, place.tile.0, place.tile.1, batch(step.sample_index), d);
    let own = scramble(step.point[dimension as usize], key(dimension));
    let width = place.width;
    if width == 0 {
        return unit(own);
    }
    let of_place = key(dimension + DIM_PLACE);
    let at = match dimension {
        DIM_HIT => shuffled(place.at, width, of_place),
        DIM_ANGLE | DIM_TECHNIQUE => place.at.reverse_bits() >> (32 - (width * width).ilog2()),
        _ => place.at,
    };
    let second = matches!(dimension, DIM_COMPONENT | DIM_TECHNIQUE);
    unit(own ^ scramble(sobol(at, usize::from(second)), of_place))
}

/// A number for direction `j` of the step's sample at a place: steps by the golden ratio, which cover [0, 1) evenly in a
/// tile and in a pixel, from a hash. It has nothing to do with the binary digits of `j`, as [`direction_point`] has.
pub fn golden(inputs: &Inputs, step: &Step, place: Place, j: u32, dimension: u32) -> f64 {
    let number = (step.sample_index / BATCHES).wrapping_mul(inputs.view.directions).wrapping_add(j);
    let start = key(inputs.view.seed, place.tile.0, place.tile.1, batch(step.sample_index), dimension);
    let n = number.wrapping_mul((place.width * place.width).max(1)).wrapping_add(place.at);
    unit(start.wrapping_add(GOLDEN.wrapping_mul(n)))
}

/// Coordinates of direction or emitter's point `j` of the step's sample at a place.
pub fn direction_point(inputs: &Inputs, step: &Step, place: Place, j: u32, dimension: u32) -> (f64, f64) {
    let number = (step.sample_index / BATCHES).wrapping_mul(inputs.view.directions).wrapping_add(j);
    let key = |d: u32| key(inputs.view.seed, place.tile.0, place.tile.1, batch(step.sample_index), dimension + d);
    let width = place.width;
    let at = if width == 0 { 0 } else { shuffled(place.at, width, key(DIM_PLACE)) };
    let coordinate = |d: u32| {
        let own = scramble(sobol(number, d as usize), key(d));
        if width == 0 { unit(own) } else { unit(own ^ scramble(sobol(at, d as usize), key(d + DIM_PLACE))) }
    };
    (coordinate(0), coordinate(1))
}
