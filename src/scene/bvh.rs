//! The compressed wide BVH (Ylitie, Karras, Laine 2017): a binary tree of ours, made wide by obvhs.
//!
//! obvhs' own binary builder takes quadratic time and linear depth where many boxes share a centre, and its conversion
//! recurses, so a small file could overflow the stack; the builder here is bounded in both.

use crate::{
    Error, Result,
    shared::{self, BVH_DEPTH},
};
use glam::{UVec4, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::cwbvh::node::CwBvhNode;
use std::path::Path;

/// Triangles of a leaf: three bits of a child's description count them.
const LEAF_TRIANGLES: u32 = 3;
/// Levels of the binary tree that are split by cost; deeper ones are halved.
const COSTED_LEVELS: u32 = 48;
/// Places between which a split is looked for on each axis.
const BINS: usize = 16;
/// Boxes grow by this share of their largest coordinate (at least of 1): more than the f32 rounding of a ray against
/// a box, so that no ray slips between two boxes that touch.
const PADDING: f32 = 1.0 / (1 << 20) as f32;

/// The nodes, five words each, and the order of the leaves: `order[i]` is the triangle that belongs at place i.
///
/// No triangle is split, so each is in exactly one leaf.
pub(super) fn build(file: &Path, triangles: &[shared::Triangle]) -> Result<(Vec<UVec4>, Vec<u32>)> {
    let boxes: Vec<Aabb> = triangles.iter().map(|triangle| bounds(triangle.vertices.map(Vec3A::from))).collect();
    let wide = bvh2_to_cwbvh(&binary(&boxes), LEAF_TRIANGLES, true, false);
    let depth = depth(&wide);
    if depth > BVH_DEPTH as usize {
        return Err(Error::scene(file, "scene", format!("its BVH is {depth} levels deep; {BVH_DEPTH} at most")));
    }
    let words: &[UVec4] = bytemuck::cast_slice(bytemuck::cast_slice::<CwBvhNode, u32>(&wide.nodes));
    Ok((words.to_vec(), wide.primitive_indices))
}

/// The box of a triangle, padded.
pub(crate) fn bounds([a, b, c]: [Vec3A; 3]) -> Aabb {
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    let padding = Vec3A::splat(PADDING * low.abs().max(high.abs()).max_element().max(1.0));
    Aabb::new(low - padding, high + padding)
}

/// A binary tree with one box a leaf: split by the surface area heuristic over bins, and in halves below
/// COSTED_LEVELS and where all centres coincide.
pub(crate) fn binary(boxes: &[Aabb]) -> Bvh2 {
    let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
    let mut nodes = Vec::with_capacity(2 * boxes.len());
    nodes.push(Bvh2Node::default());
    let mut waiting = vec![(0usize, 0usize, boxes.len(), 0u32)];
    while let Some((node, begin, end, level)) = waiting.pop() {
        let part = &mut order[begin..end];
        let whole = part.iter().fold(Aabb::empty(), |whole, &index| whole.union(&boxes[index as usize]));
        if part.len() == 1 {
            nodes[node] = Bvh2Node::new(whole, 1, begin as u32);
            continue;
        }
        let centres = part.iter().fold(Aabb::empty(), |centres, &index| {
            let centre = boxes[index as usize].center();
            centres.union(&Aabb::from_point(centre))
        });
        let split = if level < COSTED_LEVELS { costed_split(part, boxes, &centres) } else { None };
        let middle = split.unwrap_or_else(|| halve(part, boxes, &centres));
        let first = nodes.len();
        nodes[node] = Bvh2Node::new(whole, 0, first as u32);
        nodes.extend([Bvh2Node::default(); 2]);
        waiting.push((first, begin, begin + middle, level + 1));
        waiting.push((first + 1, begin + middle, end, level + 1));
    }
    Bvh2 { nodes, primitive_indices: order, ..Bvh2::default() }
}

/// Orders `part` so that its first `n` boxes are one side of the cheapest split, and returns n; none if all centres
/// fall into one bin.
fn costed_split(part: &mut [u32], boxes: &[Aabb], centres: &Aabb) -> Option<usize> {
    let extent = centres.diagonal();
    let bin = |index: u32, axis: usize| {
        let place = (boxes[index as usize].center()[axis] - centres.min[axis]) / extent[axis];
        ((place * BINS as f32) as usize).min(BINS - 1)
    };
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|&axis| extent[axis] > 0.0) {
        let mut bins = [(Aabb::empty(), 0u32); BINS];
        for &index in part.iter() {
            let bin = &mut bins[bin(index, axis)];
            *bin = (bin.0.union(&boxes[index as usize]), bin.1 + 1);
        }
        // Cost of everything from a bin on, then of everything before it.
        let cost = |(whole, count): (Aabb, u32)| if count == 0 { 0.0 } else { whole.half_area() * count as f32 };
        let add = |sum: (Aabb, u32), bin: (Aabb, u32)| (sum.0.union(&bin.0), sum.1 + bin.1);
        let mut right = [0.0; BINS];
        let mut sum = (Aabb::empty(), 0);
        for place in (1..BINS).rev() {
            sum = add(sum, bins[place]);
            right[place] = cost(sum);
        }
        let mut sum = (Aabb::empty(), 0);
        for place in 1..BINS {
            sum = add(sum, bins[place - 1]);
            let total = cost(sum) + right[place];
            let divides = sum.1 > 0 && (sum.1 as usize) < part.len();
            if divides && best.is_none_or(|(least, ..)| total < least) {
                best = Some((total, axis, place));
            }
        }
    }
    let (_, axis, place) = best?;
    part.sort_by_key(|&index| bin(index, axis) >= place);
    Some(part.partition_point(|&index| bin(index, axis) < place))
}

/// Orders `part` along the longest axis of its centres and returns its middle.
fn halve(part: &mut [u32], boxes: &[Aabb], centres: &Aabb) -> usize {
    let extent = centres.diagonal();
    let axis = if extent.x >= extent.y.max(extent.z) { 0 } else { 1 + usize::from(extent.z > extent.y) };
    let middle = part.len() / 2;
    let centre = |index: u32| boxes[index as usize].center()[axis];
    part.select_nth_unstable_by(middle, |&a, &b| centre(a).total_cmp(&centre(b)).then(a.cmp(&b)));
    middle
}

/// Levels of the wide tree.
fn depth(wide: &CwBvh) -> usize {
    let mut deepest = 0;
    let mut waiting = vec![(0u32, 1)];
    while let Some((index, level)) = waiting.pop() {
        deepest = deepest.max(level);
        let node = &wide.nodes[index as usize];
        let inner = (0..8).filter(|&child| !node.is_leaf(child) && !node.is_child_empty(child));
        waiting.extend(inner.map(|child| (node.child_node_index(child), level + 1)));
    }
    deepest
}
