//! What is looked at before the first frame, so that nothing is lost, and after the last, so that success is never
//! claimed for a picture that is not there.

use super::event::{FrameReport, Status};
use super::report::Report;
use super::{RunError, RunOptions};
use crate::format;
use crate::job::Job;
use crate::output::Records;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Refuses to write over inputs, and over files that no record names.
pub(super) fn nothing_is_lost(job: &Job, records: &Records, options: &RunOptions) -> Result<(), RunError> {
    let there: Vec<PathBuf> = job
        .pictures
        .iter()
        .map(|p| p.picture.as_path())
        .filter(|p| job.folder.join(p).symlink_metadata().is_ok())
        .map(Path::to_path_buf)
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
        let sequence = &job.sequences[picture.sequence];
        for source in &picture.sources {
            let Some(file) = source.file else { continue };
            let layer = &sequence.layers[source.layer];
            for named in format::named_files(&layer.files[file].path, layer.materials.as_deref()) {
                files.extend(real(&named));
            }
        }
    }
    files
}

fn real(path: &Path) -> Option<PathBuf> {
    path.canonicalize().ok()
}

/// Turns frames whose pictures are not there any more into failed ones and returns them.
pub(super) fn pictures_gone(job: &Job, report: &mut Report) -> Vec<FrameReport> {
    let mut gone = Vec::new();
    for frame in report.frames.iter_mut().filter(|f| f.status != Status::Failed) {
        let path = job.folder.join(&job.pictures[frame.index].picture);
        if !path.is_file() {
            frame.status = Status::Failed;
            frame.error =
                Some(format!("{}: was written and is gone; render the frame again", path.display()));
            gone.push(frame.clone());
        }
    }
    gone
}
