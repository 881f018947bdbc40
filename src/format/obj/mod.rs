//! Wavefront OBJ: vertices, polygons, smoothing groups, colours, and which face has which material.
//!
//! The bytes are scanned once into lists ([`scan`]), what faces name is checked ([`check`]), polygons become
//! triangles ([`triangulate`]), and the lists become parts ([`mesh`]).

mod check;
mod face;
mod mesh;
mod scan;
#[cfg(test)]
mod tests;
mod triangulate;

use super::ReadOptions;
use super::error::FormatError;
use super::library::Library;
use super::text::{Tally, Text, first_word, is_line_end, line_end, shown, trimmed, without_comment};
use crate::math::{Bounds, DVec3};
use crate::scene::Geometry;
use crate::warning::Warnings;
use scan::Scan;
use std::path::Path;

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
    let lines = Lines::new(&text, path, options.lenient, warnings)?;
    Ok(lines.into_parsed(library, options, warnings))
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
    /// Reads all lines and checks the faces.
    pub(super) fn new(
        text: &'a Text<'a>,
        path: &'a Path,
        lenient: bool,
        warnings: &mut Warnings,
    ) -> Result<Self, FormatError> {
        let mut scan = scan::scan(&text.joined);
        check::check_faces(&mut scan, text, path, lenient, warnings)?;
        Ok(Self { scan, text, path })
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
    pub(super) fn into_parsed(
        mut self,
        library: &Library,
        options: &ReadOptions,
        warnings: &mut Warnings,
    ) -> ParsedObj {
        self.warn_of_oddities(warnings);
        self.settle_attributes(warnings);
        let used = mesh::materials(&self.scan, library);
        if let Some(name) = used.unknown.first()
            && !library.incomplete
        {
            let text = format!("material `{}` is in no library; its faces get the default", shown(name));
            warnings.add_times(Some(self.path), None, text, used.unknown.len() as u64);
        }
        let geometry = mesh::geometry(self.scan, used.runs, used.materials, options.smooth_angle_deg);
        if is_invisible(&geometry) {
            let text = "every face is wholly transparent (d 0); nothing will be seen of them";
            warnings.add(Some(self.path), None, text);
        }
        ParsedObj { geometry, material_names: used.names }
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
        let unknown = format!("unknown statements are skipped, the first is `{}`", shown(odd.unknown_word));
        self.warn(warnings, odd.unknown, unknown);
        let many = triangulate::MAX_EAR_CORNERS;
        let huge = self.scan.faces.counts.iter().filter(|&&count| count as usize > many).count();
        if huge > 0 {
            let text =
                format!("a face of more than {many} corners becomes a fan, right only if it is convex");
            warnings.add_times(Some(self.path), None, text, huge as u64);
        }
        if self.text.joined.is_empty() {
            warnings.add(Some(self.path), None, "the file is empty; its frame shows the background");
        }
    }

    /// Texture coordinates and normals that cannot be used count as absent.
    fn settle_attributes(&mut self, warnings: &mut Warnings) {
        let Scan { faces, texcoords, normals, .. } = &mut self.scan;
        let corners = faces.positions.len();
        let finite = |t: &[f32; 2]| t.iter().all(|x| x.is_finite());
        let directed = |n: &[f32; 3]| {
            let squared: f64 = n.iter().map(|&x| f64::from(x) * f64::from(x)).sum();
            squared > 0.0 && squared.is_finite()
        };
        let refused = [
            ("texcoord", check::settle_attribute(&mut faces.texcoords, corners, texcoords, finite)),
            ("normal", check::settle_attribute(&mut faces.normals, corners, normals, directed)),
        ];
        for (kind, count) in refused.into_iter().filter(|&(_, count)| count > 0) {
            let text = format!("a {kind} index names none that can be used; it counts as absent");
            warnings.add_times(Some(self.path), None, text, count);
        }
    }
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
