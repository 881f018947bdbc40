//! A tile of the picture: camera rays, the surfaces they meet, light, and on through what is transparent; many rays
//! at a time, so that neighbours share what they touch. What a pixel becomes depends on no other pixel.

use super::area::{AreaLight, AreaSample};
use super::band::FilmBand;
use super::camera::{CameraConstants, camera_ray};
use super::center::fill_center;
use super::direct::{Shading, ShadowRays, add_lights};
use super::light::LightRecord;
use super::path::Walk;
use super::sampler::place_in_pixel;
use super::shade::{Reflected, color};
use super::world::World;
use super::{RayCounts, SURFACES_MAX};
use crate::accel::{Aggregate, Hit, Ray};
use crate::math::Vec3;
use crate::scene::{Background, Frame, Light, Shot};
use std::ops::Range;

/// Everything that a frame's tiles have in common.
#[derive(Debug)]
pub struct Scene<'a, A> {
    /// What rays are traced against: the triangles of the frame.
    pub aggregate: &'a A,
    /// The surfaces of the frame.
    pub world: World<'a>,
    /// The camera.
    pub camera: CameraConstants,
    /// The lights in the order given.
    pub lights: Vec<LightRecord>,
    /// The triangles that glow, where the job lets them light the scene.
    pub area: Option<AreaLight>,
    /// The rest.
    pub shot: &'a Shot,
}

impl<'a, A: Aggregate> Scene<'a, A> {
    /// Takes a frame, what its rays are traced against, and a shot.
    pub fn new(aggregate: &'a A, frame: &'a Frame, shot: &'a Shot) -> Self {
        let world = World::new(frame);
        let samples = shot
            .lights
            .iter()
            .find_map(|l| if let Light::Area { samples } = l { Some(*samples) } else { None });
        Self {
            aggregate,
            area: samples.and_then(|samples| AreaLight::new(&world, samples)),
            world,
            camera: CameraConstants::new(&shot.camera, shot.size),
            lights: shot.lights.iter().filter_map(LightRecord::new).collect(),
            shot,
        }
    }

    /// Whether surfaces need nothing but lights at points and what is straight on behind them.
    fn is_direct(&self) -> bool {
        self.world.is_direct && self.area.is_none() && matches!(self.shot.background, Background::Color(_))
    }
}

/// Sums over a pixel's samples.
#[derive(Clone, Copy, Debug, Default)]
struct PixelSum {
    rgb: Vec3,
    albedo: Vec3,
    /// What the background counts for.
    through: f32,
}

/// A camera ray at a surface.
#[derive(Clone, Copy, Debug)]
struct Path {
    pixel: u32,
    hit: Hit,
    /// What is seen there counts for this.
    weight: f32,
    /// Whether no surface before it had d > 0.
    sees_first: bool,
}

/// Room for a tile's rays, kept from tile to tile.
#[derive(Debug, Default)]
pub struct TileBuffers {
    /// (column, row in the band).
    pixels: Vec<[u32; 2]>,
    rays: Vec<Ray>,
    hits: Vec<Option<Hit>>,
    sums: Vec<PixelSum>,
    paths: Vec<Path>,
    shadings: Vec<Shading>,
    shadow: ShadowRays,
}

/// Traces the given columns of a band. Asks `stopped` before each sample of its pixels; None where it said yes, and
/// the band's pixels are then not to be used.
pub fn trace_tile<A: Aggregate>(
    scene: &Scene<A>,
    band: &mut FilmBand,
    columns: Range<u32>,
    buffers: &mut TileBuffers,
    stopped: &dyn Fn() -> bool,
) -> Option<RayCounts> {
    let mut counts = RayCounts::default();
    let samples = scene.shot.samples;
    list_pixels(band.rows, &columns, &mut buffers.pixels);
    buffers.sums.clear();
    buffers.sums.resize(buffers.pixels.len(), PixelSum::default());
    for sample in 0..samples {
        if stopped() {
            return None;
        }
        buffers.aim(scene, band, |pixel| {
            place_in_pixel(scene.shot.filter, sample, samples, pixel, scene.shot.seed)
        });
        buffers.trace(scene, &mut counts);
        if scene.is_direct() {
            buffers.follow(scene, &mut counts);
        } else {
            buffers.walk(scene, band, sample, &mut counts);
        }
    }
    if band.wants_center() {
        if samples > 1 {
            buffers.aim(scene, band, |_| [0.5; 2]);
            buffers.trace(scene, &mut counts);
        }
        fill_center(scene.aggregate, &scene.world, band, &buffers.pixels, &buffers.rays, &buffers.hits);
    }
    buffers.store(scene.shot, band);
    Some(counts)
}

/// A side of the blocks that a tile's pixels are ordered by, so that rays side by side are close.
const BLOCK: u32 = 4;

/// Lists the pixels of a tile, (column, row in the band), in blocks: the order of its rays.
fn list_pixels(rows: u32, columns: &Range<u32>, pixels: &mut Vec<[u32; 2]>) {
    pixels.clear();
    for top in (0..rows).step_by(BLOCK as usize) {
        for left in columns.clone().step_by(BLOCK as usize) {
            for row in top..rows.min(top + BLOCK) {
                for x in left..columns.end.min(left + BLOCK) {
                    pixels.push([x, row]);
                }
            }
        }
    }
}

impl TileBuffers {
    /// Camera rays through the given place in each pixel.
    fn aim<A>(&mut self, scene: &Scene<A>, band: &FilmBand, place: impl Fn([u32; 2]) -> [f32; 2]) {
        self.rays.clear();
        self.rays.extend(self.pixels.iter().map(|&[x, row]| {
            let y = band.first_row + row;
            let [u, v] = place([x, y]);
            camera_ray(&scene.camera, x as f32 + u, y as f32 + v)
        }));
    }

    /// The first hit of each camera ray.
    fn trace<A: Aggregate>(&mut self, scene: &Scene<A>, counts: &mut RayCounts) {
        self.hits.clear();
        self.hits.resize(self.rays.len(), None);
        scene.aggregate.closest_batch(&self.rays, &mut self.hits);
        counts.camera += self.rays.len() as u64;
    }

    /// Adds what the camera rays see, one after the other with all that follows from each.
    fn walk<A: Aggregate>(&mut self, scene: &Scene<A>, band: &FilmBand, index: u32, counts: &mut RayCounts) {
        for (i, &[x, row]) in self.pixels.iter().enumerate() {
            let sample =
                AreaSample { pixel: [x, band.first_row + row], index, seed: scene.shot.seed, surface: 0 };
            let seen = Walk { scene, sample, counts }.camera(self.rays[i], self.hits[i]);
            let sum = &mut self.sums[i];
            sum.rgb += seen.rgb;
            sum.through += seen.through;
            sum.albedo += seen.albedo;
        }
    }

    /// Adds what the camera rays see, surface after surface.
    fn follow<A: Aggregate>(&mut self, scene: &Scene<A>, counts: &mut RayCounts) {
        self.paths.clear();
        for (pixel, hit) in (0..).zip(&self.hits) {
            match *hit {
                Some(hit) => self.paths.push(Path { pixel, hit, weight: 1.0, sees_first: true }),
                None => self.sums[pixel as usize].escape(scene.shot, 1.0),
            }
        }
        for _ in 0..SURFACES_MAX {
            if self.paths.is_empty() {
                break;
            }
            self.meet(&scene.world);
            add_lights(
                scene.aggregate,
                &scene.world,
                &scene.lights,
                &mut self.shadings,
                &mut self.shadow,
                counts,
            );
            self.add_colors(&scene.world, scene.shot.ambient);
            self.go_straight_on(scene);
        }
    }

    /// Looks up the surfaces that the paths are at; what they let through remains as the paths' weight.
    fn meet(&mut self, world: &World) {
        self.shadings.clear();
        for path in &mut self.paths {
            let ray = &self.rays[path.pixel as usize];
            let d = world.dissolve(&path.hit);
            if d > 0.0 {
                let surface = world.surface(ray, &path.hit);
                if path.sees_first {
                    self.sums[path.pixel as usize].albedo += surface.kd;
                    path.sees_first = false;
                }
                self.shadings.push(Shading {
                    pixel: path.pixel,
                    weight: path.weight * d,
                    surface,
                    view: -ray.direction,
                    sum: Reflected::default(),
                });
            }
            path.weight *= 1.0 - d;
        }
    }

    fn add_colors(&mut self, world: &World, ambient: Vec3) {
        for s in &self.shadings {
            let material = &world.materials[s.surface.material as usize];
            self.sums[s.pixel as usize].rgb += color(&s.surface, material, ambient, &s.sum) * s.weight;
        }
    }

    /// Takes the paths that count for something to their next surface or the background.
    fn go_straight_on<A: Aggregate>(&mut self, scene: &Scene<A>) {
        let Self { paths, rays, sums, .. } = self;
        paths.retain_mut(|path| {
            if path.weight == 0.0 || path.weight < scene.shot.prune {
                return false;
            }
            let after = scene.aggregate.order(&path.hit);
            let next = scene.aggregate.closest(&rays[path.pixel as usize], Some(after));
            if let Some(hit) = next {
                path.hit = hit;
            } else {
                sums[path.pixel as usize].escape(scene.shot, path.weight);
            }
            next.is_some()
        });
    }

    /// Writes the means over the samples.
    fn store(&self, shot: &Shot, band: &mut FilmBand) {
        let samples = shot.samples as f32;
        for (&pixel, sum) in self.pixels.iter().zip(&self.sums) {
            let place = band.place(pixel);
            band.rgb[place] = (sum.rgb / samples).into();
            if let Some(alpha) = &mut band.alpha {
                alpha[place] = 1.0 - sum.through / samples;
            }
            if let Some(albedo) = &mut band.albedo {
                albedo[place] = (sum.albedo / samples).into();
            }
        }
    }
}

impl PixelSum {
    /// A path that counts for `weight` leaves the scene. With alpha the background adds no colour.
    fn escape(&mut self, shot: &Shot, weight: f32) {
        self.through += weight;
        if let Background::Color(color) = shot.background
            && !shot.alpha
        {
            self.rgb += color * weight;
        }
    }
}
