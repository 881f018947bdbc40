//! What every device must do, as checks over the trait: the CPU, each GPU and the fake device pass the same ones.
//!
//! The checks are assertions: they panic, naming what is wrong, where a device does not conform.

use super::{Device, DeviceError, DeviceKind, Output, Stop};
use crate::film::Film;
use crate::math::{DAffine3, DVec3, Vec3};
use crate::plan::{Action, Residency, Step, Wishes, plan_frame};
use crate::scene::{
    Aov, AovSet, Background, Camera, Faces, Falloff, Filter, Frame, Geometry, Light, Material, MaterialRuns,
    Mesh, Object, Part, Positions, Shot, Triangles,
};
use std::sync::Arc;

/// What the suite's pictures have behind everything.
const BACKGROUND: Vec3 = Vec3::new(0.1, 0.2, 0.4);

/// Gives a fresh device that may hold so many bytes.
pub type Make<'a> = &'a mut dyn FnMut(u64) -> Box<dyn Device>;

/// More than the frames of these checks need.
const AMPLE_BYTES: u64 = 1 << 24;

/// Runs all checks.
pub fn check(make: Make) {
    a_warm_picture_is_the_cold_one(make);
    what_is_resident_is_not_uploaded(make);
    residency_adds_up(make);
    a_cold_plan_forgets_everything(make);
    what_comes_again_is_kept_while_there_is_space(make);
    what_does_not_fit_is_refused(make);
    a_frame_without_objects_is_background(make);
    a_stopped_trace_says_so(make);
    a_frame_that_is_not_resident_is_refused(make);
    codes_are_those_of_the_linear_film(make);
}

/// Two devices that promise the same bytes draw the same pictures.
pub fn check_same_pictures(a: &mut dyn Device, b: &mut dyn Device) {
    for (i, frame) in frames().iter().enumerate() {
        assert!(picture(a, frame) == picture(b, frame), "frame {i}: two devices' pictures differ");
    }
}

/// A picture is the same whatever the device held before, in whatever order frames come.
fn a_warm_picture_is_the_cold_one(make: Make) {
    let frames = frames();
    let cold: Vec<Film> = frames.iter().map(|f| picture(&mut *make(AMPLE_BYTES), f)).collect();
    let mut device = make(AMPLE_BYTES);
    for i in [0, 1, 2, 3, 3, 2, 1, 0, 2, 0, 3, 1] {
        assert!(picture(&mut *device, &frames[i]) == cold[i], "frame {i}: warm and cold differ");
    }
}

fn what_is_resident_is_not_uploaded(make: Make) {
    let frames = frames();
    let mut device = make(AMPLE_BYTES);
    for frame in &frames {
        let plan = plan_frame(frame, device.residency(), &Wishes::default());
        let cost = device.apply(&plan, frame).expect("the budget is ample");
        assert!(cost.uploaded_bytes > 0, "a part that was not there was not uploaded");
        let plan = plan_frame(frame, device.residency(), &Wishes::default());
        assert_eq!(plan.action, Action::None, "what was made resident is planned again");
        let cost = device.apply(&plan, frame).expect("the budget is ample");
        assert_eq!(cost.uploaded_bytes, 0, "a resident part was uploaded again");
    }
}

/// What is held is what the frame is made of; its bytes, their peak, hits and misses are counted.
fn residency_adds_up(make: Make) {
    let mut device = make(AMPLE_BYTES);
    let mut peak = 0;
    for frame in &frames() {
        let before = device.residency().clone();
        let plan = plan_frame(frame, device.residency(), &Wishes::default());
        let cost = device.apply(&plan, frame).expect("the budget is ample");
        let after = device.residency();
        let mut parts: Vec<_> = frame.objects.iter().flat_map(|o| o.geometry.parts()).collect();
        parts.sort_unstable();
        parts.dedup();
        let trees: Vec<_> = frame.objects.iter().map(|o| crate::plan::tree_name(&o.geometry)).collect();
        for (name, bytes) in &parts {
            assert_eq!(
                after.held.get(name).map(|h| h.bytes),
                Some(*bytes),
                "a part is not held with its bytes"
            );
        }
        let strangers =
            after.held.keys().filter(|n| !trees.contains(n) && !parts.iter().any(|(p, _)| p == *n));
        assert_eq!(strangers.count(), 0, "something is held that the frame does not use");
        let uploaded: u64 = parts.iter().filter(|(n, _)| !before.held.contains_key(n)).map(|(_, b)| b).sum();
        assert_eq!(
            cost.uploaded_bytes, uploaded,
            "uploaded bytes are not those of the parts that were not there"
        );
        // a refitted tree was there, under another name
        let refitted = plan.steps.iter().filter(|s| matches!(s, Step::Refit { .. })).count() as u64;
        let kept = after.held.keys().filter(|n| before.held.contains_key(n)).count() as u64 + refitted;
        assert_eq!(after.hits - before.hits, kept, "hits");
        assert_eq!(after.misses - before.misses, after.held.len() as u64 - kept, "misses");
        peak = after.bytes().max(peak);
        assert!((peak..=device.info().budget_bytes).contains(&after.peak_bytes), "the peak is out of bounds");
    }
    let frame = Frame::default();
    let plan = plan_frame(&frame, device.residency(), &Wishes::default());
    device.apply(&plan, &frame).expect("nothing fits");
    assert!(device.residency().held.is_empty(), "something is held for a frame without objects");
}

fn a_cold_plan_forgets_everything(make: Make) {
    let frames = frames();
    let frame = &frames[0];
    let mut device = make(AMPLE_BYTES);
    let warm = picture(&mut *device, frame);
    let plan = plan_frame(frame, device.residency(), &Wishes::cold());
    assert_eq!(plan.action, Action::Load);
    let cost = device.apply(&plan, frame).expect("the budget is ample");
    let bytes: u64 = frame.objects[0].geometry.parts().iter().map(|(_, bytes)| bytes).sum();
    assert_eq!(cost.uploaded_bytes, bytes, "a cold plan uploads all");
    let cold = device.trace(frame, &shot(), &Stop::default()).expect("it is resident");
    assert!(*cold.film == warm, "the cold picture differs");
}

/// Frames whose faces differ take turns: with space each is loaded once; without, something is evicted each time, the
/// budget holds and the pictures stay.
fn what_comes_again_is_kept_while_there_is_space(make: Make) {
    let of = |n| Frame {
        objects: vec![Object { geometry: sheet(n, 0.0, &Material::default()), transform: None }],
    };
    let (a, b) = (of(12), of(13));
    let turns = [&a, &b, &a, &b, &a];
    let cold = turns.map(|frame| picture(&mut *make(AMPLE_BYTES), frame));
    let run = |device: &mut dyn Device| {
        let mut uploaded = Vec::new();
        for (frame, cold) in turns.iter().zip(&cold) {
            let budget_bytes = device.info().budget_bytes;
            let wishes = Wishes { used_again: vec![0], budget_bytes, ..Wishes::default() };
            let plan = plan_frame(frame, device.residency(), &wishes);
            uploaded.push(device.apply(&plan, frame).expect("each frame fits").uploaded_bytes);
            assert!(device.residency().bytes() <= budget_bytes, "more is held than is allowed");
            let traced = device.trace(frame, &shot(), &Stop::default()).expect("it is resident");
            assert!(*traced.film == *cold, "the picture of a frame that came again differs");
        }
        uploaded
    };
    let mut ample = make(AMPLE_BYTES);
    let uploaded = run(&mut *ample);
    assert!(uploaded[..2].iter().all(|b| *b > 0) && uploaded[2..] == [0; 3], "{uploaded:?}");
    assert_eq!(ample.residency().evictions, 0);
    // what the larger one is taken to need alone
    let empty = Residency::default();
    let needed_bytes = plan_frame(&b, &empty, &Wishes::default()).needed_bytes(&empty);
    let mut tight = make(needed_bytes);
    assert!(run(&mut *tight)[2..].iter().all(|b| *b > 0), "what was evicted was not uploaded again");
    assert!(tight.residency().evictions > 0, "nothing was evicted");
}

/// Refused with the figures, and nothing changes: the device goes on with what fits.
fn what_does_not_fit_is_refused(make: Make) {
    let frames = frames();
    let (small, large) = (&frames[0], &frames[3]);
    let mut ample = make(AMPLE_BYTES);
    let small_picture = picture(&mut *ample, small);
    let budget = ample.residency().bytes() * 2;
    let mut device = make(budget);
    assert!(picture(&mut *device, small) == small_picture);
    let held = device.residency().clone();
    let plan = plan_frame(large, device.residency(), &Wishes::default());
    match device.apply(&plan, large) {
        Err(DeviceError::OutOfMemory { needed_bytes, budget_bytes, .. }) => {
            assert_eq!(budget_bytes, budget);
            assert!(needed_bytes > budget, "{needed_bytes} bytes would fit {budget}");
        }
        other => panic!("a frame beyond the budget is not refused: {other:?}"),
    }
    assert!(*device.residency() == held, "a refused plan changed what is held");
    assert!(picture(&mut *device, small) == small_picture, "after a refusal the device is not as before");
}

fn a_frame_without_objects_is_background(make: Make) {
    let film = picture(&mut *make(AMPLE_BYTES), &Frame::default());
    // a mean of three equal samples may be off by a GPU's division
    let is_background = |p: &[f32; 3]| {
        p.iter().zip(BACKGROUND.to_array()).all(|(x, b)| (x - b).abs() <= 4.0 * f32::EPSILON * b)
    };
    assert!(film.rgb.iter().all(is_background), "an empty frame does not show the background");
    assert!(film.aovs.id.is_none_or(|ids| ids.iter().all(|id| *id == [u32::MAX; 2])));
}

/// Whether a device makes them or leaves them to the film. One that draws makes them where nothing else is wanted.
fn codes_are_those_of_the_linear_film(make: Make) {
    let frame = &frames()[1];
    let mut device = make(AMPLE_BYTES);
    picture(&mut *device, frame);
    let plain = Shot { alpha: false, aovs: AovSet::default(), ..shot() };
    for shot in [plain.clone(), Shot { alpha: false, ..shot() }, Shot { alpha: true, ..shot() }] {
        let linear = device.trace(frame, &shot, &Stop::default()).expect("it is resident").film.into_film();
        for exposure_stops in [0.0, 2.25, -1.5] {
            let output = Output::Codes { exposure_stops };
            device.begin(frame, &shot, output, &Stop::default()).expect("it is resident");
            let film = device.finish().expect("a frame was begun").film.into_film();
            let is_same = film.codes(true, exposure_stops) == linear.codes(true, exposure_stops);
            let what = format!("alpha {}, {:?}, {exposure_stops} stops", shot.alpha, shot.aovs);
            assert!(is_same && film.aovs == linear.aovs, "{what}");
            let draws = device.info().kind != DeviceKind::Fake;
            assert!(shot != plain || film.codes.is_some() == draws, "{what}");
        }
    }
}

fn a_stopped_trace_says_so(make: Make) {
    let frames = frames();
    let mut device = make(AMPLE_BYTES);
    let film = picture(&mut *device, &frames[1]);
    let stop = Stop::default();
    stop.ask();
    assert_eq!(device.trace(&frames[1], &shot(), &stop).err(), Some(DeviceError::Stopped));
    assert!(picture(&mut *device, &frames[1]) == film, "after a stop the picture differs");
}

fn a_frame_that_is_not_resident_is_refused(make: Make) {
    let frames = frames();
    let refused = make(AMPLE_BYTES).trace(&frames[0], &shot(), &Stop::default());
    assert!(
        matches!(refused, Err(DeviceError::NotResident { object: 0, .. })),
        "traced without being resident"
    );
}

/// Plans, applies and traces a frame.
fn picture(device: &mut dyn Device, frame: &Frame) -> Film {
    let plan = plan_frame(frame, device.residency(), &Wishes::default());
    device.apply(&plan, frame).expect("the budget suffices");
    device.trace(frame, &shot(), &Stop::default()).expect("it is resident").film.into_film()
}

/// A picture of odd size with several samples, all auxiliary pictures, and lights of each kind.
pub(super) fn shot() -> Shot {
    let mut aovs = AovSet::default();
    for aov in Aov::ALL {
        aovs.insert(aov);
    }
    let color = Vec3::new(1.0, 0.9, 0.8);
    let falloff = Falloff::InverseSquare;
    Shot {
        camera: Camera {
            eye: DVec3::new(0.4, 0.9, 4.0),
            look_at: DVec3::new(0.0, 0.1, 0.0),
            up: DVec3::Y,
            fov_deg: 40.0,
        },
        lights: vec![
            Light::Point { position: Vec3::new(1.0, 3.0, 2.0), color, intensity: 6.0, falloff },
            Light::Directional { direction: Vec3::new(0.3, -1.0, -0.5), color, intensity: 0.4 },
            Light::Spot {
                position: Vec3::new(-2.0, 2.0, 2.0),
                direction: Vec3::new(1.0, -1.0, -1.0),
                inner_deg: 10.0,
                outer_deg: 30.0,
                color,
                intensity: 0.5,
                falloff: Falloff::None,
            },
        ],
        ambient: Vec3::new(0.3, 0.2, 0.1),
        background: Background::Color(BACKGROUND),
        size: [75, 43],
        samples: 3,
        filter: Filter::Gaussian,
        depth: 10,
        seed: 7,
        prune: 1.0 / 4096.0,
        alpha: false,
        aovs,
    }
}

/// A wavy sheet; the same, deformed; the first with another material, in two places; a finer one.
fn frames() -> [Frame; 4] {
    let matt = Material { ka: [0.5; 3], ..Material::default() };
    let glossy = Material { ks: [0.5; 3], ns: 20.0, d: 0.6, illum: 2, ..Material::default() };
    let still = Object { geometry: sheet(12, 0.0, &matt), transform: None };
    let moved = Object {
        geometry: sheet(12, 0.0, &glossy),
        transform: Some(
            DAffine3::from_translation(DVec3::new(0.2, 0.4, 0.3))
                * DAffine3::from_scale(DVec3::new(-0.6, 0.5, 0.6)),
        ),
    };
    let deformed = Object { geometry: sheet(12, 1.0, &matt), transform: None };
    let fine = Object { geometry: sheet(40, 0.0, &matt), transform: None };
    [vec![still.clone()], vec![deformed], vec![still, moved], vec![fine]].map(|objects| Frame { objects })
}

/// A sheet of n × n squares over [−1, 1]² that waves in z with the given phase.
fn sheet(n: u32, phase: f32, material: &Material) -> Arc<Geometry> {
    let at = |i: u32| 2.0 * i as f32 / n as f32 - 1.0;
    let wave = |x: f32, y: f32| 0.3 * libm::sinf(3.0 * x + phase) * libm::cosf(4.0 * y);
    let positions = (0..=n).flat_map(|j| (0..=n).map(move |i| [at(i), at(j), wave(at(i), at(j))])).collect();
    let corners = move |i: u32, j: u32| {
        let first = j * (n + 1) + i;
        [first, first + 1, first + n + 2, first + n + 1]
    };
    let squares: Vec<[u32; 4]> = (0..n).flat_map(|j| (0..n).map(move |i| corners(i, j))).collect();
    Arc::new(Geometry {
        positions: Part::new(Positions(positions)),
        faces: Part::new(Faces { counts: vec![4; squares.len()], corners: squares.concat() }),
        triangles: Part::new(Triangles(
            squares.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        )),
        texcoords: None,
        normals: None,
        colors: None,
        material_runs: Part::new(MaterialRuns(vec![[0, 0]])),
        materials: vec![Part::new(material.clone())],
        meshes: vec![Mesh { first_face: 0, face_count: n * n, first_triangle: 0, triangle_count: 2 * n * n }],
    })
}
