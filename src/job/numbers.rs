//! Frame numbers as they are typed: `--frames`, `--chunk`, `--order`.

use std::fmt;
use std::num::{IntErrorKind, ParseIntError};
use std::ops::Range;
use std::str::FromStr;

/// A set of frame numbers: `1-100`, `1-100x2` or `1-100:2`, `5,7,9-12`; negative ones too.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameSet(Vec<Run>);

/// `first`, `first + step`, … up to `last`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Run {
    first: i64,
    last: i64,
    step: i64,
}

impl FrameSet {
    /// The set of these numbers, ascending, in runs as long as may be.
    pub fn from_numbers(numbers: &[i64]) -> Self {
        let mut runs: Vec<Run> = Vec::new();
        for &n in numbers {
            match runs.last_mut() {
                Some(run) if run.last.checked_add(1) == Some(n) => run.last = n,
                _ => runs.push(Run { first: n, last: n, step: 1 }),
            }
        }
        Self(runs)
    }

    /// Whether a number is in it.
    pub fn contains(&self, number: i64) -> bool {
        let is_step = |r: &Run| (i128::from(number) - i128::from(r.first)) % i128::from(r.step) == 0;
        self.0.iter().any(|r| (r.first..=r.last).contains(&number) && is_step(r))
    }

    /// How many numbers its runs have; what stands in several counts each time.
    pub fn len(&self) -> u64 {
        let count = |r: &Run| (i128::from(r.last) - i128::from(r.first)) / i128::from(r.step) + 1;
        self.0.iter().map(|r| u64::try_from(count(r)).unwrap_or(u64::MAX)).fold(0, u64::saturating_add)
    }

    /// Whether it holds none; a set that was typed never does.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Its numbers in ascending order, each once.
    pub fn iter(&self) -> impl Iterator<Item = i64> {
        let numbers: std::collections::BTreeSet<i64> =
            self.0.iter().flat_map(|r| (r.first..=r.last).step_by(r.step as usize)).collect();
        numbers.into_iter()
    }

    /// The least number in it that is none of these (sorted).
    pub fn first_not_in(&self, numbers: &[i64]) -> Option<i64> {
        // a run is left for good at its first number that is missing, so this is as long as the numbers are
        let missing = |r: &Run| {
            let mut at = r.first;
            while at <= r.last && numbers.binary_search(&at).is_ok() {
                at = at.checked_add(r.step)?;
            }
            (at <= r.last).then_some(at)
        };
        self.0.iter().filter_map(missing).min()
    }
}

impl fmt::Display for FrameSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, run) in self.0.iter().enumerate() {
            let comma = if i == 0 { "" } else { "," };
            write!(f, "{comma}{}", run.first)?;
            if run.last > run.first {
                write!(f, "-{}", run.last)?;
            }
            if run.step > 1 {
                write!(f, "x{}", run.step)?;
            }
        }
        Ok(())
    }
}

impl FromStr for FrameSet {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split(',').map(|part| match part.trim() {
            "" if text.contains(',') => Err(format!("`{text}`: nothing stands before or behind a comma")),
            part => run(part).map_err(|why| format!("`{part}` {why}")),
        });
        parts.collect::<Result<_, _>>().map(Self)
    }
}

/// One part between commas; else what is wrong with it.
fn run(text: &str) -> Result<Run, String> {
    let (range, step) = match text.split_once(['x', ':']) {
        Some((range, step)) => {
            let step = step.parse().ok().filter(|s| *s > 0);
            (range, step.ok_or("has a step that is no whole number of 1 or more; write 1-100x2")?)
        }
        None => (text, 1),
    };
    // the dash of a range stands behind a digit, that of a negative number does not
    let dash = range
        .bytes()
        .enumerate()
        .position(|(i, b)| b == b'-' && i > 0 && range.as_bytes()[i - 1].is_ascii_digit());
    let (first, last) = match dash {
        Some(i) => (number(&range[..i])?, number(&range[i + 1..])?),
        None => (number(range)?, number(range)?),
    };
    if first > last {
        return Err(format!(
            "ends before it begins; write {last}-{first} (--order reverse takes the last frame first)"
        ));
    }
    Ok(Run { first, last, step })
}

fn number(text: &str) -> Result<i64, String> {
    text.parse().map_err(|e: ParseIntError| match e.kind() {
        IntErrorKind::PosOverflow | IntErrorKind::NegOverflow => {
            format!("is beyond the numbers that frames may have, {} to {}", i64::MIN, i64::MAX)
        }
        _ => "is not a frame number or range; write 1-100, 1-100x2 or 5,7,9-12".to_string(),
    })
}

/// The I-th of N runs of consecutive frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chunk {
    index: usize,
    count: usize,
}

impl Chunk {
    /// Its places among so many frames; the chunks of one N cover all, each once, and differ in length by one at most.
    pub fn range(&self, frames: usize) -> Range<usize> {
        let border = |i: usize| (i as u128 * frames as u128 / self.count as u128) as usize;
        border(self.index - 1)..border(self.index)
    }
}

impl FromStr for Chunk {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match numbers {
            Some((index, count)) if (1..=count).contains(&index) => Ok(Self { index, count }),
            _ => Err(format!("chunk `{text}` is not I/N with 1 ≤ I ≤ N")),
        }
    }
}

/// In what order frames are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Order {
    /// By number.
    #[default]
    Forward,
    /// The last first.
    Reverse,
    /// In an order that looks random and is always the same.
    Shuffle,
}

impl FromStr for Order {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "forward" => Ok(Self::Forward),
            "reverse" => Ok(Self::Reverse),
            "shuffle" => Ok(Self::Shuffle),
            _ => Err(format!("order `{text}` is none of forward, reverse, shuffle")),
        }
    }
}

impl Order {
    /// Brings a list into this order.
    pub fn apply<T>(self, list: &mut [T]) {
        match self {
            Self::Forward => {}
            Self::Reverse => list.reverse(),
            Self::Shuffle => {
                // Fisher and Yates, by the generator SplitMix64
                let mut state = 0_u64;
                for i in (1..list.len()).rev() {
                    state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
                    let mut z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
                    list.swap(i, ((z ^ (z >> 31)) % (i as u64 + 1)) as usize);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(text: &str) -> Vec<i64> {
        let set: FrameSet = text.parse().unwrap();
        (-20..200).filter(|&n| set.contains(n)).collect()
    }

    #[test]
    fn sets_of_frames() {
        assert_eq!(numbers("1-9x2"), [1, 3, 5, 7, 9]);
        assert_eq!(numbers("1-9:4"), [1, 5, 9]);
        assert_eq!(numbers("2,4-6,8-9:5"), [2, 4, 5, 6, 8]);
        assert_eq!(numbers("-5--3,-1"), [-5, -4, -3, -1]);
        assert_eq!(numbers("-1-1"), [-1, 0, 1]);
        for bad in ["", "a", "1-", "5-1", "1-9x0", "1,,2", "1-9x-2", "99999999999999999999"] {
            assert!(bad.parse::<FrameSet>().is_err(), "{bad}");
        }
    }

    #[test]
    fn what_is_wrong_with_a_set_is_told() {
        for (bad, told) in [
            ("3-1", "`3-1` ends before it begins; write 1-3"),
            ("1-3,", "`1-3,`: nothing stands before or behind a comma"),
            (",5", "`,5`: nothing"),
            ("2,1-9x0", "`1-9x0` has a step"),
            ("1,a", "`a` is not a frame number or range"),
            ("1-99999999999999999999", "is beyond the numbers"),
            ("", "`` is not a frame number"),
        ] {
            let error = bad.parse::<FrameSet>().unwrap_err();
            assert!(error.starts_with(told) || error.contains(told), "{bad}: {error}");
        }
    }

    #[test]
    fn numbers_are_all_of_64_bits() {
        let all: FrameSet = "-9223372036854775808-9223372036854775807".parse().unwrap();
        assert_eq!(all.len(), u64::MAX);
        assert!(all.contains(i64::MIN) && all.contains(i64::MAX));
        let last = FrameSet::from_numbers(&[i64::MAX - 1, i64::MAX]);
        assert_eq!(last.to_string(), "9223372036854775806-9223372036854775807");
        assert_eq!(last.first_not_in(&[i64::MAX - 1, i64::MAX]), None);
        assert_eq!(last.iter().collect::<Vec<_>>(), [i64::MAX - 1, i64::MAX]);
        let time: FrameSet = "20240101123045123".parse().unwrap();
        assert!(time.contains(20_240_101_123_045_123) && !time.contains(20_240_101_123_045_124));
    }

    #[test]
    fn sets_are_shown_as_they_are_typed() {
        assert_eq!(FrameSet::from_numbers(&[-2, 1, 2, 3, 7]).to_string(), "-2,1-3,7");
        assert_eq!("1-9:2,12".parse::<FrameSet>().unwrap().to_string(), "1-9x2,12");
    }

    #[test]
    fn the_first_missing_number_is_found_even_of_huge_ranges() {
        let set: FrameSet = "1-9007199254740000".parse().unwrap();
        assert_eq!(set.first_not_in(&[1, 2]), Some(3));
        let set: FrameSet = "1-5x2,2".parse().unwrap();
        assert_eq!(set.first_not_in(&[1, 2, 3, 5]), None);
        assert_eq!(set.first_not_in(&[1, 3, 5]), Some(2));
        let set: FrameSet = "1-5x9223372036854775807".parse().unwrap();
        assert_eq!(set.first_not_in(&[1]), None);
    }

    #[test]
    fn chunks_cover_all_frames_once() {
        for frames in [0, 1, 9, 10] {
            let chunks: Vec<usize> =
                (1..=4).flat_map(|i| format!("{i}/4").parse::<Chunk>().unwrap().range(frames)).collect();
            assert_eq!(chunks, (0..frames).collect::<Vec<_>>());
        }
        for bad in ["0/2", "3/2", "1", "a/b", "1/0"] {
            assert!(bad.parse::<Chunk>().is_err(), "{bad}");
        }
    }

    #[test]
    fn a_shuffle_holds_everything_once() {
        let mut list: Vec<u32> = (0..100).collect();
        Order::Shuffle.apply(&mut list);
        assert_ne!(list, (0..100).collect::<Vec<_>>());
        list.sort_unstable();
        assert_eq!(list, (0..100).collect::<Vec<_>>());
    }
}
