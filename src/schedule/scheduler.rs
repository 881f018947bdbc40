//! Jobs and devices, and the events that change them.

use super::device::{Device, Serving};
use super::job::{Estimate, Failed, Job, weight};
use super::order::Key;
use super::rules::{Weights, alone_s, run_length};
use super::{DeviceFacts, JobId, Lease, NewJob, Policy, ScheduleError};
use std::collections::BTreeSet;
use std::ops::Range;

/// How much of a new measurement counts, where there are many.
const FRAME_GAIN: f64 = 0.05;
const START_GAIN: f64 = 0.5;
const SLOWNESS_GAIN: f64 = 0.3;

/// Shares frames out.
///
/// Jobs are served in the order of their virtual finish times, as in weighted fair queueing (Parekh and Gallager 1993): a
/// job begins at the system's virtual time v, which grows by a second for each second of service over the sum of all
/// weights, and finishes when its own work over its weight is done. Of jobs that come together the shortest is first.
///
/// **Nothing waits for ever.** A job's key K = v₀ + (W + φPc)/p (v₀ the virtual time when it came, W its seconds of work, c
/// its cold start, P devices, p its weight) stays as it is while it waits, but for what is learnt and appended. A job that
/// comes once v ≥ K has a greater finish time, hence key, and a device that falls free takes from the least key of
/// what it holds and what waits. So only work that came before v reached K goes before it, a batch on each device aside.
/// v reaches K: while it waits the soonest device that fits works, so v grows by 1/A for each second of service, A the
/// sum of the active weights. With P equal devices and at most n active jobs of weight 1, v has grown by (W + φPc) after
/// n·(W/P + φc) seconds: n times what the job would take alone. Even where more comes than can ever be served, A grows no
/// faster than jobs come, linearly in time, and the integral of 1/A has no bound.
#[derive(Clone, Debug)]
pub struct Scheduler {
    pub(super) policy: Policy,
    pub(super) weights: Weights,
    pub(super) devices: Vec<Device>,
    pub(super) kinds: Vec<Kind>,
    /// By id; those that have ended are gone.
    pub(super) jobs: Vec<Option<Box<Job>>>,
    /// Jobs with frames that failed somewhere.
    pub(super) troubled: BTreeSet<usize>,
    pub(super) virtual_s: f64,
    pub(super) active_weight: f64,
    pub(super) active: usize,
    /// Seconds until all that there is would be traced, were nothing lost.
    pub(super) work_s: f64,
    /// The sum of 1/(seconds alone) of active jobs.
    pub(super) pressure: f64,
}

/// Devices that are equal, and the orders in which jobs stand for them.
#[derive(Clone, Debug, Default)]
pub(super) struct Kind {
    pub(super) present: usize,
    pub(super) budget_bytes: u64,
    pub(super) waiting: BTreeSet<(Key, usize)>,
    pub(super) joinable: BTreeSet<(Key, usize)>,
    /// The same jobs, the one that ends last first.
    pub(super) last: BTreeSet<(Key, usize)>,
}

impl Scheduler {
    /// Without jobs yet.
    pub fn new(policy: Policy, devices: &[DeviceFacts]) -> Self {
        Self::with_weights(policy, Weights::default(), devices)
    }

    /// The same with other weights than the usual.
    pub fn with_weights(policy: Policy, weights: Weights, devices: &[DeviceFacts]) -> Self {
        let count = devices.iter().map(|d| d.kind + 1).max().unwrap_or(0);
        let mut kinds = vec![Kind::default(); count];
        for device in devices {
            kinds[device.kind].present += 1;
            kinds[device.kind].budget_bytes = kinds[device.kind].budget_bytes.max(device.budget_bytes);
        }
        Self {
            policy,
            weights,
            devices: devices.iter().map(|&facts| Device::new(facts)).collect(),
            kinds,
            jobs: Vec::new(),
            troubled: BTreeSet::new(),
            virtual_s: 0.0,
            active_weight: 0.0,
            active: 0,
            work_s: 0.0,
            pressure: 0.0,
        }
    }

    /// Adds a job; one that no device can hold is refused.
    pub fn add(&mut self, now_s: f64, new: &NewJob) -> Result<JobId, ScheduleError> {
        if new.costs.len() != self.kinds.len() {
            return Err(ScheduleError::Kinds { given: new.costs.len(), kinds: self.kinds.len() });
        }
        let fits = |(costs, kind): (&super::Costs, &Kind)| costs.fits && new.bytes <= kind.budget_bytes;
        if !new.costs.iter().zip(&self.kinds).any(fits) {
            let budget_bytes = self.kinds.iter().map(|k| k.budget_bytes).max().unwrap_or(0);
            return Err(ScheduleError::TooLarge { bytes: new.bytes, budget_bytes });
        }
        let mut job = Job::new(new, self.virtual_s, 0.0);
        for (estimate, kind) in job.estimates.iter_mut().zip(&self.kinds) {
            estimate.costs.fits &= new.bytes <= kind.budget_bytes;
        }
        job.alone_s = self.alone_s(&job);
        self.jobs.push(Some(Box::new(job)));
        let id = self.jobs.len() - 1;
        self.active += 1;
        self.active_weight += weight(new.priority);
        self.place(id, now_s);
        self.end_if_done(id);
        Ok(JobId(id))
    }

    /// More frames of a job that grows.
    pub fn append(&mut self, now_s: f64, job: JobId, more: u64) {
        let Some(one) = self.jobs.get_mut(job.0).and_then(Option::as_mut) else { return };
        let first = one.total;
        one.total += more;
        one.open.open(first..one.total);
        let alone_s = self.jobs[job.0].as_ref().map_or(0.0, |one| self.alone_s(one));
        if let Some(one) = &mut self.jobs[job.0] {
            one.alone_s = alone_s;
        }
        self.place(job.0, now_s);
    }

    /// Nothing more will be appended.
    pub fn close(&mut self, job: JobId) {
        if let Some(one) = self.jobs.get_mut(job.0).and_then(Option::as_mut) {
            one.grows = false;
            self.end_if_done(job.0);
        }
    }

    /// Better estimates, where they are known.
    pub fn learn(&mut self, now_s: f64, device: usize, job: JobId, warm_s: Option<f64>, cold_s: Option<f64>) {
        let facts = self.devices[device].facts;
        let Some(one) = self.jobs.get_mut(job.0).and_then(Option::as_mut) else { return };
        if let Some(warm_s) = warm_s.filter(|s| s.is_finite()) {
            one.learns_warm(facts.kind, warm_s.clamp(1e-6, 1e6), 1.0);
        }
        if let Some(cold_s) = cold_s.filter(|s| s.is_finite()) {
            let facing = &mut self.devices[device];
            let known_s = one.estimates[facts.kind].costs.cold_s * facing.start_slowness;
            if known_s > 0.0 && cold_s > 0.0 {
                let slowness = facing.start_slowness * (cold_s / known_s).powf(SLOWNESS_GAIN);
                facing.start_slowness = slowness.clamp(1e-3, 1e3);
            }
            let usual_s = cold_s / facing.start_slowness;
            one.learns_cold(facts.kind, usual_s.clamp(0.0, 1e6), START_GAIN);
        }
        self.place(job.0, now_s);
    }

    /// A frame of a job takes so many bytes on a device: what may hold fewer is given none of its frames any more. False,
    /// and nothing else, where no device may hold so many.
    pub fn needs(&mut self, now_s: f64, job: JobId, bytes: u64) -> bool {
        let Some(one) = self.jobs.get_mut(job.0).and_then(Option::as_mut) else { return false };
        let fits = |(estimate, kind): (&Estimate, &Kind)| {
            estimate.costs.fits && kind.present > 0 && bytes <= kind.budget_bytes
        };
        if !one.estimates.iter().zip(&self.kinds).any(fits) {
            return false;
        }
        for (estimate, kind) in one.estimates.iter_mut().zip(&self.kinds) {
            estimate.bytes = estimate.bytes.max(bytes);
            estimate.costs.fits &= estimate.bytes <= kind.budget_bytes;
        }
        self.place(job.0, now_s);
        true
    }

    /// Whether what is leased of a job would be read; where not, nothing is.
    pub fn can_be_read(&mut self, job: JobId, can: bool) {
        if let Some(one) = self.jobs.get_mut(job.0).and_then(Option::as_mut) {
            one.is_read = can;
        }
    }

    /// A job's scene is resident on a device, or is not.
    pub fn holds(&mut self, device: usize, job: JobId, is_resident: bool) {
        let facing = &mut self.devices[device];
        if facing.holds(job) != is_resident {
            facing.resident.retain(|&j| j != job);
            facing.resident.extend(is_resident.then_some(job));
        }
    }

    /// Bytes that a job's scene takes on a device.
    pub fn takes(&mut self, device: usize, job: JobId, bytes: u64) {
        let kind = self.devices[device].facts.kind;
        if let Some(one) = self.jobs.get_mut(job.0).and_then(Option::as_mut) {
            one.estimates[kind].bytes = bytes;
        }
    }

    /// What a device traces next: consecutive frames; None where it would help nobody now.
    pub fn lease(&mut self, now_s: f64, device: usize) -> Option<Lease> {
        if !self.devices[device].is_present {
            return None;
        }
        if let Some(lease) = self.retry(device) {
            return Some(lease);
        }
        let choice = match self.policy {
            Policy::Fifo => self.oldest(device),
            Policy::Affinity => self.best(now_s, device),
        };
        let serving = self.devices[device].serving;
        if let Some(serving) = serving
            && choice.is_none_or(|choice| choice.job != serving.job.0)
        {
            self.leave(now_s, device);
        }
        let choice = choice?;
        let (warm_s, cold_s) = self.costs(device, choice.job);
        let facing = &mut self.devices[device];
        let one = self.jobs[choice.job].as_mut()?;
        let before = facing.serving.take();
        let ready_s = choice.is_cold.then_some(now_s + cold_s);
        let new = Serving { job: JobId(choice.job), next: 0, rate: 1.0 / warm_s, ready_s };
        // measured again since then
        let fresh = before.map_or(new, |before| Serving { rate: 1.0 / warm_s, ..before });
        one.joins(&fresh);
        if let Some(before) = before {
            one.leaves(before);
        }
        let run = run_length(one.open.len(), warm_s, one.rate(), self.weights.batch_s);
        let frames = one.open.take(before.map(|b| b.next), run)?;
        one.leased += frames.end - frames.start;
        facing.serving = Some(Serving { next: frames.end, ..fresh });
        facing.held.push((JobId(choice.job), frames.clone()));
        if !choice.is_cold {
            facing.used(JobId(choice.job));
        }
        self.place(choice.job, now_s);
        Some(Lease { job: JobId(choice.job), frames })
    }

    /// A device traced a frame in so many seconds, its scene being resident. False, and nothing else, where the frame
    /// was not leased to it (any more).
    pub fn done(&mut self, device: usize, job: JobId, frame: u64, seconds: f64) -> bool {
        let facing = &mut self.devices[device];
        if facing.release(job, &(frame..frame.saturating_add(1))).is_empty() {
            return false;
        }
        let Some(one) = self.jobs.get_mut(job.0).and_then(Option::as_mut) else { return false };
        if let Some(serving) = facing.serving.as_mut().filter(|s| s.job == job) {
            one.is_ready(serving);
        }
        if seconds.is_finite() && seconds > 0.0 {
            let kind = facing.facts.kind;
            let known = &one.estimates[kind];
            if known.frames >= 4 {
                let ratio = seconds / (known.costs.warm_s * facing.slowness);
                facing.slowness = (facing.slowness * ratio.powf(SLOWNESS_GAIN)).clamp(1e-3, 1e3);
            }
            one.learns_warm(kind, (seconds / facing.slowness).clamp(1e-6, 1e6), FRAME_GAIN);
        }
        one.leased -= 1;
        one.traced += 1;
        one.failed.remove(&frame);
        let served_s = one.least_warm_s();
        one.served_s += served_s / one.weight;
        self.virtual_s += served_s / self.active_weight;
        self.end_if_done(job.0);
        true
    }

    /// Frames come back untraced. Those that failed go to another device; a caller counts how often they fail and gives
    /// them up by [`Scheduler::give_up`].
    pub fn give_back(
        &mut self,
        now_s: f64,
        device: usize,
        job: JobId,
        frames: Range<u64>,
        have_failed: bool,
    ) {
        let back = self.devices[device].release(job, &frames);
        let Some(one) = self.jobs.get_mut(job.0).and_then(Option::as_mut) else { return };
        for run in back {
            one.returns(run, have_failed.then_some(device));
        }
        if have_failed {
            self.troubled.insert(job.0);
        }
        self.place(job.0, now_s);
    }

    /// A frame that failed will not be traced: it counts as if it were.
    pub fn give_up(&mut self, job: JobId, frame: u64) {
        let Some(one) = self.jobs.get_mut(job.0).and_then(Option::as_mut) else { return };
        if one.failed.get(&frame).is_some_and(|f| !f.is_leased) {
            one.failed.remove(&frame);
            one.traced += 1;
            self.end_if_done(job.0);
        }
    }

    /// Whether a device is there that may try a frame that failed.
    pub fn has_other(&self, job: JobId, frame: u64) -> bool {
        let Some(one) = self.jobs.get(job.0).and_then(Option::as_ref) else { return false };
        one.failed.get(&frame).is_some_and(|failed| self.may_be_tried(one, failed))
    }

    fn may_be_tried(&self, one: &Job, failed: &Failed) -> bool {
        failed.is_leased
            || (0..self.devices.len()).any(|d| {
                let Device { facts, is_present, .. } = self.devices[d];
                let Estimate { costs, bytes, .. } = one.estimates[facts.kind];
                is_present && !failed.on.contains(&d) && costs.fits && bytes <= facts.budget_bytes
            })
    }

    /// Gives up those frames of a job that failed and that no device may try any more; how many.
    pub fn give_up_hopeless(&mut self, job: JobId) -> u64 {
        let Some(one) = self.jobs.get(job.0).and_then(Option::as_ref) else { return 0 };
        let hopeless: Vec<u64> = one
            .failed
            .iter()
            .filter(|(_, failed)| !self.may_be_tried(one, failed))
            .map(|(&f, _)| f)
            .collect();
        for &frame in &hopeless {
            self.give_up(job, frame);
        }
        hopeless.len() as u64
    }

    /// A device is lost: what was leased to it is open again, what it held is gone.
    pub fn device_gone(&mut self, now_s: f64, device: usize) {
        if !self.devices[device].is_present {
            return;
        }
        self.leave(now_s, device);
        let facing = &mut self.devices[device];
        facing.is_present = false;
        facing.resident.clear();
        self.kinds[facing.facts.kind].present -= 1;
        for (job, run) in std::mem::take(&mut facing.held) {
            if let Some(one) = self.jobs[job.0].as_mut() {
                one.returns(run, None);
                self.place(job.0, now_s);
            }
        }
    }

    /// It is there again, and holds nothing.
    pub fn device_back(&mut self, device: usize) {
        let facing = &mut self.devices[device];
        if !facing.is_present {
            (facing.is_present, facing.slowness, facing.start_slowness) = (true, 1.0, 1.0);
            self.kinds[facing.facts.kind].present += 1;
        }
    }

    /// Nothing more of a job is leased; what was, is no longer counted.
    pub fn cancel(&mut self, job: JobId) {
        if self.jobs.get(job.0).is_some_and(Option::is_some) {
            for device in &mut self.devices {
                device.held.retain(|(owner, _)| *owner != job);
            }
            self.end(job.0);
        }
    }

    /// Its share from now on: what is left of it counts by the new one.
    pub fn priority(&mut self, now_s: f64, job: JobId, priority: i32) {
        let Some(one) = self.jobs.get_mut(job.0).and_then(Option::as_mut) else { return };
        self.active_weight += weight(priority) - one.weight;
        one.weight = weight(priority);
        self.place(job.0, now_s);
    }

    /// Whether all frames of a job are traced or given up, or it was cancelled.
    pub fn is_done(&self, job: JobId) -> bool {
        self.jobs.get(job.0).is_none_or(Option::is_none)
    }

    /// Whether there is nothing left to do.
    pub fn is_idle(&self) -> bool {
        self.active == 0
    }

    /// Seconds that a device should take for a frame of a job whose scene it holds.
    pub fn frame_s(&self, device: usize, job: JobId) -> f64 {
        self.jobs.get(job.0).map_or(0.0, |_| self.costs(device, job.0).0)
    }

    /// Seconds of a frame and of making the scene resident, as a device should take them now.
    pub(super) fn costs(&self, device: usize, job: usize) -> (f64, f64) {
        let facing = &self.devices[device];
        let costs = self.jobs[job].as_ref().map(|one| one.estimates[facing.facts.kind].costs);
        // what traces more slowly than it did is thought to start more slowly, before that is measured
        let start_slowness = facing.start_slowness.max(facing.slowness);
        costs.map_or((1.0, 0.0), |c| (c.warm_s * facing.slowness, c.cold_s * start_slowness))
    }

    pub(super) fn fits(&self, device: usize, job: &Job) -> bool {
        let facts = self.devices[device].facts;
        job.is_read
            && job.estimates[facts.kind].costs.fits
            && job.estimates[facts.kind].bytes <= facts.budget_bytes
    }

    fn alone_s(&self, job: &Job) -> f64 {
        let kinds = job.estimates.iter().zip(&self.kinds).filter(|(e, _)| e.costs.fits);
        let mut kinds: Vec<_> =
            kinds.map(|(e, kind)| (kind.present.max(1), e.costs.warm_s, e.costs.cold_s)).collect();
        alone_s(job.total.max(1), &mut kinds).max(1e-6)
    }

    /// A frame that failed elsewhere.
    fn retry(&mut self, device: usize) -> Option<Lease> {
        let find = |&id: &usize| {
            let one = self.jobs[id].as_ref().filter(|one| self.fits(device, one))?;
            let may_have = |f: &Failed| !f.is_leased && !f.on.contains(&device);
            one.failed.iter().find(|(_, f)| may_have(f)).map(|(&frame, _)| (id, frame))
        };
        let (id, frame) = self.troubled.iter().find_map(find)?;
        let one = self.jobs[id].as_mut()?;
        one.failed.get_mut(&frame)?.is_leased = true;
        one.leased += 1;
        self.devices[device].held.push((JobId(id), frame..frame + 1));
        Some(Lease { job: JobId(id), frames: frame..frame + 1 })
    }
}
