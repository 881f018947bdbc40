//! Warm frames on a device without files: a sphere whose vertices move each frame, beside Mitsuba's script of the same
//! (`--mitsuba`); what a fit of trees costs; and rays through rooms.

use super::mitsuba::{Mitsuba, Rate};
use super::table::{Cell, Table};
use super::times::Spread;
use super::view::View;
use super::{Bench, BenchError};
use crate::clock::Stopwatch;
use crate::device::{Device, DeviceError, Output, Stop, Traced};
use crate::math::{DVec3, Vec3};
use crate::plan::{Update, Wishes, plan_frame};
use crate::scene::{
    AovSet, Background, Camera, Faces, Falloff, Filter, Frame, Geometry, Light, Material, MaterialRuns, Mesh,
    Object, Part, Positions, Shot, Triangles,
};
use std::collections::VecDeque;
use std::f32::consts::PI;
use std::sync::Arc;

/// Poses that take turns.
const POSES: u32 = 24;
/// Frames that are measured, after as many poses unmeasured.
const FRAMES: usize = 120;
/// How long frames are rendered before those that are measured, ms: clocks rise.
const WARM_MS: f64 = 400.0;
/// Longer than this neither goes on, where there are so many frames already: a CPU takes a second for what a GPU does in
/// milliseconds.
const LONG_MS: f64 = 1000.0;
const LEAST_FRAMES: usize = 3;
/// Around and from pole to pole: of the peer's sphere, 147,456 triangles, and of one of 1,048,576.
pub(super) const SPHERE: [u32; 2] = [384, 192];
const LARGE_SPHERE: [u32; 2] = [1024, 512];

/// Sizes of pictures, and samples a pixel.
const SHOTS: [([u32; 2], u32); 4] =
    [([1280, 720], 1), ([1920, 1080], 1), ([1280, 720], 16), ([1920, 1080], 16)];

#[allow(clippy::needless_pass_by_value, reason = "it stands where errors are mapped")]
pub(super) fn failed(error: DeviceError) -> BenchError {
    BenchError::Frame(error.to_string())
}

/// Frames a second, one at a time and as many under way as the device takes, as codes of 8 bits and as floats.
pub(super) fn frames(bench: &Bench, device: &mut dyn Device) -> Result<Table, BenchError> {
    let mut table = Table::new(
        "frames",
        "A warm frame without files, the sphere of 147,456 triangles deforming (update, trace, read back), frames/s; Mitsuba's float picture in the same run.",
        &[
            "one at a time",
            "under way",
            "Mitsuba",
            "one/Mitsuba",
            "under way/Mitsuba",
            "upload, ms",
            "refit, ms",
            "trace, ms",
            "read back, ms",
        ],
    );
    let poses = poses(SPHERE);
    let mitsuba: Vec<Rate> = bench.options.mitsuba.as_ref().map(Mitsuba::rates).unwrap_or_default();
    for (size, samples) in SHOTS {
        let shot = sphere_shot(&poses[0], size, samples);
        let peer = mitsuba.iter().find(|r| r.size == size && r.samples == samples).map(|r| r.frames_per_s);
        for (output, word) in [(Output::Codes { exposure_stops: 0.0 }, "8 bits"), (Output::Linear, "float")] {
            let rounds = bench.rounds(FRAMES);
            let one = run(device, &poses, &shot, output, rounds, 1)?;
            let most = device.most_under_way();
            let many = if most > 1 { Some(run(device, &poses, &shot, output, rounds, most)?) } else { None };
            let peer = Cell::from(peer);
            let one_rate = Cell::from(one.frames_per_s);
            let many_rate = Cell::from(many.map(|many| many.frames_per_s));
            table.row(
                format!("{}x{}, {samples} samples, {word}", size[0], size[1]),
                [
                    one_rate,
                    many_rate,
                    peer,
                    peer.times_in(one_rate),
                    peer.times_in(many_rate),
                    Spread::of(one.upload_ms).into(),
                    Spread::of(one.update_ms).into(),
                    Spread::of(one.trace_ms).into(),
                    Spread::of(one.readback_ms).into(),
                ],
            );
        }
    }
    Ok(table)
}

/// Fits of trees where they stand.
pub(super) fn refits(
    bench: &Bench,
    device: &mut dyn Device,
    meshes: &[super::trees::Mesh],
) -> Result<Table, BenchError> {
    let mut table = Table::new(
        "refit",
        "Fitting trees to moved vertices on the device, all vertices of the mesh moving.",
        &["triangles", "refit, ms", "ns a triangle"],
    );
    let mut all: Vec<(String, Vec<Frame>)> =
        vec![("sphere".to_string(), poses(SPHERE)), ("large sphere".to_string(), poses(LARGE_SPHERE))];
    all.extend(meshes.iter().filter(|m| m.name != "sheet").map(|m| (m.name.clone(), moving(&m.geometry))));
    for (name, frames) in all {
        let shot = sphere_shot(&frames[0], [64, 36], 1);
        // as in a run: a device that mostly waits clocks down, an H200 to half of it and less
        let most = device.most_under_way();
        let ran = run(device, &frames, &shot, Output::Linear, bench.rounds(FRAMES / 2), most)?;
        let triangles = frames[0].triangles() as f64;
        let ms = Spread::of(ran.update_ms);
        table.row(name, [triangles.into(), ms.into(), ms.map(|s| s.median * 1e6 / triangles).into()]);
    }
    Ok(table)
}

/// Camera and shadow rays a second, by the time of tracing and shading alone.
pub(super) fn rays(
    bench: &Bench,
    device: &mut dyn Device,
    meshes: &[super::trees::Mesh],
) -> Result<Table, BenchError> {
    let mut table = Table::new(
        "rays",
        "Camera and shadow rays, by the device's own time for tracing and shading, 10^9/s.",
        &["1280x720, 1", "1920x1080, 1", "1280x720, 16", "1920x1080, 16"],
    );
    let sphere = poses(SPHERE).remove(0);
    let mut all = vec![("sphere".to_string(), sphere.clone(), vec![sphere_shot(&sphere, [8, 8], 1)])];
    for mesh in meshes.iter().filter(|m| m.name != "sheet") {
        let frame = Frame { objects: vec![Object { geometry: Arc::clone(&mesh.geometry), transform: None }] };
        let shot = sphere_shot(&frame, [8, 8], 1);
        let grey = (!mesh.geometry.materials.is_empty()).then(|| grey(&mesh.geometry));
        let shots = mesh.view.map_or_else(|| shot.clone(), |view| from_inside(&shot, view));
        all.push((mesh.name.clone(), frame.clone(), vec![shots.clone()]));
        // what of it materials and textures cost
        all.extend(grey.clone().map(|frame| (format!("{}, grey", mesh.name), frame, vec![shots])));
        if mesh.view.is_some() {
            // what of it this one view is
            let frame = grey.unwrap_or(frame);
            let around = all_around(&mesh.geometry).map(|view| from_inside(&shot, view)).collect();
            all.push((format!("{}, grey, all around from its middle", mesh.name), frame, around));
        }
    }
    for (name, frame, shots) in all {
        let mut cells = [Cell::Absent; SHOTS.len()];
        for (cell, (size, samples)) in cells.iter_mut().zip(SHOTS) {
            let (mut rays, mut ms) = (0, 0.0);
            for shot in &shots {
                let shot = Shot { size, samples, ..shot.clone() };
                let output = Output::Codes { exposure_stops: 0.0 };
                // as in a run: a device that waits between frames clocks down
                let most = device.most_under_way();
                let ran = run(device, std::slice::from_ref(&frame), &shot, output, bench.rounds(20), most)?;
                rays += ran.rays;
                ms += Spread::of(ran.trace_ms).map_or(f64::NAN, |ms| ms.median);
            }
            *cell = (rays as f64 / ms * 1e-6).into();
        }
        table.row(name, cells);
    }
    Ok(table)
}

/// A shot from inside a room, with a lamp beside the eye, so that what is seen is lit.
fn from_inside(shot: &Shot, View { eye, look_at, fov_deg }: View) -> Shot {
    let point = |p: [f32; 3]| Vec3::from(p).as_dvec3();
    let (eye, look_at) = (point(eye), point(look_at));
    let camera = Camera { eye, look_at, up: DVec3::Y, fov_deg: fov_deg.into() };
    let beside = camera.axes().1 * 0.1 * (look_at - eye).length();
    let lights = vec![lamp((eye + beside).as_vec3())];
    Shot { camera, lights, ..shot.clone() }
}

/// Eight level views from the middle of a mesh's box.
fn all_around(geometry: &Geometry) -> impl Iterator<Item = View> {
    let (middle, diagonal) = extent(geometry);
    (0..8).map(move |i| {
        let angle = PI / 4.0 * i as f32;
        let ahead = Vec3::new(libm::cosf(angle), 0.0, libm::sinf(angle)) * (diagonal / 4.0);
        View { eye: middle.into(), look_at: (middle + ahead).into(), fov_deg: 60.0 }
    })
}

/// A mesh without its materials.
fn grey(geometry: &Geometry) -> Frame {
    let (material_runs, materials) = (Part::new(MaterialRuns::default()), Vec::new());
    let geometry = Arc::new(Geometry { material_runs, materials, ..geometry.clone() });
    Frame { objects: vec![Object { geometry, transform: None }] }
}

/// What some frames took.
#[derive(Default)]
struct Ran {
    frames_per_s: f64,
    upload_ms: Vec<f64>,
    update_ms: Vec<f64>,
    trace_ms: Vec<f64>,
    readback_ms: Vec<f64>,
    /// Camera and shadow rays of one frame.
    rays: u64,
}

/// Renders frames in turn, each fitted to the one before, with so many under way.
fn run(
    device: &mut dyn Device,
    frames: &[Frame],
    shot: &Shot,
    output: Output,
    count: usize,
    under_way: usize,
) -> Result<Ran, BenchError> {
    let mut ran = Ran::default();
    let mut uploads = VecDeque::new();
    let mut clock = Stopwatch::start();
    let mut warm = usize::MAX;
    let mut measured = 0;
    for i in 0.. {
        if i == 1 {
            // the first one may wait for kernels
            clock = Stopwatch::start();
        }
        let is_long = clock.ms() > LONG_MS;
        if warm == usize::MAX && (i >= frames.len() && clock.ms() > WARM_MS || i > 1 && is_long) {
            warm = i;
        }
        measured = i.saturating_sub(warm);
        if measured >= count || measured >= LEAST_FRAMES && is_long {
            break;
        }
        if i == warm {
            while !uploads.is_empty() {
                ran.take(device, &mut uploads, false)?;
            }
            clock = Stopwatch::start();
        }
        let frame = &frames[i % frames.len()];
        let wishes = Wishes { update: Update::Refit, ..Wishes::default() };
        let plan = plan_frame(frame, device.residency(), &wishes);
        let cost = device.apply(&plan, frame).map_err(failed)?;
        device.begin(frame, shot, output, &Stop::default()).map_err(failed)?;
        uploads.push_back(cost.upload_ms);
        while uploads.len() >= under_way {
            ran.take(device, &mut uploads, i >= warm)?;
        }
    }
    while !uploads.is_empty() {
        ran.take(device, &mut uploads, true)?;
    }
    ran.frames_per_s = measured as f64 / clock.s();
    Ok(ran)
}

impl Ran {
    fn take(
        &mut self,
        device: &mut dyn Device,
        uploads: &mut VecDeque<Option<f64>>,
        is_measured: bool,
    ) -> Result<(), BenchError> {
        let upload_ms = uploads.pop_front().flatten();
        let Traced { film, rays, trace_ms, update_ms, .. } = device.finish().map_err(failed)?;
        let clock = Stopwatch::start();
        let has_come = film.is_developed();
        std::hint::black_box(film.into_film());
        if is_measured {
            self.rays = rays.camera + rays.shadow;
            self.trace_ms.push(trace_ms);
            self.upload_ms.extend(upload_ms);
            self.update_ms.extend(update_ms);
            self.readback_ms.extend((!has_come).then(|| clock.ms()));
        }
        Ok(())
    }
}

/// The sphere of the peer's script in all its poses.
pub(super) fn poses([around, down]: [u32; 2]) -> Vec<Frame> {
    let point = |i: u32, j: u32| {
        let (v, u) = (PI * i as f32 / down as f32, 2.0 * PI * j as f32 / around as f32);
        [libm::sinf(v) * libm::cosf(u), libm::cosf(v), libm::sinf(v) * libm::sinf(u)]
    };
    let positions: Vec<[f32; 3]> = (0..=down).flat_map(|i| (0..around).map(move |j| point(i, j))).collect();
    let at = |i: u32, j: u32| i * around + j % around;
    let triangles: Vec<[u32; 3]> = (0..down)
        .flat_map(|i| {
            (0..around).flat_map(move |j| {
                [[at(i, j), at(i + 1, j + 1), at(i + 1, j)], [at(i, j), at(i, j + 1), at(i + 1, j + 1)]]
            })
        })
        .collect();
    moving(&plain(positions, triangles))
}

/// A mesh with one material, flat.
pub(super) fn plain(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Geometry {
    let count = triangles.len() as u32;
    Geometry {
        positions: Part::new(Positions(positions)),
        faces: Part::new(Faces { counts: vec![3; count as usize], corners: triangles.concat() }),
        triangles: Part::new(Triangles(triangles)),
        texcoords: None,
        normals: None,
        colors: None,
        material_runs: Part::new(MaterialRuns(vec![[0, 0]])),
        materials: vec![Part::new(Material::default())],
        meshes: vec![Mesh { first_face: 0, face_count: count, first_triangle: 0, triangle_count: count }],
    }
}

/// A mesh as waves run through it, as in the peer's script.
fn moving(geometry: &Geometry) -> Vec<Frame> {
    let (_, diagonal) = extent(geometry);
    let k = 12.0 / diagonal;
    let pose = |f: u32| {
        let s = 0.02 * diagonal * libm::sinf(2.0 * PI * f as f32 / POSES as f32);
        let moved = |&[x, y, z]: &[f32; 3]| {
            [x + s * libm::sinf(k * y), y + s * libm::sinf(k * z + 1.0), z + s * libm::sinf(k * x + 2.0)]
        };
        let positions = Part::new(Positions(geometry.positions.0.iter().map(moved).collect()));
        let geometry = Arc::new(Geometry { positions, ..geometry.clone() });
        Frame { objects: vec![Object { geometry, transform: None }] }
    };
    (0..POSES).map(pose).collect()
}

/// The middle of a mesh and its diagonal.
fn extent(geometry: &Geometry) -> (Vec3, f32) {
    let points = geometry.positions.0.iter().map(|&p| Vec3::from(p));
    let min = points.clone().fold(Vec3::INFINITY, Vec3::min);
    let max = points.fold(Vec3::NEG_INFINITY, Vec3::max);
    ((min + max) * 0.5, (max - min).length())
}

fn lamp(position: Vec3) -> Light {
    Light::Point { position, color: Vec3::ONE, intensity: 1.0, falloff: Falloff::None }
}

/// The camera and light of the peer's script.
pub(super) fn sphere_shot(frame: &Frame, size: [u32; 2], samples: u32) -> Shot {
    let (middle, diagonal) = extent(&frame.objects[0].geometry);
    Shot {
        camera: Camera {
            eye: (middle + Vec3::new(0.25, 0.2, 1.0) * diagonal).as_dvec3(),
            look_at: middle.as_dvec3(),
            up: DVec3::Y,
            fov_deg: 40.0,
        },
        lights: vec![lamp(middle + Vec3::new(0.6, 1.2, 1.0) * diagonal)],
        ambient: Vec3::ZERO,
        background: Background::Color(Vec3::ZERO),
        size,
        samples,
        filter: Filter::Box,
        depth: 10,
        seed: 0,
        prune: 1.0 / 4096.0,
        alpha: false,
        aovs: AovSet::default(),
    }
}
