//! Materials as the MTL gives them, with what it leaves out filled in.

use super::part::{Content, PartHash, PartHasher};
use super::texture::{Map, Reflection};
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

/// The maps of a material.
#[derive(Clone, Debug, Default, PartialEq)]
#[allow(missing_docs, reason = "the names are those of the MTL words")]
pub struct Textures {
    pub map_ka: Option<Map>,
    pub map_kd: Option<Map>,
    pub map_ks: Option<Map>,
    pub map_ke: Option<Map>,
    pub map_ns: Option<Map>,
    pub map_d: Option<Map>,
    pub bump: Option<Map>,
    pub norm: Option<Map>,
    pub refl: Option<Reflection>,
}

impl Textures {
    /// Whether there is no map at all.
    pub fn is_empty(&self) -> bool {
        self.refl.is_none() && self.maps().iter().all(Option::is_none)
    }

    /// All maps in a fixed order, without those of `refl`.
    pub fn maps(&self) -> [Option<&Map>; 8] {
        [
            &self.map_ka,
            &self.map_kd,
            &self.map_ks,
            &self.map_ke,
            &self.map_ns,
            &self.map_d,
            &self.bump,
            &self.norm,
        ]
        .map(Option::as_ref)
    }

    fn hash_into(&self, h: &mut PartHasher) {
        let faces: Vec<Option<&Map>> = match &self.refl {
            None => Vec::new(),
            Some(Reflection::Sphere(map)) => vec![Some(map)],
            Some(Reflection::Cube(faces)) => faces.iter().map(Option::as_ref).collect(),
        };
        h.u64(faces.len() as u64);
        for map in self.maps().into_iter().chain(faces) {
            h.u64(u64::from(map.is_some()));
            if let Some(map) = map {
                map.hash_into(h);
            }
        }
    }
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
    /// Whether `d` is that of `d -halo`: d = 1 − (1 − f)·(N·V).
    pub halo: bool,
    /// Transmission filter, linear RGB.
    pub tf: [f32; 3],
    /// Whether Tf counts as a transparency of model 4 and 9: the job gives it, or the MTL does and it is not 1 1 1.
    pub tf_given: bool,
    /// Optical density.
    pub ni: f32,
    /// Illumination model, 0 to 10.
    pub illum: u8,
    /// Maps of Ka, Kd, Ks, Ke, Ns, d, of heights, and of normals.
    pub textures: Textures,
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
            halo: false,
            tf: [1.0; 3],
            tf_given: false,
            ni: 1.0,
            illum: 1,
            textures: Textures::default(),
            maps: Vec::new(),
        }
    }
}

impl Content for Material {
    const KIND: &'static str = "material";

    fn hash_into(&self, h: &mut PartHasher) {
        for c in [self.ka, self.kd, self.ks, self.ke, self.tf] {
            h.slice(&c);
        }
        h.f32(self.ns);
        h.f32(self.d);
        h.f32(self.ni);
        h.u64(u64::from(self.illum) | u64::from(self.halo) << 8 | u64::from(self.tf_given) << 9);
        self.textures.hash_into(h);
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
