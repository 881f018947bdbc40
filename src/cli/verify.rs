//! `rentix verify`.

use super::progress::{Progress, ProgressKind};
use super::render::{fleet, run_options};
use super::render_args::RenderArgs;
use super::{EXIT_FAILED, Global, request, stop};
use crate::job;
use crate::run::Event;
use crate::run::verify::{Verdict, WAYS, verify as verify_job};
use anyhow::Result;
use std::process::ExitCode;

/// Renders warm and cold and in several orders, and tells whether it makes a difference.
pub(super) fn verify(args: &RenderArgs, global: &Global) -> Result<ExitCode> {
    let mut job = job::resolve(&request::request(args)?)?;
    // the order is what is tried
    job.pictures.sort_by_key(|p| (p.sequence, p.frame));
    let options = run_options(args);
    let stop = stop::on_signals()?;
    let kind = if global.quiet || global.json { ProgressKind::None } else { args.progress };
    let mut progress = Progress::new(kind, global.verbose);
    let (verdict, outcome) =
        verify_job(&job, &options, || fleet(args, &options), &stop.asked, &mut |way, event| {
            if !(global.quiet || global.json) {
                if matches!(event, Event::Start { .. }) {
                    progress.line(&format!("{}:", way.name));
                }
                progress.event(event);
            }
        })?;
    progress.end();
    let failed = outcome.failed().count();
    tell(&verdict, job.pictures.len(), failed, global);
    Ok(match verdict {
        Verdict::Equal => ExitCode::SUCCESS,
        Verdict::Differs { .. } => ExitCode::from(EXIT_FAILED),
        Verdict::Stopped => ExitCode::from(stop.exit_status()),
    })
}

fn tell(verdict: &Verdict, pictures: usize, failed: usize, global: &Global) {
    let ways: Vec<&str> = WAYS.iter().map(|w| w.name).collect();
    if global.json {
        let (word, way, what) = match verdict {
            Verdict::Equal => ("equal", None, None),
            Verdict::Differs { way, what } => ("differs", Some(way), Some(what)),
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
        Verdict::Stopped => err!("stopped"),
    }
}
