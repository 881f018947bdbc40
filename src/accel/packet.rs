//! Rays side by side through one tree: what is coherent is decided once for all of them. Boxes are first tested against
//! the interval of all rays, eight children at once, then a child's box against each ray. Every rounding is monotonic,
//! so the interval's entry is not after any ray's, and the answers are those of single rays. A leaf's triangles are
//! tested side by side against one ray, or one by one against eight rays, whichever is less.

use super::interval::{GROUPS, Interval, PacketShears, PacketSlabs, RAYS, greatest};
use super::lanes::Lanes8;
use super::slab::SlabRay;
use super::stack::{Stack, Waiting};
use super::traverse::{Found, search_block};
use super::tree::{Block, LEAF, NO_TRIANGLE, Node, Tree, WIDTH};
use super::triangle::{Search, ShearRay, distance_in_plane};
use super::{HitOrder, Ray};

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
        let shears = PacketShears::new::<L>(&slabs);
        loop {
            let Some(waiting) = stack.pop_before(last_end) else { return true };
            let (parent, lane) = (waiting as usize / WIDTH, waiting as usize % WIDTH);
            let parent = &self.nodes[parent];
            let (child, child_box) = (parent.children[lane], parent.child_box(lane));
            let ends_of = ends.as_chunks::<WIDTH>().0;
            let mut entered = u64::from(slabs.groups[0].enters(&child_box, L::load(&ends_of[0])));
            if child & LEAF == 0 {
                if entered != 0 || slabs.groups[1].enters(&child_box, L::load(&ends_of[1])) != 0 {
                    push_children(&self.nodes, child as usize, &slabs.interval, last_end, &mut stack);
                }
                continue;
            }
            entered |= u64::from(slabs.groups[1].enters(&child_box, L::load(&ends_of[1]))) << WIDTH;
            let block = &self.blocks[(child & !LEAF) as usize];
            let mut is_nearer = false;
            let mut note = |i: usize, found: Found, search: &mut Search| {
                note(i, found);
                if ANY {
                    search.end();
                }
                ends[i] = search.before.distance;
                is_nearer = true;
            };
            for g in 0..GROUPS {
                let of_group = (entered >> (g * WIDTH)) as u32 & 0xff;
                // where there are fewer triangles than rays
                if of_group == 0 || block.triangles[of_group.count_ones() as usize - 1] != NO_TRIANGLE {
                    continue;
                }
                let Some(shear) = shears.group(&slabs, g) else { break };
                entered &= !(0xff << (g * WIDTH));
                search_triangles::<L, ANY>(
                    block,
                    &shear,
                    of_group,
                    |i| slabs.ray(g * WIDTH + i),
                    first,
                    &mut searches[g * WIDTH..][..WIDTH],
                    |i, found, search| note(g * WIDTH + i, found, search),
                );
            }
            while entered != 0 {
                let i = entered.trailing_zeros() as usize % RAYS;
                entered &= entered - 1;
                let shear = shears.ray::<L>(&slabs, i);
                let found = search_block::<L, ANY>(block, &shear, || slabs.ray(i), first, &mut searches[i]);
                if let Some(found) = found {
                    note(i, found, &mut searches[i]);
                }
            }
            if is_nearer {
                last_end = greatest::<L>(&ends);
            }
        }
    }
}

/// Tests the triangles of a leaf one by one against rays side by side, as [`search_block`] tests them side by side
/// against one ray.
#[inline(always)]
fn search_triangles<L: Lanes8, const ANY: bool>(
    block: &Block,
    shear: &ShearRay<L>,
    mut entered: u32,
    slab: impl Fn(usize) -> SlabRay<f32>,
    first: u32,
    searches: &mut [Search],
    mut note: impl FnMut(usize, Found, &mut Search),
) {
    let [kx, ky, kz] = shear.axes;
    for (lane, &triangle) in block.triangles.iter().enumerate() {
        if triangle == NO_TRIANGLE {
            return;
        }
        let corner =
            |c: &[[f32; WIDTH]; 3]| [L::splat(c[kx][lane]), L::splat(c[ky][lane]), L::splat(c[kz][lane])];
        let edges =
            shear.edges(corner(&block.corners[0]), corner(&block.corners[1]), corner(&block.corners[2]));
        let mut inside = edges.inside() & entered;
        if inside == 0 {
            continue;
        }
        let t = shear.plane(&edges);
        inside &= L::splat(0.0).lt(t);
        if inside == 0 {
            continue;
        }
        let t = t.store();
        let corners = block.corners_of(lane);
        let [v, w] = edges.barycentric();
        let [v, w] = [v.store(), w.store()];
        while inside != 0 {
            let i = inside.trailing_zeros() as usize % WIDTH;
            inside &= inside - 1;
            let search = &mut searches[i];
            if t[i] > search.before.distance {
                continue;
            }
            let Some(distance) = distance_in_plane(&slab(i), &corners, t[i]) else { continue };
            let candidate = HitOrder { distance, primitive: first.wrapping_add(triangle) };
            if !search.admits(candidate) {
                continue;
            }
            if ANY {
                entered &= !(1 << i);
                note(i, Found { triangle, barycentric: [0.0; 2] }, search);
            } else {
                search.before = candidate;
                note(i, Found { triangle, barycentric: [v[i], w[i]] }, search);
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
