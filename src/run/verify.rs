//! Renders a job in ways that must not matter, and compares what comes out byte for byte.

use super::{Event, Fleet, Outcome, RunError, RunOptions, render};
use crate::device::Stop;
use crate::job::{Job, Order};
use crate::output;
use crate::scene::Aov;
use std::path::Path;
use std::sync::Arc;

/// A way to render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Way {
    /// What it is called.
    pub name: &'static str,
    cold: bool,
    order: Order,
}

/// All ways; the others are compared with the first.
pub const WAYS: [Way; 4] = [
    Way { name: "warm", cold: false, order: Order::Forward },
    Way { name: "cold", cold: true, order: Order::Forward },
    Way { name: "reverse", cold: false, order: Order::Reverse },
    Way { name: "shuffled", cold: false, order: Order::Shuffle },
];

/// What verifying found.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// The same files with the same bytes.
    Equal,
    /// Where a way first differs from the first one.
    Differs {
        /// The way.
        way: &'static str,
        /// What differs.
        what: String,
    },
    /// There is nothing to compare: every frame failed in every way.
    Nothing,
    /// It was stopped.
    Stopped,
}

/// Renders in all ways, to folders of a temporary one, with devices of its own each, and compares pictures and ids.
/// Frames that fail must fail in every way. Gives the outcome of the first way, too.
///
/// # Errors
/// Where there is no room, a run cannot begin, or `fleet` makes none.
pub fn verify<E: From<RunError>>(
    job: &Job,
    options: &RunOptions,
    mut fleet: impl FnMut() -> Result<Fleet, E>,
    stop: &Stop,
    on_event: &mut dyn FnMut(&Way, &Event),
) -> Result<(Verdict, Outcome), E> {
    let room = tempfile::tempdir().map_err(RunError::NoRoom)?;
    let mut run = |way: Way| -> Result<Outcome, E> {
        let job = job_of(job, way, &room.path().join(way.name));
        let options = RunOptions { cold: way.cold, report: None, overwrite: false, ..options.clone() };
        Ok(render(&job, &options, &fleet()?, stop, &mut |event| on_event(&way, event))?)
    };
    let first = run(WAYS[0])?;
    if first.stopped {
        return Ok((Verdict::Stopped, first));
    }
    for way in &WAYS[1..] {
        if run(*way)?.stopped {
            return Ok((Verdict::Stopped, first));
        }
        let [a, b] = [WAYS[0].name, way.name].map(|name| room.path().join(name));
        if let Some(what) = output::first_difference(&a, &b).map_err(RunError::Output)? {
            return Ok((Verdict::Differs { way: way.name, what }, first));
        }
    }
    let failed = first.failed().count();
    let verdict = if failed > 0 && failed == job.pictures.len() { Verdict::Nothing } else { Verdict::Equal };
    Ok((verdict, first))
}

/// The job that renders to a folder in the order of a way, ids with every picture.
fn job_of(job: &Job, way: Way, folder: &Path) -> Job {
    let mut job = Job { folder: folder.to_path_buf(), ..job.clone() };
    for picture in &mut job.pictures {
        Arc::make_mut(&mut picture.settings).aovs.insert(Aov::Id);
    }
    way.order.apply(&mut job.pictures);
    job
}
