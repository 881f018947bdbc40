//! Whatever happens, each frame is leased to one device at a time until it is traced, once, on a device that can hold its
//! scene and where it has not failed; and every job ends.

use proptest::prelude::*;
use rentix::schedule::{Costs, DeviceFacts, JobId, NewJob, Policy, Scheduler};
use std::collections::{BTreeMap, BTreeSet};

const DEVICES: usize = 4;
/// Two kinds, the second with room for small scenes alone.
const KINDS: [usize; DEVICES] = [0, 0, 1, 1];
const BUDGETS: [u64; DEVICES] = [1000, 1000, 100, 100];

#[derive(Clone, Debug)]
enum Event {
    Add { frames: u64, warm_ms: [u16; 2], cold_ms: u16, bytes: u64, grows: bool },
    Lease(usize),
    Done { device: usize, slower: u8 },
    GiveBack { device: usize, have_failed: bool },
    Gone(usize),
    Back(usize),
    Append { job: usize, more: u64 },
    Cancel(usize),
    Priority { job: usize, priority: i32 },
    Holds { device: usize, job: usize, is_resident: bool },
    Learn { device: usize, job: usize, cold_ms: u16 },
    Wait(u8),
}

fn event() -> impl Strategy<Value = Event> {
    let device = 0..DEVICES;
    let job = 0..8_usize;
    prop_oneof![
        3 => (0..60_u64, any::<[u16; 2]>(), any::<u16>(), prop::sample::select(vec![0, 50, 100, 101, 1000]), any::<bool>())
            .prop_map(|(frames, warm_ms, cold_ms, bytes, grows)| Event::Add { frames, warm_ms, cold_ms, bytes, grows }),
        12 => device.clone().prop_map(Event::Lease),
        12 => (device.clone(), any::<u8>()).prop_map(|(device, slower)| Event::Done { device, slower }),
        2 => (device.clone(), any::<bool>()).prop_map(|(device, have_failed)| Event::GiveBack { device, have_failed }),
        1 => device.clone().prop_map(Event::Gone),
        1 => device.clone().prop_map(Event::Back),
        1 => (job.clone(), 0..20_u64).prop_map(|(job, more)| Event::Append { job, more }),
        1 => job.clone().prop_map(Event::Cancel),
        1 => (job.clone(), any::<i32>()).prop_map(|(job, priority)| Event::Priority { job, priority }),
        4 => (device.clone(), job.clone(), any::<bool>())
            .prop_map(|(device, job, is_resident)| Event::Holds { device, job, is_resident }),
        1 => (device, job, any::<u16>()).prop_map(|(device, job, cold_ms)| Event::Learn { device, job, cold_ms }),
        4 => any::<u8>().prop_map(Event::Wait),
    ]
}

/// What the caller knows.
struct Caller {
    scheduler: Scheduler,
    now_s: f64,
    jobs: Vec<Known>,
    held: [Vec<(usize, u64)>; DEVICES],
    is_present: [bool; DEVICES],
}

struct Known {
    id: JobId,
    frames: u64,
    bytes: u64,
    grows: bool,
    is_cancelled: bool,
    traced: BTreeSet<u64>,
    failed: BTreeMap<u64, BTreeSet<usize>>,
}

impl Caller {
    fn new(policy: Policy) -> Self {
        let facts = |d: usize| DeviceFacts { budget_bytes: BUDGETS[d], kind: KINDS[d] };
        Self {
            scheduler: Scheduler::new(policy, &(0..DEVICES).map(facts).collect::<Vec<_>>()),
            now_s: 0.0,
            jobs: Vec::new(),
            held: Default::default(),
            is_present: [true; DEVICES],
        }
    }

    fn apply(&mut self, event: &Event) -> Result<(), TestCaseError> {
        match *event {
            Event::Add { frames, warm_ms, cold_ms, bytes, grows } => {
                let costs = |ms: u16| Costs { warm_s: ms.into(), cold_s: cold_ms.into(), fits: true };
                let costs = warm_ms.map(|ms| Costs { warm_s: f64::from(ms) / 1e3, ..costs(ms) }).to_vec();
                let new = NewJob { frames, grows, priority: 0, costs, bytes };
                let id = self.scheduler.add(self.now_s, &new).unwrap();
                let (traced, failed) = Default::default();
                self.jobs.push(Known { id, frames, bytes, grows, is_cancelled: false, traced, failed });
            }
            Event::Lease(device) => {
                self.lease(device)?;
            }
            Event::Done { device, slower } => self.done(device, f64::from(slower) / 1e2)?,
            Event::GiveBack { device, have_failed } => {
                if let Some((job, frame)) = self.held[device].pop() {
                    let known = &mut self.jobs[job];
                    self.scheduler.give_back(self.now_s, device, known.id, frame..frame + 1, have_failed);
                    if have_failed {
                        known.failed.entry(frame).or_default().insert(device);
                    }
                }
            }
            Event::Gone(device) => {
                self.scheduler.device_gone(self.now_s, device);
                self.held[device].clear();
                self.is_present[device] = false;
            }
            Event::Back(device) => {
                self.scheduler.device_back(device);
                self.is_present[device] = true;
            }
            Event::Append { job, more } => {
                if let Some(known) = self.jobs.get_mut(job).filter(|j| j.grows && !j.is_cancelled) {
                    self.scheduler.append(self.now_s, known.id, more);
                    known.frames += more;
                }
            }
            Event::Cancel(job) => {
                if let Some(known) = self.jobs.get_mut(job) {
                    self.scheduler.cancel(known.id);
                    known.is_cancelled = true;
                    self.held.iter_mut().for_each(|held| held.retain(|(owner, _)| *owner != job));
                }
            }
            Event::Priority { job, priority } => {
                if let Some(known) = self.jobs.get(job) {
                    self.scheduler.priority(self.now_s, known.id, priority);
                }
            }
            Event::Holds { device, job, is_resident } => {
                if let Some(known) = self.jobs.get(job).filter(|_| self.is_present[device]) {
                    self.scheduler.holds(device, known.id, is_resident);
                }
            }
            Event::Learn { device, job, cold_ms } => {
                if let Some(known) = self.jobs.get(job) {
                    let cold_s = Some(f64::from(cold_ms) / 1e3);
                    self.scheduler.learn(self.now_s, device, known.id, None, cold_s);
                }
            }
            Event::Wait(ms) => self.now_s += f64::from(ms) / 1e3,
        }
        Ok(())
    }

    fn lease(&mut self, device: usize) -> Result<bool, TestCaseError> {
        let Some(lease) = self.scheduler.lease(self.now_s, device) else { return Ok(false) };
        prop_assert!(self.is_present[device] && !lease.frames.is_empty());
        let job = self.jobs.iter().position(|j| j.id == lease.job).unwrap();
        let known = &self.jobs[job];
        prop_assert!(
            !known.is_cancelled && known.bytes <= BUDGETS[device] && lease.frames.end <= known.frames
        );
        for frame in lease.frames {
            prop_assert!(!known.traced.contains(&frame), "traced already");
            prop_assert!(!self.held.iter().flatten().any(|&held| held == (job, frame)), "leased already");
            let failed = known.failed.get(&frame);
            prop_assert!(!failed.is_some_and(|on| on.contains(&device)), "failed there before");
            self.held[device].push((job, frame));
        }
        Ok(true)
    }

    fn done(&mut self, device: usize, seconds: f64) -> Result<(), TestCaseError> {
        if self.held[device].is_empty() {
            return Ok(());
        }
        let (job, frame) = self.held[device].remove(0);
        let known = &mut self.jobs[job];
        prop_assert!(self.scheduler.done(device, known.id, frame, seconds));
        prop_assert!(!self.scheduler.done(device, known.id, frame, seconds), "a second time");
        prop_assert!(known.traced.insert(frame));
        Ok(())
    }

    /// Devices ask and trace in turn until all is done.
    fn finish(&mut self) -> Result<(), TestCaseError> {
        for job in &mut self.jobs {
            self.scheduler.close(job.id);
            for (&frame, on) in &job.failed {
                let able = (0..DEVICES).filter(|&d| job.bytes <= BUDGETS[d]).all(|d| on.contains(&d));
                if able && !job.is_cancelled {
                    self.scheduler.give_up(job.id, frame);
                    job.traced.insert(frame);
                }
            }
        }
        (0..DEVICES).for_each(|device| self.scheduler.device_back(device));
        self.is_present = [true; DEVICES];
        while !self.scheduler.is_idle() {
            let mut has_work = false;
            for device in 0..DEVICES {
                self.lease(device)?;
                while !self.held[device].is_empty() {
                    has_work = true;
                    self.done(device, 0.01)?;
                }
            }
            self.now_s += 0.01;
            prop_assert!(has_work, "work is left and nobody gets it");
        }
        for job in &self.jobs {
            prop_assert!(self.scheduler.is_done(job.id));
            prop_assert!(job.is_cancelled || job.traced.len() as u64 == job.frames);
        }
        Ok(())
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn each_frame_is_traced_once(events in prop::collection::vec(event(), 0..300), fifo: bool) {
        let mut caller = Caller::new(if fifo { Policy::Fifo } else { Policy::Affinity });
        for event in &events {
            caller.apply(event)?;
        }
        caller.finish()?;
    }
}
