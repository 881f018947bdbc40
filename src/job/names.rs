//! File names as text and runs of digits: which files belong to one sequence, and which run is the frame number.

use std::cmp::Ordering;
use std::collections::BTreeMap;

/// A name cut into text and numbers: `walk_007` is `walk_`, 7, and an empty text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Name {
    /// One more than there are numbers.
    texts: Vec<Vec<u8>>,
    numbers: Vec<i64>,
    /// The numbers as they are written.
    written: Vec<Vec<u8>>,
}

impl Name {
    /// Cuts the bytes of a stem. A minus is a sign where a number and no letter or digit stands beside it: `walk_-5`
    /// has −5, `horse-01` has 1. A run of digits beyond 64 bits is text.
    pub(super) fn of(stem: &[u8]) -> Self {
        let mut name = Self { texts: Vec::new(), numbers: Vec::new(), written: Vec::new() };
        let mut text_start = 0;
        let mut i = 0;
        while i < stem.len() {
            if !stem[i].is_ascii_digit() {
                i += 1;
                continue;
            }
            let digits_end = i + stem[i..].iter().take_while(|b| b.is_ascii_digit()).count();
            let is_signed =
                i > text_start && stem[i - 1] == b'-' && (i < 2 || !stem[i - 2].is_ascii_alphanumeric());
            if let Some(number) = number(&stem[i..digits_end], is_signed) {
                let start = i - usize::from(is_signed);
                name.texts.push(stem[text_start..start].to_vec());
                name.written.push(stem[start..digits_end].to_vec());
                name.numbers.push(number);
                text_start = digits_end;
            }
            i = digits_end;
        }
        name.texts.push(stem[text_start..].to_vec());
        name
    }

    /// Order that people expect: numbers by value, text by letter without regard to case.
    pub(super) fn natural_order(&self, other: &Self) -> Ordering {
        let pieces = |n: &Self| -> Vec<(Vec<u8>, i64)> {
            let numbers = n.numbers.iter().copied().chain([i64::MIN]);
            n.texts.iter().map(|t| t.to_ascii_lowercase()).zip(numbers).collect()
        };
        pieces(self).cmp(&pieces(other)).then_with(|| self.texts.cmp(&other.texts))
    }

    /// The whole name, for people.
    fn whole(&self) -> String {
        String::from_utf8_lossy(&self.bytes_without(None)).into_owned()
    }

    /// What is left of the name without one of its numbers, for people.
    fn without(&self, run: usize) -> String {
        String::from_utf8_lossy(&self.bytes_without(Some(run))).trim_matches(['_', '-', '.', ' ']).to_string()
    }

    fn bytes_without(&self, run: Option<usize>) -> Vec<u8> {
        let mut bytes = Vec::new();
        for (i, text) in self.texts.iter().enumerate() {
            bytes.extend_from_slice(text);
            if run != Some(i) {
                bytes.extend_from_slice(self.written.get(i).map_or(&[], Vec::as_slice));
            }
        }
        bytes
    }
}

/// The number that digits are, where 64 bits hold it.
fn number(digits: &[u8], is_negative: bool) -> Option<i64> {
    digits.iter().try_fold(0_i64, |n, &b| {
        let digit = i64::from(b - b'0');
        n.checked_mul(10)?.checked_add(if is_negative { -digit } else { digit })
    })
}

/// Names that belong to one sequence: their places in the list that was grouped, with their frame numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Group {
    /// What the names have in common, which may be nothing; of a name alone with its text the whole.
    pub(super) text: String,
    /// Ordered by number.
    pub(super) members: Vec<(Option<i64>, usize)>,
}

/// Groups names (CONTRACT 2): names of the same text belong together; the last number that differs among them is the
/// frame's; where others differ too, each combination is a group of its own. Groups come in natural order.
pub(super) fn group(names: &[Name]) -> Vec<Group> {
    let mut by_text: BTreeMap<&[Vec<u8>], Vec<usize>> = BTreeMap::new();
    for (i, name) in names.iter().enumerate() {
        by_text.entry(&name.texts).or_default().push(i);
    }
    let mut groups = Vec::new();
    for members in by_text.into_values() {
        let numbers = |i: usize| &names[i].numbers;
        let first = members[0];
        let differs = |run: usize| members.iter().any(|&i| numbers(i)[run] != numbers(first)[run]);
        let runs = numbers(first).len();
        let is_alone = members.len() == 1;
        let Some(frame_run) = (0..runs).rev().find(|&r| differs(r)).or(runs.checked_sub(1)) else {
            groups.push(Group {
                text: names[first].whole(),
                members: members.iter().map(|&i| (None, i)).collect(),
            });
            continue;
        };
        let mut by_rest: BTreeMap<Vec<i64>, Vec<usize>> = BTreeMap::new();
        for &i in &members {
            let mut rest = numbers(i).clone();
            rest.remove(frame_run);
            by_rest.entry(rest).or_default().push(i);
        }
        for members in by_rest.into_values() {
            let mut members: Vec<_> = members.into_iter().map(|i| (Some(numbers(i)[frame_run]), i)).collect();
            members.sort_unstable();
            let name = &names[members[0].1];
            let text = if is_alone { name.whole() } else { name.without(frame_run) };
            groups.push(Group { text, members });
        }
    }
    groups.sort_by(|a, b| names[a.members[0].1].natural_order(&names[b.members[0].1]));
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    fn groups(stems: &[&str]) -> Vec<(String, Vec<Option<i64>>)> {
        let names: Vec<Name> = stems.iter().map(|s| Name::of(s.as_bytes())).collect();
        group(&names).into_iter().map(|g| (g.text, g.members.iter().map(|m| m.0).collect())).collect()
    }

    fn one(text: &str, numbers: &[i64]) -> (String, Vec<Option<i64>>) {
        (text.to_string(), numbers.iter().map(|&n| Some(n)).collect())
    }

    #[test]
    fn the_last_number_that_differs_is_the_frame() {
        assert_eq!(groups(&["walk_0010", "walk_0002"]), [one("walk", &[2, 10])]);
        assert_eq!(groups(&["0000_00", "0001_00", "0010_00"]), [one("00", &[0, 1, 10])]);
        assert_eq!(groups(&["10", "1", "2"]), [one("", &[1, 2, 10])]);
        assert_eq!(groups(&["v2_a_7"]), [one("v2_a_7", &[7])]);
        assert_eq!(groups(&["house"]), [("house".to_string(), vec![None])]);
    }

    #[test]
    fn other_text_or_other_numbers_are_other_sequences() {
        assert_eq!(groups(&["a_1", "b_1", "a_2", "b_2"]), [one("a", &[1, 2]), one("b", &[1, 2])]);
        assert_eq!(
            groups(&["s1_1", "s1_2", "s2_1", "s10_1"]),
            [one("s1", &[1, 2]), one("s2", &[1]), one("s10", &[1])]
        );
        assert_eq!(groups(&["head-01-anger", "head-02-cry", "head"]).len(), 3);
    }

    #[test]
    fn signs_and_long_runs() {
        let last = |stem: &[u8]| Name::of(stem).numbers.last().copied();
        assert_eq!(last(b"walk_-5"), Some(-5));
        assert_eq!(last(b"-3"), Some(-3));
        assert_eq!(last(b"horse-01"), Some(1));
        assert_eq!(last(b"2024-05"), Some(5));
        assert_eq!(last(b"sim_20240101123045123"), Some(20_240_101_123_045_123));
        assert_eq!(last(b"a9223372036854775807"), Some(i64::MAX));
        assert_eq!(last(b"a_-9223372036854775808"), Some(i64::MIN));
        assert_eq!(last(b"a0000000000000000000000007"), Some(7));
        assert_eq!(last(b"a9223372036854775808"), None);
        assert_eq!(last(b"7_a9223372036854775808"), Some(7));
        assert_eq!(
            groups(&["sim_20240101123045124", "sim_20240101123045123"]),
            [one("sim", &[20_240_101_123_045_123, 20_240_101_123_045_124])]
        );
    }

    #[test]
    fn natural_order() {
        let mut names: Vec<Name> = ["b", "A10", "a9", "a"].iter().map(|s| Name::of(s.as_bytes())).collect();
        names.sort_by(Name::natural_order);
        let order: Vec<_> = names.iter().map(|n| (n.texts[0].clone(), n.numbers.last().copied())).collect();
        assert_eq!(
            order,
            [
                (b"a".to_vec(), None),
                (b"a".to_vec(), Some(9)),
                (b"A".to_vec(), Some(10)),
                (b"b".to_vec(), None)
            ]
        );
    }
}
