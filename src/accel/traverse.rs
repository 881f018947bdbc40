//! One ray through one tree.

use super::HitOrder;
use super::Ray;
use super::lanes::Lanes8;
use super::slab::SlabRay;
use super::stack::{Stack, Waiting};
use super::tree::{Block, LEAF, Node, Tree};
use super::triangle::{Search, ShearRay, distance_in_plane};

/// A triangle of a tree that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Found {
    /// Its number.
    pub(crate) triangle: u32,
    /// Weights of its second and third corner; 0 where any triangle would do.
    pub(crate) barycentric: [f32; 2],
}

/// A ray's way down through nodes: leaf after leaf, those that it enters first before the others.
pub(crate) struct Descent<'a, L> {
    nodes: &'a [Node],
    slab: SlabRay<L>,
    stack: Stack,
    /// Whether the root is still to be looked at.
    is_new: bool,
}

impl<'a, L: Lanes8> Descent<'a, L> {
    #[inline(always)]
    pub(crate) fn new(nodes: &'a [Node], ray: &Ray) -> Self {
        Self { nodes, slab: SlabRay::new(ray), stack: Stack::new(), is_new: true }
    }

    /// The next leaf that is entered not after a distance.
    #[inline(always)]
    pub(crate) fn next_leaf(&mut self, distance: f32) -> Option<usize> {
        let mut node = if self.is_new {
            self.is_new = false;
            0
        } else {
            let child = self.stack.pop_before(distance)?;
            if child & LEAF != 0 {
                return Some((child & !LEAF) as usize);
            }
            child
        };
        loop {
            let child =
                match nearest_child(self.nodes.get(node as usize)?, &self.slab, distance, &mut self.stack) {
                    Some(child) => child,
                    None => self.stack.pop_before(distance)?,
                };
            if child & LEAF != 0 {
                return Some((child & !LEAF) as usize);
            }
            node = child;
        }
    }
}

impl Tree {
    /// Looks for a candidate; `first` is the primitive number of the tree's triangle 0. With ANY the first one found
    /// ends the search, else `search` ends before the first in the order, which is returned.
    #[inline(always)]
    pub(crate) fn search<L: Lanes8, const ANY: bool>(
        &self,
        ray: &Ray,
        first: u32,
        search: &mut Search,
    ) -> Option<Found> {
        let mut descent = Descent::<L>::new(&self.nodes, ray);
        // most rays of many a picture end here
        let mut leaf = descent.next_leaf(search.before.distance)?;
        let scalar_slab = SlabRay::new(ray);
        let shear = ShearRay::<L>::new(ray);
        let mut found = None;
        loop {
            let block = &self.blocks[leaf];
            if let Some(nearer) = search_block::<L, ANY>(block, &shear, || scalar_slab, first, search) {
                found = Some(nearer);
                if ANY {
                    return found;
                }
            }
            match descent.next_leaf(search.before.distance) {
                Some(next) => leaf = next,
                None => return found,
            }
        }
    }
}

/// The child that a ray enters first of those that it enters not after a distance; the others wait.
#[inline(always)]
fn nearest_child<L: Lanes8>(node: &Node, slab: &SlabRay<L>, distance: f32, stack: &mut Stack) -> Option<u32> {
    let [sx, sy, sz] = slab.near_side;
    let planes = &node.planes;
    let (entry, exit) = slab.pass(
        [L::load(&planes[sx][0]), L::load(&planes[sy][1]), L::load(&planes[sz][2])],
        [L::load(&planes[1 - sx][0]), L::load(&planes[1 - sy][1]), L::load(&planes[1 - sz][2])],
    );
    // of a ray that is not finite the exit may be NaN; then it stays so, and nothing is entered
    let mut entered = entry.le(L::splat(distance).min(exit));
    if entered == 0 {
        return None;
    }
    let first = entered.trailing_zeros() as usize & 7;
    entered &= entered - 1;
    if entered == 0 {
        return Some(node.children[first]);
    }
    let entries = entry.store();
    let waiting = |lane: usize| Waiting::new(entries[lane], node.children[lane]);
    let mut nearest = waiting(first);
    let floor = stack.len();
    while entered != 0 {
        let next = waiting(entered.trailing_zeros() as usize & 7);
        entered &= entered - 1;
        stack.insert(nearest.max(next), floor);
        nearest = nearest.min(next);
    }
    Some(nearest.child())
}

/// Tests the triangles of a leaf; gives the first in the order of those that are admitted.
#[inline(always)]
pub(crate) fn search_block<L: Lanes8, const ANY: bool>(
    block: &Block,
    shear: &ShearRay<L>,
    slab: impl Fn() -> SlabRay<f32>,
    first: u32,
    search: &mut Search,
) -> Option<Found> {
    let [kx, ky, kz] = shear.axes;
    let corner = |c: &[[f32; 8]; 3]| [L::load(&c[kx]), L::load(&c[ky]), L::load(&c[kz])];
    let edges = shear.edges(corner(&block.corners[0]), corner(&block.corners[1]), corner(&block.corners[2]));
    let mut inside = edges.inside();
    if inside == 0 {
        return None;
    }
    let t = shear.plane(&edges);
    inside &= L::splat(0.0).lt(t) & t.le(L::splat(search.before.distance));
    if inside == 0 {
        return None;
    }
    let t = t.store();
    let mut found = None;
    while inside != 0 {
        let lane = inside.trailing_zeros() as usize & 7;
        inside &= inside - 1;
        let Some(distance) = distance_in_plane(&slab(), &block.corners_of(lane), t[lane]) else { continue };
        let candidate = HitOrder { distance, primitive: first.wrapping_add(block.triangles[lane]) };
        if search.admits(candidate) {
            if ANY {
                return Some(Found { triangle: block.triangles[lane], barycentric: [0.0; 2] });
            }
            search.before = candidate;
            found = Some(lane);
        }
    }
    let lane = found?;
    let [v, w] = edges.barycentric();
    Some(Found { triangle: block.triangles[lane], barycentric: [v.store()[lane], w.store()[lane]] })
}
