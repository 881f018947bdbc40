//! Archives that someone else packed: nothing is believed that they say of themselves (CONTRACT 8).
//!
//! Only plain files and folders; no path leaves the folder; bytes are counted while they are unpacked. One bad entry fails
//! the whole archive, named.

mod names;
mod tar;
mod zip;

use super::inbox::Packed;
use flate2::read::MultiGzDecoder;
use names::Names;
use std::cell::Cell;
use std::fs::{self, File};
use std::io::{self, BufReader, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

/// What an archive may become.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Bytes unpacked for each byte of the archive.
    pub(super) ratio: u64,
    /// Bytes unpacked in all.
    pub(super) bytes: u64,
    /// Files and folders.
    pub(super) entries: u64,
}

/// Those of CONTRACT 8.
pub(super) const LIMITS: Limits = Limits { ratio: 100, bytes: 4 << 30, entries: 100_000 };

/// A job file within an archive is not longer.
const JOB_FILE_BYTES_MAX: u64 = 1 << 20;
/// zstd's window, which is held in memory, is not larger: what `zstd -19` and below use, and `--long` up to 128 MB.
const WINDOW_BYTES_MAX: u64 = 128 << 20;

/// Why an archive is refused.
#[derive(Debug, thiserror::Error)]
pub(super) enum ArchiveError {
    /// An entry is not what may be unpacked.
    #[error("{}: `{entry}` {why}; nothing of the archive is used", archive.display())]
    Entry {
        archive: PathBuf,
        /// As the archive writes it, without signs for the terminal.
        entry: String,
        why: String,
    },
    /// It would become too much.
    #[error("{}: {text}; nothing of the archive is used (unpack it and put the folder into the inbox)", .archive.display())]
    TooMuch { archive: PathBuf, text: String },
    /// It is torn, or no archive.
    #[error("{}: cannot be unpacked: {source}; pack it again and look whether it was copied whole", archive.display())]
    Broken { archive: PathBuf, source: io::Error },
    /// What is unpacked cannot be written.
    #[error("{}: cannot be written: {source}; look whether there is space, and whether it may be written", path.display())]
    Write { path: PathBuf, source: io::Error },
}

impl ArchiveError {
    /// Whether there was no space, which says nothing of the archive.
    pub(super) fn is_full_disk(&self) -> bool {
        let full = [ErrorKind::StorageFull, ErrorKind::QuotaExceeded];
        matches!(self, Self::Write { source, .. } if full.contains(&source.kind()))
    }
}

/// What is done with the entries of an archive.
trait Sink {
    /// A folder, relative to the job's.
    fn folder(&mut self, path: &Path) -> Result<(), ArchiveError>;
    /// A plain file; all of its bytes are to be read. An error of reading is told apart from one of writing.
    fn file(&mut self, path: &Path, bytes: &mut dyn Read) -> Result<(), Failed>;
}

/// Which side of a copy failed.
enum Failed {
    Read(io::Error),
    Write(ArchiveError),
}

/// Unpacks an archive into a folder that is not there yet; where it fails the folder is gone again.
pub(super) fn unpack(
    archive: &Path,
    packed: Packed,
    folder: &Path,
    limits: Limits,
) -> Result<(), ArchiveError> {
    struct Files<'a>(&'a Path);
    impl Sink for Files<'_> {
        fn folder(&mut self, path: &Path) -> Result<(), ArchiveError> {
            let path = self.0.join(path);
            fs::create_dir_all(&path).map_err(|source| ArchiveError::Write { path, source })
        }

        fn file(&mut self, path: &Path, bytes: &mut dyn Read) -> Result<(), Failed> {
            let path = self.0.join(path);
            let write = |source| Failed::Write(ArchiveError::Write { path: path.clone(), source });
            // names were compared, so that nothing is there: no link is followed, nothing written over
            let mut file = File::create_new(&path).map_err(write)?;
            let mut room = vec![0; 1 << 16];
            loop {
                match bytes.read(&mut room).map_err(Failed::Read)? {
                    0 => return Ok(()),
                    n => file.write_all(&room[..n]).map_err(write)?,
                }
            }
        }
    }
    fs::create_dir_all(folder)
        .map_err(|source| ArchiveError::Write { path: folder.to_path_buf(), source })?;
    let unpacked = visit(archive, packed, limits, &mut Files(folder));
    if unpacked.is_err() {
        // what stays is removed before the next attempt
        let _ = fs::remove_dir_all(folder);
    }
    unpacked
}

/// The job file within an archive, if there is one (in the archive or the only folder in it); all entries are looked at.
pub(super) fn job_file(
    archive: &Path,
    packed: Packed,
    limits: Limits,
) -> Result<Option<Vec<u8>>, ArchiveError> {
    #[derive(Default)]
    struct Found(Option<(usize, Vec<u8>)>);
    impl Sink for Found {
        fn folder(&mut self, _: &Path) -> Result<(), ArchiveError> {
            Ok(())
        }

        fn file(&mut self, path: &Path, bytes: &mut dyn Read) -> Result<(), Failed> {
            let depth = path.components().count();
            let is_job = path.file_name().is_some_and(super::job::is_job_file_name);
            if is_job && depth <= 2 && self.0.as_ref().is_none_or(|(d, _)| depth < *d) {
                let mut text = Vec::new();
                (&mut *bytes).take(JOB_FILE_BYTES_MAX).read_to_end(&mut text).map_err(Failed::Read)?;
                self.0 = Some((depth, text));
            }
            io::copy(bytes, &mut io::sink()).map(drop).map_err(Failed::Read)
        }
    }
    let mut found = Found::default();
    visit(archive, packed, limits, &mut found)?;
    Ok(found.0.map(|(_, text)| text))
}

fn visit(archive: &Path, packed: Packed, limits: Limits, sink: &mut dyn Sink) -> Result<(), ArchiveError> {
    let broken = |source| ArchiveError::Broken { archive: archive.to_path_buf(), source };
    let open = || File::open(archive).map(BufReader::new).map_err(broken);
    let file = open()?;
    let packed_bytes = file.get_ref().metadata().map_err(broken)?.len();
    let most = limits.bytes.min(packed_bytes.saturating_mul(limits.ratio));
    let budget = Budget { left: Cell::new(most), spent: Cell::new(false) };
    let mut visit = Visit { archive, names: Names::new(limits.entries), budget: &budget, limits, sink };
    let visited = match packed {
        Packed::Zip => zip::visit(file, open()?, &mut visit),
        Packed::Tar => tar::visit(budget.count(file), &mut visit),
        Packed::TarGz => tar::visit(budget.count(MultiGzDecoder::new(file)), &mut visit),
        Packed::TarZst => {
            let decoder =
                ruzstd::decoding::StreamingDecoder::new_with_max_window_size(file, WINDOW_BYTES_MAX)
                    .map_err(|e| broken(io::Error::other(e.to_string())))?;
            tar::visit(budget.count(decoder), &mut visit)
        }
    };
    match visited {
        // whatever the reader made of it
        Err(_) if budget.spent.get() => Err(ArchiveError::TooMuch {
            archive: archive.to_path_buf(),
            text: format!(
                "{packed_bytes} bytes become more than {most}; at most {}:1 and {} bytes are unpacked",
                limits.ratio, limits.bytes
            ),
        }),
        visited => visited,
    }
}

/// Bytes that may still be unpacked.
struct Budget {
    left: Cell<u64>,
    /// Whether more were asked for.
    spent: Cell<bool>,
}

impl Budget {
    fn count<R>(&self, inner: R) -> Counted<'_, R> {
        Counted { inner, budget: self }
    }
}

/// Counts what is read, and refuses to read beyond the budget.
struct Counted<'a, R> {
    inner: R,
    budget: &'a Budget,
}

impl<R: Read> Read for Counted<'_, R> {
    fn read(&mut self, room: &mut [u8]) -> io::Result<usize> {
        let n = self.inner.read(room)?;
        let Some(left) = self.budget.left.get().checked_sub(n as u64) else {
            self.budget.spent.set(true);
            return Err(io::Error::other("becomes too much"));
        };
        self.budget.left.set(left);
        Ok(n)
    }
}

/// What readers of formats hand entries to.
struct Visit<'a> {
    archive: &'a Path,
    names: Names,
    budget: &'a Budget,
    limits: Limits,
    sink: &'a mut dyn Sink,
}

impl Visit<'_> {
    fn broken(&self, source: io::Error) -> ArchiveError {
        ArchiveError::Broken { archive: self.archive.to_path_buf(), source }
    }

    fn bad(&self, entry: &[u8], why: impl Into<String>) -> ArchiveError {
        let entry = String::from_utf8_lossy(entry).replace(char::is_control, "\u{fffd}");
        ArchiveError::Entry { archive: self.archive.to_path_buf(), entry, why: why.into() }
    }

    /// Counts an entry that is left out.
    fn skip(&mut self) -> Result<(), ArchiveError> {
        if self.names.count() { Ok(()) } else { Err(self.too_many()) }
    }

    fn too_many(&self) -> ArchiveError {
        let text = format!("has more than {} entries", self.limits.entries);
        ArchiveError::TooMuch { archive: self.archive.to_path_buf(), text }
    }

    fn folder(&mut self, name: &[u8]) -> Result<(), ArchiveError> {
        self.skip()?;
        let path = self.names.folder(name).map_err(|why| self.bad(name, why))?;
        path.map_or(Ok(()), |path| self.sink.folder(&path))
    }

    fn file(&mut self, name: &[u8], bytes: &mut dyn Read) -> Result<(), ArchiveError> {
        self.skip()?;
        let path = self.names.file(name).map_err(|why| self.bad(name, why))?;
        if let Some(parent) = path.parent().filter(|p| !p.as_os_str().is_empty()) {
            self.sink.folder(parent)?;
        }
        self.sink.file(&path, bytes).map_err(|failed| match failed {
            Failed::Read(source) => self.broken(source),
            Failed::Write(error) => error,
        })
    }
}

#[cfg(test)]
mod tests;
