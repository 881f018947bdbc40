//! What a sequence is expected to cost, as `inspect` tells it.

use crate::bench::Cell;
use crate::device::DeviceInfo;
use crate::run::Forecast;
use crate::schedule::estimate::{Expected, Thesis};

/// Tells what the frames of a sequence are expected to cost, by its last one.
pub(super) fn tell_costs(
    sequence: &str,
    thesis: &Thesis,
    devices: &[DeviceInfo],
    costs: &[Forecast],
    as_json: bool,
) {
    if as_json {
        for (device, c) in devices.iter().zip(costs) {
            let ms = |e: Expected| serde_json::json!({"expected": 1e3 * e.value, "error": 1e3 * e.error});
            let line = serde_json::json!({
                "sequence": sequence, "device": device.name,
                "ms": {"read": ms(c.read), "parse": ms(c.parse), "load": ms(c.load), "update": ms(c.update),
                       "trace": ms(c.trace), "encode": ms(c.encode), "write": ms(c.write),
                       "cold": ms(c.cold()), "warm": ms(c.warm())},
                "resident": {"expected": c.resident.value, "error": c.resident.error, "budget": device.budget_bytes},
                "thesis": {"start_ms": 1e3 * thesis.start_s, "render_ms": 1e3 * thesis.render_s,
                           "host_bytes": 1e6 * thesis.host_mb, "device_bytes": 1e6 * thesis.device_mb},
            });
            out!("{line}");
        }
        return;
    }
    let names = devices.iter().map(|d| d.name.chars().count()).max().unwrap_or(0).max(6);
    out!("expected, ms");
    let terms =
        ["read", "parse", "load", "update", "trace", "encode", "write"].map(|term| format!(" {term:>7}"));
    out!(
        "{:names$}{} {:>16} {:>16} {:>16}",
        "",
        terms.concat(),
        "first frame",
        "next, on device",
        "resident, MB"
    );
    for (device, c) in devices.iter().zip(costs) {
        let terms = [c.read, c.parse, c.load, c.update, c.trace, c.encode, c.write];
        let terms = terms.map(|e| format!(" {:>7}", Cell::Number(1e3 * e.value)));
        let with_error = |e: Expected, unit: f64| {
            format!("{} ± {}", Cell::Number(e.value / unit), Cell::Number(e.error / unit))
        };
        out!(
            "{:names$}{} {:>16} {:>16} {:>16}",
            device.name,
            terms.concat(),
            with_error(c.cold(), 1e-3),
            with_error(c.warm(), 1e-3),
            with_error(c.resident, 1e6)
        );
    }
    out!(
        "by the formulas of the thesis of 2012: start {}, render {}; memory of the host {} MB, of the device {} MB",
        Cell::Number(1e3 * thesis.start_s),
        Cell::Number(1e3 * thesis.render_s),
        Cell::Number(thesis.host_mb),
        Cell::Number(thesis.device_mb)
    );
    for (device, c) in devices.iter().zip(costs) {
        if c.resident.value > device.budget_bytes as f64 {
            out!(
                "{} may hold {} MB: the frames will be refused there (raise --device-memory, or use another device)",
                device.name,
                Cell::Number(device.budget_bytes as f64 / 1e6)
            );
        }
    }
}
