//! Mip levels: each texel the mean of what it covers in the level above (a box filter), taken in linear light.
//!
//! Where a side is odd, n = 2m + 1, a texel covers 2 + 1/m of the level above; three are weighed by how much of each is
//! covered, so that every texel counts the same in all levels. Colours whose alpha varies are weighed by it: what
//! cannot be seen, and often is black, must not darken the rims of leaves. Where nothing can be seen, the plain mean
//! stands.

use crate::math::{LINEAR_FROM_SRGB8, linear_from_srgb};
use crate::scene::TexelSpace;
use rayon::prelude::*;
use std::sync::LazyLock;

/// The linear light from which on a byte is the next one: halfway between two on the curve.
static BORDERS: LazyLock<[f32; 255]> =
    LazyLock::new(|| std::array::from_fn(|byte| linear_from_srgb((byte as f64 + 0.5) / 255.0) as f32));

/// Shares of 65535 as floats, alpha too; colours through the sRGB curve.
pub(super) fn floats(texel: [u16; 4], is_color: bool) -> [f32; 4] {
    let [r, g, b, a] = texel.map(|x| f64::from(x) / 65535.0);
    let [r, g, b] = if is_color { [r, g, b].map(linear_from_srgb) } else { [r, g, b] };
    [r as f32, g as f32, b as f32, a as f32]
}

/// All levels of 8-bit texels, the first given.
pub(super) fn levels_u8(
    size: [u32; 2],
    mut texels: Vec<[u8; 4]>,
    space: TexelSpace,
    by_alpha: bool,
) -> Vec<[u8; 4]> {
    let to_float = |[r, g, b, a]: [u8; 4]| {
        let linear = |x: u8| match space {
            TexelSpace::Srgb => LINEAR_FROM_SRGB8[usize::from(x)],
            TexelSpace::Linear => f32::from(x) / 255.0,
        };
        [linear(r), linear(g), linear(b), f32::from(a) / 255.0]
    };
    let share = |x: f32| (x * 255.0).round() as u8;
    let to_bytes = |[r, g, b, a]: [f32; 4]| {
        let byte = |x: f32| match space {
            TexelSpace::Srgb => BORDERS.partition_point(|border| *border <= x) as u8,
            TexelSpace::Linear => share(x),
        };
        [byte(r), byte(g), byte(b), share(a)]
    };
    texels.reserve_exact(count_below(size));
    let mut below = size;
    if below != [1, 1] {
        let mut level = halved(below, |at| to_float(texels[at]), by_alpha);
        loop {
            below = half(below);
            texels.par_extend(level.par_iter().map(|texel| to_bytes(*texel)));
            if below == [1, 1] {
                break;
            }
            // the means are those of what is covered in the picture, not of rounded bytes
            level = halved(below, |at| level[at], by_alpha);
        }
    }
    texels
}

/// All levels of floats, the first given.
pub(super) fn levels_f32(mut size: [u32; 2], mut texels: Vec<[f32; 4]>, by_alpha: bool) -> Vec<[f32; 4]> {
    texels.reserve_exact(count_below(size));
    let mut start = 0;
    while size != [1, 1] {
        let level = halved(size, |at| texels[start + at], by_alpha);
        start = texels.len();
        texels.extend_from_slice(&level);
        size = half(size);
    }
    texels
}

/// Texels of all levels but the first.
fn count_below(mut size: [u32; 2]) -> usize {
    let mut count = 0;
    while size != [1, 1] {
        size = half(size);
        count += size[0] as usize * size[1] as usize;
    }
    count
}

fn half(size: [u32; 2]) -> [u32; 2] {
    size.map(|side| (side / 2).max(1))
}

/// The level below one of that size whose texels, row by row, are `texel`.
fn halved(size: [u32; 2], texel: impl Fn(usize) -> [f32; 4] + Sync, by_alpha: bool) -> Vec<[f32; 4]> {
    let [width, height] = half(size).map(|side| side as usize);
    let columns: Vec<Cover> = (0..width).map(|x| Cover::new(x, size[0] as usize)).collect();
    let mut level = vec![[0.0; 4]; width * height];
    level.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        let rows = Cover::new(y, size[1] as usize);
        for (out, columns) in row.iter_mut().zip(&columns) {
            let mut mean = Mean::default();
            for (y, row_weight) in rows.texels() {
                for (x, weight) in columns.texels() {
                    mean.add(texel(y * size[0] as usize + x), row_weight * weight);
                }
            }
            *out = mean.texel(by_alpha);
        }
    });
    level
}

/// The texels along one side that a texel of the level below covers.
struct Cover {
    first: usize,
    count: usize,
    weights: [f32; 3],
}

impl Cover {
    fn new(place: usize, side: usize) -> Self {
        let half = side / 2;
        let share = |part: usize| part as f32 / side as f32;
        match side {
            1 => Self { first: 0, count: 1, weights: [1.0, 0.0, 0.0] },
            _ if side.is_multiple_of(2) => Self { first: 2 * place, count: 2, weights: [0.5, 0.5, 0.0] },
            // from place · (2 + 1/half) on: what is left of the first, the second whole, and a part of the third
            _ => Self {
                first: 2 * place,
                count: 3,
                weights: [share(half - place), share(half), share(place + 1)],
            },
        }
    }

    fn texels(&self) -> impl Iterator<Item = (usize, f32)> {
        (self.first..).zip(self.weights).take(self.count)
    }
}

/// Sums for a mean.
#[derive(Default)]
struct Mean {
    plain: [f32; 4],
    /// Red, green and blue times alpha.
    by_alpha: [f32; 3],
}

impl Mean {
    fn add(&mut self, texel: [f32; 4], weight: f32) {
        for (sum, x) in self.plain.iter_mut().zip(texel) {
            *sum += x * weight;
        }
        for (sum, x) in self.by_alpha.iter_mut().zip(texel) {
            *sum += x * (texel[3] * weight);
        }
    }

    fn texel(self, by_alpha: bool) -> [f32; 4] {
        let [r, g, b] = self.by_alpha;
        let alpha = self.plain[3];
        if by_alpha && alpha > 0.0 { [r / alpha, g / alpha, b / alpha, alpha] } else { self.plain }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_texel_counts_the_same_whatever_the_side() {
        // 5 x 1 of 1, 2, 3, 4, 5: the first of two covers 2.5 of them, (1 + 2 + 3/2) / 2.5 = 1.8; the other
        // (3/2 + 4 + 5) / 2.5 = 4.2; the last level is the mean of all, 3
        let row = (1..=5u8).map(|x| [f32::from(x); 4]).collect();
        let levels = levels_f32([5, 1], row, false);
        let values: Vec<f32> = levels.iter().map(|texel| texel[0]).collect();
        for (value, expected) in values[5..].iter().zip([1.8, 4.2, 3.0]) {
            assert!((value - expected).abs() < 1e-6, "{values:?}");
        }
        for size in [[7, 3], [6, 9], [1, 11], [17, 1], [64, 33]] {
            let count = (size[0] * size[1]) as usize;
            let texels: Vec<[f32; 4]> = (0..count).map(|i| [(i * i % 101) as f32, 0.0, 0.0, 1.0]).collect();
            let mean = texels.iter().map(|texel| f64::from(texel[0])).sum::<f64>() / count as f64;
            let last = *levels_f32(size, texels, true).last().unwrap();
            assert!((f64::from(last[0]) - mean).abs() < 1e-4 * mean, "{size:?}: {} for {mean}", last[0]);
        }
    }

    #[test]
    fn bytes_are_averaged_in_linear_light() {
        // half of the light of white is 0.5, 188 on the curve (0.5029 is 188 / 255, 0.4970 is 187 / 255); data are 127.5
        let texels = vec![[0, 0, 0, 255], [255, 255, 255, 255]];
        assert_eq!(levels_u8([2, 1], texels.clone(), TexelSpace::Srgb, false)[2], [188, 188, 188, 255]);
        assert_eq!(levels_u8([2, 1], texels, TexelSpace::Linear, false)[2], [128, 128, 128, 255]);
    }

    #[test]
    fn every_byte_comes_back() {
        for byte in 0..=255u8 {
            for space in [TexelSpace::Srgb, TexelSpace::Linear] {
                let texels = levels_u8([2, 2], vec![[byte; 4]; 4], space, true);
                assert_eq!(texels, vec![[byte; 4]; 5]);
            }
        }
    }

    #[test]
    fn what_cannot_be_seen_does_not_darken() {
        let leaf = vec![[0.0, 0.8, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0]];
        assert_eq!(levels_f32([2, 1], leaf.clone(), true)[2], [0.0, 0.8, 0.0, 0.5]);
        assert_eq!(levels_f32([2, 1], leaf, false)[2], [0.0, 0.4, 0.0, 0.5]);
        let unseen = vec![[1.0, 0.0, 0.0, 0.0], [0.0; 4]];
        assert_eq!(levels_f32([2, 1], unseen, true)[2], [0.5, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn levels_end_at_one_texel() {
        for size in [[1, 1], [2, 2], [5, 3], [1, 8], [16, 4]] {
            let count = (size[0] * size[1]) as usize;
            let levels = levels_u8(size, vec![[7; 4]; count], TexelSpace::Linear, false);
            assert_eq!(levels.len(), count + count_below(size));
        }
        // 5x3, 2x1, 1x1
        assert_eq!(count_below([5, 3]), 3);
    }
}
