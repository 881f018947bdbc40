//! Texels: decoding, bilinear within a level, linear between levels.

use super::power::powf;
use crate::math::Vec4;
use crate::scene::{Map, TexelSpace, Texels, Texture};
use std::sync::LazyLock;

/// A texture at (u, v), v running up, at a level of any value; repeated or clamped. RGBA, linear.
pub fn trilinear(texture: &Texture, [u, v]: [f32; 2], level: f32, clamp: bool) -> Vec4 {
    let level = level.clamp(0.0, (texture.levels() - 1) as f32);
    let lower = level.floor();
    let at = |level: f32| bilinear(texture, [u, v], level as u32, clamp);
    let share = level - lower;
    if share == 0.0 { at(lower) } else { at(lower) * (1.0 - share) + at(lower + 1.0) * share }
}

/// A texture at (u, v) within a level: texels lie at the middle of their squares.
pub fn bilinear(texture: &Texture, uv: [f32; 2], level: u32, clamp: bool) -> Vec4 {
    let size = texture.level_size(level);
    let first = first_texel(texture, level);
    let [column, row] = [axis(uv[0], size[0], clamp), axis(1.0 - uv[1], size[1], clamp)];
    let at = |x: u32, y: u32| texel(texture, first + y as usize * size[0] as usize + x as usize);
    let along = |y: u32| at(column.low, y) * (1.0 - column.share) + at(column.high, y) * column.share;
    along(row.low) * (1.0 - row.share) + along(row.high) * row.share
}

/// A map at texture coordinates: its scale and offset before, its base and gain after.
pub fn map_at(map: &Map, uv: [f32; 2], level: f32) -> Vec4 {
    let [base, gain] = map.base_gain;
    trilinear(&map.texture, map_coordinates(map, uv), level, map.clamp) * gain + base
}

/// As [`map_at`] at level 0, clamped whatever the map says.
pub fn map_clamped_at(map: &Map, uv: [f32; 2]) -> Vec4 {
    let [base, gain] = map.base_gain;
    trilinear(&map.texture, map_coordinates(map, uv), 0.0, true) * gain + base
}

/// Texture coordinates scaled and moved as the map wants.
pub fn map_coordinates(map: &Map, uv: [f32; 2]) -> [f32; 2] {
    [0, 1].map(|k| uv[k] * map.scale[k] + map.offset[k])
}

/// Two texels beside each other, and how much the second counts for.
struct Axis {
    low: u32,
    high: u32,
    share: f32,
}

fn axis(u: f32, size: u32, clamp: bool) -> Axis {
    let u = if clamp { u.clamp(0.0, 1.0) } else { u - u.floor() };
    let x = u * size as f32 - 0.5;
    let floor = x.floor();
    // what is not a number becomes 0
    let (low, share) = (floor as i64, if floor.is_finite() { x - floor } else { 0.0 });
    let last = i64::from(size) - 1;
    let place = |i: i64| if clamp { i.clamp(0, last) } else { i.rem_euclid(last + 1) } as u32;
    Axis { low: place(low), high: place(low + 1), share }
}

/// The place of a level's first texel.
fn first_texel(texture: &Texture, level: u32) -> usize {
    (0..level).map(|l| texture.level_size(l).map(|s| s as usize)).map(|[w, h]| w * h).sum()
}

/// A texel, linear; black beyond the last.
fn texel(texture: &Texture, place: usize) -> Vec4 {
    match &texture.texels {
        Texels::F32(texels) => texels.get(place).map_or(Vec4::ZERO, |&t| t.into()),
        Texels::U8(texels) => {
            let Some(&[r, g, b, a]) = texels.get(place) else { return Vec4::ZERO };
            let of = |x: u8| match texture.space {
                TexelSpace::Srgb => LINEAR_FROM_SRGB[usize::from(x)],
                TexelSpace::Linear => f32::from(x) / 255.0,
            };
            Vec4::new(of(r), of(g), of(b), f32::from(a) / 255.0)
        }
    }
}

/// IEC 61966-2-1 of the 256 shares.
static LINEAR_FROM_SRGB: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|i| linear_from_srgb(i as f32 / 255.0)));

/// IEC 61966-2-1.
pub fn linear_from_srgb(x: f32) -> f32 {
    if x <= 0.04045 { x / 12.92 } else { powf((x + 0.055) / 1.055, 2.4) }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::scene::Part;

    /// A texture of one channel, the levels one after the other.
    pub(crate) fn grey(size: [u32; 2], texels: &[f32]) -> Texture {
        let texels = texels.iter().map(|&x| [x, x, x, 1.0]).collect();
        Texture { size, space: TexelSpace::Linear, alpha_varies: false, texels: Texels::F32(texels) }
    }

    pub(crate) fn map(texture: Texture) -> Map {
        Map {
            texture: Part::new(texture),
            scale: [1.0; 2],
            offset: [0.0; 2],
            clamp: false,
            base_gain: [0.0, 1.0],
            bump_multiplier: 1.0,
            channel: None,
        }
    }

    /// Four by two texels, the upper row 0 1 2 3, the lower 4 5 6 7; then 2.5 4.5; then 3.5.
    fn ramp() -> Texture {
        grey([4, 2], &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 2.5, 4.5, 3.5])
    }

    fn at(uv: [f32; 2], level: f32, clamp: bool) -> f32 {
        trilinear(&ramp(), uv, level, clamp).x
    }

    #[test]
    fn texels_lie_in_the_middle_of_their_squares_and_v_runs_up() {
        // upper row: v = 3/4; columns at (k + 1/2)/4
        assert_eq!((at([0.125, 0.75], 0.0, false), at([0.875, 0.75], 0.0, false)), (0.0, 3.0));
        assert_eq!((at([0.125, 0.25], 0.0, false), at([0.625, 0.25], 0.0, true)), (4.0, 6.0));
        // a quarter of the way from column 1 to 2 and halfway between the rows: 1.25 + 2
        assert_eq!(at([0.4375, 0.5], 0.0, false), 3.25);
    }

    #[test]
    fn outside_it_repeats_or_keeps_the_border() {
        // at u = 0 halfway between the last and the first column: (3 + 0)/2; clamped the first
        assert_eq!((at([0.0, 0.75], 0.0, false), at([0.0, 0.75], 0.0, true)), (1.5, 0.0));
        assert_eq!((at([3.125, -0.25], 0.0, false), at([-4.0, 9.0], 0.0, true)), (0.0, 0.0));
        // at v = 1 halfway between the lower and the upper row
        assert_eq!(at([0.125, 1.0], 0.0, false), 2.0);
        assert!(at([f32::NAN, f32::INFINITY], 0.0, false).is_finite());
    }

    #[test]
    fn between_levels_it_is_linear() {
        // level 1 at the middle of its first texel: 2.5; level 0 there, (0.25, 0.5): 0.5 + 2 = 2.5
        assert_eq!(at([0.25, 0.5], 1.0, false), 2.5);
        // at (0.125, 0.75): level 0 is 0, level 1 a quarter of the way from 2.5 back to 4.5: 3
        assert_eq!(at([0.125, 0.75], 0.25, false), 0.75);
        assert_eq!((at([0.1, 0.9], 2.0, false), at([0.1, 0.9], 99.0, false)), (3.5, 3.5));
        assert_eq!(at([0.125, 0.75], -3.0, false), 0.0);
    }

    #[test]
    fn options_act_on_coordinates_and_values() {
        let mut m = map(ramp());
        (m.scale, m.offset, m.base_gain) = ([2.0, 1.0], [0.125, 0.5], [0.5, 2.0]);
        // (0.25, 0.25) becomes (0.625, 0.75): 2, then 2 · 2 + 0.5
        assert_eq!(map_at(&m, [0.25, 0.25], 0.0).x, 4.5);
    }

    #[test]
    fn eight_bits_are_decoded_by_their_curve() {
        let texture = |space| Texture {
            size: [1, 1],
            space,
            alpha_varies: true,
            texels: Texels::U8(vec![[255, 128, 0, 51]]),
        };
        let srgb = trilinear(&texture(TexelSpace::Srgb), [0.5; 2], 0.0, false);
        // sRGB 128/255 is 0.215861
        assert!((srgb - Vec4::new(1.0, 0.215_861, 0.0, 0.2)).length() < 1e-6, "{srgb}");
        let linear = trilinear(&texture(TexelSpace::Linear), [0.5; 2], 0.0, false);
        assert_eq!(linear, Vec4::new(1.0, 128.0 / 255.0, 0.0, 0.2));
    }
}
