//! Nothing is lost: a picture is whole or absent, stands under its record, and is recognised when it is finished.

use rentix::output::{PictureFile, Records, RunLog, clean_up, finish, foreign};
use rentix::scene::PartHash;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn file(path: &str, bytes: impl Into<Vec<u8>>) -> PictureFile {
    PictureFile { path: path.into(), bytes: bytes.into() }
}

fn finished(folder: &Path, picture: &str, fingerprint: u128) -> bool {
    Records::read(folder).unwrap().finished(Path::new(picture), PartHash(fingerprint))
}

/// All files below a folder but records, relative to it.
fn files_below(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(f) = folders.pop() {
        for entry in f.read_dir().unwrap() {
            let path = entry.unwrap().path();
            if !path.is_dir() {
                files.push(path.strip_prefix(folder).unwrap().to_path_buf());
            } else if !path.ends_with(".rentix") {
                folders.push(path);
            }
        }
    }
    files.sort();
    files
}

#[test]
fn a_frame_is_finished_while_all_its_files_agree() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let log = RunLog::create(&out);
    finish(&log, PartHash(7), &[file("walk/a 1.png", b"picture"), file("walk/a 1.aov.exr", b"layers")])
        .unwrap();
    assert_eq!(files_below(&out), [Path::new("walk/a 1.aov.exr"), Path::new("walk/a 1.png")]);
    assert!(finished(&out, "walk/a 1.png", 7));
    assert!(!finished(&out, "walk/a 1.png", 8), "another fingerprint");
    assert!(!finished(&out, "walk/a 1.aov.exr", 7), "a side file is no picture");
    assert!(!finished(&out, "walk/a 2.png", 7), "another picture");

    for name in ["walk/a 1.png", "walk/a 1.aov.exr"] {
        let path = out.join(name);
        let whole = fs::read(&path).unwrap();
        fs::write(&path, &whole[1..]).unwrap();
        assert!(!finished(&out, "walk/a 1.png", 7), "{name} is shorter");
        let mut flipped = whole.clone();
        flipped[3] ^= 1;
        fs::write(&path, flipped).unwrap();
        assert!(!finished(&out, "walk/a 1.png", 7), "a bit of {name} is flipped");
        fs::remove_file(&path).unwrap();
        assert!(!finished(&out, "walk/a 1.png", 7), "{name} is gone");
        fs::write(&path, whole).unwrap();
        assert!(finished(&out, "walk/a 1.png", 7));
    }
}

#[test]
fn a_frame_made_anew_has_its_new_fingerprint() {
    let folder = tempfile::tempdir().unwrap();
    for (fingerprint, bytes) in [(1, b"one"), (2, b"two")] {
        finish(&RunLog::create(folder.path()), PartHash(fingerprint), &[file("a.png", bytes)]).unwrap();
    }
    assert!(!finished(folder.path(), "a.png", 1));
    assert!(finished(folder.path(), "a.png", 2));
}

#[test]
fn a_picture_that_cannot_be_placed_leaves_nothing_and_claims_nothing() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("a.png")).unwrap();
    let log = RunLog::create(folder.path());
    let error = finish(&log, PartHash(1), &[file("a.png", b"one"), file("a.aov.exr", b"two")]).unwrap_err();
    assert!(error.to_string().contains("a.png: cannot be written"), "{error}");
    assert!(files_below(folder.path()).iter().all(|f| f == Path::new("a.aov.exr")));
    assert!(!finished(folder.path(), "a.png", 1));
    // the log goes on
    finish(&log, PartHash(2), &[file("b.png", b"three")]).unwrap();
    assert!(finished(folder.path(), "b.png", 2));
}

#[test]
fn a_folder_that_vanishes_is_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let log = RunLog::create(&out);
    finish(&log, PartHash(1), &[file("a.png", b"one")]).unwrap();
    fs::remove_dir_all(&out).unwrap();
    finish(&log, PartHash(2), &[file("b.png", b"two")]).unwrap();
    assert_eq!(files_below(&out), [Path::new("b.png")]);
    assert!(finished(&out, "b.png", 2) && !finished(&out, "a.png", 1));
}

#[test]
fn foreign_files_are_those_that_no_record_names() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path();
    finish(&RunLog::create(out), PartHash(1), &[file("ours.png", b"1"), file("ours.aov.exr", b"2")]).unwrap();
    fs::write(out.join("mine.png"), "mine").unwrap();
    fs::create_dir(out.join("folder.png")).unwrap();
    let names = ["ours.png", "ours.aov.exr", "mine.png", "folder.png", "absent.png"].map(Path::new);
    let records = Records::read(out).unwrap();
    assert_eq!(foreign(out, names, &records), [Path::new("mine.png"), Path::new("folder.png")]);
}

#[test]
fn runs_beside_each_other_lose_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path();
    let logs = [0, 1, 2].map(|_| RunLog::create(out));
    std::thread::scope(|scope| {
        // two threads for each of three runs; all of them render frame 0, each one frames of its own too
        for (run, thread) in [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)] {
            let log = &logs[run];
            scope.spawn(move || {
                for i in 0..8u128 {
                    let own = 1 + i + 8 * (2 * run as u128 + thread);
                    for n in [0, own] {
                        let picture = file(&format!("{n}.png"), [n as u8; 1000]);
                        finish(log, PartHash(n), &[picture]).unwrap();
                        clean_up(out, [Path::new("0.png")]).unwrap();
                    }
                }
            });
        }
    });
    let records = Records::read(out).unwrap();
    for n in 0..=48u128 {
        assert!(records.finished(Path::new(&format!("{n}.png")), PartHash(n)), "frame {n}");
    }
    assert_eq!(files_below(out).len(), 49, "nothing temporary stays");
}

#[test]
#[cfg(unix)]
fn names_may_be_any_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let name: std::ffi::OsString = std::os::unix::ffi::OsStringExt::from_vec(b"\xff\t\n%41.png".to_vec());
    let picture = PictureFile { path: name.clone().into(), bytes: b"one".to_vec() };
    finish(&RunLog::create(folder.path()), PartHash(1), &[picture]).unwrap();
    assert!(Records::read(folder.path()).unwrap().finished(Path::new(&name), PartHash(1)));
}

#[test]
fn without_records_nothing_is_finished() {
    let folder = tempfile::tempdir().unwrap();
    assert!(!finished(folder.path(), "a.png", 1));
    assert!(!finished(&folder.path().join("no such folder"), "a.png", 1));
    clean_up(&folder.path().join("no such folder"), [Path::new("a.png")]).unwrap();
    fs::write(folder.path().join(".rentix"), "a file").unwrap();
    let error = Records::read(folder.path()).unwrap_err().to_string();
    assert!(error.contains(".rentix: cannot be read"), "{error}");
}

#[test]
#[cfg(unix)]
fn a_folder_without_rights_is_named() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o555)).unwrap();
    if fs::write(folder.path().join("probe"), "").is_ok() {
        println!("skipped: this user may write everywhere");
        return;
    }
    let error = finish(&RunLog::create(folder.path()), PartHash(1), &[file("a.png", b"one")]).unwrap_err();
    assert!(error.to_string().contains("make its folder writable"), "{error}");
}

/// The folder that the child of the next test writes to.
const CHILD_FOLDER: &str = "RENTIX_TEST_FULL_DISK";

/// No process may write more than 64 blocks to a file here, which is what a full disk is to it.
#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_leaves_no_torn_picture() {
    if let Some(out) = std::env::var_os(CHILD_FOLDER) {
        let log = RunLog::create(Path::new(&out));
        let error = finish(&log, PartHash(1), &[file("big.png", vec![7; 1 << 20])]).unwrap_err();
        assert!(error.to_string().contains("big.png: cannot be written"), "{error}");
        assert!(error.to_string().contains("free some space"), "{error}");
        finish(&log, PartHash(2), &[file("small.png", b"small")]).unwrap();
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let child = Command::new("sh")
        .args(["-c", "trap '' XFSZ; ulimit -f 64; exec \"$0\" --exact a_full_disk_leaves_no_torn_picture"])
        .arg(std::env::current_exe().unwrap())
        .env(CHILD_FOLDER, folder.path())
        .output()
        .unwrap();
    assert!(child.status.success(), "{}", String::from_utf8_lossy(&child.stdout));
    assert_eq!(files_below(folder.path()), [Path::new("small.png")]);
    assert!(finished(folder.path(), "small.png", 2));
}
