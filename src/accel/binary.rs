//! The binary tree that the wide one is collapsed from: obvhs's, uncollapsed, one triangle a leaf. Only its shape is
//! used, never its boxes, so it is built over boxes moved to the unit cube and jittered.

use super::slab::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;
use obvhs::splits::split_aabbs_preset;
use obvhs::triangle::Triangle;
use obvhs::{Boundable, BvhBuildParams};
use rayon::prelude::*;

/// How much time a tree may take to build for being traced faster: obvhs's presets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Quality {
    /// Clusters of the two nearest neighbours.
    #[default]
    Fastest,
    /// The same, improved a little by reinsertion.
    VeryFast,
    /// Looks further for neighbours.
    Fast,
    /// Looks further, improves more.
    Medium,
    /// Splits large triangles first: they stand in several leaves.
    Slow,
    /// Splits and improves most.
    VerySlow,
}

impl Quality {
    /// All of them, the fastest first.
    pub const ALL: [Self; 6] =
        [Self::Fastest, Self::VeryFast, Self::Fast, Self::Medium, Self::Slow, Self::VerySlow];

    fn params(self) -> BvhBuildParams {
        match self {
            Self::Fastest => BvhBuildParams::fastest_build(),
            Self::VeryFast => BvhBuildParams::very_fast_build(),
            Self::Fast => BvhBuildParams::fast_build(),
            Self::Medium => BvhBuildParams::medium_build(),
            Self::Slow => BvhBuildParams::slow_build(),
            Self::VerySlow => BvhBuildParams::very_slow_build(),
        }
    }
}

/// A node of the binary tree; the two children of an inner node stand side by side.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BinaryNode {
    /// Half the surface of its box, of the scene's largest extent squared.
    pub(crate) half_area: f32,
    /// The first child; 0 in a leaf.
    pub(crate) child: u32,
    /// Its triangles' place in [`Binary::order`].
    pub(crate) start: u32,
    /// How many triangles.
    pub(crate) count: u32,
}

/// A binary tree, the root first, children after their parents.
#[derive(Clone, Debug, Default)]
pub(crate) struct Binary {
    pub(crate) nodes: Vec<BinaryNode>,
    /// The triangles in the order of the leaves.
    pub(crate) order: Vec<u32>,
}

impl Binary {
    /// Builds over triangles given by their corners' finite boxes, in the current rayon pool; the same for any number
    /// of threads.
    pub(crate) fn build(corners: &[[[f32; 3]; 3]], quality: Quality) -> Self {
        if corners.is_empty() {
            return Self::default();
        }
        Self::from_obvhs(&build_obvhs(corners, quality.params()))
    }

    fn from_obvhs(bvh: &Bvh2) -> Self {
        let mut nodes: Vec<BinaryNode> = bvh
            .nodes
            .par_iter()
            .with_min_len(4096)
            .map(|n| BinaryNode {
                half_area: n.aabb().half_area(),
                child: if n.is_leaf() { 0 } else { n.first_index },
                start: 0,
                count: 1,
            })
            .collect();
        for i in (0..nodes.len()).rev() {
            let child = nodes[i].child as usize;
            if child != 0 {
                nodes[i].count = nodes[child].count + nodes[child + 1].count;
            }
        }
        let mut order = vec![0; nodes[0].count as usize];
        for i in 0..nodes.len() {
            let BinaryNode { child, start, .. } = nodes[i];
            if child == 0 {
                order[start as usize] = bvh.primitive_indices[bvh.nodes[i].first_index as usize];
            } else {
                nodes[child as usize].start = start;
                nodes[child as usize + 1].start = start + nodes[child as usize].count;
            }
        }
        Self { nodes, order }
    }
}

fn build_obvhs(corners: &[[[f32; 3]; 3]], params: BvhBuildParams) -> Bvh2 {
    let frame = UnitCube::of(corners);
    let mut indices: Vec<u32> = (0..corners.len() as u32).collect();
    let mut boxes: Vec<obvhs::aabb::Aabb>;
    if params.pre_split {
        let triangles: Vec<Triangle> = corners.par_iter().map(|c| frame.triangle(c)).collect();
        boxes = triangles.par_iter().map(Boundable::aabb).collect();
        let mean = boxes.iter().map(obvhs::aabb::Aabb::half_area).sum::<f32>() / boxes.len() as f32;
        let largest = boxes.iter().map(obvhs::aabb::Aabb::half_area).fold(0.0, f32::max);
        split_aabbs_preset(&mut boxes, &mut indices, &triangles, mean, largest);
    } else {
        boxes = corners.par_iter().with_min_len(4096).map(|c| frame.triangle(c).aabb()).collect();
    }
    boxes.par_iter_mut().with_min_len(4096).enumerate().for_each(|(i, b)| jitter(b, i as u32));

    let mut bvh = PlocBuilder::with_capacity(boxes.len()).build(
        params.ploc_search_distance,
        &boxes,
        indices,
        params.sort_precision,
        params.search_depth_threshold,
    );
    if params.reinsertion_batch_ratio > 0.0 {
        ReinsertionOptimizer::default().run(&mut bvh, params.reinsertion_batch_ratio, None);
        bvh.reorder_in_stack_traversal_order();
    }
    bvh
}

/// Moves and scales a scene (all axes alike) into the unit cube, so that no area overflows or underflows and floats are
/// fine where the triangles are.
struct UnitCube {
    min: [f32; 3],
    scale: f32,
}

impl UnitCube {
    fn of(corners: &[[[f32; 3]; 3]]) -> Self {
        let whole = corners
            .par_iter()
            .with_min_len(4096)
            .map(|c| Aabb::of_points(c))
            .reduce(|| Aabb::EMPTY, |a, b| a.union(&b));
        let extent = (0..3).map(|k| 0.5 * whole.max[k] - 0.5 * whole.min[k]).fold(0.0, f32::max);
        Self { min: whole.min, scale: if extent > f32::MIN_POSITIVE { 0.5 / extent } else { 0.0 } }
    }

    fn triangle(&self, corners: &[[f32; 3]; 3]) -> Triangle {
        let [v0, v1, v2] = corners.map(|p| {
            glam::Vec3A::from_array(std::array::from_fn(|k| {
                2.0 * ((0.5 * p[k] - 0.5 * self.min[k]) * self.scale)
            }))
        });
        Triangle { v0, v1, v2 }
    }
}

/// Grows a box a little, each side differently. Clustering merges boxes that are each other's best partner; among equal
/// boxes (coincident triangles) every box's best partner would be the next, one pair would be merged in each pass, and
/// the time would be quadratic.
fn jitter(b: &mut obvhs::aabb::Aabb, index: u32) {
    const SCENE: f32 = 1.0 / 65536.0;
    const BOX: f32 = 1.0 / 1024.0;
    let size = b.max - b.min;
    let reach = SCENE + BOX * size.max_element();
    let mut state = index;
    let mut next = || {
        state = mix(state.wrapping_add(0x9e37_79b9));
        reach * (state >> 8) as f32 / (1 << 24) as f32
    };
    b.min -= glam::Vec3A::new(next(), next(), next());
    b.max += glam::Vec3A::new(next(), next(), next());
}

/// Mixes the bits of an integer (Wellons' lowbias32, hash-prospector).
fn mix(mut x: u32) -> u32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}
