//! Collapses a binary tree into the shape of a wide one: which nodes there are, and which triangles each leaf has.

use super::binary::Binary;
use super::tree::{LEAF, MAX_DEPTH, NO_CHILD, NO_TRIANGLE, WIDTH};
use rayon::prelude::*;
use std::ops::Range;

/// From this level on a subtree is split by number, not as the binary tree says: ten levels hold 8¹⁰ leaves, more
/// than there are numbers for.
const SPLIT_BY_NUMBER_LEVEL: usize = MAX_DEPTH - 10;

/// What leaves may be, and what they cost beside nodes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Leaves {
    /// Triangles of a leaf at most; [`WIDTH`] at most.
    pub(crate) most: usize,
    /// A leaf costs this,
    pub(crate) block: f32,
    /// and each of its triangles this; a node costs about 4.
    pub(crate) triangle: f32,
    /// Whether they are split as long as their node has room: where each triangle is tested by itself, boxes that are tested
    /// anyway keep rays from it.
    pub(crate) fill: bool,
}

impl Leaves {
    /// Of trees whose leaves' triangles are tested all at once.
    pub(crate) const BLOCKS: Self = Self { most: WIDTH, block: 1.0, triangle: 0.0, fill: false };
}

/// The shape of a wide tree.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shape {
    /// The children of each node; the root first, level by level.
    pub(crate) children: Vec<[u32; WIDTH]>,
    /// The nodes of each level.
    pub(crate) levels: Vec<Range<usize>>,
    /// The triangles of each leaf.
    pub(crate) blocks: Vec<[u32; WIDTH]>,
}

/// A subtree that becomes a child.
#[derive(Clone, Copy, Debug)]
struct Subtree {
    /// Its root in the binary tree; None where its triangles are split by number.
    node: Option<u32>,
    start: u32,
    count: u32,
    is_leaf: bool,
}

impl Shape {
    pub(crate) fn collapse(binary: &Binary, leaves: Leaves) -> Self {
        let mut shape = Self::default();
        if binary.nodes.is_empty() {
            return shape;
        }
        let is_leaf = is_leaf(binary, leaves);
        let subtree = |node: u32| {
            let n = &binary.nodes[node as usize];
            Subtree { node: Some(node), start: n.start, count: n.count, is_leaf: is_leaf[node as usize] }
        };
        let mut level = vec![subtree(0)];
        while !level.is_empty() {
            if shape.levels.len() == SPLIT_BY_NUMBER_LEVEL {
                for s in &mut level {
                    s.node = None;
                }
            }
            let expanded: Vec<([Subtree; WIDTH], usize)> =
                level.par_iter().with_min_len(256).map(|s| expand(*s, binary, leaves, &subtree)).collect();
            let first = shape.children.len();
            shape.levels.push(first..first + level.len());
            let mut next_node = first + level.len();
            level.clear();
            for (subtrees, count) in expanded {
                let mut children = [NO_CHILD; WIDTH];
                for (child, s) in children.iter_mut().zip(&subtrees[..count]) {
                    if s.is_leaf {
                        *child = LEAF | shape.blocks.len() as u32;
                        let mut triangles = [NO_TRIANGLE; WIDTH];
                        let order = &binary.order[s.start as usize..][..s.count as usize];
                        triangles[..order.len()].copy_from_slice(order);
                        shape.blocks.push(triangles);
                    } else {
                        *child = next_node as u32;
                        next_node += 1;
                        level.push(*s);
                    }
                }
                shape.children.push(children);
            }
        }
        shape
    }
}

/// Which binary nodes become leaves: where one test of a block costs less than what is below, by surface area
/// (Goldsmith and Salmon 1987). A binary node costs a share of the wide node that it dissolves in.
fn is_leaf(binary: &Binary, leaves: Leaves) -> Vec<bool> {
    const NODE_COST: f32 = 0.5;
    let mut is_leaf = vec![false; binary.nodes.len()];
    let mut cost = vec![0.0_f32; binary.nodes.len()];
    for (i, n) in binary.nodes.iter().enumerate().rev() {
        let as_block = (leaves.block + leaves.triangle * n.count as f32) * n.half_area;
        let child = n.child as usize;
        let as_inner =
            if child == 0 { f32::INFINITY } else { NODE_COST * n.half_area + cost[child] + cost[child + 1] };
        is_leaf[i] = n.count as usize <= leaves.most && as_block <= as_inner;
        cost[i] = if is_leaf[i] { as_block } else { as_inner };
    }
    is_leaf
}

/// The children of a subtree: the one with the largest surface is opened until there are eight.
fn expand(
    s: Subtree,
    binary: &Binary,
    leaves: Leaves,
    subtree: &impl Fn(u32) -> Subtree,
) -> ([Subtree; WIDTH], usize) {
    let Some(root) = s.node else { return split_by_number(s, leaves.most) };
    let mut children = [s; WIDTH];
    let mut count = 1;
    if s.is_leaf && !leaves.fill {
        return (children, count);
    }
    let mut areas = [binary.nodes[root as usize].half_area; WIDTH];
    while count < WIDTH {
        let mut largest = None;
        for i in 0..count {
            let can_open = !children[i].is_leaf || leaves.fill && child_of(&children[i], binary) != 0;
            let rank = |i: usize| (!children[i].is_leaf, areas[i]);
            if can_open && largest.is_none_or(|l: usize| rank(i) > rank(l)) {
                largest = Some(i);
            }
        }
        let Some(open) = largest else { break };
        let child = child_of(&children[open], binary);
        // what is in a leaf stays in leaves
        let was_leaf = children[open].is_leaf;
        for (place, c) in [(open, child), (count, child + 1)] {
            children[place] = subtree(c);
            children[place].is_leaf |= was_leaf;
            areas[place] = binary.nodes[c as usize].half_area;
        }
        count += 1;
    }
    (children, count)
}

/// The first child of a subtree's root in the binary tree; 0 where it has none.
fn child_of(s: &Subtree, binary: &Binary) -> u32 {
    s.node.map_or(0, |node| binary.nodes[node as usize].child)
}

fn split_by_number(s: Subtree, leaf_most: usize) -> ([Subtree; WIDTH], usize) {
    let mut children = [s; WIDTH];
    let size = s.count.div_ceil(WIDTH as u32).max(leaf_most as u32);
    let count = s.count.div_ceil(size);
    for (i, child) in (0..count).zip(&mut children) {
        let start = s.start + i * size;
        let rest = s.start + s.count - start;
        *child = Subtree {
            node: None,
            start,
            count: size.min(rest),
            is_leaf: rest.min(size) as usize <= leaf_most,
        };
    }
    (children, count as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::binary::BinaryNode;

    /// A tree in which each inner node has a leaf and the rest below it.
    fn chain(leaves: u32) -> Binary {
        let nodes = (0..2 * leaves - 1)
            .map(|i| {
                let is_inner = i % 2 == 0 && i < 2 * leaves - 2;
                BinaryNode {
                    half_area: 1.0,
                    child: if is_inner { i + 1 } else { 0 },
                    start: i / 2,
                    count: if is_inner { leaves - i / 2 } else { 1 },
                }
            })
            .collect();
        Binary { nodes, order: (0..leaves).collect() }
    }

    #[test]
    fn leaves_are_split_while_their_node_has_room() {
        // a chain's inner nodes of four triangles and fewer are leaves: five and one of four
        let shape = |fill, leaves| {
            let leaves_may = Leaves { most: 4, block: 0.0, triangle: 0.1, fill };
            Shape::collapse(&chain(leaves), leaves_may)
        };
        let sizes = |shape: &Shape| -> Vec<usize> {
            let count = |b: &[u32; WIDTH]| b.iter().filter(|t| **t != NO_TRIANGLE).count();
            shape.blocks.iter().map(count).collect()
        };
        assert_eq!(sizes(&shape(false, 9)).into_iter().max(), Some(4));
        for (leaves, most) in [(3, 1), (8, 1), (9, 2)] {
            let filled = shape(true, leaves);
            assert_eq!(filled.children.len(), 1, "{leaves}");
            assert_eq!(sizes(&filled).into_iter().max(), Some(most), "{leaves}");
            assert_eq!(sizes(&filled).into_iter().sum::<usize>(), leaves as usize);
        }
    }

    #[test]
    fn a_chain_is_split_by_number_where_it_grows_too_deep() {
        for leaves in [1, 2, 9, 100, 100_000] {
            let shape = Shape::collapse(&chain(leaves), Leaves::BLOCKS);
            assert!(shape.levels.len() <= MAX_DEPTH, "{leaves}: {} levels", shape.levels.len());
            let mut triangles: Vec<u32> =
                shape.blocks.as_flattened().iter().copied().filter(|&t| t != NO_TRIANGLE).collect();
            triangles.sort_unstable();
            assert!(triangles.into_iter().eq(0..leaves), "{leaves}");
        }
    }
}
