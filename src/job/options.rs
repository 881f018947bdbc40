//! Options that the job file and the command line share, each there or not; what is there wins over what was before.

use super::track::CameraTrack;
use crate::format::MaterialOverride;
use crate::math::{DVec3, Vec3};
use crate::scene::{AovSet, Filter, Light};
use std::path::PathBuf;

/// Where the camera comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum CameraChoice {
    /// From what is in the sequence.
    Auto,
    /// As given, over time.
    Given(CameraTrack),
    /// The one of that name in the glTF files of the frame.
    Gltf {
        /// Its name or its node's.
        name: String,
        /// A field of view instead of its own, degrees.
        fov_deg: Option<f64>,
    },
}

/// Where the lights come from.
#[derive(Clone, Debug, PartialEq)]
pub enum LightChoice {
    /// One that the contract places.
    Auto,
    /// As given.
    Given(Vec<Light>),
}

/// What is seen where nothing is hit.
#[derive(Clone, Debug, PartialEq)]
pub enum Background {
    /// The same everywhere, linear RGB.
    Color(Vec3),
    /// A picture by latitude and longitude.
    File(PathBuf),
}

macro_rules! options {
    ($($(#[$doc:meta])* $name:ident: $kind:ty,)*) => {
        /// A part of the settings.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Options {
            $($(#[$doc])* pub $name: Option<$kind>,)*
            /// Statements for materials by name; later ones win.
            pub materials: Vec<MaterialOverride>,
        }

        impl Options {
            /// Lays other options over these.
            pub fn lay_over(&mut self, over: &Self) {
                $(if over.$name.is_some() { self.$name.clone_from(&over.$name); })*
                self.materials.extend_from_slice(&over.materials);
                if over.camera.is_none()
                    && let Some(CameraChoice::Given(track)) = &mut self.camera
                {
                    // what is given apart wins over what the camera had of its own
                    for pose in track.keys.iter_mut().map(|k| &mut k.value) {
                        pose.up = pose.up.filter(|_| over.up.is_none());
                        pose.fov_deg = pose.fov_deg.filter(|_| over.fov.is_none());
                    }
                }
            }
        }
    };
}

options! {
    /// Width and height, pixels.
    size: [u32; 2],
    /// Picture format, one of [`super::settings::FORMATS`].
    format: String,
    /// Template of a picture's name.
    name: String,
    /// Whether the background is left out.
    alpha: bool,
    /// Bits a channel, 8 or 16.
    bits: u8,
    /// Quality of jpg, 1 to 100.
    quality: u8,
    /// The camera.
    camera: CameraChoice,
    /// The camera's position, apart from the rest.
    eye: DVec3,
    /// What it looks at, apart from the rest.
    look_at: DVec3,
    /// What is up.
    up: DVec3,
    /// Vertical field of view, degrees.
    fov: f64,
    /// The lights.
    lights: LightChoice,
    /// Ambient light.
    ambient: Vec3,
    /// Background.
    background: Background,
    /// Samples a pixel.
    samples: u32,
    /// Pixel filter.
    filter: Filter,
    /// Bounces.
    depth: u32,
    /// Seed of the samples.
    seed: u32,
    /// Stops of exposure.
    exposure: f32,
    /// Angle for derived normals, degrees.
    smooth_angle: f32,
    /// Auxiliary pictures.
    aov: AovSet,
    /// Whether colours in an MTL are sRGB.
    mtl_srgb: bool,
    /// Least weight of a ray.
    prune: f32,
}

/// Ranges of numbers, for job file and command line alike.
pub mod limits {
    use std::ops::RangeInclusive;

    /// Vertical field of view, degrees.
    pub const FOV: RangeInclusive<f64> = 0.01..=179.0;
    /// A side of a picture, pixels.
    pub const SIDE: RangeInclusive<f64> = 1.0..=65_535.0;
    /// Samples a pixel.
    pub const SAMPLES: RangeInclusive<f64> = 1.0..=65_536.0;
    /// Bounces.
    pub const DEPTH: RangeInclusive<f64> = 0.0..=1_000.0;
    /// Quality of jpg.
    pub const QUALITY: RangeInclusive<f64> = 1.0..=100.0;
    /// Stops of exposure.
    pub const EXPOSURE: RangeInclusive<f64> = -64.0..=64.0;
    /// Least weight of a ray.
    pub const PRUNE: RangeInclusive<f64> = 0.0..=1.0;
    /// Angles between normals, degrees.
    pub const ANGLE: RangeInclusive<f64> = 0.0..=180.0;
    /// Any number that f32 holds.
    pub const NUMBER: RangeInclusive<f64> = -3.4e38..=3.4e38;
    /// Light and colour.
    pub const COLOR: RangeInclusive<f64> = 0.0..=3.4e38;
    /// Whole numbers of 32 bits.
    pub const U32: RangeInclusive<f64> = 0.0..=4_294_967_295.0;
    /// Half angles of a spot light's cone, degrees.
    pub const HALF_ANGLE: RangeInclusive<f64> = 0.0..=90.0;
    /// Frames a second.
    pub const FPS: RangeInclusive<f64> = 0.001..=1_000.0;
    /// Bits a channel.
    pub const BITS: RangeInclusive<f64> = 8.0..=16.0;

    /// Whether a number is within a range; else what to say.
    pub fn within(x: f64, range: &RangeInclusive<f64>) -> Result<f64, String> {
        if range.contains(&x) { Ok(x) } else { Err(format!("{x} is out of range: allowed {}", told(range))) }
    }

    /// A range in words.
    pub(in crate::job) fn told(range: &RangeInclusive<f64>) -> String {
        let short = |x: f64| if x.abs() < 1e12 { x.to_string() } else { format!("{x:e}") };
        format!("from {} to {}", short(*range.start()), short(*range.end()))
    }
}
