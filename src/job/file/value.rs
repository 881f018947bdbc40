//! Values of the job file, checked where they stand, so that an error has the line and column of the value.

use crate::job::numbers::FrameSet;
use crate::job::options::limits::{self, within};
use crate::math::{DVec3, Vec3};
use serde::de::{self, Deserialize, Deserializer, SeqAccess, Unexpected, Visitor};
use std::fmt;
use std::marker::PhantomData;
use std::ops::RangeInclusive;

/// A number within a range that its type names.
pub(super) struct Number<R>(pub f64, PhantomData<R>);

/// What a number may be.
pub(super) trait Range {
    /// From and to.
    const RANGE: RangeInclusive<f64>;
    /// Whether it must be whole.
    const WHOLE: bool = false;
}

macro_rules! ranges {
    ($($name:ident: $range:expr, $whole:literal;)*) => {
        $(pub(super) struct $name;
        impl Range for $name {
            const RANGE: RangeInclusive<f64> = $range;
            const WHOLE: bool = $whole;
        })*
    };
}

ranges! {
    Any: limits::NUMBER, false;
    Color: limits::COLOR, false;
    Fov: limits::FOV, false;
    Angle: limits::ANGLE, false;
    Exposure: limits::EXPOSURE, false;
    Prune: limits::PRUNE, false;
    Side: limits::SIDE, true;
    Samples: limits::SAMPLES, true;
    Depth: limits::DEPTH, true;
    Whole: limits::U32, true;
    Quality: limits::QUALITY, true;
    Frame: -9.0e15..=9.0e15, true;
}

impl<'de, R: Range> Deserialize<'de> for Number<R> {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct In<R>(PhantomData<R>);
        impl<R: Range> Visitor<'_> for In<R> {
            type Value = f64;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                let kind = if R::WHOLE { "a whole number" } else { "a number" };
                write!(f, "{kind} from {} to {}", R::RANGE.start(), R::RANGE.end())
            }
            fn visit_f64<E: de::Error>(self, x: f64) -> Result<f64, E> {
                if R::WHOLE && x.fract() != 0.0 {
                    return Err(E::invalid_value(Unexpected::Float(x), &self));
                }
                within(x, &R::RANGE).map_err(E::custom)
            }
            fn visit_u64<E: de::Error>(self, x: u64) -> Result<f64, E> {
                self.visit_f64(x as f64)
            }
            fn visit_i64<E: de::Error>(self, x: i64) -> Result<f64, E> {
                self.visit_f64(x as f64)
            }
        }
        d.deserialize_any(In::<R>(PhantomData)).map(|x| Self(x, PhantomData))
    }
}

/// Three numbers, or one that stands for all three.
pub(super) struct Triple<R>(pub DVec3, PhantomData<R>);

impl<R> Triple<R> {
    pub(super) fn f32(&self) -> Vec3 {
        self.0.as_vec3()
    }
}

impl<'de, R: Range> Deserialize<'de> for Triple<R> {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct Three<R>(PhantomData<R>);
        impl<'de, R: Range> Visitor<'de> for Three<R> {
            type Value = DVec3;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("three numbers, as [0, 1, 0]")
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<DVec3, A::Error> {
                let mut v = [0.0; 3];
                for (i, x) in v.iter_mut().enumerate() {
                    *x = list
                        .next_element::<Number<R>>()?
                        .ok_or_else(|| de::Error::invalid_length(i, &self))?
                        .0;
                }
                match list.next_element::<de::IgnoredAny>()? {
                    Some(_) => Err(de::Error::invalid_length(4, &self)),
                    None => Ok(DVec3::from_array(v)),
                }
            }
            fn visit_f64<E: de::Error>(self, x: f64) -> Result<DVec3, E> {
                within(x, &R::RANGE).map(DVec3::splat).map_err(E::custom)
            }
            fn visit_u64<E: de::Error>(self, x: u64) -> Result<DVec3, E> {
                self.visit_f64(x as f64)
            }
            fn visit_i64<E: de::Error>(self, x: i64) -> Result<DVec3, E> {
                self.visit_f64(x as f64)
            }
        }
        d.deserialize_any(Three::<R>(PhantomData)).map(|v| Self(v, PhantomData))
    }
}

/// A colour, or a picture's file.
pub(super) enum ColorOrFile {
    /// Three numbers, or one for all three.
    Color(Triple<Color>),
    /// Its name as written.
    File(String),
}

impl<'de> Deserialize<'de> for ColorOrFile {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = ColorOrFile;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a colour, as [0, 0, 0], or a picture's file, as sky.hdr")
            }
            fn visit_str<E: de::Error>(self, s: &str) -> Result<ColorOrFile, E> {
                Ok(ColorOrFile::File(s.to_string()))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<ColorOrFile, A::Error> {
                Triple::deserialize(de::value::SeqAccessDeserializer::new(list)).map(ColorOrFile::Color)
            }
            fn visit_f64<E: de::Error>(self, x: f64) -> Result<ColorOrFile, E> {
                Triple::deserialize(de::value::F64Deserializer::new(x)).map(ColorOrFile::Color)
            }
            fn visit_u64<E: de::Error>(self, x: u64) -> Result<ColorOrFile, E> {
                self.visit_f64(x as f64)
            }
            fn visit_i64<E: de::Error>(self, x: i64) -> Result<ColorOrFile, E> {
                self.visit_f64(x as f64)
            }
        }
        d.deserialize_any(Either)
    }
}

/// A word or a number, read by a function; the error says what is allowed.
macro_rules! from_text {
    ($($name:ident($kind:ty), $expecting:literal, $parse:expr;)*) => {
        $(pub(super) struct $name(pub $kind);
        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
                struct Text;
                impl Visitor<'_> for Text {
                    type Value = $name;
                    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                        f.write_str($expecting)
                    }
                    fn visit_str<E: de::Error>(self, s: &str) -> Result<$name, E> {
                        $parse(s).map($name).map_err(E::custom)
                    }
                    fn visit_i64<E: de::Error>(self, n: i64) -> Result<$name, E> {
                        self.visit_str(&n.to_string())
                    }
                    fn visit_u64<E: de::Error>(self, n: u64) -> Result<$name, E> {
                        self.visit_str(&n.to_string())
                    }
                    fn visit_f64<E: de::Error>(self, n: f64) -> Result<$name, E> {
                        self.visit_str(&n.to_string())
                    }
                }
                d.deserialize_any(Text)
            }
        })*
    };
}

from_text! {
    Frames(FrameSet), "frame numbers, as 1-48 or 1-48x2", str::parse;
    Format(String), "a picture format", crate::job::settings::format_word;
    Word(String), "text", |s: &str| Ok::<_, String>(s.to_string());
}

/// Up as `y`, `z` or three numbers.
pub(super) struct Up(pub DVec3);

impl<'de> Deserialize<'de> for Up {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct Axis;
        impl<'de> Visitor<'de> for Axis {
            type Value = DVec3;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("y, z or three numbers")
            }
            fn visit_str<E: de::Error>(self, s: &str) -> Result<DVec3, E> {
                crate::job::settings::up(s).map_err(E::custom)
            }
            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<DVec3, A::Error> {
                let v = Triple::<Any>::deserialize(de::value::SeqAccessDeserializer::new(list))?.0;
                if v == DVec3::ZERO { Err(de::Error::custom("up has no direction")) } else { Ok(v) }
            }
        }
        d.deserialize_any(Axis).map(Up)
    }
}
