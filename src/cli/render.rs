//! `rentix render`.

use super::progress::{Progress, ProgressKind};
use super::render_args::RenderArgs;
use super::store::store;
use super::{EXIT_FAILED, EXIT_NO_DEVICE, Global, request, stop};
use crate::device::{Device, registry};
use crate::job::{self, FrameSet, Job};
use crate::run::{
    self, Event, Fleet, FrameReport, Outcome, RunOptions, machine, make_movie, movie_can_be_made,
};
use crate::store::Store;
use anyhow::Result;
use std::fmt::Write as _;
use std::process::ExitCode;
use std::sync::Arc;

/// Renders what was asked for and tells how it went.
pub(super) fn render(args: &RenderArgs, global: &Global) -> Result<ExitCode> {
    let job = job::resolve(&request::request(args)?)?;
    let options = run_options(args);
    let fleet = fleet(args, &options)?;
    if args.dry_run {
        dry_run(&job, global);
        return Ok(ExitCode::SUCCESS);
    }
    let json = global.json || args.progress == ProgressKind::Json;
    let for_people = matches!(args.progress, ProgressKind::Auto | ProgressKind::Bar | ProgressKind::Plain);
    let kind = if json || global.quiet && for_people { ProgressKind::None } else { args.progress };
    let mut progress = Progress::new(kind, global.verbose);
    if let Some(file) = &args.movie {
        // told before the work, not after it
        movie_can_be_made(&job, file, args.overwrite)?;
    }
    let stop = stop::on_signals()?;
    let outcome = run::render(&job, &options, &fleet, &stop.asked, &mut |event| {
        if json {
            out!("{}", event_json(event));
        } else if !(global.quiet && matches!(event, Event::Warning(_))) {
            progress.event(event);
        }
    })?;
    progress.end();
    if json {
        out!("{}", end_json(&outcome));
    }
    let mut status = conclude(&job, &outcome, global, &stop);
    if let Some(error) = &outcome.unsaved {
        err!("error: {error}");
        if status == ExitCode::SUCCESS {
            status = ExitCode::from(EXIT_FAILED);
        }
    }
    match &args.movie {
        Some(file) if !outcome.stopped && outcome.failed().next().is_none() => {
            if let Err(error) = make_movie(&job, file) {
                err!("error: {error}");
                let is_stopped = stop.asked.asked();
                return Ok(ExitCode::from(if is_stopped { stop.exit_status() } else { EXIT_FAILED }));
            }
            if !global.quiet && !global.json {
                err!("{}", file.display());
            }
        }
        Some(file) if outcome.stopped => err!("{}: no film is made of a part", file.display()),
        Some(file) => err!("{}: no film is made, for frames are missing", file.display()),
        None => {}
    }
    Ok(status)
}

/// What of the options bears on the run itself.
pub(super) fn run_options(args: &RenderArgs) -> RunOptions {
    RunOptions {
        threads: threads(args),
        memory_bytes: Some(args.memory.unwrap_or_else(machine::default_budget_bytes)),
        cold: args.cold,
        update: args.update.into(),
        priority: 0,
        overwrite: args.overwrite,
        lenient: args.lenient,
        strict: args.strict,
        report: args.report.clone(),
        keeps_reports: false,
        store: store_of(args),
    }
}

/// The store asked for.
pub(super) fn store_of(args: &RenderArgs) -> Option<Arc<Store>> {
    if args.no_cache { None } else { store(args.cache.as_deref()) }
}

/// The devices asked for, and how they share.
pub(super) fn fleet(args: &RenderArgs, options: &RunOptions) -> Result<Fleet> {
    Ok(Fleet::new(devices(args, options.store.clone())?, args.schedule.into()))
}

/// The devices asked for.
pub(super) fn devices(args: &RenderArgs, store: Option<Arc<Store>>) -> Result<Vec<Box<dyn Device>>> {
    let wanted = registry::Wanted {
        threads: threads(args),
        budget_bytes: args.device_memory,
        host_budget_bytes: machine::default_budget_bytes(),
        store,
    };
    Ok(registry::open_all(args.device.as_deref(), &wanted)?)
}

fn threads(args: &RenderArgs) -> usize {
    args.threads.map_or_else(|| machine::machine().cores, usize::from)
}

/// Tells what would be rendered.
fn dry_run(job: &Job, global: &Global) {
    for picture in &job.pictures {
        let sequence = &job.sequences[picture.sequence];
        let source = picture.main_file(sequence).map(|f| f.path.display().to_string());
        let path = job.folder.join(&picture.picture);
        if global.json {
            let line = serde_json::json!({
                "sequence": sequence.name, "frame": picture.frame, "source": source, "picture": path.display().to_string(),
            });
            out!("{line}");
        } else {
            out!("{} -> {}", source.unwrap_or_else(|| "nothing".to_string()), path.display());
        }
    }
}

/// Says how the run ended; the exit status is CONTRACT 1's.
fn conclude(job: &Job, outcome: &Outcome, global: &Global, stop: &stop::OnSignals) -> ExitCode {
    let totals = &outcome.report.totals;
    let failed: Vec<&FrameReport> = outcome.failed().collect();
    if !global.quiet && !global.json {
        let mut line = format!("{} rendered", totals.rendered);
        for (count, word) in
            [(totals.resumed, "found finished"), (totals.copied, "copied"), (totals.failed, "failed")]
        {
            if count > 0 {
                let _ = write!(line, ", {count} {word}");
            }
        }
        err!("{line} in {:.1} s: {}", outcome.report.wall_s, job.folder.display());
    }
    let left = job.pictures.len() as u64 - totals.frames + totals.failed;
    if outcome.stopped && left > 0 {
        err!("stopped: {left} of {} frames are left; the same command renders them", job.pictures.len());
    } else if !failed.is_empty() {
        err!(
            "{} of {} frames are missing; render them with {}",
            failed.len(),
            job.pictures.len(),
            frame_list(&failed)
        );
    }
    if outcome.stopped {
        return ExitCode::from(stop.exit_status());
    }
    if failed.is_empty() {
        ExitCode::SUCCESS
    } else if failed.iter().all(|f| f.device_failed) {
        ExitCode::from(EXIT_NO_DEVICE)
    } else {
        ExitCode::from(EXIT_FAILED)
    }
}

/// The missing frames as an option to come back with; frames without a number by their files.
fn frame_list(failed: &[&FrameReport]) -> String {
    let mut numbers: Vec<i64> = failed.iter().filter_map(|f| f.frame).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let mut text = String::new();
    if !numbers.is_empty() {
        let _ = write!(text, "--frames {}", FrameSet::from_numbers(&numbers));
    }
    for f in failed.iter().filter(|f| f.frame.is_none()) {
        let _ = write!(text, "{}{}", if text.is_empty() { "" } else { " and " }, f.source);
    }
    text
}

pub(super) fn event_json(event: &Event) -> serde_json::Value {
    match event {
        Event::Start { frames, folder, devices } => {
            serde_json::json!({"event": "start", "frames": frames, "folder": folder, "devices": devices})
        }
        Event::Frame(frame) => {
            let mut value = serde_json::to_value(frame).unwrap_or_default();
            value["event"] = "frame".into();
            value
        }
        Event::Warning(w) => serde_json::json!({
            "event": "warning", "text": w.to_string(), "count": w.count, "line": w.line,
            "file": w.file.as_ref().map(|f| f.display().to_string()),
        }),
    }
}

pub(super) fn end_json(outcome: &Outcome) -> serde_json::Value {
    let r = &outcome.report;
    serde_json::json!({"event": "end", "wall_s": r.wall_s, "totals": r.totals, "devices": r.devices, "stopped": outcome.stopped})
}
