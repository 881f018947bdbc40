//! Wavefront MTL: materials by name.

mod map;
mod words;

use super::text::{Tally, Text, first_word, is_line_end, without_comment};
use std::collections::HashMap;
pub use words::is_mtl_word;
pub(super) use words::{Given, Refusal};

/// What an MTL says.
#[derive(Debug, Default)]
pub(super) struct Parsed {
    /// Materials by name. Of two with one name the later stands, as in Blender and assimp.
    pub materials: HashMap<Vec<u8>, Given>,
    /// Statements whose word is none of an MTL.
    pub unknown: Skipped,
    /// Statements whose word cannot take what follows it.
    pub malformed: Skipped,
}

/// Statements without effect.
#[derive(Debug, Default)]
pub(super) struct Skipped {
    /// How many, and where the first stands.
    pub tally: Tally,
    /// The first one's word.
    pub word: Vec<u8>,
}

/// Reads an MTL. A line that cannot be used never makes the others unreadable.
pub(super) fn parse(text: &Text) -> Parsed {
    let mut parsed = Parsed::default();
    // what stands before the first `newmtl` belongs to none
    let mut nobody = Given::default();
    let mut current = &mut nobody;
    let mut offset = 0;
    for line in text.joined.split(|&b| is_line_end(b)) {
        let (word, value) = first_word(without_comment(line));
        if word == b"newmtl" {
            current = parsed.materials.entry(value.to_vec()).or_default();
            *current = Given::default();
        } else if !word.is_empty()
            && let Err(refusal) = current.set(word, value)
        {
            let skipped = match refusal {
                Refusal::Unknown => &mut parsed.unknown,
                Refusal::Malformed => &mut parsed.malformed,
            };
            if skipped.tally.count == 0 {
                skipped.word = word.to_vec();
            }
            skipped.tally.add(offset);
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
        parse(&Text::new(bytes, Path::new("a.mtl")).unwrap())
    }

    #[test]
    fn names_are_bytes_trimmed() {
        let Parsed { materials, unknown, malformed } =
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
}
