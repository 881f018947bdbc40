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
    Tally, Text, first_word, is_line_end, line_end, shown, shown_statement, trimmed, without_comment,
};
use crate::math::{Bounds, DVec3};
use crate::scene::Geometry;
use crate::warning::Warnings;
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
    let bytes: &[u8] = &text.joined;
    memchr::memmem::find_iter(bytes, b"mtllib")
        .filter_map(|at| {
            let starts = bytes[..at].iter().rposition(|&b| is_line_end(b)).map_or(0, |i| i + 1);
            let line = trimmed(without_comment(&bytes[starts..line_end(bytes, at)]));
            let (word, rest) = first_word(line);
            (word == b"mtllib").then(|| trimmed(rest))
        })
        .collect()
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
        warn_of_unknown(&used, library, self.path, warnings);
        let angle = options.smooth_angle_deg;
        let (geometry, known) = match self.before {
            None => mesh::geometry(self.scan, used.runs, used.materials, angle),
            Some(Parsed { geometry, known, .. }) => {
                mesh::geometry_again(self.scan, used.runs, used.materials, angle, geometry, known)
            }
        };
        warn_if_invisible(&geometry, self.path, warnings);
        let parsed = ParsedObj { geometry, material_names: used.names };
        Shape { parsed, known: can_be_known.then_some(known) }
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
        let refused = [
            ("texcoord", check::settle_attribute(&mut faces.texcoords, corners, texcoords, finite)),
            ("normal", check::settle_attribute(&mut faces.normals, corners, normals, usable_normal)),
        ];
        for (kind, count) in refused.into_iter().filter(|&(_, count)| count > 0) {
            let text = format!("a {kind} index names none that can be used; it counts as absent");
            warnings.add_times(Some(self.path), None, text, count);
        }
        refused.iter().all(|&(_, count)| count == 0)
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

fn warn_of_unknown(used: &UsedMaterials, library: &Library, path: &Path, warnings: &mut Warnings) {
    if let Some(name) = used.unknown.first()
        && !library.incomplete
    {
        let text = format!("material `{}` is in no library; its faces get the default", shown(name));
        warnings.add_times(Some(path), None, text, used.unknown.len() as u64);
    }
}

fn warn_if_invisible(geometry: &Geometry, path: &Path, warnings: &mut Warnings) {
    if is_invisible(geometry) {
        let text = "every face is wholly transparent (d 0); nothing will be seen of them";
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
