//! What a warm frame costs besides tracing and encoding, on one core: reading, diffing, planning, updating the device.

use super::table::{Cell, Table};
use super::times::Spread;
use super::{Bench, BenchError};
use crate::clock::Stopwatch;
use crate::device::Device;
use crate::device::cpu::CpuDevice;
use crate::diff::changes;
use crate::plan::{Update, Wishes, plan_frame};
use crate::run::{Sources, read_frame};
use crate::warning::Warnings;
use std::path::Path;

/// What a wave is measured against.
pub(super) struct WarmPeers {
    /// The rate at which its frames are read with the one before at hand, MB/s.
    pub(super) reading: Option<f64>,
    /// Embree's refit of its mesh with one thread, ms.
    pub(super) embree_refit_ms: Option<f64>,
}

/// Frames of each wave from the second on.
pub(super) fn warm_frames(bench: &Bench, waves: &[(String, &Path, WarmPeers)]) -> Result<Table, BenchError> {
    let mut table = Table::new(
        "warm",
        "A warm frame besides tracing and encoding, one core, medians over a wave's frames; bar: bytes by the reading rate above, and Embree's refit with one thread.",
        &["MB", "read and parse, ms", "diff, ms", "update, ms", "all, ms", "bar, ms", "all/bar"],
    );
    for (name, folder, peers) in waves {
        let job = bench.job(folder, None)?;
        let mut device = CpuDevice::new(1, u64::MAX).map_err(|_| BenchError::NoThreads)?;
        let sources = Sources::default();
        let mut before = None;
        let mut ms: [Vec<f64>; 4] = Default::default();
        let mut bytes = 0;
        for picture in &job.pictures {
            let mut warnings = Warnings::default();
            let clock = Stopwatch::start();
            let frame =
                read_frame(&job, picture, &sources, false, &mut warnings).map_err(BenchError::Frame)?;
            let read_ms = clock.ms();
            let change = changes(before.as_ref(), &frame);
            let diff_ms = clock.ms();
            let wishes = Wishes { update: Update::Refit, ..Wishes::default() };
            let plan = plan_frame(&frame, device.residency(), &wishes);
            device.apply(&plan, &frame).map_err(|e| BenchError::Frame(e.to_string()))?;
            let all_ms = clock.ms();
            if before.is_some() && change.deformed > 0 {
                let times = [read_ms, diff_ms - read_ms, all_ms - diff_ms, all_ms];
                ms.iter_mut().zip(times).for_each(|(ms, t)| ms.push(t));
                let file = picture.main_file(&job.sequences[picture.sequence]);
                bytes = file.and_then(|f| f.path.metadata().ok()).map_or(0, |m| m.len());
            }
            before = Some(frame);
        }
        let megabytes = bytes as f64 / 1e6;
        let bar = peers
            .reading
            .zip(peers.embree_refit_ms)
            .map(|(rate, refit_ms)| megabytes / rate * 1e3 + refit_ms);
        let [read, diff, update, all] = ms.map(|ms| Cell::from(Spread::of(ms)));
        table.row(
            name.clone(),
            [megabytes.into(), read, diff, update, all, bar.into(), Cell::from(bar).times_in(all)],
        );
    }
    Ok(table)
}
