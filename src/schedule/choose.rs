//! Which job a device serves next, and the orders that make this quick.
//!
//! The key of a job on a device is its virtual finish time and, where the scene is not resident there, φ times its cold
//! start; the least is served. A job that waits keeps its key, so that for each kind of device an ordered set gives the
//! least at once, in O(log jobs); jobs that are served and may be joined stand in a second set, of at most as many as there
//! are devices; the few that a device holds are looked at one by one.

use super::JobId;
use super::Policy;
use super::device::Serving;
use super::job::{Job, Place};
use super::order::Key;
use super::scheduler::{Kind, Scheduler};

/// How many jobs that might be joined are looked at for a decision: those with the least keys.
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

    /// The job with the least key that the device helps.
    pub(super) fn best(&mut self, now_s: f64, device: usize) -> Option<Choice> {
        self.forget_ended(device);
        let mut best: Option<Choice> = None;
        let facing = &self.devices[device];
        let kind = &self.kinds[facing.facts.kind];
        for &JobId(id) in &facing.resident {
            let Some(one) = self.jobs[id].as_ref().filter(|one| one.open.len() > 0) else { continue };
            let choice = Choice { key: Key(one.finish_s()), job: id, is_cold: false };
            if choice.is_before(best.as_ref()) && self.helps(now_s, device, id, one, 0.0) {
                best = Some(choice);
            }
        }
        // its scene is on its way: what it costs is spent
        if let Some(serving) = facing.serving
            && let Some(one) = self.jobs[serving.job.0].as_ref().filter(|one| one.open.len() > 0)
            && !facing.holds(serving.job)
        {
            let cold_s = serving.ready_s.map_or(0.0, |ready_s| (ready_s - now_s).max(0.0));
            let key = self.key(one, cold_s);
            let choice = Choice { key, job: serving.job.0, is_cold: true };
            if choice.is_before(best.as_ref()) && self.helps(now_s, device, serving.job.0, one, 0.0) {
                best = Some(choice);
            }
        }
        let is_new = |id: usize| !facing.holds(JobId(id)) && !facing.serves(JobId(id));
        for &(key, id) in &kind.waiting {
            let choice = Choice { key, job: id, is_cold: true };
            if !choice.is_before(best.as_ref()) {
                break;
            }
            if is_new(id) && self.jobs[id].as_ref().is_some_and(|one| self.fits(device, one)) {
                best = Some(choice);
                break;
            }
        }
        if self.weights.mode > 0 && best.is_some() {
            return best;
        }
        for &(key, id) in kind.joinable.iter().take(LOOKED_AT) {
            let choice = Choice { key, job: id, is_cold: true };
            if self.weights.mode == 0 && !choice.is_before(best.as_ref()) {
                break;
            }
            let Some(one) = self.jobs[id].as_ref() else { continue };
            let (_, cold_s) = self.costs(device, id);
            if is_new(id) && self.fits(device, one) && self.helps(now_s, device, id, one, cold_s) {
                best = Some(choice);
                break;
            }
        }
        best
    }

    /// Whether a device helps a job: where others serve it, by the end test and, where it is cold, the join test.
    fn helps(&self, now_s: f64, device: usize, id: usize, one: &Job, cold_s: f64) -> bool {
        let own = self.devices[device].serving.filter(|s| s.job.0 == id);
        if one.helpers == usize::from(own.is_some()) {
            return true;
        }
        let (warm_s, _) = self.costs(device, id);
        let served = one.served(now_s, own.as_ref());
        if served.ends_too_soon(warm_s, cold_s) {
            return false;
        }
        cold_s == 0.0 || served.pays(warm_s, cold_s, self.weights.beta, self.price_s(one, cold_s))
    }

    /// Seconds that a job must gain for a copy to be worth what those that wait lose.
    fn price_s(&self, one: &Job, cold_s: f64) -> f64 {
        let present: usize = self.kinds.iter().map(|k| k.present).sum();
        self.weights.price * one.alone_s * self.pressure * cold_s / present.max(1) as f64
    }

    fn key(&self, one: &Job, cold_s: f64) -> Key {
        Key(one.finish_s() + self.weights.phi * cold_s / one.weight)
    }

    /// Puts a job where it belongs in the orders of all kinds.
    pub(super) fn place(&mut self, id: usize, now_s: f64) {
        let Some(mut one) = self.jobs[id].take() else { return };
        let waits = one.open.len() > 0 && one.helpers == 0;
        let pressure = if waits { 1.0 / one.alone_s } else { 0.0 };
        if pressure != one.pressure {
            self.waiting = self.waiting + usize::from(waits) - usize::from(one.pressure > 0.0);
            self.pressure += pressure - one.pressure;
            if self.waiting == 0 {
                self.pressure = 0.0;
            }
            one.pressure = pressure;
        }
        for kind in 0..self.kinds.len() {
            let place = self.place_for(&one, kind, now_s);
            let slack = KEY_SLACK * one.alone_s;
            let stays = match (one.places[kind], place) {
                (Some(Place::Waiting(old)), Some(Place::Waiting(new)))
                | (Some(Place::Joinable(old)), Some(Place::Joinable(new))) => (old.0 - new.0).abs() <= slack,
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
        if one.helpers == 0 {
            return Some(Place::Waiting(key));
        }
        let served = one.served(now_s, None);
        let helps = !served.ends_too_soon(costs.warm_s, costs.cold_s)
            && served.pays(costs.warm_s, costs.cold_s, self.weights.beta, 0.0);
        let key = if self.weights.mode == 2 { Key(-(now_s + served.ends_s())) } else { key };
        helps.then_some(Place::Joinable(key))
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
        self.waiting -= usize::from(one.pressure > 0.0);
        self.pressure = if self.waiting == 0 { 0.0 } else { self.pressure - one.pressure };
        self.active -= 1;
        self.active_weight = if self.active == 0 { 0.0 } else { self.active_weight - one.weight };
    }
}

impl Kind {
    fn insert(&mut self, id: usize, place: Option<Place>) {
        match place {
            Some(Place::Waiting(key)) => self.waiting.insert((key, id)),
            Some(Place::Joinable(key)) => self.joinable.insert((key, id)),
            None => false,
        };
    }

    fn remove(&mut self, id: usize, place: Option<Place>) {
        match place {
            Some(Place::Waiting(key)) => self.waiting.remove(&(key, id)),
            Some(Place::Joinable(key)) => self.joinable.remove(&(key, id)),
            None => false,
        };
    }
}
