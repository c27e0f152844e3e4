//! Tables of what walks deposit, at nodes of albedo and curvature, and profiles between the nodes.
//!
//! # What is stored
//! For each radius of a sphere (in units of 1 / sigma_s') and each albedo alpha' of [`EXTENTS`]: the part of the profile
//! that [`single`](super::single) leaves out, ln R by cell of the squared distance with its relative standard error, its
//! total, and the total of everything under diffuse light. e = sqrt(3 (1 - alpha')) numbers the albedos since R is
//! smooth in it: far from the entry ln R falls like -e r.
//!
//! # How noise is kept low
//! In each cell ln R is replaced by the value of a parabola in ln r^2, fitted by least squares to it and its neighbours,
//! and carried from the cell's mean to its middle. On the half-space the parabola is fitted to what ln R exceeds that of
//! a diffusion dipole with the exact decay rate by, which bends little: three neighbours on each side, eight where a
//! cell's error exceeds 1 %. Cells with a standard error above 15 % are continued: towards r = 0 by the power of r of the
//! cells that follow, between r^0 and r^-1 (what two collisions give), towards infinity in proportion to the dipole.
//!
//! # Between nodes
//! ln R is a cubic in e and in ln r^2. Between the radii a1 < a < a2 of spheres, R is linear in 1/a, each part stretched
//! from its diameter to 2 a: with c = a_k / a, h = 1/c - 1, q = (r / 2 a)^2, distances r become
//!
//!   r_k = r / (1 + h q),  d r_k^2 / d r^2 = (1 - h q) / (1 + h q)^3,
//!
//! which is 1 near the entry and ends at 2 a_k. So totals are linear in 1/a.

use super::grid;
use super::single::Matter;
use super::walk::{CELLS, Estimate, FIRST, Incidence, Leaving, Walk, reached};
use crate::reference::boundary::{Side, cos_refracted, diffuse_reflectance, transmittance};
use crate::reference::math::integrate;
use crate::reference::profile::{Dipole, Radial, boundary_factor};
use std::f64::consts::PI;
use std::sync::Arc;

/// e = sqrt(3 (1 - alpha')) of the tabulated albedos.
pub const EXTENTS: [f64; 25] = [
    0.0, 0.02, 0.035, 0.05, 0.075, 0.1, 0.14, 0.19, 0.25, 0.32, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.4,
    1.5, 1.6, 1.66, 1.71,
];
/// Relative standard error above which a cell is continued from its neighbours.
const NOISY: f64 = 0.15;
/// Relative standard error from which on a cell of a half-space is smoothed over more neighbours.
const ROUGH: f64 = 0.01;
/// ln R of nothing.
const NOTHING: f64 = -80.0;

/// What leaves a half-space or a sphere at every albedo, but for single scattering.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Radius of the sphere in units of 1 / sigma_s'; infinite for the half-space.
    pub radius: f64,
    /// One for each of [`EXTENTS`].
    pub albedos: Vec<Curve>,
}

/// The same at one albedo.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Part of the light that leaves, normal incidence, without [`Matter::single`] and the pencil itself.
    pub total: Estimate,
    /// Part of the light that leaves, all of it, diffuse incidence.
    pub diffuse: Estimate,
    /// ln R at the middle of each cell.
    pub logarithm: Vec<f64>,
    /// Relative standard error of each cell's light before smoothing.
    pub error: Vec<f64>,
}

/// All spheres of one kind of matter.
#[derive(Clone, Debug, PartialEq)]
pub struct White {
    /// Index of refraction, inside over outside.
    pub ior: f64,
    pub g: f64,
    /// By radius; the last is the half-space.
    pub nodes: Vec<Node>,
}

/// sigma_a / sigma_s' of an extent.
fn absorption(extent: f64) -> f64 {
    let share = extent * extent / 3.0;
    share / (1.0 - share)
}

/// Middle of a cell of the squared distance.
fn middle(cell: usize) -> f64 {
    let cell = FIRST + cell as u32;
    (f64::from(grid::node(cell)) + f64::from(grid::node(cell + 1))) / 2.0
}

/// Area of a cell.
fn area(cell: usize) -> f64 {
    let cell = FIRST + cell as u32;
    PI * (f64::from(grid::node(cell + 1)) - f64::from(grid::node(cell)))
}

/// Decay rate in units of sigma_t': the root k of alpha' atanh(k) = k (K. M. Case, P. F. Zweifel, "Linear transport
/// theory", 1967, section 4.4), for isotropic scattering with the same reduced coefficients.
pub fn decay(albedo: f64) -> f64 {
    if albedo >= 1.0 {
        return 0.0;
    }
    if albedo <= 0.0 {
        return 1.0;
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let k: f64 = (low + high) / 2.0;
        *(if albedo * k.atanh() < k { &mut low } else { &mut high }) = k;
    }
    low
}

/// The dipole that continues a profile, in units of 1 / sigma_s'.
fn continuation(albedo: f64, ior: f64) -> Dipole {
    let z_real = albedo.max(1e-9);
    Dipole {
        albedo,
        sigma_tr: decay(albedo) / z_real,
        z_real,
        z_virtual: z_real * (1.0 + 4.0 / 3.0 * boundary_factor(ior)),
    }
}

impl White {
    /// Simulates the radii, ascending and ending with infinity, with `walks` walks each.
    pub fn simulate(ior: f64, g: f64, radii: &[f64], walks: impl Fn(f64) -> u64) -> White {
        White { ior, g, nodes: radii.iter().map(|&radius| Node::simulate(ior, g, radius, walks(radius))).collect() }
    }

    /// A half-space with the spheres that the known tables have, weighted: R and the odds T : 1 - T of a total change with
    /// the curvature as they do there, at the same albedo.
    pub fn curved(mut self, known: &[(Arc<White>, f64)]) -> White {
        let plane = self.nodes.pop().expect("a table has the half-space");
        let spheres = known[0].0.nodes.len() - 1;
        self.nodes = (0..spheres).map(|k| self.sphere(&plane, known, k)).collect();
        self.nodes.push(plane);
        self
    }

    /// Node k of the known tables for this matter.
    fn sphere(&self, plane: &Node, known: &[(Arc<White>, f64)], k: usize) -> Node {
        let radius = known[0].0.nodes[k].radius;
        let mean = |f: &dyn Fn(&White) -> f64| known.iter().map(|(table, weight)| weight * f(table)).sum::<f64>();
        let curve = |index: usize| {
            let sigma_a = absorption(EXTENTS[index]);
            let directly =
                |g: f64, ior: f64, radius: f64| Matter { sigma_s: 1.0 / (1.0 - g), sigma_a, g, ior }.directly(radius);
            let flat = &plane.albedos[index];
            let here = directly(self.g, self.ior, radius);
            // Odds of a total there over those of the half-space.
            let odds = |total: f64| (total / (1.0 - total).max(1e-12)).max(1e-300).ln();
            let changed = |own: f64, f: &dyn Fn(&White, &Node) -> f64| {
                let change =
                    mean(&|table| odds(f(table, &table.nodes[k])) - odds(f(table, &table.nodes[spheres_of(table)])));
                1.0 / (1.0 + (-odds(own) - change).exp())
            };
            let total = changed(flat.total.mean + directly(self.g, self.ior, f64::INFINITY), &|table, node| {
                node.albedos[index].total.mean + directly(table.g, table.ior, node.radius)
            });
            let diffuse = changed(flat.diffuse.mean, &|_, node| node.albedos[index].diffuse.mean);
            let shift = |cell: usize| {
                mean(&|table| {
                    let of = |node: usize| table.nodes[node].albedos[index].logarithm[cell];
                    of(k) - of(spheres_of(table))
                })
            };
            let reached = reached(radius);
            let logarithm = (0..CELLS)
                .map(|cell| if cell < reached { (flat.logarithm[cell] + shift(cell)).max(NOTHING) } else { NOTHING })
                .collect();
            Curve {
                total: Estimate { mean: (total - here).max(0.0), error: flat.total.error },
                diffuse: Estimate { mean: diffuse, error: flat.diffuse.error },
                logarithm,
                error: flat.error.clone(),
            }
        };
        Node { radius, albedos: (0..EXTENTS.len()).map(curve).collect() }
    }

    /// The profile at an albedo alpha', 0 to 1, on a sphere of the radius in units of 1 / sigma_s'.
    pub fn profile(&self, albedo: f64, radius: f64) -> Profile {
        let parts = self.parts(radius);
        let e = (3.0 * (1.0 - albedo)).max(0.0).sqrt();
        let last = *EXTENTS.last().expect("a constant");
        // Below the tabulated albedos only two collisions count: alpha'^2.
        let scale = if e > last { (albedo / (1.0 - last * last / 3.0)).powi(2) } else { 1.0 };
        let (nodes, weights) = lagrange(&EXTENTS, e.min(last));
        let curves: Vec<Part> = parts
            .into_iter()
            .map(|(node, weight, stretch)| {
                let node = &self.nodes[node];
                let curve = |i: usize| &node.albedos[nodes + i];
                let mix = |f: &dyn Fn(&Curve) -> f64| (0..4).map(|i| weights[i] * f(curve(i))).sum::<f64>();
                let reached = reached(node.radius);
                let nearest = curve((0..4).max_by(|&a, &b| weights[a].total_cmp(&weights[b])).expect("four"));
                Part {
                    weight: weight * scale,
                    stretch,
                    reached,
                    end: 4.0 * node.radius * node.radius,
                    total: mix(&|c| c.total.mean.max(1e-300).ln()).exp(),
                    total_error: nearest.total.error,
                    diffuse: mix(&|c| c.diffuse.mean.max(1e-300).ln()).exp(),
                    logarithm: (0..CELLS).map(|cell| mix(&|c| c.logarithm[cell])).collect(),
                    error: nearest.error.clone(),
                }
            })
            .collect();
        let matter =
            Matter { sigma_s: 1.0 / (1.0 - self.g), sigma_a: (1.0 - albedo) / albedo, g: self.g, ior: self.ior };
        Profile { matter, radius, dipole: continuation(albedo, self.ior), parts: curves }
    }

    /// Distance beyond which at most a share of the half-space's light leaves, by the dipole that continues the profile, in
    /// units of 1 / sigma_s'.
    pub fn tail(&self, albedo: f64, share: f64) -> f64 {
        continuation(albedo, self.ior).radius_beyond(share).max(4.0)
    }

    /// (node, weight, stretch) of the nodes around a radius.
    fn parts(&self, radius: f64) -> Vec<(usize, f64, f64)> {
        let radii: Vec<f64> = self.nodes.iter().map(|node| node.radius).collect();
        let above = radii.partition_point(|&a| a < radius);
        if above == radii.len() || radii[above] == radius {
            return vec![(above.min(radii.len() - 1), 1.0, 1.0)];
        }
        if above == 0 {
            // Smaller than every sphere: what is scattered twice or more falls with the size.
            return vec![(0, if radii[0].is_finite() { radius / radii[0] } else { 1.0 }, stretch(radii[0], radius))];
        }
        let (low, high) = (radii[above - 1], radii[above]);
        let weight = (1.0 / radius - 1.0 / high) / (1.0 / low - 1.0 / high);
        let both = high.is_finite();
        let stretch = |a: f64| if both { stretch(a, radius) } else { 1.0 };
        vec![(above - 1, weight, stretch(low)), (above, 1.0 - weight, stretch(high))]
    }
}

/// Index of a table's half-space.
fn spheres_of(table: &White) -> usize {
    table.nodes.len() - 1
}

/// Factor on distances that carries a sphere of the radius `to` to one of the radius `from`.
fn stretch(from: f64, to: f64) -> f64 {
    if from.is_finite() && to.is_finite() { from / to } else { 1.0 }
}

/// First of four nodes around x, and their weights in the cubic through them.
pub(super) fn lagrange(nodes: &[f64], x: f64) -> (usize, [f64; 4]) {
    let first = nodes.partition_point(|&node| node <= x).saturating_sub(2).min(nodes.len() - 4);
    let near = &nodes[first..first + 4];
    let weight = |i: usize| (0..4).filter(|&j| j != i).map(|j| (x - near[j]) / (near[i] - near[j])).product();
    (first, std::array::from_fn(weight))
}

impl Node {
    fn simulate(ior: f64, g: f64, radius: f64, walks: u64) -> Node {
        let absorptions = EXTENTS.map(absorption);
        let seed = (ior * 1e6) as u64 ^ ((g * 1e6) as i64 as u64) << 24 ^ radius.to_bits();
        let run = |incidence, walks| Walk { ior, g, radius, incidence, walks, seed }.run(&absorptions);
        let normal = run(Incidence::Normal, walks);
        let diffuse = run(Incidence::Diffuse, walks / 4);
        let mut albedos: Vec<Curve> = EXTENTS
            .iter()
            .zip(normal.iter().zip(&diffuse))
            .map(|(extent, (normal, diffuse))| Curve {
                total: normal.total,
                diffuse: diffuse.total,
                ..smoothed(normal, radius, &continuation(1.0 - extent * extent / 3.0, ior))
            })
            .collect();
        // Nothing is lost without absorption.
        let matter = Matter { sigma_s: 1.0 / (1.0 - g), sigma_a: 0.0, g, ior };
        albedos[0].total = Estimate { mean: 1.0 - matter.directly(radius), error: 0.0 };
        albedos[0].diffuse = Estimate { mean: 1.0, error: 0.0 };
        if radius.is_infinite() {
            // The longest walks count most here: the next albedo, by the ratio of dipoles.
            let [zero, next] = [0.0, EXTENTS[1]].map(|e| continuation(1.0 - e * e / 3.0, ior));
            let next_log = albedos[1].logarithm.clone();
            for (cell, value) in albedos[0].logarithm.iter_mut().enumerate() {
                let r = middle(cell).sqrt();
                *value = next_log[cell] + (zero.rd(r) / next.rd(r)).ln();
            }
            albedos[0].error = albedos[1].error.clone();
        }
        Node { radius, albedos }
    }
}

/// ln R in the middle of each cell and errors, without totals.
fn smoothed(leaving: &Leaving, radius: f64, dipole: &Dipole) -> Curve {
    let reached = reached(radius);
    let error: Vec<f64> = leaving
        .cells
        .iter()
        .map(|cell| if cell.mean > 0.0 { (cell.error / cell.mean).min(1.0) } else { 1.0 })
        .collect();
    // Over the dipole's shape, which on the half-space has the same end, little bends.
    let guide = |s: f64| if radius.is_finite() { 0.0 } else { dipole.shape(s.sqrt()).max(1e-300).ln() };
    let raw = |cell: usize| (leaving.cells[cell].mean / area(cell)).max(1e-300).ln() - guide(middle(cell));
    let mut logarithm = vec![NOTHING; CELLS];
    let good: Vec<usize> = (0..reached).filter(|&cell| error[cell] > 0.0 && error[cell] <= NOISY).collect();
    let longest = good.chunk_by(|a, b| a + 1 == *b).max_by_key(|run| run.len()).map(|run| (run[0], run[run.len() - 1]));
    let Some((first, last)) = longest else {
        return Curve { total: Estimate::default(), diffuse: Estimate::default(), logarithm, error };
    };
    for cell in first..=last {
        let reach = if error[cell] > ROUGH && radius.is_infinite() { 8 } else { 3 };
        let window = cell.saturating_sub(reach).max(first)..=(cell + reach).min(last);
        let point = |i: usize| ((middle(i) / middle(cell)).ln(), raw(i), 1.0 / (error[i] * error[i] + 1e-6));
        let [c0, c1, c2] = parabola(window.map(point));
        // The mean over the cell, by Simpson's rule, is what was counted.
        let curve = |s: f64| {
            let x = (s / middle(cell)).ln();
            (x * (c1 + x * c2) + guide(s) - guide(middle(cell))).exp()
        };
        let half = area(cell) / PI / 2.0;
        let mean = (curve(middle(cell) - half) + 4.0 + curve(middle(cell) + half)) / 6.0;
        logarithm[cell] = c0 + guide(middle(cell)) - mean.ln();
    }
    // Towards the entry R is a power of r, from a constant to what two collisions give, 1/r.
    let next = (first + 8).min(last);
    let slope = (logarithm[next] - logarithm[first]) / (middle(next) / middle(first)).ln().max(1e-300);
    for cell in 0..first {
        logarithm[cell] = logarithm[first] + slope.clamp(-0.5, 0.0) * (middle(cell) / middle(first)).ln();
    }
    for cell in last + 1..reached {
        let [from, to] = [last, cell].map(|cell| dipole.shape(middle(cell).sqrt()).max(1e-300).ln());
        logarithm[cell] = (logarithm[last] + to - from).max(NOTHING);
    }
    Curve { total: Estimate::default(), diffuse: Estimate::default(), logarithm, error }
}

/// Coefficients of the parabola c0 + c1 x + c2 x^2 through (x, y, weight) by least squares.
fn parabola(points: impl Iterator<Item = (f64, f64, f64)>) -> [f64; 3] {
    let (mut m, mut v, mut count) = ([0.0; 5], [0.0; 3], 0);
    for (x, y, weight) in points {
        let mut power = weight;
        for (k, moment) in m.iter_mut().enumerate() {
            *moment += power;
            if k < 3 {
                v[k] += power * y;
            }
            power *= x;
        }
        count += 1;
    }
    if count < 4 {
        return [v[0] / m[0], 0.0, 0.0];
    }
    let a = glam::DMat3::from_cols(
        glam::DVec3::new(m[0], m[1], m[2]),
        glam::DVec3::new(m[1], m[2], m[3]),
        glam::DVec3::new(m[2], m[3], m[4]),
    );
    (a.inverse() * glam::DVec3::from(v)).to_array()
}

/// One node's share in a profile.
#[derive(Clone, Debug, PartialEq)]
struct Part {
    weight: f64,
    /// Factor on the diameter.
    stretch: f64,
    reached: usize,
    /// Squared diameter.
    end: f64,
    total: f64,
    total_error: f64,
    diffuse: f64,
    logarithm: Vec<f64>,
    error: Vec<f64>,
}

/// R(r) of one albedo on one sphere; lengths in units of 1 / sigma_s'.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    pub matter: Matter,
    /// Radius of the sphere; infinite for the half-space.
    pub radius: f64,
    dipole: Dipole,
    parts: Vec<Part>,
}

impl Profile {
    /// Exitance per unit of light that entered along the normal, at the distance r > 0 [sigma_s'^2], without the pencil
    /// that crosses a sphere.
    pub fn value(&self, r: f64) -> f64 {
        if r > 2.0 * self.radius {
            return 0.0;
        }
        self.matter.single(r, self.radius) + self.multiple(r)
    }

    /// The part that Monte Carlo gives.
    pub fn multiple(&self, r: f64) -> f64 {
        let of = |part: &Part| {
            let h = 1.0 / part.stretch - 1.0;
            let q = if h == 0.0 { 0.0 } else { (r / (2.0 * self.radius)).powi(2) };
            let area = (1.0 - h * q) / (1.0 + h * q).powi(3);
            part.weight * area * part.value(r / (1.0 + h * q), &self.dipole)
        };
        self.parts.iter().map(of).sum()
    }

    /// Standard error of a cell's light at the distance r, relative to [`Profile::multiple`], before smoothing.
    pub fn error(&self, r: f64) -> f64 {
        let of = |part: &Part| {
            let cell = (grid::cell((r * part.stretch).powi(2) as f32).saturating_sub(FIRST) as usize).min(CELLS - 1);
            part.weight * part.error[cell]
        };
        self.parts.iter().map(of).sum()
    }

    /// Light that leaves the matter per unit that entered along the normal, and its standard error.
    pub fn total(&self) -> Estimate {
        let sum = |f: fn(&Part) -> f64| self.parts.iter().map(|part| part.weight * f(part)).sum::<f64>();
        Estimate { mean: sum(|p| p.total) + self.matter.directly(self.radius), error: sum(|p| p.total_error) }
    }

    /// The pencil that crosses a sphere and leaves at the far pole.
    pub fn pencil(&self) -> f64 {
        self.matter.pencil(self.radius)
    }

    /// Slope k of the total in the cosine mu' of refraction, total (1 + k (1 - mu')), from the total under diffuse light.
    ///
    /// For the incidences that a boundary with n >= 1.3 leaves, mu' > .64, totals are linear in mu' within 1 %. Beyond the
    /// tabulated albedos and radii the two totals are not of the same matter, and it is 0.
    pub fn slope(&self) -> f64 {
        if self.parts.iter().map(|part| part.weight).sum::<f64>() < 1.0 - 1e-9 {
            return 0.0;
        }
        let diffuse: f64 = self.parts.iter().map(|part| part.weight * part.diffuse).sum();
        (diffuse / self.total().mean - 1.0) / mean_obliqueness(self.matter.ior)
    }
}

/// Mean of 1 - mu' over diffuse light that has entered.
pub fn mean_obliqueness(ior: f64) -> f64 {
    // Cosines of incidence from outside above which light enters.
    let least = if ior < 1.0 { (1.0 - ior * ior).sqrt() } else { 0.0 };
    let entered = 1.0 - diffuse_reflectance(ior, Side::Outside);
    integrate(0.0, 1.0, 4, |t| {
        // Smooth in t at grazing incidence.
        let mu = least + (1.0 - least) * t * t;
        (1.0 - cos_refracted(ior, mu)) * transmittance(ior, mu) * 2.0 * mu * (1.0 - least) * 2.0 * t
    }) / entered
}

impl Part {
    fn value(&self, r: f64, dipole: &Dipole) -> f64 {
        let s = r * r;
        if s > self.end * (1.0 + 1e-12) {
            return 0.0;
        }
        let last = self.reached - 1;
        if s <= middle(0) {
            return self.logarithm[0].exp();
        }
        if s >= middle(last) {
            // On spheres the last cell continues the line from the cell before.
            if self.end.is_finite() {
                let slope = if last > 0 { self.logarithm[last] - self.logarithm[last - 1] } else { 0.0 };
                let step =
                    if last > 0 { (s / middle(last)).ln() / (middle(last) / middle(last - 1)).ln() } else { 0.0 };
                return (self.logarithm[last] + slope * step).exp();
            }
            return self.logarithm[last].exp() * dipole.shape(r) / dipole.shape(middle(last).sqrt()).max(1e-300);
        }
        let cell = (grid::cell(s as f32).max(FIRST) - FIRST) as usize;
        if last < 3 {
            return self.logarithm[cell.min(last)].exp();
        }
        let first = (cell + usize::from(s >= middle(cell.min(last)))).saturating_sub(2).min(last - 3);
        let x: [f64; 4] = std::array::from_fn(|i| middle(first + i).ln());
        let (_, weights) = lagrange(&x, s.ln());
        (0..4).map(|i| weights[i] * self.logarithm[first + i]).sum::<f64>().exp()
    }
}
