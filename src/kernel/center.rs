//! Auxiliary pictures of the ray through the pixel's centre, at the first surface with d > 0.

use super::SURFACES_MAX;
use super::band::FilmBand;
use super::scene::Scene;
use crate::accel::{Aggregate, Hit, Ray};

/// Fills depth, normal, position, id, material and texture coordinates where they are wanted; pixels where nothing is
/// seen keep what they have. Rays and their first hits stand in the order of the pixels, (column, row in the band).
pub fn fill_center<A: Aggregate>(
    scene: &Scene<A>,
    band: &mut FilmBand,
    pixels: &[[u32; 2]],
    rays: &[Ray],
    hits: &[Option<Hit>],
) {
    let world = &scene.world;
    for ((&pixel, ray), hit) in pixels.iter().zip(rays).zip(hits) {
        let Some(hit) = first_visible(scene, ray, *hit) else { continue };
        let place = band.place(pixel);
        if let Some(depth) = &mut band.depth {
            depth[place] = hit.distance;
        }
        if let Some(id) = &mut band.id {
            id[place] = world.id(&hit);
        }
        if let Some(material) = &mut band.material {
            material[place] = world.material_slot(&hit);
        }
        if let Some(uv) = &mut band.uv {
            uv[place] = world.uv(&hit).unwrap_or_default();
        }
        if band.normal.is_some() || band.position.is_some() {
            let mut surface = world.surface(ray, &hit, world.material(&hit));
            // maps change the normal
            world.changed(ray, &hit, &mut surface, scene.spread * hit.distance);
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
fn first_visible<A: Aggregate>(scene: &Scene<A>, ray: &Ray, first: Option<Hit>) -> Option<Hit> {
    let mut hit = first;
    for _ in 0..SURFACES_MAX {
        let at = hit?;
        if scene.world.dissolve(ray, &at, scene.spread * at.distance) > 0.0 {
            return hit;
        }
        hit = scene.aggregate.closest(ray, Some(scene.aggregate.order(&at)));
    }
    None
}
