//! What the estimates are worth: every scene rendered as if never seen, after others that taught their rates.

use super::scenes::{Scene, scenes};
use super::table::{Cell, Table};
use super::times::Spread;
use super::{Bench, BenchError, Event, Findings, REPORTS, child};
use crate::run::{Sources, read_frame};
use crate::schedule::estimate::Thesis;
use crate::warning::Warnings;
use serde_json::Value;
use std::ffi::OsStr;
use std::fs;

/// Frames after which a run's own measurements are to be enough.
const LEARNED_AFTER: usize = 10;

pub(super) fn estimates(bench: &Bench, on_event: &mut dyn FnMut(&Event<'_>)) -> Result<Findings, BenchError> {
    let mut found = Findings::default();
    let inputs: Vec<_> = scenes(bench.options.scenes.as_deref())
        .into_iter()
        .step_by(if bench.options.quick { 6 } else { 1 })
        .collect();
    let mut table = Table::new(
        "estimates",
        format!(
            "How far off estimates are on the device {}, %, 640x360: before the first frame, of what a warm frame takes to trace; after ten frames, of its whole time on the device (median over frames); of what the device holds; of the process's memory. Thesis: its start and render over ours, times.",
            bench.options.device.as_deref().unwrap_or("that is best")
        ),
        &[
            "triangles",
            "trace, ms",
            "trace off before, %",
            "frame off after 10, %",
            "held, MB",
            "held off before, %",
            "held off after 10, %",
            "process, MB",
            "process off before, %",
            "thesis, times",
        ],
    );
    let mut all: [Vec<f64>; 6] = Default::default();
    // those of an earlier run may be of other scenes
    let _ = fs::remove_dir_all(bench.options.folder.join(REPORTS));
    for input in &inputs {
        on_event(&Event::Stage(&input.name));
        let cells = match measured(bench, input)? {
            Ok(cells) => cells,
            Err(why) => {
                on_event(&Event::LeftOut(&input.name, &why));
                continue;
            }
        };
        for (all, column) in all.iter_mut().zip([2, 3, 5, 6, 8, 9]) {
            all.extend(cells[column].value());
        }
        table.row(input.name.clone(), cells);
    }
    let [before, after, held, held_after, process, thesis] = all.map(|values| Cell::from(Spread::of(values)));
    let none = Cell::Absent;
    table.row("median", [none, none, before, after, none, held, held_after, none, process, thesis]);
    found.add(table, on_event);
    Ok(found)
}

/// A row; or why nothing can be rendered. Each scene has a process of its own, for its memory's sake.
fn measured(bench: &Bench, input: &Scene) -> Result<Result<[Cell; 10], String>, BenchError> {
    let reports = bench.options.folder.join(REPORTS);
    fs::create_dir_all(&reports)?;
    let rates = bench.room.path().join("rates");
    let mut options: Vec<&OsStr> = ["--size", "640x360", "--cache"].map(OsStr::new).to_vec();
    options.push(rates.as_os_str());
    if let Some(name) = &bench.options.device {
        options.extend(["--device", name].map(OsStr::new));
    }
    let report = reports.join(format!("{}.json", input.name.replace('/', "-")));
    let report = match child::render(bench, &input.path, &report, &options)? {
        Ok(report) => report,
        Err(why) => return Ok(Err(why)),
    };
    let number = |value: &Value, path: &str| value.pointer(path).and_then(Value::as_f64);
    let frames = child::rendered(&report);
    let first = frames[0];
    let off = |expected: Option<f64>, is: Option<f64>| Some(100.0 * (expected? / is? - 1.0).abs());
    let median = |values: &mut dyn Iterator<Item = Option<f64>>| {
        Spread::of(values.flatten().collect()).map(|spread| spread.median)
    };
    let warm = || frames.iter().filter(|f| f["warm"] == true);
    let later = || frames.iter().skip(LEARNED_AFTER).filter(|f| f["warm"] == true);
    let trace = |f: &Value| number(f, "/ms/trace");
    let warm_ms = median(&mut warm().map(|f| trace(f))).or_else(|| trace(first));
    let on_device = |f: &Value, of: &str| Some(child::sum_ms(f, of, &["upload", "update", "trace"]));
    let after = |f: &&Value| off(on_device(f, "predicted_ms"), on_device(f, "ms"));
    let held_off = |f: &Value| off(number(f, "/bytes/predicted"), number(f, "/bytes/resident"));
    let cold_s = child::sum_ms(first, "ms", &["read", "parse", "upload", "update", "trace"]) / 1e3;
    let process = number(&report, "/totals/peak_rss_bytes");

    let job = bench.job(&input.path, None)?;
    let (sources, warnings) = (Sources::default(), &mut Warnings::default());
    // the first that can be read, as the report's
    let read = |picture| read_frame(&job, picture, &sources, true, warnings).ok();
    let Some(frame) = job.pictures.iter().find_map(read) else {
        return Ok(Err("no frame can be read again".to_string()));
    };
    let vertices: usize = frame.objects.iter().map(|o| o.geometry.positions.0.len()).sum();
    let thesis = Thesis::new(vertices as u64, frame.texture_bytes() as f64 / 1e6);
    Ok(Ok([
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
