//! All triangles one after the other: what every tree must agree with.

use super::triangle::{ScalarRay, Search, has_area};
use super::{Aggregate, Hit, HitOrder, Ray};

/// Triangles without a tree.
#[derive(Clone, Debug)]
pub struct BruteForce {
    corners: Vec<[[f32; 3]; 3]>,
}

impl BruteForce {
    /// Takes an indexed mesh; indices must be within the positions.
    pub fn new(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Self {
        Self { corners: triangles.iter().map(|t| t.map(|i| positions[i as usize])).collect() }
    }

    fn search(&self, ray: &Ray, mut search: Search) -> Option<Hit> {
        let scalar = ScalarRay::new(ray);
        let mut found = None;
        for (i, corners) in self.corners.iter().enumerate().filter(|(_, c)| has_area(c)) {
            let Some((distance, barycentric)) = scalar.hit(corners) else { continue };
            let candidate = HitOrder { distance, primitive: i as u32 };
            if search.admits(candidate) {
                search.before = candidate;
                found = Some(Hit { distance, object: 0, triangle: i as u32, barycentric });
            }
        }
        found
    }
}

impl Aggregate for BruteForce {
    fn closest(&self, ray: &Ray, after: Option<HitOrder>) -> Option<Hit> {
        self.search(ray, Search::after(after))
    }

    fn occluded(&self, ray: &Ray, end: f32) -> bool {
        self.search(ray, Search::until(end)).is_some()
    }

    fn order(&self, hit: &Hit) -> HitOrder {
        HitOrder { distance: hit.distance, primitive: hit.triangle }
    }
}
