//! A tile of the picture: camera rays, the surfaces they meet, light, and on through what is transparent; many rays
//! at a time, so that neighbours share what they touch. What a pixel becomes depends on no other pixel.

use super::RayCounts;
use super::aim::aim;
use super::band::FilmBand;
use super::branch::{Border, Branches, Visit};
use super::center::fill_center;
use super::direct::{Constants, Sample, Shading, ShadowRays, add_lights};
use super::material::{HALO, MaterialRecord, TEXTURED};
use super::optics::reflectance_upright;
use super::path::{Path, PixelSum};
use super::sampler::Places;
use super::scene::Scene;
use super::shade::{Reflected, color};
use crate::accel::{Aggregate, Hit, Ray};
use crate::math::Vec3;
use crate::scene::Shot;
use std::ops::Range;

/// Room for a tile's rays, kept from tile to tile.
#[derive(Debug, Default)]
pub struct TileBuffers {
    /// (column, row in the band).
    pixels: Vec<[u32; 2]>,
    /// The point of the picture that each camera ray goes through.
    points: Vec<[f32; 2]>,
    /// The ray of each pixel's path.
    rays: Vec<Ray>,
    hits: Vec<Option<Hit>>,
    sums: Vec<PixelSum>,
    paths: Vec<Path>,
    shadings: Vec<Shading>,
    /// Constants of materials that are those of one shading point only.
    own_constants: Vec<MaterialRecord>,
    /// For each pixel; empty where no material is of a model beyond 2.
    branches: Vec<Branches>,
    shadow: ShadowRays,
}

/// Traces the given columns of a band. Asks `stopped` at each step of its paths; None where it said yes, and
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
        buffers.aim(scene, band, Places::new(scene.shot.filter, sample, samples, scene.shot.seed));
        buffers.trace(scene, &mut counts);
        buffers.start(scene);
        for step in 0.. {
            if buffers.paths.is_empty() {
                break;
            }
            if stopped() {
                return None;
            }
            buffers.meet(scene);
            buffers.light(scene, band.first_row, sample, step, &mut counts);
            buffers.settle(scene, &mut counts);
            buffers.go_on(scene);
        }
    }
    if band.wants_center() {
        // of a single sample the hits are those of these rays, but mirrored rays may have taken their places
        buffers.aim(scene, band, Places::middle());
        if samples > 1 {
            buffers.trace(scene, &mut counts);
        }
        fill_center(scene, band, &buffers.pixels, &buffers.rays, &buffers.hits);
    }
    buffers.store(scene.shot, band);
    Some(counts)
}

/// The hit of a path that meets nothing.
const NOWHERE: Hit = Hit { distance: f32::INFINITY, object: 0, triangle: 0, barycentric: [0.0; 2] };

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
    /// Camera rays through these places.
    fn aim<A>(&mut self, scene: &Scene<A>, band: &FilmBand, places: Places) {
        let Self { pixels, points, rays, .. } = self;
        aim(&scene.camera, places, band.first_row, pixels, points, rays);
    }

    /// The first hit of each camera ray.
    fn trace<A: Aggregate>(&mut self, scene: &Scene<A>, counts: &mut RayCounts) {
        self.hits.clear();
        self.hits.resize(self.rays.len(), None);
        scene.aggregate.closest_batch(&self.rays, &mut self.hits);
        counts.camera += self.rays.len() as u64;
    }

    /// The paths of one sample begin.
    fn start<A>(&mut self, scene: &Scene<A>) {
        self.paths.clear();
        for (pixel, hit) in (0..).zip(&self.hits) {
            let path = |hit| Path::new(pixel, hit);
            match *hit {
                Some(hit) => self.paths.push(path(hit)),
                None => {
                    self.sums[pixel as usize].escape(scene.shot, &path(NOWHERE), &self.rays[pixel as usize]);
                }
            }
        }
        if scene.world.has_models_beyond_2 {
            self.branches.resize(self.pixels.len(), Branches::default());
            self.branches.iter_mut().for_each(Branches::start);
        }
    }

    /// Looks up the surfaces that the paths are at; what they let through remains as the paths' weight.
    fn meet<A>(&mut self, scene: &Scene<A>) {
        let world = &scene.world;
        self.shadings.clear();
        self.own_constants.clear();
        for (place, path) in (0..).zip(&mut self.paths) {
            let pixel = path.pixel as usize;
            let ray = &self.rays[pixel];
            let material = world.material(&path.hit);
            let mut m = &world.materials[material as usize];
            if m.cover() == 0.0 && !m.is(TEXTURED) {
                continue;
            }
            let mut surface = world.surface(ray, &path.hit, material);
            let mut constants = material;
            if m.is(TEXTURED | HALO) || m.illum == 7 && m.ks == Vec3::ZERO {
                let width = scene.spread * (path.travelled + path.hit.distance);
                let mut own = world.changed(ray, &path.hit, &mut surface, width).unwrap_or(*m);
                if own.illum == 7 && own.ks == Vec3::ZERO {
                    let border = Border::new(world, &self.branches[pixel].media, &surface);
                    own.ks = Vec3::splat(reflectance_upright(border.n1, border.n2));
                }
                constants = (world.materials.len() + self.own_constants.len()) as u32;
                self.own_constants.push(own);
                m = &self.own_constants[self.own_constants.len() - 1];
            }
            if path.sees_first && m.d > 0.0 {
                self.sums[pixel].albedo += surface.kd;
                path.sees_first = false;
            }
            let cover = m.cover();
            self.shadings.push(Shading {
                path: place,
                pixel: path.pixel,
                weight: path.weight * cover,
                surface,
                constants,
                view: -ray.direction,
                sum: Reflected::default(),
            });
            path.weight *= 1.0 - cover;
        }
    }

    /// Adds up the lights on the surfaces.
    fn light<A: Aggregate>(
        &mut self,
        scene: &Scene<A>,
        first_row: u32,
        index: u32,
        step: u32,
        counts: &mut RayCounts,
    ) {
        let constants = Constants { all: &scene.world.materials, own: &self.own_constants };
        let sample = Sample { pixels: &self.pixels, first_row, index, step };
        add_lights(scene, constants, sample, &mut self.shadings, &mut self.shadow, counts);
    }

    /// Adds what the surfaces show.
    fn settle<A>(&mut self, scene: &Scene<A>, counts: &mut RayCounts) {
        let constants = Constants { all: &scene.world.materials, own: &self.own_constants };
        for shading in &self.shadings {
            let m = constants.of(shading);
            let pixel = shading.pixel as usize;
            let sum = &mut self.sums[pixel];
            if m.illum > 2 {
                let visit = Visit { scene, shading, constants: m, ray: &self.rays[pixel] };
                let path = &mut self.paths[shading.path as usize];
                self.branches[pixel].settle(&visit, path, sum, counts);
            } else {
                sum.rgb += color(&shading.surface, m, scene.shot.ambient, &shading.sum) * shading.weight;
            }
        }
    }

    /// Takes the paths to their next surfaces; those that find none end.
    fn go_on<A: Aggregate>(&mut self, scene: &Scene<A>) {
        let Self { paths, rays, sums, branches, .. } = self;
        paths.retain_mut(|path| {
            let pixel = path.pixel as usize;
            let (ray, sum) = (&mut rays[pixel], &mut sums[pixel]);
            match branches.get_mut(pixel) {
                Some(branches) => branches.go_on(scene, ray, path, sum),
                None => path.go_straight_on(scene, ray, Vec3::ONE, sum),
            }
        });
    }

    /// Writes the means over the samples.
    fn store(&self, shot: &Shot, band: &mut FilmBand) {
        let samples = shot.samples as f32;
        for (&pixel, sum) in self.pixels.iter().zip(&self.sums) {
            let place = band.place(pixel);
            band.color.put(place, (sum.rgb / samples).into());
            if let Some(alpha) = &mut band.alpha {
                alpha[place] = 1.0 - sum.through / samples;
            }
            if let Some(coverage) = &mut band.coverage {
                coverage[place] = 1.0 - sum.through / samples;
            }
            if let Some(albedo) = &mut band.albedo {
                albedo[place] = (sum.albedo / samples).into();
            }
        }
    }
}
