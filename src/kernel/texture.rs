//! Texels: trilinear lookup with a level by the footprint, in linear numbers.

use crate::film::color;
use crate::math::{Vec2, Vec3};
use crate::scene::{Channel, Map, TexelSpace, Texels, Texture};
use std::sync::OnceLock;

/// The texel of a map at (u, v) in linear numbers, RGBA; `footprint` is the width of what is seen in units of u and v
/// times the size of level 0, so that 1 is a texel; 0 for level 0.
pub fn lookup(map: &Map, uv: Vec2, footprint: f32) -> [f32; 4] {
    let texture = &*map.texture;
    let uv = place(map, uv);
    let top = (texture.levels() - 1) as f32;
    let level = if footprint > 1.0 { libm::log2f(footprint).min(top) } else { 0.0 };
    let lower = level.floor();
    let a = bilinear(texture, lower as u32, uv, map.clamp);
    let texel = if level > lower {
        let b = bilinear(texture, lower as u32 + 1, uv, map.clamp);
        std::array::from_fn(|k| a[k] + (b[k] - a[k]) * (level - lower))
    } else {
        a
    };
    let [base, gain] = map.base_gain;
    std::array::from_fn(|k| texel[k] * gain + base)
}

/// (u, v) after the map's factors and offsets.
fn place(map: &Map, uv: Vec2) -> Vec2 {
    let placed = uv * Vec2::from(map.scale) + Vec2::from(map.offset);
    if placed.is_finite() { placed } else { Vec2::ZERO }
}

/// The colour of a map.
pub fn color_of(map: &Map, uv: Vec2, footprint: f32) -> Vec3 {
    let [r, g, b, _] = lookup(map, uv, footprint);
    Vec3::new(r, g, b)
}

/// The number of a map: its channel, else the luminance (Rec. 709).
pub fn number_of(map: &Map, uv: Vec2, footprint: f32) -> f32 {
    pick(lookup(map, uv, footprint), map.channel.unwrap_or(Channel::Luminance))
}

/// The dissolve of a map: its channel, else alpha where that varies, else the luminance.
pub fn dissolve_of(map: &Map, uv: Vec2, footprint: f32) -> f32 {
    let otherwise = if map.texture.alpha_varies { Channel::Alpha } else { Channel::Luminance };
    pick(lookup(map, uv, footprint), map.channel.unwrap_or(otherwise))
}

fn pick(texel: [f32; 4], channel: Channel) -> f32 {
    let [r, g, b, a] = texel;
    match channel {
        Channel::R => r,
        Channel::G => g,
        Channel::B => b,
        Channel::Alpha => a,
        Channel::Luminance => color::luma([r, g, b]),
    }
}

/// Slopes of a height map along u and v, from texel to texel of the level: (h(+1) − h(−1))/2.
pub fn slopes(map: &Map, uv: Vec2, footprint: f32) -> Vec2 {
    let [width, height] = map.texture.size.map(|s| s as f32);
    let texels = footprint.max(1.0);
    let step = |axis: Vec2| axis * texels / (Vec2::new(width, height) * Vec2::from(map.scale));
    let h = |d: Vec2| number_of(map, uv + d, footprint);
    let (du, dv) = (step(Vec2::X), step(Vec2::Y));
    0.5 * Vec2::new(h(du) - h(-du), h(dv) - h(-dv))
}

/// Between the four nearest texels of a level; v runs up, rows run down.
fn bilinear(texture: &Texture, level: u32, uv: Vec2, clamp: bool) -> [f32; 4] {
    let [width, height] = texture.level_size(level);
    let x = uv.x * width as f32 - 0.5;
    let y = (1.0 - uv.y) * height as f32 - 0.5;
    let (x0, y0) = (x.floor(), y.floor());
    let (fx, fy) = (x - x0, y - y0);
    let first = first_texel(texture, level);
    let at = |x: f32, y: f32| {
        let column = wrap(x, width, clamp) as usize;
        let row = wrap(y, height, clamp) as usize;
        texel(texture, first + row * width as usize + column)
    };
    let (a, b) = (at(x0, y0), at(x0 + 1.0, y0));
    let (c, d) = (at(x0, y0 + 1.0), at(x0 + 1.0, y0 + 1.0));
    std::array::from_fn(|k| {
        let upper = a[k] + (b[k] - a[k]) * fx;
        let lower = c[k] + (d[k] - c[k]) * fx;
        upper + (lower - upper) * fy
    })
}

/// A column or row within the level: the border's, or that of the repeated texture. What is not finite is 0.
fn wrap(x: f32, size: u32, clamp: bool) -> u32 {
    let last = size - 1;
    if clamp {
        return (x.max(0.0) as u32).min(last);
    }
    let size = size as f32;
    let within = x - size * (x / size).floor();
    (within.max(0.0) as u32).min(last)
}

fn first_texel(texture: &Texture, level: u32) -> usize {
    (0..level).map(|l| texture.level_size(l)).map(|[w, h]| w as usize * h as usize).sum()
}

/// A texel in linear numbers; one that is not there is black.
fn texel(texture: &Texture, index: usize) -> [f32; 4] {
    match &texture.texels {
        Texels::F32(t) => t.get(index).copied().unwrap_or_default(),
        Texels::U8(t) => {
            let [r, g, b, a] = t.get(index).copied().unwrap_or_default();
            let share = |x: u8| f32::from(x) / 255.0;
            match texture.space {
                TexelSpace::Linear => [share(r), share(g), share(b), share(a)],
                TexelSpace::Srgb => {
                    let table = linear_from_srgb8();
                    [table[r as usize], table[g as usize], table[b as usize], share(a)]
                }
            }
        }
    }
}

fn linear_from_srgb8() -> &'static [f32; 256] {
    static TABLE: OnceLock<[f32; 256]> = OnceLock::new();
    TABLE.get_or_init(|| std::array::from_fn(|i| color::linear_from_srgb(i as f64 / 255.0) as f32))
}

/// A latitude-longitude picture in a direction (unit): its middle is at −z, its top at +y.
pub fn sphere(map: &Map, direction: Vec3) -> Vec3 {
    let [x, y, z] = direction.to_array().map(f64::from);
    let u = 0.5 + libm::atan2(x, -z) / std::f64::consts::TAU;
    let v = 0.5 + libm::asin(y.clamp(-1.0, 1.0)) / std::f64::consts::PI;
    // around it repeats, above and below it ends
    let half_texel = 0.5 / map.texture.size[1] as f32;
    color_of(map, Vec2::new(u as f32, (v as f32).clamp(half_texel, 1.0 - half_texel)), 0.0)
}

/// A cube of pictures in a direction: faces −x, +x, −y, +y, −z, +z as seen from inside; a missing one is black.
pub fn cube(faces: &[Option<Map>; 6], direction: Vec3) -> Vec3 {
    let size = direction.abs();
    let axis = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.y < size.z) };
    let positive = direction[axis] > 0.0;
    let d = direction / size[axis];
    // right and up on each face, for an eye in the middle whose up is +y (−z ahead for the faces above and below)
    let (right, up) = match (axis, positive) {
        (0, false) => (-d.z, d.y),
        (0, true) => (d.z, d.y),
        (1, false) => (d.x, -d.z),
        (1, true) => (d.x, d.z),
        (_, false) => (d.x, d.y),
        (_, true) => (-d.x, d.y),
    };
    let uv = Vec2::new(0.5 + 0.5 * right, 0.5 + 0.5 * up);
    faces[2 * axis + usize::from(positive)].as_ref().map_or(Vec3::ZERO, |map| color_of(map, uv, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Part;

    /// Four texels and their mean: 0 and 100 above, 200 and 40 below.
    fn map(clamp: bool) -> Map {
        let gray = |g: u8| [g, g, g, 255];
        let texels = Texels::U8(vec![gray(0), gray(100), gray(200), gray(40), gray(85)]);
        let texture = Texture { size: [2, 2], space: TexelSpace::Linear, alpha_varies: false, texels };
        Map {
            texture: Part::new(texture),
            scale: [1.0; 2],
            offset: [0.0; 2],
            clamp,
            base_gain: [0.0, 1.0],
            bump_multiplier: 1.0,
            channel: None,
        }
    }

    fn at(map: &Map, u: f32, v: f32, footprint: f32) -> f32 {
        255.0 * number_of(map, Vec2::new(u, v), footprint)
    }

    fn close(a: f32, b: f32) -> bool {
        (a - b).abs() < 1e-3
    }

    #[test]
    fn texels_have_their_centres_and_v_runs_up() {
        let m = map(true);
        assert!(close(at(&m, 0.25, 0.75, 0.0), 0.0) && close(at(&m, 0.75, 0.75, 0.0), 100.0));
        assert!(close(at(&m, 0.25, 0.25, 0.0), 200.0) && close(at(&m, 0.75, 0.25, 0.0), 40.0));
        // a quarter of the way from 0 to 100, and the middle of all four
        assert!(close(at(&m, 0.375, 0.75, 0.0), 25.0));
        assert!(close(at(&m, 0.5, 0.5, 0.0), 85.0));
    }

    #[test]
    fn outside_it_repeats_or_stays_at_the_border() {
        let (repeat, clamp) = (map(false), map(true));
        assert!(close(at(&repeat, 1.25, 0.75, 0.0), 0.0) && close(at(&clamp, 1.25, 0.75, 0.0), 100.0));
        assert!(close(at(&repeat, -0.25, 0.75, 0.0), 100.0) && close(at(&clamp, -7.0, 0.75, 0.0), 0.0));
        // between the last and the first column
        assert!(close(at(&repeat, 0.0, 0.75, 0.0), 50.0));
        assert!(at(&repeat, f32::NAN, f32::INFINITY, 0.0).is_finite());
    }

    #[test]
    fn levels_are_mixed_by_the_footprint() {
        let m = map(true);
        assert!(close(at(&m, 0.25, 0.75, 2.0), 85.0) && close(at(&m, 0.25, 0.75, 1e9), 85.0));
        // level ½: half of each
        assert!(close(at(&m, 0.25, 0.75, 2f32.sqrt()), 42.5));
    }

    #[test]
    fn options_and_channels() {
        let mut m = map(true);
        m.base_gain = [0.1, 0.5];
        assert!(close(at(&m, 0.75, 0.75, 0.0), 25.5 + 50.0));
        let m = Map { scale: [2.0, 1.0], offset: [-0.5, 0.0], ..map(true) };
        assert!(close(at(&m, 0.625, 0.75, 0.0), 100.0));
        let m = Map { channel: Some(Channel::Alpha), ..map(true) };
        assert!(close(at(&m, 0.25, 0.75, 0.0), 255.0));
        // from the left column to the right one the heights above rise by 100, half of it a texel on either side
        let slope = slopes(&map(true), Vec2::new(0.5, 0.75), 0.0) * 255.0;
        assert!(close(slope.x, 0.5 * (100.0 - 0.0)), "{slope}");
    }

    #[test]
    fn a_sphere_and_a_cube_around() {
        let m = map(false);
        // straight ahead is the middle of the picture
        assert!((255.0 * sphere(&m, Vec3::NEG_Z).x - 85.0).abs() < 1e-3);
        let faces = std::array::from_fn(|i| (i == 1).then(|| map(true)));
        assert!(
            (255.0 * cube(&faces, Vec3::new(1.0, 0.5, -0.5)).x - 0.0).abs() < 1e-3,
            "left and up on the face ahead of +x"
        );
        assert_eq!(cube(&faces, Vec3::NEG_X), Vec3::ZERO);
    }
}
