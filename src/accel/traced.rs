//! The traced scene of the CPU: trees, each where its object stands.

use super::lanes::{Lanes8, Portable, Width};
use super::placement::Placement;
use super::slab::SlabRay;
use super::traverse::Place;
use super::tree::Tree;
use super::triangle::{ScalarRay, Search};
use super::{Aggregate, Hit, HitOrder, Ray};
use crate::math::DAffine3;
use std::sync::Arc;

/// Objects whose boxes are sorted together along a ray.
const SORTED: usize = 16;

/// An object: a tree and where it stands.
#[derive(Clone, Debug)]
pub struct TracedObject {
    tree: Arc<Tree>,
    placement: Option<Placement>,
    first_primitive: u32,
}

impl TracedObject {
    /// Places a tree; without a transform rays are used as they are.
    pub fn new(tree: Arc<Tree>, world_from_object: Option<&DAffine3>) -> Self {
        let placement = world_from_object.map(|t| Placement::new(t, &tree.vertex_box()));
        Self { tree, placement, first_primitive: 0 }
    }

    /// Where it stands; None where its space is the world's.
    pub fn placement(&self) -> Option<&Placement> {
        self.placement.as_ref()
    }

    #[inline(always)]
    fn own_ray(&self, ray: &Ray) -> Ray {
        self.placement.as_ref().map_or(*ray, |p| p.object_ray(ray))
    }

    #[inline(always)]
    fn entry(&self, ray: &Ray, slab: &SlabRay<f32>) -> Option<f32> {
        match &self.placement {
            None => slab.entry(&self.tree.bounds),
            Some(p) => slab.entry(&p.box_for(ray)),
        }
    }
}

/// A triangle that was found.
#[derive(Clone, Copy, Debug)]
struct Found {
    object: usize,
    place: Place,
}

/// Objects that rays are traced against. Primitives count through them in their order.
#[derive(Clone, Debug)]
pub struct TracedScene {
    objects: Vec<TracedObject>,
    width: Width,
}

impl TracedScene {
    /// Takes the objects of a frame in its order; together they must have fewer than 2³² triangles.
    pub fn new(mut objects: Vec<TracedObject>) -> Self {
        let mut first_primitive = 0_u32;
        for object in &mut objects {
            object.first_primitive = first_primitive;
            first_primitive = first_primitive.wrapping_add(object.tree.triangle_count());
        }
        Self { objects, width: Width::detect() }
    }

    /// Traces in another width; one that the machine lacks is not taken. The answers are the same.
    #[must_use]
    pub fn with_width(mut self, width: Width) -> Self {
        if Width::available().contains(&width) {
            self.width = width;
        }
        self
    }

    /// The objects.
    pub fn objects(&self) -> &[TracedObject] {
        &self.objects
    }

    #[inline(always)]
    fn search<L: Lanes8, const ANY: bool>(&self, ray: &Ray, search: &mut Search) -> Option<Found> {
        let mut found = None;
        for (chunk, objects) in self.objects.chunks(SORTED).enumerate() {
            let mut sorted = [(0.0, 0); SORTED];
            let mut count = 0;
            if let [TracedObject { placement: None, .. }] = objects {
                count = 1;
            } else {
                let slab = SlabRay::new(ray);
                for (i, object) in objects.iter().enumerate() {
                    let Some(entry) = object.entry(ray, &slab) else { continue };
                    let mut place = count;
                    while place > 0 && sorted[place - 1].0 > entry {
                        sorted[place] = sorted[place - 1];
                        place -= 1;
                    }
                    sorted[place] = (entry, i);
                    count += 1;
                }
            }
            for &(entry, i) in &sorted[..count] {
                if entry > search.before.distance {
                    break;
                }
                let object = &objects[i];
                let ray = object.own_ray(ray);
                if let Some(place) = object.tree.search::<L, ANY>(&ray, object.first_primitive, search) {
                    found = Some(Found { object: chunk * SORTED + i, place });
                    if ANY {
                        return found;
                    }
                }
            }
        }
        found
    }

    #[inline(always)]
    fn search_closest<L: Lanes8>(&self, ray: &Ray, after: Option<HitOrder>) -> Option<Hit> {
        let mut search = Search::after(after);
        let found = self.search::<L, false>(ray, &mut search)?;
        let object = &self.objects[found.object];
        let (triangle, corners) = object.tree.triangle_at(found.place);
        Some(Hit {
            distance: search.before.distance,
            object: found.object as u32,
            triangle,
            barycentric: ScalarRay::new(&object.own_ray(ray)).barycentric(&corners),
        })
    }

    #[inline(always)]
    fn search_any<L: Lanes8>(&self, ray: &Ray, end: f32) -> bool {
        self.search::<L, true>(ray, &mut Search::until(end)).is_some()
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::super::lanes::Avx2;
    use super::{Hit, HitOrder, Ray, TracedScene};

    #[target_feature(enable = "avx2")]
    pub(super) fn closest(scene: &TracedScene, ray: &Ray, after: Option<HitOrder>) -> Option<Hit> {
        scene.search_closest::<Avx2>(ray, after)
    }

    #[target_feature(enable = "avx2")]
    pub(super) fn occluded(scene: &TracedScene, ray: &Ray, end: f32) -> bool {
        scene.search_any::<Avx2>(ray, end)
    }
}

impl Aggregate for TracedScene {
    fn closest(&self, ray: &Ray, after: Option<HitOrder>) -> Option<Hit> {
        match self.width {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the width is one of those that were found available
            Width::Avx2 => unsafe { avx2::closest(self, ray, after) },
            _ => self.search_closest::<Portable>(ray, after),
        }
    }

    fn occluded(&self, ray: &Ray, end: f32) -> bool {
        match self.width {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the width is one of those that were found available
            Width::Avx2 => unsafe { avx2::occluded(self, ray, end) },
            _ => self.search_any::<Portable>(ray, end),
        }
    }

    fn order(&self, hit: &Hit) -> HitOrder {
        let first = self.objects.get(hit.object as usize).map_or(0, |o| o.first_primitive);
        HitOrder { distance: hit.distance, primitive: first.wrapping_add(hit.triangle) }
    }
}
