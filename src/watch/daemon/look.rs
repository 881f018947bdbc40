//! Scanning: what is in the inbox, what changed, what is whole.

use super::entry::{Entry, Phase, run_word};
use super::{AGAIN, Daemon, SCAN_EVERY};
use crate::watch::inbox::{self, Found, Kind};
use crate::watch::settle::{Seen, Settling};
use crate::watch::state::{State, Status, now_ms};
use std::collections::HashSet;
use std::ffi::{OsStr, OsString};
use std::io;
use std::path::Path;
use std::time::Duration;
use xxhash_rust::xxh3::xxh3_128;

/// One job is looked at for this part of the time at most: thousands of frames that are being copied tell of a change without end.
const LOOK_SHARE: u32 = 10;
/// What has settled is looked at again after so long, where no event told of a change.
const REST: Duration = Duration::from_secs(5);
/// A job that cannot be read for so long fails.
const UNSEEN_MAX: Duration = Duration::from_secs(30);
/// A scan looks at jobs for so long, the others' turn comes with the next, at once; what can be begun is begun between the two.
const LOOKS: Duration = SCAN_EVERY[0];
/// When a job has rested so many times longer and is still held back, it is said by what.
const TOLD_RESTS: u32 = 5;
/// A followed sequence without `.done` is whole when it has rested so many times longer than other jobs.
const FOLLOWED_RESTS: u32 = 30;
/// So many times with `--once`, which nobody wants to wait for: as long as a frame without a final newline.
const FOLLOWED_RESTS_ONCE: u32 = 5;

impl Daemon<'_> {
    pub(super) fn scan(&mut self) {
        let inbox = match inbox::list(&self.options.inbox) {
            Ok(inbox) => inbox,
            Err(error) => {
                self.listed = false;
                let later = self.now() + self.every;
                self.entries.values_mut().for_each(|e| e.due = e.due.max(later));
                return self.in_the_way(&error.to_string());
            }
        };
        self.others.retain(|file| inbox.others.contains(file));
        for file in inbox.others {
            if !self.others.contains(&file) {
                let text = format!(
                    "{}: is neither a folder nor a .zip, .tar, .tar.gz or .tar.zst; it is left alone",
                    self.options.inbox.join(&file).display()
                );
                self.note(&text);
                self.others.insert(file);
            }
        }
        let there: HashSet<&OsString> = inbox.jobs.iter().map(|found| &found.file).collect();
        let gone: Vec<u64> =
            self.by_file.iter().filter(|(file, _)| !there.contains(file)).map(|(_, id)| *id).collect();
        for id in gone {
            self.gone(id);
        }
        for found in inbox.jobs {
            self.meet(found);
        }
        let now = self.now();
        let hints = self.hints.take();
        let mut hinted: Vec<u64> = hints.iter().filter_map(|name| self.by_file.get(name)).copied().collect();
        let beside: HashSet<&OsStr> = hints.iter().filter_map(|name| inbox::said_of(name)).collect();
        if !beside.is_empty() {
            let is_meant = |file: &OsStr| inbox::names(file).any(|name| beside.contains(name));
            hinted.extend(self.by_file.iter().filter(|(file, _)| is_meant(file)).map(|(_, id)| *id));
        }
        for id in hinted {
            if let Some(entry) = self.entries.get_mut(&id) {
                entry.due = entry.due.min(now.max(entry.rests));
            }
        }
        let due = self.entries.iter().filter(|(_, e)| !e.gone && e.due <= now);
        let mut due: Vec<(bool, Duration, u64)> =
            due.map(|(id, e)| (e.settling.is_none(), e.due, *id)).collect();
        // what is known may be whole now; then what waits longest comes first
        due.sort_unstable();
        self.listed = true;
        for (_, _, id) in due {
            if self.now().saturating_sub(now) > LOOKS {
                self.listed = false;
                break;
            }
            // a look may take long
            self.beat();
            let begun = self.now();
            self.look_at(id);
            let mut took = self.now().saturating_sub(begun);
            if let Some(entry) = self.entries.get_mut(&id) {
                if entry.phase == Phase::Settling || entry.phase == Phase::Running {
                    entry.due = entry.due.min(begun + self.every);
                }
                if let Some(session) = &mut entry.session {
                    // each file is parsed once, which is no reason to look less often
                    took = took.saturating_sub(std::mem::take(&mut session.parsed));
                    if std::mem::take(&mut session.goes_on) {
                        entry.due = begun;
                    }
                }
                entry.rests = begun + LOOK_SHARE * took;
                entry.due = entry.due.max(entry.rests);
            }
        }
    }

    /// When something in the inbox is to be looked at next.
    pub(super) fn next_look(&self) -> Option<Duration> {
        self.entries.values().filter(|e| !e.gone).map(|e| e.due).min()
    }

    fn meet(&mut self, found: Found) {
        if let Some(id) = self.by_file.get(&found.file) {
            let known = &mut self.entries.get_mut(id);
            if known.as_ref().is_some_and(|e| e.found.kind == found.kind) {
                return;
            }
            // a folder in place of an archive, or the other way round: another job of that name
            let id = *id;
            return self.gone(id);
        }
        self.last_id += 1;
        self.by_file.insert(found.file.clone(), self.last_id);
        self.entries.insert(self.last_id, Entry::new(found));
    }

    /// What was in the inbox and is not any more.
    fn gone(&mut self, id: u64) {
        let Some(entry) = self.entries.get_mut(&id) else { return };
        entry.gone = true;
        self.by_file.remove(&entry.found.file);
        if !entry.named || entry.phase == Phase::Ended && !entry.dirty {
            self.entries.remove(&id);
        } else if entry.phase != Phase::Ended {
            self.cancel(id, "it was taken out of the inbox");
        }
    }

    fn look_at(&mut self, id: u64) {
        let now = self.now();
        let Some(entry) = self.entries.get_mut(&id) else { return };
        entry.due = now + REST;
        let seen = match inbox::look(&self.options.inbox, &entry.found) {
            Ok(seen) => seen,
            Err(error) => {
                let path = self.options.inbox.join(&entry.found.file);
                if path.exists() {
                    self.unseen(id, &path, &error);
                }
                return;
            }
        };
        entry.unseen = None;
        let is_other = if let Some(settling) = &mut entry.settling {
            settling.see(seen, now)
        } else {
            entry.settling = Some(Settling::new(seen, now));
            true
        };
        if seen.files == 0 && !entry.named {
            return;
        }
        if !entry.named && !self.name(id, &seen) {
            return;
        }
        self.changed(id, seen, is_other);
    }

    /// Fails a job that cannot be looked at for what it is, or for long. Once it can be, that is a new run of it.
    fn unseen(&mut self, id: u64, path: &Path, error: &io::Error) {
        let now = self.now();
        let is_rendering = self.current.contains(&id);
        let Some(entry) = self.entries.get_mut(&id) else { return };
        let is_limit = inbox::is_limit(error);
        let lasts = now.saturating_sub(*entry.unseen.get_or_insert(now)) >= UNSEEN_MAX;
        // what has ended stays so when a share is away for a while
        let fails = is_limit || lasts && entry.phase != Phase::Ended;
        let path = path.display();
        if is_rendering || !fails {
            return self.note(&format!("{path}: cannot be read: {error}; it is waited for"));
        }
        let why = if is_limit {
            format!("{path}: {error}; it is not rendered")
        } else {
            format!("{path}: cannot be read: {error}; it is gone on with once it can be")
        };
        let seen = Seen { run: xxh3_128(why.as_bytes()), files: 1, ..Seen::default() };
        if !entry.named && !self.name(id, &seen) {
            return;
        }
        let Some(entry) = self.entries.get_mut(&id) else { return };
        let run = run_word(&seen);
        if entry.status.ended(&run) {
            return;
        }
        (entry.settling, entry.unwanted) = (None, None);
        entry.status.run = run;
        entry.enter(State::Failed, Some(why));
    }

    /// What a look means for a job that has its name.
    fn changed(&mut self, id: u64, seen: Seen, is_other: bool) {
        let now = self.now();
        let run = run_word(&seen);
        let Some(entry) = self.entries.get_mut(&id) else { return };
        match entry.phase {
            Phase::Ended => {
                let is_wanted_again = entry.status.state == State::Cancelled && !seen.cancelled;
                if is_wanted_again || entry.status.run != run && !seen.cancelled {
                    entry.phase = Phase::Settling;
                    entry.unwanted = None;
                    // the end that is on the disk is that of another run
                    entry.status.run.clear();
                    entry.enter(State::Received, None);
                }
                return;
            }
            _ if seen.cancelled => return self.cancel(id, "its owner cancelled it"),
            Phase::Examining | Phase::Queued if is_other => {
                entry.phase = Phase::Settling;
                entry.enter(State::Received, None);
            }
            _ => {}
        }
        if entry.phase != Phase::Settling {
            return;
        }
        let settle = self.options.settle;
        let follows = self.options.follow && entry.found.kind == Kind::Folder;
        let mut span = settle;
        if follows {
            span *= if self.options.once { FOLLOWED_RESTS_ONCE } else { FOLLOWED_RESTS };
            let path = self.options.inbox.join(&entry.found.file);
            let session = entry.session.get_or_insert_default();
            if session.fits == Some(false) {
                span = settle;
            } else if let Err(error) = session.look(&path, seen.done, settle, now) {
                return self.note(&format!("{}: cannot be read: {error}; it is waited for", path.display()));
            }
        }
        let is_rendering = self.current.contains(&id);
        let Some(settling) = &mut entry.settling else { return };
        let is_to_be_told = settling.is_to_be_told(TOLD_RESTS * settle, now);
        if let Some(whole) = settling.settles(span).filter(|at| *at > now) {
            entry.due = entry.due.min(whole);
        }
        if settling.is_settled(span, now) && !is_rendering {
            self.accept(id, run);
        } else if let Some(session) = entry.session.as_mut().filter(|session| session.fits.is_none()) {
            // what rests and has no frames of its own, as a glTF, is perhaps none that grows
            let rests = settling.is_settled(settle, now) && session.asked != Some(seen.run);
            if rests || !session.ready.is_empty() {
                session.asked = Some(seen.run);
                self.see_whether_it_fits(id);
            }
        }
        if is_to_be_told {
            self.say_why(id);
        }
    }

    /// Says what a job waits for that has rested for long.
    fn say_why(&mut self, id: u64) {
        let Some(entry) = self.entries.get(&id) else { return };
        let path = self.options.inbox.join(&entry.found.file);
        if let Some(file) = inbox::unfinished(&path) {
            let file = file.strip_prefix(&path).unwrap_or(&file).display();
            self.note(&format!(
                "{}: waits for {file}, which is still being written by its name; rename or remove it, or put .done there",
                path.display()
            ));
        }
    }

    fn accept(&mut self, id: u64, run: String) {
        let Some(entry) = self.entries.get_mut(&id) else { return };
        entry.status.run.clone_from(&run);
        entry.session = None;
        entry.phase = Phase::Examining;
        entry.enter(State::Accepted, None);
        let place = self.place(&self.entries[&id]);
        let intake = match place.kind {
            Kind::Folder => &self.folders,
            Kind::Archive(_) => &self.archives,
        };
        intake.examine(id, run, place);
    }

    /// Whether a job that grows can be followed; where that cannot be told yet it is asked again.
    fn see_whether_it_fits(&mut self, id: u64) {
        let now = self.now();
        let Some(entry) = self.entries.get(&id) else { return };
        let job = crate::watch::job::prepare(&self.place(entry), &self.defaults, true);
        let priority = self.options.priority;
        if let Ok(job) = job
            && let Some(entry) = self.entries.get_mut(&id)
            && let Some(session) = &mut entry.session
        {
            session.fits = Some(crate::watch::follow_run::can_follow(&job));
            entry.status.priority = job.priority.unwrap_or(priority);
            entry.due = now;
        }
    }

    /// Finds a name for a job, and what is known of it; false where that must wait.
    fn name(&mut self, id: u64, seen: &Seen) -> bool {
        let now = self.now();
        let Some(entry) = self.entries.get(&id).filter(|e| e.retry <= now) else { return false };
        let (base, source) = (entry.found.name.clone(), entry.status.source.clone());
        for n in 1.. {
            let name = if n == 1 { base.clone() } else { format!("{base}-{n}") };
            let folder = self.options.out.join(&name);
            let known = match Status::read(&folder) {
                Some(known) if known.source == source => Some(known),
                Some(_) => continue,
                // what is in the way of a folder is someone else's
                None if folder.exists() && !folder.is_dir() => continue,
                None => None,
            };
            if let Some(known) = known {
                return self.go_on(id, known, seen);
            }
            let claim = match self.claims.take(&name, now) {
                Ok(Some(claim)) => claim,
                // another daemon is just giving it to a job, perhaps to this one
                Ok(None) => return self.later(id),
                Err(error) => {
                    self.in_the_way(&error.to_string());
                    return self.later(id);
                }
            };
            if Status::read(&folder).is_some() {
                claim.give_back();
                return self.later(id);
            }
            let received_ms = self.received.get(&name).copied().unwrap_or_else(now_ms);
            let Some(entry) = self.entries.get_mut(&id) else { return false };
            entry.named = true;
            entry.claim = Some(claim);
            entry.status.job = name;
            entry.status.times.received_ms = received_ms;
            entry.enter(State::Received, None);
            self.write_first(id);
            return true;
        }
        false
    }

    /// Goes on with what an earlier daemon, or another one, wrote.
    fn go_on(&mut self, id: u64, known: Status, seen: &Seen) -> bool {
        let has_ended = known.ended(&run_word(seen));
        let gone = if has_ended { known.gone(&self.options.out.join(&known.job)) } else { None };
        let Some(entry) = self.entries.get_mut(&id) else { return false };
        entry.named = true;
        entry.status = known;
        if let Some(gone) = gone {
            entry.status.run.clear();
            entry.enter(State::Received, None);
            self.note(&format!("{gone}; it is rendered again"));
        } else if has_ended {
            entry.phase = Phase::Ended;
        }
        true
    }

    fn later(&mut self, id: u64) -> bool {
        let retry = self.now() + AGAIN / 4;
        if let Some(entry) = self.entries.get_mut(&id) {
            entry.retry = retry;
        }
        false
    }

    /// Ends a job that is not wanted any more: at once, or when what is being rendered of it has stopped.
    fn cancel(&mut self, id: u64, why: &str) {
        let is_rendering = self.current.contains(&id);
        let Some(entry) = self.entries.get_mut(&id) else { return };
        if is_rendering {
            entry.unwanted = Some(why.to_owned());
            if let Some(stop) = &entry.stop {
                stop.ask();
            }
            return;
        }
        if let Some(settling) = &entry.settling {
            entry.status.run = run_word(settling.seen());
        }
        entry.enter(State::Cancelled, Some(why.to_owned()));
    }
}
