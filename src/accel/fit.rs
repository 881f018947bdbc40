//! Fits a tree to positions: corners into blocks, own boxes into leaves, leaves into nodes, level by level upwards. A
//! tree just built and one refitted in place go the same way.

use super::collapse::Shape;
use super::lanes::per_axis;
use super::slab::Aabb;
use super::tree::{Block, LEAF, NO_CHILD, NO_TRIANGLE, Node, Tree, WIDTH};
use super::triangle::has_area;
use rayon::prelude::*;

/// A block's own boxes together, and its corners' box.
type LeafBoxes = (Aabb, Aabb);

/// Blocks, or nodes of a level, that one thread takes at least.
const GRAIN: usize = 512;

impl Tree {
    pub(crate) fn fit(shape: Shape, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Self {
        let node = |children| Node { planes: [[[0.0; WIDTH]; 3]; 2], children };
        let block = |triangles| Block { corners: [[[f32::NAN; WIDTH]; 3]; 3], triangles };
        let mut tree = Self {
            nodes: shape.children.into_iter().map(node).collect(),
            blocks: shape.blocks.into_par_iter().with_min_len(GRAIN).map(block).collect(),
            levels: shape.levels,
            triangle_count: triangles.len() as u32,
            vertex_box: Aabb::EMPTY,
            bounds: Aabb::EMPTY,
            cost: 0.0,
        };
        tree.refit(positions, triangles);
        tree
    }

    /// Fits the tree as it stands to other positions, in the current rayon pool. Triangles that are made of other
    /// corners are taken as they are now; their number must be that which the tree was built over.
    pub fn refit(&mut self, positions: &[[f32; 3]], triangles: &[[u32; 3]]) {
        assert_eq!(triangles.len(), self.triangle_count as usize, "a tree is refitted to as many triangles");
        let mut boxes: Vec<LeafBoxes> = Vec::new();
        let blocks = self.blocks.par_iter_mut().with_min_len(GRAIN);
        blocks.map(|block| fit_block(block, positions, triangles)).collect_into_vec(&mut boxes);
        let mut area = 0.0;
        for level in self.levels.iter().rev() {
            let (upper, below) = self.nodes.split_at_mut(level.end);
            let nodes = upper[level.clone()].par_iter_mut().with_min_len(GRAIN);
            area += nodes
                .map(|node| {
                    fit_node(node, |child| {
                        if child & LEAF != 0 {
                            boxes[(child & !LEAF) as usize].0
                        } else {
                            below[child as usize - level.end].bounds()
                        }
                    })
                })
                .sum::<f64>();
        }
        self.vertex_box = boxes.iter().fold(Aabb::EMPTY, |all, (_, b)| all.union(b));
        self.bounds = self.nodes.first().map_or(Aabb::EMPTY, Node::bounds);
        let whole = half_area(&self.bounds);
        self.cost = if whole > 0.0 && area.is_finite() { area / whole } else { 0.0 };
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

/// Half the surface of a box; 0 of an empty one.
fn half_area(b: &Aabb) -> f64 {
    if b.is_empty() {
        return 0.0;
    }
    let [x, y, z] = per_axis(|k| f64::from(b.max[k]) - f64::from(b.min[k]));
    x * y + y * z + z * x
}

/// Takes the boxes of a node's children; gives the sum of their half surfaces.
fn fit_node(node: &mut Node, box_of: impl Fn(u32) -> Aabb) -> f64 {
    let mut area = 0.0;
    for lane in 0..WIDTH {
        let child = node.children[lane];
        let b = if child == NO_CHILD { Aabb::EMPTY } else { box_of(child) };
        for axis in 0..3 {
            node.planes[0][axis][lane] = b.min[axis];
            node.planes[1][axis][lane] = b.max[axis];
        }
        area += half_area(&b);
    }
    area
}

/// Takes a block's corners; what has no area becomes NaN, which no test hits.
fn fit_block(block: &mut Block, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> LeafBoxes {
    let (mut own, mut vertex_box) = (Aabb::EMPTY, Aabb::EMPTY);
    for (lane, &triangle) in block.triangles.iter().enumerate() {
        if triangle == NO_TRIANGLE {
            break;
        }
        let mut corners = triangles[triangle as usize].map(|i| positions[i as usize]);
        if has_area(&corners) {
            own = own.union(&Aabb::own(&corners));
            vertex_box = vertex_box.union(&Aabb::of_points(&corners));
        } else {
            corners = [[f32::NAN; 3]; 3];
        }
        for (to, corner) in block.corners.iter_mut().zip(corners) {
            for (to, x) in to.iter_mut().zip(corner) {
                to[lane] = x;
            }
        }
    }
    (own, vertex_box)
}
