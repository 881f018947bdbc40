//! The rules, on cases worked out on paper.

use super::*;

fn equal(count: usize) -> Vec<DeviceFacts> {
    vec![DeviceFacts { budget_bytes: 100, kind: 0 }; count]
}

fn job(frames: u64, warm_s: f64, cold_s: f64) -> NewJob {
    let costs = vec![Costs { warm_s, cold_s, fits: true }];
    NewJob { frames, grows: false, priority: 0, costs, bytes: 10 }
}

/// Leases, and makes resident what was leased.
fn begin(scheduler: &mut Scheduler, now_s: f64, device: usize) -> Option<Lease> {
    let lease = scheduler.lease(now_s, device)?;
    scheduler.holds(device, lease.job, true);
    Some(lease)
}

fn trace(scheduler: &mut Scheduler, device: usize, lease: &Lease, frame_s: f64) {
    for frame in lease.frames.clone() {
        assert!(scheduler.done(device, lease.job, frame, frame_s));
    }
}

#[test]
fn a_batch_takes_a_tenth_of_a_second_and_goes_on_where_it_was() {
    let mut scheduler = Scheduler::new(Policy::Affinity, &equal(1));
    let id = scheduler.add(0.0, &job(100, 0.01, 1.0)).unwrap();
    let first = begin(&mut scheduler, 0.0, 0).unwrap();
    assert_eq!(first, Lease { job: id, frames: 0..10 });
    trace(&mut scheduler, 0, &first, 0.01);
    assert_eq!(scheduler.lease(1.1, 0).unwrap().frames, 10..20);
}

#[test]
fn what_is_shortest_alone_goes_first() {
    // two devices: 60 + 2·1 = 62 s of both against 10 + 2·20 = 50
    let mut scheduler = Scheduler::new(Policy::Affinity, &equal(2));
    let _long = scheduler.add(0.0, &job(60, 1.0, 1.0)).unwrap();
    let short = scheduler.add(0.0, &job(10, 1.0, 20.0)).unwrap();
    assert_eq!(scheduler.lease(0.0, 0).unwrap().job, short);
}

#[test]
fn a_resident_scene_goes_before_one_that_is_shorter_by_less_than_its_cold_start() {
    let mut scheduler = Scheduler::new(Policy::Affinity, &equal(1));
    let here = scheduler.add(0.0, &job(100, 0.1, 5.0)).unwrap();
    let lease = begin(&mut scheduler, 0.0, 0).unwrap();
    trace(&mut scheduler, 0, &lease, 0.1);
    // 0.1 s of 10 served, the virtual time is 0.1: 10 s against 0.1 + 8 + 3, and against 0.1 + 8 + 1
    let _near = scheduler.add(5.1, &job(80, 0.1, 3.0)).unwrap();
    assert_eq!(scheduler.lease(5.1, 0).unwrap().job, here);
    let shorter = scheduler.add(5.1, &job(80, 0.1, 1.0)).unwrap();
    assert_eq!(scheduler.lease(5.1, 0).unwrap().job, shorter);
}

#[test]
fn an_idle_device_joins_where_it_traces_a_frame_in_time() {
    // 100 frames of 0.1 s: the first device is ready after 1 s and ends after 11; a second one ends with it at
    // T = (100 + 10 + 10) / 20 = 6 s
    let mut scheduler = Scheduler::new(Policy::Affinity, &equal(2));
    let id = scheduler.add(0.0, &job(100, 0.1, 1.0)).unwrap();
    let first = begin(&mut scheduler, 0.0, 0).unwrap();
    let second = begin(&mut scheduler, 0.0, 1).unwrap();
    assert_eq!((first.job, second.job), (id, id));
    assert_eq!((first.frames, second.frames), (0..1, 50..51), "the far half");

    // 5 frames are traced before another cold start of 1 s is over
    let mut scheduler = Scheduler::new(Policy::Affinity, &equal(2));
    scheduler.add(0.0, &job(5, 0.1, 1.0)).unwrap();
    let first = begin(&mut scheduler, 0.0, 0).unwrap();
    trace(&mut scheduler, 0, &first, 0.1);
    assert!(scheduler.lease(1.1, 0).is_some());
    assert_eq!(scheduler.lease(1.1, 1), None);
}

#[test]
fn an_idle_device_helps_the_job_that_ends_last() {
    let mut scheduler = Scheduler::new(Policy::Affinity, &equal(3));
    let short = scheduler.add(0.0, &job(40, 0.1, 1.0)).unwrap();
    let long = scheduler.add(0.0, &job(400, 0.1, 1.0)).unwrap();
    assert_eq!(begin(&mut scheduler, 0.0, 0).unwrap().job, short);
    assert_eq!(begin(&mut scheduler, 0.0, 1).unwrap().job, long);
    assert_eq!(begin(&mut scheduler, 0.0, 2).unwrap().job, long);
}

#[test]
fn what_waits_is_not_left_for_another_copy_that_gains_less_than_it_costs() {
    let mut scheduler = Scheduler::new(Policy::Affinity, &equal(2));
    let first = scheduler.add(0.0, &job(50, 0.1, 1.0)).unwrap();
    let second = scheduler.add(0.0, &job(60, 0.1, 1.0)).unwrap();
    assert_eq!(begin(&mut scheduler, 0.0, 0).unwrap().job, first);
    assert_eq!(begin(&mut scheduler, 0.0, 1).unwrap().job, second);
}

/// Two devices of 100 bytes. One has begun a job of 1000 frames of 0.1 s with a cold start of 5 s, the other one of 100 with
/// one of 0.1. To join saves that 5 s, and costs 8 · 5.1 · (1/5.1 + 1/55) · 0.1 / 2 = 0.44 s; 22 s where the long one must go for it.
#[test]
fn another_copy_counts_what_it_pushes_out() {
    for (bytes, joins) in [(40, true), (60, false)] {
        let mut scheduler = Scheduler::new(Policy::Affinity, &equal(2));
        let long = scheduler.add(0.0, &NewJob { bytes, ..job(1000, 0.1, 5.0) }).unwrap();
        let lease = begin(&mut scheduler, 0.0, 0).unwrap();
        trace(&mut scheduler, 0, &lease, 0.1);
        let short = scheduler.add(5.1, &NewJob { bytes, ..job(100, 0.1, 0.1) }).unwrap();
        assert_eq!(begin(&mut scheduler, 5.1, 1).unwrap().job, short);
        let next = scheduler.lease(5.1, 0).unwrap();
        assert_eq!(next.job, if joins { short } else { long }, "{bytes} bytes");
    }
}

#[test]
fn what_comes_back_is_leased_again_and_what_failed_goes_elsewhere() {
    let mut scheduler = Scheduler::new(Policy::Affinity, &equal(2));
    let id = scheduler.add(0.0, &job(3, 1.0, 0.0)).unwrap();
    assert_eq!(begin(&mut scheduler, 0.0, 0).unwrap().frames, 0..1);
    scheduler.give_back(0.1, 0, id, 0..1, false);
    assert_eq!(scheduler.lease(0.2, 0).unwrap().frames, 0..1);
    scheduler.give_back(0.3, 0, id, 0..1, true);
    assert_eq!(scheduler.lease(0.4, 0).unwrap().frames, 1..2);
    assert_eq!(scheduler.lease(0.4, 1).unwrap().frames, 0..1);
    scheduler.give_back(0.5, 1, id, 0..1, true);
    scheduler.give_up(id, 0);
    assert!(scheduler.done(0, id, 1, 1.0) && !scheduler.done(0, id, 1, 1.0));
    let last = scheduler.lease(1.5, 0).unwrap();
    trace(&mut scheduler, 0, &last, 1.0);
    assert!(scheduler.is_done(id) && scheduler.is_idle());
}

#[test]
fn what_failed_and_fits_nowhere_else_is_given_up() {
    let devices = [DeviceFacts { budget_bytes: 100, kind: 0 }, DeviceFacts { budget_bytes: 10, kind: 1 }];
    let mut scheduler = Scheduler::new(Policy::Affinity, &devices);
    let costs = vec![Costs { warm_s: 0.1, cold_s: 0.0, fits: true }; 2];
    let id = scheduler.add(0.0, &NewJob { costs, bytes: 5, ..job(2, 0.1, 0.0) }).unwrap();
    let lease = scheduler.lease(0.0, 0).unwrap();
    let frame = lease.frames.start;
    scheduler.give_back(0.1, 0, id, lease.frames, true);
    assert!(scheduler.has_other(id, frame) && scheduler.give_up_hopeless(id) == 0);
    // the next frame is larger than the other device
    assert!(scheduler.needs(0.2, id, 50));
    assert!(!scheduler.has_other(id, frame));
    assert_eq!(scheduler.give_up_hopeless(id), 1);
    assert_eq!(scheduler.lease(0.3, 1), None);
    let last = scheduler.lease(0.3, 0).unwrap();
    trace(&mut scheduler, 0, &last, 0.1);
    assert!(scheduler.is_done(id));
}

#[test]
fn a_lost_device_gives_its_frames_back() {
    let mut scheduler = Scheduler::new(Policy::Affinity, &equal(2));
    let id = scheduler.add(0.0, &job(100, 0.1, 0.5)).unwrap();
    let lost = begin(&mut scheduler, 0.0, 0).unwrap();
    scheduler.device_gone(0.1, 0);
    assert_eq!(scheduler.lease(0.1, 0), None);
    assert_eq!(scheduler.lease(0.1, 1).unwrap().frames.start, lost.frames.start);
    assert!(!scheduler.done(0, id, 0, 0.1), "what comes too late does not count");
}

#[test]
fn a_scene_goes_only_where_it_fits() {
    let devices = [DeviceFacts { budget_bytes: 100, kind: 0 }, DeviceFacts { budget_bytes: 10, kind: 1 }];
    let mut scheduler = Scheduler::new(Policy::Affinity, &devices);
    let costs = vec![Costs { warm_s: 0.1, cold_s: 0.0, fits: true }; 2];
    let large = NewJob { frames: 1000, grows: false, priority: 0, costs, bytes: 50 };
    let id = scheduler.add(0.0, &large).unwrap();
    assert_eq!(scheduler.lease(0.0, 1), None);
    assert_eq!(scheduler.lease(0.0, 0).unwrap().job, id);
    let refused = scheduler.add(0.0, &NewJob { bytes: 101, ..large });
    assert_eq!(refused, Err(ScheduleError::TooLarge { bytes: 101, budget_bytes: 100 }));
}

#[test]
fn a_device_that_would_hold_up_the_end_begins_nothing() {
    // the second kind takes 40 s to begin with; the first does all of it in 11
    let devices = [DeviceFacts { budget_bytes: 100, kind: 0 }, DeviceFacts { budget_bytes: 100, kind: 1 }];
    let mut scheduler = Scheduler::new(Policy::Affinity, &devices);
    let fast = Costs { warm_s: 0.1, cold_s: 1.0, fits: true };
    let slow = Costs { warm_s: 1.0, cold_s: 40.0, fits: true };
    scheduler.add(0.0, &NewJob { costs: vec![fast, slow], ..job(100, 0.1, 1.0) }).unwrap();
    assert_eq!(scheduler.lease(0.0, 1), None);
    assert!(scheduler.lease(0.0, 0).is_some());
}

/// A long job among short ones that never stop coming, more than the device can do: K = 20 + 1 s, at most so much virtual
/// time goes by. Each second brings a job of 1.5 s; of n active ones each gets 1/n: the virtual time after t seconds is
/// about ln t of the surplus; it is served after a bounded time all the same.
#[test]
fn nothing_waits_for_ever() {
    let mut scheduler = Scheduler::new(Policy::Affinity, &equal(1));
    let long = scheduler.add(0.0, &job(20, 0.1, 1.0)).unwrap();
    let (mut now_s, mut comes_s, mut shorts) = (0.0, 0.0, 0);
    let begins_s = loop {
        while comes_s <= now_s {
            scheduler.add(comes_s, &job(10, 0.1, 0.5)).unwrap();
            (comes_s, shorts) = (comes_s + 1.0, shorts + 1);
        }
        let lease = begin(&mut scheduler, now_s, 0).unwrap();
        if lease.job == long {
            break now_s;
        }
        let is_first = lease.frames.start == 0;
        now_s += if is_first { 0.5 } else { 0.0 } + 0.1 * (lease.frames.end - lease.frames.start) as f64;
        trace(&mut scheduler, 0, &lease, 0.1);
        assert!(now_s < 300.0, "the long job waits behind {shorts} short ones");
    };
    assert!(begins_s > 1.0, "short ones go first: {begins_s}");
}

#[test]
fn a_higher_priority_goes_first_and_can_be_given_later() {
    let mut scheduler = Scheduler::new(Policy::Affinity, &equal(1));
    let short = scheduler.add(0.0, &job(10, 0.1, 1.0)).unwrap();
    let long = scheduler.add(0.0, &job(30, 0.1, 1.0)).unwrap();
    // (3 + 1) / 4 against 1 + 1
    scheduler.priority(0.0, long, 2);
    assert_eq!(scheduler.lease(0.0, 0).unwrap().job, long);
    scheduler.priority(0.0, short, 5);
    assert_eq!(scheduler.lease(0.0, 0).unwrap().job, short);
}

#[test]
fn a_job_that_grows_ends_when_it_is_closed() {
    let mut scheduler = Scheduler::new(Policy::Affinity, &equal(1));
    let id = scheduler.add(0.0, &NewJob { grows: true, ..job(0, 0.1, 0.0) }).unwrap();
    assert_eq!(scheduler.lease(0.0, 0), None);
    scheduler.append(0.0, id, 1);
    let lease = scheduler.lease(0.0, 0).unwrap();
    trace(&mut scheduler, 0, &lease, 0.1);
    assert!(!scheduler.is_done(id));
    scheduler.close(id);
    assert!(scheduler.is_done(id));
}

#[test]
fn what_one_device_measures_its_kind_knows_and_a_slow_one_is_found_out() {
    let mut scheduler = Scheduler::new(Policy::Affinity, &equal(2));
    let id = scheduler.add(0.0, &job(1000, 0.01, 0.0)).unwrap();
    let first = begin(&mut scheduler, 0.0, 0).unwrap();
    assert_eq!(first.frames.end, 10);
    trace(&mut scheduler, 0, &first, 0.02);
    assert_eq!(
        begin(&mut scheduler, 0.2, 1).unwrap().frames.clone().count(),
        5,
        "twice as long as was thought"
    );
    for _ in 0..10 {
        let lease = scheduler.lease(0.2, 0).unwrap();
        assert_eq!(lease.job, id);
        trace(&mut scheduler, 0, &lease, 0.2);
    }
    assert_eq!(scheduler.lease(5.0, 0).unwrap().frames.count(), 1, "ten times as long on this one");
}

#[test]
fn fifo_serves_the_oldest_job_on_all_devices() {
    let mut scheduler = Scheduler::new(Policy::Fifo, &equal(2));
    let long = scheduler.add(0.0, &job(100, 0.1, 1.0)).unwrap();
    let short = scheduler.add(0.0, &job(1, 0.1, 1.0)).unwrap();
    assert_eq!(scheduler.lease(0.0, 0).unwrap().job, long);
    assert_eq!(scheduler.lease(0.0, 1).unwrap().job, long);
    scheduler.cancel(long);
    assert_eq!(scheduler.lease(0.0, 1).unwrap().job, short);
}
