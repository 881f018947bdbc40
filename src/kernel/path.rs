//! Paths of light, from the eye on: where one is, what it counts for, and how it goes straight on.

use super::SURFACES_MAX;
use super::environment::background;
use super::scene::Scene;
use crate::accel::{Aggregate, Hit, Ray};
use crate::math::Vec3;
use crate::scene::Shot;

/// A ray at a surface.
#[derive(Clone, Copy, Debug)]
pub struct Path {
    /// The pixel, by its place in the tile.
    pub pixel: u32,
    /// Where it is.
    pub hit: Hit,
    /// What is seen there counts for this in the sum that is being added up.
    pub weight: Vec3,
    /// Surfaces that this ray has crossed.
    pub crossed: u32,
    /// Bounces and crossings since the eye.
    pub used: u32,
    /// Length of the way from the eye to where this ray starts.
    pub travelled: f32,
    /// Whether it is the camera's, straight on.
    pub is_camera: bool,
    /// Whether no surface before it had d > 0.
    pub sees_first: bool,
}

impl Path {
    /// A camera ray at its first hit.
    pub fn new(pixel: u32, hit: Hit) -> Self {
        Self {
            pixel,
            hit,
            weight: Vec3::ONE,
            crossed: 0,
            used: 0,
            travelled: 0.0,
            is_camera: true,
            sees_first: true,
        }
    }

    /// Takes it to its next surface, to the background, or to its end; true where there is a surface. `base` is what the
    /// sum counts for in the picture.
    pub fn go_straight_on<A: Aggregate>(
        &mut self,
        scene: &Scene<A>,
        ray: &Ray,
        base: Vec3,
        sum: &mut PixelSum,
    ) -> bool {
        if !counts(self.weight * base, scene.shot.prune) {
            return false;
        }
        self.crossed += 1;
        self.used += 1;
        let after = scene.aggregate.order(&self.hit);
        if let Some(hit) = scene.aggregate.closest(ray, Some(after)) {
            self.hit = hit;
            self.crossed < SURFACES_MAX
        } else {
            sum.escape(scene.shot, self, ray);
            false
        }
    }
}

/// Whether what counts for so little is traced.
pub fn counts(weight: Vec3, prune: f32) -> bool {
    let weight = weight.max_element();
    !(weight == 0.0 || weight < prune)
}

/// Sums over a pixel's samples.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelSum {
    /// Colour.
    pub rgb: Vec3,
    /// Diffuse reflectance.
    pub albedo: Vec3,
    /// What the background counts for.
    pub through: f32,
}

impl PixelSum {
    /// A path leaves the scene. With alpha the background adds no colour to camera rays.
    #[inline]
    pub fn escape(&mut self, shot: &Shot, path: &Path, ray: &Ray) {
        if path.is_camera {
            self.through += path.weight.element_sum() / 3.0;
        }
        if !(shot.alpha && path.is_camera) {
            self.rgb += background(&shot.background, ray.direction) * path.weight;
        }
    }
}
