//! A prism, glass in glass, and shadows through two coloured panes, against the same pictures computed in f64 by brute
//! force, straight from the formulas. All shading normals are the triangles' own.

mod common;

use rentix::device::cpu::CpuDevice;
use rentix::device::{Device, Stop};
use rentix::math::{DVec3, Vec3};
use rentix::plan::{Wishes, plan_frame};
use rentix::scene::{
    AovSet, Background, Camera, Faces, Falloff, Filter, Frame, Geometry, Light, Material, MaterialRuns, Mesh,
    Object, Part, Positions, Shot, Triangles,
};
use std::sync::Arc;

const SIZE: [u32; 2] = [96, 72];
const BACKGROUND: DVec3 = DVec3::new(0.125, 0.25, 0.85);

/// Closer to a border than this (an edge, the horizon of a light, total reflection), f32 may decide otherwise.
const BORDER: f64 = 1e-3;

/// Triangles with their materials.
#[derive(Default)]
struct Bodies {
    triangles: Vec<([DVec3; 3], usize)>,
    materials: Vec<Material>,
}

impl Bodies {
    fn material(&mut self, material: Material) -> usize {
        self.materials.push(material);
        self.materials.len() - 1
    }

    /// Corners become floats, which both sides then start from.
    fn quad(&mut self, corners: [DVec3; 4], material: usize) {
        let [a, b, c, d] = corners.map(|p| p.as_vec3().as_dvec3());
        self.triangles.extend([([a, b, c], material), ([a, c, d], material)]);
    }

    /// A closed body that stands on a polygon (counter-clockwise seen from above), turned about `axis`.
    fn column(&mut self, base: &[[f64; 2]], low: f64, high: f64, place: impl Fn(DVec3) -> DVec3, m: usize) {
        let at = |i: usize, y: f64| {
            let [x, z] = base[i % base.len()];
            place(DVec3::new(x, y, z))
        };
        for i in 0..base.len() {
            self.quad([at(i, low), at(i + 1, low), at(i + 1, high), at(i, high)], m);
        }
        for i in 1..base.len() - 1 {
            let rounded = |p: DVec3| p.as_vec3().as_dvec3();
            self.triangles.push(([at(0, high), at(i, high), at(i + 1, high)].map(rounded), m));
            self.triangles.push(([at(0, low), at(i + 1, low), at(i, low)].map(rounded), m));
        }
    }

    fn geometry(&self) -> Geometry {
        let count = self.triangles.len() as u32;
        let corners = self.triangles.iter().flat_map(|t| t.0).map(|p| p.as_vec3().to_array());
        Geometry {
            positions: Part::new(Positions(corners.collect())),
            faces: Part::new(Faces { counts: vec![3; count as usize], corners: (0..3 * count).collect() }),
            triangles: Part::new(Triangles((0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())),
            texcoords: None,
            normals: None,
            colors: None,
            material_runs: Part::new(MaterialRuns(
                (0..).zip(&self.triangles).map(|(i, t)| [i, t.1 as u32]).collect(),
            )),
            materials: self.materials.iter().map(|m| Part::new(m.clone())).collect(),
            meshes: vec![Mesh { first_face: 0, face_count: count, first_triangle: 0, triangle_count: count }],
        }
    }
}

/// The picture in f64, and how sure each pixel is.
struct Reference<'a> {
    bodies: &'a Bodies,
    shot: &'a Shot,
    margin: f64,
}

fn vec(a: [f32; 3]) -> DVec3 {
    Vec3::from(a).as_dvec3()
}

fn schlick(f0: DVec3, c: f64) -> DVec3 {
    f0 + (1.0 - f0) * (1.0 - c.clamp(0.0, 1.0)).powi(5)
}

impl Reference<'_> {
    fn passes(&mut self, distance: f64) {
        self.margin = self.margin.min(distance.abs());
    }

    /// Hits by distance; the triangle that the ray starts on is left aside.
    fn hits(&mut self, origin: DVec3, direction: DVec3, start: Option<usize>) -> Vec<(f64, usize)> {
        let mut hits = Vec::new();
        for (i, (corners, _)) in self.bodies.triangles.iter().enumerate() {
            let (t, [w, u, v]) = common::meets(*corners, origin, direction);
            let inside = u.min(v).min(w);
            if Some(i) != start && t > 1e-9 {
                self.margin = self.margin.min(inside.abs());
                if inside > 0.0 {
                    hits.push((t, i));
                }
            }
        }
        hits.sort_by(|a, b| a.0.total_cmp(&b.0));
        hits
    }

    /// What a shadow ray is left with: t in model 4, Tf·(1 − Ks) in 6 and 7, 0 elsewhere.
    fn visibility(&mut self, p: DVec3, to_light: DVec3, start: usize) -> DVec3 {
        let hits = self.hits(p, to_light, Some(start));
        let mut share = DVec3::ONE;
        for &(_, i) in hits.iter().take_while(|hit| hit.0 < 1.0) {
            let m = &self.bodies.materials[self.bodies.triangles[i].1];
            share *= match m.illum {
                4 => vec(m.tf),
                6 | 7 => vec(m.tf) * (1.0 - vec(m.ks)),
                _ => DVec3::ZERO,
            };
        }
        share
    }

    fn radiance(
        &mut self,
        origin: DVec3,
        d: DVec3,
        start: Option<usize>,
        used: u32,
        media: &[usize],
    ) -> DVec3 {
        let Some(&(t, place)) = self.hits(origin, d, start).first() else { return BACKGROUND };
        let p = origin + t * d;
        let ([a, b, c], material) = self.bodies.triangles[place];
        let m = self.bodies.materials[material].clone();
        let outward = (b - a).cross(c - a).normalize();
        let enters = outward.dot(d) < 0.0;
        let n = if enters { outward } else { -outward };
        let cos = -n.dot(d);
        self.passes(cos);

        let ni = |material: Option<&usize>| material.map_or(1.0, |&m| f64::from(self.bodies.materials[m].ni));
        let mut behind = media.to_vec();
        let (n1, n2) = if enters {
            behind.push(material);
            (ni(media.last()), ni(Some(&material)))
        } else {
            let entry = behind.iter().rposition(|&m| m == material).expect("a body that was entered");
            behind.remove(entry);
            (ni(Some(&material)), ni(behind.last()))
        };
        let ks = vec(m.ks);
        let is_plain = ks == DVec3::ZERO;
        let f0 = if m.illum == 7 && is_plain { DVec3::splat(((n1 - n2) / (n1 + n2)).powi(2)) } else { ks };

        let Light::Point { position, color, intensity, .. } = self.shot.lights[0] else { unreachable!() };
        let to_light = position.as_dvec3() - p;
        let l = to_light.normalize();
        self.passes(n.dot(l));
        let mut sum = DVec3::ZERO;
        if n.dot(l) > 0.0 {
            let arrives = color.as_dvec3() * f64::from(intensity) * self.visibility(p, to_light, place);
            let h = (l - d).normalize();
            let share = if m.illum == 7 { schlick(f0, l.dot(h)) } else { ks };
            sum += vec(m.kd) * arrives * n.dot(l);
            sum += share * arrives * n.dot(h).max(0.0).powf(f64::from(m.ns));
        }
        if !matches!(m.illum, 6 | 7) || used >= self.shot.depth {
            return sum;
        }
        let mirrored = d + 2.0 * cos * n;
        let eta = n1 / n2;
        let cos2 = 1.0 - eta * eta * (1.0 - cos * cos);
        self.passes(cos2);
        let tf = vec(m.tf);
        if cos2 < 0.0 {
            let all = if m.illum == 7 { DVec3::ONE } else { ks + (1.0 - ks) * tf };
            return sum + all * self.radiance(p, mirrored, Some(place), used + 1, media);
        }
        let refracted = eta * d + (eta * cos - cos2.sqrt()) * n;
        let f = if m.illum == 6 { ks } else { schlick(f0, if n1 > n2 { cos2.sqrt() } else { cos }) };
        sum + f * self.radiance(p, mirrored, Some(place), used + 1, media)
            + (1.0 - f) * tf * self.radiance(p, refracted, Some(place), used + 1, &behind)
    }

    /// A pixel's colour, and how far it is from any border.
    fn pixel(&mut self, x: u32, y: u32) -> (DVec3, f64) {
        self.margin = f64::INFINITY;
        let [width, height] = self.shot.size.map(f64::from);
        let camera = &self.shot.camera;
        let back = (camera.eye - camera.look_at).normalize();
        let right = camera.up.cross(back).normalize();
        let up = back.cross(right);
        let k = (0.5 * camera.fov_deg).to_radians().tan();
        let [i, j] = [(f64::from(x) + 0.5) / width, (f64::from(y) + 0.5) / height];
        let ray = (2.0 * i - 1.0) * k * width / height * right + (1.0 - 2.0 * j) * k * up - back;
        let eye = camera.eye;
        (self.radiance(eye, ray.normalize(), None, 0, &[]), self.margin)
    }
}

fn shot(light: Vec3) -> Shot {
    Shot {
        camera: Camera { eye: DVec3::new(0.25, 1.5, 6.0), look_at: DVec3::ZERO, up: DVec3::Y, fov_deg: 36.0 },
        lights: vec![Light::Point {
            position: light,
            color: Vec3::new(1.0, 0.75, 0.5),
            intensity: 1.0,
            falloff: Falloff::None,
        }],
        ambient: Vec3::ZERO,
        background: Background::Color(BACKGROUND.as_vec3()),
        size: SIZE,
        samples: 1,
        filter: Filter::Box,
        depth: 6,
        seed: 0,
        prune: 0.0,
        alpha: false,
        aovs: AovSet::default(),
    }
}

/// A wall behind and a floor, white.
fn room() -> Bodies {
    let mut bodies = Bodies::default();
    let white = bodies.material(Material { kd: [0.8; 3], illum: 1, ..Material::default() });
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    bodies.quad([at(-9.0, -1.5, -3.0), at(9.0, -1.5, -3.0), at(9.0, 9.0, -3.0), at(-9.0, 9.0, -3.0)], white);
    bodies.quad([at(-9.0, -1.5, 4.0), at(9.0, -1.5, 4.0), at(9.0, -1.5, -3.0), at(-9.0, -1.5, -3.0)], white);
    bodies
}

fn turned(p: DVec3, angle: f64) -> DVec3 {
    let axis = DVec3::new(0.3, 1.0, 0.2).normalize();
    let (sin, cos) = angle.sin_cos();
    // Rodrigues's formula
    p * cos + axis.cross(p) * sin + axis * axis.dot(p) * (1.0 - cos)
}

#[track_caller]
fn compare(bodies: &Bodies, shot: &Shot, least: f64) {
    let frame = Frame { objects: vec![Object { geometry: Arc::new(bodies.geometry()), transform: None }] };
    let mut device = CpuDevice::new(2, 1 << 24).unwrap();
    let plan = plan_frame(&frame, device.residency(), &Wishes::default());
    device.apply(&plan, &frame).unwrap();
    let film = device.trace(&frame, shot, &Stop::default()).unwrap().film;
    let mut reference = Reference { bodies, shot, margin: 0.0 };
    let (mut compared, mut worst) = (0, 0.0_f64);
    for (i, rgb) in film.rgb.iter().enumerate() {
        let (x, y) = (i as u32 % SIZE[0], i as u32 / SIZE[0]);
        let (expected, margin) = reference.pixel(x, y);
        if margin > BORDER {
            compared += 1;
            let off = (vec(*rgb) - expected).abs().max_element();
            worst = worst.max(off);
            assert!(off < 2e-5, "pixel ({x}, {y}): {rgb:?}, not {expected:?}");
        }
    }
    println!("{compared} of {} pixels compared, the worst off by {worst:e}", film.rgb.len());
    assert!(f64::from(compared) > least * film.rgb.len() as f64, "only {compared} pixels are sure");
}

fn glass(illum: u8, ni: f32, ks: f32) -> Material {
    Material { kd: [0.0; 3], ks: [ks; 3], ns: 12.0, ni, tf: [0.9, 0.7, 0.8], illum, ..Material::default() }
}

#[test]
fn a_prism() {
    for (illum, ks) in [(7, 0.0), (7, 0.1), (6, 0.2)] {
        let mut bodies = room();
        let m = bodies.material(glass(illum, 1.6, ks));
        let base = [[-1.2, 0.8], [1.2, 0.7], [0.1, -1.1]];
        bodies.column(&base, -1.0, 1.1, |p| turned(p, 0.4), m);
        compare(&bodies, &shot(Vec3::new(3.0, 4.0, 3.0)), 0.9);
    }
}

#[test]
fn glass_in_glass() {
    // the inner body is thinner than the outer one, then denser; both surfaces meet rays at all angles
    for inner_ni in [1.2, 2.0] {
        let mut bodies = room();
        let outer = bodies.material(glass(7, 1.5, 0.0));
        let inner = bodies.material(glass(7, inner_ni, 0.0));
        let square = |r: f64| [[-r, r], [r, r], [r, -r], [-r, -r]];
        bodies.column(&square(1.2), -1.1, 1.2, |p| turned(p, 0.3), outer);
        bodies.column(&square(0.55), -0.5, 0.6, |p| turned(p, 1.1), inner);
        compare(&bodies, &shot(Vec3::new(3.0, 4.0, 3.0)), 0.85);
    }
}

#[test]
fn shadows_through_two_coloured_panes() {
    let mut bodies = room();
    let pane = |tf| Material { kd: [0.0; 3], tf, tf_given: true, illum: 4, ..Material::default() };
    let (red, blue) = (bodies.material(pane([0.9, 0.3, 0.2])), bodies.material(pane([0.2, 0.4, 0.9])));
    let at = |x: f64, z: f64, y: f64| DVec3::new(x, y, z);
    // above the picture's edge: only their shadows are seen
    bodies.quad([at(-1.5, 1.0, 3.5), at(1.0, 1.0, 3.5), at(1.0, -1.5, 3.5), at(-1.5, -1.5, 3.5)], red);
    bodies.quad([at(-0.5, 1.5, 3.9), at(2.0, 1.5, 3.9), at(2.0, -1.0, 4.1), at(-0.5, -1.0, 4.1)], blue);
    compare(&bodies, &shot(Vec3::new(0.5, 8.0, 1.0)), 0.95);
}
