//! The words of an MTL and what each takes: one row a word.

use super::map;
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
    /// Specular exponent.
    pub ns: Option<f32>,
    /// Dissolve.
    pub d: Option<f32>,
    /// 1 − dissolve.
    pub tr: Option<f32>,
    /// Illumination model.
    pub illum: Option<u8>,
    /// Files by word, in the order of the text.
    pub maps: Vec<(&'static str, Vec<u8>)>,
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
    /// A file, kept under this word.
    Map(&'static str),
    /// Something that has no effect.
    Ignored,
}

const WORDS: [(&str, Takes); 40] = [
    ("Ka", Takes::Color(|g| &mut g.ka)),
    ("Kd", Takes::Color(|g| &mut g.kd)),
    ("Ks", Takes::Color(|g| &mut g.ks)),
    ("Ke", Takes::Color(|g| &mut g.ke)),
    ("Ns", Takes::Number(|g| &mut g.ns, 0.0, f32::MAX)),
    ("Tr", Takes::Number(|g| &mut g.tr, 0.0, 1.0)),
    ("d", Takes::Dissolve),
    ("illum", Takes::Model),
    ("map_Ka", Takes::Map("map_Ka")),
    ("map_Kd", Takes::Map("map_Kd")),
    ("map_Ks", Takes::Map("map_Ks")),
    ("map_Ke", Takes::Map("map_Ke")),
    ("map_Ns", Takes::Map("map_Ns")),
    ("map_d", Takes::Map("map_d")),
    ("bump", Takes::Map("bump")),
    ("map_bump", Takes::Map("bump")),
    ("norm", Takes::Map("norm")),
    ("disp", Takes::Map("disp")),
    ("map_disp", Takes::Map("disp")),
    ("refl", Takes::Map("refl")),
    ("map_refl", Takes::Map("refl")),
    ("decal", Takes::Map("decal")),
    ("map_decal", Takes::Map("decal")),
    ("Tf", Takes::Ignored),
    ("Kt", Takes::Ignored),
    ("Ni", Takes::Ignored),
    ("Km", Takes::Ignored),
    ("sharpness", Takes::Ignored),
    ("map_aat", Takes::Ignored),
    ("Pr", Takes::Ignored),
    ("Pm", Takes::Ignored),
    ("Ps", Takes::Ignored),
    ("Pc", Takes::Ignored),
    ("Pcr", Takes::Ignored),
    ("aniso", Takes::Ignored),
    ("anisor", Takes::Ignored),
    ("map_Pr", Takes::Ignored),
    ("map_Pm", Takes::Ignored),
    ("map_Ps", Takes::Ignored),
    ("map_Tr", Takes::Ignored),
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
    /// Takes one statement. Words are known in any case; said again, the last stands.
    pub(in crate::format) fn set(&mut self, word: &[u8], value: &[u8]) -> Result<(), Refusal> {
        let (_, takes) = WORDS
            .iter()
            .find(|(known, _)| word.eq_ignore_ascii_case(known.as_bytes()))
            .ok_or(Refusal::Unknown)?;
        match takes {
            Takes::Color(place) => *place(self) = Some(color(value).ok_or(Refusal::Malformed)?),
            &Takes::Number(place, least, greatest) => {
                *place(self) = Some(number(value).ok_or(Refusal::Malformed)?.clamp(least, greatest));
            }
            Takes::Dissolve => {
                let value = value.strip_prefix(b"-halo").unwrap_or(value);
                self.d = Some(number(value).ok_or(Refusal::Malformed)?.clamp(0.0, 1.0));
            }
            Takes::Model => self.illum = Some(model(value).ok_or(Refusal::Malformed)?),
            &Takes::Map(word) => {
                let name = map::file_name(value).ok_or(Refusal::Malformed)?.to_vec();
                match self.maps.iter_mut().find(|(known, _)| *known == word) {
                    Some(map) => map.1 = name,
                    None => self.maps.push((word, name)),
                }
            }
            Takes::Ignored => {}
        }
        Ok(())
    }
}

/// Whether a word is one that an MTL may have, in any case.
pub fn is_mtl_word(word: &str) -> bool {
    WORDS.iter().any(|(known, _)| word.eq_ignore_ascii_case(known))
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
            ("Ns", "-3"),
            ("illum", "2.0"),
            ("d", "-halo 0.25"),
        ]);
        assert_eq!(g.kd, Some([0.1, 0.2, 0.3]));
        assert_eq!(g.ks, Some([0.5; 3]));
        assert_eq!((g.ns, g.illum, g.d), (Some(0.0), Some(2), Some(0.25)));
    }

    #[test]
    fn what_is_refused() {
        let refusal = |word: &str, value: &str| Given::default().set(word.as_bytes(), value.as_bytes()).err();
        for (word, value) in [
            ("Kd", ""),
            ("Kd", "0.1 0.2"),
            ("Kd", "spectral file.rfl"),
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
    fn the_last_stands() {
        let g = given(&[
            ("map_bump", "a.png"),
            ("map_Kd", "b.png"),
            ("bump", "c.png"),
            ("Kd", "1"),
            ("Kd", "0.5"),
        ]);
        assert_eq!(g.maps, [("bump", b"c.png".to_vec()), ("map_Kd", b"b.png".to_vec())]);
        assert_eq!(g.kd, Some([0.5; 3]));
    }
}
