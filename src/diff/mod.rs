//! What changed between two frames, mesh by mesh, in the words of the report. Pure.
//!
//! Meshes are matched by their place (object, run of faces); names that files give never count.

use crate::scene::{
    Attribute, Frame, Geometry, Map, Material, Mesh, Normals, Object, Part, PartHash, Texcoords, Textures,
};
use std::collections::BTreeSet;

/// Counts of what changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Change {
    /// Meshes of which nothing differs.
    pub same: u32,
    /// Meshes moved by a transform of job or glTF only.
    pub rigid: u32,
    /// Meshes whose positions or attributes differ, their faces' position indices not.
    pub deformed: u32,
    /// Meshes whose faces' position indices differ.
    pub reshaped: u32,
    /// Meshes without a counterpart in the frame before.
    pub added: u32,
    /// Meshes without a counterpart in this frame.
    pub removed: u32,
    /// Materials that differ, came or went, and objects whose triangles are assigned otherwise.
    pub materials: u32,
    /// Textures that differ, came or went, each counted once however many materials use it.
    pub textures: u32,
}

/// Compares a frame with the one before; without one everything is added.
pub fn changes(before: Option<&Frame>, after: &Frame) -> Change {
    let none = Frame::default();
    let before = before.unwrap_or(&none);
    let mut change = Change { textures: texture_changes(before, after), ..Change::default() };
    for i in 0..before.objects.len().max(after.objects.len()) {
        match (before.objects.get(i), after.objects.get(i)) {
            (Some(a), Some(b)) => object_changes(a, b, &mut change),
            (Some(a), None) => change.removed += a.geometry.meshes.len() as u32,
            (None, Some(b)) => change.added += b.geometry.meshes.len() as u32,
            (None, None) => {}
        }
    }
    change
}

fn object_changes(a: &Object, b: &Object, change: &mut Change) {
    let moved = a.transform != b.transform;
    let (ga, gb) = (&*a.geometry, &*b.geometry);
    let meshes = ga.meshes.len().min(gb.meshes.len());
    for (ma, mb) in ga.meshes.iter().zip(&gb.meshes) {
        if !same_faces(ga, ma, gb, mb) {
            change.reshaped += 1;
        } else if !same_corners(ga, ma, gb, mb) {
            change.deformed += 1;
        } else if moved {
            change.rigid += 1;
        } else {
            change.same += 1;
        }
    }
    change.removed += (ga.meshes.len() - meshes) as u32;
    change.added += (gb.meshes.len() - meshes) as u32;
    material_changes(&ga.materials, &gb.materials, change);
    if ga.material_runs != gb.material_runs && change.reshaped + change.added + change.removed == 0 {
        change.materials += 1;
    }
}

/// Whether the faces as written have the same position indices.
fn same_faces(ga: &Geometry, ma: &Mesh, gb: &Geometry, mb: &Mesh) -> bool {
    if ga.faces == gb.faces && ma == mb {
        return true;
    }
    let (counts_a, corners_a) = mesh_faces(ga, ma);
    let (counts_b, corners_b) = mesh_faces(gb, mb);
    counts_a == counts_b && corners_a == corners_b
}

fn mesh_faces<'a>(g: &'a Geometry, m: &Mesh) -> (&'a [u32], &'a [u32]) {
    let faces = m.first_face as usize..(m.first_face + m.face_count) as usize;
    // n corners give n − 2 triangles, so a run's corners follow from its triangles and faces
    let first = (m.first_triangle + 2 * m.first_face) as usize;
    let count = (m.triangle_count + 2 * m.face_count) as usize;
    (&g.faces.counts[faces], &g.faces.corners[first..first + count])
}

/// Whether positions and attributes are the same at every corner; the faces are known to be.
fn same_corners(ga: &Geometry, ma: &Mesh, gb: &Geometry, mb: &Mesh) -> bool {
    let (_, corners) = mesh_faces(ga, ma);
    (ga.positions == gb.positions
        || corners.iter().all(|&i| bits(&ga.positions.0[i as usize]) == bits(&gb.positions.0[i as usize])))
        && (ga.triangles == gb.triangles || triangles(&ga.triangles.0, ma) == triangles(&gb.triangles.0, mb))
        && same_attribute::<Texcoords>(ga.texcoords.as_ref(), ma, gb.texcoords.as_ref(), mb)
        && same_attribute::<Normals>(ga.normals.as_ref(), ma, gb.normals.as_ref(), mb)
        && (ga.colors == gb.colors
            || match (&ga.colors, &gb.colors) {
                (Some(a), Some(b)) => {
                    corners.iter().all(|&i| bits(&a.0[i as usize]) == bits(&b.0[i as usize]))
                }
                _ => false,
            })
}

fn bits(v: &[f32; 3]) -> [u32; 3] {
    v.map(f32::to_bits)
}

fn triangles<'a>(all: &'a [[u32; 3]], m: &Mesh) -> &'a [[u32; 3]] {
    &all[m.first_triangle as usize..(m.first_triangle + m.triangle_count) as usize]
}

/// Whether an attribute has the same indices and the same values behind them.
fn same_attribute<T: AttributeValues>(
    a: Option<&Attribute<T>>,
    ma: &Mesh,
    b: Option<&Attribute<T>>,
    mb: &Mesh,
) -> bool {
    match (a, b) {
        (None, None) => true,
        (Some(a), Some(b)) => {
            let (ca, cb) = (triangles(&a.corners.0, ma), triangles(&b.corners.0, mb));
            ca == cb
                && (a.values == b.values
                    || ca.as_flattened().iter().all(|&i| a.values.at(i) == b.values.at(i)))
        }
        _ => false,
    }
}

/// Values of an attribute, compared by their bits.
trait AttributeValues {
    fn at(&self, index: u32) -> Option<[u32; 3]>;
}

impl AttributeValues for Normals {
    fn at(&self, index: u32) -> Option<[u32; 3]> {
        self.0.get(index as usize).map(bits)
    }
}

impl AttributeValues for Texcoords {
    fn at(&self, index: u32) -> Option<[u32; 3]> {
        self.0.get(index as usize).map(|v| bits(&[v[0], v[1], 0.0]))
    }
}

fn material_changes(a: &[Part<Material>], b: &[Part<Material>], change: &mut Change) {
    for i in 0..a.len().max(b.len()) {
        match (a.get(i), b.get(i)) {
            (Some(a), Some(b)) => {
                // what differs in textures alone is counted there, unless they only changed places
                let counted = change.textures > 0 && same_but_for_textures(a, b);
                change.materials += u32::from(a != b && !counted);
            }
            (Some(_), None) | (None, Some(_)) => change.materials += 1,
            (None, None) => {}
        }
    }
}

/// Whether constants and the ways in which maps are used are the same.
fn same_but_for_textures(a: &Material, b: &Material) -> bool {
    let constants = |m: &Material| Material { textures: Textures::default(), ..m.clone() };
    let same_use = |(a, b): (Option<&Map>, Option<&Map>)| match (a, b) {
        (Some(a), Some(b)) => Map { texture: a.texture.clone(), ..b.clone() } == *a,
        _ => true,
    };
    constants(a) == constants(b) && a.textures.slots().into_iter().zip(b.textures.slots()).all(same_use)
}

/// How many textures only one of the frames has; one that came for one that went counts once.
fn texture_changes(before: &Frame, after: &Frame) -> u32 {
    let of = |frame: &Frame| -> BTreeSet<PartHash> {
        frame.objects.iter().flat_map(|o| o.geometry.textures()).map(Part::hash).collect()
    };
    let (before, after) = (of(before), of(after));
    before.difference(&after).count().max(after.difference(&before).count()) as u32
}

#[cfg(test)]
mod tests;
