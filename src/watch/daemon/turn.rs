//! Whose turn it is, and what becomes of it.

use super::entry::{Entry, Phase};
use super::{AGAIN, Daemon};
use crate::device::Stop;
use crate::run::{Event, FrameReport, Outcome};
use crate::watch::inbox::Kind;
use crate::watch::renderer::{JOBS_AT_ONCE, Order, Told};
use crate::watch::state::{FrameCounts, State, Status};
use crate::watch::{WatchEvent, cannot, job};
use std::cmp::Reverse;
use std::fs;
use std::io::Write;
use std::sync::Arc;
use std::time::Duration;

/// What must fit onto the disk before it is thought to have space again.
const SPACE_BYTES: usize = 1 << 20;

/// What could not be unpacked for want of space is tried again after so long.
const FULL_AGAIN: Duration = Duration::from_secs(30);

impl Daemon<'_> {
    /// What the intake found.
    pub(super) fn examined(&mut self, id: u64, run: &str, examined: Result<Option<i64>, String>) {
        let priority = self.options.priority;
        let Some(entry) = self.entries.get_mut(&id) else { return };
        if entry.phase != Phase::Examining || entry.status.run != run {
            // it changed meanwhile
            return;
        }
        match examined {
            Ok(asked) => {
                entry.status.priority = asked.unwrap_or(priority);
                entry.phase = Phase::Queued;
                entry.enter(State::Queued, None);
            }
            Err(why) => entry.enter(State::Failed, Some(why)),
        }
    }

    /// Begins the jobs whose turn it is: of the highest priority, then those that came first.
    pub(super) fn take_turns(&mut self) {
        loop {
            let free = JOBS_AT_ONCE - self.current.len();
            if free == 0 || self.stopping || self.now() < self.blocked_until {
                return;
            }
            if self.is_full
                && let Some(why) = self.full_disk()
            {
                self.blocked_until = self.now() + AGAIN;
                return self.in_the_way(&why);
            }
            self.is_full = false;
            let now = self.now();
            let waits = |id: &u64, e: &Entry| {
                let grows = e.phase == Phase::Settling
                    && e.session.as_ref().is_some_and(|s| s.fits == Some(true) && !s.ready.is_empty());
                !self.current.contains(id)
                    && e.named
                    && e.retry.max(e.not_before) <= now
                    && !e.gone
                    && (e.phase == Phase::Queued || grows)
            };
            let waiting = self.entries.iter().filter(|(id, e)| waits(id, e));
            let mut next: Vec<_> = waiting
                .map(|(id, e)| (Reverse(e.status.priority), e.status.times.received_ms, *id))
                .collect();
            if next.is_empty() {
                return;
            }
            next.sort_unstable();
            // each is begun, or put off, so that another one may have its place
            next.iter().take(free).for_each(|(_, _, id)| self.begin(*id));
        }
    }

    fn begin(&mut self, id: u64) {
        let now = self.now();
        let Some(entry) = self.entries.get_mut(&id) else { return };
        if entry.claim.is_none() {
            match self.claims.take(&entry.status.job, now) {
                Ok(Some(claim)) => entry.claim = Some(claim),
                Ok(None) => {
                    entry.retry = now + AGAIN / 4;
                    return;
                }
                Err(error) => {
                    entry.retry = now + AGAIN;
                    return self.in_the_way(&error.to_string());
                }
            }
        }
        if self.adopt(id) {
            return;
        }
        let Some(entry) = self.entries.get(&id) else { return };
        let place = self.place(entry);
        let followed = self.options.follow && entry.found.kind == Kind::Folder;
        let stop = Arc::new(Stop::default());
        let Some(entry) = self.entries.get_mut(&id) else { return };
        let mut doubtful = Vec::new();
        let only = if entry.phase == Phase::Settling {
            let session = entry.session.as_mut();
            session.map(|session| {
                entry.status.frames.all = session.all;
                let (ready, torn) = session.hand_over();
                doubtful = torn;
                ready
            })
        } else {
            entry.status.frames = FrameCounts::default();
            None
        };
        entry.first_error = None;
        entry.stop = Some(Arc::clone(&stop));
        if only.is_none() {
            entry.phase = Phase::Running;
        }
        if entry.status.state != State::Running {
            entry.enter(State::Running, None);
        }
        let priority = entry.status.priority;
        let order = Order { id, place, defaults: Arc::clone(&self.defaults), only, followed, priority, stop };
        self.current.insert(id);
        for file in doubtful {
            self.note(&format!(
                "{}: {} may be torn: it does not end as a whole file does, but has not grown for long; it is taken as it stands",
                order.place.source.display(),
                file.display()
            ));
        }
        if !self.renderer.order(order) {
            self.told(
                id,
                Told::Unfit("the thread that renders has ended; start the daemon again".to_owned()),
            );
        }
    }

    /// Whether another daemon has ended this very run meanwhile; then its word stands.
    pub(super) fn adopt(&mut self, id: u64) -> bool {
        let Some(entry) = self.entries.get(&id) else { return false };
        let folder = self.out(entry);
        let known = Status::read(&folder).filter(|known| entry.is_ended_by(known));
        let Some(ended) = known.filter(|known| known.gone(&folder).is_none()) else { return false };
        let Some(entry) = self.entries.get_mut(&id) else { return false };
        entry.status = ended;
        entry.phase = Phase::Ended;
        entry.hush();
        entry.session = None;
        if let Some(claim) = entry.claim.take() {
            claim.give_back();
        }
        true
    }

    /// What the renderer tells.
    pub(super) fn told(&mut self, id: u64, told: Told) {
        match told {
            Told::Event(event) => self.event(id, &event),
            Told::Ended(outcome) => self.ended(id, &outcome),
            Told::Unfit(why) => self.stopped(id, Err((why, false))),
            Told::Full(why) => self.stopped(id, Err((why, true))),
        }
    }

    fn event(&mut self, id: u64, event: &Event) {
        let Some(entry) = self.entries.get_mut(&id) else { return };
        (self.on_event)(&WatchEvent::Run(&entry.status.job, event));
        match event {
            Event::Start { frames, .. } if entry.phase == Phase::Running => {
                entry.status.frames.all = *frames as u64;
                entry.dirty = true;
            }
            Event::Frame(frame) => self.frame(id, frame),
            _ => {}
        }
    }

    fn frame(&mut self, id: u64, frame: &FrameReport) {
        let Some(entry) = self.entries.get_mut(&id) else { return };
        let failed = frame.error.is_some();
        if failed {
            entry.first_error.get_or_insert_with(|| frame.error.clone().unwrap_or_default());
        }
        let counts = &mut entry.status.frames;
        if let Some(session) = entry.session.as_mut().filter(|_| entry.phase == Phase::Settling) {
            (counts.done, counts.failed) = session.ended(&frame.picture, failed);
        } else if failed {
            counts.failed += 1;
        } else {
            counts.done += 1;
        }
        entry.dirty = true;
        let made = self.out(&self.entries[&id]).join(&frame.picture);
        if let Some(view) = &self.view {
            let mut view = view.lock();
            view.frames[usize::from(failed)] += 1;
            if !failed {
                view.picture = Some((self.entries[&id].status.job.clone(), made));
            }
        }
    }

    fn ended(&mut self, id: u64, outcome: &Outcome) {
        if let Some(entry) = self.entries.get_mut(&id) {
            (self.on_event)(&WatchEvent::Ended(&entry.status.job, outcome));
        }
        for device in &outcome.report.devices {
            if let Some(all) = self.devices.iter_mut().find(|d| d.name == device.name) {
                all.add(device);
            }
        }
        self.stopped(id, Ok(outcome));
    }

    /// What is rendered of a job has come to its end, whatever that is; where that is for want of space alone, which there may
    /// be again now that what was unpacked is removed, the job waits.
    fn stopped(&mut self, id: u64, end: Result<&Outcome, (String, bool)>) {
        let now = self.now();
        self.current.remove(&id);
        let full = match &end {
            Ok(outcome) if outcome.failed().next().is_none() => None,
            _ => self.full_disk(),
        };
        let Some(entry) = self.entries.get(&id) else { return };
        let room = self.place(entry).room;
        let Some(entry) = self.entries.get_mut(&id) else { return };
        entry.stop = None;
        let grows = entry.phase == Phase::Settling;
        if let Some(why) = entry.unwanted.take() {
            if let Some(settling) = &entry.settling {
                entry.status.run = format!("{:032x}", settling.seen().run);
            }
            entry.enter(State::Cancelled, Some(why));
        } else if self.stopping || matches!(end, Ok(outcome) if outcome.stopped) {
            if !grows {
                entry.phase = Phase::Queued;
            }
            entry.enter(State::Queued, None);
        } else if let Some(why) = full {
            entry.phase = if grows { Phase::Settling } else { Phase::Queued };
            entry.session = None;
            entry.enter(State::Queued, Some(why.clone()));
            self.blocked_until = now + AGAIN;
            self.is_full = true;
            self.in_the_way(&why);
        } else if let Err((why, true)) = end {
            entry.phase = Phase::Queued;
            entry.enter(State::Queued, Some(why.clone()));
            // others may need less: they do not wait for it
            entry.not_before = now + FULL_AGAIN;
            self.in_the_way(&why);
        } else if !grows {
            match end {
                Err((why, _)) => entry.enter(State::Failed, Some(why)),
                Ok(outcome) => {
                    let counts = &mut entry.status.frames;
                    (counts.failed, counts.done) = (
                        outcome.report.totals.failed,
                        outcome.report.totals.frames - outcome.report.totals.failed,
                    );
                    let (failed, all) = (counts.failed, counts.all);
                    if failed == 0 {
                        entry.enter(State::Finished, None);
                    } else {
                        let first = entry.first_error.clone();
                        let first = first
                            .or_else(|| outcome.failed().find_map(|f| f.error.clone()))
                            .unwrap_or_default();
                        let more = if failed > 1 {
                            format!("; {failed} of {all} frames are missing")
                        } else {
                            String::new()
                        };
                        entry.enter(State::Failed, Some(first + &more));
                    }
                }
            }
        } else if let Err((why, _)) = end {
            // it may be right once it is whole, which is then tried and told
            self.note(&why);
        }
        if let Err(source) = job::clear(&room) {
            self.note(&cannot("removed", &room)(source).to_string());
        }
    }

    /// Whether the output folder cannot be written, for want of space mostly: what to say then.
    pub(super) fn full_disk(&self) -> Option<String> {
        let path = self.own("space");
        let written = fs::File::create(&path).and_then(|mut file| {
            file.write_all(&vec![0xa5; SPACE_BYTES])?;
            file.sync_data()
        });
        let _ = fs::remove_file(&path);
        let error = written.err()?;
        let out = self.options.out.display();
        Some(format!("{out}: cannot be written: {error}; the jobs wait until it can be"))
    }
}
