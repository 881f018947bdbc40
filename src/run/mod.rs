//! A run: reader, device and writer stages, threads joined by bounded queues. Reading frame n + 2, tracing n + 1 and
//! encoding n overlap; memory is bounded by the queues' lengths. An error is a value that travels with its frame.

mod animation;
mod boxes;
mod check;
mod costs;
mod estimate;
pub mod event;
mod failure;
mod fleet;
mod forecast;
pub mod machine;
mod memory;
mod movie;
mod prepare;
mod read;
mod report;
mod share;
mod source;
mod spoken;
mod trace;
mod under_way;
pub mod verify;
mod write;

pub use check::files_of;
pub use event::{Event, FrameReport, Status};
pub use fleet::Fleet;
pub use forecast::{Forecast, forecast};
pub use movie::{MovieError, make_movie, movie_can_be_made};
pub use read::{PICTURE_VERSION, read_frame, read_shot};
pub use report::{DeviceReport, Report, Totals, Unsaved};
pub use source::Sources;

use crate::clock::Stopwatch;
use crate::device::{DeviceKind, Stop};
use crate::film::LatentFilm;
use crate::job::Job;
use crate::output::{self, OutputError, RunLog};
use crate::plan::Update;
use crate::schedule::ScheduleError;
use crate::store::Store;
use crate::warning::Warnings;
use estimate::Estimator;
use fleet::Shared;
use read::ReadFrame;
use share::Share;
use std::path::PathBuf;
use std::sync::mpsc::{channel, sync_channel};
use std::sync::{Arc, Mutex};
use trace::Ends;

/// Frames read ahead of the device beyond those being read.
const FRAMES_READ_AHEAD: usize = 1;
/// Most threads that read, and most that encode, beside a device that uses the same cores.
const STAGE_THREADS_BESIDE: usize = 2;

/// Threads that read, and as many that encode: two of each keep a device busy that uses the same cores; another one is as fast
/// as all of them together, three eighths for each, so that the threads that feed it have some, too.
fn stage_threads(threads: usize, kind: DeviceKind) -> usize {
    match kind {
        DeviceKind::Gpu => (3 * threads).div_ceil(8),
        DeviceKind::Cpu | DeviceKind::Fake => threads.clamp(1, STAGE_THREADS_BESIDE),
    }
}

/// What of the command line bears on the run itself.
#[derive(Clone, Debug, Default)]
#[allow(clippy::struct_excessive_bools, reason = "each is a switch that a user types")]
pub struct RunOptions {
    /// Threads of reading and of encoding; the device has its own.
    pub threads: usize,
    /// Bytes of the host's memory that frames on their way may take; None: as many as they need.
    pub memory_bytes: Option<u64>,
    /// Forget everything between frames.
    pub cold: bool,
    /// What is done with trees over meshes that changed.
    pub update: Update,
    /// Render finished frames anew and write over files that no record names.
    pub overwrite: bool,
    /// Drop faces that cannot be rendered instead of failing their frame.
    pub lenient: bool,
    /// What is missing fails its frame.
    pub strict: bool,
    /// Its share beside other runs on the same devices: each step doubles it.
    pub priority: i32,
    /// Where the report goes.
    pub report: Option<PathBuf>,
    /// Whether the outcome has the reports of all frames, as it has where a report goes somewhere; else only of those that
    /// failed, so that a run may be of any length.
    pub keeps_reports: bool,
    /// What is kept on disk from run to run; None: nothing.
    pub store: Option<Arc<Store>>,
}

impl RunOptions {
    /// The store; a run that forgets everything between frames has none.
    fn store_of_run(&self) -> Option<Arc<Store>> {
        self.store.clone().filter(|_| !self.cold)
    }
}

/// Why a run could not begin (exit status 2).
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A picture would go where something else is.
    #[error("{} is there already and no record of a run names it; nothing is rendered (--overwrite writes over it, -o names another folder)", .0.display())]
    Foreign(PathBuf),
    /// A picture would go where an input is.
    #[error("{} is an input of this job and would be overwritten; nothing is rendered (-o names another folder)", .0.display())]
    OverInput(PathBuf),
    /// An auxiliary picture would take the place of another picture.
    #[error("{} would be written for two frames, for one as an auxiliary picture; nothing is rendered (--name names them otherwise)", .0.display())]
    Twice(PathBuf),
    /// The background of all frames is not there.
    #[error("{}: cannot be the background: it is not there, or is no plain file; nothing is rendered", .0.display())]
    Background(PathBuf),
    /// The report would go where a part of the job is.
    #[error("{}: the report cannot stand there: {why}; nothing is rendered (--report names another file)", .file.display())]
    ReportPlace {
        /// Where.
        file: PathBuf,
        /// What is there.
        why: &'static str,
    },
    /// The report cannot be written.
    #[error(transparent)]
    Unsaved(#[from] Unsaved),
    /// A file stands where the output folder should.
    #[error("{}: is no folder for pictures; nothing is rendered (-o names one)", .0.display())]
    NoFolder(PathBuf),
    /// The output folder cannot be used.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// No device can take the frames.
    #[error(transparent)]
    Schedule(#[from] ScheduleError),
    /// There is no place for temporary pictures.
    #[error("no temporary folder can be made: {0}; TMPDIR names another place")]
    NoRoom(std::io::Error),
}

/// How a run ended.
#[derive(Debug)]
pub struct Outcome {
    /// The report, settled.
    pub report: Report,
    /// Whether it was stopped before its end.
    pub stopped: bool,
    /// Why the report is not where it should be.
    pub unsaved: Option<Unsaved>,
}

impl Outcome {
    /// The frames that failed.
    pub fn failed(&self) -> impl Iterator<Item = &FrameReport> {
        self.report.frames.iter().filter(|f| f.status == Status::Failed)
    }
}

/// What the stages tell the thread that runs the run.
enum Note {
    Frame(Box<FrameReport>),
    Warnings(Warnings),
    Device(usize, DeviceReport),
}

/// A traced frame on its way to its file.
struct Shown {
    film: Arc<LatentFilm>,
    read: ReadFrame,
    /// Rendered, or copied.
    status: Status,
}

/// Renders a job on devices that other runs may share. `on_event` is called on this thread.
pub fn render(
    job: &Job,
    options: &RunOptions,
    fleet: &Fleet,
    stop: &Stop,
    on_event: &mut dyn FnMut(&Event),
) -> Result<Outcome, RunError> {
    let since = Stopwatch::start();
    let [rss_before, peak_before] = [machine::rss_bytes(), machine::peak_rss_bytes()];
    let records = check::before(job, options, stop)?;
    let mut saved = report::Saver::new(options.report.clone());
    let mut report = Report::new(fleet.reports(), options.keeps_reports || options.report.is_some());
    saved.save(&mut report, &since, true)?;
    clean_up(job);
    let mut warnings = Warnings::default();
    on_event(&Event::Start {
        frames: job.pictures.len(),
        folder: job.folder.display().to_string(),
        devices: fleet.devices().iter().map(|device| device.info.name.clone()).collect(),
    });
    tell(&job.warnings, &mut warnings, &mut report, on_event);
    let prepared = prepare::prepare(job, options);
    tell(&prepared.warnings, &mut warnings, &mut report, on_event);

    let store = options.store_of_run();
    let infos = fleet.devices().iter().map(|device| &device.info);
    let estimator = Estimator::new(store.as_deref(), infos);
    let log = RunLog::create(&job.folder);
    let devices = fleet.devices();
    let stage_threads = |device: &Shared| stage_threads(options.threads, device.info.kind);
    let threads = devices.iter().map(stage_threads).max().unwrap_or(1);
    // each device has as many frames read ahead as there are readers for it
    let ahead = (threads.div_ceil(devices.len().max(1)) + FRAMES_READ_AHEAD).max(3);
    let costs = (0..devices.len()).map(|device| estimator.costs(job, device)).collect();
    let memory_bytes = options.memory_bytes.unwrap_or(u64::MAX);
    let share = Share::new(&fleet.hub, job.pictures.len(), options.priority, costs, ahead, memory_bytes)?;
    let on_their_way = (ahead * devices.len() + threads).min(job.pictures.len());
    let trees = devices.iter().filter(|device| device.info.kind == DeviceKind::Cpu).count();
    let at_once = [on_their_way, trees].map(|n| n as u64);
    let reader = read::Reader::new(job, options, &records, prepared, &estimator, at_once);

    std::thread::scope(|scope| {
        let (note, notes) = channel::<Note>();
        let (to_devices, from_readers): (Vec<_>, Vec<_>) = fleet.devices().iter().map(|_| channel()).unzip();
        // no queue between device and writers: a film waits in the device stage until a writer is free
        let (to_writers, from_device) = sync_channel::<Shown>(0);
        let from_device = Arc::new(Mutex::new(from_device));
        for _ in 0..threads {
            let (to_devices, note) = (to_devices.clone(), note.clone());
            let (reader, share) = (&reader, &share);
            scope.spawn(move || read::read_stage(reader, share, stop, &to_devices, &note));
        }
        drop(to_devices);
        for (place, (device, from_readers)) in devices.iter().zip(from_readers).enumerate() {
            let (note, to_writers) = (note.clone(), to_writers.clone());
            let (share, estimator) = (&share, &estimator);
            scope.spawn(move || {
                let ends =
                    Ends { device: place, share, estimator, stop, to_writers: &to_writers, note: &note };
                trace::device_stage(device, options, &from_readers, ends);
            });
        }
        drop(to_writers);
        for _ in 0..threads {
            let (log, estimator) = (&log, &estimator);
            let (from_device, note) = (Arc::clone(&from_device), note.clone());
            scope.spawn(move || write::write_stage(log, estimator, &from_device, &note));
        }
        drop(from_device);
        drop(note);

        for note in notes {
            match note {
                Note::Frame(frame) => {
                    // kept in this thread's part of the heap: among what readers take and give back it would hold
                    // their memory in pieces
                    report.frame(&frame);
                    on_event(&Event::Frame(frame));
                }
                Note::Warnings(w) => tell(&w, &mut warnings, &mut report, on_event),
                Note::Device(i, d) => report.devices[i] = d,
            }
            if report.totals.predicted_rss_bytes.is_none() {
                report.totals.predicted_rss_bytes = estimator.host_bytes().map(|bytes| rss_before + bytes);
            }
            // what cannot be written now is tried again, and told of at the end
            let _ = saved.save(&mut report, &since, false);
        }
    });

    let peak_bytes = machine::peak_rss_bytes();
    // what others take is not this one's
    if peak_bytes > peak_before && !share.has_others() {
        estimator.took(peak_bytes.saturating_sub(rss_before));
    }
    if let Some(store) = store {
        estimator.save(&store);
        store.collect_garbage();
        let mut notes = Warnings::default();
        store.take_notes().into_iter().for_each(|note| notes.add(None, None, note));
        tell(&notes, &mut warnings, &mut report, on_event);
    }
    if !stop.asked() {
        // a frame that failed may have what the others do not
        if report.totals.failed == 0 {
            tell(&reader.unmet_overrides(), &mut warnings, &mut report, on_event);
        }
        for left in check::left_over(job, &report, |index| reader.blank(index)) {
            report.frame(&left);
            on_event(&Event::Frame(Box::new(left)));
        }
        for gone in check::pictures_gone(job, &mut report, |index| reader.blank(index)) {
            on_event(&Event::Frame(Box::new(gone)));
        }
    }
    report.warnings = warnings.list().iter().map(ToString::to_string).collect();
    report.settle(&since);
    let stopped = stop.asked();
    let unsaved = saved.save(&mut report, &since, true).err();
    Ok(Outcome { report, stopped, unsaved })
}

/// What a caught panic says, for the error of its frame.
fn panic_text(stage: &str, panic: &(dyn std::any::Any + Send)) -> String {
    let text =
        panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    format!(
        "internal error while {stage}: {}; the other frames go on, please report this",
        text.unwrap_or("no text")
    )
}

/// Clears up after dead runs. What cannot be cleared up does no harm.
fn clean_up(job: &Job) {
    let files: Vec<PathBuf> = job.pictures.iter().flat_map(check::files_of).collect();
    let _ = output::clean_up(&job.folder, files.iter().map(PathBuf::as_path));
}

/// Tells of those warnings that are new.
fn tell(new: &Warnings, all: &mut Warnings, report: &mut Report, on_event: &mut dyn FnMut(&Event)) {
    let fresh = all.merge(new);
    report.warnings.extend(fresh.iter().map(ToString::to_string));
    for w in fresh {
        on_event(&Event::Warning(w));
    }
}

#[cfg(test)]
mod tests;
