//! `rentix devices`.

use super::Global;
use crate::device::Device;
use crate::device::cpu::CpuDevice;
use crate::run::machine;
use anyhow::Result;
use std::process::ExitCode;

/// Lists what can render.
pub(super) fn devices(global: &Global) -> Result<ExitCode> {
    let device = CpuDevice::new(machine::machine().cores, machine::default_budget_bytes())?;
    let info = device.info();
    if global.json {
        let line = serde_json::json!({
            "name": info.name, "kind": info.kind.word(), "description": info.description,
            "threads": info.threads, "budget_bytes": info.budget_bytes,
        });
        println!("{line}");
    } else {
        eprintln!(
            "{}  {}  {}, may hold {:.1} GiB (half of the free memory; --device-memory changes it)",
            info.name,
            machine::machine().cpu,
            info.description,
            info.budget_bytes as f64 / f64::from(1 << 30)
        );
    }
    Ok(ExitCode::SUCCESS)
}
