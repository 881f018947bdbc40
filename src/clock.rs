//! The one place where time comes in, so that tests can hold it still.

use std::time::{Duration, Instant, SystemTime};

/// A stopwatch over the monotonic clock.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch(Instant);

impl Stopwatch {
    /// Starts now.
    pub fn start() -> Self {
        Self(Instant::now())
    }

    /// Milliseconds since the start.
    pub fn ms(&self) -> f64 {
        self.0.elapsed().as_secs_f64() * 1e3
    }

    /// Seconds since the start.
    pub fn s(&self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }

    /// Time since the start.
    pub fn elapsed(&self) -> Duration {
        self.0.elapsed()
    }
}

/// When a file was changed, as the system tells it.
pub type FileTime = SystemTime;

/// Now, to stamp files with.
pub fn file_time() -> FileTime {
    SystemTime::now()
}

/// Before every file.
pub const EARLIEST: FileTime = SystemTime::UNIX_EPOCH;

/// Nanoseconds since the Unix epoch; 0 where the system's clock stands before it.
pub fn unix_ns() -> u128 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |d| d.as_nanos())
}
