//! Fits a tree to positions: corners into blocks, own boxes into leaves, leaves into nodes, level by level upwards. A
//! tree just built and one refitted in place go the same way.

use super::collapse::Shape;
use super::fit_lanes::{FitBlocks, FitNodes, Positions, Row};
use super::lanes::{Width, per_axis};
use super::slab::Aabb;
use super::tree::{Block, NO_TRIANGLE, Node, Tree, WIDTH};
use rayon::prelude::*;

/// Blocks, or nodes of a level, that one thread takes together.
const GRAIN: usize = 512;

impl Tree {
    pub(crate) fn fit(shape: Shape, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Self {
        let node = |children| Node { planes: [[[0.0; WIDTH]; 3]; 2], children };
        let block = |triangles| Block { corners: [[[f32::NAN; WIDTH]; 3]; 3], triangles };
        let mut tree = Self {
            nodes: shape.children.into_iter().map(node).collect(),
            blocks: shape.blocks.into_par_iter().with_min_len(GRAIN).map(block).collect(),
            levels: shape.levels,
            vertices: Vec::new(),
            triangle_count: triangles.len() as u32,
            vertex_box: Aabb::EMPTY,
            bounds: Aabb::EMPTY,
            cost: 0.0,
            rows: Vec::new(),
            half_areas: Vec::new(),
            moved: Vec::new(),
        };
        tree.reindex(triangles);
        tree.refit(positions);
        tree
    }

    /// Takes triangles that are made of other corners than those before; a refit must follow. Their number must be that
    /// which the tree was built over.
    pub fn reindex(&mut self, triangles: &[[u32; 3]]) {
        assert_eq!(triangles.len(), self.triangle_count as usize, "a tree is refitted to as many triangles");
        let vertices = |block: &Block| {
            let [first, ..] = block.triangles;
            let numbers = block.triangles.map(|t| if t == NO_TRIANGLE { first } else { t });
            per_axis(|corner| numbers.map(|t| triangles[t as usize][corner]))
        };
        self.blocks.par_iter().with_min_len(GRAIN).map(vertices).collect_into_vec(&mut self.vertices);
    }

    /// Fits the tree as it stands to other positions, in the current rayon pool. Leaves whose corners stand still are left
    /// alone, and nodes above nothing but such leaves; the tree is the one that a refit of all of it gives.
    pub fn refit(&mut self, positions: &[[f32; 3]]) {
        self.refit_in(Width::detect(), positions);
    }

    /// [`Self::refit`] in lanes of a width; the tree is the same in each.
    pub(crate) fn refit_in(&mut self, width: Width, positions: &[[f32; 3]]) {
        // one way into the pool, not one for each level
        rayon::scope(|_| self.refit_here(width, &Positions::new(positions)));
    }

    fn refit_here(&mut self, width: Width, positions: &Positions) {
        let nodes = self.nodes.len();
        let all = self.moved.is_empty();
        self.moved.resize(nodes + self.blocks.len(), true);
        self.rows.resize(nodes + self.blocks.len(), Row::EMPTY);
        self.half_areas.resize(nodes, 0.0);
        self.vertex_box = self
            .blocks
            .par_chunks_mut(GRAIN)
            .zip(self.rows[nodes..].par_chunks_mut(GRAIN))
            .zip(self.moved[nodes..].par_chunks_mut(GRAIN))
            .zip(self.vertices.par_chunks(GRAIN))
            .map(|(((blocks, rows), moved), vertices)| {
                width.compute(FitBlocks { blocks, vertices, rows, moved, all, positions })
            })
            .reduce(|| Aabb::EMPTY, |a, b| a.union(&b));
        for level in self.levels.iter().rev() {
            let (rows, below) = self.rows.split_at_mut(level.end);
            let (moved, moved_below) = self.moved.split_at_mut(level.end);
            let (first, first_leaf) = (level.end, nodes - level.end);
            self.nodes[level.clone()]
                .par_chunks_mut(GRAIN)
                .zip(rows[level.clone()].par_chunks_mut(GRAIN))
                .zip(self.half_areas[level.clone()].par_chunks_mut(GRAIN))
                .zip(moved[level.clone()].par_chunks_mut(GRAIN))
                .for_each(|(((nodes, rows), half_areas), moved)| {
                    let level = FitNodes {
                        nodes,
                        rows,
                        half_areas,
                        moved,
                        below,
                        moved_below,
                        first,
                        first_leaf,
                        all,
                    };
                    width.compute(level);
                });
        }
        self.bounds = self.nodes.first().map_or(Aabb::EMPTY, Node::bounds);
        let area: f64 = self.half_areas.iter().sum();
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
pub(super) fn half_area(b: &Aabb) -> f64 {
    if b.is_empty() {
        return 0.0;
    }
    let [x, y, z] = per_axis(|k| f64::from(b.max[k]) - f64::from(b.min[k]));
    x * y + y * z + z * x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::tree::{LEAF, NO_CHILD};
    use crate::accel::triangle::has_area;
    use crate::accel::{Quality, validate};

    /// Triangles of all sorts over points of which some are equal, far, tiny or broken.
    fn mesh(turn: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let mut positions: Vec<[f32; 3]> = (0..9_000_u32)
            .map(|i| [i.wrapping_mul(37 + turn) % 101, i * 53 % 103, i % 97].map(|x| x as f32 - 50.0))
            .collect();
        for (i, x) in
            [0.0, -0.0, 1e-45, -1e-40, 1e-20, 3e38, -3e38, f32::INFINITY, f32::NAN].into_iter().enumerate()
        {
            positions[17 * i] = [x, 1.0, x];
            positions[17 * i + 1] = [x, x, x];
        }
        let n = positions.len() as u32;
        let triangles = (0..n).map(|i| [i, (i + 1 + i % 2) % n, (i * 7 + i % 3) % n]);
        (positions.clone(), triangles.collect())
    }

    fn bits(tree: &Tree) -> (Vec<u32>, Vec<u32>, u64) {
        let of = |x: &f32| if x.is_nan() { u32::MAX } else { x.to_bits() };
        let planes = tree.nodes.iter().flat_map(|n| n.planes.as_flattened().as_flattened());
        let corners = tree.blocks.iter().flat_map(|b| b.corners.as_flattened().as_flattened());
        (planes.map(of).collect(), corners.map(of).collect(), tree.cost().to_bits())
    }

    #[test]
    fn every_width_and_number_of_threads_fits_the_same_tree() {
        let (positions, triangles) = mesh(0);
        let (moved, _) = mesh(2);
        let mut tree = Tree::build(&positions, &triangles, Quality::Fastest);
        for positions in [&positions, &moved] {
            tree.refit_in(Width::Portable, positions);
            assert_eq!(validate(&tree, positions, &triangles), Ok(()));
            for width in Width::available() {
                for threads in [1, 3] {
                    let mut other = tree.clone();
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                    pool.install(|| other.refit_in(*width, &mesh(4).0));
                    assert!(bits(&other) != bits(&tree));
                    pool.install(|| other.refit_in(*width, positions));
                    assert!(bits(&other) == bits(&tree), "{width:?}, {threads} threads");
                    assert_eq!(other.vertex_box(), tree.vertex_box());
                }
            }
        }
    }

    #[test]
    fn what_stands_still_is_left_as_a_whole_refit_leaves_it() {
        let (positions, mut triangles) = mesh(0);
        let mut tree = Tree::build(&positions, &triangles, Quality::Fastest);
        let mut moved = positions.clone();
        for range in [4_000..4_100, 0..200, 8_999..9_000, 0..9_000, 5..5] {
            moved[range.clone()].copy_from_slice(&mesh(6).0[range]);
            triangles[4_321].swap(0, 1);
            let mut whole = tree.clone();
            whole.moved.clear();
            for tree in [&mut tree, &mut whole] {
                tree.reindex(&triangles);
                tree.refit(&moved);
                assert_eq!(validate(tree, &moved, &triangles), Ok(()));
            }
            assert!(bits(&tree) == bits(&whole));
            assert_eq!(tree.vertex_box(), whole.vertex_box());
        }
        tree.refit(&moved);
        let still = tree.moved.iter().filter(|moved| !**moved).count();
        assert!(still > tree.moved.len() / 2, "{still} of {}", tree.moved.len());
    }

    #[test]
    fn a_childs_box_is_that_of_what_is_below_and_no_larger() {
        let (positions, triangles) = mesh(0);
        let tree = Tree::build(&positions, &triangles, Quality::Fastest);
        let corners = |t: u32| triangles[t as usize].map(|i| positions[i as usize]);
        let with_area = |numbers: &[u32]| -> Vec<[[f32; 3]; 3]> {
            numbers.iter().filter(|&&t| t != NO_TRIANGLE).map(|&t| corners(t)).filter(has_area).collect()
        };
        for node in &tree.nodes {
            for (lane, &child) in node.children.iter().enumerate() {
                let expected = if child == NO_CHILD {
                    Aabb::EMPTY
                } else if child & LEAF == 0 {
                    tree.nodes[child as usize].bounds()
                } else {
                    let block = &tree.blocks[(child & !LEAF) as usize];
                    with_area(&block.triangles).iter().fold(Aabb::EMPTY, |b, t| b.union(&Aabb::own(t)))
                };
                assert_eq!(node.child_box(lane), expected);
            }
        }
        let all: Vec<u32> = (0..triangles.len() as u32).collect();
        assert_eq!(tree.vertex_box(), Aabb::of_points(with_area(&all).as_flattened()));
    }
}
