//! The level above the trees of many objects: which of them a ray may meet, and in which order. Built for each frame, in
//! time that is nothing beside a tree's.

use super::Ray;
use super::packed::{PackedTree, fit, pack};
use super::placement::Placement;
use super::slab::Aabb;
use super::tree::{LEAF, NO_CHILD, Node, WIDTH};
use crate::math::Vec3;

/// From so many objects on it is faster than asking one after the other.
pub(super) const LEAST_OBJECTS: usize = 5;
/// How far from the world's origin rays may start, over how far the objects reach: beyond it they ask one after the
/// other. An object's box is widened by some ULP of that distance.
const REACH: f32 = 64.0;

/// Nodes whose leaves are objects: [`LEAF`] with the object's place.
#[derive(Clone, Debug)]
pub(crate) struct TopLevel {
    /// The root first.
    pub(crate) nodes: Vec<Node>,
    /// Rays whose origin is this far away at most, on each axis, find in `nodes` all that they meet.
    reach: f32,
}

impl TopLevel {
    /// Over objects of which `box_for` gives the box for rays that start where one does.
    pub(crate) fn build(objects: usize, box_for: impl Fn(usize, &Ray) -> Aabb) -> Self {
        let ray_from = |distance: f32| Ray { origin: Vec3::splat(distance), direction: Vec3::Z };
        let near = ray_from(0.0);
        let farthest = (0..objects)
            .map(|i| box_for(i, &near))
            .filter(|b| !b.is_empty())
            .flat_map(|b| [b.min, b.max])
            .flatten()
            .map(f32::abs)
            .filter(|x| x.is_finite())
            .fold(0.0, f32::max);
        // finite: infinity times the zeros of a margin would be NaN, and such a box is never entered
        let reach = (farthest * REACH).min(f32::MAX);
        let widest = ray_from(reach);
        let boxes = (0..objects).map(|i| (i as u32, box_for(i, &widest)));
        let mut boxes: Vec<(u32, Aabb)> = boxes.filter(|(_, b)| !b.is_empty()).collect();
        let mut nodes = Vec::new();
        add_node(&mut boxes, &mut nodes);
        Self { nodes, reach }
    }

    /// Whether a ray finds all that it meets.
    #[inline(always)]
    pub(crate) fn covers(&self, ray: &Ray) -> bool {
        // false for NaN
        ray.origin.abs().max_element() <= self.reach
    }
}

/// The level above objects for the GPU, packed: what stands at a leaf's places are objects.
#[derive(Clone, Debug, Default)]
pub struct PackedTop {
    /// Nodes and objects.
    pub tree: PackedTree,
    /// Rays whose origin is this far away at most, on each axis, find all that they meet.
    pub reach: f32,
}

impl PackedTop {
    /// Over objects: where each stands, and without a placement a box of it in the world.
    pub fn build(objects: &[(Option<&Placement>, Aabb)]) -> Self {
        let box_for = |i: usize, ray: &Ray| {
            let (placement, world_box) = &objects[i];
            placement.map_or(*world_box, |p| p.box_for(ray))
        };
        let top = TopLevel::build(objects.len(), box_for);
        let numbers: Vec<u32> = (0..objects.len() as u32).collect();
        let children: Vec<_> = top.nodes.iter().map(|node| node.children).collect();
        let boxes: Vec<[Aabb; WIDTH]> =
            top.nodes.iter().map(|node| std::array::from_fn(|lane| node.child_box(lane))).collect();
        let mut tree = pack(&children, &boxes, |object| &numbers[object as usize..][..1]);
        fit(&mut tree.nodes, |place| {
            let object = tree.order[place as usize];
            box_for(object as usize, &Ray { origin: Vec3::splat(top.reach), direction: Vec3::Z })
        });
        Self { tree, reach: top.reach }
    }
}

/// Adds the node over some objects and all below it; gives its place.
fn add_node(objects: &mut [(u32, Aabb)], nodes: &mut Vec<Node>) -> u32 {
    let place = nodes.len();
    nodes.push(Node {
        planes: [[[f32::INFINITY; WIDTH]; 3], [[f32::NEG_INFINITY; WIDTH]; 3]],
        children: [NO_CHILD; WIDTH],
    });
    let mut groups: Vec<&mut [(u32, Aabb)]> = vec![objects];
    // halves of halves of halves
    for _ in 0..WIDTH.ilog2() {
        groups = groups.into_iter().flat_map(halves).collect();
    }
    for (lane, group) in groups.into_iter().filter(|group| !group.is_empty()).enumerate() {
        let whole = group.iter().fold(Aabb::EMPTY, |all, (_, b)| all.union(b));
        let child = if let [(object, _)] = *group { LEAF | object } else { add_node(group, nodes) };
        let node = &mut nodes[place];
        node.children[lane] = child;
        for axis in 0..3 {
            node.planes[0][axis][lane] = whole.min[axis];
            node.planes[1][axis][lane] = whole.max[axis];
        }
    }
    place as u32
}

/// The objects in two halves, along the axis on which their middles lie farthest apart.
fn halves(objects: &mut [(u32, Aabb)]) -> [&mut [(u32, Aabb)]; 2] {
    let middle = |b: &Aabb, axis: usize| 0.5 * b.min[axis] + 0.5 * b.max[axis];
    let extent = |axis: usize| {
        let middles = objects.iter().map(|(_, b)| middle(b, axis));
        middles.clone().fold(f32::NEG_INFINITY, f32::max) - middles.fold(f32::INFINITY, f32::min)
    };
    let extents = [extent(0), extent(1), extent(2)];
    let axis = (0..3).max_by(|&a, &b| extents[a].total_cmp(&extents[b])).unwrap_or(0);
    objects.sort_unstable_by(|(i, a), (j, b)| middle(a, axis).total_cmp(&middle(b, axis)).then(i.cmp(j)));
    let (left, right) = objects.split_at_mut(objects.len() / 2);
    [left, right]
}
