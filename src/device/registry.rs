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
    #[error("there is no device `{0}`; `rentix devices` lists those there are")]
    Unknown(String),
    /// No GPU is hardware.
    #[error("there is no GPU that is hardware{0}; `rentix devices` lists what there is")]
    NoHardware(String),
    /// It was named twice.
    #[error("{0} is named twice; `cpu/2` makes two devices of the CPU's cores")]
    Twice(String),
    /// The CPU cannot be split so.
    #[error("{0}: the CPU is split as cpu/2, cpu/3 and so on up to its {1} threads")]
    Split(String, usize),
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

/// Opens the devices of a list: names as [`open`] takes them, `cpu/N`: N devices that share the CPU's cores and its budget,
/// and `all`: every GPU that is hardware and lacks nothing, and the CPU. Without a list the one that [`open`] takes unasked.
///
/// # Errors
/// Where one is not there, cannot be opened, or is named twice.
pub fn open_all(list: Option<&str>, wanted: &Wanted) -> Result<Vec<Box<dyn Device>>, RegistryError> {
    let Some(list) = list else { return Ok(vec![open(None, wanted)?]) };
    let mut devices: Vec<Box<dyn Device>> = Vec::new();
    for name in list.split(',').map(str::trim) {
        let more = match name.strip_prefix("cpu/") {
            Some(parts) => split_cpu(name, parts, wanted)?,
            None if name == "all" => {
                let adapters = adapters();
                let gpus = adapters.iter().filter(|a| is_usable(a)).map(|adapter| gpu(adapter, wanted));
                gpus.chain([cpu(wanted)]).collect::<Result<_, _>>()?
            }
            None => vec![open(Some(name), wanted)?],
        };
        for device in more {
            let name = &device.info().name;
            if devices.iter().any(|d| d.info().name == *name) {
                return Err(RegistryError::Twice(name.clone()));
            }
            devices.push(device);
        }
    }
    Ok(devices)
}

fn is_usable(adapter: &Adapter) -> bool {
    !adapter.is_software() && adapter.lacks().is_none()
}

fn split_cpu(name: &str, parts: &str, wanted: &Wanted) -> Result<Vec<Box<dyn Device>>, RegistryError> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = if wanted.threads == 0 { cores } else { wanted.threads };
    let parts: usize = parts.parse().unwrap_or(0);
    if parts == 0 || parts > threads {
        return Err(RegistryError::Split(name.to_string(), threads));
    }
    let budget_bytes = wanted.budget_bytes.unwrap_or(wanted.host_budget_bytes) / parts as u64;
    let part = |i: usize| {
        let threads = threads / parts + usize::from(i < threads % parts);
        let device = CpuDevice::new(threads, budget_bytes)?.with_store(wanted.store.clone());
        Ok(Box::new(device.named(format!("cpu:{i}"))) as Box<dyn Device>)
    };
    (0..parts).map(part).collect()
}

/// Opens the device of a name: `cpu`, `gpu` (the best that is hardware), `gpu:N`; without a name the best GPU that is hardware
/// and lacks nothing, else the CPU.
pub fn open(name: Option<&str>, wanted: &Wanted) -> Result<Box<dyn Device>, RegistryError> {
    match name {
        Some("cpu") => cpu(wanted),
        None => match adapters().iter().find(|a| is_usable(a)) {
            Some(adapter) => gpu(adapter, wanted),
            None => cpu(wanted),
        },
        Some("gpu") => {
            let adapters = adapters();
            let program = |a: &Adapter| format!(" ({} is a program and is used where it is named)", a.name());
            let no_hardware = || RegistryError::NoHardware(adapters.first().map(program).unwrap_or_default());
            gpu(adapters.iter().find(|a| !a.is_software()).ok_or_else(no_hardware)?, wanted)
        }
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
