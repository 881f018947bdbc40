//! The workload `accuracy`: for each scene what a picture costs and how far it is from the picture that more work would make,
//! by samples, filters, depth and pruning; the frontier of those that nothing beats in both; whether the defaults are on it.

use super::chart::{Chart, Line, Panel};
use super::scenes::scenes;
use super::sequences::TWIST;
use super::table::{Cell, Table};
use super::times::Spread;
use super::{Bench, BenchError, Event, Findings};
use crate::device::{Device, DeviceKind, Stop};
use crate::film::compare::{Channel, Picture, Samples, compare};
use crate::plan::{Wishes, plan_frame};
use crate::run::{PICTURE_VERSION, RunOptions, read_shot};
use crate::scene::{Filter, Frame, PartHasher, Shot};
use crate::store::{DEFAULT_LIMIT_BYTES, Key, Payload, Store};
use std::path::{Path, PathBuf};

const SIZE: [u32; 2] = [320, 180];
/// Samples, bounces and seed of the reference, and its pruning: with none at all a ray that meets glass at each bounce would
/// become as many as 2 to the power of the bounces.
const REFERENCE: (u32, u32, u32) = (4096, 16, 1);
const REFERENCE_PRUNE: f32 = 1.0 / 65536.0;
const QUICK_SAMPLES: u32 = 256;
const ROUNDS: usize = 3;
/// What must not be: both more exact and faster than the default, by more than noise.
const NOISE: f64 = 0.07;

/// A way to make a picture.
struct Method {
    /// What is varied.
    knob: &'static str,
    /// To what.
    to: String,
    shot: Shot,
}

/// What came of it.
struct Point {
    knob: &'static str,
    to: String,
    is_default: bool,
    /// Whether more samples would make the reference of it.
    is_of_reference: bool,
    ms: Spread,
    rmse: f64,
    flip: f64,
    /// Whether something is both faster and more exact, by more than noise.
    is_beaten: bool,
}

/// Runs it.
pub(super) fn accuracy(bench: &Bench, on_event: &mut dyn FnMut(&Event<'_>)) -> Result<Findings, BenchError> {
    let mut all = Table::new(
        "accuracy",
        format!(
            "What a picture of 320x180 costs and how far it is from the reference ({} samples, box filter, 16 bounces, pruned at 1/65536): root mean square of linear differences, mean FLIP; 1 where something is both faster and more exact by more than noise. Other filters make another picture of many samples: they take no part in that.",
            reference_samples(bench)
        ),
        &["trace, ms", "RMSE", "FLIP", "beaten"],
    );
    let mut defaults = Table::new(
        "defaults",
        "The default (one sample, box, depth 10, prune 1/4096) and its values with 16 samples: cost, error, and how many other ways are both faster and more exact.",
        &["1 sample, ms", "RMSE", "beaten by", "16 samples, ms", "RMSE ", "beaten by "],
    );
    let mut found = Findings::default();
    let mut device = bench.device()?;
    for (name, path) in inputs(bench)? {
        on_event(&Event::Stage(&name));
        let (frame, shot) = match first_frame(bench, &path) {
            Ok(shown) => shown,
            Err(why) => {
                on_event(&Event::LeftOut(&name, &why));
                continue;
            }
        };
        let points = measured(bench, &mut *device, &frame, &shot)?;
        for p in &points {
            let beaten = f64::from(u8::from(p.is_beaten));
            let cells = [Cell::from(Some(p.ms)), p.rmse.into(), p.flip.into(), beaten.into()];
            all.row(format!("{name}: {} {}", p.knob, p.to), cells);
        }
        let default = |samples: &str| points.iter().find(|p| p.is_default && p.to == samples);
        let cells = |samples: &str| {
            let Some(p) = default(samples) else { return [Cell::Absent; 3] };
            let beats = points.iter().filter(|other| beats(other, p)).count();
            [Some(p.ms).into(), p.rmse.into(), (beats as f64).into()]
        };
        let [a, b] = [cells("1"), cells("16")];
        defaults.row(name.clone(), [a[0], a[1], a[2], b[0], b[1], b[2]]);
        found.draw(&chart(&name, &points))?;
    }
    found.add(defaults, on_event);
    found.add(all, on_event);
    Ok(found)
}

/// Scenes, and a made one where there are none.
fn inputs(bench: &Bench) -> Result<Vec<(String, PathBuf)>, BenchError> {
    let made = bench.room.path().join("made sheet");
    let mut all = scenes(bench.options.scenes.as_deref());
    all.retain(|scene| !scene.path.components().any(|c| c.as_os_str() == "torture"));
    let mut paths: Vec<(String, PathBuf)> = all.into_iter().map(|s| (s.name, s.path)).collect();
    if paths.is_empty() {
        TWIST.write(40, 2, &made)?;
        paths.push(("made sheet".to_string(), made));
    }
    if bench.options.quick {
        paths.truncate(3);
    }
    Ok(paths)
}

/// A scene's first frame; or why it cannot be read.
fn first_frame(bench: &Bench, path: &Path) -> Result<(Frame, Shot), String> {
    let mut job = bench.job(path, None).map_err(|e| e.to_string())?;
    job.pictures.truncate(1);
    let options = RunOptions { threads: bench.options.threads, lenient: true, ..RunOptions::default() };
    let (frame, shot) = read_shot(&job, &options)?;
    Ok((frame, Shot { size: SIZE, ..shot }))
}

/// What is tried; the first ones are the default with more and more samples.
fn methods(shot: &Shot, quick: bool) -> Vec<Method> {
    let of = |knob, to: String, shot: Shot| Method { knob, to, shot };
    let most = if quick { 16 } else { 256 };
    let samples = |filter, knob, step: usize| {
        (0..9)
            .step_by(step)
            .map(|i| 1_u32 << i)
            .filter(move |&n| n <= most)
            .map(move |n| of(knob, n.to_string(), Shot { samples: n, filter, ..shot.clone() }))
    };
    let mut methods: Vec<Method> = samples(Filter::Box, "samples", 1).collect();
    if !quick {
        methods.extend(samples(Filter::Triangle, "triangle filter, samples", 2).take(4));
        methods.extend(samples(Filter::Gaussian, "gaussian filter, samples", 2).take(4));
    }
    for samples in [1, 16] {
        for depth in [0, 1, 2, 3, 5] {
            methods.push(of(
                if samples == 1 { "1 sample, depth" } else { "16 samples, depth" },
                depth.to_string(),
                Shot { samples, depth, ..shot.clone() },
            ));
        }
        for (prune, word) in [(REFERENCE_PRUNE, "1/65536"), (1.0 / 64.0, "1/64")] {
            methods.push(of(
                if samples == 1 { "1 sample, prune" } else { "16 samples, prune" },
                word.to_string(),
                Shot { samples, prune, ..shot.clone() },
            ));
        }
    }
    methods
}

fn measured(
    bench: &Bench,
    device: &mut dyn Device,
    frame: &Frame,
    shot: &Shot,
) -> Result<Vec<Point>, BenchError> {
    let failed = |e: crate::device::DeviceError| BenchError::Frame(e.to_string());
    let plan = plan_frame(frame, device.residency(), &Wishes::default());
    device.apply(&plan, frame).map_err(failed)?;
    let kind = device.info().kind;
    let mut trace = |shot: &Shot| {
        let traced = device.trace(frame, shot, &Stop::default()).map_err(failed)?;
        Ok::<_, BenchError>((traced.trace_ms, traced.film.film().rgb.to_vec()))
    };
    let reference = reference(bench, kind, frame, shot, &mut trace)?;
    let methods = methods(shot, bench.options.quick);
    let mut times = vec![Vec::new(); methods.len()];
    let mut films = Vec::new();
    // in turn, so that a machine that slows down slows all of them; to and fro, for what comes after short ones is faster
    for round in 0..ROUNDS {
        for turn in 0..methods.len() {
            let i = if round % 2 == 0 { turn } else { methods.len() - 1 - turn };
            let shot = &methods[i].shot;
            if shot.samples <= 2 {
                // what is over so soon depends on what came before
                trace(shot)?;
            }
            let (ms, rgb) = trace(shot)?;
            times[i].push(ms);
            if round == 0 {
                films.push(rgb);
            }
        }
    }
    let reference = picture(&reference);
    let point = |((method, times), rgb): ((&Method, Vec<f64>), Vec<[f32; 3]>)| {
        let compared = compare(&picture(&rgb), &reference).ok()?;
        Some(Point {
            knob: method.knob,
            to: method.to.clone(),
            is_default: method.knob == "samples",
            is_of_reference: method.shot.filter == shot.filter,
            ms: Spread::of(times)?,
            rmse: compared.rmse,
            flip: compared.flip,
            is_beaten: false,
        })
    };
    let mut points: Vec<Point> = methods.iter().zip(times).zip(films).filter_map(point).collect();
    let is_beaten: Vec<bool> = points.iter().map(|p| points.iter().any(|other| beats(other, p))).collect();
    points.iter_mut().zip(is_beaten).for_each(|(p, beaten)| p.is_beaten = beaten);
    Ok(points)
}

fn picture(rgb: &[[f32; 3]]) -> Picture {
    let channel = |i: usize| Channel {
        name: ["R", "G", "B"][i].to_string(),
        samples: Samples::Float(rgb.iter().map(|p| p[i]).collect()),
    };
    Picture { size: SIZE, channels: (0..3).map(channel).collect() }
}

/// Whether one is faster and at least as exact, or as fast and more exact, by more than noise. More exact is what is so by both
/// measures: what is pruned early costs little in the mean of squares, and is seen.
fn beats(a: &Point, b: &Point) -> bool {
    // faster in every round than in any of the other's
    let (faster, as_fast) =
        (a.ms.greatest < b.ms.least * (1.0 - NOISE), a.ms.median <= b.ms.median * (1.0 + NOISE));
    let exacter = a.rmse < b.rmse * (1.0 - NOISE) && a.flip < b.flip * (1.0 - NOISE);
    let as_exact = a.rmse <= b.rmse && a.flip <= b.flip;
    a.is_of_reference && b.is_of_reference && (as_fast && exacter || faster && as_exact)
}

fn reference_samples(bench: &Bench) -> u32 {
    if bench.options.quick { QUICK_SAMPLES } else { REFERENCE.0 }
}

type Trace<'a> = &'a mut dyn FnMut(&Shot) -> Result<(f64, Vec<[f32; 3]>), BenchError>;

/// The picture that more work would make, from the store where it is there.
fn reference(
    bench: &Bench,
    kind: DeviceKind,
    frame: &Frame,
    shot: &Shot,
    trace: Trace<'_>,
) -> Result<Vec<[f32; 3]>, BenchError> {
    let (_, depth, seed) = REFERENCE;
    let shot =
        Shot { samples: reference_samples(bench), depth, seed, prune: REFERENCE_PRUNE, ..shot.clone() };
    let mut hasher = PartHasher::new("reference");
    hasher.u64(PICTURE_VERSION);
    hasher.bytes(kind.word().as_bytes());
    hasher.part(frame.hash());
    shot.hash_into(&mut hasher);
    let key = Key(hasher.finish().0);
    let store = bench.options.store.as_ref().map(|root| Store::new(root, DEFAULT_LIMIT_BYTES));
    let pixels = SIZE.iter().product::<u32>() as usize;
    let kept: Option<Vec<[f32; 3]>> = store.as_ref().and_then(|s| s.get("reference", key, Payload::rest));
    if let Some(rgb) = kept.filter(|rgb| rgb.len() == pixels) {
        return Ok(rgb);
    }
    let (_, rgb) = trace(&shot)?;
    if let Some(store) = store {
        store.put("reference", key, &[bytemuck::cast_slice(&rgb)]);
    }
    Ok(rgb)
}

/// Time against error by what is varied, and the frontier.
fn chart(name: &str, points: &[Point]) -> Chart {
    let mut knobs: Vec<&str> = points.iter().map(|p| p.knob).collect();
    knobs.dedup();
    // what is exact has no place on a logarithmic axis
    let least = points.iter().map(|p| p.rmse).filter(|e| *e > 0.0).fold(1.0, f64::min) / 2.0;
    let place = |p: &Point| (p.ms.median, p.rmse.max(least));
    let mut lines: Vec<Line> = Vec::new();
    let mut frontier: Vec<&Point> = points.iter().filter(|p| p.is_of_reference && !p.is_beaten).collect();
    frontier.sort_by(|a, b| a.ms.median.total_cmp(&b.ms.median));
    for knob in knobs {
        let points = points.iter().filter(|p| p.knob == knob).map(place).collect();
        lines.push(Line { name: knob.to_string(), points });
    }
    lines.push(Line { name: "frontier".to_string(), points: frontier.into_iter().map(place).collect() });
    Chart {
        name: format!("accuracy-{}", name.replace([' ', '/'], "-")),
        title: format!("Time and error: {name}"),
        panels: vec![Panel {
            x: "tracing, ms".to_string(),
            is_log_x: true,
            y: "RMSE, linear".to_string(),
            is_log: true,
            lines,
        }],
    }
}
