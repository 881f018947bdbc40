//! What must be known of whole sequences before their first picture: auto cameras and auto lights.

use super::RunOptions;
use super::read::read_options;
use super::source::Sources;
use crate::format;
use crate::job::{Background, Job, LightChoice, Picture, Sequence, auto};
use crate::math::{Bounds, DVec3};
use crate::scene::{self, Camera, Light, Object, Part, Shot, Texture};
use crate::warning::Warnings;
use rayon::prelude::*;
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
        sources: Sources::new(options.memory_bytes, options.store_of_run()),
        warnings: job.warnings.clone(),
    };
    for (i, sequence) in job.sequences.iter().enumerate() {
        let pictures = || job.pictures.iter().filter(|p| p.sequence == i);
        let auto_light = pictures().any(|p| p.settings.lights == LightChoice::Auto);
        let auto_camera =
            pictures().chain([&sequence.first]).any(|p| p.settings.camera_at(p.frame).is_none());
        if pictures().next().is_none() {
            continue;
        }
        if auto_camera {
            prepared.sequences[i].bounds = Some(bounds(sequence, &mut prepared.warnings));
        }
        if auto_light {
            let camera = prepared.camera(&sequence.first);
            let objects = first_objects(sequence, options, &prepared.sources);
            prepared.sequences[i].light = Some(auto::light(&camera, auto::glow(&objects)));
        }
    }
    prepared
}

impl Prepared {
    /// The shot of a picture.
    pub(super) fn shot(&self, picture: &Picture) -> Result<Shot, String> {
        let lights = match &picture.settings.lights {
            LightChoice::Given(lights) => lights.clone(),
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
        Ok(picture.settings.shot(self.camera(picture), lights, background))
    }

    fn camera(&self, picture: &Picture) -> Camera {
        let bounds = || self.sequences[picture.sequence].bounds.unwrap_or(Bounds::EMPTY);
        picture
            .settings
            .camera_at(picture.frame)
            .unwrap_or_else(|| auto::camera(&bounds(), &picture.settings))
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

/// The box of a sequence's layers over the frames that are looked at; files are scanned on all cores. What cannot be
/// read is left out and said.
fn bounds(sequence: &Sequence, warnings: &mut Warnings) -> Bounds {
    let files: Vec<_> =
        sequence.layers.iter().flat_map(|l| auto::scanned(l).map(move |i| (l, &l.files[i]))).collect();
    let boxes: Vec<_> =
        files.par_iter().map(|(layer, file)| (*layer, file, format::scan_bounds(&file.path))).collect();
    let mut all = Bounds::EMPTY;
    for (layer, file, bounds) in boxes {
        match bounds {
            Ok(b) => all.merge(&auto::placed(layer, &b)),
            Err(error) => {
                warnings.add(Some(&file.path), None, format!("left out of the auto camera's box: {error}"));
            }
        }
    }
    all
}

/// What stands in a sequence's first picture; layers that cannot be read are left out (their frames fail when their
/// turn comes).
fn first_objects(sequence: &Sequence, options: &RunOptions, sources: &Sources) -> Vec<Object> {
    let mut objects = Vec::new();
    for source in &sequence.first.sources {
        let layer = &sequence.layers[source.layer];
        let Some(file) = source.file.map(|i| &layer.files[i]) else { continue };
        let read = read_options(&sequence.first, layer.materials.as_deref(), options.lenient);
        if let Ok(loaded) = sources.ahead(&file.path, &read) {
            objects.push(Object { geometry: Arc::clone(&loaded.geometry), transform: source.transform });
        }
    }
    objects
}
