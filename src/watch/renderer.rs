//! The one place that renders: several jobs at a time, on devices that stay open and warm from job to job. Which of them has which
//! device when is the scheduler's choice.

use super::Message;
use super::follow_run;
use super::job::{self, Place, Unfit};
use crate::device::Stop;
use crate::job::{Job, Request};
use crate::output;
use crate::run::{self, DeviceReport, Event, Fleet, Outcome, RunOptions};
use std::collections::HashSet;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// What is to be rendered of a job.
#[derive(Debug)]
pub(super) struct Order {
    /// Whose events these are.
    pub(super) id: u64,
    pub(super) place: Place,
    pub(super) defaults: Arc<Request>,
    /// Of a sequence that is still growing those files that are whole; None: everything.
    pub(super) only: Option<HashSet<OsString>>,
    /// Whether the sequence is followed, which says where the auto camera stands.
    pub(super) followed: bool,
    /// Its share beside the others'.
    pub(super) priority: i64,
    pub(super) stop: Arc<Stop>,
}

/// What is told of an order.
#[derive(Debug)]
pub(super) enum Told {
    /// An event of its run.
    Event(Box<Event>),
    /// Its run ended.
    Ended(Box<Outcome>),
    /// It cannot be rendered: why.
    Unfit(String),
    /// It cannot be unpacked for want of space.
    Full(String),
}

/// So many jobs share the devices: a small one need not wait for the large ones before it, and each has threads of its own.
pub(super) const JOBS_AT_ONCE: usize = 16;

/// Renders orders.
pub(super) struct Renderer {
    orders: Option<Sender<Order>>,
    threads: Vec<JoinHandle<()>>,
    /// What the devices are.
    pub(super) devices: Vec<DeviceReport>,
}

impl Renderer {
    /// Takes the devices; what happens is told as messages.
    pub(super) fn start(fleet: Fleet, options: &RunOptions, messages: &Sender<Message>) -> Self {
        let (orders, incoming) = channel::<Order>();
        let devices = fleet.reports();
        let (fleet, incoming) = (Arc::new(fleet), Arc::new(Mutex::new(incoming)));
        let thread = || {
            let (fleet, incoming) = (Arc::clone(&fleet), Arc::clone(&incoming));
            let (options, messages) = (options.clone(), messages.clone());
            std::thread::spawn(move || {
                let next = || incoming.lock().unwrap_or_else(PoisonError::into_inner).recv();
                while let Ok(order) = next() {
                    let told = one(&order, &options, &fleet, &messages);
                    if messages.send(Message::Told(order.id, told)).is_err() {
                        return;
                    }
                }
            })
        };
        let threads = (0..JOBS_AT_ONCE).map(|_| thread()).collect();
        Self { orders: Some(orders), threads, devices }
    }

    /// Hands over an order; false where the renderer is gone.
    pub(super) fn order(&self, order: Order) -> bool {
        self.orders.as_ref().is_some_and(|orders| orders.send(order).is_ok())
    }
}

impl Drop for Renderer {
    fn drop(&mut self) {
        self.orders = None;
        for thread in self.threads.drain(..) {
            // its panics were caught
            let _ = thread.join();
        }
    }
}

fn one(order: &Order, options: &RunOptions, fleet: &Fleet, messages: &Sender<Message>) -> Told {
    let mut tell = |event: &Event| {
        // nobody listens any more once the daemon ends
        let event = as_packed(event.clone(), &order.place);
        let _ = messages.send(Message::Told(order.id, Told::Event(Box::new(event))));
    };
    let rendered = catch_unwind(AssertUnwindSafe(|| {
        let job = prepared(order).map_err(|unfit| not_prepared(&unfit, &order.place))?;
        let priority = order.priority.clamp(i32::MIN.into(), i32::MAX.into()) as i32;
        let options = RunOptions { priority, ..options.clone() };
        let unfit = |error: String| Told::Unfit(order.place.as_packed(&error));
        let outcome = run::render(&job, &options, fleet, &order.stop, &mut tell)
            .map_err(|error| unfit(error.to_string()))?;
        if order.only.is_none() && !outcome.stopped && outcome.failed().next().is_none() {
            // a later daemon tells by it whether they are there still
            let files = job.pictures.iter().flat_map(run::files_of);
            output::keep_listing(&job.folder, files).map_err(|error| unfit(error.to_string()))?;
        }
        Ok(outcome)
    }));
    match rendered {
        Ok(Ok(outcome)) => Told::Ended(Box::new(outcome)),
        Ok(Err(told)) => told,
        Err(_) => Told::Unfit("internal error; the other jobs go on, please report this".to_owned()),
    }
}

/// What is told where nothing can be rendered.
fn not_prepared(unfit: &Unfit, place: &Place) -> Told {
    match unfit {
        Unfit::Archive(error) if error.is_full_disk() => Told::Full(unfit.to_string()),
        // it names the archive, or where on this machine it could not be unpacked
        Unfit::Archive(_) => Told::Unfit(unfit.to_string()),
        _ => Told::Unfit(place.as_packed(&unfit.to_string())),
    }
}

/// An event with the names of files as they were packed.
fn as_packed(mut event: Event, place: &Place) -> Event {
    match &mut event {
        Event::Start { .. } => {}
        Event::Frame(frame) => frame.error = frame.error.take().map(|error| place.as_packed(&error)),
        Event::Warning(warning) => {
            warning.text = place.as_packed(&warning.text);
            let file = warning.file.as_ref().map(|file| place.as_packed(&file.display().to_string()));
            warning.file = file.map(PathBuf::from);
        }
    }
    event
}

fn prepared(order: &Order) -> Result<Job, Unfit> {
    let mut job = job::prepare(&order.place, &order.defaults, order.only.is_some())?;
    if order.followed && follow_run::can_follow(&job) {
        follow_run::fix_cameras(&mut job)?;
    }
    if let Some(only) = &order.only {
        follow_run::keep(&mut job, only);
    }
    Ok(job)
}

#[cfg(test)]
mod tests {
    use super::super::archive::ArchiveError;
    use super::super::inbox::Kind;
    use super::*;
    use std::io;

    #[test]
    fn a_full_disk_is_no_fault_of_an_archive() {
        let write = |kind: io::ErrorKind| {
            let source = kind.into();
            let place =
                Place { source: "a.zip".into(), kind: Kind::Folder, room: "a".into(), out: "out".into() };
            not_prepared(&Unfit::Archive(ArchiveError::Write { path: "a_1.obj".into(), source }), &place)
        };
        assert!(matches!(write(io::ErrorKind::StorageFull), Told::Full(why) if why.contains("a_1.obj")));
        assert!(matches!(write(io::ErrorKind::PermissionDenied), Told::Unfit(_)));
    }
}
