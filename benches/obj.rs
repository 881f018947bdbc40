//! How fast OBJ is read, as a multiple of what tobj needs for the same file: `cargo bench --bench obj`.
//!
//! `RENTIX_SCENES` names the folder with the scenes; other files may be given as arguments. Medians of eleven runs in
//! turn, one thread, the files in the page cache.

use rentix::clock::Stopwatch;
use rentix::format::{ReadOptions, TextureCache, load_obj, scan_bounds};
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
        "{:>34} {:>8} {:>9} {:>9} {:>9} {:>7} {:>7}",
        "file", "MB", "tobj ms", "load ms", "bounds ms", "load", "bounds"
    );
    for file in files.iter().filter(|file| file.is_file()) {
        measure(file);
    }
}

fn measure(file: &Path) {
    let (options, textures) = (ReadOptions::default(), TextureCache::default());
    let triangles = tobj::LoadOptions { triangulate: true, ..Default::default() };
    let mut ms = [const { Vec::new() }; 3];
    for _ in 0..RUNS {
        let timed = |run: &dyn Fn()| {
            let watch = Stopwatch::start();
            run();
            watch.ms()
        };
        ms[0].push(timed(&|| drop(black_box(tobj::load_obj(file, &triangles)))));
        ms[1].push(timed(&|| drop(black_box(load_obj(file, &options, &textures)))));
        ms[2].push(timed(&|| drop(black_box(scan_bounds(file)))));
    }
    let [tobj, load, bounds] = ms.map(|mut runs: Vec<f64>| {
        runs.sort_by(f64::total_cmp);
        runs[RUNS / 2]
    });
    let megabytes = file.metadata().map_or(0, |m| m.len()) as f64 / 1e6;
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    println!(
        "{name:>34} {megabytes:>8.2} {tobj:>9.2} {load:>9.2} {bounds:>9.2} {:>6.1}x {:>6.1}x",
        tobj / load,
        tobj / bounds
    );
}
