//! What no policy can beat.

use super::trace::{Trace, TraceDevice, TraceJob};

/// Seconds that a job takes at least with all devices for itself, as they are while nothing fails: the least T with
/// Σ over devices of ⌊(T - cold) / warm⌋ ≥ frames, since a device traces nothing before its cold start is over, and a
/// frame is traced whole by one device.
pub fn alone_s(job: &TraceJob, devices: &[TraceDevice]) -> f64 {
    let fitting: Vec<_> = devices.iter().filter(|d| job.bytes <= d.budget_bytes).collect();
    let traced = |t_s: f64| -> f64 {
        let of =
            |d: &&TraceDevice| ((t_s - job.cold_s * d.cold_factor()) * d.speed / job.warm_s + 1e-9).floor();
        fitting.iter().map(of).map(|n| n.max(0.0)).sum()
    };
    let slowest = |d: &&TraceDevice| job.cold_s * d.cold_factor() + job.frames as f64 * job.warm_s / d.speed;
    let (mut low, mut high) = (0.0, fitting.iter().map(slowest).fold(f64::INFINITY, f64::min) + 1e-9);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if traced(middle) >= job.frames as f64 { high = middle } else { low = middle }
    }
    high
}

/// Seconds before which the last frame of a trace cannot be traced. The greatest of these, each of which is true of any
/// schedule:
///
/// - *A job*: it comes, and takes no less than alone.
/// - *Work*: take the jobs that come at `a` or later and have more than `b` bytes. Only devices whose budgets are greater
///   serve them, and not before `a`. In seconds of speed 1 every frame takes `warm` wherever it is traced, and every job
///   is made resident at least once, somewhere: that takes `cold · cold_factor · speed` of them there. A device does `speed`
///   such seconds a second until it fails, fewer after it has slowed down. Let cold starts be divided among devices as
///   finely as one likes, which only helps: then least work is spent in them where the devices of the least
///   `cold_factor · speed` do as many as they have time for (otherwise two devices could exchange cold starts for frames
///   and both gain). What all can do besides, up to T, is no less than the frames.
/// - *First starts*: as before, but cold starts count by devices: one that traces at all spends, before its first frame,
///   at least the shortest cold start of those jobs there; this is what binds where there are fewer jobs than devices.
pub fn bound_s(trace: &Trace) -> f64 {
    let alone = trace.jobs.iter().map(|job| job.arrives_s + alone_s(job, &trace.devices)).fold(0.0, f64::max);
    let mut arrivals: Vec<f64> = trace.jobs.iter().map(|j| j.arrives_s).collect();
    let mut bytes: Vec<u64> = trace.devices.iter().map(|d| d.budget_bytes).chain([0]).collect();
    arrivals.sort_by(f64::total_cmp);
    arrivals.dedup();
    bytes.sort_unstable();
    bytes.dedup();
    let mut greatest = alone;
    for &more_than in &bytes {
        for &from_s in &arrivals {
            let jobs = trace.jobs.iter().filter(|j| j.arrives_s >= from_s && j.bytes > more_than);
            let devices = trace.devices.iter().filter(|d| d.budget_bytes > more_than);
            greatest = greatest.max(of_some(&jobs.collect::<Vec<_>>(), &devices.collect::<Vec<_>>(), from_s));
        }
    }
    greatest
}

fn of_some(jobs: &[&TraceJob], devices: &[&TraceDevice], from_s: f64) -> f64 {
    if jobs.is_empty() || devices.is_empty() {
        return 0.0;
    }
    let frames: f64 = jobs.iter().map(|j| j.frames as f64 * j.warm_s).sum();
    let start = |d: &TraceDevice| d.cold_factor() * d.speed;
    let starts: f64 = jobs.iter().map(|j| j.cold_s).sum();
    let mut devices = devices.to_vec();
    devices.sort_by(|a, b| start(a).total_cmp(&start(b)));
    let shortest = jobs.iter().map(|j| j.cold_s).fold(f64::INFINITY, f64::min);
    let work = |t_s: f64| {
        let (mut to_start, mut traced) = (starts, 0.0);
        for device in &devices {
            let done = done(device, from_s, t_s);
            let started = to_start.min(done / start(device));
            to_start -= started;
            traced += done - started * start(device);
        }
        to_start <= 1e-9 && traced >= frames
    };
    let first = |t_s: f64| {
        let traced = |d: &&&TraceDevice| (done(d, from_s, t_s) - shortest * start(d)).max(0.0);
        devices.iter().map(|d| traced(&d)).sum::<f64>() >= frames
    };
    let by_work = least(from_s, work);
    by_work.max(least(from_s, first))
}

/// Seconds of speed 1 that a device does between two moments.
fn done(device: &TraceDevice, from_s: f64, to_s: f64) -> f64 {
    let to_s = device.fails_s.map_or(to_s, |fails_s| to_s.min(fails_s));
    let whole = (to_s - from_s).max(0.0);
    let lost = device
        .slows
        .map_or(0.0, |(slows_s, factor)| (to_s - slows_s.max(from_s)).max(0.0) * (1.0 - 1.0 / factor));
    (whole - lost) * device.speed
}

/// The least T of which something is true that stays true.
fn least(from_s: f64, is_enough: impl Fn(f64) -> bool) -> f64 {
    let mut length = 1.0;
    while !is_enough(from_s + length) && length < 1e12 {
        length *= 2.0;
    }
    let (mut low, mut high) = (from_s, from_s + length);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if is_enough(middle) { high = middle } else { low = middle }
    }
    low
}
