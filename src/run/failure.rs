//! Why a device made no film.

use super::panic_text;
use crate::device::DeviceError;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Why there is no film: an error of the device, or the text of a panic.
pub(super) enum Failure {
    Device(DeviceError),
    Panic(String),
}

impl Failure {
    pub(super) fn is_lost(&self) -> bool {
        matches!(self, Self::Device(DeviceError::Lost { .. }))
    }

    /// Whether it may go well on a device that holds nothing else.
    pub(super) fn is_for_want_of_room(&self) -> bool {
        let Self::Device(error) = self else { return false };
        matches!(
            error,
            DeviceError::MemoryFull { .. }
                | DeviceError::BufferTooLarge { .. }
                | DeviceError::NotResident { .. }
        )
    }

    /// Whether what the device holds is what its residency says.
    pub(super) fn left_all_as_told(&self) -> bool {
        let Self::Device(error) = self else { return false };
        matches!(
            error,
            DeviceError::Stopped | DeviceError::OutOfMemory { .. } | DeviceError::BufferTooLarge { .. }
        )
    }
}

/// What a call into a device gives, be it a panic.
pub(super) fn caught<T>(what: &str, call: impl FnOnce() -> Result<T, DeviceError>) -> Result<T, Failure> {
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(done) => done.map_err(Failure::Device),
        Err(panic) => Err(Failure::Panic(panic_text(what, &*panic))),
    }
}
