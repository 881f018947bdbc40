//! Deforms an OBJ into a sequence, a wave that runs through it along x, to measure what warm frames cost: all vertices move,
//! nothing else does.
//!
//! `cargo run --release --example wave -- FILE.obj FOLDER [FRAMES]` writes `wave_0001.obj` … (24 frames).

use rentix::bench::sequences::write_wave;
use std::error::Error;
use std::path::Path;
use std::{env, fs};

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = env::args().skip(1).collect();
    let [file, folder, rest @ ..] = &args[..] else {
        return Err("usage: wave FILE.obj FOLDER [FRAMES]".into());
    };
    let frames: u32 = rest.first().map_or(Ok(24), |n| n.parse())?;
    write_wave(&fs::read_to_string(file)?, frames, Path::new(folder))?;
    Ok(())
}
