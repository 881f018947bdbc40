//! Bounding volume hierarchies and the canonical hit: a ray's hit is a function of the ray and the set of triangles
//! alone, never of the tree.
//!
//! What a hit is stands in `slab` and `triangle`, written once over `lanes`; [`BruteForce`] applies it to one triangle
//! after the other. A tree's shape comes from obvhs (`binary`), made eight wide (`collapse`); its boxes are fitted from
//! below (`fit`). Rays go through it one by one (`traverse`) or sixteen at a time (`interval`, `packet`), and through
//! objects that stand somewhere in the world (`placement`, `traced`), many of them by a level of their own (`top`).

// Formulas over lanes must be inlined into the functions that enable the lanes' CPU feature, or they would be compiled
// without it.
#![allow(clippy::inline_always)]

mod binary;
mod brute;
mod collapse;
mod fit;
mod fit_lanes;
mod interval;
pub(crate) mod lanes;
mod origin;
mod packed;
mod packet;
mod placement;
mod reference;
mod slab;
mod stack;
mod stored;
mod top;
mod traced;
mod traverse;
mod tree;
mod triangle;
mod validate;

pub use binary::Quality;
pub use brute::BruteForce;
pub use lanes::Width;
pub use origin::{extent, hit_point, magnitude, offset_origin};
pub use packed::{NODE_BYTES, PackedNode, PackedTree, TRIANGLE_BYTES, VERTICES_BYTES};
pub use placement::{Placement, PlacementRows};
pub use reference::{Reference, disagreement, reference};
pub use slab::Aabb;
pub use top::PackedTop;
pub use traced::{TracedObject, TracedScene};
pub use tree::{Tree, TreeCounts};
pub use triangle::has_area;
pub use validate::validate;

use crate::math::Vec3;

/// A ray; the direction need not be unit. Distances are in units of its length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: Vec3,
    /// Where it goes.
    pub direction: Vec3,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The canonical distance: max(t of the plane, entry of the triangle's own box).
    pub distance: f32,
    /// The object, by its place in the frame.
    pub object: u32,
    /// The triangle, by its place in the object's [`crate::scene::Triangles`].
    pub triangle: u32,
    /// Weights of the triangle's second and third corner; the first has 1 − u − v.
    pub barycentric: [f32; 2],
}

/// A hit's place in the order of candidates along a ray: (distance, primitive). Primitives count through objects
/// and their triangles.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct HitOrder {
    /// The canonical distance.
    pub distance: f32,
    /// The primitive.
    pub primitive: u32,
}

/// What rays are traced against. Every implementation gives the same answers for the same triangles.
pub trait Aggregate: Sync {
    /// The first candidate in the order (distance, primitive); after the given one, where one is given.
    fn closest(&self, ray: &Ray, after: Option<HitOrder>) -> Option<Hit>;

    /// Whether any candidate has a distance below `end` (strictly).
    fn occluded(&self, ray: &Ray, end: f32) -> bool;

    /// A hit's place in the order.
    fn order(&self, hit: &Hit) -> HitOrder;

    /// [`Self::closest`] of many rays, coherent ones side by side; the answers are those of single rays.
    fn closest_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.closest(ray, None);
        }
    }

    /// [`Self::occluded`] of many rays; the answers are those of single rays.
    fn occluded_batch(&self, rays: &[Ray], ends: &[f32], occluded: &mut [bool]) {
        for ((ray, &end), o) in rays.iter().zip(ends).zip(occluded) {
            *o = self.occluded(ray, end);
        }
    }
}
