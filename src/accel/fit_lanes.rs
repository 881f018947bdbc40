//! What a refit does with a block and with a node: the eight triangles, or children, side by side.

use super::lanes::{InLanes, Lanes, Lanes8, per_axis, per_lane};
use super::slab::{Aabb, own_margin};
use super::tree::{Block, LEAF, NO_TRIANGLE, Node, WIDTH};
use super::triangle::{has_area, surely_have_area};

/// A box as a row: the greater it is, the greater is each of its floats, so that boxes are joined by one maximum.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Row([f32; 8]);

impl Row {
    pub(crate) const EMPTY: Self = Self([f32::NEG_INFINITY; 8]);

    /// The lesser side negated, one float of no meaning, the greater side, another.
    #[inline(always)]
    fn halves(&self) -> [&[f32; 4]; 2] {
        let (halves, _) = self.0.as_chunks::<4>();
        [&halves[0], &halves[1]]
    }
}

/// Positions, of which each can be read as four floats.
pub(crate) struct Positions<'a> {
    floats: &'a [f32],
    /// The last position, which has no float after it.
    last: [f32; 4],
}

impl<'a> Positions<'a> {
    pub(crate) fn new(positions: &'a [[f32; 3]]) -> Self {
        let [x, y, z] = positions.last().copied().unwrap_or_default();
        Self { floats: positions.as_flattened(), last: [x, y, z, 0.0] }
    }

    /// A vertex's position and a float that means nothing.
    #[inline(always)]
    fn of(&self, vertex: u32) -> &[f32; 4] {
        let at = 3 * vertex as usize;
        match self.floats.get(at..at + 4).and_then(|p| p.first_chunk()) {
            Some(position) => position,
            None => self.last(at),
        }
    }

    #[cold]
    fn last(&self, at: usize) -> &[f32; 4] {
        assert_eq!(at + 3, self.floats.len(), "a corner is one of the positions");
        &self.last
    }
}

/// Takes the corners of some blocks, and gives the box of all corners; their own boxes go to rows. A block whose corners
/// are those that it has is left alone with its row.
pub(crate) struct FitBlocks<'a> {
    pub(crate) blocks: &'a mut [Block],
    /// Their vertices, as [`Tree::vertices`](super::tree::Tree::vertices).
    pub(crate) vertices: &'a [[[u32; WIDTH]; 3]],
    pub(crate) rows: &'a mut [Row],
    /// Whether a block is not left alone.
    pub(crate) moved: &'a mut [bool],
    /// Whether none is.
    pub(crate) all: bool,
    pub(crate) positions: &'a Positions<'a>,
}

impl InLanes for FitBlocks<'_> {
    type Output = Aabb;

    #[inline(always)]
    fn compute<L: Lanes8>(self) -> Aabb {
        let mut least = [L::splat(f32::INFINITY); 3];
        let mut greatest = [L::splat(f32::NEG_INFINITY); 3];
        let Self { blocks, vertices, rows, moved, all, positions } = self;
        for (((block, vertices), row), moved) in blocks.iter_mut().zip(vertices).zip(rows).zip(moved) {
            let [min, max] = fit_block::<L>(block, vertices, row, moved, all, positions);
            // the second is given where the first is NaN
            least = per_axis(|k| min[k].min(least[k]));
            greatest = per_axis(|k| max[k].max(greatest[k]));
        }
        let (least, greatest) = (stored(least), stored(greatest));
        let fold = |lanes: &[f32; 8], of: fn(f32, f32) -> f32| {
            // + 0: a zero has one sign, whatever the order
            lanes.iter().copied().fold(lanes[0], of) + 0.0
        };
        Aabb {
            min: per_axis(|k| fold(&least[k], Lanes::min)),
            max: per_axis(|k| fold(&greatest[k], Lanes::max)),
        }
    }
}

/// Takes a block's corners; what has no area becomes NaN, which no test hits. Gives the least and greatest corners of
/// each triangle.
#[inline(always)]
fn fit_block<L: Lanes8>(
    block: &mut Block,
    vertices: &[[u32; WIDTH]; 3],
    row: &mut Row,
    moved: &mut bool,
    all: bool,
    positions: &Positions,
) -> [[L; 3]; 2] {
    let numbers = block.triangles;
    // no closure, which might not be inlined
    let mut corners = [[L::splat(0.0); 3]; 3];
    for (corner, vertices) in corners.iter_mut().zip(vertices) {
        *corner = L::transpose(per_lane(|i| positions.of(vertices[i])));
    }
    let mut nothing = per_lane(|i| if numbers[i] == NO_TRIANGLE { f32::NAN } else { -0.0 });
    let present = clear(&mut corners, &nothing);
    *moved = all || !holds(block, &corners);
    if !*moved {
        return sides(&corners);
    }
    let doubtful = present & !surely_have_area(&corners);
    if doubtful != 0 {
        clear_without_area(doubtful, &per_axis(|k| stored(corners[k])), &mut nothing);
        clear(&mut corners, &nothing);
    }
    let [least, greatest] = sides(&corners);
    let margin = own_margin(per_axis(|k| greatest[k].sub(least[k])));
    // the next float is monotonic: the greatest's is the greatest
    let empty = L::splat(f32::NEG_INFINITY);
    let [lx, ly, lz] = per_axis(|k| margin.sub(least[k]).max(empty));
    let [gx, gy, gz] = per_axis(|k| greatest[k].add(margin).max(empty));
    row.0 = L::greatest_of_each([lx, ly, lz, lz, gx, gy, gz, gz]).next_up().store();
    block.corners = per_axis(|k| stored(corners[k]));
    [least, greatest]
}

/// The least and greatest corners of each triangle.
#[inline(always)]
fn sides<L: Lanes8>([a, b, c]: &[[L; 3]; 3]) -> [[L; 3]; 2] {
    [per_axis(|k| a[k].min(b[k].min(c[k]))), per_axis(|k| a[k].max(b[k].max(c[k])))]
}

/// Whether a block has these corners, bit for bit.
#[inline(always)]
fn holds<L: Lanes8>(block: &Block, corners: &[[L; 3]; 3]) -> bool {
    let held = block.corners.as_flattened().iter().zip(corners.as_flattened());
    held.fold(L::splat(0.0), |differ, (held, x)| differ.or_differing(L::load(held), *x)).is_zero()
}

/// Makes NaN of lanes where `nothing` is; -0 there leaves them as they are. Gives the others.
#[inline(always)]
fn clear<L: Lanes8>(corners: &mut [[L; 3]; 3], nothing: &[f32; WIDTH]) -> u32 {
    let nothing = L::load(nothing);
    for x in corners.as_flattened_mut() {
        *x = x.add(nothing);
    }
    nothing.le(L::splat(0.0))
}

#[inline(always)]
fn stored<L: Lanes8>(of: [L; 3]) -> [[f32; WIDTH]; 3] {
    per_axis(|k| of[k].store())
}

/// NaN in lanes that have no area after all.
#[cold]
#[inline(never)]
fn clear_without_area(doubtful: u32, corners: &[[[f32; WIDTH]; 3]; 3], nothing: &mut [f32; WIDTH]) {
    for (lane, nothing) in nothing.iter_mut().enumerate() {
        let corners = per_axis(|corner| per_axis(|k| corners[corner][k][lane]));
        if doubtful >> lane & 1 == 1 && !has_area(&corners) {
            *nothing = f32::NAN;
        }
    }
}

/// Takes the boxes of the children of some nodes of a level; the nodes' own go to rows, the sums of their children's
/// half surfaces to `half_areas`.
pub(crate) struct FitNodes<'a> {
    pub(crate) nodes: &'a mut [Node],
    pub(crate) rows: &'a mut [Row],
    pub(crate) half_areas: &'a mut [f64],
    /// Whether a node is not left alone, as those are that have no moved child.
    pub(crate) moved: &'a mut [bool],
    /// The rows of all nodes below, then of all leaves.
    pub(crate) below: &'a [Row],
    /// Which of those below moved.
    pub(crate) moved_below: &'a [bool],
    /// The node of the first of those.
    pub(crate) first: usize,
    /// The place of the first leaf among them.
    pub(crate) first_leaf: usize,
    /// Whether none is left alone.
    pub(crate) all: bool,
}

impl InLanes for FitNodes<'_> {
    type Output = ();

    #[inline(always)]
    fn compute<L: Lanes8>(self) {
        let Self { nodes, rows, half_areas, below, first, first_leaf, moved, moved_below, all } = self;
        for (((node, row), half_area), moved) in nodes.iter_mut().zip(rows).zip(half_areas).zip(moved) {
            // what is not there has a place beyond all
            let places = per_lane(|i| {
                let child = node.children[i];
                let leaf = (child & !LEAF) as usize + first_leaf;
                if child & LEAF == 0 { (child as usize).wrapping_sub(first) } else { leaf }
            });
            *moved = all || places.iter().fold(false, |any, &i| any | moved_below.get(i).is_some_and(|m| *m));
            if !*moved {
                continue;
            }
            let children = per_lane(|i| below.get(places[i]).unwrap_or(&Row::EMPTY));
            let [a, b, c, d, e, f, g, h] = per_lane(|i| L::load(&children[i].0));
            row.0 = a.max(b).max(c.max(d)).max(e.max(f).max(g.max(h))).store();
            let less = L::transpose(per_lane(|i| children[i].halves()[0]));
            let greater = L::transpose(per_lane(|i| children[i].halves()[1]));
            node.planes = [stored(per_axis(|k| L::splat(0.0).sub(less[k]))), stored(greater)];
            *half_area = half_surfaces(&node.planes);
        }
    }
}

/// The sum of the children's half surfaces; an empty box has none.
#[inline(always)]
fn half_surfaces([min, max]: &[[[f32; WIDTH]; 3]; 2]) -> f64 {
    let mut areas = [0.0; WIDTH];
    for (lane, area) in areas.iter_mut().enumerate() {
        let [x, y, z] = per_axis(|k| f64::from(max[k][lane]) - f64::from(min[k][lane]));
        *area = if min[0][lane] > max[0][lane] { 0.0 } else { x * y + y * z + z * x };
    }
    let [a, b, c, d, e, f, g, h] = areas;
    ((a + e) + (b + f)) + ((c + g) + (d + h))
}
