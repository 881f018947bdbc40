//! Frames to devices. Pure: events with their times come in, decisions go out; there is no clock, thread or file here, and
//! no timer: a decision compares seconds of work.
//!
//! A caller adds jobs, asks for each idle device what it traces next ([`Scheduler::lease`]) and tells what became of it.
//! Where a device gets nothing it asks again after the next event.

mod choose;
mod device;
pub mod estimate;
mod job;
mod order;
mod ranges;
mod rules;
mod scheduler;
pub mod simulation;
#[cfg(test)]
mod tests;

pub use rules::Weights;
pub use scheduler::Scheduler;

use std::ops::Range;

/// How frames are shared out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Policy {
    /// Where they end first, counting what is resident and what a cold start costs.
    #[default]
    Affinity,
    /// Oldest job first, on all devices.
    Fifo,
}

/// What the scheduler knows of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeviceFacts {
    /// Bytes that it may hold.
    pub budget_bytes: u64,
    /// Equal devices are of one kind: the same costs hold for them, and what one measures the others know.
    /// Kinds are counted from 0.
    pub kind: usize,
}

/// What a job costs on a kind of device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// Seconds for a frame where the scene is resident.
    pub warm_s: f64,
    /// Seconds to make the scene resident.
    pub cold_s: f64,
    /// Whether it can be traced there at all.
    pub fits: bool,
}

/// A job to come.
#[derive(Clone, Debug, PartialEq)]
pub struct NewJob {
    /// How many frames it has; they are numbered from 0.
    pub frames: u64,
    /// Whether more will be appended: it ends only after [`Scheduler::close`].
    pub grows: bool,
    /// Each step doubles its share; 0 is ordinary, at most ±16 count.
    pub priority: i32,
    /// By kinds of devices.
    pub costs: Vec<Costs>,
    /// Bytes of its scene on a device.
    pub bytes: u64,
}

/// Names a job; never used again for another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct JobId(pub(crate) usize);

/// What a device traces next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lease {
    /// The job.
    pub job: JobId,
    /// Consecutive frames.
    pub frames: Range<u64>,
}

/// Why a job is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ScheduleError {
    /// No device can hold the scene.
    #[error(
        "the scene takes {bytes} bytes on a device, the largest budget is {budget_bytes}; raise it (--memory), or render fewer or smaller textures"
    )]
    TooLarge {
        /// Bytes of the scene.
        bytes: u64,
        /// Bytes that the device with the most of them may hold.
        budget_bytes: u64,
    },
    /// Its costs are not for the kinds of devices that there are.
    #[error("costs are given for {given} kinds of devices, there are {kinds}")]
    Kinds {
        /// Kinds that costs are given for.
        given: usize,
        /// Kinds that there are.
        kinds: usize,
    },
}
