//! Materials as the MTL gives them, with what it leaves out filled in.

use super::part::{Content, PartHash, PartHasher};
use std::path::PathBuf;

/// A file that a material names (`map_Kd` and the like).
#[derive(Clone, Debug, PartialEq)]
pub struct MapFile {
    /// The word before it, as `map_Kd`.
    pub word: String,
    /// Where it was found; None where it is missing.
    pub path: Option<PathBuf>,
    /// Hash of its bytes; None where it is missing.
    pub content: Option<PartHash>,
}

/// One material, defaults filled in (CONTRACT 5). Its name is not part of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Ambient reflectance, linear RGB.
    pub ka: [f32; 3],
    /// Diffuse reflectance, linear RGB.
    pub kd: [f32; 3],
    /// Specular reflectance, linear RGB.
    pub ks: [f32; 3],
    /// Emission, linear RGB.
    pub ke: [f32; 3],
    /// Specular exponent.
    pub ns: f32,
    /// Dissolve: 1 opaque, 0 not there.
    pub d: f32,
    /// Illumination model, 0 to 10.
    pub illum: u8,
    /// Files it names, in the order of the file.
    pub maps: Vec<MapFile>,
}

impl Default for Material {
    /// What a face without a material has.
    fn default() -> Self {
        Self {
            ka: [0.0; 3],
            kd: [0.8; 3],
            ks: [0.0; 3],
            ke: [0.0; 3],
            ns: 1.0,
            d: 1.0,
            illum: 1,
            maps: Vec::new(),
        }
    }
}

impl Content for Material {
    const KIND: &'static str = "material";

    fn hash_into(&self, h: &mut PartHasher) {
        for c in [self.ka, self.kd, self.ks, self.ke] {
            h.slice(&c);
        }
        h.f32(self.ns);
        h.f32(self.d);
        h.u64(u64::from(self.illum));
        for m in &self.maps {
            h.bytes(m.word.as_bytes());
            h.u64(u64::from(m.content.is_some()));
            if let Some(c) = m.content {
                h.part(c);
            }
        }
    }

    fn bytes(&self) -> u64 {
        size_of::<Self>() as u64
    }
}
