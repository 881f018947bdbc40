//! What the tests of the watch folder share.
#![allow(dead_code, unreachable_pub, reason = "each test file uses its own share")]

use crate::common::{Run, pictures, render, run, wave};
use serde_json::Value;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// What does not come about for so long hangs.
pub const PATIENCE: Duration = Duration::from_mins(2);

/// Waits for something, and fails where it does not come about.
pub fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let since = Instant::now();
    while !is_so() {
        assert!(since.elapsed() < PATIENCE, "{what}: waited {PATIENCE:?} in vain");
        std::thread::yield_now();
    }
}

/// Size of the pictures.
pub const SMALL: [&str; 2] = ["--size", "64x36"];

/// An inbox, and daemons over it with short settling.
pub struct Watched {
    pub t: tempfile::TempDir,
}

impl Watched {
    pub fn new() -> Self {
        let t = tempfile::tempdir().unwrap();
        fs::create_dir(t.path().join("inbox")).unwrap();
        Self { t }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.t.path().join(name)
    }

    pub fn args(&self, more: &[&str]) -> Vec<std::ffi::OsString> {
        let (inbox, out) = (self.path("inbox"), self.path("done"));
        let mut args: Vec<&OsStr> = vec!["watch".as_ref(), inbox.as_ref(), "-o".as_ref(), out.as_ref()];
        args.extend(["--settle", "0.05", "--once"].map(OsStr::new));
        args.extend(SMALL.iter().chain(more).map(OsStr::new));
        args.into_iter().map(OsStr::to_os_string).collect()
    }

    /// Watches until all that is there has ended.
    pub fn once(&self, more: &[&str], status: i32) -> Run {
        let run = run(self.t.path(), self.args(more));
        assert_eq!(run.status, status, "{more:?}: {}", run.stderr);
        run
    }

    pub fn job(&self, name: &str, frames: u32) -> PathBuf {
        wave(&self.path("inbox").join(name), frames, 6, 8)
    }

    pub fn status(&self, job: &str) -> Value {
        serde_json::from_slice(&fs::read(self.path("done").join(job).join("status.json")).unwrap()).unwrap()
    }

    pub fn done(&self, job: &str) -> std::collections::BTreeMap<String, Vec<u8>> {
        let mut files = pictures(&self.path("done").join(job));
        files.remove("status.json");
        files
    }

    /// What `render` makes of a folder.
    pub fn wanted(&self, input: &Path, more: &[&str]) -> std::collections::BTreeMap<String, Vec<u8>> {
        let _ = fs::remove_dir_all(self.path("want"));
        render(self.t.path(), input, "want", &[&SMALL, more].concat(), 0);
        pictures(&self.path("want"))
    }
}
