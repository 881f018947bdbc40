//! What the scheduler remembers of a device.

use super::{DeviceFacts, JobId};
use std::ops::Range;

/// A device.
#[derive(Clone, Debug)]
pub(super) struct Device {
    pub(super) facts: DeviceFacts,
    pub(super) is_present: bool,
    /// How many times longer it takes than its kind is thought to take.
    pub(super) slowness: f64,
    /// The same of cold starts.
    pub(super) start_slowness: f64,
    /// The job that it takes its runs from.
    pub(super) serving: Option<Serving>,
    /// Jobs whose scenes it holds, the one served last at the end; those that have ended are dropped in passing.
    pub(super) resident: Vec<JobId>,
    /// Runs leased and not yet traced.
    pub(super) held: Vec<(JobId, Range<u64>)>,
}

/// What a device adds to a job.
#[derive(Clone, Copy, Debug)]
pub(super) struct Serving {
    pub(super) job: JobId,
    /// The frame before which it stands.
    pub(super) next: u64,
    /// Frames a second.
    pub(super) rate: f64,
    /// When its cold start should be over, where it is in one.
    pub(super) ready_s: Option<f64>,
}

impl Device {
    pub(super) fn new(facts: DeviceFacts) -> Self {
        Self {
            facts,
            is_present: true,
            slowness: 1.0,
            start_slowness: 1.0,
            serving: None,
            resident: Vec::new(),
            held: Vec::new(),
        }
    }

    pub(super) fn serves(&self, job: JobId) -> bool {
        self.serving.is_some_and(|serving| serving.job == job)
    }

    pub(super) fn holds(&self, job: JobId) -> bool {
        self.resident.contains(&job)
    }

    /// What it holds of a job was used.
    pub(super) fn used(&mut self, job: JobId) {
        if let Some(i) = self.resident.iter().position(|&j| j == job) {
            self.resident[i..].rotate_left(1);
        }
    }

    /// Takes frames out of what is leased to it; gives those that were.
    pub(super) fn release(&mut self, job: JobId, frames: &Range<u64>) -> Vec<Range<u64>> {
        let mut out = Vec::new();
        let mut i = 0;
        while i < self.held.len() {
            let (owner, run) = self.held[i].clone();
            let common = run.start.max(frames.start)..run.end.min(frames.end);
            if owner != job || common.is_empty() {
                i += 1;
                continue;
            }
            let rest = [run.start..common.start, common.end..run.end];
            let mut rest = rest.into_iter().filter(|r| !r.is_empty());
            match rest.next() {
                Some(first) => {
                    self.held[i].1 = first;
                    if let Some(second) = rest.next() {
                        self.held.insert(i + 1, (job, second));
                        i += 1;
                    }
                    i += 1;
                }
                None => {
                    self.held.remove(i);
                }
            }
            out.push(common);
        }
        out
    }
}
