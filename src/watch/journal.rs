//! The journal: every change of a job's state, appended and never changed.
//!
//! One file a daemon, of the name of its claims, a line a change: a checksum (XXH3, 64 bits, hexadecimal) of the rest, a tab,
//! and the status as JSON. A line that is torn or damaged counts for nothing. A daemon folds what dead ones left, at its
//! start and later: of each job the last line stands.
//!
//! The line of an end that somebody is to be told of says that this is due, and another one that it was done; what was due
//! when its daemon died is for the one that folds its journal to tell.

use super::state::{State, Status};
use super::{WatchError, cannot};
use crate::output::{self, is_gone};
use serde::{Deserialize, Serialize};
use std::collections::{HashMap, HashSet};
use std::fs::{self, File};
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::xxh3_64;

const SUFFIX: &str = ".log";
/// Of so many jobs a fold keeps the last state, the latest first. Ends that are due are all kept.
const JOBS_KEPT: usize = 10_000;
/// After so many bytes a journal is folded, which takes a fifth of a second.
const BYTES_MAX: u64 = 16 << 20;
/// No line is longer; what is, is no line of a journal.
const LINE_BYTES_MAX: u64 = 1 << 20;

/// The journal that this daemon appends to.
#[derive(Debug)]
pub(super) struct Journal {
    path: PathBuf,
    /// None until the first line, and after one that failed: it may end torn, so that the next begins a line.
    file: Option<File>,
    /// Whether somebody is to be told of ends.
    tells: bool,
    /// Bytes appended since it was folded.
    bytes: u64,
}

/// What earlier daemons wrote down.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Known {
    /// The last known status of each job, the latest first.
    pub(super) last: Vec<Status>,
    /// Ends of which daemons that are dead told nobody.
    pub(super) due: Vec<Status>,
}

/// What a line says of telling of an end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Notice {
    Due,
    Told,
}

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Line {
    #[serde(flatten)]
    status: Status,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    notice: Option<Notice>,
}

impl Journal {
    /// Folds what dead daemons left in a folder and begins the journal of one of that name, in which ends are marked that
    /// somebody is to be told of, where anybody is.
    pub(super) fn open(folder: &Path, me: &str, tells: bool) -> Result<(Self, Known), WatchError> {
        fs::create_dir_all(folder).map_err(cannot("made", folder))?;
        let mut gathered = Gathered::default();
        let mut dead = Vec::new();
        for (path, owner) in journals(folder)? {
            let is_dead = is_gone(&owner);
            gathered.read(&path, is_dead)?;
            if is_dead {
                dead.push(path);
            }
        }
        let known = gathered.known(tells);
        let mut journal = Self { path: folder.join(format!("{me}{SUFFIX}")), file: None, tells, bytes: 0 };
        if !dead.is_empty() {
            journal.fold(&known, &dead)?;
        }
        Ok((journal, known))
    }

    /// Folds what daemons left that are dead by now: of another host, or of a container that is gone, that shows in time
    /// alone. Returns their ends that are due; where nobody is told of ends, they are left to those who tell.
    pub(super) fn take_over(
        &mut self,
        mut lives: impl FnMut(&str) -> bool,
    ) -> Result<Vec<Status>, WatchError> {
        let folder = self.path.parent().unwrap_or(Path::new("."));
        if !self.tells || !folder.exists() {
            return Ok(Vec::new());
        }
        let mut others = journals(folder)?;
        others.retain(|(path, owner)| *path != self.path && !lives(owner));
        let dead: Vec<PathBuf> = others.into_iter().map(|(path, _)| path).collect();
        if dead.is_empty() {
            return Ok(Vec::new());
        }
        let mut theirs = Gathered::default();
        dead.iter().try_for_each(|path| theirs.read(path, true))?;
        self.fold_own(&dead)?;
        Ok(theirs.known(true).due)
    }

    /// Begins with what is known, in place of other files.
    fn fold(&mut self, known: &Known, others: &[PathBuf]) -> Result<(), WatchError> {
        // the last states last: in one file the later line wins
        let due = known.due.iter().map(|status| line(status, Some(Notice::Due)));
        let text: String = due.chain(known.last.iter().rev().map(|status| line(status, None))).collect();
        output::write_atomic(&self.path, text.as_bytes())?;
        for path in others {
            match fs::remove_file(path) {
                // another daemon folds at the same time
                Err(error) if error.kind() != ErrorKind::NotFound => {
                    return Err(cannot("removed", path)(error));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Appends statuses of a job in one write. A kill loses none of them; a power cut may, until they are flushed.
    pub(super) fn append(&mut self, statuses: &[Status]) -> Result<(), WatchError> {
        let notice = |status: &Status| (self.tells && is_told(status)).then_some(Notice::Due);
        let text = statuses.iter().map(|status| line(status, notice(status))).collect();
        self.append_text(text)
    }

    /// Appends that an end was told of.
    pub(super) fn told(&mut self, end: &Status) -> Result<(), WatchError> {
        self.append_text(line(end, Some(Notice::Told)))
    }

    /// Waits, where somebody is to be told of ends, until what was appended is on the disk.
    pub(super) fn flush(&mut self) -> Result<(), WatchError> {
        let Some(file) = self.file.as_ref().filter(|_| self.tells) else { return Ok(()) };
        file.sync_data().map_err(cannot("written", &self.path))
    }

    fn append_text(&mut self, mut text: String) -> Result<(), WatchError> {
        if self.bytes > BYTES_MAX {
            self.fold_own(&[])?;
        }
        let was_torn = self.file.is_none() && self.path.metadata().is_ok_and(|m| m.len() > 0);
        let mut file = match self.file.take().filter(|_| self.path.exists()) {
            Some(file) => file,
            None => open(&self.path).map_err(cannot("written", &self.path))?,
        };
        if was_torn {
            text.insert(0, '\n');
        }
        file.write_all(text.as_bytes()).map_err(cannot("written", &self.path))?;
        self.bytes += text.len() as u64;
        self.file = Some(file);
        Ok(())
    }

    /// Goes on in a file that holds what is left of this one and of other ones.
    fn fold_own(&mut self, others: &[PathBuf]) -> Result<(), WatchError> {
        let mut gathered = Gathered::default();
        gathered.read(&self.path, true)?;
        others.iter().try_for_each(|path| gathered.read(path, true))?;
        (self.file, self.bytes) = (None, 0);
        self.fold(&gathered.known(self.tells), others)
    }
}

/// The journals in a folder and the names of their daemons.
fn journals(folder: &Path) -> Result<Vec<(PathBuf, String)>, WatchError> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(cannot("read", folder))? {
        let path = entry.map_err(cannot("read", folder))?.path();
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
        if let Some(owner) = name.strip_suffix(SUFFIX) {
            let owner = owner.to_owned();
            found.push((path, owner));
        }
    }
    Ok(found)
}

/// Opens a journal to append to; its folder may have been removed.
fn open(path: &Path) -> std::io::Result<File> {
    path.parent().map_or(Ok(()), fs::create_dir_all)?;
    File::options().append(true).create(true).open(path)
}

/// What is gathered from journals.
#[derive(Default)]
struct Gathered {
    /// Of each job the last status.
    last: HashMap<String, Status>,
    /// The same of the file that is being read, in which a later line wins, whatever its times: a job that is received
    /// again has none of its own.
    of_file: HashMap<String, Status>,
    due: HashMap<(String, Option<u64>), Status>,
    told: HashSet<(String, Option<u64>)>,
}

impl Gathered {
    /// Takes the lines of a journal that are whole; one that another daemon has folded meanwhile has none. What is due in it
    /// counts where its daemon does not tell of it any more.
    fn read(&mut self, path: &Path, takes_due: bool) -> Result<(), WatchError> {
        let file = match File::open(path) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
            file => file.map_err(cannot("read", path))?,
        };
        let mut file = BufReader::new(file);
        loop {
            let mut line = Vec::new();
            let read = (&mut file).take(LINE_BYTES_MAX).read_until(b'\n', &mut line);
            if read.map_err(cannot("read", path))? == 0 {
                self.merge();
                return Ok(());
            }
            // without its line end it is torn
            if let Some(line) = line.strip_suffix(b"\n").and_then(from_line) {
                self.take(line, takes_due);
            }
        }
    }

    fn take(&mut self, Line { status, notice }: Line, takes_due: bool) {
        match notice {
            Some(Notice::Due) if takes_due => drop(self.due.insert(end_of(&status), status.clone())),
            // it says nothing of the job, which may have gone on meanwhile
            Some(Notice::Told) => {
                self.told.insert(end_of(&status));
                return;
            }
            _ => {}
        }
        self.of_file.insert(status.job.clone(), status);
    }

    /// Takes what the file that was read says last of each job; of several files the later change stands.
    fn merge(&mut self) {
        for (job, status) in self.of_file.drain() {
            let known = self.last.get(&job).map(latest);
            if known.is_none_or(|at| at <= latest(&status)) {
                self.last.insert(job, status);
            }
        }
    }

    fn known(self, tells: bool) -> Known {
        let mut last: Vec<Status> = self.last.into_values().collect();
        last.sort_by_key(|status| std::cmp::Reverse(latest(status)));
        last.truncate(JOBS_KEPT);
        let due = self.due.into_iter().filter(|(end, _)| tells && !self.told.contains(end));
        let mut due: Vec<Status> = due.map(|(_, status)| status).collect();
        due.sort_by_key(latest);
        Known { last, due }
    }
}

/// Whether somebody is told of that state, where anybody is: finished and failed jobs.
pub(super) fn is_told(status: &Status) -> bool {
    matches!(status.state, State::Finished | State::Failed)
}

/// Tells the ends of all jobs apart.
fn end_of(status: &Status) -> (String, Option<u64>) {
    (status.job.clone(), status.times.ended_ms)
}

/// When a status was last changed.
fn latest(status: &Status) -> u64 {
    let t = &status.times;
    [Some(t.received_ms), t.accepted_ms, t.started_ms, t.ended_ms].into_iter().flatten().max().unwrap_or(0)
}

fn line(status: &Status, notice: Option<Notice>) -> String {
    let json = serde_json::to_string(&Line { status: status.clone(), notice }).unwrap_or_default();
    format!("{:016x}\t{json}\n", xxh3_64(json.as_bytes()))
}

fn from_line(line: &[u8]) -> Option<Line> {
    let (checksum, json) = std::str::from_utf8(line).ok()?.split_once('\t')?;
    let is_whole = u64::from_str_radix(checksum, 16).ok()? == xxh3_64(json.as_bytes());
    serde_json::from_str(json).ok().filter(|_| is_whole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::own_name;

    fn status(job: &str, state: State, at_ms: u64) -> Status {
        let mut status = Status { job: job.into(), state, ..Status::default() };
        status.times.received_ms = at_ms;
        status
    }

    fn open_new(folder: &Path, tells: bool) -> Result<(Journal, Known), WatchError> {
        Journal::open(folder, &own_name("", ""), tells)
    }

    #[test]
    fn torn_at_every_byte_a_journal_keeps_what_was_whole() {
        let t = tempfile::tempdir().unwrap();
        let path = t.path().join("j.log");
        let read = |path: &Path| {
            let bytes = fs::read(path).unwrap();
            bytes.split_inclusive(|b| *b == b'\n').filter_map(|l| from_line(l.strip_suffix(b"\n")?)).count()
        };
        let lines: Vec<String> =
            [State::Received, State::Queued, State::Finished].map(|s| line(&status("a", s, 1), None)).into();
        let whole = lines.concat();
        for cut in 0..=whole.len() {
            fs::write(&path, &whole[..cut]).unwrap();
            let expected = whole[..cut].matches('\n').count();
            assert_eq!(read(&path), expected, "cut at {cut}");
        }
        // a damaged byte costs its own line alone
        for at in 0..whole.len() {
            let mut bytes = whole.clone().into_bytes();
            bytes[at] ^= 1;
            fs::write(&path, &bytes).unwrap();
            let left = read(&path);
            assert!((1..=2).contains(&left), "byte {at}: {left}");
        }
    }

    #[test]
    fn the_last_state_stands_and_appending_goes_on_after_a_torn_line() {
        let t = tempfile::tempdir().unwrap();
        let (mut one, none) = open_new(t.path(), true).unwrap();
        assert_eq!(none, Known::default());
        one.append(&[status("a", State::Received, 1)]).unwrap();
        one.append(&[status("b", State::Received, 2)]).unwrap();
        one.append(&[status("a", State::Running, 3), status("a", State::Finished, 3)]).unwrap();
        one.flush().unwrap();
        File::options().append(true).open(&one.path).unwrap().write_all(b"0123\t{torn").unwrap();
        one.file = None;
        one.append(&[status("b", State::Failed, 4)]).unwrap();
        let (_, mut known) = open_new(t.path(), true).unwrap();
        known.last.sort_by(|a, b| a.job.cmp(&b.job));
        assert_eq!(known.last, [status("a", State::Finished, 3), status("b", State::Failed, 4)]);
        assert_eq!(known.due, [], "the one that lives tells of its ends");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn journals_of_dead_daemons_are_folded() {
        let t = tempfile::tempdir().unwrap();
        let dead = dead_name();
        let lines =
            [line(&status("a", State::Queued, 1), None), line(&status("a", State::Finished, 2), None)]
                .concat();
        fs::write(t.path().join(dead), lines + "torn").unwrap();
        for _ in 0..2 {
            let (_, known) = open_new(t.path(), true).unwrap();
            assert_eq!(known, Known { last: vec![status("a", State::Finished, 2)], due: Vec::new() });
        }
        assert_eq!(fs::read_dir(t.path()).unwrap().count(), 1, "one file, and an empty one is not made");
    }

    #[test]
    fn a_journal_that_grows_is_folded_and_nothing_that_is_due_is_lost() {
        let t = tempfile::tempdir().unwrap();
        let (mut journal, _) = open_new(t.path(), true).unwrap();
        journal.append(&[status("due", State::Failed, 1), status("told", State::Failed, 1)]).unwrap();
        journal.told(&status("told", State::Failed, 1)).unwrap();
        for n in 2..100 {
            journal.append(&[status("a", State::Running, n)]).unwrap();
        }
        journal.bytes = BYTES_MAX + 1;
        journal.append(&[status("a", State::Finished, 100)]).unwrap();
        assert_eq!(fs::read_dir(t.path()).unwrap().count(), 1);
        let text = fs::read_to_string(&journal.path).unwrap();
        let lines = text.lines().filter(|line| !line.is_empty());
        assert_eq!(lines.count(), 5, "the last of each, what is due, and what was appended: {text}");
        let mut gathered = Gathered::default();
        gathered.read(&journal.path, true).unwrap();
        let known = gathered.known(true);
        assert_eq!(known.last[0], status("a", State::Finished, 100));
        assert_eq!(known.due, [status("due", State::Failed, 1), status("a", State::Finished, 100)]);
        fs::remove_dir_all(t.path()).unwrap();
        journal.append(&[status("b", State::Running, 101)]).unwrap();
        assert!(journal.path.exists(), "its folder is made anew");
    }

    #[test]
    fn what_is_due_in_a_journal_from_elsewhere_is_taken_over_once_its_daemon_is_dead() {
        let t = tempfile::tempdir().unwrap();
        let other = || Journal::open(t.path(), "elsewhere.7.0", true).unwrap();
        let end = status("a", State::Failed, 1);
        other().0.append(std::slice::from_ref(&end)).unwrap();
        let (mut journal, known) = open_new(t.path(), true).unwrap();
        assert_eq!(known.due, [], "it may live");
        journal.append(&[status("own", State::Finished, 2)]).unwrap();
        assert_eq!(journal.take_over(|_| true).unwrap(), []);
        let silent = open_new(t.path(), false).unwrap().0.take_over(|_| false).unwrap();
        assert_eq!(silent, [], "that one tells nobody");
        assert_eq!(journal.take_over(|owner| owner != "elsewhere.7.0").unwrap(), [end]);
        assert_eq!(journal.take_over(|_| false).unwrap(), [], "once");
        let mut left = Gathered::default();
        left.read(&journal.path, true).unwrap();
        assert_eq!(left.known(true).due.len(), 2, "until it was told it is due");
    }

    #[test]
    fn no_end_that_is_due_is_dropped() {
        let ends = JOBS_KEPT + 1;
        let mut gathered = Gathered::default();
        for n in 0..ends {
            let status = status(&n.to_string(), State::Finished, 1);
            gathered.take(Line { status, notice: Some(Notice::Due) }, true);
        }
        gathered.merge();
        let known = gathered.known(true);
        assert_eq!((known.last.len(), known.due.len()), (JOBS_KEPT, ends));
    }

    #[test]
    fn in_one_file_the_later_line_wins() {
        let t = tempfile::tempdir().unwrap();
        let (mut journal, _) = open_new(t.path(), true).unwrap();
        let mut end = status("a", State::Finished, 1);
        end.times.ended_ms = Some(9);
        // it changed, and is received again before its end was told of
        journal.append(&[end.clone(), status("a", State::Received, 1)]).unwrap();
        for told in [false, true] {
            if told {
                journal.told(&end).unwrap();
            }
            journal.fold_own(&[]).unwrap();
            let mut gathered = Gathered::default();
            gathered.read(&journal.path, true).unwrap();
            let known = gathered.known(true);
            assert_eq!(known.last, [status("a", State::Received, 1)], "told: {told}");
            assert_eq!(known.due.len(), usize::from(!told));
        }
    }

    /// The name of a journal whose daemon is dead.
    #[cfg(target_os = "linux")]
    fn dead_name() -> String {
        let mut child = std::process::Command::new("true").spawn().unwrap();
        child.wait().unwrap();
        own_name("", SUFFIX).replace(&format!(".{}.", std::process::id()), &format!(".{}.", child.id()))
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn what_a_dead_daemon_told_nobody_of_is_due() {
        let t = tempfile::tempdir().unwrap();
        let ends = [("a", State::Finished, 1), ("b", State::Failed, 2), ("c", State::Cancelled, 3)];
        let ends = ends.map(|(job, state, at_ms)| {
            let mut status = status(job, state, at_ms);
            status.times.ended_ms = Some(at_ms);
            status
        });
        let due_next = |told: &[Status]| {
            let (mut journal, _) = open_new(t.path(), true).unwrap();
            journal.append(&ends).unwrap();
            for end in told {
                journal.told(end).unwrap();
            }
            fs::rename(&journal.path, t.path().join(dead_name())).unwrap();
            // twice: the one that tells of it may be killed, too
            let once = open_new(t.path(), true).unwrap();
            fs::rename(&once.0.path, t.path().join(dead_name())).unwrap();
            let again = open_new(t.path(), true).unwrap();
            assert_eq!(once.1.due, again.1.due);
            fs::rename(&again.0.path, t.path().join(dead_name())).unwrap();
            assert_eq!(open_new(t.path(), false).unwrap().1.due, [], "where nobody is to be told");
            for left in fs::read_dir(t.path()).unwrap() {
                fs::remove_file(left.unwrap().path()).unwrap();
            }
            again.1.due
        };
        assert_eq!(due_next(&[]), ends[..2], "of what was cancelled nobody is told");
        assert_eq!(due_next(&ends[1..2]), ends[..1]);
        assert_eq!(due_next(&ends[..2]), []);
    }
}
