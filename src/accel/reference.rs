//! Hits by brute force in f64: what tests and benchmarks hold traced hits against.

use super::{Hit, Ray};
use crate::math::Vec3;
use rayon::prelude::*;

/// A triangle that a ray hits, in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// The distance, in lengths of the ray's direction.
    pub t: f64,
    /// The triangle.
    pub triangle: u32,
}

/// The corners of a triangle of an indexed mesh.
fn corners(positions: &[[f32; 3]], triangle: [u32; 3]) -> [Vec3; 3] {
    triangle.map(|i| Vec3::from(positions[i as usize]))
}

/// Where a ray meets the plane of a triangle, and whether inside it (Möller and Trumbore 1997, in f64).
fn plane(ray: &Ray, corners: [Vec3; 3]) -> Option<(f64, bool)> {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let (e, f) = (b - a, c - a);
    let p = d.cross(f);
    let det = e.dot(p);
    if det == 0.0 {
        return None;
    }
    let s = o - a;
    let u = s.dot(p) / det;
    let q = s.cross(e);
    let v = d.dot(q) / det;
    Some((f.dot(q) / det, u >= 0.0 && v >= 0.0 && u + v <= 1.0))
}

/// The nearest hit of each ray, over all triangles, in the current rayon pool.
pub fn reference(positions: &[[f32; 3]], triangles: &[[u32; 3]], rays: &[Ray]) -> Vec<Option<Reference>> {
    let corners: Vec<[Vec3; 3]> = triangles.iter().map(|&t| corners(positions, t)).collect();
    rays.par_iter()
        .map(|ray| {
            let mut nearest: Option<Reference> = None;
            for (i, c) in corners.iter().enumerate() {
                if let Some((t, true)) = plane(ray, *c)
                    && t > 0.0
                    && nearest.is_none_or(|n| t < n.t)
                {
                    nearest = Some(Reference { t, triangle: i as u32 });
                }
            }
            nearest
        })
        .collect()
}

/// How near a ray passes an edge of a triangle, per t.
fn edge_distance(ray: &Ray, corners: [Vec3; 3]) -> f64 {
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let mut least = f64::INFINITY;
    for (a, b) in [(0, 1), (1, 2), (2, 0)] {
        let (a, b) = (corners[a].as_dvec3(), corners[b].as_dvec3());
        // nearest points of the ray's line and the segment
        let (e, r) = (b - a, a - o);
        let (dd, de, ee, dr, er) = (d.dot(d), d.dot(e), e.dot(e), d.dot(r), e.dot(r));
        let det = dd * ee - de * de;
        let s = if det > 1e-14 * dd * ee { ((de * dr - dd * er) / det).clamp(0.0, 1.0) } else { 0.5 };
        let p = a + e * s;
        let t = d.dot(p - o) / dd;
        least = least.min((p - (o + d * t)).length() / (t.abs() * dd.sqrt()));
    }
    least
}

/// Why a hit and the reference are not the same scene; None where they are, but for float ties: both distances differ
/// by less than 2e-6·t/|cos|, or the ray passes within 1e-6·t of an edge.
pub fn disagreement(
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
    ray: &Ray,
    hit: Option<&Hit>,
    reference: Option<&Reference>,
) -> Option<String> {
    let corners = |triangle: u32| corners(positions, triangles[triangle as usize]);
    let near_edge = |triangle: u32| edge_distance(ray, corners(triangle)) < 1e-6;
    let excused = match (hit, reference) {
        (None, None) => true,
        (Some(h), Some(r)) if h.triangle == r.triangle => {
            // in units of what is rounded; grazing, the plane's distance is as uncertain as the cosine is small
            let size = r.t + f64::from(ray.origin.length() / ray.direction.length());
            let off = (f64::from(h.distance) - r.t).abs();
            off <= 1e-5 * r.t || off * cosine(ray, corners(h.triangle)) < 2e-6 * size
        }
        (Some(h), Some(r)) => {
            let t = plane(ray, corners(h.triangle)).map_or(f64::NAN, |(t, _)| t);
            let cos = cosine(ray, corners(h.triangle)).min(cosine(ray, corners(r.triangle)));
            (t - r.t).abs() * cos < 2e-6 * r.t || near_edge(h.triangle) || near_edge(r.triangle)
        }
        (Some(h), None) => near_edge(h.triangle),
        (None, Some(r)) => near_edge(r.triangle),
    };
    (!excused).then(|| format!("{ray:?}: {hit:?}, in f64 {reference:?}"))
}

fn cosine(ray: &Ray, corners: [Vec3; 3]) -> f64 {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    (b - a).cross(c - a).normalize_or_zero().dot(ray.direction.as_dvec3().normalize()).abs()
}
