//! What the documents show works: the examples of job files render, links lead somewhere.

mod common;

use std::fs;
use std::path::{Path, PathBuf};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// A triangle that moves for a second, and a camera.
const DANCE: &str = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
 "nodes": [{"mesh": 0}, {"camera": 0, "translation": [0, 0, 3]}],
 "cameras": [{"name": "Front", "type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}],
 "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
 "buffers": [{"byteLength": 68, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAAAAAAA="}],
 "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 8}, {"buffer": 0, "byteOffset": 44, "byteLength": 24}],
 "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
  {"bufferView": 1, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [1]},
  {"bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC3"}],
 "animations": [{"name": "Dance", "samplers": [{"input": 1, "output": 2}], "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}]}"#;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// What the examples name.
fn inputs(folder: &Path) {
    let write = |name: &str, bytes: &[u8]| {
        let file = folder.join(name);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(file, bytes).unwrap();
    };
    for frame in 1..=48 {
        write(&format!("walk/walk_{frame:04}.obj"), TRIANGLE.as_bytes());
    }
    for frame in 1..=8 {
        write(&format!("bird/bird_{frame}.obj"), TRIANGLE.as_bytes());
    }
    write("room.obj", TRIANGLE.as_bytes());
    write("fixed.mtl", b"newmtl Wall\nKd 0.5 0.5 0.5\n");
    write("sky.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n\x80\x80\x80\x81");
    write("dance.gltf", DANCE.as_bytes());
}

#[test]
fn the_examples_of_job_files_render() {
    let text = fs::read_to_string(root().join("docs/job-file.md")).unwrap();
    let examples: Vec<&str> =
        text.split("```yaml\n").skip(1).map(|rest| rest.split("```").next().unwrap()).collect();
    assert!(examples.len() >= 7, "{}", examples.len());
    let t = tempfile::tempdir().unwrap();
    inputs(t.path());
    for (i, example) in examples.iter().enumerate() {
        let job = t.path().join(format!("job{i}.yaml"));
        fs::write(&job, example).unwrap();
        let out = format!("out{i}");
        let more = ["--device", "cpu", "--size", "32x18"];
        common::render(t.path(), &job, &out, &more, 0);
        let pictures = common::pictures(&t.path().join(out));
        assert!(pictures.len() >= 25, "example {i}: {:?}", pictures.keys());
    }
}

#[test]
fn links_lead_somewhere() {
    let docs = fs::read_dir(root().join("docs")).unwrap().map(|e| e.unwrap().path());
    let mut pages: Vec<PathBuf> = docs.filter(|p| p.extension().is_some_and(|e| e == "md")).collect();
    pages.extend(["README.md", "CONTRIBUTING.md", "benches/README.md"].map(|p| root().join(p)));
    let mut dead = Vec::new();
    for page in pages {
        let text = fs::read_to_string(&page).unwrap();
        let links = text.split("](").skip(1).filter_map(|rest| rest.split([')', '#']).next());
        for link in links.filter(|l| !l.is_empty() && !l.contains("://")) {
            if !page.with_file_name(link).exists() {
                dead.push(format!("{}: {link}", page.display()));
            }
        }
    }
    assert!(dead.is_empty(), "{}", dead.join("\n"));
}
