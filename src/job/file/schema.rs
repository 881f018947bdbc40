//! The keys of the job file as serde reads them. Unknown ones are errors everywhere.

use super::value::{
    Angle, Any, Color, ColorOrFile, Depth, Exposure, Format, Fov, Frame, Frames, Number, Prune, Quality,
    Samples, Side, Triple, Up, Whole, Word,
};
use crate::job::track::Interpolation;
use crate::scene::Filter;
use serde::Deserialize;
use serde::de::{self, Deserializer, MapAccess, Visitor, value::MapAccessDeserializer};
use std::collections::BTreeMap;
use std::fmt;

/// Fields that the job and its overrides share.
macro_rules! with_scene_keys {
    ($(#[$doc:meta])* $name:ident { $($own:tt)* }) => {
        $(#[$doc])*
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        pub(super) struct $name {
            pub camera: Option<Choice<Camera>>,
            pub lights: Option<Choice<Vec<Light>>>,
            pub ambient: Option<Triple<Color>>,
            pub background: Option<ColorOrFile>,
            pub samples: Option<Number<Samples>>,
            pub filter: Option<Filter>,
            pub depth: Option<Number<Depth>>,
            pub seed: Option<Number<Whole>>,
            pub up: Option<Up>,
            pub exposure: Option<Number<Exposure>>,
            pub smooth_angle: Option<Number<Angle>>,
            pub aov: Option<Vec<Word>>,
            pub mtl_color: Option<MtlColor>,
            pub prune: Option<Number<Prune>>,
            pub materials: Option<BTreeMap<String, BTreeMap<String, MaterialWord>>>,
            $($own)*
        }
    };
}

with_scene_keys! {
    /// The whole file.
    Job {
        pub version: Option<Number<Whole>>,
        pub name: Option<Word>,
        pub sequence: Option<Word>,
        pub layers: Option<Vec<Layer>>,
        pub frames: Option<Frames>,
        pub output: Option<Output>,
        /// For the daemon; a render has no use for it.
        #[serde(rename = "priority")]
        pub _priority: Option<Number<Any>>,
        pub overrides: Option<Vec<Override>>,
    }
}

with_scene_keys! {
    /// Settings for some frames.
    Override {
        pub frames: Option<Frames>,
        pub files: Option<Word>,
        pub size: Option<[Number<Side>; 2]>,
        pub format: Option<Format>,
        pub name: Option<Word>,
        pub alpha: Option<bool>,
        pub bits: Option<Number<Whole>>,
        pub quality: Option<Number<Quality>>,
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Output {
    pub folder: Option<Word>,
    pub name: Option<Word>,
    pub format: Option<Format>,
    pub size: Option<[Number<Side>; 2]>,
    pub alpha: Option<bool>,
    pub bits: Option<Number<Whole>>,
    pub quality: Option<Number<Quality>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Layer {
    pub sequence: Word,
    pub name: Option<Word>,
    pub transform: Option<Transform>,
    pub frames: Option<LayerFrames>,
    pub materials: Option<Word>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LayerFrames {
    pub start: Option<Number<Frame>>,
    pub step: Option<Number<Frame>>,
    #[serde(default)]
    pub outside: Outside,
}

#[derive(Clone, Copy, Deserialize, Default)]
#[serde(rename_all = "lowercase")]
pub(super) enum Outside {
    #[default]
    Hold,
    Loop,
    Hide,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Transform {
    pub translate: Option<Triple<Any>>,
    pub rotate: Option<Triple<Any>>,
    pub scale: Option<Triple<Any>>,
    pub keys: Option<Vec<TransformKey>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TransformKey {
    pub frame: Number<Frame>,
    pub translate: Option<Triple<Any>>,
    pub rotate: Option<Triple<Any>>,
    pub scale: Option<Triple<Any>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Camera {
    pub eye: Option<Triple<Any>>,
    pub look_at: Option<Triple<Any>>,
    pub up: Option<Up>,
    pub fov: Option<Number<Fov>>,
    pub keys: Option<Vec<CameraKey>>,
    #[serde(default)]
    pub interpolate: Interpolation,
    pub gltf: Option<Word>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraKey {
    pub frame: Number<Frame>,
    pub eye: Triple<Any>,
    pub look_at: Triple<Any>,
    pub up: Option<Up>,
    pub fov: Option<Number<Fov>>,
}

/// A map with one key; which one says what kind of light it is.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Light {
    pub point: Option<Point>,
    pub directional: Option<Directional>,
    pub spot: Option<Spot>,
    pub area: Option<Area>,
}

#[derive(Clone, Copy, Deserialize, Default)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Falloff {
    #[default]
    None,
    InverseSquare,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Point {
    pub position: Triple<Any>,
    pub color: Option<Triple<Color>>,
    pub intensity: Option<Number<Color>>,
    #[serde(default)]
    pub falloff: Falloff,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Directional {
    pub direction: Triple<Any>,
    pub color: Option<Triple<Color>>,
    pub intensity: Option<Number<Color>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Area {
    pub material: Option<AllMaterials>,
    pub samples: Option<Number<Samples>>,
}

/// Which materials' triangles are meant: those of all.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum AllMaterials {
    All,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Spot {
    pub position: Triple<Any>,
    pub direction: Triple<Any>,
    pub inner: Number<Angle>,
    pub outer: Number<Angle>,
    pub color: Option<Triple<Color>>,
    pub intensity: Option<Number<Color>>,
    #[serde(default)]
    pub falloff: Falloff,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum MtlColor {
    Linear,
    Srgb,
}

/// `auto`, or what is given.
pub(super) enum Choice<T> {
    Auto,
    Given(T),
}

/// A visitor of `auto` or something else that keeps the places of errors, which serde's untagged enums lose.
struct AutoOr<T>(&'static str, std::marker::PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for AutoOr<T> {
    type Value = Choice<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "auto or {}", self.0)
    }

    fn visit_str<E: de::Error>(self, s: &str) -> Result<Choice<T>, E> {
        if s == "auto" { Ok(Choice::Auto) } else { Err(E::invalid_value(de::Unexpected::Str(s), &self)) }
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Choice<T>, A::Error> {
        T::deserialize(MapAccessDeserializer::new(map)).map(Choice::Given)
    }

    fn visit_seq<A: de::SeqAccess<'de>>(self, list: A) -> Result<Choice<T>, A::Error> {
        T::deserialize(de::value::SeqAccessDeserializer::new(list)).map(Choice::Given)
    }
}

impl<'de> Deserialize<'de> for Choice<Camera> {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        d.deserialize_any(AutoOr("a map with eye and look_at", std::marker::PhantomData))
    }
}

impl<'de> Deserialize<'de> for Choice<Vec<Light>> {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        d.deserialize_any(AutoOr("a list of lights", std::marker::PhantomData))
    }
}

/// What stands behind a word of an MTL: a word, a number, or a list of them.
pub(super) struct MaterialWord(pub String);

impl<'de> Deserialize<'de> for MaterialWord {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct Words;
        impl<'de> Visitor<'de> for Words {
            type Value = String;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("what an MTL has behind the word: a number, a name or a list of numbers")
            }
            fn visit_str<E: de::Error>(self, s: &str) -> Result<String, E> {
                Ok(s.to_string())
            }
            fn visit_f64<E: de::Error>(self, x: f64) -> Result<String, E> {
                Ok(x.to_string())
            }
            fn visit_u64<E: de::Error>(self, x: u64) -> Result<String, E> {
                Ok(x.to_string())
            }
            fn visit_i64<E: de::Error>(self, x: i64) -> Result<String, E> {
                Ok(x.to_string())
            }
            fn visit_seq<A: de::SeqAccess<'de>>(self, mut list: A) -> Result<String, A::Error> {
                let mut words = Vec::new();
                while let Some(word) = list.next_element::<MaterialWord>()? {
                    words.push(word.0);
                }
                Ok(words.join(" "))
            }
        }
        d.deserialize_any(Words).map(Self)
    }
}
