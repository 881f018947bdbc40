//! A picture is traced in cuts of tiles: so small that no driver takes a dispatch for a hang, that a run can be stopped, and
//! that rays that wait have room.

use std::ops::Range;

/// Threads of a workgroup that traces.
pub(super) const GROUP: u32 = 64;

/// Threads that take one pixel's samples side by side at most.
pub(super) const LANES_MOST: u32 = 16;

/// Pixels whose codes are packed into whole words.
pub(super) const CODES: u32 = 4;

/// What one dispatch traces: whole rows of tiles, or a part of one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Cut {
    /// Rows of the picture.
    pub(super) rows: Range<u32>,
    /// The first tile of each row of tiles.
    pub(super) first_tile: u32,
    /// Tiles, a workgroup each.
    pub(super) groups: [u32; 2],
}

/// Samples of one dispatch at most while nothing is known of how long they take: the slowest GPUs take a tenth of a second
/// for them.
const SAMPLES_UNKNOWN: u64 = 1 << 22;
/// Of frames with rays that branch so many times fewer.
const BRANCHING: u64 = 8;
/// How long a dispatch should take at most, ms.
const DISPATCH_MS: f64 = 10.0;
/// Samples of one dispatch in any case.
const SAMPLES_LEAST: u64 = 1 << 16;
/// Samples of one dispatch at most: the next frame may be a hundred times harder than the last one.
const SAMPLES_MOST: u64 = 1 << 25;

/// How fast a device traces, from the frame before.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pace {
    samples_per_ms: Option<f64>,
}

impl Pace {
    /// Learns from a frame of so many samples.
    pub(super) fn learn(&mut self, samples: u64, ms: f64) {
        self.samples_per_ms = (ms > 0.0).then(|| samples as f64 / ms);
    }

    /// Samples of a dispatch of the next frame at most, where each sends so many rays to lights.
    pub(super) fn samples_most(self, has_branches: bool, shadows: u64) -> u64 {
        let unknown = SAMPLES_UNKNOWN / if has_branches { BRANCHING } else { 1 } / shadows.max(1);
        let known = self.samples_per_ms.map(|rate| (rate * DISPATCH_MS) as u64);
        known.unwrap_or(unknown).clamp(SAMPLES_LEAST, SAMPLES_MOST)
    }
}

/// The pixels of a workgroup where so many threads share one: a tile of so many columns and rows. Twin of `tile_columns` and
/// `tile_rows` in shaders/trace.wgsl.
pub(super) fn tile(lanes: u32) -> [u32; 2] {
    let pixels = GROUP / lanes;
    let columns = (1 << pixels.ilog2().div_ceil(2)).max(CODES);
    [columns, pixels / columns]
}

/// Cuts a picture into so many tiles at most, whole rows of them where there is one, one tile at least; into so many of those
/// rows at most.
pub(super) fn cuts(size: [u32; 2], [columns, rows]: [u32; 2], tiles_most: u64, groups_most: u32) -> Vec<Cut> {
    let [across, down] = [size[0].div_ceil(columns), size[1].div_ceil(rows)];
    let high = (tiles_most / u64::from(across)).min(u64::from(down.min(groups_most))) as u32;
    let (wide, high) = match high {
        0 => (tiles_most.max(1) as u32, 1),
        high => (across, high),
    };
    let cut = |top: u32, left: u32| {
        let groups = [wide.min(across - left), high.min(down - top)];
        let end = size[1].min((top + groups[1]) * rows);
        Cut { rows: top * rows..end, first_tile: left, groups }
    };
    let of_row = |top| (0..across).step_by(wide as usize).map(move |left| cut(top, left));
    (0..down).step_by(high as usize).flat_map(of_row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dispatches_are_as_long_as_the_pace_allows() {
        let pace = |samples, ms| {
            let mut pace = Pace::default();
            pace.learn(samples, ms);
            [pace.samples_most(false, 1), pace.samples_most(true, 64)]
        };
        assert_eq!([false, true].map(|b| Pace::default().samples_most(b, 1)), [1 << 22, 1 << 19]);
        assert_eq!(
            [0, 4, 1 << 40].map(|s| Pace::default().samples_most(false, s)),
            [1 << 22, 1 << 20, 1 << 16]
        );
        // a million samples a ms, a hundred thousand, a hundred, very many; a frame that took no time teaches nothing
        assert_eq!(pace(3_000_000, 3.0), [10_000_000; 2]);
        assert_eq!(pace(300_000, 3.0), [1_000_000; 2]);
        assert_eq!(pace(300, 3.0), [1 << 16; 2]);
        assert_eq!(pace(1 << 40, 1.0), [1 << 25; 2]);
        assert_eq!(pace(1 << 40, 0.0), [1 << 22, 1 << 16]);
    }

    #[test]
    fn cuts_cover_all_tiles_once() {
        for lanes in [1, 2, 4, 8, 16] {
            let tile = tile(lanes);
            assert_eq!(tile[0] * tile[1] * lanes, GROUP);
            for (size, tiles_most, groups_most) in [
                ([75_u32, 43_u32], 1, 100),
                ([75, 43], 3, 2),
                ([75, 43], 47, 100),
                ([75, 43], 47, 3),
                ([1, 1], 0, 100),
                ([1280, 720], 1 << 40, 1 << 16),
            ] {
                let [across, down] = [size[0].div_ceil(tile[0]), size[1].div_ceil(tile[1])];
                let mut traced = vec![0; (across * down) as usize];
                for cut in cuts(size, tile, tiles_most, groups_most) {
                    let [wide, high] = cut.groups;
                    assert!(u64::from(wide * high) <= tiles_most.max(1));
                    assert!(high <= groups_most);
                    assert_eq!(cut.rows.start % tile[1], 0);
                    assert_eq!((cut.rows.end - cut.rows.start).div_ceil(tile[1]), high);
                    assert!(cut.rows.end <= size[1]);
                    for y in 0..high {
                        let first = (cut.rows.start / tile[1] + y) * across + cut.first_tile;
                        traced[first as usize..(first + wide) as usize].iter_mut().for_each(|n| *n += 1);
                    }
                }
                assert!(traced.iter().all(|&n| n == 1), "{size:?} in {tiles_most} tiles: {traced:?}");
            }
        }
    }
}
