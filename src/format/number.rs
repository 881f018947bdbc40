//! Decimal numbers from bytes: the value that `str::parse::<f32>` gives, bit by bit, sooner.

use super::text::ends_number;

/// Exactly representable powers of ten.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];

/// The same as integers, as far as eight digits go.
pub(super) const INTEGER_POWERS: [u64; 9] =
    [1, 10, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000, 100_000_000];

/// The nearest f64 to inverses of powers of ten, as far as digits are exact.
pub(super) const INVERSE_POWERS: [f64; 16] =
    [1e0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14, 1e-15];

/// The bits of an f64 behind those of an f32, and what they are halfway between two f32.
pub(super) const BEHIND_F32: u64 = 0x1FFF_FFFF;
pub(super) const HALFWAY: u64 = 0x1000_0000;
/// How near to that an f64 of 2 units' error in the last place must not come, in such units.
pub(super) const NEAR_HALFWAY: u64 = 4;

/// The byte at `at`; a line ends where the text ends.
#[inline]
pub(super) fn byte(text: &[u8], at: usize) -> u8 {
    text.get(at).copied().unwrap_or(b'\n')
}

/// The high bit of each byte that is no digit, and nothing else.
#[inline]
pub(super) fn others(bytes: u64) -> u64 {
    // a digit becomes 0 to 9; adding 0x76 lifts everything else below 0x80, and only that, to 0x80
    let ones = bytes ^ 0x3030_3030_3030_3030;
    (((ones & 0x7F7F_7F7F_7F7F_7F7F) + 0x7676_7676_7676_7676) | ones) & 0x8080_8080_8080_8080
}

/// The value of the first `count` bytes, at most eight, all digits.
#[inline]
fn value(bytes: u64, count: usize) -> u64 {
    // what lies behind is shifted out (in two steps: a shift by 64 is none), then come pairs, fours and all eight
    let half = 32 - 4 * count;
    eight_digits((bytes ^ 0x3030_3030_3030_3030) << half << half)
}

/// The value of eight digits, the first in the lowest byte, each from 0 to 9.
#[inline(always)]
#[allow(clippy::inline_always, reason = "as in `triple`")]
pub(super) fn eight_digits(ones: u64) -> u64 {
    let pairs = ones.wrapping_mul(10).wrapping_add(ones >> 8);
    let low = (pairs & 0x0000_00FF_0000_00FF).wrapping_mul(0x000F_4240_0000_0064);
    let high = (pairs >> 16 & 0x0000_00FF_0000_00FF).wrapping_mul(0x0000_2710_0000_0001);
    low.wrapping_add(high) >> 32
}

/// Up to eight digits from `at`: their value and how many they are.
#[inline]
pub(super) fn digits(text: &[u8], at: usize) -> (u64, usize) {
    let Some(chunk) = text.get(at..).and_then(<[u8]>::first_chunk::<8>) else {
        return last_digits(text, at);
    };
    let bytes = u64::from_le_bytes(*chunk);
    let count = (others(bytes).trailing_zeros() / 8) as usize;
    (value(bytes, count), count)
}

/// [`digits`] within eight bytes of the end of the text.
#[cold]
fn last_digits(text: &[u8], at: usize) -> (u64, usize) {
    let rest = text.get(at..).unwrap_or_default();
    let count = rest.iter().take(8).take_while(|b| b.is_ascii_digit()).count();
    (rest[..count].iter().fold(0, |value, b| 10 * value + u64::from(b - b'0')), count)
}

/// The number at `at` and the place behind it; None where it is malformed. The place is then that of the next
/// blank, comment or line end.
#[inline]
pub(super) fn float(text: &[u8], at: usize) -> (Option<f32>, usize) {
    match short_decimal(text, at) {
        Some((value, end)) => (Some(value), end),
        None => long_float(text, at),
    }
}

/// A sign, up to six digits, a point, and up to eight digits, the way nearly all numbers are written: both places
/// where something else than a digit stands are found at once, and the next number need not wait for the value.
#[inline]
fn short_decimal(text: &[u8], start: usize) -> Option<(f32, usize)> {
    let window = text.get(start..)?.first_chunk::<24>()?;
    let eight = |at: usize| window.get(at..)?.first_chunk().map(|chunk| u64::from_le_bytes(*chunk));
    let (low, high) = (eight(0)?, eight(8)?);
    let signed = usize::from(matches!(window[0], b'-' | b'+'));
    let in_low = others(low) & !(0x80 * signed as u64);
    let second = in_low & in_low.wrapping_sub(1);
    let in_high = others(high).trailing_zeros() + 64;
    let end = (if second == 0 { in_high } else { second.trailing_zeros() } / 8) as usize;
    let point = (in_low.trailing_zeros() / 8) as usize;
    let decimals = end.wrapping_sub(point + 1);
    let sound = window[point] == b'.' && decimals <= 8 && end - signed > 1 && ends_number(window[end]);
    if point == 8 || !sound {
        return None;
    }
    let (whole, count) = (low >> (8 * signed), point - signed);
    let behind = eight(point + 1)?;
    let mantissa = if count + decimals <= 8 {
        // the point taken out, all digits stand in one word
        let mask = !(u64::MAX << (8 * count));
        value(whole & mask | behind << (8 * count), count + decimals)
    } else {
        value(whole, count) * INTEGER_POWERS[decimals] + value(behind, decimals)
    };
    // fifteen digits are exact; the product is the quotient but for 2 units in the last place, which is as good as
    // exact unless halfway between two f32 is as near
    let value = mantissa as i64 as f64 * INVERSE_POWERS[decimals];
    if near_halfway(value) {
        return None;
    }
    let sign = u32::from(window[0] == b'-') << 31;
    Some((f32::from_bits((value as f32).to_bits() | sign), start + end))
}

/// Whether an f64 lies so near to halfway between two f32 that one of a few units in the last place beside it may be
/// rounded otherwise.
#[inline(always)]
#[allow(clippy::inline_always, reason = "as in `triple`")]
pub(super) fn near_halfway(value: f64) -> bool {
    (value.to_bits() & BEHIND_F32).abs_diff(HALFWAY) <= NEAR_HALFWAY
}

/// All that [`short_decimal`] leaves.
#[inline(never)]
fn long_float(text: &[u8], at: usize) -> (Option<f32>, usize) {
    match plain_decimal(text, at) {
        Some((value, end)) => (Some(value), end),
        None => any_float(text, at),
    }
}

/// A decimal of few digits and a small exponent, the way nearly all are written. Its digits and the power of ten
/// are exact in f64, so that one operation gives the f64 nearest to it (Clinger 1990, "How to read floating point
/// numbers accurately", the fast path); see [`rounded`] for the way from there.
#[inline]
fn plain_decimal(text: &[u8], start: usize) -> Option<(f32, usize)> {
    let mut at = start;
    let sign = byte(text, at);
    at += usize::from(sign == b'-' || sign == b'+');
    let (mut mantissa, mut count) = digits(text, at);
    at += count;
    let mut decimals = 0;
    if byte(text, at) == b'.' {
        at += 1;
        loop {
            let (value, n) = digits(text, at);
            decimals += n;
            at += n;
            mantissa = mantissa.checked_mul(INTEGER_POWERS[n])?.checked_add(value)?;
            if n < 8 {
                break;
            }
        }
        count += decimals;
    }
    if count == 0 {
        return None;
    }
    let mut exponent = -(decimals as i32);
    if byte(text, at) | 0x20 == b'e' {
        at += 1;
        let sign = byte(text, at);
        at += usize::from(sign == b'-' || sign == b'+');
        let (value, n) = digits(text, at);
        if n == 0 || n > 4 {
            return None;
        }
        at += n;
        exponent += if sign == b'-' { -(value as i32) } else { value as i32 };
    }
    if !ends_number(byte(text, at)) {
        return None;
    }
    let power = *POWERS.get(exponent.unsigned_abs() as usize)?;
    let value = mantissa as f64;
    let value = if exponent < 0 { value / power } else { value * power };
    // more digits than are exact cost another unit in the last place
    if mantissa >= 1 << 53 && near_halfway(value) {
        return None;
    }
    let value = rounded(value)?;
    Some((if sign == b'-' { -value } else { value }, at))
}

/// The f32 nearest to the decimal to which `value` is the nearest f64; None where that cannot be told. The f32 in
/// question must be normal, else other bits decide.
fn rounded(value: f64) -> Option<f32> {
    let normal = (f64::from(f32::MIN_POSITIVE)..f64::from(f32::MAX)).contains(&value) || value == 0.0;
    (normal && !is_halfway(value)).then_some(value as f32)
}

/// Whether an f64 lies halfway between two f32: its last 29 bits are 100…0. Rounding twice errs only there.
#[inline]
fn is_halfway(value: f64) -> bool {
    value.to_bits() & BEHIND_F32 == HALFWAY
}

/// Everything else: many digits, large exponents, `inf`, `nan`, and what is no number.
#[cold]
fn any_float(text: &[u8], start: usize) -> (Option<f32>, usize) {
    let rest = text.get(start..).unwrap_or_default();
    let length = rest.iter().position(|&b| ends_number(b)).unwrap_or(rest.len());
    let word = str::from_utf8(&rest[..length]).ok();
    (word.and_then(|word| word.parse().ok()), start + length)
}

/// A whole word as a number.
pub(super) fn word(text: &[u8]) -> Option<f32> {
    let (value, end) = float(text, 0);
    value.filter(|_| end == text.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn same_as_std(text: &str) {
        let (value, end) = float(text.as_bytes(), 0);
        assert_eq!(value.map(f32::to_bits), text.parse().ok().map(f32::to_bits), "{text}");
        assert_eq!(end, text.len());
        let followed = format!("{text} 12345678.5");
        let (value, end) = float(followed.as_bytes(), 0);
        assert_eq!(value.map(f32::to_bits), text.parse().ok().map(f32::to_bits), "{followed}");
        assert_eq!(end, text.len());
    }

    #[test]
    fn odd_forms() {
        for text in [
            "0",
            "-0",
            "+1",
            "2.",
            ".5",
            "-.5",
            "2.e1",
            "+1E2",
            "1e-002",
            "1e+5",
            "nan",
            "-nan",
            "NaN",
            "inf",
            "-inf",
            "+infinity",
            "00000000000000000001.5",
            "0.00000000000000000000000000000001",
            "123456789012345678901234567890",
            "12345678",
            "123456789",
            "1234567.8",
            "12345678.12345678",
            "1e38",
            "3.4028235e38",
            "3.4028236e38",
            "1e39",
            "1.1754944e-38",
            "1e-45",
            "7e-46",
            "1e99999",
            "1e-99999",
            "0e99999",
            "0.0e5",
            "9007199254740993",
        ] {
            same_as_std(text);
        }
        for malformed in
            [".", "-", "+", "e5", "1e", "1e+", "3.1+e2", "1.#IND", "1,5", "--1", "0x10", "1.2.3", "1f"]
        {
            if malformed != "1.#IND" {
                assert_eq!(float(malformed.as_bytes(), 0), (None, malformed.len()), "{malformed}");
            }
        }
        assert_eq!(float(b"1.#IND", 0), (Some(1.0), 2), "the rest is a comment");
    }

    #[test]
    fn halfway_between_two_floats() {
        // 16777217 = 2^24 + 1 lies halfway between 2^24 and 2^24 + 2: to even. A little more goes up, though the
        // nearest f64 of 16777217.0000000001 is 16777217 itself.
        for text in
            ["16777217", "16777217.0000000001", "16777216.9999999999", "16777219", "8388608.5", "8388609.5"]
        {
            same_as_std(text);
        }
    }

    #[test]
    fn digits_stop_at_every_other_byte() {
        for other in (0..=255u8).filter(|b| !b.is_ascii_digit()) {
            for count in 0..=8 {
                let mut text = *b"1234567899";
                text[count] = other;
                let value = (1..=count as u64).fold(0, |value, digit| 10 * value + digit);
                assert_eq!(digits(&text, 0), (value, count), "{other}");
                assert_eq!(digits(&text[..=count], 0), (value, count), "{other} at the end");
            }
        }
    }

    proptest! {
        #[test]
        fn decimals_are_those_of_std(text in r"[-+]?[0-9]{0,12}(\.[0-9]{0,12})?([eE][-+]?[0-9]{1,3})?") {
            same_as_std(&text);
        }

        #[test]
        fn floats_are_read_back(bits in any::<u32>()) {
            let value = f32::from_bits(bits);
            same_as_std(&format!("{value}"));
            same_as_std(&format!("{value:e}"));
            // one half unit in the last place away, written out: as near to a tie as decimals come
            let (value, next) = (f64::from(value), f64::from(f32::from_bits(bits ^ 1)));
            same_as_std(&format!("{}", value.midpoint(next)));
            same_as_std(&format!("{:e}", value.midpoint(next)));
        }

        #[test]
        fn seven_digits_around_ties(digits in 16_777_216u64..1 << 27, scale in 0u32..8) {
            same_as_std(&format!("{}", digits as f64 / 10f64.powi(scale as i32)));
        }
    }
}
