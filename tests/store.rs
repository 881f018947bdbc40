//! The store on disk bears on time alone: pictures are the same without it, with it, with it damaged, full or gone.

mod common;
use common::{pictures, render, report, run, wave};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A textured wave of more triangles than a tree is kept for, and more bytes than a file's shape; something is wrong with
/// it.
fn scene(folder: &Path) -> PathBuf {
    let input = wave(&folder.join("w"), 2, 64, 80);
    image::RgbImage::from_fn(64, 64, |x, y| image::Rgb([x as u8 * 4, y as u8 * 4, 99]))
        .save(input.join("t.png"))
        .unwrap();
    std::fs::write(input.join("t.mtl"), "newmtl m\nmap_Kd t.png\n").unwrap();
    for frame in 1..=2 {
        let obj = input.join(format!("wave_{frame:04}.obj"));
        let text = std::fs::read_to_string(&obj).unwrap();
        let textured = "\nmtllib t.mtl no.mtl\nwrong\nl 1 2\nusemtl m\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 4/3\nusemtl none\nf 1/9 2/9 3/9\n";
        std::fs::write(&obj, text + textured).unwrap();
    }
    input
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            if entry.path().is_dir() { folders.push(entry.path()) } else { found.push(entry.path()) }
        }
    }
    found.sort();
    found
}

const SIZE: [&str; 2] = ["--size", "64x36"];

fn shown(t: &Path, input: &Path, out: &str, more: &[&str]) -> (BTreeMap<String, Vec<u8>>, String) {
    let said = render(t, input, out, &[&SIZE, more].concat(), 0).stderr;
    (pictures(&t.join(out)), said)
}

/// What a report says of what was read: all warnings, and of each frame what was read and is there.
fn told(t: &Path, input: &Path, more: &[&str]) -> String {
    let path = t.join("r.json");
    let options = ["--overwrite", "--report", path.to_str().unwrap()];
    render(t, input, "told", &[&SIZE, &options[..], more].concat(), 0);
    let report = report(&path);
    let frames = report["frames"].as_array().unwrap();
    let bytes: u64 = frames.iter().map(|f| f["bytes"]["read"].as_u64().unwrap()).sum();
    let frames: Vec<_> =
        frames.iter().map(|f| (&f["source"], &f["triangles"], &f["bytes"]["uploaded"])).collect();
    format!("{} {bytes} {frames:?}", report["warnings"])
}

#[test]
fn pictures_are_the_same_whatever_the_store_holds() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = scene(t);
    let store = t.join("store");
    let (without, _) = shown(t, &input, "without", &["--no-cache"]);
    let texel = image::load_from_memory(&without["wave_0001.png"]).unwrap().into_rgb8();
    assert!(texel.pixels().any(|p| p.0 != texel.get_pixel(0, 0).0), "nothing is seen");
    assert!(entries(&store).is_empty(), "--no-cache keeps something");
    assert!(shown(t, &input, "cold", &["--cold"]).0 == without && entries(&store).is_empty());

    assert!(shown(t, &input, "first", &[]).0 == without);
    let kept = entries(&store);
    // a texture, a tree, the shape in the file that was read first, and the rates of the host and of the device
    assert_eq!(kept.len(), 5, "{kept:?}");
    assert!(shown(t, &input, "second", &[]).0 == without);
    assert_eq!(entries(&store), kept);

    for (round, damage) in ["flip", "cut", "empty", "swap"].into_iter().enumerate() {
        for (i, path) in kept.iter().enumerate() {
            let mut bytes = std::fs::read(path).unwrap();
            match damage {
                "flip" => {
                    let at = bytes.len() * (round + i + 1) / 7;
                    bytes[at] ^= 0x10;
                }
                "cut" => bytes.truncate(bytes.len() / 2),
                "empty" => bytes.clear(),
                _ => bytes = std::fs::read(&kept[0]).unwrap(),
            }
            std::fs::write(path, bytes).unwrap();
        }
        let (got, said) = shown(t, &input, &format!("{damage}ed"), &[]);
        assert!(got == without && said.contains("damaged"), "{damage}: {said}");
        let (got, said) = shown(t, &input, &format!("healed from {damage}"), &[]);
        assert!(got == without && !said.contains("damaged"), "{damage}: {said}");
        assert_eq!(entries(&store), kept);
    }
}

#[test]
fn the_same_is_told_whatever_the_store_holds() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let folder = scene(t);
    // a folder's first frame is read for the next, one file for itself
    for input in [folder.clone(), folder.join("wave_0001.obj")] {
        let without = told(t, &input, &["--no-cache"]);
        for word in ["unknown", "lines", "no.mtl", "texcoord"] {
            assert!(without.contains(word), "{word}: {without}");
        }
        for _ in 0..3 {
            assert_eq!(told(t, &input, &[]), without);
        }
    }
    // what fails fails alike, and is not kept
    let bad = folder.join("wave_0001.obj");
    let kept = entries(&t.join("store")).len();
    std::fs::write(&bad, std::fs::read_to_string(&bad).unwrap() + "f 1 2 999999\n").unwrap();
    let said = |more: &[&str]| render(t, &bad, "bad", &[&SIZE, more].concat(), 1).stderr;
    let without = said(&["--no-cache"]);
    assert!(without.contains("999999") && said(&[]) == without && said(&[]) == without, "{without}");
    assert_eq!(entries(&t.join("store")).len(), kept);
    // but with --lenient it is read, and that is another thing
    let without = told(t, &bad, &["--lenient", "--no-cache"]);
    assert!(told(t, &bad, &["--lenient"]) == without && told(t, &bad, &["--lenient"]) == without);
    assert_eq!(said(&[]), said(&["--no-cache"]));
}

#[test]
fn a_store_that_cannot_be_written_stops_nothing() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = scene(t);
    let file = t.join("file");
    std::fs::write(&file, "no folder").unwrap();
    let (without, _) = shown(t, &input, "without", &["--no-cache"]);
    let (got, said) = shown(t, &input, "out", &["--cache", file.to_str().unwrap()]);
    assert!(got == without && said.matches("--no-cache does without").count() == 1, "{said}");
    assert_eq!(std::fs::read(file).unwrap(), b"no folder");
}

#[test]
fn cache_tells_and_clears() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = scene(t);
    shown(t, &input, "out", &[]);
    let told = |what: &str| -> serde_json::Value {
        let run = run(t, ["cache", what, "--json"]);
        assert_eq!(run.status, 0, "{}", run.stderr);
        serde_json::from_str(&run.stdout).unwrap()
    };
    let bytes: u64 = entries(&t.join("store")).iter().map(|p| p.metadata().unwrap().len()).sum();
    assert_eq!((&told("stat")["entries"], &told("stat")["bytes"]), (&5.into(), &bytes.into()));
    assert_eq!(told("gc")["removed"]["entries"], 0);
    assert_eq!((&told("clear")["removed"]["entries"], &told("stat")["entries"]), (&5.into(), &0.into()));
    // what another put there is not touched
    std::fs::write(t.join("store/mine.txt"), "kept").unwrap();
    told("clear");
    assert!(t.join("store/mine.txt").exists());
}

/// Not even root removes what the system shows of a process.
#[test]
#[cfg(target_os = "linux")]
fn cache_counts_only_what_it_removed() {
    let t = tempfile::tempdir().unwrap();
    let store = t.path().join("store");
    std::fs::create_dir(&store).unwrap();
    std::os::unix::fs::symlink("/proc/self", store.join("v1")).unwrap();
    let told = run(t.path(), ["cache", "clear", "--json"]);
    let line: serde_json::Value = serde_json::from_str(&told.stdout).unwrap();
    assert_eq!(line["removed"], serde_json::json!({"entries": 0, "bytes": 0}));
    assert!(line["entries"].as_u64().unwrap() > 0, "{line}");
    assert!(told.status == 1 && told.stderr.contains("cannot be removed"), "{}", told.stderr);
}
