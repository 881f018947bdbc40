//! What is known of one thing in the inbox.

use super::session::Session;
use crate::device::Stop;
use crate::watch::claim::Claim;
use crate::watch::inbox::Found;
use crate::watch::settle::{Seen, Settling};
use crate::watch::state::{State, Status};
use std::sync::Arc;
use std::time::Duration;

/// What is being done with it here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// It may still grow.
    Settling,
    /// It is whole and being looked into.
    Examining,
    /// It waits for its turn.
    Queued,
    /// It is being rendered.
    Running,
    /// Nothing, until it changes.
    Ended,
}

/// The word of a settled set in a status.
pub(super) fn run_word(seen: &Seen) -> String {
    format!("{:032x}", seen.run)
}

/// One thing in the inbox.
#[derive(Debug)]
pub(super) struct Entry {
    pub(super) found: Found,
    /// Whether its job has its name; until then the status is not written.
    pub(super) named: bool,
    pub(super) settling: Option<Settling>,
    /// When it is to be looked at next.
    pub(super) due: Duration,
    /// Since when it cannot be looked at.
    pub(super) unseen: Option<Duration>,
    /// It is not looked at before, whatever is told of it.
    pub(super) rests: Duration,
    pub(super) phase: Phase,
    pub(super) status: Status,
    /// Its changes of state that are still to be told of, each as the status was then, the last one last.
    pub(super) changes: Vec<Status>,
    /// So many of them are in the journal.
    pub(super) journaled: usize,
    /// Whether the status is to be written.
    pub(super) dirty: bool,
    /// When it was written last.
    pub(super) wrote: Duration,
    /// Nothing is tried before.
    pub(super) retry: Duration,
    /// It is not begun before.
    pub(super) not_before: Duration,
    pub(super) claim: Option<Claim>,
    /// Asks what is being rendered of it to stop.
    pub(super) stop: Option<Arc<Stop>>,
    /// Its owner does not want it: why.
    pub(super) unwanted: Option<String>,
    /// It is not in the inbox any more.
    pub(super) gone: bool,
    /// Its growing sequence, where it is followed.
    pub(super) session: Option<Session>,
    /// The first frame of its run that failed, and why.
    pub(super) first_error: Option<String>,
}

impl Entry {
    pub(super) fn new(found: Found) -> Self {
        let source = found.file.to_string_lossy().into_owned();
        Self {
            found,
            named: false,
            settling: None,
            due: Duration::ZERO,
            unseen: None,
            rests: Duration::ZERO,
            phase: Phase::Settling,
            status: Status { source, ..Status::default() },
            changes: Vec::new(),
            journaled: 0,
            dirty: false,
            wrote: Duration::ZERO,
            retry: Duration::ZERO,
            not_before: Duration::ZERO,
            claim: None,
            stop: None,
            unwanted: None,
            gone: false,
            session: None,
            first_error: None,
        }
    }

    /// Comes into a state, to be written.
    pub(super) fn enter(&mut self, state: State, error: Option<String>) {
        self.status.enter(state, error);
        self.changes.push(self.status.clone());
        self.dirty = true;
        if state.is_end() {
            self.phase = Phase::Ended;
            self.session = None;
        }
    }

    /// Leaves what happened to it here untold: another daemon's word stands.
    pub(super) fn hush(&mut self) {
        self.changes.clear();
        self.journaled = 0;
        self.dirty = false;
    }

    /// Whether a status on the disk, another daemon's, is the end of its very run: of the files that are seen, where none was
    /// accepted yet. Then a cancelled one is wanted again.
    pub(super) fn is_ended_by(&self, known: &Status) -> bool {
        let is_run = if self.status.run.is_empty() {
            let seen = self.settling.is_some_and(|s| known.ended(&run_word(s.seen())));
            seen && known.state != State::Cancelled
        } else {
            known.ended(&self.status.run)
        };
        is_run && known.source == self.status.source
    }

    /// Whether nothing more is to be done with it, as far as it is known. An empty folder is not yet a job.
    pub(super) fn is_over(&self) -> bool {
        let is_empty = self.phase == Phase::Settling && self.settling.is_some_and(|s| s.seen().files == 0);
        !self.dirty && (self.phase == Phase::Ended || is_empty)
    }

    pub(super) fn has_failed(&self) -> bool {
        self.phase == Phase::Ended && self.status.state == State::Failed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watch::inbox::Kind;

    #[test]
    fn what_another_daemon_has_ended_is_not_begun_again() {
        let found = Found { file: "walk".into(), kind: Kind::Folder, name: "walk".into() };
        let mut entry = Entry::new(found);
        let seen = Seen { run: 7, ..Seen::default() };
        entry.settling = Some(Settling::new(seen, Duration::ZERO));
        let ended = |run: u128, state: State| {
            let run = run_word(&Seen { run, ..seen });
            Status { source: "walk".into(), run, state, ..Status::default() }
        };
        // it changed here, and is received again
        entry.enter(State::Received, None);
        assert!(entry.is_ended_by(&ended(7, State::Finished)) && entry.is_ended_by(&ended(7, State::Failed)));
        assert!(!entry.is_ended_by(&ended(6, State::Finished)), "that is the run before");
        assert!(!entry.is_ended_by(&ended(7, State::Running)));
        assert!(!entry.is_ended_by(&ended(7, State::Cancelled)), "it is wanted again");
        let other = Status { source: "walk.zip".into(), ..ended(7, State::Finished) };
        assert!(!entry.is_ended_by(&other));
        entry.status.run = ended(6, State::Accepted).run;
        assert!(
            entry.is_ended_by(&ended(6, State::Cancelled)) && !entry.is_ended_by(&ended(7, State::Finished))
        );
    }
}
