//! Animated glTF 2.0 (.gltf, .glb): nodes, clips, skins, morph targets, cameras and lights.
//!
//! A file is opened once ([`Gltf::open`]) and then shown at any time ([`Gltf::frame`]). Positions are worked out in
//! f64 and rounded once. What does not change from frame to frame is shared: a mesh that moves as a whole keeps its
//! parts and gets another transform, one that deforms keeps all but its positions and normals. Each index and length
//! in the file is checked here, the crate only reads its JSON.

mod accessor;
mod animate;
mod clip;
mod file;
mod light;
mod material;
mod mesh;
mod morph;
mod overlay;
mod picture;
mod pose;
mod skin;
#[cfg(test)]
mod tests;
mod uri;

use super::MaterialOverride;
use super::error::FormatError;
use crate::math::{Bounds, DAffine3, DVec3};
use crate::scene::{Attribute, Geometry, Light, Normals, Object, Part, Positions};
use crate::warning::Warnings;
use clip::Clip;
use file::File;
use material::Materials;
use mesh::Shape;
use morph::{morph, wide};
use picture::Pictures;
use pose::{Nodes, Pose};
use skin::{Skin, skinned};
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

pub use clip::ClipChoice;
pub(super) use file::named_files;
pub use light::NamedCamera;

/// What is wrong with a file and what to do, to stand behind its name.
#[derive(Debug)]
struct Cause(String);

impl Cause {
    /// Something in the file is not as the format wants it.
    fn broken(text: impl AsRef<str>) -> Self {
        Self(format!("{}; export it again", text.as_ref()))
    }

    fn at(self, path: &Path) -> FormatError {
        FormatError::BadGltf { path: path.to_path_buf(), cause: self.0 }
    }
}

/// How a file is opened.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GltfOptions {
    /// Normals are smoothed over triangles within this angle, degrees, where the file gives none; None: they are flat.
    pub smooth_angle_deg: Option<f32>,
    /// Statements for materials by name that are laid over the file's; maps are not.
    pub material_overrides: Vec<MaterialOverride>,
    /// The most bytes that its textures may take together, mip levels included; None: any.
    pub texture_limit_bytes: Option<u64>,
}

/// What a file shows at one time.
#[derive(Clone, Debug)]
pub struct GltfFrame {
    /// Its meshes in the order of a walk through the scene. The geometry of one that did not change is that of the
    /// last frame.
    pub objects: Vec<Object>,
    /// Its perspective cameras.
    pub cameras: Vec<NamedCamera>,
    /// Its lights.
    pub lights: Vec<Light>,
}

/// The length of a file's animation.
#[derive(Clone, Debug, PartialEq)]
pub struct GltfClips {
    /// The names of all clips; the place of one without a name.
    pub names: Vec<String>,
    /// The greatest time of the keys of those that play, seconds; 0 where none does.
    pub duration_s: f64,
    /// Where clips that animate the same leave some out: which.
    pub left_out: Option<String>,
}

/// What is shown of a file.
#[derive(Debug)]
struct Content {
    clips: Vec<Clip>,
    nodes: Nodes,
    /// Meshes by their places in the file, those that are shown.
    shapes: HashMap<usize, Shape>,
    /// Skins by their places in the file, those that are used.
    skins: HashMap<usize, Skin>,
}

/// A mesh in a pose.
#[derive(Debug)]
struct Deformed {
    /// The bits of all matrices and weights.
    pose: Vec<u64>,
    geometry: Arc<Geometry>,
}

/// A glTF file in memory.
#[derive(Debug)]
pub struct Gltf {
    file: File,
    content: Content,
    /// For each node that deforms its last pose.
    deformed: Mutex<HashMap<usize, Deformed>>,
    /// What is wrong but does not stop a frame, and what is not mapped, each once.
    pub warnings: Warnings,
    /// Images that were named and cannot be had, each as a sentence.
    pub missing: Vec<String>,
    /// Names of materials that the options' overrides speak of and no mesh has.
    pub unmet_overrides: Vec<Vec<u8>>,
    /// Every file whose content it is made of.
    pub inputs: Vec<PathBuf>,
    /// Bytes that were read.
    pub bytes_read: u64,
}

/// Whether a file's name is that of a glTF.
pub fn is_gltf(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gltf") || e.eq_ignore_ascii_case("glb"))
}

/// What clips a file has, and how long those that are chosen are; meshes and images are not looked at.
///
/// # Errors
/// Where the file cannot be read or has no such clip.
pub fn gltf_clips(path: &Path, choice: &ClipChoice) -> Result<GltfClips, FormatError> {
    let file = File::open(path)?;
    let clips = clip::clips(&file, &mut Warnings::default()).map_err(|cause| cause.at(path))?;
    let chosen = clip::chosen(&clips, choice).map_err(|cause| cause.at(path))?;
    let left_out = (*choice == ClipChoice::Auto && chosen.len() < clips.len()).then(|| {
        let others: Vec<String> = clips.iter().skip(1).map(|clip| format!("`{}`", clip.name)).collect();
        format!(
            "its clips animate the same: `{}` plays, not {} (--clip NAME or all)",
            clips[0].name,
            others.join(", ")
        )
    });
    let names = clips.iter().map(|clip| clip.name.clone()).collect();
    Ok(GltfClips { names, duration_s: clip::duration_s(&clips, &chosen), left_out })
}

impl Gltf {
    /// Reads a file and all that it refers to.
    ///
    /// # Errors
    /// Where it cannot be read, is broken, requires an extension that is not known, or its textures are beyond the
    /// limit.
    pub fn open(path: &Path, options: &GltfOptions) -> Result<Self, FormatError> {
        Self::new(File::open(path)?, options)
    }

    /// The same from memory; other files that it names are relative to `path`.
    pub fn from_bytes(bytes: &[u8], path: &Path, options: &GltfOptions) -> Result<Self, FormatError> {
        Self::new(File::from_bytes(bytes, path)?, options)
    }

    fn new(file: File, options: &GltfOptions) -> Result<Self, FormatError> {
        let mut warnings = Warnings::default();
        let pictures = Pictures::with_limit(options.texture_limit_bytes.unwrap_or(u64::MAX));
        let mut materials = Materials::new(pictures, overlay::overlays(&options.material_overrides)?);
        let read = Self::read(&file, options, &mut materials, &mut warnings);
        materials.pictures.within_limit(&file)?;
        let content = read.map_err(|cause| cause.at(&file.path))?;
        for name in file::idle_extensions(&file.root) {
            warnings.add(Some(&file.path), None, format!("the extension {name} is not mapped"));
        }
        light::check(&file, &mut warnings);
        let unmet_overrides = materials.unmet_overrides();
        let Materials { pictures, .. } = materials;
        Ok(Self {
            unmet_overrides,
            inputs: file.inputs.iter().cloned().chain(pictures.inputs).collect(),
            bytes_read: file.bytes_read + pictures.bytes_read,
            missing: pictures.missing,
            file,
            content,
            deformed: Mutex::default(),
            warnings,
        })
    }

    fn read(
        file: &File,
        options: &GltfOptions,
        materials: &mut Materials,
        warnings: &mut Warnings,
    ) -> Result<Content, Cause> {
        let clips = clip::clips(file, warnings)?;
        let nodes = Nodes::read(file, &clips)?;
        let (mut shapes, mut skins) = (HashMap::new(), HashMap::new());
        for &i in &nodes.shown {
            let node = &file.root.nodes[i];
            let Some(mesh) = node.mesh.map(|mesh| mesh.value()) else { continue };
            let shape = match shapes.entry(mesh) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(new) => {
                    new.insert(mesh::shape(file, mesh, materials, options.smooth_angle_deg, warnings)?)
                }
            };
            let Some(skin) = node.skin.map(|skin| skin.value()) else { continue };
            let joints = match skins.entry(skin) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(new) => new.insert(skin::skin(file, skin)?),
            }
            .joints();
            match &shape.influences {
                None => {
                    warnings.add(Some(&file.path), None, "a skinned mesh names no joints and stands still");
                }
                Some(influences) => {
                    if influences.list.iter().any(|&(joint, _)| joint as usize >= joints) {
                        let text = format!("mesh {mesh} names joints that skin {skin} does not have");
                        return Err(Cause::broken(text));
                    }
                }
            }
        }
        Ok(Content { clips, nodes, shapes, skins })
    }

    fn chosen(&self, choice: &ClipChoice) -> Result<Vec<usize>, FormatError> {
        clip::chosen(&self.content.clips, choice).map_err(|cause| cause.at(&self.file.path))
    }

    /// What is shown at a time, seconds.
    ///
    /// # Errors
    /// Where there is no such clip, or a vertex that is used goes where no f32 does.
    pub fn frame(&self, time_s: f64, choice: &ClipChoice) -> Result<GltfFrame, FormatError> {
        let chosen = self.chosen(choice)?;
        let pose = self.content.nodes.pose(time_s, chosen.iter().map(|&i| &self.content.clips[i]));
        let mut frame = GltfFrame { objects: Vec::new(), cameras: Vec::new(), lights: Vec::new() };
        for &i in &self.content.nodes.shown {
            let (node, world) = (&self.file.root.nodes[i], &pose.worlds[i]);
            frame.lights.extend(light::light(&self.file, node, world));
            frame.cameras.extend(light::camera(&self.file, node, world));
            if let Some(object) = self.object(i, &pose).map_err(|cause| cause.at(&self.file.path))? {
                frame.objects.push(object);
            }
        }
        Ok(frame)
    }

    /// The box of all vertices at a time, seconds, in the world.
    pub fn bounds(&self, time_s: f64, choice: &ClipChoice) -> Result<Bounds, FormatError> {
        let mut bounds = Bounds::EMPTY;
        for object in self.frame(time_s, choice)?.objects {
            for p in &object.geometry.positions.0 {
                let p = object.transform.map_or(wide(*p), |world| world.transform_point3(wide(*p)));
                if p.is_finite() {
                    bounds.add(p);
                }
            }
        }
        Ok(bounds)
    }

    /// The mesh at a node; None where it has none.
    fn object(&self, i: usize, pose: &Pose) -> Result<Option<Object>, Cause> {
        let node = &self.file.root.nodes[i];
        let Some((mesh, shape)) =
            node.mesh.and_then(|m| Some((m.value(), self.content.shapes.get(&m.value())?)))
        else {
            return Ok(None);
        };
        let skin = node.skin.and_then(|skin| self.content.skins.get(&skin.value()));
        let bones = skin.zip(shape.influences.as_ref());
        let transform = (self.content.nodes.is_placed[i] && bones.is_none()).then(|| pose.worlds[i]);
        if transform.is_some_and(|world| !world.is_finite()) {
            return Err(Cause(format!("node {i} is moved beyond all numbers")));
        }
        if bones.is_none() && shape.targets.is_empty() {
            return Ok(Some(Object { geometry: Arc::clone(&shape.geometry), transform }));
        }
        let own = || node.weights.as_ref().map(|w| w.iter().map(|&w| f64::from(w)).collect());
        let weights = pose.weights.get(&i).cloned().or_else(own).unwrap_or_else(|| shape.weights.clone());
        let matrices = bones.map(|(skin, _)| skin.matrices(&pose.worlds)).unwrap_or_default();
        let numbers = matrices.iter().flat_map(DAffine3::to_cols_array).chain(weights.iter().copied());
        let bits: Vec<u64> = numbers.map(f64::to_bits).collect();
        {
            let held = self.deformed.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(known) = held.get(&i).filter(|known| known.pose == bits) {
                return Ok(Some(Object { geometry: Arc::clone(&known.geometry), transform }));
            }
        }
        let geometry =
            deform(shape, &weights, bones.map(|(_, influences)| (influences, matrices.as_slice())))
                .ok_or_else(|| {
                    Cause(format!("mesh {mesh} has vertices that are moved beyond all numbers"))
                })?;
        let geometry = Arc::new(geometry);
        let mut held = self.deformed.lock().unwrap_or_else(PoisonError::into_inner);
        held.insert(i, Deformed { pose: bits, geometry: Arc::clone(&geometry) });
        Ok(Some(Object { geometry, transform }))
    }
}

/// A mesh as morph targets and joints move it; None where a vertex is used and no longer finite.
fn deform(
    shape: &Shape,
    weights: &[f64],
    bones: Option<(&mesh::Influences, &[DAffine3])>,
) -> Option<Geometry> {
    let rest = &shape.geometry;
    let vertices = rest.positions.0.len();
    let mut positions = morph(&rest.positions.0, &shape.targets, weights, |target| &target.positions);
    let mut normals = rest
        .normals
        .as_ref()
        .map(|n| morph(&n.values.0, &shape.targets, weights, |target| &target.normals))
        .unwrap_or_default();
    if let Some((influences, matrices)) = bones {
        skinned(&mut positions, &mut normals, influences, matrices);
    }
    let positions: Vec<[f32; 3]> = positions.into_iter().map(|p| p.as_vec3().to_array()).collect();
    debug_assert_eq!(positions.len(), vertices);
    let is_used_finite = |&corner: &u32| positions[corner as usize].iter().all(|x| x.is_finite());
    if !rest.triangles.0.as_flattened().iter().all(is_used_finite) {
        return None;
    }
    let turned = rest.normals.as_ref().map(|n| Attribute {
        values: Part::new(Normals(normals.iter().map(unit).collect())),
        corners: n.corners.clone(),
    });
    Some(Geometry { positions: Part::new(Positions(positions)), normals: turned, ..(**rest).clone() })
}

/// A unit normal; (0, 0, 0) where there is no direction, as if absent.
fn unit(n: &DVec3) -> [f32; 3] {
    n.normalize_or_zero().as_vec3().to_array()
}
