//! Each GPU keeps what every device promises, and shows what the CPU shows. Without one the tests are left out and say so;
//! with `RENTIX_REQUIRE_GPU=1` they fail.

mod agreement;
#[path = "gpu/fits.rs"]
mod fits;
mod rays;
#[path = "gpu/scenes.rs"]
mod scenes;

use agreement::Agreement;
use glam::DQuat;
use rays::{Random, sphere};
use rentix::device::cpu::CpuDevice;
use rentix::device::gpu::{Adapter, GpuDevice, adapters};
use rentix::device::{Device, DeviceError, DeviceInfo, Output, Stop, Traced, UpdateCost, conformance};
use rentix::film::Film;
use rentix::film::quantize::quantize8;
use rentix::format::{ReadOptions, TextureCache, load_obj};
use rentix::job::{Options, Request, resolve};
use rentix::math::{DVec3, Vec3};
use rentix::plan::{Action, Residency, Update, UpdatePlan, Wishes, plan_frame};
use rentix::run::{Fleet, RunOptions, render};
use rentix::scene::{AovSet, Background, Camera, Filter, Frame, Material, Object, Shot};
use rentix::schedule::Policy;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

const BUDGET_BYTES: u64 = 1 << 27;

/// The adapters that can be used.
fn usable() -> Vec<Adapter> {
    let usable: Vec<Adapter> = adapters().into_iter().filter(|a| a.lacks().is_none()).collect();
    let is_required = std::env::var_os("RENTIX_REQUIRE_GPU").is_some_and(|v| v == "1");
    assert!(!usable.is_empty() || !is_required, "RENTIX_REQUIRE_GPU=1, but no adapter can be used");
    if usable.is_empty() {
        eprintln!("left out: no adapter can be used");
    }
    usable
}

/// Each of them, and as if it had nothing beyond what every adapter has.
fn usable_and_plain() -> Vec<Adapter> {
    usable().into_iter().flat_map(|a| [a.clone(), a.plain()]).collect()
}

fn open(adapter: &Adapter) -> GpuDevice {
    GpuDevice::new(adapter, 2, BUDGET_BYTES).expect("the adapter lacks nothing")
}

fn picture_as(device: &mut dyn Device, frame: &Frame, shot: &Shot, wishes: &Wishes) -> Film {
    let plan = plan_frame(frame, device.residency(), wishes);
    device.apply(&plan, frame).expect("the budget is ample");
    device.trace(frame, shot, &Stop::default()).expect("it is resident").film.into_film()
}

fn picture(device: &mut dyn Device, frame: &Frame, shot: &Shot) -> Film {
    picture_as(device, frame, shot, &Wishes::default())
}

/// Colour, coverage and auxiliary pictures as bytes.
fn bytes(film: &Film) -> Vec<u8> {
    let aovs = &film.aovs;
    let mut bytes = bytemuck::cast_slice(&film.rgb).to_vec();
    for floats in [&film.alpha, &aovs.depth, &aovs.coverage].into_iter().flatten() {
        bytes.extend_from_slice(bytemuck::cast_slice(floats));
    }
    for rows in [&aovs.normal, &aovs.position, &aovs.albedo].into_iter().flatten() {
        bytes.extend_from_slice(bytemuck::cast_slice(rows));
    }
    aovs.id.iter().for_each(|ids| bytes.extend_from_slice(bytemuck::cast_slice(ids)));
    aovs.material.iter().for_each(|slots| bytes.extend_from_slice(bytemuck::cast_slice(slots)));
    aovs.uv.iter().for_each(|uv| bytes.extend_from_slice(bytemuck::cast_slice(uv)));
    bytes
}

fn one(object: rentix::scene::Geometry) -> Frame {
    Frame { objects: vec![Object { geometry: Arc::new(object), transform: None }] }
}

#[test]
fn every_gpu_conforms() {
    for adapter in usable_and_plain() {
        conformance::check(&mut |budget| {
            Box::new(GpuDevice::new(&adapter, 2, budget).expect("the adapter lacks nothing"))
        });
    }
}

#[test]
fn gpus_show_what_the_cpu_shows() {
    let adapters = usable_and_plain();
    let scenes = if adapters.is_empty() { Vec::new() } else { scenes::all() };
    let mut cpu = CpuDevice::new(2, BUDGET_BYTES).unwrap();
    let right: Vec<Film> = scenes.iter().map(|s| picture(&mut cpu, &s.frame, &s.shot)).collect();
    for adapter in adapters {
        let mut gpu = open(&adapter);
        for (scene, right) in scenes.iter().zip(&right) {
            let agreement = Agreement::new(right, &picture(&mut gpu, &scene.frame, &scene.shot));
            agreement.check(&format!("{}: {}", adapter.name(), scene.name));
        }
    }
}

/// At a size at which most of a surface has no edge nearby.
#[test]
fn gpus_show_surfaces_as_the_cpu_does_block_by_block() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("sequences/inchworm/inchworm_0009.obj");
    let loaded = load_obj(&file, &ReadOptions::default(), &TextureCache::default()).unwrap();
    let points = loaded.geometry.positions.0.iter().map(|&p| Vec3::from(p).as_dvec3());
    let low = points.clone().fold(DVec3::INFINITY, DVec3::min);
    let high = points.fold(DVec3::NEG_INFINITY, DVec3::max);
    let (look_at, diagonal) = ((low + high) * 0.5, (high - low).length());
    let mut shot = scenes::shot([320, 180], 2);
    shot.camera = Camera { eye: look_at + DVec3::new(0.2, 0.3, 0.8) * diagonal, look_at, ..shot.camera };
    let frame = Frame { objects: vec![Object { geometry: loaded.geometry, transform: None }] };
    let mut cpu = CpuDevice::new(2, BUDGET_BYTES).unwrap();
    let right = picture(&mut cpu, &frame, &shot);
    let lit = right.rgb.iter().filter(|p| p[0] > 0.3).count();
    assert!(lit > right.rgb.len() / 20, "only {lit} pixels are lit");
    for adapter in usable() {
        let film = picture(&mut open(&adapter), &frame, &shot);
        Agreement::new(&right, &film).check_blocks(&adapter.name());
    }
}

/// From inside of a closed surface no background is seen, wherever it stands and however it is turned.
#[test]
fn no_ray_leaks_on_a_gpu() {
    const PLACES: [(f64, DVec3); 5] = [
        (1.0, DVec3::ZERO),
        (1e-3, DVec3::ZERO),
        (1e4, DVec3::ZERO),
        (100.0, DVec3::new(148_376.0, 1234.0, -223_423.0)),
        (37.3, DVec3::new(-1000.0, 3.0, 0.1)),
    ];
    let mut random = Random(5);
    let mut bumpy = sphere(4);
    for p in &mut bumpy.positions {
        *p = (Vec3::from(*p) * (0.7 + 0.3 * random.unit())).to_array();
    }
    for adapter in usable() {
        let mut gpu = open(&adapter);
        for (scale, by) in PLACES {
            let eye = random.direction().as_dvec3() * 0.5;
            let ahead = random.direction().as_dvec3();
            let mut shot = scenes::shot([49, 27], 1);
            shot.background = Background::Color(Vec3::new(1.0, 0.0, 1.0));
            shot.camera.eye = eye * scale + by;
            shot.camera.look_at = (eye + ahead) * scale + by;
            shot.camera.fov_deg = 90.0;
            for view in 0..12 {
                // the ray through the middle meets a vertex, or an edge
                let corners = bumpy.corners(random.below(bumpy.triangles.len()) as u32);
                let target = if view % 2 == 0 { corners[0] } else { corners[0].lerp(corners[1], 0.5) };
                let target = target.as_dvec3();
                let along = -eye.dot(ahead)
                    + (eye.dot(ahead).powi(2) + target.length_squared() - eye.length_squared()).sqrt();
                let seen_at = (eye + ahead * along).normalize();
                let turn = DQuat::from_axis_angle(seen_at, f64::from(random.unit()) * 6.0)
                    * DQuat::from_rotation_arc(target.normalize(), seen_at);
                let mut mesh = bumpy.clone();
                for p in &mut mesh.positions {
                    *p = ((turn * Vec3::from(*p).as_dvec3()) * scale + by).as_vec3().to_array();
                }
                let frame = one(scenes::geometry(&mesh, Some(Material { illum: 0, ..Material::default() })));
                let film = picture(&mut gpu, &frame, &shot);
                let what = format!("{}: x {scale} + {by}, view {view}", adapter.name());
                let leaks = film.aovs.id.unwrap().iter().filter(|id| id[0] == u32::MAX).count();
                assert_eq!(leaks, 0, "{what}: {:?}", shot.camera);
                assert!(film.aovs.coverage.unwrap().iter().all(|c| *c == 1.0), "{what}");
            }
        }
    }
}

/// A sequence on which refits decay or must not be tried, each frame with the scale that its picture has.
fn hostile() -> Vec<(Frame, f64)> {
    const SIDE: u32 = 13;
    let mut random = Random(9);
    let mut anywhere: Vec<Vec3> = Vec::new();
    for _ in 0..SIDE * SIDE {
        anywhere.push(random.cube());
    }
    let never = |_: u32| false;
    let odd = |n: u32| n % 2 == 1;
    let still = |_: u32, p: Vec3| p;
    let exploded = |n: u32, _: Vec3| anywhere[n as usize];
    let shuffled = |n: u32, _: Vec3| anywhere[((n * 37 + 5) % (SIDE * SIDE)) as usize];
    vec![
        (one(scenes::sheet(SIDE, never, still)), 1.0),
        (one(scenes::sheet(SIDE, never, exploded)), 1.0),
        (one(scenes::sheet(SIDE, odd, exploded)), 1.0),
        (one(scenes::sheet(SIDE, never, |_, p| p * 1e6)), 1e6),
        (one(scenes::sheet(SIDE, odd, |n, p| exploded(n, p) * 1e-6)), 1e-6),
        // rows fall together: triangles without area
        (
            one(scenes::sheet(SIDE, odd, |n, p| {
                if (n / SIDE).is_multiple_of(3) { still(n, p) } else { Vec3::new(p.x, 0.2, 0.0) }
            })),
            1.0,
        ),
        (one(scenes::sheet(SIDE, never, |_, _| Vec3::ZERO)), 1.0),
        (one(scenes::sheet(SIDE, never, |n, p| shuffled(n, p) * 1e6)), 1e6),
        (one(scenes::sheet(SIDE, |n| n % 3 == 0, shuffled)), 1.0),
        (one(scenes::sheet(SIDE, never, still)), 1.0),
    ]
}

/// A picture of something around the origin.
fn shot_at(scale: f64) -> Shot {
    let mut shot = scenes::shot([64, 36], 2);
    shot.camera.eye = DVec3::new(0.4, 0.9, 4.0) * scale;
    shot.camera.look_at = DVec3::ZERO;
    shot
}

#[test]
fn warm_is_cold_on_gpus_whatever_happens() {
    for adapter in usable() {
        let frames = hostile();
        let mut cold_device = open(&adapter);
        let cold: Vec<Vec<u8>> = frames
            .iter()
            .map(|(frame, scale)| {
                bytes(&picture_as(&mut cold_device, frame, &shot_at(*scale), &Wishes::cold()))
            })
            .collect();
        let different: std::collections::BTreeSet<_> = cold.iter().collect();
        assert_eq!(different.len(), frames.len() - 1, "all but the last show something else");
        for update in [Update::Refit, Update::Rebuild, Update::Auto] {
            let mut warm = open(&adapter);
            let mut actions = Vec::new();
            let backwards = (0..frames.len()).rev();
            for i in (0..frames.len()).chain(backwards) {
                let (frame, scale) = &frames[i];
                let wishes = Wishes { update, ..Wishes::default() };
                actions.push(plan_frame(frame, warm.residency(), &wishes).action);
                let film = picture_as(&mut warm, frame, &shot_at(*scale), &wishes);
                assert!(bytes(&film) == cold[i], "{}: frame {i}, {update:?}: {actions:?}", adapter.name());
            }
            if update == Update::Refit {
                assert!(
                    actions[1..].iter().all(|a| matches!(a, Action::Refit | Action::None)),
                    "{actions:?}"
                );
            }
        }
    }
}

#[test]
fn a_picture_beyond_the_largest_buffer_is_refused_with_the_figures() {
    for adapter in usable() {
        let (frame, shot) = (&one(scenes::sheet(13, |_| false, |_, p| p)), &shot_at(1.0));
        let mut gpu = open(&adapter);
        let right = bytes(&picture(&mut gpu, frame, shot));
        let rows = adapter.binding_bytes() / (16_384 * 12) + 1;
        let large = Shot { size: [16_384, rows as u32], aovs: AovSet::default(), ..shot.clone() };
        let error = gpu.begin(frame, &large, Output::Linear, &Stop::default()).unwrap_err();
        let DeviceError::BufferTooLarge { needed_bytes, most_bytes, .. } = &error else { panic!("{error}") };
        assert!(*most_bytes == adapter.binding_bytes() && *needed_bytes >= 16_384 * 12 * rows, "{error}");
        assert!(bytes(&picture(&mut gpu, frame, shot)) == right, "{}: it is not as before", adapter.name());
    }
}

/// Waiting rays take a part of the budget: in a small one there is no room for those of a whole row of tiles.
#[test]
fn a_deep_picture_is_traced_in_parts_of_rows() {
    for adapter in usable() {
        let scene = scenes::models();
        for samples in [1, 16] {
            // a strip across the balls: 41 and 81 tiles, 600 KB each
            let camera = Camera { fov_deg: 4.0, ..scene.shot.camera };
            let shot = Shot { camera, size: [321, 16], depth: 60, samples, ..scene.shot.clone() };
            let [whole, in_parts] = [1 << 30, 1 << 24].map(|budget_bytes| {
                let mut gpu = GpuDevice::new(&adapter, 2, budget_bytes).expect("the adapter lacks nothing");
                let film = picture(&mut gpu, &scene.frame, &shot);
                let lit = film.rgb.iter().filter(|p| p[0] > 0.3).count();
                assert!(lit > film.rgb.len() / 20, "only {lit} pixels are lit");
                bytes(&film)
            });
            assert!(whole == in_parts, "{}, {samples} samples", adapter.name());
        }
    }
}

#[test]
fn a_lost_gpu_says_so_once_and_begins_anew() {
    for adapter in usable() {
        let (frame, shot) = (&one(scenes::sheet(13, |_| false, |_, p| p)), &shot_at(1.0));
        let mut gpu = open(&adapter);
        let right = bytes(&picture(&mut gpu, frame, shot));
        let is_lost = |what: &str, error: Option<DeviceError>| {
            assert!(matches!(error, Some(DeviceError::Lost { .. })), "{}: {what}: {error:?}", adapter.name());
        };
        let again = |gpu: &mut GpuDevice, what: &str| {
            assert!(gpu.residency().held.is_empty(), "{what}: a lost device holds something");
            let plan = plan_frame(frame, gpu.residency(), &Wishes::default());
            assert_eq!(plan.action, Action::Load, "{what}");
            assert!(bytes(&picture(gpu, frame, shot)) == right, "{what}: the picture is another");
        };
        let plan = |gpu: &GpuDevice| plan_frame(frame, gpu.residency(), &Wishes::default());

        gpu.lose();
        is_lost("apply", gpu.apply(&plan(&gpu), frame).err());
        again(&mut gpu, "apply");

        gpu.apply(&plan(&gpu), frame).unwrap();
        gpu.lose();
        is_lost("begin", gpu.begin(frame, shot, Output::Linear, &Stop::default()).err());
        again(&mut gpu, "begin");

        gpu.apply(&plan(&gpu), frame).unwrap();
        gpu.begin(frame, shot, Output::Linear, &Stop::default()).unwrap();
        gpu.lose();
        is_lost("finish", gpu.finish().err());
        again(&mut gpu, "finish");

        // what was traced before is not lost, though it lies where the device wrote it
        let plain = &Shot { alpha: false, aovs: AovSet::default(), ..shot.clone() };
        let right = bytes(&picture(&mut gpu, frame, plain));
        gpu.apply(&plan(&gpu), frame).unwrap();
        gpu.begin(frame, plain, Output::Linear, &Stop::default()).unwrap();
        let film = gpu.finish().unwrap().film;
        assert!(!film.is_developed());
        gpu.lose();
        is_lost("apply", gpu.apply(&plan(&gpu), frame).err());
        assert!(bytes(&film) == right, "a film went with its device");
        drop(gpu);
        assert!(bytes(&film) == right, "a film went with its device when that was closed");
    }
}

/// A GPU that is lost once: when so many frames were begun.
struct LostOnce {
    gpu: GpuDevice,
    /// None: it was lost.
    frames_left: Option<u32>,
}

impl Device for LostOnce {
    fn info(&self) -> &DeviceInfo {
        self.gpu.info()
    }

    fn residency(&self) -> &Residency {
        self.gpu.residency()
    }

    fn apply(&mut self, plan: &UpdatePlan, frame: &Frame) -> Result<UpdateCost, DeviceError> {
        self.gpu.apply(plan, frame)
    }

    fn most_under_way(&self) -> usize {
        self.gpu.most_under_way()
    }

    fn begin(&mut self, frame: &Frame, shot: &Shot, output: Output, stop: &Stop) -> Result<(), DeviceError> {
        let begun = self.gpu.begin(frame, shot, output, stop);
        self.frames_left = match self.frames_left {
            Some(0) => {
                self.gpu.lose();
                None
            }
            left => left.map(|n| n - 1),
        };
        begun
    }

    fn finish(&mut self) -> Result<Traced, DeviceError> {
        self.gpu.finish()
    }
}

/// The pictures of a run of a folder on a device.
fn pictures_of_run(input: &Path, out: &Path, device: Box<dyn Device>) -> BTreeMap<String, Vec<u8>> {
    let job = resolve(&Request {
        inputs: vec![input.to_path_buf()],
        options: Options { size: Some([64, 36]), ..Options::default() },
        folder: Some(out.to_path_buf()),
        ..Request::default()
    })
    .unwrap();
    let options = RunOptions { threads: 2, keeps_reports: true, ..RunOptions::default() };
    let outcome =
        render(&job, &options, &Fleet::new(vec![device], Policy::default()), &Stop::default(), &mut |_| {})
            .unwrap();
    let failed: Vec<_> = outcome.failed().map(|f| &f.error).collect();
    assert!(failed.is_empty(), "{failed:?}");
    let entries = std::fs::read_dir(out).unwrap().map(|e| e.unwrap().path());
    let is_picture = |path: &std::path::PathBuf| path.extension().is_some_and(|e| e == "png");
    let named = |path: std::path::PathBuf| {
        (path.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(&path).unwrap())
    };
    entries.filter(is_picture).map(named).collect()
}

fn frames_of_two_triangles(room: &Path, frames: u32) -> PathBuf {
    let input = room.join("in");
    std::fs::create_dir(&input).unwrap();
    for frame in 1..=frames {
        let obj = format!("v -1 0 0\nv {frame} 0 0\nv 0 1 0\nv 0 0 {frame}\nf 1 2 3\nf 1 4 3\n");
        std::fs::write(input.join(format!("t_{frame}.obj")), obj).unwrap();
    }
    input
}

#[test]
fn a_run_goes_on_after_its_gpu_was_lost() {
    const FRAMES: u32 = 6;
    for adapter in usable() {
        let t = tempfile::tempdir().unwrap();
        let input = frames_of_two_triangles(t.path(), FRAMES);
        let run = |out: &str, frames_left| {
            let device = LostOnce { gpu: open(&adapter), frames_left };
            pictures_of_run(&input, &t.path().join(out), Box::new(device))
        };
        let right = run("right", None);
        assert_eq!(right.len(), FRAMES as usize);
        for frames_left in [0, 2, FRAMES - 1] {
            let pictures = run(&format!("lost {frames_left}"), Some(frames_left));
            assert!(pictures == right, "{}: lost after {frames_left}", adapter.name());
        }
    }
}

/// What hangs gives its frames back, and another device makes them.
#[test]
fn a_gpu_that_hangs_is_given_up() {
    for adapter in usable() {
        let frame = &one(scenes::sheet(13, |_| false, |_, p| p));
        // more than can be done in no time at all
        let shot = &Shot { size: [512, 512], samples: 16, ..shot_at(1.0) };
        let mut gpu = open(&adapter.clone().patient(Duration::ZERO));
        let plan = plan_frame(frame, gpu.residency(), &Wishes::default());
        let hangs = gpu.apply(&plan, frame).and_then(|_| gpu.trace(frame, shot, &Stop::default())).err();
        let says = |error: &DeviceError| error.to_string().contains("it hangs: nothing came of 0ns");
        assert!(hangs.as_ref().is_some_and(says), "{}: {hangs:?}", adapter.name());
        assert!(gpu.residency().held.is_empty(), "it is left, with what it held");

        let t = tempfile::tempdir().unwrap();
        let job = resolve(&Request {
            inputs: vec![frames_of_two_triangles(t.path(), 6)],
            options: Options { size: Some([512, 512]), samples: Some(16), ..Options::default() },
            folder: Some(t.path().join("out")),
            ..Request::default()
        });
        let cpu = CpuDevice::new(1, BUDGET_BYTES).expect("a thread can be had");
        let devices: Vec<Box<dyn Device>> = vec![Box::new(gpu), Box::new(cpu)];
        let options = RunOptions { threads: 2, keeps_reports: true, ..RunOptions::default() };
        let fleet = Fleet::new(devices, Policy::default());
        let outcome = render(&job.unwrap(), &options, &fleet, &Stop::default(), &mut |_| {}).unwrap();
        assert_eq!(outcome.report.totals.rendered, 6, "{:?}", outcome.report.warnings);
    }
}

/// Codes are those that the linear film has, where the exposure is whatever it is.
#[test]
fn codes_of_gpus_are_those_of_the_linear_film() {
    for adapter in usable_and_plain() {
        let mut gpu = open(&adapter);
        // what differs is how films are written: few scenes will do
        for mut scene in [scenes::instances(), scenes::colors()] {
            (scene.shot.aovs, scene.shot.alpha) = (AovSet::default(), false);
            scene.shot.filter = Filter::Box;
            let linear = picture(&mut gpu, &scene.frame, &scene.shot);
            for exposure_stops in [0.0, -1.5, 2.25] {
                let output = Output::Codes { exposure_stops };
                gpu.begin(&scene.frame, &scene.shot, output, &Stop::default()).unwrap();
                let codes =
                    gpu.finish().unwrap().film.into_film().codes.expect("nothing else is wanted of the film");
                let right = quantize8(&linear.rgb, None, exposure_stops);
                assert!(*codes == *right, "{}: {} at {exposure_stops}", adapter.name(), scene.name);
            }
        }
    }
}
