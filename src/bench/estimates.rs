//! What the estimates are worth: every scene rendered as if never seen, after others that taught their rates.

use super::table::{Cell, Table};
use super::times::Spread;
use super::{Bench, BenchError, Event, Findings};
use crate::run::{Sources, read_frame};
use crate::schedule::estimate::Thesis;
use crate::warning::Warnings;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Frames after which a run's own measurements are to be enough.
const LEARNED_AFTER: usize = 10;
/// Smaller files are no scenes.
const LEAST_BYTES: u64 = 20_000;

pub(super) fn estimates(bench: &Bench, on_event: &mut dyn FnMut(&Event<'_>)) -> Result<Findings, BenchError> {
    let mut found = Findings::default();
    let inputs = bench.options.scenes.as_deref().map(inputs).unwrap_or_default();
    let inputs: Vec<_> = inputs.into_iter().step_by(if bench.options.quick { 6 } else { 1 }).collect();
    let mut table = Table::new(
        "estimates",
        format!(
            "How far off estimates are on the device {}, %, 640x360: of a warm frame's time on the device before the first frame, and after ten (median over frames); of what the device holds; of the process's memory. Thesis: its start and render over ours, times.",
            bench.options.device.as_deref().unwrap_or("that is best")
        ),
        &[
            "triangles",
            "warm, ms",
            "off before, %",
            "off after 10, %",
            "held, MB",
            "off before, %",
            "off after 10, %",
            "process, MB",
            "off before, %",
            "thesis, times",
        ],
    );
    let mut all: [Vec<f64>; 6] = Default::default();
    for input in &inputs {
        on_event(&Event::Stage(&input.display().to_string()));
        let Some(cells) = measured(bench, input)? else { continue };
        for (all, column) in all.iter_mut().zip([2, 3, 5, 6, 8, 9]) {
            all.extend(cells[column].value());
        }
        table.row(name(input), cells);
    }
    let [before, after, held, held_after, process, thesis] = all.map(|values| Cell::from(Spread::of(values)));
    let none = Cell::Absent;
    table.row("median", [none, none, before, after, none, held, held_after, none, process, thesis]);
    found.add(table, on_event);
    Ok(found)
}

/// Sequences, animations and single scenes in a folder of scenes, mixed: neighbours in the alphabet are alike.
fn inputs(scenes: &Path) -> Vec<PathBuf> {
    let list = |folder: &Path| -> Vec<PathBuf> {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        let mut paths: Vec<PathBuf> = entries.map(|e| e.path()).collect();
        paths.sort();
        paths
    };
    let mut inputs = Vec::new();
    for folder in list(scenes) {
        let is_sequence = folder.file_name().is_some_and(|n| n.to_string_lossy().starts_with("seq-"));
        if is_sequence {
            inputs.push(folder);
            continue;
        }
        let files =
            list(&folder).into_iter().flat_map(|path| if path.is_dir() { list(&path) } else { vec![path] });
        inputs.extend(files.filter(|file| {
            let is_scene = file.extension().is_some_and(|e| e == "obj" || e == "gltf" || e == "glb");
            is_scene && file.metadata().is_ok_and(|m| m.len() >= LEAST_BYTES)
        }));
    }
    // a stride without a common factor with their number takes each once
    let stride = (0..inputs.len()).rev().find(|s| s % 7 == 3 && gcd(*s, inputs.len()) == 1).unwrap_or(1);
    (0..inputs.len()).map(|i| inputs[i * stride % inputs.len()].clone()).collect()
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

fn name(input: &Path) -> String {
    input.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

/// A row; None where nothing can be rendered. Each scene has a process of its own, for its memory's sake.
fn measured(bench: &Bench, input: &Path) -> Result<Option<[Cell; 10]>, BenchError> {
    let Some(report) = report(bench, input)? else { return Ok(None) };
    let number = |value: &Value, path: &str| value.pointer(path).and_then(Value::as_f64);
    let frames: Vec<&Value> = report["frames"].as_array().into_iter().flatten().collect();
    let frames: Vec<&Value> = frames.into_iter().filter(|f| f["status"] == "rendered").collect();
    let Some(&first) = frames.first() else { return Ok(None) };
    let off = |expected: Option<f64>, is: Option<f64>| Some(100.0 * (expected? / is? - 1.0).abs());
    let median = |values: &mut dyn Iterator<Item = Option<f64>>| {
        Spread::of(values.flatten().collect()).map(|spread| spread.median)
    };
    let warm = || frames.iter().filter(|f| f["warm"] == true);
    let later = || frames.iter().skip(LEARNED_AFTER).filter(|f| f["warm"] == true);
    let trace = |f: &Value| number(f, "/ms/trace");
    let warm_ms = median(&mut warm().map(|f| trace(f))).or_else(|| trace(first));
    let on_device = |f: &Value, of: &str| {
        let term = |term: &str| number(f, &format!("/{of}/{term}"));
        Some(term("upload")? + term("update")? + term("trace")?)
    };
    let after = |f: &&Value| off(on_device(f, "predicted_ms"), on_device(f, "ms"));
    let held_off = |f: &Value| off(number(f, "/bytes/predicted"), number(f, "/bytes/resident"));
    let cold_ms =
        ["read", "parse", "upload", "update", "trace"].map(|term| number(first, &format!("/ms/{term}")));
    let cold_s = cold_ms.into_iter().flatten().sum::<f64>() / 1e3;
    let process = number(&report, "/totals/peak_rss_bytes");

    let job = bench.job(input, None)?;
    let (sources, warnings) = (Sources::default(), &mut Warnings::default());
    let frame = read_frame(&job, &job.pictures[0], &sources, true, warnings).map_err(BenchError::Frame)?;
    let vertices: usize = frame.objects.iter().map(|o| o.geometry.positions.0.len()).sum();
    let thesis = Thesis::new(vertices as u64, frame.texture_bytes() as f64 / 1e6);
    Ok(Some([
        number(first, "/triangles").into(),
        warm_ms.into(),
        off(number(first, "/predicted_ms/trace"), warm_ms).into(),
        median(&mut later().map(after)).into(),
        number(first, "/bytes/resident").map(|b| b / 1e6).into(),
        held_off(first).into(),
        median(&mut later().map(|f| held_off(f))).into(),
        process.map(|b| b / 1e6).into(),
        off(number(&report, "/totals/predicted_rss_bytes"), process).into(),
        ((thesis.start_s + thesis.render_s) / cold_s).into(),
    ]))
}

/// What a run of this program tells of an input; None where it tells nothing.
fn report(bench: &Bench, input: &Path) -> Result<Option<Value>, BenchError> {
    let room = bench.room.path();
    let report = room.join("report.json");
    let mut command = Command::new(std::env::current_exe()?);
    command.arg("render").arg(input).args(["--size", "640x360", "--overwrite", "--lenient", "--quiet"]);
    command.args(["--threads", &bench.options.threads.to_string()]);
    command.args(bench.options.device.iter().flat_map(|name| ["--device", name]));
    for (option, file) in [("-o", "pictures"), ("--cache", "rates"), ("--report", "report.json")] {
        command.arg(option).arg(room.join(file));
    }
    // what it cannot render it says, and the table goes on
    let _ = command.stdout(Stdio::null()).stderr(Stdio::null()).status()?;
    let told = std::fs::read(&report).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let _ = std::fs::remove_file(&report);
    Ok(told)
}
