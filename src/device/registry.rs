//! Which devices there are, and the one that a name means.

use super::cpu::CpuDevice;
use super::gpu::{Adapter, GpuDevice, adapters};
use super::{Device, DeviceError};
use crate::store::Store;
use rayon::ThreadPoolBuildError;
use std::sync::Arc;

/// What a device is opened with.
#[derive(Clone, Debug)]
pub struct Wanted {
    /// Threads that trace on the CPU and build trees for a GPU; 0: one for each core.
    pub threads: usize,
    /// Bytes that it may hold; None: what the device itself finds fit.
    pub budget_bytes: Option<u64>,
    /// That of devices in the host's memory, where nothing else is said.
    pub host_budget_bytes: u64,
    /// Where shapes of trees and compiled kernels are kept from run to run.
    pub store: Option<Arc<Store>>,
}

/// Why there is no such device.
#[derive(Debug, thiserror::Error)]
pub enum RegistryError {
    /// No device has that name.
    #[error("there is no device {0}; `rentix devices` lists those there are")]
    Unknown(String),
    /// No GPU is hardware.
    #[error("there is no GPU that is hardware{0}; `rentix devices` lists what there is")]
    NoHardware(String),
    /// More than one was named.
    #[error("{0}: a run has one device; one of these must be named")]
    Several(String),
    /// An adapter lacks something.
    #[error("{0}")]
    Lacks(String),
    /// It cannot be opened.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The system gives no threads.
    #[error("the system gives no threads: {0}; fewer may be asked for by --threads")]
    NoThreads(#[from] ThreadPoolBuildError),
}

/// Opens the device of a name: `cpu`, `gpu` (the best that is hardware), `gpu:N`; without a name, or for `all`, the best GPU
/// that is hardware and lacks nothing, else the CPU.
pub fn open(name: Option<&str>, wanted: &Wanted) -> Result<Box<dyn Device>, RegistryError> {
    match name {
        Some("cpu") => cpu(wanted),
        None | Some("all") => {
            let usable = |adapter: &Adapter| !adapter.is_software() && adapter.lacks().is_none();
            match adapters().iter().find(|a| usable(a)) {
                Some(adapter) => gpu(adapter, wanted),
                None => cpu(wanted),
            }
        }
        Some("gpu") => {
            let adapters = adapters();
            let program = |a: &Adapter| format!(" ({} is a program and is used where it is named)", a.name());
            let no_hardware = || RegistryError::NoHardware(adapters.first().map(program).unwrap_or_default());
            gpu(adapters.iter().find(|a| !a.is_software()).ok_or_else(no_hardware)?, wanted)
        }
        Some(list) if list.contains(',') => Err(RegistryError::Several(list.to_string())),
        Some(name) => {
            let is_named = |a: &&Adapter| a.name() == name;
            let unknown = || RegistryError::Unknown(name.to_string());
            if !name.starts_with("gpu:") {
                return Err(unknown());
            }
            gpu(adapters().iter().find(is_named).ok_or_else(unknown)?, wanted)
        }
    }
}

fn cpu(wanted: &Wanted) -> Result<Box<dyn Device>, RegistryError> {
    let budget_bytes = wanted.budget_bytes.unwrap_or(wanted.host_budget_bytes);
    Ok(Box::new(CpuDevice::new(wanted.threads, budget_bytes)?.with_store(wanted.store.clone())))
}

fn gpu(adapter: &Adapter, wanted: &Wanted) -> Result<Box<dyn Device>, RegistryError> {
    if let Some(lacks) = adapter.lacks() {
        return Err(RegistryError::Lacks(lacks));
    }
    let own = if adapter.is_software() { wanted.host_budget_bytes } else { adapter.default_budget_bytes() };
    let budget_bytes = wanted.budget_bytes.unwrap_or(own);
    Ok(Box::new(GpuDevice::with_store(adapter, wanted.threads, budget_bytes, wanted.store.clone())?))
}
