//! What readers read next and for which device, as the scheduler leases it to one of the runs that share the devices; and what
//! frames on their way may take of the host's memory: a bound on their number for each device, and one on their bytes.

use crate::clock::Stopwatch;
use crate::device::Stop;
use crate::schedule::{Costs, DeviceFacts, JobId, Lease, NewJob, Policy, ScheduleError, Scheduler};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Frames that are read ahead of a device keep it so long from other runs, s; two of them always, so that one is read while the
/// other is traced.
const AHEAD_S: f64 = 0.2;
const AHEAD_LEAST: u64 = 2;
/// A reader that waits looks so often whether to stop.
const LOOKS_FOR_STOP: Duration = Duration::from_millis(100);
/// On so many devices a frame is tried.
const TRIES: usize = 2;

/// A frame's place on its way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Turn {
    /// The device that it is read for.
    pub(super) device: usize,
    /// The place of its picture in the job.
    pub(super) index: usize,
    /// Its place among all of its run that are read for that device, which takes them in that order.
    pub(super) place: u64,
    /// Its place among all of its run.
    pub(super) taken: u64,
}

/// The frames of all runs, shared out.
#[derive(Debug)]
pub(super) struct Hub {
    clock: Stopwatch,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug)]
struct State {
    scheduler: Scheduler,
    feeds: Vec<Feed>,
    runs: BTreeMap<JobId, Run>,
    /// What frames on their way take.
    bytes: u64,
}

/// What is read for a device.
#[derive(Clone, Debug, Default)]
struct Feed {
    /// What is leased to it and not given to a reader yet.
    lease: Option<Lease>,
    /// Frames that readers took for it.
    given: u64,
    /// Those of them that were read.
    read: u64,
    /// Those that it took of them.
    taken: u64,
    /// Those that left it.
    left: u64,
    /// Since when it has had nothing to trace, s, where it has nothing.
    idle_s: f64,
    is_gone: bool,
}

/// One of the runs.
#[derive(Debug)]
struct Run {
    /// For each device what becomes of its frames.
    turns: Vec<Turns>,
    /// Readers that wait for a frame.
    waiting: usize,
    /// Frames that are neither traced nor given up.
    left: u64,
    /// Frames that failed, and the devices they failed on.
    failed: HashMap<usize, Vec<usize>>,
}

/// Frames of a run for one device.
#[derive(Clone, Copy, Debug, Default)]
struct Turns {
    /// Those that readers took.
    given: u64,
    /// Those of them that were read.
    read: u64,
    /// Those that the device took.
    taken: u64,
    /// Those that left it.
    left: u64,
}

impl Hub {
    /// For devices with their budgets.
    pub(super) fn new(policy: Policy, devices: &[DeviceFacts]) -> Self {
        let feeds = vec![Feed::default(); devices.len()];
        let scheduler = Scheduler::new(policy, devices);
        let state = State { scheduler, feeds, runs: BTreeMap::new(), bytes: 0 };
        Self { clock: Stopwatch::start(), state: Mutex::new(state), changed: Condvar::new() }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change<T>(&self, change: impl FnOnce(&mut State) -> T) -> T {
        let out = change(&mut self.lock());
        self.changed.notify_all();
        out
    }
}

/// A run's part of it, from its begin to its end.
#[derive(Debug)]
pub(super) struct Share<'a> {
    hub: &'a Hub,
    job: JobId,
    /// Frames that are read ahead for each device.
    ahead: u64,
    budget_bytes: u64,
}

impl Drop for Share<'_> {
    fn drop(&mut self) {
        self.hub.change(|s| {
            s.give_up(self.job);
            s.runs.remove(&self.job);
        });
    }
}

impl<'a> Share<'a> {
    /// A run of so many frames, with their costs on each device.
    ///
    /// # Errors
    /// Where no device can hold the frames.
    pub(super) fn new(
        hub: &'a Hub,
        frames: usize,
        priority: i32,
        costs: Vec<Costs>,
        ahead: usize,
        budget_bytes: u64,
    ) -> Result<Self, ScheduleError> {
        let now_s = hub.clock.s();
        let frames = frames as u64;
        let job = hub.change(|s| {
            let turns = vec![Turns::default(); s.feeds.len()];
            let job = s.scheduler.add(now_s, &NewJob { frames, grows: false, priority, costs, bytes: 0 })?;
            s.runs.insert(job, Run { turns, waiting: 0, left: frames, failed: HashMap::new() });
            Ok(job)
        })?;
        Ok(Self { hub, job, ahead: ahead as u64, budget_bytes })
    }

    /// What a reader reads next; waits while every device has enough ahead of it, or reads for other runs. None at the end.
    pub(super) fn next(&self, stop: &Stop) -> Option<Turn> {
        let mut state = self.hub.lock();
        loop {
            if stop.asked() {
                state.give_up(self.job);
                break;
            }
            if state.scheduler.is_done(self.job) {
                break;
            }
            let (turn, others) = state.next(self.job, self.hub.clock.s(), self.ahead);
            if others {
                self.hub.changed.notify_all();
            }
            if turn.is_some() {
                return turn;
            }
            let is_still = |feed: &Feed| feed.given == feed.left && feed.lease.is_none();
            if state.runs.len() == 1 && state.feeds.iter().all(is_still) {
                // nothing is on its way that could change anything
                break;
            }
            state.waits(self.job, true);
            // nobody is told of a stop
            let waited = self.hub.changed.wait_timeout(state, LOOKS_FOR_STOP);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
            state.waits(self.job, false);
        }
        drop(state);
        // the other readers must come to this point too
        self.hub.changed.notify_all();
        None
    }

    /// Waits until so many bytes are free and takes them. The frame that its device waits for is not held up: those before
    /// it are done, and those behind it wait for it.
    pub(super) fn take_bytes(&self, turn: Turn, bytes: u64) {
        let is_held_up = |s: &mut State| {
            let Turns { taken, .. } = s.runs[&self.job].turns[turn.device];
            taken < turn.place && s.bytes.saturating_add(bytes) > self.budget_bytes
        };
        let waited = self.hub.changed.wait_while(self.hub.lock(), is_held_up);
        waited.unwrap_or_else(PoisonError::into_inner).bytes += bytes;
    }

    /// A frame was read for a device.
    pub(super) fn was_read(&self, device: usize) {
        let mut state = self.hub.lock();
        state.feeds[device].read += 1;
        if let Some(run) = state.runs.get_mut(&self.job) {
            run.turns[device].read += 1;
        }
    }

    /// A frame has left its device's stage.
    pub(super) fn give_bytes(&self, bytes: u64) {
        self.hub.change(|s| s.bytes -= bytes);
    }

    /// A device takes the next frame that was read for it.
    pub(super) fn taken(&self, device: usize) {
        self.change(|s, run| {
            s.feeds[device].taken += 1;
            run.turns[device].taken += 1;
        });
    }

    /// A frame is traced, in so many seconds of its device; or ended where it was read, in none.
    pub(super) fn done(&self, device: usize, index: usize, seconds: f64) {
        let now_s = self.hub.clock.s();
        self.change(|s, run| {
            s.leaves(run, device, now_s);
            if s.scheduler.done(device, self.job, index as u64, seconds) {
                run.left -= 1;
            }
        });
    }

    /// A device made the scene resident, in so many seconds.
    pub(super) fn started(&self, device: usize, seconds: f64) {
        let now_s = self.hub.clock.s();
        self.hub.lock().scheduler.learn(now_s, device, self.job, None, Some(seconds));
    }

    /// Its name among the runs that share the devices.
    pub(super) fn run(&self) -> u64 {
        self.job.0 as u64
    }

    /// Whether there are others.
    pub(super) fn has_others(&self) -> bool {
        self.hub.lock().runs.len() > 1
    }

    /// The names of the others.
    pub(super) fn others(&self) -> BTreeSet<u64> {
        let state = self.hub.lock();
        state.runs.keys().filter(|&&job| job != self.job).map(|job| job.0 as u64).collect()
    }

    /// A device holds these bytes of the run, and the scenes of those runs that are told.
    pub(super) fn holds(&self, device: usize, bytes: u64, is_resident: impl Fn(u64) -> bool) {
        let mut state = self.hub.lock();
        let State { scheduler, runs, .. } = &mut *state;
        for &job in runs.keys() {
            scheduler.holds(device, job, is_resident(job.0 as u64));
        }
        scheduler.takes(device, self.job, bytes);
    }

    /// A frame failed on a device: whether another one tries it.
    pub(super) fn failed(&self, device: usize, index: usize) -> bool {
        let now_s = self.hub.clock.s();
        self.change(|s, run| {
            s.leaves(run, device, now_s);
            let tried = run.failed.entry(index).or_default();
            tried.push(device);
            let may_try = tried.len() < TRIES;
            let frame = index as u64;
            s.scheduler.give_back(now_s, device, self.job, frame..frame + 1, true);
            let has_other = may_try && s.scheduler.has_other(self.job, frame);
            if !has_other {
                s.scheduler.give_up(self.job, frame);
                run.left -= 1;
            }
            has_other
        })
    }

    /// A frame takes more bytes than a device may hold: whether another takes it, and from now on all frames of its run.
    pub(super) fn too_large(&self, device: usize, index: usize, bytes: u64) -> bool {
        let now_s = self.hub.clock.s();
        self.change(|s, run| {
            if !s.scheduler.needs(now_s, self.job, bytes) {
                return false;
            }
            s.leaves(run, device, now_s);
            let frame = index as u64;
            s.scheduler.give_back(now_s, device, self.job, frame..frame + 1, false);
            if let Some(lease) = s.feeds[device].lease.take_if(|lease| lease.job == self.job) {
                s.scheduler.give_back(now_s, device, self.job, lease.frames, false);
            }
            // what failed elsewhere and does not fit here either
            run.left -= s.scheduler.give_up_hopeless(self.job);
            true
        })
    }

    /// A frame comes back untraced.
    pub(super) fn gave_back(&self, device: usize, index: usize) {
        let now_s = self.hub.clock.s();
        self.change(|s, run| {
            s.leaves(run, device, now_s);
            let frame = index as u64;
            s.scheduler.give_back(now_s, device, self.job, frame..frame + 1, false);
        });
    }

    /// A device will take no more frames. False where it is the last one: then it must.
    pub(super) fn gone(&self, device: usize) -> bool {
        let now_s = self.hub.clock.s();
        self.change(|s, run| {
            if s.feeds.iter().filter(|feed| !feed.is_gone).count() <= 1 {
                return false;
            }
            let feed = &mut s.feeds[device];
            feed.is_gone = true;
            feed.lease = None;
            s.scheduler.device_gone(now_s, device);
            run.left -= s.scheduler.give_up_hopeless(self.job);
            true
        })
    }

    /// Whether a device takes no frames any more.
    pub(super) fn is_gone(&self, device: usize) -> bool {
        self.hub.lock().feeds[device].is_gone
    }

    /// Frames that are still to come.
    pub(super) fn left(&self) -> u64 {
        self.hub.lock().runs[&self.job].left
    }

    fn change<T>(&self, change: impl FnOnce(&mut State, &mut Run) -> T) -> T {
        self.hub.change(|s| {
            // it is there until the share is dropped
            let mut run = s.runs.remove(&self.job).expect("the run has not ended");
            let out = change(s, &mut run);
            s.runs.insert(self.job, run);
            out
        })
    }
}

impl State {
    /// A frame of a run has left a device's stage.
    fn leaves(&mut self, run: &mut Run, device: usize, now_s: f64) {
        self.feeds[device].left += 1;
        self.feeds[device].idle_s = now_s;
        run.turns[device].left += 1;
    }

    /// A reader of a run waits for a frame, or does no more.
    fn waits(&mut self, job: JobId, does: bool) {
        if let Some(run) = self.runs.get_mut(&job) {
            run.waiting = if does { run.waiting + 1 } else { run.waiting - 1 };
        }
    }

    /// Nothing more of a run is leased.
    fn give_up(&mut self, job: JobId) {
        self.scheduler.cancel(job);
        for feed in &mut self.feeds {
            feed.lease.take_if(|lease| lease.job == job);
        }
    }

    /// Whether a device has enough ahead of it for a run to add nothing. What others are still reading is not counted in
    /// seconds: reading may take longer than they do.
    fn is_fed(&self, device: usize, job: JobId, ahead: u64) -> bool {
        let feed = &self.feeds[device];
        let own = self.runs.get(&job).map_or(Turns::default(), |run| run.turns[device]);
        let ready = feed.read - feed.taken;
        let reading = own.given - own.read;
        if feed.is_gone || ready + reading >= ahead {
            return true;
        }
        let on_their_way = |(other, run): (&JobId, &Run)| {
            let Turns { given, read, left, .. } = run.turns[device];
            let frames = if *other == job { given } else { read } - left;
            frames as f64 * self.scheduler.frame_s(device, *other)
        };
        let frames = feed.read - feed.left + reading;
        frames >= AHEAD_LEAST && self.runs.iter().map(on_their_way).sum::<f64>() > AHEAD_S
    }

    /// Whether a device has had nothing to trace for so long that whoever can read for it has it, whatever was leased to runs
    /// whose readers are all busy.
    fn starves(&self, device: usize, now_s: f64) -> bool {
        let feed = &self.feeds[device];
        feed.read == feed.left && now_s - feed.idle_s > AHEAD_S
    }

    /// Leases to a run; one that asks has a reader for it.
    fn lease(&mut self, device: usize, job: JobId, now_s: f64) {
        let starves = self.starves(device, now_s);
        for (&other, run) in &self.runs {
            self.scheduler.can_be_read(other, !starves || other == job || run.waiting > 0);
        }
        let runs = &self.runs;
        let is_unread =
            |lease: &mut Lease| lease.job != job && runs.get(&lease.job).is_none_or(|run| run.waiting == 0);
        let lease = &mut self.feeds[device].lease;
        if starves && let Some(unread) = lease.take_if(is_unread) {
            self.scheduler.give_back(now_s, device, unread.job, unread.frames, false);
        }
        if lease.is_none() {
            *lease = self.scheduler.lease(now_s, device);
        }
    }

    /// The next frame of a run, for the device that has the fewest ahead of it; and whether others were leased to other runs,
    /// whose readers must hear of it. Readers that find nothing wake nobody: they would wake each other without end.
    fn next(&mut self, job: JobId, now_s: f64, ahead: u64) -> (Option<Turn>, bool) {
        let mut others = false;
        let mut hungry: Vec<usize> = (0..self.feeds.len()).collect();
        hungry.retain(|&d| !self.is_fed(d, job, ahead));
        hungry.sort_by_key(|&d| self.feeds[d].given - self.feeds[d].taken);
        for device in hungry {
            let before = self.feeds[device].lease.as_ref().map(|lease| lease.job);
            self.lease(device, job, now_s);
            let feed = &mut self.feeds[device];
            others |= feed.lease.as_ref().is_some_and(|lease| lease.job != job && Some(lease.job) != before);
            let Some(lease) = feed.lease.as_mut().filter(|lease| lease.job == job) else { continue };
            let Some(frame) = lease.frames.next() else { continue };
            // another's readers may have waited for it to end
            others |= feed.lease.take_if(|lease| lease.frames.is_empty()).is_some();
            if feed.given == feed.left {
                feed.idle_s = now_s;
            }
            feed.given += 1;
            let Some(run) = self.runs.get_mut(&job) else { break };
            let taken = run.turns.iter().map(|turns| turns.given).sum();
            let given = &mut run.turns[device].given;
            *given += 1;
            return (Some(Turn { device, index: frame as usize, place: *given - 1, taken }), others);
        }
        (None, others)
    }
}

#[cfg(test)]
mod tests;
