//! What shading costs beside tracing: a picture of the CPU device with one point light and one sample, against its rays
//! alone, on all cores. Medians.
//!
//! `cargo bench --bench shade -- FILE.obj [RUNS] [ex,ey,ez,lx,ly,lz]`

use rayon::prelude::*;
use rentix::accel::{Aggregate, Quality, Ray, TracedObject, TracedScene, Tree};
use rentix::clock::Stopwatch;
use rentix::device::cpu::CpuDevice;
use rentix::device::{Device, Stop};
use rentix::kernel::camera::{CameraConstants, camera_ray};
use rentix::math::{DVec3, Vec3};
use rentix::plan::{Wishes, plan_frame};
use rentix::scene::{
    AovSet, Background, Camera, Faces, Falloff, Filter, Frame, Geometry, Light, Material, MaterialRuns, Mesh,
    Object, Part, Positions, Shot, Triangles,
};
use std::hint::black_box;
use std::sync::Arc;

const SIZE: [u32; 2] = [1280, 720];

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|w| w != "--bench").collect();
    let Some(file) = words.first() else {
        eprintln!("usage: shade FILE.obj [RUNS] [ex,ey,ez,lx,ly,lz]");
        return;
    };
    let runs = words.get(1).and_then(|w| w.parse().ok()).unwrap_or(9);
    let Ok(text) = std::fs::read_to_string(file) else {
        eprintln!("{file}: cannot be read");
        return;
    };
    let (positions, triangles) = load(&text);
    let (min, max) = positions
        .iter()
        .map(|p| Vec3::from(*p))
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |b, p| (b.0.min(p), b.1.max(p)));
    let (centre, diagonal) = ((min + max) / 2.0, (max - min).length());
    let view: Option<Vec<f32>> = words.get(2).map(|w| w.split(',').filter_map(|x| x.parse().ok()).collect());
    let (eye, look_at) = match view.as_deref() {
        Some([a, b, c, d, e, f]) => (Vec3::new(*a, *b, *c), Vec3::new(*d, *e, *f)),
        _ => (
            centre + 1.05 * 0.5 * diagonal / 20f32.to_radians().sin() * Vec3::new(0.5, 0.35, 1.0).normalize(),
            centre,
        ),
    };
    let light = if view.is_some() {
        eye + Vec3::Y * (0.05 * diagonal)
    } else {
        centre + Vec3::new(0.5, 1.0, 1.0) * diagonal
    };
    println!("{file}: {} triangles, {} threads", triangles.len(), rayon::current_num_threads());

    let camera = Camera { eye: eye.as_dvec3(), look_at: look_at.as_dvec3(), up: DVec3::Y, fov_deg: 40.0 };
    let tree = Arc::new(Tree::build(&positions, &triangles, Quality::default()));
    let scene = TracedScene::new(vec![TracedObject::new(tree, None)]);
    let rays_ms = median(runs, || black_box(rays_alone(&scene, &camera, light)));
    println!("rays alone        {rays_ms:8.2} ms");

    for (name, illum, ks) in [("model 1", 1, 0.0), ("model 2, Ns 50", 2, 0.5)] {
        let material = Material { illum, ks: [ks; 3], ns: 50.0, ..Material::default() };
        let frame = Frame {
            objects: vec![Object {
                geometry: Arc::new(geometry(&positions, &triangles, material)),
                transform: None,
            }],
        };
        let shot = shot(camera, light);
        let mut device = CpuDevice::new(0, u64::MAX).expect("threads");
        let plan = plan_frame(&frame, device.residency(), &Wishes::default());
        let cost = device.apply(&plan, &frame).expect("no budget");
        let ms = median(runs, || black_box(device.trace(&frame, &shot, &Stop::default()).expect("resident")));
        println!(
            "{name:17} {ms:8.2} ms  {:.2} of the rays alone; tree {:.1} ms",
            ms / rays_ms,
            cost.update_ms.unwrap_or(0.0)
        );
        let residency = device.residency();
        println!(
            "                  {} bytes a triangle",
            (residency.bytes() - plan.part_bytes) / triangles.len() as u64
        );
    }
}

fn median<T>(runs: usize, mut f: impl FnMut() -> T) -> f64 {
    let mut times: Vec<f64> = (0..runs)
        .map(|_| {
            let start = Stopwatch::start();
            f();
            start.ms()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Camera rays and a shadow ray from each hit, in blocks of 4 × 4 pixels; gives the number that reach the light.
fn rays_alone(scene: &TracedScene, camera: &Camera, light: Vec3) -> usize {
    let camera = CameraConstants::new(camera, SIZE);
    (0..SIZE[1] / 8)
        .into_par_iter()
        .map(|band| {
            let (mut rays, mut lit) = (Vec::new(), 0);
            for tile in 0..SIZE[0] / 32 {
                rays.clear();
                for block in 0..16 {
                    for pixel in 0..16 {
                        let x = 32 * tile + 4 * (block % 8) + pixel % 4;
                        let y = 8 * band + 4 * (block / 8) + pixel / 4;
                        rays.push(camera_ray(&camera, x as f32 + 0.5, y as f32 + 0.5));
                    }
                }
                let mut hits = vec![None; rays.len()];
                scene.closest_batch(&rays, &mut hits);
                let shadow: Vec<Ray> = rays
                    .iter()
                    .zip(&hits)
                    .filter_map(|(ray, hit)| {
                        let origin = ray.origin + ray.direction * (hit.as_ref()?.distance * 0.9999);
                        Some(Ray { origin, direction: light - origin })
                    })
                    .collect();
                let mut occluded = vec![false; shadow.len()];
                scene.occluded_batch(&shadow, &vec![1.0; shadow.len()], &mut occluded);
                lit += occluded.iter().filter(|o| !**o).count();
            }
            lit
        })
        .sum()
}

fn geometry(positions: &[[f32; 3]], triangles: &[[u32; 3]], material: Material) -> Geometry {
    let count = triangles.len() as u32;
    Geometry {
        positions: Part::new(Positions(positions.to_vec())),
        faces: Part::new(Faces { counts: vec![3; triangles.len()], corners: triangles.concat() }),
        triangles: Part::new(Triangles(triangles.to_vec())),
        texcoords: None,
        normals: None,
        colors: None,
        material_runs: Part::new(MaterialRuns(vec![[0, 0]])),
        materials: vec![Part::new(material)],
        meshes: vec![Mesh { first_face: 0, face_count: count, first_triangle: 0, triangle_count: count }],
    }
}

fn shot(camera: Camera, position: Vec3) -> Shot {
    Shot {
        camera,
        lights: vec![Light::Point { position, color: Vec3::ONE, intensity: 1.0, falloff: Falloff::None }],
        ambient: Vec3::splat(0.1),
        background: Background::Color(Vec3::ZERO),
        size: SIZE,
        samples: 1,
        filter: Filter::Box,
        depth: 10,
        seed: 0,
        prune: 1.0 / 4096.0,
        alpha: false,
        aovs: AovSet::default(),
    }
}

fn load(text: &str) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => positions
                .push(std::array::from_fn(|_| words.next().and_then(|w| w.parse().ok()).unwrap_or(0.0))),
            Some("f") => {
                let index = |w: &str| w.split('/').next()?.parse::<i64>().ok();
                let place = |i: i64| if i < 0 { positions.len() as i64 + i } else { i - 1 } as u32;
                let corners: Vec<u32> = words.filter_map(index).map(place).collect();
                triangles.extend((2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]));
            }
            _ => {}
        }
    }
    (positions, triangles)
}
