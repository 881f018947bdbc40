//! Direct light: shadow rays from many surfaces to one light after the other.

use super::light::{AREA, Incident, LightRecord, incident};
use super::material::MaterialRecord;
use super::sampler::{hash, unit_square_for};
use super::scene::Scene;
use super::shade::{Reflected, faces, reflect, unshadowed};
use super::world::{Surface, World};
use super::{RayCounts, SURFACES_MAX};
use crate::accel::{Aggregate, Hit, Ray, offset_origin};
use crate::math::Vec3;
use std::borrow::Borrow;

/// A surface on its way to a colour.
#[derive(Clone, Copy, Debug)]
pub struct Shading {
    /// The path that is there, by its place.
    pub path: u32,
    /// The pixel, by its place in the tile.
    pub pixel: u32,
    /// What its colour counts for there.
    pub weight: Vec3,
    /// The surface.
    pub surface: Surface,
    /// The material's constants at this point: a place in [`World::materials`], or beyond them in [`Constants::own`].
    pub constants: u32,
    /// Unit vector towards the viewer.
    pub view: Vec3,
    /// What its lights add up to.
    pub sum: Reflected,
}

/// The constants of materials as shading points see them.
#[derive(Clone, Copy, Debug)]
pub struct Constants<'a> {
    /// Those of the frame.
    pub all: &'a [MaterialRecord],
    /// Those of single points, where maps, angles or media change them.
    pub own: &'a [MaterialRecord],
}

impl<'a> Constants<'a> {
    /// Those of a shading point.
    pub fn of(&self, s: &Shading) -> &'a MaterialRecord {
        let place = s.constants as usize;
        self.all.get(place).unwrap_or_else(|| &self.own[place - self.all.len()])
    }
}

/// Which of a pixel's samples is being taken, and where its paths are.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// The pixels of the tile, (column, row in the band).
    pub pixels: &'a [[u32; 2]],
    /// The band's first row.
    pub first_row: u32,
    /// The sample's number.
    pub index: u32,
    /// Surfaces that each path has met before in this sample.
    pub step: u32,
}

impl Sample<'_> {
    /// A point of the unit square for point `k` of `count` of a light at a shading point.
    fn point(&self, pixel: u32, light: u32, k: u32, count: u32, seed: u32) -> [f32; 2] {
        let [x, row] = self.pixels[pixel as usize];
        let index = self.index.wrapping_mul(count).wrapping_add(k);
        unit_square_for(hash(self.step) ^ light, index, [x, self.first_row + row], seed)
    }
}

/// Room for the shadow rays of one light, kept from light to light.
#[derive(Debug, Default)]
pub struct ShadowRays {
    rays: Vec<Ray>,
    ends: Vec<f32>,
    occluded: Vec<bool>,
    /// The first hit of each ray, where it may be of something transparent.
    hits: Vec<Option<Hit>>,
    /// For each ray its surface, by place, and what arrives there.
    lit: Vec<(u32, Incident)>,
}

/// Adds each light, in the order given, to each surface's sum.
pub fn add_lights<A: Aggregate>(
    scene: &Scene<A>,
    constants: Constants,
    sample: Sample,
    shadings: &mut [Shading],
    shadow: &mut ShadowRays,
    counts: &mut RayCounts,
) {
    for (number, light) in (0..).zip(&scene.lights) {
        if light.kind == AREA {
            for k in 0..light.samples {
                shadow.aim(constants, shadings, |s: &Shading| {
                    let at = sample.point(s.pixel, number, k, light.samples, scene.shot.seed);
                    let mut light = *light;
                    if let Some(stand_in) = scene.emitters.stand_in(&scene.world, s.surface.position, at) {
                        light =
                            LightRecord { radiance: stand_in.radiance / light.samples as f32, ..stand_in };
                    }
                    light
                });
                shadow.trace(scene, constants, shadings, counts);
            }
        } else {
            shadow.aim(constants, shadings, |_| light);
            shadow.trace(scene, constants, shadings, counts);
        }
    }
}

impl ShadowRays {
    /// Collects the rays to a light from those surfaces that it can reach.
    fn aim<L: Borrow<LightRecord>>(
        &mut self,
        constants: Constants,
        shadings: &mut [Shading],
        light: impl Fn(&Shading) -> L,
    ) {
        self.rays.clear();
        self.ends.clear();
        self.lit.clear();
        for (place, s) in shadings.iter_mut().enumerate() {
            let illum = constants.of(s).illum;
            if illum == 0 {
                continue;
            }
            let light = light(s);
            let light = light.borrow();
            let incident = incident(light, s.surface.position);
            if faces(&s.surface, incident.direction) && incident.radiance != Vec3::ZERO {
                let origin = offset_origin(s.surface.position, s.surface.ng, s.surface.magnitude);
                let (direction, end) = light.shadow_segment(origin);
                self.rays.push(Ray { origin, direction });
                self.ends.push(end);
                self.lit.push((place as u32, incident));
                if illum == 10 {
                    s.sum.specular += unshadowed(&s.surface, &incident);
                }
            }
        }
    }

    /// Traces them and adds what arrives.
    fn trace<A: Aggregate>(
        &mut self,
        scene: &Scene<A>,
        constants: Constants,
        shadings: &mut [Shading],
        counts: &mut RayCounts,
    ) {
        let Scene { aggregate, world, .. } = scene;
        counts.shadow += self.rays.len() as u64;
        if world.is_opaque {
            self.occluded.resize(self.rays.len(), false);
            aggregate.occluded_batch(&self.rays, &self.ends, &mut self.occluded);
        } else {
            self.hits.resize(self.rays.len(), None);
            aggregate.closest_batch(&self.rays, &mut self.hits);
        }
        for (ray, &(place, incident)) in self.lit.iter().enumerate() {
            let s = &mut shadings[place as usize];
            if world.is_opaque {
                if !self.occluded[ray] {
                    let reflected = reflect(&s.surface, constants.of(s), s.view, &incident);
                    s.sum.diffuse += reflected.diffuse;
                    s.sum.specular += reflected.specular;
                }
                continue;
            }
            let visibility =
                transmittance(*aggregate, world, &self.rays[ray], self.ends[ray], self.hits[ray]);
            if visibility != Vec3::ZERO {
                let reflected = reflect(&s.surface, constants.of(s), s.view, &incident);
                s.sum.diffuse += reflected.diffuse * visibility;
                s.sum.specular += reflected.specular * visibility;
            }
        }
    }
}

/// The share of light that comes along a shadow ray through surfaces that are not opaque: the product of what they let
/// through, in order; 0 after [`SURFACES_MAX`].
fn transmittance<A: Aggregate>(
    aggregate: &A,
    world: &World,
    ray: &Ray,
    end: f32,
    first: Option<Hit>,
) -> Vec3 {
    let mut share = Vec3::ONE;
    let mut next = first;
    for _ in 0..SURFACES_MAX {
        match next {
            Some(hit) if hit.distance < end => {
                share *= world.shadow_factor(ray, &hit);
                if share == Vec3::ZERO {
                    return share;
                }
                next = aggregate.closest(ray, Some(aggregate.order(&hit)));
            }
            _ => return share,
        }
    }
    Vec3::ZERO
}
