//! What one ray does: camera rays, sampling, surfaces, lights, shading. Pure: no threads, no files, no clock.
//!
//! Plain functions over records of four-float rows, one file for each part of the shading; the same operations in
//! the same order whatever the tile or the thread, so that a pixel is a function of frame and shot alone.

pub mod aim;
pub mod band;
pub mod branch;
pub mod camera;
pub mod center;
pub mod direct;
pub mod emitter;
pub mod environment;
pub mod light;
pub mod maps;
pub mod material;
pub mod media;
pub mod optics;
pub mod path;
pub mod power;
pub mod sampler;
pub mod scene;
pub mod shade;
pub mod texture;
pub mod tile;
pub mod world;

#[cfg(test)]
mod tests;

pub use band::{FilmBand, bands};
pub use scene::Scene;
pub use tile::{TileBuffers, trace_tile};

/// Surfaces that a ray crosses at most, straight on; beyond them it sees nothing.
pub const SURFACES_MAX: u32 = 256;

/// Rays traced for one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// Through pixels.
    pub camera: u64,
    /// To lights.
    pub shadow: u64,
    /// Mirrored.
    pub mirrored: u64,
    /// Refracted.
    pub refracted: u64,
    /// Of the refracted ones those that entered more media than are kept.
    pub media_ignored: u64,
}

impl std::ops::AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.camera += other.camera;
        self.shadow += other.shadow;
        self.mirrored += other.mirrored;
        self.refracted += other.refracted;
        self.media_ignored += other.media_ignored;
    }
}
