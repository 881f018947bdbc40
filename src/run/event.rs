//! What a run tells while it goes on: the fields of CONTRACT 7.

use crate::device::{RayCounts, UpdateCost};
use crate::diff::Change;
use crate::format::is_gltf;
use crate::plan::{Action, UpdatePlan};
use crate::warning::Warning;
use serde::Serialize;
use std::path::Path;

/// How a frame ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// Its picture was made.
    Rendered,
    /// Its picture was there and right.
    Resumed,
    /// It equals the frame before, and so does its picture.
    Copied,
    /// There is no picture; the error says why.
    Failed,
}

/// What was done to the device before tracing.
#[derive(Clone, Debug, Default, Serialize)]
pub struct UpdateReport {
    /// load, none, refit, repair or rebuild; None where nothing was traced.
    pub action: Option<&'static str>,
    /// Surface-area cost against the last build.
    pub cost_ratio: Option<f64>,
    /// What the update was expected to take, ms.
    pub predicted_ms: Option<f64>,
    /// Why this action.
    pub why: String,
}

/// Bytes of one frame.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct ByteCounts {
    /// Read from files.
    pub read: u64,
    /// Handed to what the device holds; None where nothing was traced.
    pub uploaded: Option<u64>,
    /// What the device held then; None where nothing was traced.
    pub resident: Option<u64>,
    /// What it was expected to hold before it was made resident.
    pub predicted: Option<u64>,
}

/// Milliseconds of one frame by stage; None for what was not done.
#[derive(Clone, Copy, Debug, Default, Serialize)]
#[allow(missing_docs, reason = "the names are those of the contract")]
pub struct StageTimes {
    pub read: Option<f64>,
    pub parse: Option<f64>,
    pub diff: Option<f64>,
    pub upload: Option<f64>,
    pub update: Option<f64>,
    pub trace: Option<f64>,
    pub readback: Option<f64>,
    pub encode: Option<f64>,
    pub write: Option<f64>,
}

/// Rays of one frame.
#[derive(Clone, Copy, Debug, Default, Serialize)]
#[allow(missing_docs, reason = "the names are those of the contract")]
pub struct RayReport {
    pub camera: u64,
    pub shadow: u64,
    pub mirrored: u64,
    pub refracted: u64,
}

impl From<RayCounts> for RayReport {
    fn from(r: RayCounts) -> Self {
        Self { camera: r.camera, shadow: r.shadow, mirrored: r.mirrored, refracted: r.refracted }
    }
}

/// Everything that is told of one frame.
#[derive(Clone, Debug, Serialize)]
pub struct FrameReport {
    /// The sequence's name.
    pub sequence: String,
    /// The frame's number in its file name, if it has one.
    pub frame: Option<i64>,
    /// The source file's name (of the first layer that moves).
    pub source: String,
    /// The picture, relative to the output folder.
    pub picture: String,
    /// How it ended.
    pub status: Status,
    /// Why it failed.
    pub error: Option<String>,
    /// The device that traced it.
    pub device: Option<String>,
    /// Whether something that it needs was resident.
    pub warm: bool,
    /// Triangles in all.
    pub triangles: u64,
    /// What changed since the frame that the device traced before.
    pub change: Change,
    /// What was done to the device.
    pub update: UpdateReport,
    /// Bytes.
    pub bytes: ByteCounts,
    /// Rays.
    pub rays: RayReport,
    /// Times.
    pub ms: StageTimes,
    /// What they were expected to be before.
    pub predicted_ms: StageTimes,
    /// Where several sequences have the same numbers only their place in the job tells pictures apart.
    #[serde(skip)]
    pub index: usize,
    /// Its place among those that were taken; None: it was not.
    #[serde(skip)]
    pub taken: Option<u64>,
    /// Whether it failed because no device could hold or keep it.
    #[serde(skip)]
    pub device_failed: bool,
}

impl FrameReport {
    /// The frame as errors name it: all frames of a glTF are of one file.
    pub(super) fn named(&self) -> String {
        match self.frame {
            Some(frame) if is_gltf(Path::new(&self.source)) => format!("{}: frame {frame}", self.source),
            _ => self.source.clone(),
        }
    }

    /// Fills in what a plan and its execution tell.
    pub fn updated(&mut self, plan: &UpdatePlan, cost: &UpdateCost) {
        self.warm = plan.is_warm();
        let refit_was_bad = plan.action == Action::Refit && cost.built.triangles > 0;
        self.update = UpdateReport {
            action: Some(if refit_was_bad { Action::Rebuild } else { plan.action }.word()),
            cost_ratio: cost.cost_ratio.filter(|ratio| ratio.is_finite()),
            predicted_ms: Some(plan.predicted_ms),
            why: plan.why.clone(),
        };
        if refit_was_bad {
            self.update.why += "; the refitted tree was too bad to be kept";
        }
        self.bytes.uploaded = Some(cost.uploaded_bytes);
        self.ms.upload = cost.upload_ms;
        self.ms.update = cost.update_ms;
    }
}

/// What a run tells while it goes on.
#[derive(Clone, Debug)]
pub enum Event {
    /// The run begins.
    Start {
        /// Pictures asked for.
        frames: usize,
        /// The output folder.
        folder: String,
        /// The devices' names.
        devices: Vec<String>,
    },
    /// A frame ended.
    Frame(Box<FrameReport>),
    /// Something is wrong that stops nothing; once per cause and file.
    Warning(Warning),
}
