//! What renders: one small trait that the CPU, each GPU and the fake device implement. Callers know no other
//! difference between them.

pub mod conformance;
pub mod cpu;
pub mod fake;
pub mod gpu;
pub mod registry;

pub use crate::kernel::RayCounts;

use crate::film::LatentFilm;
use crate::plan::{Residency, UpdatePlan};
use crate::scene::{Frame, Shot};
use std::sync::atomic::{AtomicBool, Ordering};

/// What kind of device it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceKind {
    /// Cores of the host.
    Cpu,
    /// A wgpu adapter.
    Gpu,
    /// The fake device of tests: scripted, draws nothing.
    Fake,
}

impl DeviceKind {
    /// The word in reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
            Self::Fake => "fake",
        }
    }
}

/// What a device is.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceInfo {
    /// Its name on the command line and in reports.
    pub name: String,
    /// Its kind.
    pub kind: DeviceKind,
    /// What it is, for people: model, SIMD width.
    pub description: String,
    /// Threads that trace.
    pub threads: usize,
    /// Bytes that it may hold.
    pub budget_bytes: u64,
}

/// Asks a trace to end early.
#[derive(Debug, Default)]
pub struct Stop(AtomicBool);

impl Stop {
    /// Asks.
    pub fn ask(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether it was asked.
    pub fn asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// What applying a plan cost. A term that a device does not have is None.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UpdateCost {
    /// Bytes of parts handed to what the device holds; derived data not counted.
    pub uploaded_bytes: u64,
    /// Handing them over, ms.
    pub upload_ms: Option<f64>,
    /// Building and refitting, ms.
    pub update_ms: Option<f64>,
    /// What was built.
    pub built: Work,
    /// What was made of shapes that a store had.
    pub restored: Work,
    /// What was refitted and kept.
    pub refitted: Work,
    /// The surface-area cost of the frame's trees over that of their last builds, by triangles; None without trees.
    pub cost_ratio: Option<f64>,
}

/// Triangles that something was done with, and how long it took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Work {
    /// Triangles.
    pub triangles: u64,
    /// Milliseconds.
    pub ms: f64,
}

impl Work {
    /// Adds to it.
    pub fn add(&mut self, triangles: u64, ms: f64) {
        self.triangles += triangles;
        self.ms += ms;
    }
}

/// What is wanted of a film's colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Output {
    /// Linear floats.
    Linear,
    /// Codes of 8 bits, where the device can make them; the film has linear floats else.
    Codes {
        /// Exposure in stops.
        exposure_stops: f32,
    },
}

/// A traced frame and what it cost.
#[derive(Debug)]
pub struct Traced {
    /// The picture.
    pub film: LatentFilm,
    /// Rays.
    pub rays: RayCounts,
    /// Tracing and shading, ms.
    pub trace_ms: f64,
    /// Fitting trees for this frame, ms, where the device does that when it traces.
    pub update_ms: Option<f64>,
    /// The surface-area cost of the frame's trees over that of their last builds, mean by triangles, where fits showed it.
    pub cost_ratio: Option<f64>,
    /// When it fitted trees and when it traced, by its own clock; where it has one.
    pub spans: Spans,
}

/// When a device worked on a frame: from and to, ms of its own clock.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spans {
    /// Fitting trees.
    pub update: Option<[f64; 2]>,
    /// Tracing.
    pub trace: Option<[f64; 2]>,
}

/// Why a device did not do what it was asked.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DeviceError {
    /// The frame does not fit.
    #[error(
        "{device}: the frame needs {needed_bytes} bytes, {budget_bytes} are allowed; raise --device-memory or use a device with more memory"
    )]
    OutOfMemory {
        /// Which device.
        device: String,
        /// What the frame needs.
        needed_bytes: u64,
        /// What is allowed.
        budget_bytes: u64,
    },
    /// Something must lie in one buffer, and no buffer may be so large.
    #[error(
        "{device}: {what} would take a buffer of {needed_bytes} bytes, {most_bytes} are the most there; use another device, or a smaller picture or scene"
    )]
    BufferTooLarge {
        /// Which device.
        device: String,
        /// What lies in the buffer.
        what: String,
        /// What it takes.
        needed_bytes: u64,
        /// What a buffer may take.
        most_bytes: u64,
    },
    /// The device's memory is full, though the budget is not.
    #[error(
        "{device}: there is no memory for {needed_bytes} bytes of {what}; lower --device-memory, or end what else uses the device"
    )]
    MemoryFull {
        /// Which device.
        device: String,
        /// What was to be held.
        what: String,
        /// What it takes.
        needed_bytes: u64,
    },
    /// The device is gone and holds nothing any more.
    #[error("{device}: lost: {why}")]
    Lost {
        /// Which device.
        device: String,
        /// What is known.
        why: String,
    },
    /// The frame was not made resident before it was traced.
    #[error("{device}: object {object} of the frame is not resident; its plan must be applied first")]
    NotResident {
        /// Which device.
        device: String,
        /// The object, by its place in the frame.
        object: usize,
    },
    /// [`Stop`] was asked.
    #[error("stopped")]
    Stopped,
}

/// What renders. All calls come from one thread at a time.
pub trait Device: Send {
    /// What it is.
    fn info(&self) -> &DeviceInfo;

    /// What it holds.
    fn residency(&self) -> &Residency;

    /// Makes a frame resident as the plan says. The only thing that changes what the device holds. The plan must
    /// have been made for this frame and for what the device holds now.
    fn apply(&mut self, plan: &UpdatePlan, frame: &Frame) -> Result<UpdateCost, DeviceError>;

    /// Frames that may be under way at once: begun, and not finished.
    fn most_under_way(&self) -> usize {
        1
    }

    /// Begins to trace the frame that is resident. The next frame may be made resident at once.
    fn begin(&mut self, frame: &Frame, shot: &Shot, output: Output, stop: &Stop) -> Result<(), DeviceError>;

    /// Waits for the frame that was begun first of those under way. Where the device is lost, all of them are.
    fn finish(&mut self) -> Result<Traced, DeviceError>;

    /// Traces the frame that is resident; nothing else may be under way.
    fn trace(&mut self, frame: &Frame, shot: &Shot, stop: &Stop) -> Result<Traced, DeviceError> {
        self.begin(frame, shot, Output::Linear, stop)?;
        self.finish()
    }
}
