//! A picture of the CPU device against the same picture computed in f64 by brute force, straight from the formulas:
//! loose triangles of models 0 to 2, some with shading normals, some transparent, under lights of each kind.

mod common;

use rentix::device::cpu::CpuDevice;
use rentix::device::{Device, Stop};
use rentix::math::{DVec3, Vec3};
use rentix::plan::{Wishes, plan_frame};
use rentix::scene::{
    ABSENT, AovSet, Attribute, Background, Camera, Corners, Faces, Falloff, Filter, Frame, Geometry, Light,
    Material, MaterialRuns, Mesh, Normals, Object, Part, Positions, Shot, Triangles,
};
use std::sync::Arc;

const BACKGROUND: Vec3 = Vec3::new(0.1, 0.2, 0.4);
const TRIANGLES: u32 = 24;
const SIZE: [u32; 2] = [96, 54];

/// Closer to a border than this (an edge, another surface, the horizon of a light), f32 may decide otherwise.
const BORDER: f64 = 2e-4;

/// Numbers in [0, 1) that are floats.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / 16_777_216.0
    }

    fn vector(&mut self) -> [f32; 3] {
        [self.next(), self.next(), self.next()]
    }

    fn centred(&mut self, reach: f32) -> [f32; 3] {
        self.vector().map(|x| reach * (2.0 * x - 1.0))
    }
}

/// A triangle in f64 with what it is made of.
struct Patch {
    corners: [DVec3; 3],
    normals: Option<[DVec3; 3]>,
    material: Material,
}

fn geometry(random: &mut Random) -> Geometry {
    let (mut positions, mut normals, mut corners, mut materials) = (vec![], vec![], vec![], vec![]);
    for i in 0..TRIANGLES {
        let centre = random.centred(1.0);
        for _ in 0..3 {
            let corner = random.centred(0.8);
            positions.push(std::array::from_fn(|k| centre[k] + corner[k]));
            normals.push(random.centred(1.0));
        }
        corners.push(if i % 3 == 0 { [3 * i, 3 * i + 1, 3 * i + 2] } else { [ABSENT; 3] });
        materials.push(Part::new(Material {
            ka: random.vector(),
            kd: random.vector(),
            ks: random.vector(),
            ke: random.vector().map(|x| 0.1 * x),
            ns: (20.0 * random.next()).floor(),
            d: if i % 4 == 0 { random.next() } else { 1.0 },
            illum: (i % 8).min(2) as u8,
            ..Material::default()
        }));
    }
    Geometry {
        positions: Part::new(Positions(positions)),
        faces: Part::new(Faces {
            counts: vec![3; TRIANGLES as usize],
            corners: (0..3 * TRIANGLES).collect(),
        }),
        triangles: Part::new(Triangles((0..TRIANGLES).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())),
        texcoords: None,
        normals: Some(Attribute {
            values: Part::new(Normals(normals)),
            corners: Part::new(Corners(corners)),
        }),
        colors: None,
        material_runs: Part::new(MaterialRuns((0..TRIANGLES).map(|i| [i, i]).collect())),
        materials,
        meshes: vec![Mesh {
            first_face: 0,
            face_count: TRIANGLES,
            first_triangle: 0,
            triangle_count: TRIANGLES,
        }],
    }
}

fn patches(g: &Geometry) -> Vec<Patch> {
    let patch = |i: usize| Patch {
        corners: g.triangles.0[i].map(|v| Vec3::from(g.positions.0[v as usize]).as_dvec3()),
        normals: g
            .normals
            .as_ref()
            .filter(|n| n.corners.0[i] != [ABSENT; 3])
            .map(|n| n.corners.0[i].map(|v| Vec3::from(n.values.0[v as usize]).as_dvec3())),
        material: (*g.materials[i]).clone(),
    };
    (0..TRIANGLES as usize).map(patch).collect()
}

/// What is sure: the nearest distance to a border on the way.
struct Margin(f64);

impl Margin {
    fn passes(&mut self, distance: f64) {
        self.0 = self.0.min(distance.abs());
    }
}

/// All hits along a ray by distance: (distance, patch, weights).
fn hits(
    patches: &[Patch],
    origin: DVec3,
    direction: DVec3,
    margin: &mut Margin,
) -> Vec<(f64, usize, [f64; 3])> {
    let mut hits: Vec<(f64, usize, [f64; 3])> = Vec::new();
    for (i, p) in patches.iter().enumerate() {
        let (t, weights) = common::meets(p.corners, origin, direction);
        let inside = weights.into_iter().fold(f64::INFINITY, f64::min);
        margin.passes(inside);
        if inside > 0.0 && t > 1e-9 {
            hits.push((t, i, weights));
        }
    }
    hits.sort_by(|a, b| a.0.total_cmp(&b.0));
    for pair in hits.windows(2) {
        margin.passes(pair[1].0 - pair[0].0);
    }
    hits
}

fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// (unit vector to the light, its distance, what arrives).
fn arriving(light: &Light, p: DVec3) -> (DVec3, f64, DVec3) {
    let weaken =
        |falloff: Falloff, d: f64| if falloff == Falloff::InverseSquare { 1.0 / (d * d) } else { 1.0 };
    match *light {
        Light::Directional { direction, color, intensity } => {
            (-direction.as_dvec3().normalize(), f64::INFINITY, color.as_dvec3() * f64::from(intensity))
        }
        Light::Point { position, color, intensity, falloff } => {
            let to = position.as_dvec3() - p;
            let d = to.length();
            (to / d, d, color.as_dvec3() * f64::from(intensity) * weaken(falloff, d))
        }
        Light::Spot { position, direction, inner_deg, outer_deg, color, intensity, falloff } => {
            let to = position.as_dvec3() - p;
            let d = to.length();
            let [inner, outer] = [inner_deg, outer_deg].map(|a| f64::from(a).to_radians().cos());
            let share = smoothstep(outer, inner, -(to / d).dot(direction.as_dvec3().normalize()));
            (to / d, d, color.as_dvec3() * f64::from(intensity) * weaken(falloff, d) * share)
        }
        Light::Area { .. } => unreachable!("no light of this test"),
    }
}

fn vec(a: [f32; 3]) -> DVec3 {
    Vec3::from(a).as_dvec3()
}

fn color(
    patches: &[Patch],
    shot: &Shot,
    hit: &(f64, usize, [f64; 3]),
    ray: DVec3,
    margin: &mut Margin,
) -> DVec3 {
    let (_, place, w) = *hit;
    let patch = &patches[place];
    let m = &patch.material;
    if m.illum == 0 {
        return vec(m.kd);
    }
    let mix = |c: [DVec3; 3]| c[0] * w[0] + c[1] * w[1] + c[2] * w[2];
    let [a, b, c] = patch.corners;
    let p = mix(patch.corners);
    let ng = (b - a).cross(c - a).normalize();
    let ng = if ng.dot(ray) > 0.0 { -ng } else { ng };
    let n = patch.normals.map_or(ng, |n| mix(n).normalize());
    margin.passes(n.dot(ng));
    let n = if n.dot(ng) < 0.0 { -n } else { n };
    let mut sum = vec(m.ka) * shot.ambient.as_dvec3() + vec(m.ke);
    for light in &shot.lights {
        let (l, distance, radiance) = arriving(light, p);
        margin.passes(ng.dot(l));
        margin.passes(n.dot(l));
        if n.dot(l) <= 0.0 || ng.dot(l) <= 0.0 {
            continue;
        }
        let mut s = 1.0;
        for &(t, i, _) in &hits(patches, p, l, margin) {
            // the patch itself is left aside here by its number, by rentix by where its shadow ray starts
            if i != place && t < distance {
                margin.passes(t);
                s *= 1.0 - f64::from(patches[i].material.d);
            }
        }
        sum += vec(m.kd) * radiance * s * n.dot(l);
        if m.illum == 2 {
            sum += vec(m.ks) * radiance * s * n.dot((l - ray).normalize()).max(0.0).powf(f64::from(m.ns));
        }
    }
    sum
}

/// The pixel's colour, and how far it is from any border.
fn pixel(patches: &[Patch], shot: &Shot, x: u32, y: u32) -> (DVec3, f64) {
    let [width, height] = shot.size.map(f64::from);
    let camera = &shot.camera;
    let back = (camera.eye - camera.look_at).normalize();
    let right = camera.up.cross(back).normalize();
    let up = back.cross(right);
    let k = (0.5 * camera.fov_deg).to_radians().tan();
    let [i, j] = [(f64::from(x) + 0.5) / width, (f64::from(y) + 0.5) / height];
    let ray = ((2.0 * i - 1.0) * k * width / height * right + (1.0 - 2.0 * j) * k * up - back).normalize();
    let mut margin = Margin(f64::INFINITY);
    let (mut sum, mut through) = (DVec3::ZERO, 1.0);
    for hit in &hits(patches, camera.eye, ray, &mut margin) {
        let d = f64::from(patches[hit.1].material.d);
        sum += through * d * color(patches, shot, hit, ray, &mut margin);
        through *= 1.0 - d;
        if through == 0.0 {
            break;
        }
    }
    (sum + through * BACKGROUND.as_dvec3(), margin.0)
}

fn shot() -> Shot {
    let color = Vec3::new(1.0, 0.8, 0.6);
    Shot {
        camera: Camera {
            eye: DVec3::new(0.5, 0.25, 5.0),
            look_at: DVec3::new(0.125, 0.0, 0.0),
            up: DVec3::new(0.1, 1.0, 0.0),
            fov_deg: 40.0,
        },
        lights: vec![
            Light::Point {
                position: Vec3::new(3.0, 4.0, 4.0),
                color,
                intensity: 0.5,
                falloff: Falloff::None,
            },
            Light::Point {
                position: Vec3::new(-2.0, 0.5, 3.0),
                color,
                intensity: 4.0,
                falloff: Falloff::InverseSquare,
            },
            Light::Directional { direction: Vec3::new(0.25, -1.0, -0.5), color, intensity: 0.25 },
            Light::Spot {
                position: Vec3::new(0.0, 0.0, 4.0),
                direction: Vec3::new(0.0, 0.125, -1.0),
                inner_deg: 4.0,
                outer_deg: 14.0,
                color,
                intensity: 0.5,
                falloff: Falloff::None,
            },
        ],
        ambient: Vec3::new(0.3, 0.2, 0.1),
        background: Background::Color(BACKGROUND),
        size: SIZE,
        samples: 1,
        filter: Filter::Box,
        depth: 10,
        seed: 0,
        prune: 0.0,
        alpha: false,
        aovs: AovSet::default(),
    }
}

#[test]
fn every_pixel_away_from_borders() {
    let mut compared = 0;
    for seed in 1..=4 {
        let geometry = geometry(&mut Random(seed));
        let patches = patches(&geometry);
        let frame = Frame { objects: vec![Object { geometry: Arc::new(geometry), transform: None }] };
        let shot = shot();
        let mut device = CpuDevice::new(2, 1 << 24).unwrap();
        let plan = plan_frame(&frame, device.residency(), &Wishes::default());
        device.apply(&plan, &frame).unwrap();
        let film = device.trace(&frame, &shot, &Stop::default()).unwrap().film;
        for (i, rgb) in film.rgb.iter().enumerate() {
            let (x, y) = (i as u32 % SIZE[0], i as u32 / SIZE[0]);
            let (expected, margin) = pixel(&patches, &shot, x, y);
            if margin > BORDER {
                compared += 1;
                let off = (vec(*rgb) - expected).abs().max_element();
                assert!(off < 1e-5, "seed {seed}, pixel ({x}, {y}): {rgb:?}, not {expected:?}");
            }
        }
    }
    let all = 4 * SIZE[0] * SIZE[1];
    assert!(compared > all * 9 / 10, "only {compared} of {all} pixels are away from borders");
}
