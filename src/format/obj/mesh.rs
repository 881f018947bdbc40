//! From the lists of an OBJ to the parts of a [`Geometry`].

use super::scan::{FaceList, Run, Scan};
use super::triangulate::triangulate;
use crate::format::library::Library;
use crate::scene::normals::{self, DerivedNormals, Smoothing};
use crate::scene::{
    ABSENT, Attribute, Colors, Content, Corners, Faces, Geometry, Material, MaterialRuns, Mesh, Normals,
    Part, PartHash, Positions, Texcoords, Triangles,
};
use std::collections::HashMap;
use std::sync::Arc;

/// More `o` lines than this, and the whole file is one mesh.
const MAX_MESHES: usize = 4096;

/// The materials that faces have.
pub(super) struct UsedMaterials<'a> {
    /// In order of first use, each content once.
    pub materials: Vec<Part<Material>>,
    /// The first name of each.
    pub names: Vec<Vec<u8>>,
    /// `(first face, slot)`; slots change from run to run.
    pub runs: Vec<(u32, u32)>,
    /// Names that the library does not know, one for each run of faces that has one.
    pub unknown: Vec<&'a [u8]>,
}

/// Gives the materials slots by content: names may differ where the content does not.
pub(super) fn materials<'a>(scan: &Scan<'a>, library: &Library) -> UsedMaterials<'a> {
    let faces = scan.face_count;
    let mut used =
        UsedMaterials { materials: Vec::new(), names: Vec::new(), runs: Vec::new(), unknown: Vec::new() };
    let mut slot_of_content: HashMap<PartHash, u32> = HashMap::new();
    let mut slot_of_name: HashMap<&[u8], u32> = HashMap::new();
    if faces > 0 && scan.materials.first().is_none_or(|&(face, _)| face > 0) {
        used.runs.push((0, ABSENT));
    }
    for (face, name) in scan.material_runs() {
        let slot = *slot_of_name.entry(name).or_insert_with(|| {
            let Some(material) = library.get(name) else { return ABSENT };
            *slot_of_content.entry(material.hash()).or_insert_with(|| {
                used.materials.push(material.clone());
                used.names.push(name.to_vec());
                used.materials.len() as u32 - 1
            })
        });
        if slot == ABSENT {
            used.unknown.push(name);
        }
        if used.runs.last().is_none_or(|&(_, last)| last != slot) {
            used.runs.push((face, slot));
        }
    }
    used
}

/// What else must be known of an OBJ to read the next that has its faces.
#[derive(Clone, Debug, Default)]
pub(super) struct Known {
    /// Where its faces stand.
    pub runs: Vec<Run>,
    /// Indices of texture coordinates of all corners as written; empty where none has one.
    pub texcoords: Arc<Vec<u32>>,
    /// The same of normals.
    pub normals: Arc<Vec<u32>>,
}

/// Makes the parts. All indices must have been checked.
pub(super) fn geometry(
    scan: Scan,
    runs: Vec<(u32, u32)>,
    materials: Vec<Part<Material>>,
    smooth_angle_deg: Option<f32>,
) -> (Geometry, Known) {
    let Scan { positions, mut colors, texcoords, normals, faces, objects, smoothing, runs: lines, .. } = scan;
    let lists = TriangleLists::new(&positions, faces.corners());
    let derived = derived_normals(
        &positions,
        &lists.triangles,
        &lists.normals,
        smooth_angle_deg,
        &smoothing,
        &faces.counts,
    );
    let known = Known { runs: lines, texcoords: Arc::new(faces.texcoords), normals: Arc::new(faces.normals) };
    if !colors.is_empty() {
        colors.resize(positions.len(), [f32::NAN; 3]);
    }
    let geometry = Geometry {
        material_runs: Part::new(material_runs(runs, &faces.counts)),
        meshes: meshes(&objects, &faces.counts),
        positions: Part::new(Positions(compact(positions))),
        faces: Part::new(Faces { counts: compact(faces.counts), corners: compact(faces.positions) }),
        triangles: Part::new(Triangles(lists.triangles)),
        texcoords: (!lists.texcoords.is_empty()).then(|| Attribute {
            values: Part::new(Texcoords(compact(texcoords))),
            corners: Part::new(Corners(lists.texcoords)),
        }),
        normals: shading_normals(normals, lists.normals, derived),
        colors: (!colors.is_empty()).then(|| Part::new(Colors(colors))),
        materials,
    };
    (geometry, known)
}

/// Makes the parts of an OBJ that has the faces of the one before, and shares those that are the same.
pub(super) fn geometry_again(
    scan: Scan,
    runs: Vec<(u32, u32)>,
    materials: Vec<Part<Material>>,
    smooth_angle_deg: Option<f32>,
    before: &Geometry,
    known: &Known,
) -> (Geometry, Known) {
    let Scan { positions, texcoords, normals, faces, objects, smoothing, runs: lines, .. } = scan;
    let counts = &before.faces.counts[..];
    let raw =
        if faces.normals == **known.normals { Arc::clone(&known.normals) } else { Arc::new(faces.normals) };
    let corners =
        FaceCorners { counts, positions: &before.faces.corners, texcoords: &known.texcoords, normals: &raw };
    let as_before = triangles_again(&positions, corners, &before.triangles.0);
    let (triangles, corners_texcoords, lists) = if let Some(normals) = as_before {
        (before.triangles.clone(), before.texcoords.as_ref().map(|t| t.corners.clone()), normals)
    } else {
        let lists = TriangleLists::new(&positions, corners);
        let corners = (!lists.texcoords.is_empty()).then(|| Part::new(Corners(lists.texcoords)));
        (Part::new(Triangles(lists.triangles)), corners, lists.normals)
    };
    let derived = derived_normals(&positions, &triangles.0, &lists, smooth_angle_deg, &smoothing, counts);
    let known = Known { runs: lines, texcoords: Arc::clone(&known.texcoords), normals: raw };
    let texcoords = corners_texcoords.map(|corners| {
        let old = before.texcoords.as_ref().map(|t| &t.values);
        Attribute { values: shared(old, Texcoords(texcoords)), corners }
    });
    let material_runs = shared(Some(&before.material_runs), material_runs(runs, counts));
    let meshes = meshes(&objects, counts);
    let geometry = Geometry {
        positions: shared(Some(&before.positions), Positions(positions)),
        faces: before.faces.clone(),
        triangles,
        texcoords,
        normals: shading_normals(normals, lists, derived),
        colors: None,
        material_runs,
        materials,
        meshes,
    };
    (geometry, known)
}

/// The part there was where the content is the same.
fn shared<T: Content + PartialEq>(before: Option<&Part<T>>, content: T) -> Part<T> {
    let part = Part::new(content);
    before.filter(|before| before.hash() == part.hash()).cloned().unwrap_or(part)
}

pub(super) fn material_runs(runs: Vec<(u32, u32)>, counts: &[u32]) -> MaterialRuns {
    let mut starts = TriangleStarts::new(counts);
    MaterialRuns(runs.into_iter().map(|(face, slot)| [starts.at(face), slot]).collect())
}

/// Gives back what was reserved beyond need.
fn compact<T>(mut list: Vec<T>) -> Vec<T> {
    list.shrink_to_fit();
    list
}

/// Faces and the indices of all their corners; those of an attribute are empty where no corner has it.
#[derive(Clone, Copy)]
struct FaceCorners<'a> {
    counts: &'a [u32],
    positions: &'a [u32],
    texcoords: &'a [u32],
    normals: &'a [u32],
}

impl FaceList {
    fn corners(&self) -> FaceCorners<'_> {
        let Self { counts, positions, texcoords, normals } = self;
        FaceCorners { counts, positions, texcoords, normals }
    }
}

/// The normals' indices of all triangles' corners where polygons still become the same triangles; None where one does
/// not.
fn triangles_again(
    positions: &[[f32; 3]],
    faces: FaceCorners,
    mut before: &[[u32; 3]],
) -> Option<Vec<[u32; 3]>> {
    if faces.counts.iter().all(|&count| count == 3) {
        return Some(faces.normals.as_chunks().0.to_vec());
    }
    let mut normals = Vec::with_capacity(if faces.normals.is_empty() { 0 } else { before.len() });
    let mut of_face = Vec::new();
    let mut first = 0;
    for &count in faces.counts {
        let corners = first..first + count as usize;
        of_face.clear();
        let of_positions = &faces.positions[corners.clone()];
        triangulate(positions, of_positions, &mut of_face);
        let (same, rest) = before.split_at_checked(of_face.len())?;
        before = rest;
        if of_face.iter().zip(same).any(|(new, same)| new.map(|k| of_positions[k as usize]) != *same) {
            return None;
        }
        if let Some(indices) = faces.normals.get(corners.clone()) {
            normals.extend(of_face.iter().map(|triangle| triangle.map(|k| indices[k as usize])));
        }
        first = corners.end;
    }
    Some(normals)
}

/// The indices of all triangles' corners; those of an attribute are empty where no corner has it.
struct TriangleLists {
    triangles: Vec<[u32; 3]>,
    texcoords: Vec<[u32; 3]>,
    normals: Vec<[u32; 3]>,
}

impl TriangleLists {
    fn new(positions: &[[f32; 3]], faces: FaceCorners) -> Self {
        if faces.counts.iter().all(|&count| count == 3) {
            let as_written = |list: &[u32]| list.as_chunks().0.to_vec();
            return Self {
                triangles: as_written(faces.positions),
                texcoords: as_written(faces.texcoords),
                normals: as_written(faces.normals),
            };
        }
        let count = faces.positions.len() - 2 * faces.counts.len();
        let reserved = |list: &[u32]| Vec::with_capacity(if list.is_empty() { 0 } else { count });
        let mut lists = Self {
            triangles: reserved(faces.positions),
            texcoords: reserved(faces.texcoords),
            normals: reserved(faces.normals),
        };
        let mut of_face = Vec::new();
        let mut first = 0;
        for &count in faces.counts {
            let corners = first..first + count as usize;
            of_face.clear();
            triangulate(positions, &faces.positions[corners.clone()], &mut of_face);
            let append = |list: &mut Vec<[u32; 3]>, indices: &[u32]| {
                if let Some(indices) = indices.get(corners.clone()) {
                    list.extend(
                        of_face.iter().map(|triangle| triangle.map(|corner| indices[corner as usize])),
                    );
                }
            };
            append(&mut lists.triangles, faces.positions);
            append(&mut lists.texcoords, faces.texcoords);
            append(&mut lists.normals, faces.normals);
            first = corners.end;
        }
        lists
    }
}

/// Tells the first triangle of faces asked for in ascending order.
struct TriangleStarts<'a> {
    counts: &'a [u32],
    face: usize,
    triangle: u32,
}

impl<'a> TriangleStarts<'a> {
    fn new(counts: &'a [u32]) -> Self {
        Self { counts, face: 0, triangle: 0 }
    }

    /// The first triangle of that face, or of one behind the last.
    fn at(&mut self, face: u32) -> u32 {
        let face = face as usize;
        self.triangle += self.counts[self.face..face].iter().map(|count| count - 2).sum::<u32>();
        self.face = face;
        self.triangle
    }
}

/// The meshes between those faces.
pub(super) fn meshes(objects: &[u32], counts: &[u32]) -> Vec<Mesh> {
    let borders = if objects.len() > MAX_MESHES { &[] } else { objects };
    let firsts = std::iter::once(0).chain(borders.iter().copied());
    let ends = borders.iter().copied().chain([counts.len() as u32]);
    let mut starts = TriangleStarts::new(counts);
    firsts
        .zip(ends)
        .filter(|(first, end)| first < end)
        .map(|(first_face, end)| {
            let first_triangle = starts.at(first_face);
            let triangle_count = starts.at(end) - first_triangle;
            Mesh { first_face, face_count: end - first_face, first_triangle, triangle_count }
        })
        .collect()
}

/// Normals from smoothing groups or by angle, where a corner has none of the file's (`given`); None where all is flat.
fn derived_normals(
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
    given: &[[u32; 3]],
    smooth_angle_deg: Option<f32>,
    groups: &[(u32, u32)],
    counts: &[u32],
) -> Option<DerivedNormals> {
    if !given.is_empty() && !given.as_flattened().contains(&ABSENT) {
        return None;
    }
    if let Some(angle) = smooth_angle_deg {
        return Some(normals::derive(positions, triangles, Smoothing::AngleDeg(angle.into())));
    }
    if groups.iter().all(|&(_, group)| group == 0) {
        return None;
    }
    let mut of_triangles = vec![0; triangles.len()];
    let mut starts = TriangleStarts::new(counts);
    let firsts: Vec<u32> = groups.iter().map(|&(face, _)| starts.at(face)).collect();
    let ends = firsts.iter().skip(1).copied().chain([triangles.len() as u32]);
    for ((&first, end), &(_, group)) in firsts.iter().zip(ends).zip(groups) {
        of_triangles[first as usize..end as usize].fill(group);
    }
    Some(normals::derive(positions, triangles, Smoothing::Groups(&of_triangles)))
}

/// The file's normals where a corner has one, else the derived ones behind them.
fn shading_normals(
    mut values: Vec<[f32; 3]>,
    mut corners: Vec<[u32; 3]>,
    derived: Option<DerivedNormals>,
) -> Option<Attribute<Normals>> {
    if corners.is_empty() {
        let derived = derived?;
        (values, corners) = (derived.values, derived.corners);
    } else if let Some(derived) = derived {
        let given = values.len() as u32;
        values.extend(derived.values);
        for (corner, &own) in corners.as_flattened_mut().iter_mut().zip(derived.corners.as_flattened()) {
            if *corner == ABSENT && own != ABSENT {
                *corner = given + own;
            }
        }
    }
    let any = corners.as_flattened().iter().any(|&corner| corner != ABSENT);
    any.then(|| Attribute {
        values: Part::new(Normals(compact(values))),
        corners: Part::new(Corners(corners)),
    })
}
