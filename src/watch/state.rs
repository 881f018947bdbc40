//! What is known of a job: `DIR/NAME/status.json`, replaced whole.

use crate::clock;
use crate::output::{self, OutputError};
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Where a job stands (CONTRACT 8).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Seen; it may still grow.
    #[default]
    Received,
    /// Whole; it is being looked into.
    Accepted,
    /// Waits for its turn.
    Queued,
    /// Frames of it are being rendered.
    Running,
    /// Every picture is there.
    Finished,
    /// Some picture is not there; the error says why.
    Failed,
    /// Its owner does not want it any more.
    Cancelled,
}

impl State {
    /// All, in order.
    pub const ALL: [Self; 7] = [
        Self::Received,
        Self::Accepted,
        Self::Queued,
        Self::Running,
        Self::Finished,
        Self::Failed,
        Self::Cancelled,
    ];

    /// Its word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Received => "received",
            Self::Accepted => "accepted",
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Finished => "finished",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
        }
    }

    /// Whether nothing more happens to the job as it stands.
    pub fn is_end(self) -> bool {
        self >= Self::Finished
    }
}

/// Frames of a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameCounts {
    /// Whose pictures are there.
    pub done: u64,
    /// That failed.
    pub failed: u64,
    /// Asked for.
    pub all: u64,
}

/// When a job came into its states, milliseconds since the Unix epoch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Times {
    /// First seen.
    pub received_ms: u64,
    /// Found whole.
    pub accepted_ms: Option<u64>,
    /// Its first frame begun.
    pub started_ms: Option<u64>,
    /// Finished, failed or cancelled.
    pub ended_ms: Option<u64>,
}

/// What `status.json` says.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// The job's name, that of its folder of pictures.
    pub job: String,
    /// What in the inbox it is made of.
    pub source: String,
    /// Where it stands.
    pub state: State,
    /// Its frames.
    pub frames: FrameCounts,
    /// Why it failed, or what it waits for.
    pub error: Option<String>,
    /// Higher first.
    pub priority: i64,
    /// Names the settled set of files that is rendered; empty before it settled.
    pub run: String,
    /// When.
    pub times: Times,
}

/// No status is longer.
const MAX_BYTES: u64 = 1 << 20;

impl Status {
    /// Comes into a state now.
    pub fn enter(&mut self, state: State, error: Option<String>) {
        self.state = state;
        self.error = error;
        let now = Some(now_ms());
        match state {
            State::Received | State::Queued => self.times.ended_ms = None,
            State::Accepted => {
                self.times = Times { accepted_ms: now, started_ms: None, ended_ms: None, ..self.times };
            }
            State::Running => self.times.started_ms = self.times.started_ms.or(now),
            State::Finished | State::Failed | State::Cancelled => self.times.ended_ms = now,
        }
    }

    /// Whether this is the end of a run of that settled set.
    pub fn ended(&self, run: &str) -> bool {
        self.state.is_end() && self.run == run
    }

    /// What is gone of the pictures in a job's folder that this says are there, in words.
    pub(super) fn gone(&self, folder: &Path) -> Option<String> {
        (self.state == State::Finished).then(|| output::gone(folder, self.frames.done))?
    }

    /// Reads the status in a job's folder of pictures; None where there is none that can be understood.
    pub fn read(folder: &Path) -> Option<Self> {
        let mut bytes = Vec::new();
        File::open(path(folder)).ok()?.take(MAX_BYTES).read_to_end(&mut bytes).ok()?;
        serde_json::from_slice(&bytes).ok()
    }

    /// Replaces the status in a job's folder of pictures; whoever reads it finds the old one or the new. It is not flushed (3 ms,
    /// several times a job): one that a power cut spoils is no status, and its job is gone through again, with every picture
    /// there already.
    pub fn write(&self, folder: &Path) -> Result<(), OutputError> {
        let target = path(folder);
        let temporary = folder.join(output::own_name(".rentix-", ".tmp"));
        let mut bytes = serde_json::to_vec_pretty(self).unwrap_or_default();
        bytes.push(b'\n');
        let written = fs::create_dir_all(folder)
            .and_then(|()| fs::write(&temporary, &bytes))
            .and_then(|()| fs::rename(&temporary, &target));
        written.map_err(|source| {
            // what stays is removed when the job's next run begins
            let _ = fs::remove_file(&temporary);
            OutputError::Write { path: target, source }
        })
    }
}

fn path(folder: &Path) -> PathBuf {
    folder.join("status.json")
}

/// Milliseconds since the Unix epoch.
pub(super) fn now_ms() -> u64 {
    (clock::unix_ns() / 1_000_000) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_status_is_read_as_it_was_written() {
        let t = tempfile::tempdir().unwrap();
        let folder = t.path().join("walk");
        assert_eq!(Status::read(&folder), None);
        let mut status = Status { job: "walk".into(), run: "1".into(), ..Status::default() };
        status.enter(State::Failed, Some("a reason".into()));
        status.write(&folder).unwrap();
        assert_eq!(Status::read(&folder), Some(status.clone()));
        assert!(status.ended("1") && !status.ended("2"));
        let text = fs::read_to_string(folder.join("status.json")).unwrap();
        for part in ["\"state\": \"failed\"", "\"error\": \"a reason\"", "\"done\": 0", "\"ended_ms\""] {
            assert!(text.contains(part), "{text}");
        }
        fs::write(folder.join("status.json"), &text[..20]).unwrap();
        assert_eq!(Status::read(&folder), None);
        for state in State::ALL {
            assert_eq!(serde_json::to_value(state).unwrap(), state.word());
        }
    }
}
