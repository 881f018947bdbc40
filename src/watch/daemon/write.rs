//! Statuses on their way to the disk: what cannot be written now is tried again, and nothing is begun meanwhile.

use super::entry::Phase;
use super::{AGAIN, Daemon};
use crate::watch::state::State;
use crate::watch::{WatchError, WatchEvent};
use std::time::Duration;

/// Statuses are written for so long, the others' turn comes with the next call: thousands of new jobs do not keep the first
/// from being begun.
const WRITES: Duration = Duration::from_millis(200);
/// How often progress alone is written.
const PROGRESS: Duration = Duration::from_secs(1);

impl Daemon<'_> {
    /// Writes all statuses that are to be written and whose time it is.
    pub(super) fn write_all(&mut self) {
        let now = self.now();
        let mut due: Vec<(bool, u64)> = self
            .entries
            .iter()
            .filter(|(_, e)| e.dirty && e.named && e.retry <= now)
            .filter(|(_, e)| e.written != Some(e.status.state) || now.saturating_sub(e.wrote) >= PROGRESS)
            .map(|(id, e)| (e.phase != Phase::Ended && !self.current.contains(id), *id))
            .collect();
        // ends first
        due.sort_unstable();
        for (can_wait, id) in due {
            if can_wait && self.now().saturating_sub(now) > WRITES {
                break;
            }
            if let Err(error) = self.write(id) {
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
        }
    }

    fn write(&mut self, id: u64) -> Result<(), WatchError> {
        let now = self.now();
        let Some(entry) = self.entries.get_mut(&id) else { return Ok(()) };
        if entry.claim.as_ref().is_some_and(|claim| !claim.stands()) {
            // it was taken over by another daemon, to which this one seemed dead; what that one writes stands
            entry.claim = None;
            entry.dirty = false;
            if entry.phase == Phase::Ended {
                entry.phase = Phase::Settling;
            }
            let text = format!("{}: was taken over by another daemon", entry.status.job);
            self.note(&text);
            return Ok(());
        }
        if entry.claim.is_none() {
            let Some(claim) = self.claims.take(&entry.status.job, now)? else {
                // another daemon works on it; what that one writes stands
                entry.retry = now + AGAIN / 4;
                return Ok(());
            };
            entry.claim = Some(claim);
            if self.adopt(id) {
                return Ok(());
            }
        }
        let folder = self.out(&self.entries[&id]);
        let Some(entry) = self.entries.get_mut(&id) else { return Ok(()) };
        let is_new = entry.written != Some(entry.status.state);
        entry.status.write(&folder)?;
        if is_new {
            let flush = entry.status.state.is_end() || entry.status.state == State::Accepted;
            self.journal.append(&entry.status, flush)?;
        }
        entry.written = Some(entry.status.state);
        entry.wrote = now;
        entry.dirty = false;
        let is_in_work =
            self.current.contains(&id) || entry.session.is_some() && entry.status.state == State::Running;
        if !is_in_work && let Some(claim) = entry.claim.take() {
            claim.give_back();
        }
        if is_new {
            self.tell(id);
        }
        let is_done_with = self.entries.get(&id).is_some_and(|e| e.gone && e.phase == Phase::Ended);
        if is_done_with {
            self.entries.remove(&id);
        }
        Ok(())
    }

    /// Tells of a new state.
    fn tell(&mut self, id: u64) {
        let Some(entry) = self.entries.get(&id) else { return };
        (self.on_event)(&WatchEvent::State(&entry.status));
        if !entry.status.state.is_end() {
            return;
        }
        if let Some(view) = &self.view {
            view.lock().add_ended(entry.status.clone());
        }
        if let Some(notifier) = &self.notifier
            && entry.status.state != State::Cancelled
            && let Err(text) = notifier.tell(&entry.status, &self.out(entry))
        {
            self.note(&text);
        }
    }
}
