//! The writer stage: films become files, each whole or absent, its record before it.

use super::estimate::Estimator;
use super::event::Status;
use super::{Note, Shown, panic_text};
use crate::clock::Stopwatch;
use crate::output::{self, OutputError, RunLog};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, Sender};
use std::sync::{Mutex, PoisonError};

/// Encodes and writes until no film comes any more.
pub(super) fn write_stage(
    log: &RunLog,
    estimator: &Estimator,
    films: &Mutex<Receiver<Shown>>,
    note: &Sender<Note>,
) {
    loop {
        let shown = films.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok(mut shown) = shown else { return };
        let written = catch_unwind(AssertUnwindSafe(|| write_frame(log, &mut shown)));
        let error = match written {
            Ok(Ok(())) => None,
            Ok(Err(error)) => Some(error.to_string()),
            Err(panic) => Some(format!("{}: {}", shown.read.report.picture, panic_text("writing", &*panic))),
        };
        shown.read.report.status = if error.is_some() { Status::Failed } else { shown.status };
        shown.read.report.error = error;
        let [width, height] = shown.read.shot.size.map(u64::from);
        estimator.written(&mut shown.read.report, shown.read.encoding.format.word(), width * height);
        let _ = note.send(Note::Frame(shown.read.report));
    }
}

fn write_frame(log: &RunLog, shown: &mut Shown) -> Result<(), OutputError> {
    if !shown.film.is_developed() {
        let clock = Stopwatch::start();
        shown.film.film();
        shown.read.report.ms.readback = Some(clock.ms());
    }
    let clock = Stopwatch::start();
    let files = output::picture_files(&shown.read.picture, &shown.film, shown.read.encoding)?;
    shown.read.report.ms.encode = Some(clock.ms());
    let clock = Stopwatch::start();
    output::finish(log, shown.read.fingerprint, &files)?;
    shown.read.report.ms.write = Some(clock.ms());
    Ok(())
}
