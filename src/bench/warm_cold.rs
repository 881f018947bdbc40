//! The workload `warm-cold`: what a frame costs when everything is new and when it follows another, beside the thesis's own
//! figures for its scenes.

use super::dots::Dots;
use super::scenes::quoted;
use super::sequences::TWIST;
use super::table::{Cell, Table};
use super::times::Spread;
use super::{Bench, BenchError, Event, Findings, child};
use crate::device::gpu::adapters;
use crate::job::FrameSet;
use serde_json::Value;
use std::ffi::{OsStr, OsString};
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

/// The thesis's scenes that can be had, their files, and its table 6.5 (device 1, 1280x720): start, cold, warm, save in seconds.
const THESIS: [(&str, &str, [f64; 4]); 11] = [
    ("CornellBox-Empty", "cornell-box/CornellBox-Empty-CO.obj", [1.1438, 0.0111, 0.0042, 0.0253]),
    ("CornellBox-Original", "cornell-box/CornellBox-Original.obj", [1.1459, 0.0133, 0.0049, 0.0252]),
    ("CornellBox-Mirror", "cornell-box/CornellBox-Mirror.obj", [1.1484, 0.0137, 0.0053, 0.0253]),
    ("Monkey", "suzanne/suzanne.obj", [1.1168, 0.0320, 0.0062, 0.0253]),
    ("CornellBox-Glossy", "cornell-box/CornellBox-Glossy.obj", [1.1484, 0.0373, 0.0053, 0.0248]),
    ("CornellBox-Sphere", "cornell-box/CornellBox-Sphere.obj", [1.1552, 0.0695, 0.0119, 0.0254]),
    ("CornellBox-Water", "cornell-box/CornellBox-Water.obj", [1.1674, 0.2322, 0.0240, 0.0255]),
    ("Dragon", "dragon/dragon_23k.obj", [1.2858, 1.1295, 0.0116, 0.0282]),
    ("Bunny", "bunny/stanford-bunny.obj", [1.2980, 1.5491, 0.0060, 0.0257]),
    ("Sibenik", "sibenik/sibenik.obj", [2.0187, 1.3758, 0.0253, 0.0373]),
    ("Conference", "conference/conference.obj", [2.5607, 2.4926, 0.0217, 0.0312]),
];

/// Frames of a still scene, and of a sequence at most.
const FRAMES: usize = 9;
/// Side and frames of the made sequence.
const SIDE: u32 = 100;
const MADE_FRAMES: u32 = 9;

/// Terms of a frame's time: before the device, on it in the first frame and in another, and after it.
const START: [&str; 2] = ["read", "parse"];
const FIRST: [&str; 3] = ["upload", "update", "trace"];
const AFTER: [&str; 6] = ["read", "parse", "diff", "upload", "update", "trace"];
const SAVE: [&str; 2] = ["encode", "write"];

/// What is rendered, and the thesis's figures for it.
struct Input {
    name: String,
    path: PathBuf,
    /// The numbers of its frames that are rendered, as an option; empty: all.
    frames: String,
    thesis: Option<[f64; 4]>,
}

/// Runs it.
pub(super) fn warm_cold(bench: &Bench, on_event: &mut dyn FnMut(&Event<'_>)) -> Result<Findings, BenchError> {
    let mut table = Table::new(
        "warm-cold",
        "A frame, 1280x720, one sample, each run in a process of its own: start (reading, parsing), and with a warm store; the first frame on the device; a frame after it, its own reading included; saving; cold over warm: (start + first)/after. Beside it the thesis's figures for its scenes on its machine of 2012.",
        &[
            "start, ms",
            "with store, ms",
            "first, ms",
            "after, ms",
            "save, ms",
            "process, MB",
            "device, MB",
            "cold/warm",
            "thesis start, ms",
            "first, ms ",
            "after, ms ",
            "save, ms ",
            "cold/warm ",
        ],
    );
    let devices = devices(bench);
    for input in inputs(bench)? {
        for device in &devices {
            let name =
                if devices.len() == 1 { input.name.clone() } else { format!("{}, {device}", input.name) };
            on_event(&Event::Stage(&name));
            match measured(bench, &input, device)? {
                Ok(cells) => table.row(name, cells),
                Err(why) => on_event(&Event::LeftOut(&name, &why)),
            }
        }
    }
    let mut found = Findings::default();
    let columns = [
        (0, "start"),
        (2, "first frame"),
        (3, "a frame after it"),
        (8, "start, 2012"),
        (10, "a frame after it, 2012"),
    ];
    let title = "Cold and warm";
    found.draw(&Dots { name: "warm-cold", table: &table, title, unit: "ms", columns: &columns })?;
    found.add(table, on_event);
    Ok(found)
}

/// The device that was named; else the CPU and every GPU that is hardware.
fn devices(bench: &Bench) -> Vec<String> {
    let named = bench.options.device.clone();
    named.map_or_else(
        || {
            let usable = adapters().into_iter().filter(|a| !a.is_software() && a.lacks().is_none());
            ["cpu".to_string()].into_iter().chain(usable.map(|a| a.name())).collect()
        },
        |name| vec![name],
    )
}

/// Still scenes as jobs of a few frames that differ in nothing but a shade of ambient light, and sequences.
fn inputs(bench: &Bench) -> Result<Vec<Input>, BenchError> {
    let mut inputs = Vec::new();
    for (name, file, thesis) in THESIS {
        let Some(path) = bench.scene(file) else { continue };
        let job = bench.room.path().join(format!("{name}.yaml"));
        let mut text =
            format!("version: 1\nlayers:\n  - sequence: {}\nframes: 1-{FRAMES}\noverrides:\n", quoted(&path));
        for frame in 1..=FRAMES {
            let ambient = 0.1 + 1e-4 * frame as f64;
            let _ = writeln!(text, "  - {{frames: {frame}-{frame}, ambient: {ambient:.4}}}");
        }
        fs::write(&job, text)?;
        inputs.push(Input { name: name.to_string(), path: job, frames: String::new(), thesis: Some(thesis) });
    }
    let folders =
        bench.options.scenes.iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten().flatten();
    let mut sequences: Vec<PathBuf> = folders.map(|e| e.path()).collect();
    sequences.retain(|path| {
        path.is_dir() && path.file_name().is_some_and(|n| n.to_string_lossy().starts_with("seq-"))
    });
    sequences.sort();
    let folder = bench.room.path().join("made sheet");
    TWIST.write(SIDE, MADE_FRAMES, &folder)?;
    sequences.push(folder);
    for path in sequences {
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let pictures = bench.job(&path, None)?.pictures;
        let numbers: Vec<i64> = pictures.iter().take(FRAMES).filter_map(|p| p.frame).collect();
        let frames = FrameSet::from_numbers(&numbers).to_string();
        inputs.push(Input { name, path, frames, thesis: None });
    }
    let step = if bench.options.quick { 4 } else { 1 };
    Ok(inputs.into_iter().step_by(step).collect())
}

/// A row; or why nothing is rendered.
fn measured(bench: &Bench, input: &Input, device: &str) -> Result<Result<[Cell; 13], String>, BenchError> {
    let store = bench.room.path().join("store");
    let run = |kept: bool| {
        let cache: OsString = if kept { store.clone().into() } else { "--no-cache".into() };
        let mut options: Vec<&OsStr> = ["--size", "1280x720", "--device", device].map(OsStr::new).to_vec();
        if !input.frames.is_empty() {
            options.extend(["--frames", &input.frames].map(OsStr::new));
        }
        if kept {
            options.push(OsStr::new("--cache"));
        }
        options.push(&cache);
        child::render(bench, &input.path, &bench.room.path().join("report.json"), &options)
    };
    let mut ms: [Vec<f64>; 5] = Default::default();
    let mut bytes: [Vec<f64>; 2] = Default::default();
    if let Err(why) = run(true)? {
        return Ok(Err(why));
    }
    for _ in 0..bench.rounds(8).max(3) {
        let (report, with_store) = match (run(false)?, run(true)?) {
            (Ok(report), Ok(with_store)) => (report, with_store),
            (Err(why), _) | (_, Err(why)) => return Ok(Err(why)),
        };
        let (frames, kept) = (child::rendered(&report), child::rendered(&with_store));
        // a file that all frames show is read once, by whichever reader comes first
        let start_of = |frames: &[&Value]| {
            let read = frames.iter().map(|f| child::sum_ms(f, "ms", &START));
            if input.thesis.is_some() { read.fold(0.0, f64::max) } else { read.take(1).sum() }
        };
        let after = frames.iter().skip(1).map(|f| child::sum_ms(f, "ms", &AFTER)).collect();
        let save = frames.iter().map(|f| child::sum_ms(f, "ms", &SAVE)).collect();
        let medians = [after, save].map(|all| Spread::of(all).map(|s| s.median));
        let [Some(after), Some(save)] = medians else {
            return Ok(Err("no frame follows the first one".to_string()));
        };
        let of_first = [start_of(&frames), start_of(&kept), child::sum_ms(frames[0], "ms", &FIRST)];
        ms.iter_mut().zip(of_first.into_iter().chain([after, save])).for_each(|(all, x)| all.push(x));
        let held = [&report["totals"]["peak_rss_bytes"], &report["devices"][0]["resident"]["peak"]];
        bytes.iter_mut().zip(held).for_each(|(all, x)| all.extend(x.as_f64().map(|b| b / 1e6)));
    }
    let [start, kept, first, after, save] = ms.map(|all| Cell::from(Spread::of(all)));
    let [process, device] = bytes.map(|all| Cell::from(Spread::of(all).map(|s| s.median)));
    let ratio_of = |values: [Option<f64>; 3]| match values {
        [Some(start), Some(first), Some(after)] if after > 0.0 => Cell::from((start + first) / after),
        _ => Cell::Absent,
    };
    let then = |i: usize| input.thesis.map(|t| t[i] * 1e3);
    Ok(Ok([
        start,
        kept,
        first,
        after,
        save,
        process,
        device,
        ratio_of([start.value(), first.value(), after.value()]),
        then(0).into(),
        then(1).into(),
        then(2).into(),
        then(3).into(),
        ratio_of([then(0), then(1), then(2)]),
    ]))
}
