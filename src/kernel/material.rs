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
    /// Optical density, above 0.
    pub ni: f32,
    /// Transmission filter.
    pub tf: Vec3,
    /// [`HALO`] and [`TF_GIVEN`].
    pub flags: u32,
}

/// The dissolve is that of `d -halo`.
pub const HALO: u32 = 1;
/// Tf counts as the transparency of models 4 and 9.
pub const TF_GIVEN: u32 = 2;

impl MaterialRecord {
    /// From a material as the scene gives it.
    pub fn new(m: &Material) -> Self {
        Self {
            ka: m.ka.into(),
            illum: u32::from(m.illum.min(10)),
            kd: m.kd.into(),
            ns: m.ns.clamp(0.0, f32::MAX),
            ks: m.ks.into(),
            d: m.d.clamp(0.0, 1.0),
            ke: m.ke.into(),
            ni: if m.ni > 0.0 { m.ni } else { 1.0 },
            tf: m.tf.into(),
            flags: (u32::from(m.halo) * HALO) | (u32::from(m.tf_given) * TF_GIVEN),
        }
    }
}

impl MaterialRecord {
    /// Whether a surface of it needs nothing but its lights and what is straight on behind it: models 0 to 2.
    pub fn is_direct(&self) -> bool {
        self.illum <= 2 && self.flags & HALO == 0
    }

    /// What a shadow ray keeps of its light here, by channel; `cos` is |N·V| of the shadow ray.
    pub fn shadow_factor(&self, d: f32, tf: Vec3, ks: Vec3) -> Vec3 {
        match self.illum {
            4 | 9 => self.transparency(d, tf),
            6 | 7 => tf.min(Vec3::ONE) * (Vec3::ONE - ks.min(Vec3::ONE)),
            10 => Vec3::ONE,
            _ => Vec3::splat(1.0 - d),
        }
    }

    /// The transparency t of models 4 and 9: 1 − d where d < 1, else Tf where it counts, else 0.
    pub fn transparency(&self, d: f32, tf: Vec3) -> Vec3 {
        if d < 1.0 {
            Vec3::splat(1.0 - d)
        } else if self.flags & TF_GIVEN != 0 {
            tf.min(Vec3::ONE)
        } else {
            Vec3::ZERO
        }
    }

    /// Whether no light passes, whatever the textures say of other things than d.
    pub fn is_opaque(&self) -> bool {
        self.flags & HALO == 0 && self.shadow_factor(self.d, self.tf, self.ks) == Vec3::ZERO
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_shadow_rays_keep() {
        let of = |illum, d, tf_given| {
            let m = MaterialRecord::new(&Material {
                illum,
                d,
                tf: [0.5, 1.0, 2.0],
                tf_given,
                ks: [0.2; 3],
                ..Material::default()
            });
            m.shadow_factor(m.d, m.tf, m.ks)
        };
        assert_eq!(of(2, 0.75, true), Vec3::splat(0.25), "Tf acts in 4, 6, 7 and 9 only");
        assert_eq!(of(4, 0.75, true), Vec3::splat(0.25), "d below 1 wins");
        assert_eq!(of(4, 1.0, true), Vec3::new(0.5, 1.0, 1.0));
        assert_eq!(of(9, 1.0, false), Vec3::ZERO);
        assert_eq!(of(7, 1.0, false), Vec3::new(0.5, 1.0, 1.0) * (1.0 - 0.2));
        assert_eq!(of(10, 1.0, false), Vec3::ONE);
    }

    #[test]
    fn constants_are_brought_into_range() {
        let of = |ns, d| MaterialRecord::new(&Material { ns, d, ..Material::default() });
        assert_eq!((of(-3.0, 2.0).ns, of(-3.0, 2.0).d), (0.0, 1.0));
        assert_eq!((of(f32::INFINITY, -1.0).ns, of(f32::INFINITY, -1.0).d), (f32::MAX, 0.0));
    }
}
