//! A map statement: options, a file name that may hold blanks, and options again.

use crate::format::number;
use crate::format::text::{first_word, is_blank, trimmed};

/// Options and how many words each takes: at least, and at most while they are numbers.
const OPTIONS: [(&[u8], usize, usize); 14] = [
    (b"-blendu", 1, 1),
    (b"-blendv", 1, 1),
    (b"-boost", 1, 1),
    (b"-bm", 1, 1),
    (b"-cc", 1, 1),
    (b"-clamp", 1, 1),
    (b"-colorspace", 1, 1),
    (b"-imfchan", 1, 1),
    (b"-mm", 1, 2),
    (b"-o", 1, 3),
    (b"-s", 1, 3),
    (b"-t", 1, 3),
    (b"-texres", 1, 2),
    (b"-type", 1, 1),
];

fn option(word: &[u8]) -> Option<(usize, usize)> {
    OPTIONS.iter().find(|(name, ..)| word.eq_ignore_ascii_case(name)).map(|&(_, least, most)| (least, most))
}

/// The file's name in what follows the word of a map; None where there is none.
pub(super) fn file_name(value: &[u8]) -> Option<&[u8]> {
    let mut rest = trimmed(value);
    loop {
        let (word, behind) = first_word(rest);
        let Some((least, most)) = option(word) else { break };
        rest = behind;
        for taken in 0..most {
            let (word, behind) = first_word(rest);
            if taken >= least && number::word(word).is_none() {
                break;
            }
            rest = behind;
        }
    }
    let opens_option =
        |i: usize| rest[i] == b'-' && is_blank(rest[i - 1]) && option(first_word(&rest[i..]).0).is_some();
    let end = (1..rest.len()).find(|&i| opens_option(i));
    let name = trimmed(&rest[..end.unwrap_or(rest.len())]);
    (!name.is_empty()).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_on_both_sides_of_a_name_with_blanks() {
        for (value, name) in [
            ("tex.png", "tex.png"),
            ("  a b.png \t", "a b.png"),
            ("-s 2 2 1 -o 0.5 0 0 tex.png", "tex.png"),
            ("-o 0.1 diffuse.jpg", "diffuse.jpg"),
            ("-s 0.1 0.2 specular.jpg", "specular.jpg"),
            ("-s 1 1 1 2.png", "2.png"),
            ("-s 1 1 1 2 3.png", "2 3.png"),
            ("-blendu on -bm 2 -texres 64 tex.png", "tex.png"),
            ("-texres 64 64 tex.png", "tex.png"),
            ("-imfchan r bump map 2.jpg -bm 1.5", "bump map 2.jpg"),
            ("X.jpg -bm -0.1", "X.jpg"),
            ("-mm 0.1 0.3 x.jpg", "x.jpg"),
            ("-type cube_top -clamp on -cc off x.jpg", "x.jpg"),
            ("-colorspace sRGB x.png", "x.png"),
            ("a-s 1.png", "a-s 1.png"),
            (r"maps\\b c.jpg", r"maps\\b c.jpg"),
        ] {
            assert_eq!(file_name(value.as_bytes()), Some(name.as_bytes()), "{value}");
        }
        for value in ["", "  ", "-bm", "-bm 2", "-s 1 1 1"] {
            assert_eq!(file_name(value.as_bytes()), None, "{value}");
        }
    }
}
