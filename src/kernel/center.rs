//! Auxiliary pictures of the ray through the pixel's centre, at the first surface with d > 0.

use super::SURFACES_MAX;
use super::band::FilmBand;
use super::world::World;
use crate::accel::{Aggregate, Hit, Ray};

/// Fills depth, normal, position and id where they are wanted; pixels where nothing is seen keep what they have. Rays
/// and their first hits stand in the order of the pixels, (column, row in the band).
pub fn fill_center<A: Aggregate>(
    aggregate: &A,
    world: &World,
    band: &mut FilmBand,
    pixels: &[[u32; 2]],
    rays: &[Ray],
    hits: &[Option<Hit>],
) {
    for ((&pixel, ray), hit) in pixels.iter().zip(rays).zip(hits) {
        let Some(hit) = first_visible(aggregate, world, ray, *hit) else { continue };
        let place = band.place(pixel);
        if let Some(depth) = &mut band.depth {
            depth[place] = hit.distance;
        }
        if let Some(id) = &mut band.id {
            id[place] = world.id(&hit);
        }
        if band.normal.is_some() || band.position.is_some() {
            let surface = world.surface(ray, &hit);
            if let Some(normal) = &mut band.normal {
                normal[place] = surface.n.into();
            }
            if let Some(position) = &mut band.position {
                position[place] = surface.position.into();
            }
        }
    }
}

/// The first hit with d > 0, from the first hit on.
fn first_visible<A: Aggregate>(aggregate: &A, world: &World, ray: &Ray, first: Option<Hit>) -> Option<Hit> {
    let mut hit = first;
    for _ in 0..SURFACES_MAX {
        let at = hit?;
        if world.dissolve(&at) > 0.0 {
            return hit;
        }
        hit = aggregate.closest(ray, Some(aggregate.order(&at)));
    }
    None
}
