//! Materials as the kernel reads them.

use crate::math::Vec3;
use crate::scene::Material;
use bytemuck::{Pod, Zeroable};

/// A material's constants.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct MaterialRecord {
    /// Ambient reflectance.
    pub ka: Vec3,
    /// The illumination model that is rendered: 0, 1 or 2.
    pub illum: u32,
    /// Diffuse reflectance.
    pub kd: Vec3,
    /// Specular exponent, 0 or more.
    pub ns: f32,
    /// Specular reflectance.
    pub ks: Vec3,
    /// Dissolve in [0, 1].
    pub d: f32,
    /// Emission.
    pub ke: Vec3,
    /// Fills the row of four.
    pub pad: f32,
}

impl MaterialRecord {
    /// From a material as the scene gives it.
    pub fn new(m: &Material) -> Self {
        Self {
            ka: m.ka.into(),
            illum: u32::from(fallback(m.illum).unwrap_or(m.illum)),
            kd: m.kd.into(),
            ns: m.ns.clamp(0.0, f32::MAX),
            ks: m.ks.into(),
            d: m.d.clamp(0.0, 1.0),
            ke: m.ke.into(),
            pad: 0.0,
        }
    }
}

/// The illumination model that is rendered in place of one that is not rendered as it stands.
pub fn fallback(illum: u8) -> Option<u8> {
    (illum > 2).then_some(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_that_are_not_rendered_fall_back_to_highlights() {
        assert_eq!((0..=2).filter_map(fallback).count(), 0);
        assert!((3..=10).all(|illum| fallback(illum) == Some(2)));
        assert_eq!(MaterialRecord::new(&Material { illum: 7, ..Material::default() }).illum, 2);
    }

    #[test]
    fn constants_are_brought_into_range() {
        let of = |ns, d| MaterialRecord::new(&Material { ns, d, ..Material::default() });
        assert_eq!((of(-3.0, 2.0).ns, of(-3.0, 2.0).d), (0.0, 1.0));
        assert_eq!((of(f32::INFINITY, -1.0).ns, of(f32::INFINITY, -1.0).d), (f32::MAX, 0.0));
    }
}
