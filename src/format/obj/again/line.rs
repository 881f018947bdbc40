//! A face as in the frame before but for its normals, which is told from the bytes without reading the other indices.

use crate::format::number::{byte, digits, others};
use crate::scene::ABSENT;

/// Reads the normals' indices of the face whose first corner stands at `new_at`, where its position and texture
/// coordinate indices are written as those of the one at `old_at`, all without signs and one blank apart. Appends
/// them; the places behind both lines, and whether they are the same. None, and nothing appended, where that is not so.
#[inline]
pub(super) fn same_but_normals(
    (old, mut old_at): (&[u8], usize),
    (new, mut new_at): (&[u8], usize),
    corners: usize,
    normals: &mut Vec<u32>,
) -> Option<(usize, usize, bool)> {
    let before = normals.len();
    let mut is_same = true;
    for corner in 1..=corners {
        let separator = if corner < corners { b' ' } else { b'\n' };
        let found = same_but_normal(&old[old_at..], &new[new_at..], separator);
        let Some((old_length, new_length, normal, same)) = found else {
            normals.truncate(before);
            return None;
        };
        normals.push(normal);
        is_same &= same;
        old_at += old_length;
        new_at += new_length;
    }
    Some((old_at, new_at, is_same))
}

/// The lengths of both corners with what stands behind them, the index in the second, and whether they are the same.
#[inline]
fn same_but_normal(old: &[u8], new: &[u8], separator: u8) -> Option<(usize, usize, u32, bool)> {
    let (known, read) = (u128::from_le_bytes(*old.first_chunk()?), u128::from_le_bytes(*new.first_chunk()?));
    let same = (known ^ read).trailing_zeros() / 8;
    // the two slashes: nothing but digits may stand before them
    let marks = u128::from(others(known as u64)) | u128::from(others((known >> 64) as u64)) << 64;
    let first = marks.trailing_zeros() / 8;
    let second = (marks & marks.wrapping_sub(1)).trailing_zeros() / 8;
    if second >= same.min(16) || byte(old, first as usize) != b'/' || byte(old, second as usize) != b'/' {
        return None;
    }
    let at = second as usize + 1;
    let (known_value, known_count) = digits(old, at);
    let (value, count) = digits(new, at);
    let (old_end, new_end) = (at + known_count, at + count);
    let ends = old.get(old_end) == Some(&separator) && new.get(new_end) == Some(&separator);
    // an index of 0 or of eight digits is left to others
    let normal = (value as u32).wrapping_sub(1);
    let is_same = (known_value, known_count) == (value, count);
    let is_sound = ends && (1..8).contains(&count) && (1..8).contains(&known_count) && normal != ABSENT;
    is_sound.then_some((old_end + 1, new_end + 1, normal, is_same))
}
