//! Files that are whole or absent: written under a temporary name in the same folder, flushed, renamed.

use super::error::OutputError;
use super::owner::{is_dead, own_name};
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

const PREFIX: &str = ".rentix-";
const SUFFIX: &str = ".tmp";

/// Replaces a file whole: whoever reads it finds the old content or the new. Its folder must be there.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    Temporary::write(path, bytes)?.place()
}

/// Makes a folder where there is none, and tries whether files can be written there.
pub fn make_writable(folder: &Path) -> Result<(), OutputError> {
    let path = folder.join(own_name(PREFIX, SUFFIX));
    let tried = fs::create_dir_all(folder).and_then(|()| File::create(&path));
    tried.map_err(OutputError::write(folder)).and_then(|_| remove(&path))
}

/// Content on its way to its place; removed where it does not get there.
#[derive(Debug)]
pub(super) struct Temporary {
    path: PathBuf,
    target: PathBuf,
    placed: bool,
}

impl Temporary {
    /// Writes and flushes the content beside its target.
    ///
    /// A killed process loses nothing that it has written, so the flush (fdatasync, 3 to 4 ms for a picture on a disk
    /// that writes through) is for a power cut: without it a picture could stand in its place torn. The thread that
    /// writes waits for it, not one that computes.
    pub(super) fn write(target: &Path, bytes: &[u8]) -> Result<Self, OutputError> {
        let path = target.with_file_name(own_name(PREFIX, SUFFIX));
        let temporary = Self { path, target: target.to_path_buf(), placed: false };
        let write = || -> io::Result<()> {
            let mut file = File::create(&temporary.path)?;
            file.write_all(bytes)?;
            file.sync_data()
        };
        write().map_err(OutputError::write(target))?;
        Ok(temporary)
    }

    /// Renames it into its place. What is there and no file, such as a folder or a device, stays.
    pub(super) fn place(mut self) -> Result<(), OutputError> {
        let kept = self.target.metadata().is_ok_and(|m| !m.is_file());
        let renamed = if kept {
            Err(io::Error::new(io::ErrorKind::AlreadyExists, "what is in its place is not a file"))
        } else {
            fs::rename(&self.path, &self.target)
        };
        self.placed = renamed.is_ok();
        renamed.map_err(OutputError::write(&self.target))
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if !self.placed {
            // what cannot be removed now is removed as a dead run's later
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Removes temporary files of dead runs from a folder; one that is not there has none.
pub(super) fn remove_dead_temporaries(folder: &Path) -> Result<(), OutputError> {
    let entries = match folder.read_dir() {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        entries => entries.map_err(OutputError::read(folder))?,
    };
    for entry in entries {
        let path = entry.map_err(OutputError::read(folder))?.path();
        if is_dead(&path, PREFIX, SUFFIX) {
            remove(&path)?;
        }
    }
    Ok(())
}

/// Removes a file that another run may remove at the same time.
pub(super) fn remove(path: &Path) -> Result<(), OutputError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(OutputError::write(path)(error)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::owner::tests::{dead_name, make_old};
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            folder.read_dir().unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn content_is_replaced_whole_and_nothing_else_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        write_atomic(&path, b"one").unwrap();
        write_atomic(&path, b"two").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
        let temporary = Temporary::write(&path, b"three").unwrap();
        assert_eq!(names(folder.path()).len(), 2);
        assert_eq!(fs::read(&path).unwrap(), b"two");
        drop(temporary);
        assert_eq!(names(folder.path()), ["a.png"]);
    }

    #[test]
    fn what_is_in_the_way_is_named_and_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        fs::create_dir(&path).unwrap();
        let error = write_atomic(&path, b"one").unwrap_err().to_string();
        assert!(error.contains("a.png: cannot be written") && error.contains("move away"), "{error}");
        assert_eq!(names(folder.path()), ["a.png"]);
        let gone = folder.path().join("gone/a.png");
        let error = write_atomic(&gone, b"one").unwrap_err().to_string();
        assert!(error.contains("gone/a.png: cannot be written") && error.contains("still there"), "{error}");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn temporaries_of_dead_runs_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| {
            let path = folder.path().join(name);
            fs::write(&path, "torn").unwrap();
            path
        };
        file(&dead_name(PREFIX, SUFFIX));
        make_old(&file(".rentix-elsewhere.7.0.tmp"));
        let kept = [own_name(PREFIX, SUFFIX), ".rentix-elsewhere.8.0.tmp".into(), ".mine.tmp".into()];
        for name in &kept {
            file(name);
        }
        make_old(&folder.path().join(".mine.tmp"));
        remove_dead_temporaries(folder.path()).unwrap();
        remove_dead_temporaries(&folder.path().join("no such folder")).unwrap();
        let mut kept = kept.to_vec();
        kept.sort();
        assert_eq!(names(folder.path()), kept);
    }
}
