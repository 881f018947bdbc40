//! What is compared: the product's scheduler and, beside it, the thesis's and the plainest, each behind one trait.

use super::trace::{Trace, TraceDevice, TraceJob};
use crate::schedule::{Costs, DeviceFacts, JobId, Lease, NewJob, Policy, Scheduler, Weights};
use std::ops::Range;

/// A rule that shares frames out. It sees what a trace's jobs are thought to be, never what they are.
pub(super) trait Rule {
    fn arrives(&mut self, now_s: f64, job: usize);
    fn next(&mut self, now_s: f64, device: usize) -> Option<(usize, Range<u64>)>;
    fn done(&mut self, _now_s: f64, _device: usize, _job: usize, _frame: u64, _seconds: f64) {}
    /// A cold start took so long.
    fn started(&mut self, _now_s: f64, _device: usize, _job: usize, _seconds: f64) {}
    fn holds(&mut self, _device: usize, _job: usize, _is_resident: bool) {}
    /// Frames of a run that was cut off.
    fn back(&mut self, now_s: f64, device: usize, job: usize, frames: Range<u64>);
    fn gone(&mut self, now_s: f64, device: usize);
}

/// What a rule is told of a trace.
#[derive(Clone, Debug)]
pub(super) struct Seen {
    jobs: Vec<TraceJob>,
    devices: Vec<TraceDevice>,
}

impl Seen {
    pub(super) fn of(trace: &Trace) -> Self {
        let see = |job: &TraceJob| TraceJob {
            warm_s: job.warm_s * job.seen[0],
            cold_s: job.cold_s * job.seen[1],
            ..job.clone()
        };
        Self { jobs: trace.jobs.iter().map(see).collect(), devices: trace.devices.clone() }
    }

    pub(super) fn frames(&self, job: usize) -> u64 {
        self.jobs[job].frames
    }

    pub(super) fn speed(&self, device: usize) -> f64 {
        self.devices[device].speed
    }

    pub(super) fn fits(&self, device: usize, job: usize) -> bool {
        self.jobs[job].bytes <= self.devices[device].budget_bytes
    }

    pub(super) fn warm_s(&self, device: usize, job: usize) -> f64 {
        self.jobs[job].warm_s / self.devices[device].speed
    }

    pub(super) fn cold_s(&self, device: usize, job: usize) -> f64 {
        self.jobs[job].cold_s * self.devices[device].cold_factor()
    }
}

/// The product's scheduler.
pub(super) struct Product {
    seen: Seen,
    kinds: Vec<usize>,
    scheduler: Scheduler,
    ids: Vec<Option<JobId>>,
    /// By id.
    jobs: Vec<usize>,
}

impl Product {
    pub(super) fn new(trace: &Trace, policy: Policy, weights: Weights) -> Self {
        let seen = Seen::of(trace);
        let mut kinds: Vec<usize> = Vec::new();
        let mut facts = Vec::new();
        for (i, device) in seen.devices.iter().enumerate() {
            let equal = |&k: &usize| {
                let other = &seen.devices[k];
                other.speed == device.speed && other.budget_bytes == device.budget_bytes
            };
            let kind = kinds.iter().position(equal).unwrap_or_else(|| {
                kinds.push(i);
                kinds.len() - 1
            });
            facts.push(DeviceFacts { budget_bytes: device.budget_bytes, kind });
        }
        let scheduler = Scheduler::with_weights(policy, weights, &facts);
        let ids = vec![None; seen.jobs.len()];
        Self { seen, kinds, scheduler, ids, jobs: Vec::new() }
    }
}

impl Rule for Product {
    fn arrives(&mut self, now_s: f64, job: usize) {
        let costs = self.kinds.iter().map(|&device| Costs {
            warm_s: self.seen.warm_s(device, job),
            cold_s: self.seen.cold_s(device, job),
            fits: self.seen.fits(device, job),
        });
        let one = &self.seen.jobs[job];
        let new = NewJob {
            frames: one.frames,
            grows: false,
            priority: 0,
            costs: costs.collect(),
            bytes: one.bytes,
        };
        if let Ok(id) = self.scheduler.add(now_s, &new) {
            self.ids[job] = Some(id);
            self.jobs.push(job);
        }
    }

    fn next(&mut self, now_s: f64, device: usize) -> Option<(usize, Range<u64>)> {
        let Lease { job, frames } = self.scheduler.lease(now_s, device)?;
        Some((self.jobs[job.0], frames))
    }

    fn done(&mut self, _now_s: f64, device: usize, job: usize, frame: u64, seconds: f64) {
        if let Some(id) = self.ids[job] {
            self.scheduler.done(device, id, frame, seconds);
        }
    }

    fn started(&mut self, now_s: f64, device: usize, job: usize, seconds: f64) {
        if let Some(id) = self.ids[job] {
            self.scheduler.holds(device, id, true);
            self.scheduler.learn(now_s, device, id, None, Some(seconds));
        }
    }

    fn holds(&mut self, device: usize, job: usize, is_resident: bool) {
        if let Some(id) = self.ids[job] {
            self.scheduler.holds(device, id, is_resident);
        }
    }

    fn back(&mut self, now_s: f64, device: usize, job: usize, frames: Range<u64>) {
        if let Some(id) = self.ids[job] {
            self.scheduler.give_back(now_s, device, id, frames, false);
        }
    }

    fn gone(&mut self, now_s: f64, device: usize) {
        self.scheduler.device_gone(now_s, device);
    }
}
