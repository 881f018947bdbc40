//! Materials as the MTL gives them, with what it leaves out filled in.

use super::part::{Content, PartHasher};
use super::texture::{Map, Reflection};

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

    /// All maps there can be in a fixed order: those of [`Self::maps`], the sphere of `refl`, the six faces of its
    /// cube.
    pub fn slots(&self) -> [Option<&Map>; 15] {
        let mut slots = [None; 15];
        slots[..8].copy_from_slice(&self.maps());
        match &self.refl {
            None => {}
            Some(Reflection::Sphere(map)) => slots[8] = Some(map),
            Some(Reflection::Cube(faces)) => {
                slots[9..].copy_from_slice(&faces.each_ref().map(Option::as_ref));
            }
        }
        slots
    }

    fn hash_into(&self, h: &mut PartHasher) {
        for map in self.slots() {
            h.u64(u64::from(map.is_some()));
            if let Some(map) = map {
                map.hash_into(h);
            }
        }
        // a cube without faces is black all around, which is not the same as no map
        h.u64(u64::from(self.refl.is_some()));
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
    }

    fn bytes(&self) -> u64 {
        size_of::<Self>() as u64
    }
}
