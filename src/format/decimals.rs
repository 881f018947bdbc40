//! Two or three plain decimals on a line, the way exporters write vertices: what each of 64 bytes is, is found at once,
//! and all numbers are made together. What is not of this form is left to [`float`](super::number::float), whose values
//! these are, bit by bit.

use super::number::{BEHIND_F32, HALFWAY, INVERSE_POWERS, NEAR_HALFWAY};
use super::wide::{self, WINDOW, Window, eights, through};
use std::arch::x86_64::{
    __m128i, __m256d, __m256i, _mm_and_si128, _mm_or_ps, _mm_shuffle_epi8, _mm_xor_si128, _mm256_add_pd,
    _mm256_and_si256, _mm256_castsi256_si128, _mm256_cmpgt_epi64, _mm256_cvtepi32_pd, _mm256_cvtpd_ps,
    _mm256_extracti128_si256, _mm256_mul_pd, _mm256_permutevar8x32_epi32, _mm256_set1_epi64x, _mm256_set1_pd,
    _mm256_sub_epi64, _mm256_testz_si256,
};

/// Bytes before the numbers, so that sixteen can be taken that end with any of theirs.
const BEFORE: usize = 16;
/// Digits whose number is exact in f64, and that fit sixteen bytes with a point.
const MAX_DIGITS: usize = 15;

/// For each number of decimals the places that the last sixteen bytes have once the point is out.
const WITHOUT_POINT: [[u8; 16]; 16] = {
    let mut places = [[0x80; 16]; 16];
    let mut decimals = 0;
    while decimals < 16 {
        let mut k = 1;
        while k < 16 {
            places[decimals][k] = if k > 15 - decimals { k as u8 } else { k as u8 - 1 };
            k += 1;
        }
        decimals += 1;
    }
    places
};

/// From the place of a count on: bytes that keep so many of the last of sixteen.
const LAST: [u8; 32] = {
    let mut bytes = [0; 32];
    let mut k = 16;
    while k < 32 {
        bytes[k] = 0xFF;
        k += 1;
    }
    bytes
};

/// Reads lines of this word and N plain decimals, as far as they stand one below the other. The place behind them; None
/// where there is none.
#[inline]
pub(super) fn rows<const N: usize>(
    text: &[u8],
    start: usize,
    word: &[u8],
    list: &mut Vec<[f32; N]>,
) -> Option<usize> {
    // SAFETY: the processor has what is needed.
    if wide::is_there() { unsafe { rows_wide(text, start, word, list) } } else { None }
}

#[target_feature(enable = "avx2,bmi1,bmi2")]
fn rows_wide<const N: usize>(
    text: &[u8],
    start: usize,
    word: &[u8],
    list: &mut Vec<[f32; N]>,
) -> Option<usize> {
    let mut end = None;
    let mut at = start;
    // compared as a number, which is no call
    let mut padded = [0; 4];
    padded[..word.len()].copy_from_slice(word);
    let (expected, mask) = (u32::from_le_bytes(padded), u32::MAX >> (32 - 8 * word.len()));
    while let Some(first) = text.get(at..).and_then(<[u8]>::first_chunk)
        && u32::from_le_bytes(*first) & mask == expected
        && let Some((values, next)) = row(text, at + word.len())
    {
        list.push(values);
        at = next;
        end = Some(next);
    }
    end
}

/// The numbers at `at`, blanks between them and a line end behind them, and where the next line begins. None where they
/// are not so, or not surely exact, or too near to an end of the text.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2")]
fn row<const N: usize>(text: &[u8], at: usize) -> Option<([f32; N], usize)> {
    let bytes: &[u8; BEFORE + WINDOW] = text.get(at.checked_sub(BEFORE)?..)?.first_chunk()?;
    let window = Window::new(bytes[BEFORE..].first_chunk()?);
    let (points, minuses, blanks) = (window.of(b'.'), window.of(b'-'), window.of(b' '));
    let line_end = window.others() & !(points | minuses | blanks);
    let length = match text.get(at + line_end.trailing_zeros() as usize..)? {
        [b'\n', ..] => 1,
        [b'\r', b'\n', ..] => 2,
        _ => return None,
    };
    let line = through(line_end) >> 1;
    let of_words = line & !blanks;
    let starts = of_words & !(of_words << 1);
    let ends = !of_words & (of_words << 1);
    let points = points & line;
    let [starts_at, points_at, ends_at]: [[usize; N]; 3] = [first(starts)?, first(points)?, first(ends)?];
    let (mut digits, mut sound) = ([0; N], line_end != 0 && minuses & line & !starts == 0);
    let (mut decimals, mut signs) = ([0; N], [0; 4]);
    for k in 0..N {
        let minus = (minuses >> starts_at[k]) as usize & 1;
        let before = points_at[k].wrapping_sub(starts_at[k] + minus);
        decimals[k] = ends_at[k].wrapping_sub(points_at[k] + 1);
        digits[k] = before.wrapping_add(decimals[k]);
        sound &= before < MAX_DIGITS && decimals[k].wrapping_sub(1) < MAX_DIGITS && digits[k] <= MAX_DIGITS;
        signs[k] = (minus as u32) << 31;
    }
    if !sound {
        return None;
    }
    let mut numbers = [bytemuck::cast::<_, __m128i>([0u8; 16]); 4];
    let mut powers = [1.0; 4];
    for k in 0..N {
        let word: [u8; 16] = *bytes[ends_at[k]..].first_chunk()?;
        let ones = _mm_xor_si128(bytemuck::cast(word), bytemuck::cast([b'0'; 16]));
        let whole = _mm_shuffle_epi8(ones, bytemuck::cast(WITHOUT_POINT[decimals[k] & 15]));
        let keep: [u8; 16] = *LAST[digits[k] & 15..].first_chunk()?;
        numbers[k] = _mm_and_si128(whole, bytemuck::cast(keep));
        powers[k] = INVERSE_POWERS[decimals[k] & 15];
    }
    let values = scaled(numbers, powers, signs)?;
    Some((values, at + line_end.trailing_zeros() as usize + length))
}

/// The places of the lowest bits, if there are so many and no more.
#[inline]
fn first<const N: usize>(mut bits: u64) -> Option<[usize; N]> {
    let mut places = [0; N];
    for place in &mut places {
        *place = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
    }
    (bits == 0 && places[N - 1] < WINDOW).then_some(places)
}

/// Numbers of sixteen digits, the first of them 0, times powers of ten and with the signs' bits. None where one may be
/// rounded otherwise.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2")]
fn scaled<const N: usize>([a, b, c, d]: [__m128i; 4], powers: [f64; 4], signs: [u32; 4]) -> Option<[f32; N]> {
    // each lane: the upper and lower eight digits of one, then of another
    let halves = eights(bytemuck::cast([a, b]), bytemuck::cast([c, d]));
    let halves = _mm256_permutevar8x32_epi32(halves, bytemuck::cast([0u32, 4, 2, 6, 1, 5, 3, 7]));
    let upper = _mm256_cvtepi32_pd(_mm256_castsi256_si128(halves));
    let lower = _mm256_cvtepi32_pd(_mm256_extracti128_si256::<1>(halves));
    let whole = _mm256_add_pd(_mm256_mul_pd(upper, _mm256_set1_pd(1e8)), lower);
    let values: __m256d = _mm256_mul_pd(whole, bytemuck::cast(powers));
    let behind = _mm256_and_si256(bytemuck::cast(values), _mm256_set1_epi64x(BEHIND_F32 as i64));
    let distance = _mm256_sub_epi64(behind, _mm256_set1_epi64x(HALFWAY as i64 - NEAR_HALFWAY as i64));
    let is_above: __m256i = _mm256_cmpgt_epi64(distance, _mm256_set1_epi64x(-1));
    let is_below = _mm256_cmpgt_epi64(_mm256_set1_epi64x(2 * NEAR_HALFWAY as i64 + 1), distance);
    if _mm256_testz_si256(is_above, is_below) == 0 {
        return None;
    }
    let values: [f32; 4] = bytemuck::cast(_mm_or_ps(_mm256_cvtpd_ps(values), bytemuck::cast(signs)));
    values.first_chunk().copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::number::float;
    use proptest::prelude::*;

    /// Whether the line is of the form; its numbers are those of [`float`] then.
    fn is_row<const N: usize>(line: &str, end: &str) -> bool {
        let text = format!("# numbers before\nv {line}{end}0.25 0.5 1.5\n{}", " ".repeat(80));
        let mut list: Vec<[f32; N]> = Vec::new();
        let Some(next) = rows(text.as_bytes(), 17, b"v ", &mut list) else { return false };
        assert_eq!((next, list.len()), (19 + line.len() + end.len(), 1), "{line:?}");
        assert_eq!(line.split_ascii_whitespace().count(), N, "{line:?}");
        for (value, word) in list[0].iter().zip(line.split_ascii_whitespace()) {
            let (expected, length) = float(word.as_bytes(), 0);
            assert_eq!(Some(value.to_bits()), expected.map(f32::to_bits), "{line:?}");
            assert_eq!(length, word.len(), "{line:?}");
        }
        true
    }

    #[test]
    fn forms() {
        if !wide::is_there() {
            return;
        }
        for line in [
            "0.5 -0.25 1.125",
            "-0.000000 0.000000 1234567.12345678",
            ".00000001 .12345678 .9",
            "  0.009277020    0.656557000   -0.071835800",
            "0.5 0.5 0.5  ",
            "1234567.1 9999999.99999999 0.00000001",
            "12345678901234.5 -0.00000000000001 .123456789012345",
        ] {
            assert!(is_row::<3>(line, "\n") && is_row::<3>(line, "\r\n"), "{line}");
            let is_odd = |end| is_row::<3>(line, end);
            assert!(
                !is_odd("\r") && !is_odd("#") && !is_odd("e") && !is_odd("\t") && !is_odd("\\\n"),
                "{line}"
            );
        }
        for line in [
            "1 0.5 0.5",
            "0.5 0.5",
            "0.5 0.5 0.5 0.5",
            "0.5\t0.5 0.5",
            "+0.5 0.5 0.5",
            "1. 0.5 0.5",
            "--0.5 0.5 0.5",
            "-. 0.5 0.5",
            ". 0.5 0.5",
            "- .5 0.5 0.5",
            "0.5 0.5 0.5e1",
            "0.5e1 0.5 0.5",
            "123456789012345.5 0.5 0.5",
            "0.1234567890123456 0.5 0.5",
            "0.5-0.5 0.5 0.5",
            "0.5.5 0.5 0.5",
            "0.5.5 5 0.5",
            "0,5 0.5 0.5",
            "nan 0.5 0.5",
            "",
            "0.5 0.5 -",
        ] {
            assert!(!is_row::<3>(line, "\n"), "{line}");
        }
        assert!(
            is_row::<2>("0.5 -.25", "\n") && !is_row::<2>("0.5 0.25 0.5", "\n") && !is_row::<2>("0.5", "\n")
        );
        let mut list: Vec<[f32; 3]> = Vec::new();
        assert!(rows(b"v 0.5 0.5 0.5\n", 0, b"v ", &mut list).is_none(), "near an end of the text");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(50_000))]

        #[test]
        fn numbers_are_those_of_float(line in r" {0,2}-?[0-9]{1,7}\.[0-9]{1,9} {1,3}-?[0-9]{0,14}\.[0-9]{1,15} -?[0-9]{1,3}\.[0-9]{6} ?") {
            is_row::<3>(&line, "\n");
        }

        #[test]
        fn pairs_too(line in r"-?[0-9]{1,5}\.[0-9]{1,12} -?[0-9]{0,3}\.[0-9]{1,6}") {
            is_row::<2>(&line, "\n");
        }

        #[test]
        fn near_ties_are_left_out(digits in 16_777_216u64..1 << 27, scale in 1usize..15) {
            let number = format!("{:.scale$}", digits as f64 / 10f64.powi(scale as i32));
            is_row::<3>(&format!("{number} {number} {number}"), "\n");
        }

        #[test]
        fn floats_and_halfway_between_them(bits in 0x2800_0000u32..0x5000_0000, decimals in 1usize..15) {
            let value = f32::from_bits(bits);
            let middle = f64::from(value).midpoint(f64::from(f32::from_bits(bits ^ 1)));
            is_row::<3>(&format!("{value:.decimals$} {middle:.decimals$} -{middle:.9}"), "\n");
        }

        #[test]
        fn other_bytes(line in r"[-+0-9. e#\t/]{0,40}") {
            is_row::<3>(&line, "\n");
            is_row::<2>(&line, "\n");
        }
    }
}
