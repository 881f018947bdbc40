//! A job whose sequence is still growing: which of its pictures can be made, and a camera that stays where it is.

use crate::format::{self, FormatError};
use crate::job::auto;
use crate::job::track::{CameraPose, CameraTrack, Interpolation, Key};
use crate::job::{CameraChoice, Job, Sequence, Settings};
use crate::math::Bounds;
use std::collections::HashSet;
use std::ffi::OsString;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::panic::catch_unwind;
use std::path::Path;
use std::sync::Arc;

/// How much wider than the first frame's box that of a sequence that is followed is, on every side, of its diagonal
/// (CONTRACT 5).
const ENLARGED: f64 = 0.5;

/// Whether a job can be followed: one layer of OBJ files, each picture shows one of them.
pub(super) fn can_follow(job: &Job) -> bool {
    let is_plain = |s: &Sequence| s.layers.len() == 1 && s.layers[0].files.iter().all(|f| f.moment.is_none());
    job.sequences.iter().all(is_plain)
}

/// Keeps the pictures that show those files.
pub(super) fn keep(job: &mut Job, only: &HashSet<OsString>) {
    let sequences = &job.sequences;
    job.pictures.retain(|p| {
        p.sources
            .iter()
            .filter_map(|s| sequences[p.sequence].layers[s.layer].files.get(s.file?))
            .all(|file| file.path.file_name().is_some_and(|name| only.contains(name)))
    });
}

/// Puts the camera of each sequence that has none of its own where its first frame says.
pub(super) fn fix_cameras(job: &mut Job) -> Result<(), FormatError> {
    for at in 0..job.sequences.len() {
        let sequence = &job.sequences[at];
        let pictures = job.pictures.iter().filter(|p| p.sequence == at);
        if !pictures.chain([&sequence.first]).any(|p| p.settings.camera == CameraChoice::Auto) {
            continue;
        }
        let bounds = first_bounds(sequence)?;
        let fixed = |settings: &mut Arc<Settings>| {
            if settings.camera == CameraChoice::Auto {
                let camera = auto::camera_around(&bounds, settings, ENLARGED);
                let value = CameraPose { eye: camera.eye, look_at: camera.look_at, up: None, fov_deg: None };
                let keys = vec![Key { frame: 0, value }];
                let track = CameraTrack { keys, interpolation: Interpolation::Linear };
                Arc::make_mut(settings).camera = CameraChoice::Given(track);
            }
        };
        fixed(&mut job.sequences[at].first.settings);
        job.pictures.iter_mut().filter(|p| p.sequence == at).for_each(|p| fixed(&mut p.settings));
    }
    Ok(())
}

/// The box of a sequence's first frame on disk.
fn first_bounds(sequence: &Sequence) -> Result<Bounds, FormatError> {
    let mut all = Bounds::EMPTY;
    for layer in &sequence.layers {
        if let Some(file) = layer.files.first() {
            all.merge(&auto::placed(layer, &format::scan_bounds(&file.path)?));
        }
    }
    Ok(all)
}

/// Whether a frame's file ends with a newline and parses to its end.
pub(super) fn ends_whole(path: &Path) -> bool {
    // what makes the parser panic is for the run to tell of
    let parses = || catch_unwind(|| format::check_obj(path)).is_ok_and(|checked| checked.is_ok());
    ends_with_newline(path).unwrap_or(false) && parses()
}

fn ends_with_newline(path: &Path) -> std::io::Result<bool> {
    let mut file = File::open(path)?;
    if file.seek(SeekFrom::End(0))? == 0 {
        return Ok(false);
    }
    file.seek(SeekFrom::End(-1))?;
    let mut last = [0];
    file.read_exact(&mut last)?;
    Ok(last[0] == b'\n')
}
