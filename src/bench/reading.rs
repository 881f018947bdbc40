//! How fast OBJ frames are read, as a multiple of what tobj needs for the same files: one thread, the files in the page
//! cache.

use super::Bench;
use super::table::{Cell, Table};
use super::times::in_turn;
use crate::format::{ReadOptions, TextureCache, load_obj, load_obj_after};
use std::hint::black_box;
use std::path::PathBuf;

/// Pairs of frames that are read of a sequence.
const PAIRS: usize = 4;

/// Frames that follow each other: of each pair the second is read with the first at hand.
pub(super) struct Consecutive {
    /// Its name.
    pub(super) name: String,
    /// The pairs.
    pub(super) pairs: Vec<[PathBuf; 2]>,
}

impl Consecutive {
    /// Pairs of a sequence's files, spread over it.
    pub(super) fn of(name: &str, files: &[PathBuf]) -> Self {
        let last = files.len().saturating_sub(2);
        let mut starts: Vec<usize> = (0..PAIRS).map(|i| last * i / (PAIRS - 1)).collect();
        starts.dedup();
        let pair = |&i: &usize| Some([files.get(i)?.clone(), files.get(i + 1)?.clone()]);
        Self { name: name.to_string(), pairs: starts.iter().filter_map(pair).collect() }
    }
}

/// The column of the rate at which frames are read with the one before at hand.
pub(super) const RATE: &str = "next, MB/s";

/// Reads each.
pub(super) fn reading(bench: &Bench, all: &[Consecutive]) -> Table {
    let mut table = Table::new(
        "reading",
        "Reading OBJ, one thread: mean of frames spread over each sequence; \"next\" is a frame with the one before it at hand.",
        &["MB", "tobj, ms", "whole, ms", "next, ms", RATE, "tobj/whole", "tobj/next"],
    );
    let (options, textures) = (ReadOptions::default(), TextureCache::default());
    let for_tobj = tobj::LoadOptions { triangulate: true, ..Default::default() };
    for Consecutive { name, pairs } in all {
        let before: Vec<_> = pairs
            .iter()
            .map(|[file, _]| {
                load_obj_after(None, Vec::new(), file, &options, &textures).ok().and_then(|(_, p)| p)
            })
            .collect();
        let next = || pairs.iter().map(|[_, next]| next);
        let count = pairs.len().max(1) as f64;
        let bytes: u64 = next().map(|f| f.metadata().map_or(0, |m| m.len())).sum();
        let per_frame = |ms: super::Spread| super::Spread {
            median: ms.median / count,
            least: ms.least / count,
            greatest: ms.greatest / count,
        };
        let [tobj, whole, next] = in_turn(
            bench.rounds(11),
            [
                &mut || next().for_each(|f| drop(black_box(tobj::load_obj(f, &for_tobj)))),
                &mut || next().for_each(|f| drop(black_box(load_obj(f, &options, &textures)))),
                &mut || {
                    for (before, f) in before.iter().zip(next()) {
                        drop(black_box(load_obj_after(before.as_ref(), Vec::new(), f, &options, &textures)));
                    }
                },
            ],
        )
        .map(per_frame);
        let megabytes = bytes as f64 / count / 1e6;
        let [tobj, whole, again] = [tobj, whole, next].map(Cell::from);
        let rate = Cell::from(megabytes / next.median * 1e3);
        let row = [megabytes.into(), tobj, whole, again, rate, whole.times_in(tobj), again.times_in(tobj)];
        table.row(name.clone(), row);
    }
    table
}
