//! The files of a store: how many, and which to give up.

use crate::clock::{EARLIEST, FileTime, file_time};
use std::fs::{self, Metadata};
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

struct Found {
    path: PathBuf,
    bytes: u64,
    used: FileTime,
    is_unfinished: bool,
}

pub(super) fn stat(root: &Path) -> Stat {
    let mut stat = Stat::default();
    files(root).iter().filter(|f| !f.is_unfinished).for_each(|f| stat.add(f.bytes));
    stat
}

/// Removes abandoned files and, the longest unused first, entries until so many bytes are left.
pub(super) fn shrink(root: &Path, limit_bytes: u64) -> Stat {
    let now = file_time();
    let (unfinished, mut entries): (Vec<Found>, Vec<Found>) =
        files(root).into_iter().partition(|f| f.is_unfinished);
    let is_abandoned =
        |f: &&Found| limit_bytes == 0 || now.duration_since(f.used).is_ok_and(|age| age > ABANDONED);
    unfinished.iter().filter(is_abandoned).for_each(|f| remove(&f.path));
    entries.sort_by(|a, b| (a.used, &a.path).cmp(&(b.used, &b.path)));
    let mut left: u64 = entries.iter().map(|f| f.bytes).sum();
    let mut removed = Stat::default();
    for entry in entries {
        if left <= limit_bytes {
            break;
        }
        left -= entry.bytes;
        removed.add(entry.bytes);
        remove(&entry.path);
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
fn files(root: &Path) -> Vec<Found> {
    let entries = |folder: PathBuf| fs::read_dir(folder).into_iter().flatten().flatten();
    let subfolders = |folder: PathBuf| entries(folder).filter(|e| e.file_type().is_ok_and(|t| t.is_dir()));
    let mut found = Vec::new();
    for file in subfolders(root.join(VERSION))
        .flat_map(|kind| subfolders(kind.path()))
        .flat_map(|first| entries(first.path()))
    {
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
