//! The built-in benchmarks: named workloads, each with tables, charts and JSON. Medians of runs in turn; a peer that is
//! not installed is absent, never filled in.

mod accuracy;
mod baseline;
mod chart;
mod child;
mod dots;
mod drawing;
mod embree;
mod estimates;
mod frames;
mod mitsuba;
mod needs;
mod pace;
mod page;
mod peers;
mod policy;
mod reading;
mod recorded;
mod scenes;
mod schedule;
pub mod sequences;
mod stability;
mod start;
mod table;
mod timeline;
mod times;
mod trees;
mod updates;
mod view;
mod warm;
mod warm_cold;

pub use baseline::Slower;

use baseline::Baseline;
use drawing::Drawing;
pub use mitsuba::Mitsuba;
pub use table::{Cell, Table};
pub use times::Spread;

use crate::device::cpu::CpuDevice;
use crate::device::registry::{self, RegistryError};
use crate::device::{Device, Stop};
use crate::job::{self, Job, JobError, Options, Request};
use crate::math::Vec3;
use crate::output::{OutputError, write_atomic};
use crate::run::{self, Fleet, Outcome, RunError, RunOptions, machine};
use crate::schedule::Policy;
use page::Page;
use std::fs::create_dir_all;
use std::io;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use view::View;

/// Renders a job on a device that nobody else has.
fn rendered(job: &Job, options: &RunOptions, device: CpuDevice) -> Result<Outcome, RunError> {
    let fleet = Fleet::new(vec![Box::new(device)], Policy::default());
    run::render(job, options, &fleet, &Stop::default(), &mut |_| {})
}

/// Where the reports of runs stand in the folder of results.
const REPORTS: &str = "reports";

/// What is asked for.
#[derive(Clone, Debug)]
pub struct BenchOptions {
    /// Where tables and charts go.
    pub folder: PathBuf,
    /// A folder of scenes; without it only made ones are taken.
    pub scenes: Option<PathBuf>,
    /// The Embree program (`benches/peers/embree_bench.cpp`).
    pub embree: Option<PathBuf>,
    /// Mitsuba's script for moving meshes.
    pub mitsuba: Option<Mitsuba>,
    /// The device of the tables of devices; None: the best there is.
    pub device: Option<String>,
    /// This program, for runs in processes of their own.
    pub program: PathBuf,
    /// The folder of a store, where references are kept.
    pub store: Option<PathBuf>,
    /// Fewer runs, smaller made scenes.
    pub quick: bool,
    /// The tables to make, by name; all where none is named.
    pub only: Vec<String>,
    /// Threads.
    pub threads: usize,
}

type Run = fn(&Bench, &mut dyn FnMut(&Event<'_>)) -> Result<Findings, BenchError>;

/// A workload.
#[derive(Clone, Copy, Debug)]
pub struct Workload {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it measures.
    pub about: &'static str,
    /// The names of its tables.
    pub tables: &'static [&'static str],
    run: Run,
}

/// All of them.
pub const WORKLOADS: [Workload; 7] = [
    Workload {
        name: "warm-cold",
        tables: &["warm-cold"],
        about: "a frame when everything is new and when it follows another, beside the thesis",
        run: warm_cold::warm_cold,
    },
    Workload {
        name: "accuracy",
        tables: &["accuracy", "defaults"],
        about: "time against error: samples, filters, depth, pruning; the frontier, and whether the defaults are on it",
        run: accuracy::accuracy,
    },
    Workload {
        name: "stability",
        tables: &["stability", "hostile"],
        about: "scenes moved and scaled, sequences that break refits: wrong hits, acne, what rounding takes",
        run: stability::stability,
    },
    Workload {
        name: "needs",
        tables: &["needs"],
        about: "what a feature costs a scene that does not use it, and one that does",
        run: needs::needs,
    },
    Workload {
        name: "updates",
        tables: &["reading", "trees", "warm", "start", "policy", "frames", "timeline", "refit", "rays"],
        about: "what a frame costs that follows another: reading, trees, refit or rebuild, the store, devices",
        run: updates::updates,
    },
    Workload {
        name: "estimates",
        tables: &["estimates"],
        about: "what frames were expected to cost, and what they cost, scene by scene",
        run: estimates::estimates,
    },
    Workload {
        name: "schedule",
        tables: &["makespan", "slowdown", "starts", "affinity", "load", "weights", "decisions"],
        about: "frames to devices, simulated: affinity beside the thesis's policies and others on made traces",
        run: schedule::schedule,
    },
];

/// What is told while it goes on.
#[derive(Debug)]
pub enum Event<'a> {
    /// What is measured now.
    Stage(&'a str),
    /// A table is complete.
    Table(&'a Table),
    /// An input is left out, and why.
    LeftOut(&'a str, &'a str),
}

/// Why a benchmark did not come to its end.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// Made scenes cannot be written.
    #[error("made scenes or results cannot be written: {0}; TMPDIR and -o name other places")]
    Room(#[from] io::Error),
    /// A scene cannot be rendered.
    #[error(transparent)]
    Job(#[from] JobError),
    /// A run cannot begin.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A frame cannot be read or traced.
    #[error("{0}")]
    Frame(String),
    /// There is no such device.
    #[error(transparent)]
    Device(#[from] RegistryError),
    /// The system gives no threads.
    #[error("the system gives no threads; fewer may be asked for by --threads")]
    NoThreads,
    /// An earlier result cannot be compared with.
    #[error("{0}: {1}; --baseline takes the NAME.json of an earlier run of a workload")]
    Baseline(String, String),
    /// A chart cannot be drawn.
    #[error("a chart cannot be drawn: {0}")]
    Chart(String),
    /// The tables cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// What a workload found.
#[derive(Debug, Default)]
struct Findings {
    tables: Vec<Table>,
    charts: Vec<Drawn>,
}

/// A chart.
#[derive(Debug)]
struct Drawn {
    /// Its file name without extension.
    name: String,
    svg: String,
    png: Vec<u8>,
}

impl Findings {
    fn add(&mut self, table: Table, on_event: &mut dyn FnMut(&Event<'_>)) {
        on_event(&Event::Table(&table));
        self.tables.push(table);
    }

    fn draw(&mut self, drawing: &impl Drawing) -> Result<(), BenchError> {
        let name = drawing.name().to_string();
        let svg = drawing.svg().map_err(BenchError::Chart)?;
        let png = drawing.png().map_err(BenchError::Chart)?;
        self.charts.push(Drawn { name, svg, png });
        Ok(())
    }
}

/// What workloads share.
struct Bench {
    options: BenchOptions,
    /// Made scenes and pictures.
    room: TempDir,
}

impl Bench {
    /// How often something is measured that deserves so many times.
    fn rounds(&self, rounds: usize) -> usize {
        if self.options.quick { rounds.div_ceil(4) } else { rounds }
    }

    /// What results must have in common to be compared.
    fn settings(&self) -> serde_json::Value {
        let BenchOptions { quick, threads, device, .. } = &self.options;
        serde_json::json!({"quick": quick, "threads": threads, "device": device})
    }

    /// The device that was named, else the best there is.
    fn device(&self) -> Result<Box<dyn Device>, BenchError> {
        let wanted = registry::Wanted {
            threads: self.options.threads,
            budget_bytes: None,
            host_budget_bytes: machine::default_budget_bytes(),
            store: None,
        };
        Ok(registry::open(self.options.device.as_deref(), &wanted)?)
    }

    fn wants(&self, table: &str) -> bool {
        self.options.only.is_empty() || self.options.only.iter().any(|name| name == table)
    }

    /// A file of the scenes, where it is there.
    fn scene(&self, file: &str) -> Option<PathBuf> {
        let path = self.options.scenes.as_ref()?.join(file);
        path.is_file().then_some(path)
    }

    /// The job of an INPUT, in small pictures, to a folder of the room.
    fn job(&self, input: &Path, view: Option<&View>) -> Result<Job, JobError> {
        let point = |of: fn(&View) -> [f32; 3]| view.map(|v| Vec3::from(of(v)).as_dvec3());
        job::resolve(&Request {
            inputs: vec![input.to_path_buf()],
            options: Options {
                size: Some([640, 360]),
                eye: point(|v| v.eye),
                look_at: point(|v| v.look_at),
                fov: view.map(|v| f64::from(v.fov_deg)),
                ..Options::default()
            },
            folder: Some(self.room.path().join("pictures")),
            ..Request::default()
        })
    }
}

/// Runs workloads and writes what they found: `NAME.json`, charts, and a page with all of it. Gives what is slower than in an
/// earlier `NAME.json`, where one is given.
pub fn bench(
    workloads: &[Workload],
    options: BenchOptions,
    baseline: Option<&Path>,
    on_event: &mut dyn FnMut(&Event<'_>),
) -> Result<Vec<Slower>, BenchError> {
    let bench = Bench { options, room: tempfile::tempdir()? };
    // what cannot end well is told before the work, not after it
    let before = baseline.map(|path| Baseline::read(path, &bench.settings(), workloads)).transpose()?;
    if bench.options.device.is_some() {
        bench.device()?;
    }
    create_dir_all(&bench.options.folder)?;
    let peers = peers::installed(bench.options.embree.as_deref());
    let mut page = Page::new(&bench, &peers);
    let mut slower = Vec::new();
    for workload in workloads {
        let mut paces = Vec::new();
        let mut found = (workload.run)(&bench, &mut |event| {
            if matches!(event, Event::Stage(_)) {
                paces.push(pace::pace_ms(bench.options.threads));
            }
            if !matches!(event, Event::Table(table) if !bench.wants(table.name)) {
                on_event(event);
            }
        })?;
        found.tables.retain(|table| bench.wants(table.name));
        // the best of many moments: in a single one the machine may be busy with something else
        let pace_ms = Spread::of(paces).map_or(0.0, |spread| spread.least);
        let folder = &bench.options.folder;
        let json = serde_json::json!({
            "rentix": env!("CARGO_PKG_VERSION"), "workload": workload.name, "machine": machine::machine(),
            "settings": bench.settings(), "pace_ms": pace_ms, "peers": peers, "tables": found.tables,
        });
        if let Some(before) = before.as_ref().filter(|before| before.is_of(workload.name)) {
            slower.extend(before.slower(&json)?);
        }
        let json = serde_json::to_vec_pretty(&json).unwrap_or_default();
        write_atomic(&folder.join(format!("{}.json", workload.name)), &json)?;
        for Drawn { name, svg, png } in &found.charts {
            write_atomic(&folder.join(format!("{name}.svg")), svg.as_bytes())?;
            write_atomic(&folder.join(format!("{name}.png")), png)?;
        }
        page.add(workload, &found);
        // after each: a later one may not come to its end
        write_atomic(&folder.join("report.html"), page.html(&slower).as_bytes())?;
    }
    Ok(slower)
}
