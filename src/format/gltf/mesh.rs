//! Meshes: the primitives of one become one [`Geometry`].

use super::file::File;
use super::material::{self, Materials};
use super::{Cause, accessor};
use crate::math::srgb_from_linear;
use crate::scene::normals::{self, Smoothing};
use crate::scene::{
    ABSENT, Attribute, Colors, Corners, Faces, Geometry, Material, MaterialRuns, Mesh, Normals, Part,
    PartHash, Positions, Texcoords, Triangles,
};
use crate::warning::Warnings;
use gltf::json;
use gltf::json::accessor::Type;
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use std::collections::HashMap;
use std::sync::Arc;

/// The most vertices and the most triangles of a mesh: all indices fit 32 bits with room to spare.
const MAX_COUNT: usize = 1 << 28;

/// A mesh as the file gives it.
#[derive(Debug)]
pub(super) struct Shape {
    /// Without morphs and skin.
    pub geometry: Arc<Geometry>,
    /// What morph targets add.
    pub targets: Vec<Target>,
    /// Weights of the targets, where no node or clip gives any.
    pub weights: Vec<f64>,
    /// Which joints move which vertex; None where no primitive says so.
    pub influences: Option<Influences>,
}

/// What a morph target adds to each vertex; empty where it adds nothing.
#[derive(Debug, Default)]
pub(super) struct Target {
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
}

/// Joints and their weights, vertex by vertex.
#[derive(Debug, Default)]
pub(super) struct Influences {
    /// For each vertex the end of its part of `list`, which starts where that of the one before ends.
    pub ends: Vec<u32>,
    /// Places in the skin's list of joints, and weights, whose sum is 1.
    pub list: Vec<(u32, f64)>,
}

/// Reads an attribute of one of those types that has an element for each vertex.
type VertexList<'a> = &'a dyn Fn(json::Index<json::Accessor>, &[Type]) -> Result<accessor::Numbers, Cause>;

/// A mesh that grows by its primitives.
#[derive(Default)]
struct Growing {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    texcoords: Vec<[f32; 2]>,
    colors: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    texcoord_corners: Vec<[u32; 3]>,
    normal_corners: Vec<[u32; 3]>,
    runs: Vec<[u32; 2]>,
    materials: Vec<Part<Material>>,
    slots: HashMap<PartHash, u32>,
    targets: Vec<Target>,
    influences: Influences,
    has: Has,
}

/// Which attributes any primitive has.
#[derive(Default)]
#[allow(clippy::struct_excessive_bools, reason = "one for each attribute")]
struct Has {
    normals: bool,
    texcoords: bool,
    colors: bool,
    influences: bool,
}

/// Reads a mesh. Normals are smoothed within an angle where it has none and one is given.
pub(super) fn shape(
    file: &File,
    index: usize,
    materials: &mut Materials,
    smooth_angle_deg: Option<f32>,
    warnings: &mut Warnings,
) -> Result<Shape, Cause> {
    let mesh = file
        .root
        .meshes
        .get(index)
        .ok_or_else(|| Cause::broken(format!("mesh {index} is named and is not there")))?;
    let mut growing = Growing::default();
    for (i, primitive) in mesh.primitives.iter().enumerate() {
        let what = format!("mesh {index}, primitive {i}");
        growing.add(file, primitive, &what, materials, warnings)?;
    }
    let weights = mesh.weights.iter().flatten().map(|&w| f64::from(w)).collect();
    Ok(growing.into_shape(weights, smooth_angle_deg))
}

impl Growing {
    fn add(
        &mut self,
        file: &File,
        primitive: &Primitive,
        what: &str,
        materials: &mut Materials,
        warnings: &mut Warnings,
    ) -> Result<(), Cause> {
        let mode = match primitive.mode {
            Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
            Checked::Valid(_) => {
                warnings.add(Some(&file.path), None, "points and lines are not rendered");
                return Ok(());
            }
            Checked::Invalid => return Err(Cause::broken(format!("{what} has an unknown mode"))),
        };
        let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let Some(positions) = attribute(Semantic::Positions) else {
            warnings.add(Some(&file.path), None, "a primitive without positions is left out");
            return Ok(());
        };
        let positions = accessor::numbers(file, positions, &[Type::Vec3], what)?.arrays::<3>();
        let (first, count) = (self.positions.len(), positions.len());
        let list = match primitive.indices {
            Some(indices) => accessor::indices(file, indices, what)?,
            None => (0..count as u32).collect(),
        };
        if first + count > MAX_COUNT || self.triangles.len() + list.len() > MAX_COUNT {
            return Err(Cause(format!(
                "{what} makes more than {MAX_COUNT} vertices or triangles; split the mesh"
            )));
        }
        if mode == Mode::Triangles && list.len() % 3 != 0 {
            let text = "a primitive's corners are no multiple of 3; those left over are dropped";
            warnings.add(Some(&file.path), None, text);
        }
        if let Some(bad) = list.iter().find(|&&corner| corner as usize >= count) {
            return Err(Cause::broken(format!("{what} names vertex {bad} of {count}")));
        }
        if let Some(bad) = list.iter().find(|&&c| positions[c as usize].iter().any(|x| !x.is_finite())) {
            return Err(Cause::broken(format!("{what}: vertex {bad} is not finite")));
        }
        let triangles = triangles(&list, mode, first as u32);
        let vertex_list = |index, types: &[Type]| -> Result<accessor::Numbers, Cause> {
            let read = accessor::numbers(file, index, types, what)?;
            if read.count() == count {
                return Ok(read);
            }
            Err(Cause::broken(format!(
                "{what}: an attribute has {} elements for {count} vertices",
                read.count()
            )))
        };

        let given = attribute(Semantic::Normals).map(|i| vertex_list(i, &[Type::Vec3])).transpose()?;
        let given = given.map(|n| n.arrays::<3>());
        self.normal_corners.extend(corners(&triangles, given.is_some(), |corner| {
            let n = given.as_ref().map_or([0.0; 3], |n| n[corner as usize - first]);
            let squared: f64 = n.iter().map(|&x| f64::from(x) * f64::from(x)).sum();
            squared > 0.0 && squared.is_finite()
        }));
        self.has.normals |= given.is_some();
        append(&mut self.normals, given, first, count, [0.0; 3]);

        let given = attribute(Semantic::TexCoords(0)).map(|i| vertex_list(i, &[Type::Vec2])).transpose()?;
        let turn = primitive.material.and_then(|index| material::turn(file, index.value()));
        let given = given.map(|t| texcoords(&t, turn.as_ref()));
        self.texcoord_corners.extend(corners(&triangles, given.is_some(), |corner| {
            given.as_ref().is_some_and(|t| t[corner as usize - first].iter().all(|x| x.is_finite()))
        }));
        self.has.texcoords |= given.is_some();
        append(&mut self.texcoords, given, first, count, [0.0; 2]);

        self.add_colors(file, primitive, first, count, &vertex_list, warnings)?;
        self.add_influences(primitive, count, &vertex_list)?;
        for (k, target) in primitive.targets.iter().flatten().enumerate() {
            if self.targets.len() <= k {
                self.targets.push(Target::default());
            }
            let read = |index: Option<_>| -> Result<Option<Vec<[f32; 3]>>, Cause> {
                index.map(|i| vertex_list(i, &[Type::Vec3]).map(|n| n.arrays::<3>())).transpose()
            };
            let (moves, turns) = (read(target.positions)?, read(target.normals)?);
            let target = &mut self.targets[k];
            append_given(&mut target.positions, moves, first, count);
            append_given(&mut target.normals, turns, first, count);
        }
        self.positions.extend(positions);

        if !triangles.is_empty() {
            let slot = match primitive.material {
                None => ABSENT,
                Some(index) => self.slot(materials.get(file, index.value(), warnings)?),
            };
            if self.runs.last().is_none_or(|run| run[1] != slot) {
                self.runs.push([self.triangles.len() as u32, slot]);
            }
        }
        self.triangles.extend(triangles);
        Ok(())
    }

    fn slot(&mut self, material: Part<Material>) -> u32 {
        *self.slots.entry(material.hash()).or_insert_with(|| {
            self.materials.push(material);
            self.materials.len() as u32 - 1
        })
    }

    /// Colours are seen where there is no material.
    fn add_colors(
        &mut self,
        file: &File,
        primitive: &Primitive,
        first: usize,
        count: usize,
        vertex_list: VertexList<'_>,
        warnings: &mut Warnings,
    ) -> Result<(), Cause> {
        let Some(&index) = primitive.attributes.get(&Checked::Valid(Semantic::Colors(0))) else {
            append(&mut self.colors, None, first, count, [f32::NAN; 3]);
            return Ok(());
        };
        if primitive.material.is_some() {
            let text = "vertex colours (COLOR_0) of primitives with a material are not mapped";
            warnings.add(Some(&file.path), None, text);
            append(&mut self.colors, None, first, count, [f32::NAN; 3]);
            return Ok(());
        }
        let read = vertex_list(index, &[Type::Vec3, Type::Vec4])?;
        let colors = read.values.chunks_exact(read.width).map(|c| {
            // ours are on the sRGB curve, glTF's linear
            [c[0], c[1], c[2]].map(|x| srgb_from_linear(x.clamp(0.0, 1.0)) as f32)
        });
        self.has.colors = true;
        append(&mut self.colors, Some(colors.collect()), first, count, [f32::NAN; 3]);
        Ok(())
    }

    fn add_influences(
        &mut self,
        primitive: &Primitive,
        count: usize,
        vertex_list: VertexList<'_>,
    ) -> Result<(), Cause> {
        let mut sets = Vec::new();
        for set in 0..u32::MAX {
            let attribute = |s| primitive.attributes.get(&Checked::Valid(s)).copied();
            let (Some(joints), Some(weights)) =
                (attribute(Semantic::Joints(set)), attribute(Semantic::Weights(set)))
            else {
                break;
            };
            sets.push((vertex_list(joints, &[Type::Vec4])?, vertex_list(weights, &[Type::Vec4])?));
        }
        self.has.influences |= !sets.is_empty();
        for vertex in 0..count {
            let start = self.influences.list.len();
            for (joints, weights) in &sets {
                let part = 4 * vertex..4 * vertex + 4;
                for (&joint, &weight) in joints.values[part.clone()].iter().zip(&weights.values[part]) {
                    if weight > 0.0 && weight.is_finite() {
                        self.influences.list.push((joint as u32, weight));
                    }
                }
            }
            let own = &mut self.influences.list[start..];
            let sum: f64 = own.iter().map(|(_, weight)| weight).sum();
            for (_, weight) in own {
                *weight /= sum;
            }
            self.influences.ends.push(self.influences.list.len() as u32);
        }
        Ok(())
    }

    fn into_shape(mut self, weights: Vec<f64>, smooth_angle_deg: Option<f32>) -> Shape {
        let vertices = self.positions.len();
        for target in &mut self.targets {
            // those of the last primitives may have had none
            for list in [&mut target.positions, &mut target.normals] {
                if !list.is_empty() {
                    list.resize(vertices, [0.0; 3]);
                }
            }
        }
        if let Some(angle) = smooth_angle_deg
            && self.normal_corners.as_flattened().contains(&ABSENT)
        {
            let smooth = Smoothing::AngleDeg(angle.into());
            let derived = normals::derive(&self.positions, &self.triangles, smooth);
            let first = self.normals.len() as u32;
            self.normals.extend(derived.values);
            let own = derived.corners.as_flattened();
            for (corner, &own) in self.normal_corners.as_flattened_mut().iter_mut().zip(own) {
                if *corner == ABSENT && own != ABSENT {
                    *corner = first + own;
                }
            }
            self.has.normals = true;
        }
        let triangle_count = self.triangles.len() as u32;
        let meshes = [Mesh { first_face: 0, face_count: triangle_count, first_triangle: 0, triangle_count }];
        let faces =
            Faces { counts: vec![3; self.triangles.len()], corners: self.triangles.as_flattened().to_vec() };
        let any = |corners: &[[u32; 3]]| corners.as_flattened().iter().any(|&corner| corner != ABSENT);
        let geometry = Geometry {
            positions: Part::new(Positions(self.positions)),
            faces: Part::new(faces),
            triangles: Part::new(Triangles(self.triangles)),
            texcoords: (self.has.texcoords && any(&self.texcoord_corners)).then(|| Attribute {
                values: Part::new(Texcoords(self.texcoords)),
                corners: Part::new(Corners(self.texcoord_corners)),
            }),
            normals: (self.has.normals && any(&self.normal_corners)).then(|| Attribute {
                values: Part::new(Normals(self.normals)),
                corners: Part::new(Corners(self.normal_corners)),
            }),
            colors: self.has.colors.then(|| Part::new(Colors(self.colors))),
            material_runs: Part::new(MaterialRuns(self.runs)),
            materials: self.materials,
            meshes: if triangle_count > 0 { meshes.to_vec() } else { Vec::new() },
        };
        Shape {
            geometry: Arc::new(geometry),
            targets: self.targets,
            weights,
            influences: self.has.influences.then_some(self.influences),
        }
    }
}

/// Appends what is given, or as many of `absent`, so that the list has one a vertex.
fn append<T: Copy>(list: &mut Vec<T>, given: Option<Vec<T>>, first: usize, count: usize, absent: T) {
    list.resize(first, absent);
    match given {
        Some(given) => list.extend(given),
        None => list.resize(first + count, absent),
    }
}

/// Appends what is given; a list that nothing was ever given to stays empty.
fn append_given(list: &mut Vec<[f32; 3]>, given: Option<Vec<[f32; 3]>>, first: usize, count: usize) {
    if given.is_some() || !list.is_empty() {
        append(list, given, first, count, [0.0; 3]);
    }
}

/// The indices of an attribute that has one value a vertex: those of the positions, where the value can be used.
fn corners(triangles: &[[u32; 3]], given: bool, is_usable: impl Fn(u32) -> bool) -> Vec<[u32; 3]> {
    let own = |corner: u32| if given && is_usable(corner) { corner } else { ABSENT };
    triangles.iter().map(|triangle| triangle.map(own)).collect()
}

/// Texture coordinates, turned where all maps are (`KHR_texture_transform`: scale, rotation, offset), v running up.
fn texcoords(given: &accessor::Numbers, turn: Option<&TextureTransform>) -> Vec<[f32; 2]> {
    let angle = turn.map_or(0.0, |turn| f64::from(turn.rotation.0));
    let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
    let [su, sv] = turn.map_or([1.0; 2], |turn| turn.scale.0.map(f64::from));
    let [ou, ov] = turn.map_or([0.0; 2], |turn| turn.offset.0.map(f64::from));
    let turned = |&[u, v]: &[f64; 2]| {
        let (u, v) = (u * su, v * sv);
        [cosine * u + sine * v + ou, cosine * v - sine * u + ov]
    };
    let pairs = given.values.as_chunks::<2>().0.iter();
    pairs.map(turned).map(|[u, v]| [u as f32, (1.0 - v) as f32]).collect()
}

/// Triangles of a list, a strip or a fan (glTF 2.0, 3.7.2.1), moved by `first`.
fn triangles(list: &[u32], mode: Mode, first: u32) -> Vec<[u32; 3]> {
    let at = |i: usize| list[i] + first;
    let fitting = list.len().saturating_sub(2);
    match mode {
        Mode::TriangleStrip => (0..fitting).map(|i| [at(i), at(i + 1 + i % 2), at(i + 2 - i % 2)]).collect(),
        Mode::TriangleFan => (0..fitting).map(|i| [at(i + 1), at(i + 2), at(0)]).collect(),
        _ => list.as_chunks::<3>().0.iter().map(|t| t.map(|corner| corner + first)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_strips_and_fans() {
        let list = [5, 6, 7, 8, 9];
        assert_eq!(triangles(&list, Mode::Triangles, 1), [[6, 7, 8]]);
        assert_eq!(triangles(&list, Mode::TriangleStrip, 0), [[5, 6, 7], [6, 8, 7], [7, 8, 9]]);
        assert_eq!(triangles(&list, Mode::TriangleFan, 0), [[6, 7, 5], [7, 8, 5], [8, 9, 5]]);
        for mode in [Mode::Triangles, Mode::TriangleStrip, Mode::TriangleFan] {
            assert!(triangles(&[1, 2], mode, 0).is_empty());
        }
    }

    #[test]
    fn texture_coordinates_turn() {
        // (1, 0) twice as large, a quarter turn, moved: (cos · 2 + 0.5, −sin · 2 + 0.25), and 1 − v
        let turn = TextureTransform {
            rotation: json::extensions::texture::TextureTransformRotation(std::f32::consts::FRAC_PI_2),
            scale: json::extensions::texture::TextureTransformScale([2.0, 2.0]),
            offset: json::extensions::texture::TextureTransformOffset([0.5, 0.25]),
            ..TextureTransform::default()
        };
        let given = accessor::Numbers { width: 2, values: vec![1.0, 0.0] };
        let [u, v] = texcoords(&given, Some(&turn))[0];
        assert!((u - 0.5).abs() < 1e-6 && (v - 2.75).abs() < 1e-6, "{u} {v}");
        assert_eq!(texcoords(&given, None), [[1.0, 1.0]]);
    }

    #[test]
    fn attributes_keep_their_places() {
        let mut list = vec![];
        append_given(&mut list, None, 0, 2);
        assert!(list.is_empty());
        append_given(&mut list, Some(vec![[1.0; 3]]), 2, 1);
        append_given(&mut list, None, 3, 1);
        assert_eq!(list, [[0.0; 3], [0.0; 3], [1.0; 3], [0.0; 3]]);
    }
}
