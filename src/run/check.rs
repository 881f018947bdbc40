//! What is looked at before the first frame, so that nothing is lost, and after the last, so that success is never
//! claimed for a picture that is not there.

use super::event::{FrameReport, Status};
use super::read::{encoding, read_options};
use super::report::{MARK as REPORT, Report};
use super::{RunError, RunOptions};
use crate::device::Stop;
use crate::format;
use crate::job::{Background, Job, Picture};
use crate::output::{self, Records, file_names};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// All that is looked at before the first frame; the records of earlier runs.
pub(super) fn before(job: &Job, options: &RunOptions, stop: &Stop) -> Result<Records, RunError> {
    if job.folder.exists() && !job.folder.is_dir() {
        return Err(RunError::NoFolder(job.folder.clone()));
    }
    let records = Records::read(&job.folder)?;
    nothing_is_lost(job, &records, options)?;
    each_has_its_place(job)?;
    background_is_there(job)?;
    if let Some(file) = &options.report
        && let Some(why) = part_of_job(job, file, REPORT)
    {
        return Err(RunError::ReportPlace { file: file.clone(), why });
    }
    if !stop.asked() {
        can_be_written(job, &records, options)?;
    }
    Ok(records)
}

/// Refuses to write over inputs, and over files that no record names.
fn nothing_is_lost(job: &Job, records: &Records, options: &RunOptions) -> Result<(), RunError> {
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

/// Makes the output folder; refuses one where nothing can be written, unless all pictures are there.
fn can_be_written(job: &Job, records: &Records, options: &RunOptions) -> Result<(), RunError> {
    let is_there = |p: PathBuf| records.names(&p) && job.folder.join(p).is_file();
    let are_there = job.pictures.iter().all(|picture| files_of(picture).into_iter().all(is_there));
    if are_there && (!options.overwrite || job.pictures.is_empty()) {
        return Ok(());
    }
    Ok(output::make_writable(&job.folder)?)
}

/// Refuses auxiliary pictures that would take the place of others; pictures were found to differ when the job was read.
fn each_has_its_place(job: &Job) -> Result<(), RunError> {
    if job.pictures.iter().all(|picture| picture.settings.aovs.is_empty()) {
        return Ok(());
    }
    let mut places = HashSet::new();
    match job.pictures.iter().flat_map(files_of).find(|file| !places.insert(file.clone())) {
        Some(file) => Err(RunError::Twice(job.folder.join(file))),
        None => Ok(()),
    }
}

/// Refuses a background that none of the frames will have.
fn background_is_there(job: &Job) -> Result<(), RunError> {
    let missing = |picture: &Picture| match &picture.settings.background {
        Background::File(file) if !file.is_file() => Some(file.clone()),
        _ => None,
    };
    let mut files = job.pictures.iter().map(missing);
    match files.next().flatten() {
        Some(file) if files.all(|file| file.is_some()) => Err(RunError::Background(file)),
        _ => Ok(()),
    }
}

/// What of a job a file is that something else than a picture is to be written to, where it is a part of it. One that has the
/// mark was written by a run.
pub(super) fn part_of_job(job: &Job, file: &Path, mark: &str) -> Option<&'static str> {
    let place = place(file);
    let is_place =
        |p: PathBuf| p.file_name() == file.file_name() && self::place(&job.folder.join(p)) == place;
    if job.pictures.iter().flat_map(files_of).any(is_place) {
        return Some("a picture of this job goes there");
    }
    let is_input = file.exists() && !output::has_mark(file, mark) && input_files(job).contains(&place);
    is_input.then_some("it is an input of this job")
}

/// Where a file is or will be.
fn place(file: &Path) -> PathBuf {
    let new = || Some(real(file.parent()?)?.join(file.file_name()?));
    real(file).or_else(new).or_else(|| std::path::absolute(file).ok()).unwrap_or_else(|| file.to_path_buf())
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
