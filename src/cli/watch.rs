//! `rentix watch`.

use super::progress::ProgressKind;
use super::render::{end_json, event_json, fleet, run_options};
use super::render_args::RenderArgs;
use super::{EXIT_FAILED, Global, request, stop};
use crate::job::Request;
use crate::run::Event;
use crate::watch::{self, Notices, State, WatchEvent, WatchOptions};
use anyhow::{Result, bail};
use clap::Args;
use std::collections::HashMap;
use std::net::{SocketAddr, ToSocketAddrs as _};
use std::process::ExitCode;
use std::time::Duration;

/// What `watch` takes beside the options of `render`, which are defaults for jobs that do not say.
#[derive(Args, Debug)]
#[allow(clippy::doc_markdown, reason = "this is what --help shows, as it stands")]
pub(super) struct WatchArgs {
    #[command(flatten)]
    pub render: RenderArgs,

    /// A job is whole when nothing in it has changed for so many seconds [default: 2]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, help_heading = "Watching")]
    pub settle: Option<f64>,
    /// Render frames of sequences that are still growing, as they come
    #[arg(long, help_heading = "Watching")]
    pub follow: bool,
    /// End when every job present is finished, failed or cancelled
    #[arg(long, help_heading = "Watching")]
    pub once: bool,
    /// Priority of jobs that say nothing of it; higher first [default: 0]
    #[arg(long, value_name = "N", allow_negative_numbers = true, help_heading = "Watching")]
    pub priority: Option<i64>,
    /// Serve a status page (also /metrics for Prometheus, /healthz), as 127.0.0.1:8080
    #[arg(long, value_name = "ADDRESS", value_parser = address, help_heading = "Watching")]
    pub listen: Option<SocketAddr>,
    /// Run a command for each job that finished or failed, tried at least once, one at a time (RENTIX_JOB, RENTIX_STATE, RENTIX_FOLDER, RENTIX_FRAMES, RENTIX_FAILED, RENTIX_ERROR; its status on stdin)
    #[arg(long, value_name = "CMD", help_heading = "Watching")]
    pub on_done: Option<String>,
    /// Kill that command, and all that it started, after so many seconds [default: 300]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, help_heading = "Watching")]
    pub on_done_within: Option<f64>,
    /// Post the status of each job that finished or failed, as JSON
    #[arg(long, value_name = "URL", help_heading = "Watching")]
    pub webhook: Option<String>,
    /// Mail to an address about each job that finished or failed
    #[arg(long, value_name = "ADDRESS", help_heading = "Watching")]
    pub mail: Option<String>,
    /// The server that sends mail: smtp://HOST, smtps://USER:PASSWORD@HOST [default: RENTIX_SMTP, else smtp://localhost]
    #[arg(long, value_name = "URL", help_heading = "Watching")]
    pub smtp: Option<String>,
}

/// Whether `watch` takes an option of `render`: not those that one run alone has.
pub(super) const NOT_TAKEN: [&str; 8] =
    ["job", "chunk", "report", "progress", "dry_run", "cold", "order", "movie"];

/// No job rests longer before it begins, and no command takes longer.
const SECONDS_MAX: f64 = 86_400.0;

fn seconds(option: &str, given: f64) -> Result<Duration> {
    if !(0.0..=SECONDS_MAX).contains(&given) {
        bail!("{option}: {given} is out of range: allowed from 0 to {SECONDS_MAX}");
    }
    Ok(Duration::from_secs_f64(given))
}

/// Watches a folder and renders what is put into it.
pub(super) fn watch(args: &WatchArgs, global: &Global) -> Result<ExitCode> {
    let stop = stop::on_signals()?;
    let render = &args.render;
    let [inbox] = render.inputs.as_slice() else {
        bail!("one INBOX is watched; start another daemon for another one");
    };
    let asks_for_one_run = render.job.is_some()
        || render.chunk.is_some()
        || render.report.is_some()
        || render.dry_run
        || render.cold
        || render.order.is_some()
        || render.movie.is_some()
        || render.progress != ProgressKind::Auto;
    if asks_for_one_run {
        bail!(
            "--job, --chunk, --order, --report, --progress, --movie, --cold and --dry-run are for `rentix render`"
        );
    }
    let settle = seconds("--settle", args.settle.unwrap_or(2.0))?;
    let on_done_within = seconds("--on-done-within", args.on_done_within.unwrap_or(300.0))?;
    let run = run_options(render);
    let fleet = fleet(render, &run)?;
    let smtp = args.smtp.clone().or_else(|| std::env::var("RENTIX_SMTP").ok().filter(|url| !url.is_empty()));
    let options = WatchOptions {
        inbox: inbox.clone(),
        out: render.output.clone().unwrap_or_else(|| "out".into()),
        settle,
        follow: args.follow,
        once: args.once,
        priority: args.priority.unwrap_or(0),
        defaults: Request { inputs: Vec::new(), folder: None, ..request::request(render)? },
        run,
        listen: args.listen,
        notices: Notices {
            on_done: args.on_done.clone(),
            on_done_within,
            webhook: args.webhook.clone(),
            mail: args.mail.clone(),
            smtp,
        },
    };
    let mut counts = Counts::default();
    stop::keep_state(counts.words());
    let ended = watch::watch(&options, fleet, &stop.asked, &mut |event| {
        if let WatchEvent::State(status) = event {
            counts.count(&status.job, status.state);
            stop::keep_state(counts.words());
        }
        if global.json {
            out!("{}", as_json(event));
        } else {
            tell(event, global);
        }
    })?;
    Ok(if ended.stopped {
        ExitCode::from(stop.exit_status())
    } else if ended.failed > 0 {
        ExitCode::from(EXIT_FAILED)
    } else {
        ExitCode::SUCCESS
    })
}

/// Jobs by their states; of those that have not ended it is known which.
#[derive(Default)]
struct Counts {
    open: HashMap<String, State>,
    counts: [u64; State::ALL.len()],
}

impl Counts {
    fn count(&mut self, job: &str, state: State) {
        let before =
            if state.is_end() { self.open.remove(job) } else { self.open.insert(job.to_owned(), state) };
        if let Some(before) = before {
            self.counts[before as usize] -= 1;
        }
        self.counts[state as usize] += 1;
    }

    fn words(&self) -> String {
        let counts = State::ALL.iter().zip(self.counts).filter(|(_, n)| *n > 0);
        let words: Vec<String> = counts.map(|(state, n)| format!("{n} {}", state.word())).collect();
        if words.is_empty() { "no jobs".to_owned() } else { words.join(", ") }
    }
}

/// For people: a line for each state that matters, and for each frame that failed.
fn tell(event: &WatchEvent<'_>, global: &Global) {
    match event {
        WatchEvent::Ready(at) if !global.quiet => match at {
            Some(at) => err!("watching; the status page is at http://{at}/"),
            None => err!("watching"),
        },
        WatchEvent::State(status) => {
            let (job, word, frames) = (&status.job, status.state.word(), &status.frames);
            match (status.state, &status.error) {
                (State::Failed, error) => {
                    err!("{job}: failed: {}", error.as_deref().unwrap_or("no reason is known"));
                }
                _ if global.quiet => {}
                (State::Finished, _) => err!("{job}: finished, {} frames", frames.done),
                (State::Cancelled, Some(error)) => err!("{job}: cancelled: {error}"),
                (State::Running | State::Queued, _) => err!("{job}: {word}"),
                _ if global.verbose => err!("{job}: {word}"),
                _ => {}
            }
        }
        WatchEvent::Run(job, Event::Frame(frame)) => match &frame.error {
            Some(error) => err!("{job}: error: {error}"),
            None if global.verbose => err!("{job}: {}: {:?}", frame.picture, frame.status),
            None => {}
        },
        WatchEvent::Run(job, Event::Warning(warning)) if !global.quiet => {
            err!("{job}: warning: {warning}");
        }
        WatchEvent::Note(text) => err!("{text}"),
        _ => {}
    }
}

fn as_json(event: &WatchEvent<'_>) -> serde_json::Value {
    let of = |job: &str, mut value: serde_json::Value| {
        value["job"] = job.into();
        value
    };
    match event {
        WatchEvent::Ready(at) => {
            serde_json::json!({"event": "ready", "page": at.map(|at| format!("http://{at}/"))})
        }
        WatchEvent::State(status) => {
            let mut value = serde_json::to_value(status).unwrap_or_default();
            value["event"] = "state".into();
            value
        }
        WatchEvent::Run(job, event) => of(job, event_json(event)),
        WatchEvent::Ended(job, outcome) => of(job, end_json(outcome)),
        WatchEvent::Note(text) => serde_json::json!({"event": "note", "text": text}),
    }
}

/// An address and a port, or a host's name and a port.
fn address(text: &str) -> Result<SocketAddr, String> {
    let found = text.to_socket_addrs().map_err(|e| format!("{e}; it is written 127.0.0.1:8080"))?.next();
    found.ok_or_else(|| "this host has no address".to_string())
}
