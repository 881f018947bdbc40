//! What machine this is and what the process took of it. Zero or empty where the system does not tell.

use serde::Serialize;

/// The machine a run was made on.
#[derive(Clone, Debug, Serialize)]
pub struct Machine {
    /// The processor's model.
    pub cpu: String,
    /// Cores that the process may use.
    pub cores: usize,
    /// Memory in bytes.
    pub memory_bytes: u64,
}

/// Describes this machine.
pub fn machine() -> Machine {
    let cpu = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpu.lines().find_map(|l| l.strip_prefix("model name")).and_then(|l| l.split_once(':'));
    Machine {
        cpu: model.map_or_else(|| std::env::consts::ARCH.to_string(), |(_, name)| name.trim().to_string()),
        cores: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        memory_bytes: kib_field("/proc/meminfo", "MemTotal:"),
    }
}

/// Memory that can still be had, in bytes.
pub fn available_memory_bytes() -> u64 {
    kib_field("/proc/meminfo", "MemAvailable:")
}

/// The most memory that this process ever had resident, in bytes.
pub fn peak_rss_bytes() -> u64 {
    kib_field("/proc/self/status", "VmHWM:")
}

/// The memory that this process has resident now, in bytes.
pub fn rss_bytes() -> u64 {
    kib_field("/proc/self/status", "VmRSS:")
}

/// What the CPU device may hold unless told otherwise: half of the free memory, 1 GiB where that is not known.
pub fn default_budget_bytes() -> u64 {
    match available_memory_bytes() {
        0 => 1 << 30,
        free => free / 2,
    }
}

fn kib_field(file: &str, field: &str) -> u64 {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    let value = text.lines().find_map(|l| l.strip_prefix(field)).and_then(|l| l.split_whitespace().next());
    value.and_then(|v| v.parse::<u64>().ok()).map_or(0, |kib| kib * 1024)
}
