//! The traced scene of the CPU: trees, each where its object stands.

use super::lanes::{Lanes8, Portable, Width};
use super::traverse::Place;
use super::tree::Tree;
use super::triangle::{ScalarRay, Search};
use super::{Aggregate, Hit, HitOrder, Ray};
use std::sync::Arc;

/// An object: a tree.
#[derive(Clone, Debug)]
pub struct TracedObject {
    tree: Arc<Tree>,
    first_primitive: u32,
}

/// Objects that rays are traced against. Primitives count through them in their order.
#[derive(Clone, Debug)]
pub struct TracedScene {
    objects: Vec<TracedObject>,
    width: Width,
}

impl TracedScene {
    /// Takes the objects.
    pub fn new(trees: Vec<Arc<Tree>>) -> Self {
        let mut first_primitive = 0;
        let objects = trees
            .into_iter()
            .map(|tree| {
                let object = TracedObject { first_primitive, tree };
                first_primitive += object.tree.triangle_count();
                object
            })
            .collect();
        Self { objects, width: Width::detect() }
    }

    /// Traces in another width; one that the machine lacks is not taken.
    #[must_use]
    pub fn with_width(mut self, width: Width) -> Self {
        if Width::available().contains(&width) {
            self.width = width;
        }
        self
    }

    #[inline(always)]
    fn search<L: Lanes8, const ANY: bool>(
        &self,
        ray: &Ray,
        mut search: Search,
    ) -> Option<(usize, Place, f32)> {
        let mut found = None;
        for (i, object) in self.objects.iter().enumerate() {
            if let Some(place) = object.tree.search::<L, ANY>(ray, object.first_primitive, &mut search) {
                found = Some((i, place, search.before.distance));
                if ANY {
                    break;
                }
            }
        }
        found
    }

    #[inline(always)]
    fn search_closest<L: Lanes8>(&self, ray: &Ray, after: Option<HitOrder>) -> Option<Hit> {
        let (object, place, distance) = self.search::<L, false>(ray, Search::after(after))?;
        let (triangle, corners) = self.objects[object].tree.triangle_at(place);
        Some(Hit {
            distance,
            object: object as u32,
            triangle,
            barycentric: ScalarRay::new(ray).barycentric(&corners),
        })
    }

    #[inline(always)]
    fn search_any<L: Lanes8>(&self, ray: &Ray, end: f32) -> bool {
        self.search::<L, true>(ray, Search::until(end)).is_some()
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
        HitOrder { distance: hit.distance, primitive: first + hit.triangle }
    }
}
