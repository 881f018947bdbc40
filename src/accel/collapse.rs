//! Collapses a binary tree into the shape of a wide one: which nodes there are, and which triangles each leaf has. Of all
//! ways to do so it is the one that costs least by surface area (Ylitie, Karras and Laine, "Efficient Incoherent Ray
//! Traversal on GPUs Through Compressed Wide BVHs", 2017, section 3.1).

use super::binary::Binary;
use super::tree::{LEAF, MAX_DEPTH, NO_CHILD, NO_TRIANGLE, WIDTH};
use rayon::prelude::*;
use std::ops::Range;

/// From this level on a subtree is split by number, not as the binary tree says: ten levels hold 8¹⁰ leaves, more
/// than there are numbers for.
const SPLIT_BY_NUMBER_LEVEL: usize = MAX_DEPTH - 10;
/// Deeper in the binary tree than this nothing is ever opened: a level opens seven nodes one below the other at most.
const PLANNED_DEPTH: usize = SPLIT_BY_NUMBER_LEVEL * (WIDTH - 1);

/// Triangles of a subtree of which one thread finds the cuts, at most.
const GRAIN: u32 = 2048;

/// What leaves may be, and what they and nodes cost. By its surface a node costs 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Leaves {
    /// Triangles of a leaf at most; [`WIDTH`] at most.
    pub(crate) most: usize,
    /// By its surface a leaf costs this,
    pub(crate) block: f32,
    /// and this for each of its triangles.
    pub(crate) triangle: f32,
    /// What a leaf and a node cost besides, for being refitted whatever their surface: so many times the whole's surface
    /// over the number of triangles.
    pub(crate) refit: f32,
}

impl Leaves {
    /// Of trees whose leaves' triangles are tested all at once. Were refits free, leaves would be split wherever a node has
    /// room: up to a quarter more of them, for a hundredth of the boxes that rays meet.
    pub(crate) const BLOCKS: Self = Self { most: WIDTH, block: 0.5, triangle: 0.0, refit: 4.0 };
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
        let mut cuts = vec![Cuts::default(); binary.order.len() - 1];
        let surface = binary.nodes[0].half_area / binary.order.len() as f32;
        let leaves = Leaves { refit: leaves.refit * surface, ..leaves };
        plan(0, 0, binary, &leaves, &mut cuts);
        let mut level = vec![Subtree::of(0, binary, &cuts)];
        while !level.is_empty() {
            if shape.levels.len() == SPLIT_BY_NUMBER_LEVEL {
                for s in &mut level {
                    s.node = None;
                }
            }
            let expanded: Vec<([Subtree; WIDTH], usize)> =
                level.par_iter().with_min_len(256).map(|s| expand(*s, binary, leaves, &cuts)).collect();
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

/// How an inner node of the binary tree is best made into few subtrees.
#[derive(Clone, Copy, Debug, Default)]
struct Cuts {
    /// Whether as one subtree it is a leaf.
    is_leaf: bool,
    /// For up to 2, 3, … 7 subtrees how many of them its first child becomes, the second child the others; 0 where one fewer
    /// is no worse. And for the 8 children of a node; 0 where a leaf is no worse.
    first: [u8; WIDTH - 1],
}

impl Cuts {
    /// How many subtrees each child becomes of up to so many; None where it stays one.
    fn best(self, most: usize) -> Option<[usize; 2]> {
        let least = if most == WIDTH { WIDTH } else { 2 };
        (least..=most).rev().find_map(|i| match usize::from(self.first[i - 2]) {
            0 => None,
            first => Some([first, i - first]),
        })
    }
}

/// What a subtree costs as up to 1, 2, … 7 subtrees.
type Costs = [f32; WIDTH - 1];

/// Finds the cuts of a subtree's inner nodes, which are one fewer than its triangles: each one's stand between those of its
/// two children. Here the leaves' `refit` is a cost as it is added.
fn plan(node: u32, depth: usize, binary: &Binary, leaves: &Leaves, cuts: &mut [Cuts]) -> Costs {
    let n = &binary.nodes[node as usize];
    let as_leaf = (leaves.block + leaves.triangle * n.count as f32) * n.half_area + leaves.refit;
    if n.child == 0 || depth == PLANNED_DEPTH {
        return [as_leaf; WIDTH - 1];
    }
    let (before, rest) = cuts.split_at_mut(binary.nodes[n.child as usize].count as usize - 1);
    let (own, after) = rest.split_at_mut(1);
    let own = &mut own[0];
    let first = |cuts| plan(n.child, depth + 1, binary, leaves, cuts);
    let second = |cuts| plan(n.child + 1, depth + 1, binary, leaves, cuts);
    let (first, second) = if n.count > GRAIN {
        rayon::join(|| first(before), || second(after))
    } else {
        (first(before), second(after))
    };
    // what it costs as 2, 3, … 8 subtrees, some of either child; side by side
    let mut of_second = [f32::INFINITY; 2 * (WIDTH - 1)];
    of_second[WIDTH - 1..].copy_from_slice(&second);
    let mut split = second.map(|cost| first[0] + cost);
    own.first = [1; WIDTH - 1];
    for k in 1..WIDTH - 1 {
        for i in 0..WIDTH - 1 {
            let cost = first[k] + of_second[WIDTH - 1 + i - k];
            let is_less = cost < split[i];
            split[i] = if is_less { cost } else { split[i] };
            own.first[i] = if is_less { k as u8 + 1 } else { own.first[i] };
        }
    }
    let as_leaf = if n.count as usize <= leaves.most { as_leaf } else { f32::INFINITY };
    let children = split[WIDTH - 2];
    let as_node = n.half_area + leaves.refit + children;
    own.is_leaf = as_leaf <= as_node;
    if as_leaf <= children {
        own.first[WIDTH - 2] = 0;
    }
    let mut costs = [as_leaf.min(as_node); WIDTH - 1];
    for i in 1..WIDTH - 1 {
        costs[i] = costs[i - 1].min(split[i - 1]);
        if costs[i - 1] <= split[i - 1] {
            own.first[i - 1] = 0;
        }
    }
    costs
}

impl Subtree {
    /// That of a node of the binary tree.
    fn of(node: u32, binary: &Binary, cuts: &[Cuts]) -> Self {
        let n = &binary.nodes[node as usize];
        let is_leaf = n.child == 0 || cuts_of(node, binary, cuts).is_leaf;
        Self { node: Some(node), start: n.start, count: n.count, is_leaf }
    }
}

/// The cuts of an inner node.
fn cuts_of(node: u32, binary: &Binary, cuts: &[Cuts]) -> Cuts {
    let n = &binary.nodes[node as usize];
    cuts[(n.start + binary.nodes[n.child as usize].count) as usize - 1]
}

/// The children of a subtree, in the order of the binary tree.
fn expand(s: Subtree, binary: &Binary, leaves: Leaves, cuts: &[Cuts]) -> ([Subtree; WIDTH], usize) {
    let Some(root) = s.node else { return split_by_number(s, leaves.most) };
    let mut children = [s; WIDTH];
    let mut count = 0;
    // nodes, and how many children each may become
    let mut open = [(root, WIDTH); WIDTH];
    let mut open_count = 1;
    while open_count > 0 {
        open_count -= 1;
        let (node, most) = open[open_count];
        let child = binary.nodes[node as usize].child;
        let cut = if child == 0 { None } else { cuts_of(node, binary, cuts).best(most) };
        if let Some([first, second]) = cut {
            open[open_count] = (child + 1, second);
            open[open_count + 1] = (child, first);
            open_count += 2;
        } else {
            children[count] = Subtree::of(node, binary, cuts);
            count += 1;
        }
    }
    (children, count)
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
                let count = if is_inner { leaves - i / 2 } else { 1 };
                BinaryNode {
                    half_area: count as f32,
                    child: if is_inner { i + 1 } else { 0 },
                    start: i / 2,
                    count,
                }
            })
            .collect();
        Binary { nodes, order: (0..leaves).collect() }
    }

    fn sizes(shape: &Shape) -> Vec<usize> {
        shape.blocks.iter().map(|b| b.iter().filter(|t| **t != NO_TRIANGLE).count()).collect()
    }

    #[test]
    fn leaves_are_split_while_their_node_has_room() {
        let each = Leaves { most: 4, block: 0.0, triangle: 0.1, refit: 0.0 };
        for (leaves, most) in [(3, 1), (8, 1), (9, 2)] {
            let shape = Shape::collapse(&chain(leaves), each);
            assert_eq!(shape.children.len(), 1, "{leaves}");
            assert_eq!(sizes(&shape).into_iter().max(), Some(most), "{leaves}");
            assert_eq!(sizes(&shape).into_iter().sum::<usize>(), leaves as usize);
        }
        // of three triangles: three leaves, 3 · 0.3 · 1 + 3r; two, 0.3 · 1 + 0.6 · 2 + 2r, from r = 0.6 on; one, 0.9 · 3 + r, from
        // r = 1.2 on
        for (refit, expected) in [(0.5, vec![1, 1, 1]), (0.7, vec![1, 2]), (1.1, vec![1, 2]), (1.3, vec![3])]
        {
            let binary = chain(3);
            let shape = Shape::collapse(&binary, Leaves { triangle: 0.3, refit, ..each });
            assert_eq!(sizes(&shape), expected, "{refit}");
        }
    }

    /// A tree of any form, boxes below each other ever smaller.
    fn any_tree(leaves: u32, random: &mut impl FnMut() -> f32) -> Binary {
        let root = BinaryNode { half_area: 1.0, child: 0, start: 0, count: leaves };
        let mut nodes = vec![root];
        let mut next = 0;
        while next < nodes.len() {
            let BinaryNode { half_area, start, count, .. } = nodes[next];
            if count > 1 {
                nodes[next].child = nodes.len() as u32;
                let first = 1 + ((count - 1) as f32 * random()) as u32;
                for (start, count) in [(start, first), (start + first, count - first)] {
                    nodes.push(BinaryNode { half_area: half_area * random(), child: 0, start, count });
                }
            }
            next += 1;
        }
        Binary { nodes, order: (0..leaves).collect() }
    }

    /// All ways to take a subtree apart into up to so many others.
    fn parts(binary: &Binary, node: u32, most: usize) -> Vec<Vec<u32>> {
        let mut ways = vec![vec![node]];
        let child = binary.nodes[node as usize].child;
        if child != 0 && most > 1 {
            let second = parts(binary, child + 1, most - 1);
            for first in parts(binary, child, most - 1) {
                ways.extend(second.iter().map(|s| [&first[..], s].concat()));
            }
        }
        ways.retain(|way| way.len() <= most);
        ways
    }

    fn leaf_cost(n: &BinaryNode, leaves: Leaves, refit: f32) -> f32 {
        n.half_area * (leaves.block + leaves.triangle * n.count as f32) + refit
    }

    /// The least that a subtree costs as a node, and as a node or a leaf, of all ways.
    fn least_cost(binary: &Binary, node: u32, leaves: Leaves, refit: f32) -> [f32; 2] {
        let n = &binary.nodes[node as usize];
        let as_leaf =
            if n.count as usize <= leaves.most { leaf_cost(n, leaves, refit) } else { f32::INFINITY };
        let ways = parts(binary, node, WIDTH).into_iter().map(|way| match way[..] {
            [_] => as_leaf,
            _ => way.iter().map(|&part| least_cost(binary, part, leaves, refit)[1]).sum(),
        });
        let as_node = n.half_area + refit + ways.fold(f32::INFINITY, f32::min);
        [as_node, as_node.min(as_leaf)]
    }

    /// What a node of a shape costs with all below it, and the triangles in it.
    fn cost(shape: &Shape, child: u32, binary: &Binary, leaves: Leaves, refit: f32) -> (f32, Range<u32>) {
        let of = |r: &Range<u32>| {
            let n = binary.nodes.iter().find(|n| n.start == r.start && n.count == r.end - r.start);
            n.expect("a subtree of the binary tree")
        };
        if child & LEAF != 0 {
            let triangles = shape.blocks[(child & !LEAF) as usize].iter().filter(|t| **t != NO_TRIANGLE);
            let start = *triangles.clone().min().expect("no empty leaf");
            let range = start..start + triangles.count() as u32;
            return (leaf_cost(of(&range), leaves, refit), range);
        }
        let children = shape.children[child as usize].iter().filter(|c| **c != NO_CHILD);
        let below = children.map(|&c| cost(shape, c, binary, leaves, refit));
        let (sum, range) = below
            .reduce(|a, b| (a.0 + b.0, a.1.start.min(b.1.start)..a.1.end.max(b.1.end)))
            .expect("a child");
        (sum + refit + of(&range).half_area, range)
    }

    #[test]
    fn no_way_to_collapse_costs_less() {
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        for i in 0..300 {
            let leaves_may = Leaves {
                most: 1 + i % WIDTH,
                block: if i % 2 == 0 { 0.0 } else { random() },
                triangle: random(),
                refit: if i % 3 == 0 { 0.0 } else { 0.3 * random() },
            };
            let binary = any_tree(1 + i as u32 % 15, &mut random);
            let refit = leaves_may.refit / binary.order.len() as f32;
            let shape = Shape::collapse(&binary, leaves_may);
            let (found, _) = cost(&shape, 0, &binary, leaves_may, refit);
            let [least, _] = least_cost(&binary, 0, leaves_may, refit);
            assert!((found - least).abs() <= 1e-5 * least, "{i}: {found}, not {least}");
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
