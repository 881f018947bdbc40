//! Models 3 to 10: what their surfaces add, and where paths go from there. Each pixel has one path at a time; the others
//! wait, the latest first, so that a pixel's sums have one order and its memory is bounded by depth.

use super::RayCounts;
use super::direct::Shading;
use super::environment::{background, reflection};
use super::material::MaterialRecord;
use super::media::Media;
use super::optics::{mirrored, refracted, schlick};
use super::path::{Path, PixelSum, counts};
use super::scene::Scene;
use super::shade::{Reflected, color};
use super::world::{Surface, World};
use crate::accel::{Aggregate, Ray, offset_origin};
use crate::math::Vec3;

/// What a pixel's path has beside it in frames with models beyond 2.
#[derive(Clone, Debug, Default)]
pub struct Branches {
    /// What the path is inside of.
    pub media: Media,
    /// What the sum that is being added up counts for in the picture.
    base: Vec3,
    waiting: Vec<Waiting>,
}

/// What goes on when the path ends.
#[derive(Clone, Debug)]
enum Waiting {
    /// A mirrored or refracted ray.
    Ray(Start),
    /// A ray that goes straight on from its surface.
    Straight(Start),
    /// A pane whose mirrored light has been added up in a sum of its own.
    Pane(Pane),
}

#[derive(Clone, Debug)]
struct Start {
    ray: Ray,
    path: Path,
    media: Media,
}

/// A surface of model 4 or 9 that waits for what it mirrors.
#[derive(Clone, Debug)]
struct Pane {
    /// The ray that goes straight on.
    start: Start,
    /// The sum so far, and what it counts for.
    rgb: Vec3,
    base: Vec3,
    glass: Glass,
}

/// A surface of model 4 or 9.
#[derive(Clone, Copy, Debug)]
struct Glass {
    weight: Vec3,
    /// A + D + S.
    plain: Vec3,
    specular: Vec3,
    mirror: Vec3,
    transparency: Vec3,
}

impl Glass {
    /// Adds its colour; gives what goes straight on counts for.
    fn add(&self, incoming: Vec3, rgb: &mut Vec3) -> Vec3 {
        let mirrored = self.mirror * incoming;
        let shine = ((self.specular + mirrored).element_sum() / 3.0).min(1.0);
        let opacity = (1.0 - self.transparency).max(Vec3::splat(shine));
        *rgb += self.weight * opacity * (self.plain + mirrored);
        self.weight * (1.0 - opacity)
    }
}

/// A path at a surface whose lights are added up.
#[derive(Debug)]
pub struct Visit<'a, A> {
    /// Where all this is.
    pub scene: &'a Scene<'a, A>,
    /// The surface.
    pub shading: &'a Shading,
    /// Its material's constants.
    pub constants: &'a MaterialRecord,
    /// The ray that met it.
    pub ray: &'a Ray,
}

impl<A> Visit<'_, A> {
    /// A mirrored or refracted ray that leaves the surface, with what it counts for there.
    fn leaving(&self, path: &Path, weight: Vec3, direction: Vec3, media: Media) -> Start {
        let Surface { position, ng, magnitude, .. } = self.shading.surface;
        let side = if ng.dot(direction) < 0.0 { -ng } else { ng };
        let path = Path {
            weight,
            crossed: 0,
            used: path.used + 1,
            travelled: path.travelled + path.hit.distance,
            is_camera: false,
            sees_first: false,
            ..*path
        };
        Start { ray: Ray { origin: offset_origin(position, side, magnitude), direction }, path, media }
    }

    fn mirrored(&self) -> Vec3 {
        mirrored(self.shading.view, self.shading.surface.n)
    }

    /// What models 8 and 9 mirror: the material's `refl` map, else the background.
    fn environment(&self) -> Vec3 {
        let textures = self.scene.world.textures(self.shading.surface.material);
        match textures.and_then(|t| t.refl.as_ref()) {
            Some(map) => reflection(map, self.mirrored()),
            None => background(&self.scene.shot.background, self.mirrored()),
        }
    }
}

/// The densities on both sides of a surface, and what a ray is inside of behind it.
#[derive(Clone, Copy, Debug)]
pub struct Border {
    /// Where the ray comes from.
    pub n1: f32,
    /// Behind the surface.
    pub n2: f32,
    behind: Media,
    /// Whether the stack was full.
    is_too_deep: bool,
}

impl Border {
    /// The surface met by a ray that is inside of `media`.
    pub fn new(world: &World, media: &Media, surface: &Surface) -> Self {
        let ni = |material: u32| world.materials[material as usize].ni;
        let mut behind = *media;
        if surface.is_front {
            let is_too_deep = !behind.enter(surface.material);
            Self { n1: media.top().map_or(1.0, ni), n2: ni(surface.material), behind, is_too_deep }
        } else {
            behind.leave(surface.material);
            Self { n1: ni(surface.material), n2: behind.top().map_or(1.0, ni), behind, is_too_deep: false }
        }
    }
}

impl Branches {
    /// Forgets what waits; a camera ray starts.
    pub fn start(&mut self) {
        self.media = Media::default();
        self.base = Vec3::ONE;
        self.waiting.clear();
    }

    /// Adds what a surface shows, by its model, and decides how the path goes on: `path` goes straight on with the weight
    /// that it is left with; mirrored and refracted rays wait.
    pub fn settle<A>(&mut self, visit: &Visit<A>, path: &mut Path, sum: &mut PixelSum, rays: &mut RayCounts) {
        let Visit { scene, shading: s, constants: m, .. } = visit;
        if m.illum == 10 {
            path.weight += s.weight * (1.0 - shadow(&s.sum));
            return;
        }
        let plain = color(&s.surface, m, scene.shot.ambient, &s.sum);
        let mirror = m.mirror();
        match m.illum {
            4 | 9 => {
                let glass = Glass {
                    weight: s.weight,
                    plain,
                    specular: s.sum.specular,
                    mirror,
                    transparency: m.transparency(),
                };
                if m.illum == 4 {
                    self.meet_pane(visit, glass, path, sum, rays);
                } else {
                    path.weight = glass.add(visit.environment(), &mut sum.rgb);
                }
            }
            8 => sum.rgb += s.weight * (plain + mirror * visit.environment()),
            _ => {
                sum.rgb += s.weight * plain;
                if path.used < scene.shot.depth {
                    match m.illum {
                        3 => self.split(visit, path, mirror, None, rays),
                        5 => {
                            let mirror = schlick(mirror, s.surface.n.dot(s.view));
                            self.split(visit, path, mirror, None, rays);
                        }
                        6 | 7 => self.bend(visit, path, rays),
                        _ => {}
                    }
                }
            }
        }
    }

    /// A surface of model 6 or 7.
    fn bend<A>(&mut self, visit: &Visit<A>, path: &mut Path, rays: &mut RayCounts) {
        let Visit { scene, shading: s, constants: m, .. } = visit;
        let border = Border::new(&scene.world, &self.media, &s.surface);
        let Some(bent) = refracted(s.view, s.surface.n, border.n1, border.n2) else {
            let all = if m.illum == 6 { m.mirror() + (1.0 - m.mirror()) * m.tf } else { Vec3::ONE };
            return self.split(visit, path, all, None, rays);
        };
        let mirror = if m.illum == 6 {
            m.mirror()
        } else {
            // leaving the denser side, the cosine is that on the thinner side
            let cosine = if border.n1 > border.n2 { bent.cosine } else { s.surface.n.dot(s.view) };
            schlick(m.mirror(), cosine)
        };
        rays.media_ignored += u64::from(border.is_too_deep);
        let through = ((1.0 - mirror) * m.tf, bent.direction, border.behind);
        self.split(visit, path, mirror, Some(through), rays);
    }

    /// Sends out what is mirrored and what is refracted (weight, direction, what it is inside of then); the straight ray
    /// waits for them.
    fn split<A>(
        &mut self,
        visit: &Visit<A>,
        path: &mut Path,
        mirror: Vec3,
        through: Option<(Vec3, Vec3, Media)>,
        rays: &mut RayCounts,
    ) {
        let weight = visit.shading.weight;
        let is_traced = |share: Vec3| counts(weight * share * self.base, visit.scene.shot.prune);
        let through = through.filter(|&(share, ..)| is_traced(share));
        let is_mirrored = is_traced(mirror);
        if !is_mirrored && through.is_none() {
            return;
        }
        if path.weight != Vec3::ZERO {
            self.waiting.push(Waiting::Straight(Start { ray: *visit.ray, path: *path, media: self.media }));
        }
        if let Some((share, direction, media)) = through {
            rays.refracted += 1;
            self.waiting.push(Waiting::Ray(visit.leaving(path, weight * share, direction, media)));
        }
        if is_mirrored {
            rays.mirrored += 1;
            let ray = visit.leaving(path, weight * mirror, visit.mirrored(), self.media);
            self.waiting.push(Waiting::Ray(ray));
        }
        path.weight = Vec3::ZERO;
    }

    /// A surface of model 4. What it lets through depends on what it mirrors, which is therefore added up first.
    fn meet_pane<A>(
        &mut self,
        visit: &Visit<A>,
        glass: Glass,
        path: &mut Path,
        sum: &mut PixelSum,
        rays: &mut RayCounts,
    ) {
        let shot = visit.scene.shot;
        let base = glass.weight * glass.mirror * self.base;
        if path.used >= shot.depth || !counts(base, shot.prune) {
            path.weight = glass.add(Vec3::ZERO, &mut sum.rgb);
            return;
        }
        rays.mirrored += 1;
        let start = Start { ray: *visit.ray, path: *path, media: self.media };
        self.waiting.push(Waiting::Pane(Pane { start, rgb: sum.rgb, base: self.base, glass }));
        let ray = visit.leaving(path, Vec3::ONE, visit.mirrored(), self.media);
        self.waiting.push(Waiting::Ray(ray));
        sum.rgb = Vec3::ZERO;
        self.base = base;
        path.weight = Vec3::ZERO;
    }

    /// Takes the path to its next surface: straight on, or what waits; false where nothing does any more.
    pub fn go_on<A: Aggregate>(
        &mut self,
        scene: &Scene<A>,
        ray: &mut Ray,
        path: &mut Path,
        sum: &mut PixelSum,
    ) -> bool {
        if path.go_straight_on(scene, ray, self.base, sum) {
            return true;
        }
        while let Some(waiting) = self.waiting.pop() {
            let (is_straight, start) = match waiting {
                Waiting::Ray(start) => (false, start),
                Waiting::Straight(start) => (true, start),
                Waiting::Pane(Pane { mut start, rgb, base, glass }) => {
                    let incoming = std::mem::replace(&mut sum.rgb, rgb);
                    self.base = base;
                    start.path.weight = glass.add(incoming, &mut sum.rgb);
                    (true, start)
                }
            };
            (*ray, *path, self.media) = (start.ray, start.path, start.media);
            if is_straight {
                if path.go_straight_on(scene, ray, self.base, sum) {
                    return true;
                }
            } else if let Some(hit) = scene.aggregate.closest(ray, None) {
                path.hit = hit;
                return true;
            } else {
                sum.escape(scene.shot, path, ray);
            }
        }
        false
    }
}

/// The share of light that a shadow catcher misses: mean of the channels, 0 where there would be none.
fn shadow(sum: &Reflected) -> f32 {
    let missing = |k: usize| if sum.specular[k] > 0.0 { 1.0 - sum.diffuse[k] / sum.specular[k] } else { 0.0 };
    ((missing(0) + missing(1) + missing(2)) / 3.0).clamp(0.0, 1.0)
}
