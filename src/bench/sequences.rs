//! Sequences that are made: a wave through any OBJ, and those on which refitting decays or must not be tried.

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// How far the vertices of a wave move, as a share of the largest extent.
const REACH: f64 = 0.02;

/// The three numbers of a `v` line.
fn position(line: &str) -> Option<[f64; 3]> {
    let mut words = line.strip_prefix("v ")?.split_ascii_whitespace().map(str::parse);
    Some([words.next()?.ok()?, words.next()?.ok()?, words.next()?.ok()?])
}

/// Frames of a wave that runs through an OBJ along x: all vertices move, nothing else does. Written to a folder as
/// `wave_0001.obj` …; gives the files.
pub fn write_wave(text: &str, frames: u32, folder: &Path) -> io::Result<Vec<PathBuf>> {
    let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in text.lines().filter_map(position) {
        for k in 0..3 {
            (min[k], max[k]) = (min[k].min(p[k]), max[k].max(p[k]));
        }
    }
    let extent = (0..3).map(|k| max[k] - min[k]).fold(0.0, f64::max);
    let moved = |frame: u32| {
        let mut moved = String::with_capacity(text.len() + text.len() / 8);
        for line in text.lines() {
            if let Some([x, y, z]) = position(line) {
                let phase = 3.0 * (x - min[0]) / extent + f64::from(frame) / f64::from(frames);
                let _ = writeln!(moved, "v {x} {:.6} {z}", y + REACH * extent * (TAU * phase).sin());
            } else {
                moved.push_str(line);
                moved.push('\n');
            }
        }
        moved
    };
    write_frames(folder, "wave", frames, moved)
}

fn write_frames(
    folder: &Path,
    name: &str,
    frames: u32,
    text: impl Fn(u32) -> String,
) -> io::Result<Vec<PathBuf>> {
    fs::create_dir_all(folder)?;
    (0..frames)
        .map(|frame| {
            let file = folder.join(format!("{name}_{:04}.obj", frame + 1));
            fs::write(&file, text(frame))?;
            Ok(file)
        })
        .collect()
}

/// A sequence made to break refitting: what happens to a wavy sheet of 2·(side − 1)² triangles, or to several.
#[derive(Clone, Copy, Debug)]
pub struct Hostile {
    /// What happens.
    pub name: &'static str,
    /// Whether all frames have the same faces, so that trees may be refitted.
    pub keeps_its_faces: bool,
    text: fn(&Sheet, u32) -> String,
}

/// The one that is made where any moving scene will do.
pub(super) const TWIST: Hostile = HOSTILE[3];

/// All of them.
pub const HOSTILE: [Hostile; 11] = [
    Hostile { name: "random places", keeps_its_faces: true, text: random_places },
    Hostile { name: "explosion", keeps_its_faces: true, text: explosion },
    Hostile { name: "bodies that swap places", keeps_its_faces: true, text: swap },
    Hostile { name: "twist", keeps_its_faces: true, text: twist },
    Hostile { name: "collapse and back", keeps_its_faces: true, text: collapse },
    Hostile { name: "to a point", keeps_its_faces: true, text: to_a_point },
    Hostile { name: "inflation", keeps_its_faces: true, text: inflation },
    Hostile { name: "duplicates", keeps_its_faces: true, text: duplicates },
    Hostile { name: "nothing, something, nothing", keeps_its_faces: false, text: something },
    Hostile { name: "new topology", keeps_its_faces: false, text: new_topology },
    Hostile { name: "meshes that come and go", keeps_its_faces: false, text: come_and_go },
];

impl Hostile {
    /// The OBJ text of a frame, counted from 0, of so many (at least 2), with a sheet of side² points.
    pub fn text(&self, side: u32, frames: u32, frame: u32) -> String {
        (self.text)(&Sheet { side, frames }, frame)
    }

    /// Writes all frames to a folder as `f_0001.obj` …; gives the files.
    pub fn write(&self, side: u32, frames: u32, folder: &Path) -> io::Result<Vec<PathBuf>> {
        write_frames(folder, "f", frames, |frame| self.text(side, frames, frame))
    }
}

/// Numbers in [0, 1): a linear congruential generator with Knuth's constants.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / 16_777_216.0
    }
}

/// A wavy sheet over [−1, 1]², and a time that runs from 0 in frame 0 to 1 in the last.
#[derive(Debug)]
pub struct Sheet {
    /// Points on a side, at least 2.
    pub side: u32,
    /// Frames, at least 2.
    pub frames: u32,
}

impl Sheet {
    /// A point of it as it stands.
    fn point(&self, i: u32, j: u32) -> [f64; 3] {
        let [x, y] = [i, j].map(|k| 2.0 * f64::from(k) / f64::from(self.side - 1) - 1.0);
        [x, y, 0.3 * (4.0 * x).sin() * (3.0 * y).cos()]
    }

    /// The OBJ text of the sheet in a frame, its points moved: `place` is given the time, the point and its place in its
    /// row.
    pub fn moved(&self, frame: u32, place: impl Fn(f64, [f64; 3], u32) -> [f64; 3]) -> String {
        let t = f64::from(frame) / f64::from(self.frames - 1);
        let mut text = String::new();
        for j in 0..self.side {
            for i in 0..self.side {
                let [x, y, z] = place(t, self.point(i, j), i);
                let _ = writeln!(text, "v {x} {y} {z}");
            }
        }
        self.faces(&mut text, 0);
        text
    }

    /// Its quads, after so many vertices.
    fn faces(&self, text: &mut String, before: u32) {
        for j in 0..self.side - 1 {
            for i in 0..self.side - 1 {
                let a = before + j * self.side + i + 1;
                let _ = writeln!(text, "f {a} {} {} {}", a + 1, a + self.side + 1, a + self.side);
            }
        }
    }
}

fn random_places(sheet: &Sheet, frame: u32) -> String {
    let mut random = Random(u64::from(frame));
    let mut text = String::new();
    for _ in 0..sheet.side * sheet.side {
        let [x, y, z] = [0; 3].map(|_| 2.0 * random.next() - 1.0);
        let _ = writeln!(text, "v {x} {y} {z}");
    }
    sheet.faces(&mut text, 0);
    text
}

fn explosion(sheet: &Sheet, frame: u32) -> String {
    sheet.moved(frame, |t, p, i| p.map(|x| x * (1.0 + 20.0 * t * f64::from(i % 7))))
}

fn swap(sheet: &Sheet, frame: u32) -> String {
    sheet.moved(frame, |t, [x, y, z], i| {
        let side = if i < sheet.side / 2 { 1.0 } else { -1.0 };
        [x + side * 2.0 * t, y + side * (PI * t).sin(), z]
    })
}

fn twist(sheet: &Sheet, frame: u32) -> String {
    sheet.moved(frame, |t, [x, y, z], _| {
        let (sin, cos) = (20.0 * TAU * t * y).sin_cos();
        [x * cos - z * sin, y, x * sin + z * cos]
    })
}

fn collapse(sheet: &Sheet, frame: u32) -> String {
    sheet.moved(frame, |t, p, _| p.map(|x| x * (2.0 * t - 1.0).abs()))
}

fn to_a_point(sheet: &Sheet, frame: u32) -> String {
    sheet.moved(frame, |t, p, _| if t < 0.5 { p } else { [0.5, 0.5, 0.5] })
}

fn inflation(sheet: &Sheet, frame: u32) -> String {
    sheet.moved(frame, |t, p, _| p.map(|x| x * 1e6_f64.powf(t)))
}

fn duplicates(sheet: &Sheet, frame: u32) -> String {
    sheet.moved(frame, |t, [x, y, z], i| if i % 3 == 0 { [0.0, t, 0.0] } else { [x, y + t, z] })
}

fn something(sheet: &Sheet, frame: u32) -> String {
    let there = sheet.frames * 3 / 8..sheet.frames * 3 / 4;
    if there.contains(&frame) { sheet.moved(frame, |_, p, _| p) } else { "v 0 0 0\n".to_string() }
}

fn new_topology(sheet: &Sheet, frame: u32) -> String {
    let mut random = Random(u64::from(frame));
    let mut text = sheet.moved(frame, |_, p, _| p);
    for _ in 0..5 + frame {
        let mut corner = || 1 + (random.next() * f64::from(sheet.side * sheet.side)) as u32;
        let _ = writeln!(text, "f {} {} {}", corner(), corner(), corner());
    }
    text
}

fn come_and_go(sheet: &Sheet, frame: u32) -> String {
    let mut text = String::new();
    let mut vertices = 0;
    for k in (0..4).filter(|k| (frame >> k) & 1 == 1 || *k == 3) {
        let _ = writeln!(text, "o {k}");
        for j in 0..sheet.side {
            for i in 0..sheet.side {
                let [x, y, z] = sheet.point(i, j);
                let _ = writeln!(text, "v {} {y} {}", x + f64::from(k), z + 0.1 * f64::from(frame));
            }
        }
        sheet.faces(&mut text, vertices);
        vertices += sheet.side * sheet.side;
    }
    text
}
