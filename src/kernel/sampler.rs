//! Where a pixel's samples lie: one Owen-scrambled Sobol sequence a pixel, warped by the filter. Seeded by pixel,
//! seed and dimension, never by frame, so that what stands still does not flicker.
//!
//! Scrambling by hashes: Brent Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020.

#![allow(clippy::inline_always, reason = "what is not inlined is not compiled for the lanes' CPU feature")]

use crate::scene::Filter;

/// Half the gaussian filter's width in units of σ·√2: radius 1.5, σ 0.5.
const GAUSSIAN_REACH: f32 = 3.0 * std::f32::consts::FRAC_1_SQRT_2;
/// erf of [`GAUSSIAN_REACH`]: the part of the gaussian within three σ.
const GAUSSIAN_WITHIN_REACH: f32 = 0.997_300_2;
/// σ·√2 with σ = 0.5, in pixels.
const GAUSSIAN_SCALE: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// Which sample of each pixel is meant.
#[derive(Clone, Copy, Debug)]
pub struct Places {
    filter: Filter,
    /// None: the pixel's middle.
    sample: Option<[u32; 2]>,
    seed: u32,
}

impl Places {
    /// Where sample `index` of `count` lies. A single sample lies in the middle.
    pub fn new(filter: Filter, index: u32, count: u32, seed: u32) -> Self {
        Self { filter, sample: (count > 1).then(|| sobol(index)), seed }
    }

    /// The middle of each pixel.
    pub fn middle() -> Self {
        Self { filter: Filter::Box, sample: None, seed: 0 }
    }

    /// That point of the picture for each pixel (column, row after `first_row`), in pixels from its upper left corner.
    #[inline(always)]
    pub(super) fn fill(self, first_row: u32, pixels: &[[u32; 2]], points: &mut [[f32; 2]]) {
        let Some(sample) = self.sample else {
            for (point, &[x, row]) in points.iter_mut().zip(pixels) {
                *point = [x as f32 + 0.5, (first_row + row) as f32 + 0.5];
            }
            return;
        };
        // a loop for each: none of them asks
        match self.filter {
            Filter::Box => self.fill_warped(Filter::Box, sample, first_row, pixels, points),
            Filter::Triangle => self.fill_warped(Filter::Triangle, sample, first_row, pixels, points),
            Filter::Gaussian => self.fill_warped(Filter::Gaussian, sample, first_row, pixels, points),
        }
    }

    #[inline(always)]
    fn fill_warped(
        self,
        filter: Filter,
        sample: [u32; 2],
        first_row: u32,
        pixels: &[[u32; 2]],
        points: &mut [[f32; 2]],
    ) {
        for (point, &[x, row]) in points.iter_mut().zip(pixels) {
            let y = first_row + row;
            let [u, v] = scrambled(sample, [x, y], self.seed);
            *point = [x as f32 + warp(filter, u), y as f32 + warp(filter, v)];
        }
    }
}

/// Point `index` of a pixel's sequence in [0, 1)².
pub fn unit_square(index: u32, pixel: [u32; 2], seed: u32) -> [f32; 2] {
    scrambled(sobol(index), pixel, seed)
}

/// A point of the Sobol sequence as a pixel's own sequence has it.
#[inline(always)]
fn scrambled([x, y]: [u32; 2], pixel: [u32; 2], seed: u32) -> [f32; 2] {
    let pixel_seed = hash(pixel[0] ^ hash(pixel[1] ^ hash(seed)));
    [unit(owen_scramble(x, hash(pixel_seed))), unit(owen_scramble(y, hash(pixel_seed ^ 1)))]
}

/// As [`unit_square`], for a purpose other than the place in the pixel: the same points in another order and scrambled
/// anew, so that purposes do not follow one another (Burley, section 5).
pub fn unit_square_for(purpose: u32, index: u32, pixel: [u32; 2], seed: u32) -> [f32; 2] {
    let seed = hash(seed ^ hash(purpose ^ 0x5bd1_e995));
    unit_square(owen_scramble(index, hash(pixel[0] ^ hash(pixel[1] ^ seed))), pixel, seed)
}

/// Warps [0, 1) by the filter's inverse cumulative distribution, in x as in y.
#[inline(always)]
fn warp(filter: Filter, u: f32) -> f32 {
    match filter {
        Filter::Box => u,
        Filter::Triangle => 0.5 + triangle(u),
        Filter::Gaussian => 0.5 + gaussian(u),
    }
}

/// The tent of radius 1: its distribution is (1 + x)²/2 left of 0.
#[inline(always)]
fn triangle(u: f32) -> f32 {
    let side = 1.0 - (2.0 * u.min(1.0 - u)).sqrt();
    if u < 0.5 { -side } else { side }
}

/// The gaussian of σ 0.5, cut off at 1.5.
#[inline(always)]
fn gaussian(u: f32) -> f32 {
    GAUSSIAN_SCALE
        * inverse_erf((2.0 * u - 1.0) * GAUSSIAN_WITHIN_REACH).clamp(-GAUSSIAN_REACH, GAUSSIAN_REACH)
}

/// Mike Giles, "Approximating the erfinv function", GPU Computing Gems Jade Edition, 2011 (single precision).
#[inline(always)]
fn inverse_erf(x: f32) -> f32 {
    const CENTRE: [f32; 9] = [
        2.810_226_4e-8,
        3.432_739_4e-7,
        -3.523_387_7e-6,
        -4.391_506_5e-6,
        0.000_218_580_87,
        -0.001_253_725,
        -0.004_177_681_6,
        0.246_640_73,
        1.501_409_4,
    ];
    const TAIL: [f32; 9] = [
        -0.000_200_214_26,
        0.000_100_950_56,
        0.001_349_343_2,
        -0.003_673_428_4,
        0.005_739_507_7,
        -0.007_622_461,
        0.009_438_870_5,
        1.001_674,
        2.832_976_8,
    ];
    let w = -ln((1.0 - x) * (1.0 + x));
    let is_tail = w >= 5.0;
    let w = if is_tail { w.sqrt() - 3.0 } else { w - 2.5 };
    let mut sum = 0.0;
    for (centre, tail) in CENTRE.into_iter().zip(TAIL) {
        sum = sum * w + if is_tail { tail } else { centre };
    }
    x * sum
}

/// The natural logarithm of a normal number above 0, without branches: with x = m·2^k, m around 1, and s = (m − 1)/(m + 1), it is
/// k·ln 2 + 2·artanh s. Of artanh's series what is left out is at most 3e-9 of it.
#[inline(always)]
fn ln(x: f32) -> f32 {
    const ROOT_OF_HALF: u32 = std::f32::consts::FRAC_1_SQRT_2.to_bits();
    let above = x.to_bits().wrapping_sub(ROOT_OF_HALF);
    let k = above.cast_signed() >> 23;
    let m = f32::from_bits((above & 0x007f_ffff) + ROOT_OF_HALF);
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let series = 1.0 + z * (1.0 / 3.0 + z * (1.0 / 5.0 + z * (1.0 / 7.0 + z * (1.0 / 9.0))));
    k as f32 * std::f32::consts::LN_2 + 2.0 * s * series
}

/// The first two dimensions of the Sobol sequence: van der Corput's, and the one of Pascal's triangle modulo 2.
fn sobol(index: u32) -> [u32; 2] {
    let mut second = 0;
    let mut direction = 1 << 31;
    let mut bits = index;
    while bits != 0 {
        if bits & 1 != 0 {
            second ^= direction;
        }
        direction ^= direction >> 1;
        bits >>= 1;
    }
    [index.reverse_bits(), second]
}

/// Flips each bit by a hash of the bits above it (Laine and Karras's permutation on reversed bits).
#[inline(always)]
fn owen_scramble(x: u32, seed: u32) -> u32 {
    let mut x = x.reverse_bits().wrapping_add(seed);
    for factor in [0x6c50_b47c, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6u32] {
        x ^= x.wrapping_mul(factor);
    }
    x.reverse_bits()
}

/// The finaliser of `MurmurHash3`, moved off its fixed point 0.
#[inline(always)]
pub(super) fn hash(x: u32) -> u32 {
    let x = x.wrapping_add(0x9e37_79b9);
    let x = (x ^ x >> 16).wrapping_mul(0x85eb_ca6b);
    let x = (x ^ x >> 13).wrapping_mul(0xc2b2_ae35);
    x ^ x >> 16
}

/// The upper 24 bits as a float in [0, 1).
#[inline(always)]
fn unit(x: u32) -> f32 {
    (x >> 8) as f32 / 16_777_216.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From the pixel's corner.
    fn place(filter: Filter, index: u32, count: u32, pixel: [u32; 2], seed: u32) -> [f32; 2] {
        let mut points = [[0.0; 2]];
        Places::new(filter, index, count, seed).fill(pixel[1], &[[pixel[0], 0]], &mut points);
        [0, 1].map(|k| points[0][k] - pixel[k] as f32)
    }

    #[test]
    fn a_single_sample_lies_in_the_middle() {
        for filter in [Filter::Box, Filter::Triangle, Filter::Gaussian] {
            assert_eq!(place(filter, 0, 1, [3, 4], 5), [0.5, 0.5]);
        }
    }

    /// A (0, k, 2)-net in base 2: each of the 2^k boxes of size 2^-a × 2^-(k−a) has one of the first 2^k points.
    #[test]
    fn the_first_points_are_stratified_in_every_elementary_interval() {
        for pixel in [[0, 0], [17, 5], [1919, 1079]] {
            for k in 0..=8 {
                for a in 0..=k {
                    let (columns, rows) = (1 << a, 1 << (k - a));
                    let mut boxes = vec![0; columns * rows];
                    for index in 0..1 << k {
                        let [x, y] = unit_square(index, pixel, 9);
                        boxes[(x * columns as f32) as usize * rows + (y * rows as f32) as usize] += 1;
                    }
                    assert!(boxes.iter().all(|&n| n == 1), "{pixel:?}, 2^{k} points, {columns} × {rows}");
                }
            }
        }
    }

    #[test]
    fn pixels_and_seeds_differ_and_nothing_else_does() {
        let at = |pixel, seed| unit_square(0, pixel, seed);
        assert_eq!(at([3, 4], 0), at([3, 4], 0));
        let all = [at([3, 4], 0), at([4, 3], 0), at([3, 4], 1), at([0, 0], 0), at([0, 0], 1)];
        for (i, a) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|b| a != b));
            assert!(a[0] != a[1], "the dimensions are scrambled alike");
        }
    }

    /// Mean 0 from the pixel's centre; variances: box 1/12; triangle 1/6; gaussian cut off at 3σ:
    /// σ²·(1 − 6·φ(3)/erf(3/√2)) = 0.25·(1 − 6·0.00443185/0.9973002) = 0.243334.
    #[test]
    fn samples_are_spread_as_the_filter_is() {
        let count = 1 << 14;
        for (filter, variance, reach) in [
            (Filter::Box, 1.0 / 12.0, 0.5),
            (Filter::Triangle, 1.0 / 6.0, 1.0),
            (Filter::Gaussian, 0.243_334, 1.5),
        ] {
            for axis in 0..2 {
                let offsets: Vec<f64> =
                    (0..count).map(|i| f64::from(place(filter, i, count, [2, 3], 0)[axis]) - 0.5).collect();
                let mean =
                    |f: &dyn Fn(f64) -> f64| offsets.iter().map(|&x| f(x)).sum::<f64>() / f64::from(count);
                assert!(mean(&|x| x).abs() < 1e-3, "{filter:?}: mean {}", mean(&|x| x));
                assert!(
                    (mean(&|x| x * x) - variance).abs() < 1e-3,
                    "{filter:?}: variance {}",
                    mean(&|x| x * x)
                );
                assert!(offsets.iter().all(|x| x.abs() <= reach), "{filter:?} reaches too far");
            }
        }
    }

    #[test]
    fn the_logarithm_is_exact_to_the_last_but_one_bit() {
        let steps = (1..20_000).map(|i| 0.005 + 0.0001 * i as f32);
        for x in steps.chain([f32::MIN_POSITIVE, 1e-30, 1.0, 1.0 - f32::EPSILON, 1e30, f32::MAX]) {
            let (got, want) = (f64::from(ln(x)), libm::log(f64::from(x)));
            assert!((got - want).abs() <= 2.4e-7 * want.abs(), "ln {x}: {got}, not {want}");
        }
    }

    #[test]
    fn the_inverse_of_erf_is_one() {
        for i in -997..=997 {
            let x = i as f32 / 1000.0;
            assert!((libm::erf(f64::from(inverse_erf(x))) - f64::from(x)).abs() < 5e-7, "{x}");
        }
    }
}
