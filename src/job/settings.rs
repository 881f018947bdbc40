//! The settings of one picture: every option with its default filled in.

use super::extent;
use super::options::{Background, CameraChoice, LightChoice, Options, limits};
use super::track::{CameraPose, CameraTrack, Interpolation, Key};
use super::words::{listed, nearest, one_of};
use crate::format::ReadOptions;
use crate::math::{DVec3, Vec3};
use crate::scene::{self, Aov, AovSet, Camera, Falloff, Filter, Light, Shot};

/// Picture formats of this version, by their words.
pub const FORMATS: [&str; 19] = [
    "png", "exr", "ppm", "pgm", "pbm", "jpg", "jpeg", "jpe", "bmp", "dib", "tif", "tiff", "jp2", "sr", "ras",
    "tga", "webp", "qoi", "hdr",
];

/// Those that have alpha.
pub const ALPHA: [&str; 7] = ["png", "exr", "tif", "tiff", "tga", "webp", "qoi"];
/// Those that hold integers of 16 bits a channel.
pub const SIXTEEN_BITS: [&str; 6] = ["png", "tif", "tiff", "ppm", "pgm", "jp2"];
/// Those that hold floats, whatever the bits.
pub const FLOATS: [&str; 2] = ["exr", "hdr"];

/// Pixel filters by their words.
pub const FILTERS: [(&str, Filter); 3] =
    [("box", Filter::Box), ("triangle", Filter::Triangle), ("gaussian", Filter::Gaussian)];

/// Whether colours in an MTL are sRGB, by the words.
pub const MTL_COLORS: [(&str, bool); 2] = [("linear", false), ("srgb", true)];

/// How a light weakens, by the words.
pub(super) const FALLOFFS: [(&str, Falloff); 2] =
    [("none", Falloff::None), ("inverse-square", Falloff::InverseSquare)];

/// How keys are joined, by the words.
pub(super) const INTERPOLATIONS: [(&str, Interpolation); 2] =
    [("linear", Interpolation::Linear), ("smooth", Interpolation::Smooth)];

/// Everything that bears on one picture but its geometry.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Where the camera comes from.
    pub camera: CameraChoice,
    /// Where the lights come from.
    pub lights: LightChoice,
    /// What is up.
    pub up: DVec3,
    /// Vertical field of view, degrees.
    pub fov_deg: f64,
    /// Ambient light.
    pub ambient: Vec3,
    /// What is seen where nothing is hit.
    pub background: Background,
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Samples a pixel.
    pub samples: u32,
    /// Pixel filter.
    pub filter: Filter,
    /// Bounces.
    pub depth: u32,
    /// Seed of the samples.
    pub seed: u32,
    /// Least weight of a ray.
    pub prune: f32,
    /// Whether the background is left out.
    pub alpha: bool,
    /// Auxiliary pictures.
    pub aovs: AovSet,
    /// Picture format, one of [`FORMATS`].
    pub format: String,
    /// Bits a channel.
    pub bits: u8,
    /// Quality of jpg.
    pub quality: u8,
    /// Stops of exposure.
    pub exposure_stops: f32,
    /// Template of the picture's name, where one is given.
    pub name: Option<String>,
    /// How files are read.
    pub read: ReadOptions,
}

impl Settings {
    /// Fills in what the options leave open.
    pub fn new(options: &Options) -> Result<Self, String> {
        let o = options.clone();
        check_bits(&o)?;
        let format = o.format.clone().unwrap_or_else(|| FORMATS[0].to_string());
        let size = o.size.unwrap_or([1280, 720]);
        extent::check(&format, size, o.bits.unwrap_or(8), o.alpha.unwrap_or(false))?;
        let read = ReadOptions {
            smooth_angle_deg: o.smooth_angle,
            mtl_srgb: o.mtl_srgb.unwrap_or(false),
            material_overrides: o.materials.clone(),
            ..ReadOptions::default()
        };
        Ok(Self {
            camera: camera(&o)?,
            lights: o.lights.unwrap_or(LightChoice::Auto),
            up: o.up.unwrap_or(DVec3::Y),
            fov_deg: o.fov.unwrap_or(40.0),
            ambient: o.ambient.unwrap_or(Vec3::splat(0.1)),
            background: o.background.unwrap_or(Background::Color(Vec3::ZERO)),
            size,
            samples: o.samples.unwrap_or(1),
            filter: o.filter.unwrap_or_default(),
            depth: o.depth.unwrap_or(10),
            seed: o.seed.unwrap_or(0),
            prune: o.prune.unwrap_or(1.0 / 4096.0),
            alpha: o.alpha.unwrap_or(false),
            aovs: o.aov.unwrap_or_default(),
            format,
            bits: o.bits.unwrap_or(8),
            quality: o.quality.unwrap_or(92),
            exposure_stops: o.exposure.unwrap_or(0.0),
            name: o.name,
            read,
        })
    }

    /// What is asked for but not in pictures of this format, where there is such.
    pub fn left_out(&self) -> Option<String> {
        (self.alpha && !ALPHA.contains(&&*self.format)).then(|| {
            let have = ALPHA.join(", ");
            format!(
                "{} has no alpha: what covers a pixel in part stands on black ({have} have it)",
                self.format
            )
        })
    }

    /// The shot of a frame with the camera, lights and background that were found for it.
    pub fn shot(&self, camera: Camera, lights: Vec<Light>, background: scene::Background) -> Shot {
        Shot {
            camera,
            lights,
            ambient: self.ambient,
            background,
            size: self.size,
            samples: self.samples,
            filter: self.filter,
            depth: self.depth,
            seed: self.seed,
            prune: self.prune,
            alpha: self.alpha,
            aovs: self.aovs,
        }
    }

    /// The camera at a frame, where it is given; None: auto, or one of a glTF. A number that a frame does not have counts as 0.
    pub fn camera_at(&self, frame: Option<i64>) -> Option<Camera> {
        match &self.camera {
            CameraChoice::Auto | CameraChoice::Gltf { .. } => None,
            CameraChoice::Given(track) => track.at(frame.unwrap_or(0), self.up, self.fov_deg),
        }
    }

    /// Width over height.
    pub fn aspect(&self) -> f64 {
        f64::from(self.size[0]) / f64::from(self.size[1])
    }
}

/// Whether the format has the bits a channel that are asked for.
pub(super) fn check_bits(o: &Options) -> Result<(), String> {
    let format = o.format.as_deref().unwrap_or(FORMATS[0]);
    if o.bits == Some(16) && !SIXTEEN_BITS.contains(&format) && !FLOATS.contains(&format) {
        return Err(format!("{format} has 8 bits a channel; 16 have {}", SIXTEEN_BITS.join(", ")));
    }
    Ok(())
}

/// The camera with what was given apart from it (`--eye`, `--look-at`, `--up`, `--fov`) laid over.
fn camera(o: &Options) -> Result<CameraChoice, String> {
    let mut choice = o.camera.clone().unwrap_or(CameraChoice::Auto);
    match &mut choice {
        CameraChoice::Gltf { fov_deg, .. } if o.eye.or(o.look_at).is_none() => {
            *fov_deg = o.fov.or(*fov_deg);
        }
        CameraChoice::Auto | CameraChoice::Gltf { .. } => match (o.eye, o.look_at) {
            (None, None) => return Ok(CameraChoice::Auto),
            (Some(eye), Some(look_at)) => {
                let value = CameraPose { eye, look_at, up: None, fov_deg: None };
                let keys = vec![Key { frame: 0, value }];
                choice = CameraChoice::Given(CameraTrack { keys, interpolation: Interpolation::Linear });
            }
            (Some(_), None) => return Err("--eye needs --look-at beside it".to_string()),
            (None, Some(_)) => return Err("--look-at needs --eye beside it".to_string()),
        },
        CameraChoice::Given(track) => {
            for key in &mut track.keys {
                key.value.eye = o.eye.unwrap_or(key.value.eye);
                key.value.look_at = o.look_at.unwrap_or(key.value.look_at);
            }
        }
    }
    if let CameraChoice::Given(track) = &choice
        && track.keys.iter().any(|k| k.value.eye == k.value.look_at)
    {
        return Err("eye and look-at are the same point".to_string());
    }
    Ok(choice)
}

/// The word of a picture format, if there is such a one.
pub fn format_word(word: &str) -> Result<String, String> {
    let lower = word.to_ascii_lowercase();
    if FORMATS.contains(&lower.as_str()) {
        Ok(lower)
    } else {
        let hint = nearest(&lower, FORMATS.into_iter());
        Err(format!("there is no picture format `{word}`{hint}; allowed: {}", FORMATS.join(", ")))
    }
}

/// Bits a channel.
pub fn bits(x: f64) -> Result<u8, String> {
    if x == 8.0 || x == 16.0 { Ok(x as u8) } else { Err(format!("bits are 8 or 16, not {x}")) }
}

/// Auxiliary pictures by their words.
pub fn aovs<'a>(words: impl Iterator<Item = &'a str>) -> Result<AovSet, String> {
    let mut set = AovSet::default();
    for word in words {
        let all = || Aov::ALL.into_iter().map(Aov::word);
        let aov = Aov::ALL.into_iter().find(|a| a.word() == word);
        set.insert(aov.ok_or_else(|| {
            let hint = nearest(word, all());
            format!("there is no auxiliary picture `{word}`{hint}; allowed: {}", listed(all()))
        })?);
    }
    Ok(set)
}

/// Up as `y` or `z`.
pub(super) fn up_word(word: &str) -> Result<DVec3, String> {
    one_of(&[("y", DVec3::Y), ("z", DVec3::Z)], word)
}

/// Up as `y`, `z` or `x,y,z`.
pub fn up(text: &str) -> Result<DVec3, String> {
    match text.contains(',').then(|| vector(text)).transpose()? {
        None => up_word(text).map_err(|e| format!("{e}, or three numbers, as 0,0,1")),
        Some(DVec3::ZERO) => Err("up has no direction".to_string()),
        Some(v) => Ok(v),
    }
}

/// Three numbers between commas.
pub fn vector(text: &str) -> Result<DVec3, String> {
    let numbers: Vec<f64> =
        text.split(',').map(|s| s.trim().parse()).collect::<Result<_, _>>().unwrap_or_default();
    match numbers.as_slice() {
        &[x, y, z] if [x, y, z].iter().all(|x| limits::within(*x, &limits::NUMBER).is_ok()) => {
            Ok(DVec3::new(x, y, z))
        }
        _ => Err(format!("`{text}` is not three numbers, as 0,1,5")),
    }
}

/// A colour: three numbers, or one for all channels, not negative.
pub fn color(text: &str) -> Result<Vec3, String> {
    let v = if text.contains(',') {
        vector(text)?
    } else {
        DVec3::splat(text.trim().parse().map_err(|_| format!("`{text}` is not a colour, as 0.1,0.2,0.3"))?)
    };
    for x in v.to_array() {
        limits::within(x, &limits::COLOR)?;
    }
    Ok(v.as_vec3())
}

/// A background as typed: a colour, or else a picture's file.
pub fn background(text: &str) -> Result<Background, String> {
    let is_number = |word: &str| word.trim().parse::<f64>().is_ok();
    if text.split(',').any(is_number) {
        color(text).map(Background::Color)
    } else if text.is_empty() {
        Err("a background is a colour, as 0.1,0.2,0.3, or a picture's file".to_string())
    } else {
        Ok(Background::File(text.into()))
    }
}

/// A light as typed: `point:x,y,z[,intensity]`.
pub fn light(text: &str) -> Result<Light, String> {
    let wrong =
        || format!("`{text}` is not a light, as point:0,5,2 or point:0,5,2,0.8 (other lights: job file)");
    let numbers = text.strip_prefix("point:").ok_or_else(wrong)?;
    let (position, intensity) = match numbers.match_indices(',').nth(2) {
        Some((i, _)) => (&numbers[..i], numbers[i + 1..].trim().parse::<f64>().map_err(|_| wrong())?),
        None => (numbers, 1.0),
    };
    limits::within(intensity, &limits::COLOR)?;
    Ok(Light::Point {
        position: vector(position).map_err(|_| wrong())?.as_vec3(),
        color: Vec3::ONE,
        intensity: intensity as f32,
        falloff: crate::scene::Falloff::None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_those_of_the_contract() {
        let s = Settings::new(&Options::default()).unwrap();
        assert_eq!((s.size, s.samples, s.depth, s.fov_deg), ([1280, 720], 1, 10, 40.0));
        assert_eq!((s.ambient, s.background), (Vec3::splat(0.1), Background::Color(Vec3::ZERO)));
        assert_eq!(
            (s.prune, s.format.as_str(), s.camera, s.lights),
            (1.0 / 4096.0, "png", CameraChoice::Auto, LightChoice::Auto)
        );
    }

    #[test]
    fn a_camera_from_the_command_line_is_laid_over_that_of_the_job() {
        let pose = CameraPose { eye: DVec3::X, look_at: DVec3::ZERO, up: None, fov_deg: Some(30.0) };
        let track =
            CameraTrack { keys: vec![Key { frame: 0, value: pose }], interpolation: Interpolation::Linear };
        let o =
            Options { camera: Some(CameraChoice::Given(track)), eye: Some(DVec3::Y), ..Options::default() };
        let camera = Settings::new(&o).unwrap().camera_at(Some(3)).unwrap();
        assert_eq!((camera.eye, camera.look_at, camera.fov_deg), (DVec3::Y, DVec3::ZERO, 30.0));
        let alone = Options { eye: Some(DVec3::Y), ..Options::default() };
        assert!(Settings::new(&alone).unwrap_err().contains("--look-at"));
    }

    #[test]
    fn words_and_numbers_as_typed() {
        assert_eq!(vector("1,-2,3e1"), Ok(DVec3::new(1.0, -2.0, 30.0)));
        assert!(vector("1,2").is_err() && vector("1,2,nan").is_err() && vector("a,b,c").is_err());
        assert_eq!(color("0.5"), Ok(Vec3::splat(0.5)));
        assert!(color("-1,0,0").is_err());
        assert_eq!(background("0.5"), Ok(Background::Color(Vec3::splat(0.5))));
        assert_eq!(background("sky.hdr"), Ok(Background::File("sky.hdr".into())));
        assert!(background("1,2").is_err() && background("-1").is_err() && background("").is_err());
        assert!(matches!(light("point:0,5,2,0.5"), Ok(Light::Point { intensity: 0.5, .. })));
        assert!(light("spot:1,2,3").is_err() && light("point:1,2").is_err());
        assert!(up("0,0,0").is_err() && up("z") == Ok(DVec3::Z));
        assert!(format_word("PNG") == Ok("png".to_string()) && format_word("gif").is_err());
        let sixteen = |format: &str| {
            Settings::new(&Options { format: Some(format.to_string()), bits: Some(16), ..Options::default() })
                .is_ok()
        };
        let clear = |format: &str| {
            let o = Options { format: Some(format.to_string()), alpha: Some(true), ..Options::default() };
            Settings::new(&o).unwrap().left_out()
        };
        assert!(clear("webp").is_none() && Settings::new(&Options::default()).unwrap().left_out().is_none());
        assert!(clear("jpg").unwrap().starts_with("jpg has no alpha"));
        let wide =
            Options { format: Some("webp".to_string()), size: Some([20_000, 16]), ..Options::default() };
        assert!(Settings::new(&wide).unwrap_err().contains("16384 pixels a side"));
        assert!(sixteen("jp2") && sixteen("exr") && !sixteen("bmp"));
    }
}
