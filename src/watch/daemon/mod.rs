//! The thread that drives everything: what it waits for, and in which order it does what.

mod entry;
mod look;
mod session;
mod turn;
mod write;

use super::claim::Claims;
use super::hints::Hints;
use super::intake::Intake;
use super::journal::Journal;
use super::notice::Notifier;
use super::renderer::Renderer;
use super::view::Shared;
use super::{Ended, Message, WatchError, WatchEvent, WatchOptions, cannot, job, page};
use crate::clock::Stopwatch;
use crate::device::Stop;
use crate::job::Request;
use crate::run::{DeviceReport, Fleet};
use entry::{Entry, Phase};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

/// The daemon's own folder within the output folder.
const OWN: &str = ".rentix-watch";
/// Between two scans there is a quarter of the span that a job rests, within these.
const SCAN_EVERY: [Duration; 2] = [Duration::from_millis(50), Duration::from_secs(1)];
/// What cannot be done now is tried again after so long.
const AGAIN: Duration = Duration::from_secs(2);
/// The same is not said again for so long.
const QUIET: Duration = Duration::from_mins(1);
/// So many things that were said are remembered.
const SAID_MAX: usize = 256;

/// Everything that the daemon knows.
pub(super) struct Daemon<'a> {
    options: &'a WatchOptions,
    on_event: &'a mut dyn FnMut(&WatchEvent<'_>),
    defaults: Arc<Request>,
    since: Stopwatch,
    /// Between two scans.
    every: Duration,
    messages: Receiver<Message>,
    hints: Hints,
    folders: Intake,
    archives: Intake,
    renderer: Renderer,
    notifier: Option<Notifier>,
    /// Ends that somebody is being told of.
    untold: u64,
    claims: Claims,
    journal: Journal,
    view: Option<Shared>,
    /// By their numbers, which grow.
    entries: BTreeMap<u64, Entry>,
    by_file: HashMap<OsString, u64>,
    last_id: u64,
    /// The jobs that are being rendered.
    current: BTreeSet<u64>,
    /// When each job was first seen, by its name, as earlier daemons wrote it down.
    received: HashMap<String, u64>,
    devices: Vec<DeviceReport>,
    /// What was said, and when.
    said: HashMap<String, Duration>,
    /// Files in the inbox that are no jobs and were told of.
    others: HashSet<OsString>,
    /// Nothing is begun before: the output folder cannot be written.
    blocked_until: Duration,
    /// It could not be written when that was tried last.
    is_full: bool,
    trouble: Option<(String, Duration)>,
    stopping: bool,
    /// Whether the inbox could be listed, and all in it was looked at.
    listed: bool,
}

impl<'a> Daemon<'a> {
    /// Opens everything that must be there before the first job.
    pub(super) fn open(
        options: &'a WatchOptions,
        fleet: Fleet,
        on_event: &'a mut dyn FnMut(&WatchEvent<'_>),
    ) -> Result<Self, WatchError> {
        fs::read_dir(&options.inbox).map_err(cannot("read", &options.inbox))?;
        fs::create_dir_all(&options.out).map_err(cannot("made", &options.out))?;
        apart(&options.inbox, &options.out)?;
        let own = options.out.join(OWN);
        let since = Stopwatch::start();
        let (send, messages) = channel();
        let notifier = Notifier::start(&options.notices, send.clone())?;
        let mut claims = Claims::open(&own.join("claims"), since.elapsed())?;
        clear_unpacked(&own.join("unpacked"), &mut claims, since.elapsed());
        let (journal, known) = Journal::open(&own.join("journal"), claims.me(), notifier.is_some())?;
        let view = options.listen.map(|_| Shared::default());
        if let Some(view) = &view {
            let mut ended: Vec<_> = known.last.iter().filter(|s| s.state.is_end()).cloned().collect();
            ended.sort_by_key(|s| s.times.ended_ms);
            let mut view = view.lock();
            for status in ended {
                view.add_ended(status);
            }
        }
        let at = options.listen.zip(view.as_ref()).map(|(at, view)| page::serve(at, view)).transpose()?;
        let (hints, no_hints) = Hints::listen(&options.inbox, send.clone());
        let renderer = Renderer::start(fleet, &options.run, &send);
        let mut daemon = Self {
            options,
            on_event,
            defaults: Arc::new(options.defaults.clone()),
            since,
            every: (options.settle / 4).clamp(SCAN_EVERY[0], SCAN_EVERY[1]),
            messages,
            hints,
            folders: Intake::start(&send),
            archives: Intake::start(&send),
            devices: renderer.devices.clone(),
            renderer,
            notifier,
            untold: 0,
            claims,
            journal,
            view,
            entries: BTreeMap::new(),
            by_file: HashMap::new(),
            last_id: 0,
            current: BTreeSet::new(),
            received: known.last.into_iter().map(|s| (s.job, s.times.received_ms)).collect(),
            said: HashMap::new(),
            others: HashSet::new(),
            blocked_until: Duration::ZERO,
            is_full: false,
            trouble: None,
            stopping: false,
            listed: false,
        };
        (daemon.on_event)(&WatchEvent::Ready(at));
        if let Some(why) = no_hints {
            daemon.note(&why);
        }
        for end in &known.due {
            daemon.notify(end, &options.out.join(&end.job));
        }
        Ok(daemon)
    }

    /// Watches until it is asked to stop, or with `once` until every job present has ended.
    pub(super) fn watch(mut self, stop: &Stop) -> Result<Ended, WatchError> {
        let mut next = Duration::ZERO;
        loop {
            let now = self.now();
            if now >= next {
                self.tick(stop);
                if let Some(ended) = self.end() {
                    return Ok(ended);
                }
                next = now + self.every;
                if let Some(at) = self.next_look().filter(|_| !self.stopping) {
                    next = next.min(at);
                }
            }
            let wait = next.saturating_sub(self.now());
            match self.messages.recv_timeout(wait) {
                // what is written at once is not looked at more often than this
                Ok(Message::Hint) => next = next.min(self.now() + SCAN_EVERY[0]),
                Ok(message) => {
                    self.take(message);
                    while let Ok(message) = self.messages.try_recv() {
                        self.take(message);
                    }
                    self.take_turns();
                    self.write_all();
                }
                Err(RecvTimeoutError::Timeout) => {}
                // the renderer's thread holds a sender as long as this does
                Err(RecvTimeoutError::Disconnected) => std::thread::sleep(self.every),
            }
        }
    }

    fn now(&self) -> Duration {
        self.since.elapsed()
    }

    fn tick(&mut self, stop: &Stop) {
        self.beat();
        if stop.asked() && !self.stopping {
            self.stopping = true;
            for stop in self.current.iter().filter_map(|id| self.entries.get(id)?.stop.as_ref()) {
                stop.ask();
            }
        }
        if !self.stopping {
            self.scan();
        }
        self.take_turns();
        self.write_all();
        self.renew_view();
    }

    /// Gives a heartbeat where it is time to; as often it is looked who has died.
    fn beat(&mut self) {
        let now = self.now();
        match self.claims.beat(now) {
            Ok(true) => {
                for id in &self.current {
                    // whoever has taken it over is heeded when it is to be written
                    if let Some(entry) = self.entries.get_mut(id) {
                        entry.dirty |= entry.claim.as_ref().is_some_and(|claim| !claim.stands());
                    }
                }
                if !self.stopping {
                    self.take_over_journals(now);
                }
            }
            Ok(false) => {}
            Err(error) => self.in_the_way(&error.to_string()),
        }
    }

    /// Tells of what daemons that have died told nobody of.
    fn take_over_journals(&mut self, now: Duration) {
        let claims = &mut self.claims;
        match self.journal.take_over(|owner| claims.lives(owner, now)) {
            Ok(due) => due.iter().for_each(|end| self.notify(end, &self.options.out.join(&end.job))),
            // they are there still
            Err(error) => self.in_the_way(&error.to_string()),
        }
    }

    fn take(&mut self, message: Message) {
        match message {
            Message::Hint => {}
            Message::Examined(id, run, examined) => self.examined(id, &run, examined),
            Message::Told(id, told) => self.told(id, told),
            Message::WasTold(end) => self.was_told(&end),
            Message::Note(text) => self.note(&text),
        }
    }

    /// How it ended, once it has.
    fn end(&mut self) -> Option<Ended> {
        let stopped = self.stopping;
        let is_over = if stopped {
            self.current.is_empty()
        } else {
            self.options.once && self.listed && self.untold == 0 && self.entries.values().all(Entry::is_over)
        };
        if !is_over {
            return None;
        }
        self.let_go();
        let failed = self.entries.values().filter(|e| e.has_failed()).count();
        Some(Ended { failed, stopped })
    }

    /// Gives back what is still claimed.
    fn let_go(&mut self) {
        self.write_all();
        for entry in self.entries.values_mut() {
            if let Some(claim) = entry.claim.take() {
                claim.give_back();
            }
        }
    }

    /// Says what is in the way or left alone; the same only once a while.
    fn note(&mut self, text: &str) {
        let now = self.now();
        if self.said.get(text).is_some_and(|at| now.saturating_sub(*at) < QUIET) {
            return;
        }
        if self.said.len() >= SAID_MAX {
            self.said.clear();
        }
        self.said.insert(text.to_owned(), now);
        (self.on_event)(&WatchEvent::Note(text));
    }

    /// Notes what is in the way of everything, and shows it for a while.
    fn in_the_way(&mut self, text: &str) {
        self.note(text);
        self.trouble = Some((text.to_owned(), self.now()));
    }

    fn renew_view(&mut self) {
        let Some(shared) = self.view.clone() else { return };
        let now = self.now();
        self.trouble.take_if(|(_, at)| now.saturating_sub(*at) > 2 * AGAIN);
        let mut view = shared.lock();
        view.counts = [0; _];
        let mut open = Vec::new();
        for entry in self.entries.values() {
            view.counts[entry.status.state as usize] += 1;
            if entry.phase != Phase::Ended {
                open.push(&entry.status);
            }
        }
        open.sort_by_key(|s| {
            (std::cmp::Reverse(s.state), std::cmp::Reverse(s.priority), s.times.received_ms)
        });
        view.open = open.into_iter().take(super::view::JOBS_SHOWN).cloned().collect();
        view.devices.clone_from(&self.devices);
        view.up_s = now.as_secs_f64();
        view.trouble = self.trouble.as_ref().map(|(text, _)| text.clone());
    }

    fn place(&self, entry: &Entry) -> job::Place {
        job::Place {
            source: self.options.inbox.join(&entry.found.file),
            kind: entry.found.kind,
            room: self.own("unpacked").join(&entry.status.job),
            out: self.out(entry),
        }
    }

    fn out(&self, entry: &Entry) -> PathBuf {
        self.options.out.join(&entry.status.job)
    }

    fn own(&self, name: &str) -> PathBuf {
        self.options.out.join(OWN).join(name)
    }
}

/// Refuses an output folder within the inbox, and the other way round.
fn apart(inbox: &Path, out: &Path) -> Result<(), WatchError> {
    let real = |path: &Path| path.canonicalize().map_err(cannot("found", path));
    let (a, b) = (real(inbox)?, real(out)?);
    if a.starts_with(&b) || b.starts_with(&a) {
        return Err(WatchError::Nested(inbox.to_path_buf(), out.to_path_buf()));
    }
    Ok(())
}

/// Removes what dead daemons unpacked; what cannot be removed is when its job's turn comes.
fn clear_unpacked(folder: &Path, claims: &mut Claims, now: Duration) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        if let Ok(Some(claim)) = claims.take(&name.to_string_lossy(), now) {
            let _ = job::clear(&entry.path());
            claim.give_back();
        }
    }
}
