//! The frames of a job that nobody has taken, as ranges: devices walk forwards, each through a range of its own.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Open frames.
#[derive(Clone, Debug, Default)]
pub(super) struct Ranges {
    /// By the first frame.
    by_start: BTreeMap<u64, Open>,
    /// Lengths and first frames.
    by_length: BTreeSet<(u64, u64)>,
    frames: u64,
}

#[derive(Clone, Copy, Debug)]
struct Open {
    end: u64,
    /// Whether a device stands before its first frame and will go on there.
    is_walked: bool,
}

impl Ranges {
    /// How many frames are open.
    pub(super) fn len(&self) -> u64 {
        self.frames
    }

    /// Opens frames, none of which is open; ranges that touch become one.
    pub(super) fn open(&mut self, frames: Range<u64>) {
        if frames.is_empty() {
            return;
        }
        let Range { mut start, mut end } = frames;
        let mut is_walked = false;
        let before = self.by_start.range(..start).next_back().map(|(&s, &open)| (s, open));
        if let Some((s, open)) = before.filter(|(_, open)| open.end == start) {
            self.remove(s, open);
            (start, is_walked) = (s, open.is_walked);
        }
        if let Some(&open) = self.by_start.get(&end) {
            self.remove(end, open);
            end = open.end;
        }
        self.insert(start, Open { end, is_walked });
    }

    /// Takes at most so many consecutive frames for a device that stands before frame `next`: those, where they are
    /// open; else the largest range, from its beginning where no device walks through it, from the middle (the far
    /// half) where one does: it will walk on to the end while the other comes as far as the middle.
    pub(super) fn take(&mut self, next: Option<u64>, most: u64) -> Option<Range<u64>> {
        let own = next.and_then(|n| self.by_start.get(&n).map(|&open| (n, open)));
        let largest = || {
            let &(_, start) = self.by_length.last()?;
            Some((start, *self.by_start.get(&start)?))
        };
        let (start, open) = own.or_else(largest)?;
        self.remove(start, open);
        let far = if own.is_none() && open.is_walked { start + (open.end - start) / 2 } else { start };
        if far > start {
            self.insert(start, Open { end: far, is_walked: true });
        }
        let end = open.end.min(far.saturating_add(most.max(1)));
        if end < open.end {
            self.insert(end, Open { end: open.end, is_walked: true });
        }
        Some(far..end)
    }

    /// The device that stood before this frame has gone elsewhere.
    pub(super) fn leave(&mut self, next: u64) {
        if let Some(open) = self.by_start.get_mut(&next) {
            open.is_walked = false;
        }
    }

    fn insert(&mut self, start: u64, open: Open) {
        self.by_start.insert(start, open);
        self.by_length.insert((open.end - start, start));
        self.frames += open.end - start;
    }

    fn remove(&mut self, start: u64, open: Open) {
        self.by_start.remove(&start);
        self.by_length.remove(&(open.end - start, start));
        self.frames -= open.end - start;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ranges(frames: u64) -> Ranges {
        let mut ranges = Ranges::default();
        ranges.open(0..frames);
        ranges
    }

    #[test]
    fn a_device_goes_on_where_it_was() {
        let mut open = ranges(100);
        assert_eq!(open.take(None, 10), Some(0..10));
        assert_eq!(open.take(Some(10), 10), Some(10..20));
        assert_eq!(open.len(), 80);
    }

    #[test]
    fn who_joins_takes_the_far_half_of_the_largest_range() {
        let mut open = ranges(100);
        assert_eq!(open.take(None, 20), Some(0..20));
        // 20..100 is walked: its far half is 60..100
        assert_eq!(open.take(None, 10), Some(60..70));
        // 20..60 is larger than 70..100
        assert_eq!(open.take(None, 10), Some(40..50));
        assert_eq!(open.take(Some(20), 50), Some(20..40), "as far as the next device's beginning");
        // 50..60 and 70..100 are left, both walked
        assert_eq!(open.take(Some(40), 10), Some(85..95));
    }

    #[test]
    fn what_was_left_is_taken_from_its_beginning() {
        let mut open = ranges(100);
        assert_eq!(open.take(None, 20), Some(0..20));
        open.leave(20);
        assert_eq!(open.take(None, 20), Some(20..40));
    }

    #[test]
    fn what_comes_back_joins_its_neighbours() {
        let mut open = ranges(30);
        assert_eq!(open.take(None, 10), Some(0..10));
        assert_eq!(open.take(Some(10), 10), Some(10..20));
        open.open(10..20);
        open.open(0..10);
        open.leave(0);
        assert_eq!(open.take(None, 100), Some(0..30));
        assert_eq!((open.len(), open.take(None, 1)), (0, None));
    }

    #[test]
    fn the_last_frame_of_a_walked_range_can_be_taken() {
        let mut open = ranges(2);
        assert_eq!(open.take(None, 1), Some(0..1));
        assert_eq!(open.take(None, 1), Some(1..2));
        assert_eq!(open.take(None, 1), None);
    }
}
