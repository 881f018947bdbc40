//! What a surface is at one point: the material's constants, its maps, and the normal that they bend.

use super::material::{HALO, MaterialRecord};
use super::texture::{color_of, dissolve_of, lookup, number_of, slopes};
use super::world::{Surface, Texcoord, World};
use crate::accel::Hit;
use crate::math::{Vec2, Vec3};
use crate::scene::{Map, Textures};

/// A material at a point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// The material with its maps applied; its Kd is that of the surface.
    pub material: MaterialRecord,
    /// The shading normal.
    pub n: Vec3,
    /// Cosine between it and the direction to the viewer, 0 or more.
    pub cos: f32,
}

/// The least cosine that footprints are divided by.
const LEAST_COSINE: f32 = 0.1;

impl Point {
    /// The point of a hit; `view` is the unit vector towards the viewer, `width` that of the ray's cone.
    pub fn new(world: &World, surface: &Surface, hit: &Hit, view: Vec3, width: f32) -> Self {
        let mut material = world.materials[surface.material as usize];
        material.kd = surface.kd;
        let mut n = surface.n;
        if let Some((textures, at)) = world.maps(hit, surface.material)
            && let Some(uv) = at.uv
        {
            let seen = width / surface.ng.dot(view).abs().max(LEAST_COSINE);
            apply(&mut material, textures, uv, seen * at.uv_per_width);
            n = bent(n, textures, &at, uv, seen);
            n = if n.dot(surface.ng) < 0.0 { -n } else { n };
        }
        let cos = n.dot(view).max(0.0);
        if material.flags & HALO != 0 {
            material.d = 1.0 - (1.0 - material.d) * cos.min(1.0);
        }
        Self { material, n, cos }
    }
}

/// What a shadow ray keeps of its light at a hit; maps at their finest level.
pub fn shadow_factor(world: &World, hit: &Hit, surface: impl Fn() -> Surface, view: Vec3) -> Vec3 {
    let material = world.material_of(hit);
    let record = &world.materials[material as usize];
    if record.flags & HALO == 0 && world.maps(hit, material).is_none() {
        return record.shadow_factor(record.d, record.tf, record.ks);
    }
    let m = Point::new(world, &surface(), hit, view, 0.0).material;
    m.shadow_factor(m.d, m.tf, m.ks)
}

/// Multiplies constants by their maps. `uv_width` is the width of what is seen in units of u and v.
fn apply(m: &mut MaterialRecord, textures: &Textures, uv: Vec2, uv_width: f32) {
    let color =
        |map: &Option<Map>| map.as_ref().map_or(Vec3::ONE, |map| color_of(map, uv, texels(map, uv_width)));
    m.ka *= color(&textures.map_ka);
    m.kd *= color(&textures.map_kd);
    m.ks *= color(&textures.map_ks);
    m.ke *= color(&textures.map_ke);
    if let Some(map) = &textures.map_ns {
        m.ns = (m.ns * number_of(map, uv, texels(map, uv_width))).max(0.0);
    }
    if let Some(map) = &textures.map_d {
        m.d = (m.d * dissolve_of(map, uv, texels(map, uv_width))).clamp(0.0, 1.0);
    }
}

/// A width in (u, v) in texels of level 0 of a map.
fn texels(map: &Map, uv_width: f32) -> f32 {
    let [width, height] = map.texture.size.map(|s| s as f32);
    uv_width * (width * height * (map.scale[0] * map.scale[1]).abs()).sqrt()
}

/// The normal after the maps of heights and of normals.
fn bent(n: Vec3, textures: &Textures, at: &Texcoord, uv: Vec2, seen: f32) -> Vec3 {
    let across = |t: Vec3| (t - n * n.dot(t)).normalize_or_zero();
    let (t, b) = (across(at.tangent), across(at.bitangent));
    let width = seen * at.uv_per_width;
    let mut bent = n;
    if let Some(map) = &textures.bump {
        let slope = slopes(map, uv, texels(map, width)) * map.bump_multiplier;
        bent = (n - (t * slope.x + b * slope.y)).normalize_or(n);
    }
    if let Some(map) = &textures.norm {
        let [x, y, z, _] = lookup(map, uv, texels(map, width)).map(|c| 2.0 * c - 1.0);
        bent = (t * (x * map.bump_multiplier) + b * (y * map.bump_multiplier) + bent * z).normalize_or(bent);
    }
    bent
}
