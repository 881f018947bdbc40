//! The traced scene of the CPU: trees, each where its object stands.

use super::interval::{PacketSlabs, RAYS};
use super::lanes::{Lanes, Lanes8, Portable, Width};
use super::packet::push_children;
use super::placement::Placement;
use super::slab::{Aabb, SlabRay};
use super::stack::Stack;
use super::top::{LEAST_OBJECTS, TopLevel};
use super::traverse::{Descent, Found};
use super::tree::{LEAF, Tree, WIDTH};
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

    /// A box in the world that the ray enters not after any of the object's triangles.
    #[inline(always)]
    fn box_for(&self, ray: &Ray) -> Aabb {
        self.placement.as_ref().map_or(self.tree.bounds, |p| p.box_for(ray))
    }
}

/// An object, and its triangle that was found.
type FoundIn = (usize, Found);

/// Objects that rays are traced against. Primitives count through them in their order. Batches are taken sixteen rays
/// at a time; fastest are sixteen that start near each other and go the same way, as through 4x4 pixels.
#[derive(Clone, Debug)]
pub struct TracedScene {
    objects: Vec<TracedObject>,
    top: Option<TopLevel>,
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
        let pays = objects.len() >= LEAST_OBJECTS;
        let top = pays.then(|| TopLevel::build(objects.len(), |i, ray| objects[i].box_for(ray)));
        Self { objects, top, width: Width::detect() }
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
        match self.top.as_ref().filter(|top| top.covers(ray)) {
            Some(top) => self.search_below::<L, ANY>(top, ray, search),
            None => self.search_in_turn::<L, ANY>(ray, search),
        }
    }

    #[inline(always)]
    fn search_below<L: Lanes8, const ANY: bool>(
        &self,
        top: &TopLevel,
        ray: &Ray,
        search: &mut Search,
    ) -> Option<FoundIn> {
        let mut descent = Descent::<L>::new(&top.nodes, ray);
        let mut found = None;
        while let Some(object) = descent.next_leaf(search.before.distance) {
            if let Some(nearer) = self.search_object::<L, ANY>(object, ray, search) {
                found = Some(nearer);
                if ANY {
                    break;
                }
            }
        }
        found
    }

    #[inline(always)]
    fn search_in_turn<L: Lanes8, const ANY: bool>(&self, ray: &Ray, search: &mut Search) -> Option<FoundIn> {
        let slab = SlabRay::new(ray);
        let mut found = None;
        for (chunk, objects) in self.objects.chunks(SORTED).enumerate() {
            let (sorted, count) = by_entry(objects, ray, &slab);
            for &(entry, i) in &sorted[..count] {
                if entry > search.before.distance {
                    break;
                }
                if let Some(nearer) = self.search_object::<L, ANY>(chunk * SORTED + i, ray, search) {
                    found = Some(nearer);
                    if ANY {
                        return found;
                    }
                }
            }
        }
        found
    }

    #[inline(always)]
    fn search_object<L: Lanes8, const ANY: bool>(
        &self,
        i: usize,
        ray: &Ray,
        search: &mut Search,
    ) -> Option<FoundIn> {
        let object = &self.objects[i];
        let ray = object.own_ray(ray);
        object.tree.search::<L, ANY>(&ray, object.first_primitive, search).map(|triangle| (i, triangle))
    }

    /// [`Self::search`] for rays that are coherent.
    #[inline(always)]
    fn search_packet<L: Lanes8, const ANY: bool>(
        &self,
        rays: &[Ray],
        searches: &mut [Search; RAYS],
        found: &mut [Option<FoundIn>; RAYS],
    ) {
        let top = self.top.as_ref().filter(|top| rays.iter().all(|ray| top.covers(ray)));
        let Some((top, slabs)) = top.and_then(|top| Some((top, PacketSlabs::<L>::new(rays)?))) else {
            for i in 0..self.objects.len() {
                self.search_object_packet::<L, ANY>(i, rays, searches, found);
            }
            return;
        };
        let last_end = |searches: &[Search; RAYS]| {
            searches[..rays.len()].iter().map(|s| s.before.distance).fold(f32::NEG_INFINITY, Lanes::max)
        };
        let mut end = last_end(searches);
        let mut stack = Stack::new();
        if !top.nodes.is_empty() {
            push_children(&top.nodes, 0, &slabs.interval, end, &mut stack);
        }
        while let Some(waiting) = stack.pop_before(end) {
            let child = top.nodes[waiting as usize / WIDTH].children[waiting as usize % WIDTH];
            if child & LEAF == 0 {
                push_children(&top.nodes, child as usize, &slabs.interval, end, &mut stack);
            } else {
                self.search_object_packet::<L, ANY>((child & !LEAF) as usize, rays, searches, found);
                end = last_end(searches);
            }
        }
    }

    #[inline(always)]
    fn search_object_packet<L: Lanes8, const ANY: bool>(
        &self,
        i: usize,
        rays: &[Ray],
        searches: &mut [Search; RAYS],
        found: &mut [Option<FoundIn>; RAYS],
    ) {
        let object = &self.objects[i];
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
        let Some(entry) = slab.entry(&object.box_for(ray)) else { continue };
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::Quality;
    use crate::accel::placement::tests::numbers;
    use crate::math::{DVec3, Vec3};
    use glam::DQuat;

    /// Fans of triangles all over the place; some stand as they are, one can never be hit, some lie in one another.
    fn objects(count: usize) -> Vec<TracedObject> {
        let mut next = numbers();
        let mut vector = move |s: f64| DVec3::new(next() * s, next() * s, next() * s);
        let points: Vec<[f32; 3]> = (0..30).map(|_| vector(1.0).as_vec3().to_array()).collect();
        let triangles: Vec<[u32; 3]> = (0..28).map(|i| [i, i + 1, i + 2]).collect();
        let tree = Arc::new(Tree::build(&points, &triangles, Quality::default()));
        let place = |i: usize| match i % 11 {
            0 => None,
            1 => Some(DAffine3::from_scale(DVec3::ZERO)),
            _ => {
                let turn = DQuat::from_axis_angle(vector(1.0).normalize(), 3.0 * i as f64);
                let size = DVec3::splat(0.3) + 0.2 * vector(1.0);
                Some(DAffine3::from_scale_rotation_translation(size, turn, vector(8.0)))
            }
        };
        (0..count)
            .map(place)
            .collect::<Vec<_>>()
            .iter()
            .map(|m| TracedObject::new(Arc::clone(&tree), m.as_ref()))
            .collect()
    }

    #[test]
    fn with_a_level_above_the_hits_are_those_without() {
        for count in [5, 8, 9, 64, 65, 300] {
            let with = TracedScene::new(objects(count));
            assert!(with.top.is_some());
            let without = TracedScene { top: None, ..with.clone() };
            let mut next = numbers();
            let mut vector = move |s: f64| DVec3::new(next() * s, next() * s, next() * s).as_vec3();
            let mut seen = 0;
            for i in 0..300 {
                // from within, from outside, from farther away than the level above covers
                let origin = vector([4.0, 30.0, 1e5][i % 3]);
                let to = vector(8.0);
                let rays: [Ray; RAYS] = std::array::from_fn(|k| {
                    let aside = Vec3::new((k % 4) as f32, (k / 4) as f32, 0.0) * 0.05;
                    Ray { origin, direction: to + aside - origin }
                });
                let mut hits = [[None; RAYS]; 2];
                let mut shadows = [[false; RAYS]; 2];
                for (k, scene) in [&with, &without].into_iter().enumerate() {
                    scene.closest_batch(&rays, &mut hits[k]);
                    scene.occluded_batch(&rays, &[0.9; RAYS], &mut shadows[k]);
                }
                assert_eq!(hits[0], hits[1]);
                assert_eq!(shadows[0], shadows[1]);
                for (ray, hit) in rays.iter().zip(hits[0]) {
                    assert_eq!(with.closest(ray, None), hit);
                    assert_eq!(with.occluded(ray, 0.9), without.occluded(ray, 0.9));
                    let after = hit.map(|hit| with.order(&hit));
                    assert_eq!(with.closest(ray, after), without.closest(ray, after));
                    seen += usize::from(hit.is_some());
                }
            }
            assert!(seen > 100, "{count}: {seen}");
        }
    }

    /// One stray object may stand so far away that a box for all rays that start as far would be infinite.
    #[test]
    fn an_object_at_the_end_of_the_world_hides_no_others() {
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let tree = Arc::new(Tree::build(&points, &[[0, 1, 2]], Quality::default()));
        let at = |z: f64| Some(DAffine3::from_translation(DVec3::new(0.0, 0.0, z)));
        let object = |z: f64| TracedObject::new(Arc::clone(&tree), at(z).as_ref());
        let scene = TracedScene::new([1e37, 1.0, 2.0, 3.0, 4.0, 5.0].map(object).to_vec());
        assert!(scene.top.is_some());
        let ray = Ray { origin: Vec3::new(0.2, 0.3, -1.0), direction: Vec3::Z };
        let hit = scene.closest(&ray, None);
        assert_eq!(hit.map(|hit| (hit.object, hit.distance)), Some((1, 2.0)));
        let mut hits = [None; RAYS];
        scene.closest_batch(&[ray; RAYS], &mut hits);
        assert_eq!(hits, [hit; RAYS]);
    }
}
