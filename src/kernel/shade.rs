//! Light on a surface at one point (`A + D + S`; no π).

use super::light::Incident;
use super::material::MaterialRecord;
use super::optics::schlick;
use super::power::powf;
use super::world::Surface;
use crate::math::Vec3;

/// What leaves a surface towards the viewer, by kind; linear RGB.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reflected {
    /// D: Σ Kd·Ij·Sj·(N·Lj). In model 10 Σ Ij·Sj·(N·Lj).
    pub diffuse: Vec3,
    /// S: Σ Ks·Ij·Sj·max(0, N·Hj)^Ns. In model 10 Σ Ij·(N·Lj).
    pub specular: Vec3,
}

/// Whether a light in that direction reaches the viewer's side: N·L > 0 and Ng·L > 0.
pub fn faces(surface: &Surface, direction: Vec3) -> bool {
    surface.n.dot(direction) > 0.0 && surface.ng.dot(direction) > 0.0
}

/// What one light adds where nothing is in its way; it must [`faces`] the surface. `view` is the unit vector towards
/// the viewer.
pub fn reflect(surface: &Surface, material: &MaterialRecord, view: Vec3, light: &Incident) -> Reflected {
    if material.illum == 10 {
        return Reflected { diffuse: unshadowed(surface, light), specular: Vec3::ZERO };
    }
    let diffuse = surface.kd * light.radiance * surface.n.dot(light.direction);
    let is_fresnel = matches!(material.illum, 5 | 7);
    if material.illum < 2 || material.ks == Vec3::ZERO && !is_fresnel {
        return Reflected { diffuse, specular: Vec3::ZERO };
    }
    // S is 0 where the light and the viewer are opposite
    let specular = match (light.direction + view).try_normalize() {
        Some(half) => {
            let ks = if is_fresnel { schlick(material.ks, light.direction.dot(half)) } else { material.ks };
            ks * light.radiance * powf(surface.n.dot(half).max(0.0), material.ns)
        }
        None => Vec3::ZERO,
    };
    Reflected { diffuse, specular }
}

/// What a light that [`faces`] the surface brings to it where nothing is in its way.
pub fn unshadowed(surface: &Surface, light: &Incident) -> Vec3 {
    light.radiance * surface.n.dot(light.direction)
}

/// The colour without mirrored and refracted light: model 0 is Kd, the others are A + D + S with A = Ka·Ia + Ke; S is 0
/// in model 1.
pub fn color(surface: &Surface, material: &MaterialRecord, ambient: Vec3, sum: &Reflected) -> Vec3 {
    if material.illum == 0 {
        return surface.kd;
    }
    material.ka * ambient + material.ke + sum.diffuse + sum.specular
}
