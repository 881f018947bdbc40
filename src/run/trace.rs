//! The device stage: what changed, what the device must do, trace.

use super::costs::Learned;
use super::event::{Status, UpdateReport};
use super::memory::InFlight;
use super::read::{Read, ReadFrame};
use super::report::DeviceReport;
use super::{Note, RunOptions, Shown, panic_text};
use crate::clock::Stopwatch;
use crate::device::{Device, DeviceError, Stop};
use crate::diff::changes;
use crate::film::Film;
use crate::kernel::media::MEDIA_MAX;
use crate::plan::{Action, Update, Wishes, plan_frame};
use crate::scene::{Frame, PartHash};
use crate::warning::Warnings;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, SyncSender};

/// Takes frames in their order, makes each resident, traces it and hands the film to a writer.
#[allow(clippy::too_many_arguments, reason = "the stage's ends")]
pub(super) fn device_stage(
    device: &mut dyn Device,
    options: &RunOptions,
    frames: usize,
    from_readers: &Receiver<Read>,
    flight: &InFlight,
    stop: &Stop,
    to_writers: &SyncSender<Shown>,
    note: &Sender<Note>,
) {
    let mut stage = DeviceStage {
        told: DeviceReport::new(device.info()),
        device,
        before: None,
        cold: options.cold,
        update: options.update,
        learned: Learned::new(),
        frames_left: frames as u64,
        forget: false,
        warnings: Warnings::default(),
    };
    let mut waiting = BTreeMap::new();
    let mut turn = 0;
    for read in from_readers {
        waiting.insert(read.index, read);
        while let Some(Read { bytes, outcome, .. }) = waiting.remove(&turn) {
            turn += 1;
            stage.frames_left = (frames - turn.min(frames)) as u64;
            flight.give_slot();
            let traced = match outcome {
                _ if stop.asked() => None,
                Err(report) => {
                    let _ = note.send(Note::Frame(report));
                    None
                }
                Ok(mut read) => Some((stage.frame(&mut read, stop), read)),
            };
            flight.give_bytes(bytes);
            if !stage.warnings.is_empty() {
                let _ = note.send(Note::Warnings(std::mem::take(&mut stage.warnings)));
            }
            let Some((film, mut read)) = traced else { continue };
            match film {
                Ok((film, status)) => {
                    // the writers outlive this stage
                    let _ = to_writers.send(Shown { film, read, status });
                }
                Err(None) => {}
                Err(Some(error)) => {
                    read.report.status = Status::Failed;
                    read.report.error = Some(error);
                    let _ = note.send(Note::Frame(read.report));
                }
            }
            let _ = note.send(Note::Device(stage.told.clone()));
        }
    }
}

struct DeviceStage<'a> {
    device: &'a mut dyn Device,
    told: DeviceReport,
    /// What the device traced last.
    before: Option<Before>,
    cold: bool,
    update: Update,
    learned: Learned,
    /// Frames that are still to come.
    frames_left: u64,
    /// Whether what the device holds is not to be trusted, because it panicked.
    forget: bool,
    /// What is to be told of the frame.
    warnings: Warnings,
}

/// A frame and what came of it.
struct Before {
    frame: Arc<Frame>,
    fingerprint: PartHash,
    film: Arc<Film>,
}

impl DeviceStage<'_> {
    /// The film, or why there is none; no reason means that the run was stopped.
    fn frame(&mut self, read: &mut ReadFrame, stop: &Stop) -> Result<(Arc<Film>, Status), Option<String>> {
        let is_copy = |before: &&Before| before.fingerprint == read.fingerprint;
        if let Some(before) = self.before.as_ref().filter(|_| !self.cold).filter(is_copy) {
            let report = &mut read.report;
            report.warm = true;
            report.change = changes(Some(&before.frame), &read.frame);
            let why = "equal to the frame before, as are its settings".to_string();
            report.update =
                UpdateReport { action: Some(Action::None.word()), why, ..UpdateReport::default() };
            return Ok((Arc::clone(&before.film), Status::Copied));
        }
        let busy = Stopwatch::start();
        read.report.device = Some(self.told.name.clone());
        let traced = catch_unwind(AssertUnwindSafe(|| self.update_and_trace(read, stop)));
        let source = &read.report.source;
        self.told.busy_s += busy.s();
        self.told.holds(self.device);
        let failed = match traced {
            Ok(Ok(film)) => {
                self.told.frames += 1;
                let film = Arc::new(film);
                let (frame, fingerprint) = (Arc::clone(&read.frame), read.fingerprint);
                self.before = Some(Before { frame, fingerprint, film: Arc::clone(&film) });
                self.forget = false;
                return Ok((film, Status::Rendered));
            }
            Ok(Err(DeviceError::Stopped)) => return Err(None),
            Ok(Err(error)) => {
                read.report.device_failed = true;
                format!("{source}: {error}")
            }
            Err(panic) => format!("{source}: {}", panic_text("tracing", &*panic)),
        };
        self.before = None;
        self.forget = true;
        Err(Some(failed))
    }

    fn update_and_trace(&mut self, read: &mut ReadFrame, stop: &Stop) -> Result<Film, DeviceError> {
        let report = &mut read.report;
        let clock = Stopwatch::start();
        let cold = self.cold || self.forget;
        let before = self.before.as_ref().filter(|_| !cold).map(|before| &*before.frame);
        report.change = changes(before, &read.frame);
        report.ms.diff = Some(clock.ms());
        let wishes = Wishes {
            cold,
            budget_bytes: self.device.info().budget_bytes,
            used_again: if self.cold { Vec::new() } else { std::mem::take(&mut read.used_again) },
            update: self.update,
            costs: self.learned.costs(self.frames_left),
        };
        let plan = plan_frame(&read.frame, self.device.residency(), &wishes);
        let cost = self.device.apply(&plan, &read.frame)?;
        report.updated(&plan, &cost);
        let traced = self.device.trace(&read.frame, &read.shot, stop)?;
        self.learned.frame(&cost, traced.trace_ms);
        if traced.rays.media_ignored > 0 {
            let text =
                format!("rays entered more than {MEDIA_MAX} media one in another; deeper ones are ignored");
            let source = Path::new(&report.source);
            self.warnings.add_times(Some(source), None, text, traced.rays.media_ignored);
        }
        report.rays = traced.rays.into();
        report.ms.trace = Some(traced.trace_ms);
        report.ms.readback = traced.readback_ms;
        Ok(traced.film)
    }
}
