//! The illumination models 0, 1 and 2 of MTL at one point (`A + D + S`; no π).

use super::light::Incident;
use super::material::MaterialRecord;
use super::power::powf;
use super::world::Surface;
use crate::math::Vec3;

/// What leaves a surface towards the viewer, by kind; linear RGB.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reflected {
    /// D: Σ Kd·Ij·Sj·(N·Lj).
    pub diffuse: Vec3,
    /// S: Σ Ks·Ij·Sj·max(0, N·Hj)^Ns.
    pub specular: Vec3,
}

/// Whether a light in that direction reaches the viewer's side: N·L > 0 and Ng·L > 0.
pub fn faces(surface: &Surface, direction: Vec3) -> bool {
    surface.n.dot(direction) > 0.0 && surface.ng.dot(direction) > 0.0
}

/// What one light adds where nothing is in its way; it must [`faces`] the surface. `view` is the unit vector towards
/// the viewer.
pub fn reflect(surface: &Surface, material: &MaterialRecord, view: Vec3, light: &Incident) -> Reflected {
    let diffuse = surface.kd * light.radiance * surface.n.dot(light.direction);
    if material.illum < 2 || material.ks == Vec3::ZERO {
        return Reflected { diffuse, specular: Vec3::ZERO };
    }
    // S is 0 where the light and the viewer are opposite
    let specular = match (light.direction + view).try_normalize() {
        Some(half) => material.ks * light.radiance * powf(surface.n.dot(half).max(0.0), material.ns),
        None => Vec3::ZERO,
    };
    Reflected { diffuse, specular }
}

/// The colour by the material's model from what its lights add up to: model 0 is Kd, 1 is A + D, 2 is A + D + S with
/// A = Ka·Ia + Ke.
pub fn color(surface: &Surface, material: &MaterialRecord, ambient: Vec3, sum: &Reflected) -> Vec3 {
    if material.illum == 0 {
        return surface.kd;
    }
    material.ka * ambient + material.ke + sum.diffuse + sum.specular
}
