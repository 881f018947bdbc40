//! What a folder or an archive in the inbox means: a `job.yaml` inside says how and wins, the daemon's options are defaults.

use super::archive::{self, ArchiveError};
use super::inbox::{self, Kind};
use crate::format::FormatError;
use crate::job::{self, Job, JobError, Request};
use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::{MAIN_SEPARATOR, Path, PathBuf};

/// Names of the job file.
const JOB_FILES: [&str; 2] = ["job.yaml", "job.yml"];

/// Whether that is the name of a job file.
pub(super) fn is_job_file_name(name: &OsStr) -> bool {
    JOB_FILES.iter().any(|n| name == *n)
}

/// Why a job cannot be.
#[derive(Debug, thiserror::Error)]
pub(super) enum Unfit {
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    #[error(transparent)]
    Job(#[from] JobError),
    #[error(transparent)]
    Frame(#[from] FormatError),
    #[error("{}: is no plain file; put the job file itself there", .0.display())]
    NotAFile(PathBuf),
    #[error("{}: cannot be used: {source}; look whether it is still there and may be read", path.display())]
    Unusable { path: PathBuf, source: io::Error },
}

fn unusable(path: &Path) -> impl FnOnce(io::Error) -> Unfit {
    |source| Unfit::Unusable { path: path.to_path_buf(), source }
}

/// Where a job's files are and where its pictures go.
#[derive(Clone, Debug)]
pub(super) struct Place {
    /// The folder or archive in the inbox.
    pub(super) source: PathBuf,
    pub(super) kind: Kind,
    /// Where an archive is unpacked.
    pub(super) room: PathBuf,
    /// Where its pictures go.
    pub(super) out: PathBuf,
}

impl Place {
    /// A text about files that were unpacked, as whoever packed them knows them: `walk.zip: a.obj:2: …`.
    pub(super) fn as_packed(&self, text: &str) -> String {
        if self.kind == Kind::Folder {
            return text.to_owned();
        }
        let archive = self.source.file_name().unwrap_or_default().to_string_lossy();
        let real = self.room.canonicalize().unwrap_or_else(|_| self.room.clone());
        let mut text = text.to_owned();
        for room in [real, self.room.clone()].map(|room| room.display().to_string()) {
            text = text.replace(&format!("{room}{MAIN_SEPARATOR}"), &format!("{archive}: "));
            text = text.replace(&room, &archive);
        }
        text
    }
}

/// The priority that a job asks for, if it does; an archive is looked through for it, and refused where it is bad.
pub(super) fn examine(place: &Place) -> Result<Option<i64>, Unfit> {
    match place.kind {
        Kind::Folder => {
            let root = inbox::root(&place.source).map_err(unusable(&place.source))?;
            Ok(job_file(&root)?.as_deref().and_then(job::priority))
        }
        Kind::Archive(packed) => {
            let Some(text) = archive::job_file(&place.source, packed, archive::LIMITS)? else {
                return Ok(None);
            };
            let folder = tempfile::tempdir().map_err(unusable(&place.source))?;
            let path = folder.path().join(JOB_FILES[0]);
            fs::write(&path, text).map_err(unusable(&path))?;
            Ok(job::priority(&path))
        }
    }
}

/// Unpacks what is to be unpacked and works out what is to be rendered.
pub(super) fn prepare(place: &Place, defaults: &Request, grows: bool) -> Result<Job, Unfit> {
    let folder = match place.kind {
        Kind::Folder => &place.source,
        Kind::Archive(packed) => {
            clear(&place.room).map_err(unusable(&place.room))?;
            archive::unpack(&place.source, packed, &place.room, archive::LIMITS)?;
            &place.room
        }
    };
    let root = inbox::root(folder).and_then(|root| root.canonicalize()).map_err(unusable(folder))?;
    let input = job_file(&root)?.unwrap_or_else(|| root.clone());
    let request = Request {
        inputs: vec![input],
        folder: Some(place.out.clone()),
        dropped: Some(root),
        grows,
        ..defaults.clone()
    };
    Ok(job::resolve(&request)?)
}

/// Removes what was unpacked.
pub(super) fn clear(room: &Path) -> io::Result<()> {
    match fs::remove_dir_all(room) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// The job file in a folder; a link, or what is no file, is none.
fn job_file(root: &Path) -> Result<Option<PathBuf>, Unfit> {
    for path in JOB_FILES.map(|name| root.join(name)) {
        match fs::symlink_metadata(&path) {
            Ok(meta) if meta.is_file() => return Ok(Some(path)),
            Ok(_) => return Err(Unfit::NotAFile(path)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(unusable(&path)(error)),
        }
    }
    Ok(None)
}
