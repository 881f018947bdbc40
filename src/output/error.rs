//! What can go wrong with pictures and records.

use std::io;
use std::path::{Path, PathBuf};

/// Why a picture or a record is not where it should be, or cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// A file or folder cannot be written.
    #[error("{}: cannot be written: {source}; {}", path.display(), remedy(source))]
    Write {
        /// Which.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file or folder cannot be read.
    #[error("{}: cannot be read: {source}; look whether it is there and may be read", path.display())]
    Read {
        /// Which.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file of records is larger than any run makes.
    #[error("{}: holds more than {max_bytes} bytes; it is no file of records: move it away", path.display())]
    RecordsTooLarge {
        /// Which.
        path: PathBuf,
        /// What is allowed.
        max_bytes: u64,
    },
    /// An encoder refuses a film.
    #[error("a film of {}x{} pixels cannot become {format}: {why}; choose another size or format", size[0], size[1])]
    Encode {
        /// The format.
        format: &'static str,
        /// Width and height in pixels.
        size: [u32; 2],
        /// What the encoder says.
        why: String,
    },
    /// A file is not a picture that can be read.
    #[error("{}: is not a picture that can be compared: {why}; all formats but jp2 are read", path.display())]
    Decode {
        /// Which.
        path: PathBuf,
        /// What the decoder says.
        why: String,
    },
    /// There is nothing to compare.
    #[error("{} and {}: no pictures are in either; name two folders of pictures", .0.display(), .1.display())]
    NoPictures(PathBuf, PathBuf),
    /// A folder and a file are to be compared.
    #[error("{} and {}: one is a folder, the other is not; name two pictures or two folders", .0.display(), .1.display())]
    FolderAndFile(PathBuf, PathBuf),
}

impl OutputError {
    /// For `map_err` of what writes to a path.
    pub(super) fn write(path: &Path) -> impl FnOnce(io::Error) -> Self {
        |source| Self::Write { path: path.to_path_buf(), source }
    }

    /// For `map_err` of what reads a path.
    pub(super) fn read(path: &Path) -> impl FnOnce(io::Error) -> Self {
        |source| Self::Read { path: path.to_path_buf(), source }
    }
}

/// What to do about an error of writing.
fn remedy(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge => {
            "free some space or choose another folder (-o)"
        }
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            "make its folder writable or choose another one (-o)"
        }
        io::ErrorKind::IsADirectory | io::ErrorKind::NotADirectory | io::ErrorKind::AlreadyExists => {
            "move away what is in its place or choose another folder (-o)"
        }
        io::ErrorKind::InvalidFilename => "choose a shorter name (--name) or folder (-o)",
        _ => "look whether its folder is still there and can be written, then render again",
    }
}
