//! Runs of this program as processes of their own, for their memory and their start.

use super::{Bench, BenchError};
use serde_json::Value;
use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Stdio};

/// Renders an input and gives the run's report, which is kept at `report`; or why there is none, where the run says so.
pub(super) fn render(
    bench: &Bench,
    input: &Path,
    report: &Path,
    options: &[&OsStr],
) -> Result<Result<Value, String>, BenchError> {
    let _ = std::fs::remove_file(report);
    let mut command = Command::new(&bench.options.program);
    command.arg("render").arg(input).args(options).arg("--report").arg(report);
    command.args(["--overwrite", "--lenient", "--quiet", "--threads", &bench.options.threads.to_string()]);
    command.arg("-o").arg(bench.room.path().join("pictures"));
    let output = command.stdout(Stdio::null()).output()?;
    let report: Option<Value> =
        std::fs::read(report).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let told = String::from_utf8_lossy(&output.stderr);
    let why = || told.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it says nothing").to_string();
    Ok(report.filter(|report| !rendered(report).is_empty()).ok_or_else(why))
}

/// The frames of a report that were rendered.
pub(super) fn rendered(report: &Value) -> Vec<&Value> {
    report["frames"].as_array().into_iter().flatten().filter(|f| f["status"] == "rendered").collect()
}

/// The sum of those of some terms of a frame that there are, ms.
pub(super) fn sum_ms(frame: &Value, of: &str, terms: &[&str]) -> f64 {
    terms.iter().filter_map(|term| frame[of][term].as_f64()).sum()
}
