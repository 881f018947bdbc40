//! Runs of this program as processes of their own, for their memory and their start.

use super::{Bench, BenchError};
use serde_json::Value;
use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Stdio};

/// Renders an input and gives the run's report, which is kept at `report`; None where the run tells nothing.
pub(super) fn render(
    bench: &Bench,
    input: &Path,
    report: &Path,
    options: &[&OsStr],
) -> Result<Option<Value>, BenchError> {
    let _ = std::fs::remove_file(report);
    let mut command = Command::new(&bench.options.program);
    command.arg("render").arg(input).args(options).arg("--report").arg(report);
    command.args(["--overwrite", "--lenient", "--quiet", "--threads", &bench.options.threads.to_string()]);
    command.arg("-o").arg(bench.room.path().join("pictures"));
    // what it cannot render it says, and the table goes on
    let _ = command.stdout(Stdio::null()).stderr(Stdio::null()).status()?;
    Ok(std::fs::read(report).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok()))
}

/// The frames of a report that were rendered.
pub(super) fn rendered(report: &Value) -> Vec<&Value> {
    report["frames"].as_array().into_iter().flatten().filter(|f| f["status"] == "rendered").collect()
}

/// The sum of those of some terms of a frame that there are, ms.
pub(super) fn sum_ms(frame: &Value, of: &str, terms: &[&str]) -> f64 {
    terms.iter().filter_map(|term| frame[of][term].as_f64()).sum()
}
