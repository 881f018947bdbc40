//! From start to first ray: without a store, and with one that has what the scene needs.

use super::table::{Cell, Table};
use super::times::Spread;
use super::view::View;
use super::{Bench, BenchError, rendered};
use crate::device::cpu::CpuDevice;
use crate::run::RunOptions;
use crate::store::{DEFAULT_LIMIT_BYTES, Store};
use std::path::Path;
use std::sync::Arc;

/// Each scene, an OBJ of its own.
pub(super) fn starts(bench: &Bench, scenes: &[(&str, &Path, View)]) -> Result<Table, BenchError> {
    let mut table = Table::new(
        "start",
        "From start to first ray (reading, textures, tree), ms: without a store and with a warm one, in turn.",
        &["without, ms", "with, ms", "without/with"],
    );
    for (name, file, view) in scenes {
        let store = Arc::new(Store::new(&bench.room.path().join("store"), DEFAULT_LIMIT_BYTES));
        start_ms(bench, file, view, Some(Arc::clone(&store)))?;
        let mut ms: [Vec<f64>; 2] = Default::default();
        for _ in 0..bench.rounds(11) {
            ms[0].push(start_ms(bench, file, view, None)?);
            ms[1].push(start_ms(bench, file, view, Some(Arc::clone(&store)))?);
        }
        let [without, with] = ms.map(|ms| Cell::from(Spread::of(ms)));
        table.row(*name, [without, with, with.times_in(without)]);
    }
    Ok(table)
}

fn start_ms(bench: &Bench, file: &Path, view: &View, store: Option<Arc<Store>>) -> Result<f64, BenchError> {
    let job = bench.job(file, Some(view))?;
    let threads = bench.options.threads;
    let device =
        CpuDevice::new(threads, u64::MAX).map_err(|_| BenchError::NoThreads)?.with_store(store.clone());
    let options =
        RunOptions { threads, overwrite: true, keeps_reports: true, store, ..RunOptions::default() };
    let outcome = rendered(&job, &options, device)?;
    let ms = outcome.report.frames.first().map(|f| f.ms).unwrap_or_default();
    Ok([ms.read, ms.parse, ms.diff, ms.upload, ms.update].into_iter().flatten().sum())
}
