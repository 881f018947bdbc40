//! Frames that a device was given.

use super::estimate::DeviceWork;
use super::read::ReadFrame;
use crate::device::UpdateCost;
use crate::film::LatentFilm;
use crate::scene::{Frame, PartHash};
use std::sync::Arc;

/// A frame that was begun.
pub(super) struct UnderWay {
    pub(super) read: ReadFrame,
    /// Bytes of the host's memory, until it has left this stage.
    pub(super) bytes: u64,
    pub(super) begun: Begun,
    /// When that was, s.
    pub(super) begun_s: f64,
}

impl UnderWay {
    pub(super) fn not_begun(read: ReadFrame, bytes: u64) -> Self {
        Self { read, bytes, begun: Begun::default(), begun_s: 0.0 }
    }
}

/// What the device did for a frame before it could be traced.
#[derive(Clone, Debug, Default)]
pub(super) struct Begun {
    pub(super) work: DeviceWork,
    pub(super) cost: UpdateCost,
    /// Whether no tree of it or of its run was there.
    pub(super) is_start: bool,
}

/// A frame, and what came of it: None while it is under way.
pub(super) struct Before {
    pub(super) frame: Arc<Frame>,
    pub(super) fingerprint: PartHash,
    pub(super) film: Option<Arc<LatentFilm>>,
}
