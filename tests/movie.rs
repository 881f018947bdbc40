//! Films: the pictures in their order, whole or absent, and a clear word where ffmpeg is missing or fails. ffmpeg is a script here.
#![cfg(unix)]

mod common;

use common::{Run, rentix};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

/// The film is the list that ffmpeg is given, and how it was called.
const LISTS: &str = "for last; do :; done\nall=\"$*\"\nwhile [ \"$1\" != -i ]; do shift; done\ncp \"$2\" \"$last\"\necho \"$all\" >> \"$last\"";

/// Renders three frames to a film with a script in ffmpeg's place; None: without any.
fn film(room: &Path, ffmpeg: Option<&str>) -> Run {
    film_with(room, ffmpeg, &[])
}

fn film_with(room: &Path, ffmpeg: Option<&str>, more: &[&str]) -> Run {
    let (frames, programs) = (room.join("frames"), room.join("programs"));
    fs::create_dir_all(&frames).unwrap();
    fs::create_dir_all(&programs).unwrap();
    for frame in [2, 10, 1] {
        fs::write(
            frames.join(format!("f_{frame}.obj")),
            format!("v 0 0 0\nv {frame} 0 0\nv 0 1 0\nf 1 2 3\n"),
        )
        .unwrap();
    }
    let program = programs.join("ffmpeg");
    if let Some(script) = ffmpeg {
        fs::write(&program, format!("#!/bin/sh\n[ \"$1\" = -version ] && exit 0\n{script}\n")).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    }
    let mut command = rentix(room);
    command
        .arg("render")
        .arg(&frames)
        .arg("-o")
        .arg(room.join("it's"))
        .args(["--size", "8x8", "--device", "cpu"])
        .args(more);
    if !more.contains(&"--movie") {
        command.arg("--movie").arg(room.join("film.mp4"));
    }
    command.env("PATH", format!("{}:/bin:/usr/bin", programs.display()));
    if ffmpeg.is_none() {
        command.env("PATH", &programs);
    }
    let output = command.output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
    Run {
        status: output.status.code().unwrap_or(-1),
        stdout: text(output.stdout),
        stderr: text(output.stderr),
    }
}

#[test]
fn a_film_has_the_pictures_by_their_numbers() {
    let t = tempfile::tempdir().unwrap();
    let run = film(t.path(), Some(LISTS));
    assert_eq!(run.status, 0, "{}", run.stderr);
    let list = fs::read_to_string(t.path().join("film.mp4")).unwrap();
    let files: Vec<&str> = list.lines().filter_map(|l| l.strip_prefix("file ")?.rsplit('/').next()).collect();
    assert_eq!(files, ["f_1.png'", "f_2.png'", "f_10.png'"], "{list}");
    assert_eq!(list.matches(r"it'\''s/").count(), 3, "{list}");
    assert_eq!(list.matches("duration 0.0416").count(), 3, "{list}");
    let left: Vec<_> = fs::read_dir(t.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(!left.iter().any(|name| name.to_string_lossy().starts_with(".rentix-movie")), "{left:?}");
}

#[test]
fn without_ffmpeg_nothing_is_rendered() {
    let t = tempfile::tempdir().unwrap();
    let run = film(t.path(), None);
    assert_eq!(run.status, 2);
    assert!(
        run.stderr.contains("ffmpeg is not installed") && run.stderr.contains("--movie"),
        "{}",
        run.stderr
    );
    assert!(!t.path().join("it's").join("f_1.png").exists());
}

#[test]
fn what_ffmpeg_says_is_told_and_the_pictures_are_there() {
    let t = tempfile::tempdir().unwrap();
    let run = film(t.path(), Some("echo 'no such encoder' >&2; exit 1"));
    assert_eq!(run.status, 1);
    assert!(run.stderr.contains("film.mp4: ffmpeg made no film: no such encoder"), "{}", run.stderr);
    assert!(t.path().join("it's").join("f_10.png").exists() && !t.path().join("film.mp4").exists());
}

#[test]
fn a_film_runs_as_fast_as_the_job_says() {
    let t = tempfile::tempdir().unwrap();
    let job = t.path().join("job.yaml");
    fs::write(&job, "version: 1\nsequence: frames\nfps: 10\n").unwrap();
    let run = film_with(t.path(), Some(LISTS), &[job.to_str().unwrap()]);
    assert_eq!(run.status, 0, "{}", run.stderr);
    let list = fs::read_to_string(t.path().join("film.mp4")).unwrap();
    assert!(list.matches("duration 0.1\n").count() == 3 && list.contains("-r 10 "), "{list}");
}

#[test]
fn a_file_that_is_no_film_of_ours_is_kept() {
    let t = tempfile::tempdir().unwrap();
    let film_file = t.path().join("film.mp4");
    fs::write(&film_file, "edited by hand").unwrap();
    let run = film(t.path(), Some(LISTS));
    assert_eq!(run.status, 2, "{}", run.stderr);
    assert!(run.stderr.contains("film.mp4") && run.stderr.contains("--overwrite"), "{}", run.stderr);
    assert_eq!(fs::read_to_string(&film_file).unwrap(), "edited by hand");
    assert!(!t.path().join("it's").exists(), "it was told after the work");
    assert_eq!(film_with(t.path(), Some(LISTS), &["--overwrite"]).status, 0);
    // and what is ours is replaced
    let run = film(t.path(), Some(LISTS));
    assert_eq!(run.status, 0, "{}", run.stderr);
    assert!(fs::read_to_string(&film_file).unwrap().starts_with("ffconcat"));
}

#[test]
fn where_no_film_can_stand_is_told_before_the_work() {
    let t = tempfile::tempdir().unwrap();
    for (file, told) in [("absent/film.mp4", "make it first"), ("film", "FILE.mp4")] {
        let file = t.path().join(file);
        let run = film_with(t.path(), Some(LISTS), &["--movie", file.to_str().unwrap()]);
        assert!(run.status == 2 && run.stderr.contains(told), "{}", run.stderr);
        assert!(!t.path().join("it's").exists());
    }
}

#[test]
fn a_film_takes_no_part_of_the_job() {
    let t = tempfile::tempdir().unwrap();
    for (file, told) in [("frames/f_1.obj", "input"), ("it's/f_1.png", "picture")] {
        let file = t.path().join(file);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        let run = film_with(t.path(), Some(LISTS), &["--overwrite", "--movie", file.to_str().unwrap()]);
        assert!(run.status == 2 && run.stderr.contains(told), "{}", run.stderr);
    }
    assert!(fs::read_to_string(t.path().join("frames/f_1.obj")).unwrap().starts_with('v'));
}
