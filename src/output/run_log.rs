//! The file of records that one run appends to, and the folding of those that dead runs left.

use super::atomic::{Temporary, remove};
use super::error::OutputError;
use super::owner::{is_dead, own_name};
use super::records::{LOG_SUFFIX, Record, log_lines, logs, records_folder};
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Files of records that are left alone; more are folded into one where their runs are dead.
const LOGS_MAX: usize = 16;

/// The records that a run makes. Nothing is written before the first.
#[derive(Debug)]
pub struct RunLog {
    folder: PathBuf,
    open: Mutex<Option<(PathBuf, File)>>,
}

impl RunLog {
    /// For a run into an output folder.
    pub fn create(folder: &Path) -> Self {
        Self { folder: folder.to_path_buf(), open: Mutex::new(None) }
    }

    /// The output folder.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Appends a record in one write and flushes it (fdatasync, 4 ms on a disk that writes through): after a power cut
    /// a picture without its record would be taken for someone else's and never be written over.
    pub(super) fn append(&self, record: &Record) -> Result<(), OutputError> {
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        // what is appended to a file that someone has removed is lost; one that failed may end in a torn line
        let (path, mut file) = match open.take().filter(|(path, _)| path.exists()) {
            Some(log) => log,
            None => create_log(&records_folder(&self.folder))?,
        };
        let written = file.write_all(record.line().as_bytes()).and_then(|()| file.sync_data());
        written.map_err(OutputError::write(&path))?;
        *open = Some((path, file));
        Ok(())
    }
}

fn create_log(records_folder: &Path) -> Result<(PathBuf, File), OutputError> {
    fs::create_dir_all(records_folder).map_err(OutputError::write(records_folder))?;
    loop {
        let path = records_folder.join(own_name("", LOG_SUFFIX));
        match File::options().append(true).create_new(true).open(&path) {
            Ok(file) => return Ok((path, file)),
            // left by a dead process of the same number; the next name is another one
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(OutputError::write(&path)(error)),
        }
    }
}

/// Folds files of records whose runs are dead into one, where there are many. Other runs may read, append and fold at
/// the same time: the new file is whole before the old ones go, and a line that stands twice counts once.
pub(super) fn fold_logs(folder: &Path) -> Result<(), OutputError> {
    let records_folder = records_folder(folder);
    let logs = logs(&records_folder)?;
    if logs.len() <= LOGS_MAX {
        return Ok(());
    }
    let dead: Vec<&PathBuf> = logs.iter().filter(|log| is_dead(log, "", LOG_SUFFIX)).collect();
    if dead.len() < 2 {
        return Ok(());
    }
    let mut lines = BTreeSet::new();
    for log in &dead {
        lines.extend(log_lines(log)?);
    }
    let bytes: Vec<u8> = lines.into_iter().flat_map(|line| line.into_iter().chain([b'\n'])).collect();
    let folded = records_folder.join(own_name("", LOG_SUFFIX));
    Temporary::write(&folded, &bytes)?.place()?;
    dead.into_iter().try_for_each(|log| remove(log))
}

#[cfg(test)]
mod tests {
    use super::super::encoding::PictureFile;
    use super::super::owner::tests::dead_name;
    use super::super::records::Records;
    use super::*;
    use crate::scene::PartHash;

    fn record(n: usize) -> Record {
        let file = PictureFile { path: format!("{n}.png").into(), bytes: vec![n as u8] };
        Record::new(PartHash(n as u128), &[file])
    }

    fn named(folder: &Path, count: usize) -> usize {
        let records = Records::read(folder).unwrap();
        (0..count).filter(|n| records.names(Path::new(&format!("{n}.png")))).count()
    }

    #[test]
    fn nothing_is_made_before_the_first_record() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("out");
        let log = RunLog::create(&output);
        assert!(!output.exists());
        log.append(&record(0)).unwrap();
        log.append(&record(1)).unwrap();
        assert_eq!((logs(&records_folder(&output)).unwrap().len(), named(&output, 2)), (1, 2));
    }

    #[test]
    fn a_log_that_was_removed_is_made_anew() {
        let folder = tempfile::tempdir().unwrap();
        let log = RunLog::create(folder.path());
        log.append(&record(0)).unwrap();
        fs::remove_dir_all(records_folder(folder.path())).unwrap();
        log.append(&record(1)).unwrap();
        assert_eq!(named(folder.path(), 2), 1);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_an_error_and_later_records_stand_in_another_file() {
        let folder = tempfile::tempdir().unwrap();
        let log = RunLog::create(folder.path());
        let full = PathBuf::from("/dev/full");
        *log.open.lock().unwrap() = Some((full.clone(), File::options().write(true).open(&full).unwrap()));
        let error = log.append(&record(0)).unwrap_err().to_string();
        assert!(
            error.contains("/dev/full: cannot be written") && error.contains("free some space"),
            "{error}"
        );
        log.append(&record(1)).unwrap();
        assert_eq!(named(folder.path(), 2), 1);
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_named() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("file"), "").unwrap();
        let error = RunLog::create(&folder.path().join("file")).append(&record(0)).unwrap_err().to_string();
        assert!(error.contains("file/.rentix: cannot be written"), "{error}");
    }

    /// Logs of dead runs; each record stands in two of them, and each ends in a torn line.
    fn leave_dead_logs(output: &Path, count: usize) {
        let folder = records_folder(output);
        fs::create_dir_all(&folder).unwrap();
        for n in 0..count {
            let lines = record(n).line() + &record((n + 1) % count).line() + &record(n).line()[..20];
            fs::write(folder.join(dead_name("", LOG_SUFFIX)), lines).unwrap();
        }
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn logs_of_dead_runs_are_folded_and_nothing_is_lost() {
        let output = tempfile::tempdir().unwrap();
        leave_dead_logs(output.path(), LOGS_MAX);
        fold_logs(output.path()).unwrap();
        assert_eq!(
            logs(&records_folder(output.path())).unwrap().len(),
            LOGS_MAX,
            "few enough to leave alone"
        );
        let live = RunLog::create(output.path());
        live.append(&record(LOGS_MAX)).unwrap();
        fold_logs(output.path()).unwrap();
        assert_eq!(
            logs(&records_folder(output.path())).unwrap().len(),
            2,
            "the live run's and the folded one"
        );
        live.append(&record(LOGS_MAX + 1)).unwrap();
        let live_ones: Vec<RunLog> = (0..LOGS_MAX).map(|_| RunLog::create(output.path())).collect();
        for log in &live_ones {
            log.append(&record(0)).unwrap();
        }
        fold_logs(output.path()).unwrap();
        assert_eq!(logs(&records_folder(output.path())).unwrap().len(), LOGS_MAX + 2, "live ones stay");
        assert_eq!(named(output.path(), LOGS_MAX + 2), LOGS_MAX + 2);
    }

    #[test]
    fn readers_miss_nothing_while_others_fold() {
        let output = tempfile::tempdir().unwrap();
        let count = LOGS_MAX + 4;
        for _ in 0..5 {
            leave_dead_logs(output.path(), count);
            std::thread::scope(|scope| {
                let folders = [0, 1].map(|_| scope.spawn(|| fold_logs(output.path()).unwrap()));
                for _ in 0..20 {
                    assert_eq!(named(output.path(), count), count);
                }
                for folder in folders {
                    folder.join().unwrap();
                }
            });
        }
    }
}
