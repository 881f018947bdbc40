//! What readers read next and for which device, as the scheduler leases it to one of the runs that share the devices; and what
//! frames on their way may take of the host's memory: a bound on their number for each device, and one on their bytes.

use crate::clock::Stopwatch;
use crate::device::Stop;
use crate::schedule::{Costs, DeviceFacts, JobId, Lease, NewJob, Policy, ScheduleError, Scheduler};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// Frames that are read ahead of a device keep it so long from other runs, s; two of them always, so that one is read while the
/// other is traced.
const AHEAD_S: f64 = 0.2;
const AHEAD_LEAST: u64 = 2;
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
    /// Those that it took of them.
    taken: u64,
    /// Those that left it.
    left: u64,
    is_gone: bool,
}

/// One of the runs.
#[derive(Debug)]
struct Run {
    /// For each device the frames that its readers took, those of them that the device took, and those that left it.
    turns: Vec<[u64; 3]>,
    /// Frames that are neither traced nor given up.
    left: u64,
    /// Frames that failed, and the devices they failed on.
    failed: HashMap<usize, Vec<usize>>,
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
            s.scheduler.cancel(self.job);
            s.runs.remove(&self.job);
            for feed in &mut s.feeds {
                feed.lease.take_if(|lease| lease.job == self.job);
            }
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
            let turns = vec![[0; 3]; s.feeds.len()];
            let job = s.scheduler.add(now_s, &NewJob { frames, grows: false, priority, costs, bytes: 0 })?;
            s.runs.insert(job, Run { turns, left: frames, failed: HashMap::new() });
            Ok(job)
        })?;
        Ok(Self { hub, job, ahead: ahead as u64, budget_bytes })
    }

    /// What a reader reads next; waits while every device has enough ahead of it, or reads for other runs. None at the end.
    pub(super) fn next(&self, stop: &Stop) -> Option<Turn> {
        let mut state = self.hub.lock();
        loop {
            if stop.asked() || state.scheduler.is_done(self.job) {
                break;
            }
            let (turn, others) = state.next(self.job, self.hub.clock.s(), self.ahead);
            if others {
                self.hub.changed.notify_all();
            }
            if turn.is_some() {
                return turn;
            }
            if state.feeds.iter().all(|feed| feed.given == feed.left && feed.lease.is_none()) {
                // nothing is on its way that could change anything
                break;
            }
            state = self.hub.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
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
            let [_, taken, _] = s.runs[&self.job].turns[turn.device];
            taken < turn.place && s.bytes.saturating_add(bytes) > self.budget_bytes
        };
        let waited = self.hub.changed.wait_while(self.hub.lock(), is_held_up);
        waited.unwrap_or_else(PoisonError::into_inner).bytes += bytes;
    }

    /// A frame has left its device's stage.
    pub(super) fn give_bytes(&self, bytes: u64) {
        self.hub.change(|s| s.bytes -= bytes);
    }

    /// A device takes the next frame that was read for it.
    pub(super) fn taken(&self, device: usize) {
        self.change(|s, run| {
            s.feeds[device].taken += 1;
            run.turns[device][1] += 1;
        });
    }

    /// A frame is traced, in so many seconds of its device; or ended where it was read, in none.
    pub(super) fn done(&self, device: usize, index: usize, seconds: f64) {
        self.change(|s, run| {
            s.leaves(run, device);
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

    /// The names of the others.
    pub(super) fn others(&self) -> BTreeSet<u64> {
        let runs = self.hub.lock().runs.keys().map(|job| job.0 as u64).collect::<BTreeSet<_>>();
        runs.into_iter().filter(|&run| run != self.run()).collect()
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
            s.leaves(run, device);
            let tried = run.failed.entry(index).or_default();
            tried.push(device);
            let is_other = |(d, feed): (usize, &Feed)| !feed.is_gone && !tried.contains(&d);
            let has_other = tried.len() < TRIES && s.feeds.iter().enumerate().any(is_other);
            let frame = index as u64;
            s.scheduler.give_back(now_s, device, self.job, frame..frame + 1, true);
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
            s.leaves(run, device);
            let frame = index as u64;
            s.scheduler.give_back(now_s, device, self.job, frame..frame + 1, false);
            if let Some(lease) = s.feeds[device].lease.take_if(|lease| lease.job == self.job) {
                s.scheduler.give_back(now_s, device, self.job, lease.frames, false);
            }
            true
        })
    }

    /// A frame comes back untraced.
    pub(super) fn gave_back(&self, device: usize, index: usize) {
        let now_s = self.hub.clock.s();
        self.change(|s, run| {
            s.leaves(run, device);
            let frame = index as u64;
            s.scheduler.give_back(now_s, device, self.job, frame..frame + 1, false);
        });
    }

    /// A device will take no more frames. False where it is the last one: then it must.
    pub(super) fn gone(&self, device: usize) -> bool {
        let now_s = self.hub.clock.s();
        self.change(|s, _| {
            if s.feeds.iter().filter(|feed| !feed.is_gone).count() <= 1 {
                return false;
            }
            let feed = &mut s.feeds[device];
            feed.is_gone = true;
            feed.lease = None;
            s.scheduler.device_gone(now_s, device);
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
    fn leaves(&mut self, run: &mut Run, device: usize) {
        self.feeds[device].left += 1;
        run.turns[device][2] += 1;
    }

    /// Whether a device has enough ahead of it.
    fn is_fed(&self, device: usize, ahead: u64) -> bool {
        let feed = &self.feeds[device];
        if feed.is_gone || feed.given - feed.taken >= ahead {
            return true;
        }
        let on_their_way = |(job, run): (&JobId, &Run)| {
            let [given, _, left] = run.turns[device];
            (given - left) as f64 * self.scheduler.frame_s(device, *job)
        };
        feed.given - feed.left >= AHEAD_LEAST && self.runs.iter().map(on_their_way).sum::<f64>() > AHEAD_S
    }

    /// The next frame of a run, for the device that has the fewest ahead of it; and whether others were leased to other runs,
    /// whose readers must hear of it. Readers that find nothing wake nobody: they would wake each other without end.
    fn next(&mut self, job: JobId, now_s: f64, ahead: u64) -> (Option<Turn>, bool) {
        let mut others = false;
        let mut hungry: Vec<usize> = (0..self.feeds.len()).collect();
        hungry.retain(|&d| !self.is_fed(d, ahead));
        hungry.sort_by_key(|&d| self.feeds[d].given - self.feeds[d].taken);
        for device in hungry {
            if self.feeds[device].lease.is_none() {
                self.feeds[device].lease = self.scheduler.lease(now_s, device);
                others |= self.feeds[device].lease.as_ref().is_some_and(|lease| lease.job != job);
            }
            let feed = &mut self.feeds[device];
            let Some(lease) = feed.lease.as_mut().filter(|lease| lease.job == job) else { continue };
            let Some(frame) = lease.frames.next() else { continue };
            feed.lease.take_if(|lease| lease.frames.is_empty());
            feed.given += 1;
            let Some(run) = self.runs.get_mut(&job) else { break };
            let [given, ..] = &mut run.turns[device];
            *given += 1;
            return (Some(Turn { device, index: frame as usize, place: *given - 1 }), others);
        }
        (None, others)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COSTS: Costs = Costs { warm_s: 0.01, cold_s: 0.0, fits: true };

    fn hub(devices: usize) -> Hub {
        let facts = |kind| DeviceFacts { budget_bytes: 1 << 30, kind };
        Hub::new(Policy::Affinity, &(0..devices).map(facts).collect::<Vec<_>>())
    }

    fn share(hub: &Hub, frames: usize, ahead: usize, budget_bytes: u64) -> Share<'_> {
        let costs = vec![COSTS; hub.lock().feeds.len()];
        Share::new(hub, frames, 0, costs, ahead, budget_bytes).unwrap()
    }

    #[test]
    fn every_frame_is_given_once_and_in_order_on_each_device() {
        let (hub, stop) = (hub(2), Stop::default());
        let share = share(&hub, 100, 3, u64::MAX);
        let (mut seen, mut turns) = (vec![0; 100], [0; 2]);
        while let Some(turn) = share.next(&stop) {
            assert_eq!(turn.place, turns[turn.device]);
            turns[turn.device] += 1;
            seen[turn.index] += 1;
            share.taken(turn.device);
            share.done(turn.device, turn.index, 0.01);
        }
        assert_eq!(seen, [1; 100]);
        assert_eq!(share.left(), 0);
    }

    #[test]
    fn a_frame_that_fails_goes_to_another_device_and_fails_on_two() {
        let (hub, stop) = (hub(3), Stop::default());
        let share = share(&hub, 1, 3, u64::MAX);
        let first = share.next(&stop).unwrap();
        share.taken(first.device);
        assert!(share.failed(first.device, 0), "another one tries it");
        let second = share.next(&stop).unwrap();
        assert_ne!(second.device, first.device);
        share.taken(second.device);
        assert!(!share.failed(second.device, 0), "two have tried it");
        assert_eq!(share.next(&stop), None);
    }

    #[test]
    fn what_a_device_that_is_gone_had_goes_to_the_other() {
        let (hub, stop) = (hub(2), Stop::default());
        let share = share(&hub, 10, 2, u64::MAX);
        let first = share.next(&stop).unwrap();
        assert!(share.gone(first.device));
        share.gave_back(first.device, first.index);
        let mut seen = vec![0; 10];
        while let Some(turn) = share.next(&stop) {
            assert_ne!(turn.device, first.device);
            seen[turn.index] += 1;
            share.taken(turn.device);
            share.done(turn.device, turn.index, 0.01);
        }
        assert_eq!(seen, [1; 10]);
        assert!(!share.gone(1 - first.device), "the last one must go on");
    }

    #[test]
    fn only_what_is_leased_to_another_run_wakes_its_readers() {
        let hub = hub(1);
        let (one, other) = (share(&hub, 10, 1, u64::MAX), share(&hub, 10, 1, u64::MAX));
        let next = |share: &Share| hub.lock().next(share.job, hub.clock.s(), 1);
        let (mine, wakes) = next(&one);
        assert!(mine.is_some() != wakes, "the device's first frames are of one of them");
        let waits = if wakes { &one } else { &other };
        // the device has enough ahead of it, or its lease is the other's: nothing that anybody must hear of
        assert_eq!((next(waits), next(waits)), ((None, false), (None, false)));
    }

    #[test]
    fn the_frame_whose_turn_it_is_is_never_held_up() {
        let (hub, stop) = (hub(1), Stop::default());
        let share = share(&hub, 4, 2, 100);
        let first = share.next(&stop).unwrap();
        let second = share.next(&stop).unwrap();
        // the second came first, the first does not fit beside it, and goes on all the same
        share.take_bytes(second, 90);
        share.take_bytes(first, 50);
        share.taken(0);
        share.give_bytes(50);
        share.done(0, first.index, 0.01);
        let third = share.next(&stop).unwrap();
        std::thread::scope(|scope| {
            let waits = scope.spawn(|| share.take_bytes(third, 20));
            share.taken(0);
            share.give_bytes(90);
            waits.join().unwrap();
        });
        assert_eq!(hub.lock().bytes, 20);
    }

    #[test]
    fn runs_take_turns_and_one_that_ends_leaves_nothing_behind() {
        let (hub, stop) = (hub(1), Stop::default());
        let long = share(&hub, 1000, 3, u64::MAX);
        let first = long.next(&stop).unwrap();
        long.taken(0);
        long.done(0, first.index, 0.01);
        let short = share(&hub, 5, 3, u64::MAX);
        // what the device has leased is the long one's; then the short one has its turn
        let mut before = 0;
        let mut done = 0;
        while done < 5 {
            let (next, _) = hub.lock().next(short.job, hub.clock.s(), 3);
            if let Some(turn) = next {
                short.taken(0);
                short.done(0, turn.index, 0.01);
                done += 1;
                continue;
            }
            let turn = long.next(&stop).unwrap();
            long.taken(0);
            long.done(0, turn.index, 0.01);
            before += 1;
        }
        assert!(before < 100, "{before} frames of the long run went first");
        drop(long);
        assert_eq!(short.next(&stop), None);
        assert!(hub.lock().feeds[0].lease.is_none() && hub.lock().runs.len() == 1);
    }
}
