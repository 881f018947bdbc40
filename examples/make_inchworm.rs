//! Makes `sequences/inchworm/`: an inchworm that crawls through a still garden, one OBJ a frame, as an exporter writes
//! them: everything in every file, names that change, one MTL.
//!
//! `cargo run --example make_inchworm` writes the files; with `-- --check` it tells whether those there are the same.

pub(crate) mod made;

use made::Files;
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::io;
use std::process::ExitCode;

const FRAMES: u32 = 36;
/// How far one cycle of the gait brings it.
const STRIDE: f64 = 1.1;
const LENGTH: f64 = 3.4;
const RINGS: usize = 40;
const SECTORS: usize = 16;

const MTL: &str = "\
# Made by examples/make_inchworm.rs
newmtl Skin
Kd 0.36 0.62 0.16
Ks 0.25 0.3 0.2
Ns 40
illum 2
newmtl Stripe
Kd 0.85 0.72 0.15
Ks 0.25 0.25 0.2
Ns 40
illum 2
newmtl Eye
Kd 0.92 0.92 0.9
Ks 0.6 0.6 0.6
Ns 120
illum 2
newmtl Pupil
Kd 0.03 0.03 0.05
Ks 0.8 0.8 0.8
Ns 200
illum 2
newmtl Soil
Kd 0.42 0.33 0.25
illum 1
newmtl Moss
Kd 0.34 0.4 0.2
illum 1
newmtl Cap
Kd 0.75 0.13 0.09
Ks 0.3 0.3 0.3
Ns 30
illum 2
newmtl Stem
Kd 0.85 0.8 0.7
illum 1
newmtl Stone
Kd 0.45 0.46 0.5
illum 1
newmtl Dew
Kd 0.5 0.65 0.8
Ks 0.9 0.9 0.9
Ns 300
d 0.35
illum 2
";

/// An OBJ in the making.
#[derive(Default)]
struct Obj {
    text: String,
    vertices: usize,
}

impl Obj {
    fn object(&mut self, name: &str) {
        let _ = writeln!(self.text, "o {name}");
    }

    fn material(&mut self, name: &str, smooth: bool) {
        let _ = writeln!(self.text, "usemtl {name}\ns {}", if smooth { "1" } else { "off" });
    }

    fn vertex(&mut self, p: [f64; 3]) -> usize {
        let [x, y, z] = p.map(|x| (x * 1e4).round() / 1e4 + 0.0);
        let _ = writeln!(self.text, "v {x} {y} {z}");
        self.vertices += 1;
        self.vertices
    }

    fn face(&mut self, corners: &[usize]) {
        self.text.push('f');
        for c in corners {
            let _ = write!(self.text, " {c}");
        }
        self.text.push('\n');
    }

    /// Rings of vertices joined by quads, both ends closed by a polygon; `material` names that of each ring of quads.
    fn tube(&mut self, rings: &[Vec<[f64; 3]>], material: impl Fn(usize) -> &'static str) {
        let first: Vec<Vec<usize>> =
            rings.iter().map(|ring| ring.iter().map(|p| self.vertex(*p)).collect()).collect();
        let mut last = "";
        for (i, pair) in first.windows(2).enumerate() {
            if material(i) != last {
                last = material(i);
                self.material(last, true);
            }
            let n = pair[0].len();
            for j in 0..n {
                let k = (j + 1) % n;
                self.face(&[pair[0][j], pair[0][k], pair[1][k], pair[1][j]]);
            }
        }
        let mut start = first[0].clone();
        start.reverse();
        self.face(&start);
        self.face(&first[first.len() - 1]);
    }

    /// A surface of revolution about the vertical through (x, z): radius and height from the bottom up.
    fn lathe(&mut self, at: [f64; 2], profile: &[[f64; 2]], sectors: usize, material: &'static str) {
        let rings: Vec<Vec<[f64; 3]>> = profile
            .iter()
            .map(|[r, y]| {
                (0..sectors)
                    .map(|j| TAU * j as f64 / sectors as f64)
                    .map(|a| [at[0] + r * a.cos(), *y, at[1] - r * a.sin()])
                    .collect()
            })
            .collect();
        self.tube(&rings, |_| material);
    }

    fn ball(&mut self, c: [f64; 3], r: f64, sectors: usize, material: &'static str) {
        let rings = sectors / 2;
        let profile: Vec<[f64; 2]> = (0..=rings)
            .map(|i| PI * (0.04 + 0.92 * i as f64 / rings as f64))
            .map(|a| [r * a.sin(), c[1] - r * a.cos()])
            .collect();
        self.lathe([c[0], c[2]], &profile, sectors, material);
    }

    fn stone(&mut self, c: [f64; 3], half: [f64; 3]) {
        let corner = |i: usize| {
            let side = |k: usize| if i >> k & 1 == 0 { -half[k] } else { half[k] };
            let taper = if i & 2 == 0 { 1.0 } else { 0.7 };
            [c[0] + side(0) * taper, c[1] + side(1), c[2] + side(2) * taper]
        };
        let v: Vec<usize> = (0..8).map(|i| self.vertex(corner(i))).collect();
        self.material("Stone", false);
        for f in [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
            self.face(&f.map(|i| v[i]));
        }
    }
}

/// Where tail and head stand and how high the hump is, at a phase of the gait (0 to 1): first the tail is drawn up,
/// then the head reaches out.
fn gait(phase: f64) -> (f64, f64, f64) {
    let ease = |x: f64| x * x * (3.0 - 2.0 * x);
    let tail = STRIDE * ease((2.0 * phase).min(1.0));
    let head = LENGTH + STRIDE * ease((2.0 * phase - 1.0).max(0.0));
    // the flatter the longer: roughly what keeps the length of the body
    let hump = 0.78 * (LENGTH - (head - tail)).max(0.0).sqrt() + 0.06;
    (tail, head, hump)
}

/// The height of the ground.
fn ground(x: f64, z: f64) -> f64 {
    0.06 * (1.3 * x).sin() * (1.7 * z).cos() - 0.06
}

fn worm(obj: &mut Obj, frame: u32) {
    let cycle = 2.0 * f64::from(frame) / f64::from(FRAMES);
    let (tail, head, hump) = gait(cycle.fract());
    let start = -3.2 + STRIDE * cycle.floor();
    let spine = |s: f64| {
        let s = s.clamp(0.0, 1.0);
        let (x, z) = (start + tail + (head - tail) * s, 0.12 * (TAU * s).sin());
        let lift = 0.25 * (8.0 * (s - 0.86)).clamp(0.0, 1.0);
        [x, ground(x, z) + 0.27 + hump * (PI * s).sin().powi(2) + lift, z]
    };
    let rings: Vec<Vec<[f64; 3]>> = (0..RINGS)
        .map(|i| {
            // rings stand closer at the ends, which are round
            let s = 0.5 - 0.5 * (PI * i as f64 / (RINGS - 1) as f64).cos();
            let (a, b, c) = (spine(s - 0.01), spine(s + 0.01), spine(s));
            let along = [b[0] - a[0], b[1] - a[1]];
            let length = along[0].hypot(along[1]);
            let up = [-along[1] / length, along[0] / length];
            let ends = (1.0 - (2.0 * s - 1.0).abs().powi(9)).sqrt().max(0.05);
            let r = 0.29 * ends * (1.0 + 0.08 * (11.0 * TAU * s).sin());
            (0..SECTORS)
                .map(|j| TAU * j as f64 / SECTORS as f64)
                .map(|t| [c[0] + r * t.cos() * up[0], c[1] + r * t.cos() * up[1], c[2] - r * t.sin()])
                .collect()
        })
        .collect();
    obj.object(&format!("Worm.{frame:03}"));
    let stripe = |i: usize| (5.5 * (0.5 - 0.5 * (PI * i as f64 / (RINGS - 1) as f64).cos())).fract() > 0.78;
    obj.tube(&rings, |i| if stripe(i) { "Stripe" } else { "Skin" });
    let face = spine(1.0);
    obj.object(&format!("Eyes.{frame:03}"));
    for side in [-1.0, 1.0] {
        obj.ball([face[0] - 0.02, face[1] + 0.2, side * 0.17], 0.13, 12, "Eye");
        obj.ball([face[0] + 0.07, face[1] + 0.22, side * 0.19], 0.07, 8, "Pupil");
    }
}

fn garden(obj: &mut Obj, frame: u32) {
    obj.object(&format!("Ground.{frame:03}"));
    let n = 12;
    let at = |i: usize| -7.0 + 14.0 * i as f64 / n as f64;
    let v: Vec<usize> = (0..=n)
        .flat_map(|i| (0..=n).map(move |j| (at(i), at(j))))
        .map(|(x, z)| obj.vertex([x, ground(x, z), z]))
        .collect();
    for material in 0..2 {
        obj.material(["Soil", "Moss"][material], true);
        for (i, j) in
            (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|(i, j)| (i + j) % 2 == material)
        {
            let c = |i: usize, j: usize| v[i * (n + 1) + j];
            obj.face(&[c(i, j), c(i, j + 1), c(i + 1, j + 1), c(i + 1, j)]);
        }
    }
    obj.object(&format!("Garden.{frame:03}"));
    for (x, z, size) in [(-1.2, -2.2, 1.0), (0.3, -2.9, 0.65), (3.4, -1.7, 0.8)] {
        obj.lathe([x, z], &[[size * 0.2, -0.1], [size * 0.14, size * 1.5 - 0.1]], 10, "Stem");
        let cap: Vec<[f64; 2]> = (0..=6)
            .map(|i| 0.5 * PI * f64::from(i) / 6.0)
            .map(|a| [size * 0.85 * a.cos().max(0.04), size * (1.3 + 0.55 * a.sin())])
            .collect();
        obj.lathe([x, z], &cap, 16, "Cap");
    }
    obj.stone([2.2, 0.16, 1.7], [0.4, 0.25, 0.3]);
    obj.stone([-3.6, 0.2, -1.2], [0.5, 0.3, 0.45]);
    obj.stone([4.7, 0.1, 0.9], [0.25, 0.18, 0.3]);
    for (x, z, r) in [(-0.4, 1.5, 0.3), (0.35, 1.85, 0.16), (3.3, 1.3, 0.22)] {
        obj.ball([x, 0.8 * r, z], r, 12, "Dew");
    }
}

/// Names and contents of all files.
pub(crate) fn files() -> Files {
    let mut files = Files::new();
    files.insert("inchworm.mtl".into(), MTL.into());
    for frame in 1..=FRAMES {
        let mut obj = Obj::default();
        obj.text += "# Made by examples/make_inchworm.rs\nmtllib inchworm.mtl\n";
        worm(&mut obj, frame - 1);
        garden(&mut obj, frame);
        files.insert(format!("inchworm_{frame:04}.obj"), obj.text.into_bytes());
    }
    files
}

fn main() -> io::Result<ExitCode> {
    made::write_or_check("inchworm", &files())
}
