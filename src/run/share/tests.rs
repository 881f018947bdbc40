//! Frames are given once, in order, to whoever can read them, and a run that ends leaves nothing behind.

use super::*;

const COSTS: Costs = Costs { warm_s: 0.01, cold_s: 0.0, fits: true };

fn hub(devices: usize) -> Hub {
    let facts = |kind| DeviceFacts { budget_bytes: 1 << 30, kind };
    Hub::new(Policy::Affinity, &(0..devices).map(facts).collect::<Vec<_>>())
}

fn share(hub: &Hub, frames: usize, ahead: usize, budget_bytes: u64) -> Share<'_> {
    let costs = vec![COSTS; hub.lock().feeds.len()];
    Share::new(hub, frames, 0, costs, ahead, budget_bytes).unwrap()
}

#[test]
fn every_frame_is_given_once_and_in_order_on_each_device() {
    let (hub, stop) = (hub(2), Stop::default());
    let share = share(&hub, 100, 3, u64::MAX);
    let (mut seen, mut turns) = (vec![0; 100], [0; 2]);
    while let Some(turn) = share.next(&stop) {
        assert_eq!(turn.place, turns[turn.device]);
        turns[turn.device] += 1;
        seen[turn.index] += 1;
        share.was_read(turn.device);
        share.taken(turn.device);
        share.done(turn.device, turn.index, 0.01);
    }
    assert_eq!(seen, [1; 100]);
    assert_eq!(share.left(), 0);
}

#[test]
fn a_frame_that_fails_goes_to_another_device_and_fails_on_two() {
    let (hub, stop) = (hub(3), Stop::default());
    let share = share(&hub, 1, 3, u64::MAX);
    let first = share.next(&stop).unwrap();
    share.was_read(first.device);
    share.taken(first.device);
    assert!(share.failed(first.device, 0), "another one tries it");
    let second = share.next(&stop).unwrap();
    assert_ne!(second.device, first.device);
    share.was_read(second.device);
    share.taken(second.device);
    assert!(!share.failed(second.device, 0), "two have tried it");
    assert_eq!(share.next(&stop), None);
}

#[test]
fn what_a_device_that_is_gone_had_goes_to_the_other() {
    let (hub, stop) = (hub(2), Stop::default());
    let share = share(&hub, 10, 2, u64::MAX);
    let first = share.next(&stop).unwrap();
    assert!(share.gone(first.device));
    share.gave_back(first.device, first.index);
    let mut seen = vec![0; 10];
    while let Some(turn) = share.next(&stop) {
        assert_ne!(turn.device, first.device);
        seen[turn.index] += 1;
        share.was_read(turn.device);
        share.taken(turn.device);
        share.done(turn.device, turn.index, 0.01);
    }
    assert_eq!(seen, [1; 10]);
    assert!(!share.gone(1 - first.device), "the last one must go on");
}

#[test]
fn only_what_is_leased_to_another_run_wakes_its_readers() {
    let hub = hub(1);
    let (one, other) = (share(&hub, 10, 1, u64::MAX), share(&hub, 10, 1, u64::MAX));
    let next = |share: &Share| hub.lock().next(share.job, hub.clock.s(), 1);
    let (mine, wakes) = next(&one);
    assert!(mine.is_some() != wakes, "the device's first frames are of one of them");
    let waits = if wakes { &one } else { &other };
    // the device has enough ahead of it, or its lease is the other's: nothing that anybody must hear of
    assert_eq!((next(waits), next(waits)), ((None, false), (None, false)));
}

/// The long run has a lease, and its only reader has been reading for a second.
#[test]
fn a_device_without_frames_is_fed_by_whoever_can_read() {
    let (hub, stop) = (hub(1), Stop::default());
    let (long, short) = (share(&hub, 1000, 3, u64::MAX), share(&hub, 5, 3, u64::MAX));
    let (slow, other) = match hub.lock().next(long.job, 0.0, 3).0 {
        Some(_) => (&long, &short),
        None => (&short, &long),
    };
    if slow.job == short.job {
        assert!(short.next(&stop).is_some());
    }
    let next = |now_s: f64| hub.lock().next(other.job, now_s, 3).0;
    assert_eq!(next(0.1), None, "the lease is the other's");
    let turn = next(1.5).unwrap();
    // what it read is traced, and the device waits again
    other.was_read(0);
    other.taken(0);
    other.done(0, turn.index, 0.01);
    assert_eq!(hub.lock().runs[&slow.job].left, if slow.job == short.job { 5 } else { 1000 });
}

#[test]
fn the_frame_whose_turn_it_is_is_never_held_up() {
    let (hub, stop) = (hub(1), Stop::default());
    let share = share(&hub, 4, 2, 100);
    let first = share.next(&stop).unwrap();
    let second = share.next(&stop).unwrap();
    // the second came first, the first does not fit beside it, and goes on all the same
    share.take_bytes(second, 90);
    share.take_bytes(first, 50);
    share.was_read(0);
    share.taken(0);
    share.give_bytes(50);
    share.done(0, first.index, 0.01);
    let third = share.next(&stop).unwrap();
    std::thread::scope(|scope| {
        let waits = scope.spawn(|| share.take_bytes(third, 20));
        share.was_read(0);
        share.taken(0);
        share.give_bytes(90);
        waits.join().unwrap();
    });
    assert_eq!(hub.lock().bytes, 20);
}

#[test]
fn runs_take_turns_and_one_that_ends_leaves_nothing_behind() {
    let (hub, stop) = (hub(1), Stop::default());
    let long = share(&hub, 1000, 3, u64::MAX);
    let first = long.next(&stop).unwrap();
    long.was_read(0);
    long.taken(0);
    long.done(0, first.index, 0.01);
    let short = share(&hub, 5, 3, u64::MAX);
    // what the device has leased is the long one's; then the short one has its turn
    let mut before = 0;
    let mut done = 0;
    while done < 5 {
        let (next, _) = hub.lock().next(short.job, hub.clock.s(), 3);
        if let Some(turn) = next {
            short.was_read(0);
            short.taken(0);
            short.done(0, turn.index, 0.01);
            done += 1;
            continue;
        }
        let turn = long.next(&stop).unwrap();
        long.was_read(0);
        long.taken(0);
        long.done(0, turn.index, 0.01);
        before += 1;
    }
    assert!(before < 100, "{before} frames of the long run went first");
    drop(long);
    assert_eq!(short.next(&stop), None);
    assert!(hub.lock().feeds[0].lease.is_none() && hub.lock().runs.len() == 1);
}
