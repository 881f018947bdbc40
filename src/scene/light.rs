//! Lights of CONTRACT 3 and 5.

use super::part::PartHasher;
use crate::math::Vec3;

/// How a light weakens with the distance d.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Falloff {
    /// Not at all.
    #[default]
    None,
    /// 1/d².
    InverseSquare,
}

/// A light. Colours are linear RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Shines from a point in all directions.
    Point {
        /// Where.
        position: Vec3,
        /// Colour.
        color: Vec3,
        /// Factor of the colour.
        intensity: f32,
        /// How it weakens.
        falloff: Falloff,
    },
    /// Shines from infinitely far away.
    Directional {
        /// The way the light travels (any length).
        direction: Vec3,
        /// Colour.
        color: Vec3,
        /// Factor of the colour.
        intensity: f32,
    },
    /// A point light within a cone: smoothstep in the cosine between the outer and the inner half angle.
    Spot {
        /// Where.
        position: Vec3,
        /// The cone's axis, the way the light travels (any length).
        direction: Vec3,
        /// Half angle of the full light, degrees.
        inner_deg: f32,
        /// Half angle of the border, degrees.
        outer_deg: f32,
        /// Colour.
        color: Vec3,
        /// Factor of the colour.
        intensity: f32,
        /// How it weakens.
        falloff: Falloff,
    },
    /// Every triangle of the frame with Ke.
    Area {
        /// Points that each shading point looks at, 1 or more.
        samples: u32,
    },
}

impl Light {
    /// Adds it to a fingerprint.
    pub fn hash_into(&self, h: &mut PartHasher) {
        let (kind, falloff) = match self {
            Self::Point { falloff, .. } => (0, *falloff),
            Self::Directional { .. } => (1, Falloff::None),
            Self::Spot { falloff, .. } => (2, *falloff),
            Self::Area { .. } => (3, Falloff::None),
        };
        h.u64(kind | u64::from(falloff == Falloff::InverseSquare) << 8);
        match *self {
            Self::Point { position, color, intensity, .. } => {
                h.slice(&[position, color]);
                h.f32(intensity);
            }
            Self::Directional { direction, color, intensity } => {
                h.slice(&[direction, color]);
                h.f32(intensity);
            }
            Self::Spot { position, direction, inner_deg, outer_deg, color, intensity, .. } => {
                h.slice(&[position, direction, color]);
                h.slice(&[inner_deg, outer_deg, intensity]);
            }
            Self::Area { samples } => h.u64(u64::from(samples)),
        }
    }
}
