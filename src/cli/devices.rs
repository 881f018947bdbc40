//! `rentix devices`.

use super::Global;
use crate::device::Device;
use crate::device::cpu::CpuDevice;
use crate::device::gpu::{Adapter, adapters};
use crate::run::machine;
use anyhow::Result;
use std::fmt::Write as _;
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
        out!("{line}");
    } else {
        err!(
            "{}  {}, {}, may hold {} (half of the free memory; --device-memory changes it)",
            info.name,
            machine::machine().cpu,
            info.description,
            gibibytes(info.budget_bytes)
        );
    }
    for adapter in adapters() {
        if global.json {
            out!("{}", as_json(&adapter));
        } else {
            err!("{}", for_people(&adapter));
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn budget_bytes(adapter: &Adapter) -> u64 {
    if adapter.is_software() { machine::default_budget_bytes() } else { adapter.default_budget_bytes() }
}

fn as_json(adapter: &Adapter) -> serde_json::Value {
    let [least, most] = adapter.subgroup_sizes();
    serde_json::json!({
        "name": adapter.name(), "kind": "gpu", "description": adapter.description(),
        "software": adapter.is_software(), "memory_bytes": adapter.memory_bytes(), "budget_bytes": budget_bytes(adapter),
        "buffer_bytes": adapter.binding_bytes(), "subgroup": {"least": least, "most": most},
        "features": adapter.features(), "lacks": adapter.lacks(),
    })
}

fn for_people(adapter: &Adapter) -> String {
    let mut text = format!("{}  {}", adapter.name(), adapter.description());
    if let Some(lacks) = adapter.lacks() {
        return format!("{text}\n       cannot be used: {lacks}");
    }
    if let Some(bytes) = adapter.memory_bytes() {
        let _ = write!(text, ", {} of memory", gibibytes(bytes));
    }
    let _ = write!(text, ", may hold {}", gibibytes(budget_bytes(adapter)));
    if adapter.is_software() {
        text.push_str(" (used only where it is named)");
    }
    let [least, most] = adapter.subgroup_sizes();
    let threads = if least == most { least.to_string() } else { format!("{least} to {most}") };
    let mut uses = vec![
        format!("buffers up to {}", gibibytes(adapter.binding_bytes())),
        format!("{threads} threads in step"),
    ];
    uses.extend(adapter.features().into_iter().map(String::from));
    format!("{text}\n       {}", uses.join(", "))
}

fn gibibytes(bytes: u64) -> String {
    format!("{:.1} GiB", bytes as f64 / f64::from(1 << 30))
}
