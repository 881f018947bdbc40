//! `--report`: what the run did, as JSON, replaced whole: at the beginning, at most once a second, and always at the end.

use super::event::{FrameReport, Status};
use super::machine::{Machine, machine, peak_rss_bytes};
use crate::clock::Stopwatch;
use crate::device::{Device, DeviceInfo};
use crate::output::{self, OutputError};
use serde::Serialize;
use std::path::PathBuf;

/// Counts of the frames so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Totals {
    /// Frames that ended.
    pub frames: u64,
    /// Rendered.
    pub rendered: u64,
    /// Found finished.
    pub resumed: u64,
    /// Equal to the frame before.
    pub copied: u64,
    /// Failed.
    pub failed: u64,
    /// Frames that ended a second.
    pub frames_per_s: f64,
    /// The most memory ever resident, bytes.
    pub peak_rss_bytes: u64,
    /// What that was expected to be when the first frame was read.
    pub predicted_rss_bytes: Option<u64>,
}

impl Totals {
    fn count(&mut self, status: Status) {
        self.frames += 1;
        match status {
            Status::Rendered => self.rendered += 1,
            Status::Resumed => self.resumed += 1,
            Status::Copied => self.copied += 1,
            Status::Failed => self.failed += 1,
        }
    }
}

/// What a device holds and how that went.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ResidentReport {
    /// Bytes held now.
    pub bytes: u64,
    /// Bytes that it may hold.
    pub budget: u64,
    /// The most it ever held.
    pub peak: u64,
    /// Needed and there.
    pub hits: u64,
    /// Needed and not there.
    pub misses: u64,
    /// Given up for want of space.
    pub evictions: u64,
}

/// What one device did.
#[derive(Clone, Debug, Serialize)]
pub struct DeviceReport {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: &'static str,
    /// Frames that it traced.
    pub frames: u64,
    /// Seconds in which it worked.
    pub busy_s: f64,
    /// What it holds.
    pub resident: ResidentReport,
}

impl DeviceReport {
    /// A device that has done nothing yet.
    pub fn new(info: &DeviceInfo) -> Self {
        Self {
            name: info.name.clone(),
            kind: info.kind.word(),
            frames: 0,
            busy_s: 0.0,
            resident: ResidentReport { budget: info.budget_bytes, ..ResidentReport::default() },
        }
    }

    /// Adds what it did in another run.
    pub fn add(&mut self, other: &Self) {
        self.frames += other.frames;
        self.busy_s += other.busy_s;
        let (all, one) = (&mut self.resident, &other.resident);
        all.hits += one.hits;
        all.misses += one.misses;
        all.evictions += one.evictions;
        all.peak = all.peak.max(one.peak);
        if other.frames > 0 {
            all.bytes = one.bytes;
        }
    }

    /// Takes over how much the device holds now.
    pub fn holds(&mut self, device: &dyn Device) {
        self.resident.bytes = device.residency().bytes();
        self.resident.peak = device.residency().peak_bytes;
    }
}

/// The whole report.
#[derive(Debug, Serialize)]
pub struct Report {
    rentix: &'static str,
    /// Seconds since the run's start.
    pub wall_s: f64,
    machine: Machine,
    /// The devices.
    pub devices: Vec<DeviceReport>,
    /// Counts.
    pub totals: Totals,
    /// The frames in the order in which they were taken: all, or only those that failed.
    pub frames: Vec<FrameReport>,
    #[serde(skip)]
    keeps_all: bool,
    /// Each picture that ended, by its place in the job, and how.
    #[serde(skip)]
    pub(super) ended: Vec<(u32, Status)>,
    /// Warnings as told.
    pub warnings: Vec<String>,
}

impl Report {
    /// An empty report that keeps all frames, or only those that fail.
    pub fn new(devices: Vec<DeviceReport>, keeps_all: bool) -> Self {
        Self {
            rentix: env!("CARGO_PKG_VERSION"),
            wall_s: 0.0,
            machine: machine(),
            devices,
            totals: Totals::default(),
            frames: Vec::new(),
            keeps_all,
            ended: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// Adds a frame that ended.
    pub fn frame(&mut self, frame: &FrameReport) {
        self.ended.push((frame.index as u32, frame.status));
        if self.keeps_all || frame.status == Status::Failed {
            self.frames.push(frame.clone());
        }
    }

    /// Brings counts, times and memory up to now.
    pub fn settle(&mut self, since: &Stopwatch) {
        self.wall_s = since.s();
        self.totals = Totals { predicted_rss_bytes: self.totals.predicted_rss_bytes, ..Totals::default() };
        for (_, status) in &self.ended {
            self.totals.count(*status);
        }
        self.totals.frames_per_s = self.totals.frames as f64 / self.wall_s.max(1e-9);
        self.totals.peak_rss_bytes = peak_rss_bytes();
        self.frames.sort_by_key(|f| (f.taken.is_none(), f.taken, f.index));
    }

    /// The report as JSON.
    pub fn json(&self) -> Vec<u8> {
        // plain numbers, strings and lists cannot fail to serialize
        serde_json::to_vec_pretty(self).unwrap_or_default()
    }
}

/// Stands in each report, and tells it from files that others made.
pub(super) const MARK: &str = "\"rentix\": \"";

/// A report that is not where it should be.
#[derive(Debug, thiserror::Error)]
#[error("{}: the report cannot be written: {why}; --report names another file", .file.display())]
pub struct Unsaved {
    /// Where it should be.
    pub file: PathBuf,
    /// What the system says.
    pub why: String,
}

/// Writes the report: at the beginning, at most once a second, for less than a hundredth of the run's time, and at the end.
#[derive(Debug)]
pub(super) struct Saver {
    path: Option<PathBuf>,
    saved_s: f64,
    cost_s: f64,
}

const SAVE_EVERY_S: f64 = 1.0;
const SAVE_SHARE_MAX: f64 = 0.01;

impl Saver {
    pub(super) fn new(path: Option<PathBuf>) -> Self {
        Self { path, saved_s: 0.0, cost_s: 0.0 }
    }

    /// Saves if it is time to, or anyway.
    pub(super) fn save(
        &mut self,
        report: &mut Report,
        since: &Stopwatch,
        anyway: bool,
    ) -> Result<(), Unsaved> {
        let Some(path) = &self.path else { return Ok(()) };
        let now_s = since.s();
        if !anyway && now_s - self.saved_s < SAVE_EVERY_S.max(self.cost_s / SAVE_SHARE_MAX) {
            return Ok(());
        }
        report.settle(since);
        let written = output::write_atomic(path, &report.json());
        self.saved_s = since.s();
        self.cost_s = self.saved_s - now_s;
        written.map_err(|error| Unsaved {
            file: path.clone(),
            why: if let OutputError::Write { source, .. } = error {
                source.to_string()
            } else {
                error.to_string()
            },
        })
    }
}
