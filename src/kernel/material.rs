//! Materials as the kernel reads them.

use crate::math::Vec3;
use crate::scene::Material;
use bytemuck::{Pod, Zeroable};

/// In [`MaterialRecord::flags`]: the dissolve is that of `d -halo`.
pub const HALO: u32 = 1;
/// In [`MaterialRecord::flags`]: Tf counts as a transparency of models 4 and 9.
pub const TF_GIVEN: u32 = 2;
/// In [`MaterialRecord::flags`]: maps change what stands here.
pub const TEXTURED: u32 = 4;
/// In [`MaterialRecord::flags`]: a map changes what shadow rays are let through.
pub const TEXTURED_SHADOW: u32 = 8;

/// A material's constants.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct MaterialRecord {
    /// Ambient reflectance.
    pub ka: Vec3,
    /// The illumination model, 0 to 10.
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
    /// [`HALO`], [`TF_GIVEN`], [`TEXTURED`], [`TEXTURED_SHADOW`].
    pub flags: u32,
    /// Transmission filter, at most 1.
    pub tf: Vec3,
    /// Optical density, above 0.
    pub ni: f32,
}

impl MaterialRecord {
    /// From a material as the scene gives it.
    pub fn new(m: &Material) -> Self {
        let flag = |is_set: bool, flag| if is_set { flag } else { 0 };
        let t = &m.textures;
        let shadow_maps = t.map_d.is_some() || t.map_ks.is_some() && matches!(m.illum, 6 | 7);
        Self {
            ka: m.ka.into(),
            illum: u32::from(m.illum.min(10)),
            kd: m.kd.into(),
            ns: m.ns.clamp(0.0, f32::MAX),
            ks: m.ks.into(),
            d: m.d.clamp(0.0, 1.0),
            ke: m.ke.into(),
            flags: flag(m.halo, HALO)
                | flag(m.tf_given, TF_GIVEN)
                | flag(t.maps().iter().any(Option::is_some), TEXTURED)
                | flag(shadow_maps, TEXTURED_SHADOW),
            tf: Vec3::from(m.tf).clamp(Vec3::ZERO, Vec3::ONE),
            ni: if m.ni > 0.0 { m.ni.min(f32::MAX) } else { 1.0 },
        }
    }

    /// Whether a flag is set.
    pub fn is(&self, flag: u32) -> bool {
        self.flags & flag != 0
    }

    /// Whether its dissolve is not that of all models: models 4 and 9 have a transparency of their own, 6 and 7 refract.
    pub fn is_glass(&self) -> bool {
        matches!(self.illum, 4 | 6 | 7 | 9)
    }

    /// What of a ray's weight the surface takes; the rest goes straight on.
    pub fn cover(&self) -> f32 {
        if self.is_glass() { 1.0 } else { self.d }
    }

    /// Specular reflectance as a weight of rays.
    pub fn mirror(&self) -> Vec3 {
        self.ks.clamp(Vec3::ZERO, Vec3::ONE)
    }

    /// The transparency of models 4 and 9.
    pub fn transparency(&self) -> Vec3 {
        if self.d < 1.0 {
            Vec3::splat(1.0 - self.d)
        } else if self.is(TF_GIVEN) {
            self.tf
        } else {
            Vec3::ZERO
        }
    }

    /// What shadow rays are let through.
    pub fn shadow_factor(&self) -> Vec3 {
        match self.illum {
            4 | 9 => self.transparency(),
            6 | 7 => self.tf * (1.0 - self.mirror()),
            10 => Vec3::ONE,
            _ => Vec3::splat(1.0 - self.d),
        }
    }

    /// Whether no shadow ray is ever let through.
    pub fn is_opaque(&self) -> bool {
        !self.is(HALO | TEXTURED_SHADOW) && self.shadow_factor() == Vec3::ZERO
    }

    /// `d -halo f` seen under an angle of that cosine: 1 − (1 − f)·(N·V).
    #[must_use]
    pub fn with_halo(mut self, cosine: f32) -> Self {
        self.d = 1.0 - (1.0 - self.d) * cosine.clamp(0.0, 1.0);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(change: impl FnOnce(&mut Material)) -> MaterialRecord {
        let mut m = Material::default();
        change(&mut m);
        MaterialRecord::new(&m)
    }

    #[test]
    fn constants_are_brought_into_range() {
        let ns_and_d = |ns, d| {
            let m = of(|m| (m.ns, m.d) = (ns, d));
            (m.ns, m.d)
        };
        assert_eq!(ns_and_d(-3.0, 2.0), (0.0, 1.0));
        assert_eq!(ns_and_d(f32::INFINITY, -1.0), (f32::MAX, 0.0));
        assert_eq!([0.0, -2.0, f32::NAN, 1.5].map(|ni| of(|m| m.ni = ni).ni), [1.0, 1.0, 1.0, 1.5]);
        assert_eq!(of(|m| m.illum = 200).illum, 10);
    }

    #[test]
    fn what_shadow_rays_are_let_through() {
        let with = |illum, d, tf_given| {
            of(|m| {
                (m.illum, m.d, m.tf_given, m.tf) = (illum, d, tf_given, [0.5, 2.0, 0.25]);
                m.ks = [0.5, 0.0, 4.0];
            })
            .shadow_factor()
        };
        let tf = Vec3::new(0.5, 1.0, 0.25);
        assert_eq!(with(2, 0.25, true), Vec3::splat(0.75));
        assert_eq!(
            (with(4, 0.25, true), with(4, 1.0, true), with(9, 1.0, false)),
            (Vec3::splat(0.75), tf, Vec3::ZERO)
        );
        assert_eq!(
            (with(6, 0.25, false), with(7, 1.0, true)),
            (Vec3::new(0.25, 1.0, 0.0), Vec3::new(0.25, 1.0, 0.0))
        );
        assert_eq!(with(10, 1.0, false), Vec3::ONE);
    }

    #[test]
    fn a_halo_is_clear_in_the_middle() {
        let m = of(|m| (m.d, m.halo) = (0.25, true));
        assert_eq!((m.with_halo(1.0).d, m.with_halo(0.0).d, m.with_halo(0.5).d), (0.25, 1.0, 0.625));
        assert!(!of(|m| m.halo = true).is_opaque());
    }
}
