//! Which job a device serves next, and the orders that make this quick.
//!
//! The key of a job on a device is its virtual finish time and, where the scene is not resident there, φ times its cold
//! start on as many devices as there are; the least is served. So jobs that come together stand in the order of the
//! seconds that each would take alone with all devices, which keeps the worst ratio of waiting to length small; and what a
//! device holds goes before what it does not.
//!
//! - A device takes the least key of the jobs that it holds and those that nobody serves.
//! - It joins a job that others serve where that has a lesser key and gains more than all lose (join test), or, where
//!   there is nothing else to do, the one that ends last.
//! - Nowhere does it begin what the others will have finished before it has traced a frame (end test).
//!
//! A job that waits keeps its key, so that for each kind of device an ordered set gives the least at once, in O(log jobs);
//! jobs that may be joined stand in two more sets, by key and by when they end, which is a moment that stays while nobody
//! joins or leaves: at most as many as there are devices. The few jobs that a device holds are looked at one by one.

use super::JobId;
use super::Policy;
use super::device::Serving;
use super::job::{Job, Place};
use super::order::Key;
use super::scheduler::{Kind, Scheduler};

/// How many jobs of an order are looked at for a decision.
const LOOKED_AT: usize = 8;
/// A key that differs from the true one by less than this share of the job's length stays: sets are not sorted anew for
/// every frame that is measured.
const KEY_SLACK: f64 = 0.01;

/// What a device could do next.
#[derive(Clone, Copy, Debug)]
pub(super) struct Choice {
    pub(super) key: Key,
    pub(super) job: usize,
    pub(super) is_cold: bool,
}

impl Choice {
    fn is_before(&self, other: Option<&Self>) -> bool {
        other.is_none_or(|other| (self.key, self.job) < (other.key, other.job))
    }
}

impl Scheduler {
    /// The oldest job of the highest priority.
    pub(super) fn oldest(&self, device: usize) -> Option<Choice> {
        let kind = &self.kinds[self.devices[device].facts.kind];
        let fits = |&&(_, id): &&(Key, usize)| self.jobs[id].as_ref().is_some_and(|j| self.fits(device, j));
        let &(key, job) = kind.waiting.iter().find(fits)?;
        Some(Choice { key, job, is_cold: !self.devices[device].holds(JobId(job)) })
    }

    /// The job that the device helps most.
    pub(super) fn best(&mut self, now_s: f64, device: usize) -> Option<Choice> {
        self.forget_ended(device);
        let best = self.best_held(now_s, device);
        let best = self.best_waiting(device).filter(|c| c.is_before(best.as_ref())).or(best);
        let best = self.best_joined(now_s, device, best.as_ref()).or(best);
        best.or_else(|| self.last_to_end(now_s, device))
    }

    /// Of the jobs whose scenes it holds, and the one that it is making resident: what that costs is spent.
    fn best_held(&self, now_s: f64, device: usize) -> Option<Choice> {
        let facing = &self.devices[device];
        let serving = facing.serving.map(|s| s.job).filter(|&job| !facing.holds(job));
        let mut best: Option<Choice> = None;
        for &JobId(id) in facing.resident.iter().chain(&serving) {
            let Some(one) = &self.jobs[id] else { continue };
            if one.open.len() == 0 || !self.fits(device, one) {
                continue;
            }
            let is_cold = serving == Some(JobId(id));
            let choice = Choice { key: Key(one.finish_s()), job: id, is_cold };
            if choice.is_before(best.as_ref()) && self.helps(now_s, device, id, one, 0.0, 0.0) {
                best = Some(choice);
            }
        }
        best
    }

    /// Of those that nobody serves.
    fn best_waiting(&self, device: usize) -> Option<Choice> {
        let facing = &self.devices[device];
        let usable = |&&(_, id): &&(Key, usize)| {
            let one = self.jobs[id].as_ref().filter(|one| self.fits(device, one));
            !facing.holds(JobId(id)) && one.is_some_and(|one| !self.is_too_slow(device, id, one))
        };
        let waiting = &self.kinds[facing.facts.kind].waiting;
        // those that it holds stand here too
        let &(key, job) = waiting.iter().take(LOOKED_AT + facing.resident.len()).find(usable)?;
        Some(Choice { key, job, is_cold: true })
    }

    /// Of those that others serve: where joining pays and the key is less than the best so far.
    fn best_joined(&self, now_s: f64, device: usize, best: Option<&Choice>) -> Option<Choice> {
        let joinable = &self.kinds[self.devices[device].facts.kind].joinable;
        let choices = joinable.iter().map(|&(key, job)| Choice { key, job, is_cold: true });
        choices
            .take(LOOKED_AT)
            .take_while(|c| c.is_before(best))
            .find(|c| self.joins(now_s, device, c.job, true))
    }

    /// Of those that others serve: the one that ends last and which the device would make end sooner.
    fn last_to_end(&self, now_s: f64, device: usize) -> Option<Choice> {
        let last = &self.kinds[self.devices[device].facts.kind].last;
        let choices = last.iter().map(|&(key, job)| Choice { key, job, is_cold: true });
        choices.take(LOOKED_AT).find(|c| self.joins(now_s, device, c.job, false))
    }

    fn joins(&self, now_s: f64, device: usize, id: usize, is_priced: bool) -> bool {
        let facing = &self.devices[device];
        let is_new = !facing.holds(JobId(id)) && !facing.serves(JobId(id));
        let Some(one) = self.jobs[id].as_ref().filter(|one| is_new && self.fits(device, one)) else {
            return false;
        };
        let (warm_s, cold_s) = self.costs(device, id);
        let price_s =
            if is_priced { self.price_s(one, warm_s, cold_s + self.evicted_s(device, one)) } else { 0.0 };
        self.helps(now_s, device, id, one, cold_s, price_s)
    }

    /// Whether a device helps a job: where others serve it, by the end test and the join test.
    fn helps(&self, now_s: f64, device: usize, id: usize, one: &Job, cold_s: f64, price_s: f64) -> bool {
        let own = self.devices[device].serving.filter(|s| s.job.0 == id);
        if one.servers == usize::from(own.is_some()) {
            return true;
        }
        let (warm_s, _) = self.costs(device, id);
        let served = one.served(now_s, own.as_ref());
        !served.ends_too_soon(warm_s, cold_s) && served.gains_s(warm_s, cold_s) >= price_s
    }

    /// End test for what waits: whether all the work that there is will be done, and the device that is soonest ready
    /// could have begun with this, before a slow one has traced a frame of it.
    fn is_too_slow(&self, device: usize, id: usize, one: &Job) -> bool {
        let (warm_s, cold_s) = self.costs(device, id);
        let first_s = warm_s + cold_s;
        if first_s <= self.work_s {
            return false;
        }
        let able = (0..self.devices.len()).filter(|&d| self.devices[d].is_present && self.fits(d, one));
        let soonest = able.map(|d| self.costs(d, id)).map(|(w, c)| w + c).fold(f64::INFINITY, f64::min);
        first_s > self.work_s + soonest
    }

    /// Seconds that a job must gain for another copy to be worth what all lose by it: cold starts, its own and those of
    /// what it pushes out, take the devices `cold_s`, at this one's share of their speed, from all that is to be done, so
    /// that every job ends so much later; as a share of what each takes alone, summed up, that is `pressure` times as much.
    fn price_s(&self, one: &Job, warm_s: f64, cold_s: f64) -> f64 {
        let share = one.least_warm_s() / warm_s / self.parallel(one);
        self.weights.price * one.alone_s * self.pressure * cold_s * share
    }

    /// How many times faster all devices trace a job than its fastest one does.
    fn parallel(&self, one: &Job) -> f64 {
        let least_s = one.least_warm_s();
        let fitting = one.estimates.iter().zip(&self.kinds).filter(|(e, _)| e.costs.fits);
        fitting.map(|(e, kind)| kind.present as f64 * least_s / e.costs.warm_s).sum::<f64>().max(1.0)
    }

    /// Seconds of the cold starts that others would take again on a device: of those that have frames left and must go for
    /// a job's scene, the least recently served first.
    fn evicted_s(&self, device: usize, one: &Job) -> f64 {
        let facing = &self.devices[device];
        let kind = facing.facts.kind;
        let held = || facing.resident.iter().filter_map(|&JobId(id)| Some((id, self.jobs[id].as_ref()?)));
        let held_bytes = held().map(|(_, other)| other.estimates[kind].bytes).fold(0, u64::saturating_add);
        let needed_bytes = held_bytes.saturating_add(one.estimates[kind].bytes);
        let mut over_bytes = needed_bytes.saturating_sub(facing.facts.budget_bytes);
        let mut seconds = 0.0;
        for (id, other) in held() {
            if over_bytes == 0 {
                break;
            }
            over_bytes = over_bytes.saturating_sub(other.estimates[kind].bytes);
            if other.open.len() > 0 {
                seconds += self.costs(device, id).1;
            }
        }
        seconds
    }

    fn key(&self, one: &Job, cold_s: f64) -> Key {
        Key(one.finish_s() + self.weights.phi * self.parallel(one) * cold_s / one.weight)
    }

    /// Puts a job where it belongs in the orders of all kinds.
    pub(super) fn place(&mut self, id: usize, now_s: f64) {
        let Some(mut one) = self.jobs[id].take() else { return };
        let pressure = 1.0 / one.alone_s;
        self.pressure += pressure - one.pressure;
        one.pressure = pressure;
        let work_s = one.left() as f64 * one.least_warm_s() / self.parallel(&one);
        self.work_s += work_s - one.work_s;
        one.work_s = work_s;
        for kind in 0..self.kinds.len() {
            let place = self.place_for(&one, kind, now_s);
            let slack = KEY_SLACK * one.alone_s;
            let stays = match (one.places[kind], place) {
                (Some(Place::Waiting(old)), Some(Place::Waiting(new))) => (old.0 - new.0).abs() <= slack,
                (Some(Place::Joinable(old, end)), Some(Place::Joinable(new, ends))) => {
                    (old.0 - new.0).abs() <= slack && (end.0 - ends.0).abs() <= slack
                }
                (old, new) => old == new,
            };
            if !stays {
                self.kinds[kind].remove(id, one.places[kind]);
                self.kinds[kind].insert(id, place);
                one.places[kind] = place;
            }
        }
        self.jobs[id] = Some(one);
    }

    fn place_for(&self, one: &Job, kind: usize, now_s: f64) -> Option<Place> {
        let costs = one.estimates[kind].costs;
        if one.open.len() == 0 || !costs.fits {
            return None;
        }
        if self.policy == Policy::Fifo {
            return Some(Place::Waiting(Key(-one.weight)));
        }
        let key = self.key(one, costs.cold_s);
        if one.servers == 0 {
            return Some(Place::Waiting(key));
        }
        let served = one.served(now_s, None);
        let helps = !served.ends_too_soon(costs.warm_s, costs.cold_s)
            && served.gains_s(costs.warm_s, costs.cold_s) >= 0.0;
        let ends_s = now_s + served.ends_s();
        helps.then_some(Place::Joinable(key, Key(-ends_s)))
    }

    /// A device takes no more from the job that it served.
    pub(super) fn leave(&mut self, now_s: f64, device: usize) {
        if let Some(serving) = self.devices[device].serving.take() {
            self.stop_serving(serving);
            self.place_if_there(serving.job.0, now_s);
        }
    }

    fn stop_serving(&mut self, serving: Serving) {
        if let Some(one) = self.jobs[serving.job.0].as_mut() {
            one.leaves(serving);
            one.open.leave(serving.next);
        }
    }

    fn place_if_there(&mut self, id: usize, now_s: f64) {
        if self.jobs[id].is_some() {
            self.place(id, now_s);
        }
    }

    fn forget_ended(&mut self, device: usize) {
        let jobs = &self.jobs;
        self.devices[device].resident.retain(|id| jobs[id.0].is_some());
    }

    pub(super) fn end_if_done(&mut self, id: usize) {
        if self.jobs[id].as_ref().is_some_and(|one| one.has_ended()) {
            self.end(id);
        }
    }

    pub(super) fn end(&mut self, id: usize) {
        let Some(one) = self.jobs[id].take() else { return };
        for (kind, &place) in self.kinds.iter_mut().zip(&one.places) {
            kind.remove(id, place);
        }
        self.troubled.remove(&id);
        self.active -= 1;
        self.pressure -= one.pressure;
        self.work_s -= one.work_s;
        self.active_weight -= one.weight;
        if self.active == 0 {
            // sums of many terms do not drift from one stretch of work into the next
            (self.pressure, self.work_s, self.active_weight) = (0.0, 0.0, 0.0);
        }
    }
}

impl Kind {
    fn insert(&mut self, id: usize, place: Option<Place>) {
        match place {
            Some(Place::Waiting(key)) => self.waiting.insert((key, id)),
            Some(Place::Joinable(key, end)) => self.joinable.insert((key, id)) && self.last.insert((end, id)),
            None => false,
        };
    }

    fn remove(&mut self, id: usize, place: Option<Place>) {
        match place {
            Some(Place::Waiting(key)) => self.waiting.remove(&(key, id)),
            Some(Place::Joinable(key, end)) => {
                self.joinable.remove(&(key, id)) && self.last.remove(&(end, id))
            }
            None => false,
        };
    }
}
