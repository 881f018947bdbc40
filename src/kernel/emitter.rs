//! Area lights: the triangles that glow, and points on them that stand for their light.

use super::light::{LightRecord, POINT};
use super::maps::textured_emission;
use super::world::World;
use crate::accel::{Hit, hit_point, offset_origin};
use crate::math::Vec3;
use bytemuck::Zeroable;
use std::f32::consts::FRAC_1_PI;

/// A triangle that glows.
#[derive(Clone, Debug)]
pub struct Emitter {
    /// In the world.
    pub corners: [Vec3; 3],
    /// As [`super::world::Surface::magnitude`].
    pub magnitude: Vec3,
    /// Unit.
    pub normal: Vec3,
    /// Ke · (1/π) · its area / the share of points that it is given.
    pub radiance: Vec3,
    /// Its material's place in [`World::materials`].
    pub material: u32,
    /// Where it stands in the frame.
    pub place: Hit,
}

/// The triangles with Ke > 0, chosen by their power: area × sum of the channels of Ke.
#[derive(Clone, Debug, Default)]
pub struct Emitters {
    /// In the order of the frame.
    pub emitters: Vec<Emitter>,
    /// The shares of all emitters up to each, itself included; the last is 1.
    pub shares: Vec<f32>,
}

impl Emitters {
    /// All those of a frame, in order.
    pub fn new(world: &World) -> Self {
        let ke = |material: u32| world.materials[material as usize].ke;
        let (mut emitters, mut powers, mut total) = (Vec::new(), Vec::new(), 0.0);
        world.triangles_of(
            |material| ke(material).max_element() > 0.0,
            |place, material, corners, magnitude| {
                let [a, b, c] = corners.map(glam::Vec3::as_dvec3);
                let cross = (b - a).cross(c - a);
                let area = 0.5 * cross.length();
                let power = area * f64::from(ke(material).element_sum());
                if area > 0.0 && power.is_finite() {
                    total += power;
                    powers.push((power, area, total));
                    let normal = cross.normalize_or_zero().as_vec3();
                    let radiance = ke(material) * FRAC_1_PI;
                    emitters.push(Emitter { corners, magnitude, normal, radiance, material, place });
                }
            },
        );
        for (emitter, (power, area, _)) in emitters.iter_mut().zip(&powers) {
            emitter.radiance *= (area * total / power) as f32;
        }
        let shares = powers.iter().map(|(.., up_to)| (up_to / total) as f32).collect();
        Self { emitters, shares }
    }

    /// The point light that stands for all of them at a point, chosen by a point of the unit square; its radiance counts
    /// the whole. None where nothing glows.
    pub fn stand_in(&self, world: &World, point: Vec3, [r, s]: [f32; 2]) -> Option<LightRecord> {
        let chosen = self.shares.partition_point(|&share| share <= r).min(self.shares.len().checked_sub(1)?);
        let e = &self.emitters[chosen];
        // what is left of r within the chosen one's share is as good as new
        let low = if chosen == 0 { 0.0 } else { self.shares[chosen - 1] };
        let r = ((r - low) / (self.shares[chosen] - low)).clamp(0.0, 1.0);
        let root = r.sqrt();
        let barycentric = [root * (1.0 - s), root * s];
        let x = hit_point(&e.corners, barycentric);
        let to_point = point - x;
        let distance_squared = to_point.length_squared();
        let mut light = LightRecord::zeroed();
        light.kind = POINT;
        let cosine = e.normal.dot(to_point.normalize_or_zero());
        light.place = offset_origin(x, if cosine < 0.0 { -e.normal } else { e.normal }, e.magnitude);
        if distance_squared > 0.0 {
            light.radiance = e.radiance * (cosine.abs() / distance_squared);
            if let Some(textures) = world.textures(e.material)
                && textures.map_ke.is_some()
                && let Some(uv) = world.uv(&Hit { barycentric, ..e.place })
            {
                light.radiance = textured_emission(light.radiance, textures, uv);
            }
        }
        Some(light)
    }
}
