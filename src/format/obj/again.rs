//! The same faces over other values: an OBJ is read with the frame before it at hand. Faces that stand there byte by
//! byte are not read again; those that differ must name the same positions and texture coordinates. All else is read
//! as [`scan`](super::scan) reads it, so that what comes out is the same; where that is in doubt, nothing does.

mod line;

use super::check::settle_attribute;
use super::face;
use super::mesh::Known;
use super::scan::{Kind, Run, Scan, ends_line, push_attribute, skip_blanks};
use super::usable_normal;
use crate::format::number::byte;
use crate::format::text::line_end;
use crate::scene::{ABSENT, Geometry};
use line::same_but_normals;
use memchr::{memchr, memchr_iter, memrchr};
use std::sync::Arc;

/// An OBJ that was read, with its text: what is the same in the next need not be read again.
#[derive(Debug)]
pub struct Parsed {
    /// The text. No line is continued, and no byte-order mark stands before it.
    pub(super) bytes: Vec<u8>,
    pub(super) geometry: Arc<Geometry>,
    pub(super) known: Known,
}

impl Parsed {
    /// The memory of its text.
    pub fn into_text(self) -> Vec<u8> {
        self.bytes
    }
}

/// Reads a text that has the faces of `before`, whatever materials they have. The lists of faces stay empty but for
/// the normals' indices, which are settled. None where there is anything that [`Known`] cannot describe.
pub(super) fn scan_again<'a>(text: &'a [u8], before: &Parsed) -> Option<Scan<'a>> {
    let positions = before.geometry.positions.0.len();
    let mut again = Again {
        text,
        scan: Scan::default(),
        before,
        faces: Cursor { runs: before.runs(Kind::Faces), at: 0 },
        texcoords: Cursor { runs: before.runs(Kind::Texcoords), at: 0 },
        corners: 0,
        counts_back: (usize::MAX, false),
        was_same: true,
    };
    again.scan.positions.reserve_exact(positions);
    again.scan.runs.reserve(before.known.runs.len());
    let mut at = 0;
    while at < text.len() {
        at = again.lines(at)?;
    }
    let Again { mut scan, corners, .. } = again;
    let faces = &before.geometry.faces;
    let sound = scan.faces.counts.is_empty()
        && scan.face_count as usize == faces.counts.len()
        && scan.positions.len() == positions
        && scan.positions.iter().all(|p| p.iter().all(|x| x.is_finite()))
        && before.geometry.texcoords.as_ref().is_none_or(|t| t.values.0.len() == scan.texcoords.len())
        && scan.texcoords.iter().all(|t| t.iter().all(|x| x.is_finite()))
        && scan.colors.is_empty()
        && scan.oddities.malformed.count == 0
        && scan.oddities.short_faces.count == 0;
    let refused = settle_attribute(&mut scan.faces.normals, corners, &scan.normals, usable_normal);
    (sound && refused.is_none()).then_some(scan)
}

/// A place in the frame before, among the runs of one kind.
struct Cursor<'b> {
    /// Those that begin before the place are done with, but for the first.
    runs: Vec<&'b Run>,
    at: usize,
}

impl Cursor<'_> {
    /// The run in which the place stands, or the next.
    fn run(&mut self) -> Option<Run> {
        while let Some(run) = self.runs.last() {
            if self.at < run.end {
                self.at = self.at.max(run.start);
                return Some(**run);
            }
            self.runs.pop();
        }
        None
    }
}

struct Again<'a, 'b> {
    text: &'a [u8],
    scan: Scan<'a>,
    before: &'b Parsed,
    faces: Cursor<'b>,
    texcoords: Cursor<'b>,
    /// Of the faces so far.
    corners: usize,
    /// Where a run of faces stands in the frame before, and whether an index in it counts back.
    counts_back: (usize, bool),
    /// Whether the last face stood in the frame before, so that the next may.
    was_same: bool,
}

impl Parsed {
    /// The runs of one kind, the last first.
    fn runs(&self, kind: Kind) -> Vec<&Run> {
        self.known.runs.iter().rev().filter(|run| run.kind == kind).collect()
    }
}

impl Again<'_, '_> {
    /// Reads one line or several; the place where the next begins.
    #[inline]
    fn lines(&mut self, at: usize) -> Option<usize> {
        match (byte(self.text, at), byte(self.text, at + 1)) {
            (b'f', b' ') => self.faces(at),
            (b'v', b't') if let Some(end) = self.same_texcoords(at) => Some(end),
            _ => self.any(at),
        }
    }

    /// Reads one line that is none of a face, whatever it is.
    fn any(&mut self, at: usize) -> Option<usize> {
        let next = self.scan.statement(self.text, at);
        // the one behind a line that is continued is no line
        let is_continued = next >= 2 && byte(self.text, next - 2) == b'\\';
        (!is_continued && self.scan.faces.counts.is_empty()).then_some(next)
    }

    /// Texture coordinates that are those of the frame before.
    fn same_texcoords(&mut self, at: usize) -> Option<usize> {
        let run = self.texcoords.run().filter(|run| run.start == self.texcoords.at)?;
        let known = self.before.bytes.get(run.start..run.end)?;
        if known.last() != Some(&b'\n') || !self.text[at..].starts_with(known) {
            return None;
        }
        let first = run.so_far[1];
        let count = memchr_iter(b'\n', known).count();
        let values = self.before.geometry.texcoords.as_ref()?.values.0.get(first..first + count)?;
        let so_far = self.scan.so_far();
        self.scan.texcoords.extend_from_slice(values);
        let end = at + known.len();
        self.scan.note_run(self.text, Run { kind: Kind::Texcoords, start: at, end, so_far });
        self.texcoords.at = run.end;
        Some(end)
    }

    /// Faces from here on: those that stand in the frame before, or one that names the same positions and texture
    /// coordinates.
    fn faces(&mut self, at: usize) -> Option<usize> {
        let run = self.faces.run()?;
        let so_far = self.scan.so_far();
        let may_be_same = self.means_the_same(&run);
        let known = &self.before.bytes[self.faces.at..run.end];
        let same = if may_be_same && self.was_same { common_lines(known, &self.text[at..]) } else { 0 };
        let end = if same > 0 {
            let faces = memchr_iter(b'\n', &known[..same]).count();
            self.same_faces(faces)?;
            self.faces.at += same;
            at + same
        } else if may_be_same && let Some(end) = self.usual_faces(at, run.end) {
            end
        } else if may_be_same && let Some(end) = self.similar_face(at, run.end) {
            end
        } else {
            let end = self.face(at, so_far)?;
            self.faces.at = after_line(&self.before.bytes, self.faces.at);
            self.was_same = true;
            end
        };
        self.scan.note_run(self.text, Run { kind: Kind::Faces, start: at, end, so_far });
        Some(end)
    }

    /// Whether the same bytes are the same faces: indices may count back from what stands before them.
    fn means_the_same(&mut self, run: &Run) -> bool {
        if self.scan.so_far() == run.so_far {
            return true;
        }
        if self.counts_back.0 != run.start {
            let known = &self.before.bytes[run.start..run.end];
            self.counts_back = (run.start, memchr(b'-', known).is_some());
        }
        !self.counts_back.1
    }

    /// Takes over faces of the frame before.
    fn same_faces(&mut self, faces: usize) -> Option<()> {
        let first = self.scan.face_count as usize;
        let counts = self.before.geometry.faces.counts.get(first..first + faces)?;
        let corners: u32 = counts.iter().sum();
        let end = self.corners + corners as usize;
        let known = &self.before.known.normals;
        let list = &mut self.scan.faces.normals;
        if !known.is_empty() {
            list.resize(self.corners, ABSENT);
            list.extend_from_slice(known.get(self.corners..end)?);
        }
        self.corners = end;
        self.scan.face_count += faces as u32;
        Some(())
    }

    /// Reads faces whose lines have their normals' indices in the same places and differ in nothing else, up to some
    /// that are the same in those too or to the end of the run.
    #[cfg(target_arch = "x86_64")]
    fn usual_faces(&mut self, start: usize, run_end: usize) -> Option<usize> {
        let counts = self.before.geometry.faces.counts.get(self.scan.face_count as usize..)?;
        let known = (&self.before.bytes[..run_end], self.faces.at);
        let list = &mut self.scan.faces.normals;
        list.resize(self.corners, ABSENT);
        let similar = super::lines::similar(known, (self.text, start), counts, list)?;
        self.corners = list.len();
        self.scan.face_count += similar.faces as u32;
        self.faces.at = similar.known_end;
        self.was_same = true;
        (similar.faces > 0).then_some(similar.end)
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn usual_faces(&mut self, _: usize, _: usize) -> Option<usize> {
        None
    }

    /// Reads a face whose line differs in nothing but normals.
    fn similar_face(&mut self, start: usize, run_end: usize) -> Option<usize> {
        let count = *self.before.geometry.faces.counts.get(self.scan.face_count as usize)? as usize;
        let (known, known_at) = (&self.before.bytes[..run_end], self.faces.at);
        let list = &mut self.scan.faces.normals;
        if !known[known_at..].starts_with(b"f ") {
            return None;
        }
        list.resize(self.corners, ABSENT);
        let (known_end, end, is_same) =
            same_but_normals((known, known_at + 2), (self.text, start + 2), count, list)?;
        self.corners = list.len();
        self.scan.face_count += 1;
        self.faces.at = known_end;
        self.was_same = is_same;
        Some(end)
    }

    /// Reads one face.
    fn face(&mut self, start: usize, so_far: [usize; 3]) -> Option<usize> {
        let text = self.text;
        let faces = &self.before.geometry.faces;
        let count = *faces.counts.get(self.scan.face_count as usize)? as usize;
        let positions = faces.corners.get(self.corners..self.corners + count)?;
        let texcoords = &self.before.known.texcoords;
        let mut at = skip_blanks(text, start + 1);
        for (k, &position) in positions.iter().enumerate() {
            let (corner, end) = face::corner(text, at, so_far);
            let texcoord = texcoords.get(self.corners + k).copied().unwrap_or(ABSENT);
            if corner.position != position || corner.texcoord != texcoord {
                return None;
            }
            push_attribute(&mut self.scan.faces.normals, self.corners + k, corner.normal);
            at = skip_blanks(text, end);
        }
        // a comment may be continued or not
        if !ends_line(byte(text, at)) || byte(text, at) == b'#' {
            return None;
        }
        self.corners += count;
        self.scan.face_count += 1;
        Some(at + 1)
    }
}

/// The place behind the line that holds `at`.
fn after_line(text: &[u8], at: usize) -> usize {
    let end = line_end(text, at);
    if byte(text, end) == b'\r' && byte(text, end + 1) == b'\n' { end + 2 } else { end + 1 }
}

/// How many bytes are the same in both, up to the last LF among them.
fn common_lines(a: &[u8], b: &[u8]) -> usize {
    memrchr(b'\n', &a[..common(a, b)]).map_or(0, |last| last + 1)
}

/// Compared in one go.
const STEP_BYTES: usize = 256;

/// How many bytes are the same in both.
fn common(a: &[u8], b: &[u8]) -> usize {
    let length = a.len().min(b.len());
    let (a, b) = (&a[..length], &b[..length]);
    let mut at = 0;
    // long runs at the speed of memory, then the place
    while at + STEP_BYTES <= length && a[at..at + STEP_BYTES] == b[at..at + STEP_BYTES] {
        at += STEP_BYTES;
    }
    while let (Some(x), Some(y)) = (a[at..].first_chunk::<8>(), b[at..].first_chunk::<8>()) {
        let differs = u64::from_le_bytes(*x) ^ u64::from_le_bytes(*y);
        if differs != 0 {
            return at + (differs.trailing_zeros() / 8) as usize;
        }
        at += 8;
    }
    at + a[at..].iter().zip(&b[at..]).take_while(|(x, y)| x == y).count()
}

#[cfg(test)]
mod tests;
