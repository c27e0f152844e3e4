//! Which surfaces exchange light, and on which side of them their matter is.
//!
//! # Sets
//! Triangles of materials or nodes that name the same set (`extras.bssrdf.set`) are one set. Of the others, the triangles
//! of one material on one node are, together with those of the same material on other nodes wherever their *borders*
//! meet: a border is made of the edges with one triangle. So the parts of an object that was cut along seams are one set,
//! and closed objects stay apart even where they touch.
//!
//! # Winding
//! Within a set, triangles that share an edge with exactly one other are wound alike: where some are not, the fewer are
//! turned. A closed part whose volume is then negative is turned as a whole, unless it lies in the box of another closed
//! part, where it may bound a cavity. Parts that cannot be wound alike (a Moebius strip) stay as they are.
//!
//! All of it takes n log n time, but for the comparison of the boxes of parts that are inside out with all others.

use super::mesh::Triangle;
use super::{Material, Set};
use crate::{Error, Result};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// Vertices of borders count as one if they are closer than this share of the size of what their material covers on its
/// largest node; farther than ten times that, they never do.
const WELD: f64 = 1e-6;
/// Share of a volume's terms below which it is the rounding of a flat shape.
const FLAT: f64 = 1e-6;

/// The triangles of one material on one node.
pub(super) struct Group {
    pub node: String,
    pub material: usize,
    /// The set that the node or the material names.
    pub set: Option<String>,
}

/// Numbers the sets, gives each triangle (whose `set` is the index of its group) its own, turns triangles that are wound
/// against their neighbours, and drops those that lie twice in a set; `positions` are those of the triangles' vertices.
///
/// # Errors
/// If matter of different indices of refraction is in one set.
pub(super) fn resolve(
    file: &Path,
    triangles: &mut Vec<Triangle>,
    positions: &[DVec3],
    groups: &[Group],
    materials: &[Material],
    warnings: &mut Vec<String>,
) -> Result<Vec<Set>> {
    let translucent = |triangle: &Triangle| materials[triangle.material as usize].medium.is_some();
    let mut vertices = Joined::new(positions.len());
    join_equal(triangles.iter().filter(|t| translucent(t)).flat_map(|t| t.vertices), positions, &mut vertices);
    let mut joined = join_groups(triangles, positions, groups, materials, &mut vertices);

    // Sets are numbered in the order in which triangles first show them.
    let mut numbers: HashMap<u32, u32> = HashMap::new();
    let mut members: Vec<Vec<u32>> = Vec::new();
    for triangle in triangles.iter_mut() {
        let group = triangle.set;
        triangle.set = *numbers.entry(joined.root(group)).or_insert_with(|| {
            members.push(Vec::new());
            members.len() as u32 - 1
        });
        let members = &mut members[triangle.set as usize];
        if !members.contains(&group) {
            members.push(group);
        }
    }
    let mut sets = members
        .iter()
        .map(|members| set_of(file, members.iter().map(|&group| &groups[group as usize]).collect(), materials))
        .collect::<Result<Vec<Set>>>()?;

    drop_doubles(triangles, &mut vertices, &translucent, warnings);
    let owned = |triangle: &Triangle| translucent(triangle).then_some(triangle.set);
    let edges = edges(triangles, &mut vertices, owned);
    let mut neighbours = vec![[None; 3]; triangles.len()];
    for run in edges.chunk_by(Edge::same) {
        let set = &mut sets[run[0].owner as usize];
        match run {
            [_] => set.open_edges += 1,
            [a, b] => {
                for (from, to) in [(a, b), (b, a)] {
                    let free = neighbours[from.triangle as usize].iter_mut().find(|place| place.is_none());
                    *free.expect("a triangle has three edges") = Some((to.triangle, a.forward == b.forward));
                }
            }
            _ => set.crowded_edges += 1,
        }
    }
    wind(triangles, &neighbours, &edges, &translucent, warnings);
    Ok(sets)
}

/// Name and materials of a set.
fn set_of(file: &Path, groups: Vec<&Group>, materials: &[Material]) -> Result<Set> {
    let mut used: Vec<usize> = groups.iter().map(|group| group.material).collect();
    used.sort_unstable();
    used.dedup();
    let first = &materials[used[0]];
    let name = match &groups[0].set {
        Some(name) if first.medium.is_some() => name.clone(),
        _ if groups.len() == 1 => format!("{}, {}", groups[0].node, first.name),
        _ => format!("{} and {} more, {}", groups[0].node, groups.len() - 1, first.name),
    };
    if let Some(other) = used.iter().map(|&material| &materials[material]).find(|other| other.ior != first.ior) {
        let of = |material: &Material| format!("{} of \"{}\"", material.ior, material.name);
        let problem = format!(
            "holds the indices of refraction {} and {}: matter of one set must have one (`ior`)",
            of(first),
            of(other)
        );
        return Err(Error::scene(file, format!("set `{}`", super::json::shorten(&name)), problem));
    }
    Ok(Set { name, materials: used, open_edges: 0, crowded_edges: 0 })
}

/// Joins vertices at exactly the same position, as they are where normals or texture coordinates differ.
fn join_equal(vertices: impl Iterator<Item = u32>, positions: &[DVec3], joined: &mut Joined) {
    let mut first: HashMap<[u64; 3], u32> = HashMap::new();
    let mut seen = vec![false; positions.len()];
    for vertex in vertices {
        if !std::mem::replace(&mut seen[vertex as usize], true) {
            // -0 is 0.
            let place = positions[vertex as usize].to_array().map(|x| (x + 0.0).to_bits());
            joined.join(*first.entry(place).or_insert(vertex), vertex);
        }
    }
}

/// Vertices on borders of one material, or of one named set.
#[derive(Default)]
struct Border {
    /// Diagonal of the largest group's box.
    size: f64,
    /// With their groups.
    vertices: Vec<(u32, u32)>,
}

/// Joins groups by name and along borders, and the vertices of those borders.
fn join_groups(
    triangles: &[Triangle],
    positions: &[DVec3],
    groups: &[Group],
    materials: &[Material],
    vertices: &mut Joined,
) -> Joined {
    let mut joined = Joined::new(groups.len());
    let mut named: HashMap<&str, u32> = HashMap::new();
    for (index, group) in groups.iter().enumerate() {
        if let Some(name) = group.set.as_deref().filter(|_| materials[group.material].medium.is_some()) {
            joined.join(*named.entry(name).or_insert(index as u32), index as u32);
        }
    }
    let owned = |triangle: &Triangle| materials[triangle.material as usize].medium.as_ref().map(|_| triangle.set);
    let mut boxes = vec![Bounds::EMPTY; groups.len()];
    for triangle in triangles {
        triangle.vertices.iter().for_each(|&v| boxes[triangle.set as usize].add(positions[v as usize]));
    }
    // Vertices of borders, by material; named groups meet their own set alone.
    let mut borders: HashMap<(usize, Option<&str>), Border> = HashMap::new();
    for run in edges(triangles, vertices, owned).chunk_by(Edge::same) {
        let [edge] = run else { continue };
        let group = &groups[edge.owner as usize];
        // A named set is one surface, whatever its materials.
        let key = (if group.set.is_some() { usize::MAX } else { group.material }, group.set.as_deref());
        let border = borders.entry(key).or_default();
        border.size = border.size.max(boxes[edge.owner as usize].diagonal());
        border.vertices.extend([(edge.low, edge.owner), (edge.high, edge.owner)]);
    }
    for Border { size, vertices: border } in borders.into_values() {
        // (cell) -> the first vertex found there; the cells around a vertex that its tolerance reaches are its own.
        let tolerance = WELD * size;
        let mut cells: HashMap<[i64; 3], (u32, u32)> = HashMap::new();
        for (vertex, group) in border {
            let position = positions[vertex as usize];
            let cell = |position: DVec3| (position / (2.0 * tolerance)).floor().to_array().map(|x| x as i64);
            let (low, high) = (cell(position - tolerance), cell(position + tolerance));
            for corner in 0..8 {
                let near = [0, 1, 2].map(|axis| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] });
                if let Some(&(other, other_group)) = cells.get(&near) {
                    vertices.join(other, vertex);
                    joined.join(other_group, group);
                }
            }
            cells.entry(cell(position)).or_insert((vertex, group));
        }
    }
    joined
}

/// Drops translucent triangles that lie in the same place as another of their set and are wound as it is: their light
/// would count twice. (One that is wound the other way is the back of a sheet.)
fn drop_doubles(
    triangles: &mut Vec<Triangle>,
    vertices: &mut Joined,
    translucent: &impl Fn(&Triangle) -> bool,
    warnings: &mut Vec<String>,
) {
    let before = triangles.len();
    let mut seen: HashSet<(u32, [u32; 3])> = HashSet::new();
    triangles.retain(|triangle| {
        let mut corners = triangle.vertices.map(|vertex| vertices.root(vertex));
        let first = (0..3).min_by_key(|&i| corners[i]).unwrap_or(0);
        corners.rotate_left(first);
        !translucent(triangle) || seen.insert((triangle.set, corners))
    });
    if triangles.len() < before {
        let dropped = before - triangles.len();
        warnings.push(format!("translucent triangles that lie twice in a set were dropped: {dropped}"));
    }
}

/// An edge of a triangle.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Edge {
    /// Group or set.
    owner: u32,
    low: u32,
    high: u32,
    triangle: u32,
    /// Whether the triangle runs through it from `low` to `high`.
    forward: bool,
}

impl Edge {
    fn same(&self, other: &Edge) -> bool {
        (self.owner, self.low, self.high) == (other.owner, other.low, other.high)
    }
}

/// The edges of all triangles that have an owner, equal ones beside each other.
fn edges(triangles: &[Triangle], vertices: &mut Joined, owner: impl Fn(&Triangle) -> Option<u32>) -> Vec<Edge> {
    let mut edges = Vec::new();
    for (index, triangle) in triangles.iter().enumerate() {
        let Some(owner) = owner(triangle) else { continue };
        let corners = triangle.vertices.map(|vertex| vertices.root(vertex));
        let pairs = [0, 1, 2].map(|i| (corners[i], corners[(i + 1) % 3]));
        // A sliver between joined vertices has nothing between its neighbours.
        if pairs.iter().all(|(a, b)| a != b) {
            let edge = |(a, b): (u32, u32)| Edge {
                owner,
                low: a.min(b),
                high: a.max(b),
                triangle: index as u32,
                forward: a < b,
            };
            edges.extend(pairs.map(edge));
        }
    }
    edges.par_sort_unstable();
    edges
}

/// Up to three neighbours of a triangle, and whether they run through the common edge in the same direction.
type Neighbours = [Option<(u32, bool)>; 3];

/// Triangles that hang together by edges of two.
struct Part {
    set: u32,
    triangles: Vec<u32>,
    bounds: Bounds,
    /// Six times the volume, as wound; of a part that is not closed, nothing.
    volume: Option<f64>,
}

fn wind(
    triangles: &mut [Triangle],
    neighbours: &[Neighbours],
    edges: &[Edge],
    translucent: &impl Fn(&Triangle) -> bool,
    warnings: &mut Vec<String>,
) {
    let mut closed = vec![true; triangles.len()];
    for run in edges.chunk_by(Edge::same).filter(|run| run.len() != 2) {
        run.iter().for_each(|edge| closed[edge.triangle as usize] = false);
    }
    let mut twisted = 0;
    let mut parts: Vec<Part> = Vec::new();
    let mut against: Vec<Option<bool>> = vec![None; triangles.len()];
    for start in 0..triangles.len() {
        if against[start].is_some() || !translucent(&triangles[start]) {
            continue;
        }
        against[start] = Some(false);
        let mut part = vec![start as u32];
        let mut possible = true;
        let mut next = 0;
        while let Some(&triangle) = part.get(next) {
            next += 1;
            let own = against[triangle as usize].unwrap_or(false);
            for &(other, same) in neighbours[triangle as usize].iter().flatten() {
                match against[other as usize] {
                    Some(known) => possible &= known == (own != same),
                    None => {
                        against[other as usize] = Some(own != same);
                        part.push(other);
                    }
                }
            }
        }
        if !possible {
            twisted += part.len();
            continue;
        }
        let count = part.iter().filter(|&&t| against[t as usize] == Some(true)).count();
        let fewer = 2 * count <= part.len();
        for &triangle in part.iter().filter(|&&t| against[t as usize] == Some(fewer)) {
            triangles[triangle as usize].turn();
        }
        parts.push(measure(triangles, part, &closed));
    }

    // Only what lies in the box of a closed part that is wound outward can bound a cavity.
    let outward: Vec<&Part> = parts.iter().filter(|part| part.volume.is_some_and(|volume| volume > 0.0)).collect();
    for part in parts.iter().filter(|part| part.volume.is_some_and(|volume| volume < 0.0)) {
        if !outward.iter().any(|outer| outer.set == part.set && outer.bounds.contains(&part.bounds)) {
            part.triangles.iter().for_each(|&triangle| triangles[triangle as usize].turn());
        }
    }
    let turned = triangles.iter().filter(|triangle| triangle.turned).count();
    if turned > 0 {
        warnings.push(format!(
            "translucent triangles wound against their neighbours, or inside out, were turned: {turned}"
        ));
    }
    if twisted > 0 {
        warnings.push(format!(
            "translucent triangles on surfaces with only one side, where no winding says where the matter is: {twisted}"
        ));
    }
}

/// A part's box and volume.
fn measure(triangles: &[Triangle], part: Vec<u32>, closed: &[bool]) -> Part {
    let mut bounds = Bounds::EMPTY;
    let Triangle { corner: origin, set, .. } = triangles[part[0] as usize];
    let (mut volume, mut size) = (0.0, 0.0);
    for &index in &part {
        let Triangle { corner, edge1, edge2, .. } = triangles[index as usize];
        [corner, corner + edge1, corner + edge2].iter().for_each(|&vertex| bounds.add(vertex));
        let term = (corner - origin).dot(edge1.cross(edge2));
        volume += term;
        size += term.abs();
    }
    let is_closed = part.iter().all(|&triangle| closed[triangle as usize]) && volume.abs() > FLAT * size;
    Part { set, triangles: part, bounds, volume: is_closed.then_some(volume) }
}

#[derive(Clone, Copy)]
struct Bounds {
    low: DVec3,
    high: DVec3,
}

impl Bounds {
    const EMPTY: Bounds = Bounds { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    fn add(&mut self, point: DVec3) {
        self.low = self.low.min(point);
        self.high = self.high.max(point);
    }

    fn diagonal(&self) -> f64 {
        (self.high - self.low).length()
    }

    fn contains(&self, other: &Bounds) -> bool {
        self.low.cmple(other.low).all() && self.high.cmpge(other.high).all()
    }
}

/// Disjoint sets of numbers (R. E. Tarjan, J. ACM 22 (1975)); the smallest number stands for its set.
struct Joined(Vec<u32>);

impl Joined {
    fn new(count: usize) -> Joined {
        Joined((0..count as u32).collect())
    }

    fn root(&mut self, mut number: u32) -> u32 {
        while self.0[number as usize] != number {
            let parent = self.0[number as usize];
            self.0[number as usize] = self.0[parent as usize];
            number = parent;
        }
        number
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}
