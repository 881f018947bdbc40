//! Linear light as codes of 8 and 16 bits on the sRGB curve, and back.

use crate::math::{linear_from_srgb, srgb_from_linear};
use std::sync::LazyLock;

/// Luminance of linear RGB by the weights of Rec. 709.
pub fn luma([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// The factor of an exposure in stops.
pub fn gain_from_stops(stops: f32) -> f32 {
    libm::exp2f(stops)
}

/// Clamps to [0, 1]; what is not a number becomes 0.
#[expect(
    clippy::manual_clamp,
    reason = "`clamp` keeps what is not a number, `max` returns its other operand"
)]
pub(super) fn unit(x: f32) -> f32 {
    x.max(0.0).min(1.0)
}

/// A share in [0, 1] as an integer of 8 bits, rounded to nearest; no curve.
pub fn unorm8(x: f32) -> u8 {
    (f64::from(unit(x)) * 255.0 + 0.5) as u8
}

/// A share in [0, 1] as an integer of 16 bits, rounded to nearest; no curve.
pub fn unorm16(x: f32) -> u16 {
    (f64::from(unit(x)) * 65535.0 + 0.5) as u16
}

/// Linear light as 16 bits on the sRGB curve: clamped, rounded to nearest.
pub fn srgb16(x: f32) -> u16 {
    (srgb_from_linear(f64::from(unit(x))) * 65535.0).round() as u16
}

/// [`srgb8`] as the formula says it, slowly.
fn srgb8_by_formula(x: f32) -> u8 {
    (srgb_from_linear(f64::from(unit(x))) * 255.0).round() as u8
}

/// Below this everything is 0: the step from 0 to 1 lies at 0.5 / 255 / 12.92 = 1.52e-4, above 2^-13 = 1.22e-4.
const LEAST: f32 = 1.0 / 8192.0;
/// A bucket holds the floats of equal exponent and upper 7 bits of the mantissa.
const BUCKET_SHIFT: u32 = 16;
const FIRST_BUCKET: u32 = LEAST.to_bits() >> BUCKET_SHIFT;
/// 13 octaves of 128 buckets, and one for 1.
const BUCKETS: usize = 13 * 128 + 1;

/// The codes of a bucket's floats.
#[derive(Clone, Copy, Debug)]
struct Bucket {
    /// Bits of the least float with the code after `code`.
    next: u32,
    /// Code of the bucket's least float.
    code: u32,
}

/// Linear light to 8 bits on the sRGB curve.
///
/// The curve never climbs more than one code within a bucket (steepest against the bucket's width just above 0.5,
/// where a bucket is 1/256 wide and the curve gains 0.66 codes in it), so that one comparison finds the code.
#[derive(Debug)]
pub struct Srgb8([Bucket; BUCKETS]);

impl Srgb8 {
    /// The table, made on first use.
    pub fn table() -> &'static Self {
        static TABLE: LazyLock<Srgb8> = LazyLock::new(Srgb8::new);
        &TABLE
    }

    /// The bits of the least float of each code from 1 to 255.
    pub fn steps() -> &'static [u32; 255] {
        static STEPS: LazyLock<[u32; 255]> =
            LazyLock::new(|| std::array::from_fn(|i| least_with_code(i as u8 + 1).to_bits()));
        &STEPS
    }

    fn new() -> Self {
        let steps = Self::steps();
        Self(std::array::from_fn(|i| {
            let least = (FIRST_BUCKET + i as u32) << BUCKET_SHIFT;
            let code = steps.partition_point(|&step| step <= least);
            Bucket { next: steps.get(code).copied().unwrap_or(u32::MAX), code: code as u32 }
        }))
    }

    /// The code of linear light: clamped to [0, 1], curve, rounded to nearest; 0 for what is not a number.
    #[inline]
    #[expect(clippy::manual_clamp, reason = "as in `unit`")]
    pub fn code(&self, x: f32) -> u8 {
        let bits = x.max(LEAST).min(1.0).to_bits();
        let bucket = self.0[((bits >> BUCKET_SHIFT) - FIRST_BUCKET) as usize];
        (bucket.code + u32::from(bits >= bucket.next)) as u8
    }
}

/// The least float that [`srgb8_by_formula`] takes to a code of 1 or more.
fn least_with_code(code: u8) -> f32 {
    let mut x = linear_from_srgb((f64::from(code) - 0.5) / 255.0) as f32;
    while srgb8_by_formula(x) >= code {
        x = x.next_down();
    }
    while srgb8_by_formula(x) < code {
        x = x.next_up();
    }
    x
}

/// Linear light of each 16-bit code on the sRGB curve.
pub fn linear_from_srgb16() -> &'static [f32] {
    static TABLE: LazyLock<Vec<f32>> = LazyLock::new(|| {
        (0..=u16::MAX).map(|code| linear_from_srgb(f64::from(code) / 65535.0) as f32).collect()
    });
    &TABLE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_on_paper() {
        // 0.735357 · 255 = 187.5 and a little; half a code above 187
        assert_eq!(Srgb8::table().code(0.5), 188);
        assert_eq!(srgb16(0.5), 48192);
        // middle grey: 1.055 · 0.18^(1/2.4) − 0.055 = 0.461356, times 255 = 117.65
        assert_eq!(Srgb8::table().code(0.18), 118);
        assert_eq!(luma([1.0, 1.0, 1.0]), 1.0);
        assert_eq!(gain_from_stops(3.0), 8.0);
        assert_eq!(gain_from_stops(-1.0), 0.5);
    }

    #[test]
    fn sixteen_bits_come_back() {
        for code in 0..=u16::MAX {
            assert_eq!(srgb16(linear_from_srgb16()[usize::from(code)]), code);
        }
    }

    #[test]
    fn the_table_is_the_formula_at_every_step() {
        let table = Srgb8::table();
        for code in 1..=255 {
            let step = least_with_code(code);
            assert_eq!(table.code(step), code);
            assert_eq!(table.code(step.next_down()), code - 1);
            let (mut below, mut above) = (step, step);
            for _ in 0..100 {
                assert_eq!(table.code(below), srgb8_by_formula(below), "{below}");
                assert_eq!(table.code(above), srgb8_by_formula(above), "{above}");
                (below, above) = (below.next_down(), above.next_up());
            }
        }
    }

    #[test]
    fn the_table_is_the_formula_between_the_steps() {
        let table = Srgb8::table();
        // every bucket's ends, and a stride through all floats from 2^-16 to 2
        let ends = (0..BUCKETS as u32).map(|i| (FIRST_BUCKET + i) << BUCKET_SHIFT);
        let stride = ((1.0f32 / 65536.0).to_bits()..2.0f32.to_bits()).step_by(97);
        for bits in ends.flat_map(|b| [b - 1, b, b + 1]).chain(stride) {
            let x = f32::from_bits(bits);
            assert_eq!(table.code(x), srgb8_by_formula(x), "{x}");
        }
    }

    #[test]
    fn what_is_no_light() {
        let table = Srgb8::table();
        for (x, code) in [
            (f32::NAN, 0),
            (-f32::NAN, 0),
            (-1.0, 0),
            (-0.0, 0),
            (f32::NEG_INFINITY, 0),
            (f32::MIN_POSITIVE, 0),
            (f32::INFINITY, 255),
            (1e30, 255),
        ] {
            assert_eq!(table.code(x), code, "{x}");
            assert_eq!(srgb16(x), u16::from(code) * 257, "{x}");
            assert_eq!(unorm8(x), code, "{x}");
            assert_eq!(unorm16(x), u16::from(code) * 257, "{x}");
        }
    }
}
