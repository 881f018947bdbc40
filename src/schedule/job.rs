//! What the scheduler remembers of a job.

use super::device::Serving;
use super::order::Key;
use super::ranges::Ranges;
use super::rules::Served;
use super::{Costs, NewJob};
use std::collections::BTreeMap;
use std::ops::Range;

/// Where a job stands in a kind's order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// Nobody serves it.
    Waiting(Key),
    /// It is served and another device may help.
    Joinable(Key, Key),
}

/// What a job costs on a kind of device, and how often that was measured.
#[derive(Clone, Copy, Debug)]
pub(super) struct Estimate {
    pub(super) costs: Costs,
    /// Bytes of its scene there.
    pub(super) bytes: u64,
    pub(super) frames: u32,
    pub(super) starts: u32,
}

/// A frame that failed.
#[derive(Clone, Debug, Default)]
pub(super) struct Failed {
    /// The devices that it failed on.
    pub(super) on: Vec<usize>,
    /// Whether another tries it now.
    pub(super) is_leased: bool,
}

/// A job that has not ended.
#[derive(Clone, Debug)]
pub(super) struct Job {
    pub(super) total: u64,
    pub(super) grows: bool,
    /// Whether what is leased of it would be read.
    pub(super) is_read: bool,
    /// Its share beside others'.
    pub(super) weight: f64,
    pub(super) estimates: Vec<Estimate>,
    pub(super) open: Ranges,
    /// Frames that failed, and the devices they failed on.
    pub(super) failed: BTreeMap<u64, Failed>,
    /// Frames leased and not yet traced.
    pub(super) leased: u64,
    pub(super) traced: u64,
    /// Virtual time: that of the system when it came, and since then what it was served, over its weight.
    pub(super) served_s: f64,
    /// Seconds that it takes alone.
    pub(super) alone_s: f64,
    /// What it adds to the seconds of work that are left.
    pub(super) work_s: f64,
    pub(super) servers: usize,
    /// Frames a second of those who serve it.
    rate: f64,
    /// Of those in a cold start: their rates, and rates times the moments when they are ready.
    cold_rate: f64,
    cold_ready: f64,
    pub(super) slowest_s: f64,
    /// What it adds to the pressure of those that wait; 0 where it does not wait.
    pub(super) pressure: f64,
    pub(super) places: Vec<Option<Place>>,
}

impl Job {
    pub(super) fn new(new: &NewJob, served_s: f64, alone_s: f64) -> Self {
        let mut open = Ranges::default();
        open.open(0..new.frames);
        let estimate = |costs: &Costs| {
            // neither endless nor free, so that every formula is finite
            let (warm_s, cold_s) = (costs.warm_s.clamp(1e-6, 1e6), costs.cold_s.clamp(0.0, 1e6));
            Estimate { costs: Costs { warm_s, cold_s, ..*costs }, bytes: new.bytes, frames: 0, starts: 0 }
        };
        Self {
            total: new.frames,
            grows: new.grows,
            is_read: true,
            weight: weight(new.priority),
            estimates: new.costs.iter().map(estimate).collect(),
            open,
            failed: BTreeMap::new(),
            leased: 0,
            traced: 0,
            served_s,
            alone_s,
            work_s: 0.0,
            servers: 0,
            rate: 0.0,
            cold_rate: 0.0,
            cold_ready: 0.0,
            slowest_s: 0.0,
            pressure: 0.0,
            places: vec![None; new.costs.len()],
        }
    }

    pub(super) fn has_ended(&self) -> bool {
        !self.grows && self.traced == self.total
    }

    pub(super) fn left(&self) -> u64 {
        self.total - self.traced
    }

    /// Seconds of a frame on the fastest kind.
    pub(super) fn least_warm_s(&self) -> f64 {
        let fitting = self.estimates.iter().filter(|e| e.costs.fits);
        fitting.map(|e| e.costs.warm_s).fold(f64::INFINITY, f64::min)
    }

    /// The virtual time at which its last frame would be traced, were it served its share from when it came. While it is
    /// served this stays: what it was served grows as what is left shrinks.
    pub(super) fn finish_s(&self) -> f64 {
        self.served_s + self.left() as f64 * self.least_warm_s() / self.weight
    }

    /// What a device that joins now would find.
    pub(super) fn served(&self, now_s: f64, without: Option<&Serving>) -> Served {
        let mut rate = self.rate;
        let (mut cold_rate, mut cold_ready) = (self.cold_rate, self.cold_ready);
        if let Some(one) = without {
            rate -= one.rate;
            if let Some(ready_s) = one.ready_s {
                cold_rate -= one.rate;
                cold_ready -= one.rate * ready_s;
            }
        }
        Served {
            frames: (self.open.len() + self.leased) as f64,
            rate: rate.max(1e-12),
            debt: (cold_ready - cold_rate * now_s).max(0.0),
            slowest_s: self.slowest_s,
        }
    }

    pub(super) fn rate(&self) -> f64 {
        self.rate.max(1e-12)
    }

    /// What was leased comes back untraced, failed on a device or just not begun.
    pub(super) fn returns(&mut self, run: Range<u64>, failed_on: Option<usize>) {
        self.leased -= run.end - run.start;
        if failed_on.is_none() && self.failed.is_empty() {
            return self.open.open(run);
        }
        for frame in run {
            if failed_on.is_none() && !self.failed.contains_key(&frame) {
                self.open.open(frame..frame + 1);
                continue;
            }
            let failed = self.failed.entry(frame).or_default();
            failed.is_leased = false;
            failed.on.extend(failed_on);
        }
    }

    /// A frame was measured; what is true of one kind of device is thought to be true of those not measured yet, by the
    /// same factor.
    pub(super) fn learns_warm(&mut self, kind: usize, seconds: f64, gain: f64) {
        let known = &mut self.estimates[kind];
        known.frames = known.frames.saturating_add(1);
        let before_s = known.costs.warm_s;
        known.costs.warm_s += (seconds - before_s) * gain.max(1.0 / f64::from(known.frames));
        if known.frames == 1 {
            let factor = seconds / before_s;
            self.estimates.iter_mut().filter(|e| e.frames == 0).for_each(|e| e.costs.warm_s *= factor);
        }
    }

    /// The same of a cold start.
    pub(super) fn learns_cold(&mut self, kind: usize, seconds: f64, gain: f64) {
        let known = &mut self.estimates[kind];
        known.starts = known.starts.saturating_add(1);
        let before_s = known.costs.cold_s;
        known.costs.cold_s += (seconds - before_s) * gain.max(1.0 / f64::from(known.starts));
        if known.starts == 1 && before_s > 0.0 {
            let factor = seconds / before_s;
            self.estimates.iter_mut().filter(|e| e.starts == 0).for_each(|e| e.costs.cold_s *= factor);
        }
    }

    pub(super) fn joins(&mut self, serving: &Serving) {
        self.servers += 1;
        self.rate += serving.rate;
        self.slowest_s = self.slowest_s.max(1.0 / serving.rate);
        if let Some(ready_s) = serving.ready_s {
            self.cold_rate += serving.rate;
            self.cold_ready += serving.rate * ready_s;
        }
    }

    pub(super) fn is_ready(&mut self, serving: &mut Serving) {
        if let Some(ready_s) = serving.ready_s.take() {
            self.cold_rate -= serving.rate;
            self.cold_ready -= serving.rate * ready_s;
        }
    }

    pub(super) fn leaves(&mut self, mut serving: Serving) {
        self.is_ready(&mut serving);
        self.servers -= 1;
        self.rate -= serving.rate;
        if self.servers == 0 {
            // sums of many terms do not drift from one stretch of service into the next
            (self.rate, self.cold_rate, self.cold_ready, self.slowest_s) = (0.0, 0.0, 0.0, 0.0);
        }
    }
}

/// The share of a priority: a step doubles it.
pub(super) fn weight(priority: i32) -> f64 {
    f64::from(priority.clamp(-16, 16)).exp2()
}
