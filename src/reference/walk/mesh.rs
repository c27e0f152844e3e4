//! A body bounded by triangles, and the tree that finds them.

use super::Random;
use super::shape::{Body, Met, Shape, Site};
use glam::{DVec3, dvec3};
use std::f64::consts::{PI, TAU};

/// Three vertices, counter-clockwise seen from outside.
pub type Corners = [DVec3; 3];

/// Triangles of a leaf.
const LEAF: usize = 4;

/// A closed mesh. `place` is the index of a triangle in the order given.
#[derive(Clone, Debug)]
pub struct Mesh {
    triangles: Vec<Facet>,
    /// Running sums of their areas.
    areas: Vec<f64>,
    nodes: Vec<Node>,
    /// Triangles in the order of the leaves.
    order: Vec<u32>,
    /// Centre and radius of a ball around it.
    ball: (DVec3, f64),
}

#[derive(Clone, Copy, Debug)]
struct Facet {
    corner: DVec3,
    edge1: DVec3,
    edge2: DVec3,
    normal: DVec3,
}

/// A box, and its two children (at `first` and `first + 1`) or, if `count` > 0, its triangles in `order`.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    first: u32,
    count: u32,
}

impl Mesh {
    /// From at least one triangle; none may have area 0.
    pub fn new(corners: &[Corners]) -> Mesh {
        let facet = |&[a, b, c]: &Corners| {
            let (edge1, edge2) = (b - a, c - a);
            Facet { corner: a, edge1, edge2, normal: edge1.cross(edge2).normalize() }
        };
        let mut area = 0.0;
        let running = |[a, b, c]: &Corners| {
            area += (b - a).cross(c - a).length() / 2.0;
            area
        };
        let areas = corners.iter().map(running).collect();
        let mut order: Vec<u32> = (0..corners.len() as u32).collect();
        let mut nodes = vec![bounds(corners, &order, 0)];
        let mut waiting = vec![(0, 0, order.len())];
        while let Some((node, begin, end)) = waiting.pop() {
            if end - begin <= LEAF {
                nodes[node] = Node { first: begin as u32, count: (end - begin) as u32, ..nodes[node] };
                continue;
            }
            let axis = (nodes[node].high - nodes[node].low).max_position();
            let centre = |&index: &u32| corners[index as usize].iter().map(|c| c[axis]).sum::<f64>();
            order[begin..end].sort_by(|a, b| centre(a).total_cmp(&centre(b)));
            let middle = (begin + end) / 2;
            nodes[node].first = nodes.len() as u32;
            for (begin, end) in [(begin, middle), (middle, end)] {
                waiting.push((nodes.len(), begin, end));
                nodes.push(bounds(corners, &order[begin..end], 0));
            }
        }
        let centre = (nodes[0].low + nodes[0].high) / 2.0;
        let radius = corners.iter().flatten().map(|c| c.distance(centre)).fold(0.0, f64::max);
        Mesh { triangles: corners.iter().map(facet).collect(), areas, nodes, order, ball: (centre, radius) }
    }

    /// A box around the origin with edges along the axes, each face cut into `cells` x `cells` squares.
    pub fn cuboid(size: DVec3, cells: usize) -> Mesh {
        let mut corners = Vec::new();
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                let normal = DVec3::AXES[axis] * sign;
                let (u, v) = (DVec3::AXES[(axis + 1) % 3], DVec3::AXES[(axis + 2) % 3] * sign);
                let point = |i: usize, j: usize| {
                    let at = |k: usize| 2.0 * k as f64 / cells as f64 - 1.0;
                    (normal + at(i) * u + at(j) * v) * size / 2.0
                };
                for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))) {
                    let (a, b, c, d) = (point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1));
                    corners.extend([[a, b, c], [a, c, d]]);
                }
            }
        }
        Mesh::new(&corners)
    }

    /// A body of revolution about z whose outline runs through (distance from the axis, z), from the bottom on the axis to
    /// the top on the axis, in `sides` flat strips.
    pub fn revolved(outline: &[(f64, f64)], sides: usize) -> Mesh {
        let point = |(r, z): (f64, f64), side: usize| {
            let (s, c) = (TAU * (side % sides) as f64 / sides as f64).sin_cos();
            dvec3(r * c, r * s, z)
        };
        let mut corners = Vec::new();
        for ends in outline.windows(2) {
            for side in 0..sides {
                let [a, b] = [point(ends[0], side), point(ends[0], side + 1)];
                let [d, c] = [point(ends[1], side), point(ends[1], side + 1)];
                let whole = |t: &Corners| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
                corners.extend([[a, b, c], [a, c, d]].into_iter().filter(whole));
            }
        }
        Mesh::new(&corners)
    }

    /// A cylinder of length `length` with half-balls of `radius` at its ends, about z; a sphere at length 0.
    pub fn capsule(radius: f64, length: f64, sides: usize) -> Mesh {
        let quarter = sides / 4;
        let arc = |i: usize| PI / 2.0 * i as f64 / quarter as f64;
        let on_axis = |i: usize, r: f64| if i == 0 { 0.0 } else { r };
        let mut outline: Vec<(f64, f64)> =
            (0..=quarter).map(|i| (on_axis(i, radius * arc(i).sin()), -length / 2.0 - radius * arc(i).cos())).collect();
        let steps = (length / (radius * PI / 2.0 / quarter as f64)).ceil() as usize;
        outline.extend((1..steps).map(|i| (radius, length * (i as f64 / steps as f64 - 0.5))));
        let top =
            (0..=quarter).rev().map(|i| (on_axis(i, radius * arc(i).sin()), length / 2.0 + radius * arc(i).cos()));
        outline.extend(top.skip(usize::from(length == 0.0)));
        Mesh::revolved(&outline, sides)
    }

    /// Number of triangles.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Enclosed volume.
    pub fn volume(&self) -> f64 {
        self.triangles.iter().map(|t| t.corner.dot(t.edge1.cross(t.edge2)) / 6.0).sum()
    }

    /// A triangle's vertices.
    pub fn corners(&self, index: usize) -> Corners {
        let t = &self.triangles[index];
        [t.corner, t.corner + t.edge1, t.corner + t.edge2]
    }

    /// A triangle's area, outward normal and centre.
    pub fn facet(&self, index: usize) -> (f64, DVec3, DVec3) {
        let t = &self.triangles[index];
        (t.edge1.cross(t.edge2).length() / 2.0, t.normal, t.corner + (t.edge1 + t.edge2) / 3.0)
    }

    /// Divides the surface into parts of at most 1 / `count` of its area (but for single triangles), compact and facing
    /// one way: the part of each triangle, and the areas of the parts.
    pub fn parts(&self, count: usize) -> (Vec<usize>, Vec<f64>) {
        let mut facing: [Vec<usize>; 6] = Default::default();
        for index in 0..self.len() {
            let normal = self.triangles[index].normal;
            let axis = normal.abs().max_position();
            facing[2 * axis + usize::from(normal[axis] > 0.0)].push(index);
        }
        let area = |group: &[usize]| group.iter().map(|&index| self.facet(index).0).sum::<f64>();
        let mut waiting: Vec<Vec<usize>> = facing.into_iter().filter(|group| !group.is_empty()).collect();
        let (mut part, mut areas) = (vec![0; self.len()], Vec::new());
        while let Some(mut group) = waiting.pop() {
            let whole = area(&group);
            if group.len() == 1 || whole <= self.area() / count as f64 * (1.0 + 1e-9) {
                group.iter().for_each(|&index| part[index] = areas.len());
                areas.push(whole);
                continue;
            }
            let centre = |index: usize| self.facet(index).2;
            let low = group.iter().fold(DVec3::INFINITY, |low, &index| low.min(centre(index)));
            let high = group.iter().fold(DVec3::NEG_INFINITY, |high, &index| high.max(centre(index)));
            let axis = (high - low).max_position();
            group.sort_by(|&a, &b| centre(a)[axis].total_cmp(&centre(b)[axis]));
            let mut sum = 0.0;
            let half = group.iter().position(|&index| {
                sum += self.facet(index).0;
                sum >= whole / 2.0
            });
            let rest = group.split_off((half.unwrap_or(0) + 1).min(group.len() - 1));
            waiting.extend([group, rest]);
        }
        (part, areas)
    }

    /// Calls `hit` with distance and triangle of what the ray meets up to `limit`, in no order; it returns the new limit.
    pub fn visit(&self, origin: DVec3, direction: DVec3, limit: f64, mut hit: impl FnMut(f64, usize) -> f64) {
        let mut nearest = limit;
        self.candidates(origin, direction, limit, |index| {
            if let Some(t) = self.triangles[index].meet(origin, direction).filter(|&t| t <= nearest) {
                nearest = hit(t, index);
            }
            nearest
        });
    }

    /// Calls `found` with every triangle that the ray may meet up to `limit`, in no order; it returns the new limit.
    pub fn candidates(&self, origin: DVec3, direction: DVec3, limit: f64, mut found: impl FnMut(usize) -> f64) {
        let mut limit = limit;
        let slope = direction.recip();
        let near = |node: &Node| {
            let (a, b) = ((node.low - origin) * slope, (node.high - origin) * slope);
            // Rounding must lose no flat box: max and min drop the NaN of 0 / 0.
            let near = a.x.min(b.x).max(a.y.min(b.y)).max(a.z.min(b.z));
            let far = a.x.max(b.x).min(a.y.max(b.y)).min(a.z.max(b.z));
            (near <= far && far >= 0.0).then_some(near)
        };
        let mut stack = [(0u32, 0f64); 64];
        let mut height = usize::from(near(&self.nodes[0]).is_some_and(|t| t <= limit));
        while height > 0 {
            height -= 1;
            let (index, entry) = stack[height];
            if entry > limit {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.count > 0 {
                for &index in &self.order[node.first as usize..(node.first + node.count) as usize] {
                    limit = found(index as usize);
                }
                continue;
            }
            let children = [0, 1].map(|child| {
                let index = node.first + child;
                near(&self.nodes[index as usize]).filter(|&t| t <= limit).map(|t| (index, t))
            });
            let [a, b] = children;
            // The nearer child is looked at first.
            let nearer_last = if a.is_some_and(|a| b.is_none_or(|b| a.1 <= b.1)) { [b, a] } else { [a, b] };
            for child in nearer_last.into_iter().flatten() {
                stack[height] = child;
                height += 1;
            }
        }
    }

    /// The nearest triangle on the ray; outward or inward faces.
    fn nearest(&self, origin: DVec3, direction: DVec3, limit: f64, leaving: bool) -> Option<(f64, usize)> {
        let (mut best, mut found) = (limit, None);
        self.visit(origin, direction, limit, |t, index| {
            if (self.triangles[index].normal.dot(direction) > 0.0) == leaving && t < best {
                (best, found) = (t, Some((t, index)));
            }
            best
        });
        found
    }

    fn inside_box(&self, point: DVec3) -> bool {
        let Node { low, high, .. } = self.nodes[0];
        point.cmpge(low).all() && point.cmple(high).all()
    }
}

impl Facet {
    /// T. Möller, B. Trumbore, J. Graphics Tools 2 (1997).
    fn meet(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let p = direction.cross(self.edge2);
        let inverse = 1.0 / self.edge1.dot(p);
        let s = origin - self.corner;
        let u = s.dot(p) * inverse;
        if !(0.0..=1.0).contains(&u) {
            return None;
        }
        let q = s.cross(self.edge1);
        let v = direction.dot(q) * inverse;
        let t = self.edge2.dot(q) * inverse;
        (v >= 0.0 && u + v <= 1.0 && t >= 0.0).then_some(t)
    }
}

fn bounds(corners: &[Corners], order: &[u32], first: u32) -> Node {
    let points = || order.iter().flat_map(|&index| corners[index as usize]);
    let low = points().fold(DVec3::INFINITY, DVec3::min);
    let high = points().fold(DVec3::NEG_INFINITY, DVec3::max);
    let margin = DVec3::splat(1e-12 * low.abs().max(high.abs()).max_element());
    Node { low: low - margin, high: high + margin, first, count: 0 }
}

impl Shape for Mesh {
    fn leave(&self, origin: DVec3, direction: DVec3, limit: f64) -> Met {
        match self.nearest(origin, direction, limit, true) {
            Some((distance, place)) => Met::Surface { distance, normal: self.triangles[place].normal, place },
            None if self.inside_box(origin) && self.inside_box(origin + direction * limit) => Met::Nothing,
            None => Met::Outside,
        }
    }
}

impl Body for Mesh {
    fn ball(&self) -> (DVec3, f64) {
        self.ball
    }

    fn enter(&self, origin: DVec3, direction: DVec3) -> Option<Site> {
        let (t, place) = self.nearest(origin, direction, f64::INFINITY, false)?;
        Some(Site { position: origin + t * direction, normal: self.triangles[place].normal, place })
    }

    fn area(&self) -> f64 {
        *self.areas.last().expect("a mesh has triangles")
    }

    fn sample(&self, random: &mut Random) -> Site {
        let at = random.next() * self.area();
        let place = self.areas.partition_point(|&sum| sum <= at).min(self.len() - 1);
        let t = &self.triangles[place];
        let (mut u, mut v) = (random.next(), random.next());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        Site { position: t.corner + u * t.edge1 + v * t.edge2, normal: t.normal, place }
    }

    fn meetings(&self, origin: DVec3, direction: DVec3, sites: &mut Vec<Site>) {
        // A ray that starts outside of the mesh.
        let back = (origin - self.ball.0).dot(direction) + 2.0 * self.ball.1;
        let start = origin - back * direction;
        self.visit(start, direction, f64::INFINITY, |t, place| {
            sites.push(Site { position: start + t * direction, normal: self.triangles[place].normal, place });
            f64::INFINITY
        });
    }
}
