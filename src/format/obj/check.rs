//! Which faces cannot be rendered, and why. Nothing is looked at twice unless something is wrong.

use super::scan::{FaceList, Scan, face_offset, face_words, position_offset};
use crate::format::error::FormatError;
use crate::format::text::{Tally, Text, shown_statement};
use crate::scene::ABSENT;
use crate::warning::Warnings;
use std::path::Path;

/// Fails where a face names a position that is not there or not finite; with `lenient` such faces are taken out.
pub(super) fn check_faces(
    scan: &mut Scan,
    text: &Text,
    path: &Path,
    lenient: bool,
    warnings: &mut Warnings,
) -> Result<(), FormatError> {
    let finite = |p: &[f32; 3]| p.iter().all(|x| x.is_finite());
    let usable = |&index: &u32| scan.positions.get(index as usize).is_some_and(finite);
    let highest = scan.faces.positions.iter().copied().max().unwrap_or(0);
    if (highest as usize) < scan.positions.len() && scan.positions.iter().all(finite) {
        return Ok(());
    }
    let mut bad = Vec::new();
    let mut corners = scan.faces.positions.as_slice();
    for (face, &count) in scan.faces.counts.iter().enumerate() {
        let (of_face, rest) = corners.split_at(count as usize);
        corners = rest;
        if !of_face.iter().all(usable) {
            bad.push(face as u32);
        }
    }
    let Some(&first) = bad.first() else { return Ok(()) };
    let offset = face_offset(&text.joined, first).unwrap_or(0);
    let cause = cause(scan, text, first, offset);
    let line = text.line_at(offset);
    if !lenient {
        return Err(FormatError::BadFace { path: path.to_path_buf(), line, cause });
    }
    let dropped = format!("faces with an unusable vertex are dropped, the first because {cause}");
    warnings.add_times(Some(path), Some(line), dropped, bad.len() as u64);
    drop_faces(scan, &bad);
    Ok(())
}

/// What is wrong with a bad face, of its first corner that is.
fn cause(scan: &Scan, text: &Text, face: u32, offset: usize) -> String {
    let face = face as usize;
    let before: usize = scan.faces.counts[..face].iter().map(|&count| count as usize).sum();
    let vertices = scan.positions.len();
    let corners = &scan.faces.positions[before..before + scan.faces.counts[face] as usize];
    for (&index, word) in corners.iter().zip(face_words(&text.joined, offset)) {
        let Some(position) = scan.positions.get(index as usize) else {
            return without_position(word, vertices);
        };
        if !position.iter().all(|x| x.is_finite()) {
            let line = position_offset(&text.joined, index).map_or(0, |offset| text.line_at(offset));
            return format!("vertex {} (line {line}) is not three finite numbers", index + 1);
        }
    }
    "it names a vertex that is not there".to_owned()
}

/// Why the index in a corner's word is that of no position.
fn without_position(word: &[u8], vertices: usize) -> String {
    let index = word.split(|&b| b == b'/').next().unwrap_or_default();
    let digits = index.strip_prefix(b"-").or(index.strip_prefix(b"+")).unwrap_or(index);
    let whole = word.split(|&b| b == b'/').count() <= 3
        && !digits.is_empty()
        && word.iter().all(|b| b.is_ascii_digit() || matches!(b, b'/' | b'-' | b'+'));
    let index = shown_statement(index);
    if !whole {
        format!(
            "`{}` is no corner (position, position/texcoord, position//normal or all three)",
            shown_statement(word)
        )
    } else if digits.iter().all(|&b| b == b'0') {
        format!("position index {index} is not one: they count from 1, or back from -1")
    } else if index.starts_with('-') {
        format!("position index {index} reaches back before the file's first vertex")
    } else {
        format!("position index {index} is beyond the file's {vertices} vertices")
    }
}

/// Takes out faces, given in ascending order, and moves what counts from a face.
fn drop_faces(scan: &mut Scan, bad: &[u32]) {
    let mut keep = vec![true; scan.faces.counts.len()];
    for &face in bad {
        keep[face as usize] = false;
    }
    let FaceList { counts, positions, texcoords, normals } = &mut scan.faces;
    for list in [positions, texcoords, normals] {
        let per_corner =
            counts.iter().zip(&keep).flat_map(|(&n, &keep)| std::iter::repeat_n(keep, n as usize));
        let mut of_list = per_corner.chain(std::iter::repeat(true));
        list.retain(|_| of_list.next() == Some(true));
    }
    let mut of_list = keep.iter();
    counts.retain(|_| of_list.next() == Some(&true));
    scan.face_count = counts.len() as u32;
    // faces and lines no longer match
    scan.runs.clear();
    let moved = |face: u32| face - bad.partition_point(|&b| b < face) as u32;
    scan.objects.iter_mut().for_each(|face| *face = moved(*face));
    scan.materials.iter_mut().for_each(|(face, _)| *face = moved(*face));
    scan.smoothing.iter_mut().for_each(|(face, _)| *face = moved(*face));
}

/// What of an attribute's indices was refused.
#[derive(Debug, Default)]
pub(super) struct Refused {
    /// Corners whose index names no value, and the first of them.
    pub beyond: Tally,
    /// Corners whose index names a value that cannot be used, and the first such value.
    pub unusable: Tally,
}

impl Refused {
    pub(super) fn is_none(&self) -> bool {
        self.beyond.count == 0 && self.unusable.count == 0
    }
}

/// Makes [`ABSENT`] what names no usable value, and fills the list up to all corners; what was given that names none. The
/// list becomes empty where no corner has an index.
pub(super) fn settle_attribute<const N: usize>(
    indices: &mut Vec<u32>,
    corners: usize,
    values: &[[f32; N]],
    usable: impl Fn(&[f32; N]) -> bool,
) -> Refused {
    // ABSENT becomes 0, so that one look finds the highest index
    let end = indices.iter().map(|index| index.wrapping_add(1)).max().unwrap_or(0);
    let mut refused = Refused::default();
    if end as usize > values.len() || !values.iter().all(&usable) {
        for (corner, index) in indices.iter_mut().enumerate().filter(|(_, index)| **index != ABSENT) {
            match values.get(*index as usize) {
                Some(value) if usable(value) => continue,
                Some(_) => refused.unusable.add(*index as usize),
                None => refused.beyond.add(corner),
            }
            *index = ABSENT;
        }
    }
    if end == 0 || (!refused.is_none() && indices.iter().all(|&index| index == ABSENT)) {
        indices.clear();
    } else {
        indices.resize(corners, ABSENT);
    }
    refused
}
