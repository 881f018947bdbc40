//! The workload `stability`: every scene moved away from the origin and scaled, and the sequences that break refits: where
//! methods fail, and what is left of it here.

use super::chart::{Chart, Line, Panel};
use super::frames::plain;
use super::scenes::scenes;
use super::sequences::{HOSTILE, TWIST};
use super::table::{Cell, Table};
use super::times::Spread;
use super::{Bench, BenchError, Event, Findings};
use crate::accel::{Aggregate, Hit, Quality, Ray, TracedObject, TracedScene, Tree, disagreement, reference};
use crate::device::cpu::CpuDevice;
use crate::device::{Device, DeviceError, Stop};
use crate::kernel::camera::{CameraConstants, camera_ray};
use crate::math::{DVec3, Vec3};
use crate::plan::{Wishes, plan_frame};
use crate::run::{RunOptions, Sources, read_frame, read_shot};
use crate::scene::{Aov, AovSet, Background, Camera, Falloff, Filter, Frame, Geometry, Light, Object, Shot};
use crate::warning::Warnings;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How far from the origin, in extents of the scene, and how large.
const MOVED: [f64; 9] = [0.0, 1.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7];
const SCALED: [f64; 7] = [1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6];
/// Pixels of the rays that are held against brute force, and of those that are lit.
const RAYS: [u32; 2] = [32, 18];
const LIT: [u32; 2] = [96, 54];
/// Side and frames of the sequences.
const SIDE: u32 = 40;
const FRAMES: u32 = 12;

/// A mesh as it was written, in f64.
struct Placed {
    name: String,
    positions: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

/// What came of a scene in one place: shares of rays or pixels, in percent.
#[derive(Clone, Copy, Debug, Default)]
struct Found {
    /// Hits that are not those of brute force in f64 on the same triangles.
    wrong: f64,
    /// Pixels that are dark though the light stands in the eye.
    acne: f64,
    /// Rays that meet another triangle than where the scene was written: what rounding its positions to f32 takes.
    lost: f64,
    /// Tracing, ns a pixel.
    ns: f64,
}

/// Runs it.
pub(super) fn stability(bench: &Bench, on_event: &mut dyn FnMut(&Event<'_>)) -> Result<Findings, BenchError> {
    let mut found = Findings::default();
    let meshes = meshes(bench)?;
    let mut moved: Vec<Vec<Found>> = Vec::new();
    let mut scaled: Vec<Vec<Found>> = Vec::new();
    let mut table = Table::new(
        "stability",
        "Each scene moved to 10^7 extents from the origin and scaled from 10^-6 to 10^6. Wrong: hits that are not those of brute force in f64 on the same f32 triangles; acne: pixels that shadow themselves; both at their worst place. Lost: rays that meet another triangle once positions are rounded to f32 there. %.",
        &[
            "triangles",
            "wrong, moved",
            "acne, moved",
            "lost at 10^3",
            "lost at 10^5",
            "lost at 10^7",
            "wrong, scaled",
            "acne, scaled",
            "ns a pixel",
            "at 10^7",
        ],
    );
    for mesh in &meshes {
        on_event(&Event::Stage(&mesh.name));
        let home = hits(mesh, 1.0, 0.0).1;
        let one = |scale: f64, extents: f64| place(bench, mesh, scale, extents, &home);
        let by_offset = MOVED.iter().map(|&o| one(1.0, o)).collect::<Result<Vec<Found>, _>>()?;
        let by_scale = SCALED.iter().map(|&s| one(s, 0.0)).collect::<Result<Vec<Found>, _>>()?;
        let worst = |all: &[Found], of: fn(&Found) -> f64| all.iter().map(of).fold(0.0, f64::max);
        let cells = [
            mesh.triangles.len() as f64,
            worst(&by_offset, |f| f.wrong),
            worst(&by_offset, |f| f.acne),
            by_offset[4].lost,
            by_offset[6].lost,
            by_offset[8].lost,
            worst(&by_scale, |f| f.wrong),
            worst(&by_scale, |f| f.acne),
            by_offset[0].ns,
            by_offset[8].ns,
        ];
        table.row(mesh.name.clone(), cells.map(Cell::from));
        moved.push(by_offset);
        scaled.push(by_scale);
    }
    found.draw(&Chart {
        name: "stability".to_string(),
        title: format!("{} scenes moved and scaled", meshes.len()),
        panels: vec![
            panel("extents from the origin (leftmost: 0)", &MOVED, &moved),
            panel("scale", &SCALED, &scaled),
        ],
    })?;
    found.add(table, on_event);
    found.add(sequences(bench, on_event)?, on_event);
    Ok(found)
}

fn panel(x: &str, at: &[f64], found: &[Vec<Found>]) -> Panel {
    let place = |i: usize| if at[i] > 0.0 { at[i] } else { 0.1 };
    let line = |name: &str, of: fn(&Found) -> f64, share: f64| {
        let at_place = |i: usize| {
            let mut all: Vec<f64> = found.iter().map(|places| of(&places[i])).collect();
            all.sort_by(f64::total_cmp);
            let rank = ((all.len() as f64 * share).ceil() as usize).clamp(1, all.len().max(1)) - 1;
            (place(i), all.get(rank).copied().unwrap_or(0.0))
        };
        Line { name: name.to_string(), points: (0..at.len()).map(at_place).collect() }
    };
    Panel {
        x: x.to_string(),
        is_log_x: true,
        y: "rays, %".to_string(),
        is_log: false,
        lines: vec![
            line("wrong hits, worst scene", |f| f.wrong, 1.0),
            line("lost by rounding, worst scene", |f| f.lost, 1.0),
            line("lost by rounding, median", |f| f.lost, 0.5),
            line("acne, worst scene", |f| f.acne, 1.0),
        ],
    }
}

/// The first frames of all scenes as one mesh each, and of a made one.
fn meshes(bench: &Bench) -> Result<Vec<Placed>, BenchError> {
    let made = bench.room.path().join("made twist");
    TWIST.write(SIDE, 2, &made)?;
    let mut inputs: Vec<(String, PathBuf)> =
        scenes(bench.options.scenes.as_deref()).into_iter().map(|s| (s.name, s.path)).collect();
    inputs.truncate(if bench.options.quick { 3 } else { usize::MAX });
    inputs.push(("made sheet".to_string(), made));
    let mut meshes = Vec::new();
    for (name, path) in inputs {
        let mut job = bench.job(&path, None)?;
        job.pictures.truncate(1);
        let options = RunOptions { threads: bench.options.threads, lenient: true, ..RunOptions::default() };
        // what cannot be read is no scene to move
        let Ok((frame, _)) = read_shot(&job, &options) else { continue };
        let mut mesh = Placed { name, positions: Vec::new(), triangles: Vec::new() };
        for object in &frame.objects {
            let first = mesh.positions.len() as u32;
            let points = object.geometry.positions.0.iter().map(|&p| Vec3::from(p).as_dvec3());
            mesh.positions.extend(points.map(|p| object.transform.map_or(p, |m| m.transform_point3(p))));
            mesh.triangles.extend(object.geometry.triangles.0.iter().map(|t| t.map(|i| first + i)));
        }
        if !mesh.triangles.is_empty() {
            meshes.push(mesh);
        }
    }
    Ok(meshes)
}

impl Placed {
    /// The box of what its triangles use.
    fn bounds(&self) -> (DVec3, f64) {
        let used = self.triangles.iter().flatten().map(|&i| self.positions[i as usize]);
        let (min, max) = used.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), p| (a.min(p), b.max(p)));
        let diagonal = (max - min).length();
        ((min + max) * 0.5, if diagonal > 0.0 { diagonal } else { 1.0 })
    }

    /// Positions, eye and what it looks at, scaled about the middle and moved so many extents away, in f32.
    fn at(&self, scale: f64, extents: f64) -> (Vec<[f32; 3]>, Vec3, Vec3) {
        let (middle, diagonal) = self.bounds();
        let by = DVec3::new(0.8, 0.36, -0.48) * (extents * diagonal);
        let place = |p: DVec3| ((p - middle) * scale + by).as_vec3();
        let eye = middle
            + DVec3::new(0.5, 0.35, 1.0).normalize() * (1.05 * 0.5 * diagonal / 20_f64.to_radians().sin());
        (self.positions.iter().map(|&p| place(p).to_array()).collect(), place(eye), place(middle))
    }
}

type Hits = (Vec<[f32; 3]>, Vec<Option<Hit>>, Vec<Ray>);

/// What camera rays hit in a place.
fn hits(mesh: &Placed, scale: f64, extents: f64) -> Hits {
    let (positions, eye, look_at) = mesh.at(scale, extents);
    let rays = camera_rays(eye, look_at);
    let tree = Arc::new(Tree::build(&positions, &mesh.triangles, Quality::default()));
    let scene = TracedScene::new(vec![TracedObject::new(tree, None)]);
    let hits = rays.iter().map(|ray| scene.closest(ray, None)).collect();
    (positions, hits, rays)
}

fn camera(eye: Vec3, look_at: Vec3) -> Camera {
    Camera { eye: eye.as_dvec3(), look_at: look_at.as_dvec3(), up: DVec3::Y, fov_deg: 40.0 }
}

/// The rays through the centres of pixels.
fn camera_rays(eye: Vec3, look_at: Vec3) -> Vec<Ray> {
    let constants = CameraConstants::new(&camera(eye, look_at), RAYS);
    let [w, h] = RAYS;
    (0..w * h).map(|i| camera_ray(&constants, (i % w) as f32 + 0.5, (i / w) as f32 + 0.5)).collect()
}

/// A picture without light of its own.
fn shot(eye: Vec3, look_at: Vec3, size: [u32; 2]) -> Shot {
    let mut aovs = AovSet::default();
    aovs.insert(Aov::Depth);
    aovs.insert(Aov::Id);
    Shot {
        camera: camera(eye, look_at),
        lights: vec![Light::Point {
            position: eye,
            color: Vec3::ONE,
            intensity: 1.0,
            falloff: Falloff::None,
        }],
        ambient: Vec3::ZERO,
        background: Background::Color(Vec3::ZERO),
        size,
        samples: 1,
        filter: Filter::Box,
        depth: 0,
        seed: 0,
        prune: 0.0,
        alpha: false,
        aovs,
    }
}

fn place(
    bench: &Bench,
    mesh: &Placed,
    scale: f64,
    extents: f64,
    home: &[Option<Hit>],
) -> Result<Found, BenchError> {
    let (positions, hits, rays) = hits(mesh, scale, extents);
    let references = reference(&positions, &mesh.triangles, &rays);
    let both = rays.iter().zip(&hits).zip(&references);
    let is_wrong = |((ray, hit), r): &((&Ray, &Option<Hit>), &Option<crate::accel::Reference>)| {
        disagreement(&positions, &mesh.triangles, ray, hit.as_ref(), r.as_ref()).is_some()
    };
    let wrong = both.filter(is_wrong).count();
    let lost = hits.iter().zip(home).filter(|(a, b)| a.map(|h| h.triangle) != b.map(|h| h.triangle)).count();
    let (_, eye, look_at) = mesh.at(scale, extents);
    let (dark, ns) = dark(bench, plain(positions, mesh.triangles.clone()), eye, look_at).map_err(failed)?;
    let percent = |n: usize, of: usize| 100.0 * n as f64 / of.max(1) as f64;
    Ok(Found { wrong: percent(wrong, rays.len()), lost: percent(lost, rays.len()), acne: dark, ns })
}

#[allow(clippy::needless_pass_by_value, reason = "it is passed on")]
fn failed(error: DeviceError) -> BenchError {
    BenchError::Frame(error.to_string())
}

/// The percentage of pixels that show something and are dark with the light in the eye, where none may be; and ns a pixel.
fn dark(bench: &Bench, geometry: Geometry, eye: Vec3, look_at: Vec3) -> Result<(f64, f64), DeviceError> {
    let frame = Frame { objects: vec![Object { geometry: Arc::new(geometry), transform: None }] };
    let shot = shot(eye, look_at, LIT);
    let no_threads =
        |e: rayon::ThreadPoolBuildError| DeviceError::Lost { device: "cpu".to_string(), why: e.to_string() };
    let mut device = CpuDevice::new(bench.options.threads, u64::MAX).map_err(no_threads)?;
    let plan = plan_frame(&frame, device.residency(), &Wishes::default());
    device.apply(&plan, &frame)?;
    let film = device.trace(&frame, &shot, &Stop::default())?.film.into_film();
    let mut times = Vec::new();
    for _ in 0..bench.rounds(5) {
        times.push(device.trace(&frame, &shot, &Stop::default())?.trace_ms);
    }
    let trace_ms = Spread::of(times).map_or(f64::NAN, |spread| spread.median);
    let depth = film.aovs.depth.unwrap_or_default();
    let seen = depth.iter().filter(|d| d.is_finite()).count();
    let is_dark = |(d, rgb): &(&f32, &[f32; 3])| d.is_finite() && rgb.iter().all(|x| *x <= 0.0);
    let dark = depth.iter().zip(&*film.rgb).filter(is_dark).count();
    let pixels = f64::from(LIT[0] * LIT[1]);
    Ok((100.0 * dark as f64 / seen.max(1) as f64, trace_ms * 1e6 / pixels))
}

/// The sequences that break refits, warm, with their ids held against brute force in every frame.
fn sequences(bench: &Bench, on_event: &mut dyn FnMut(&Event<'_>)) -> Result<Table, BenchError> {
    let mut table = Table::new(
        "hostile",
        "Sequences made to break refits, updated by the policy, all frames: rays that hit another triangle than by brute force in f64, %; those whose distance is off by more than 10^-5 of it; the surface-area cost over the last build's; a frame's tracing.",
        &["wrong, %", "distance off, %", "cost, times", "worst", "trace, ms"],
    );
    for hostile in HOSTILE {
        on_event(&Event::Stage(hostile.name));
        let folder = bench.room.path().join(format!("stability {}", hostile.name));
        let frames = if bench.options.quick { FRAMES / 2 } else { FRAMES };
        hostile.write(SIDE, frames, &folder)?;
        table.row(hostile.name, sequence(bench, &folder)?);
    }
    Ok(table)
}

fn sequence(bench: &Bench, folder: &Path) -> Result<[Cell; 5], BenchError> {
    let job = bench.job(folder, None)?;
    let sources = Sources::default();
    let mut device = CpuDevice::new(bench.options.threads, u64::MAX).map_err(|_| BenchError::NoThreads)?;
    let (mut ratios, mut times) = (Vec::new(), Vec::new());
    let (mut wrong, mut off, mut all) = (0, 0, 0_usize);
    for picture in &job.pictures {
        let frame =
            read_frame(&job, picture, &sources, true, &mut Warnings::default()).map_err(BenchError::Frame)?;
        let plan = plan_frame(&frame, device.residency(), &Wishes::default());
        let cost = device.apply(&plan, &frame).map_err(failed)?;
        ratios.extend(cost.cost_ratio.filter(|r| r.is_finite()));
        let (eye, look_at) = (Vec3::new(1.5, 1.2, 3.0), Vec3::ZERO);
        let shot = shot(eye, look_at, RAYS);
        let traced = device.trace(&frame, &shot, &Stop::default()).map_err(failed)?;
        times.push(traced.trace_ms);
        let film = traced.film.into_film();
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        let mut firsts = Vec::new();
        for object in &frame.objects {
            let first = positions.len() as u32;
            let triangles_before = triangles.len() as u32;
            firsts.extend(object.geometry.meshes.iter().map(|m| triangles_before + m.first_triangle));
            positions.extend_from_slice(&object.geometry.positions.0);
            triangles.extend(object.geometry.triangles.0.iter().map(|t| t.map(|i| first + i)));
        }
        let (depth, id) = (film.aovs.depth.unwrap_or_default(), film.aovs.id.unwrap_or_default());
        let rays = camera_rays(eye, look_at);
        let references = reference(&positions, &triangles, &rays);
        for (i, (ray, r)) in rays.iter().zip(&references).enumerate() {
            let [part, triangle] = id[i];
            let hit = depth[i].is_finite().then(|| Hit {
                distance: depth[i],
                object: 0,
                triangle: firsts.get(part as usize).copied().unwrap_or(0) + triangle,
                barycentric: [0.0; 2],
            });
            all += 1;
            let differs = disagreement(&positions, &triangles, ray, hit.as_ref(), r.as_ref()).is_some();
            let is_same = hit.map(|h| h.triangle) == r.map(|r| r.triangle);
            wrong += usize::from(differs && !is_same);
            off += usize::from(differs && is_same);
        }
    }
    let worst = ratios.iter().copied().fold(0.0, f64::max);
    let percent = |n: usize| Cell::from(100.0 * n as f64 / all.max(1) as f64);
    Ok([
        percent(wrong),
        percent(off),
        Cell::from(Spread::of(ratios)),
        worst.into(),
        Cell::from(Spread::of(times)),
    ])
}
