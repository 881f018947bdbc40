//! `rentix bench`.

use super::store::store;
use super::{EXIT_FAILED, Global};
use crate::bench::{self, BenchOptions, Event, Mitsuba, WORKLOADS, Workload};
use crate::run::machine;
use anyhow::Result;
use clap::Args;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::process::ExitCode;

/// What `bench` takes.
#[derive(Args, Debug)]
#[allow(clippy::doc_markdown, reason = "the text is help on a terminal")]
pub(super) struct BenchArgs {
    /// What to measure [default: everything]
    #[arg(value_name = "NAME", value_parser = WORKLOADS.map(|w| w.name))]
    names: Vec<String>,
    /// Where tables and charts go
    #[arg(short, long, value_name = "DIR", default_value = "bench")]
    output: PathBuf,
    /// Fewer runs, smaller made scenes
    #[arg(long)]
    quick: bool,
    /// This table alone (may be repeated)
    #[arg(long, value_name = "TABLE", value_parser = WORKLOADS.iter().flat_map(|w| w.tables).copied().collect::<Vec<_>>())]
    only: Vec<String>,
    /// A folder of scenes; without it made ones are taken [default: RENTIX_SCENES]
    #[arg(long, value_name = "DIR")]
    scenes: Option<PathBuf>,
    /// The program made of benches/peers/embree_bench.cpp [default: RENTIX_EMBREE]
    #[arg(long, value_name = "PROGRAM")]
    embree: Option<PathBuf>,
    /// The script mitsuba_anim.py, run beside the tables of devices by python3 [default: RENTIX_MITSUBA]
    #[arg(long, value_name = "SCRIPT")]
    mitsuba: Option<PathBuf>,
    /// The variant of Mitsuba that it runs
    #[arg(long, value_name = "NAME", default_value = "cuda_ad_rgb")]
    mitsuba_variant: String,
    /// The device to measure; needs and stability are of the CPU [default: the best there is]
    #[arg(long, value_name = "NAME")]
    device: Option<String>,
    /// NAME.json of an earlier run: what is slower now is named, and the exit status is 1
    #[arg(long, value_name = "FILE")]
    baseline: Option<PathBuf>,
    /// Threads [default: all cores]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
}

/// Runs the workloads and prints their tables.
pub(super) fn bench(args: &BenchArgs, global: &Global) -> Result<ExitCode> {
    let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let options = BenchOptions {
        program: std::env::current_exe()?,
        folder: args.output.clone(),
        scenes: args.scenes.clone().or_else(|| set("RENTIX_SCENES")),
        embree: args.embree.clone().or_else(|| set("RENTIX_EMBREE")),
        mitsuba: (args.mitsuba.clone().or_else(|| set("RENTIX_MITSUBA")))
            .map(|script| Mitsuba { script, variant: args.mitsuba_variant.clone() }),
        device: args.device.clone(),
        store: store(None).map(|store| store.root().to_path_buf()),
        quick: args.quick,
        only: args.only.clone(),
        threads: args.threads.map_or_else(|| machine::machine().cores, usize::from),
    };
    let is_asked = |w: &Workload| {
        let has_table = args.only.iter().any(|table| w.tables.contains(&table.as_str()));
        (args.names.is_empty() || args.names.iter().any(|name| name == w.name))
            && (args.only.is_empty() || has_table)
    };
    let workloads: Vec<Workload> = WORKLOADS.into_iter().filter(is_asked).collect();
    let slower = bench::bench(&workloads, options, args.baseline.as_deref(), &mut |event| match event {
        Event::Stage(what) if !(global.quiet || global.json) => err!("{what} ..."),
        Event::Stage(_) => {}
        Event::Table(table) if global.json => {
            out!("{}", serde_json::to_value(table).unwrap_or_default());
        }
        Event::Table(table) => out!("{table}"),
        Event::LeftOut(what, why) => err!("{what} is left out: {why}"),
    })?;
    for one in &slower {
        err!("{one}");
    }
    Ok(if slower.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(EXIT_FAILED) })
}
