//! What the page shows: a copy that the driving thread renews, bounded however many jobs there are.

use super::state::{State, Status};
use crate::run::DeviceReport;
use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// So many jobs that have not ended are shown, and as many that have.
pub(super) const JOBS_SHOWN: usize = 200;

/// What is shown.
#[derive(Debug, Default)]
pub(super) struct View {
    /// Jobs that have not ended, those that run first.
    pub(super) open: Vec<Status>,
    /// The last that ended, the latest first.
    pub(super) ended: VecDeque<Status>,
    /// Jobs by their states.
    pub(super) counts: [u64; State::ALL.len()],
    /// Frames that ended since the start: rendered, and failed.
    pub(super) frames: [u64; 2],
    /// The devices and what they hold.
    pub(super) devices: Vec<DeviceReport>,
    /// The picture that was made last: of which job, and the file.
    pub(super) picture: Option<(String, PathBuf)>,
    /// Seconds since the start.
    pub(super) up_s: f64,
    /// What is in the way now.
    pub(super) trouble: Option<String>,
}

impl View {
    /// Adds a job that ended.
    pub(super) fn add_ended(&mut self, status: Status) {
        self.ended.retain(|s| s.job != status.job);
        self.ended.push_front(status);
        self.ended.truncate(JOBS_SHOWN);
    }
}

/// The view, shared between the thread that renews it and the one that serves it.
#[derive(Clone, Debug, Default)]
pub(super) struct Shared(Arc<Mutex<View>>);

impl Shared {
    /// The view, for a moment.
    pub(super) fn lock(&self) -> MutexGuard<'_, View> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
