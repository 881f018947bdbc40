//! What kernels read of a frame's parts, as bytes.

use crate::accel::{Aabb, PackedNode};
use crate::scene::{Geometry, PartHash, Texels, Texture, Triangles};
use rayon::ThreadPool;
use rayon::prelude::*;

/// Triangles whose vertices one thread looks up together.
const GRAIN: usize = 4096;

/// For each place of a leaf the vertices of its triangle, and its number.
pub(super) fn vertices(order: &[u32], triangles: &Triangles, pool: &ThreadPool) -> Vec<[u32; 4]> {
    let of = |&number: &u32| {
        let [a, b, c] = triangles.0[number as usize];
        [a, b, c, number]
    };
    pool.install(|| order.par_iter().with_min_len(GRAIN).map(of).collect())
}

/// Counts a tree's nodes and triangles from the heaps' beginnings.
pub(super) fn move_nodes(nodes: &mut [PackedNode], first_node: u32, first_triangle: u32) {
    for node in nodes {
        node.child_base += first_node;
        node.triangle_base += first_triangle;
    }
}

/// The words of a part that kernels read.
pub(super) fn words(part: PartHash, geometry: &Geometry) -> Option<&[u8]> {
    let Geometry { positions, triangles, texcoords, normals, colors, material_runs, .. } = geometry;
    if part == positions.hash() {
        return Some(bytemuck::cast_slice(&positions.0));
    }
    if part == triangles.hash() {
        return Some(bytemuck::cast_slice(&triangles.0));
    }
    if part == material_runs.hash() {
        return Some(bytemuck::cast_slice(&material_runs.0));
    }
    if let Some(a) = texcoords {
        if part == a.values.hash() {
            return Some(bytemuck::cast_slice(&a.values.0));
        }
        if part == a.corners.hash() {
            return Some(bytemuck::cast_slice(&a.corners.0));
        }
    }
    if let Some(a) = normals {
        if part == a.values.hash() {
            return Some(bytemuck::cast_slice(&a.values.0));
        }
        if part == a.corners.hash() {
            return Some(bytemuck::cast_slice(&a.corners.0));
        }
    }
    colors.as_ref().filter(|c| part == c.hash()).map(|c| bytemuck::cast_slice(&c.0))
}

/// The texels as the device has them.
pub(super) fn texels(texture: &Texture) -> &[u8] {
    match &texture.texels {
        Texels::U8(texels) => bytemuck::cast_slice(texels),
        Texels::F32(texels) => bytemuck::cast_slice(texels),
    }
}

/// The box of what is finite of some positions, a little larger than any triangle's own box.
pub(super) fn world_box(positions: &[[f32; 3]], pool: &ThreadPool) -> Aabb {
    let finite = |p: &&[f32; 3]| p.iter().all(|x| x.is_finite());
    let point = |p: &[f32; 3]| Aabb { min: *p, max: *p };
    let union = |a: Aabb, b: Aabb| a.union(&b);
    pool.install(|| {
        positions.par_iter().with_min_len(GRAIN).filter(finite).map(point).reduce(|| Aabb::EMPTY, union)
    })
}
