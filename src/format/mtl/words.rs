//! The words of an MTL and what each takes: one row a word.

use super::map::{MapStatement, Side};
use crate::format::number;
use crate::format::text::words;

/// What a material's statements say, before defaults.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::format) struct Given {
    /// Ambient reflectance.
    pub ka: Option<[f32; 3]>,
    /// Diffuse reflectance.
    pub kd: Option<[f32; 3]>,
    /// Specular reflectance.
    pub ks: Option<[f32; 3]>,
    /// Emission.
    pub ke: Option<[f32; 3]>,
    /// Transmission filter.
    pub tf: Option<[f32; 3]>,
    /// Specular exponent.
    pub ns: Option<f32>,
    /// Optical density.
    pub ni: Option<f32>,
    /// Dissolve.
    pub d: Option<f32>,
    /// Whether that is of `d -halo`.
    pub halo: bool,
    /// 1 − dissolve.
    pub tr: Option<f32>,
    /// Illumination model.
    pub illum: Option<u8>,
    /// Maps in the order of the text, one for each slot.
    pub maps: Vec<(MapSlot, MapStatement)>,
}

/// What a map is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are those of the MTL words")]
pub(in crate::format) enum MapSlot {
    Ka,
    Kd,
    Ks,
    Ke,
    Ns,
    D,
    Bump,
    Norm,
    Refl(Side),
}

impl MapSlot {
    /// The word of the MTL.
    pub(in crate::format) fn word(self) -> &'static str {
        match self {
            Self::Ka => "map_Ka",
            Self::Kd => "map_Kd",
            Self::Ks => "map_Ks",
            Self::Ke => "map_Ke",
            Self::Ns => "map_Ns",
            Self::D => "map_d",
            Self::Bump => "bump",
            Self::Norm => "norm",
            Self::Refl(_) => "refl",
        }
    }

    /// Whether a map of one puts away one of the other: a sphere and the faces of a cube exclude each other.
    pub(in crate::format) fn replaces(self, other: Self) -> bool {
        match (self, other) {
            (Self::Refl(Side::Sphere), Self::Refl(_)) | (Self::Refl(_), Self::Refl(Side::Sphere)) => true,
            _ => self == other,
        }
    }
}

/// What a word takes, and where that goes.
enum Takes {
    /// Three numbers, or one for all three.
    Color(fn(&mut Given) -> &mut Option<[f32; 3]>),
    /// One number within a range.
    Number(fn(&mut Given) -> &mut Option<f32>, f32, f32),
    /// Dissolve, with or without `-halo`.
    Dissolve,
    /// A whole number from 0 to 10.
    Model,
    /// A file.
    Map(MapSlot),
    /// A file of all surroundings or of one side of them.
    Reflection,
    /// Something that has no effect, which is told.
    Idle,
    /// Something that has no effect and that nobody misses.
    Ignored,
}

const WORDS: [(&str, Takes); 43] = [
    ("Ka", Takes::Color(|g| &mut g.ka)),
    ("Kd", Takes::Color(|g| &mut g.kd)),
    ("Ks", Takes::Color(|g| &mut g.ks)),
    ("Ke", Takes::Color(|g| &mut g.ke)),
    ("Tf", Takes::Color(|g| &mut g.tf)),
    ("Kt", Takes::Color(|g| &mut g.tf)),
    ("Ns", Takes::Number(|g| &mut g.ns, 0.0, f32::MAX)),
    ("Ni", Takes::Number(|g| &mut g.ni, f32::MIN, f32::MAX)),
    ("Tr", Takes::Number(|g| &mut g.tr, 0.0, 1.0)),
    ("d", Takes::Dissolve),
    ("illum", Takes::Model),
    ("map_Ka", Takes::Map(MapSlot::Ka)),
    ("map_Kd", Takes::Map(MapSlot::Kd)),
    ("map_Ks", Takes::Map(MapSlot::Ks)),
    ("map_Ke", Takes::Map(MapSlot::Ke)),
    ("map_Ns", Takes::Map(MapSlot::Ns)),
    ("map_d", Takes::Map(MapSlot::D)),
    ("bump", Takes::Map(MapSlot::Bump)),
    ("map_bump", Takes::Map(MapSlot::Bump)),
    ("norm", Takes::Map(MapSlot::Norm)),
    ("refl", Takes::Reflection),
    ("map_refl", Takes::Reflection),
    ("disp", Takes::Idle),
    ("map_disp", Takes::Idle),
    ("decal", Takes::Idle),
    ("map_decal", Takes::Idle),
    ("map_Tr", Takes::Idle),
    ("Pr", Takes::Idle),
    ("Pm", Takes::Idle),
    ("Ps", Takes::Idle),
    ("Pc", Takes::Idle),
    ("Pcr", Takes::Idle),
    ("aniso", Takes::Idle),
    ("anisor", Takes::Idle),
    ("map_Pr", Takes::Idle),
    ("map_Pm", Takes::Idle),
    ("map_Ps", Takes::Idle),
    ("map_Pc", Takes::Idle),
    ("map_Pcr", Takes::Idle),
    ("map_RMA", Takes::Idle),
    ("Km", Takes::Idle),
    ("sharpness", Takes::Ignored),
    ("map_aat", Takes::Ignored),
];

/// Why a statement has no effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::format) enum Refusal {
    /// The word is none of an MTL.
    Unknown,
    /// The word cannot take that value; the default stands.
    Malformed,
}

impl Given {
    /// Takes one statement; gives the word or the options in it that change nothing. Words are known in any case; said
    /// again, the last stands.
    pub(in crate::format) fn set(&mut self, word: &[u8], value: &[u8]) -> Result<Vec<&'static str>, Refusal> {
        let (known, takes) = WORDS
            .iter()
            .find(|(known, _)| word.eq_ignore_ascii_case(known.as_bytes()))
            .ok_or(Refusal::Unknown)?;
        match takes {
            Takes::Color(place) => *place(self) = Some(color(value).ok_or(Refusal::Malformed)?),
            &Takes::Number(place, least, greatest) => {
                *place(self) = Some(number(value).ok_or(Refusal::Malformed)?.clamp(least, greatest));
            }
            Takes::Dissolve => {
                let halo = value.strip_prefix(b"-halo");
                let d = number(halo.unwrap_or(value)).ok_or(Refusal::Malformed)?;
                (self.d, self.halo) = (Some(d.clamp(0.0, 1.0)), halo.is_some());
            }
            Takes::Model => self.illum = Some(model(value).ok_or(Refusal::Malformed)?),
            &Takes::Map(slot) => {
                let mut map = MapStatement::parse(value).ok_or(Refusal::Malformed)?;
                if map.side.take().is_some() {
                    map.has_idle("-type");
                }
                if !matches!(slot, MapSlot::Bump | MapSlot::Norm) && map.bump_multiplier.take().is_some() {
                    map.has_idle("-bm");
                }
                if map.channel.is_some() && !matches!(slot, MapSlot::Ns | MapSlot::D | MapSlot::Bump) {
                    map.has_idle("-imfchan");
                }
                return Ok(self.set_map(slot, map));
            }
            Takes::Reflection => {
                let mut map = MapStatement::parse(value).ok_or(Refusal::Malformed)?;
                if map.channel.is_some() {
                    map.has_idle("-imfchan");
                }
                return Ok(self.set_map(MapSlot::Refl(map.side.unwrap_or(Side::Sphere)), map));
            }
            Takes::Idle => return Ok(vec![known]),
            Takes::Ignored => {}
        }
        Ok(Vec::new())
    }

    fn set_map(&mut self, slot: MapSlot, mut map: MapStatement) -> Vec<&'static str> {
        let idle = std::mem::take(&mut map.idle);
        self.maps.retain(|(known, _)| !slot.replaces(*known));
        self.maps.push((slot, map));
        idle
    }

    /// Lays other statements over these: what they say stands.
    pub(in crate::format) fn lay_over(&mut self, over: Self) {
        self.ka = over.ka.or(self.ka);
        self.kd = over.kd.or(self.kd);
        self.ks = over.ks.or(self.ks);
        self.ke = over.ke.or(self.ke);
        self.tf = over.tf.or(self.tf);
        self.ns = over.ns.or(self.ns);
        self.ni = over.ni.or(self.ni);
        self.illum = over.illum.or(self.illum);
        // d and Tr speak of the same
        if over.d.is_some() || over.tr.is_some() {
            (self.d, self.halo, self.tr) = (over.d, over.halo, over.tr);
        }
        for (slot, map) in over.maps {
            self.set_map(slot, map);
        }
    }
}

/// The words of an MTL that bear on a picture.
pub fn mtl_words() -> impl Iterator<Item = &'static str> {
    let has_effect = |(_, takes): &&(&str, Takes)| !matches!(takes, Takes::Idle | Takes::Ignored);
    WORDS.iter().filter(has_effect).map(|(word, _)| *word)
}

/// What a word of an MTL takes, for people to read; None where there is no such word. Words are known in any case.
pub fn mtl_word_takes(word: &str) -> Option<String> {
    let (_, takes) = WORDS.iter().find(|(known, _)| word.eq_ignore_ascii_case(known))?;
    Some(match takes {
        Takes::Color(_) => "three numbers, or one for all three".to_string(),
        Takes::Number(_, least, greatest) => match (*least, *greatest) {
            (f32::MIN, f32::MAX) => "a number".to_string(),
            (least, f32::MAX) => format!("a number of {least} or more"),
            (least, greatest) => format!("a number from {least} to {greatest}"),
        },
        Takes::Dissolve => "a number from 0 to 1, or `-halo` and such a number".to_string(),
        Takes::Model => "a whole number from 0 to 10".to_string(),
        Takes::Map(_) | Takes::Reflection => "a file, with options before or behind its name".to_string(),
        Takes::Idle | Takes::Ignored => "anything".to_string(),
    })
}

/// Whether a word takes a value just as it stands: in an MTL what is too much is left out and what is out of range is
/// moved into it, which a job does not ask for.
pub fn mtl_word_accepts(word: &str, value: &str) -> bool {
    let Some((_, takes)) = WORDS.iter().find(|(known, _)| word.eq_ignore_ascii_case(known)) else {
        return false;
    };
    let value = value.as_bytes();
    let only = |value: &[u8]| number(value).filter(|_| words(value).count() == 1);
    match takes {
        Takes::Color(_) => color(value).is_some() && words(value).count() <= 3,
        Takes::Number(_, least, greatest) => only(value).is_some_and(|x| (*least..=*greatest).contains(&x)),
        Takes::Dissolve => {
            let number = value.strip_prefix(b"-halo").unwrap_or(value);
            only(number).is_some_and(|x| (0.0..=1.0).contains(&x))
        }
        Takes::Model => only(value).and_then(|_| model(value)).is_some(),
        Takes::Map(_) | Takes::Reflection => MapStatement::parse(value).is_some(),
        Takes::Idle | Takes::Ignored => true,
    }
}

/// The first word as a finite number.
fn number(value: &[u8]) -> Option<f32> {
    number::word(words(value).next()?).filter(|x| x.is_finite())
}

fn color(value: &[u8]) -> Option<[f32; 3]> {
    let mut channels = words(value).map(|word| number::word(word).filter(|x| x.is_finite()));
    let red = channels.next()??;
    let Some(green) = channels.next() else { return Some([red; 3]) };
    Some([red, green?, channels.next()??])
}

/// `2` or `2.0`.
fn model(value: &[u8]) -> Option<u8> {
    number(value).filter(|x| (0.0..=10.0).contains(x) && x.fract() == 0.0).map(|x| x as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn given(statements: &[(&str, &str)]) -> Given {
        let mut given = Given::default();
        for (word, value) in statements {
            given.set(word.as_bytes(), value.as_bytes()).unwrap();
        }
        given
    }

    #[test]
    fn values_of_each_kind() {
        let g = given(&[
            ("Kd", "0.1 0.2 0.3"),
            ("ks", "0.5"),
            ("Kt", "0.25"),
            ("Ns", "-3"),
            ("Ni", "1.5"),
            ("illum", "2.0"),
            ("d", "-halo 0.25"),
        ]);
        assert_eq!((g.kd, g.ks, g.tf), (Some([0.1, 0.2, 0.3]), Some([0.5; 3]), Some([0.25; 3])));
        assert_eq!((g.ns, g.ni, g.illum), (Some(0.0), Some(1.5), Some(2)));
        assert_eq!((g.d, g.halo), (Some(0.25), true));
        assert!(!given(&[("d", "-halo 0.25"), ("d", "0.25")]).halo);
    }

    #[test]
    fn what_is_refused() {
        let refusal = |word: &str, value: &str| Given::default().set(word.as_bytes(), value.as_bytes()).err();
        for (word, value) in [
            ("Kd", ""),
            ("Kd", "0.1 0.2"),
            ("Kd", "spectral file.rfl"),
            ("Tf", "xyz 0.1 0.2 0.3"),
            ("Kd", "nan 0 0"),
            ("Ns", "a"),
            ("illum", "11"),
            ("illum", "2.5"),
            ("illum", "-1"),
            ("d", "-halo"),
            ("map_Kd", "-s 1 1 1"),
        ] {
            assert_eq!(refusal(word, value), Some(Refusal::Malformed), "{word} {value}");
        }
        assert_eq!(refusal("Kx", "1"), Some(Refusal::Unknown));
    }

    #[test]
    fn what_changes_nothing_is_told() {
        let idle = |word: &str, value: &str| Given::default().set(word.as_bytes(), value.as_bytes()).unwrap();
        assert_eq!(idle("map_disp", "a.png"), ["map_disp"]);
        assert_eq!(idle("PR", "0.5"), ["Pr"]);
        assert_eq!(idle("map_kd", "-blendu on -type sphere -bm 2 a.png"), ["-blendu", "-type", "-bm"]);
        assert!(idle("map_bump", "-bm 2 a.png").is_empty() && idle("sharpness", "60").is_empty());
        assert!(idle("refl", "-type sphere a.png").is_empty());
        // a channel is of maps that are one number
        for word in ["map_Ka", "map_Kd", "map_Ks", "map_Ke", "norm", "refl"] {
            assert_eq!(idle(word, "-imfchan r a.png"), ["-imfchan"], "{word}");
        }
        for word in ["map_d", "map_Ns", "bump"] {
            assert!(idle(word, "-imfchan r a.png").is_empty(), "{word}");
        }
    }

    #[test]
    fn what_a_job_may_say() {
        for (word, value) in [
            ("Kd", "0.1 0.2 0.3"),
            ("kd", "0.5"),
            ("d", "0.5"),
            ("d", "-halo 0.5"),
            ("Ni", "-2"),
            ("Ns", "1e4"),
            ("illum", "10"),
            ("map_Kd", "-s 2 a b.png"),
            ("refl", "-type sphere a.png"),
            ("Pr", "x"),
        ] {
            assert!(mtl_word_accepts(word, value), "{word} {value}");
        }
        for (word, value) in [
            ("Kd", "0.1 0.2"),
            ("Kd", "0.1 0.2 0.3 0.4"),
            ("Kd", "red"),
            ("d", "2"),
            ("d", "-halo 1.5"),
            ("d", "0.5 0.5"),
            ("Tr", "-0.1"),
            ("Ni", "1 2 3"),
            ("Ns", "-1"),
            ("illum", "11"),
            ("illum", "1 2"),
            ("map_Kd", "-s 1 1 1"),
            ("Nii", "1.5"),
        ] {
            assert!(!mtl_word_accepts(word, value), "{word} {value}");
        }
        let takes = |word| mtl_word_takes(word).unwrap();
        assert_eq!([takes("Ns"), takes("tr")], ["a number of 0 or more", "a number from 0 to 1"]);
        assert!(mtl_words().any(|w| w == "Ni") && !mtl_words().any(|w| w == "Pr"));
    }

    fn slots(given: &Given) -> Vec<(MapSlot, &str)> {
        given.maps.iter().map(|(slot, map)| (*slot, str::from_utf8(&map.file).unwrap())).collect()
    }

    #[test]
    fn the_last_stands() {
        let g = given(&[
            ("map_bump", "a.png"),
            ("map_Kd", "b.png"),
            ("bump", "c.png"),
            ("Kd", "1"),
            ("Kd", "0.5"),
        ]);
        assert_eq!(slots(&g), [(MapSlot::Kd, "b.png"), (MapSlot::Bump, "c.png")]);
        assert_eq!(g.kd, Some([0.5; 3]));
    }

    #[test]
    fn a_sphere_or_a_cube_is_reflected() {
        let cube = [("refl", "-type cube_top a.png"), ("refl", "-type cube_left b.png")];
        let faces = [(MapSlot::Refl(Side::Face(3)), "a.png"), (MapSlot::Refl(Side::Face(0)), "b.png")];
        assert_eq!(slots(&given(&cube)), faces);
        assert_eq!(slots(&given(&[&[("refl", "s.png")], &cube[..]].concat())), faces);
        let sphere = given(&[&cube[..], &[("refl", "s.png")]].concat());
        assert_eq!(slots(&sphere), [(MapSlot::Refl(Side::Sphere), "s.png")]);
    }

    #[test]
    fn d_and_tr_are_laid_over_together() {
        let mut g = given(&[("d", "1"), ("Kd", "0.5"), ("map_Kd", "a.png")]);
        g.lay_over(given(&[("Tr", "0.25"), ("map_Kd", "b.png")]));
        assert_eq!((g.d, g.tr, g.kd), (None, Some(0.25), Some([0.5; 3])));
        assert_eq!(slots(&g), [(MapSlot::Kd, "b.png")]);
    }
}
