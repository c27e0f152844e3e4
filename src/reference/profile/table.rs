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
use crate::settings::Precision;
use crate::shared::Material;
use crate::table::{
    self,
    block::{Block, Cell, HEADER},
    grid,
};
use glam::{DVec2, DVec3, Vec3};
use std::f64::consts::PI;

/// The profile of one channel on a half-space.
#[derive(Clone, Debug)]
pub struct Tabulated {
    channel: usize,
    /// Total, 0 for matter that does not scatter; 1 where it is the kernels' strength.
    strength: f64,
    rate: f64,
    first: u32,
    /// Of the half-space's node.
    data: Vec<Vec3>,
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

/// One node of the curvature.
#[derive(Clone, Copy)]
struct Node<'a> {
    first: u32,
    curvature: f64,
    /// Cells that its sphere reaches.
    reached: usize,
    /// 1 / mass, and k, of the channels.
    densities: DVec3,
    slope: DVec3,
    /// Vectors of a cell.
    cell_vectors: usize,
    /// Values below the first node as a cell, then the cells.
    cells: &'a [Vec3],
    within: &'a [Vec3],
}

/// Where node k of a material's table begins, and its vectors.
fn extent(matter: Matter, k: usize) -> (usize, usize) {
    let Material { table, table_cells, .. } = *matter.material;
    let cell_vectors = matter.tables[table as usize].z as u32;
    let stride = Block::stride(table_cells, cell_vectors);
    (table as usize + k * stride, stride)
}

impl<'a> Node<'a> {
    /// Node k of a material's table.
    fn of(matter: Matter<'a>, k: usize) -> Node<'a> {
        let (start, stride) = extent(matter, k);
        Node::new(matter.material.table_first, &matter.tables[start..][..stride])
    }

    fn new(first: u32, data: &'a [Vec3]) -> Node<'a> {
        let (header, nodes) = data.split_at(HEADER);
        let cell_vectors = header[0].z as usize;
        let (cells, within) = nodes.split_at(nodes.len() / (cell_vectors + 1) * cell_vectors);
        Node {
            first,
            curvature: header[0].x.into(),
            reached: header[0].y as usize,
            densities: header[1].as_dvec3(),
            slope: header[2].as_dvec3(),
            cell_vectors,
            cells,
            within,
        }
    }

    /// The channels' values at both nodes of a cell: 0 is below the first node, i + 1 cell i.
    fn ends(&self, cell: usize) -> [DVec3; 2] {
        let vectors = &self.cells[cell * self.cell_vectors..][..self.cell_vectors];
        let [x, y, z] = [0, 1, 2].map(|c| Cell::read(vectors, c).ends());
        [DVec3::new(x.x, y.x, z.x), DVec3::new(x.y, y.y, z.y)]
    }

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

    /// Values at the squared distance.
    fn values(&self, s: f64) -> DVec3 {
        self.values_in(self.place(s))
    }

    fn values_in(&self, place: Place) -> DVec3 {
        match place {
            Place::Before(_) => self.ends(0)[0],
            Place::Cell { i, t, .. } => {
                let [low, high] = self.ends(i + 1);
                low.lerp(high, t)
            }
            Place::Beyond => DVec3::ZERO,
        }
    }

    /// Squared distance within which the share u of a channel's light lies.
    fn draw(&self, c: usize, u: f64) -> f64 {
        let within = |i: usize| f64::from(self.within[i][c]);
        let target = u * within(self.reached);
        if target < within(0) {
            return f64::from(grid::node(self.first)) * target / within(0);
        }
        let i = self.within[..self.reached].partition_point(|light| f64::from(light[c]) <= target) - 1;
        let [low, high] = [0, 1].map(|k| f64::from(grid::node(self.first + i as u32 + k)));
        let [a, b] = self.ends(i + 1).map(|values| values[c]);
        // Light from the edge over the cell's area: a t + (b - a) t^2 / 2.
        let q = (target - within(i)) / (PI * (high - low));
        let root = a + (a * a + 2.0 * (b - a) * q).max(0.0).sqrt();
        let t = if root > 0.0 { (2.0 * q / root).min(1.0) } else { 0.0 };
        low + t * (high - low)
    }

    fn total(&self) -> DVec3 {
        self.within[self.reached].as_dvec3()
    }

    /// Light within the squared distance.
    fn inside(&self, place: Place) -> DVec3 {
        match place {
            Place::Before(share) => self.within[0].as_dvec3() * share,
            Place::Cell { i, past, .. } => {
                let mean = (self.ends(i + 1)[0] + self.values_in(place)) / 2.0;
                self.within[i].as_dvec3() + PI * past * mean
            }
            Place::Beyond => self.total(),
        }
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
    let of = |k: usize| Node::of(matter, k).curvature;
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
    let Material { table_first, table_cells, table_nodes, .. } = *matter.material;
    let values = &matter.tables[extent(matter, table_nodes as usize).0..];
    let i = grid::cell(s as f32).clamp(table_first, table_first + table_cells - 1) - table_first;
    let [low, high] = [i, i + 1].map(|i| f64::from(grid::node(table_first + i)));
    let t = ((s - low) / (high - low)).clamp(0.0, 1.0);
    let cell = values[i as usize].as_dvec3();
    cell.x * (1.0 - t) + cell.y * t
}

/// shape(r) of the three channels.
pub(super) fn shapes(matter: Matter, r: f64) -> DVec3 {
    parts(matter).iter().map(|part| part.values(matter, r)).sum()
}

/// The values of the curvature that the number draws.
pub(super) fn drawn(matter: Matter, r: f64, u: f64) -> DVec3 {
    let parts = parts(matter);
    let part = &parts[usize::from(u >= parts[0].weight)];
    let (s, area) = part.bent(r * r);
    area * Node::of(matter, part.node).values(s)
}

/// Density of the sampled radii per area of the plane.
pub(super) fn density(matter: Matter, r: f64) -> f64 {
    let of = |part: &Part| {
        let normalised = part.values(matter, r) * Node::of(matter, part.node).densities;
        normalised.dot(matter.material.density.as_dvec3())
    };
    parts(matter).iter().map(of).sum()
}

/// The radius that the numbers pick in channel c: `share` the node, u the distance.
pub(super) fn radius(matter: Matter, c: usize, share: f64, u: f64) -> f64 {
    let parts = parts(matter);
    let part = &parts[usize::from(parts.len() > 1 && share >= parts[0].weight)];
    part.unbent(Node::of(matter, part.node).draw(c, u))
}

/// k of the three channels.
pub(in crate::reference) fn slope(matter: Matter) -> DVec3 {
    parts(matter).iter().map(|part| part.weight * Node::of(matter, part.node).slope).sum()
}

/// The factor 1 + k (1 - mu') on light that enters, or 1 over its mean times it on light that leaves, at the cosine
/// outside.
pub(super) fn obliqueness(material: &Material, slope: DVec3, cos: f64, leaving: bool) -> DVec3 {
    let factor = DVec3::ONE + slope * (1.0 - cos_refracted(material.ior.into(), cos));
    if leaving { factor / (DVec3::ONE + slope * f64::from(material.obliqueness)) } else { factor }
}

/// The profile of a material at one curvature, over its strength.
pub struct Local<'a> {
    parts: Vec<(Part, Node<'a>)>,
}

impl<'a> Local<'a> {
    pub fn new(matter: Matter<'a>) -> Local<'a> {
        let of = |part: Part| {
            let node = Node::of(matter, part.node);
            (part, node)
        };
        Local { parts: parts(matter).into_iter().map(of).collect() }
    }

    fn sum(&self, f: impl Fn(&Part, &Node) -> DVec3) -> DVec3 {
        self.parts.iter().map(|(part, node)| part.weight * f(part, node)).sum()
    }

    /// Value at the squared distance.
    pub fn value(&self, squared: f64) -> DVec3 {
        self.sum(|part, node| {
            let (s, area) = part.bent(squared);
            area * node.values(s)
        })
    }

    /// Light within the squared distance.
    pub fn inside(&self, squared: f64) -> DVec3 {
        self.sum(|part, node| {
            let (s, area) = part.bent(squared);
            node.inside(if area > 0.0 { node.place(s) } else { Place::Beyond })
        })
    }

    /// All light.
    pub fn total(&self) -> DVec3 {
        self.sum(|_, node| node.total())
    }

    /// Distance beyond which there is nothing.
    pub fn end(&self) -> f64 {
        let of = |(part, node): &(Part, Node)| part.unbent(f64::from(grid::node(node.first + node.reached as u32)));
        self.parts.iter().map(of).fold(0.0, f64::max)
    }
}

impl Tabulated {
    /// The channel on a half-space.
    pub(super) fn of(matter: &Coefficients) -> Tabulated {
        let channel = table::channel(matter);
        let mut block = Block::new(&[channel.clone(), None, None], &[], Precision::Full);
        block.data.truncate(Block::stride(block.cells, Precision::Full.cell_vectors()));
        Tabulated {
            channel: 0,
            strength: block.totals.x,
            rate: channel.map_or(0.0, |channel| channel.rate()),
            first: block.first,
            data: block.data,
        }
    }

    pub(super) fn unpack(matter: Matter, channel: usize) -> Tabulated {
        let Material { table_first, table_nodes, sigma_tr, .. } = *matter.material;
        let (start, stride) = extent(matter, table_nodes as usize - 1);
        let data = matter.tables[start..][..stride].to_vec();
        Tabulated { channel, strength: 1.0, rate: f64::from(sigma_tr[channel]), first: table_first, data }
    }

    fn node(&self) -> Node<'_> {
        Node::new(self.first, &self.data)
    }
}

impl Radial for Tabulated {
    fn shape_shifted(&self, r: f64, exponent: f64) -> f64 {
        shifted(self.node().values(r * r)[self.channel], exponent)
    }

    fn strength(&self) -> f64 {
        self.strength
    }

    fn masses(&self) -> [f64; COMPONENTS] {
        [self.node().total()[self.channel], 0.0, 0.0]
    }

    fn inside(&self, radius: f64) -> f64 {
        let node = self.node();
        node.inside(node.place(radius * radius))[self.channel]
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
        ring(0.0, edge(0)) + (1..self.node().within.len()).map(|i| ring(edge(i - 1), edge(i))).sum::<f64>()
    }

    fn radius(&self, _component: usize, _share: f64, u: f64) -> f64 {
        self.node().draw(self.channel, u).sqrt()
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
