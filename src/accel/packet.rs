//! Rays side by side through one tree: what is coherent is decided once for all of them. Boxes are first tested against
//! the interval of all rays, eight children at once, then a child's box against each ray. Every rounding is monotonic,
//! so the interval's entry is not after any ray's, and the answers are those of single rays.

use super::Ray;
use super::interval::{Interval, PacketSlabs, RAYS, greatest};
use super::lanes::Lanes8;
use super::stack::{Stack, Waiting};
use super::traverse::{Found, search_block};
use super::tree::{LEAF, Node, Tree, WIDTH};
use super::triangle::{Search, ShearRay};

impl Tree {
    /// [`Tree::search`] for a packet of finite rays of which the boxes' sides are met in the same order; gives false
    /// where they are not. `note` is told the ray and the triangle, each time one is found.
    #[inline(always)]
    pub(crate) fn search_packet<L: Lanes8, const ANY: bool>(
        &self,
        rays: &[Ray],
        first: u32,
        searches: &mut [Search; RAYS],
        mut note: impl FnMut(usize, Found),
    ) -> bool {
        let Some(slabs) = PacketSlabs::<L>::new(rays) else { return false };
        let mut ends = [f32::NEG_INFINITY; RAYS];
        for (end, search) in ends.iter_mut().zip(&searches[..rays.len()]) {
            *end = search.before.distance;
        }
        let mut last_end = greatest::<L>(&ends);
        let mut stack = Stack::new();
        if !self.nodes.is_empty() {
            push_children(&self.nodes, 0, &slabs.interval, last_end, &mut stack);
        }
        if stack.len() == 0 {
            return true;
        }
        let mut shears = [ShearRay::<f32>::new(&rays[0]); RAYS];
        for (shear, ray) in shears.iter_mut().zip(rays).skip(1) {
            *shear = ShearRay::new(ray);
        }
        loop {
            let Some(waiting) = stack.pop_before(last_end) else { return true };
            let (parent, lane) = (waiting as usize / WIDTH, waiting as usize % WIDTH);
            let parent = &self.nodes[parent];
            let child_box = parent.child_box(lane);
            let mut entered = 0_u64;
            for (g, (slab, ends)) in slabs.groups.iter().zip(ends.as_chunks::<WIDTH>().0).enumerate() {
                entered |= u64::from(slab.enters(&child_box, L::load(ends))) << (g * WIDTH);
            }
            if entered == 0 {
                continue;
            }
            let child = parent.children[lane];
            if child & LEAF == 0 {
                push_children(&self.nodes, child as usize, &slabs.interval, last_end, &mut stack);
                continue;
            }
            let block = &self.blocks[(child & !LEAF) as usize];
            let mut is_nearer = false;
            while entered != 0 {
                let i = entered.trailing_zeros() as usize % RAYS;
                entered &= entered - 1;
                let shear = shears[i].splat::<L>();
                let found = search_block::<L, ANY>(block, &shear, || slabs.ray(i), first, &mut searches[i]);
                if let Some(found) = found {
                    note(i, found);
                    if ANY {
                        searches[i].end();
                    }
                    ends[i] = searches[i].before.distance;
                    is_nearer = true;
                }
            }
            if is_nearer {
                last_end = greatest::<L>(&ends);
            }
        }
    }
}

/// Adds the children of a node that a ray may enter not after a distance, as the number of the node times eight plus the
/// lane.
#[inline(always)]
pub(crate) fn push_children<L: Lanes8>(
    nodes: &[Node],
    node: usize,
    interval: &Interval<L>,
    end: f32,
    stack: &mut Stack,
) {
    let (entry, exit) = interval.pass(&nodes[node].planes);
    let mut entered = entry.le(L::splat(end).min(exit));
    let entries = entry.store();
    let floor = stack.len();
    while entered != 0 {
        let lane = entered.trailing_zeros() as usize % WIDTH;
        entered &= entered - 1;
        stack.insert(Waiting::new(entries[lane], (node * WIDTH + lane) as u32), floor);
    }
}
