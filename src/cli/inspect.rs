//! `rentix inspect`: what is in a sequence, what changes from frame to frame, and what it will cost.

use super::costs::tell_costs;
use super::render::{devices, store_of};
use super::render_args::RenderArgs;
use super::{EXIT_FAILED, Global, request};
use crate::device::DeviceInfo;
use crate::diff::{Change, changes};
use crate::job::{self, Job, Picture};
use crate::run::{Sources, forecast, read_frame};
use crate::scene::Frame;
use crate::schedule::estimate::Thesis;
use crate::warning::Warnings;
use anyhow::Result;
use std::process::ExitCode;

/// What is told of one frame.
struct Seen {
    triangles: u64,
    vertices: u64,
    meshes: usize,
    materials: usize,
    texture_bytes: u64,
    change: Change,
}

/// Reads every chosen frame and tells what is in it; renders nothing.
pub(super) fn inspect(args: &RenderArgs, global: &Global) -> Result<ExitCode> {
    let job = job::resolve(&request::request(args)?)?;
    let mut warnings = Warnings::default();
    for w in job.warnings.list() {
        say(global, &format!("warning: {w}"));
    }
    let mut failed = 0;
    // the frame that was read last, and what was seen in it
    let mut latest: Option<(&Picture, Frame, Seen)> = None;
    let sources = Sources::default();
    let store = store_of(args);
    let devices: Vec<DeviceInfo> = match devices(args, store.clone()) {
        Ok(devices) => devices.iter().map(|device| device.info().clone()).collect(),
        Err(error) => {
            say(global, &format!("warning: no costs are told, for no device can be opened: {error:#}"));
            Vec::new()
        }
    };
    for (i, picture) in job.pictures.iter().enumerate() {
        match read_frame(&job, picture, &sources, args.lenient, &mut warnings) {
            Err(error) => {
                failed += 1;
                err!("error: {error}");
            }
            Ok(frame) => {
                let before = latest.as_ref().filter(|(p, ..)| p.sequence == picture.sequence);
                let seen = look(before.map(|(_, frame, _)| frame), &frame);
                tell(&job, picture, &seen, before.is_none(), global);
                latest = Some((picture, frame, seen));
            }
        }
        if job.pictures.get(i + 1).is_some_and(|next| next.sequence == picture.sequence) {
            continue;
        }
        // by the last frame of the sequence that could be read
        if let Some((picture, frame, seen)) = latest.as_ref().filter(|(p, ..)| p.sequence == picture.sequence)
        {
            let costs = forecast(&job, picture, frame, &seen.change, store.as_deref(), &devices);
            let thesis = Thesis::new(seen.vertices, seen.texture_bytes as f64 / 1e6);
            tell_costs(&job.sequences[picture.sequence].name, &thesis, &devices, &costs, global.json);
        }
    }
    for w in warnings.list() {
        say(global, &format!("warning: {w}"));
    }
    Ok(if failed == 0 { ExitCode::SUCCESS } else { ExitCode::from(EXIT_FAILED) })
}

fn say(global: &Global, line: &str) {
    if !global.quiet {
        err!("{line}");
    }
}

fn look(before: Option<&Frame>, frame: &Frame) -> Seen {
    let geometries = || frame.objects.iter().map(|o| &o.geometry);
    Seen {
        triangles: frame.triangles(),
        vertices: geometries().map(|g| g.positions.0.len() as u64).sum(),
        meshes: geometries().map(|g| g.meshes.len()).sum(),
        materials: geometries().map(|g| g.materials.len()).sum(),
        texture_bytes: frame.texture_bytes(),
        change: changes(before, frame),
    }
}

fn tell(job: &Job, picture: &Picture, seen: &Seen, first: bool, global: &Global) {
    let sequence = &job.sequences[picture.sequence];
    if global.json {
        let source = picture.main_file(sequence).map(|f| f.stem.clone()).unwrap_or_default();
        let line = serde_json::json!({
            "sequence": sequence.name, "frame": picture.frame, "source": source, "triangles": seen.triangles,
            "vertices": seen.vertices, "meshes": seen.meshes, "materials": seen.materials, "change": seen.change,
        });
        out!("{line}");
        return;
    }
    if first {
        out!("{}", sequence.name);
        out!(
            "{:>24} {:>10} {:>10} {:>7} {:>9}  change",
            "frame",
            "triangles",
            "vertices",
            "meshes",
            "materials"
        );
    }
    // all frames of a glTF are of one file
    let name = picture.picture.file_stem().unwrap_or_default().to_string_lossy();
    out!(
        "{name:>24} {:>10} {:>10} {:>7} {:>9}  {}",
        seen.triangles,
        seen.vertices,
        seen.meshes,
        seen.materials,
        words(&seen.change)
    );
}

fn words(c: &Change) -> String {
    let counts = [
        (c.same, "same"),
        (c.rigid, "rigid"),
        (c.deformed, "deformed"),
        (c.reshaped, "reshaped"),
        (c.added, "added"),
        (c.removed, "removed"),
        (c.materials, "materials"),
        (c.textures, "textures"),
    ];
    let list: Vec<String> =
        counts.iter().filter(|(n, _)| *n > 0).map(|(n, word)| format!("{n} {word}")).collect();
    if list.is_empty() { "nothing in it".to_string() } else { list.join(", ") }
}
