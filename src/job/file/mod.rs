//! The job file: YAML, strict. Each error has line, column, what is allowed, and the nearest known name.

mod fields;
mod node;
mod scene;

use super::JobError;
use super::numbers::FrameSet;
use super::options::{Background, Options, limits};
use super::pattern::Pattern;
use super::settings::{self, FILTERS, MTL_COLORS};
use super::template;
use super::track::Placed;
use super::words::one_of;
use crate::format::{self, ClipChoice};
use crate::scene::AovSet;
use fields::{Fields, Read, color, frames, integer, list, number, parsed, text, truth, unexpected, whole};
use node::{Node, Value, Wrong, place_of};
use std::io::Read as _;
use std::path::{Path, PathBuf};

/// What a job file says.
#[derive(Debug, Default)]
pub(super) struct JobFile {
    /// The file itself; empty where there is none.
    path: PathBuf,
    pub(super) name: Option<String>,
    pub(super) sequence: Option<PathBuf>,
    pub(super) layers: Vec<LayerFile>,
    pub(super) frames: Option<FrameSet>,
    /// Where those stand, as it follows the file's name.
    pub(super) frames_at: String,
    pub(super) folder: Option<PathBuf>,
    pub(super) priority: Option<i64>,
    pub(super) fps: Option<f64>,
    pub(super) clip: ClipChoice,
    pub(super) options: Options,
    /// Where `bits` stand.
    pub(super) bits_at: Option<String>,
    pub(super) overrides: Vec<Override>,
}

impl JobFile {
    /// The file itself.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Something wrong at a place in the file that shows only beside what is on the disk or in other keys.
    pub(super) fn wrong(&self, place: &str, text: String) -> JobError {
        JobError::File { path: self.path.clone(), place: place.to_string(), text }
    }
}

/// One layer as the job file gives it.
#[derive(Debug)]
pub(super) struct LayerFile {
    pub(super) sequence: PathBuf,
    pub(super) name: Option<String>,
    pub(super) placed: Option<Placed>,
    pub(super) start: Option<i64>,
    pub(super) step: i64,
    pub(super) outside: Outside,
    pub(super) materials: Option<PathBuf>,
}

/// What a layer shows beyond its frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Outside {
    /// Its first or last frame.
    #[default]
    Hold,
    /// Its frames again.
    Loop,
    /// Nothing.
    Hide,
}

const OUTSIDES: [(&str, Outside); 3] =
    [("hold", Outside::Hold), ("loop", Outside::Loop), ("hide", Outside::Hide)];

/// Settings for some of the frames.
#[derive(Debug)]
pub(super) struct Override {
    pub(super) frames: Option<FrameSet>,
    /// Where it stands.
    pub(super) line: u32,
    /// On the stem.
    pub(super) files: Option<Pattern>,
    pub(super) options: Options,
    /// Where its `bits` stand.
    pub(super) bits_at: Option<String>,
}

/// No job file is larger.
const MAX_BYTES: u64 = 1 << 20;

/// Reads a job file; paths in it are relative to its folder.
pub(super) fn read(path: &Path) -> Result<JobFile, JobError> {
    let unreadable = |cause| JobError::Unreadable { path: path.to_path_buf(), cause };
    let wrong = |place: String, text: String| JobError::File { path: path.to_path_buf(), place, text };
    let mut bytes = Vec::new();
    let opened = format::open_plain(path).map_err(unreadable)?;
    let (file, _) = opened.ok_or_else(|| JobError::NotAFile(path.to_path_buf()))?;
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(wrong(String::new(), format!("is longer than the {MAX_BYTES} bytes of any job file")));
    }
    // what the file says may be for a terminal to obey
    let plain = |text: String| text.replace(char::is_control, "\u{fffd}");
    let read = decoded(bytes).and_then(|yaml| parse(&yaml, path));
    read.map_err(|e| wrong(format!(":{}:{}", e.line, e.column), plain(e.to_string())))
}

/// The text of a file, which is UTF-8.
fn decoded(bytes: Vec<u8>) -> Read<String> {
    let wrong = |line, column, text: &str| Err(Wrong { line, column, key: None, text: text.to_string() });
    if bytes.starts_with(b"\xFF\xFE") || bytes.starts_with(b"\xFE\xFF") {
        return wrong(1, 1, "is UTF-16 text; save it as UTF-8");
    }
    String::from_utf8(bytes).or_else(|e| {
        let text = String::from_utf8_lossy(&e.as_bytes()[..e.utf8_error().valid_up_to()]);
        let line = text.split('\n').count();
        let column = 1 + text.rsplit('\n').next().map_or(0, |last| last.chars().count());
        wrong(line as u64, column as u64, "is not UTF-8 text; save it as UTF-8")
    })
}

/// Keys that the job and its overrides share.
const SCENE_KEYS: [&str; 15] = [
    "camera",
    "lights",
    "ambient",
    "background",
    "samples",
    "filter",
    "depth",
    "seed",
    "up",
    "exposure",
    "smooth_angle",
    "aov",
    "mtl_color",
    "prune",
    "materials",
];

/// Keys that the job has in `output` and an override beside the others.
const PICTURE_KEYS: [&str; 6] = ["name", "format", "size", "alpha", "bits", "quality"];

const JOB_KEYS: [&str; 10] =
    ["version", "name", "sequence", "layers", "frames", "output", "priority", "fps", "clip", "overrides"];

fn parse(yaml: &str, said_in: &Path) -> Read<JobFile> {
    let root = node::parse(yaml)?;
    if matches!(root.value, Value::Null) {
        return Err(Wrong::at(&root, "is empty; a job needs either `sequence` or `layers`"));
    }
    let job = Fields::of(&root, &[&JOB_KEYS, &SCENE_KEYS])?;
    job.get("version", |node| match node.value {
        Value::Number(1.0) => Ok(()),
        _ => Err(Wrong::at(node, "this version of rentix reads job files of version 1")),
    })?;
    match (job.node("sequence"), job.node("layers")) {
        (None, None) => return Err(Wrong::at(&root, "a job needs either `sequence` or `layers`")),
        (Some(_), Some(layers)) => {
            return Err(Wrong::at(layers, "a job has either `sequence` or `layers`; remove one"));
        }
        _ => {}
    }
    let path = |node: &Node| path(node, said_in);
    let mut file = JobFile {
        path: said_in.to_path_buf(),
        name: job.get("name", plain_name)?,
        sequence: job.get("sequence", path)?,
        layers: job.get("layers", |node| layers(node, said_in))?.unwrap_or_default(),
        frames: job.get("frames", frames)?,
        frames_at: job.node("frames").map(place_of).unwrap_or_default(),
        priority: job.get("priority", integer)?,
        fps: job.get("fps", number(limits::FPS))?,
        clip: job.get("clip", text)?.map(|word| ClipChoice::from_word(&word)).unwrap_or_default(),
        options: scene_options(&job, said_in)?,
        overrides: job.get("overrides", list(|node| override_of(node, said_in)))?.unwrap_or_default(),
        folder: None,
        bits_at: None,
    };
    job.get("output", |node| {
        let output = Fields::of(node, &[&["folder"], &PICTURE_KEYS])?;
        file.folder = output.get("folder", path)?;
        file.bits_at = output.node("bits").map(place_of);
        picture_options(&output, &mut file.options)
    })?;
    Ok(file)
}

/// A path, relative to the folder of the job file.
fn path(node: &Node, said_in: &Path) -> Read<PathBuf> {
    text(node).map(|p| said_in.parent().unwrap_or(Path::new("")).join(p))
}

/// The job's name becomes a folder's.
fn plain_name(node: &Node) -> Read<String> {
    let name = text(node)?;
    if name.contains(['/', '\\']) || name == "." || name == ".." {
        return Err(Wrong::at(
            node,
            format!("`{name}` is a path, not a name; `output: {{folder: …}}` takes one"),
        ));
    }
    Ok(name)
}

fn scene_options(map: &Fields<'_>, said_in: &Path) -> Read<Options> {
    let mut options = Options {
        lights: map.get("lights", scene::lights)?,
        ambient: map.get("ambient", color)?,
        background: map.get("background", |node| background(node, said_in))?,
        samples: map.get("samples", whole(limits::SAMPLES))?.map(|x| x as u32),
        filter: map.get("filter", parsed(|w| one_of(&FILTERS, w)))?,
        depth: map.get("depth", whole(limits::DEPTH))?.map(|x| x as u32),
        seed: map.get("seed", whole(limits::U32))?.map(|x| x as u32),
        up: map.get("up", scene::up)?,
        exposure: map.get("exposure", number(limits::EXPOSURE))?.map(|x| x as f32),
        smooth_angle: map.get("smooth_angle", number(limits::ANGLE))?.map(|x| x as f32),
        aov: map.get("aov", aovs)?,
        mtl_srgb: map.get("mtl_color", parsed(|w| one_of(&MTL_COLORS, w)))?,
        prune: map.get("prune", number(limits::PRUNE))?.map(|x| x as f32),
        materials: map.get("materials", |node| scene::materials(node, said_in))?.unwrap_or_default(),
        ..Options::default()
    };
    options.camera = map.get("camera", |node| scene::camera(node, &mut options))?;
    Ok(options)
}

fn picture_options(map: &Fields<'_>, options: &mut Options) -> Read<()> {
    options.name = map.get("name", picture_name)?;
    options.format = map.get("format", parsed(settings::format_word))?;
    options.size = map.get("size", size)?;
    options.alpha = map.get("alpha", truth)?;
    options.bits = map.get("bits", |node| {
        let bits = whole(limits::BITS)(node)?;
        settings::bits(bits).map_err(|e| Wrong::at(node, e))
    })?;
    options.quality = map.get("quality", whole(limits::QUALITY))?.map(|x| x as u8);
    Ok(())
}

/// A template of pictures' names.
fn picture_name(node: &Node) -> Read<String> {
    let name = text(node)?;
    template::check(&name).map_err(|e| Wrong::at(node, e))?;
    Ok(name)
}

fn size(node: &Node) -> Read<[u32; 2]> {
    let sides = list(whole(limits::SIDE))(node)?;
    <[f64; 2]>::try_from(sides)
        .map(|sides| sides.map(|x| x as u32))
        .map_err(|_| Wrong::at(node, "expected two numbers of pixels, as [1280, 720]"))
}

/// A colour, or a picture's file.
fn background(node: &Node, said_in: &Path) -> Read<Background> {
    match node.value {
        Value::Text(_) => path(node, said_in).map(Background::File),
        Value::Number(_) | Value::Long(_) | Value::List(_) => color(node).map(Background::Color),
        _ => Err(unexpected(node, "a colour, as [0, 0, 0], or a picture's file, as sky.hdr")),
    }
}

/// A list of words, or words between commas.
fn aovs(node: &Node) -> Read<AovSet> {
    let words = match &node.value {
        Value::List(_) => list(text)(node)?,
        _ => text(node)?.split(',').map(|w| w.trim().to_string()).collect(),
    };
    settings::aovs(words.iter().map(String::as_str)).map_err(|e| Wrong::at(node, e))
}

fn override_of(node: &Node, said_in: &Path) -> Read<Override> {
    let map = Fields::of(node, &[&["frames", "files"], &SCENE_KEYS, &PICTURE_KEYS])?;
    let mut options = scene_options(&map, said_in)?;
    picture_options(&map, &mut options)?;
    let bits_at = map.node("bits").map(place_of);
    Ok(Override {
        frames: map.get("frames", frames)?,
        line: u32::try_from(node.referenced.line()).unwrap_or(u32::MAX),
        files: map.get("files", pattern)?,
        options,
        bits_at,
    })
}

fn pattern(node: &Node) -> Read<Pattern> {
    Ok(Pattern::new(text(node)?.as_bytes()))
}

fn layers(node: &Node, said_in: &Path) -> Read<Vec<LayerFile>> {
    let layers = list(|node: &Node| layer(node, said_in))(node)?;
    if layers.is_empty() {
        return Err(Wrong::at(node, "the list of layers is empty"));
    }
    Ok(layers)
}

fn layer(node: &Node, said_in: &Path) -> Read<LayerFile> {
    let map = Fields::of(node, &[&["sequence", "name", "transform", "frames", "materials"]])?;
    let path = |node: &Node| path(node, said_in);
    let mut layer = LayerFile {
        sequence: map.need("sequence", path)?,
        name: map.get("name", text)?,
        placed: map.get("transform", scene::placed)?,
        start: None,
        step: 1,
        outside: Outside::Hold,
        materials: map.get("materials", path)?,
    };
    map.get("frames", |node| {
        let map = Fields::of(node, &[&["start", "step", "outside"]])?;
        layer.start = map.get("start", integer)?;
        layer.step = map.get("step", step)?.unwrap_or(1);
        layer.outside = map.get("outside", parsed(|w| one_of(&OUTSIDES, w)))?.unwrap_or_default();
        Ok(())
    })?;
    Ok(layer)
}

fn step(node: &Node) -> Read<i64> {
    match integer(node)? {
        0 => Err(Wrong::at(node, "a step of 0 never leaves the first frame; leave it out or give another")),
        step => Ok(step),
    }
}

#[cfg(test)]
mod tests;
