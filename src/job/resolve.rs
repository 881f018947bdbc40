//! From what was asked for to the list of pictures.

use super::animation;
use super::discover::{self, Files, Taking};
use super::dropped;
use super::file::{self, JobFile, LayerFile, Outside, Override};
use super::template::{Fill, fill};
use super::{
    FrameFile, Job, JobError, Layer, MAX_FRAMES, Options, Picture, Request, Sequence, Settings, Source,
    main_file, settings,
};
use crate::format::ClipChoice;
use crate::warning::Warnings;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Works out what is to be rendered; nothing is written.
pub fn resolve(request: &Request) -> Result<Job, JobError> {
    let mut job = Resolving {
        request,
        warnings: Warnings::default(),
        inputs: Vec::new(),
        sequences: Vec::new(),
        pictures: Vec::new(),
        settings: HashMap::new(),
    };
    let (mut files, inputs): (Vec<&PathBuf>, Vec<&PathBuf>) =
        request.inputs.iter().partition(|i| is_job_file(i));
    files.extend(&request.job_file);
    let job_file = match files.as_slice() {
        [] => JobFile::default(),
        [path] => {
            job.inputs.push((*path).clone());
            let read = file::read(path)?;
            if let Some(folder) = &request.dropped {
                dropped::check_file(&read, path, folder)?;
            }
            read
        }
        _ => {
            return Err(JobError::Options(
                "more than one job file; render them one after the other".to_string(),
            ));
        }
    };
    if inputs.is_empty() && files.is_empty() {
        return Err(JobError::NoInput);
    }
    if !inputs.is_empty() && !job_file.layers.is_empty() {
        return Err(JobError::Options("a job with layers takes no other INPUT".to_string()));
    }

    let stem = files.first().map(|p| p.file_stem().unwrap_or_default().to_string_lossy().into_owned());
    let of_job = job_file.name.clone().or(stem);
    let mut name = of_job.clone();
    let taking = Resolving::taking(request, &job_file);
    let fps = taking.fps;
    if job_file.layers.is_empty() {
        let own: Vec<&PathBuf> = job_file.sequence.iter().collect();
        for input in if inputs.is_empty() { own } else { inputs } {
            for files in discover::discover(input, taking, &mut job.warnings)? {
                job.add_sequence(of_job.as_deref(), files, &job_file)?;
            }
            name.get_or_insert_with(|| discover::input_name(input));
        }
    } else {
        job.add_layers(name.as_deref().unwrap_or("layers"), &job_file)?;
    }
    let name = name.unwrap_or_default();

    job.warn_of_what_is_for_nothing(&job_file);
    job.place_in_folders();
    job.choose(&job_file)?;
    job.inputs.extend(
        job.sequences
            .iter()
            .flat_map(|s| &s.layers)
            .flat_map(|l| l.files.iter().map(|f| f.path.clone()).chain(l.materials.clone()))
            .collect::<Vec<_>>(),
    );
    if let Some(folder) = &request.dropped {
        dropped::check_inputs(&job.inputs, folder)?;
    }
    let folder = request.folder.clone().or(job_file.folder).unwrap_or_else(|| Path::new("out").join(&name));
    Ok(Job {
        name,
        folder,
        sequences: job.sequences,
        pictures: job.pictures,
        inputs: job.inputs,
        priority: job_file.priority,
        fps,
        warnings: job.warnings,
    })
}

pub(super) fn is_job_file(path: &Path) -> bool {
    let is_yaml = |e: &std::ffi::OsStr| e.eq_ignore_ascii_case("yaml") || e.eq_ignore_ascii_case("yml");
    path.extension().is_some_and(is_yaml) && !path.is_dir()
}

struct Resolving<'a> {
    request: &'a Request,
    warnings: Warnings,
    inputs: Vec<PathBuf>,
    sequences: Vec<Sequence>,
    pictures: Vec<Picture>,
    /// Settings by the places of the overrides that are laid over the job's.
    settings: HashMap<Vec<usize>, Arc<Settings>>,
}

impl Resolving<'_> {
    /// How INPUTs are taken: what is typed wins over the job, but over a dropped one.
    fn taking<'t>(request: &'t Request, job: &'t JobFile) -> Taking<'t> {
        let job_wins = request.dropped.is_some();
        Taking {
            one_sequence: request.one_sequence,
            strict: request.strict,
            fps: if job_wins { job.fps.or(request.fps) } else { request.fps.or(job.fps) }
                .unwrap_or(animation::FPS),
            clip: match &request.clip {
                Some(clip) if !job_wins || job.clip == ClipChoice::Auto => clip,
                _ => &job.clip,
            },
        }
    }

    /// A sequence of one layer: a picture for each of its files.
    fn add_sequence(&mut self, of_job: Option<&str>, files: Files, job: &JobFile) -> Result<(), JobError> {
        let sequence = self.sequences.len();
        let layer = Layer { name: files.name.clone(), files: files.files, materials: None, placed: None };
        let mut pictures = Vec::new();
        for (i, file) in layer.files.iter().enumerate() {
            let sources = vec![Source { layer: 0, file: Some(i), transform: None }];
            let settings = self.settings(job, file.number, &[&file.stem])?;
            let with = Fill { stem: &file.stem, name: of_job.unwrap_or(&files.name), frame: file.number };
            let default = if file.moment.is_some() { "{stem}_{frame:04}" } else { "{stem}" };
            let picture = picture_path(&settings, default, with)?;
            pictures.push(Picture { sequence, frame: file.number, sources, picture, settings });
        }
        self.add(files.name, vec![layer], pictures);
        Ok(())
    }

    /// All layers in one sequence: a picture for each frame of the job, else of the longest layer.
    fn add_layers(&mut self, job_name: &str, job: &JobFile) -> Result<(), JobError> {
        let mut layers = Vec::new();
        let taking = Self::taking(self.request, job);
        for given in &job.layers {
            let mut found = discover::discover(&given.sequence, taking, &mut self.warnings)?;
            if found.len() > 1 {
                let text = format!(
                    "layer {} holds {} sequences; name one by a pattern",
                    given.sequence.display(),
                    found.len()
                );
                return Err(JobError::Options(text));
            }
            let files = found.remove(0);
            let name = given.name.clone().unwrap_or(files.name);
            if let Some(absent) = given.materials.as_ref().filter(|m| !m.is_file()) {
                return Err(JobError::Absent(absent.clone()));
            }
            layers.push(Layer {
                name,
                files: files.files,
                materials: given.materials.clone(),
                placed: given.placed.clone(),
            });
        }
        if job.frames.as_ref().is_some_and(|set| set.len() > MAX_FRAMES) {
            return Err(JobError::Options(format!(
                "the job asks for more than {MAX_FRAMES} frames; split it"
            )));
        }
        let frames = layer_frames(&layers, job);
        let first = frames.first().copied().unwrap_or(1);
        let mut pictures = Vec::new();
        for frame in frames {
            let sources: Vec<Source> = layers
                .iter()
                .zip(&job.layers)
                .enumerate()
                .map(|(layer, (l, given))| Source {
                    layer,
                    file: layer_file(&l.files, given, i128::from(frame) - i128::from(first)),
                    transform: l.placed.as_ref().map(|p| p.at(frame)),
                })
                .collect();
            let shown = sources.iter().zip(&layers).filter_map(|(s, l)| Some(l.files[s.file?].stem.as_str()));
            let settings = self.settings(job, Some(frame), &shown.collect::<Vec<_>>())?;
            let stem = main_file(&layers, &sources).map_or(job_name, |f| &f.stem);
            let with = Fill { stem, name: job_name, frame: Some(frame) };
            let picture = picture_path(&settings, "{name}_{frame:04}", with)?;
            pictures.push(Picture { sequence: 0, frame: Some(frame), sources, picture, settings });
        }
        self.add(job_name.to_string(), layers, pictures);
        Ok(())
    }

    fn add(&mut self, name: String, layers: Vec<Layer>, pictures: Vec<Picture>) {
        if let Some(first) = pictures.first().cloned() {
            self.sequences.push(Sequence { name, layers, first });
            self.pictures.extend(pictures);
        }
    }

    /// Defaults, then the job, then its overrides in turn, then the command line, which for a dropped job comes before it.
    /// An override of files is for pictures that show one of them.
    fn settings(
        &mut self,
        job: &JobFile,
        frame: Option<i64>,
        stems: &[&str],
    ) -> Result<Arc<Settings>, JobError> {
        let applying: Vec<usize> =
            (0..job.overrides.len()).filter(|&i| applies(&job.overrides[i], frame, stems)).collect();
        if let Some(settings) = self.settings.get(&applying) {
            return Ok(Arc::clone(settings));
        }
        let is_dropped = self.request.dropped.is_some();
        let own = applying.iter().map(|&i| &job.overrides[i].options);
        let own = std::iter::once(&job.options).chain(own);
        let mut options = if is_dropped { self.request.options.clone() } else { Options::default() };
        for over in own {
            if is_dropped && over.camera.is_some() {
                // else what was typed would win over the job's camera
                (options.eye, options.look_at) = (None, None);
            }
            options.lay_over(over);
        }
        if !is_dropped {
            options.lay_over(&self.request.options);
        }
        if let Err(text) = settings::check_bits(&options) {
            let of_override = applying.iter().rev().find_map(|&i| job.overrides[i].bits_at.as_ref());
            let place = of_override.or(job.bits_at.as_ref());
            let is_typed = self.request.options.bits.is_some() && !is_dropped;
            return Err(match place.filter(|_| !is_typed) {
                Some(place) => job.wrong(place, format!("bits: {text}")),
                None => JobError::Options(text),
            });
        }
        let mut settings = Settings::new(&options).map_err(JobError::Options)?;
        settings.read.within.clone_from(&self.request.dropped);
        let settings = Arc::new(settings);
        if let Some(text) = settings.left_out() {
            self.warnings.add(None, None, text);
        }
        self.settings.insert(applying, Arc::clone(&settings));
        Ok(settings)
    }

    /// Overrides that are for none of the frames, and a clip where nothing has one.
    fn warn_of_what_is_for_nothing(&mut self, job: &JobFile) {
        let applied: HashSet<usize> = self.settings.keys().flatten().copied().collect();
        // frames that an override is for may come yet
        let idle = (0..job.overrides.len()).filter(|i| !applied.contains(i) && !self.request.grows);
        for i in idle {
            let text = "an override is for none of the frames; check its `frames` and `files`";
            self.warnings.add(Some(job.path()), Some(job.overrides[i].line), text);
        }
        let mut files = self.sequences.iter().flat_map(|s| &s.layers).flat_map(|l| &l.files);
        if files.any(|f| f.moment.is_some()) {
            return;
        }
        if job.clip != ClipChoice::Auto {
            let text = "`clip` is for glTF files and there is none; it changes nothing";
            self.warnings.add(Some(job.path()), None, text);
        } else if self.request.clip.is_some() && self.request.dropped.is_none() {
            self.warnings.add(None, None, "--clip is for glTF files and there is none; it changes nothing");
        }
    }

    /// Where several sequences would write one name, each gets a folder of its own.
    fn place_in_folders(&mut self) {
        let mut owner: HashMap<&Path, usize> = HashMap::new();
        let clash =
            self.pictures.iter().any(|p| *owner.entry(&p.picture).or_insert(p.sequence) != p.sequence);
        if !clash {
            return;
        }
        let mut taken: HashSet<String> = HashSet::new();
        let folders: Vec<String> = self
            .sequences
            .iter()
            .map(|s| {
                let names = std::iter::once(s.name.clone()).chain((2..).map(|i| format!("{}-{i}", s.name)));
                // the iterator has no end
                names.into_iter().find(|n| taken.insert(n.clone())).unwrap_or_default()
            })
            .collect();
        for p in &mut self.pictures {
            p.picture = Path::new(&folders[p.sequence]).join(&p.picture);
        }
    }

    /// `--frames`, else the job's, then `--chunk`, then `--order`. Names are compared before the chunk is taken: all
    /// chunks write into one folder.
    fn choose(&mut self, job: &JobFile) -> Result<(), JobError> {
        let typed = self.request.frames.as_ref();
        let of_job = job.frames.as_ref();
        let job_wins = of_job.is_some() && (self.request.dropped.is_some() || typed.is_none());
        if let Some(set) = if job_wins { of_job } else { typed } {
            let mut numbers: Vec<i64> = self.pictures.iter().filter_map(|p| p.frame).collect();
            numbers.sort_unstable();
            if let Some(missing) = set.first_not_in(&numbers).filter(|_| !self.request.grows) {
                let error = JobError::NoSuchFrame(missing);
                return Err(if job_wins {
                    job.wrong(&job.frames_at, format!("frames: {error}"))
                } else {
                    error
                });
            }
            self.pictures.retain(|p| p.frame.is_some_and(|f| set.contains(f)));
        }
        let mut seen: HashMap<&Path, &Picture> = HashMap::new();
        for second in &self.pictures {
            if let Some(first) = seen.insert(&second.picture, second) {
                return Err(self.two_of_a_name(first, second));
            }
        }
        if let Some(chunk) = self.request.chunk {
            self.pictures = self.pictures[chunk.range(self.pictures.len())].to_vec();
        }
        self.request.order.apply(&mut self.pictures);
        Ok(())
    }

    /// Names both frames and what would part them.
    fn two_of_a_name(&self, first: &Picture, second: &Picture) -> JobError {
        let file = |p: &Picture| p.main_file(&self.sequences[p.sequence]).cloned();
        let (files, frames) = ([file(first), file(second)], [first.frame, second.frame]);
        let named = |i: usize| match (&files[i], frames[i]) {
            (Some(file), _) if files[0] != files[1] => file.path.display().to_string(),
            (_, Some(frame)) => format!("frame {frame}"),
            _ => "a frame".to_string(),
        };
        let stems = files.each_ref().map(|file| file.as_ref().map(|f| &f.stem));
        let remedy = if stems[0] != stems[1] {
            "put {stem} or {frame} into the name"
        } else if frames[0] != frames[1] {
            "put {frame} into the name"
        } else {
            "rename one, or use --one-sequence with {frame} in the name (--name)"
        };
        JobError::TwoOfAName { first: named(0), second: named(1), picture: second.picture.clone(), remedy }
    }
}

fn applies(o: &Override, frame: Option<i64>, stems: &[&str]) -> bool {
    o.frames.as_ref().is_none_or(|set| frame.is_some_and(|f| set.contains(f)))
        && o.files.as_ref().is_none_or(|pattern| stems.iter().any(|s| pattern.matches(s.as_bytes())))
}

fn picture_path(settings: &Settings, default: &str, with: Fill<'_>) -> Result<PathBuf, JobError> {
    let template = settings.name.as_deref().unwrap_or(default);
    let name = fill(template, with).map_err(JobError::Options)?;
    Ok(PathBuf::from(format!("{name}.{}", settings.format)))
}

/// The frames of a job with layers: those it names, else those of the longest layer (1 where it has no number).
fn layer_frames(layers: &[Layer], job: &JobFile) -> Vec<i64> {
    if let Some(set) = &job.frames {
        return set.iter().collect();
    }
    // of several the first
    let longest = layers.iter().rev().max_by_key(|l| l.files.len());
    longest.into_iter().flat_map(|l| &l.files).map(|f| f.number.unwrap_or(1)).collect()
}

/// The file that a layer shows so many frames after the job's first one (CONTRACT 3: start + step · offset, in a gap
/// the last one before).
fn layer_file(files: &[FrameFile], given: &LayerFile, offset: i128) -> Option<usize> {
    let number = |f: &FrameFile| i128::from(f.number.unwrap_or(0));
    let (first, last) = (number(files.first()?), number(files.last()?));
    let steps = i128::from(given.step).saturating_mul(offset);
    let mut wanted = given.start.map_or(first, i128::from).saturating_add(steps);
    if !(first..=last).contains(&wanted) {
        wanted = match given.outside {
            Outside::Hold => wanted.clamp(first, last),
            Outside::Loop => first + wanted.saturating_sub(first).rem_euclid(last - first + 1),
            Outside::Hide => return None,
        };
    }
    files.partition_point(|f| number(f) <= wanted).checked_sub(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(step: i64, outside: Outside) -> LayerFile {
        LayerFile {
            sequence: PathBuf::new(),
            name: None,
            placed: None,
            start: None,
            step,
            outside,
            materials: None,
        }
    }

    fn shown(given: &LayerFile) -> Vec<Option<usize>> {
        let file = |n| FrameFile { number: Some(n), path: PathBuf::new(), stem: String::new(), moment: None };
        // frame 12 is missing
        let files = [file(10), file(11), file(13)];
        (-1..6).map(|offset| layer_file(&files, given, offset)).collect()
    }

    #[test]
    fn layers_hold_loop_or_hide() {
        assert_eq!(shown(&layer(1, Outside::Hold)), [0, 0, 1, 1, 2, 2, 2].map(Some));
        assert_eq!(shown(&layer(1, Outside::Loop)), [2, 0, 1, 1, 2, 0, 1].map(Some));
        assert_eq!(shown(&layer(1, Outside::Hide)), [None, Some(0), Some(1), Some(1), Some(2), None, None]);
        assert_eq!(shown(&layer(2, Outside::Hold)), [0, 0, 1, 2, 2, 2, 2].map(Some));
        let later = LayerFile { start: Some(13), ..layer(-1, Outside::Hold) };
        assert_eq!(shown(&later), [2, 2, 1, 1, 0, 0, 0].map(Some));
    }
}
