//! What readers read next and for which device, as the scheduler leases it; and what frames on their way may take of the
//! host's memory: a bound on their number for each device, and one on their bytes.

use crate::clock::Stopwatch;
use crate::device::Stop;
use crate::schedule::{Costs, DeviceFacts, JobId, Lease, NewJob, Policy, ScheduleError, Scheduler};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// On so many devices a frame is tried.
const TRIES: usize = 2;

/// A frame's place on its way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Turn {
    /// The device that it is read for.
    pub(super) device: usize,
    /// The place of its picture in the job.
    pub(super) index: usize,
    /// Its place among all that are read for that device, which takes them in that order.
    pub(super) turn: u64,
}

/// The frames of a run, shared out.
#[derive(Debug)]
pub(super) struct Share {
    clock: Stopwatch,
    /// Frames that are read ahead for each device.
    ahead: u64,
    budget_bytes: u64,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug)]
struct State {
    scheduler: Scheduler,
    job: JobId,
    feeds: Vec<Feed>,
    bytes: u64,
    /// Frames that are neither traced nor given up.
    left: u64,
    /// Frames that failed, and the devices they failed on.
    failed: HashMap<usize, Vec<usize>>,
}

/// What is read for a device.
#[derive(Clone, Debug, Default)]
struct Feed {
    /// What is leased to it and not given to a reader yet.
    leased: Range<u64>,
    /// Frames that readers took for it.
    given: u64,
    /// Those that it took of them.
    taken: u64,
    /// Those that left it.
    left: u64,
    is_gone: bool,
}

impl Share {
    /// For so many frames and devices with their budgets and costs.
    ///
    /// # Errors
    /// Where no device can hold the frames.
    pub(super) fn new(
        policy: Policy,
        frames: usize,
        devices: &[(DeviceFacts, Costs)],
        ahead: usize,
        budget_bytes: u64,
    ) -> Result<Self, ScheduleError> {
        let facts: Vec<DeviceFacts> = devices.iter().map(|d| d.0).collect();
        let mut scheduler = Scheduler::new(policy, &facts);
        let frames = frames as u64;
        let costs = devices.iter().map(|d| d.1).collect();
        let job = scheduler.add(0.0, &NewJob { frames, grows: false, priority: 0, costs, bytes: 0 })?;
        let state = State {
            scheduler,
            job,
            feeds: vec![Feed::default(); devices.len()],
            bytes: 0,
            left: frames,
            failed: HashMap::new(),
        };
        let (state, changed) = (Mutex::new(state), Condvar::new());
        Ok(Self { clock: Stopwatch::start(), ahead: ahead as u64, budget_bytes, state, changed })
    }

    /// What a reader reads next; waits while every device has enough ahead of it. None at the end.
    pub(super) fn next(&self, stop: &Stop) -> Option<Turn> {
        let mut state = self.lock();
        loop {
            if stop.asked() || state.scheduler.is_done(state.job) {
                break;
            }
            if let Some(turn) = state.next(self.clock.s(), self.ahead) {
                return Some(turn);
            }
            if state.feeds.iter().all(|feed| feed.given == feed.left && feed.leased.is_empty()) {
                // nothing is on its way that could change anything
                break;
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        drop(state);
        // the other readers must come to this point too
        self.changed.notify_all();
        None
    }

    /// Waits until so many bytes are free and takes them. The frame that its device waits for is not held up: those before
    /// it are done, and those behind it wait for it.
    pub(super) fn take_bytes(&self, turn: Turn, bytes: u64) {
        let is_held_up = |s: &mut State| {
            s.feeds[turn.device].taken < turn.turn && s.bytes.saturating_add(bytes) > self.budget_bytes
        };
        let mut state =
            self.changed.wait_while(self.lock(), is_held_up).unwrap_or_else(PoisonError::into_inner);
        state.bytes += bytes;
    }

    /// A frame has left its device's stage.
    pub(super) fn give_bytes(&self, bytes: u64) {
        self.change(|s| s.bytes -= bytes);
    }

    /// A device takes the next frame that was read for it.
    pub(super) fn taken(&self, device: usize) {
        self.change(|s| s.feeds[device].taken += 1);
    }

    /// A frame is traced, in so many seconds of its device; or ended where it was read, in none.
    pub(super) fn done(&self, device: usize, index: usize, seconds: f64) {
        self.change(|s| {
            s.feeds[device].left += 1;
            if s.scheduler.done(device, s.job, index as u64, seconds) {
                s.left -= 1;
            }
        });
    }

    /// A device made the scene resident, in so many seconds.
    pub(super) fn started(&self, device: usize, seconds: f64) {
        let now_s = self.clock.s();
        self.change(|s| {
            s.scheduler.learn(now_s, device, s.job, None, Some(seconds));
            s.scheduler.holds(device, s.job, true);
        });
    }

    /// A frame failed on a device: whether another one tries it.
    pub(super) fn failed(&self, device: usize, index: usize) -> bool {
        let now_s = self.clock.s();
        self.change(|s| {
            s.feeds[device].left += 1;
            let tried = s.failed.entry(index).or_default();
            tried.push(device);
            let is_other = |(d, feed): (usize, &Feed)| !feed.is_gone && !tried.contains(&d);
            let has_other = tried.len() < TRIES && s.feeds.iter().enumerate().any(is_other);
            let frame = index as u64;
            s.scheduler.give_back(now_s, device, s.job, frame..frame + 1, true);
            if !has_other {
                s.scheduler.give_up(s.job, frame);
                s.left -= 1;
            }
            has_other
        })
    }

    /// A frame comes back untraced.
    pub(super) fn gave_back(&self, device: usize, index: usize) {
        let now_s = self.clock.s();
        self.change(|s| {
            s.feeds[device].left += 1;
            let frame = index as u64;
            s.scheduler.give_back(now_s, device, s.job, frame..frame + 1, false);
        });
    }

    /// A device will take no more frames. False where it is the last one: then it must.
    pub(super) fn gone(&self, device: usize) -> bool {
        let now_s = self.clock.s();
        self.change(|s| {
            if s.feeds.iter().filter(|feed| !feed.is_gone).count() <= 1 {
                return false;
            }
            let feed = &mut s.feeds[device];
            feed.is_gone = true;
            feed.leased = 0..0;
            s.scheduler.device_gone(now_s, device);
            true
        })
    }

    /// Frames that are still to come.
    pub(super) fn left(&self) -> u64 {
        self.lock().left
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

impl State {
    /// The next frame for the device that has the fewest ahead of it.
    fn next(&mut self, now_s: f64, ahead: u64) -> Option<Turn> {
        let mut hungry: Vec<usize> = (0..self.feeds.len()).collect();
        hungry.retain(|&d| !self.feeds[d].is_gone && self.feeds[d].given - self.feeds[d].taken < ahead);
        hungry.sort_by_key(|&d| self.feeds[d].given - self.feeds[d].taken);
        for device in hungry {
            if self.feeds[device].leased.is_empty() {
                let lease = self.scheduler.lease(now_s, device);
                self.feeds[device].leased = lease.map_or(0..0, |Lease { frames, .. }| frames);
            }
            let feed = &mut self.feeds[device];
            if let Some(frame) = feed.leased.next() {
                feed.given += 1;
                return Some(Turn { device, index: frame as usize, turn: feed.given - 1 });
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COSTS: Costs = Costs { warm_s: 0.01, cold_s: 0.0, fits: true };

    fn share(frames: usize, devices: usize, ahead: usize, budget_bytes: u64) -> Share {
        let facts = DeviceFacts { budget_bytes: 1 << 30, kind: 0 };
        let mut all = vec![(facts, COSTS); devices];
        for (kind, (facts, _)) in all.iter_mut().enumerate() {
            facts.kind = kind;
        }
        Share::new(Policy::Affinity, frames, &all, ahead, budget_bytes).unwrap()
    }

    #[test]
    fn every_frame_is_given_once_and_in_order_on_each_device() {
        let (share, stop) = (share(100, 2, 3, u64::MAX), Stop::default());
        let (mut seen, mut turns) = (vec![0; 100], [0; 2]);
        while let Some(turn) = share.next(&stop) {
            assert_eq!(turn.turn, turns[turn.device]);
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
        let (share, stop) = (share(1, 3, 3, u64::MAX), Stop::default());
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
        let (share, stop) = (share(10, 2, 2, u64::MAX), Stop::default());
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
    fn the_frame_whose_turn_it_is_is_never_held_up() {
        let (share, stop) = (share(4, 1, 2, 100), Stop::default());
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
        assert_eq!(share.lock().bytes, 20);
    }
}
