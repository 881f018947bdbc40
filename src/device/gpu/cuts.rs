//! A picture is traced in cuts of whole rows: so small that no driver takes a dispatch for a hang, that a run can be stopped,
//! and that rays that wait have room.

use std::ops::Range;

/// Threads of a workgroup that traces.
pub(super) const GROUP: u32 = 64;

/// Rows of the picture that one dispatch traces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Cut {
    pub(super) rows: Range<u32>,
    pub(super) groups: [u32; 2],
}

/// The pixels of a workgroup where so many threads share one: a tile of so many columns and rows.
pub(super) fn tile(lanes: u32) -> [u32; 2] {
    let bits = (GROUP / lanes).ilog2();
    [1 << bits.div_ceil(2), 1 << (bits / 2)]
}

/// Cuts a picture into so many rows at most, whole tiles each; one row of tiles at least.
pub(super) fn cuts(size: [u32; 2], [columns, rows]: [u32; 2], rows_most: u64) -> Vec<Cut> {
    let [width, height] = size;
    let step = (rows_most.min(u64::from(height)) as u32 / rows).max(1) * rows;
    // nothing is left over for a last cut of a few rows
    let step = if step >= height { height.next_multiple_of(rows) } else { step };
    let cut = |first: u32| {
        let end = height.min(first.saturating_add(step));
        Cut { rows: first..end, groups: [width.div_ceil(columns), (end - first).div_ceil(rows)] }
    };
    (0..height).step_by(step as usize).map(cut).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cuts_cover_all_rows_once() {
        for lanes in [1, 2, 4, 8, 16] {
            let tile = tile(lanes);
            assert_eq!(tile[0] * tile[1] * lanes, GROUP);
            for (size, rows_most) in [([75, 43], 1), ([75, 43], 20), ([1, 1], 0), ([1280, 720], 1 << 40)] {
                let mut next = 0;
                for cut in cuts(size, tile, rows_most) {
                    assert_eq!(cut.rows.start, next);
                    assert!(cut.groups[0] * tile[0] >= size[0]);
                    assert!(cut.groups[1] * tile[1] >= cut.rows.end - cut.rows.start);
                    assert!((cut.rows.end - cut.rows.start) as u64 <= rows_most.max(u64::from(tile[1])));
                    next = cut.rows.end;
                }
                assert_eq!(next, size[1]);
            }
        }
    }
}
