//! The device stage: what changed, what the device must do, trace.

use super::costs::Learned;
use super::estimate::{DeviceWork, Estimator, Rays};
use super::event::{Status, UpdateReport};
use super::failure::{Failure, caught};
use super::fleet::{Held, Shared};
use super::read::{Read, ReadFrame};
use super::report::DeviceReport;
use super::share::Share;
use super::under_way::{Before, Begun, UnderWay};
use super::{Note, RunOptions, Shown};
use crate::clock::Stopwatch;
use crate::device::{DeviceError, Output, Stop, Traced};
use crate::diff::changes;
use crate::film::LatentFilm;
use crate::kernel::media::MEDIA_MAX;
use crate::plan::{Action, Update, Wishes, plan_frame};
use crate::warning::Warnings;
use parking_lot::FairMutexGuard;
use std::collections::{BTreeMap, VecDeque};
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, SyncSender, TryRecvError, TrySendError};
use std::time::Duration;

/// Takes frames in their order, makes each resident, traces it and hands the film to a writer. As many frames are under way
/// as the device takes; where no other is read yet, the first of them is waited for.
pub(super) fn device_stage(
    shared: &Shared,
    options: &RunOptions,
    from_readers: &Receiver<Read>,
    ends: Ends<'_>,
) {
    let mut stage = DeviceStage {
        told: DeviceReport::new(&shared.info),
        shared,
        held: None,
        under_way: VecDeque::new(),
        before: None,
        cold: options.cold,
        update: options.update,
        learned: Learned::new(),
        losses: 0,
        in_vain: false,
        shown: VecDeque::new(),
        clock: Stopwatch::start(),
        ended_s: 0.0,
        warnings: Warnings::default(),
        ends,
    };
    let mut waiting = BTreeMap::new();
    let mut next = 0;
    loop {
        let read = if stage.under_way.is_empty() {
            from_readers.recv().map_err(|_| TryRecvError::Disconnected)
        } else {
            from_readers.try_recv()
        };
        match read {
            Ok(read) => {
                waiting.insert(read.turn.place, read);
            }
            Err(TryRecvError::Empty) => {
                stage.finish(true);
                continue;
            }
            Err(TryRecvError::Disconnected) => break,
        }
        while let Some(Read { turn, bytes, outcome }) = waiting.remove(&next) {
            next += 1;
            let Ends { share, stop, note, device, .. } = stage.ends;
            share.taken(device);
            match outcome {
                _ if stop.asked() || share.is_gone(device) => {
                    share.give_bytes(bytes);
                    share.gave_back(device, turn.index);
                }
                Err(report) => {
                    share.give_bytes(bytes);
                    share.done(device, turn.index, 0.0);
                    let _ = note.send(Note::Frame(report));
                }
                Ok(read) => stage.take(read, bytes),
            }
        }
    }
    while !stage.under_way.is_empty() {
        stage.finish(true);
    }
}

/// Where a frame of a device comes from and goes to.
#[derive(Clone, Copy)]
pub(super) struct Ends<'a> {
    /// The device, by its place among those of the run.
    pub(super) device: usize,
    pub(super) share: &'a Share<'a>,
    pub(super) estimator: &'a Estimator,
    pub(super) stop: &'a Stop,
    pub(super) to_writers: &'a SyncSender<Shown>,
    pub(super) note: &'a Sender<Note>,
}

/// After so many losses one after the other a device is given up.
const LOSSES: usize = 3;
/// Who waits for a device looks so often whether to stop.
const LOOKS_FOR_STOP: Duration = Duration::from_millis(100);

struct DeviceStage<'a> {
    shared: &'a Shared,
    /// The device while frames are under way; between them other runs may have it.
    held: Option<FairMutexGuard<'a, Held>>,
    told: DeviceReport,
    /// Frames that were begun, the first one first.
    under_way: VecDeque<UnderWay>,
    /// What the device traced last.
    before: Option<Before>,
    cold: bool,
    update: Update,
    learned: Learned,
    /// Frames in a row with which it was lost.
    losses: usize,
    /// Whether a frame had no room on the device for itself alone, either; then the next ones are not tried so.
    in_vain: bool,
    /// Films that wait for a writer, the first one first.
    shown: VecDeque<Shown>,
    clock: Stopwatch,
    /// When it last finished a frame.
    ended_s: f64,
    /// What is to be told of the frame.
    warnings: Warnings,
    ends: Ends<'a>,
}

impl DeviceStage<'_> {
    /// Begins a frame; before that finishes others, where the device takes no more.
    fn take(&mut self, mut read: ReadFrame, bytes: u64) {
        let is_copy = |before: &Before| before.fingerprint == read.fingerprint;
        if !self.cold && self.before.as_ref().is_some_and(is_copy) {
            while !self.under_way.is_empty() {
                self.finish(true);
            }
            // unless it failed
            if let Some(Before { frame, film: Some(film), .. }) = &self.before {
                self.ends.share.done(self.ends.device, read.report.index, 0.0);
                let report = &mut read.report;
                report.warm = true;
                report.change = changes(Some(frame), &read.frame);
                let why = "equal to the frame before, as are its settings".to_string();
                report.update =
                    UpdateReport { action: Some(Action::None.word()), why, ..UpdateReport::default() };
                let film = Arc::clone(film);
                return self.shown(film, Status::Copied, read, bytes);
            }
        }
        self.begin(read, bytes, true);
        let most =
            if self.cold { 1 } else { self.held.as_ref().map_or(1, |held| held.device.most_under_way()) };
        while self.under_way.len() >= most {
            self.finish(true);
        }
    }

    /// Makes a frame resident and begins to trace it.
    fn begin(&mut self, mut read: ReadFrame, bytes: u64, may_retry: bool) {
        if let Some(failure) = self.cannot_begin() {
            return self.failed(failure, UnderWay::not_begun(read, bytes));
        }
        let mut begun_s = self.clock.s();
        read.report.device = Some(self.told.name.clone());
        let mut begun = self.try_begin(&mut read);
        if begun.as_ref().is_err_and(Failure::is_for_want_of_room) && !self.cold && !self.in_vain {
            // what others left there is in the way
            while !self.under_way.is_empty() {
                self.finish(may_retry);
            }
            if let Some(failure) = self.cannot_begin() {
                return self.failed(failure, UnderWay::not_begun(read, bytes));
            }
            self.forget(true);
            begun_s = self.clock.s();
            begun = self.try_begin(&mut read);
            self.in_vain = begun.as_ref().is_err_and(Failure::is_for_want_of_room);
        }
        match begun {
            Ok(begun) => {
                let (frame, fingerprint) = (Arc::clone(&read.frame), read.fingerprint);
                self.before = Some(Before { frame, fingerprint, film: None });
                self.forget(false);
                self.in_vain = false;
                self.under_way.push_back(UnderWay { read, bytes, begun, begun_s });
            }
            Err(failure) => {
                let frame = UnderWay::not_begun(read, bytes);
                if may_retry && failure.is_lost() {
                    let mut lost = std::mem::take(&mut self.under_way);
                    lost.push_back(frame);
                    return self.retry(lost);
                }
                self.failed(failure, frame);
            }
        }
    }

    /// Takes the device, which others may have; why not.
    fn cannot_begin(&mut self) -> Option<Failure> {
        let Ends { stop, .. } = self.ends;
        let shared = self.shared;
        if self.losses >= LOSSES {
            let why = format!("{LOSSES} times, one after the other; it is not tried any more");
            return Some(Failure::Device(DeviceError::Lost { device: self.told.name.clone(), why }));
        }
        while self.held.is_none() && !stop.asked() {
            self.held = shared.take_within(LOOKS_FOR_STOP);
        }
        self.held.is_none().then_some(Failure::Device(DeviceError::Stopped))
    }

    /// Makes a frame resident and begins it; counts what was there.
    fn try_begin(&mut self, read: &mut ReadFrame) -> Result<Begun, Failure> {
        let counts = |stage: &Self| {
            let residency = stage.held.as_ref().map(|held| held.device.residency());
            residency.map_or([0; 3], |r| [r.hits, r.misses, r.evictions])
        };
        let (busy, before) = (Stopwatch::start(), counts(self));
        let begun = caught("tracing", || self.update_and_begin(read));
        self.told.busy_s += busy.s();
        let after = counts(self);
        let told = &mut self.told.resident;
        // a device that was lost begins to count anew
        for (told, i) in [&mut told.hits, &mut told.misses, &mut told.evictions].into_iter().zip(0..) {
            *told += after[i].saturating_sub(before[i]);
        }
        self.tell_holds();
        begun
    }

    /// Waits for the frame that was begun first, and hands on its film. Where the device is lost it may be tried again.
    fn finish(&mut self, may_retry: bool) {
        let Some(mut first) = self.under_way.pop_front() else { return };
        let busy = Stopwatch::start();
        // it was begun, so the device is here
        let shared = self.shared;
        let held = self.held.get_or_insert_with(|| shared.take());
        let traced = caught("tracing", || held.device.finish());
        self.told.busy_s += busy.s();
        self.tell_holds();
        match traced {
            Ok(traced) => {
                self.told.frames += 1;
                self.losses = 0;
                self.let_go();
                self.learn(&mut first, &traced);
                self.tell_share(&first);
                let film = Arc::new(traced.film);
                if let Some(before) = &mut self.before
                    && before.fingerprint == first.read.fingerprint
                {
                    before.film = Some(Arc::clone(&film));
                }
                self.shown(film, Status::Rendered, first.read, first.bytes);
            }
            Err(failure) if may_retry && failure.is_lost() => {
                let mut lost = std::mem::take(&mut self.under_way);
                lost.push_front(first);
                self.retry(lost);
            }
            Err(failure) => self.failed(failure, first),
        }
    }

    /// The device was lost, and with it all frames that were under way: each is tried once more, one at a time.
    fn retry(&mut self, lost: VecDeque<UnderWay>) {
        self.before = None;
        self.forget(true);
        for UnderWay { read, bytes, .. } in lost {
            self.begin(read, bytes, false);
            while !self.under_way.is_empty() {
                self.finish(false);
            }
        }
    }

    fn failed(&mut self, failure: Failure, frame: UnderWay) {
        self.before = None;
        if !failure.left_all_as_told() {
            self.forget(true);
        }
        self.let_go();
        let UnderWay { mut read, bytes, .. } = frame;
        let Ends { device, share, .. } = self.ends;
        share.give_bytes(bytes);
        let index = read.report.index;
        if matches!(failure, Failure::Device(DeviceError::Stopped)) {
            share.gave_back(device, index);
            return self.tell();
        }
        if share.is_gone(device) {
            // it was given up for those that were lost with this one
            share.gave_back(device, index);
            return self.tell();
        }
        if let Failure::Device(DeviceError::OutOfMemory { needed_bytes, budget_bytes, .. }) = &failure
            && needed_bytes > budget_bytes
            && share.too_large(device, index, *needed_bytes)
        {
            return self.tell();
        }
        self.losses = if failure.is_lost() { self.losses + 1 } else { 0 };
        let is_tried_again = share.failed(device, index);
        if self.losses >= LOSSES && !share.is_gone(device) && share.gone(device) {
            let text = format!("{} was lost {LOSSES} times and is given up", self.told.name);
            self.warnings.add(None, None, text);
        }
        if is_tried_again {
            return self.tell();
        }
        let source = read.report.named();
        let error = match failure {
            Failure::Device(error) => {
                read.report.device_failed = true;
                format!("{source}: {error}")
            }
            Failure::Panic(text) => format!("{source}: {text}"),
        };
        self.tell();
        read.report.status = Status::Failed;
        read.report.error = Some(error);
        let _ = self.ends.note.send(Note::Frame(read.report));
    }

    /// Whether what the device holds is to be trusted by those that have it next.
    fn forget(&mut self, forget: bool) {
        if let Some(held) = &mut self.held {
            held.forget = forget;
        }
    }

    fn tell_holds(&mut self) {
        if let Some(held) = &self.held {
            self.told.holds(&*held.device);
        }
    }

    /// Lets others have the device where nothing is under way.
    fn let_go(&mut self) {
        if self.under_way.is_empty() {
            self.held = None;
        }
    }

    fn shown(&mut self, film: Arc<LatentFilm>, status: Status, read: ReadFrame, bytes: u64) {
        self.ends.share.give_bytes(bytes);
        self.tell();
        self.shown.push_back(Shown { film, read, status });
        self.hand_on();
    }

    /// Hands films to the writers. Where all of them are busy and other runs wait for the device, they have it meanwhile.
    fn hand_on(&mut self) {
        while let Some(shown) = self.shown.pop_front() {
            match self.ends.to_writers.try_send(shown) {
                Err(TrySendError::Full(shown))
                    if !self.under_way.is_empty() && self.ends.share.has_others() =>
                {
                    self.shown.push_front(shown);
                    self.finish(true);
                }
                Err(TrySendError::Full(shown)) => {
                    // the writers outlive this stage
                    let _ = self.ends.to_writers.send(shown);
                }
                Ok(()) | Err(TrySendError::Disconnected(_)) => {}
            }
        }
    }

    /// Tells of the device and of what was noticed.
    fn tell(&mut self) {
        if !self.warnings.is_empty() {
            let _ = self.ends.note.send(Note::Warnings(std::mem::take(&mut self.warnings)));
        }
        let _ = self.ends.note.send(Note::Device(self.ends.device, self.told.clone()));
    }

    fn update_and_begin(&mut self, read: &mut ReadFrame) -> Result<Begun, DeviceError> {
        let Some(held) = &mut self.held else { return Err(DeviceError::Stopped) };
        let Held { device, forget } = &mut **held;
        let Ends { estimator, share, device: place, .. } = self.ends;
        let report = &mut read.report;
        let clock = Stopwatch::start();
        let cold = self.cold || *forget;
        let before = self.before.as_ref().filter(|_| !cold).map(|before| &*before.frame);
        report.change = changes(before, &read.frame);
        report.ms.diff = Some(clock.ms());
        let wishes = Wishes {
            cold,
            budget_bytes: device.info().budget_bytes,
            used_again: if self.cold { Vec::new() } else { std::mem::take(&mut read.used_again) },
            update: self.update,
            costs: self.learned.costs(share.left()),
            run: share.run(),
            others: share.others(),
        };
        let residency = device.residency();
        let plan = plan_frame(&read.frame, residency, &wishes);
        let work = DeviceWork::new(&plan, &read.frame, Rays::of_shot(&read.shot));
        let needed_bytes = plan.needed_bytes(residency);
        estimator.begins(place, &work, report);
        report.bytes.predicted = Some(estimator.resident_bytes(place, &plan, residency));
        let cost = device.apply(&plan, &read.frame)?;
        let residency = device.residency();
        share.holds(place, needed_bytes, |run| residency.holds_trees_of(run));
        estimator.built(place, &plan, residency);
        report.bytes.resident = Some(residency.bytes());
        report.updated(&plan, &cost);
        let exposure_stops = read.encoding.exposure_stops;
        let output =
            if read.encoding.takes_codes() { Output::Codes { exposure_stops } } else { Output::Linear };
        device.begin(&read.frame, &read.shot, output, self.ends.stop)?;
        Ok(Begun { work, cost, is_start: plan.is_start })
    }

    /// Tells what a frame took of its device: from its begin, or from the end of the one before, to its own, but for what it
    /// waited for others meanwhile.
    fn tell_share(&mut self, frame: &UnderWay) {
        let ended_s = self.clock.s();
        let passed_s = ended_s - frame.begun_s.max(self.ended_s);
        self.ended_s = ended_s;
        let Ends { device, share, .. } = self.ends;
        let report = &frame.read.report;
        let [start_s, trace_s] = [
            report.ms.upload.unwrap_or(0.0) + report.ms.update.unwrap_or(0.0),
            report.ms.trace.unwrap_or(0.0),
        ]
        .map(|ms| ms / 1e3);
        if frame.begun.is_start {
            share.started(device, start_s);
            share.done(device, report.index, trace_s);
        } else {
            share.done(device, report.index, passed_s.min(start_s + trace_s));
        }
    }

    /// Learns from a frame that was traced, and reports it.
    fn learn(&mut self, frame: &mut UnderWay, traced: &Traced) {
        let UnderWay { read, begun: Begun { work, cost, .. }, .. } = frame;
        let report = &mut read.report;
        if let Some(ms) = traced.update_ms {
            report.ms.update = Some(cost.update_ms.unwrap_or(0.0) + ms);
            if cost.built.triangles == 0 {
                cost.refitted.ms = ms;
            }
        }
        if traced.cost_ratio.is_some() {
            cost.cost_ratio = traced.cost_ratio;
            report.update.cost_ratio = traced.cost_ratio.filter(|ratio| ratio.is_finite());
        }
        self.learned.frame(cost, traced.trace_ms);
        self.ends.estimator.traced(self.ends.device, work, cost, traced);
        if traced.rays.media_ignored > 0 {
            let text =
                format!("rays entered more than {MEDIA_MAX} media one in another; deeper ones are ignored");
            let source = Path::new(&report.source);
            self.warnings.add_times(Some(source), None, text, traced.rays.media_ignored);
        }
        report.rays = traced.rays.into();
        report.ms.trace = Some(traced.trace_ms);
    }
}
