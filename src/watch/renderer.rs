//! The one place that renders: jobs in turn, on devices that stay open and warm from job to job.
//!
//! One thread for now; what comes in and goes out does not say so, so that a scheduler may take several jobs at a time.

use super::Message;
use super::follow_run;
use super::job::{self, Place};
use crate::device::{Device, Stop};
use crate::job::{Job, Request};
use crate::run::{self, DeviceReport, Event, Outcome, RunOptions};
use std::collections::HashSet;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::mpsc::{Sender, channel};
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
}

/// Renders orders one after the other.
pub(super) struct Renderer {
    orders: Option<Sender<Order>>,
    thread: Option<JoinHandle<()>>,
    /// What the devices are.
    pub(super) devices: Vec<DeviceReport>,
}

impl Renderer {
    /// Takes the devices; what happens is told as messages.
    pub(super) fn start(
        mut devices: Vec<Box<dyn Device>>,
        options: RunOptions,
        messages: Sender<Message>,
    ) -> Self {
        let (orders, incoming) = channel::<Order>();
        let reports = devices.iter().map(|d| DeviceReport::new(d.info())).collect();
        let thread = std::thread::spawn(move || {
            for order in incoming {
                let told = one(&order, &options, &mut devices, &messages);
                if messages.send(Message::Told(order.id, told)).is_err() {
                    return;
                }
            }
        });
        Self { orders: Some(orders), thread: Some(thread), devices: reports }
    }

    /// Hands over an order; false where the renderer is gone.
    pub(super) fn order(&self, order: Order) -> bool {
        self.orders.as_ref().is_some_and(|orders| orders.send(order).is_ok())
    }
}

impl Drop for Renderer {
    fn drop(&mut self) {
        self.orders = None;
        if let Some(thread) = self.thread.take() {
            // its panics were caught
            let _ = thread.join();
        }
    }
}

fn one(
    order: &Order,
    options: &RunOptions,
    devices: &mut [Box<dyn Device>],
    messages: &Sender<Message>,
) -> Told {
    let mut tell = |event: &Event| {
        // nobody listens any more once the daemon ends
        let _ = messages.send(Message::Told(order.id, Told::Event(Box::new(event.clone()))));
    };
    let rendered = catch_unwind(AssertUnwindSafe(|| {
        let job = prepared(order)?;
        run::render(&job, options, devices, &order.stop, &mut tell).map_err(|e| e.to_string())
    }));
    match rendered {
        Ok(Ok(outcome)) => Told::Ended(Box::new(outcome)),
        Ok(Err(why)) => Told::Unfit(why),
        Err(_) => Told::Unfit("internal error; the other jobs go on, please report this".to_owned()),
    }
}

fn prepared(order: &Order) -> Result<Job, String> {
    let mut job =
        job::prepare(&order.place, &order.defaults, order.only.is_some()).map_err(|e| e.to_string())?;
    if order.followed && follow_run::can_follow(&job) {
        follow_run::fix_cameras(&mut job).map_err(|e| e.to_string())?;
    }
    if let Some(only) = &order.only {
        follow_run::keep(&mut job, only);
    }
    Ok(job)
}
