//! A shot: everything but the geometry that bears on the film of one frame.

use super::camera::Camera;
use super::light::Light;
use super::part::{Part, PartHasher};
use super::texture::Texture;
use crate::math::Vec3;

/// The pixel filter, sampled, not splatted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Filter {
    /// Width 1.
    #[default]
    Box,
    /// Radius 1.
    Triangle,
    /// Radius 1.5, σ 0.5.
    Gaussian,
}

/// One kind of auxiliary picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Aov {
    /// Distance along the ray, infinite where nothing is hit.
    Depth,
    /// Shading normal, turned to the viewer.
    Normal,
    /// Position in the world.
    Position,
    /// Diffuse reflectance, mean over the samples.
    Albedo,
    /// `id.part` and `id.triangle`.
    Id,
    /// The material, by its place among the frame's distinct ones in the order of their first use.
    Material,
    /// Texture coordinates.
    Uv,
    /// What is not background, mean over the samples.
    Coverage,
}

impl Aov {
    /// All of them, in the order in which they are written.
    pub const ALL: [Self; 8] = [
        Self::Depth,
        Self::Normal,
        Self::Position,
        Self::Albedo,
        Self::Id,
        Self::Material,
        Self::Uv,
        Self::Coverage,
    ];

    /// How many numbers of 32 bits it has in a pixel.
    pub fn channels(self) -> u64 {
        match self {
            Self::Depth | Self::Material | Self::Coverage => 1,
            Self::Id | Self::Uv => 2,
            Self::Normal | Self::Position | Self::Albedo => 3,
        }
    }

    /// The word on the command line and in the job file.
    pub fn word(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Normal => "normal",
            Self::Position => "position",
            Self::Albedo => "albedo",
            Self::Id => "id",
            Self::Material => "material",
            Self::Uv => "uv",
            Self::Coverage => "coverage",
        }
    }
}

/// A set of [`Aov`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct AovSet(u8);

impl AovSet {
    /// Adds one.
    pub fn insert(&mut self, aov: Aov) {
        self.0 |= 1 << aov as u8;
    }

    /// Whether it holds one.
    pub fn contains(self, aov: Aov) -> bool {
        self.0 & 1 << aov as u8 != 0
    }

    /// Whether it holds none.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// What is seen where nothing is hit.
#[derive(Clone, Debug, PartialEq)]
pub enum Background {
    /// A colour, linear RGB.
    Color(Vec3),
    /// A latitude-longitude picture: −z in its middle, +x to the right of it, +y at the top.
    Picture {
        /// The picture.
        texture: Part<Texture>,
        /// Whether +z is at the top instead, +y in the middle, as all that stands upright is turned by `--up z`.
        is_z_up: bool,
    },
}

impl Background {
    fn hash_into(&self, h: &mut PartHasher) {
        match self {
            Self::Color(color) => {
                h.u64(0);
                h.slice(&[*color]);
            }
            Self::Picture { texture, is_z_up } => {
                h.u64(1 + u64::from(*is_z_up));
                h.part(texture.hash());
            }
        }
    }
}

/// Everything but the geometry that bears on the film of one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Shot {
    /// The camera.
    pub camera: Camera,
    /// The lights in the order given; sums follow it.
    pub lights: Vec<Light>,
    /// Ambient light Ia, linear RGB.
    pub ambient: Vec3,
    /// What is seen where nothing is hit.
    pub background: Background,
    /// Width and height in pixels, each 1 or more.
    pub size: [u32; 2],
    /// Samples a pixel, 1 or more.
    pub samples: u32,
    /// Pixel filter.
    pub filter: Filter,
    /// Bounces of mirrored and refracted rays.
    pub depth: u32,
    /// Seed of the samples.
    pub seed: u32,
    /// Rays below this weight in every channel are not traced.
    pub prune: f32,
    /// Whether the background is left out and coverage kept.
    pub alpha: bool,
    /// Auxiliary pictures.
    pub aovs: AovSet,
}

impl Shot {
    /// Adds it to a fingerprint.
    pub fn hash_into(&self, h: &mut PartHasher) {
        self.camera.hash_into(h);
        h.u64(self.lights.len() as u64);
        for l in &self.lights {
            l.hash_into(h);
        }
        h.slice(&[self.ambient]);
        self.background.hash_into(h);
        h.slice(&self.size);
        h.slice(&[self.samples, self.filter as u32, self.depth, self.seed]);
        h.f32(self.prune);
        h.u64(u64::from(self.alpha) | u64::from(self.aovs.0) << 8);
    }
}
