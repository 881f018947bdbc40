//! The reader stage: files become a frame and a shot, and finished pictures are recognised before they are traced.

use super::animation::{self, Views};
use super::estimate::Estimator;
use super::event::{ByteCounts, FrameReport, StageTimes, Status, UpdateReport};
use super::memory::{expected_bytes, needed_bytes, reckoned_bytes, refusal};
use super::prepare::{Prepared, prepare};
use super::share::{Share, Turn};
use super::source::{Place, Sources};
use super::spoken::Spoken;
use super::{Note, RunOptions, panic_text};
use crate::device::Stop;
use crate::diff::Change;
use crate::format::{FormatError, ParseKind, ReadOptions};
use crate::job::{Job, Picture, Settings};
use crate::output::{Bits, Encoding, Format, Records};
use crate::scene::{Frame, Object, PartHash, PartHasher, Shot};
use crate::schedule::estimate::Term;
use crate::warning::Warnings;
use std::collections::{HashMap, HashSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::Sender;

/// Changes whenever the same inputs may give other pixels, so that pictures of other versions are made anew.
pub const PICTURE_VERSION: u64 = 5;

/// A frame that was read and must be traced.
pub(super) struct ReadFrame {
    pub(super) report: Box<FrameReport>,
    pub(super) frame: Arc<Frame>,
    /// Objects that later pictures show, too, by their places in the frame.
    pub(super) used_again: Vec<usize>,
    pub(super) shot: Shot,
    pub(super) encoding: Encoding,
    pub(super) fingerprint: PartHash,
    /// The picture, relative to the output folder.
    pub(super) picture: PathBuf,
}

/// What became of a picture's turn with a reader.
pub(super) struct Read {
    pub(super) turn: Turn,
    /// Of the budget, taken until the frame has left the device stage.
    pub(super) bytes: u64,
    /// The frame; or its report, where it ends here.
    pub(super) outcome: Result<ReadFrame, Box<FrameReport>>,
}

/// Reads the pictures of a job.
pub(super) struct Reader<'a> {
    job: &'a Job,
    options: &'a RunOptions,
    records: &'a Records,
    prepared: Prepared,
    estimator: &'a Estimator,
    /// Frames on their way at once, and devices that have their trees in the host's memory.
    at_once: [u64; 2],
    /// The last picture that shows a file.
    last_shown: HashMap<&'a Path, usize>,
    /// The first picture of each sequence.
    first_of: HashMap<usize, usize>,
    spoken: Spoken,
}

/// Reads pictures for devices until there are no more.
pub(super) fn read_stage(
    reader: &Reader<'_>,
    share: &Share,
    stop: &Stop,
    to_devices: &[Sender<Read>],
    note: &Sender<Note>,
) {
    while let Some(turn) = share.next(stop) {
        let mut warnings = Warnings::default();
        let index = turn.index;
        let bytes = expected_bytes(reader.job, &reader.job.pictures[index]);
        share.take_bytes(turn, bytes);
        let mut outcome = catch_unwind(AssertUnwindSafe(|| reader.read(index, bytes, &mut warnings)))
            .unwrap_or_else(|panic| Err(reader.failed(index, &panic_text("reading", &*panic))));
        match &mut outcome {
            Ok(read) => read.report.taken = Some(turn.taken),
            Err(report) => report.taken = Some(turn.taken),
        }
        if !warnings.is_empty() {
            let _ = note.send(Note::Warnings(warnings));
        }
        share.was_read(turn.device);
        if to_devices[turn.device].send(Read { turn, bytes, outcome }).is_err() {
            return;
        }
    }
}

impl<'a> Reader<'a> {
    pub(super) fn new(
        job: &'a Job,
        options: &'a RunOptions,
        records: &'a Records,
        prepared: Prepared,
        estimator: &'a Estimator,
        at_once: [u64; 2],
    ) -> Self {
        let (mut last_shown, mut first_of) = (HashMap::new(), HashMap::new());
        for (index, picture) in job.pictures.iter().enumerate() {
            last_shown.extend(files(job, picture).map(|(_, path)| (path, index)));
            first_of.entry(picture.sequence).or_insert(index);
        }
        let spoken = Spoken::default();
        Self { job, options, records, prepared, estimator, at_once, last_shown, first_of, spoken }
    }

    /// What is to be told of materials that the job speaks of and no frame that was read has.
    pub(super) fn unmet_overrides(&self) -> Warnings {
        self.spoken.unmet()
    }

    /// Which objects of a picture stand in files that later pictures show, too.
    fn used_again(&self, index: usize, sources: &[usize]) -> Vec<usize> {
        let comes_again =
            |&(_, path): &(usize, &Path)| self.last_shown.get(path).is_some_and(|&last| last > index);
        let again: Vec<usize> = files(self.job, &self.job.pictures[index])
            .filter(comes_again)
            .map(|(source, _)| source)
            .collect();
        let is_again = |(_, source): &(usize, &usize)| again.contains(source);
        sources.iter().enumerate().filter(is_again).map(|(object, _)| object).collect()
    }

    /// Reads one picture's frame; or its report, where it ends here: failed or finished already.
    fn read(
        &self,
        index: usize,
        expected_bytes: u64,
        warnings: &mut Warnings,
    ) -> Result<ReadFrame, Box<FrameReport>> {
        let picture = &self.job.pictures[index];
        let mut report = self.blank(index);
        self.refuse_beyond_memory(&mut report, expected_bytes)?;
        let sources = &self.prepared.sources;
        let is_first = self.first_of.get(&picture.sequence) == Some(&index);
        let RunOptions { lenient, strict, .. } = *self.options;
        let loaded = load_frame(self.job, picture, is_first, sources, lenient, strict, warnings);
        let (frame, views, sources, parsing) = match loaded {
            Ok(loaded) => {
                report.bytes.read = loaded.bytes_read;
                report.ms.read = Some(loaded.read_ms);
                report.ms.parse = Some(loaded.parse_ms);
                let parsing = loaded.parsing();
                if let Some(unmet) = loaded.unmet_overrides {
                    self.spoken.see(&picture.settings.read.material_overrides, |name| unmet.contains(name));
                }
                (loaded.frame, loaded.views, loaded.sources, parsing)
            }
            Err(error) => {
                report.device_failed = matches!(error, LoadError::TooLarge(_));
                report.error = Some(error.text());
                return Err(report);
            }
        };
        report.triangles = frame.triangles();
        self.estimator.read(&mut report, parsing);
        let [on_their_way, trees] = self.at_once;
        self.estimator.reckon_host(|| reckoned_bytes(self.job, picture, &frame, on_their_way, trees));
        self.refuse_beyond_memory(&mut report, needed_bytes(&frame))?;
        let shot = match self.prepared.shot(picture, &views) {
            Ok(shot) => shot,
            Err(error) => {
                report.error = Some(format!("{}: {error}", report.named()));
                return Err(report);
            }
        };
        let encoding = encoding(&picture.settings);
        let fingerprint = fingerprint(&frame, &shot, encoding);
        if !self.options.overwrite && self.records.finished(&picture.picture, fingerprint) {
            report.status = Status::Resumed;
            report.change = Change::default();
            return Err(report);
        }
        Ok(ReadFrame {
            report,
            frame: Arc::new(frame),
            used_again: self.used_again(index, &sources),
            shot,
            encoding,
            fingerprint,
            picture: picture.picture.clone(),
        })
    }

    fn refuse_beyond_memory(
        &self,
        report: &mut Box<FrameReport>,
        needed_bytes: u64,
    ) -> Result<(), Box<FrameReport>> {
        match self.options.memory_bytes {
            Some(budget_bytes) if needed_bytes > budget_bytes => {
                report.error = Some(format!("{}: {}", report.named(), refusal(needed_bytes, budget_bytes)));
                report.device_failed = true;
                Err(report.clone())
            }
            _ => Ok(()),
        }
    }

    pub(super) fn blank(&self, index: usize) -> Box<FrameReport> {
        let picture = &self.job.pictures[index];
        let sequence = &self.job.sequences[picture.sequence];
        Box::new(FrameReport {
            sequence: sequence.name.clone(),
            frame: picture.frame,
            source: picture.main_file(sequence).map(|f| file_name(&f.path)).unwrap_or_default(),
            picture: picture.picture.to_string_lossy().into_owned(),
            status: Status::Failed,
            error: None,
            device: None,
            warm: false,
            triangles: 0,
            change: Change::default(),
            update: UpdateReport::default(),
            bytes: ByteCounts::default(),
            rays: super::event::RayReport::default(),
            ms: StageTimes::default(),
            predicted_ms: StageTimes::default(),
            index,
            taken: None,
            device_failed: false,
        })
    }

    fn failed(&self, index: usize, error: &str) -> Box<FrameReport> {
        let mut report = self.blank(index);
        report.error = Some(format!("{}: {error}", report.named()));
        report
    }
}

/// A frame and what reading it cost; what was kept from an earlier frame costs nothing.
struct LoadedFrame {
    frame: Frame,
    /// For each object the place of its source in the picture.
    sources: Vec<usize>,
    views: Views,
    /// Whether what stands in it was parsed before and posed now.
    is_posed: bool,
    /// That of its files that was the most work.
    kind: ParseKind,
    bytes_read: u64,
    read_ms: f64,
    parse_ms: f64,
    /// Names of materials that the job speaks of and none of its files has; None: it has no file.
    unmet_overrides: Option<HashSet<Vec<u8>>>,
}

impl LoadedFrame {
    /// Takes the names that one of its files does not have.
    fn without_materials(&mut self, unmet: &[Vec<u8>]) {
        match &mut self.unmet_overrides {
            Some(all) => all.retain(|name| unmet.contains(name)),
            None => self.unmet_overrides = Some(unmet.iter().cloned().collect()),
        }
    }

    /// What kind of work its parsing was.
    fn parsing(&self) -> Term<'static> {
        match self.kind {
            _ if self.is_posed => Term::Pose,
            ParseKind::Full => Term::Parse,
            ParseKind::Incremental => Term::Reparse,
            ParseKind::Restored => Term::Restore,
        }
    }
}

/// Why a frame cannot be had.
enum LoadError {
    /// What its files are.
    Bad(String),
    /// It takes more memory than is allowed: another machine may have it.
    TooLarge(String),
}

impl LoadError {
    /// What is missing, where that fails the frame; it is told with its error, not as a warning, too.
    fn missing(sentence: &str) -> Self {
        Self::Bad(format!("{sentence}; the frame is not rendered (--strict)"))
    }

    fn text(self) -> String {
        match self {
            Self::Bad(text) | Self::TooLarge(text) => text,
        }
    }
}

impl From<FormatError> for LoadError {
    fn from(error: FormatError) -> Self {
        let text = error.to_string();
        if matches!(error, FormatError::TexturesTooLarge { .. }) {
            Self::TooLarge(text)
        } else {
            Self::Bad(text)
        }
    }
}

/// The files of a picture, each with the place of its source.
fn files<'a>(job: &'a Job, picture: &'a Picture) -> impl Iterator<Item = (usize, &'a Path)> {
    let layers = &job.sequences[picture.sequence].layers;
    let shown = picture.sources.iter().enumerate();
    shown.filter_map(|(place, s)| Some((place, &*layers[s.layer].files[s.file?].path)))
}

/// Reads a picture's frame; `is_first` where it is the first of its sequence.
fn load_frame(
    job: &Job,
    picture: &Picture,
    is_first: bool,
    sources: &Sources,
    lenient: bool,
    strict: bool,
    warnings: &mut Warnings,
) -> Result<LoadedFrame, LoadError> {
    let sequence = &job.sequences[picture.sequence];
    let mut all = LoadedFrame {
        frame: Frame::default(),
        sources: Vec::new(),
        views: Views::default(),
        is_posed: false,
        kind: ParseKind::default(),
        bytes_read: 0,
        read_ms: 0.0,
        parse_ms: 0.0,
        unmet_overrides: None,
    };
    for (at, source) in picture.sources.iter().enumerate() {
        let Some(file) = source.file else { continue };
        let layer = &sequence.layers[source.layer];
        let options = read_options(picture, layer.materials.as_deref(), lenient);
        let path = &layer.files[file].path;
        if let Some(moment) = &layer.files[file].moment {
            let shown = sources.animations.show(path, moment, &options, source.transform.as_ref(), true)?;
            let missing = shown.gltf.missing.first().filter(|_| strict);
            if shown.is_first {
                all.bytes_read += shown.gltf.bytes_read;
                animation::tell(&shown.gltf, path, &options, missing, warnings);
            }
            if let Some(missing) = missing {
                return Err(LoadError::missing(missing));
            }
            all.without_materials(&shown.gltf.unmet_overrides);
            all.is_posed = true;
            all.parse_ms += shown.parse_ms;
            all.views.cameras.extend(shown.views.cameras);
            all.views.lights.extend(shown.views.lights);
            all.sources.extend(shown.objects.iter().map(|_| at));
            all.frame.objects.extend(shown.objects);
            continue;
        }
        let place = match layer.files.len() {
            1 => Place::Only,
            _ if is_first => Place::First,
            _ => Place::Later,
        };
        let (loaded, is_new) = sources.load(path, &options, place)?;
        let missing = loaded.missing.first().filter(|_| strict);
        if is_new {
            all.kind = all.kind.max(loaded.kind);
            all.bytes_read += loaded.bytes_read;
            all.read_ms += loaded.read_ms;
            all.parse_ms += loaded.parse_ms;
            match missing {
                Some(told) => warnings.merge(&loaded.warnings.without(told)),
                None => warnings.merge(&loaded.warnings),
            };
        }
        if let Some(missing) = missing {
            return Err(LoadError::missing(missing));
        }
        all.without_materials(&loaded.unmet_overrides);
        all.sources.push(at);
        all.frame
            .objects
            .push(Object { geometry: Arc::clone(&loaded.geometry), transform: source.transform });
    }
    Ok(all)
}

/// Reads the frame of a picture, without the run around it.
pub fn read_frame(
    job: &Job,
    picture: &Picture,
    sources: &Sources,
    lenient: bool,
    warnings: &mut Warnings,
) -> Result<Frame, String> {
    load_frame(job, picture, false, sources, lenient, false, warnings)
        .map(|l| l.frame)
        .map_err(LoadError::text)
}

/// Reads the frame of a job's first picture, and what it is to be shot with.
pub fn read_shot(job: &Job, options: &RunOptions) -> Result<(Frame, Shot), String> {
    let picture = job.pictures.first().ok_or_else(|| "there is no picture".to_string())?;
    let prepared = prepare(job, options);
    let (sources, warnings) = (&prepared.sources, &mut Warnings::default());
    let loaded = load_frame(job, picture, true, sources, options.lenient, options.strict, warnings);
    let LoadedFrame { frame, views, .. } = loaded.map_err(LoadError::text)?;
    Ok((frame, prepared.shot(picture, &views)?))
}

/// How a layer of a picture is read.
pub(super) fn read_options(picture: &Picture, materials: Option<&Path>, lenient: bool) -> ReadOptions {
    ReadOptions { lenient, materials_file: materials.map(Path::to_path_buf), ..picture.settings.read.clone() }
}

fn file_name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

/// How a picture is written.
pub(super) fn encoding(settings: &Settings) -> Encoding {
    Encoding {
        // the job room knows the same words, which a test holds together
        format: Format::from_word(&settings.format).unwrap_or(Format::Png),
        bits: Bits::from_number(settings.bits).unwrap_or_default(),
        exposure_stops: settings.exposure_stops,
        quality: settings.quality,
    }
}

/// Names everything that bears on the picture file: parts, shot, encoding and the version of the pictures.
fn fingerprint(frame: &Frame, shot: &Shot, encoding: Encoding) -> PartHash {
    let mut h = PartHasher::new("picture");
    h.u64(PICTURE_VERSION);
    h.part(frame.hash());
    shot.hash_into(&mut h);
    encoding.hash_into(&mut h);
    h.finish()
}
