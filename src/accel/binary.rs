//! The binary tree that the wide one is collapsed from: obvhs's, uncollapsed, one triangle a leaf. Only its shape is
//! used, never its boxes, so it is built over boxes moved to the unit cube and jittered.

use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;
use obvhs::splits::split_aabbs_preset;
use obvhs::triangle::Triangle;
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
    /// Builds over an indexed mesh in the current rayon pool; the same for any number of threads.
    pub(crate) fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]], quality: Quality) -> Self {
        if triangles.is_empty() {
            return Self::default();
        }
        Self::from_obvhs(&build_obvhs(positions, triangles, quality.params()))
    }

    fn from_obvhs(bvh: &Bvh2) -> Self {
        // breadth first, as reinsertion leaves children anywhere
        let mut nodes: Vec<BinaryNode> = Vec::with_capacity(bvh.nodes.len());
        let mut places: Vec<u32> = Vec::with_capacity(bvh.nodes.len());
        places.push(0);
        while let Some(from) = places.get(nodes.len()).and_then(|&p| bvh.nodes.get(p as usize)) {
            let child = if from.is_leaf() { 0 } else { places.len() as u32 };
            nodes.push(BinaryNode { half_area: from.aabb().half_area(), child, start: 0, count: 1 });
            if child != 0 {
                places.extend([from.first_index, from.first_index + 1]);
            }
        }
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
                order[start as usize] =
                    bvh.primitive_indices[bvh.nodes[places[i] as usize].first_index as usize];
            } else {
                nodes[child as usize].start = start;
                nodes[child as usize + 1].start = start + nodes[child as usize].count;
            }
        }
        Self { nodes, order }
    }
}

/// Triangles that are handled together by one thread, at least.
const GRAIN: usize = 4096;

fn build_obvhs(positions: &[[f32; 3]], triangles: &[[u32; 3]], params: BvhBuildParams) -> Bvh2 {
    // what is not finite is never hit and may stand anywhere
    let finite = |p: [f32; 3]| Vec3A::from_array(p.map(|x| if x.is_finite() { x } else { 0.0 }));
    let corners = |t: &[u32; 3]| t.map(|i| finite(positions[i as usize]));
    let whole = triangles.par_iter().with_min_len(GRAIN).map(|t| Aabb::from_points(&corners(t)));
    let cube = UnitCube::of(&whole.reduce(|| Aabb::INVALID, |a, b| a.union(&b)));
    let triangle = |t: &[u32; 3]| {
        let [v0, v1, v2] = corners(t).map(|p| cube.point(p));
        Triangle { v0, v1, v2 }
    };
    let mut boxes: Vec<Aabb> = triangles.par_iter().with_min_len(GRAIN).map(|t| triangle(t).aabb()).collect();
    let mut indices: Vec<u32> = (0..triangles.len() as u32).collect();
    if params.pre_split {
        let triangles: Vec<Triangle> = triangles.par_iter().map(triangle).collect();
        let mean = boxes.iter().map(Aabb::half_area).sum::<f32>() / boxes.len() as f32;
        let largest = boxes.iter().map(Aabb::half_area).fold(0.0, f32::max);
        split_aabbs_preset(&mut boxes, &mut indices, &triangles, mean, largest);
    }
    boxes.par_iter_mut().with_min_len(GRAIN).enumerate().for_each(|(i, b)| jitter(b, i as u32));

    let mut bvh = PlocBuilder::with_capacity(boxes.len()).build(
        params.ploc_search_distance,
        &boxes,
        indices,
        params.sort_precision,
        params.search_depth_threshold,
    );
    if params.reinsertion_batch_ratio > 0.0 {
        ReinsertionOptimizer::default().run(&mut bvh, params.reinsertion_batch_ratio, None);
    }
    bvh
}

/// Moves and scales a scene (all axes alike) into the unit cube, so that no area overflows or underflows and floats are
/// fine where the triangles are.
struct UnitCube {
    half_min: Vec3A,
    scale: f32,
}

impl UnitCube {
    fn of(whole: &Aabb) -> Self {
        let half_extent = (0.5 * whole.max - 0.5 * whole.min).max_element();
        Self {
            half_min: 0.5 * whole.min,
            scale: if half_extent > f32::MIN_POSITIVE { 1.0 / half_extent } else { 0.0 },
        }
    }

    fn point(&self, p: Vec3A) -> Vec3A {
        (0.5 * p - self.half_min) * self.scale
    }
}

/// Grows a box a little, each side differently. Clustering merges boxes that are each other's best partner; among equal
/// boxes (coincident triangles) every box's best partner would be the next, one pair would be merged in each pass, and
/// the time would be quadratic.
fn jitter(b: &mut Aabb, index: u32) {
    const SCENE: f32 = 1.0 / 65536.0;
    const BOX: f32 = 1.0 / 1024.0;
    let size = b.max - b.min;
    let reach = SCENE + BOX * size.max_element();
    let mut state = index;
    let mut next = || {
        state = mix(state.wrapping_add(0x9e37_79b9));
        reach * (state >> 8) as f32 / (1 << 24) as f32
    };
    b.min -= Vec3A::new(next(), next(), next());
    b.max += Vec3A::new(next(), next(), next());
}

/// Mixes the bits of an integer (Wellons' lowbias32, hash-prospector).
fn mix(mut x: u32) -> u32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}
