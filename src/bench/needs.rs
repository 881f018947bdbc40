//! The workload `needs`: what each feature costs a scene that has it and does not use it, and one that does. The scene is a sheet
//! that is twisted; beside it stands the same without.

use super::dots::Dots;
use super::scenes::quoted;
use super::table::{Cell, Table};
use super::times::Spread;
use super::{Bench, BenchError, Event, Findings};
use crate::device::cpu::CpuDevice;
use crate::device::{Device, DeviceError, Stop};
use crate::plan::{Wishes, plan_frame};
use crate::run::{RunOptions, read_shot};
use crate::scene::{Aov, AovSet, Filter, Frame, Light, Shot};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

const SIDE: u32 = 100;
const SIZE: [u32; 2] = [640, 360];
/// Rounds: what differs by hundredths is to be told apart.
const ROUNDS: usize = 21;

/// Materials: the sheet's own, and one that a feature needs.
const PLAIN: &str = "newmtl sheet\nKd 0.6 0.5 0.4\nillum 2\n";
const MIRROR: &str = "newmtl other\nKd 0.2 0.2 0.2\nKs 0.7 0.7 0.7\nillum 3\n";
const GLASS: &str = "newmtl other\nKd 0 0 0\nKs 0.1 0.1 0.1\nTf 0.9 0.9 0.9\nNi 1.5\nillum 7\n";
const TEXTURED: &str = "newmtl other\nKd 0.6 0.5 0.4\nmap_Kd checks.ppm\nillum 2\n";
const GLOWING: &str = "newmtl other\nKd 0.6 0.5 0.4\nKe 0.2 0.2 0.2\nillum 2\n";

/// A scene made for a feature.
#[derive(Clone, Copy)]
struct Made<'a> {
    other: Option<&'a str>,
    /// Whether the sheet has the other material.
    is_used: bool,
    /// Objects that the sheet is cut into.
    parts: u32,
}

const ALONE: Made<'_> = Made { other: None, is_used: false, parts: 1 };

/// Runs it.
pub(super) fn needs(bench: &Bench, on_event: &mut dyn FnMut(&Event<'_>)) -> Result<Findings, BenchError> {
    let side = side(bench);
    let mut table = Table::new(
        "needs",
        format!(
            "Tracing a sheet of {} triangles at 640x360, one sample: without a feature; with it there and not used; with it used. In turn; ratios of medians.",
            2 * (side - 1).pow(2)
        ),
        &["without, ms", "not used, ms", "ratio", "used, ms", "ratio "],
    );
    let (plain, plain_shot) = scene(bench, "plain", ALONE)?;
    for (name, text) in [("mirror", MIRROR), ("glass", GLASS), ("texture", TEXTURED), ("glow", GLOWING)] {
        on_event(&Event::Stage(name));
        let made = |is_used| Made { other: Some(text), is_used, parts: 1 };
        let (idle, _) = scene(bench, &format!("{name} idle"), made(false))?;
        let (used, _) = scene(bench, &format!("{name} used"), made(true))?;
        let of = |frame| (frame, &plain_shot);
        add(bench, &mut table, name, [Some(of(&plain)), Some(of(&idle)), Some(of(&used))])?;
    }
    // that nothing here mirrors shows what bounces that do not come about cost
    let none = Shot { depth: 0, ..plain_shot.clone() };
    let four = Shot { samples: 4, ..plain_shot.clone() };
    let used = [
        ("a second light", &plain_shot, Shot { lights: two(&plain_shot), ..plain_shot.clone() }),
        ("auxiliary pictures", &plain_shot, Shot { aovs: all_aovs(), ..plain_shot.clone() }),
        ("alpha", &plain_shot, Shot { alpha: true, ..plain_shot.clone() }),
        ("gaussian filter, 4 samples", &four, Shot { filter: Filter::Gaussian, ..four.clone() }),
    ];
    on_event(&Event::Stage("bounces"));
    let of = |shot| Some((&plain, shot));
    add(bench, &mut table, "bounces, depth 10", [of(&none), of(&plain_shot), None])?;
    for (name, without, with) in &used {
        on_event(&Event::Stage(name));
        add(bench, &mut table, name, [of(without), None, of(with)])?;
    }
    for parts in [4, 8] {
        let name = format!("{parts} objects");
        on_event(&Event::Stage(&name));
        let (cut, _) = scene(bench, &name, Made { parts, ..ALONE })?;
        add(bench, &mut table, &name, [Some((&plain, &plain_shot)), None, Some((&cut, &plain_shot))])?;
    }
    let mut found = Findings::default();
    let columns = [(0, "without"), (1, "there, not used"), (3, "used")];
    let title = "What features cost";
    found.draw(&Dots { name: "needs", table: &table, title, unit: "tracing, ms", columns: &columns })?;
    found.add(table, on_event);
    Ok(found)
}

/// Vertices of the sheet along a side.
fn side(bench: &Bench) -> u32 {
    if bench.options.quick { SIDE / 2 } else { SIDE }
}

fn two(shot: &Shot) -> Vec<Light> {
    shot.lights.iter().chain(&shot.lights).copied().collect()
}

fn all_aovs() -> AovSet {
    let mut aovs = AovSet::default();
    for aov in Aov::ALL {
        aovs.insert(aov);
    }
    aovs
}

/// A row: times of each case in turn.
fn add(
    bench: &Bench,
    table: &mut Table,
    name: &str,
    cases: [Option<(&Frame, &Shot)>; 3],
) -> Result<(), BenchError> {
    let mut devices = Vec::new();
    for case in &cases {
        let Some((frame, _)) = case else {
            devices.push(None);
            continue;
        };
        let mut device =
            CpuDevice::new(bench.options.threads, u64::MAX).map_err(|_| BenchError::NoThreads)?;
        let plan = plan_frame(frame, device.residency(), &Wishes::default());
        device.apply(&plan, frame).map_err(failed)?;
        devices.push(Some(device));
    }
    let mut times: [Vec<f64>; 3] = Default::default();
    for _ in 0..bench.rounds(ROUNDS) {
        for ((case, device), times) in cases.iter().zip(&mut devices).zip(&mut times) {
            if let (Some((frame, shot)), Some(device)) = (case, device) {
                times.push(device.trace(frame, shot, &Stop::default()).map_err(failed)?.trace_ms);
            }
        }
    }
    let [without, idle, used] = times.map(|times| Cell::from(Spread::of(times)));
    table.row(name, [without, idle, without.times_in(idle), used, without.times_in(used)]);
    Ok(())
}

#[allow(clippy::needless_pass_by_value, reason = "it is passed on")]
fn failed(error: DeviceError) -> BenchError {
    BenchError::Frame(error.to_string())
}

/// Writes a scene and reads it.
fn scene(bench: &Bench, name: &str, made: Made<'_>) -> Result<(Frame, Shot), BenchError> {
    let folder = bench.room.path().join("needs").join(name.replace(' ', "-"));
    fs::create_dir_all(&folder)?;
    let side = side(bench);
    let mut checks = b"P6 4 4 255\n".to_vec();
    checks.extend((0..16_u32).flat_map(|i| [if (i + i / 4) % 2 == 0 { 255 } else { 60 }; 3]));
    fs::write(folder.join("checks.ppm"), checks)?;
    fs::write(folder.join("sheet.mtl"), format!("{PLAIN}{}", made.other.unwrap_or_default()))?;
    let mut files = Vec::new();
    for part in 0..made.parts {
        let file = folder.join(format!("part-{part}.obj"));
        fs::write(&file, text(side, part, made))?;
        files.push(file);
    }
    let job = job(bench, &folder, &files)?;
    let options = RunOptions { threads: bench.options.threads, ..RunOptions::default() };
    let (frame, shot) = read_shot(&job, &options).map_err(BenchError::Frame)?;
    Ok((frame, Shot { size: SIZE, ..shot }))
}

/// All parts as layers, seen from one place.
fn job(bench: &Bench, folder: &Path, files: &[PathBuf]) -> Result<crate::job::Job, BenchError> {
    let file = folder.join("job.yaml");
    let mut yaml = "version: 1\nlayers:\n".to_string();
    for file in files {
        let _ = writeln!(yaml, "  - sequence: {}", quoted(file));
    }
    yaml += "camera: {eye: [1.5, 1.2, 3], look_at: [0, 0, 0], fov: 40}\nlights:\n  - point: {position: [4, 5, 6], intensity: 1}\n";
    fs::write(&file, yaml)?;
    Ok(bench.job(&file, None)?)
}

/// A part of a wavy sheet as OBJ. What has the other material and is not to be seen of it is a triangle behind the eye.
fn text(side: u32, part: u32, made: Made<'_>) -> String {
    let mut text = "mtllib sheet.mtl\n".to_string();
    for j in 0..side {
        for i in 0..side {
            let [x, y] = [i, j].map(|k| 2.0 * f64::from(k) / f64::from(side - 1) - 1.0);
            let z = 0.3 * (4.0 * x).sin() * (3.0 * y).cos();
            let _ = writeln!(text, "v {x:.6} {y:.6} {z:.6}\nvt {} {}", 4.0 * x, 4.0 * y);
        }
    }
    if made.other.is_some() && !made.is_used {
        text += "v 8 8 20\nv 8 9 20\nv 9 8 20\nusemtl other\n";
        let last = side * side;
        let _ = writeln!(text, "f {}/1 {}/1 {}/1", last + 1, last + 2, last + 3);
    }
    text += if made.is_used { "usemtl other\n" } else { "usemtl sheet\n" };
    for j in (0..side - 1).filter(|j| j % made.parts == part) {
        for i in 0..side - 1 {
            let a = j * side + i + 1;
            let [b, c, d] = [a + 1, a + side, a + side + 1];
            let _ = writeln!(text, "f {a}/{a} {b}/{b} {d}/{d}\nf {a}/{a} {d}/{d} {c}/{c}");
        }
    }
    text
}
