//! Texels: bilinear within a level, linear between levels.

use super::power::powf;
use crate::math::{LINEAR_FROM_SRGB8, Vec4};
use crate::scene::{Map, TexelSpace, Texels, Texture};

/// A texture at (u, v), v running up, at a level of any value; repeated or clamped. RGBA, linear.
pub fn trilinear(texture: &Texture, uv: [f32; 2], level: f32, clamp: bool) -> Vec4 {
    let level = level.clamp(0.0, (texture.levels() - 1) as f32);
    let lower = level as u32;
    let share = level - lower as f32;
    let at = |level: u32| bilinear(texture, uv, level, clamp);
    if share == 0.0 { at(lower) } else { at(lower) * (1.0 - share) + at(lower + 1) * share }
}

/// A texture at (u, v) within a level: texels lie at the middle of their squares.
pub fn bilinear(texture: &Texture, uv: [f32; 2], level: u32, clamp: bool) -> Vec4 {
    let level = Level::new(texture, level, clamp);
    let [column, row] = level.axes(uv);
    level.mix(column, row)
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

/// One level of a texture.
pub struct Level<'a> {
    texture: &'a Texture,
    size: [u32; 2],
    /// The place of its first texel.
    first: usize,
    clamp: bool,
}

/// Two texels beside each other: the place of the first, which may lie outside, and how much the second counts for.
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    low: i32,
    share: f32,
}

impl Axis {
    /// The same, whole texels further.
    #[must_use]
    pub fn moved(self, by: i32) -> Self {
        Self { low: self.low + by, ..self }
    }
}

impl<'a> Level<'a> {
    /// A level that the texture has.
    pub fn new(texture: &'a Texture, level: u32, clamp: bool) -> Self {
        let texels = |level| texture.level_size(level).map(|s| s as usize).iter().product::<usize>();
        Self { texture, size: texture.level_size(level), first: (0..level).map(texels).sum(), clamp }
    }

    /// Where (u, v) lies along columns and rows; v runs up, rows run down.
    pub fn axes(&self, [u, v]: [f32; 2]) -> [Axis; 2] {
        [self.axis(u, self.size[0]), self.axis(1.0 - v, self.size[1])]
    }

    fn axis(&self, u: f32, size: u32) -> Axis {
        let u = if self.clamp { unit(u) } else { fraction(u) };
        // half a texel before the middle of the first one, so that the cast rounds down
        let x = u * size as f32 + 0.5;
        let up = x as i32;
        Axis { low: up - 1, share: x - up as f32 }
    }

    /// Between the four texels of a column and a row.
    pub fn mix(&self, column: Axis, row: Axis) -> Vec4 {
        let [width, height] = self.size;
        let [x0, x1] = [column.low, column.low + 1].map(|x| self.place(x, width));
        let [y0, y1] = [row.low, row.low + 1].map(|y| self.first + self.place(y, height) * width as usize);
        let places = [y0 + x0, y0 + x1, y1 + x0, y1 + x1];
        let along = |a: Vec4, b: Vec4, share: f32| a * (1.0 - share) + b * share;
        let mixed =
            |[a, b, c, d]: [Vec4; 4]| along(along(a, b, column.share), along(c, d, column.share), row.share);
        match &self.texture.texels {
            Texels::F32(texels) => mixed(places.map(|i| texels.get(i).map_or(Vec4::ZERO, |&t| t.into()))),
            Texels::U8(texels) => {
                let codes = places.map(|i| texels.get(i).copied().unwrap_or_default());
                match self.texture.space {
                    TexelSpace::Linear => mixed(codes.map(|code| Vec4::from(code.map(f32::from)))) / 255.0,
                    TexelSpace::Srgb => {
                        let table = &*LINEAR_FROM_SRGB8;
                        mixed(codes.map(|[r, g, b, a]| {
                            let [r, g, b] = [r, g, b].map(|c| table[usize::from(c)]);
                            Vec4::new(r, g, b, f32::from(a) / 255.0)
                        }))
                    }
                }
            }
        }
    }

    /// A place that may lie a few texels outside, within a side.
    fn place(&self, mut i: i32, size: u32) -> usize {
        let size = size as i32;
        if self.clamp {
            return i.clamp(0, size - 1) as usize;
        }
        while i < 0 {
            i += size;
        }
        while i >= size {
            i -= size;
        }
        i as usize
    }
}

/// Brought into [0, 1]; 0 for what is not a number.
#[expect(
    clippy::manual_clamp,
    reason = "`clamp` keeps what is not a number, `max` returns its other operand"
)]
fn unit(u: f32) -> f32 {
    u.max(0.0).min(1.0)
}

/// What is above the next lower integer; 0 where a float has no fraction or is not a number.
fn fraction(u: f32) -> f32 {
    if u.abs() < 8_388_608.0 {
        let fraction = u - u as i32 as f32;
        if fraction < 0.0 { fraction + 1.0 } else { fraction }
    } else {
        0.0
    }
}

/// The inverse of the sRGB curve, of colours of vertices.
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
