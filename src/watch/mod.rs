//! The daemon: a folder in which jobs appear, rendered in turn by what `run` does (CONTRACT 8).
//!
//! A scan of the inbox decides what there is and when it is whole; file-system events only wake it. A job is claimed by a
//! lock file before anything is done with it, and each change of its state goes to the journal and to its `status.json`.
//! One thread drives all that; one looks into what arrives, one renders, one tells of what ended, one serves the page.
//!
//! What the daemon keeps is in `DIR/.rentix-watch/`: `claims`, `journal`, and `unpacked`, the archives that are rendered.

mod archive;
mod claim;
mod daemon;
mod follow;
mod follow_run;
mod hints;
mod inbox;
mod intake;
mod job;
mod journal;
mod notice;
mod page;
mod renderer;
mod settle;
mod state;
mod view;

pub use notice::Notices;
pub use state::{FrameCounts, State, Status, Times};

use crate::device::Stop;
use crate::job::Request;
use crate::output::OutputError;
use crate::run::{Event, Fleet, Outcome, RunOptions};
use std::io;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What the daemon is asked to do.
#[derive(Clone, Debug)]
pub struct WatchOptions {
    /// Where jobs appear.
    pub inbox: PathBuf,
    /// Where their pictures go, each job's into a folder of its name.
    pub out: PathBuf,
    /// How long a job has rested when it is whole.
    pub settle: Duration,
    /// Render frames of sequences that are still growing.
    pub follow: bool,
    /// End when every job present has ended.
    pub once: bool,
    /// The priority of jobs that say nothing of it; higher first.
    pub priority: i64,
    /// What a job does not say itself.
    pub defaults: Request,
    /// What bears on the runs themselves.
    pub run: RunOptions,
    /// Where the status page is served.
    pub listen: Option<SocketAddr>,
    /// Who is told of jobs that ended.
    pub notices: Notices,
}

/// What the daemon tells while it goes on.
#[derive(Debug)]
pub enum WatchEvent<'a> {
    /// It watches; the page's address, where one is served.
    Ready(Option<SocketAddr>),
    /// A job came into a state.
    State(&'a Status),
    /// What a job's run tells.
    Run(&'a str, &'a Event),
    /// A job's run ended.
    Ended(&'a str, &'a Outcome),
    /// Something is in the way and is waited for, or is left alone.
    Note(&'a str),
}

/// Why the daemon cannot begin, or what is in its way meanwhile.
#[derive(Debug, thiserror::Error)]
pub enum WatchError {
    /// A file or folder refuses.
    #[error("{}: cannot be {what}: {source}; look whether it is there, may be used, and has space", path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// What was to be done with it.
        what: &'static str,
        /// What the system says.
        source: io::Error,
    },
    /// A status cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The inbox and the output folder lie within one another.
    #[error("{} and {}: pictures would go into the inbox, or jobs into the pictures; name two folders apart (-o)", .0.display(), .1.display())]
    Nested(PathBuf, PathBuf),
    /// The page's address is taken, or not this machine's.
    #[error("{address}: cannot be listened at: {source}; --listen names another address")]
    Listen {
        /// Which.
        address: SocketAddr,
        /// What the system says.
        source: io::Error,
    },
    /// An address that mail or a webhook goes to is none.
    #[error("{0}")]
    Notice(String),
}

/// For `map_err` of what was to be done with a path.
fn cannot(what: &'static str, path: &Path) -> impl FnOnce(io::Error) -> WatchError {
    move |source| WatchError::File { path: path.to_path_buf(), what, source }
}

/// How the daemon ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ended {
    /// Jobs present that failed.
    pub failed: usize,
    /// Whether it was asked to stop.
    pub stopped: bool,
}

/// What wakes the thread that drives everything.
#[derive(Debug)]
enum Message {
    /// Something happened in the inbox.
    Hint,
    /// A job was looked into: its priority, or why it cannot be.
    Examined(u64, String, Result<Option<i64>, String>),
    /// What became of an order.
    Told(u64, renderer::Told),
    /// Somebody was told of a job's end, or that was tried as often as it is.
    WasTold(Box<Status>),
    /// What could not be told.
    Note(String),
}

/// Watches until it is asked to stop, or with `once` until every job present has ended. `on_event` is called on this thread.
pub fn watch(
    options: &WatchOptions,
    fleet: Fleet,
    stop: &Stop,
    on_event: &mut dyn FnMut(&WatchEvent<'_>),
) -> Result<Ended, WatchError> {
    daemon::Daemon::open(options, fleet, on_event)?.watch(stop)
}
