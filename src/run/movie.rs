//! The pictures of a job as a film, by ffmpeg.

use crate::job::Job;
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

/// Whether ffmpeg can be started.
///
/// # Errors
/// Where it cannot.
pub fn movie_can_be_made() -> Result<(), MovieError> {
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

/// Makes a film of a job's pictures by their sequences and numbers, so many a second. The file is whole or absent.
///
/// # Errors
/// Where ffmpeg says so, or there is no room.
pub fn make_movie(job: &Job, file: &Path, fps: f64) -> Result<(), MovieError> {
    let room = |why: io::Error| MovieError::Room { file: file.to_path_buf(), why };
    let folder = file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // on the same file system, so that it can take the film's place
    let unfinished = tempfile::Builder::new().prefix(".rentix-movie-").tempdir_in(folder).map_err(room)?;
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
