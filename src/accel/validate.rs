//! Checks a tree against the mesh that it was built over.

use super::slab::Aabb;
use super::tree::{LEAF, MAX_DEPTH, NO_CHILD, NO_TRIANGLE, Tree, WIDTH};
use super::triangle::has_area;

/// Checks that every triangle stands in a leaf, with its corners as they are, that every box contains those below it,
/// down to the triangles' own boxes, that levels are as the traversal and a pass from below need them, and that the
/// depth is bounded. Gives what is wrong.
pub fn validate(tree: &Tree, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<(), String> {
    if tree.triangle_count as usize != triangles.len() {
        return Err(format!("built over {} triangles, not {}", tree.triangle_count, triangles.len()));
    }
    if tree.levels.len() > MAX_DEPTH {
        return Err(format!("{} levels", tree.levels.len()));
    }
    let mut parents = vec![0_u32; tree.nodes.len()];
    let mut leaf_parents = vec![0_u32; tree.blocks.len()];
    let mut seen = vec![false; triangles.len()];
    let mut next = 0;
    for level in &tree.levels {
        if level.start != next {
            return Err(format!("level {level:?} does not start at {next}"));
        }
        next = level.end;
        for i in level.clone() {
            for lane in 0..WIDTH {
                let (child, b) = (tree.nodes[i].children[lane], tree.nodes[i].child_box(lane));
                if child == NO_CHILD {
                    if b != Aabb::EMPTY {
                        return Err(format!("node {i}, lane {lane}: no child, but {b:?}"));
                    }
                } else if child & LEAF != 0 {
                    let block = (child & !LEAF) as usize;
                    leaf_parents[block] += 1;
                    check_block(tree, block, &b, positions, triangles, &mut seen)?;
                } else {
                    let child = child as usize;
                    parents[child] += 1;
                    if child < level.end || !b.contains(&tree.nodes[child].bounds()) {
                        return Err(format!(
                            "node {i}, lane {lane}: child {child} is not below or not inside"
                        ));
                    }
                }
            }
        }
    }
    if let Some(i) = (1..parents.len()).find(|&i| parents[i] != 1) {
        return Err(format!("node {i} has {} parents", parents[i]));
    }
    if let Some(i) = leaf_parents.iter().position(|&p| p != 1) {
        return Err(format!("leaf {i} has {} parents", leaf_parents[i]));
    }
    match seen.iter().position(|s| !s) {
        Some(i) => Err(format!("triangle {i} stands in no leaf")),
        None => Ok(()),
    }
}

fn check_block(
    tree: &Tree,
    block: usize,
    leaf_box: &Aabb,
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
    seen: &mut [bool],
) -> Result<(), String> {
    let block = &tree.blocks[block];
    for (lane, &triangle) in block.triangles.iter().enumerate().filter(|&(_, &t)| t != NO_TRIANGLE) {
        let corners = triangles[triangle as usize].map(|i| positions[i as usize]);
        seen[triangle as usize] = true;
        if has_area(&corners) {
            if block.corners_of(lane) != corners {
                return Err(format!("triangle {triangle}: {:?}, not {corners:?}", block.corners_of(lane)));
            }
            if !leaf_box.contains(&Aabb::own(&corners)) {
                return Err(format!("triangle {triangle}: its own box is not inside its leaf's"));
            }
        } else if !block.corners_of(lane).as_flattened().iter().all(|x| x.is_nan()) {
            return Err(format!("triangle {triangle} has no area but can be hit"));
        }
    }
    Ok(())
}
