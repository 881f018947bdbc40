//! `rentix verify`.

use super::progress::{Progress, ProgressKind};
use super::render::{fleet, run_options};
use super::render_args::RenderArgs;
use super::{EXIT_FAILED, EXIT_NO_DEVICE, EXIT_USE, Global, request, stop};
use crate::job;
use crate::run::verify::{Verdict, WAYS, verify as verify_job};
use crate::run::{Event, Outcome};
use anyhow::{Result, bail};
use std::collections::HashSet;
use std::process::ExitCode;

/// Options of `render` that `verify` does not take: pictures are temporary, and the ways are its own.
pub(super) const NOT_TAKEN: [&str; 7] =
    ["output", "overwrite", "report", "movie", "dry_run", "cold", "order"];

/// Renders warm and cold and in several orders, and tells whether it makes a difference.
pub(super) fn verify(args: &RenderArgs, global: &Global) -> Result<ExitCode> {
    let asks_for_one_run = args.output.is_some()
        || args.overwrite
        || args.report.is_some()
        || args.movie.is_some()
        || args.dry_run
        || args.cold
        || args.order.is_some();
    if asks_for_one_run {
        bail!(
            "-o, --overwrite, --report, --movie, --dry-run, --cold and --order are for `rentix render`; here pictures are temporary, and rendered in every way"
        );
    }
    let mut job = job::resolve(&request::request(args)?)?;
    // the order is what is tried
    job.pictures.sort_by_key(|p| (p.sequence, p.frame));
    let options = run_options(args);
    let stop = stop::on_signals()?;
    let kind = if global.quiet || global.json { ProgressKind::None } else { args.progress };
    let mut progress = Progress::new(kind, global.verbose);
    // the ways warn of the same
    let mut told = HashSet::new();
    let (verdict, outcome) =
        verify_job(&job, &options, || fleet(args, &options), &stop.asked, &mut |way, event| {
            if !(global.quiet || global.json) {
                if matches!(event, Event::Start { .. }) {
                    progress.line(&format!("{}:", way.name));
                }
                let is_new = match event {
                    Event::Warning(w) => told.insert((w.file.clone(), w.text.clone())),
                    _ => true,
                };
                if is_new {
                    progress.event(event);
                }
            }
        })?;
    progress.end();
    tell(&verdict, job.pictures.len(), &outcome, global);
    Ok(match verdict {
        Verdict::Equal => ExitCode::SUCCESS,
        Verdict::Differs { .. } => ExitCode::from(EXIT_FAILED),
        Verdict::Nothing if outcome.failed().all(|f| f.device_failed) => ExitCode::from(EXIT_NO_DEVICE),
        Verdict::Nothing => ExitCode::from(EXIT_USE),
        Verdict::Stopped => ExitCode::from(stop.exit_status()),
    })
}

fn tell(verdict: &Verdict, pictures: usize, outcome: &Outcome, global: &Global) {
    let failed = outcome.failed().count();
    let ways: Vec<&str> = WAYS.iter().map(|w| w.name).collect();
    if global.json {
        let (word, way, what) = match verdict {
            Verdict::Equal => ("equal", None, None),
            Verdict::Differs { way, what } => ("differs", Some(way), Some(what)),
            Verdict::Nothing => ("nothing", None, None),
            Verdict::Stopped => ("stopped", None, None),
        };
        let line = serde_json::json!({
            "verdict": word, "ways": ways, "pictures": pictures, "failed": failed, "way": way, "what": what,
        });
        out!("{line}");
        return;
    }
    match verdict {
        Verdict::Equal if global.quiet => {}
        Verdict::Equal => {
            let and_failed =
                if failed > 0 { format!("; {failed} failed in every way alike") } else { String::new() };
            err!("equal: {pictures} pictures, {}{and_failed}", ways.join(", "));
        }
        Verdict::Differs { way, what } => err!("differs: {way}: {what}"),
        Verdict::Nothing => {
            let first = outcome.failed().find_map(|f| f.error.as_deref()).unwrap_or("no reason is known");
            err!(
                "error: there is nothing to compare, for every frame failed in every way; the first: {first}"
            );
        }
        Verdict::Stopped => err!("stopped"),
    }
}
