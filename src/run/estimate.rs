//! What frames should take on a device before the first of them was traced: counts, bytes and the kind of device. From then on
//! what was measured counts.

use super::memory::expected_bytes;
use crate::device::{DeviceInfo, DeviceKind};
use crate::job::Job;
use crate::schedule::Costs;

/// Samples a second with their shadow rays, of a thread of a CPU and of a GPU, and seconds for each byte that a first frame's
/// reading takes to be made resident: orders of magnitude.
const SAMPLES_PER_S_THREAD: f64 = 5e6;
const SAMPLES_PER_S_GPU: f64 = 1e9;
const START_S_PER_BYTE: f64 = 1e-9;
/// Opening kernels and the like.
const START_S_GPU: f64 = 0.05;

/// The costs of a job's frames on a device, by its first picture.
pub(super) fn estimate(job: &Job, device: &DeviceInfo) -> Costs {
    let Some(picture) = job.pictures.first() else { return Costs { warm_s: 1e-3, cold_s: 0.0, fits: true } };
    let settings = &picture.settings;
    let samples = settings.size.iter().map(|&n| f64::from(n)).product::<f64>() * f64::from(settings.samples);
    let (rate, start_s) = match device.kind {
        DeviceKind::Gpu => (SAMPLES_PER_S_GPU, START_S_GPU),
        DeviceKind::Cpu | DeviceKind::Fake => (SAMPLES_PER_S_THREAD * device.threads.max(1) as f64, 0.0),
    };
    let cold_s = start_s + START_S_PER_BYTE * expected_bytes(job, picture) as f64;
    Costs { warm_s: samples / rate, cold_s, fits: true }
}
