//! What kernels read of a frame's parts, as bytes.

use super::records::ABSENT;
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

/// The slots of triangles: the first triangle of the last slot, that slot, then the slots of the triangles before it, so that
/// it does not depend on how many follow. A budget counts the runs instead, but also the faces, which a GPU does not hold.
pub(super) fn triangle_slots(runs: &[[u32; 2]]) -> Vec<u32> {
    let Some(&[last_first, last_slot]) = runs.last() else { return Vec::new() };
    let mut words = vec![ABSENT; 2 + last_first as usize];
    (words[0], words[1]) = (last_first, last_slot);
    for (&[first, slot], &[next, _]) in runs.iter().zip(&runs[1..]) {
        words[2 + first as usize..2 + next as usize].fill(slot);
    }
    words
}

/// The words of a part that kernels read as it stands.
pub(super) fn words(part: PartHash, geometry: &Geometry) -> Option<&[u32]> {
    let Geometry { positions, triangles, texcoords, normals, colors, .. } = geometry;
    if part == positions.hash() {
        return Some(bytemuck::cast_slice(&positions.0));
    }
    if part == triangles.hash() {
        return Some(bytemuck::cast_slice(&triangles.0));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_find_their_slots() {
        assert_eq!(triangle_slots(&[]), [0_u32; 0]);
        assert_eq!(triangle_slots(&[[0, 7]]), [0, 7]);
        // triangles 0 and 1 have none; 2 to 4 slot 5, then one without, from 6 on slot 1
        let runs = [[2, 5], [5, ABSENT], [6, 1]];
        assert_eq!(triangle_slots(&runs), [6, 1, ABSENT, ABSENT, 5, 5, 5, ABSENT]);
    }
}
