//! Makes `sequences/materials/`: a ball, a chequered floor, a sky, and a material library for each illumination model of
//! MTL; `sequences/materials.yaml` puts them into one picture.
//!
//! `cargo run --example make_materials` writes the files; with `-- --check` it tells whether those there are the same.

mod made;

use made::Files;
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::io;
use std::process::ExitCode;

/// The ball's rings and sectors.
const RINGS: u32 = 24;
const SECTORS: u32 = 48;

/// What each model's ball is made of, but for `newmtl` and `illum`.
const MODELS: [&str; 11] = [
    "Kd 0.75 0.3 0.2",
    "Kd 0.75 0.3 0.2\nKa 0.75 0.3 0.2",
    "Kd 0.75 0.3 0.2\nKa 0.75 0.3 0.2\nKs 0.6 0.6 0.6\nNs 60",
    "Kd 0.2 0.08 0.05\nKs 0.7 0.7 0.7\nNs 200",
    "Kd 0.1 0.04 0.03\nKs 0.3 0.3 0.3\nNs 200\nd 0.25",
    "Kd 0.4 0.15 0.1\nKs 0.05 0.05 0.05\nNs 200",
    "Kd 0 0 0\nKs 0.12 0.12 0.12\nNs 200\nNi 1.5\nTf 1 0.85 0.75",
    "Kd 0 0 0\nKs 0 0 0\nNs 200\nNi 1.5\nTf 1 0.85 0.75",
    "Kd 0.2 0.08 0.05\nKs 0.7 0.7 0.7\nNs 200",
    "Kd 0.1 0.04 0.03\nKs 0.3 0.3 0.3\nNs 200\nd 0.25",
    "Kd 0 0 0",
];

const FLOOR: &str = "\
# Made by examples/make_materials.rs
mtllib floor.mtl
v -8 0 -8
v 8 0 -8
v 8 0 8
v -8 0 8
vt 0 0
vt 8 0
vt 8 8
vt 0 8
usemtl floor
f 4/1 3/2 2/3 1/4
";

const FLOOR_MTL: &str = "\
# Made by examples/make_materials.rs
newmtl floor
Ka 1 1 1
Kd 1 1 1
map_Ka floor.ppm
map_Kd floor.ppm
illum 1
";

/// A ball of radius 1 that stands on the floor, of quads, with normals.
fn ball() -> String {
    let mut text = String::from("# Made by examples/make_materials.rs\nmtllib model_2.mtl\n");
    for ring in 0..=RINGS {
        let (sin, cos) = (f64::from(ring) / f64::from(RINGS) * PI).sin_cos();
        for sector in 0..SECTORS {
            let (s, c) = (f64::from(sector) / f64::from(SECTORS) * TAU).sin_cos();
            // + 0.0: no negative zero in the text
            let [x, y, z] = [sin * s, cos, sin * c].map(|x| (x * 1e5).round() / 1e5 + 0.0);
            let _ = writeln!(text, "v {x} {} {z}\nvn {x} {y} {z}", y + 1.0);
        }
    }
    text += "usemtl ball\n";
    for ring in 0..RINGS {
        for sector in 0..SECTORS {
            let at = |ring: u32, sector: u32| 1 + ring * SECTORS + sector % SECTORS;
            let corners =
                [at(ring, sector), at(ring + 1, sector), at(ring + 1, sector + 1), at(ring, sector + 1)];
            // at the poles a side of the quad has no length
            let corners = match ring {
                0 => &corners[..3],
                _ if ring + 1 == RINGS => &[corners[0], corners[1], corners[3]],
                _ => &corners[..],
            };
            text += "f";
            for i in corners {
                let _ = write!(text, " {i}//{i}");
            }
            text.push('\n');
        }
    }
    text
}

/// A picture as binary PPM.
fn ppm(width: u32, height: u32, texel: impl Fn(u32, u32) -> [u8; 3]) -> Vec<u8> {
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let mut bytes = format!("P6\n{width} {height}\n255\n").into_bytes();
    bytes.extend(texels.flat_map(|(x, y)| texel(x, y)));
    bytes
}

/// Blue above, brown below, a bright band at the horizon, and a window to each side.
fn sky(x: u32, y: u32) -> [u8; 3] {
    let blend = |a: [u8; 3], b: [u8; 3], share: f64| {
        [0, 1, 2].map(|k| (f64::from(a[k]) * (1.0 - share) + f64::from(b[k]) * share).round() as u8)
    };
    let height = f64::from(y) / 63.0;
    if (10..22).contains(&y) && (x % 64).abs_diff(32) < 6 && !(15..17).contains(&y) {
        [255, 250, 235]
    } else if y < 32 {
        blend([40, 80, 150], [205, 215, 225], height * 2.0)
    } else {
        blend([120, 100, 80], [50, 40, 35], height * 2.0 - 1.0)
    }
}

/// Names and contents of all files.
pub(crate) fn files() -> Files {
    let mut files = Files::new();
    files.insert("ball.obj".into(), ball().into_bytes());
    files.insert("floor.obj".into(), FLOOR.into());
    files.insert("floor.mtl".into(), FLOOR_MTL.into());
    let checker = |x: u32, y: u32| if (x < 64) == (y < 64) { [215, 210, 200] } else { [70, 95, 110] };
    files.insert("floor.ppm".into(), ppm(128, 128, checker));
    files.insert("sky.ppm".into(), ppm(128, 64, sky));
    for (illum, words) in MODELS.iter().enumerate() {
        let text = format!("# Made by examples/make_materials.rs\nnewmtl ball\n{words}\nillum {illum}\n");
        files.insert(format!("model_{illum}.mtl"), text.into());
    }
    files
}

fn main() -> io::Result<ExitCode> {
    made::write_or_check("materials", &files())
}
