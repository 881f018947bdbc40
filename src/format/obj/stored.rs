//! What was made of an OBJ in the store: its lists as they stand in memory, what it says of materials, what is wrong
//! with it. Materials are read anew each time, so that they are not in it. Parts are named anew by what is read, and what
//! an index may name is looked at again: no entry can do harm.

use super::mesh::{self, Known};
use super::scan::{Kind, Run, Scan};
use super::{LineOf, Lines, ParsedObj, Shape, tell_of_unknown, warn_if_invisible};
use crate::format::ReadOptions;
use crate::format::library::Library;
use crate::scene::{
    Attribute, Colors, Content, Corners, Faces, Geometry, Normals, Part, PartHash, PartHasher, Positions,
    Texcoords, Triangles,
};
use crate::store::{Key, Payload, Store};
use crate::warning::Warnings;
use bytemuck::Pod;
use std::path::Path;
use std::sync::Arc;

/// Another name for each form in which OBJs are kept, or in which they are read.
const KIND: &str = "obj-2";

/// How many lists an entry has.
const LISTS: usize = 18;
/// Stands for the length of a list that is the same as another.
const SAME: u64 = u64::MAX;

/// What an OBJ says beside its shape, and what is wrong with it.
pub(in crate::format) struct Said<'t> {
    libraries: Vec<&'t [u8]>,
    materials: Vec<(u32, &'t [u8])>,
    warnings: Warnings,
}

impl<'a> Lines<'a> {
    /// What is said, with what was warned of so far.
    pub(in crate::format) fn said(&self, warnings: &Warnings) -> Said<'a> {
        Said {
            libraries: self.scan.libraries.clone(),
            materials: self.scan.materials.clone(),
            warnings: warnings.clone(),
        }
    }
}

/// The name of what becomes of a file with that digest, and whether it must serve the next frame.
pub(in crate::format) fn key(digest: (PartHash, u64), is_followed: bool, options: &ReadOptions) -> Key {
    let mut h = PartHasher::new(KIND);
    h.bytes(env!("CARGO_PKG_VERSION").as_bytes());
    h.u64(u64::from(is_followed) | u64::from(options.lenient) << 1);
    h.u64(options.smooth_angle_deg.map_or(0, |angle| 1 | u64::from(angle.to_bits()) << 1));
    h.part(digest.0);
    h.u64(digest.1);
    Key(h.finish().0)
}

/// Puts what was made of an OBJ.
pub(in crate::format) fn put(store: &Store, key: Key, said: &Said, shape: &Shape, is_followed: bool) {
    let g = &shape.parsed.geometry;
    let warnings = said.warnings.list();
    let words: Vec<&[u8]> = said
        .libraries
        .iter()
        .copied()
        .chain(said.materials.iter().map(|&(_, name)| name))
        .chain(warnings.iter().map(|w| w.text.as_bytes()))
        .collect();
    let lengths: Vec<u32> = words.iter().map(|word| word.len() as u32).collect();
    let words = words.concat();
    let material_faces: Vec<u32> = said.materials.iter().map(|&(face, _)| face).collect();
    // lines count from 1
    let lines: Vec<u32> = warnings.iter().map(|w| w.line.unwrap_or(0)).collect();
    let counts: Vec<u64> = warnings.iter().map(|w| w.count).collect();
    let first_faces: Vec<u32> = g.meshes.iter().map(|m| m.first_face).collect();
    let threes = vec![3; g.triangles.0.len()];
    let texcoords = g.texcoords.as_ref().map_or((&[][..], &[][..]), |t| (&t.values.0, &t.corners.0));
    let normals = g.normals.as_ref().map_or((&[][..], &[][..]), |n| (&n.values.0, &n.corners.0));
    let known = shape.known.as_ref().filter(|_| is_followed);
    let runs: Vec<[u32; 6]> = known.map_or(&[][..], |known| &known.runs).iter().map(words_of).collect();
    let raw = |of: fn(&Known) -> &Arc<Vec<u32>>| known.map_or(&[][..], |known| of(known));

    let mut lists = Lists::default();
    lists.add(&lengths);
    lists.add(&words);
    lists.add(&material_faces);
    lists.add(&lines);
    lists.add(&counts);
    lists.add(&g.positions.0);
    lists.add(&g.triangles.0);
    lists.add_or_same(&g.faces.counts, &threes);
    lists.add_or_same(&g.faces.corners, g.triangles.0.as_flattened());
    lists.add(&first_faces);
    lists.add(texcoords.0);
    lists.add(texcoords.1);
    lists.add(normals.0);
    lists.add(normals.1);
    lists.add(g.colors.as_ref().map_or(&[][..], |c| &c.0));
    lists.add(&runs);
    lists.add_or_same(raw(|known| &known.texcoords), texcoords.1.as_flattened());
    lists.add_or_same(raw(|known| &known.normals), normals.1.as_flattened());
    lists.put(store, key);
}

/// Lists to be put.
#[derive(Default)]
struct Lists<'a> {
    lengths: Vec<u64>,
    lists: Vec<&'a [u8]>,
}

impl<'a> Lists<'a> {
    fn add<T: Pod>(&mut self, list: &'a [T]) {
        self.lengths.push(list.len() as u64);
        self.lists.push(bytemuck::cast_slice(list));
    }

    fn add_or_same(&mut self, list: &'a [u32], other: &[u32]) {
        if list == other {
            self.lengths.push(SAME);
        } else {
            self.add(list);
        }
    }

    fn put(&self, store: &Store, key: Key) {
        debug_assert_eq!(self.lengths.len(), LISTS, "as many as are read");
        let mut payload = vec![bytemuck::cast_slice(&self.lengths)];
        payload.extend(&self.lists);
        store.put(KIND, key, &payload);
    }
}

/// Takes the lists in turn.
struct Taken<'p> {
    payload: &'p mut Payload,
    lengths: std::vec::IntoIter<u64>,
}

impl Taken<'_> {
    fn list<T: Pod>(&mut self) -> Option<Vec<T>> {
        let length = self.lengths.next()?;
        self.payload.values(usize::try_from(length).ok()?)
    }

    fn list_or_same(&mut self, other: impl FnOnce() -> Vec<u32>) -> Option<Vec<u32>> {
        if self.lengths.as_slice().first() == Some(&SAME) {
            self.lengths.next();
            return Some(other());
        }
        self.list()
    }
}

/// What was made of an OBJ.
pub(in crate::format) struct StoredObj {
    libraries: Vec<Vec<u8>>,
    materials: Vec<(u32, Vec<u8>)>,
    warnings: Vec<(String, u32, u64)>,
    positions: Vec<[f32; 3]>,
    faces: Faces,
    triangles: Vec<[u32; 3]>,
    first_faces: Vec<u32>,
    texcoords: (Vec<[f32; 2]>, Vec<[u32; 3]>),
    normals: (Vec<[f32; 3]>, Vec<[u32; 3]>),
    colors: Vec<[f32; 3]>,
    runs: Vec<Run>,
    raw_texcoords: Vec<u32>,
    raw_normals: Vec<u32>,
}

/// What was put; None where the store has nothing, or nothing that can be true of a file of that length.
pub(in crate::format) fn get(store: &Store, key: Key, file_bytes: u64) -> Option<StoredObj> {
    store.get(KIND, key, taken).filter(|stored| stored.is_sound(file_bytes))
}

fn taken(payload: &mut Payload) -> Option<StoredObj> {
    let lengths = payload.values::<u64>(LISTS)?.into_iter();
    let mut lists = Taken { payload, lengths };
    let lengths: Vec<u32> = lists.list()?;
    let words: Vec<u8> = lists.list()?;
    let material_faces: Vec<u32> = lists.list()?;
    let lines: Vec<u32> = lists.list()?;
    let counts: Vec<u64> = lists.list()?;
    let mut rest = &words[..];
    let mut word = |length: u32| {
        let (word, behind) = rest.split_at_checked(length as usize)?;
        rest = behind;
        Some(word.to_vec())
    };
    let words: Vec<Vec<u8>> = lengths.into_iter().map(&mut word).collect::<Option<_>>()?;
    let library_count = words.len().checked_sub(material_faces.len())?.checked_sub(lines.len())?;
    let mut words = words.into_iter();
    let libraries = words.by_ref().take(library_count).collect();
    let materials = material_faces.into_iter().zip(words.by_ref()).collect();
    let warnings = words
        .zip(lines.into_iter().zip(counts))
        .map(|(text, (line, count))| Some((String::from_utf8(text).ok()?, line, count)))
        .collect::<Option<_>>()?;

    let positions = lists.list()?;
    let triangles: Vec<[u32; 3]> = lists.list()?;
    let counts = lists.list_or_same(|| vec![3; triangles.len()])?;
    let corners = lists.list_or_same(|| triangles.as_flattened().to_vec())?;
    let first_faces = lists.list()?;
    let texcoords: (_, Vec<[u32; 3]>) = (lists.list()?, lists.list()?);
    let normals: (_, Vec<[u32; 3]>) = (lists.list()?, lists.list()?);
    let colors = lists.list()?;
    let runs = lists.list()?.into_iter().map(run_of).collect::<Option<_>>()?;
    let raw_texcoords = lists.list_or_same(|| texcoords.1.as_flattened().to_vec())?;
    let raw_normals = lists.list_or_same(|| normals.1.as_flattened().to_vec())?;
    let faces = Faces { counts, corners };
    (payload.left() == 0).then_some(StoredObj {
        libraries,
        materials,
        warnings,
        positions,
        faces,
        triangles,
        first_faces,
        texcoords,
        normals,
        colors,
        runs,
        raw_texcoords,
        raw_normals,
    })
}

fn words_of(run: &Run) -> [u32; 6] {
    let [positions, texcoords, normals] = run.so_far;
    // files are of 2^31 bytes at most
    [run.start, run.end, positions, texcoords, normals, usize::from(run.kind == Kind::Faces)]
        .map(|x| x as u32)
}

fn run_of(words: [u32; 6]) -> Option<Run> {
    let [start, end, positions, texcoords, normals, kind] = words.map(|x| x as usize);
    let kind = [Kind::Texcoords, Kind::Faces].get(kind).copied()?;
    Some(Run { kind, start, end, so_far: [positions, texcoords, normals] })
}

impl StoredObj {
    /// Whether all lists are as long as the others say, and all indices within them.
    fn is_sound(&self, file_bytes: u64) -> bool {
        let Faces { counts, corners } = &self.faces;
        let triangles = self.triangles.len();
        let sum: u64 = counts.iter().map(|&count| u64::from(count)).sum();
        let are_indices = |list: &[u32], length: usize, absent: bool| {
            // one look at all of them: ABSENT becomes 0 where it is allowed
            let shift = u32::from(absent);
            let end = list.iter().map(|index| index.wrapping_add(shift)).max();
            end.is_none_or(|end| (end as usize) < length + shift as usize)
        };
        let attribute = |corners: &[[u32; 3]], values: usize| {
            corners.is_empty()
                || (corners.len() == triangles && are_indices(corners.as_flattened(), values, true))
        };
        let raw = |list: &[u32], values: usize| {
            list.is_empty() || (list.len() == corners.len() && are_indices(list, values, true))
        };
        let is_face = |face: u32| face as usize <= counts.len();
        let is_run = |run: &Run| {
            run.start < run.end
                && run.end as u64 <= file_bytes
                && run.so_far.iter().all(|&count| count as u64 <= file_bytes)
        };
        counts.iter().all(|&count| count >= 3)
            && sum == corners.len() as u64
            && triangles == corners.len() - 2 * counts.len()
            && are_indices(corners, self.positions.len(), false)
            && are_indices(self.triangles.as_flattened(), self.positions.len(), false)
            && attribute(&self.texcoords.1, self.texcoords.0.len())
            && attribute(&self.normals.1, self.normals.0.len())
            && (self.colors.is_empty() || self.colors.len() == self.positions.len())
            && self.materials.is_sorted_by_key(|&(face, _)| face)
            && self.materials.last().is_none_or(|&(last, _)| is_face(last))
            && self.first_faces.is_sorted()
            && self.first_faces.last().is_none_or(|&last| is_face(last))
            && self.first_faces.first().is_none_or(|&first| first == 0)
            && self.first_faces.is_empty() == counts.is_empty()
            && self.runs.iter().all(is_run)
            && self.runs.is_sorted_by(|a, b| a.end <= b.start)
            && raw(&self.raw_texcoords, self.texcoords.0.len())
            // what reads the next frame looks at their indices
            && [0, corners.len()].contains(&self.raw_normals.len())
    }

    /// What stands behind each `mtllib`.
    pub(in crate::format) fn libraries(&self) -> Vec<&[u8]> {
        self.libraries.iter().map(Vec::as_slice).collect()
    }

    /// The names of materials that faces have.
    pub(in crate::format) fn used_materials(&self) -> impl Iterator<Item = &[u8]> {
        scan_of(&self.materials, &self.faces)
            .material_runs()
            .map(|(_, name)| name)
            .collect::<Vec<_>>()
            .into_iter()
    }

    /// What is wrong with the file.
    pub(in crate::format) fn warnings(&self, path: &Path) -> Warnings {
        let mut warnings = Warnings::default();
        for (text, line, count) in &self.warnings {
            warnings.add_times(Some(path), (*line > 0).then_some(*line), text.clone(), *count);
        }
        warnings
    }

    /// Makes the shape.
    pub(in crate::format) fn into_shape(
        self,
        library: &Library,
        path: &Path,
        line_of: LineOf<'_>,
        warnings: &mut Warnings,
    ) -> Shape {
        let used = mesh::materials(&scan_of(&self.materials, &self.faces), library);
        let missing = tell_of_unknown(&used, library, path, line_of, warnings);
        let counts = &self.faces.counts;
        let borders = self.first_faces.get(1..).unwrap_or_default();
        let geometry = Geometry {
            material_runs: Part::new(mesh::material_runs(used.runs, counts)),
            meshes: mesh::meshes(borders, counts),
            positions: Part::new(Positions(self.positions)),
            triangles: Part::new(Triangles(self.triangles)),
            texcoords: attribute(self.texcoords, Texcoords),
            normals: attribute(self.normals, Normals),
            colors: (!self.colors.is_empty()).then(|| Part::new(Colors(self.colors))),
            faces: Part::new(self.faces),
            materials: used.materials,
        };
        warn_if_invisible(&geometry, path, warnings);
        let known = (!self.runs.is_empty()).then(|| Known {
            runs: self.runs,
            texcoords: Arc::new(self.raw_texcoords),
            normals: Arc::new(self.raw_normals),
        });
        Shape { parsed: ParsedObj { geometry, material_names: used.names }, known, missing }
    }
}

/// What those who give materials slots look at.
fn scan_of<'a>(materials: &'a [(u32, Vec<u8>)], faces: &Faces) -> Scan<'a> {
    Scan {
        face_count: faces.counts.len() as u32,
        materials: materials.iter().map(|(face, name)| (*face, &name[..])).collect(),
        ..Scan::default()
    }
}

fn attribute<V, T: Content>(lists: (Vec<V>, Vec<[u32; 3]>), part: fn(Vec<V>) -> T) -> Option<Attribute<T>> {
    let (values, corners) = lists;
    (!corners.is_empty())
        .then(|| Attribute { values: Part::new(part(values)), corners: Part::new(Corners(corners)) })
}

#[cfg(test)]
mod tests;
