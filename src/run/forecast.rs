//! What a sequence will cost, told before anything is rendered.

use super::estimate::{DeviceWork, Estimator, Rays};
use super::memory::{part_bytes, text_bytes};
use crate::device::DeviceInfo;
use crate::diff::Change;
use crate::job::{Job, Picture};
use crate::scene::Frame;
use crate::schedule::estimate::{Expected, Term};
use crate::store::Store;

/// What frames of a sequence are expected to cost on a device: seconds and bytes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Forecast {
    /// Reading a file.
    pub read: Expected,
    /// Parsing it.
    pub parse: Expected,
    /// Making the first frame resident.
    pub load: Expected,
    /// Making another one resident.
    pub update: Expected,
    /// Tracing.
    pub trace: Expected,
    /// Making the picture file.
    pub encode: Expected,
    /// Writing it.
    pub write: Expected,
    /// What the device holds.
    pub resident: Expected,
}

impl Forecast {
    /// The device's part of a warm frame.
    pub fn warm(&self) -> Expected {
        [self.update, self.trace].into_iter().sum()
    }

    /// All of the first frame.
    pub fn cold(&self) -> Expected {
        [self.read, self.parse, self.load, self.trace, self.encode, self.write].into_iter().sum()
    }
}

/// What the frames of a picture's sequence are expected to cost on each of some devices, by one of them and what changes from
/// each to the next.
pub fn forecast(
    job: &Job,
    picture: &Picture,
    frame: &Frame,
    change: &Change,
    store: Option<&Store>,
    devices: &[DeviceInfo],
) -> Vec<Forecast> {
    let estimator = Estimator::new(store, devices.iter());
    let triangles = frame.triangles();
    let tracing = DeviceWork::tracing(frame, Rays::of_settings(&picture.settings));
    let parts = part_bytes(frame);
    let first = DeviceWork { uploaded: parts, built: triangles, ..tracing };
    let is_built = change.reshaped + change.added > 0;
    let is_moved = change.deformed > 0;
    let positions = || frame.objects.iter().map(|o| size_of_val(&*o.geometry.positions.0) as u64).sum();
    let next = DeviceWork {
        uploaded: if is_built {
            parts
        } else if is_moved {
            positions()
        } else {
            0
        },
        built: if is_built { triangles } else { 0 },
        refitted: if is_moved && !is_built { triangles } else { 0 },
        ..tracing
    };
    let layers = &job.sequences[picture.sequence].layers;
    let is_posed = picture
        .sources
        .iter()
        .any(|s| s.file.is_some_and(|file| layers[s.layer].files[file].moment.is_some()));
    let text = text_bytes(job, picture) as f64;
    let format = picture.settings.format.as_str();
    let pixels = picture.settings.size.map(f64::from).iter().product::<f64>();
    let of_device = |device: usize| {
        let [load, trace] = estimator.device_s(device, &first);
        let [update, _] = estimator.device_s(device, &next);
        let trees = estimator.tree_bytes(device, triangles);
        Forecast {
            read: if is_posed { Expected::default() } else { estimator.host(Term::Read, text) },
            parse: if is_posed {
                estimator.host(Term::Pose, triangles as f64)
            } else {
                estimator.host(Term::Parse, text)
            },
            load,
            update,
            trace,
            encode: estimator.host(Term::Encode(format), pixels),
            write: estimator.host(Term::Write(format), pixels),
            resident: Expected { value: trees.value + parts as f64, error: trees.error },
        }
    };
    (0..devices.len()).map(of_device).collect()
}
