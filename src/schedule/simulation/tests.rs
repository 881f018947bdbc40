//! The bound on paper, and what is claimed of the rules.

use super::*;

fn device(speed: f64) -> TraceDevice {
    TraceDevice { speed, budget_bytes: 100, slows: None, fails_s: None }
}

fn job(arrives_s: f64, frames: u64, warm_s: f64, cold_s: f64) -> TraceJob {
    TraceJob { arrives_s, frames, warm_s, cold_s, bytes: 50, seen: [1.0; 2], deadline_s: None }
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-6
}

#[test]
fn alone_a_job_takes_whole_frames_on_devices_that_start_cold() {
    // two devices of speed 1: 1 s, then 3 frames on one and 2 on the other
    assert!(close(alone_s(&job(0.0, 5, 1.0, 1.0), &[device(1.0), device(1.0)]), 4.0));
    // one of speed 0.5 is ready after 1.5 s and traces its frame up to 3.5: 3 + 1 frames up to 4
    assert!(close(alone_s(&job(0.0, 4, 1.0, 1.0), &[device(1.0), device(0.5)]), 4.0));
    // a cold start of 10 s helps nobody
    assert!(close(alone_s(&job(0.0, 1, 1.0, 10.0), &[device(1.0), device(1.0)]), 11.0));
}

#[test]
fn the_bound_counts_work_starts_and_what_devices_can_do() {
    let bound = |jobs: &[TraceJob], devices: &[TraceDevice]| {
        bound_s(&Trace { jobs: jobs.to_vec(), devices: devices.to_vec() })
    };
    let equal = [device(1.0), device(1.0)];
    // two jobs of 10 frames of 1 s and 2 s of cold start on two devices: (20 + 4) / 2
    assert!(close(bound(&[job(0.0, 10, 1.0, 2.0), job(0.0, 10, 1.0, 2.0)], &equal), 12.0));
    // what comes at 100 s ends 7 s later: 2 + 10 / 2
    assert!(close(bound(&[job(0.0, 10, 1.0, 2.0), job(100.0, 10, 1.0, 2.0)], &equal), 107.0));
    // one fails after 5 s: 5 + 12 are needed of the 24, the other does them in 19
    let failing = [device(1.0), TraceDevice { fails_s: Some(5.0), ..device(1.0) }];
    assert!(close(bound(&[job(0.0, 10, 1.0, 2.0), job(0.0, 10, 1.0, 2.0)], &failing), 19.0));
    // large scenes fit one device: its work alone
    let small = [device(1.0), TraceDevice { budget_bytes: 10, ..device(1.0) }];
    assert!(close(bound(&[job(0.0, 10, 1.0, 2.0), job(0.0, 10, 1.0, 2.0)], &small), 24.0));
}

#[test]
fn a_trace_runs_alike_each_time_and_no_rule_breaks_it() {
    for family in Family::ALL {
        let trace = family.trace(3);
        assert_eq!(trace, family.trace(3));
        for contender in Contender::all() {
            let outcome = simulate(&trace, contender);
            assert_eq!(outcome, simulate(&trace, contender));
            assert_eq!(
                (outcome.wrong, outcome.over_budget),
                (0.0, 0.0),
                "{} {}",
                family.name(),
                contender.name()
            );
            assert!(outcome.makespan >= 1.0 - 1e-9, "{} {}", family.name(), contender.name());
        }
    }
}

/// What is claimed of affinity, over the means of sixteen traces of each family: the last frame at most 1.08 times as late
/// as the bound and 1.05 as by the best of the others; the 95th percentile of slowdown no more than 1.05 times theirs, and
/// on mixed traces 0.8. Where each small job pushes the giant out, nobody has both: what ends soonest lets them wait for its
/// end.
#[test]
fn affinity_ends_near_the_bound_and_keeps_slowdown_low() {
    let seeds = 0..16;
    for family in Family::ALL {
        let traces: Vec<Trace> = seeds.clone().map(|seed| family.trace(seed)).collect();
        let means = Contender::all().map(|contender| {
            let outcomes: Vec<Outcome> = traces.iter().map(|trace| simulate(trace, contender)).collect();
            let mean = |of: fn(&Outcome) -> f64| outcomes.iter().map(of).sum::<f64>() / outcomes.len() as f64;
            [mean(|o| o.makespan), mean(|o| o.slowdown[1])]
        });
        let [others @ .., affinity] = means;
        let best = |i: usize| others.iter().map(|m| m[i]).fold(f64::INFINITY, f64::min);
        let name = family.name();
        let [latest, slowest] = match family {
            Family::GiantAlone => [1.3, 0.5 * best(1)],
            Family::FewLong => [(1.05 * best(0)).min(1.08), 1.05 * best(1)],
            _ => [(1.05 * best(0)).min(1.08), 0.8 * best(1)],
        };
        assert!(affinity[0] <= latest && affinity[1] <= slowest, "{name}: {affinity:?}, {others:?}");
    }
}
