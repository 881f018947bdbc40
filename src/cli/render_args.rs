//! The options of `rentix render`, as typed.

use super::progress::ProgressKind;
use super::size::{self, whole};
use crate::job::options::limits;
use crate::plan::Update;
use crate::schedule::Policy;
use clap::Args;
use std::path::PathBuf;

/// `--schedule`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum ScheduleWord {
    /// Where they end first, counting what is resident
    Affinity,
    /// To whichever device asks
    Fifo,
}

impl From<ScheduleWord> for Policy {
    fn from(word: ScheduleWord) -> Self {
        match word {
            ScheduleWord::Affinity => Self::Affinity,
            ScheduleWord::Fifo => Self::Fifo,
        }
    }
}

/// `--update`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum UpdateWord {
    /// What is expected to take the least time
    Auto,
    /// Refit wherever the faces are the same
    Refit,
    /// Build anew
    Rebuild,
}

impl From<UpdateWord> for Update {
    fn from(word: UpdateWord) -> Self {
        match word {
            UpdateWord::Auto => Self::Auto,
            UpdateWord::Refit => Self::Refit,
            UpdateWord::Rebuild => Self::Rebuild,
        }
    }
}

/// What `render` takes. Options win over the job file.
#[derive(Args, Debug)]
#[allow(clippy::struct_excessive_bools, reason = "each is a switch that a user types")]
pub(super) struct RenderArgs {
    /// Folders of OBJ frames, patterns (walk_####.obj, walk_%04d.obj, 'walk/*.obj'), OBJ and glTF files, job files (.yaml)
    #[arg(value_name = "INPUT")]
    pub inputs: Vec<PathBuf>,

    /// Where pictures go [default: out/NAME]
    #[arg(short = 'o', value_name = "DIR", help_heading = "Output")]
    pub output: Option<PathBuf>,
    /// Width and height: 640x360, hd (1280x720) or fullhd (1920x1080) [default: hd]
    #[arg(long, value_parser = size::pixels, value_name = "SIZE", help_heading = "Output")]
    pub size: Option<[u32; 2]>,
    /// Picture format: png exr ppm pgm pbm jpg bmp tif jp2 ras tga webp qoi hdr … [default: png]
    #[arg(long, value_name = "EXT", help_heading = "Output")]
    pub format: Option<String>,
    /// Name of a picture: {stem}, {name}, {frame}, {frame:04} [default: {stem}; glTF: {stem}_{frame:04}; layers: {name}_{frame:04}]
    #[arg(long, value_name = "TEMPLATE", help_heading = "Output")]
    pub name: Option<String>,
    /// Leave the background out and keep coverage
    #[arg(long, help_heading = "Output")]
    pub alpha: bool,
    /// Bits a channel: 8 or 16 [default: 8]
    #[arg(long, value_parser = clap::value_parser!(u8).range(whole(&limits::BITS)), value_name = "N", help_heading = "Output")]
    pub bits: Option<u8>,
    /// Quality of jpg, 1 to 100 [default: 92]
    #[arg(long, value_parser = clap::value_parser!(u8).range(whole(&limits::QUALITY)), value_name = "N", help_heading = "Output")]
    pub quality: Option<u8>,
    /// Brighten by so many stops before the sRGB curve
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true, help_heading = "Output")]
    pub exposure: Option<f32>,
    /// Auxiliary pictures: depth,normal,position,albedo,id,material,uv,coverage
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Output")]
    pub aov: Option<Vec<String>>,
    /// Render finished frames anew and write over files that no run's record names
    #[arg(long, help_heading = "Output")]
    pub overwrite: bool,

    /// Make a film of the pictures, by ffmpeg (.mp4, .webm, .gif …)
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub movie: Option<PathBuf>,

    /// Job file (YAML); as INPUT or here
    #[arg(long, value_name = "FILE", help_heading = "What to render")]
    pub job: Option<PathBuf>,
    /// Frame numbers: 1-100, 1-100x2 or 1-100:2 (every second), 5,7,9-12
    #[arg(long, value_name = "SET", allow_hyphen_values = true, help_heading = "What to render")]
    pub frames: Option<String>,
    /// The I-th of N runs of consecutive frames
    #[arg(long, value_name = "I/N", help_heading = "What to render")]
    pub chunk: Option<String>,
    /// forward, reverse or shuffle [default: forward]
    #[arg(long, value_name = "ORDER", help_heading = "What to render")]
    pub order: Option<String>,
    /// All files in natural order of names are one sequence, numbered from 1
    #[arg(long, help_heading = "What to render")]
    pub one_sequence: bool,
    /// Frames a second of glTF animations and films [default: 24]
    #[arg(long, value_name = "N", help_heading = "What to render")]
    pub fps: Option<f64>,
    /// Clip of glTF animations, or all [default: all where no two animate the same, else the first]
    #[arg(long, value_name = "NAME", help_heading = "What to render")]
    pub clip: Option<String>,
    /// Gaps, missing materials and textures are errors
    #[arg(long, help_heading = "What to render")]
    pub strict: bool,
    /// Drop faces that cannot be rendered instead of failing their frame
    #[arg(long, help_heading = "What to render")]
    pub lenient: bool,

    /// Camera position
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, help_heading = "Scene")]
    pub eye: Option<String>,
    /// What the camera looks at
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, help_heading = "Scene")]
    pub look_at: Option<String>,
    /// What is up: y, z or X,Y,Z [default: y]
    #[arg(long, value_name = "UP", allow_hyphen_values = true, help_heading = "Scene")]
    pub up: Option<String>,
    /// Vertical field of view, degrees [default: 40]
    #[arg(long, value_name = "DEG", help_heading = "Scene")]
    pub fov: Option<f64>,
    /// A light: point:X,Y,Z[,INTENSITY]; may be repeated
    #[arg(long, value_name = "LIGHT", help_heading = "Scene")]
    pub light: Vec<String>,
    /// Ambient light, R,G,B or one number [default: 0.1]
    #[arg(long, value_name = "R,G,B", help_heading = "Scene")]
    pub ambient: Option<String>,
    /// Background, R,G,B or one number, or a picture by latitude and longitude [default: 0]
    #[arg(long, value_name = "R,G,B|FILE", help_heading = "Scene")]
    pub background: Option<String>,
    /// Smooth normals over edges below this angle where the file has none, degrees
    #[arg(long, value_name = "DEG", help_heading = "Scene")]
    pub smooth_angle: Option<f32>,
    /// How colours in an MTL are meant: linear or srgb [default: linear]
    #[arg(long, value_name = "SPACE", help_heading = "Scene")]
    pub mtl_color: Option<String>,

    /// Samples a pixel [default: 1]
    #[arg(long, value_parser = clap::value_parser!(u32).range(whole(&limits::SAMPLES)), value_name = "N", help_heading = "Quality")]
    pub samples: Option<u32>,
    /// Pixel filter: box, triangle or gaussian [default: box]
    #[arg(long, value_name = "FILTER", help_heading = "Quality")]
    pub filter: Option<String>,
    /// Bounces of mirrored and refracted rays [default: 10]
    #[arg(long, value_parser = clap::value_parser!(u32).range(whole(&limits::DEPTH)), value_name = "N", help_heading = "Quality")]
    pub depth: Option<u32>,
    /// Seed of the samples [default: 0]
    #[arg(long, value_name = "N", help_heading = "Quality")]
    pub seed: Option<u32>,
    /// Do not trace rays below this weight; 0 traces all [default: 1/4096]
    #[arg(long, value_name = "WEIGHT", help_heading = "Quality")]
    pub prune: Option<f32>,

    /// What renders: cpu, gpu:0 and so on (`rentix devices` lists them), several with commas, cpu/2 (the CPU as two), all
    /// [default: the best hardware GPU, else cpu]
    #[arg(long, value_name = "NAME[,NAME]", help_heading = "Machine")]
    pub device: Option<String>,
    /// How several devices share frames: affinity (where they end first, counting what is resident) or fifo
    #[arg(
        long,
        value_name = "HOW",
        default_value = "affinity",
        hide_default_value = true,
        help_heading = "Machine"
    )]
    pub schedule: ScheduleWord,
    /// Threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), help_heading = "Machine")]
    pub threads: Option<u16>,
    /// What frames on their way may take of the host's memory, as 512M or 4G [default: half of the free memory]
    #[arg(long, value_name = "SIZE", value_parser = size::bytes, help_heading = "Machine")]
    pub memory: Option<u64>,
    /// What the device may hold of scenes, as 512M or 4G; pictures on their way and rays that wait (a quarter of
    /// it, 512M at most) come on top [default: half of the free memory; four fifths of a GPU's]
    #[arg(long, value_name = "SIZE", value_parser = size::bytes, help_heading = "Machine")]
    pub device_memory: Option<u64>,
    /// Trees over meshes that changed: auto, refit or rebuild [default: auto]
    #[arg(
        long,
        value_name = "HOW",
        default_value = "auto",
        hide_default_value = true,
        help_heading = "Machine"
    )]
    pub update: UpdateWord,
    /// Forget everything between frames, for comparison
    #[arg(long, help_heading = "Machine")]
    pub cold: bool,
    /// Where the store on disk is
    #[arg(long, value_name = "DIR", help_heading = "Machine")]
    pub cache: Option<PathBuf>,
    /// Do without the store
    #[arg(long, help_heading = "Machine")]
    pub no_cache: bool,

    /// Write a report of the run (JSON)
    #[arg(long, value_name = "FILE", help_heading = "Telling")]
    pub report: Option<PathBuf>,
    /// Progress on stderr
    #[arg(long, value_name = "KIND", default_value = "auto", help_heading = "Telling")]
    pub progress: ProgressKind,
    /// Tell what would be rendered and stop
    #[arg(long, help_heading = "Telling")]
    pub dry_run: bool,
}
