//! The job file: YAML, strict. Each error has line, column, what is allowed, and the nearest known name.

mod schema;
mod value;

use super::JobError;
use super::numbers::FrameSet;
use super::options::{Background, CameraChoice, LightChoice, Options};
use super::settings;
use super::track::{CameraPose, CameraTrack, Key, Placed, Transform};
use crate::format::{MaterialOverride, is_mtl_word};
use crate::math::{DVec3, Vec3};
use crate::scene::{Falloff, Light};
use schema::Choice;
use std::path::{Path, PathBuf};

/// What a job file says.
#[derive(Debug, Default)]
pub(super) struct JobFile {
    pub(super) name: Option<String>,
    pub(super) sequence: Option<PathBuf>,
    pub(super) layers: Vec<LayerFile>,
    pub(super) frames: Option<FrameSet>,
    pub(super) folder: Option<PathBuf>,
    pub(super) options: Options,
    pub(super) overrides: Vec<Override>,
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

/// Settings for some of the frames.
#[derive(Debug)]
pub(super) struct Override {
    pub(super) frames: Option<FrameSet>,
    /// Pattern on the stem.
    pub(super) files: Option<String>,
    pub(super) options: Options,
}

/// Reads a job file.
pub(super) fn read(path: &Path) -> Result<JobFile, JobError> {
    let unreadable = |source| JobError::Unreadable { path: path.to_path_buf(), source };
    let length = std::fs::metadata(path).map_err(unreadable)?.len();
    if length > MAX_BYTES {
        return Err(JobError::File {
            path: path.to_path_buf(),
            place: String::new(),
            text: format!("has {length} bytes, more than the {MAX_BYTES} of any job file"),
        });
    }
    let text = std::fs::read_to_string(path).map_err(unreadable)?;
    parse(&text, path).map_err(|(place, text)| JobError::File { path: path.to_path_buf(), place, text })
}

/// No job file is larger.
const MAX_BYTES: u64 = 1 << 20;

/// Paths are relative to the file's folder. An error is its place, as `:3:12`, and its text.
fn parse(text: &str, path: &Path) -> Result<JobFile, (String, String)> {
    let job: schema::Job = serde_yaml::from_str(text).map_err(|e| {
        let told = e.to_string();
        // of a key that stands twice serde tells only where its map begins
        let twice = told.split("duplicate field `").nth(1).and_then(|t| t.split('`').next());
        let place = twice.map(|key| line_of(text, key, true));
        let place = place.or_else(|| e.location().map(|l| format!(":{}:{}", l.line(), l.column())));
        (place.unwrap_or_default(), plainly(&told))
    })?;
    // these are checks between values; the line is that of the key they are about
    convert(job, path).map_err(|(key, wrong)| (line_of(text, key, false), wrong))
}

/// The first or last line that begins with a key, as `:3:1`.
fn line_of(text: &str, key: &str, last: bool) -> String {
    let begins = |l: &&str| {
        l.trim_start_matches([' ', '-', '{'])
            .strip_prefix(key)
            .is_some_and(|r| r.trim_start().starts_with(':'))
    };
    let mut lines = text.lines().zip(1..).filter(|(l, _)| begins(l)).map(|(_, n)| n);
    let line: Option<u32> = if last { lines.last() } else { lines.next() };
    line.map(|l| format!(":{l}:1")).unwrap_or_default()
}

/// serde's text without the place, which stands in front, and with the nearest known name.
fn plainly(text: &str) -> String {
    let text = text.split(" at line ").next().unwrap_or(text);
    let Some(rest) = text.split("unknown field `").nth(1).or_else(|| text.split("unknown variant `").nth(1))
    else {
        return text.to_string();
    };
    let mut words = rest.split('`');
    let unknown = words.next().unwrap_or_default();
    let known = words.skip(1).step_by(2);
    match known.map(|w| (distance(unknown, w), w)).min() {
        Some((d, nearest)) if d <= 1 + unknown.len() / 3 => format!("{text} (did you mean `{nearest}`?)"),
        _ => text.to_string(),
    }
}

/// Levenshtein's distance.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, cb) in b.iter().enumerate() {
            let change = diagonal + usize::from(ca != *cb);
            diagonal = row[j + 1];
            row[j + 1] = change.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

/// An error between values: the key that it is about, and what is wrong.
type Wrong = (&'static str, String);

macro_rules! scene_options {
    ($options:ident, $from:ident, $path:ident) => {
        $options.camera = $from.camera.map(camera).transpose()?;
        $options.lights = $from.lights.map(lights).transpose()?;
        $options.ambient = $from.ambient.map(|t| t.f32());
        $options.background = $from.background.map(|b| match b {
            value::ColorOrFile::Color(color) => Background::Color(color.f32()),
            value::ColorOrFile::File(file) => {
                Background::File($path.parent().unwrap_or(Path::new("")).join(file))
            }
        });
        $options.samples = $from.samples.map(|n| n.0 as u32);
        $options.filter = $from.filter;
        $options.depth = $from.depth.map(|n| n.0 as u32);
        $options.seed = $from.seed.map(|n| n.0 as u32);
        $options.up = $from.up.map(|u| u.0);
        $options.exposure = $from.exposure.map(|n| n.0 as f32);
        $options.smooth_angle = $from.smooth_angle.map(|n| n.0 as f32);
        $options.mtl_srgb = $from.mtl_color.map(|c| matches!(c, schema::MtlColor::Srgb));
        $options.prune = $from.prune.map(|n| n.0 as f32);
        if let Some(words) = &$from.aov {
            $options.aov = Some(settings::aovs(words.iter().map(|w| w.0.as_str())).map_err(|e| ("aov", e))?);
        }
        $options.materials = materials($from.materials, $path)?;
    };
}

macro_rules! output_options {
    ($options:ident, $from:ident) => {
        $options.name = $from.name.map(|n| n.0);
        $options.format = $from.format.map(|f| f.0);
        $options.size = $from.size.map(|[w, h]| [w.0 as u32, h.0 as u32]);
        $options.alpha = $from.alpha;
        $options.bits = $from.bits.map(|b| settings::bits(b.0)).transpose().map_err(|e| ("bits", e))?;
        $options.quality = $from.quality.map(|q| q.0 as u8);
    };
}

fn convert(job: schema::Job, path: &Path) -> Result<JobFile, Wrong> {
    let folder = path.parent().unwrap_or(Path::new(""));
    if job.version.as_ref().is_some_and(|v| v.0 != 1.0) {
        return Err(("version", "this version of rentix reads job files of version 1".to_string()));
    }
    if job.sequence.is_some() == job.layers.as_ref().is_some_and(|l| !l.is_empty()) {
        return Err(("sequence", "a job has either `sequence` or `layers`".to_string()));
    }
    let mut options = Options::default();
    scene_options!(options, job, path);
    let mut file = JobFile {
        name: job.name.map(|n| n.0),
        sequence: job.sequence.map(|s| folder.join(s.0)),
        frames: job.frames.map(|f| f.0),
        ..JobFile::default()
    };
    if let Some(output) = job.output {
        output_options!(options, output);
        file.folder = output.folder.map(|f| folder.join(f.0));
    }
    file.options = options;
    for layer in job.layers.unwrap_or_default() {
        file.layers.push(convert_layer(layer, folder)?);
    }
    for o in job.overrides.unwrap_or_default() {
        let mut options = Options::default();
        scene_options!(options, o, path);
        output_options!(options, o);
        file.overrides.push(Override { frames: o.frames.map(|f| f.0), files: o.files.map(|f| f.0), options });
    }
    Ok(file)
}

fn camera(choice: Choice<schema::Camera>) -> Result<CameraChoice, Wrong> {
    let Choice::Given(c) = choice else { return Ok(CameraChoice::Auto) };
    let wrong = |text: &str| Err(("camera", text.to_string()));
    if c.gltf.is_some() {
        return wrong("glTF cameras are not supported by this version");
    }
    let keys: Vec<Key<CameraPose>> = match (c.keys, c.eye, c.look_at) {
        (Some(keys), None, None) => keys
            .into_iter()
            .map(|k| Key {
                frame: k.frame.0,
                value: CameraPose {
                    eye: k.eye.0,
                    look_at: k.look_at.0,
                    up: k.up.or(None).map(|u| u.0).or(c.up.as_ref().map(|u| u.0)),
                    fov_deg: k.fov.map(|f| f.0).or(c.fov.as_ref().map(|f| f.0)),
                },
            })
            .collect(),
        (None, Some(eye), Some(look_at)) => {
            let value = CameraPose {
                eye: eye.0,
                look_at: look_at.0,
                up: c.up.map(|u| u.0),
                fov_deg: c.fov.map(|f| f.0),
            };
            vec![Key { frame: 0.0, value }]
        }
        (Some(_), ..) => return wrong("a camera with keys has eye and look_at in the keys"),
        (None, ..) => return wrong("a camera needs both eye and look_at (or keys)"),
    };
    if let Some(k) = keys.iter().find(|k| k.value.eye == k.value.look_at) {
        return Err(("camera", format!("eye and look_at are both {}", k.value.eye)));
    }
    Ok(CameraChoice::Given(CameraTrack { keys: ordered(keys, "camera")?, interpolation: c.interpolate }))
}

/// Keys in the order of their frames; there must be one, and no two at a frame.
fn ordered<T>(mut keys: Vec<Key<T>>, what: &'static str) -> Result<Vec<Key<T>>, Wrong> {
    keys.sort_by(|a, b| a.frame.total_cmp(&b.frame));
    if keys.is_empty() {
        return Err((what, "the list of keys is empty".to_string()));
    }
    match keys.windows(2).find(|w| w[0].frame == w[1].frame) {
        Some(w) => Err((what, format!("two keys are at frame {}", w[0].frame))),
        None => Ok(keys),
    }
}

fn lights(choice: Choice<Vec<schema::Light>>) -> Result<LightChoice, Wrong> {
    let Choice::Given(list) = choice else { return Ok(LightChoice::Auto) };
    list.into_iter().map(light).collect::<Result<_, _>>().map(LightChoice::Given)
}

fn light(l: schema::Light) -> Result<Light, Wrong> {
    let color = |c: Option<value::Triple<value::Color>>| c.map_or(Vec3::ONE, |c| c.f32());
    let intensity = |i: Option<value::Number<value::Color>>| i.map_or(1.0, |i| i.0 as f32);
    let falloff = |f: schema::Falloff| match f {
        schema::Falloff::None => Falloff::None,
        schema::Falloff::InverseSquare => Falloff::InverseSquare,
    };
    let direction = |d: value::Triple<value::Any>| match d.f32() {
        Vec3::ZERO => Err(("lights", "a direction has no length".to_string())),
        d => Ok(d),
    };
    match (l.point, l.directional, l.spot, l.area) {
        (Some(p), None, None, None) => Ok(Light::Point {
            position: p.position.f32(),
            color: color(p.color),
            intensity: intensity(p.intensity),
            falloff: falloff(p.falloff),
        }),
        (None, Some(d), None, None) => Ok(Light::Directional {
            direction: direction(d.direction)?,
            color: color(d.color),
            intensity: intensity(d.intensity),
        }),
        (None, None, Some(s), None) => {
            if s.inner.0 > s.outer.0 || s.outer.0 > 90.0 {
                return Err((
                    "lights",
                    format!("a spot needs inner ≤ outer ≤ 90, not {} and {}", s.inner.0, s.outer.0),
                ));
            }
            Ok(Light::Spot {
                position: s.position.f32(),
                direction: direction(s.direction)?,
                inner_deg: s.inner.0 as f32,
                outer_deg: s.outer.0 as f32,
                color: color(s.color),
                intensity: intensity(s.intensity),
                falloff: falloff(s.falloff),
            })
        }
        (None, None, None, Some(a)) => {
            let (Some(schema::AllMaterials::All) | None) = a.material;
            Ok(Light::Area { samples: a.samples.map_or(1, |n| n.0 as u32) })
        }
        _ => Err(("lights", "each light is one of point, directional, spot, area".to_string())),
    }
}

fn materials(
    map: Option<std::collections::BTreeMap<String, std::collections::BTreeMap<String, schema::MaterialWord>>>,
    path: &Path,
) -> Result<Vec<MaterialOverride>, Wrong> {
    let mut list = Vec::new();
    for (name, words) in map.unwrap_or_default() {
        if let Some(unknown) = words.keys().find(|w| !is_mtl_word(w)) {
            return Err(("materials", format!("material {name}: `{unknown}` is not a word of an MTL")));
        }
        let words = words.into_iter().map(|(w, v)| (w, v.0)).collect();
        list.push(MaterialOverride { name: name.into_bytes(), words, said_in: path.to_path_buf() });
    }
    Ok(list)
}

fn convert_layer(layer: schema::Layer, folder: &Path) -> Result<LayerFile, Wrong> {
    let frames = layer.frames.unwrap_or(schema::LayerFrames {
        start: None,
        step: None,
        outside: schema::Outside::Hold,
    });
    let step = frames.step.map_or(1, |s| s.0 as i64);
    if step == 0 {
        return Err((
            "frames",
            "a step of 0 never leaves the first frame; leave step out or give another".to_string(),
        ));
    }
    Ok(LayerFile {
        sequence: folder.join(layer.sequence.0),
        name: layer.name.map(|n| n.0),
        placed: layer.transform.map(placed).transpose()?,
        start: frames.start.map(|s| s.0 as i64),
        step,
        outside: match frames.outside {
            schema::Outside::Hold => Outside::Hold,
            schema::Outside::Loop => Outside::Loop,
            schema::Outside::Hide => Outside::Hide,
        },
        materials: layer.materials.map(|m| folder.join(m.0)),
    })
}

fn placed(t: schema::Transform) -> Result<Placed, Wrong> {
    let transform = |translate: Option<value::Triple<value::Any>>,
                     rotate: Option<value::Triple<value::Any>>,
                     scale: Option<value::Triple<value::Any>>| {
        let part = |v: Option<value::Triple<value::Any>>, absent: DVec3| v.map_or(absent, |v| v.0);
        Transform {
            translate: part(translate, DVec3::ZERO),
            rotate_deg: part(rotate, DVec3::ZERO),
            scale: part(scale, DVec3::ONE),
        }
    };
    let keys = match t.keys {
        None => vec![Key { frame: 0.0, value: transform(t.translate, t.rotate, t.scale) }],
        Some(_) if t.translate.is_some() || t.rotate.is_some() || t.scale.is_some() => {
            return Err((
                "transform",
                "a transform with keys has translate, rotate and scale in the keys".to_string(),
            ));
        }
        Some(keys) => keys
            .into_iter()
            .map(|k| Key { frame: k.frame.0, value: transform(k.translate, k.rotate, k.scale) })
            .collect(),
    };
    Ok(Placed { keys: ordered(keys, "transform")? })
}

#[cfg(test)]
mod tests;
