//! The traced scene of the CPU: trees, each where its object stands.

use super::interval::RAYS;
use super::lanes::{Lanes8, Portable, Width};
use super::placement::Placement;
use super::slab::SlabRay;
use super::traverse::Found;
use super::tree::Tree;
use super::triangle::Search;
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

/// An object, and its triangle that was found.
type FoundIn = (usize, Found);

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
    fn search<L: Lanes8, const ANY: bool>(&self, ray: &Ray, search: &mut Search) -> Option<FoundIn> {
        if let [TracedObject { tree, placement: None, .. }] = &self.objects[..] {
            return tree.search::<L, ANY>(ray, 0, search).map(|triangle| (0, triangle));
        }
        let slab = SlabRay::new(ray);
        let mut found = None;
        for (chunk, objects) in self.objects.chunks(SORTED).enumerate() {
            let (sorted, count) = by_entry(objects, ray, &slab);
            for &(entry, i) in &sorted[..count] {
                if entry > search.before.distance {
                    break;
                }
                let object = &objects[i];
                let ray = object.own_ray(ray);
                if let Some(triangle) = object.tree.search::<L, ANY>(&ray, object.first_primitive, search) {
                    found = Some((chunk * SORTED + i, triangle));
                    if ANY {
                        return found;
                    }
                }
            }
        }
        found
    }

    /// [`Self::search`] for rays that are coherent.
    #[inline(always)]
    fn search_packet<L: Lanes8, const ANY: bool>(
        &self,
        rays: &[Ray],
        searches: &mut [Search; RAYS],
        found: &mut [Option<FoundIn>; RAYS],
    ) {
        for (i, object) in self.objects.iter().enumerate() {
            let mut own_rays = [rays[0]; RAYS];
            for (own, ray) in own_rays.iter_mut().zip(rays) {
                *own = object.own_ray(ray);
            }
            let own_rays = &own_rays[..rays.len()];
            let first = object.first_primitive;
            let note = |ray: usize, triangle| found[ray] = Some((i, triangle));
            if !object.tree.search_packet::<L, ANY>(own_rays, first, searches, note) {
                for (k, ray) in own_rays.iter().enumerate() {
                    if let Some(triangle) = object.tree.search::<L, ANY>(ray, first, &mut searches[k]) {
                        found[k] = Some((i, triangle));
                        if ANY {
                            searches[k].end();
                        }
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn search_closest<L: Lanes8>(&self, ray: &Ray, after: Option<HitOrder>) -> Option<Hit> {
        let mut search = Search::after(after);
        let found = self.search::<L, false>(ray, &mut search)?;
        Some(hit(found, &search))
    }

    #[inline(always)]
    fn search_closest_batch<L: Lanes8>(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (rays, hits) in rays.chunks(RAYS).zip(hits.chunks_mut(RAYS)) {
            let mut searches = [Search::after(None); RAYS];
            let mut found = [None; RAYS];
            self.search_packet::<L, false>(rays, &mut searches, &mut found);
            for ((to, found), search) in hits.iter_mut().zip(found).zip(&searches) {
                *to = found.map(|f| hit(f, search));
            }
        }
    }

    #[inline(always)]
    fn search_any_batch<L: Lanes8>(&self, rays: &[Ray], ends: &[f32], occluded: &mut [bool]) {
        for ((rays, ends), occluded) in
            rays.chunks(RAYS).zip(ends.chunks(RAYS)).zip(occluded.chunks_mut(RAYS))
        {
            let mut searches = [Search::until(0.0); RAYS];
            for (search, &end) in searches.iter_mut().zip(ends) {
                *search = Search::until(end);
            }
            let mut found = [None; RAYS];
            self.search_packet::<L, true>(rays, &mut searches, &mut found);
            for (occluded, found) in occluded.iter_mut().zip(found) {
                *occluded = found.is_some();
            }
        }
    }

    #[inline(always)]
    fn search_any<L: Lanes8>(&self, ray: &Ray, end: f32) -> bool {
        self.search::<L, true>(ray, &mut Search::until(end)).is_some()
    }
}

/// The objects that a ray enters, with their entries, the nearest first, and how many they are.
#[inline(always)]
fn by_entry(objects: &[TracedObject], ray: &Ray, slab: &SlabRay<f32>) -> ([(f32, usize); SORTED], usize) {
    let mut sorted = [(0.0, 0); SORTED];
    let mut count = 0;
    for (i, object) in objects.iter().enumerate() {
        let Some(entry) = object.entry(ray, slab) else { continue };
        let mut place = count;
        while place > 0 && sorted[place - 1].0 > entry {
            sorted[place] = sorted[place - 1];
            place -= 1;
        }
        sorted[place] = (entry, i);
        count += 1;
    }
    (sorted, count)
}

#[inline(always)]
fn hit((object, found): FoundIn, search: &Search) -> Hit {
    let Found { triangle, barycentric } = found;
    Hit { distance: search.before.distance, object: object as u32, triangle, barycentric }
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

    #[target_feature(enable = "avx2")]
    pub(super) fn closest_batch(scene: &TracedScene, rays: &[Ray], hits: &mut [Option<Hit>]) {
        scene.search_closest_batch::<Avx2>(rays, hits);
    }

    #[target_feature(enable = "avx2")]
    pub(super) fn occluded_batch(scene: &TracedScene, rays: &[Ray], ends: &[f32], occluded: &mut [bool]) {
        scene.search_any_batch::<Avx2>(rays, ends, occluded);
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

    fn closest_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        match self.width {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the width is one of those that were found available
            Width::Avx2 => unsafe { avx2::closest_batch(self, rays, hits) },
            _ => self.search_closest_batch::<Portable>(rays, hits),
        }
    }

    fn occluded_batch(&self, rays: &[Ray], ends: &[f32], occluded: &mut [bool]) {
        match self.width {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the width is one of those that were found available
            Width::Avx2 => unsafe { avx2::occluded_batch(self, rays, ends, occluded) },
            _ => self.search_any_batch::<Portable>(rays, ends, occluded),
        }
    }
}
