//! An event simulation of made traces, to compare rules by: deterministic by seed, with a bound that none can beat.

mod bound;
mod queues;
mod random;
mod rule;
#[cfg(test)]
mod tests;
mod trace;
mod world;

pub use bound::{alone_s, bound_s};
pub use trace::{Family, Trace, TraceDevice, TraceJob, load};

use super::{Policy, Weights};
use queues::{Balance, Deal, GlobalQueue, LocalQueues};
use rule::{Product, Rule};

/// What is compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Contender {
    /// Oldest frame first to any free device, frame by frame.
    GlobalFifo,
    /// Frames dealt to the devices' queues in turn: the thesis's first.
    RoundRobin,
    /// Each job in parts by the devices' speeds.
    StaticPartition,
    /// Whole jobs to local queues; who sees an idle device gives it half of its queue: the thesis's choice.
    Donation,
    /// Whole jobs to local queues; an idle device takes half of the longest.
    Stealing,
    /// The same, and in each queue the shortest job first.
    StealingShortest,
    /// The product's, oldest job first.
    Fifo,
    /// The product's.
    Affinity(Weights),
}

impl Contender {
    /// All of them; the product's affinity is the last.
    pub fn all() -> [Self; 8] {
        [
            Self::GlobalFifo,
            Self::RoundRobin,
            Self::StaticPartition,
            Self::Donation,
            Self::Stealing,
            Self::StealingShortest,
            Self::Fifo,
            Self::Affinity(Weights::default()),
        ]
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::GlobalFifo => "global fifo",
            Self::RoundRobin => "round robin",
            Self::StaticPartition => "static partition",
            Self::Donation => "donation",
            Self::Stealing => "stealing",
            Self::StealingShortest => "stealing, shortest first",
            Self::Fifo => "fifo",
            Self::Affinity(_) => "affinity",
        }
    }

    fn rule(self, trace: &Trace) -> Box<dyn Rule> {
        let queues = |deal, balance, shortest| -> Box<dyn Rule> {
            Box::new(LocalQueues::new(trace, deal, balance, shortest))
        };
        match self {
            Self::GlobalFifo => Box::new(GlobalQueue::new(trace)),
            Self::RoundRobin => queues(Deal::Alternately, Balance::Never, false),
            Self::StaticPartition => queues(Deal::Parts, Balance::Never, false),
            Self::Donation => queues(Deal::Whole, Balance::Donate, false),
            Self::Stealing => queues(Deal::Whole, Balance::Steal, false),
            Self::StealingShortest => queues(Deal::Whole, Balance::Steal, true),
            Self::Fifo => Box::new(Product::new(trace, Policy::Fifo, Weights::default())),
            Self::Affinity(weights) => Box::new(Product::new(trace, Policy::Affinity, weights)),
        }
    }
}

/// What a rule did with a trace.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// When the last frame was traced, over [`bound_s`].
    pub makespan: f64,
    /// Seconds from when a job comes to its last frame: mean, 95th and 99th percentile.
    pub latency_s: [f64; 3],
    /// The same over what the job takes with all devices for itself.
    pub slowdown: [f64; 3],
    /// Cold starts for each job.
    pub cold_starts: f64,
    /// The share of the devices' busy time that was spent in them.
    pub cold_share: f64,
    /// Bytes made resident.
    pub bytes_moved: f64,
    /// Jain's index of alone/latency over jobs: 1 where all were slowed down alike (Jain, Chiu and Hawe 1984).
    pub fairness: f64,
    /// The longest that a job waited for its first frame to begin, in seconds.
    pub longest_wait_s: f64,
    /// Scenes made resident again after they were evicted.
    pub evictions: f64,
    /// Times that a device held more than it may.
    pub over_budget: f64,
    /// The share of deadlines that were missed.
    pub missed: f64,
    /// Runs given out.
    pub leases: f64,
    /// Decisions: times that an idle device asked, in vain too.
    pub decisions: f64,
    /// Jobs that never ended, and frames traced beyond those that there are.
    pub wrong: f64,
}

/// Runs a trace by a rule.
pub fn simulate(trace: &Trace, contender: Contender) -> Outcome {
    let mut rule = contender.rule(trace);
    let happened = world::simulate(trace, &mut *rule);
    let alone: Vec<f64> = trace.jobs.iter().map(|job| alone_s(job, &trace.devices)).collect();
    let by_job = || trace.jobs.iter().zip(&happened.ends_s).zip(&alone);
    let latency: Vec<f64> = by_job().map(|((job, end), _)| end - job.arrives_s).collect();
    let slowdown: Vec<f64> = by_job().map(|((job, end), alone)| (end - job.arrives_s) / alone).collect();
    let waits = trace.jobs.iter().zip(&happened.begins_s).map(|(job, begin)| begin - job.arrives_s);
    let wanted = by_job().filter(|((job, _), _)| job.deadline_s.is_some()).count();
    let missed = by_job().filter(|((job, end), _)| job.deadline_s.is_some_and(|d| **end > job.arrives_s + d));
    let service: Vec<f64> = slowdown.iter().map(|s| 1.0 / s).collect();
    let (sum, squares) = (service.iter().sum::<f64>(), service.iter().map(|x| x * x).sum::<f64>());
    let count = trace.jobs.len().max(1) as f64;
    Outcome {
        makespan: happened.ends_s.iter().copied().fold(0.0, f64::max) / bound_s(trace),
        cold_starts: happened.cold_starts as f64 / count,
        cold_share: happened.cold_s / happened.busy_s.max(1e-12),
        bytes_moved: happened.bytes_moved as f64,
        fairness: sum * sum / (count * squares).max(1e-300),
        longest_wait_s: waits.fold(0.0, f64::max),
        evictions: happened.evictions as f64,
        over_budget: happened.over_budget as f64,
        missed: missed.count() as f64 / wanted.max(1) as f64,
        leases: happened.leases as f64,
        decisions: happened.asked as f64,
        wrong: happened.twice as f64 + happened.ends_s.iter().filter(|e| e.is_infinite()).count() as f64,
        latency_s: mean_and_tail(latency),
        slowdown: mean_and_tail(slowdown),
    }
}

/// Mean, 95th and 99th percentile (the least value that so many are not greater than).
fn mean_and_tail(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values.get((values.len() as f64 * share).ceil() as usize - 1).copied();
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    [mean, at(0.95).unwrap_or(0.0), at(0.99).unwrap_or(0.0)]
}
