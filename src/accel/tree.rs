//! The tree that rays are traced against: eight children a node, their boxes and the triangles of a leaf side by side
//! in f32. Its shape comes from [`super::collapse`], its boxes from [`super::fit`].

use super::binary::{Binary, Quality};
use super::collapse::{Leaves, Shape};
use super::fit_lanes::Row;
use super::lanes::per_axis;
use super::slab::Aabb;
use std::ops::Range;

/// Children of a node, and triangles of a leaf at most.
pub(crate) const WIDTH: usize = 8;
/// Levels of nodes at most; bounds the stack of a traversal.
pub(crate) const MAX_DEPTH: usize = 32;

/// In a child's number: it is a leaf, the rest is its block.
pub(crate) const LEAF: u32 = 1 << 31;
/// A child that is not there.
pub(crate) const NO_CHILD: u32 = u32::MAX;
/// A lane of a block without a triangle.
pub(crate) const NO_TRIANGLE: u32 = u32::MAX;

/// A node: the boxes of its children and what they are.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// By side (lesser, greater), axis, child. The box of a child that is not there is empty.
    pub(crate) planes: [[[f32; WIDTH]; 3]; 2],
    /// Places of inner nodes, or [`LEAF`] with the place of a block, or [`NO_CHILD`].
    pub(crate) children: [u32; WIDTH],
}

/// The triangles of a leaf.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Block {
    /// By corner, axis, triangle; NaN in lanes without a triangle and for triangles without area, which no test hits.
    pub(crate) corners: [[[f32; WIDTH]; 3]; 3],
    /// Their numbers, or [`NO_TRIANGLE`].
    pub(crate) triangles: [u32; WIDTH],
}

impl Block {
    /// The corners of one triangle.
    #[inline(always)]
    pub(crate) fn corners_of(&self, lane: usize) -> [[f32; 3]; 3] {
        per_axis(|corner| per_axis(|axis| self.corners[corner][axis][lane]))
    }
}

/// A bounding volume hierarchy over one mesh, with a copy of its triangles' corners.
#[derive(Clone, Debug)]
pub struct Tree {
    /// The root first, level by level, each node after its parent; empty without triangles.
    pub(crate) nodes: Vec<Node>,
    pub(crate) blocks: Vec<Block>,
    /// The nodes of each level.
    pub(crate) levels: Vec<Range<usize>>,
    /// For each block the vertices of its triangles, by corner and lane, those of its first one in lanes without a
    /// triangle: looking them up through the triangles' numbers would be a quarter of a refit.
    pub(crate) vertices: Vec<[[u32; WIDTH]; 3]>,
    pub(crate) triangle_count: u32,
    pub(crate) vertex_box: Aabb,
    /// The box of the root's children.
    pub(crate) bounds: Aabb,
    pub(crate) cost: f64,
    /// The boxes of all nodes, then of all leaves (the own boxes of their triangles together): room for a refit, for new
    /// memory would cost as much as filling it.
    pub(crate) rows: Vec<Row>,
    /// For each node its children's half surfaces together: room for a refit.
    pub(crate) half_areas: Vec<f64>,
    /// Which of the rows the last refit changed: room for the next.
    pub(crate) moved: Vec<bool>,
}

/// How large a tree is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TreeCounts {
    /// Inner nodes.
    pub nodes: usize,
    /// Leaves.
    pub leaves: usize,
    /// Levels of nodes.
    pub levels: usize,
}

impl Tree {
    /// Builds over an indexed mesh in the current rayon pool; indices must be within the positions. The tree is the
    /// same for any number of threads. A triangle without area or with a corner that is not finite is never hit.
    pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]], quality: Quality) -> Self {
        let shape = Shape::collapse(&Binary::build(positions, triangles, quality), Leaves::BLOCKS);
        Self::fit(shape, positions, triangles)
    }

    /// Bytes that it takes in memory.
    pub fn bytes(&self) -> u64 {
        (size_of::<Self>()
            + size_of_val(&*self.nodes)
            + size_of_val(&*self.blocks)
            + size_of_val(&*self.vertices)
            + size_of_val(&*self.rows)
            + size_of_val(&*self.half_areas)
            + size_of_val(&*self.moved)
            + size_of_val(&*self.levels)) as u64
    }

    /// Its nodes, leaves and levels.
    pub fn counts(&self) -> TreeCounts {
        TreeCounts { nodes: self.nodes.len(), leaves: self.blocks.len(), levels: self.levels.len() }
    }

    /// Triangles that it was built over, with and without area.
    pub fn triangle_count(&self) -> u32 {
        self.triangle_count
    }

    /// Its surface-area cost: the surfaces of all children over the whole's (Goldsmith and Salmon 1987); how many
    /// boxes a ray that meets the whole meets on average. 0 where the whole has no surface.
    pub fn cost(&self) -> f64 {
        self.cost
    }

    /// The box of the corners of all triangles that can be hit.
    pub fn vertex_box(&self) -> Aabb {
        self.vertex_box
    }
}
