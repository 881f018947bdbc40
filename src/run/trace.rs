//! The device stage: what changed, what the device must do, trace.

use super::event::Status;
use super::memory::InFlight;
use super::read::{Read, ReadFrame};
use super::report::DeviceReport;
use super::{Note, RunOptions, Shown, panic_text};
use crate::clock::Stopwatch;
use crate::device::{Device, DeviceError, Stop};
use crate::diff::changes;
use crate::film::Film;
use crate::plan::plan_frame;
use crate::scene::Frame;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, SyncSender};

/// Takes frames in their order, makes each resident, traces it and hands the film to a writer.
pub(super) fn device_stage(
    device: &mut dyn Device,
    options: &RunOptions,
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
        forget: false,
    };
    let mut waiting = BTreeMap::new();
    let mut turn = 0;
    for read in from_readers {
        waiting.insert(read.index, read);
        while let Some(Read { bytes, outcome, .. }) = waiting.remove(&turn) {
            turn += 1;
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
            let Some((film, mut read)) = traced else { continue };
            match film {
                Ok(film) => {
                    // the writers outlive this stage
                    let _ = to_writers.send(Shown { film, read });
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
    /// The frame that the device traced last.
    before: Option<Arc<Frame>>,
    cold: bool,
    /// Whether what the device holds is not to be trusted, because it panicked.
    forget: bool,
}

impl DeviceStage<'_> {
    /// The film, or why there is none; no reason means that the run was stopped.
    fn frame(&mut self, read: &mut ReadFrame, stop: &Stop) -> Result<Film, Option<String>> {
        let busy = Stopwatch::start();
        read.report.device = Some(self.told.name.clone());
        let traced = catch_unwind(AssertUnwindSafe(|| self.update_and_trace(read, stop)));
        let source = &read.report.source;
        self.told.busy_s += busy.s();
        self.told.holds(self.device);
        match traced {
            Ok(Ok(film)) => {
                self.told.frames += 1;
                self.before = Some(Arc::clone(&read.frame));
                self.forget = false;
                Ok(film)
            }
            Ok(Err(DeviceError::Stopped)) => Err(None),
            Ok(Err(error)) => {
                self.before = None;
                self.forget = true;
                let told = format!("{source}: {error}");
                read.report.device_failed = true;
                Err(Some(told))
            }
            Err(panic) => {
                self.before = None;
                self.forget = true;
                Err(Some(format!("{source}: {}", panic_text("tracing", &*panic))))
            }
        }
    }

    fn update_and_trace(&mut self, read: &mut ReadFrame, stop: &Stop) -> Result<Film, DeviceError> {
        let report = &mut read.report;
        let clock = Stopwatch::start();
        let cold = self.cold || self.forget;
        report.change = changes(self.before.as_deref().filter(|_| !cold), &read.frame);
        report.ms.diff = Some(clock.ms());
        let plan = plan_frame(&read.frame, self.device.residency(), cold);
        let cost = self.device.apply(&plan, &read.frame)?;
        report.updated(&plan, &cost);
        let traced = self.device.trace(&read.frame, &read.shot, stop)?;
        report.rays = traced.rays.into();
        report.ms.trace = Some(traced.trace_ms);
        report.ms.readback = traced.readback_ms;
        Ok(traced.film)
    }
}
