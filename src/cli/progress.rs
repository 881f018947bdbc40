//! Progress on stderr: a bar on a terminal, elsewhere a plain line at most every 5 s.

use super::stop;
use crate::clock::Stopwatch;
use crate::run::{Event, FrameReport, Status};
use crate::warning::Warning;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::collections::BTreeMap;
use std::io::IsTerminal;
use std::path::Path;
use std::time::Duration;

/// How progress is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, clap::ValueEnum)]
pub(super) enum ProgressKind {
    /// A bar on a terminal, else plain lines.
    #[default]
    Auto,
    /// A bar.
    Bar,
    /// A line at most every 5 s.
    Plain,
    /// Events as JSON on stdout, as --json.
    Json,
    /// What Open Job Description reads: `openjd_progress: 12.5` on stdout.
    Openjd,
    /// What Alfred and Tractor read: `ALF_PROGRESS 12%` on stdout.
    Alf,
    /// What Afanasy reads: `PROGRESS: 12%` on stdout.
    Afanasy,
    /// Nothing.
    None,
}

/// Draws progress from a run's events.
pub(super) struct Progress {
    kind: ProgressKind,
    bar: Option<ProgressBar>,
    plain: bool,
    verbose: bool,
    since: Stopwatch,
    told_s: f64,
    /// Where pictures go.
    folder: String,
    frames: usize,
    ended: usize,
    failed: usize,
    /// For how many files each warning came.
    warned: BTreeMap<String, usize>,
    /// How many times each error came: all frames of an animation have one file.
    errors: BTreeMap<String, usize>,
}

const PLAIN_EVERY_S: f64 = 5.0;
/// For so many files one cause of warnings is told.
const FILES_TOLD: usize = 3;

impl Progress {
    /// Progress of the given kind.
    pub(super) fn new(kind: ProgressKind, verbose: bool) -> Self {
        let bar = match kind {
            ProgressKind::Bar => true,
            ProgressKind::Auto => std::io::stderr().is_terminal(),
            _ => false,
        };
        let bar = bar.then(|| {
            let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr_with_hz(8));
            let style = ProgressStyle::with_template(
                "{prefix} {bar:32} {pos}/{len} frames  {per_sec}  {eta} left  {msg}",
            );
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("━╸─"));
            bar.enable_steady_tick(Duration::from_millis(250));
            bar
        });
        Self {
            kind,
            plain: bar.is_none() && matches!(kind, ProgressKind::Auto | ProgressKind::Plain),
            bar,
            verbose,
            since: Stopwatch::start(),
            told_s: 0.0,
            folder: String::new(),
            frames: 0,
            ended: 0,
            failed: 0,
            warned: BTreeMap::new(),
            errors: BTreeMap::new(),
        }
    }

    /// Shows an event.
    pub(super) fn event(&mut self, event: &Event) {
        match event {
            Event::Start { frames, folder, .. } => {
                self.folder.clone_from(folder);
                self.frames = *frames;
                self.keep_state();
                if let Some(bar) = &self.bar {
                    bar.set_length(*frames as u64);
                }
            }
            Event::Frame(frame) => self.frame(frame),
            Event::Warning(w) => self.warning(w),
        }
    }

    /// Shows a cause for a few files and counts the others; the report has them all.
    fn warning(&mut self, warning: &Warning) {
        let files = self.warned.entry(warning.text.clone()).or_default();
        *files += 1;
        if *files <= FILES_TOLD || self.verbose {
            self.line(&format!("warning: {warning}"));
        }
    }

    fn frame(&mut self, frame: &FrameReport) {
        self.ended += 1;
        if frame.status == Status::Failed {
            self.failed += 1;
            let error = frame.error.as_deref().unwrap_or("failed");
            let times = self.errors.entry(error.to_string()).or_default();
            *times += 1;
            if *times == 1 || self.verbose {
                self.line(&format!("error: {error}"));
            }
        } else if self.verbose {
            let ms = |x: Option<f64>| x.map_or_else(|| "–".to_string(), |x| format!("{x:.1}"));
            self.line(&format!(
                "{}: {:?} on {}; ms: read {} parse {} update {} trace {} encode {} write {}",
                frame.picture,
                frame.status,
                frame.device.as_deref().unwrap_or("no device"),
                ms(frame.ms.read),
                ms(frame.ms.parse),
                ms(frame.ms.update),
                ms(frame.ms.trace),
                ms(frame.ms.encode),
                ms(frame.ms.write),
            ));
        }
        self.keep_state();
        let percent = 100.0 * self.ended.min(self.frames) as f64 / self.frames.max(1) as f64;
        match self.kind {
            ProgressKind::Openjd => out!("openjd_progress: {percent:.1}"),
            ProgressKind::Alf => out!("ALF_PROGRESS {percent:.0}%"),
            ProgressKind::Afanasy => {
                out!("PROGRESS: {percent:.0}%");
                if frame.status != Status::Failed {
                    // what its monitor shows of the frame
                    out!("@IMAGE@{}", Path::new(&self.folder).join(&frame.picture).display());
                }
            }
            _ => {}
        }
        if let Some(bar) = &self.bar {
            bar.inc(1);
            if self.failed > 0 {
                bar.set_message(format!("{} failed", self.failed));
            }
        } else if self.plain && self.since.s() - self.told_s >= PLAIN_EVERY_S {
            self.told_s = self.since.s();
            let rate = self.ended as f64 / self.told_s;
            let left_s = (self.frames - self.ended.min(self.frames)) as f64 / rate;
            self.line(&format!(
                "{}/{} frames, {rate:.2} frames/s, {left_s:.0} s left",
                self.ended, self.frames
            ));
        }
    }

    /// For whoever asks how far the run is.
    fn keep_state(&self) {
        let Self { frames, ended, failed, .. } = self;
        stop::keep_state(format!("{ended} of {frames} frames have ended, {failed} failed"));
    }

    /// Prints a line above the bar.
    pub(super) fn line(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| err!("{text}")),
            None => err!("{text}"),
        }
    }

    /// Takes the bar away and tells what was counted.
    pub(super) fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
        if self.kind == ProgressKind::Openjd {
            let (done, failed) = (self.ended - self.failed, self.failed);
            out!("openjd_status: {done} of {} frames, {failed} failed", self.frames);
            if failed > 0 {
                out!("openjd_fail: {failed} frames failed");
            }
        }
        for (error, times) in self.errors.iter().filter(|(_, times)| **times > 1 && !self.verbose) {
            err!("error: the same {} more times: {error}", times - 1);
        }
        for (text, files) in self.warned.iter().filter(|(_, files)| **files > FILES_TOLD && !self.verbose) {
            err!("warning: the same for {} more files: {text}", files - FILES_TOLD);
        }
    }
}
