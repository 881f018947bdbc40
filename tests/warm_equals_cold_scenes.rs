//! Promise 1 on real sequences over their whole length. They are not in this repository.

mod common;
use common::{pictures, render, report, run};
use std::path::{Path, PathBuf};

const SIZE: [&str; 2] = ["--size", "96x54"];

/// Sequences and glTF models below a folder, by name; those alone whose path has the word of `RENTIX_ONLY`.
fn inputs(scenes: &Path) -> Vec<PathBuf> {
    let entries = |folder: &Path| -> Vec<PathBuf> {
        std::fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path()).collect()
    };
    let is_sequence =
        |path: &PathBuf| path.file_name().is_some_and(|n| n.to_string_lossy().starts_with("seq-"));
    let is_gltf = |path: &PathBuf| path.extension().is_some_and(|e| e == "gltf" || e == "glb");
    let mut found: Vec<PathBuf> =
        entries(scenes).into_iter().filter(|path| is_sequence(path) && path.is_dir()).collect();
    let models = entries(&scenes.join("gltf"));
    found.extend(models.iter().flat_map(|folder| entries(folder)).filter(is_gltf));
    if let Ok(only) = std::env::var("RENTIX_ONLY") {
        found.retain(|path| path.to_string_lossy().contains(&only));
    }
    found.sort();
    found
}

/// `rentix verify` under each policy, then some frames by processes of their own.
fn check(t: &Path, input: &Path) -> u64 {
    let name = input.display();
    let mut count = 0;
    for update in ["auto", "refit", "rebuild"] {
        let args = [&["verify", input.to_str().unwrap(), "--update", update, "--json"], &SIZE[..]].concat();
        let told = run(t, args);
        let verdict: serde_json::Value = serde_json::from_str(&told.stdout)
            .unwrap_or_else(|error| panic!("{name}, {update}: {error}: {}", told.stderr));
        assert!(told.status == 0 && verdict["verdict"] == "equal", "{name}, {update}: {verdict}");
        assert!(verdict["failed"] == 0, "{name}, {update}: {verdict}");
        count = verdict["pictures"].as_u64().unwrap();
        assert!(count > 0, "{name}, {update}: {verdict}");
    }
    let r = t.join("r.json");
    render(t, input, "all", &[&SIZE[..], &["--report", r.to_str().unwrap()]].concat(), 0);
    let all = pictures(&t.join("all"));
    let report = report(&r);
    let frames = report["frames"].as_array().unwrap();
    assert!(frames.len() as u64 == count && all.len() as u64 == count, "{name}");
    for at in [0, 1, frames.len() / 2, frames.len() - 1].into_iter().filter(|&at| at < frames.len()) {
        // a file without a number cannot be asked for by one
        let Some(number) = frames[at]["frame"].as_i64().map(|n| n.to_string()) else { continue };
        let picture = frames[at]["picture"].as_str().unwrap();
        let out = format!("alone {at}");
        render(t, input, &out, &[&SIZE[..], &["--frames", &number]].concat(), 0);
        let alone = pictures(&t.join(out));
        assert!(alone.len() == 1 && alone[picture] == all[picture], "{name}: frame {number} alone differs");
    }
    count
}

/// All of it takes long; one sequence with `RENTIX_ONLY=seq-bird`:
/// `RENTIX_SCENES=FOLDER cargo test --release --test warm_equals_cold_scenes -- --ignored --nocapture`
#[test]
#[ignore = "long, and needs the scenes"]
fn every_sequence_and_gltf_over_its_whole_length() {
    let scenes = std::env::var_os("RENTIX_SCENES").expect("RENTIX_SCENES names the folder of the scenes");
    let inputs = inputs(Path::new(&scenes));
    assert!(!inputs.is_empty(), "there is none");
    for input in inputs {
        let t = tempfile::tempdir().unwrap();
        eprintln!("{}: {} frames", input.display(), check(t.path(), &input));
    }
}
