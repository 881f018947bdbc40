//! Frames of glTF files: each file is opened once and shown at many times.

use super::source::{Stamp, stamp};
use crate::clock::Stopwatch;
use crate::format::{FormatError, Gltf, GltfOptions, NamedCamera, ReadOptions};
use crate::job::Moment;
use crate::math::{DAffine3, DVec3, Vec3};
use crate::scene::{Camera, Light, Object};
use crate::warning::Warnings;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// So many files are kept open, those used last.
const KEPT_FILES: usize = 8;

/// Cameras and lights that stand in a frame's files.
#[derive(Clone, Debug, Default)]
pub(super) struct Views {
    pub(super) cameras: Vec<NamedCamera>,
    pub(super) lights: Vec<Light>,
}

impl Views {
    /// The camera of that name, or at the node of that name; an error says which there are.
    pub(super) fn camera(&self, name: &str) -> Result<Camera, String> {
        let is_named = |c: &&NamedCamera| c.name == name;
        let is_at = |c: &&NamedCamera| c.node.as_deref() == Some(name);
        let found = self.cameras.iter().find(is_named).or_else(|| self.cameras.iter().find(is_at));
        found.map(|c| c.camera).ok_or_else(|| {
            let names: Vec<String> = self.cameras.iter().map(|c| format!("`{}`", c.name)).collect();
            let names = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            format!("there is no glTF camera `{name}` in this frame; there are {names}")
        })
    }
}

/// glTF files that are open.
#[derive(Default)]
pub(super) struct Animations {
    kept: Mutex<Vec<Kept>>,
    texture_limit_bytes: Option<u64>,
}

struct Kept {
    path: PathBuf,
    stamp: Stamp,
    options: GltfOptions,
    gltf: Arc<Gltf>,
    /// Whether a picture has used it, so that its costs are told already.
    used: bool,
}

/// What a file gives to a frame.
pub(super) struct Shown {
    pub(super) objects: Vec<Object>,
    pub(super) views: Views,
    pub(super) gltf: Arc<Gltf>,
    /// Whether this is the first picture that uses the file.
    pub(super) is_first: bool,
    pub(super) parse_ms: f64,
}

impl Animations {
    pub(super) fn with_limit(texture_limit_bytes: Option<u64>) -> Self {
        Self { texture_limit_bytes, ..Self::default() }
    }

    /// Opens a file, or gives the one that is open if the file's size and time are the same. Must not be called from
    /// a thread of rayon's pool: textures are decoded there while others wait. The flag tells whether no picture has
    /// used it yet; `uses` makes this the first.
    pub(super) fn open(
        &self,
        path: &Path,
        options: &ReadOptions,
        uses: bool,
    ) -> Result<(Arc<Gltf>, bool), FormatError> {
        let options = GltfOptions {
            smooth_angle_deg: options.smooth_angle_deg,
            material_overrides: options.material_overrides.clone(),
            texture_limit_bytes: self.texture_limit_bytes,
        };
        let stamp = stamp(path);
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let known = kept.iter().position(|k| k.path == path && k.stamp == stamp && k.options == options);
        let mut file = match known {
            Some(at) => kept.remove(at),
            None => Kept {
                path: path.to_path_buf(),
                stamp,
                gltf: Arc::new(Gltf::open(path, &options)?),
                options,
                used: false,
            },
        };
        let found = (Arc::clone(&file.gltf), !file.used);
        file.used |= uses;
        kept.insert(0, file);
        kept.truncate(KEPT_FILES);
        Ok(found)
    }

    /// What a file shows, moved by its layer's transform.
    pub(super) fn show(
        &self,
        path: &Path,
        moment: &Moment,
        options: &ReadOptions,
        layer: Option<&DAffine3>,
        uses: bool,
    ) -> Result<Shown, FormatError> {
        let watch = Stopwatch::start();
        let (gltf, is_first) = self.open(path, options, uses)?;
        let frame = gltf.frame(moment.time_s, &moment.clip)?;
        let mut shown = Shown {
            objects: frame.objects,
            views: Views { cameras: frame.cameras, lights: frame.lights },
            gltf,
            is_first,
            parse_ms: watch.ms(),
        };
        if let Some(layer) = layer {
            for object in &mut shown.objects {
                object.transform = Some(object.transform.map_or(*layer, |own| *layer * own));
            }
            shown.views.lights.iter_mut().for_each(|light| place_light(light, layer));
            for NamedCamera { camera, .. } in &mut shown.views.cameras {
                camera.eye = layer.transform_point3(camera.eye);
                camera.look_at = layer.transform_point3(camera.look_at);
                camera.up = layer.transform_vector3(camera.up);
            }
        }
        Ok(shown)
    }
}

fn place_light(light: &mut Light, layer: &DAffine3) {
    let point = |p: &mut Vec3| *p = layer.transform_point3(p.as_dvec3()).as_vec3();
    let turn = |d: &mut Vec3| {
        *d = layer.transform_vector3(d.as_dvec3()).normalize_or(DVec3::NEG_Z).as_vec3();
    };
    match light {
        Light::Point { position, .. } => point(position),
        Light::Directional { direction, .. } => turn(direction),
        Light::Spot { position, direction, .. } => {
            point(position);
            turn(direction);
        }
        Light::Area { .. } => {}
    }
}

/// What is told of a file when the first picture uses it, but for what is told another way.
pub(super) fn tell(
    gltf: &Gltf,
    path: &Path,
    options: &ReadOptions,
    told: Option<&String>,
    warnings: &mut Warnings,
) {
    match told {
        Some(told) => warnings.merge(&gltf.warnings.without(told)),
        None => warnings.merge(&gltf.warnings),
    };
    if options.materials_file.is_some() {
        warnings.add(Some(path), None, "a layer's MTL is not laid over the materials of a glTF");
    }
}
