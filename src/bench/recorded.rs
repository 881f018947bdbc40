//! Traces of what was measured: each run's report is a job, as it was and as it was thought to be before its first frame.

use super::child;
use super::times::Spread;
use crate::schedule::simulation::{Trace, TraceDevice, TraceJob};
use serde_json::Value;
use std::path::Path;

/// Devices of a recorded trace.
const DEVICES: usize = 4;

/// The reports of a folder as jobs that come at once, in so many orders; none where there are none.
pub(super) fn traces(reports: &Path, orders: usize) -> Vec<Trace> {
    let mut files: Vec<_> =
        std::fs::read_dir(reports).into_iter().flatten().flatten().map(|e| e.path()).collect();
    files.sort();
    let jobs: Vec<TraceJob> = files.iter().filter_map(|file| job(file)).collect();
    let device = TraceDevice { speed: 1.0, budget_bytes: u64::MAX, slows: None, fails_s: None };
    let trace = |order: usize| {
        let mut jobs = jobs.clone();
        let count = jobs.len();
        jobs.rotate_left(order * count / orders.max(1));
        Trace { jobs, devices: vec![device; DEVICES] }
    };
    if jobs.is_empty() { Vec::new() } else { (0..orders).map(trace).collect() }
}

fn job(report: &Path) -> Option<TraceJob> {
    let report: Value = serde_json::from_slice(&std::fs::read(report).ok()?).ok()?;
    let frames = child::rendered(&report);
    let seconds = |f: &Value, of: &str, terms: &[&str]| child::sum_ms(f, of, terms) / 1e3;
    let first = frames.first()?;
    let warm = |terms: &[&str]| {
        let warm = frames.iter().filter(|f| f["warm"] == true);
        let spread = Spread::of(warm.map(|f| seconds(f, "ms", terms)).collect());
        spread.map_or_else(|| seconds(first, "ms", &["trace"]), |spread| spread.median)
    };
    let cold_s = seconds(first, "ms", &["read", "parse", "upload", "update"]);
    let thought = |terms: &[&str], is: f64| (seconds(first, "predicted_ms", terms) / is.max(1e-9)).max(1e-3);
    Some(TraceJob {
        arrives_s: 0.0,
        frames: frames.len() as u64,
        warm_s: warm(&["upload", "update", "trace"]),
        cold_s,
        bytes: report["devices"][0]["resident"]["peak"].as_u64()?,
        seen: [
            thought(&["trace"], warm(&["trace"])),
            thought(&["read", "parse", "upload", "update"], cold_s),
        ],
        deadline_s: None,
    })
}
