//! The shape of a tree as words: what a build decides; boxes and corners follow from the mesh.

use super::collapse::Shape;
use super::tree::{LEAF, MAX_DEPTH, NO_CHILD, NO_TRIANGLE, Tree, WIDTH};

/// Counts of nodes, blocks and levels before them.
const HEAD: usize = 3;

impl Tree {
    /// Its shape, for [`Tree::from_shape`].
    pub fn shape(&self) -> Vec<u32> {
        let mut words = vec![self.nodes.len() as u32, self.blocks.len() as u32, self.levels.len() as u32];
        words.extend(self.levels.iter().map(|level| level.end as u32));
        words.extend(self.nodes.iter().flat_map(|node| node.children));
        words.extend(self.blocks.iter().flat_map(|block| block.triangles));
        words
    }

    /// A tree of that shape over a mesh of which each triangle stands in some leaf; None where the words are no shape of
    /// such a tree.
    pub fn from_shape(words: &[u32], positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Option<Self> {
        let shape = read(words)?;
        is_sound(&shape, triangles.len()).then(|| Self::fit(shape, positions, triangles))
    }
}

fn read(words: &[u32]) -> Option<Shape> {
    let [nodes, blocks, levels] = *words.first_chunk::<HEAD>()?;
    let lanes = |count: u32| (count as usize).checked_mul(WIDTH);
    let after_levels = HEAD.checked_add(levels as usize)?;
    let after_nodes = after_levels.checked_add(lanes(nodes)?)?;
    let end = after_nodes.checked_add(lanes(blocks)?)?;
    if words.len() != end {
        return None;
    }
    let mut start = 0;
    let levels = words[HEAD..after_levels].iter().map(|&end| {
        let level = start..end as usize;
        start = end as usize;
        level
    });
    Some(Shape {
        levels: levels.collect(),
        children: words[after_levels..after_nodes].as_chunks::<WIDTH>().0.to_vec(),
        blocks: words[after_nodes..end].as_chunks::<WIDTH>().0.to_vec(),
    })
}

/// Whether levels cover the nodes in order, each node and block but the root has one parent, nodes a level above, and
/// each triangle stands somewhere.
fn is_sound(shape: &Shape, triangles: usize) -> bool {
    let nodes = shape.children.len();
    if shape.levels.len() > MAX_DEPTH || shape.levels.last().map_or(0, |level| level.end) != nodes {
        return false;
    }
    let (mut node_parents, mut block_parents) = (vec![0_u32; nodes], vec![0_u32; shape.blocks.len()]);
    for (i, level) in shape.levels.iter().enumerate() {
        if level.start >= level.end || level.end > nodes {
            return false;
        }
        let below = shape.levels.get(i + 1).cloned().unwrap_or(nodes..nodes);
        for &child in shape.children[level.clone()].as_flattened().iter().filter(|c| **c != NO_CHILD) {
            if child & LEAF != 0 {
                let Some(parents) = block_parents.get_mut((child & !LEAF) as usize) else { return false };
                *parents += 1;
            } else if below.contains(&(child as usize)) {
                node_parents[child as usize] += 1;
            } else {
                return false;
            }
        }
    }
    let mut seen = vec![false; triangles];
    for block in &shape.blocks {
        let count = block.iter().take_while(|t| **t != NO_TRIANGLE).count();
        if block[count..].iter().any(|t| *t != NO_TRIANGLE) {
            return false;
        }
        for &triangle in &block[..count] {
            match seen.get_mut(triangle as usize) {
                Some(seen) => *seen = true,
                None => return false,
            }
        }
    }
    let once = |parents: &[u32]| parents.iter().all(|p| *p == 1);
    node_parents.get(1..).is_none_or(once)
        && node_parents.first().is_none_or(|p| *p == 0)
        && once(&block_parents)
        && seen.iter().all(|s| *s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::{Quality, validate};

    #[test]
    fn a_tree_of_a_stored_shape_is_the_tree() {
        let positions: Vec<[f32; 3]> =
            (0..300_u32).map(|i| [i * 37 % 101, i * 53 % 103, i].map(|x| x as f32)).collect();
        let triangles: Vec<[u32; 3]> = (0..100).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        for quality in Quality::ALL {
            let tree = Tree::build(&positions, &triangles, quality);
            let words = tree.shape();
            let again = Tree::from_shape(&words, &positions, &triangles).unwrap();
            assert_eq!(validate(&again, &positions, &triangles), Ok(()));
            assert_eq!((again.counts(), again.cost()), (tree.counts(), tree.cost()));
            assert!(Tree::from_shape(&words, &positions, &triangles[1..]).is_none());
            assert!(Tree::from_shape(&words[1..], &positions, &triangles).is_none());
            // no byte of it may do harm: what is taken is a sound tree
            for at in 0..4 * words.len() {
                let mut changed = words.clone();
                changed[at / 4] ^= 0x81 << (8 * (at % 4));
                if let Some(tree) = Tree::from_shape(&changed, &positions, &triangles) {
                    assert_eq!(validate(&tree, &positions, &triangles), Ok(()), "byte {at}");
                }
            }
        }
        let empty = Tree::build(&[], &[], Quality::Fastest);
        assert!(Tree::from_shape(&empty.shape(), &[], &[]).is_some());
    }
}
