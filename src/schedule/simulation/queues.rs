//! The thesis's rules and the plainest: one queue for all devices, or one for each.

use super::rule::{Rule, Seen};
use super::trace::Trace;
use std::collections::{HashSet, VecDeque};
use std::ops::Range;

/// One queue, oldest frame first, to whichever device is free.
pub(super) struct GlobalQueue {
    seen: Seen,
    queue: VecDeque<(usize, Range<u64>)>,
}

impl GlobalQueue {
    pub(super) fn new(trace: &Trace) -> Self {
        Self { seen: Seen::of(trace), queue: VecDeque::new() }
    }
}

impl Rule for GlobalQueue {
    fn arrives(&mut self, _now_s: f64, job: usize) {
        self.queue.push_back((job, 0..self.seen.frames(job)));
    }

    fn next(&mut self, _now_s: f64, device: usize) -> Option<(usize, Range<u64>)> {
        let at = self.queue.iter().position(|(job, _)| self.seen.fits(device, *job))?;
        let (job, frames) = &mut self.queue[at];
        let (job, first) = (*job, frames.start);
        frames.start += 1;
        if frames.is_empty() {
            self.queue.remove(at);
        }
        Some((job, first..first + 1))
    }

    fn back(&mut self, _now_s: f64, _device: usize, job: usize, frames: Range<u64>) {
        self.queue.push_front((job, frames));
    }

    fn gone(&mut self, _now_s: f64, _device: usize) {}
}

/// How a queue for each device is filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Deal {
    /// Frame by frame, to each device in turn.
    Alternately,
    /// Each job in parts, by the devices' speeds.
    Parts,
    /// Each job whole, to the device that would end it first.
    Whole,
}

/// What an idle device gets from another's queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Balance {
    /// Nothing.
    Never,
    /// A device that comes to its next frame and sees an idle one gives it half of its own queue.
    Donate,
    /// An idle device takes half of the longest queue, from its end.
    Steal,
}

/// A queue for each device.
pub(super) struct LocalQueues {
    seen: Seen,
    deal: Deal,
    balance: Balance,
    /// Shortest remaining job first, else the oldest.
    shortest_first: bool,
    queues: Vec<VecDeque<(usize, Range<u64>)>>,
    /// Seconds queued.
    loads_s: Vec<f64>,
    resident: Vec<HashSet<usize>>,
    is_present: Vec<bool>,
    is_idle: Vec<bool>,
    turn: usize,
}

impl LocalQueues {
    pub(super) fn new(trace: &Trace, deal: Deal, balance: Balance, shortest_first: bool) -> Self {
        let count = trace.devices.len();
        Self {
            seen: Seen::of(trace),
            deal,
            balance,
            shortest_first,
            queues: vec![VecDeque::new(); count],
            loads_s: vec![0.0; count],
            resident: vec![HashSet::new(); count],
            is_present: vec![true; count],
            is_idle: vec![true; count],
            turn: 0,
        }
    }

    fn takers(&self, job: usize) -> Vec<usize> {
        (0..self.queues.len()).filter(|&d| self.is_present[d] && self.seen.fits(d, job)).collect()
    }

    fn cold_s(&self, device: usize, job: usize) -> f64 {
        if self.resident[device].contains(&job) { 0.0 } else { self.seen.cold_s(device, job) }
    }

    fn seconds(&self, device: usize, job: usize, frames: &Range<u64>) -> f64 {
        self.seen.warm_s(device, job) * (frames.end - frames.start) as f64
    }

    /// Adds to the end of a queue; a run that goes on where the last ends is one with it.
    fn push(&mut self, device: usize, job: usize, frames: Range<u64>) {
        if frames.is_empty() {
            return;
        }
        self.loads_s[device] += self.seconds(device, job, &frames);
        if let Some((last, run)) = self.queues[device].back_mut()
            && *last == job
            && run.end == frames.start
        {
            run.end = frames.end;
            return;
        }
        self.queues[device].push_back((job, frames));
    }

    fn share_out(&mut self, job: usize, frames: Range<u64>) {
        let takers = self.takers(job);
        if takers.is_empty() {
            return;
        }
        match self.deal {
            Deal::Alternately => {
                for frame in frames {
                    self.push(takers[self.turn % takers.len()], job, frame..frame + 1);
                    self.turn += 1;
                }
            }
            Deal::Parts => {
                let sum: f64 = takers.iter().map(|&d| self.seen.speed(d)).sum();
                let (mut start, mut share) = (frames.start, 0.0);
                for (i, &device) in takers.iter().enumerate() {
                    share += self.seen.speed(device) / sum;
                    let end = frames.start + ((frames.end - frames.start) as f64 * share).round() as u64;
                    let end = if i + 1 == takers.len() { frames.end } else { end.clamp(start, frames.end) };
                    self.push(device, job, start..end);
                    start = end;
                }
            }
            Deal::Whole => {
                let ends_s = |d: usize| self.loads_s[d] + self.cold_s(d, job) + self.seconds(d, job, &frames);
                let best = takers.iter().copied().min_by(|&a, &b| ends_s(a).total_cmp(&ends_s(b)));
                if let Some(device) = best {
                    // its cold start counts for those that come after it
                    self.push(device, job, frames);
                }
            }
        }
    }

    /// Moves half of a queue, by seconds, from its end to an idle device; not what would take longer there, by its cold
    /// start, than it would wait.
    fn move_half(&mut self, from: usize, to: usize) -> bool {
        let half_s = self.loads_s[from] / 2.0;
        let mut moved_s = 0.0;
        let mut moved = Vec::new();
        let mut i = self.queues[from].len();
        while i > 0 && moved_s < half_s {
            i -= 1;
            let (job, frames) = self.queues[from][i].clone();
            let worth_s = self.loads_s[from] - moved_s;
            if !self.seen.fits(to, job) || self.cold_s(to, job) + self.seen.warm_s(to, job) >= worth_s {
                continue;
            }
            let frame_s = self.seen.warm_s(from, job);
            let count = ((half_s - moved_s) / frame_s).ceil().max(1.0) as u64;
            let start = frames.end.saturating_sub(count).max(frames.start);
            moved_s += frame_s * (frames.end - start) as f64;
            if start == frames.start {
                self.queues[from].remove(i);
            } else {
                self.queues[from][i].1.end = start;
            }
            moved.push((job, start..frames.end));
        }
        self.loads_s[from] -= moved_s;
        let any = !moved.is_empty();
        for (job, frames) in moved.into_iter().rev() {
            self.push(to, job, frames);
        }
        any
    }

    fn longest(&self, but: usize) -> Option<usize> {
        let others = (0..self.queues.len()).filter(|&d| d != but && !self.queues[d].is_empty());
        others.max_by(|&a, &b| self.loads_s[a].total_cmp(&self.loads_s[b]))
    }
}

impl Rule for LocalQueues {
    fn arrives(&mut self, _now_s: f64, job: usize) {
        self.share_out(job, 0..self.seen.frames(job));
    }

    fn next(&mut self, _now_s: f64, device: usize) -> Option<(usize, Range<u64>)> {
        if self.queues[device].is_empty()
            && self.balance == Balance::Steal
            && let Some(victim) = self.longest(device)
        {
            self.move_half(victim, device);
        }
        self.is_idle[device] = self.queues[device].is_empty();
        let left_s = |(job, frames): &(usize, Range<u64>)| {
            self.cold_s(device, *job) + self.seconds(device, *job, frames)
        };
        let at = if self.shortest_first {
            let numbered = self.queues[device].iter().enumerate();
            numbered.min_by(|a, b| left_s(a.1).total_cmp(&left_s(b.1)))?.0
        } else {
            0
        };
        let (job, frames) = self.queues[device].get_mut(at)?;
        let (job, first) = (*job, frames.start);
        frames.start += 1;
        if frames.is_empty() {
            self.queues[device].remove(at);
        }
        self.loads_s[device] = (self.loads_s[device] - self.seen.warm_s(device, job)).max(0.0);
        if self.queues[device].is_empty() {
            self.loads_s[device] = 0.0;
        }
        let is_free = |&d: &usize| d != device && self.is_idle[d] && self.is_present[d];
        if self.balance == Balance::Donate
            && let Some(idle) = (0..self.queues.len()).find(is_free)
            && self.move_half(device, idle)
        {
            self.is_idle[idle] = false;
        }
        Some((job, first..first + 1))
    }

    fn started(&mut self, _now_s: f64, device: usize, job: usize, _seconds: f64) {
        self.resident[device].insert(job);
    }

    fn holds(&mut self, device: usize, job: usize, is_resident: bool) {
        if is_resident {
            self.resident[device].insert(job);
        } else {
            self.resident[device].remove(&job);
        }
    }

    fn back(&mut self, _now_s: f64, device: usize, job: usize, frames: Range<u64>) {
        self.push(device, job, frames);
    }

    fn gone(&mut self, _now_s: f64, device: usize) {
        self.is_present[device] = false;
        self.loads_s[device] = 0.0;
        for (job, frames) in std::mem::take(&mut self.queues[device]) {
            self.share_out(job, frames);
        }
    }
}
