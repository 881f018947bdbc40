//! What must be known of whole sequences before their first picture: auto cameras and auto lights.

use super::RunOptions;
use super::animation::Views;
use super::boxes;
use super::read::read_options;
use super::source::{Place, Sources};
use crate::format;
use crate::job::{Background, CameraChoice, Job, LightChoice, Picture, Sequence, auto};
use crate::math::{Bounds, DVec3};
use crate::scene::{self, Camera, Light, Object, Part, Shot, Texture};
use crate::warning::Warnings;
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

/// What was found out of each sequence, by its place in the job.
pub(super) struct Prepared {
    sequences: Vec<Found>,
    /// Background pictures, or why there is none.
    backgrounds: HashMap<PathBuf, Result<Part<Texture>, String>>,
    pub(super) sources: Sources,
    pub(super) warnings: Warnings,
}

#[derive(Default)]
struct Found {
    bounds: Option<Bounds>,
    light: Option<Light>,
}

/// Looks at those sequences of which pictures are asked for.
pub(super) fn prepare(job: &Job, options: &RunOptions) -> Prepared {
    let mut prepared = Prepared {
        sequences: job.sequences.iter().map(|_| Found::default()).collect(),
        backgrounds: backgrounds(job),
        sources: Sources::new(options.memory_bytes, options.store_of_run(), options.cold),
        warnings: job.warnings.clone(),
    };
    for (i, sequence) in job.sequences.iter().enumerate() {
        let pictures = || job.pictures.iter().filter(|p| p.sequence == i);
        let auto_light = pictures().any(|p| p.settings.lights == LightChoice::Auto);
        let auto_camera =
            pictures().chain([&sequence.first]).any(|p| p.settings.camera == CameraChoice::Auto);
        if pictures().next().is_none() {
            continue;
        }
        if auto_camera {
            let (animations, store) = (&prepared.sources.animations, options.store_of_run());
            let bounds = boxes::bounds(sequence, animations, store.as_deref(), &mut prepared.warnings);
            prepared.sequences[i].bounds = Some(bounds);
        }
        if auto_light {
            let (objects, views) = first_objects(sequence, options, &prepared.sources);
            // where there is no such camera the frames fail when their turn comes
            if let Ok(camera) = prepared.camera(&sequence.first, &views) {
                prepared.sequences[i].light = Some(auto::light(&camera, auto::glow(&objects)));
            }
        }
    }
    prepared
}

impl Prepared {
    /// The shot of a picture in whose files those cameras and lights stand.
    pub(super) fn shot(&self, picture: &Picture, views: &Views) -> Result<Shot, String> {
        let lights = match &picture.settings.lights {
            LightChoice::Given(lights) => lights.clone(),
            LightChoice::Auto if !views.lights.is_empty() => views.lights.clone(),
            LightChoice::Auto => self.sequences[picture.sequence].light.into_iter().collect(),
        };
        let background = match &picture.settings.background {
            Background::Color(color) => scene::Background::Color(*color),
            Background::File(path) => {
                let read =
                    self.backgrounds.get(path).ok_or_else(|| format!("{}: was not read", path.display()))?;
                scene::Background::Picture {
                    texture: read.clone()?,
                    is_z_up: picture.settings.up == DVec3::Z,
                }
            }
        };
        Ok(picture.settings.shot(self.camera(picture, views)?, lights, background))
    }

    fn camera(&self, picture: &Picture, views: &Views) -> Result<Camera, String> {
        if let CameraChoice::Gltf { name, fov_deg } = &picture.settings.camera {
            let mut camera = views.camera(name)?;
            camera.fov_deg = fov_deg.unwrap_or(camera.fov_deg);
            return Ok(camera);
        }
        let bounds = || self.sequences[picture.sequence].bounds.unwrap_or(Bounds::EMPTY);
        let given = picture.settings.camera_at(picture.frame);
        Ok(given.unwrap_or_else(|| auto::camera(&bounds(), &picture.settings)))
    }
}

/// The background pictures of a job, each read once.
fn backgrounds(job: &Job) -> HashMap<PathBuf, Result<Part<Texture>, String>> {
    let mut read = HashMap::new();
    for picture in &job.pictures {
        if let Background::File(path) = &picture.settings.background {
            let load = || format::load_picture(path).map_err(|e| format!("{e}; the frame is not rendered"));
            read.entry(path.clone()).or_insert_with(load);
        }
    }
    read
}

/// What stands in a sequence's first picture; layers that cannot be read are left out (their frames fail when their
/// turn comes).
fn first_objects(sequence: &Sequence, options: &RunOptions, sources: &Sources) -> (Vec<Object>, Views) {
    let (mut objects, mut views) = (Vec::new(), Views::default());
    for source in &sequence.first.sources {
        let layer = &sequence.layers[source.layer];
        let Some(file) = source.file.map(|i| &layer.files[i]) else { continue };
        let read = read_options(&sequence.first, layer.materials.as_deref(), options.lenient);
        if let Some(moment) = &file.moment {
            let layer = source.transform.as_ref();
            if let Ok(shown) = sources.animations.show(&file.path, moment, &read, layer, false) {
                objects.extend(shown.objects);
                views.cameras.extend(shown.views.cameras);
                views.lights.extend(shown.views.lights);
            }
            continue;
        }
        let place = if layer.files.len() == 1 { Place::Only } else { Place::First };
        if let Ok(loaded) = sources.ahead(&file.path, &read, place) {
            objects.push(Object { geometry: Arc::clone(&loaded.geometry), transform: source.transform });
        }
    }
    (objects, views)
}
