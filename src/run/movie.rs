//! The pictures of a job as a film, by ffmpeg.

use super::check::part_of_job;
use crate::job::Job;
use crate::output::has_mark;
use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Why there is no film. The pictures are there.
#[derive(Debug, thiserror::Error)]
pub enum MovieError {
    /// ffmpeg cannot be started.
    #[error("no film can be made: ffmpeg {0}; install it (https://ffmpeg.org), or leave --movie out")]
    NoProgram(String),
    /// It would be made where it cannot be.
    #[error("{}: no film can be made there: {why}", .file.display())]
    Place {
        /// The film.
        file: PathBuf,
        /// What is wrong, and what helps.
        why: &'static str,
    },
    /// There is no room.
    #[error("{}: the film cannot be written: {why}; the pictures are there", .file.display())]
    Room {
        /// The film.
        file: PathBuf,
        /// What the system says.
        why: io::Error,
    },
    /// ffmpeg failed.
    #[error("{}: ffmpeg made no film: {why}; the pictures are there", .file.display())]
    Failed {
        /// The film.
        file: PathBuf,
        /// What ffmpeg says.
        why: String,
    },
}

/// Stands in each film, and tells it from files that others made.
const MARK: &str = "made by rentix";

/// Whether ffmpeg can be started, and its film of a job may stand there.
///
/// # Errors
/// Where not: there is no such folder, no ending that tells the format, a file that is no film of this program and is not to be
/// written over, or a file of the job.
pub fn movie_can_be_made(job: &Job, file: &Path, overwrite: bool) -> Result<(), MovieError> {
    let place = |why| Err(MovieError::Place { file: file.to_path_buf(), why });
    if !folder_of(file).is_dir() {
        return place("there is no such folder; make it first");
    }
    if file.extension().is_none() {
        return place("its ending tells no format; name it FILE.mp4");
    }
    if !overwrite && file.symlink_metadata().is_ok() && !has_mark(file, MARK) {
        return place("the file there was not made by rentix; --overwrite replaces it");
    }
    if let Some(why) = part_of_job(job, file, MARK) {
        return place(why);
    }
    let started = Command::new("ffmpeg").arg("-version").stdin(Stdio::null()).output();
    match started {
        Ok(output) if output.status.success() => Ok(()),
        Ok(output) => Err(MovieError::NoProgram(format!("ends with {}", output.status))),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            Err(MovieError::NoProgram("is not installed".to_string()))
        }
        Err(error) => Err(MovieError::NoProgram(format!("cannot be started ({error})"))),
    }
}

fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Makes a film of a job's pictures by their sequences and numbers, as many a second as the job says. The file is whole or
/// absent.
///
/// # Errors
/// Where ffmpeg says so, or there is no room.
pub fn make_movie(job: &Job, file: &Path) -> Result<(), MovieError> {
    let fps = job.fps;
    let room = |why: io::Error| MovieError::Room { file: file.to_path_buf(), why };
    // on the same file system, so that it can take the film's place
    let unfinished =
        tempfile::Builder::new().prefix(".rentix-movie-").tempdir_in(folder_of(file)).map_err(room)?;
    let mut pictures: Vec<_> = job.pictures.iter().collect();
    pictures.sort_by_key(|p| (p.sequence, p.frame));
    let mut list = "ffconcat version 1.0\n".to_string();
    for picture in pictures {
        let path = std::path::absolute(job.folder.join(&picture.picture)).map_err(room)?;
        let _ = writeln!(
            list,
            "file '{}'\nduration {}",
            path.display().to_string().replace('\'', r"'\''"),
            1.0 / fps
        );
    }
    let list_file = unfinished.path().join("list.txt");
    std::fs::write(&list_file, list).map_err(room)?;
    let made = unfinished.path().join("film").with_extension(file.extension().unwrap_or_default());
    let output = Command::new("ffmpeg")
        .args(["-v", "error", "-nostdin", "-y", "-f", "concat", "-safe", "0", "-i"])
        .arg(&list_file)
        // players know this one; it needs even sizes
        .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "-r", &fps.to_string()])
        .args(["-metadata", &format!("comment={MARK}")])
        .arg(&made)
        .output()
        .map_err(room)?;
    if !output.status.success() {
        let told = String::from_utf8_lossy(&output.stderr);
        let last = told.lines().rev().find(|l| !l.trim().is_empty()).unwrap_or("it says nothing");
        return Err(MovieError::Failed { file: file.to_path_buf(), why: last.to_string() });
    }
    std::fs::rename(made, file).map_err(room)
}
