//! The run around the fake device: faults fail their own frame, each picture shows its own frame.

use super::*;
use crate::device::Device;
use crate::device::fake::{FakeDevice, Fault};
use crate::job::{Request, resolve};
use crate::schedule::Policy;
use crate::warning::Warnings;
use std::path::Path;

const FRAMES: usize = 6;

/// Frames of one triangle that grows.
fn sequence(folder: &Path) -> Request {
    sequence_of(folder, FRAMES, "f 1 2 3")
}

fn sequence_of(folder: &Path, frames: usize, faces: &str) -> Request {
    for frame in 1..=frames {
        let obj = format!("v 0 0 0\nv {frame} 0 0\nv 0 1 0\n{faces}\n");
        std::fs::write(folder.join(format!("t_{frame}.obj")), obj).unwrap();
    }
    Request {
        inputs: vec![folder.to_path_buf()],
        options: crate::job::Options { size: Some([4, 4]), ..crate::job::Options::default() },
        folder: Some(folder.join("out")),
        ..Request::default()
    }
}

fn statuses(outcome: &Outcome) -> Vec<(Option<i64>, Status)> {
    outcome.report.frames.iter().map(|f| (f.frame, f.status)).collect()
}

fn run(request: &Request, faults: &[(usize, Fault)], options: &RunOptions) -> Outcome {
    run_on(request, &[faults], Policy::default(), options)
}

/// A run on fake devices of which each has faults of its own, by pictures.
fn run_on(request: &Request, devices: &[&[(usize, Fault)]], policy: Policy, options: &RunOptions) -> Outcome {
    let job = resolve(request).unwrap();
    let frame = |picture: usize| {
        let (sources, warnings) = (source::Sources::default(), &mut Warnings::default());
        read_frame(&job, &job.pictures[picture], &sources, false, warnings).unwrap()
    };
    let fake = |(i, faults): (usize, &&[(usize, Fault)])| {
        let device = FakeDevice::new(&format!("fake:{i}"), 1 << 20);
        let with = |device: FakeDevice, &(picture, fault): &(usize, Fault)| {
            device.with_fault(frame(picture).hash(), fault)
        };
        Box::new(faults.iter().fold(device, with)) as Box<dyn Device>
    };
    let devices: Vec<_> = devices.iter().enumerate().map(fake).collect();
    render(&job, options, &Fleet::new(devices, policy), &Stop::default(), &mut |_| {}).unwrap()
}

fn two_threads() -> RunOptions {
    RunOptions { threads: 2, keeps_reports: true, ..RunOptions::default() }
}

#[test]
fn a_panic_and_a_lack_of_memory_fail_their_own_frames() {
    let t = tempfile::tempdir().unwrap();
    let request = sequence(t.path());
    // the panic is meant; its text need not stand in the test's output
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let outcome = run(&request, &[(1, Fault::Panic), (3, Fault::OutOfMemory)], &two_threads());
    std::panic::set_hook(hook);
    let failed: Vec<_> = outcome.failed().collect();
    assert_eq!(failed.iter().map(|f| f.frame).collect::<Vec<_>>(), [Some(2), Some(4)]);
    let error = |i: usize| failed[i].error.clone().unwrap_or_default();
    assert!(error(0).contains("t_2.obj: internal error while tracing"), "{}", error(0));
    assert!(error(1).contains("t_4.obj") && failed[1].device_failed, "{}", error(1));
    assert_eq!(outcome.report.totals.rendered, 4);
    // the second run makes what is missing, and only that
    let again = run(&request, &[], &two_threads());
    assert_eq!((again.report.totals.rendered, again.report.totals.resumed), (2, 4));
}

/// Frames whose device may hold them all, beside two that may hold one triangle and no more.
#[test]
fn what_a_device_cannot_hold_goes_to_one_that_can() {
    let t = tempfile::tempdir().unwrap();
    let job = resolve(&sequence(t.path())).unwrap();
    let fleet = |budgets: &[u64]| {
        let fake = |(i, &bytes): (usize, &u64)| {
            Box::new(FakeDevice::new(&format!("fake:{i}"), bytes)) as Box<dyn Device>
        };
        Fleet::new(budgets.iter().enumerate().map(fake).collect(), Policy::default())
    };
    let outcome =
        render(&job, &two_threads(), &fleet(&[10, 20, 1 << 20]), &Stop::default(), &mut |_| {}).unwrap();
    assert_eq!(outcome.report.totals.rendered, FRAMES as u64);
    assert!(outcome.report.frames.iter().all(|f| f.device.as_deref() == Some("fake:2")));
    // what fits none is refused with the figures
    let options = RunOptions { overwrite: true, ..two_threads() };
    let outcome = render(&job, &options, &fleet(&[10, 20]), &Stop::default(), &mut |_| {}).unwrap();
    let errors: Vec<_> = outcome.failed().filter_map(|f| f.error.clone()).collect();
    assert_eq!(errors.len(), FRAMES);
    assert!(
        errors.iter().all(|e| e.contains("bytes, 20 are allowed") || e.contains("bytes, 10 are allowed"))
    );
}

#[test]
fn a_lost_device_fails_what_comes_after_it() {
    let t = tempfile::tempdir().unwrap();
    let outcome = run(&sequence(t.path()), &[(2, Fault::Lost)], &two_threads());
    let want: Vec<_> = (1..=FRAMES as i64)
        .map(|f| (Some(f), if f < 3 { Status::Rendered } else { Status::Failed }))
        .collect();
    assert_eq!(statuses(&outcome), want);
    assert!(outcome.failed().all(|f| f.device_failed));
    let last = outcome.failed().last().and_then(|f| f.error.clone()).unwrap();
    assert!(last.contains("it is not tried any more"), "{last}");
}

#[test]
fn a_frame_that_is_refused_leaves_what_the_device_holds() {
    let t = tempfile::tempdir().unwrap();
    let outcome = run(&sequence(t.path()), &[(2, Fault::OutOfMemory)], &two_threads());
    assert_eq!(statuses(&outcome)[2], (Some(3), Status::Failed));
    let loads = outcome.report.frames.iter().filter(|f| f.update.action == Some("load"));
    assert_eq!(loads.map(|f| f.frame).collect::<Vec<_>>(), [Some(1)]);
}

#[test]
fn a_frame_without_room_is_tried_on_an_empty_device() {
    let t = tempfile::tempdir().unwrap();
    let outcome = run(&sequence(t.path()), &[(2, Fault::MemoryFull)], &two_threads());
    assert_eq!(outcome.report.totals.rendered, FRAMES as u64, "{:?}", statuses(&outcome));
    let loads = outcome.report.frames.iter().filter(|f| f.update.action == Some("load"));
    assert_eq!(loads.map(|f| f.frame).collect::<Vec<_>>(), [Some(1), Some(3)]);
    let residency = &outcome.report.devices[0].resident;
    assert!(residency.hits > 0 && residency.misses > 0, "{residency:?}");
}

#[test]
fn each_picture_shows_its_own_frame_whatever_the_order() {
    let t = tempfile::tempdir().unwrap();
    let mut request = sequence(t.path());
    run(&request, &[], &RunOptions { threads: 1, ..RunOptions::default() });
    let first = pictures(&t.path().join("out"));
    let different: std::collections::BTreeSet<_> = first.iter().map(|(_, bytes)| bytes.clone()).collect();
    assert_eq!(different.len(), FRAMES);
    request.order = crate::job::Order::Shuffle;
    request.folder = Some(t.path().join("shuffled"));
    run(&request, &[], &two_threads());
    assert_eq!(pictures(&t.path().join("shuffled")), first);
}

fn pictures(folder: &Path) -> Vec<(String, Vec<u8>)> {
    (1..=FRAMES)
        .map(|f| format!("t_{f}.png"))
        .map(|n| (n.clone(), std::fs::read(folder.join(n)).unwrap()))
        .collect()
}

#[test]
fn a_run_that_is_told_to_stop_before_it_begins_makes_nothing() {
    let t = tempfile::tempdir().unwrap();
    let job = resolve(&sequence(t.path())).unwrap();
    let stop = Stop::default();
    stop.ask();
    let device = Box::new(FakeDevice::new("fake", 1 << 20));
    let outcome =
        render(&job, &two_threads(), &Fleet::new(vec![device], Policy::default()), &stop, &mut |_| {})
            .unwrap();
    assert!(outcome.stopped && outcome.report.frames.is_empty() && !t.path().join("out").exists());
}

#[test]
fn without_a_report_only_frames_that_fail_are_kept_and_all_are_counted() {
    let t = tempfile::tempdir().unwrap();
    let request = sequence(t.path());
    let options = RunOptions { keeps_reports: false, ..two_threads() };
    let outcome = run(&request, &[(3, Fault::OutOfMemory)], &options);
    assert_eq!(statuses(&outcome), [(Some(4), Status::Failed)]);
    let totals = outcome.report.totals;
    assert_eq!((totals.frames, totals.rendered, totals.failed), (6, 5, 1));
}

#[test]
fn a_picture_that_is_gone_at_the_end_is_told_of_with_and_without_a_report() {
    for keeps_reports in [true, false] {
        let t = tempfile::tempdir().unwrap();
        let job = resolve(&sequence(t.path())).unwrap();
        let options = RunOptions { keeps_reports, overwrite: true, ..two_threads() };
        let mut told = Vec::new();
        let outcome = {
            let gone = job.folder.join(&job.pictures[1].picture);
            let mut on_event = |event: &Event| {
                if let Event::Frame(frame) = event {
                    told.push((frame.frame, frame.status));
                    // the last to be told of: the second is there by then, or is the last itself
                    if told.len() == job.pictures.len() {
                        std::fs::remove_file(&gone).unwrap();
                    }
                }
            };
            let device = Box::new(FakeDevice::new("fake", 1 << 20));
            render(
                &job,
                &options,
                &Fleet::new(vec![device], Policy::default()),
                &Stop::default(),
                &mut on_event,
            )
            .unwrap()
        };
        assert_eq!(told.last(), Some(&(Some(2), Status::Failed)));
        let failed: Vec<_> = outcome.failed().collect();
        assert_eq!(failed.len(), 1);
        assert!(failed[0].error.as_ref().is_some_and(|e| e.contains("is gone")), "{:?}", failed[0].error);
        assert_eq!((outcome.report.totals.rendered, outcome.report.totals.failed), (5, 1));
        assert_eq!(outcome.report.frames.len(), if keeps_reports { FRAMES } else { 1 });
    }
}

#[test]
fn several_devices_make_what_one_makes() {
    let t = tempfile::tempdir().unwrap();
    let mut request = sequence(t.path());
    run(&request, &[], &two_threads());
    let first = pictures(&t.path().join("out"));
    for policy in [Policy::Affinity, Policy::Fifo] {
        let folder = t.path().join(format!("{policy:?}"));
        request.folder = Some(folder.clone());
        let outcome = run_on(&request, &[&[], &[], &[]], policy, &two_threads());
        assert_eq!(pictures(&folder), first);
        let traced: u64 = outcome.report.devices.iter().map(|d| d.frames).sum();
        assert_eq!(traced, FRAMES as u64);
        assert_eq!(outcome.report.devices.len(), 3);
    }
}

#[test]
fn what_fails_on_one_device_is_made_by_another() {
    let t = tempfile::tempdir().unwrap();
    // which device has a frame first is chance: each fails at other ones
    let faults: [&[_]; 2] = [
        &[(0, Fault::OutOfMemory), (2, Fault::OutOfMemory)],
        &[(1, Fault::OutOfMemory), (5, Fault::OutOfMemory)],
    ];
    let outcome = run_on(&sequence(t.path()), &faults, Policy::default(), &two_threads());
    assert_eq!(outcome.report.totals.rendered, FRAMES as u64, "{:?}", statuses(&outcome));
}

#[test]
fn what_fails_on_two_devices_has_failed() {
    let t = tempfile::tempdir().unwrap();
    let faults: &[_] = &[(3, Fault::OutOfMemory)];
    let outcome = run_on(&sequence(t.path()), &[faults, faults, faults], Policy::default(), &two_threads());
    assert_eq!(outcome.report.totals.rendered, 5);
    let failed: Vec<_> = outcome.failed().collect();
    assert!(failed.len() == 1 && failed[0].frame == Some(4) && failed[0].device_failed);
}

#[test]
fn a_device_that_stays_lost_gives_its_frames_to_another() {
    let t = tempfile::tempdir().unwrap();
    let lost: Vec<_> = (0..FRAMES).map(|picture| (picture, Fault::Lost)).collect();
    let outcome = run_on(&sequence(t.path()), &[&lost, &[]], Policy::default(), &two_threads());
    assert_eq!(outcome.report.totals.rendered, FRAMES as u64, "{:?}", statuses(&outcome));
    assert!(outcome.report.frames.iter().all(|f| f.device.as_deref() == Some("fake:1")));
}

/// A long run, and one that begins once the first frame of that was made: neither makes its scene resident twice.
#[test]
fn runs_that_take_turns_on_a_device_keep_their_scenes_there() {
    let t = tempfile::tempdir().unwrap();
    let job = |name: &str, frames: usize, faces: &str| {
        let folder = t.path().join(name);
        std::fs::create_dir(&folder).unwrap();
        resolve(&sequence_of(&folder, frames, faces)).unwrap()
    };
    let (long, short) = (job("long", 200, "f 1 2 3"), job("short", 20, "f 1 2 3\nf 1 3 2"));
    let device = Box::new(FakeDevice::new("fake", 1 << 20));
    let (fleet, stop) = (Fleet::new(vec![device], Policy::default()), Stop::default());
    let options = RunOptions { update: crate::plan::Update::Refit, ..two_threads() };
    let mut outcomes = Vec::new();
    let mut on_event = |event: &Event| {
        if matches!(event, Event::Frame(_)) && outcomes.is_empty() {
            outcomes.push(render(&short, &options, &fleet, &stop, &mut |_| {}).unwrap());
        }
    };
    let outcome = render(&long, &options, &fleet, &stop, &mut on_event).unwrap();
    outcomes.push(outcome);
    for outcome in &outcomes {
        let actions = outcome.report.frames.iter().map(|f| f.update.action.unwrap());
        let made = actions.filter(|&action| action != "refit").count();
        assert_eq!(made, 1, "of {} frames", outcome.report.frames.len());
    }
}
