//! What is to be rendered: INPUT, frame numbers, job file, layers, cameras and transforms over time.

mod animation;
pub mod auto;
mod discover;
mod dropped;
mod extent;
mod file;
mod names;
pub mod numbers;
pub mod options;
mod pattern;
mod resolve;
pub mod settings;
mod template;
pub mod track;
pub mod words;

pub use animation::Moment;
pub use discover::FrameFile;
pub use dropped::priority;
pub use file::Outside;
pub use numbers::{Chunk, FrameSet, Order};
pub use options::{Background, CameraChoice, LightChoice, Options};
pub use resolve::resolve;
pub use settings::Settings;

use crate::format::{ClipChoice, FormatError};
use crate::math::DAffine3;
use crate::warning::Warnings;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use track::Placed;

/// No sequence that is made here has more pictures.
const MAX_FRAMES: u64 = 1_000_000;

/// What was asked for.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// INPUTs, job files among them.
    pub inputs: Vec<PathBuf>,
    /// A job file given by `--job`.
    pub job_file: Option<PathBuf>,
    /// Options of the command line; they win.
    pub options: Options,
    /// `--frames`.
    pub frames: Option<FrameSet>,
    /// `--chunk`.
    pub chunk: Option<Chunk>,
    /// `--order`.
    pub order: Order,
    /// `--one-sequence`.
    pub one_sequence: bool,
    /// `--strict`.
    pub strict: bool,
    /// `--fps`: frames a second of glTF files.
    pub fps: Option<f64>,
    /// `--clip`.
    pub clip: Option<ClipChoice>,
    /// `-o`.
    pub folder: Option<PathBuf>,
    /// The job was put into this folder (as the system names it, without links) by someone who is not trusted: its job
    /// file says nothing of where pictures go, nothing of it leads out of the folder, and what it says wins over the
    /// options.
    pub dropped: Option<PathBuf>,
    /// The sequence is still growing: frames that were asked for may be missing yet.
    pub grows: bool,
}

/// What is to be rendered.
#[derive(Clone, Debug)]
pub struct Job {
    /// Its name.
    pub name: String,
    /// Where pictures go.
    pub folder: PathBuf,
    /// The sequences that there are.
    pub sequences: Vec<Sequence>,
    /// The pictures that were chosen, in the order in which they are to be taken.
    pub pictures: Vec<Picture>,
    /// Files that are read, as far as they are known before a frame is: job files, OBJs, layers' MTLs.
    pub inputs: Vec<PathBuf>,
    /// Jobs of higher priority come first with the daemon; None: nothing is said.
    pub priority: Option<i64>,
    /// Frames a second, of glTF files and of a film.
    pub fps: f64,
    /// What is wrong but stops nothing.
    pub warnings: Warnings,
}

/// One sequence of pictures.
#[derive(Clone, Debug)]
pub struct Sequence {
    /// Its name.
    pub name: String,
    /// Its layers, at least one.
    pub layers: Vec<Layer>,
    /// Its first picture, chosen or not: where the auto light stands follows from it.
    pub first: Picture,
}

/// One layer: an INPUT's files and where they stand.
#[derive(Clone, Debug)]
pub struct Layer {
    /// Its name.
    pub name: String,
    /// Its files, ordered by number, at least one.
    pub files: Vec<FrameFile>,
    /// An MTL whose materials replace those of the same name.
    pub materials: Option<PathBuf>,
    /// Its transform over time.
    pub placed: Option<Placed>,
}

/// One picture.
#[derive(Clone, Debug)]
pub struct Picture {
    /// The sequence, by its place in the job.
    pub sequence: usize,
    /// The frame's number, if it has one.
    pub frame: Option<i64>,
    /// What stands in it, layer by layer.
    pub sources: Vec<Source>,
    /// The picture's file, relative to the output folder.
    pub picture: PathBuf,
    /// Its settings.
    pub settings: Arc<Settings>,
}

/// What one layer shows in one picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Source {
    /// The layer, by its place in the sequence.
    pub layer: usize,
    /// The file, by its place in the layer; None: it is hidden.
    pub file: Option<usize>,
    /// World from object, where the job gives a transform.
    pub transform: Option<DAffine3>,
}

impl Picture {
    /// The file that names the picture: that of the first layer that moves, else of the first.
    pub fn main_file<'a>(&self, sequence: &'a Sequence) -> Option<&'a FrameFile> {
        main_file(&sequence.layers, &self.sources)
    }
}

fn main_file<'a>(layers: &'a [Layer], sources: &[Source]) -> Option<&'a FrameFile> {
    let moves = |s: &&Source| layers[s.layer].files.len() > 1;
    let source = sources.iter().find(moves).or(sources.first())?;
    source.file.map(|i| &layers[source.layer].files[i])
}

/// Why nothing can be tried (exit status 2).
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// Nothing was named.
    #[error("no INPUT; name a folder of OBJ frames, an OBJ or glTF file or a job file")]
    NoInput,
    /// There is no such file, folder or pattern.
    #[error("{}: there is no such file or folder; check the name", .0.display())]
    Absent(PathBuf),
    /// A folder without frames.
    #[error("{}: no .obj, .gltf or .glb file in this folder; name a folder that holds the frames", .0.display())]
    NoFrames(PathBuf),
    /// A pattern without matches.
    #[error("{}: no .obj, .gltf or .glb file matches this pattern", .0.display())]
    NoMatch(PathBuf),
    /// Some other file.
    #[error("{}: is neither a folder nor an .obj, .gltf, .glb, .yaml or .yml file", .0.display())]
    NotAnInput(PathBuf),
    /// A job file where a sequence should be.
    #[error("{}: is a job file; a job's sequence is a folder, a pattern, or an .obj, .gltf or .glb file", .0.display())]
    JobInJob(PathBuf),
    /// A glTF file that cannot be read, or has no such clip.
    #[error(transparent)]
    BadGltf(FormatError),
    /// The system refuses.
    #[error("{}: cannot be read: {cause}; check that it exists and that its permissions allow reading", path.display())]
    Unreadable {
        /// File or folder.
        path: PathBuf,
        /// What the system said.
        cause: io::Error,
    },
    /// A pipe or a device stands where a file should.
    #[error("{}: is not a plain file; name a job file", .0.display())]
    NotAFile(PathBuf),
    /// Two files for one frame.
    #[error("frame {number} is given twice: {} and {}; {remedy}", first.display(), second.display())]
    TwoOfANumber {
        /// The frame.
        number: i64,
        /// One file.
        first: PathBuf,
        /// The other.
        second: PathBuf,
        /// What to do.
        remedy: &'static str,
    },
    /// `--strict` and frames are missing.
    #[error("{}: {text} (--strict)", input.display())]
    Gaps {
        /// The INPUT.
        input: PathBuf,
        /// Which are missing.
        text: String,
    },
    /// A number that was asked for and that no sequence has.
    #[error("frame {0} was asked for and no sequence has it; `rentix inspect` shows the frames")]
    NoSuchFrame(i64),
    /// Two frames of a sequence would write one picture.
    #[error("{first} and {second} would both be written to {}; {remedy}", picture.display())]
    TwoOfAName {
        /// One frame.
        first: String,
        /// The other.
        second: String,
        /// The picture.
        picture: PathBuf,
        /// What to do.
        remedy: &'static str,
    },
    /// The job file is wrong.
    #[error("{}{place}: {text}", path.display())]
    File {
        /// The job file.
        path: PathBuf,
        /// `:LINE:COLUMN` where it is known.
        place: String,
        /// What is wrong.
        text: String,
    },
    /// A dropped job asks for what only its owner may say.
    #[error("{}: {text}; what is put into a watched folder stays within its own folder", path.display())]
    Dropped {
        /// The job file, or the file that lies elsewhere.
        path: PathBuf,
        /// What it asks for.
        text: String,
    },
    /// A combination of options is wrong.
    #[error("{0}")]
    Options(String),
}

#[cfg(test)]
mod tests;
