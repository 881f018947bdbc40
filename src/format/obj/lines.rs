//! Faces written the usual way, a line at a time: indices without signs, one blank apart. Where digits end is found for
//! 64 bytes at once, so that no index waits for the one before it. What is of another form is left to
//! [`face`](super::face), whose indices these are.

use super::face::MISSING;
use super::scan::FaceList;
use crate::format::wide::{self, WINDOW, Window, four_values, through};
use crate::scene::ABSENT;
use std::arch::x86_64::_pdep_u64;

/// All bytes looked at: eight are taken from any place in the window.
const BYTES: usize = WINDOW + 8;

/// The last of one, two and three places in turn.
const EACH: [u64; 3] = [u64::MAX, 0xAAAA_AAAA_AAAA_AAAA, 0x4924_9249_2492_4924];
/// The second of three places in turn.
const SECOND: u64 = EACH[2] >> 1;

/// Reads faces from `start` on that stand one below the other, as far as they are of the usual form; the place behind
/// them. None where there is none.
#[inline]
pub(super) fn faces(text: &[u8], start: usize, faces: &mut FaceList) -> Option<usize> {
    // SAFETY: the processor has what is needed.
    if wide::is_there() { unsafe { faces_wide(text, start, faces) } } else { None }
}

#[target_feature(enable = "avx2,bmi1,bmi2")]
fn faces_wide(text: &[u8], start: usize, faces: &mut FaceList) -> Option<usize> {
    let mut end = None;
    let mut at = start;
    while is_face(text, at) {
        let before = faces.positions.len();
        let Some(next) = face(text, at + 2, faces) else {
            faces.truncate(before);
            break;
        };
        faces.counts.push((faces.positions.len() - before) as u32);
        at = next;
        end = Some(next);
    }
    end
}

#[inline]
fn is_face(text: &[u8], at: usize) -> bool {
    text.get(at..).and_then(<[u8]>::first_chunk) == Some(b"f ")
}

/// Reads the corners of a face; the place behind its line. None where they are not of the usual form or fewer than
/// three; some may have been read then.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2")]
fn face(text: &[u8], start: usize, faces: &mut FaceList) -> Option<usize> {
    let before = faces.positions.len();
    let mut at = start;
    loop {
        let bytes: &[u8; BYTES] = text.get(at..)?.first_chunk()?;
        let window = Window::new(bytes.first_chunk()?);
        let others = window.others();
        let line_end = window.of(b'\n');
        let line_end = line_end & line_end.wrapping_neg();
        let to_line_end = through(line_end);
        // the blanks behind corners, and the line's end
        let blanks = window.of(b' ') & to_line_end;
        let last = (blanks | line_end).checked_ilog2()?;
        let whole = u64::MAX >> (63 - last);
        // behind a blank the line's end ends no corner
        let ends = blanks | (line_end & !(blanks << 1));
        let marks = others & whole & (!line_end | ends);
        let first = marks.trailing_zeros() as usize;
        let is_end = |bits: u64| bits & bits.wrapping_neg() & ends != 0;
        let behind = marks & marks.wrapping_sub(1);
        let indices = if is_end(marks) {
            1
        } else if is_end(behind) {
            2
        } else {
            3
        };
        // an index that is empty, which is sound in `a//c` alone
        let empty = marks & (marks << 1 | 1);
        let is_without_texcoords = indices == 3 && bytes[(first + 1) & 63] == b'/';
        let expected = if is_without_texcoords { _pdep_u64(SECOND, marks) } else { 0 };
        let slashes = marks & window.of(b'/');
        let (long2, digits) = (|d: u64| d & d >> 1, !others & whole);
        let long4 = long2(digits) & long2(digits) >> 2;
        let is_sound = _pdep_u64(EACH[indices - 1], marks) == ends
            && slashes | ends == marks
            && empty == expected
            && long4 & long4 >> 4 == 0;
        if !is_sound {
            return None;
        }
        let values = values(bytes, marks);
        let values = &values.as_flattened()[..marks.count_ones() as usize];
        match (indices, is_without_texcoords) {
            (1, _) => faces.corners_of::<1, false, false>(values),
            (2, _) => faces.corners_of::<2, true, false>(values),
            (_, false) => faces.corners_of::<3, true, true>(values),
            (_, true) => faces.corners_of::<3, false, true>(values),
        }
        at += last as usize + 1;
        if line_end != 0 {
            return (faces.positions.len() - before >= 3).then_some(at);
        }
    }
}

/// Most marks in a window, in fours: three for each five bytes of `1//1 `.
const FOURS: usize = (WINDOW * 3 / 5).div_ceil(4);

/// The numbers before each mark, less one; what stands behind the last is undefined.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2")]
fn values(bytes: &[u8; BYTES], mut marks: u64) -> [[u32; 4]; FOURS] {
    let mut values = [[0; 4]; FOURS];
    let mut start = 0;
    for four in &mut values {
        let words = [(); 4].map(|()| {
            let end = marks.trailing_zeros() as usize;
            marks &= marks.wrapping_sub(1);
            let word = digits(bytes, start, end);
            start = end + 1;
            word
        });
        *four = four_values(words).map(|value| value.wrapping_sub(1).min(MISSING));
        if marks == 0 {
            break;
        }
    }
    values
}

/// Digits from one place to another, at most eight, the last in the highest byte.
#[inline]
fn digits(bytes: &[u8; BYTES], start: usize, end: usize) -> u64 {
    let word = bytes[start & 63..].first_chunk().copied().map_or(0, u64::from_le_bytes);
    // in two steps: a shift by 64 is none; behind the last mark the places mean nothing
    let half = 32usize.wrapping_sub(end.wrapping_sub(start).wrapping_mul(4)) & 63;
    (word ^ 0x3030_3030_3030_3030) << half << half
}

impl FaceList {
    #[inline]
    fn corners_of<const INDICES: usize, const TEXCOORDS: bool, const NORMALS: bool>(
        &mut self,
        values: &[u32],
    ) {
        let before = self.positions.len();
        let corners = values.as_chunks::<INDICES>().0;
        self.positions.extend(corners.iter().map(|corner| corner[0]));
        for (list, is_there, place) in
            [(&mut self.texcoords, TEXCOORDS, 1), (&mut self.normals, NORMALS, INDICES - 1)]
        {
            if is_there {
                if list.len() < before {
                    list.resize(before, ABSENT);
                }
                list.extend(corners.iter().map(|corner| corner[place]));
            } else if !list.is_empty() {
                list.resize(before + corners.len(), ABSENT);
            }
        }
    }
}

/// Normals of faces whose lines are those of the frame before but for digits of normals: as many digits, the same places.
pub(super) struct Similar {
    /// Behind the faces in the frame before.
    pub known_end: usize,
    /// Behind them in this.
    pub end: usize,
    /// How many they are.
    pub faces: usize,
}

/// After so many faces that are the same in all, more may be.
const SAME_IN_A_ROW: usize = 8;

/// Reads the normals' indices of faces that are written in as many bytes as those of the frame before, and differ in
/// nothing else; up to some that are the same in those too.
#[inline]
pub(super) fn similar(
    known: (&[u8], usize),
    text: (&[u8], usize),
    counts: &[u32],
    normals: &mut Vec<u32>,
) -> Option<Similar> {
    // SAFETY: the processor has what is needed.
    if wide::is_there() { Some(unsafe { similar_wide(known, text, counts, normals) }) } else { None }
}

#[target_feature(enable = "avx2,bmi1,bmi2")]
fn similar_wide(
    (known, mut known_at): (&[u8], usize),
    (text, mut at): (&[u8], usize),
    counts: &[u32],
    normals: &mut Vec<u32>,
) -> Similar {
    let (mut faces, mut same) = (0, 0);
    while same < SAME_IN_A_ROW
        && let Some(&count) = counts.get(faces)
        && is_face(known, known_at)
        && is_face(text, at)
    {
        let before = normals.len();
        let Some((length, is_same)) =
            normals_of((known, known_at + 2), (text, at + 2), count as usize, normals)
        else {
            normals.truncate(before);
            break;
        };
        known_at += 2 + length;
        at += 2 + length;
        faces += 1;
        same = if is_same { same + 1 } else { 0 };
    }
    Similar { known_end: known_at, end: at, faces }
}

/// The same of one face: the length of its line from its first corner, and whether it is the same in all.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2")]
fn normals_of(
    (known, known_at): (&[u8], usize),
    (text, at): (&[u8], usize),
    corners: usize,
    normals: &mut Vec<u32>,
) -> Option<(usize, bool)> {
    let (mut length, mut left, mut is_same) = (0, corners, true);
    loop {
        let bytes: &[u8; BYTES] = text.get(at + length..)?.first_chunk()?;
        let window = Window::new(bytes.first_chunk()?);
        let before = Window::new(known.get(known_at + length..)?.first_chunk()?);
        let line_end = window.of(b'\n');
        let line_end = line_end & line_end.wrapping_neg();
        let ends = (window.of(b' ') & through(line_end)) | line_end;
        let last = ends.checked_ilog2()?;
        let whole = u64::MAX >> (63 - last);
        let marks = window.others() & whole;
        let seconds = _pdep_u64(SECOND, marks);
        // from behind each second slash to the corner's end: no field reaches into the next, so none borrows of it
        let fields = ends.wrapping_sub(seconds << 1);
        let differs = window.differs(before) & whole;
        let slashes = window.of(b'/') & whole;
        let few7 = fields & fields >> 1 & fields >> 2 & fields >> 3;
        let is_sound = _pdep_u64(EACH[2], marks) == ends
            && slashes | ends == marks
            && before.others() & whole == marks
            && differs & !fields == 0
            && seconds << 1 & ends == 0
            && few7 & few7 >> 4 == 0;
        let count = ends.count_ones() as usize;
        if !is_sound || count > left || (line_end != 0) != (count == left) {
            return None;
        }
        is_same &= differs == 0;
        let (mut seconds, mut field_ends) = (seconds, ends);
        while field_ends != 0 {
            let words = [(); 4].map(|()| {
                let (second, end) = (seconds.trailing_zeros() as usize, field_ends.trailing_zeros() as usize);
                seconds &= seconds.wrapping_sub(1);
                field_ends &= field_ends.wrapping_sub(1);
                digits(bytes, second + 1, end)
            });
            let four = four_values(words).map(|value| value.wrapping_sub(1));
            // those behind the last are taken off below
            normals.extend_from_slice(&four);
        }
        let keep = normals.len() - (count.wrapping_neg() & 3);
        normals.truncate(keep);
        if normals[keep - count..].contains(&ABSENT) {
            return None;
        }
        left -= count;
        length += last as usize + 1;
        if left == 0 {
            return Some((length, is_same));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::face::corner;
    use super::*;
    use proptest::prelude::*;

    /// The corners of a line, read one by one; None where it is not of the usual form.
    fn corners(line: &str) -> Option<Vec<[u32; 3]>> {
        let words: Vec<&str> = line.split(' ').filter(|word| !word.is_empty()).collect();
        let read = words.iter().map(|word| {
            let (c, end) = corner(word.as_bytes(), 0, [0; 3]);
            (end == word.len()).then_some([c.position, c.texcoord, c.normal])
        });
        read.collect()
    }

    /// Whether lines are of the usual form, in which they are read as one by one.
    fn is_usual(lines: &[&str]) -> bool {
        let text = format!("f {}\n#{}", lines.join("\nf "), " ".repeat(BYTES));
        let mut list = FaceList::default();
        let Some(end) = faces(text.as_bytes(), 0, &mut list) else { return false };
        let count = list.counts.len();
        let expected: Vec<Vec<[u32; 3]>> =
            lines[..count].iter().map(|line| corners(line).unwrap_or_else(|| panic!("{line:?}"))).collect();
        assert_eq!(end, lines[..count].iter().map(|line| line.len() + 3).sum::<usize>(), "{lines:?}");
        let counts: Vec<u32> = expected.iter().map(|face| face.len() as u32).collect();
        assert_eq!(list.counts, counts, "{lines:?}");
        assert!(counts.iter().all(|&count| count >= 3));
        let all: Vec<[u32; 3]> = expected.concat();
        for (k, list) in [&list.positions, &list.texcoords, &list.normals].into_iter().enumerate() {
            let of_corner = |i: usize| list.get(i).copied().unwrap_or(ABSENT);
            let read: Vec<u32> = (0..all.len()).map(of_corner).collect();
            assert_eq!(read, all.iter().map(|corner| corner[k]).collect::<Vec<u32>>(), "{lines:?}");
            assert!(list.is_empty() || list.len() == all.len());
        }
        count == lines.len()
    }

    #[test]
    fn forms() {
        if !wide::is_there() {
            return;
        }
        for line in [
            "1 2 3",
            "1 2 3 ",
            "1//1 2//2 3//3 4//4 5//5 6//6 7//7 8//8 9//9 1//1 2//2 3//3 4//4 5//5 6//6 7//7 8//8 9//9 1//1",
            "1/2 3/4 5/6 7/8",
            "1//2 3//4 5//6",
            "1234567/1234567/1234567 1234567/1234567/1234567 1234567/1234567/1234567 1234567/1234567/1234567",
            "0/0/0 0/0/0 0000001/2/3",
            "1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32 33 34 35 36",
        ] {
            assert!(
                is_usual(&[line]) && is_usual(&[line, line]) && is_usual(&["7 8 9", line, "1//2 1//2 3//4"]),
                "{line}"
            );
        }
        for line in [
            "",
            "1",
            "1 2",
            "1 2  3",
            " 1 2 3",
            "1 2 3  ",
            "1/ 2/ 3/",
            "/1 /2 /3",
            "1/2/3 4/5 6",
            "1//2 3/4/5 6//7",
            "1///2 3///4 5///6",
            "1/2/3/4 1/2/3/4 1/2/3/4",
            "-1 2 3",
            "1 2 3 # so",
            "1\t2 3",
            "12345678 2 3",
            "1/2/ 3/4/ 5/6/",
            "1// 2// 3//",
            "1 2 3\r",
            "1 2 3 \r",
            "1.5 2 3",
            "1/2/3 4/5/6 7/8/9/",
        ] {
            assert!(!is_usual(&[line]), "{line}");
        }
        let mut list = FaceList::default();
        assert_eq!(faces(b"f 1 2 3\n", 0, &mut list), None, "near the end of the text");
    }

    /// Whether the normals' indices of a line are read by those of the line before, in which they are those read one by
    /// one, and nothing else differs.
    fn is_similar(known: &str, line: &str, count: usize) -> bool {
        let text = |line: &str| format!("f {line}\n#{}", " ".repeat(BYTES));
        let mut normals = Vec::new();
        let (a, b) = (text(known), text(line));
        let Some(found) = similar((a.as_bytes(), 0), (b.as_bytes(), 0), &[count as u32], &mut normals) else {
            return false;
        };
        if found.faces == 0 {
            assert!(normals.is_empty() && found.end == 0 && found.known_end == 0);
            return false;
        }
        assert_eq!((found.faces, found.end, found.known_end), (1, line.len() + 3, known.len() + 3));
        let (known, read) = (corners(known).unwrap(), corners(line).unwrap());
        let of = |corners: &[[u32; 3]], k: usize| corners.iter().map(|c| c[k]).collect::<Vec<u32>>();
        assert_eq!((of(&known, 0), of(&known, 1)), (of(&read, 0), of(&read, 1)), "{line:?}");
        assert_eq!((of(&read, 2), read.len()), (normals, count), "{line:?}");
        assert!(!of(&read, 2).contains(&MISSING));
        true
    }

    #[test]
    fn only_digits_of_normals_may_differ() {
        if !wide::is_there() {
            return;
        }
        let known = "1/2/3 4/5/6 7/8/9";
        for (line, is) in [
            (known, true),
            ("1/2/9 4/5/8 7/8/7", true),
            ("1/2/9 4/5/8 7/8/70", false),
            ("1/2/0 4/5/8 7/8/7", false),
            ("1/3/3 4/5/6 7/8/9", false),
            ("2/2/3 4/5/6 7/8/9", false),
            ("1/2/345/5/6 7/8/9", false),
            ("1/2/3 4/5/6 7/8 9", false),
            ("1/2/3 4/5/6 7/8/-", false),
        ] {
            assert_eq!(is_similar(known, line, 3), is, "{line}");
        }
        assert!(!is_similar(known, known, 2) && !is_similar(known, known, 4));
        assert!(is_similar("1//3 4//6 7//9", "1//4 4//4 7//4", 3));
        let long =
            "1234567/1234567/1234567 1234567/1234567/1234567 1234567/1234567/1234567 1234567/1234567/1234567";
        assert!(is_similar(long, &long.replace("67 ", "77 "), 4));
        assert!(!is_similar("1 2 3", "1 2 3", 3) && !is_similar("1/2 2/3 3/4", "1/2 2/3 3/4", 3));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn indices_are_those_of_single_corners(
            a in r"([0-9]{1,7}/[0-9]{1,7}/[0-9]{1,7} ){1,5}[0-9]{1,3}/[0-9]{1,3}/[0-9]{1,8}",
            b in r"([0-9]{1,7}//[0-9]{1,5} ){1,5}[0-9]{1,3}/?/[0-9]{1,3}",
            d in r"([0-9]{1,2}//[0-9] ){8,20}[0-9]//[0-9]",
            c in r"([0-9]{1,7} ){1,20}([0-9]/[0-9])?",
        ) {
            is_usual(&[&a, &b, &c]);
            is_usual(&[&c, &d, &a, &c, &d, &b]);
        }

        #[test]
        fn other_bytes(line in r"[0-9]{1,3}[-0-9/ #]{0,90}") {
            is_usual(&[&line]);
        }

        #[test]
        fn similar_lines(
            line in r"([0-9]{1,5}/[0-9]{0,5}/[0-9]{1,5} ){2,4}[0-9]/[0-9]/[0-9]",
            edits in prop::collection::vec((0usize..90, "[-0-9/ ]"), 0..4),
            count in 3usize..6,
        ) {
            let mut edited = line.clone();
            for (at, byte) in edits {
                let at = at % line.len();
                edited.replace_range(at..=at, &byte);
            }
            is_similar(&line, &edited, count);
            is_similar(&edited, &line, count);
        }
    }
}
