//! Textures and how materials use them.

use super::part::{Content, Part, PartHasher};

/// What the numbers of a texture mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TexelSpace {
    /// Colour on the sRGB curve; alpha is linear.
    Srgb,
    /// Linear numbers: data, or colour of float files.
    Linear,
}

/// The texels of all levels, level 0 first, each level row by row from the top; RGBA.
#[derive(Clone, Debug, PartialEq)]
pub enum Texels {
    /// Shares of 255.
    U8(Vec<[u8; 4]>),
    /// Floats.
    F32(Vec<[f32; 4]>),
}

/// A decoded picture with its mip levels: each half as wide and high as the one before, rounded down, at least 1, down
/// to 1x1.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Width and height of level 0, each 1 or more.
    pub size: [u32; 2],
    /// What the numbers mean.
    pub space: TexelSpace,
    /// Whether alpha differs anywhere from 1.
    pub alpha_varies: bool,
    /// The texels.
    pub texels: Texels,
}

impl Texture {
    /// Width and height of a level.
    pub fn level_size(&self, level: u32) -> [u32; 2] {
        self.size.map(|s| (s >> level.min(31)).max(1))
    }

    /// How many levels there are.
    pub fn levels(&self) -> u32 {
        32 - self.size[0].max(self.size[1]).max(1).leading_zeros()
    }
}

impl Content for Texture {
    const KIND: &'static str = "texture";

    fn hash_into(&self, h: &mut PartHasher) {
        h.slice(&self.size);
        h.u64(u64::from(self.space == TexelSpace::Srgb));
        match &self.texels {
            Texels::U8(t) => h.slice(t.as_flattened()),
            Texels::F32(t) => h.slice(t.as_flattened()),
        }
    }

    fn bytes(&self) -> u64 {
        match &self.texels {
            Texels::U8(t) => size_of_val(t.as_slice()) as u64,
            Texels::F32(t) => size_of_val(t.as_slice()) as u64,
        }
    }
}

/// Which number of a texel a map that needs one takes (-imfchan).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Red.
    R,
    /// Green.
    G,
    /// Blue.
    B,
    /// Alpha (m, matte).
    Alpha,
    /// Luminance.
    Luminance,
}

/// A texture as a material uses it, with the options of its MTL statement.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// The texture.
    pub texture: Part<Texture>,
    /// -s: factors of u and v.
    pub scale: [f32; 2],
    /// -o: added to u and v after the factors.
    pub offset: [f32; 2],
    /// -clamp on: outside 0 to 1 the border's texel, else the texture repeats.
    pub clamp: bool,
    /// -mm base gain: texel · gain + base.
    pub base_gain: [f32; 2],
    /// -bm: factor of a bump map's heights.
    pub bump_multiplier: f32,
    /// -imfchan, where it was given.
    pub channel: Option<Channel>,
}

impl Map {
    /// Adds it to a hash.
    pub fn hash_into(&self, h: &mut PartHasher) {
        h.part(self.texture.hash());
        h.slice(&self.scale);
        h.slice(&self.offset);
        h.slice(&self.base_gain);
        h.f32(self.bump_multiplier);
        h.u64(u64::from(self.clamp) | self.channel.map_or(0, |c| 1 + c as u64) << 1);
    }
}

/// What a `refl` map is.
#[derive(Clone, Debug, PartialEq)]
pub enum Reflection {
    /// -type sphere: one picture, latitude and longitude.
    Sphere(Map),
    /// -type cube_*: the faces −x, +x, −y, +y, −z, +z (left, right, bottom, top, back, front); missing ones are black.
    Cube(Box<[Option<Map>; 6]>),
}
