//! The camera and light of the Embree program: rays through pixel centres, a point light 1.5 diagonals above the box's
//! middle on the eye's side; shadow rays start 1e-3 of the way to it.

use crate::accel::{Aggregate, Ray, TracedScene};
use crate::math::Vec3;
use rayon::prelude::*;

/// Width and height, multiples of 4.
const SIZE: [usize; 2] = [1280, 720];
/// Pixels of a tile, a square of 4.
const TILE: usize = 16;

/// Where one looks from; without it, from beside and above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct View {
    /// The eye.
    pub(super) eye: [f32; 3],
    /// What it looks at.
    pub(super) look_at: [f32; 3],
    /// The vertical angle, degrees.
    pub(super) fov_deg: f32,
}

impl View {
    /// The options of the Embree program for it.
    pub(super) fn options(&self) -> Vec<String> {
        let point = |p: [f32; 3]| format!("{},{},{}", p[0], p[1], p[2]);
        let options = [
            ("--eye", point(self.eye)),
            ("--look-at", point(self.look_at)),
            ("--fov", self.fov_deg.to_string()),
        ];
        options.into_iter().flat_map(|(name, value)| [name.to_string(), value]).collect()
    }
}

/// Rays into a mesh.
pub(super) struct Rays {
    eye: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    light: Vec3,
    distances: Vec<[f32; TILE]>,
    shadowed: Vec<[bool; TILE]>,
}

impl Rays {
    /// From a view into the box of those positions.
    pub(super) fn new(view: Option<&View>, positions: &[[f32; 3]]) -> Self {
        let points = positions.iter().map(|&p| Vec3::from(p));
        let min = points.clone().fold(Vec3::INFINITY, Vec3::min);
        let max = points.fold(Vec3::NEG_INFINITY, Vec3::max);
        let (middle, diagonal) = ((min + max) * 0.5, (max - min).length());
        let eye = view.map_or(middle + Vec3::new(0.25, 0.2, 1.0) * diagonal, |v| v.eye.into());
        let look_at = view.map_or(middle, |v| v.look_at.into());
        let light =
            middle + ((eye - middle).normalize() + Vec3::new(0.4, 1.0, 0.2)).normalize() * (1.5 * diagonal);
        let forward = (look_at - eye).normalize();
        let right = forward.cross(Vec3::Y).normalize();
        let half = (0.5 * view.map_or(40.0, |v| v.fov_deg)).to_radians().tan();
        let [w, h] = SIZE;
        Self {
            eye,
            right: right * half * (w as f32 / h as f32),
            up: right.cross(forward) * half,
            forward,
            light,
            distances: vec![[f32::INFINITY; TILE]; w * h / TILE],
            shadowed: vec![[false; TILE]; w * h / TILE],
        }
    }

    /// Traces camera rays and a shadow ray for each hit, in batches, in the current pool.
    pub(super) fn trace(&mut self, scene: &TracedScene) {
        let mut distances = std::mem::take(&mut self.distances);
        let mut shadowed = std::mem::take(&mut self.shadowed);
        let tiles = distances.par_iter_mut().zip(&mut shadowed).with_min_len(SIZE[0] / 4).enumerate();
        tiles.for_each(|(tile, (distances, shadowed))| {
            let rays = self.camera_rays(tile);
            let mut hits = [None; TILE];
            scene.closest_batch(&rays, &mut hits);
            *distances = hits.map(|h| h.map_or(f32::INFINITY, |h| h.distance));
            let mut to_light = rays;
            let mut count = 0;
            for (ray, distance) in rays.iter().zip(&*distances).filter(|(_, d)| d.is_finite()) {
                let point = ray.origin + ray.direction * *distance;
                let direction = self.light - point;
                to_light[count] = Ray { origin: point + 1e-3 * direction, direction };
                count += 1;
            }
            let ends = [1.0 - 1e-3; TILE];
            *shadowed = [false; TILE];
            scene.occluded_batch(&to_light[..count], &ends[..count], &mut shadowed[..count]);
        });
        (self.distances, self.shadowed) = (distances, shadowed);
    }

    /// Camera rays that hit.
    pub(super) fn hits(&self) -> usize {
        self.distances.as_flattened().iter().filter(|d| d.is_finite()).count()
    }

    fn camera_rays(&self, tile: usize) -> [Ray; TILE] {
        let tiles = SIZE[0] / 4;
        let (x, y) = (tile % tiles * 4, tile / tiles * 4);
        std::array::from_fn(|i| {
            let (x, y) = (x + i % 4, y + i / 4);
            let u = 2.0 * (x as f32 + 0.5) / SIZE[0] as f32 - 1.0;
            let v = 1.0 - 2.0 * (y as f32 + 0.5) / SIZE[1] as f32;
            Ray { origin: self.eye, direction: (self.right * u + self.up * v + self.forward).normalize() }
        })
    }
}
