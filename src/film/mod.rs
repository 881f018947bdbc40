//! Film, AOVs, colour, comparison.

pub mod color;
pub mod compare;
mod flip;
mod latent;
mod pixels;
pub mod quantize;

pub use color::{Srgb8, gain_from_stops};
pub use latent::LatentFilm;
pub use pixels::Pixels;

use crate::scene::{Aov, AovSet};
use std::borrow::Cow;

/// A linear float picture with its auxiliary pictures; rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Linear RGB, premultiplied where alpha is there; empty where there are codes.
    pub rgb: Pixels<[f32; 3]>,
    /// RGB of 8 bits on the sRGB curve after exposure, three bytes a pixel, where a device made them.
    pub codes: Option<Pixels<u8>>,
    /// Coverage, where it was asked for.
    pub alpha: Option<Vec<f32>>,
    /// Auxiliary pictures.
    pub aovs: Aovs,
}

/// Auxiliary pictures, each there if asked for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Aovs {
    /// Distance along the ray through the pixel's centre; infinite where nothing is hit.
    pub depth: Option<Vec<f32>>,
    /// Shading normal; 0 where nothing is hit.
    pub normal: Option<Vec<[f32; 3]>>,
    /// Position in the world; 0 where nothing is hit.
    pub position: Option<Vec<[f32; 3]>>,
    /// Diffuse reflectance, mean over the samples.
    pub albedo: Option<Vec<[f32; 3]>>,
    /// `[id.part, id.triangle]`, 0xFFFFFFFF where nothing is hit.
    pub id: Option<Vec<[u32; 2]>>,
    /// The material, by its place among the frame's distinct ones in the order of their first use; 0xFFFFFFFF where
    /// nothing is hit.
    pub material: Option<Vec<u32>>,
    /// Texture coordinates; 0 where nothing is hit, or where there are none.
    pub uv: Option<Vec<[f32; 2]>>,
    /// What is not background, mean over the samples.
    pub coverage: Option<Vec<f32>>,
}

impl Aovs {
    /// Whether there is one.
    pub fn any(&self) -> bool {
        self.depth.is_some()
            || self.normal.is_some()
            || self.position.is_some()
            || self.albedo.is_some()
            || self.id.is_some()
            || self.material.is_some()
            || self.uv.is_some()
            || self.coverage.is_some()
    }
}

impl Film {
    /// A film of codes, three bytes a pixel.
    pub fn of_codes(size: [u32; 2], codes: Pixels<u8>) -> Self {
        Self { size, rgb: Pixels::default(), codes: Some(codes), alpha: None, aovs: Aovs::default() }
    }

    /// RGB of 8 bits on the sRGB curve, RGBA with straight colour where there is alpha and it is wanted.
    pub fn codes(&self, with_alpha: bool, exposure_stops: f32) -> Cow<'_, [u8]> {
        if let Some(codes) = &self.codes {
            return Cow::Borrowed(codes);
        }
        let alpha = self.alpha.as_deref().filter(|_| with_alpha);
        Cow::Owned(quantize::quantize8(&self.rgb, alpha, exposure_stops))
    }

    /// A black film with room for what is asked.
    pub fn new(size: [u32; 2], alpha: bool, aovs: AovSet) -> Self {
        let n = size[0] as usize * size[1] as usize;
        Self { rgb: vec![[0.0; 3]; n].into(), ..Self::without_rgb(size, alpha, aovs) }
    }

    /// A black film of codes.
    pub fn new_codes(size: [u32; 2], aovs: AovSet) -> Self {
        let n = size[0] as usize * size[1] as usize;
        Self { codes: Some(vec![0; 3 * n].into()), ..Self::without_rgb(size, false, aovs) }
    }

    /// The same before its colour is there.
    pub fn without_rgb(size: [u32; 2], alpha: bool, aovs: AovSet) -> Self {
        let n = size[0] as usize * size[1] as usize;
        Self {
            size,
            rgb: Pixels::default(),
            codes: None,
            alpha: alpha.then(|| vec![0.0; n]),
            aovs: Aovs {
                depth: aovs.contains(Aov::Depth).then(|| vec![f32::INFINITY; n]),
                normal: aovs.contains(Aov::Normal).then(|| vec![[0.0; 3]; n]),
                position: aovs.contains(Aov::Position).then(|| vec![[0.0; 3]; n]),
                albedo: aovs.contains(Aov::Albedo).then(|| vec![[0.0; 3]; n]),
                id: aovs.contains(Aov::Id).then(|| vec![[u32::MAX; 2]; n]),
                material: aovs.contains(Aov::Material).then(|| vec![u32::MAX; n]),
                uv: aovs.contains(Aov::Uv).then(|| vec![[0.0; 2]; n]),
                coverage: aovs.contains(Aov::Coverage).then(|| vec![0.0; n]),
            },
        }
    }
}
