//! Wavefront OBJ: vertices, polygons, smoothing groups, colours, and which face has which material.
//!
//! The bytes are scanned once into lists ([`scan`]; faces as most are written by `lines`), what faces name is checked
//! ([`check`]), polygons become triangles ([`triangulate`]), and the lists become parts ([`mesh`]). A frame that has the
//! faces of the one before it is read with that at hand ([`again`]).

mod again;
mod check;
mod face;
#[cfg(target_arch = "x86_64")]
mod lines;
mod mesh;
mod scan;
pub(super) mod stored;
#[cfg(test)]
mod tests;
mod triangulate;

use super::ReadOptions;
use super::error::FormatError;
use super::library::Library;
use super::text::{
    Tally, Text, first_word, is_blank, is_line_end, line_end, shown, shown_statement, trimmed,
    without_comment,
};
use crate::math::{Bounds, DVec3};
use crate::scene::Geometry;
use crate::warning::{Warning, Warnings};
use mesh::{Known, UsedMaterials};
use scan::Scan;
use std::path::Path;
use std::sync::Arc;

pub use again::Parsed;

/// The shape in an OBJ's bytes and the names of its materials.
#[derive(Clone, Debug)]
pub struct ParsedObj {
    /// Shape and materials.
    pub geometry: Geometry,
    /// For each slot of [`Geometry::materials`] the first name under which it was used.
    pub material_names: Vec<Vec<u8>>,
}

/// An OBJ in memory of which all lines are read, before its materials are known.
pub(super) struct Lines<'a> {
    scan: Scan<'a>,
    text: &'a Text<'a>,
    path: &'a Path,
    /// What has the same faces; their lists in `scan` are then empty but for the normals.
    before: Option<&'a Parsed>,
    /// Whether no index names what cannot be used.
    all_usable: bool,
}

/// What is read of an OBJ, and what makes the next quicker to read, where there is such a thing.
pub(super) struct Shape {
    pub parsed: ParsedObj,
    known: Option<Known>,
    /// A material that no library has, as a sentence.
    pub missing: Option<String>,
}

impl Shape {
    /// The shape, and what to keep for the next frame.
    pub(super) fn keep(self, text: Option<Vec<u8>>) -> (Arc<Geometry>, Vec<Vec<u8>>, Option<Parsed>) {
        let geometry = Arc::new(self.parsed.geometry);
        let parsed = self.known.zip(text).map(|(known, bytes)| Parsed {
            bytes,
            geometry: Arc::clone(&geometry),
            known,
        });
        (geometry, self.parsed.material_names, parsed)
    }
}

/// Reads an OBJ from memory. `path` is its name in errors and warnings; `library` what its `usemtl` finds, whatever
/// `mtllib` says. Overrides and libraries among the options are not looked at.
pub fn parse_obj(
    bytes: &[u8],
    path: &Path,
    library: &Library,
    options: &ReadOptions,
    warnings: &mut Warnings,
) -> Result<ParsedObj, FormatError> {
    let text = Text::new(bytes, path)?;
    let lines = Lines::new(&text, path, options.lenient, None, warnings)?;
    Ok(lines.into_shape(library, options, warnings).parsed)
}

/// Grows a box by the finite positions in (a part of) an OBJ: those of [`Geometry::positions`], without the rest.
pub(super) fn add_to_bounds(bounds: &mut Bounds, text: &Text) {
    let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    scan::positions(&text.joined, |p| {
        if p.iter().all(|x| x.is_finite()) {
            for k in 0..3 {
                min[k] = if p[k] < min[k] { p[k] } else { min[k] };
                max[k] = if p[k] > max[k] { p[k] } else { max[k] };
            }
        }
    });
    bounds.merge(&Bounds { min: DVec3::from(min.map(f64::from)), max: DVec3::from(max.map(f64::from)) });
}

/// What stands behind each `mtllib`, found without reading the rest.
pub(super) fn library_statements<'t>(text: &'t Text<'_>) -> Vec<&'t [u8]> {
    statements(text, b"mtllib").map(|(_, behind)| behind).collect()
}

/// The line of the first statement of that word with that behind it, found without reading the rest.
pub(super) fn line_of(text: &Text, word: &[u8], behind: &[u8]) -> Option<u32> {
    statements(text, word).find(|&(_, found)| found == behind).map(|(start, _)| text.line_at(start))
}

/// Tells the line of a statement by its word and what stands behind it; asked where that is to be told of.
pub(super) type LineOf<'a> = &'a dyn Fn(&[u8], &[u8]) -> Option<u32>;

/// Where each statement of a word begins, and what stands behind the word.
fn statements<'t>(text: &'t Text<'_>, word: &'t [u8]) -> impl Iterator<Item = (usize, &'t [u8])> {
    let bytes: &[u8] = &text.joined;
    memchr::memmem::find_iter(bytes, word).filter_map(move |start| {
        let before = bytes[..start].iter().rev().find(|&&b| !is_blank(b));
        if before.is_some_and(|&b| !is_line_end(b)) {
            return None;
        }
        let line = &bytes[start..line_end(bytes, start)];
        let (found, behind) = first_word(without_comment(line));
        (found == word).then_some((start, behind))
    })
}

impl<'a> Lines<'a> {
    /// Reads all lines and checks the faces; sooner where they are those `before`.
    pub(super) fn new(
        text: &'a Text<'a>,
        path: &'a Path,
        lenient: bool,
        before: Option<&'a Parsed>,
        warnings: &mut Warnings,
    ) -> Result<Self, FormatError> {
        if let Some(zero) = text.first_zero {
            return Err(FormatError::Binary { path: path.to_path_buf(), line: text.line_at(zero) });
        }
        let scan_again = |parsed| again::scan_again(&text.joined, parsed).map(|scan| (scan, parsed));
        let again = before.filter(|_| text.is_plain()).and_then(scan_again);
        let mut lines = if let Some((scan, before)) = again {
            Self { scan, text, path, before: Some(before), all_usable: true }
        } else {
            let mut scan = scan::scan(&text.joined);
            // what has the faces of the frame before is an OBJ
            refuse_something_else(&scan, text, path)?;
            check::check_faces(&mut scan, text, path, lenient, warnings)?;
            Self { scan, text, path, before: None, all_usable: false }
        };
        lines.warn_of_oddities(warnings);
        lines.all_usable = lines.all_usable || lines.settle_attributes(warnings);
        Ok(lines)
    }

    /// What stands behind each `mtllib`.
    pub(super) fn libraries(&self) -> &[&'a [u8]] {
        &self.scan.libraries
    }

    /// The names of materials that faces have, in order of first use, repeated where they are named again.
    pub(super) fn used_materials(&self) -> impl Iterator<Item = &'a [u8]> {
        self.scan.material_runs().map(|(_, name)| name)
    }

    /// Makes the shape.
    pub(super) fn into_shape(
        self,
        library: &Library,
        options: &ReadOptions,
        warnings: &mut Warnings,
    ) -> Shape {
        let can_be_known = self.all_usable && self.can_be_known();
        let used = mesh::materials(&self.scan, library);
        let line_of = |word: &[u8], behind: &[u8]| line_of(self.text, word, behind);
        let missing = tell_of_unknown(&used, library, self.path, &line_of, warnings);
        let angle = options.smooth_angle_deg;
        let (geometry, known) = match self.before {
            None => mesh::geometry(self.scan, used.runs, used.materials, angle),
            Some(Parsed { geometry, known, .. }) => {
                mesh::geometry_again(self.scan, used.runs, used.materials, angle, geometry, known)
            }
        };
        warn_if_invisible(&geometry, self.path, warnings);
        let parsed = ParsedObj { geometry, material_names: used.names };
        Shape { parsed, known: can_be_known.then_some(known), missing }
    }

    /// Whether this can serve as the frame before another: nothing is odd about its faces and vertices.
    fn can_be_known(&self) -> bool {
        let Scan { runs, positions, colors, oddities, .. } = &self.scan;
        self.text.is_plain()
            && !runs.is_empty()
            && oddities.malformed.count == 0
            && colors.is_empty()
            && positions.iter().all(|p| p.iter().all(|x| x.is_finite()))
    }

    fn warn(&self, warnings: &mut Warnings, tally: Tally, text: impl Into<String>) {
        if tally.count > 0 {
            warnings.add_times(Some(self.path), Some(self.text.line_at(tally.first)), text, tally.count);
        }
    }

    fn warn_of_oddities(&self, warnings: &mut Warnings) {
        let odd = &self.scan.oddities;
        self.warn(warnings, odd.malformed, "a vertex has a malformed or missing number; faces cannot use it");
        self.warn(warnings, odd.short_faces, "a face has fewer than 3 corners and is dropped");
        self.warn(warnings, odd.unrendered, "points, lines, curves and surfaces are not rendered");
        let unknown =
            format!("unknown statements are skipped, the first is `{}`", shown_statement(odd.unknown_word));
        self.warn(warnings, odd.unknown, unknown);
        let many = triangulate::MAX_EAR_CORNERS;
        let counts = self.before.map_or(&self.scan.faces.counts, |before| &before.geometry.faces.counts);
        let huge = counts.iter().filter(|&&count| count as usize > many).count();
        if huge > 0 {
            let text =
                format!("a face of more than {many} corners becomes a fan, right only if it is convex");
            warnings.add_times(Some(self.path), None, text, huge as u64);
        }
        if self.text.joined.is_empty() {
            warnings.add(Some(self.path), None, "the file is empty; its frame shows the background");
        }
    }

    /// Texture coordinates and normals that cannot be used count as absent; whether there are none.
    fn settle_attributes(&mut self, warnings: &mut Warnings) -> bool {
        let Scan { faces, texcoords, normals, .. } = &mut self.scan;
        let corners = faces.positions.len();
        let finite = |t: &[f32; 2]| t.iter().all(|x| x.is_finite());
        let of_texcoords = check::settle_attribute(&mut faces.texcoords, corners, texcoords, finite);
        let of_normals = check::settle_attribute(&mut faces.normals, corners, normals, usable_normal);
        let is_zero = normals.get(of_normals.unusable.first).is_some_and(|n| *n == [0.0; 3]);
        let counts = [texcoords.len(), normals.len()];
        for (kind, count, refused) in
            [("texcoord", counts[0], &of_texcoords), ("normal", counts[1], &of_normals)]
        {
            let Tally { count: times, first } = refused.beyond;
            if times > 0 {
                let plural = if count == 1 { "" } else { "s" };
                let text = format!(
                    "a {kind} index is 0 or beyond the file's {count} {kind}{plural}; it counts as absent"
                );
                warnings.add_times(Some(self.path), self.line_of_corner(first), text, times);
            }
        }
        let normal = if is_zero { "a normal has length 0" } else { "a normal is not three finite numbers" };
        for (word, cause, unusable) in [
            (&b"vt"[..], "a texcoord is not finite", of_texcoords.unusable),
            (b"vn", normal, of_normals.unusable),
        ] {
            if unusable.count > 0 {
                let line = statements(self.text, word).nth(unusable.first);
                let line = line.map(|(start, _)| self.text.line_at(start));
                let text = format!("{cause}; where a corner names it, it counts as absent");
                warnings.add_times(Some(self.path), line, text, unusable.count);
            }
        }
        of_texcoords.is_none() && of_normals.is_none()
    }

    /// The line of the face that has a corner; None where faces were dropped, so that they no longer match the lines.
    fn line_of_corner(&self, corner: usize) -> Option<u32> {
        let mut end = 0;
        let face = self.scan.faces.counts.iter().position(|&count| {
            end += count as usize;
            corner < end
        });
        let face = face.filter(|_| !self.scan.runs.is_empty())?;
        scan::face_offset(&self.text.joined, face as u32).map(|offset| self.text.line_at(offset))
    }
}

fn refuse_something_else(scan: &Scan, text: &Text, path: &Path) -> Result<(), FormatError> {
    if !scan.is_something_else() {
        return Ok(());
    }
    let start = scan.oddities.unknown.first;
    let line = &text.joined[start..line_end(&text.joined, start)];
    Err(FormatError::NoObj {
        path: path.to_path_buf(),
        line: text.line_at(start),
        statement: shown_statement(trimmed(line)),
    })
}

/// Warns of materials that no library has; the sentence for the first. Where a library is missing, that was told.
fn tell_of_unknown(
    used: &UsedMaterials,
    library: &Library,
    path: &Path,
    line_of: LineOf<'_>,
    warnings: &mut Warnings,
) -> Option<String> {
    let name = used.unknown.first().filter(|_| !library.incomplete)?;
    let text = format!("material `{}` is in no library; its faces get the default", shown(name));
    let line = line_of(b"usemtl", name);
    warnings.add_times(Some(path), line, text.clone(), used.unknown.len() as u64);
    Some(Warning { file: Some(path.to_path_buf()), line, text, count: 1 }.to_string())
}

fn warn_if_invisible(geometry: &Geometry, path: &Path, warnings: &mut Warnings) {
    if is_invisible(geometry) {
        let text = "every face is wholly transparent (d 0), as some exporters write by mistake; nothing will be seen of them";
        warnings.add(Some(path), None, text);
    }
}

/// Whether a normal has a direction.
fn usable_normal(normal: &[f32; 3]) -> bool {
    let squared: f64 = normal.iter().map(|&x| f64::from(x) * f64::from(x)).sum();
    squared > 0.0 && squared.is_finite()
}

/// Whether there are faces and all of them have d 0, in a model where that hides them: some exporters write it
/// everywhere.
fn is_invisible(geometry: &Geometry) -> bool {
    let hides = |&[_, slot]: &[u32; 2]| {
        geometry.materials.get(slot as usize).is_some_and(|m| m.d == 0.0 && !matches!(m.illum, 4 | 6 | 7 | 9))
    };
    let runs = &geometry.material_runs.0;
    !runs.is_empty() && runs.iter().all(hides)
}
