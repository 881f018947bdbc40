//! How fast OBJ is read, as a multiple of what tobj needs for the same file: `cargo bench --bench obj`.
//!
//! `RENTIX_SCENES` names the folder with the scenes; other files may be given as arguments. Medians of eleven runs in
//! turn, one thread, the files in the page cache. "again" is a frame read with the one before it at hand: a file of a
//! sequence, else the same file with all its vertices moved.

use rentix::clock::Stopwatch;
use rentix::format::{ReadOptions, TextureCache, load_obj, load_obj_after, scan_bounds};
use std::fmt::Write;
use std::hint::black_box;
use std::path::{Path, PathBuf};

const RUNS: usize = 11;

fn main() {
    let mut files: Vec<PathBuf> =
        std::env::args().skip(1).filter(|word| !word.starts_with('-')).map(PathBuf::from).collect();
    if files.is_empty() {
        let Some(scenes) = std::env::var_os("RENTIX_SCENES").map(PathBuf::from) else {
            println!("RENTIX_SCENES is not set and no file was given: nothing is measured");
            return;
        };
        files = [
            "bunny/stanford-bunny.obj",
            "seq-xbot-dance/untitled_000012.obj",
            "seq-dancing/Dancing_0000015.obj",
            "seq-arcsim-adaptive/0030_00.obj",
            "seq-origami/500.obj",
            "conference/conference.obj",
        ]
        .map(|file| scenes.join(file))
        .to_vec();
    }
    println!(
        "{:>34} {:>8} {:>9} {:>9} {:>9} {:>9} {:>7} {:>7} {:>7}",
        "file", "MB", "tobj ms", "load ms", "bounds ms", "again ms", "load", "bounds", "again"
    );
    let folder = tempfile::tempdir().expect("a folder for moved files");
    for file in files.iter().filter(|file| file.is_file()) {
        let moved = next_frame(file).unwrap_or_else(|| {
            let moved = folder.path().join(file.file_name().unwrap_or_default());
            std::fs::write(&moved, wave(&std::fs::read_to_string(file).expect("the file is text")))
                .expect("the folder can be written");
            moved
        });
        measure(file, &moved);
    }
}

/// The file of a sequence behind that one: the last number in its name is one more.
fn next_frame(file: &Path) -> Option<PathBuf> {
    let name = file.file_stem()?.to_str()?;
    let digits = name.len() - name.bytes().rev().take_while(u8::is_ascii_digit).count();
    let number: u64 = name[digits..].parse().ok()?;
    let next = format!("{}{:0width$}.obj", &name[..digits], number + 1, width = name.len() - digits);
    Some(file.with_file_name(next)).filter(|next| next.is_file())
}

/// The same text with all positions moved; numbers have as many decimals as before.
fn wave(text: &str) -> String {
    let mut moved = String::with_capacity(text.len());
    for line in text.lines() {
        let numbers: Vec<&str> =
            line.strip_prefix("v ").map_or(Vec::new(), |l| l.split_whitespace().collect());
        if numbers.len() < 3 {
            moved += line;
        } else {
            let values: Vec<f64> = numbers.iter().map(|n| n.parse().unwrap_or(0.0)).collect();
            moved.push('v');
            for (number, value) in numbers.iter().zip(&values) {
                let decimals = number.split('.').nth(1).map_or(6, str::len);
                let _ = write!(moved, " {:.decimals$}", value * (1.0 + 0.01 * (values[1] * 7.0).sin()));
            }
        }
        moved.push('\n');
    }
    moved
}

fn measure(file: &Path, next: &Path) {
    let (options, textures) = (ReadOptions::default(), TextureCache::default());
    let triangles = tobj::LoadOptions { triangulate: true, ..Default::default() };
    let (_, before) = load_obj_after(None, file, &options, &textures).expect("the file can be read");
    let mut ms = [const { Vec::new() }; 5];
    for _ in 0..RUNS {
        let timed = |run: &dyn Fn()| {
            let watch = Stopwatch::start();
            run();
            watch.ms()
        };
        ms[0].push(timed(&|| drop(black_box(tobj::load_obj(file, &triangles)))));
        ms[1].push(timed(&|| drop(black_box(load_obj(file, &options, &textures)))));
        ms[2].push(timed(&|| drop(black_box(scan_bounds(file)))));
        ms[3].push(timed(&|| drop(black_box(tobj::load_obj(next, &triangles)))));
        ms[4].push(timed(&|| drop(black_box(load_obj_after(before.as_ref(), next, &options, &textures)))));
    }
    let [tobj, load, bounds, tobj_next, again] = ms.map(|mut runs: Vec<f64>| {
        runs.sort_by(f64::total_cmp);
        runs[RUNS / 2]
    });
    let megabytes = file.metadata().map_or(0, |m| m.len()) as f64 / 1e6;
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    println!(
        "{name:>34} {megabytes:>8.2} {tobj:>9.2} {load:>9.2} {bounds:>9.2} {again:>9.2} {:>6.1}x {:>6.1}x {:>6.1}x",
        tobj / load,
        tobj / bounds,
        tobj_next / again
    );
}
