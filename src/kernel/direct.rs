//! Direct light: shadow rays from many surfaces to one light after the other.

use super::light::{Incident, LightRecord, incident};
use super::shade::{Reflected, faces, reflect};
use super::world::{Surface, World};
use super::{RayCounts, SURFACES_MAX};
use crate::accel::{Aggregate, HitOrder, Ray, offset_origin};
use crate::math::Vec3;

/// A surface on its way to a colour.
#[derive(Clone, Copy, Debug)]
pub struct Shading {
    /// The pixel, by its place in the tile.
    pub pixel: u32,
    /// What its colour counts for there.
    pub weight: f32,
    /// The surface.
    pub surface: Surface,
    /// Unit vector towards the viewer.
    pub view: Vec3,
    /// What its lights add up to.
    pub sum: Reflected,
}

/// Room for the shadow rays of one light, kept from light to light.
#[derive(Debug, Default)]
pub struct ShadowRays {
    rays: Vec<Ray>,
    ends: Vec<f32>,
    occluded: Vec<bool>,
    /// For each ray its surface, by place, and what arrives there.
    lit: Vec<(u32, Incident)>,
}

/// Adds each light, in the order given, to each surface's sum.
pub fn add_lights<A: Aggregate>(
    aggregate: &A,
    world: &World,
    lights: &[LightRecord],
    shadings: &mut [Shading],
    shadow: &mut ShadowRays,
    counts: &mut RayCounts,
) {
    for light in lights {
        shadow.aim(world, light, shadings);
        counts.shadow += shadow.rays.len() as u64;
        if world.is_opaque {
            shadow.occluded.resize(shadow.rays.len(), false);
            aggregate.occluded_batch(&shadow.rays, &shadow.ends, &mut shadow.occluded);
        }
        for (ray, &(place, incident)) in shadow.lit.iter().enumerate() {
            let visibility = if world.is_opaque {
                f32::from(u8::from(!shadow.occluded[ray]))
            } else {
                transmittance(aggregate, world, &shadow.rays[ray], shadow.ends[ray])
            };
            if visibility > 0.0 {
                let s = &mut shadings[place as usize];
                let material = &world.materials[s.surface.material as usize];
                let reflected = reflect(&s.surface, material, s.view, &incident);
                s.sum.diffuse += reflected.diffuse * visibility;
                s.sum.specular += reflected.specular * visibility;
            }
        }
    }
}

impl ShadowRays {
    /// Collects the rays to a light from those surfaces that it can reach.
    fn aim(&mut self, world: &World, light: &LightRecord, shadings: &[Shading]) {
        self.rays.clear();
        self.ends.clear();
        self.lit.clear();
        for (place, s) in shadings.iter().enumerate() {
            if world.materials[s.surface.material as usize].illum == 0 {
                continue;
            }
            let incident = incident(light, s.surface.position);
            if faces(&s.surface, incident.direction) && incident.radiance != Vec3::ZERO {
                let origin = offset_origin(s.surface.position, s.surface.ng, s.surface.magnitude);
                let (direction, end) = light.shadow_segment(origin);
                self.rays.push(Ray { origin, direction });
                self.ends.push(end);
                self.lit.push((place as u32, incident));
            }
        }
    }
}

/// The share of light that comes along a shadow ray through surfaces that are not opaque: the product of their 1 − d
/// in order; 0 after [`SURFACES_MAX`].
fn transmittance<A: Aggregate>(aggregate: &A, world: &World, ray: &Ray, end: f32) -> f32 {
    let mut share = 1.0;
    let mut after: Option<HitOrder> = None;
    for _ in 0..SURFACES_MAX {
        match aggregate.closest(ray, after) {
            Some(hit) if hit.distance < end => {
                share *= 1.0 - world.dissolve(&hit);
                if share == 0.0 {
                    return 0.0;
                }
                after = Some(aggregate.order(&hit));
            }
            _ => return share,
        }
    }
    0.0
}
