//! The devices of a process, which several runs may share at once.

use super::report::DeviceReport;
use super::share::Hub;
use crate::device::{Device, DeviceInfo};
use crate::schedule::{DeviceFacts, Policy};
use parking_lot::{FairMutex, FairMutexGuard};
use std::time::Duration;

/// Devices, and who has which of them when.
pub struct Fleet {
    devices: Vec<Shared>,
    pub(super) hub: Hub,
}

/// A device that runs take in turns, in the order in which they ask: each has it while frames of it are under way.
pub(super) struct Shared {
    pub(super) info: DeviceInfo,
    held: FairMutex<Held>,
}

/// A device while a run has it.
pub(super) struct Held {
    pub(super) device: Box<dyn Device>,
    /// Whether what it holds is not to be trusted, because it panicked.
    pub(super) forget: bool,
}

impl Fleet {
    /// Takes devices; frames are shared out over them by a policy.
    pub fn new(devices: Vec<Box<dyn Device>>, policy: Policy) -> Self {
        // what two devices take for a frame is never quite the same
        let budgets = devices.iter().map(|device| device.info().budget_bytes);
        let facts: Vec<_> =
            budgets.enumerate().map(|(kind, budget_bytes)| DeviceFacts { budget_bytes, kind }).collect();
        let shared = |device: Box<dyn Device>| Shared {
            info: device.info().clone(),
            held: FairMutex::new(Held { device, forget: false }),
        };
        Self { devices: devices.into_iter().map(shared).collect(), hub: Hub::new(policy, &facts) }
    }

    /// What the devices are.
    pub fn reports(&self) -> Vec<DeviceReport> {
        self.devices.iter().map(|device| DeviceReport::new(&device.info)).collect()
    }

    pub(super) fn devices(&self) -> &[Shared] {
        &self.devices
    }
}

impl Shared {
    /// Waits until no other run has it.
    pub(super) fn take(&self) -> FairMutexGuard<'_, Held> {
        self.held.lock()
    }

    /// The same, for so long.
    pub(super) fn take_within(&self, time: Duration) -> Option<FairMutexGuard<'_, Held>> {
        self.held.try_lock_for(time)
    }
}
