//! One camera ray and all that follows from it, for scenes with mirrors, glass, maps or area lights: the illumination
//! models 0 to 10 of MTL. Scenes without any of them are traced a tile at a time ([`super::tile`]) and never come here.

use super::area::AreaSample;
use super::light::{Incident, incident};
use super::media::Media;
use super::point::{Point, shadow_factor};
use super::power::powf;
use super::texture::{cube, sphere};
use super::tile::Scene;
use super::world::Surface;
use super::{RayCounts, SURFACES_MAX};
use crate::accel::{Aggregate, Hit, HitOrder, Ray, offset_origin};
use crate::math::Vec3;
use crate::scene::{Background, Reflection};

/// What a camera ray sees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// Linear RGB.
    pub rgb: Vec3,
    /// What the background counts for straight on, mean of the channels.
    pub through: f32,
    /// Diffuse reflectance of the first surface with d > 0.
    pub albedo: Vec3,
}

/// A ray on its way.
#[derive(Clone, Copy, Debug)]
struct Path {
    ray: Ray,
    /// What it counts for in the pixel, by channel, at most.
    weight: Vec3,
    /// Bounces and straight crossings behind it.
    depth: u32,
    /// Width of its cone where it starts.
    width: f32,
    media: Media,
    /// Whether it comes straight from the camera.
    is_camera: bool,
}

/// Follows the rays of one sample.
pub struct Walk<'w, 's, A> {
    /// The scene.
    pub scene: &'w Scene<'s, A>,
    /// Which sample of which pixel, for area lights.
    pub sample: AreaSample,
    /// Rays traced.
    pub counts: &'w mut RayCounts,
}

/// What the lights add up to at a point.
#[derive(Clone, Copy, Debug, Default)]
struct Lit {
    diffuse: Vec3,
    specular: Vec3,
}

/// What a surface shows, and how much of what is straight on behind it.
struct Shown {
    color: Vec3,
    pass: Vec3,
}

/// Mirrored and refracted directions at a point.
struct Bounce {
    mirrored: Vec3,
    /// None at total reflection.
    refracted: Option<Vec3>,
    /// Fresnel's share by Schlick.
    fresnel: Vec3,
    media: Media,
}

impl<A: Aggregate> Walk<'_, '_, A> {
    /// What a camera ray sees whose first hit is known.
    pub fn camera(&mut self, ray: Ray, first: Option<Hit>) -> Seen {
        let path =
            Path { ray, weight: Vec3::ONE, depth: 0, width: 0.0, media: Media::default(), is_camera: true };
        self.follow(&path, first)
    }

    /// Along a ray from surface to surface, straight on.
    fn follow(&mut self, path: &Path, first: Option<Hit>) -> Seen {
        let shot = self.scene.shot;
        let mut seen = Seen::default();
        let mut through = Vec3::ONE;
        let mut sees_first = true;
        let mut hit = first;
        for crossing in 0..SURFACES_MAX {
            let Some(at) = hit else {
                if !(path.is_camera && shot.alpha) {
                    seen.rgb += through * self.background(path.ray.direction);
                }
                seen.through = through.element_sum() / 3.0;
                return seen;
            };
            let surface = self.scene.world.surface(&path.ray, &at);
            let width = path.width + self.scene.camera.spread() * at.distance;
            let point = Point::new(&self.scene.world, &surface, &at, -path.ray.direction, width);
            if sees_first && point.material.d > 0.0 {
                seen.albedo = point.material.kd;
                sees_first = false;
            }
            let here = Path { weight: path.weight * through, depth: path.depth + crossing, width, ..*path };
            let shown = self.shade(&here, &surface, &point);
            seen.rgb += through * shown.color;
            through *= shown.pass;
            let left = (path.weight * through).max_element();
            if left == 0.0 || left < shot.prune {
                return seen;
            }
            hit = self.scene.aggregate.closest(&path.ray, Some(self.scene.aggregate.order(&at)));
        }
        seen
    }

    /// A surface by its material's model (CONTRACT 5). `path` is the ray that met it, with all behind it.
    fn shade(&mut self, path: &Path, surface: &Surface, p: &Point) -> Shown {
        let m = &p.material;
        let dissolved = |color: Vec3| Shown { color: color * m.d, pass: Vec3::splat(1.0 - m.d) };
        if m.illum == 0 {
            return dissolved(m.kd);
        }
        if m.illum == 10 {
            return Shown { color: Vec3::ZERO, pass: Vec3::splat(1.0 - self.shadow_share(surface, p)) };
        }
        if m.d == 0.0 && !matches!(m.illum, 4 | 6 | 7 | 9) {
            return dissolved(Vec3::ZERO);
        }
        let bounce = Self::bounce(path, surface, p);
        let f0 = matches!(m.illum, 5 | 7).then(|| Self::f0(path, surface, p));
        let lit = self.lights(path, surface, p, f0);
        let ambient = m.ka * self.scene.shot.ambient + m.ke;
        let ks = m.ks.min(Vec3::ONE);
        let direct = ambient + lit.diffuse + lit.specular;
        match m.illum {
            1 => dissolved(ambient + lit.diffuse),
            3 => dissolved(direct + self.mirrored(path, surface, &bounce, ks, m.d)),
            5 => dissolved(direct + self.mirrored(path, surface, &bounce, bounce.fresnel, m.d)),
            8 => dissolved(direct + ks * self.around(surface, bounce.mirrored)),
            4 | 9 => {
                let t = m.transparency(m.d, m.tf);
                let reflected = if m.illum == 4 {
                    self.mirrored(path, surface, &bounce, ks, 1.0)
                } else {
                    ks * self.around(surface, bounce.mirrored)
                };
                let shine = ((lit.specular + reflected).element_sum() / 3.0).min(1.0);
                let opacity = (Vec3::ONE - t).max(Vec3::splat(shine));
                Shown { color: opacity * (direct + reflected), pass: Vec3::ONE - opacity }
            }
            6 | 7 => {
                let share = if m.illum == 6 { ks } else { bounce.fresnel };
                let tf = (Vec3::ONE - share) * m.tf.min(Vec3::ONE);
                let color = if bounce.refracted.is_none() && m.illum == 6 {
                    // total reflection: what would be refracted is mirrored
                    self.mirrored(path, surface, &bounce, ks + tf, 1.0)
                } else {
                    let mirrored = self.mirrored(path, surface, &bounce, share, 1.0);
                    mirrored + self.refracted(path, surface, &bounce, tf)
                };
                Shown { color: direct + color, pass: Vec3::ZERO }
            }
            _ => dissolved(direct),
        }
    }

    /// Optical densities before and behind a surface, and the media behind it.
    fn densities(path: &Path, surface: &Surface, p: &Point) -> (f32, f32, Media) {
        let media = path.media;
        if surface.is_front {
            (media.density(), p.material.ni, media.entered(surface.material, p.material.ni))
        } else {
            let behind = media.left(surface.material);
            (p.material.ni, behind.density(), behind)
        }
    }

    /// F0: Ks; of model 7 with Ks 0 that of the densities.
    fn f0(path: &Path, surface: &Surface, p: &Point) -> Vec3 {
        let ks = p.material.ks.min(Vec3::ONE);
        if p.material.illum == 7 && ks == Vec3::ZERO {
            let (n1, n2, _) = Self::densities(path, surface, p);
            let r = (n1 - n2) / (n1 + n2);
            Vec3::splat(r * r)
        } else {
            ks
        }
    }

    /// Where a ray goes on from a surface, by Snell and Schlick.
    fn bounce(path: &Path, surface: &Surface, p: &Point) -> Bounce {
        let d = path.ray.direction;
        let mirrored = (d + p.n * (2.0 * p.cos)).normalize_or(surface.ng);
        if !matches!(p.material.illum, 5..=7) {
            return Bounce { mirrored, refracted: None, fresnel: Vec3::ZERO, media: path.media };
        }
        let f0 = Self::f0(path, surface, p);
        if p.material.illum == 5 {
            return Bounce { mirrored, refracted: None, fresnel: schlick(f0, p.cos), media: path.media };
        }
        let (n1, n2, media) = Self::densities(path, surface, p);
        let eta = n1 / n2;
        let cos2 = 1.0 - eta * eta * (1.0 - p.cos * p.cos);
        if cos2 < 0.0 {
            return Bounce { mirrored, refracted: None, fresnel: Vec3::ONE, media };
        }
        let cos_behind = cos2.sqrt();
        let refracted = (d * eta + p.n * (eta * p.cos - cos_behind)).normalize_or(d);
        // leaving the denser side, the cosine on the thinner side counts
        let fresnel = schlick(f0, if n1 > n2 { cos_behind } else { p.cos });
        Bounce { mirrored, refracted: Some(refracted), fresnel, media }
    }

    /// share · Ir.
    fn mirrored(
        &mut self,
        path: &Path,
        surface: &Surface,
        bounce: &Bounce,
        share: Vec3,
        opacity: f32,
    ) -> Vec3 {
        let Some(next) = self.next(path, surface, bounce.mirrored, share * opacity, path.media) else {
            return Vec3::ZERO;
        };
        self.counts.mirrored += 1;
        share * self.bounced(&next)
    }

    /// share · It; 0 where nothing is refracted.
    fn refracted(&mut self, path: &Path, surface: &Surface, bounce: &Bounce, share: Vec3) -> Vec3 {
        let Some(direction) = bounce.refracted else { return Vec3::ZERO };
        let Some(next) = self.next(path, surface, direction, share, bounce.media) else { return Vec3::ZERO };
        self.counts.refracted += 1;
        share * self.bounced(&next)
    }

    fn bounced(&mut self, path: &Path) -> Vec3 {
        let first = self.scene.aggregate.closest(&path.ray, None);
        self.follow(path, first).rgb
    }

    /// A path on from a surface; None past the depth or where it counts for too little.
    fn next(
        &self,
        path: &Path,
        surface: &Surface,
        direction: Vec3,
        share: Vec3,
        media: Media,
    ) -> Option<Path> {
        let shot = self.scene.shot;
        let weight = path.weight * share;
        let most = weight.max_element();
        if path.depth >= shot.depth || most == 0.0 || most < shot.prune {
            return None;
        }
        let ng = if direction.dot(surface.ng) < 0.0 { -surface.ng } else { surface.ng };
        let origin = offset_origin(surface.position, ng, surface.magnitude);
        let ray = Ray { origin, direction };
        Some(Path { ray, weight, depth: path.depth + 1, width: path.width, media, is_camera: false })
    }

    /// D and S; S with F(L·H) for Ks where `f0` is given (models 5 and 7).
    fn lights(&mut self, path: &Path, surface: &Surface, p: &Point, f0: Option<Vec3>) -> Lit {
        let mut lit = Lit::default();
        let scene = self.scene;
        for light in &scene.lights {
            let incident = incident(light, surface.position);
            if faces(surface, p, incident.direction) && incident.radiance != Vec3::ZERO {
                let origin = offset_origin(surface.position, surface.ng, surface.magnitude);
                let (direction, end) = light.shadow_segment(origin);
                let visibility = self.visibility(&Ray { origin, direction }, end);
                lit.add(p, -path.ray.direction, &incident, visibility, f0);
            }
        }
        if let Some(area) = &scene.area {
            let mut sum = Lit::default();
            for i in 0..area.samples {
                let Some(sampled) = area.sample(&self.sample, surface.position, i) else { continue };
                if !faces(surface, p, sampled.incident.direction) {
                    continue;
                }
                let origin = offset_origin(surface.position, surface.ng, surface.magnitude);
                let visibility = self.visibility(&Ray { origin, direction: sampled.target - origin }, 1.0);
                sum.add(p, -path.ray.direction, &sampled.incident, visibility, f0);
            }
            lit.diffuse += sum.diffuse / area.samples as f32;
            lit.specular += sum.specular / area.samples as f32;
            self.sample.surface += 1;
        }
        lit
    }

    /// Of a shadow catcher: 1 − Σ I·S·max(0, N·L) / Σ I·max(0, N·L), mean of the channels; 0 without light.
    fn shadow_share(&mut self, surface: &Surface, p: &Point) -> f32 {
        let (mut shadowed, mut all) = (Vec3::ZERO, Vec3::ZERO);
        let scene = self.scene;
        for light in &scene.lights {
            let incident = incident(light, surface.position);
            let arrives = incident.radiance * p.n.dot(incident.direction).max(0.0);
            if arrives == Vec3::ZERO {
                continue;
            }
            all += arrives;
            if surface.ng.dot(incident.direction) > 0.0 {
                let origin = offset_origin(surface.position, surface.ng, surface.magnitude);
                let (direction, end) = light.shadow_segment(origin);
                shadowed += arrives * self.visibility(&Ray { origin, direction }, end);
            }
        }
        let share = |k: usize| if all[k] > 0.0 { 1.0 - shadowed[k] / all[k] } else { 0.0 };
        ((share(0) + share(1) + share(2)) / 3.0).clamp(0.0, 1.0)
    }

    /// The share of light, by channel, that comes along a shadow ray: the product, in order, of what the surfaces on
    /// it let through; 0 after [`SURFACES_MAX`].
    fn visibility(&mut self, ray: &Ray, end: f32) -> Vec3 {
        self.counts.shadow += 1;
        let Scene { aggregate, world, .. } = self.scene;
        if world.is_opaque {
            return if aggregate.occluded(ray, end) { Vec3::ZERO } else { Vec3::ONE };
        }
        let mut share = Vec3::ONE;
        let mut after: Option<HitOrder> = None;
        let view = -ray.direction.normalize_or(Vec3::Z);
        for _ in 0..SURFACES_MAX {
            match aggregate.closest(ray, after) {
                Some(hit) if hit.distance < end => {
                    share *= shadow_factor(world, &hit, || world.surface(ray, &hit), view);
                    if share == Vec3::ZERO {
                        return share;
                    }
                    after = Some(aggregate.order(&hit));
                }
                _ => return share,
            }
        }
        Vec3::ZERO
    }

    /// What models 8 and 9 mirror: the material's `refl` map, else the background.
    fn around(&self, surface: &Surface, direction: Vec3) -> Vec3 {
        match self.scene.world.reflection(surface.material) {
            Some(Reflection::Sphere(map)) => sphere(map, direction),
            Some(Reflection::Cube(faces)) => cube(faces, direction),
            None => self.background(direction),
        }
    }

    fn background(&self, direction: Vec3) -> Vec3 {
        match &self.scene.shot.background {
            Background::Color(color) => *color,
            Background::Picture(map) => sphere(map, direction),
        }
    }
}

/// F0 + (1 − F0)·(1 − c)⁵.
fn schlick(f0: Vec3, cos: f32) -> Vec3 {
    let x = 1.0 - cos.clamp(0.0, 1.0);
    f0 + (Vec3::ONE - f0) * (x * x * x * x * x)
}

/// Whether a light in that direction reaches the viewer's side.
fn faces(surface: &Surface, p: &Point, direction: Vec3) -> bool {
    p.n.dot(direction) > 0.0 && surface.ng.dot(direction) > 0.0
}

impl Lit {
    /// Adds one light of which `visibility` arrives; it must reach the viewer's side.
    fn add(&mut self, p: &Point, view: Vec3, light: &Incident, visibility: Vec3, f0: Option<Vec3>) {
        if visibility == Vec3::ZERO {
            return;
        }
        let m = &p.material;
        let arrives = light.radiance * visibility;
        self.diffuse += m.kd * arrives * p.n.dot(light.direction);
        if m.illum < 2 {
            return;
        }
        // S is 0 where the light and the viewer are opposite
        if let Some(half) = (light.direction + view).try_normalize() {
            let ks = f0.map_or(m.ks, |f0| schlick(f0, light.direction.dot(half)));
            if ks != Vec3::ZERO {
                self.specular += ks * arrives * powf(p.n.dot(half).max(0.0), m.ns);
            }
        }
    }
}
