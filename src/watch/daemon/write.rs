//! Statuses on their way to the disk: what cannot be written now is tried again, and nothing is begun meanwhile.

use super::entry::Phase;
use super::{AGAIN, Daemon};
use crate::watch::journal::is_told;
use crate::watch::state::{State, Status};
use crate::watch::{WatchError, WatchEvent};
use std::path::Path;
use std::time::Duration;

/// What can wait is written for so long, the others' turn comes with the next call: thousands of new jobs do not keep those
/// that are rendered.
const WRITES: Duration = Duration::from_millis(50);
/// How often progress alone is written.
const PROGRESS: Duration = Duration::from_secs(1);

impl Daemon<'_> {
    /// Writes all statuses that are to be written and whose time it is: first into the journal, so that of an end that can be
    /// read somebody will be told.
    pub(super) fn write_all(&mut self) {
        let now = self.now();
        if self.is_full && now < self.blocked_until {
            return;
        }
        let mut due: Vec<(bool, u64)> = self
            .entries
            .iter()
            .filter(|(_, e)| e.dirty && e.named && e.retry <= now)
            .filter(|(_, e)| !e.changes.is_empty() || now.saturating_sub(e.wrote) >= PROGRESS)
            .map(|(id, e)| (e.phase != Phase::Ended && !self.current.contains(id), *id))
            .collect();
        // ends first
        due.sort_unstable();
        let (mut claimed, mut are_ends) = (Vec::new(), false);
        for (can_wait, id) in due {
            let is_blocked = self.is_full && now < self.blocked_until;
            if is_blocked || can_wait && self.now().saturating_sub(now) > WRITES {
                break;
            }
            match self.claim_and_journal(id) {
                Ok(true) => {
                    claimed.push(id);
                    are_ends |= self.entries[&id].phase == Phase::Ended;
                }
                Ok(false) => {}
                Err(error) => self.put_off(id, &error),
            }
        }
        let flushed = if are_ends { self.journal.flush() } else { Ok(()) };
        if let Err(error) = &flushed {
            self.in_the_way(&error.to_string());
        }
        for id in claimed {
            if let Err(error) = self.write_status(id) {
                self.put_off(id, &error);
            }
        }
    }

    /// Writes a job that has just got its name, so that its claim is free again.
    pub(super) fn write_first(&mut self, id: u64) {
        let written =
            self.claim_and_journal(id).and_then(|may| if may { self.write_status(id) } else { Ok(()) });
        if let Err(error) = written {
            self.put_off(id, &error);
        }
    }

    fn put_off(&mut self, id: u64, error: &WatchError) {
        self.in_the_way(&error.to_string());
        let again = self.now() + AGAIN;
        // one job whose folder refuses does not stop the others
        self.is_full = self.full_disk().is_some();
        if self.is_full {
            self.blocked_until = again;
        }
        if let Some(entry) = self.entries.get_mut(&id) {
            entry.retry = again;
        }
    }

    /// Whether the status is this daemon's to write; then its changes are in the journal.
    fn claim_and_journal(&mut self, id: u64) -> Result<bool, WatchError> {
        let now = self.now();
        let Some(entry) = self.entries.get_mut(&id) else { return Ok(false) };
        if entry.claim.as_ref().is_some_and(|claim| !claim.stands()) {
            // it was taken over by another daemon, to which this one seemed dead; what that one writes stands
            entry.claim = None;
            entry.hush();
            if let Some(stop) = &entry.stop {
                stop.ask();
            }
            if entry.phase == Phase::Ended {
                entry.phase = Phase::Settling;
            }
            let text = format!("{}: was taken over by another daemon", entry.status.job);
            self.note(&text);
            return Ok(false);
        }
        if entry.claim.is_none() {
            let Some(claim) = self.claims.take(&entry.status.job, now)? else {
                // another daemon works on it; what that one writes stands
                entry.retry = now + AGAIN / 4;
                return Ok(false);
            };
            entry.claim = Some(claim);
            if self.adopt(id) {
                return Ok(false);
            }
        }
        let Some(entry) = self.entries.get_mut(&id) else { return Ok(false) };
        if entry.journaled < entry.changes.len() {
            self.journal.append(&entry.changes[entry.journaled..])?;
            entry.journaled = entry.changes.len();
        }
        Ok(true)
    }

    fn write_status(&mut self, id: u64) -> Result<(), WatchError> {
        let now = self.now();
        let folder = self.out(&self.entries[&id]);
        let Some(entry) = self.entries.get_mut(&id) else { return Ok(()) };
        entry.status.write(&folder)?;
        entry.wrote = now;
        entry.dirty = false;
        entry.journaled = 0;
        let changes = std::mem::take(&mut entry.changes);
        let is_in_work =
            self.current.contains(&id) || entry.session.is_some() && entry.status.state == State::Running;
        if !is_in_work && let Some(claim) = entry.claim.take() {
            claim.give_back();
        }
        if entry.gone && entry.phase == Phase::Ended {
            self.entries.remove(&id);
        }
        for change in changes {
            self.tell(&change, &folder);
        }
        Ok(())
    }

    /// Tells of a new state.
    fn tell(&mut self, status: &Status, folder: &Path) {
        (self.on_event)(&WatchEvent::State(status));
        if !status.state.is_end() {
            return;
        }
        if let Some(view) = &self.view {
            view.lock().add_ended(status.clone());
        }
        if is_told(status) {
            self.notify(status, folder);
        }
    }

    /// Has somebody told of an end, where anybody is.
    pub(super) fn notify(&mut self, end: &Status, folder: &Path) {
        let Some(notifier) = &self.notifier else { return };
        match notifier.tell(end, folder) {
            Ok(()) => self.untold += 1,
            Err(text) => self.note(&text),
        }
    }

    /// Somebody was told of an end.
    pub(super) fn was_told(&mut self, end: &Status) {
        self.untold -= 1;
        if let Err(error) = self.journal.told(end) {
            // it is told of again by the next daemon
            self.in_the_way(&error.to_string());
        }
    }
}
