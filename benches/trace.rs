//! Builds a tree and traces camera rays and one shadow ray a hit, on all cores, without the rest of rentix.
//!
//! `cargo bench --bench trace -- FILE.obj [--eye x,y,z --look-at x,y,z] [--fov 40] [--size 1280x720] [--runs 9]
//! [--quality fastest]`
//!
//! Camera, light and rays are those of the Embree yardstick: a point light 1.5 diagonals above the box's centre, on the
//! eye's side; shadow rays start 1e-3 of the way to the light.

use rayon::prelude::*;
use rentix::accel::{Aggregate, Quality, Ray, TracedObject, TracedScene, Tree, Width};
use rentix::math::Vec3;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

struct Options {
    file: String,
    view: Option<(Vec3, Vec3)>,
    fov_deg: f32,
    size: [usize; 2],
    runs: usize,
    quality: Option<Quality>,
}

fn main() {
    let Some(o) = options() else {
        eprintln!(
            "usage: trace FILE.obj [--eye x,y,z --look-at x,y,z] [--fov DEG] [--size WxH] [--runs N] [--quality NAME]"
        );
        return;
    };
    let Ok(text) = std::fs::read_to_string(&o.file) else {
        eprintln!("{}: cannot be read", o.file);
        return;
    };
    let (positions, triangles) = load(&text);
    let camera = Camera::new(&o, &positions);
    println!("{}: {} triangles, {} threads", o.file, triangles.len(), rayon::current_num_threads());
    for quality in Quality::ALL.into_iter().filter(|q| o.quality.is_none_or(|o| o == *q)) {
        let (build, mut tree) = measure(o.runs, || Tree::build(&positions, &triangles, quality));
        let (refit, ()) = measure(o.runs, || tree.refit(&positions, &triangles));
        let megabytes = tree.bytes() as f64 / 1e6;
        println!("{quality:?}: build {build}, refit {refit}, {megabytes:.1} MB, {:?}", tree.counts());
        let scene = TracedScene::new(vec![TracedObject::new(Arc::new(tree), None)]);
        for &width in Width::available() {
            let scene = scene.clone().with_width(width);
            for mode in [Mode::Single, Mode::Batch] {
                trace(&scene, &camera, mode, o.runs, &format!("{quality:?} {width:?}"));
            }
        }
    }
}

/// How rays are handed over.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    /// One by one.
    Single,
    /// A tile at once.
    Batch,
}

/// Pixels of a tile, a square of 4.
const TILE: usize = 16;

fn trace(scene: &TracedScene, camera: &Camera, mode: Mode, runs: usize, name: &str) {
    let [w, h] = camera.size;
    let mut distances = vec![[f32::INFINITY; TILE]; w * h / TILE];
    let mut shadowed = vec![[false; TILE]; distances.len()];
    let (camera_times, ()) = measure(runs, || {
        distances.par_iter_mut().with_min_len(w / 4).enumerate().for_each(|(tile, distances)| {
            let rays = camera.rays(tile);
            if mode == Mode::Batch {
                let mut hits = [None; TILE];
                scene.closest_batch(&rays, &mut hits);
                *distances = hits.map(|h| h.map_or(f32::INFINITY, |h| h.distance));
            } else {
                *distances = rays.map(|ray| scene.closest(&ray, None).map_or(f32::INFINITY, |h| h.distance));
            }
        });
    });
    let (shadow_times, ()) = measure(runs, || {
        shadowed.par_iter_mut().with_min_len(w / 4).zip(&distances).enumerate().for_each(
            |(tile, (shadowed, distances))| {
                let mut rays = camera.rays(tile);
                let mut ends = [0.0; TILE];
                let mut count = 0;
                for i in 0..TILE {
                    if distances[i] < f32::INFINITY {
                        let point = rays[i].origin + rays[i].direction * distances[i];
                        let to_light = camera.light - point;
                        rays[count] = Ray { origin: point + 1e-3 * to_light, direction: to_light };
                        ends[count] = 1.0 - 1e-3;
                        count += 1;
                    }
                }
                if mode == Mode::Batch {
                    scene.occluded_batch(&rays[..count], &ends[..count], &mut shadowed[..count]);
                } else {
                    for ((s, ray), end) in shadowed.iter_mut().zip(&rays[..count]).zip(ends) {
                        *s = scene.occluded(ray, end);
                    }
                }
            },
        );
    });
    let hits = distances.as_flattened().iter().filter(|d| d.is_finite()).count();
    println!(
        "{name} {mode:?}: camera {camera_times}, shadow {shadow_times}, together {:.1} ms; {hits} hits, {} shadowed",
        camera_times.median + shadow_times.median,
        shadowed.as_flattened().iter().filter(|s| **s).count()
    );
}

/// Times of some runs, ms.
#[derive(Clone, Copy, Debug)]
struct Times {
    median: f64,
    least: f64,
}

impl std::fmt::Display for Times {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.1} ms (least {:.1})", self.median, self.least)
    }
}

/// Runs something some times after once that is not counted; gives the last result too.
fn measure<T>(runs: usize, mut f: impl FnMut() -> T) -> (Times, T) {
    let mut last = black_box(f());
    let mut times: Vec<f64> = (0..runs.max(1))
        .map(|_| {
            let start = Instant::now();
            last = black_box(f());
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    (Times { median: times[times.len() / 2], least: times[0] }, last)
}

struct Camera {
    eye: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    light: Vec3,
    size: [usize; 2],
}

impl Camera {
    fn new(o: &Options, positions: &[[f32; 3]]) -> Self {
        let points = positions.iter().map(|&p| Vec3::from(p));
        let min = points.clone().fold(Vec3::INFINITY, Vec3::min);
        let max = points.fold(Vec3::NEG_INFINITY, Vec3::max);
        let (middle, diagonal) = ((min + max) * 0.5, (max - min).length());
        let (eye, look_at) = o.view.unwrap_or((middle + Vec3::new(0.25, 0.2, 1.0) * diagonal, middle));
        let light =
            middle + ((eye - middle).normalize() + Vec3::new(0.4, 1.0, 0.2)).normalize() * (1.5 * diagonal);
        let forward = (look_at - eye).normalize();
        let right = forward.cross(Vec3::Y).normalize();
        let half = (0.5 * o.fov_deg).to_radians().tan();
        let aspect = o.size[0] as f32 / o.size[1] as f32;
        Self {
            eye,
            right: right * half * aspect,
            up: right.cross(forward) * half,
            forward,
            light,
            size: o.size,
        }
    }

    /// The rays of a tile, row by row; the picture's size is a multiple of 4.
    fn rays(&self, tile: usize) -> [Ray; TILE] {
        let tiles = self.size[0] / 4;
        let (x, y) = (tile % tiles * 4, tile / tiles * 4);
        std::array::from_fn(|i| Ray { origin: self.eye, direction: self.direction(x + i % 4, y + i / 4) })
    }

    fn direction(&self, x: usize, y: usize) -> Vec3 {
        let u = 2.0 * (x as f32 + 0.5) / self.size[0] as f32 - 1.0;
        let v = 1.0 - 2.0 * (y as f32 + 0.5) / self.size[1] as f32;
        (self.right * u + self.up * v + self.forward).normalize()
    }
}

/// Positions and triangles of an OBJ: `v` and `f` lines, fans.
fn load(text: &str) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => positions
                .push(std::array::from_fn(|_| words.next().and_then(|w| w.parse().ok()).unwrap_or(0.0))),
            Some("f") => {
                let corners: Vec<u32> = words
                    .filter_map(|w| w.split('/').next()?.parse::<i64>().ok())
                    .map(|i| if i < 0 { positions.len() as i64 + i } else { i - 1 } as u32)
                    .collect();
                triangles.extend((2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]));
            }
            _ => {}
        }
    }
    (positions, triangles)
}

fn options() -> Option<Options> {
    let mut o =
        Options { file: String::new(), view: None, fov_deg: 40.0, size: [1280, 720], runs: 9, quality: None };
    let (mut eye, mut look_at) = (None, None);
    let mut words = std::env::args().skip(1).filter(|w| w != "--bench");
    while let Some(word) = words.next() {
        match word.as_str() {
            "--eye" => eye = Some(vec3(&words.next()?)?),
            "--look-at" => look_at = Some(vec3(&words.next()?)?),
            "--fov" => o.fov_deg = words.next()?.parse().ok()?,
            "--runs" => o.runs = words.next()?.parse().ok()?,
            "--size" => {
                let size = words.next()?;
                let (w, h) = size.split_once('x')?;
                o.size =
                    [w.parse::<usize>().ok()?, h.parse().ok()?].map(|n: usize| n.next_multiple_of(4).max(4));
            }
            "--quality" => {
                let name = words.next()?;
                o.quality =
                    Some(Quality::ALL.into_iter().find(|q| format!("{q:?}").eq_ignore_ascii_case(&name))?);
            }
            _ => o.file = word,
        }
    }
    o.view = eye.zip(look_at);
    (!o.file.is_empty()).then_some(o)
}

fn vec3(text: &str) -> Option<Vec3> {
    let mut numbers = text.split(',').map(str::parse);
    Some(Vec3::new(numbers.next()?.ok()?, numbers.next()?.ok()?, numbers.next()?.ok()?))
}
