//! The inputs in a folder of scenes: sequences (folders whose names begin with `seq-`), single OBJs and glTF files.

use std::fs;
use std::path::{Path, PathBuf};

/// Smaller files are no scenes.
const LEAST_BYTES: u64 = 20_000;

/// An input.
#[derive(Clone, Debug)]
pub(super) struct Scene {
    /// Its path within the folder of scenes, with `/`.
    pub(super) name: String,
    pub(super) path: PathBuf,
}

/// All of them, mixed: neighbours in the alphabet are alike.
pub(super) fn scenes(root: Option<&Path>) -> Vec<Scene> {
    let mut paths = Vec::new();
    for folder in root.map(list).unwrap_or_default() {
        if folder.file_name().is_some_and(|n| n.to_string_lossy().starts_with("seq-")) {
            paths.push(folder);
            continue;
        }
        let inside = |path: PathBuf| if path.is_dir() { list(&path) } else { vec![path] };
        paths.extend(list(&folder).into_iter().flat_map(inside).filter(|file| {
            let is_scene = file.extension().is_some_and(|e| e == "obj" || e == "gltf" || e == "glb");
            is_scene && file.metadata().is_ok_and(|m| m.len() >= LEAST_BYTES)
        }));
    }
    // a stride without a common factor with their number takes each once
    let count = paths.len();
    let stride = (0..count).rev().find(|s| s % 7 == 3 && gcd(*s, count) == 1).unwrap_or(1);
    let scene = |path: &PathBuf| Scene {
        name: root
            .map_or(&**path, |root| path.strip_prefix(root).unwrap_or(path))
            .to_string_lossy()
            .replace('\\', "/"),
        path: path.clone(),
    };
    (0..count).map(|i| scene(&paths[i * stride % count])).collect()
}

fn list(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = entries.map(|e| e.path()).collect();
    paths.sort();
    paths
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// A path as a string of YAML.
pub(super) fn quoted(path: &Path) -> String {
    // strings of JSON are strings of YAML
    serde_json::json!(path.to_string_lossy()).to_string()
}
