//! From the lists of an OBJ to the parts of a [`Geometry`].

use super::scan::{FaceList, Scan};
use super::triangulate::triangulate;
use crate::format::material::Library;
use crate::scene::normals::{self, DerivedNormals, Smoothing};
use crate::scene::{
    ABSENT, Attribute, Colors, Corners, Faces, Geometry, Material, MaterialRuns, Mesh, Normals, Part,
    PartHash, Positions, Texcoords, Triangles,
};
use std::collections::HashMap;

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
    let faces = scan.faces.counts.len() as u32;
    let mut used =
        UsedMaterials { materials: Vec::new(), names: Vec::new(), runs: Vec::new(), unknown: Vec::new() };
    let mut slot_of_content: HashMap<PartHash, u32> = HashMap::new();
    let mut slot_of_name: HashMap<&[u8], u32> = HashMap::new();
    let ends = scan.materials.iter().skip(1).map(|&(face, _)| face).chain([faces]);
    if faces > 0 && scan.materials.first().is_none_or(|&(face, _)| face > 0) {
        used.runs.push((0, ABSENT));
    }
    for (&(face, name), end) in scan.materials.iter().zip(ends) {
        if face == end {
            continue;
        }
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

/// Makes the parts. All indices must have been checked.
pub(super) fn geometry(
    scan: Scan,
    runs: Vec<(u32, u32)>,
    materials: Vec<Part<Material>>,
    smooth_angle_deg: Option<f32>,
) -> Geometry {
    let Scan { positions, mut colors, texcoords, normals, faces, objects, smoothing, .. } = scan;
    let FaceList { counts, positions: corners, texcoords: texcoord_corners, normals: normal_corners, .. } =
        faces;
    let order = Order::new(&positions, &counts, &corners);
    let triangles = order.gather(&corners);
    let starts = TriangleStarts::new(&counts);
    let meshes = meshes(&objects, &starts);
    let material_runs = runs.into_iter().map(|(face, slot)| [starts.at(face), slot]).collect();
    let given = order.gather(&normal_corners);
    let derived = if given.is_empty() || given.as_flattened().contains(&ABSENT) {
        derived_normals(&positions, &triangles, smooth_angle_deg, &smoothing, &starts)
    } else {
        None
    };
    if !colors.is_empty() {
        colors.resize(positions.len(), [f32::NAN; 3]);
    }
    let texcoord_corners = order.gather(&texcoord_corners);
    Geometry {
        positions: Part::new(Positions(compact(positions))),
        faces: Part::new(Faces { counts: compact(counts), corners: compact(corners) }),
        triangles: Part::new(Triangles(triangles)),
        texcoords: (!texcoord_corners.is_empty()).then(|| Attribute {
            values: Part::new(Texcoords(compact(texcoords))),
            corners: Part::new(Corners(texcoord_corners)),
        }),
        normals: shading_normals(normals, given, derived),
        colors: (!colors.is_empty()).then(|| Part::new(Colors(colors))),
        material_runs: Part::new(MaterialRuns(material_runs)),
        materials,
        meshes,
    }
}

/// Gives back what was reserved beyond need.
fn compact<T>(mut list: Vec<T>) -> Vec<T> {
    list.shrink_to_fit();
    list
}

/// Which corners, counted through the file, make each triangle.
enum Order {
    /// Three by three.
    AsWritten,
    /// These.
    Listed(Vec<[u32; 3]>),
}

impl Order {
    fn new(positions: &[[f32; 3]], counts: &[u32], corners: &[u32]) -> Self {
        if counts.iter().all(|&count| count == 3) {
            return Self::AsWritten;
        }
        let mut listed = Vec::with_capacity(corners.len() - 2 * counts.len());
        let mut first = 0;
        for &count in counts {
            let from = listed.len();
            triangulate(positions, &corners[first..first + count as usize], &mut listed);
            for triangle in &mut listed[from..] {
                *triangle = triangle.map(|corner| corner + first as u32);
            }
            first += count as usize;
        }
        Self::Listed(listed)
    }

    /// Of a list with one entry a corner those of the triangles; nothing of an empty list.
    fn gather(&self, list: &[u32]) -> Vec<[u32; 3]> {
        match self {
            _ if list.is_empty() => Vec::new(),
            Self::AsWritten => list.as_chunks::<3>().0.to_vec(),
            Self::Listed(order) => order.iter().map(|t| t.map(|corner| list[corner as usize])).collect(),
        }
    }
}

/// The first triangle of each face, and of one behind the last.
struct TriangleStarts(Vec<u32>);

impl TriangleStarts {
    fn new(counts: &[u32]) -> Self {
        let mut starts = Vec::with_capacity(counts.len() + 1);
        let mut next = 0;
        for &count in counts {
            starts.push(next);
            next += count - 2;
        }
        starts.push(next);
        Self(starts)
    }

    fn at(&self, face: u32) -> u32 {
        self.0[face as usize]
    }

    fn faces(&self) -> u32 {
        self.0.len() as u32 - 1
    }
}

fn meshes(objects: &[u32], starts: &TriangleStarts) -> Vec<Mesh> {
    let borders = if objects.len() > MAX_MESHES { &[] } else { objects };
    let firsts = std::iter::once(0).chain(borders.iter().copied());
    let ends = borders.iter().copied().chain([starts.faces()]);
    firsts
        .zip(ends)
        .filter(|(first, end)| first < end)
        .map(|(first, end)| Mesh {
            first_face: first,
            face_count: end - first,
            first_triangle: starts.at(first),
            triangle_count: starts.at(end) - starts.at(first),
        })
        .collect()
}

/// Normals from smoothing groups or by angle; None where all is flat.
fn derived_normals(
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
    smooth_angle_deg: Option<f32>,
    groups: &[(u32, u32)],
    starts: &TriangleStarts,
) -> Option<DerivedNormals> {
    if let Some(angle) = smooth_angle_deg {
        return Some(normals::derive(positions, triangles, Smoothing::AngleDeg(angle.into())));
    }
    if groups.iter().all(|&(_, group)| group == 0) {
        return None;
    }
    let mut of_triangles = vec![0; triangles.len()];
    let ends = groups.iter().skip(1).map(|&(face, _)| face).chain([starts.faces()]);
    for (&(first, group), end) in groups.iter().zip(ends) {
        of_triangles[starts.at(first) as usize..starts.at(end) as usize].fill(group);
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
