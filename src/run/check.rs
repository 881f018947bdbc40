//! What is looked at before the first frame, so that nothing is lost, and after the last, so that success is never
//! claimed for a picture that is not there.

use super::event::{FrameReport, Status};
use super::read::{encoding, read_options};
use super::report::Report;
use super::{RunError, RunOptions};
use crate::format;
use crate::job::{Background, Job, Picture};
use crate::output::{Records, file_names};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Refuses to write over inputs, and over files that no record names.
pub(super) fn nothing_is_lost(job: &Job, records: &Records, options: &RunOptions) -> Result<(), RunError> {
    let there: Vec<PathBuf> = job
        .pictures
        .iter()
        .flat_map(files_of)
        .filter(|p| job.folder.join(p).symlink_metadata().is_ok())
        .collect();
    if there.is_empty() {
        return Ok(());
    }
    if !options.overwrite
        && let Some(foreign) = there.iter().find(|p| !records.names(p))
    {
        return Err(RunError::Foreign(job.folder.join(foreign)));
    }
    let inputs = input_files(job);
    match there.iter().map(|p| job.folder.join(p)).find(|p| real(p).is_some_and(|r| inputs.contains(&r))) {
        Some(input) => Err(RunError::OverInput(input)),
        None => Ok(()),
    }
}

/// Every file that the job reads, by its real path.
fn input_files(job: &Job) -> HashSet<PathBuf> {
    let mut files: HashSet<PathBuf> = job.inputs.iter().filter_map(|p| real(p)).collect();
    for picture in &job.pictures {
        if let Background::File(file) = &picture.settings.background {
            files.extend(real(file));
        }
        let sequence = &job.sequences[picture.sequence];
        for source in &picture.sources {
            let Some(file) = source.file else { continue };
            let layer = &sequence.layers[source.layer];
            let read = read_options(picture, layer.materials.as_deref(), false);
            for named in format::named_files(&layer.files[file].path, &read) {
                files.extend(real(&named));
            }
        }
    }
    files
}

/// The files of a picture, relative to the output folder.
pub fn files_of(picture: &Picture) -> Vec<PathBuf> {
    let s = &picture.settings;
    file_names(&picture.picture, encoding(s).format, s.aovs)
}

fn real(path: &Path) -> Option<PathBuf> {
    path.canonicalize().ok()
}

/// Frames that no device took, for whatever reason: success is never claimed for what is not there.
pub(super) fn left_over(
    job: &Job,
    report: &Report,
    blank: impl Fn(usize) -> Box<FrameReport>,
) -> Vec<FrameReport> {
    let mut has_ended = vec![false; job.pictures.len()];
    for (index, _) in &report.ended {
        has_ended[*index as usize] = true;
    }
    let left = (0..has_ended.len()).filter(|&index| !has_ended[index]);
    let failed = |index| {
        let mut frame = *blank(index);
        frame.error = Some(format!("{}: no device took the frame; render it again", frame.source));
        frame.device_failed = true;
        frame
    };
    left.map(failed).collect()
}

/// Turns frames whose pictures are not there any more into failed ones and returns them. `blank` gives the report of one
/// that is not kept.
pub(super) fn pictures_gone(
    job: &Job,
    report: &mut Report,
    blank: impl Fn(usize) -> Box<FrameReport>,
) -> Vec<FrameReport> {
    let mut gone = Vec::new();
    for (index, status) in report.ended.iter_mut().filter(|(_, status)| *status != Status::Failed) {
        let index = *index as usize;
        let files = files_of(&job.pictures[index]);
        let Some(path) = files.iter().map(|f| job.folder.join(f)).find(|f| !f.is_file()) else { continue };
        let error = format!("{}: was written and is gone; render the frame again", path.display());
        *status = Status::Failed;
        let place = report.frames.iter().position(|f| f.index == index).unwrap_or_else(|| {
            report.frames.push(*blank(index));
            report.frames.len() - 1
        });
        let frame = &mut report.frames[place];
        frame.status = Status::Failed;
        frame.error = Some(error);
        gone.push(frame.clone());
    }
    gone
}
