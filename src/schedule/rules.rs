//! The rules as formulas: seconds and frames in, yes or no out.

/// What the rules weigh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Affinity against balance: how many times a cold start counts in a job's key; φ. At 1 jobs stand in the order of
    /// what they take alone.
    pub phi: f64,
    /// How many times what all jobs lose by another copy counts beside what one gains by it; γ. At 1 the sum of all
    /// slowdowns is least, were the loss spread evenly; greater, fewer copies are made and the last job ends sooner.
    pub price: f64,
    /// How long a run of frames takes, at most, in seconds.
    pub batch_s: f64,
}

impl Default for Weights {
    fn default() -> Self {
        Self { phi: 1.0, price: 8.0, batch_s: 0.1 }
    }
}

/// What a device would join.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Served {
    /// Frames not yet traced.
    pub(super) frames: f64,
    /// Frames a second of those who serve it.
    pub(super) rate: f64,
    /// Frames that those who are still making it resident will not trace in that time.
    pub(super) debt: f64,
    /// Seconds that the slowest of them takes for a frame.
    pub(super) slowest_s: f64,
}

impl Served {
    /// Seconds until the last frame is traced by those who serve it.
    pub(super) fn ends_s(&self) -> f64 {
        (self.frames + self.debt) / self.rate
    }

    /// The same with one more device, which traces its first frame after `cold_s + warm_s`: all end together when
    /// `rate * T - debt + (T - cold_s) / warm_s = frames`.
    pub(super) fn joined_s(&self, warm_s: f64, cold_s: f64) -> f64 {
        (self.frames + self.debt + cold_s / warm_s) / (self.rate + 1.0 / warm_s)
    }

    /// End test: a device that would finish its first frame after the others have finished all of them does not help.
    pub(super) fn ends_too_soon(&self, warm_s: f64, cold_s: f64) -> bool {
        cold_s + warm_s > self.ends_s() + self.slowest_s
    }

    /// Join test: the seconds by which a job ends sooner with one more device; below 0 where that would be later.
    pub(super) fn gains_s(&self, warm_s: f64, cold_s: f64) -> f64 {
        self.ends_s() - self.joined_s(warm_s, cold_s)
    }
}

/// How many frames a device takes at once: as many as fill a batch, at most half of its share of what is open, so that
/// devices of any speed end together.
pub(super) fn run_length(open: u64, warm_s: f64, rate: f64, batch_s: f64) -> u64 {
    let share = 1.0 / (warm_s * rate);
    let most = (batch_s / warm_s).min(open as f64 * share / 2.0);
    (most as u64).clamp(1, open.max(1))
}

/// Seconds that a job takes where it has all devices for itself: each starts cold and all end together. `devices` are
/// `(how many, warm_s, cold_s)`. Solves the sum of n·max(0, T - cold)/warm = frames.
pub(super) fn alone_s(frames: u64, devices: &mut [(usize, f64, f64)]) -> f64 {
    devices.sort_by(|a, b| a.2.total_cmp(&b.2));
    let (mut rate, mut lost) = (0.0, 0.0);
    let mut ends_s = f64::INFINITY;
    for &(count, warm_s, cold_s) in devices.iter().filter(|d| d.0 > 0) {
        if cold_s >= ends_s {
            break;
        }
        rate += count as f64 / warm_s;
        lost += count as f64 * cold_s / warm_s;
        ends_s = (frames as f64 + lost) / rate;
    }
    ends_s
}
