//! What the maps of a material make of its constants and of the normal at a point.

use super::material::MaterialRecord;
use super::power::log2;
use super::texture::{Axis, Level, map_at, map_coordinates};
use crate::math::{Vec2, Vec3, Vec4};
use crate::scene::{Channel, Map, Textures};

/// A point of a textured triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapPoint {
    /// Texture coordinates.
    pub uv: [f32; 2],
    /// Square root of the area of texture coordinates that a unit of the triangle's area has.
    pub scale: f32,
    /// Width of the ray's cone on the surface; 0 asks for level 0.
    pub width: f32,
    /// How the point moves with u and with v.
    pub tangents: [Vec3; 2],
}

impl MapPoint {
    /// `corners` and their texture coordinates in the same order.
    pub fn new(corners: [Vec3; 3], coordinates: [[f32; 2]; 3], uv: [f32; 2], width: f32) -> Self {
        let [e1, e2] = [corners[1] - corners[0], corners[2] - corners[0]];
        let [a, b, c] = coordinates.map(Vec2::from);
        let [t1, t2] = [b - a, c - a];
        let area_uv = t1.perp_dot(t2);
        let scale = (area_uv.abs() / e1.cross(e2).length()).sqrt();
        // e1 = t1.x·∂p/∂u + t1.y·∂p/∂v, e2 alike, solved but for a positive factor
        let sign = area_uv.signum();
        let tangents = [(e1 * t2.y - e2 * t1.y) * sign, (e2 * t1.x - e1 * t2.x) * sign];
        Self { uv, scale, width, tangents }
    }

    /// log2 of the footprint in texels of level 0, at least 0.
    fn level(&self, map: &Map) -> f32 {
        let [w, h] = map.texture.size.map(|s| s as f32);
        let texels = self.width * self.scale * (w * h * (map.scale[0] * map.scale[1]).abs()).sqrt();
        // also where it is not a number
        if texels > 1.0 { log2(f64::from(texels)) as f32 } else { 0.0 }
    }
}

/// The constants times the maps.
pub fn textured(m: &MaterialRecord, textures: &Textures, point: &MapPoint) -> MaterialRecord {
    let at = |map: &Map| map_at(map, point.uv, point.level(map));
    let color = |map: &Option<Map>| map.as_ref().map_or(Vec3::ONE, |map| at(map).truncate());
    let number = |map: &Option<Map>, otherwise: fn(&Map) -> Channel| {
        map.as_ref().map_or(1.0, |map| channel(at(map), map.channel.unwrap_or(otherwise(map))))
    };
    let alpha = |map: &Map| if map.texture.alpha_varies { Channel::Alpha } else { Channel::Luminance };
    let kd = color(&textures.map_kd);
    // usually the same map
    let ka = if textures.map_ka == textures.map_kd { kd } else { color(&textures.map_ka) };
    MaterialRecord {
        ka: m.ka * ka,
        kd: m.kd * kd,
        ks: m.ks * color(&textures.map_ks),
        ke: m.ke * color(&textures.map_ke),
        ns: (m.ns * number(&textures.map_ns, |_| Channel::Luminance)).clamp(0.0, f32::MAX),
        d: (m.d * number(&textures.map_d, alpha)).clamp(0.0, 1.0),
        ..*m
    }
}

/// Emission times its map at level 0.
pub fn textured_emission(ke: Vec3, textures: &Textures, uv: [f32; 2]) -> Vec3 {
    textures.map_ke.as_ref().map_or(ke, |map| ke * map_at(map, uv, 0.0).truncate())
}

/// The normal as `bump` and `norm` tilt it.
pub fn tilted(n: Vec3, textures: &Textures, point: &MapPoint) -> Vec3 {
    let mut tilted = n;
    if let Some(map) = &textures.bump {
        let [t, b] = axes(n, map, point);
        let [du, dv] = slopes(map, point);
        tilted = (n - (t * du + b * dv) * map.bump_multiplier).normalize_or(n);
    }
    if let Some(map) = &textures.norm {
        let [t, b] = axes(tilted, map, point);
        let [x, y, z] = (map_at(map, point.uv, point.level(map)) * 2.0 - 1.0).truncate().to_array();
        tilted = (t * x + b * y + tilted * z).normalize_or(tilted);
    }
    tilted
}

/// Unit directions of growing u and v of a map, perpendicular to the normal; 0 where there are none.
fn axes(n: Vec3, map: &Map, point: &MapPoint) -> [Vec3; 2] {
    [0, 1].map(|k| {
        let t = point.tangents[k].normalize_or_zero() * map.scale[k].signum();
        (t - n * n.dot(t)).normalize_or_zero()
    })
}

/// Half the differences of the heights a texel to both sides, along u and v, of the level that is next.
fn slopes(map: &Map, point: &MapPoint) -> [f32; 2] {
    let texture = &map.texture;
    let nearest = ((point.level(map) + 0.5) as u32).min(texture.levels() - 1);
    let level = Level::new(texture, nearest, map.clamp);
    let [column, row] = level.axes(map_coordinates(map, point.uv));
    let height = |column: Axis, row: Axis| {
        let [base, gain] = map.base_gain;
        channel(level.mix(column, row) * gain + base, map.channel.unwrap_or(Channel::Luminance))
    };
    let along_u = height(column.moved(1), row) - height(column.moved(-1), row);
    // rows run down
    let along_v = height(column, row.moved(-1)) - height(column, row.moved(1));
    [along_u / 2.0, along_v / 2.0]
}

fn channel(texel: Vec4, channel: Channel) -> f32 {
    match channel {
        Channel::R => texel.x,
        Channel::G => texel.y,
        Channel::B => texel.z,
        Channel::Alpha => texel.w,
        // Rec. 709
        Channel::Luminance => 0.2126 * texel.x + 0.7152 * texel.y + 0.0722 * texel.z,
    }
}

#[cfg(test)]
mod tests {
    use super::super::texture::tests::{grey, map};
    use super::*;
    use crate::scene::{Material, Part, TexelSpace, Texels, Texture};

    /// u grows with x, twice as fast; v with y.
    fn point(uv: [f32; 2], width: f32) -> MapPoint {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        MapPoint::new(corners, [[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]], uv, width)
    }

    #[test]
    fn the_level_is_that_of_the_footprint() {
        // 8 × 4 texels over 1/2 × 1: √(2 · 32) = 8 texels a unit; a cone 1/2 wide covers 4: level 2
        let m = map(grey([8, 4], &[0.0; 32]));
        assert!((point([0.0; 2], 0.5).level(&m) - 2.0).abs() < 1e-5);
        // -s 2 2: twice as many
        let scaled = Map { scale: [2.0, -2.0], ..m.clone() };
        assert!((point([0.0; 2], 0.5).level(&scaled) - 3.0).abs() < 1e-5);
        assert_eq!(point([0.0; 2], 0.0).level(&m), 0.0);
        let flat = MapPoint::new([Vec3::ZERO; 3], [[0.0; 2]; 3], [0.0; 2], 1.0);
        assert_eq!(flat.level(&m), 0.0);
    }

    #[test]
    fn maps_multiply_constants() {
        let texture = Texture {
            size: [1, 1],
            space: TexelSpace::Linear,
            alpha_varies: true,
            texels: Texels::F32(vec![[0.5, 0.25, 1.0, 0.75]]),
        };
        let m = map(texture);
        let textures = Textures {
            map_kd: Some(m.clone()),
            map_d: Some(m.clone()),
            map_ns: Some(Map { channel: Some(Channel::G), ..m.clone() }),
            ..Textures::default()
        };
        let record = MaterialRecord::new(&Material { ns: 40.0, d: 0.5, ..Material::default() });
        let got = textured(&record, &textures, &point([0.5; 2], 0.0));
        assert_eq!((got.kd, got.d, got.ns, got.ks), (Vec3::new(0.4, 0.2, 0.8), 0.375, 10.0, Vec3::ZERO));
        // luminance of (0.5, 0.25, 1): 0.1063 + 0.1788 + 0.0722
        let opaque = Texture { alpha_varies: false, ..(*m.texture).clone() };
        let textures =
            Textures { map_d: Some(Map { texture: Part::new(opaque), ..m }), ..Textures::default() };
        let got = textured(&record, &textures, &point([0.5; 2], 0.0));
        assert!((got.d - 0.5 * 0.3573).abs() < 1e-6);
    }

    #[test]
    fn a_slope_tilts_the_normal_against_it() {
        // heights grow by 0.25 a texel with u: N − (0.25, 0, 0); -bm 2 doubles it
        let ramp = map(grey([4, 1], &[0.0, 0.25, 0.5, 0.75, 0.125, 0.625, 0.375]));
        let with = |map| Textures { bump: Some(map), ..Textures::default() };
        let middle = point([0.375, 0.5], 0.0);
        let got = tilted(Vec3::Z, &with(ramp.clone()), &middle);
        assert!((got - Vec3::new(-0.25, 0.0, 1.0).normalize()).length() < 1e-6, "{got}");
        let got = tilted(Vec3::Z, &with(Map { bump_multiplier: 2.0, ..ramp }), &middle);
        assert!((got - Vec3::new(-0.5, 0.0, 1.0).normalize()).length() < 1e-6, "{got}");
        // heights that grow with v
        let up = map(grey([1, 4], &[0.75, 0.5, 0.25, 0.0, 0.625, 0.125, 0.375]));
        let got = tilted(Vec3::Z, &with(up), &point([0.5, 0.375], 0.0));
        assert!((got - Vec3::new(0.0, -0.25, 1.0).normalize()).length() < 1e-6, "{got}");
    }

    #[test]
    fn a_normal_map_is_read_in_the_plane_of_u_and_v() {
        // (0.8, 0.5, 0.9) · 2 − 1 = (0.6, 0, 0.8)
        let texels = Texels::F32(vec![[0.8, 0.5, 0.9, 1.0]]);
        let texture = Texture { size: [1, 1], space: TexelSpace::Linear, alpha_varies: false, texels };
        let textures = Textures { norm: Some(map(texture)), ..Textures::default() };
        let got = tilted(Vec3::Z, &textures, &point([0.5; 2], 0.0));
        assert!((got - Vec3::new(0.6, 0.0, 0.8)).length() < 1e-6, "{got}");
        // u to the left
        let left = MapPoint::new(
            [Vec3::ZERO, Vec3::X, Vec3::Y],
            [[0.0, 0.0], [-1.0, 0.0], [0.0, 1.0]],
            [0.5; 2],
            0.0,
        );
        let got = tilted(Vec3::Z, &textures, &left);
        assert!((got - Vec3::new(-0.6, 0.0, 0.8)).length() < 1e-6, "{got}");
    }
}
