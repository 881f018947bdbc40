//! Wavefront MTL: materials by name.

mod map;
mod words;

use super::text::{Tally, Text, first_word, is_line_end, without_comment};
pub(super) use map::{MapStatement, Side};
use std::collections::{BTreeSet, HashMap};
pub(super) use words::{Given, MapSlot, Refusal};
pub use words::{mtl_word_accepts, mtl_word_takes, mtl_words};

/// What an MTL says.
#[derive(Debug, Default)]
pub(super) struct Parsed {
    /// Materials by name. Of two with one name the later stands, as in Blender and assimp.
    pub materials: HashMap<Vec<u8>, Given>,
    /// Statements whose word is none of an MTL.
    pub unknown: Skipped,
    /// Statements whose word cannot take what follows it.
    pub malformed: Skipped,
    /// Words and options that change nothing.
    pub idle: Idle,
}

/// Words and options that change nothing.
#[derive(Debug, Default)]
pub(super) struct Idle {
    /// How many statements have such, and where the first stands.
    pub tally: Tally,
    /// The words and options.
    pub words: BTreeSet<&'static str>,
}

/// Statements without effect.
#[derive(Debug, Default)]
pub(super) struct Skipped {
    /// How many, and where the first stands.
    pub tally: Tally,
    /// The first one's word.
    pub word: Vec<u8>,
}

impl Skipped {
    fn add(&mut self, word: &[u8], offset: usize) {
        if self.tally.count == 0 {
            self.word = word.to_vec();
        }
        self.tally.add(offset);
    }
}

/// Reads an MTL; of its materials those with wanted names are kept. A line that cannot be used never makes the others
/// unreadable.
pub(super) fn parse(text: &Text, is_wanted: impl Fn(&[u8]) -> bool) -> Parsed {
    let mut parsed = Parsed::default();
    // what stands before the first `newmtl` belongs to none
    let mut nobody = Given::default();
    let mut current = &mut nobody;
    let mut offset = 0;
    for line in text.joined.split(|&b| is_line_end(b)) {
        let (word, value) = first_word(without_comment(line));
        if word == b"newmtl" {
            nobody = Given::default();
            current = if is_wanted(value) {
                parsed.materials.entry(value.to_vec()).or_default()
            } else {
                &mut nobody
            };
            *current = Given::default();
        } else if !word.is_empty() {
            match current.set(word, value) {
                Ok(idle) if idle.is_empty() => {}
                Ok(idle) => {
                    parsed.idle.tally.add(offset);
                    parsed.idle.words.extend(idle);
                }
                Err(Refusal::Unknown) => parsed.unknown.add(word, offset),
                Err(Refusal::Malformed) => parsed.malformed.add(word, offset),
            }
        }
        offset += line.len() + 1;
    }
    parsed
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn parsed(bytes: &[u8]) -> Parsed {
        parse(&Text::new(bytes, Path::new("a.mtl")).unwrap(), |_| true)
    }

    #[test]
    fn names_are_bytes_trimmed() {
        let Parsed { materials, unknown, malformed, .. } =
            parsed(b"newmtl \nKs 0\nnewmtl  a b  # c\r\nKd 1 0 0 # red\r\nnewmtl \xE6\n\tKd 0 1 0\n");
        assert_eq!((unknown.tally.count, malformed.tally.count), (0, 0));
        assert_eq!(materials[&b""[..]].ks, Some([0.0; 3]));
        assert_eq!(materials[&b"a b"[..]].kd, Some([1.0, 0.0, 0.0]));
        assert_eq!(materials[&b"\xE6"[..]].kd, Some([0.0, 1.0, 0.0]));
    }

    #[test]
    fn a_name_again_is_a_new_material() {
        let Parsed { materials, .. } = parsed(b"newmtl a\nKd 1\nNs 5\nnewmtl a\nKd 0.5\n");
        assert_eq!(materials[&b"a"[..]], Given { kd: Some([0.5; 3]), ..Given::default() });
    }

    #[test]
    fn what_has_no_effect_is_counted() {
        let Parsed { unknown, malformed, .. } = parsed(b"Kd 1\nnewmtl a\nKd x\nfoo 1\nbar\n");
        assert_eq!((unknown.tally.count, unknown.tally.first, &unknown.word[..]), (2, 19, &b"foo"[..]));
        assert_eq!((malformed.tally.count, malformed.tally.first, &malformed.word[..]), (1, 14, &b"Kd"[..]));
    }

    #[test]
    fn what_changes_nothing_is_listed() {
        let Parsed { idle, .. } = parsed(b"newmtl a\nPr 1\nmap_Kd -t 1 a.png\nPr 0.5\n");
        assert_eq!((idle.tally.count, idle.tally.first), (3, 9));
        assert_eq!(idle.words.into_iter().collect::<Vec<_>>(), ["-t", "Pr"]);
    }

    #[test]
    fn only_wanted_materials_are_kept() {
        let text = Text::new(b"newmtl a\nKd 1\nnewmtl b\nKd 0\nnewmtl c\nKd x", Path::new("a.mtl")).unwrap();
        let Parsed { materials, malformed, .. } = parse(&text, |name| name == b"a");
        assert_eq!(materials.len(), 1);
        assert_eq!((materials[&b"a"[..]].kd, malformed.tally.count), (Some([1.0; 3]), 1));
    }
}
