//! A map statement: options, a file name that may hold blanks, and options again.

use crate::format::number;
use crate::format::text::{first_word, is_blank, trimmed};
use crate::scene::Channel;

/// What a map statement says. The name of the file is not looked for here.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::format) struct MapStatement {
    /// The file as written.
    pub file: Vec<u8>,
    /// -s: factors of u and v.
    pub scale: [f32; 2],
    /// -o: added to u and v.
    pub offset: [f32; 2],
    /// -clamp
    pub clamp: bool,
    /// -mm: added to the texel times the second.
    pub base_gain: [f32; 2],
    /// -bm: factor of heights.
    pub bump_multiplier: Option<f32>,
    /// -imfchan
    pub channel: Option<Channel>,
    /// -type
    pub side: Option<Side>,
    /// Options that were given and change nothing.
    pub idle: Vec<&'static str>,
}

/// What of its surroundings a reflection map shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::format) enum Side {
    /// All of them, by latitude and longitude.
    Sphere,
    /// One face of a cube, by its place in [`crate::scene::Reflection::Cube`].
    Face(u8),
}

/// Values of `-type`, faces in the order of their places.
const FACES: [&str; 6] = ["cube_left", "cube_right", "cube_bottom", "cube_top", "cube_back", "cube_front"];

/// An option: how many words it takes, at least, and at most while they are numbers; and what those do. What returns
/// None changes nothing.
struct OptionWord {
    name: &'static str,
    least: usize,
    most: usize,
    set: fn(&mut MapStatement, &[&[u8]]) -> Option<()>,
}

const fn option(
    name: &'static str,
    least: usize,
    most: usize,
    set: fn(&mut MapStatement, &[&[u8]]) -> Option<()>,
) -> OptionWord {
    OptionWord { name, least, most, set }
}

const OPTIONS: [OptionWord; 14] = [
    option("-blendu", 1, 1, |_, _| None),
    option("-blendv", 1, 1, |_, _| None),
    option("-boost", 1, 1, |_, _| None),
    option("-bm", 1, 1, |map, words| number(words, 0).map(|x| map.bump_multiplier = Some(x))),
    option("-cc", 1, 1, |_, _| None),
    option("-clamp", 1, 1, |map, words| switch(words).map(|on| map.clamp = on)),
    option("-colorspace", 1, 1, |_, _| None),
    option("-imfchan", 1, 1, |map, words| channel(words).map(|channel| map.channel = Some(channel))),
    option("-mm", 1, 2, |map, words| pair(words, 1.0).map(|pair| map.base_gain = pair)),
    option("-o", 1, 3, |map, words| pair(words, 0.0).map(|pair| map.offset = pair)),
    option("-s", 1, 3, |map, words| pair(words, 1.0).map(|pair| map.scale = pair)),
    option("-t", 1, 3, |_, _| None),
    option("-texres", 1, 2, |_, _| None),
    option("-type", 1, 1, |map, words| side(words).map(|side| map.side = Some(side))),
];

fn number(words: &[&[u8]], at: usize) -> Option<f32> {
    number::word(words.get(at)?).filter(|x| x.is_finite())
}

/// Two numbers; a third, which is for textures in space, is not looked at.
fn pair(words: &[&[u8]], second: f32) -> Option<[f32; 2]> {
    let first = number(words, 0)?;
    if words.len() < 2 { Some([first, second]) } else { Some([first, number(words, 1)?]) }
}

fn word(words: &[&[u8]]) -> Option<String> {
    Some(String::from_utf8_lossy(words.first()?).to_ascii_lowercase())
}

fn switch(words: &[&[u8]]) -> Option<bool> {
    match word(words)?.as_str() {
        "on" => Some(true),
        "off" => Some(false),
        _ => None,
    }
}

fn channel(words: &[&[u8]]) -> Option<Channel> {
    match word(words)?.as_str() {
        "r" => Some(Channel::R),
        "g" => Some(Channel::G),
        "b" => Some(Channel::B),
        "m" => Some(Channel::Alpha),
        "l" => Some(Channel::Luminance),
        _ => None,
    }
}

fn side(words: &[&[u8]]) -> Option<Side> {
    let word = word(words)?;
    let face = FACES.iter().position(|face| *face == word).map(|place| Side::Face(place as u8));
    face.or((word == "sphere").then_some(Side::Sphere))
}

fn known(word: &[u8]) -> Option<&'static OptionWord> {
    OPTIONS.iter().find(|option| word.eq_ignore_ascii_case(option.name.as_bytes()))
}

impl MapStatement {
    /// Reads what follows the word of a map; None where no file is named.
    pub(super) fn parse(value: &[u8]) -> Option<Self> {
        let mut map = Self {
            file: Vec::new(),
            scale: [1.0; 2],
            offset: [0.0; 2],
            clamp: false,
            base_gain: [0.0, 1.0],
            bump_multiplier: None,
            channel: None,
            side: None,
            idle: Vec::new(),
        };
        let rest = map.take_options(trimmed(value));
        let opens_option =
            |i: usize| rest[i] == b'-' && is_blank(rest[i - 1]) && known(first_word(&rest[i..]).0).is_some();
        let end = (1..rest.len()).find(|&i| opens_option(i)).unwrap_or(rest.len());
        map.file = trimmed(&rest[..end]).to_vec();
        map.take_options(&rest[end..]);
        (!map.file.is_empty()).then_some(map)
    }

    /// Takes the options at the start; what follows them.
    fn take_options<'a>(&mut self, mut rest: &'a [u8]) -> &'a [u8] {
        loop {
            let (word, mut behind) = first_word(rest);
            let Some(option) = known(word) else { return rest };
            let mut words = Vec::new();
            while words.len() < option.most {
                let (word, next) = first_word(behind);
                if word.is_empty() || (words.len() >= option.least && number::word(word).is_none()) {
                    break;
                }
                words.push(word);
                behind = next;
            }
            if (option.set)(self, &words).is_none() {
                self.has_idle(option.name);
            }
            rest = behind;
        }
    }

    /// Notes an option that changes nothing.
    pub(super) fn has_idle(&mut self, option: &'static str) {
        if !self.idle.contains(&option) {
            self.idle.push(option);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(value: &str) -> MapStatement {
        MapStatement::parse(value.as_bytes()).unwrap()
    }

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
            assert_eq!(parsed(value).file, name.as_bytes(), "{value}");
        }
        for value in ["", "  ", "-bm", "-bm 2", "-s 1 1 1"] {
            assert_eq!(MapStatement::parse(value.as_bytes()), None, "{value}");
        }
    }

    #[test]
    fn what_options_say() {
        let map = parsed("-S 2 3 4 -o 0.5 -mm 0.1 x.png -clamp on -imfchan M -bm -0.5 -type cube_top");
        assert_eq!((map.scale, map.offset, map.base_gain), ([2.0, 3.0], [0.5, 0.0], [0.1, 1.0]));
        assert_eq!((map.clamp, map.channel, map.bump_multiplier), (true, Some(Channel::Alpha), Some(-0.5)));
        assert_eq!((map.side, map.idle.is_empty()), (Some(Side::Face(3)), true));
        assert_eq!(parsed("-type sphere -s 2 x.png").side, Some(Side::Sphere));
        assert_eq!(parsed("-s 2 x.png").scale, [2.0, 1.0]);
    }

    #[test]
    fn what_changes_nothing_is_noted_once() {
        let map = parsed("-t 1 1 1 -blendu on -s nan 1 -imfchan z -t 0 -clamp maybe x.png -bm abc");
        assert_eq!(map.idle, ["-t", "-blendu", "-s", "-imfchan", "-clamp", "-bm"]);
        assert_eq!(MapStatement { idle: Vec::new(), ..map }, parsed("x.png"));
    }
}
