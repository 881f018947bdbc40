//! One pass over the bytes of an OBJ: its lists of vertices and faces, and where its state changes. Indices are
//! not judged here, since a face may name what comes later in the file.

use super::face::{self, Corner};
use crate::format::number::{byte, float};
use crate::format::text::{
    Tally, first_word, is_blank, is_line_end, line_end, trimmed, without_comment, words,
};
use crate::format::triple::{pairs, triples};
use crate::scene::ABSENT;
use memchr::memchr;

/// What is in an OBJ, in file order. Faces are counted from 0; `(face, x)` means: x holds from that face on.
#[derive(Debug, Default)]
pub(super) struct Scan<'a> {
    /// `v`; a malformed number is NaN.
    pub positions: Vec<[f32; 3]>,
    /// Colours of positions, NaN where there is none; empty where no position has one.
    pub colors: Vec<[f32; 3]>,
    /// `vt`, two numbers of it; a malformed one is NaN.
    pub texcoords: Vec<[f32; 2]>,
    /// `vn`; a malformed number is NaN.
    pub normals: Vec<[f32; 3]>,
    /// `f` of three corners and more.
    pub faces: FaceList,
    /// How many they are.
    pub face_count: u32,
    /// Where texture coordinates and faces stand.
    pub runs: Vec<Run>,
    /// Where `o` stands.
    pub objects: Vec<u32>,
    /// Names of materials.
    pub materials: Vec<(u32, &'a [u8])>,
    /// Smoothing groups, 0 for none.
    pub smoothing: Vec<(u32, u32)>,
    /// What stands behind `mtllib`.
    pub libraries: Vec<&'a [u8]>,
    /// Whether another statement of the format than those for vertices and faces was met.
    pub has_other_words: bool,
    /// What was met and left out.
    pub oddities: Oddities<'a>,
}

/// Faces and their corners. Indices count from 0; [`ABSENT`] where none is given, [`MISSING`](face::MISSING) where
/// one is given that names nothing.
#[derive(Debug, Default)]
pub(super) struct FaceList {
    /// Corners of each face.
    pub counts: Vec<u32>,
    /// Position indices of all corners.
    pub positions: Vec<u32>,
    /// Their texture coordinates; empty where no corner has one.
    pub texcoords: Vec<u32>,
    /// Their normals; empty where no corner has one.
    pub normals: Vec<u32>,
}

/// What stands in a run of lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// `vt`.
    Texcoords,
    /// `f` of three corners and more.
    Faces,
}

/// Lines of one kind with nothing between them, from the word of the first to the end of the last. Each but the last
/// ends with its only LF.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    /// What they are.
    pub kind: Kind,
    /// Where the first begins.
    pub start: usize,
    /// The place behind the last.
    pub end: usize,
    /// How many positions, texture coordinates and normals stand before the first.
    pub so_far: [usize; 3],
}

/// What was met and left out.
#[derive(Debug, Default)]
pub(super) struct Oddities<'a> {
    /// `v`, `vt` and `vn` with a number that is none, or with too few.
    pub malformed: Tally,
    /// `f` with fewer than three corners.
    pub short_faces: Tally,
    /// Points, lines, curves and surfaces.
    pub unrendered: Tally,
    /// Words that are no statement.
    pub unknown: Tally,
    /// The first of those words.
    pub unknown_word: &'a [u8],
}

/// Statements of the format that have no effect on a picture of polygons.
const WITHOUT_EFFECT: [&[u8]; 14] = [
    b"g",
    b"mg",
    b"lod",
    b"bevel",
    b"c_interp",
    b"d_interp",
    b"shadow_obj",
    b"trace_obj",
    b"maplib",
    b"usemap",
    b"ctech",
    b"stech",
    b"vw",
    b"end",
];

/// Statements that draw something else than polygons, or are part of that.
const UNRENDERED: [&[u8]; 20] = [
    b"p", b"l", b"vp", b"cstype", b"deg", b"bmat", b"step", b"curv", b"curv2", b"surf", b"parm", b"trim",
    b"hole", b"scrv", b"sp", b"con", b"bzp", b"bsp", b"cdc", b"res",
];

/// Reads a text whose continued lines are joined.
pub(super) fn scan(text: &[u8]) -> Scan<'_> {
    let mut scan = Scan::default();
    // a vertex takes some 30 bytes, a face no fewer, and each is at most about half of a file
    let expected = text.len() / 64;
    scan.positions.reserve(expected);
    scan.faces.counts.reserve(expected);
    scan.faces.positions.reserve(3 * expected);
    let mut at = 0;
    while at < text.len() {
        at = scan.statement(text, at);
    }
    scan
}

/// Calls `found` with each position of a text whose continued lines are joined, and looks at little else.
pub(super) fn positions(text: &[u8], mut found: impl FnMut([f32; 3])) {
    let mut next = next_statement(text, b'v', 0);
    while let Some(start) = next {
        let (position, end, _) = numbers::<3>(text, start + 1);
        found(position);
        // mostly they stand one below the other
        let below = (byte(text, end), byte(text, end + 1), byte(text, end + 2)) == (b'\n', b'v', b' ');
        next = if below { Some(end + 1) } else { next_statement(text, b'v', end) };
    }
}

/// Where the next statement begins whose word is this one letter. The letter is looked for, not the lines: it is rare
/// in all others.
fn next_statement(text: &[u8], word: u8, mut at: usize) -> Option<usize> {
    loop {
        let start = at + memchr(word, &text[at..])?;
        at = start + 1;
        if ends_word(byte(text, at)) {
            let before = text[..start].iter().rev().find(|&&b| !is_blank(b));
            if before.is_none_or(|&b| is_line_end(b)) {
                return Some(start);
            }
        }
    }
}

impl<'a> Scan<'a> {
    /// Each run of faces that has a material: its first face and the material's name.
    pub(super) fn material_runs(&self) -> impl Iterator<Item = (u32, &'a [u8])> {
        let ends = self.materials.iter().skip(1).map(|&(face, _)| face).chain([self.face_count]);
        self.materials.iter().copied().zip(ends).filter(|((face, _), end)| face < end).map(|(run, _)| run)
    }

    /// Whether there are statements and none of them is one of the format.
    pub(super) fn is_something_else(&self) -> bool {
        let vertices = self.positions.len() + self.texcoords.len() + self.normals.len();
        let faces = u64::from(self.face_count) + self.oddities.short_faces.count;
        self.oddities.unknown.count > 0 && !self.has_other_words && vertices == 0 && faces == 0
    }

    /// Reads the statement at `start`; the place where the next line begins.
    #[inline]
    pub(super) fn statement(&mut self, text: &'a [u8], start: usize) -> usize {
        let start = skip_blanks(text, start);
        match (byte(text, start), byte(text, start + 1)) {
            (b'v', b' ') if let Some(end) = triples::<false>(text, start, &mut self.positions) => end,
            (b'v', next) if ends_word(next) => self.position(text, start),
            (b'f', b' ') if let Some(end) = self.usual_faces(text, start) => end,
            (b'f', next) if ends_word(next) => self.face(text, start),
            (b'v', b't') if let Some(end) = self.usual_texcoords(text, start) => end,
            (b'v', b't') if ends_word(byte(text, start + 2)) => {
                let (values, at, malformed) = numbers::<1>(text, start + 2);
                let (second, at) = optional(text, at);
                // one number is a place along a line; a second that is malformed must not pass for 0
                let so_far = self.so_far();
                self.texcoords.push([values[0], second.unwrap_or(0.0)]);
                self.note_malformed(malformed || second.is_some_and(f32::is_nan), start);
                let end = after_line(text, at);
                self.note_run(text, Run { kind: Kind::Texcoords, start, end, so_far });
                end
            }
            (b'v', b'n') if let Some(end) = triples::<true>(text, start, &mut self.normals) => end,
            (b'v', b'n') if ends_word(byte(text, start + 2)) => {
                let (normal, at, malformed) = numbers::<3>(text, start + 2);
                self.normals.push(normal);
                self.note_malformed(malformed, start);
                after_line(text, at)
            }
            (b'\n' | b'\r', _) => start + 1,
            _ => self.other(text, start),
        }
    }

    #[inline]
    fn note_malformed(&mut self, malformed: bool, start: usize) {
        if malformed {
            self.oddities.malformed.add(start);
        }
    }

    /// How many positions, texture coordinates and normals there are.
    #[inline]
    pub(super) fn so_far(&self) -> [usize; 3] {
        [self.positions.len(), self.texcoords.len(), self.normals.len()]
    }

    /// Takes lines into the last run, else as a new one.
    #[inline]
    pub(super) fn note_run(&mut self, text: &[u8], mut run: Run) {
        run.end = run.end.min(text.len());
        if text[..run.end].ends_with(b"\r") && text.get(run.end) == Some(&b'\n') {
            run.end += 1;
        }
        if let Some(last) = self.runs.last_mut()
            && last.kind == run.kind
            && last.end == run.start
            && text[..run.start].ends_with(b"\n")
        {
            last.end = run.end;
        } else {
            self.runs.push(run);
        }
    }

    #[inline]
    fn position(&mut self, text: &[u8], start: usize) -> usize {
        let (position, at, malformed) = numbers::<3>(text, start + 1);
        self.positions.push(position);
        self.note_malformed(malformed, start);
        if byte(text, at) == b'\n' {
            return at + 1;
        }
        self.color(text, at)
    }

    /// What may follow x, y and z: w; r g b; r g b a.
    fn color(&mut self, text: &[u8], at: usize) -> usize {
        let mut values = [f32::NAN; 4];
        let (mut count, mut at) = (0, skip_blanks(text, at));
        while count < values.len()
            && let (Some(value), end) = optional(text, at)
        {
            values[count] = value;
            count += 1;
            at = end;
        }
        let color = [values[0], values[1], values[2]];
        if count >= 3 && color.iter().all(|c| c.is_finite()) {
            self.colors.resize(self.positions.len() - 1, [f32::NAN; 3]);
            self.colors.push(color);
        }
        after_line(text, at)
    }

    /// Texture coordinates that stand one below the other, written the usual way.
    #[inline]
    fn usual_texcoords(&mut self, text: &[u8], start: usize) -> Option<usize> {
        let so_far = self.so_far();
        let end = pairs(text, start, &mut self.texcoords)?;
        self.note_run(text, Run { kind: Kind::Texcoords, start, end, so_far });
        Some(end)
    }

    /// Faces that stand one below the other, written the usual way.
    #[inline]
    #[cfg(target_arch = "x86_64")]
    fn usual_faces(&mut self, text: &[u8], start: usize) -> Option<usize> {
        let end = super::lines::faces(text, start, &mut self.faces)?;
        self.face_count = self.faces.counts.len() as u32;
        self.note_run(text, Run { kind: Kind::Faces, start, end, so_far: self.so_far() });
        Some(end)
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn usual_faces(&mut self, _: &[u8], _: usize) -> Option<usize> {
        None
    }

    #[inline]
    fn face(&mut self, text: &[u8], start: usize) -> usize {
        let so_far = self.so_far();
        let first = self.faces.positions.len();
        let mut at = skip_blanks(text, start + 1);
        while !ends_line(byte(text, at)) {
            let (corner, end) = face::corner(text, at, so_far);
            self.faces.push(corner);
            at = skip_blanks(text, end);
        }
        let count = self.faces.positions.len() - first;
        if count < 3 {
            self.faces.truncate(first);
            self.oddities.short_faces.add(start);
            return after_line(text, at);
        }
        self.faces.counts.push(count as u32);
        self.face_count += 1;
        let end = after_line(text, at);
        self.note_run(text, Run { kind: Kind::Faces, start, end, so_far });
        end
    }

    /// Every other statement, and comments.
    fn other(&mut self, text: &'a [u8], start: usize) -> usize {
        let end = line_end(text, start);
        let line = without_comment(&text[start..end]);
        let (keyword, rest) = first_word(line);
        let face = self.face_count;
        match keyword {
            b"" => return end + 1,
            b"o" => self.objects.push(face),
            b"usemtl" => self.materials.push((face, rest)),
            b"mtllib" => self.libraries.push(rest),
            b"s" => self.smoothing.push((face, smoothing_group(rest))),
            _ if WITHOUT_EFFECT.contains(&keyword) => {}
            _ if UNRENDERED.contains(&keyword) => self.oddities.unrendered.add(start),
            _ => {
                if self.oddities.unknown.count == 0 {
                    self.oddities.unknown_word = keyword;
                }
                self.oddities.unknown.add(start);
                return end + 1;
            }
        }
        self.has_other_words = true;
        end + 1
    }
}

impl FaceList {
    #[inline]
    fn push(&mut self, corner: Corner) {
        self.positions.push(corner.position);
        let before = self.positions.len() - 1;
        push_attribute(&mut self.texcoords, before, corner.texcoord);
        push_attribute(&mut self.normals, before, corner.normal);
    }

    pub(super) fn truncate(&mut self, corners: usize) {
        self.positions.truncate(corners);
        self.texcoords.truncate(corners);
        self.normals.truncate(corners);
    }
}

/// Appends an index to a list that stays empty until a corner has one.
#[inline]
pub(super) fn push_attribute(list: &mut Vec<u32>, before: usize, index: u32) {
    if index == ABSENT && list.is_empty() {
        return;
    }
    if list.len() < before {
        list.resize(before, ABSENT);
    }
    list.push(index);
}

#[inline]
pub(super) fn skip_blanks(text: &[u8], mut at: usize) -> usize {
    while is_blank(byte(text, at)) {
        at += 1;
    }
    at
}

#[inline]
fn ends_word(byte: u8) -> bool {
    is_blank(byte) || is_line_end(byte)
}

/// Whether nothing but a comment can follow.
#[inline]
pub(super) fn ends_line(byte: u8) -> bool {
    is_line_end(byte) || byte == b'#'
}

/// The place where the line behind that of `at` begins. Looks at the next byte first: it mostly ends the line.
#[inline]
fn after_line(text: &[u8], at: usize) -> usize {
    if byte(text, at) == b'\n' { at + 1 } else { line_end(text, at) + 1 }
}

/// N numbers, NaN where one is malformed or missing; the place behind them and the blanks there; whether any was.
#[inline]
fn numbers<const N: usize>(text: &[u8], mut at: usize) -> ([f32; N], usize, bool) {
    let mut values = [f32::NAN; N];
    let mut malformed = false;
    for value in &mut values {
        let (number, end) = float(text, skip_blanks(text, at));
        *value = number.unwrap_or(f32::NAN);
        malformed |= number.is_none();
        at = end;
    }
    (values, skip_blanks(text, at), malformed)
}

/// One number that need not be there, NaN where it is malformed; None where the line ends.
#[inline]
fn optional(text: &[u8], at: usize) -> (Option<f32>, usize) {
    if ends_line(byte(text, at)) {
        return (None, at);
    }
    let (number, end) = float(text, at);
    (Some(number.unwrap_or(f32::NAN)), skip_blanks(text, end))
}

/// `s off` and everything that is no number are group 0: none.
fn smoothing_group(rest: &[u8]) -> u32 {
    let word = words(rest).next().unwrap_or_default();
    if word == b"on" { 1 } else { str::from_utf8(word).ok().and_then(|w| w.parse().ok()).unwrap_or(0) }
}

/// Where the statement of the `index`-th position begins.
pub(super) fn position_offset(text: &[u8], index: u32) -> Option<usize> {
    statements(text, b'v').nth(index as usize)
}

/// Where the statement of the `index`-th face begins, of those with three corners and more.
pub(super) fn face_offset(text: &[u8], index: u32) -> Option<usize> {
    statements(text, b'f').filter(|&start| face_words(text, start).nth(2).is_some()).nth(index as usize)
}

fn statements(text: &[u8], word: u8) -> impl Iterator<Item = usize> {
    let mut at = 0;
    std::iter::from_fn(move || {
        let start = next_statement(text, word, at)?;
        at = start + 1;
        Some(start)
    })
}

/// The words of the face at `offset`, one a corner.
pub(super) fn face_words(text: &[u8], offset: usize) -> impl Iterator<Item = &[u8]> {
    let line = &text[offset..line_end(text, offset)];
    let line = line.split(|&b| b == b'#').next().unwrap_or_default();
    words(trimmed(&line[1..]))
}
