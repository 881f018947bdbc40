//! The event simulation: devices that take runs from a rule, make scenes resident, evict, trace, slow down and fail.

use super::rule::Rule;
use super::trace::Trace;
use crate::schedule::order::Key;
use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};
use std::ops::Range;

/// What happened.
#[derive(Clone, Debug, Default)]
pub(super) struct Happened {
    /// When each job's last frame was traced.
    pub(super) ends_s: Vec<f64>,
    /// When each job's first frame was begun.
    pub(super) begins_s: Vec<f64>,
    pub(super) cold_starts: u64,
    pub(super) cold_s: f64,
    pub(super) busy_s: f64,
    pub(super) bytes_moved: u64,
    pub(super) evictions: u64,
    pub(super) over_budget: u64,
    pub(super) leases: u64,
    /// Times that a device asked, in vain too.
    pub(super) asked: u64,
    /// Frames beyond those that a job has.
    pub(super) twice: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Event {
    Arrives(usize),
    Fails(usize),
    Slows(usize),
    /// The device's run ends; the number tells it from one that was cut off.
    Ends(usize, u64),
}

struct Place {
    speed: f64,
    held_bytes: u64,
    /// The last used at the end.
    held: Vec<usize>,
    /// Evicted while frames were left.
    evicted: BTreeSet<usize>,
    run: Option<Run>,
    runs: u64,
    is_present: bool,
}

struct Run {
    job: usize,
    frames: Range<u64>,
    /// When the first frame begins, and how long each takes.
    first_s: f64,
    frame_s: f64,
    cold_s: Option<f64>,
    begins_s: f64,
}

struct World<'a> {
    trace: &'a Trace,
    rule: &'a mut dyn Rule,
    events: BinaryHeap<Reverse<(Key, u64, Event)>>,
    sequence: u64,
    places: Vec<Place>,
    /// Frames not yet traced, by job.
    left: Vec<u64>,
    idle: Vec<usize>,
    happened: Happened,
}

/// Runs a trace through a rule. Frames traced twice are counted, not refused: it is the rule that is tested.
pub(super) fn simulate(trace: &Trace, rule: &mut dyn Rule) -> Happened {
    let place = |d: &super::trace::TraceDevice| Place {
        speed: d.speed,
        held_bytes: 0,
        held: Vec::new(),
        evicted: BTreeSet::new(),
        run: None,
        runs: 0,
        is_present: true,
    };
    let mut world = World {
        trace,
        rule,
        events: BinaryHeap::new(),
        sequence: 0,
        places: trace.devices.iter().map(place).collect(),
        left: trace.jobs.iter().map(|j| j.frames).collect(),
        idle: (0..trace.devices.len()).collect(),
        happened: Happened {
            ends_s: vec![f64::INFINITY; trace.jobs.len()],
            begins_s: vec![f64::INFINITY; trace.jobs.len()],
            ..Happened::default()
        },
    };
    for (i, job) in trace.jobs.iter().enumerate() {
        world.at(job.arrives_s, Event::Arrives(i));
    }
    for (i, device) in trace.devices.iter().enumerate() {
        if let Some((slows_s, _)) = device.slows {
            world.at(slows_s, Event::Slows(i));
        }
        if let Some(fails_s) = device.fails_s {
            world.at(fails_s, Event::Fails(i));
        }
    }
    world.run();
    world.happened
}

impl World<'_> {
    fn at(&mut self, time_s: f64, event: Event) {
        self.sequence += 1;
        self.events.push(Reverse((Key(time_s), self.sequence, event)));
    }

    fn run(&mut self) {
        while let Some(Reverse((Key(now_s), _, event))) = self.events.pop() {
            match event {
                Event::Arrives(job) => self.rule.arrives(now_s, job),
                Event::Slows(device) => {
                    self.places[device].speed /= self.trace.devices[device].slows.map_or(1.0, |s| s.1);
                }
                Event::Fails(device) => self.fails(now_s, device),
                Event::Ends(device, run) => {
                    if self.places[device].runs != run || !self.places[device].is_present {
                        continue;
                    }
                    self.ends(device);
                    self.idle.push(device);
                }
            }
            // what comes at the same time is known before anything is decided
            if self.events.peek().is_none_or(|Reverse((next, _, _))| next.0 > now_s) {
                self.start_idle(now_s);
            }
        }
    }

    fn start_idle(&mut self, now_s: f64) {
        // one device's decision may be what another waits for
        let mut has_started = true;
        while has_started {
            has_started = false;
            for device in std::mem::take(&mut self.idle) {
                if !self.places[device].is_present {
                    continue;
                }
                self.happened.asked += 1;
                match self.rule.next(now_s, device) {
                    Some((job, frames)) => {
                        has_started = true;
                        self.start(now_s, device, job, frames);
                    }
                    None => self.idle.push(device),
                }
            }
        }
    }

    fn start(&mut self, now_s: f64, device: usize, job: usize, frames: Range<u64>) {
        self.happened.leases += 1;
        self.happened.begins_s[job] = self.happened.begins_s[job].min(now_s);
        let truth = &self.trace.jobs[job];
        let facts = &self.trace.devices[device];
        let place = &mut self.places[device];
        let cold_s = if let Some(i) = place.held.iter().position(|&held| held == job) {
            place.held.remove(i);
            None
        } else {
            while place.held_bytes.saturating_add(truth.bytes) > facts.budget_bytes && !place.held.is_empty()
            {
                // what has ended first, then what was used least recently
                let ended = place.held.iter().position(|&held| self.left[held] == 0);
                let out = place.held.remove(ended.unwrap_or(0));
                place.held_bytes -= self.trace.jobs[out].bytes;
                if ended.is_none() {
                    place.evicted.insert(out);
                }
                self.rule.holds(device, out, false);
            }
            place.held_bytes = place.held_bytes.saturating_add(truth.bytes);
            self.happened.over_budget += u64::from(place.held_bytes > facts.budget_bytes);
            self.happened.bytes_moved += truth.bytes;
            self.happened.cold_starts += 1;
            self.happened.evictions += u64::from(place.evicted.remove(&job));
            let slowness = facts.speed / place.speed;
            Some(truth.cold_s * facts.cold_factor() * slowness)
        };
        place.held.push(job);
        let frame_s = truth.warm_s / place.speed;
        let first_s = now_s + cold_s.unwrap_or(0.0);
        let ends_s = first_s + frame_s * (frames.end - frames.start) as f64;
        place.runs += 1;
        let runs = place.runs;
        place.run = Some(Run { job, frames, first_s, frame_s, cold_s, begins_s: now_s });
        self.at(ends_s, Event::Ends(device, runs));
    }

    /// All of a run is traced.
    fn ends(&mut self, device: usize) {
        let Some(run) = self.places[device].run.take() else { return };
        self.traced(device, &run, run.frames.end);
    }

    fn traced(&mut self, device: usize, run: &Run, end: u64) {
        if let Some(cold_s) = run.cold_s {
            self.rule.started(run.first_s, device, run.job, cold_s);
            self.happened.cold_s += cold_s;
        }
        let ends_s = run.first_s + run.frame_s * (end - run.frames.start) as f64;
        self.happened.busy_s += ends_s - run.begins_s;
        for frame in run.frames.start..end {
            self.rule.done(ends_s, device, run.job, frame, run.frame_s);
            self.happened.twice += u64::from(self.left[run.job] == 0);
            self.left[run.job] = self.left[run.job].saturating_sub(1);
        }
        if self.left[run.job] == 0 && end > run.frames.start {
            self.happened.ends_s[run.job] = ends_s;
        }
    }

    fn fails(&mut self, now_s: f64, device: usize) {
        self.places[device].is_present = false;
        if let Some(run) = self.places[device].run.take() {
            let whole = ((now_s - run.first_s) / run.frame_s).floor().max(0.0) as u64;
            let end = (run.frames.start + whole).min(run.frames.end);
            if now_s >= run.first_s {
                self.traced(device, &run, end);
            }
            self.rule.back(now_s, device, run.job, end..run.frames.end);
        }
        self.rule.gone(now_s, device);
    }
}
