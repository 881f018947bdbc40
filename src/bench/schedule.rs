//! The workload `schedule`: rules that share frames out, simulated on made traces, and on those that the workload `estimates`
//! left in the same folder. Nothing is timed but decisions; made
//! traces are the same on every machine.

use super::chart::{Chart, Line, Panel};
use super::table::{Cell, Table};
use super::{Bench, BenchError, Event, Findings, REPORTS, recorded};
use crate::clock::Stopwatch;
use crate::schedule::simulation::{Contender, Family, Outcome, Trace, load, simulate};
use crate::schedule::{Costs, DeviceFacts, NewJob, Policy, Scheduler, Weights};

/// Traces of each kind.
const SEEDS: usize = 32;
/// Jobs at once on sixteen devices, and jobs at once on how many.
const LOADS: [usize; 7] = [4, 8, 16, 32, 64, 128, 256];
const LOADED: usize = 16;
const SIZES: [(usize, usize); 6] = [(1, 1), (40, 4), (8, 16), (400, 64), (64, 400), (1000, 100)];
const LARGEST: (usize, usize) = (10_000, 1000);
/// Multiples of a cold start in a job's key; the default is among them.
const PHIS: [f64; 9] = [0.0, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0];
/// Multiples of what others lose by another copy.
const PRICES: [f64; 7] = [0.5, 1.0, 2.0, 4.0, 8.0, 32.0, 1024.0];

/// Runs it.
pub(super) fn schedule(bench: &Bench, on_event: &mut dyn FnMut(&Event<'_>)) -> Result<Findings, BenchError> {
    let mut findings = Findings::default();
    let seeds = bench.rounds(SEEDS) as u64;
    if ["makespan", "slowdown", "starts", "affinity"].iter().any(|table| bench.wants(table)) {
        on_event(&Event::Stage("families of traces"));
        for table in families(bench, seeds) {
            if bench.wants(table.name) {
                findings.add(table, on_event);
            }
        }
    }
    if bench.wants("load") {
        on_event(&Event::Stage("makespan over load"));
        findings.add(sizes(bench), on_event);
        findings.draw(&over_load(seeds.min(8)))?;
    }
    if bench.wants("weights") {
        on_event(&Event::Stage("weights"));
        let (table, chart) = weights(seeds.min(16));
        findings.add(table, on_event);
        findings.draw(&chart)?;
    }
    if bench.wants("decisions") {
        on_event(&Event::Stage("decisions"));
        findings.add(decisions(bench), on_event);
    }
    Ok(findings)
}

/// The means over traces.
struct Means(Vec<Outcome>);

impl Means {
    fn of(traces: &[Trace], contender: Contender) -> Self {
        Self(traces.iter().map(|trace| simulate(trace, contender)).collect())
    }

    fn mean(&self, of: impl Fn(&Outcome) -> f64) -> f64 {
        self.0.iter().map(of).sum::<f64>() / self.0.len().max(1) as f64
    }

    fn greatest(&self, of: impl Fn(&Outcome) -> f64) -> f64 {
        self.0.iter().map(of).fold(0.0, f64::max)
    }
}

fn makespan(outcome: &Outcome) -> f64 {
    outcome.makespan
}

fn slowdown_95(outcome: &Outcome) -> f64 {
    outcome.slowdown[1]
}

/// A row for each family, a column for each rule.
fn families(bench: &Bench, seeds: u64) -> [Table; 4] {
    let names = Contender::all().map(Contender::name);
    let columns: Vec<&str> = names.iter().copied().chain(["affinity/best other"]).collect();
    let mut makespans = Table::new(
        "makespan",
        "When the last frame is traced over a bound that no rule can beat; means of traces of each family.",
        &columns,
    );
    let mut slowdowns = Table::new(
        "slowdown",
        "Slowdown, a job's time from coming to its last frame over what it takes with all devices for itself: 95th percentile.",
        &columns,
    );
    let mut starts = Table::new("starts", "Cold starts for each job.", &names);
    let columns = [
        "makespan",
        "worst",
        "slowdown",
        "95 %",
        "99 %",
        "latency, s",
        "95 %",
        "99 %",
        "cold/job",
        "cold share",
        "GB moved",
        "Jain",
        "wait, s",
        "evictions",
        "over budget",
        "missed",
    ];
    let mut affinity = Table::new(
        "affinity",
        "Affinity: makespan over the bound (mean, worst trace), slowdown and latency (mean, 95th, 99th percentile), cold starts for each job and as a share of busy time, Jain's index of speed beside alone, the longest wait for a first frame, scenes made resident again after they were evicted, devices over budget, the share of deadlines missed.",
        &columns,
    );
    let made = |family: Family| (family.name(), (0..seeds).map(|seed| family.trace(seed)).collect());
    let mut all: Vec<(&str, Vec<Trace>)> = Family::ALL.into_iter().map(made).collect();
    let recorded = recorded::traces(&bench.options.folder.join(REPORTS), seeds as usize);
    if !recorded.is_empty() {
        all.push(("recorded", recorded));
    }
    for (name, traces) in all {
        let means = Contender::all().map(|contender| Means::of(&traces, contender));
        let row = |of: fn(&Outcome) -> f64| means.each_ref().map(|m| m.mean(of));
        let beside = |values: [f64; 8]| {
            let [others @ .., own] = values;
            let best = others.into_iter().fold(f64::INFINITY, f64::min);
            values.into_iter().chain([own / best]).map(Cell::from).collect::<Vec<_>>()
        };
        makespans.rows.push((name.to_string(), beside(row(makespan))));
        slowdowns.rows.push((name.to_string(), beside(row(slowdown_95))));
        starts.row(name, row(|o| o.cold_starts).map(Cell::from));
        let [.., own] = &means;
        let cells = [
            own.mean(makespan),
            own.greatest(makespan),
            own.mean(|o| o.slowdown[0]),
            own.mean(slowdown_95),
            own.mean(|o| o.slowdown[2]),
            own.mean(|o| o.latency_s[0]),
            own.mean(|o| o.latency_s[1]),
            own.mean(|o| o.latency_s[2]),
            own.mean(|o| o.cold_starts),
            own.mean(|o| o.cold_share),
            own.mean(|o| o.bytes_moved) / 1e9,
            own.mean(|o| o.fairness),
            own.mean(|o| o.longest_wait_s),
            own.mean(|o| o.evictions),
            own.greatest(|o| o.over_budget),
            own.mean(|o| o.missed),
        ];
        affinity.row(name, cells.map(Cell::from));
    }
    [makespans, slowdowns, starts, affinity]
}

/// From one job on one device to 10,000 on 1,000.
fn sizes(bench: &Bench) -> Table {
    let columns = [
        "makespan",
        "best other",
        "slowdown 95 %",
        "best other",
        "cold/job",
        "that other",
        "longest wait, s",
    ];
    let mut table = Table::new(
        "load",
        "Mixed jobs, all at once, on equal devices: affinity beside the best of the others in each.",
        &columns,
    );
    let sizes = SIZES.into_iter().chain((!bench.options.quick).then_some(LARGEST));
    for (jobs, devices) in sizes {
        let seeds = if jobs < 1000 { bench.rounds(8) as u64 } else { 1 };
        let traces: Vec<Trace> = (0..seeds).map(|seed| load(jobs, devices, seed)).collect();
        // of the largest only those that are near elsewhere: the rest would trace for hours, and say nothing new
        let is_near =
            |c: &Contender| jobs < 10_000 || matches!(c, Contender::Donation | Contender::StealingShortest);
        let [others @ .., own] = Contender::all();
        let others: Vec<Means> = others.into_iter().filter(is_near).map(|c| Means::of(&traces, c)).collect();
        let own = Means::of(&traces, own);
        let best = |of: fn(&Outcome) -> f64| others.iter().map(|m| m.mean(of)).fold(f64::INFINITY, f64::min);
        let fewest = best(|o| o.cold_starts);
        let cells = [
            own.mean(makespan),
            best(makespan),
            own.mean(slowdown_95),
            best(slowdown_95),
            own.mean(|o| o.cold_starts),
            fewest,
            own.mean(|o| o.longest_wait_s),
        ];
        table.row(format!("{jobs} jobs, {devices} devices"), cells.map(Cell::from));
    }
    table
}

/// Makespan and slowdown by rule, over the number of jobs.
fn over_load(seeds: u64) -> Chart {
    let [rules @ .., last] = Contender::all();
    // the product's is drawn first, in the first colour
    let rules: Vec<Contender> = [last].into_iter().chain(rules).collect();
    let mut lines = [(); 2].map(|()| {
        rules
            .iter()
            .map(|rule| Line { name: rule.name().to_string(), points: Vec::new() })
            .collect::<Vec<_>>()
    });
    for jobs in LOADS {
        let traces: Vec<Trace> = (0..seeds).map(|seed| load(jobs, LOADED, seed)).collect();
        for (i, &rule) in rules.iter().enumerate() {
            let means = Means::of(&traces, rule);
            lines[0][i].points.push((jobs as f64, means.mean(makespan)));
            lines[1][i].points.push((jobs as f64, means.mean(slowdown_95)));
        }
    }
    let [makespans, slowdowns] = lines;
    let panel = |y: &str, lines| Panel {
        x: format!("jobs, all at once, on {LOADED} equal devices"),
        is_log_x: true,
        y: y.to_string(),
        is_log: true,
        lines,
    };
    Chart {
        name: "schedule-load".to_string(),
        title: "Makespan and slowdown over load".to_string(),
        panels: vec![
            panel("makespan over the bound", makespans),
            panel("slowdown, 95th percentile", slowdowns),
        ],
    }
}

/// Affinity against balance: φ, how often a cold start counts in a job's key, and beside it γ, the price of another copy.
fn weights(seeds: u64) -> (Table, Chart) {
    const FAMILIES: [Family; 4] = [Family::Mixed, Family::ManyShort, Family::Unequal, Family::FewLong];
    let traces = FAMILIES.map(|family| (0..seeds).map(|seed| family.trace(seed)).collect::<Vec<_>>());
    let columns: Vec<String> = FAMILIES
        .iter()
        .flat_map(|f| [format!("{}: makespan", f.name()), "slowdown 95 %".to_string()])
        .collect();
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    let mut table = Table::new(
        "weights",
        "Affinity with its weights varied, one at a time: φ, how often a cold start counts in a job's key (default 1), and γ, how often what all lose by another copy counts beside what one job gains by it (default 8).",
        &columns,
    );
    let mut lines =
        [(); 2].map(|()| FAMILIES.map(|f| Line { name: f.name().to_string(), points: Vec::new() }));
    let usual = Weights::default();
    let phis = PHIS.map(|phi| (format!("φ = {phi}"), Some(phi), Weights { phi, ..usual }));
    let prices = PRICES.map(|price| (format!("γ = {price}"), None, Weights { price, ..usual }));
    for (name, phi, weights) in phis.into_iter().chain(prices) {
        let mut cells = Vec::new();
        for (i, traces) in traces.iter().enumerate() {
            let means = Means::of(traces, Contender::Affinity(weights));
            let found = [means.mean(makespan), means.mean(slowdown_95)];
            cells.extend(found.map(Cell::from));
            if let Some(phi) = phi {
                for (lines, y) in lines.iter_mut().zip(found) {
                    // 0 has no place on a logarithmic axis
                    lines[i].points.push((phi.max(PHIS[1] / 2.0), y));
                }
            }
        }
        table.rows.push((name, cells));
    }
    let [makespans, slowdowns] = lines.map(Vec::from);
    let panel = |y: &str, is_log, lines| Panel {
        x: "how often a cold start counts in a job's key: φ (leftmost: 0)".to_string(),
        is_log_x: true,
        y: y.to_string(),
        is_log,
        lines,
    };
    let panels = vec![
        panel("makespan over the bound", false, makespans),
        panel("slowdown, 95th percentile", true, slowdowns),
    ];
    let title = "Affinity against balance".to_string();
    (table, Chart { name: "schedule-weights".to_string(), title, panels })
}

/// How fast the scheduler decides: leases that were given, each with the reports of its frames.
fn decisions(bench: &Bench) -> Table {
    let mut table = Table::new(
        "decisions",
        "Decisions a second, on one thread: a run of frames leased, made resident and reported.",
        &["decisions/s", "frames", "µs each"],
    );
    for (jobs, devices) in [(100, 4), (1000, 100), LARGEST] {
        let most = if bench.options.quick { 50_000 } else { 500_000 };
        let (leases, frames, seconds) = drive(&load(jobs, devices, 0), most);
        let cells = [leases / seconds, frames, seconds / leases * 1e6];
        table.row(format!("{jobs} jobs, {devices} devices"), cells.map(Cell::from));
    }
    table
}

/// Devices ask and report in turn, at most so often; gives leases, frames and seconds.
fn drive(trace: &Trace, most: usize) -> (f64, f64, f64) {
    let facts = DeviceFacts { budget_bytes: u64::MAX, kind: 0 };
    let clock = Stopwatch::start();
    let mut scheduler = Scheduler::new(Policy::Affinity, &vec![facts; trace.devices.len()]);
    for job in &trace.jobs {
        let costs = vec![Costs { warm_s: job.warm_s, cold_s: job.cold_s, fits: true }];
        let new = NewJob { frames: job.frames, grows: false, priority: 0, costs, bytes: job.bytes };
        // a budget without bound holds all
        let _ = scheduler.add(0.0, &new);
    }
    let (mut now_s, mut leases, mut frames) = (0.0, 0, 0_u64);
    while leases < most && !scheduler.is_idle() {
        for device in 0..trace.devices.len() {
            let Some(lease) = scheduler.lease(now_s, device) else { continue };
            leases += 1;
            scheduler.holds(device, lease.job, true);
            let warm_s = trace.jobs[lease.job.0].warm_s;
            for frame in lease.frames {
                frames += 1;
                scheduler.done(device, lease.job, frame, warm_s);
            }
        }
        now_s += 0.1;
    }
    (leases.max(1) as f64, frames as f64, clock.s())
}
