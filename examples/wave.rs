//! Deforms an OBJ into a sequence, a wave that runs through it along x, to measure what warm frames cost: all vertices move,
//! nothing else does.
//!
//! `cargo run --release --example wave -- FILE.obj FOLDER [FRAMES]` writes `wave_0001.obj` … (24 frames).

use std::error::Error;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;
use std::{env, fs};

/// How far vertices move, as a share of the largest extent.
const REACH: f64 = 0.02;

/// The three numbers of a `v` line.
fn position(line: &str) -> Option<[f64; 3]> {
    let mut words = line.strip_prefix("v ")?.split_ascii_whitespace().map(str::parse);
    Some([words.next()?.ok()?, words.next()?.ok()?, words.next()?.ok()?])
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = env::args().skip(1).collect();
    let [file, folder, rest @ ..] = &args[..] else {
        return Err("usage: wave FILE.obj FOLDER [FRAMES]".into());
    };
    let frames: u32 = rest.first().map_or(Ok(24), |n| n.parse())?;
    let text = fs::read_to_string(file)?;
    let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in text.lines().filter_map(position) {
        for k in 0..3 {
            (min[k], max[k]) = (min[k].min(p[k]), max[k].max(p[k]));
        }
    }
    let extent = (0..3).map(|k| max[k] - min[k]).fold(0.0, f64::max);
    fs::create_dir_all(folder)?;
    for frame in 0..frames {
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
        fs::write(Path::new(folder).join(format!("wave_{:04}.obj", frame + 1)), moved)?;
    }
    Ok(())
}
