//! The one way in which frames become finished, and what is looked after around it.

use super::atomic::{Temporary, remove_dead_temporaries};
use super::encoding::PictureFile;
use super::error::OutputError;
use super::records::{Record, Records, records_folder};
use super::run_log::{RunLog, fold_logs};
use crate::scene::PartHash;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Brings a frame's files into their places in the log's output folder, which is made where it is missing.
///
/// Order is the promise: all files whole under temporary names, then the record, then the renames, the picture's last.
/// So a picture in its place has its record and its side files, at whatever moment the run is killed; and on an error
/// nothing temporary stays.
pub fn finish(log: &RunLog, fingerprint: PartHash, files: &[PictureFile]) -> Result<(), OutputError> {
    let mut temporaries = Vec::with_capacity(files.len());
    for file in files {
        let target = log.folder().join(&file.path);
        if let Some(folder) = target.parent() {
            fs::create_dir_all(folder).map_err(OutputError::write(folder))?;
        }
        temporaries.push(Temporary::write(&target, &file.bytes)?);
    }
    log.append(&Record::new(fingerprint, files))?;
    temporaries.into_iter().rev().try_for_each(Temporary::place)
}

/// Those of a run's files, relative to the output folder, in whose place something is that no record names.
pub fn foreign<'a>(
    folder: &Path,
    files: impl IntoIterator<Item = &'a Path>,
    records: &Records,
) -> Vec<PathBuf> {
    let is_there = |file: &Path| folder.join(file).symlink_metadata().is_ok();
    files.into_iter().filter(|file| is_there(file) && !records.names(file)).map(Path::to_path_buf).collect()
}

/// Clears up after dead runs, before the first frame: removes their temporary files where a run's files go (relative
/// to the output folder), and folds their records where there are many. What could not be cleared up does no harm, so
/// an error here need not stop a run.
pub fn clean_up<'a>(folder: &Path, files: impl IntoIterator<Item = &'a Path>) -> Result<(), OutputError> {
    let parents = files.into_iter().filter_map(Path::parent).map(|parent| folder.join(parent));
    let folders: BTreeSet<PathBuf> = parents.chain([records_folder(folder)]).collect();
    folders.iter().try_for_each(|folder| remove_dead_temporaries(folder))?;
    fold_logs(folder)
}
