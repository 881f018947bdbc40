//! Refit or rebuild over whole sequences: what the policy's choice takes against always doing one, and frame by frame.

use super::chart::{Chart, Line, Panel};
use super::table::{Cell, Table};
use super::times::Spread;
use super::{Bench, BenchError, rendered};
use crate::device::cpu::CpuDevice;
use crate::plan::Update;
use crate::run::{FrameReport, RunOptions};
use std::path::PathBuf;

const UPDATES: [(&str, Update); 3] =
    [("auto", Update::Auto), ("refit", Update::Refit), ("rebuild", Update::Rebuild)];

/// A sequence, and whether it gets a chart.
pub(super) struct Input {
    /// Its name.
    pub(super) name: String,
    /// A folder.
    pub(super) folder: PathBuf,
    /// Whether its frames are charted.
    pub(super) is_charted: bool,
}

/// Renders each sequence in each way and adds up what updating and tracing took.
pub(super) fn policy(bench: &Bench, inputs: &[Input]) -> Result<(Table, Vec<Chart>), BenchError> {
    let mut table = Table::new(
        "policy",
        "Updating and tracing whole sequences, ms: the policy against always refitting and always rebuilding; medians of rounds in turn.",
        &["frames", "auto, ms", "refit, ms", "rebuild, ms", "auto/better", "refits", "builds", "cost ratio"],
    );
    let mut charts = Vec::new();
    let mut sums = [0.0; 3];
    let mut better_sum = 0.0;
    for input in inputs {
        let mut ms: [Vec<f64>; 3] = Default::default();
        let mut last: [Vec<FrameReport>; 3] = Default::default();
        for _ in 0..bench.rounds(3) {
            for (i, (_, update)) in UPDATES.iter().enumerate() {
                last[i] = render(bench, input, *update)?;
                ms[i].push(last[i].iter().map(update_and_trace_ms).sum());
            }
        }
        let [auto, refit, rebuild] = ms.map(Spread::of);
        let medians = [auto, refit, rebuild].map(|s| s.map_or(0.0, |s| s.median));
        let better = medians[1].min(medians[2]);
        sums.iter_mut().zip(medians).for_each(|(sum, ms)| *sum += ms);
        better_sum += better;
        let count = |action: &str| last[0].iter().filter(|f| f.update.action == Some(action)).count() as f64;
        let worst = last[1].iter().filter_map(|f| f.update.cost_ratio).fold(1.0, f64::max);
        table.row(
            input.name.clone(),
            [
                (last[0].len() as f64).into(),
                auto.into(),
                refit.into(),
                rebuild.into(),
                Cell::from(better).times_in(auto.into()),
                count("refit").into(),
                (count("rebuild") + count("load")).into(),
                worst.into(),
            ],
        );
        if input.is_charted {
            charts.push(chart(&input.name, &last));
        }
    }
    let [auto, refit, rebuild] = sums.map(Cell::from);
    let frames = table.rows.iter().filter_map(|(_, cells)| cells[0].value()).sum::<f64>();
    let ratio = Cell::from(better_sum).times_in(auto);
    table.row("all", [frames.into(), auto, refit, rebuild, ratio, Cell::Absent, Cell::Absent, Cell::Absent]);
    Ok((table, charts))
}

fn update_and_trace_ms(frame: &FrameReport) -> f64 {
    frame.ms.update.unwrap_or(0.0) + frame.ms.trace.unwrap_or(0.0)
}

fn render(bench: &Bench, input: &Input, update: Update) -> Result<Vec<FrameReport>, BenchError> {
    let job = bench.job(&input.folder, None)?;
    let device = CpuDevice::new(bench.options.threads, u64::MAX).map_err(|_| BenchError::NoThreads)?;
    let options = RunOptions {
        threads: bench.options.threads,
        update,
        overwrite: true,
        keeps_reports: true,
        ..RunOptions::default()
    };
    Ok(rendered(&job, &options, device)?.report.frames)
}

/// Cost ratio and time by frame, for each way.
fn chart(name: &str, ways: &[Vec<FrameReport>; 3]) -> Chart {
    let lines = |of: fn(&FrameReport) -> Option<f64>| -> Vec<Line> {
        let points = |frames: &[FrameReport]| -> Vec<(f64, f64)> {
            let numbered = frames.iter().enumerate().map(|(i, f)| (i as f64 + 1.0, of(f)));
            numbered.filter_map(|(x, y)| Some((x, y?))).collect()
        };
        let named = UPDATES.iter().zip(ways);
        named.map(|((name, _), frames)| Line { name: (*name).to_string(), points: points(frames) }).collect()
    };
    Chart {
        name: format!("updates-{}", name.replace([' ', ','], "-").replace("--", "-")),
        title: name.to_string(),
        panels: vec![
            Panel {
                x: "frame".to_string(),
                is_log_x: false,
                y: "surface-area cost over the last build's".to_string(),
                is_log: true,
                lines: lines(|f| f.update.cost_ratio),
            },
            Panel {
                x: "frame".to_string(),
                is_log_x: false,
                y: "update and trace, ms".to_string(),
                is_log: false,
                lines: lines(|f| Some(update_and_trace_ms(f))),
            },
        ],
    }
}
