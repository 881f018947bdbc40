//! Collapses a binary tree into the shape of a wide one: which nodes there are, and which triangles each leaf has.

use super::binary::Binary;
use super::tree::{LEAF, MAX_DEPTH, NO_CHILD, NO_TRIANGLE, WIDTH};
use rayon::prelude::*;
use std::ops::Range;

/// From this level on a subtree is split by number, not as the binary tree says: eight levels hold 8⁸ leaves of eight
/// triangles, more than there are numbers for.
const SPLIT_BY_NUMBER_LEVEL: usize = MAX_DEPTH - 10;

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
    pub(crate) fn collapse(binary: &Binary) -> Self {
        let mut shape = Self::default();
        if binary.nodes.is_empty() {
            return shape;
        }
        let is_leaf = leaves(binary);
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
                level.par_iter().with_min_len(256).map(|s| expand(*s, binary, &subtree)).collect();
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
fn leaves(binary: &Binary) -> Vec<bool> {
    const BLOCK_COST: f32 = 1.0;
    const NODE_COST: f32 = 0.3;
    let mut is_leaf = vec![false; binary.nodes.len()];
    let mut cost = vec![0.0_f32; binary.nodes.len()];
    for (i, n) in binary.nodes.iter().enumerate().rev() {
        let as_block = BLOCK_COST * n.half_area;
        let child = n.child as usize;
        let as_inner =
            if child == 0 { f32::INFINITY } else { NODE_COST * n.half_area + cost[child] + cost[child + 1] };
        is_leaf[i] = n.count as usize <= WIDTH && as_block <= as_inner;
        cost[i] = if is_leaf[i] { as_block } else { as_inner };
    }
    is_leaf
}

/// The children of a subtree: the one with the largest surface is opened until there are eight.
fn expand(s: Subtree, binary: &Binary, subtree: &impl Fn(u32) -> Subtree) -> ([Subtree; WIDTH], usize) {
    let Some(root) = s.node else { return split_by_number(s) };
    let mut children = [s; WIDTH];
    let mut count = 1;
    if s.is_leaf {
        return (children, count);
    }
    let mut areas = [binary.nodes[root as usize].half_area; WIDTH];
    while count < WIDTH {
        let mut largest = None;
        for i in 0..count {
            if !children[i].is_leaf && largest.is_none_or(|l: usize| areas[i] > areas[l]) {
                largest = Some(i);
            }
        }
        let Some((open, node)) = largest.and_then(|i| children[i].node.map(|n| (i, n))) else { break };
        let child = binary.nodes[node as usize].child;
        for (place, c) in [(open, child), (count, child + 1)] {
            children[place] = subtree(c);
            areas[place] = binary.nodes[c as usize].half_area;
        }
        count += 1;
    }
    (children, count)
}

fn split_by_number(s: Subtree) -> ([Subtree; WIDTH], usize) {
    let mut children = [s; WIDTH];
    let size = s.count.div_ceil(WIDTH as u32).max(WIDTH as u32);
    let count = s.count.div_ceil(size);
    for (i, child) in (0..count).zip(&mut children) {
        let start = s.start + i * size;
        let rest = s.start + s.count - start;
        *child =
            Subtree { node: None, start, count: size.min(rest), is_leaf: rest.min(size) as usize <= WIDTH };
    }
    (children, count as usize)
}
