//! Three plain decimals on a line, the way exporters write vertices: all places where something else than a digit
//! stands are found at once, so that no number waits for the one before it. What is not of this form is left to
//! [`float`](super::number::float), whose values these are, bit by bit.

// A part that is not inlined is a call for each number, and is compiled for the least of processors.
#![allow(clippy::inline_always)]

#[cfg(target_arch = "x86_64")]
use super::decimals;
use super::number::{INTEGER_POWERS, INVERSE_POWERS, eight_digits, near_halfway};
#[cfg(target_arch = "x86_64")]
use super::wide;

/// Bytes in which the numbers must stand, with what ends them.
const WINDOW: usize = 48;
/// Eight bytes before the numbers too, so that eight bytes can be taken that end with any digit.
const BEFORE: usize = 8;
/// All bytes looked at; beyond the window no byte is more than there.
const BYTES: usize = 72;

/// Reads lines of `v`, or `vn` where those are asked for, with three plain decimals, as far as they stand one below the
/// other. The place behind them; None where there is none.
#[inline]
pub(super) fn triples<const NORMALS: bool>(
    text: &[u8],
    start: usize,
    list: &mut Vec<[f32; 3]>,
) -> Option<usize> {
    #[cfg(target_arch = "x86_64")]
    if wide::is_there() {
        return decimals::rows(text, start, if NORMALS { b"vn " } else { b"v " }, list);
    }
    triples_of::<NORMALS>(text, start, list)
}

/// Reads lines of `vt` with two plain decimals, as [`triples`] does.
#[inline]
pub(super) fn pairs(text: &[u8], start: usize, list: &mut Vec<[f32; 2]>) -> Option<usize> {
    #[cfg(target_arch = "x86_64")]
    return decimals::rows(text, start, b"vt ", list);
    #[cfg(not(target_arch = "x86_64"))]
    None
}

#[inline(always)]
fn triples_of<const NORMALS: bool>(text: &[u8], start: usize, list: &mut Vec<[f32; 3]>) -> Option<usize> {
    let mut end = None;
    let mut at = start;
    loop {
        let numbers = match text.get(at..).unwrap_or_default().first_chunk::<3>() {
            Some(b"vn ") if NORMALS => at + 3,
            Some([b'v', b' ', _]) if !NORMALS => at + 2,
            _ => return end,
        };
        let Some((values, next)) = triple(text, numbers) else { return end };
        list.push(values);
        at = next;
        end = Some(next);
    }
}

/// The three numbers at `at`, one blank between them and a line end behind them, and where the next line begins. None
/// where they are not so, or not surely exact, or too near to an end of the text.
#[inline(always)]
fn triple(text: &[u8], at: usize) -> Option<([f32; 3], usize)> {
    let bytes: &[u8; BYTES] = text.get(at.checked_sub(BEFORE)?..)?.first_chunk()?;
    let Marks { others, points, ends } = marks(bytes);
    let (points, ends) = (first_three(points), first_three(ends));
    if ends[2] >= WINDOW || points[2] >= ends[2] {
        return None;
    }
    let starts = [0, ends[0] + 1, ends[1] + 1];
    let words = [
        Word::new(bytes, starts[0], points[0], ends[0]),
        Word::new(bytes, starts[1], points[1], ends[1]),
        Word::new(bytes, starts[2], points[2], ends[2]),
    ];
    let [a, b, c] = &words;
    let few = (a.digits | b.digits | c.digits) < 8;
    let some = (a.decimals.wrapping_sub(1) | b.decimals.wrapping_sub(1) | c.decimals.wrapping_sub(1)) < 8;
    let between = bytes[BEFORE + (ends[0] & 63)] == b' ' && bytes[BEFORE + (ends[1] & 63)] == b' ';
    let expected = a.others() | b.others() | c.others();
    if !(few && some && between && others & ((2 << ends[2]) - 1) == expected) {
        return None;
    }
    let length = match (bytes[BEFORE + (ends[2] & 63)], bytes[BEFORE + ((ends[2] + 1) & 63)]) {
        (b'\n', _) => 1,
        (b'\r', b'\n') => 2,
        _ => return None,
    };
    let is_short = (a.digits + a.decimals).max(b.digits + b.decimals).max(c.digits + c.decimals) <= 8;
    let scaled = if is_short {
        [a.short(bytes), b.short(bytes), c.short(bytes)]
    } else {
        [a.long(bytes), b.long(bytes), c.long(bytes)]
    };
    if near_halfway(scaled[0]) | near_halfway(scaled[1]) | near_halfway(scaled[2]) {
        return None;
    }
    let values = [a.signed(scaled[0]), b.signed(scaled[1]), c.signed(scaled[2])];
    Some((values, at + ends[2] + length))
}

/// Where a number's bytes stand in the window.
struct Word {
    start: usize,
    point: usize,
    end: usize,
    /// 1 where a minus stands before it.
    minus: usize,
    /// How many digits stand before and behind the point; large numbers where the places are in a wrong order.
    digits: usize,
    decimals: usize,
}

impl Word {
    #[inline(always)]
    fn new(bytes: &[u8; BYTES], start: usize, point: usize, end: usize) -> Self {
        let minus = usize::from(bytes[BEFORE + (start & 63)] == b'-');
        let digits = point.wrapping_sub(start + minus);
        Self { start, point, end, minus, digits, decimals: end.wrapping_sub(point + 1) }
    }

    /// What is no digit.
    #[inline(always)]
    fn others(&self) -> u64 {
        1 << (self.point & 63) | 1 << (self.end & 63) | (self.minus as u64) << (self.start & 63)
    }

    /// The value without its sign, of at most eight digits: taken together once the point is out.
    #[inline(always)]
    fn short(&self, bytes: &[u8; BYTES]) -> f64 {
        let of_decimals = last(self.decimals);
        let before = eight(bytes, self.end - 1) & last(self.digits + self.decimals) & !of_decimals;
        self.scaled(eight_digits(eight(bytes, self.end) & of_decimals | before))
    }

    /// The value without its sign, of at most fifteen digits.
    #[inline(always)]
    fn long(&self, bytes: &[u8; BYTES]) -> f64 {
        // in two steps: there may be no digit, and a shift by 64 is none
        let whole = eight(bytes, self.point) & (last(self.digits + 1) << 8);
        let behind = eight(bytes, self.end) & last(self.decimals);
        self.scaled(eight_digits(whole) * INTEGER_POWERS[self.decimals] + eight_digits(behind))
    }

    #[inline(always)]
    fn scaled(&self, mantissa: u64) -> f64 {
        mantissa as i64 as f64 * INVERSE_POWERS[self.decimals]
    }

    #[inline(always)]
    fn signed(&self, value: f64) -> f32 {
        f32::from_bits((value as f32).to_bits() | (self.minus as u32) << 31)
    }
}

/// The eight bytes before a place in the window, as digits.
#[inline(always)]
fn eight(bytes: &[u8; BYTES], place: usize) -> u64 {
    let eight = bytes[place & 63..].first_chunk().copied().unwrap_or_default();
    u64::from_le_bytes(eight) ^ 0x3030_3030_3030_3030
}

/// The places of the lowest three bits; 64 where there are fewer.
#[inline(always)]
fn first_three(bits: u64) -> [usize; 3] {
    let second = bits & bits.wrapping_sub(1);
    let third = second & second.wrapping_sub(1);
    [bits.trailing_zeros() as usize, second.trailing_zeros() as usize, third.trailing_zeros() as usize]
}

/// The last `count` bytes of eight, 1 to 8.
#[inline(always)]
fn last(count: usize) -> u64 {
    u64::MAX << ((64 - 8 * count) & 63)
}

/// A bit for each byte of the window.
#[derive(Debug, PartialEq)]
struct Marks {
    /// What is no digit.
    others: u64,
    /// Points.
    points: u64,
    /// Blanks, line ends and other bytes that are no characters of ASCII.
    ends: u64,
}

#[inline(always)]
#[cfg(target_arch = "x86_64")]
fn marks(bytes: &[u8; BYTES]) -> Marks {
    use std::arch::x86_64::{
        __m128i, _mm_add_epi8, _mm_cmpeq_epi8, _mm_cmpgt_epi8, _mm_movemask_epi8, _mm_set1_epi8,
    };
    let mut marks = Marks { others: 0, points: 0, ends: 0 };
    for (k, chunk) in bytes[BEFORE..BEFORE + WINDOW].as_chunks::<16>().0.iter().enumerate() {
        let chunk: __m128i = bytemuck::cast(*chunk);
        // SAFETY: these take values, no pointers, and need SSE2 alone, which every x86-64 has.
        let [others, points, ends] = unsafe {
            // digits become the ten least of all signed bytes
            let moved = _mm_add_epi8(chunk, _mm_set1_epi8((0x80 - b'0') as i8));
            [
                _mm_movemask_epi8(_mm_cmpgt_epi8(moved, _mm_set1_epi8(i8::MIN + 9))),
                _mm_movemask_epi8(_mm_cmpeq_epi8(chunk, _mm_set1_epi8(b'.' as i8))),
                _mm_movemask_epi8(_mm_cmpgt_epi8(_mm_set1_epi8(b'!' as i8), chunk)),
            ]
        };
        let bits = |of_chunk: i32| u64::from(of_chunk as u16) << (16 * k);
        marks.others |= bits(others);
        marks.points |= bits(points);
        marks.ends |= bits(ends);
    }
    marks
}

#[inline]
#[cfg(not(target_arch = "x86_64"))]
fn marks(bytes: &[u8; BYTES]) -> Marks {
    plain_marks(bytes)
}

#[cfg(any(test, not(target_arch = "x86_64")))]
fn plain_marks(bytes: &[u8; BYTES]) -> Marks {
    let window = &bytes[BEFORE..BEFORE + WINDOW];
    let of = |is: fn(u8) -> bool| {
        window.iter().enumerate().fold(0, |bits, (place, &byte)| bits | u64::from(is(byte)) << place)
    };
    Marks {
        others: of(|byte| !byte.is_ascii_digit()),
        points: of(|byte| byte == b'.'),
        ends: of(|byte| (byte as i8) < b'!' as i8),
    }
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
            ".00000001 .12345678 .9",
            "0.1 .5 -.5",
            "1234567.1 9999999.99999999 0.00000001",
            "1234567.1234567 -123456.1234567 -12345.123456",
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
    fn marks_are_those_of_each_byte() {
        for byte in 0..=255 {
            for place in 0..BYTES {
                let mut bytes = [b'7'; BYTES];
                bytes[place] = byte;
                assert_eq!(marks(&bytes), plain_marks(&bytes), "{byte} at {place}");
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
