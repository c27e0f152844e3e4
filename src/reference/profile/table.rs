//! Profiles tabulated by simulation, as kernels read them: twin of `profile_table.glsl`. [`crate::table`] makes them.
//!
//! A table holds values at the nodes of r^2 and the light within them, for spheres of several radii and the half-space;
//! see [`crate::table::block`]. Between two radii a1 < a < a2 of spheres
//!
//!   f(r) = sum of w_k (1 - h_k q) / (1 + h_k q)^3 f_k(r / (1 + h_k q)),  w linear in 1/a,  h_k = a / a_k - 1,  q = (r / 2 a)^2,
//!
//! so that each part keeps its values near the entry, its total, and ends at the diameter 2 a; h_k = 0 where the
//! half-space is one of the two.
//! Drawn is a channel, one of the two with the probability w_k, and r^2 from its distribution function.
//!
//! # Oblique light
//! A table is for light that entered along the normal. Light refracted to the cosine mu' leaves in the total T(mu') =
//! T(1) (1 + k (1 - mu')), with k from the total under diffuse light: that factor stands at the entry and, since light
//! paths can be reversed, at the exit, divided there by its mean.

use super::{COMPONENTS, Coefficients, Matter, Options, Radial};
use crate::reference::boundary::cos_refracted;
use crate::shared::Material;
use crate::table::{
    self,
    block::{Block, HEADER},
    grid,
};
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// The profile of one channel on a half-space.
#[derive(Clone, Debug)]
pub struct Tabulated {
    first: u32,
    /// Total, 0 for matter that does not scatter; 1 where it is the kernels' strength.
    strength: f64,
    rate: f64,
    values: Vec<f32>,
    within: Vec<f32>,
}

/// One channel at one node of the curvature.
#[derive(Clone, Copy)]
struct Column<'a> {
    first: u32,
    reached: usize,
    values: &'a [f32],
    within: &'a [f32],
}

/// Where a squared distance lies in the grid.
#[derive(Clone, Copy)]
enum Place {
    /// Before the first node, at this share of it.
    Before(f64),
    /// In cell i, this far past its node, and the same as a share of the cell.
    Cell { i: usize, past: f64, t: f64 },
    /// Where nothing is.
    Beyond,
}

impl Column<'_> {
    /// Where the squared distance lies in the grid.
    fn place(&self, s: f64) -> Place {
        let cell = grid::cell(s as f32);
        if cell < self.first {
            return Place::Before(s / f64::from(grid::node(self.first)));
        }
        let i = (cell - self.first) as usize;
        if i >= self.reached {
            return Place::Beyond;
        }
        let [low, high] = [cell, cell + 1].map(|cell| f64::from(grid::node(cell)));
        Place::Cell { i, past: s - low, t: (s - low) / (high - low) }
    }

    /// Value at the squared distance.
    fn value(&self, s: f64) -> f64 {
        self.value_in(self.place(s))
    }

    fn value_in(&self, place: Place) -> f64 {
        match place {
            Place::Before(_) => f64::from(self.within[0]) / (PI * f64::from(grid::node(self.first))),
            Place::Cell { i, t, .. } => f64::from(self.values[i]) * (1.0 - t) + f64::from(self.values[i + 1]) * t,
            Place::Beyond => 0.0,
        }
    }

    /// Squared distance within which the share u of the light lies.
    fn draw(&self, u: f64) -> f64 {
        let target = u * f64::from(self.within[self.reached]);
        let first = f64::from(grid::node(self.first));
        if target < f64::from(self.within[0]) {
            return first * target / f64::from(self.within[0]);
        }
        let i = self.within[..self.reached].partition_point(|&light| f64::from(light) <= target) - 1;
        let [low, high] = [0, 1].map(|k| f64::from(grid::node(self.first + i as u32 + k)));
        let [a, b] = [i, i + 1].map(|i| f64::from(self.values[i]));
        // Light from the edge over the cell's area: a t + (b - a) t^2 / 2.
        let q = (target - f64::from(self.within[i])) / (PI * (high - low));
        let root = a + (a * a + 2.0 * (b - a) * q).max(0.0).sqrt();
        let t = if root > 0.0 { (2.0 * q / root).min(1.0) } else { 0.0 };
        low + t * (high - low)
    }

    fn total(&self) -> f64 {
        f64::from(self.within[self.reached])
    }

    /// Light within the squared distance.
    fn inside(&self, s: f64) -> f64 {
        self.inside_of(self.place(s))
    }

    fn inside_of(&self, place: Place) -> f64 {
        match place {
            Place::Before(share) => f64::from(self.within[0]) * share,
            Place::Cell { i, past, .. } => {
                f64::from(self.within[i]) + PI * past * (f64::from(self.values[i]) + self.value_in(place)) / 2.0
            }
            Place::Beyond => self.total(),
        }
    }
}

/// Node k of a material's table.
struct Node<'a> {
    data: &'a [f32],
    first: u32,
    cells: usize,
}

impl<'a> Node<'a> {
    fn of(matter: Matter<'a>, k: usize) -> Node<'a> {
        let Material { table, table_first, table_cells, .. } = *matter.material;
        let stride = Block::stride(table_cells);
        let data = &matter.tables[table as usize + k * stride..][..stride];
        Node { data, first: table_first, cells: table_cells as usize }
    }

    fn curvature(&self) -> f64 {
        f64::from(self.data[0])
    }

    fn vector(&self, at: usize) -> DVec3 {
        DVec3::from([0, 1, 2].map(|c| f64::from(self.data[at + c])))
    }

    fn column(&self, c: usize) -> Column<'a> {
        let n = self.cells + 1;
        let (values, within) = self.data[HEADER + 2 * c * n..][..2 * n].split_at(n);
        Column { first: self.first, reached: self.data[1] as usize, values, within }
    }

    fn values(&self, s: f64) -> DVec3 {
        DVec3::from([0, 1, 2].map(|c| self.column(c).value(s)))
    }
}

/// A node around the matter's curvature: its index, its weight, and how distances bend, h = 1/c - 1.
struct Part {
    node: usize,
    weight: f64,
    bend: f64,
    /// 1 / 4 a^2.
    scale: f64,
}

impl Part {
    /// The squared distance s in the node's table, and the factor on areas there; nothing lies beyond the diameter.
    fn bent(&self, s: f64) -> (f64, f64) {
        if self.bend == 0.0 {
            return (s, 1.0);
        }
        let q = s * self.scale;
        let d = 1.0 + self.bend * q;
        if q <= 1.0 { (s / (d * d), (1.0 - self.bend * q) / d.powi(3)) } else { (0.0, 0.0) }
    }

    /// The distance that is bent to the squared distance s.
    fn unbent(&self, s: f64) -> f64 {
        2.0 * s.sqrt() / (1.0 + (1.0 - 4.0 * self.bend * self.scale * s).max(0.0).sqrt())
    }

    /// Values of the channels at the distance r, weighted.
    fn values(&self, matter: Matter, r: f64) -> DVec3 {
        let (s, area) = self.bent(r * r);
        self.weight * area * Node::of(matter, self.node).values(s)
    }
}

fn parts(matter: Matter) -> Vec<Part> {
    let curvature = matter.curvature;
    let count = matter.material.table_nodes as usize;
    let of = |k: usize| Node::of(matter, k).curvature();
    let scale = 0.25 * curvature * curvature;
    // Curvatures fall from node to node.
    let above = (0..count).take_while(|&k| of(k) > curvature).count();
    if above == count {
        return vec![Part { node: count - 1, weight: 1.0, bend: 0.0, scale }];
    }
    // Distances bend where both are spheres.
    let low = of(above);
    let bend = |k: usize| if low > 0.0 { of(k) / curvature - 1.0 } else { 0.0 };
    if above == 0 {
        return vec![Part { node: 0, weight: 1.0, bend: bend(0), scale }];
    }
    let weight = (curvature - low) / (of(above - 1) - low);
    let part = |node: usize, weight| Part { node, weight, bend: bend(node), scale };
    vec![part(above - 1, weight), part(above, 1.0 - weight)]
}

/// Where a curvature lies between a table's nodes, as kernels keep it: the first of two nodes, its weight, how distances
/// bend in both, and 1 / 4 a^2.
pub struct Placement {
    pub node: u32,
    pub weight: f64,
    pub bend: DVec2,
    pub scale: f64,
}

/// Of the matter's curvature.
pub fn placement(matter: Matter) -> Placement {
    let parts = parts(matter);
    let (first, last) = (&parts[0], &parts[parts.len() - 1]);
    Placement {
        node: first.node as u32,
        weight: first.weight,
        bend: DVec2::new(first.bend, last.bend),
        scale: first.scale,
    }
}

/// Distance beyond which there is no light.
pub(in crate::reference) fn reach(matter: Matter) -> f64 {
    Local::new(matter).end()
}

/// The half-space's value at the squared distance, all channels together, of matter that reflects all light: constant
/// below the first node.
pub(in crate::reference) fn weighed(matter: Matter, s: f64) -> f64 {
    let Material { table, table_first, table_cells, table_nodes, .. } = *matter.material;
    let values = &matter.tables[table as usize + table_nodes as usize * Block::stride(table_cells)..];
    let i = grid::cell(s as f32).clamp(table_first, table_first + table_cells - 1) - table_first;
    let [low, high] = [i, i + 1].map(|i| (f64::from(grid::node(table_first + i)), f64::from(values[i as usize])));
    let t = ((s - low.0) / (high.0 - low.0)).clamp(0.0, 1.0);
    low.1 * (1.0 - t) + high.1 * t
}

/// shape(r) of the three channels.
pub(super) fn shapes(matter: Matter, r: f64) -> DVec3 {
    parts(matter).iter().map(|part| part.values(matter, r)).sum()
}

/// One value of the curvature that `node` draws, the one that u draws of the two around the distance.
pub(super) fn drawn(matter: Matter, r: f64, node: f64, u: f64) -> DVec3 {
    let parts = parts(matter);
    let part = &parts[usize::from(node >= parts[0].weight)];
    let (s, area) = part.bent(r * r);
    let of = |c: usize| {
        let column = Node::of(matter, part.node).column(c);
        match column.place(s) {
            Place::Cell { i, t, .. } => f64::from(column.values[i + usize::from(u < t)]),
            place => column.value_in(place),
        }
    };
    area * DVec3::from([0, 1, 2].map(of))
}

/// Density of the sampled radii per area of the plane.
pub(super) fn density(matter: Matter, r: f64) -> f64 {
    let of = |part: &Part| {
        let normalised = part.values(matter, r) * Node::of(matter, part.node).vector(2);
        normalised.dot(matter.material.density.as_dvec3())
    };
    parts(matter).iter().map(of).sum()
}

/// The radius that the numbers pick in channel c: `share` the node, u the distance.
pub(super) fn radius(matter: Matter, c: usize, share: f64, u: f64) -> f64 {
    let parts = parts(matter);
    let part = &parts[usize::from(parts.len() > 1 && share >= parts[0].weight)];
    part.unbent(Node::of(matter, part.node).column(c).draw(u))
}

/// k of the three channels.
pub(in crate::reference) fn slope(matter: Matter) -> DVec3 {
    parts(matter).iter().map(|part| part.weight * Node::of(matter, part.node).vector(5)).sum()
}

/// The factor 1 + k (1 - mu') on light that enters, or 1 over its mean times it on light that leaves, at the cosine
/// outside.
pub(super) fn obliqueness(material: &Material, slope: DVec3, cos: f64, leaving: bool) -> DVec3 {
    let factor = DVec3::ONE + slope * (1.0 - cos_refracted(material.ior.into(), cos));
    if leaving { factor / (DVec3::ONE + slope * f64::from(material.obliqueness)) } else { factor }
}

/// The profile of a material at one curvature, over its strength.
pub struct Local<'a> {
    parts: Vec<(Part, [Column<'a>; 3])>,
}

impl<'a> Local<'a> {
    pub fn new(matter: Matter<'a>) -> Local<'a> {
        let of = |part: Part| {
            let columns = [0, 1, 2].map(|c| Node::of(matter, part.node).column(c));
            (part, columns)
        };
        Local { parts: parts(matter).into_iter().map(of).collect() }
    }

    fn sum(&self, f: impl Fn(&Part, &[Column; 3]) -> DVec3) -> DVec3 {
        self.parts.iter().map(|(part, columns)| part.weight * f(part, columns)).sum()
    }

    /// Value at the squared distance.
    pub fn value(&self, squared: f64) -> DVec3 {
        self.sum(|part, columns| {
            let (s, area) = part.bent(squared);
            let place = columns[0].place(s);
            area * DVec3::from(columns.each_ref().map(|column| column.value_in(place)))
        })
    }

    /// Light within the squared distance.
    pub fn inside(&self, squared: f64) -> DVec3 {
        self.sum(|part, columns| {
            let (s, area) = part.bent(squared);
            let place = if area > 0.0 { columns[0].place(s) } else { Place::Beyond };
            DVec3::from(columns.each_ref().map(|column| column.inside_of(place)))
        })
    }

    /// All light.
    pub fn total(&self) -> DVec3 {
        self.sum(|_, columns| DVec3::from(columns.each_ref().map(Column::total)))
    }

    /// Distance beyond which there is nothing.
    pub fn end(&self) -> f64 {
        let of = |(part, columns): &(Part, [Column; 3])| {
            part.unbent(f64::from(grid::node(columns[0].first + columns[0].reached as u32)))
        };
        self.parts.iter().map(of).fold(0.0, f64::max)
    }
}

impl Tabulated {
    /// The channel on a half-space.
    pub(super) fn of(matter: &Coefficients) -> Tabulated {
        let channel = table::channel(matter);
        let block = Block::new(&[channel.clone(), None, None], &[]);
        let n = block.cells as usize + 1;
        let (values, within) = block.data[HEADER..HEADER + 2 * n].split_at(n);
        Tabulated {
            first: block.first,
            strength: block.totals.x,
            rate: channel.map_or(0.0, |channel| channel.rate()),
            values: values.to_vec(),
            within: within.to_vec(),
        }
    }

    pub(super) fn unpack(matter: Matter, c: usize) -> Tabulated {
        let node = Node::of(matter, matter.material.table_nodes as usize - 1);
        let column = node.column(c);
        Tabulated {
            first: column.first,
            strength: 1.0,
            rate: f64::from(matter.material.sigma_tr[c]),
            values: column.values.to_vec(),
            within: column.within.to_vec(),
        }
    }

    fn column(&self) -> Column<'_> {
        Column { first: self.first, reached: self.values.len() - 1, values: &self.values, within: &self.within }
    }
}

impl Radial for Tabulated {
    fn shape_shifted(&self, r: f64, exponent: f64) -> f64 {
        shifted(self.column().value(r * r), exponent)
    }

    fn strength(&self) -> f64 {
        self.strength
    }

    fn masses(&self) -> [f64; COMPONENTS] {
        [f64::from(*self.within.last().expect("a table has nodes")), 0.0, 0.0]
    }

    fn inside(&self, radius: f64) -> f64 {
        self.column().inside(radius * radius)
    }

    fn outside(&self, radius: f64) -> f64 {
        (self.mass() - self.inside(radius)).max(0.0)
    }

    /// Cell by cell, with J_0 by its integral (Bessel's first).
    fn response(&self, k: f64) -> f64 {
        let bessel = |x: f64| {
            let n = 16 + (x.abs() / 2.0) as usize;
            (0..n).map(|i| (x * ((i as f64 + 0.5) * PI / n as f64).sin()).cos()).sum::<f64>() / n as f64
        };
        let ring = |a: f64, b: f64| {
            let panels = 1 + (k * (b - a)) as usize;
            crate::reference::math::integrate(a, b, panels, |r| 2.0 * PI * r * self.shape(r) * bessel(k * r))
        };
        let edge = |i: usize| f64::from(grid::node(self.first + i as u32)).sqrt();
        ring(0.0, edge(0)) + (1..self.values.len()).map(|i| ring(edge(i - 1), edge(i))).sum::<f64>()
    }

    fn radius(&self, _component: usize, _share: f64, u: f64) -> f64 {
        self.column().draw(u).sqrt()
    }

    fn rate(&self) -> f64 {
        self.rate
    }

    fn pack(&self, c: usize, _options: &Options, material: &mut Material) {
        material.sigma_tr[c] = self.rate as f32;
    }
}

/// value e^exponent, though one of them may leave the range of numbers.
pub(super) fn shifted(value: f64, exponent: f64) -> f64 {
    if exponent == 0.0 || value <= 0.0 { value } else { (value.ln() + exponent).exp() }
}
