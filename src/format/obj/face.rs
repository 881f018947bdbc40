//! One corner of a face: `a`, `a/b`, `a//c`, `a/b/c`.

use crate::format::number::{byte, digits};
use crate::format::text::ends_number;
use crate::scene::ABSENT;

/// An index that is given but names nothing: 0, negative beyond the start, more digits than any file has lines,
/// or no number at all.
pub(super) const MISSING: u32 = ABSENT - 1;

/// The indices of one corner, from 0; [`ABSENT`] where none is given, [`MISSING`] where it names nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Corner {
    /// Of the position.
    pub position: u32,
    /// Of the texture coordinate.
    pub texcoord: u32,
    /// Of the normal.
    pub normal: u32,
}

/// Reads the corner at `at`; the place behind it. `so_far`: how many positions, texture coordinates and normals
/// stand before it, from which negative indices count.
#[inline]
pub(super) fn corner(text: &[u8], at: usize, so_far: [usize; 3]) -> (Corner, usize) {
    let mut corner = Corner { position: ABSENT, texcoord: ABSENT, normal: ABSENT };
    let mut at = at;
    (corner.position, at) = index(text, at, so_far[0]);
    if byte(text, at) == b'/' {
        (corner.texcoord, at) = index(text, at + 1, so_far[1]);
        if byte(text, at) == b'/' {
            (corner.normal, at) = index(text, at + 1, so_far[2]);
        }
    }
    if ends_number(byte(text, at)) {
        return (corner, at);
    }
    malformed(text, at)
}

/// A corner that is none of the forms.
#[cold]
fn malformed(text: &[u8], mut at: usize) -> (Corner, usize) {
    while !ends_number(byte(text, at)) {
        at += 1;
    }
    (Corner { position: MISSING, texcoord: ABSENT, normal: ABSENT }, at)
}

/// One index: [`ABSENT`] where there is no digit.
#[inline]
fn index(text: &[u8], at: usize, so_far: usize) -> (u32, usize) {
    let (value, count) = digits(text, at);
    if count == 0 {
        return if matches!(byte(text, at), b'-' | b'+') { signed(text, at, so_far) } else { (ABSENT, at) };
    }
    if count == 8 {
        return long(text, at);
    }
    // 0 becomes ABSENT, which it must not pass for
    ((value as u32).wrapping_sub(1).min(MISSING), at + count)
}

/// An index of eight digits or more.
#[cold]
#[inline(never)]
fn long(text: &[u8], mut at: usize) -> (u32, usize) {
    let mut value = 0u64;
    while byte(text, at).is_ascii_digit() {
        value = (10 * value + u64::from(byte(text, at) - b'0')).min(u64::from(MISSING) + 1);
        at += 1;
    }
    ((value as u32).wrapping_sub(1).min(MISSING), at)
}

/// An index with a sign; a negative one counts back from the last so far.
#[inline(never)]
fn signed(text: &[u8], at: usize, so_far: usize) -> (u32, usize) {
    let (value, count) = digits(text, at + 1);
    if count == 0 {
        return (ABSENT, at);
    }
    let (from_start, end) =
        if count == 8 { long(text, at + 1) } else { ((value as u32).wrapping_sub(1), at + 1 + count) };
    if byte(text, at) == b'+' {
        return (from_start.min(MISSING), end);
    }
    let back = from_start.wrapping_add(1) as usize;
    let index = if (1..=so_far).contains(&back) { (so_far - back) as u32 } else { MISSING };
    (index, end)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> [u32; 3] {
        let (c, end) = corner(text.as_bytes(), 0, [10, 5, 3]);
        assert_eq!(end, text.find([' ', '#']).unwrap_or(text.len()), "{text}");
        [c.position, c.texcoord, c.normal]
    }

    #[test]
    fn the_four_forms() {
        assert_eq!(read("7"), [6, ABSENT, ABSENT]);
        assert_eq!(read("7/2"), [6, 1, ABSENT]);
        assert_eq!(read("7//3"), [6, ABSENT, 2]);
        assert_eq!(read("7/2/3 8/2/3"), [6, 1, 2]);
        assert_eq!(read("7//"), [6, ABSENT, ABSENT]);
        assert_eq!(read("7/2/"), [6, 1, ABSENT]);
        assert_eq!(read("7#comment"), [6, ABSENT, ABSENT]);
        assert_eq!(read("+7"), [6, ABSENT, ABSENT]);
    }

    #[test]
    fn negative_indices_count_back() {
        assert_eq!(read("-1/-1/-1"), [9, 4, 2]);
        assert_eq!(read("-10/-5/-3"), [0, 0, 0]);
        assert_eq!(read("-11/-6/-4"), [MISSING; 3]);
    }

    #[test]
    fn what_names_nothing() {
        assert_eq!(read("0/0/0"), [MISSING; 3]);
        assert_eq!(read("-0"), [MISSING, ABSENT, ABSENT]);
        assert_eq!(read("99999999999999999999"), [MISSING, ABSENT, ABSENT]);
        assert_eq!(read("-99999999999999999999"), [MISSING, ABSENT, ABSENT]);
        assert_eq!(read("4294967295"), [MISSING, ABSENT, ABSENT]);
        assert_eq!(read("4294967294"), [MISSING - 1, ABSENT, ABSENT]);
        assert_eq!(read("12345678"), [12345677, ABSENT, ABSENT]);
        for text in ["1.5", "a", "1/2/3/4", "1,2", "--1", "1-"] {
            assert_eq!(read(text)[0], MISSING, "{text}");
        }
        assert_eq!(read("/1/2")[0], ABSENT);
    }
}
