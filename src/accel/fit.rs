//! Fits a tree to positions: corners into blocks, own boxes into leaves, leaves into nodes, level by level upwards. A
//! tree just built and one refitted in place go the same way.

use super::collapse::Shape;
use super::lanes::{Lanes, per_axis};
use super::slab::{Aabb, above, below, own_margin};
use super::tree::{Block, LEAF, NO_CHILD, NO_TRIANGLE, Node, Tree, WIDTH};
use super::triangle::have_area;
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
            leaf_boxes: Vec::new(),
        };
        tree.refit(positions, triangles);
        tree
    }

    /// Fits the tree as it stands to other positions, in the current rayon pool. Triangles that are made of other
    /// corners are taken as they are now; their number must be that which the tree was built over.
    pub fn refit(&mut self, positions: &[[f32; 3]], triangles: &[[u32; 3]]) {
        assert_eq!(triangles.len(), self.triangle_count as usize, "a tree is refitted to as many triangles");
        // kept from refit to refit: new memory would cost as much as filling it
        let mut boxes = std::mem::take(&mut self.leaf_boxes);
        boxes.resize(self.blocks.len(), Aabb::EMPTY);
        self.vertex_box = self
            .blocks
            .par_iter_mut()
            .zip(&mut boxes)
            .with_min_len(GRAIN)
            .map(|(block, own)| {
                let vertex_box;
                (*own, vertex_box) = fit_block(block, positions, triangles);
                vertex_box
            })
            .reduce(|| Aabb::EMPTY, |a, b| a.union(&b));
        let mut area = 0.0;
        for level in self.levels.iter().rev() {
            let (upper, below) = self.nodes.split_at_mut(level.end);
            let nodes = upper[level.clone()].par_iter_mut().with_min_len(GRAIN);
            area += nodes
                .map(|node| {
                    fit_node(node, |child| {
                        if child & LEAF != 0 {
                            boxes[(child & !LEAF) as usize]
                        } else {
                            below[child as usize - level.end].bounds()
                        }
                    })
                })
                .sum::<f64>();
        }
        self.leaf_boxes = boxes;
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

/// Takes a block's corners; what has no area becomes NaN, which no test hits. All lanes go side by side: plain loops
/// over eight floats, which become vector instructions.
fn fit_block(block: &mut Block, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> LeafBoxes {
    let mut corners = [[[f32::NAN; WIDTH]; 3]; 3];
    for (lane, &triangle) in block.triangles.iter().enumerate() {
        if triangle == NO_TRIANGLE {
            break;
        }
        for (to, i) in corners.iter_mut().zip(triangles[triangle as usize]) {
            let p = positions[i as usize];
            for (to, x) in to.iter_mut().zip(p) {
                to[lane] = x;
            }
        }
    }
    let has_area = have_area(&corners);
    for axis in corners.as_flattened_mut() {
        for (x, has_area) in axis.iter_mut().zip(has_area) {
            *x = if has_area { *x } else { f32::NAN };
        }
    }
    let [a, b, c] = &corners;
    let mut least = [[0.0; WIDTH]; 3];
    let mut greatest = [[0.0; WIDTH]; 3];
    for k in 0..3 {
        for lane in 0..WIDTH {
            least[k][lane] = Lanes::min(a[k][lane], Lanes::min(b[k][lane], c[k][lane]));
            greatest[k][lane] = Lanes::max(a[k][lane], Lanes::max(b[k][lane], c[k][lane]));
        }
    }
    let [mut own_least, mut own_greatest] = [least, greatest];
    for lane in 0..WIDTH {
        let size = |k: usize| greatest[k][lane] - least[k][lane];
        let margin = own_margin([size(0), size(1), size(2)]);
        for k in 0..3 {
            own_least[k][lane] = below(least[k][lane], margin);
            own_greatest[k][lane] = above(greatest[k][lane], margin);
        }
    }
    block.corners = corners;
    (union(&own_least, &own_greatest), union(&least, &greatest))
}

/// The box of the lanes' boxes; those that are NaN are left aside.
fn union(least: &[[f32; WIDTH]; 3], greatest: &[[f32; WIDTH]; 3]) -> Aabb {
    // the first operand is given where one is NaN
    let fold = |lanes: &[f32; WIDTH], empty: f32, wins: fn(f32, f32) -> bool| {
        lanes.iter().fold(empty, |all, &x| if wins(x, all) { x } else { all })
    };
    Aabb {
        min: per_axis(|k| fold(&least[k], f32::INFINITY, |x, all| x < all)),
        max: per_axis(|k| fold(&greatest[k], f32::NEG_INFINITY, |x, all| x > all)),
    }
}
