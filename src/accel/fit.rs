//! Fits a tree to positions: corners into blocks, own boxes into leaves, leaves into nodes, level by level upwards.

use super::collapse::Shape;
use super::lanes::per_axis;
use super::slab::Aabb;
use super::tree::{Block, LEAF, NO_CHILD, NO_TRIANGLE, Node, Tree, WIDTH};
use super::triangle::has_area;
use rayon::prelude::*;

/// A block's own boxes together, and its corners' box.
type LeafBoxes = (Aabb, Aabb);

impl Tree {
    pub(crate) fn fit(shape: Shape, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Self {
        let (mut blocks, mut boxes): (Vec<Block>, Vec<LeafBoxes>) = (Vec::new(), Vec::new());
        let lanes = shape.blocks.into_par_iter().with_min_len(512);
        lanes.map(|lanes| fit_block(lanes, positions, triangles)).unzip_into_vecs(&mut blocks, &mut boxes);
        let mut nodes: Vec<Node> = shape
            .children
            .into_iter()
            .map(|children| Node { planes: [[[0.0; WIDTH]; 3]; 2], children })
            .collect();
        for level in shape.levels.iter().rev() {
            let (upper, below) = nodes.split_at_mut(level.end);
            upper[level.clone()].par_iter_mut().with_min_len(512).for_each(|node| {
                fit_node(node, |child| {
                    if child & LEAF != 0 {
                        boxes[(child & !LEAF) as usize].0
                    } else {
                        below[child as usize - level.end].bounds()
                    }
                });
            });
        }
        let vertex_box = boxes.iter().fold(Aabb::EMPTY, |all, (_, b)| all.union(b));
        let bounds = nodes.first().map_or(Aabb::EMPTY, Node::bounds);
        Self {
            nodes,
            bounds,
            blocks,
            levels: shape.levels,
            triangle_count: triangles.len() as u32,
            vertex_box,
        }
    }
}

impl Node {
    /// One child's box.
    #[inline(always)]
    pub(crate) fn child_box(&self, lane: usize) -> Aabb {
        let [min, max] = &self.planes;
        Aabb { min: per_axis(|k| min[k][lane]), max: per_axis(|k| max[k][lane]) }
    }

    /// The box of all children.
    pub(crate) fn bounds(&self) -> Aabb {
        (0..WIDTH).fold(Aabb::EMPTY, |all, lane| all.union(&self.child_box(lane)))
    }
}

fn fit_node(node: &mut Node, box_of: impl Fn(u32) -> Aabb) {
    for lane in 0..WIDTH {
        let child = node.children[lane];
        let b = if child == NO_CHILD { Aabb::EMPTY } else { box_of(child) };
        for axis in 0..3 {
            node.planes[0][axis][lane] = b.min[axis];
            node.planes[1][axis][lane] = b.max[axis];
        }
    }
}

fn fit_block(lanes: [u32; WIDTH], positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> (Block, LeafBoxes) {
    let mut block = Block { corners: [[[f32::NAN; WIDTH]; 3]; 3], triangles: lanes };
    let (mut own, mut vertex_box) = (Aabb::EMPTY, Aabb::EMPTY);
    for (lane, &triangle) in lanes.iter().enumerate().filter(|&(_, &t)| t != NO_TRIANGLE) {
        let corners = triangles[triangle as usize].map(|i| positions[i as usize]);
        if !has_area(&corners) {
            continue;
        }
        own = own.union(&Aabb::own(&corners));
        vertex_box = vertex_box.union(&Aabb::of_points(&corners));
        for (to, corner) in block.corners.iter_mut().zip(corners) {
            for (to, x) in to.iter_mut().zip(corner) {
                to[lane] = x;
            }
        }
    }
    (block, (own, vertex_box))
}
