//! Light that enters, interpolated between points of a triangle: twin of `cached.glsl`.
//!
//! What enters at x is needed as E = int Ft(wi) Li cos dw and, under table models, as O = int Ft(wi) (1 - mu') Li cos dw
//! ([`irradiance`](mod@super::irradiance)); both depend on x alone, not on the pixel. They are kept at the points of
//! [`cache`](crate::cache) and in between they are linear over the cells of a triangle's lattice, or of one of its patches. The estimator of
//! [`accumulate`](mod@super::accumulate) then has
//!
//!   E(x) + slope O(x)
//!
//! in place of the sum over shadow rays. Its error is that of the interpolation, of the order h^2 E'' / 8 for points h apart
//! where E is smooth and of the order of a cell's light where a shadow has its edge, and the noise that the points were lit
//! with, which is the same in all samples. The profile takes the mean of both over a mean free path.

use super::Inputs;
use super::profile::{Matter, table};
use crate::shared::{Lattice, MODEL_TABLE};
use glam::{DVec2, DVec3};

/// Number of the point b1 = i / cells, b2 = j / cells.
pub fn number(lattice: &Lattice, i: u32, j: u32) -> u32 {
    let n = lattice.cells;
    match (i, j) {
        (0, 0) => lattice.corners[0],
        (i, 0) if i == n => lattice.corners[1],
        (0, j) if j == n => lattice.corners[2],
        // Row k has n + 1 - k points; one corner comes before those of row 0, two before the others.
        _ => lattice.first + (0..j).map(|k| n + 1 - k).sum::<u32>() + i - if j == 0 { 1 } else { 2 },
    }
}

/// A cell of a triangle that is cut into cells, n along each edge.
struct Cell {
    i: u32,
    j: u32,
    /// Of the two cells between four points, the one with the larger b1 and b2. Its vertices are (i + 1, j + 1), (i, j + 1)
    /// and (i + 1, j), those of the other (i, j), (i + 1, j) and (i, j + 1).
    upper: bool,
    /// Weights of its second and third vertex.
    weights: DVec2,
}

fn cell(n: u32, weights: DVec2) -> Cell {
    // Rounding may have put them outside of the triangle.
    let inside = weights.max(DVec2::ZERO);
    let at = inside / (inside.x + inside.y).max(1.0) * f64::from(n);
    let x = at.x.floor().min(f64::from(n) - 1.0);
    let y = at.y.floor().min(f64::from(n) - 1.0 - x);
    let rest = at - DVec2::new(x, y);
    let (i, j) = (x as u32, y as u32);
    let upper = rest.x + rest.y > 1.0 && i + j + 1 < n;
    Cell { i, j, upper, weights: if upper { 1.0 - rest } else { rest } }
}

/// Number of a patch among those of its triangle.
pub fn patch(n: u32, i: u32, j: u32, upper: bool) -> u32 {
    (0..j).map(|k| 2 * (n - k) - 1).sum::<u32>() + 2 * i + u32::from(upper)
}

/// The three points around weights of the second and third vertex of a triangle, and what each counts; none where no light
/// is kept.
pub fn around(lattices: &[Lattice], triangle: u32, weights: DVec2) -> Option<[(u32, f64); 3]> {
    let (mut lattice, mut weights) = (&lattices[triangle as usize], weights);
    if lattice.patches > 1 {
        let Cell { i, j, upper, weights: within } = cell(lattice.patches, weights);
        lattice = &lattices[(lattice.first + patch(lattice.patches, i, j, upper)) as usize];
        weights = within;
    }
    if lattice.cells == 0 {
        return None;
    }
    let Cell { i, j, upper, weights } = cell(lattice.cells, weights);
    let vertices = if upper { [(1, 1), (0, 1), (1, 0)] } else { [(0, 0), (1, 0), (0, 1)] };
    let [a, b, c] = vertices.map(|(di, dj)| number(lattice, i + di, j + dj));
    Some([(a, 1.0 - weights.x - weights.y), (b, weights.x), (c, weights.y)])
}

/// E + slope O at a point of a triangle; `matter` is what light enters there.
pub fn cached(inputs: &Inputs, matter: Matter, triangle: u32, weights: DVec2) -> DVec3 {
    let slope = if matter.material.model == MODEL_TABLE { table::slope(matter) } else { DVec3::ZERO };
    let kept = |(number, weight): (u32, f64)| {
        let point = &inputs.kept[number as usize];
        weight * (point.flux.as_dvec3() + slope * point.oblique.as_dvec3())
    };
    around(inputs.lattices, triangle, weights).into_iter().flatten().map(kept).sum()
}
