//! The BVH: every triangle in exactly one leaf, every box around its triangles, decoded from the words kernels read.

use crate::build::{Numbers, load, with_bytes};
use glam::DVec3;
use translucent::{Scene, shared::BVH_DEPTH};

/// One node, decoded in f64 from its 80 bytes.
struct Node {
    origin: DVec3,
    step: DVec3,
    inner: u8,
    first_child: u32,
    first_triangle: u32,
    meta: [u8; 8],
    low: [[u8; 8]; 3],
    high: [[u8; 8]; 3],
}

fn decode(scene: &Scene, index: u32) -> Node {
    let words = &scene.nodes[index as usize * 5..index as usize * 5 + 5];
    let bytes: &[u8; 80] = bytemuck::cast_slice::<_, u8>(words).try_into().expect("five words are 80 bytes");
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"));
    let eight = |at: usize| -> [u8; 8] { bytes[at..at + 8].try_into().expect("eight bytes") };
    let origin = |at: usize| f32::from_bits(word(at)) as f64;
    let step = |at: usize| f32::from_bits((bytes[at] as u32) << 23) as f64;
    Node {
        origin: DVec3::new(origin(0), origin(4), origin(8)),
        step: DVec3::new(step(12), step(13), step(14)),
        inner: bytes[15],
        first_child: word(16),
        first_triangle: word(20),
        meta: eight(24),
        low: [eight(32), eight(48), eight(64)],
        high: [eight(40), eight(56), eight(72)],
    }
}

impl Node {
    fn boxed(&self, child: usize) -> Box {
        let at = |planes: &[[u8; 8]; 3]| {
            self.origin
                + self.step * DVec3::new(planes[0][child] as f64, planes[1][child] as f64, planes[2][child] as f64)
        };
        (at(&self.low), at(&self.high))
    }
}

/// The lowest and the highest corner of a box.
type Box = (DVec3, DVec3);

/// Visits all leaves and checks what they hold; returns the depth.
pub fn check(scene: &Scene) -> usize {
    let mut met = vec![0; scene.triangles.len()];
    let mut deepest = 0;
    // Node, level, and the boxes on the way to it, all of which must hold its triangles.
    let mut waiting: Vec<(u32, usize, Vec<Box>)> = vec![(0, 1, Vec::new())];
    let mut visited = 0;
    while let Some((index, level, boxes)) = waiting.pop() {
        visited += 1;
        deepest = deepest.max(level);
        let node = decode(scene, index);
        let mut inner_before = 0;
        for child in 0..8 {
            if node.meta[child] == 0 {
                continue;
            }
            let mut boxes = boxes.clone();
            boxes.push(node.boxed(child));
            if node.inner >> child & 1 == 1 {
                assert_eq!(node.meta[child], 0b0010_0000 | (24 + child as u8), "an inner child names its slot");
                waiting.push((node.first_child + inner_before, level + 1, boxes));
                inner_before += 1;
                continue;
            }
            let count = (node.meta[child] >> 5).count_ones();
            assert!([1, 3, 7].contains(&(node.meta[child] >> 5)), "the count of a leaf is unary");
            let first = node.first_triangle + (node.meta[child] & 31) as u32;
            for triangle in first..first + count {
                met[triangle as usize] += 1;
                for vertex in scene.triangles[triangle as usize].vertices.map(|vertex| vertex.as_dvec3()) {
                    for (low, high) in &boxes {
                        assert!(vertex.cmpge(*low).all() && vertex.cmple(*high).all(), "{vertex} in {low} to {high}");
                    }
                }
            }
        }
    }
    assert_eq!(visited * 5, scene.nodes.len(), "every node is reached once");
    assert!(met.iter().all(|&count| count == 1), "every triangle is in exactly one leaf");
    assert!(deepest <= BVH_DEPTH as usize);
    deepest
}

#[test]
fn spot() {
    let scene = Scene::load("assets/spot.glb").expect("the shipped scene loads");
    assert_eq!(scene.triangles.len(), 5856);
    assert!(check(&scene) < 10, "5856 triangles need log8(5856 / 3) = 4 levels at best");
}

#[test]
fn one_triangle() {
    let scene = load(&with_bytes(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]], &[0, 1, 2]));
    assert_eq!(check(&scene), 1);
}

#[test]
fn flat_along_each_axis() {
    for axis in 0..3 {
        let mut numbers = Numbers(axis as u64);
        let mut positions: Vec<[f32; 3]> = (0..600).map(|_| [0; 3].map(|_| numbers.signed() as f32)).collect();
        positions.iter_mut().for_each(|position| position[axis] = 0.75);
        check(&load(&with_bytes(&positions, &(0..600).collect::<Vec<_>>())));
    }
}

#[test]
fn sizes_that_span_many_decades() {
    let mut numbers = Numbers(7);
    let mut positions = Vec::new();
    for triangle in 0..300 {
        let size = 10f64.powf(-6.0 * (triangle % 60) as f64 / 60.0);
        let place = [0; 3].map(|_| numbers.signed());
        for _ in 0..3 {
            positions.push(place.map(|place| (place + size * numbers.signed()) as f32));
        }
    }
    check(&load(&with_bytes(&positions, &(0..900).collect::<Vec<_>>())));
}

#[test]
fn many_copies_of_one_triangle() {
    let indices: Vec<u16> = (0..3000).map(|index| index % 3).collect();
    check(&load(&with_bytes(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]], &indices)));
}

#[test]
fn concentric_triangles() {
    // Of the same centre, each 1 % larger: the worst case of a builder that merges neighbours.
    let mut positions = Vec::new();
    for triangle in 0..2000 {
        let size = 1.01f32.powi(triangle);
        positions.extend([[size, 0.0, 0.0], [-size, size, 0.0], [0.0, -size, 0.0]]);
    }
    check(&load(&with_bytes(&positions, &(0..6000).collect::<Vec<_>>())));
}
