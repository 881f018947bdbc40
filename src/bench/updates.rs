//! The workload `updates`: reading, trees, warm frames, refit or rebuild, the store, on scenes and on made sequences.

use super::embree::Program;
use super::frames::{frames, rays, refits};
use super::policy::{Input, policy};
use super::reading::{Consecutive, RATE, reading};
use super::sequences::{HOSTILE, write_wave};
use super::start::starts;
use super::timeline::timeline;
use super::trees::{EMBREE_REFIT_1, Mesh, trees};
use super::view::View;
use super::warm::{WarmPeers, warm_frames};
use super::{Bench, BenchError, Event, Findings};
use crate::device::DeviceKind;
use crate::format::{ReadOptions, TextureCache, load_obj};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Scenes of which meshes are taken, and where those that are rooms are looked at from.
const MESHES: [(&str, &str, Option<View>); 4] = [
    ("bunny", "bunny/stanford-bunny.obj", None),
    ("dragon", "dragon/dragon_100k.obj", None),
    (
        "conference",
        "conference/conference.obj",
        Some(View { eye: [1000.0, 400.0, 500.0], look_at: [0.0, 150.0, -200.0], fov_deg: 40.0 }),
    ),
    ("sibenik", "sibenik/sibenik.obj", Some(SIBENIK)),
];
const SIBENIK: View = View { eye: [-17.0, -13.0, 0.0], look_at: [0.0, -11.0, 0.0], fov_deg: 60.0 };

/// Meshes through which waves run, by their names among [`MESHES`].
const WAVES: [&str; 3] = ["bunny", "dragon", "conference"];
/// Side of the sheets of hostile sequences, their frames, and those of waves.
const SIDE: u32 = 100;
const FRAMES: u32 = 24;
const WAVE_FRAMES: u32 = 12;

/// Runs it.
pub(super) fn updates(bench: &Bench, on_event: &mut dyn FnMut(&Event<'_>)) -> Result<Findings, BenchError> {
    let mut findings = Findings::default();
    on_event(&Event::Stage("making sequences"));
    let hostile = hostile(bench)?;
    let waves = waves(bench, &hostile)?;
    if bench.wants("reading") {
        on_event(&Event::Stage("reading"));
        let all: Vec<_> = waves.iter().cloned().chain(sequences(bench)).collect();
        let read: Vec<_> =
            all.iter().map(|(name, folder)| Consecutive::of(name, &obj_files(folder))).collect();
        findings.add(reading(bench, &read), on_event);
    }
    if bench.wants("trees") {
        on_event(&Event::Stage("trees"));
        findings.add(trees(bench, &meshes(bench, &hostile)?)?, on_event);
    }
    if bench.wants("warm") {
        on_event(&Event::Stage("warm frames"));
        let found = |table: &str, column: &str, is_row: &dyn Fn(&str) -> bool| {
            let table = findings.tables.iter().find(|t| t.name == table)?;
            let column = table.columns.iter().position(|c| c == column)?;
            table.rows.iter().find(|(row, _)| is_row(row)).and_then(|(_, cells)| cells[column].value())
        };
        let peers = |wave: &str| WarmPeers {
            reading: found("reading", RATE, &|row| row == wave),
            embree_refit_ms: found("trees", EMBREE_REFIT_1, &|mesh| wave.starts_with(mesh)),
        };
        let with_peers: Vec<_> =
            waves.iter().map(|(name, folder)| (name.clone(), &**folder, peers(name))).collect();
        findings.add(warm_frames(bench, &with_peers)?, on_event);
    }
    if bench.wants("start")
        && let Some(sibenik) = bench.scene("sibenik/sibenik.obj")
    {
        on_event(&Event::Stage("start"));
        findings.add(starts(bench, &[("sibenik", &sibenik, SIBENIK)])?, on_event);
    }
    if ["frames", "timeline", "refit", "rays"].iter().any(|table| bench.wants(table)) {
        devices(bench, &hostile, &mut findings, on_event)?;
    }
    if bench.wants("policy") {
        on_event(&Event::Stage("refit or rebuild"));
        let input = |is_charted| move |(name, folder)| Input { name, folder, is_charted };
        let mut inputs: Vec<Input> = hostile.into_iter().map(input(true)).collect();
        inputs.extend(waves.into_iter().chain(sequences(bench)).map(input(false)));
        let (table, charts) = policy(bench, &inputs)?;
        findings.add(table, on_event);
        for chart in &charts {
            findings.draw(chart)?;
        }
    }
    Ok(findings)
}

/// The tables of a device.
fn devices(
    bench: &Bench,
    hostile: &[(String, PathBuf)],
    findings: &mut Findings,
    on_event: &mut dyn FnMut(&Event<'_>),
) -> Result<(), BenchError> {
    let mut device = bench.device()?;
    if bench.options.quick && bench.options.only.is_empty() && device.info().kind != DeviceKind::Gpu {
        // they are tables of GPUs: on a CPU they take minutes
        return Ok(());
    }
    let meshes = meshes(bench, hostile)?;
    if bench.wants("frames") {
        on_event(&Event::Stage("frames of a device"));
        findings.add(frames(bench, &mut *device)?, on_event);
    }
    if bench.wants("timeline") {
        on_event(&Event::Stage("frames over time"));
        if let Some((table, chart)) = timeline(bench, &mut *device)? {
            findings.add(table, on_event);
            findings.draw(&chart)?;
        }
    }
    if bench.wants("refit") {
        on_event(&Event::Stage("fits on a device"));
        findings.add(refits(bench, &mut *device, &meshes)?, on_event);
    }
    if bench.wants("rays") {
        on_event(&Event::Stage("rays of a device"));
        findings.add(rays(bench, &mut *device, &meshes)?, on_event);
    }
    Ok(())
}

/// The hostile sequences, written.
fn hostile(bench: &Bench) -> Result<Vec<(String, PathBuf)>, BenchError> {
    let (side, frames) = if bench.options.quick { (SIDE / 4, FRAMES / 2) } else { (SIDE, FRAMES) };
    let write = |hostile: &super::sequences::Hostile| {
        let folder = bench.room.path().join(hostile.name);
        hostile.write(side, frames, &folder)?;
        Ok((hostile.name.to_string(), folder))
    };
    HOSTILE.iter().map(write).collect()
}

/// The sheet that hostile sequences begin with.
fn sheet(hostile: &[(String, PathBuf)]) -> Option<PathBuf> {
    let (_, folder) = hostile.iter().find(|(name, _)| name == "explosion")?;
    obj_files(folder).into_iter().next()
}

/// The meshes of the scenes, and a sheet.
fn meshes(bench: &Bench, hostile: &[(String, PathBuf)]) -> Result<Vec<Mesh>, BenchError> {
    let scenes = MESHES.iter().filter_map(|(name, file, view)| Some((*name, bench.scene(file)?, *view)));
    let all = scenes.chain(sheet(hostile).map(|file| ("sheet", file, None)));
    let load = |(name, file, view): (&str, PathBuf, Option<View>)| {
        let loaded = load_obj(&file, &ReadOptions::default(), &TextureCache::default())
            .map_err(|e| BenchError::Frame(e.to_string()))?;
        let camera = view.map(|v| v.options()).unwrap_or_default();
        let program = bench.options.embree.as_deref();
        let embree = program.map(|p| Program { path: p.to_path_buf(), obj: file.clone(), camera });
        Ok(Mesh { name: name.to_string(), geometry: Arc::clone(&loaded.geometry), view, embree })
    };
    all.map(load).collect()
}

/// Waves through meshes of the scenes, or else through a sheet.
fn waves(bench: &Bench, hostile: &[(String, PathBuf)]) -> Result<Vec<(String, PathBuf)>, BenchError> {
    let of_scenes = MESHES.iter().filter(|(name, ..)| WAVES.contains(name));
    let mut files: Vec<(&str, PathBuf)> =
        of_scenes.filter_map(|(name, file, _)| Some((*name, bench.scene(file)?))).collect();
    if files.is_empty() {
        files.extend(sheet(hostile).map(|file| ("sheet", file)));
    }
    let write = |(name, file): (&str, PathBuf)| {
        let name = format!("{name} wave");
        let folder = bench.room.path().join(&name);
        write_wave(&fs::read_to_string(file)?, WAVE_FRAMES, &folder)?;
        Ok((name, folder))
    };
    files.into_iter().map(write).collect()
}

/// Folders of scenes that hold sequences: their names begin with `seq-`.
fn sequences(bench: &Bench) -> Vec<(String, PathBuf)> {
    let entries =
        bench.options.scenes.iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten().flatten();
    let named = entries.map(|e| (e.file_name().to_string_lossy().into_owned(), e.path()));
    let mut all: Vec<_> = named.filter(|(name, path)| name.starts_with("seq-") && path.is_dir()).collect();
    all.sort();
    all
}

/// The OBJ files of a folder by name.
fn obj_files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path());
    let mut files: Vec<PathBuf> = entries.filter(|p| p.extension().is_some_and(|e| e == "obj")).collect();
    files.sort();
    files
}
