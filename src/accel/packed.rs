//! Trees for the GPU: eight children a node in 80 bytes, their boxes quantised to bytes, up to three triangles a leaf
//! (Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", 2017). What is
//! packed here is the shape; boxes and corners are fitted on the device, after a build as after a move of vertices.
//!
//! A child's planes are origin + byte · 2^exponent as real numbers, never rounded to f32, and lie outside the child's box
//! or on it. Who traces widens what it computes from them by its own roundings, so that a box is entered not after
//! anything inside it.

use super::binary::{Binary, Quality};
use super::collapse::{Leaves, Shape};
use super::fit::half_area;
use super::lanes::per_axis;
use super::slab::Aabb;
use super::tree::{LEAF, NO_CHILD, NO_TRIANGLE, WIDTH};
use bytemuck::{Pod, Zeroable};
use std::ops::Range;

/// Triangles of a leaf at most.
const LEAF_MOST: usize = 3;
/// Triangles are tested one by one: between 0.3 and 0.5 rays meet about as much, nodes and half the triangles together. Refits
/// are left out: with them trees are deeper, and threads' stacks larger.
const LEAVES: Leaves = Leaves { most: LEAF_MOST, block: 0.0, triangle: 0.4, refit: 0.0 };
/// In [`PackedNode::meta`] of an inner child, beside its slot: one bit of a count, 24 and more of a place.
const INNER: u8 = 0b001_11000;

/// A node as kernels read it: five rows of four words.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct PackedNode {
    /// The least corner of all children, bits of f32.
    pub origin: [u32; 3],
    /// For each axis the exponent of the quantum with f32's bias; in the highest byte which slots have inner children.
    pub exponents: u32,
    /// The first inner child; the others follow in the order of their slots.
    pub child_base: u32,
    /// The first triangle, by its place.
    pub triangle_base: u32,
    /// For each slot `INNER` with the slot, or a leaf: its triangles after the node's first in the lower five bits, one
    /// of the upper three bits for each triangle; 0 where there is nothing.
    pub meta: [[u8; 4]; 2],
    /// By side (lesser, greater), axis, slot.
    pub planes: [[[u8; WIDTH]; 3]; 2],
}

/// The shape of a tree, packed.
#[derive(Clone, Debug, Default)]
pub struct PackedTree {
    /// The root first, each node before its children.
    pub nodes: Vec<PackedNode>,
    /// For each place of a leaf what stands there: a triangle's number.
    pub order: Vec<u32>,
    /// The nodes by height: first those that have leaves only, each after its children.
    pub by_height: Vec<u32>,
    /// Where each height's nodes stand in `by_height`.
    pub heights: Vec<Range<u32>>,
    /// The surface-area cost as [`super::Tree::cost`], of boxes of corners.
    pub cost: f64,
}

impl PackedTree {
    /// Builds over an indexed mesh in the current rayon pool. The same for any number of threads.
    pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]], quality: Quality) -> Self {
        let binary = Binary::build(positions, triangles, quality);
        let shape = Shape::collapse(&binary, LEAVES);
        let boxes = boxes(&shape, |triangle| {
            Aabb::of_points(&triangles[triangle as usize].map(|i| positions[i as usize]))
        });
        let leaf = |block: u32| {
            let triangles = &shape.blocks[block as usize];
            let count = triangles.iter().position(|t| *t == NO_TRIANGLE).unwrap_or(WIDTH);
            &triangles[..count]
        };
        let mut tree = pack(&shape.children, &boxes, leaf);
        let whole = boxes.first().map_or(0.0, |b| half_area(&union(b)));
        let sum: f64 = boxes.as_flattened().iter().map(half_area).sum();
        tree.cost = if whole > 0.0 && sum.is_finite() { sum / whole } else { 0.0 };
        tree
    }

    /// Bytes that it takes on a device: nodes, corners and numbers of triangles, and what a refit needs.
    pub fn device_bytes(&self) -> u64 {
        // before the root stands the box of all
        let nodes = 1 + self.nodes.len() as u64;
        nodes * (NODE_BYTES + 4) + self.order.len() as u64 * (TRIANGLE_BYTES + VERTICES_BYTES)
    }
}

/// Bytes of a node on a device.
pub const NODE_BYTES: u64 = size_of::<PackedNode>() as u64;
/// Bytes of a triangle in a leaf on a device: three rows.
pub const TRIANGLE_BYTES: u64 = 48;
/// Bytes of its vertices' numbers and its own.
pub const VERTICES_BYTES: u64 = 16;

/// The boxes of each node's children; of a wide tree whose nodes stand before their children.
fn boxes(shape: &Shape, of_triangle: impl Fn(u32) -> Aabb) -> Vec<[Aabb; WIDTH]> {
    let mut boxes = vec![[Aabb::EMPTY; WIDTH]; shape.children.len()];
    for node in (0..shape.children.len()).rev() {
        boxes[node] = shape.children[node].map(|child| {
            if child == NO_CHILD {
                Aabb::EMPTY
            } else if child & LEAF != 0 {
                let triangles = shape.blocks[(child & !LEAF) as usize].iter().filter(|t| **t != NO_TRIANGLE);
                triangles.fold(Aabb::EMPTY, |all, &t| all.union(&of_triangle(t)))
            } else {
                union(&boxes[child as usize])
            }
        });
    }
    boxes
}

fn union(boxes: &[Aabb]) -> Aabb {
    boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(b))
}

/// Packs nodes of which `boxes` are the children's. Planes are left to a fit.
pub(crate) fn pack<'a>(
    children: &[[u32; WIDTH]],
    boxes: &[[Aabb; WIDTH]],
    leaf: impl Fn(u32) -> &'a [u32],
) -> PackedTree {
    let mut tree = PackedTree::default();
    if children.is_empty() {
        return tree;
    }
    tree.nodes.reserve(children.len());
    // the old number of each node in its new order
    let mut from = Vec::with_capacity(children.len());
    from.push(0_u32);
    let mut next = 0;
    while next < from.len() {
        let old = from[next] as usize;
        let mut node = PackedNode {
            child_base: from.len() as u32,
            triangle_base: tree.order.len() as u32,
            ..PackedNode::default()
        };
        let mut inner = 0_u32;
        for (slot, lane) in slots(&children[old], &boxes[old]).into_iter().enumerate() {
            let Some(lane) = lane else { continue };
            let child = children[old][lane];
            let meta = &mut node.meta[slot / 4][slot % 4];
            if child & LEAF != 0 {
                let triangles = leaf(child & !LEAF);
                let offset = tree.order.len() as u32 - node.triangle_base;
                *meta = (((1 << triangles.len()) - 1) << 5 | offset) as u8;
                tree.order.extend_from_slice(triangles);
            } else {
                *meta = INNER | slot as u8;
                inner |= 1 << slot;
                from.push(child);
            }
        }
        node.exponents = inner << 24;
        tree.nodes.push(node);
        next += 1;
    }
    by_height(&mut tree);
    tree
}

/// Fits packed nodes from below; `leaf` gives the box of what stands at a place.
pub(crate) fn fit(nodes: &mut [PackedNode], leaf: impl Fn(u32) -> Aabb) {
    let mut whole = vec![Aabb::EMPTY; nodes.len()];
    for i in (0..nodes.len()).rev() {
        let node = &mut nodes[i];
        let inner = node.exponents >> 24;
        let mut boxes = [Aabb::EMPTY; WIDTH];
        for (slot, b) in boxes.iter_mut().enumerate() {
            let meta = node.meta[slot / 4][slot % 4];
            if inner >> slot & 1 != 0 {
                *b = whole[(node.child_base + (inner & ((1 << slot) - 1)).count_ones()) as usize];
            } else {
                let first = node.triangle_base + u32::from(meta & 31);
                *b = (first..first + (meta >> 5).count_ones()).fold(*b, |all, place| all.union(&leaf(place)));
            }
        }
        node.fit(&boxes);
        whole[i] = union(&boxes);
    }
}

/// For each slot the child that stands there, by its lane. A slot is a corner of the node's box; each child stands in the
/// corner that it lies most towards, as far as that is free, so that the order of the slots, turned by the signs of a
/// ray's direction, is about that in which the ray meets the children (Ylitie et al., section 3.2, chosen greedily).
fn slots(children: &[u32; WIDTH], boxes: &[Aabb; WIDTH]) -> [Option<usize>; WIDTH] {
    let middle = |b: &Aabb| per_axis(|k| 0.5 * b.min[k] + 0.5 * b.max[k]);
    let whole = middle(&union(boxes));
    let mut pairs = Vec::with_capacity(WIDTH * WIDTH);
    for lane in (0..WIDTH).filter(|&lane| children[lane] != NO_CHILD) {
        let from_middle = per_axis(|k| middle(&boxes[lane])[k] - whole[k]);
        for slot in 0..WIDTH {
            let towards: f32 =
                (0..3).map(|k| if slot >> k & 1 != 0 { from_middle[k] } else { -from_middle[k] }).sum();
            pairs.push((towards, lane, slot));
        }
    }
    // a stable sort: ties have one order
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut slots = [None; WIDTH];
    let mut is_placed = [false; WIDTH];
    for (_, lane, slot) in pairs {
        if slots[slot].is_none() && !is_placed[lane] {
            slots[slot] = Some(lane);
            is_placed[lane] = true;
        }
    }
    slots
}

/// Sorts nodes by their height.
fn by_height(tree: &mut PackedTree) {
    let mut height = vec![0_u32; tree.nodes.len()];
    let mut counts = Vec::new();
    for (i, node) in tree.nodes.iter().enumerate().rev() {
        let inner = (node.exponents >> 24).count_ones();
        let below = node.child_base..node.child_base + inner;
        height[i] = below.map(|child| height[child as usize] + 1).max().unwrap_or(0);
        let h = height[i] as usize;
        counts.resize(counts.len().max(h + 1), 0_u32);
        counts[h] += 1;
    }
    let mut end = 0;
    let mut next = Vec::with_capacity(counts.len());
    for count in counts {
        next.push(end);
        tree.heights.push(end..end + count);
        end += count;
    }
    tree.by_height = vec![0; tree.nodes.len()];
    for (i, h) in height.into_iter().enumerate() {
        let place = &mut next[h as usize];
        tree.by_height[*place as usize] = i as u32;
        *place += 1;
    }
}

impl PackedNode {
    /// Quantises the boxes of children by their slots; an empty one is that of a slot without a child. The twin of what
    /// refits do on a device.
    pub fn fit(&mut self, boxes: &[Aabb; WIDTH]) {
        let whole = union(boxes);
        self.planes = [[[0; WIDTH]; 3]; 2];
        self.exponents &= 0xff00_0000;
        // nothing is beyond the largest float
        let most = |x: f32| x.clamp(-f32::MAX, f32::MAX);
        for k in 0..3 {
            let origin = if whole.is_empty() { 0.0 } else { most(whole.min[k]) };
            self.origin[k] = origin.to_bits();
            let from_origin = |x: f32| f64::from(most(x)) - f64::from(origin);
            let extent = if whole.is_empty() { 0.0 } else { from_origin(whole.max[k]) };
            let exponent = least_exponent(extent);
            self.exponents |= ((exponent + 127) as u32) << (8 * k);
            let quantum = f64::from(exponent).exp2();
            for (slot, b) in boxes.iter().enumerate().filter(|(_, b)| !b.is_empty()) {
                self.planes[0][k][slot] = (from_origin(b.min[k]) / quantum).floor() as u8;
                self.planes[1][k][slot] = (from_origin(b.max[k]) / quantum).ceil() as u8;
            }
        }
    }

    /// The box of a slot's planes, in f64, where they are exact.
    pub fn child_box(&self, slot: usize) -> [[f64; 3]; 2] {
        [0, 1].map(|side| {
            [0, 1, 2].map(|k| {
                let quantum = f64::from(f32::from_bits((self.exponents >> (8 * k) & 0xff) << 23));
                f64::from(f32::from_bits(self.origin[k])) + f64::from(self.planes[side][k][slot]) * quantum
            })
        })
    }
}

/// The least exponent with which 255 quanta reach as far; -126 at least, where quanta are normal floats.
fn least_exponent(extent: f64) -> i32 {
    let mut exponent = ((extent / 255.0).log2().ceil() as i32).max(-126);
    // log2 may be rounded
    while 255.0 * f64::from(exponent).exp2() < extent {
        exponent += 1;
    }
    exponent
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(n: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let positions = (0..3 * n).map(|i| [i * 37 % 101, i * 53 % 103, i % 97].map(|x| x as f32)).collect();
        (positions, (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
    }

    /// Each triangle stands in one leaf, each node but the root has one parent and stands after it, and heights are above
    /// those of children.
    #[test]
    fn a_packed_tree_holds_each_triangle_once() {
        for n in [0, 1, 2, 3, 4, 25, 1000] {
            let (positions, triangles) = mesh(n);
            let tree = PackedTree::build(&positions, &triangles, Quality::Fastest);
            let mut sorted = tree.order.clone();
            sorted.sort_unstable();
            assert!(sorted.into_iter().eq(0..n), "{n}");
            let mut parents = vec![0; tree.nodes.len()];
            let mut places = vec![0; n as usize];
            for (i, node) in tree.nodes.iter().enumerate() {
                let inner = node.exponents >> 24;
                for child in node.child_base..node.child_base + inner.count_ones() {
                    assert!(child as usize > i);
                    parents[child as usize] += 1;
                }
                for (slot, &meta) in node.meta.as_flattened().iter().enumerate() {
                    if inner >> slot & 1 != 0 {
                        assert_eq!(meta, INNER | slot as u8);
                    } else {
                        let first = node.triangle_base + u32::from(meta & 31);
                        for place in first..first + (meta >> 5).count_ones() {
                            places[place as usize] += 1;
                        }
                    }
                }
            }
            assert!(parents.iter().skip(1).all(|&p| p == 1) && places.iter().all(|&p| p == 1), "{n}");
            let mut all: Vec<u32> = tree
                .heights
                .iter()
                .flat_map(|h| &tree.by_height[h.start as usize..h.end as usize])
                .copied()
                .collect();
            all.sort_unstable();
            assert!(all.into_iter().eq(0..tree.nodes.len() as u32));
        }
    }

    /// Whatever the size, the place and the ratio of both.
    #[test]
    fn planes_lie_outside_the_boxes() {
        for (size, place) in [
            (1.0_f32, 0.0_f32),
            (1e-30, 0.0),
            (1e30, -1e30),
            (1e-3, 1e6),
            (3e38, -3e38),
            (0.0, 5.0),
            (1e-44, 0.0),
        ] {
            let mut n = 0.0_f64;
            let mut next = || {
                n += 1.0;
                (n * 0.618_033_988_749_894_9).fract() as f32
            };
            let boxes = [(); WIDTH].map(|()| {
                let a = per_axis(|_| place + size * next());
                let b = per_axis(|_| place + size * next());
                Aabb::of_points(&[a, b])
            });
            let mut node = PackedNode::default();
            node.fit(&boxes);
            for (slot, b) in boxes.iter().enumerate() {
                let [min, max] = node.child_box(slot);
                for k in 0..3 {
                    assert!(min[k] <= f64::from(b.min[k]) && max[k] >= f64::from(b.max[k]), "{size} {place}");
                }
            }
        }
    }
}
