//! Area lights: every point of the triangles that glow is a light (CONTRACT 5), estimated by points chosen by power.

use super::light::Incident;
use super::sampler::unit_square_of;
use super::world::World;
use crate::accel::{magnitude, offset_origin};
use crate::math::Vec3;
use std::f32::consts::FRAC_1_PI;

/// The triangles that glow.
#[derive(Clone, Debug)]
pub struct AreaLight {
    triangles: Vec<Emitter>,
    /// Samples at every shading point.
    pub samples: u32,
}

/// A triangle that glows on both sides.
#[derive(Clone, Copy, Debug)]
struct Emitter {
    corners: [Vec3; 3],
    normal: Vec3,
    ke: Vec3,
    area: f32,
    /// The share of all power of the triangles before it.
    before: f32,
    /// Its own share.
    share: f32,
}

/// Which sample of which pixel is being taken.
#[derive(Clone, Copy, Debug)]
pub struct AreaSample {
    /// Column and row.
    pub pixel: [u32; 2],
    /// The sample of the pixel.
    pub index: u32,
    /// The job's seed.
    pub seed: u32,
    /// Surfaces shaded before it on the sample's way.
    pub surface: u32,
}

/// A point of the light as a shading point sees it.
#[derive(Clone, Copy, Debug)]
pub struct Sampled {
    /// Direction, and what arrives over the probability of the choice.
    pub incident: Incident,
    /// Where shadow rays end: the point, moved off its triangle to the side that is seen.
    pub target: Vec3,
}

impl AreaLight {
    /// All triangles of a frame with Ke > 0; None where nothing glows.
    pub fn new(world: &World, samples: u32) -> Option<Self> {
        let mut triangles: Vec<Emitter> = world
            .emitting()
            .into_iter()
            .map(|(ke, corners)| {
                let cross = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
                let area = 0.5 * cross.length();
                let share = area * ke.element_sum();
                Emitter { corners, normal: cross.normalize_or_zero(), ke, area, before: 0.0, share }
            })
            .filter(|e| e.share > 0.0 && e.share.is_finite())
            .collect();
        let sum: f64 = triangles.iter().map(|e| f64::from(e.share)).sum();
        let mut before = 0.0;
        for e in &mut triangles {
            let share = f64::from(e.share) / sum;
            e.before = before as f32;
            e.share = share as f32;
            before += share;
        }
        (!triangles.is_empty()).then_some(Self { triangles, samples })
    }

    /// Sample i of the light's own for a point; None where the chosen point does not shine there.
    pub fn sample(&self, sample: &AreaSample, point: Vec3, i: u32) -> Option<Sampled> {
        let index = sample.index * self.samples + i;
        let [mut u, v] = unit_square_of(index, sample.pixel, sample.seed, 1 + sample.surface);
        let place = self.triangles.partition_point(|e| e.before <= u).saturating_sub(1);
        let e = &self.triangles[place];
        // what is left of u after the choice is as even as it was
        u = ((u - e.before) / e.share).clamp(0.0, 1.0);
        // even over the triangle: Turk, "Generating random points in triangles", Graphics Gems, 1990
        let root = u.sqrt();
        let (b, c) = (root * (1.0 - v), root * v);
        let x = e.corners[0] * (1.0 - b - c) + e.corners[1] * b + e.corners[2] * c;
        let towards = x - point;
        let square = towards.length_squared();
        let direction = towards.try_normalize()?;
        let cos = e.normal.dot(direction);
        if cos == 0.0 || square == 0.0 {
            return None;
        }
        // (1/π)·Ke·|cos θ'|/d² dA over the density of x: share / area
        let radiance = e.ke * (FRAC_1_PI * cos.abs() / square * e.area / e.share);
        let side = if cos > 0.0 { -e.normal } else { e.normal };
        let target = offset_origin(x, side, magnitude(&e.corners));
        Some(Sampled { incident: Incident { direction, radiance }, target })
    }
}
