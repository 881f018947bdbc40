//! The journal: every change of a job's state, appended and never changed.
//!
//! One file a daemon, a line a change: a checksum (XXH3, 64 bits, hexadecimal) of the rest, a tab, and the status as
//! JSON. A line that is torn or damaged counts for nothing. At its start a daemon folds what dead ones left: of each job
//! the last line stands.

use super::state::Status;
use super::{WatchError, cannot};
use crate::output::{self, is_gone, own_name};
use std::collections::HashMap;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::xxh3_64;

const SUFFIX: &str = ".log";
/// Of so many jobs a fold keeps the last state, the latest first.
const JOBS_KEPT: usize = 10_000;
/// No line is longer; what is, is no line of a journal.
const LINE_BYTES_MAX: u64 = 1 << 20;

/// The journal that this daemon appends to.
#[derive(Debug)]
pub(super) struct Journal {
    path: PathBuf,
    /// None until the first line, and after one that failed: it may end torn, so that the next begins a line.
    file: Option<File>,
}

impl Journal {
    /// Folds what dead daemons left in a folder and begins a journal of its own. The second value is the last known status
    /// of each job, in no order.
    pub(super) fn open(folder: &Path) -> Result<(Self, Vec<Status>), WatchError> {
        fs::create_dir_all(folder).map_err(cannot("made", folder))?;
        let mut last: HashMap<String, Status> = HashMap::new();
        let mut dead = Vec::new();
        for entry in fs::read_dir(folder).map_err(cannot("read", folder))? {
            let path = entry.map_err(cannot("read", folder))?.path();
            let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
            let Some(owner) = name.strip_suffix(SUFFIX) else { continue };
            for status in read(&path)? {
                let known = last.get(&status.job).map(latest);
                if known.is_none_or(|at| at <= latest(&status)) {
                    last.insert(status.job.clone(), status);
                }
            }
            if is_gone(owner) {
                dead.push(path);
            }
        }
        let mut last: Vec<Status> = last.into_values().collect();
        last.sort_by_key(|status| std::cmp::Reverse(latest(status)));
        last.truncate(JOBS_KEPT);
        let path = folder.join(own_name("", SUFFIX));
        if !dead.is_empty() {
            let folded: String = last.iter().rev().map(line).collect();
            output::write_atomic(&path, folded.as_bytes())?;
            for path in dead {
                match fs::remove_file(&path) {
                    // another daemon folds at the same time
                    Err(error) if error.kind() != ErrorKind::NotFound => {
                        return Err(cannot("removed", &path)(error));
                    }
                    _ => {}
                }
            }
        }
        Ok((Self { path, file: None }, last))
    }

    /// Appends a status in one write; `flush` waits until it is on the disk.
    pub(super) fn append(&mut self, status: &Status, flush: bool) -> Result<(), WatchError> {
        let was_torn = self.file.is_none() && self.path.metadata().is_ok_and(|m| m.len() > 0);
        let mut file = match self.file.take().filter(|_| self.path.exists()) {
            Some(file) => file,
            None => File::options()
                .append(true)
                .create(true)
                .open(&self.path)
                .map_err(cannot("written", &self.path))?,
        };
        let text = if was_torn { format!("\n{}", line(status)) } else { line(status) };
        let written = file.write_all(text.as_bytes());
        written
            .and_then(|()| if flush { file.sync_data() } else { Ok(()) })
            .map_err(cannot("written", &self.path))?;
        self.file = Some(file);
        Ok(())
    }
}

/// When a status was last changed.
fn latest(status: &Status) -> u64 {
    let t = &status.times;
    [Some(t.received_ms), t.accepted_ms, t.started_ms, t.ended_ms].into_iter().flatten().max().unwrap_or(0)
}

fn line(status: &Status) -> String {
    let json = serde_json::to_string(status).unwrap_or_default();
    format!("{:016x}\t{json}\n", xxh3_64(json.as_bytes()))
}

fn from_line(line: &[u8]) -> Option<Status> {
    let (checksum, json) = std::str::from_utf8(line).ok()?.split_once('\t')?;
    let is_whole = u64::from_str_radix(checksum, 16).ok()? == xxh3_64(json.as_bytes());
    serde_json::from_str(json).ok().filter(|_| is_whole)
}

/// The lines of a journal that are whole; one that another daemon has folded meanwhile has none.
fn read(path: &Path) -> Result<Vec<Status>, WatchError> {
    let file = match File::open(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        file => file.map_err(cannot("read", path))?,
    };
    let mut file = BufReader::new(file);
    let mut found = Vec::new();
    loop {
        let mut line = Vec::new();
        let read = (&mut file).take(LINE_BYTES_MAX).read_until(b'\n', &mut line);
        if read.map_err(cannot("read", path))? == 0 {
            return Ok(found);
        }
        // without its line end it is torn
        found.extend(line.strip_suffix(b"\n").and_then(from_line));
    }
}

#[cfg(test)]
mod tests {
    use super::super::state::State;
    use super::*;

    fn status(job: &str, state: State, at_ms: u64) -> Status {
        let mut status = Status { job: job.into(), state, ..Status::default() };
        status.times.received_ms = at_ms;
        status
    }

    #[test]
    fn torn_at_every_byte_a_journal_keeps_what_was_whole() {
        let t = tempfile::tempdir().unwrap();
        let path = t.path().join("j.log");
        let lines: Vec<String> =
            [State::Received, State::Queued, State::Finished].map(|s| line(&status("a", s, 1))).into();
        let whole = lines.concat();
        for cut in 0..=whole.len() {
            fs::write(&path, &whole[..cut]).unwrap();
            let expected = whole[..cut].matches('\n').count();
            assert_eq!(read(&path).unwrap().len(), expected, "cut at {cut}");
        }
        // a damaged byte costs its own line alone
        for at in 0..whole.len() {
            let mut bytes = whole.clone().into_bytes();
            bytes[at] ^= 1;
            fs::write(&path, &bytes).unwrap();
            let left = read(&path).unwrap().len();
            assert!((1..=2).contains(&left), "byte {at}: {left}");
        }
    }

    #[test]
    fn the_last_state_stands_and_appending_goes_on_after_a_torn_line() {
        let t = tempfile::tempdir().unwrap();
        let (mut one, none) = Journal::open(t.path()).unwrap();
        assert!(none.is_empty());
        one.append(&status("a", State::Received, 1), false).unwrap();
        one.append(&status("b", State::Received, 2), true).unwrap();
        one.append(&status("a", State::Finished, 3), true).unwrap();
        File::options().append(true).open(&one.path).unwrap().write_all(b"0123\t{torn").unwrap();
        one.file = None;
        one.append(&status("b", State::Failed, 4), true).unwrap();
        let (_, mut last) = Journal::open(t.path()).unwrap();
        last.sort_by(|a, b| a.job.cmp(&b.job));
        assert_eq!(last, [status("a", State::Finished, 3), status("b", State::Failed, 4)]);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn journals_of_dead_daemons_are_folded() {
        let t = tempfile::tempdir().unwrap();
        let mut child = std::process::Command::new("true").spawn().unwrap();
        child.wait().unwrap();
        let own = own_name("", SUFFIX);
        let dead = own.replace(&format!(".{}.", std::process::id()), &format!(".{}.", child.id()));
        let lines = [line(&status("a", State::Queued, 1)), line(&status("a", State::Finished, 2))].concat();
        fs::write(t.path().join(dead), lines + "torn").unwrap();
        for _ in 0..2 {
            let (_, last) = Journal::open(t.path()).unwrap();
            assert_eq!(last, [status("a", State::Finished, 2)]);
        }
        assert_eq!(fs::read_dir(t.path()).unwrap().count(), 1, "one file, and an empty one is not made");
    }
}
