//! Meshes, rays and the reference in f64 that the tests of hits share.
#![allow(dead_code, unreachable_pub)]

use glam::{DVec3, Vec3};
use rentix::accel::{Aggregate, Hit, Quality, Ray, Reference, TracedObject, TracedScene, Tree, validate};
use std::sync::Arc;

/// An indexed mesh.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub positions: Vec<[f32; 3]>,
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.triangles[triangle as usize].map(|i| Vec3::from(self.positions[i as usize]))
    }

    /// Scales, then moves, in f64, and rounds.
    pub fn placed(&self, scale: f64, by: DVec3) -> Self {
        let positions = self.positions.iter().map(|&p| place(Vec3::from(p), scale, by).to_array()).collect();
        Self { positions, triangles: self.triangles.clone() }
    }

    /// A tree that was validated.
    pub fn tree(&self, quality: Quality) -> Arc<Tree> {
        let tree = Tree::build(&self.positions, &self.triangles, quality);
        assert_eq!(validate(&tree, &self.positions, &self.triangles), Ok(()), "{quality:?}");
        Arc::new(tree)
    }

    pub fn scene(&self, quality: Quality) -> TracedScene {
        TracedScene::new(vec![TracedObject::new(self.tree(quality), None)])
    }

    pub fn push(&mut self, corners: [Vec3; 3]) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners.map(|c| c.to_array()));
        self.triangles.push([first, first + 1, first + 2]);
    }
}

pub fn place(p: Vec3, scale: f64, by: DVec3) -> Vec3 {
    (p.as_dvec3() * scale + by).as_vec3()
}

/// A small generator (`SplitMix64`, Steele et al. 2014).
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1 << 24) as f32
    }

    /// In the cube from -1 to 1.
    pub fn cube(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    pub fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.cube();
            if v.length() > 0.05 && v.length() < 1.0 {
                return v.normalize();
            }
        }
    }
}

/// Triangles of many sizes at random, among them flat ones, duplicates, coplanar ones that overlap, slivers and some
/// without area.
pub fn soup(count: usize, seed: u64) -> Mesh {
    let mut random = Random(seed);
    let mut mesh = Mesh::default();
    while mesh.triangles.len() < count {
        let at = random.cube();
        let size = 0.5 * random.unit().powi(4) + 0.005;
        let mut corners = [at, at + random.cube() * size, at + random.cube() * size];
        match random.below(8) {
            0 => {
                let k = random.below(3);
                let plane = (at[k] * 4.0).round() * 0.25;
                for c in &mut corners {
                    c[k] = plane;
                }
            }
            1 => corners[2] = corners[0].lerp(corners[1], random.unit()),
            2 => corners[2] = corners[random.below(2)],
            3 => mesh.push(corners),
            _ => {}
        }
        mesh.push(corners);
    }
    mesh
}

/// A sphere of radius 1: an octahedron whose faces are cut in four some times. Closed, neighbours share vertices.
pub fn sphere(cuts: usize) -> Mesh {
    let mut mesh = Mesh {
        positions: vec![
            [1.0, 0.0, 0.0],
            [-1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, -1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
        ],
        triangles: vec![
            [0, 2, 4],
            [2, 1, 4],
            [1, 3, 4],
            [3, 0, 4],
            [2, 0, 5],
            [1, 2, 5],
            [3, 1, 5],
            [0, 3, 5],
        ],
    };
    for _ in 0..cuts {
        let mut middles = std::collections::HashMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in mesh.triangles.clone() {
            let mut middle = |i: u32, j: u32| {
                *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    let [p, q] = [i, j].map(|i| Vec3::from(mesh.positions[i as usize]));
                    mesh.positions.push((p + q).normalize().to_array());
                    mesh.positions.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        mesh.triangles = finer;
    }
    mesh
}

/// An OBJ of the scenes that `RENTIX_SCENES` names; None, and a line, where it is not set.
pub fn load(path: &str) -> Option<Mesh> {
    let Some(folder) = std::env::var_os("RENTIX_SCENES") else {
        println!("skipped: RENTIX_SCENES is not set");
        return None;
    };
    let path = std::path::Path::new(&folder).join(path);
    let text = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut mesh = Mesh::default();
    for line in String::from_utf8_lossy(&text).lines() {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => mesh.positions.push(std::array::from_fn(|_| words.next().unwrap().parse().unwrap())),
            Some("f") => {
                let corner = |w: &str| w.split('/').next().unwrap().parse::<i64>().unwrap();
                let n = mesh.positions.len() as i64;
                let c: Vec<u32> =
                    words.map(corner).map(|i| if i < 0 { n + i } else { i - 1 } as u32).collect();
                mesh.triangles.extend((2..c.len()).map(|k| [c[0], c[k - 1], c[k]]));
            }
            _ => {}
        }
    }
    Some(mesh)
}

/// One ray through the centre of each pixel of a small picture.
pub fn camera_rays(eye: Vec3, look_at: Vec3, fov_deg: f32, [w, h]: [usize; 2]) -> Vec<Ray> {
    let forward = (look_at - eye).normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let up = right.cross(forward);
    let half = (0.5 * fov_deg).to_radians().tan();
    (0..w * h)
        .map(|i| {
            let u = (2.0 * ((i % w) as f32 + 0.5) / w as f32 - 1.0) * half * w as f32 / h as f32;
            let v = (1.0 - 2.0 * ((i / w) as f32 + 0.5) / h as f32) * half;
            Ray { origin: eye, direction: (forward + right * u + up * v).normalize() }
        })
        .collect()
}

/// Rays through a mesh in all directions: axis-parallel ones and ones in the planes of flat triangles among them.
pub fn random_rays(count: usize, seed: u64) -> Vec<Ray> {
    let mut random = Random(seed);
    (0..count)
        .map(|_| {
            let mut origin = random.cube() * 1.5;
            let mut direction = random.direction();
            match random.below(8) {
                0 => direction[random.below(3)] = 0.0,
                1 => direction = Vec3::AXES[random.below(3)] * if random.below(2) == 0 { 1.0 } else { -1.0 },
                2 => {
                    let k = random.below(3);
                    origin[k] = (origin[k] * 4.0).round() * 0.25;
                    direction[k] = -0.0;
                }
                3 => direction *= 1e3,
                _ => {}
            }
            Ray { origin, direction }
        })
        .collect()
}

/// The nearest hit of each ray, in f64 over all triangles.
pub fn reference(mesh: &Mesh, rays: &[Ray]) -> Vec<Option<Reference>> {
    rentix::accel::reference(&mesh.positions, &mesh.triangles, rays)
}

/// Why a hit and the reference are not the same scene; None where they are, but for float ties.
pub fn disagreement(
    mesh: &Mesh,
    ray: &Ray,
    hit: Option<&Hit>,
    reference: Option<&Reference>,
) -> Option<String> {
    rentix::accel::disagreement(&mesh.positions, &mesh.triangles, ray, hit, reference)
}

/// All hits along a ray in their order, at most 200.
pub fn all_hits(scene: &impl Aggregate, ray: &Ray) -> Vec<Hit> {
    let mut hits: Vec<Hit> = Vec::new();
    while hits.len() < 200 {
        let Some(hit) = scene.closest(ray, hits.last().map(|h| scene.order(h))) else { break };
        hits.push(hit);
    }
    hits
}
