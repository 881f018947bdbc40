//! Three plain decimals on a line, the way exporters write vertices: all places where something else than a digit
//! stands are found at once, so that no number waits for the one before it. What is not of this form is left to
//! [`float`](super::number::float), whose values these are, bit by bit.

use super::number::{INTEGER_POWERS, INVERSE_POWERS, eight_digits, near_halfway};

/// Bytes in which the numbers must stand, with what ends them.
const WINDOW: usize = 64;

/// The three numbers at `at`, one blank between them and a line end behind them, and where the next line begins. None
/// where they are not so, or not surely exact, or too near to an end of the text.
#[inline]
pub(super) fn triple(text: &[u8], at: usize) -> Option<([f32; 3], usize)> {
    // eight bytes before the numbers too, so that eight bytes can be taken that end with any digit
    let window: &[u8; 8 + WINDOW] = text.get(at.checked_sub(8)?..)?.first_chunk()?;
    let mut others = others(window);
    let mut values = [0.0; 3];
    let mut start = 0;
    let mut sound = true;
    for (k, value) in values.iter_mut().enumerate() {
        let signed = usize::from(*window.get(8 + start)? == b'-');
        others &= !((signed as u64) << start);
        let point = others.trailing_zeros() as usize;
        others &= others.wrapping_sub(1);
        let end = others.trailing_zeros() as usize;
        others &= others.wrapping_sub(1);
        let (digits, decimals) = (point.wrapping_sub(start + signed), end.wrapping_sub(point + 1));
        if digits > 7 || decimals.wrapping_sub(1) > 7 || end == WINDOW {
            return None;
        }
        sound &= window[8 + point] == b'.' && (k == 2 || window[8 + end] == b' ');
        // the eight bytes that end with the last digit, with the one before that, with the point
        let eight = |from: usize| Some(u64::from_le_bytes(*window.get(from..)?.first_chunk()?) ^ ZEROS);
        let behind = eight(end)?;
        let mantissa = if digits + decimals <= 8 {
            // the point taken out
            let before = eight(end - 1)? & last(digits + decimals);
            let of_decimals = last(decimals);
            eight_digits(behind & of_decimals | before & !of_decimals)
        } else {
            // at least one digit, since there are at most eight decimals
            eight_digits(eight(point)? & last(digits)) * INTEGER_POWERS[decimals]
                + eight_digits(behind & last(decimals))
        };
        let scaled = mantissa as i64 as f64 * INVERSE_POWERS[decimals];
        sound &= !near_halfway(scaled);
        *value = f32::from_bits((scaled as f32).to_bits() | (signed as u32) << 31);
        start = end + 1;
    }
    let end = start - 1;
    let length = match window[8 + end] {
        b'\n' => 1,
        b'\r' if window.get(8 + start) == Some(&b'\n') => 2,
        _ => return None,
    };
    sound.then_some((values, at + end + length))
}

/// `0` in each byte.
const ZEROS: u64 = 0x3030_3030_3030_3030;

/// The last `count` bytes of eight, 1 to 8.
#[inline]
fn last(count: usize) -> u64 {
    u64::MAX << ((64 - 8 * count) & 63)
}

/// A bit for each byte behind the first eight, set where it is no digit.
#[inline]
#[cfg(target_arch = "x86_64")]
fn others(window: &[u8; 8 + WINDOW]) -> u64 {
    use std::arch::x86_64::{__m128i, _mm_add_epi8, _mm_cmpgt_epi8, _mm_movemask_epi8, _mm_set1_epi8};
    let mut bits = 0;
    for (k, bytes) in window[8..].as_chunks::<16>().0.iter().enumerate() {
        let bytes: __m128i = bytemuck::cast(*bytes);
        // SAFETY: these take values, no pointers, and need SSE2 alone, which every x86-64 has.
        let of_bytes = unsafe {
            // digits become the ten least of all signed bytes
            let moved = _mm_add_epi8(bytes, _mm_set1_epi8((0x80 - b'0') as i8));
            _mm_movemask_epi8(_mm_cmpgt_epi8(moved, _mm_set1_epi8(i8::MIN + 9)))
        };
        bits |= u64::from(of_bytes as u16) << (16 * k);
    }
    bits
}

/// A bit for each byte behind the first eight, set where it is no digit.
#[inline]
#[cfg(not(target_arch = "x86_64"))]
fn others(window: &[u8; 8 + WINDOW]) -> u64 {
    let mut bits = 0;
    for (k, bytes) in window[8..].as_chunks::<8>().0.iter().enumerate() {
        let high = super::number::others(u64::from_le_bytes(*bytes));
        // the eight high bits side by side
        bits |= ((high >> 7).wrapping_mul(0x0102_0408_1020_4080) >> 56) << (8 * k);
    }
    bits
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::number::float;
    use proptest::prelude::*;

    /// Whether the line is of the form; its numbers are those of [`float`] then.
    fn is_triple(line: &str, end: &str) -> bool {
        let text = format!("1.5 -2.5\nv {line}{end}0.25 0.5 1.5\n{}", " ".repeat(80));
        let found = triple(text.as_bytes(), 11);
        if let Some((values, next)) = found {
            assert_eq!(next, 11 + line.len() + end.len(), "{line:?}");
            for (value, word) in values.iter().zip(line.split(' ')) {
                let (expected, length) = float(word.as_bytes(), 0);
                assert_eq!(
                    (Some(value.to_bits()), word.len()),
                    (expected.map(f32::to_bits), length),
                    "{line:?}"
                );
            }
            assert_eq!(line.split(' ').count(), 3);
        }
        found.is_some()
    }

    #[test]
    fn forms() {
        for line in [
            "0.5 -0.25 1.125",
            "-0.000000 0.000000 1234567.12345678",
            "0.1 .5 -.5",
            "1234567.1 9999999.99999999 0.00000001",
            "0.03783012 1234567.5 0.1",
        ] {
            assert!(is_triple(line, "\n") && is_triple(line, "\r\n"), "{line}");
            assert!(
                !is_triple(line, "\r")
                    && !is_triple(line, " ")
                    && !is_triple(line, "#")
                    && !is_triple(line, "e")
            );
        }
        for line in [
            "1 0.5 0.5",
            "0.5 0.5",
            "0.5  0.5 0.5",
            "0.5 0.5 0.5 0.5",
            "0.5\t0.5 0.5",
            "+0.5 0.5 0.5",
            "1. 0.5 0.5",
            "--0.5 0.5 0.5",
            "-. 0.5 0.5",
            "0.5 0.5 0.5e1",
            "0.5e1 0.5 0.5",
            "12345678.5 0.5 0.5",
            "0.123456789 0.5 0.5",
            "0.5-0.5 0.5 0.5",
            "0.5.5 0.5 0.5",
            "0,5 0.5 0.5",
            "nan 0.5 0.5",
            "",
            "0.5 0.5 -",
        ] {
            assert!(!is_triple(line, "\n"), "{line}");
        }
        assert!(triple(b"v 0.5 0.5 0.5\n", 2).is_none(), "near an end of the text");
    }

    #[test]
    fn every_byte_that_is_no_digit_is_found() {
        for byte in 0..=255 {
            for place in 0..WINDOW {
                let mut window = [b'7'; 8 + WINDOW];
                window[8 + place] = byte;
                assert_eq!(others(&window), u64::from(!byte.is_ascii_digit()) << place, "{byte} at {place}");
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn numbers_are_those_of_float(line in r"-?[0-9]{1,7}\.[0-9]{1,8} -?[0-9]{0,7}\.[0-9]{1,8} -?[0-9]{1,3}\.[0-9]{6}") {
            is_triple(&line, "\n");
        }

        #[test]
        fn near_ties_are_left_out(digits in 16_777_216u64..1 << 27, scale in 1usize..8) {
            let number = format!("{:.scale$}", digits as f64 / 10f64.powi(scale as i32));
            is_triple(&format!("{number} {number} {number}"), "\n");
        }

        #[test]
        fn other_bytes(line in r"[-+0-9. e#\t/]{0,40}") {
            is_triple(&line, "\n");
        }
    }
}
