//! What a run's frames are expected to take on its devices, learned from every frame; what was learned is kept in the store,
//! for the host and for each device.

use super::event::FrameReport;
use super::machine::{Machine, machine};
use super::memory::text_bytes;
use crate::device::{DeviceInfo, DeviceKind, Traced, UpdateCost};
use crate::job::{Job, LightChoice, Settings};
use crate::plan::{Residency, Step, TREE_BYTES_PER_TRIANGLE, UpdatePlan};
use crate::scene::{Frame, PartHasher, Shot};
use crate::schedule::Costs;
use crate::schedule::estimate::{Estimates, Expected, Speeds, Term, trace_work};
use crate::store::{Key, Payload, Store};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

/// Bytes of an OBJ file for each of its triangles; 20 to 100 were seen.
const TEXT_BYTES_PER_TRIANGLE: u64 = 40;
/// The kind of the store's entries.
const KIND: &str = "rates";

/// Rates of the host and of devices.
pub(super) struct Estimator {
    host: Kept,
    devices: Vec<Kept>,
    /// Bytes of the host's memory as they are reckoned from the first frame.
    host_bytes: OnceLock<u64>,
}

/// Rates, and the key under which a store has them.
struct Kept {
    key: Key,
    estimates: Mutex<Estimates>,
}

/// What bears on the rays of a frame beside what they hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rays {
    /// Samples in all.
    pub(super) samples: f64,
    /// Lights.
    pub(super) lights: usize,
    /// Bounces.
    pub(super) depth: u32,
}

impl Rays {
    pub(super) fn of_shot(shot: &Shot) -> Self {
        let Shot { size, samples, lights, depth, .. } = shot;
        Self { samples: all_samples(*size, *samples), lights: lights.len(), depth: *depth }
    }

    /// Before lights are known that stand in files: one.
    pub(super) fn of_settings(settings: &Settings) -> Self {
        let Settings { size, samples, lights, depth, .. } = settings;
        let lights = if let LightChoice::Given(lights) = lights { lights.len() } else { 1 };
        Self { samples: all_samples(*size, *samples), lights, depth: *depth }
    }
}

fn all_samples(size: [u32; 2], samples: u32) -> f64 {
    size.map(f64::from).iter().product::<f64>() * f64::from(samples)
}

/// What a frame asks of a device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct DeviceWork {
    /// Bytes of parts that it is handed.
    pub(super) uploaded: u64,
    /// Triangles over which trees are built.
    pub(super) built: u64,
    /// Triangles over which trees are refitted.
    pub(super) refitted: u64,
    /// Tracing, by [`trace_work`].
    pub(super) traced: f64,
    /// Whether anything reflects or lets through.
    pub(super) is_deep: bool,
}

impl DeviceWork {
    /// What a plan asks for, and tracing.
    pub(super) fn new(plan: &UpdatePlan, frame: &Frame, rays: Rays) -> Self {
        let mut work = Self::tracing(frame, rays);
        for step in &plan.steps {
            match step {
                Step::Upload { bytes, .. } => work.uploaded += bytes,
                Step::Build { triangles, .. } => work.built += triangles,
                Step::Refit { triangles, .. } => work.refitted += triangles,
                Step::Free { .. } | Step::Evict { .. } | Step::Keep { .. } => {}
            }
        }
        work
    }

    /// Tracing alone.
    pub(super) fn tracing(frame: &Frame, rays: Rays) -> Self {
        let mut materials = frame.objects.iter().flat_map(|o| &o.geometry.materials);
        let is_deep =
            rays.depth > 0 && materials.any(|m| m.illum > 2 || m.d < 1.0 || m.textures.map_d.is_some());
        Self { traced: trace_work(rays.samples, frame.triangles(), rays.lights), is_deep, ..Self::default() }
    }

    fn trace(&self) -> Term<'static> {
        Term::Trace { is_deep: self.is_deep }
    }
}

fn stored(store: &Store, key: Key) -> Vec<u8> {
    store.get(KIND, key, Payload::rest).unwrap_or_default()
}

impl Kept {
    fn new(store: Option<&Store>, speeds: Speeds, name: &str) -> Self {
        let Machine { cpu, cores, .. } = machine();
        let mut hasher = PartHasher::new(KIND);
        for text in [name, &cpu, &cores.to_string()] {
            hasher.bytes(text.as_bytes());
        }
        let key = Key(hasher.finish().0);
        let kept = store.map(|store| stored(store, key)).unwrap_or_default();
        Self { key, estimates: Mutex::new(Estimates::new(speeds, &kept)) }
    }

    fn lock(&self) -> MutexGuard<'_, Estimates> {
        self.estimates.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What a term is expected to take, ms; then learns what it took.
    fn then(&self, term: Term<'_>, units: f64, ms: Option<f64>) -> Option<f64> {
        // what was kept from an earlier frame takes none
        let ms = ms.filter(|&ms| ms > 0.0)?;
        let mut estimates = self.lock();
        let expected = estimates.expected(term, units);
        estimates.learn(term, units, ms / 1e3);
        Some(1e3 * expected.value)
    }
}

impl Estimator {
    /// With what earlier runs left in the store.
    pub(super) fn new<'a>(store: Option<&Store>, devices: impl Iterator<Item = &'a DeviceInfo>) -> Self {
        let device = |info: &DeviceInfo| {
            let speeds = match info.kind {
                DeviceKind::Gpu => Speeds::Gpu,
                DeviceKind::Cpu | DeviceKind::Fake => Speeds::Cpu(info.threads),
            };
            // two equal devices of a machine are one kind; what it is made of tells them from others
            let name = format!("{} {} {}", info.kind.word(), info.description, info.threads);
            Kept::new(store, speeds, &name)
        };
        Self {
            host: Kept::new(store, Speeds::Host, "host"),
            devices: devices.map(device).collect(),
            host_bytes: OnceLock::new(),
        }
    }

    /// The costs of a job's frames on a device by its first picture, before that is read.
    pub(super) fn costs(&self, job: &Job, device: usize) -> Costs {
        let Some(picture) = job.pictures.first() else {
            return Costs { warm_s: 1e-3, cold_s: 0.0, fits: true };
        };
        let bytes = text_bytes(job, picture);
        let triangles = bytes / TEXT_BYTES_PER_TRIANGLE;
        let rays = Rays::of_settings(&picture.settings);
        let work = DeviceWork {
            uploaded: bytes,
            built: triangles,
            traced: trace_work(rays.samples, triangles, rays.lights),
            ..DeviceWork::default()
        };
        let [cold, warm] = self.device_s(device, &work);
        Costs { warm_s: warm.value, cold_s: cold.value, fits: true }
    }

    /// What so many units of a term of the host's will take.
    pub(super) fn host(&self, term: Term<'_>, units: f64) -> Expected {
        self.host.lock().expected(term, units)
    }

    /// Seconds of making a frame resident and of tracing it.
    pub(super) fn device_s(&self, device: usize, work: &DeviceWork) -> [Expected; 2] {
        let estimates = self.devices[device].lock();
        let of = |term, units: f64| {
            if units > 0.0 { estimates.expected(term, units) } else { Expected::default() }
        };
        let update = [
            of(Term::Upload, work.uploaded as f64),
            of(Term::Build, work.built as f64),
            of(Term::Refit, work.refitted as f64),
        ];
        [update.into_iter().sum(), of(work.trace(), work.traced)]
    }

    /// Tells what reading was expected to take, once the frame's bytes are known and how they were parsed, and learns what
    /// it took.
    pub(super) fn read(&self, report: &mut FrameReport, parsing: Term<'static>) {
        let bytes = report.bytes.read as f64;
        let is_posed = parsing == Term::Pose;
        report.predicted_ms.read = self.host.then(Term::Read, bytes, report.ms.read.filter(|_| !is_posed));
        let units = if is_posed { report.triangles as f64 } else { bytes };
        report.predicted_ms.parse = self.host.then(parsing, units, report.ms.parse);
    }

    /// The same of making a picture file and writing it.
    pub(super) fn written(&self, report: &mut FrameReport, format: &str, pixels: u64) {
        let pixels = pixels as f64;
        report.predicted_ms.encode = self.host.then(Term::Encode(format), pixels, report.ms.encode);
        report.predicted_ms.write = self.host.then(Term::Write(format), pixels, report.ms.write);
    }

    /// Tells what a device is expected to take for a frame.
    pub(super) fn begins(&self, device: usize, work: &DeviceWork, report: &mut FrameReport) {
        let estimates = self.devices[device].lock();
        let ms =
            |term, units: f64| 1e3 * if units > 0.0 { estimates.expected(term, units).value } else { 0.0 };
        let predicted = &mut report.predicted_ms;
        predicted.upload = Some(ms(Term::Upload, work.uploaded as f64));
        predicted.update = Some(ms(Term::Build, work.built as f64) + ms(Term::Refit, work.refitted as f64));
        predicted.trace = Some(ms(work.trace(), work.traced));
    }

    /// Learns what it took.
    pub(super) fn traced(&self, device: usize, work: &DeviceWork, cost: &UpdateCost, traced: &Traced) {
        let mut estimates = self.devices[device].lock();
        let mut learn = |term, units: f64, ms: f64| {
            if units > 0.0 {
                estimates.learn(term, units, ms / 1e3);
            }
        };
        if let Some(ms) = cost.upload_ms {
            learn(Term::Upload, work.uploaded as f64, ms);
        }
        learn(Term::Build, cost.built.triangles as f64, cost.built.ms);
        if cost.built.triangles == 0 {
            learn(Term::Refit, cost.refitted.triangles as f64, cost.refitted.ms);
        }
        learn(work.trace(), work.traced, traced.trace_ms);
    }

    /// Bytes that a device is expected to hold once a plan is carried out.
    pub(super) fn resident_bytes(&self, device: usize, plan: &UpdatePlan, residency: &Residency) -> u64 {
        let (mut bytes, mut trees) = (residency.bytes(), 0);
        for step in &plan.steps {
            match step {
                Step::Free { name } | Step::Evict { name } => {
                    bytes -= residency.held.get(name).map_or(0, |held| held.bytes);
                }
                Step::Upload { bytes: more, .. } => bytes += more,
                Step::Build { triangles, .. } => trees += triangles,
                Step::Keep { .. } | Step::Refit { .. } => {}
            }
        }
        bytes + self.tree_bytes(device, trees).value as u64
    }

    /// Bytes of trees over so many triangles.
    pub(super) fn tree_bytes(&self, device: usize, triangles: u64) -> Expected {
        let reckoned = triangles * TREE_BYTES_PER_TRIANGLE;
        self.devices[device].lock().expected(Term::TreeBytes, reckoned as f64)
    }

    /// Learns how large the trees are that a plan had built.
    pub(super) fn built(&self, device: usize, plan: &UpdatePlan, residency: &Residency) {
        for step in &plan.steps {
            if let Step::Build { tree, triangles, .. } = step
                && let Some(held) = residency.held.get(tree)
                && *triangles > 0
            {
                let reckoned = triangles * TREE_BYTES_PER_TRIANGLE;
                self.devices[device].lock().learn(Term::TreeBytes, reckoned as f64, held.bytes as f64);
            }
        }
    }

    /// Takes what the first frame says of the host's memory.
    pub(super) fn reckon_host(&self, bytes: impl FnOnce() -> u64) {
        self.host_bytes.get_or_init(bytes);
    }

    /// Bytes of the host's memory that the run is expected to take; None before its first frame was read.
    pub(super) fn host_bytes(&self) -> Option<u64> {
        let reckoned = *self.host_bytes.get()?;
        Some(self.host.lock().expected(Term::HostBytes, reckoned as f64).value as u64)
    }

    /// Learns what it took.
    pub(super) fn took(&self, bytes: u64) {
        if let Some(&reckoned) = self.host_bytes.get() {
            self.host.lock().learn(Term::HostBytes, reckoned as f64, bytes as f64);
        }
    }

    /// Keeps what was learned for later runs, beside what others have kept meanwhile.
    pub(super) fn save(&self, store: &Store) {
        for kept in self.devices.iter().chain([&self.host]) {
            let bytes = kept.lock().kept(&stored(store, kept.key));
            store.put(KIND, kept.key, &[&bytes]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{RayCounts, Spans, Work};
    use crate::film::{Film, LatentFilm};
    use crate::scene::AovSet;

    #[test]
    fn what_the_store_had_says_nothing_of_building() {
        let info = DeviceInfo {
            name: "cpu".to_string(),
            kind: DeviceKind::Cpu,
            description: String::new(),
            threads: 1,
            budget_bytes: 0,
        };
        let estimator = Estimator::new(None, std::iter::once(&info));
        let work = DeviceWork { built: 1_000_000, ..DeviceWork::default() };
        let traced = Traced {
            film: LatentFilm::from(Film::new([1, 1], false, AovSet::default())),
            rays: RayCounts::default(),
            trace_ms: 1.0,
            update_ms: None,
            cost_ratio: None,
            spans: Spans::default(),
        };
        let build_s = || estimator.device_s(0, &work)[0].value;
        let assumed = build_s();
        let millisecond = Work { triangles: 1_000_000, ms: 1.0 };
        estimator.traced(0, &work, &UpdateCost { restored: millisecond, ..UpdateCost::default() }, &traced);
        assert_eq!(build_s(), assumed);
        estimator.traced(0, &work, &UpdateCost { built: millisecond, ..UpdateCost::default() }, &traced);
        assert!((build_s() / 1e-3 - 1.0).abs() < 1e-9, "{}", build_s());
    }
}
