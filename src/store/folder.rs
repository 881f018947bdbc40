//! The files of a store: how many, and which to give up.

use crate::clock::{EARLIEST, FileTime, file_time};
use std::fs::{self, DirEntry, Metadata};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The folder below the root; another for each form of the entries.
pub(super) const VERSION: &str = "v1";
/// How the names of files begin that are being written.
pub(super) const UNFINISHED: &str = ".tmp-";
/// A file that is unfinished for so long was left by a process that died.
const ABANDONED: Duration = Duration::from_hours(1);

/// Entries and their bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Stat {
    /// Files.
    pub entries: u64,
    /// Bytes.
    pub bytes: u64,
}

impl Stat {
    fn add(&mut self, bytes: u64) {
        self.entries += 1;
        self.bytes += bytes;
    }
}

/// What was removed, and what could not be.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Removed {
    /// Entries that are gone.
    pub gone: Stat,
    /// How many files could not be removed, and folders not looked into.
    pub failed: u64,
    /// Why, of the first of them.
    pub why: Option<String>,
}

impl Removed {
    fn fail(&mut self, what: &str, path: &Path, error: &io::Error) {
        self.failed += 1;
        self.why.get_or_insert_with(|| format!("{}: cannot be {what}: {error}", path.display()));
    }

    /// Removes a file; whether it was this that did so.
    fn remove(&mut self, path: &Path) -> bool {
        let removed = fs::remove_file(path);
        if let Err(error) = &removed
            && error.kind() != io::ErrorKind::NotFound
        {
            self.fail("removed", path, error);
        }
        removed.is_ok()
    }
}

struct Found {
    path: PathBuf,
    bytes: u64,
    used: FileTime,
    is_unfinished: bool,
}

pub(super) fn stat(root: &Path) -> Stat {
    let mut stat = Stat::default();
    let files = files(root, &mut Removed::default());
    files.iter().filter(|f| !f.is_unfinished).for_each(|f| stat.add(f.bytes));
    stat
}

/// Removes abandoned files and, the longest unused first, entries until so many bytes are left.
pub(super) fn shrink(root: &Path, limit_bytes: u64) -> Removed {
    let now = file_time();
    let mut removed = Removed::default();
    let (unfinished, mut entries): (Vec<Found>, Vec<Found>) =
        files(root, &mut removed).into_iter().partition(|f| f.is_unfinished);
    for file in unfinished {
        if limit_bytes == 0 || now.duration_since(file.used).is_ok_and(|age| age > ABANDONED) {
            removed.remove(&file.path);
        }
    }
    entries.sort_by(|a, b| (a.used, &a.path).cmp(&(b.used, &b.path)));
    let mut left: u64 = entries.iter().map(|f| f.bytes).sum();
    for entry in entries {
        // with 0, what was cut to nothing goes, too
        if limit_bytes > 0 && left <= limit_bytes {
            break;
        }
        let failed = removed.failed;
        if removed.remove(&entry.path) {
            removed.gone.add(entry.bytes);
        }
        if removed.failed == failed {
            // another process may have done so
            left -= entry.bytes;
        }
    }
    removed
}

/// Whether the current folder is a checkout of this program, by its `Cargo.toml`.
pub fn is_own_checkout() -> bool {
    let manifest = fs::read_to_string("Cargo.toml").unwrap_or_default();
    manifest.lines().any(|line| line.trim() == "name = \"rentix\"")
}

/// Removes a file; another process may have done so.
pub(super) fn remove(path: &Path) {
    let _ = fs::remove_file(path);
}

/// All files below the version's folder: kinds, first digits, entries. Nothing else is looked at.
fn files(root: &Path, failed: &mut Removed) -> Vec<Found> {
    let mut folders = vec![root.join(VERSION)];
    for _ in 0..2 {
        let below = folders.iter().flat_map(|folder| entries(folder, failed));
        let below = below.filter(|e| e.file_type().is_ok_and(|t| t.is_dir()));
        folders = below.map(|e| e.path()).collect();
    }
    let mut found = Vec::new();
    for file in folders.iter().flat_map(|folder| entries(folder, failed)) {
        let Some(metadata) = file.metadata().ok().filter(Metadata::is_file) else { continue };
        found.push(Found {
            is_unfinished: file.file_name().to_string_lossy().starts_with(UNFINISHED),
            path: file.path(),
            bytes: metadata.len(),
            used: metadata.modified().unwrap_or(EARLIEST),
        });
    }
    found
}

fn entries(folder: &Path, failed: &mut Removed) -> Vec<DirEntry> {
    match fs::read_dir(folder) {
        Ok(entries) => entries.flatten().collect(),
        Err(error) => {
            if error.kind() != io::ErrorKind::NotFound {
                failed.fail("read", folder, &error);
            }
            Vec::new()
        }
    }
}
