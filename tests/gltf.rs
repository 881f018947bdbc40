//! Poses of animated glTF models agree with an evaluation of their own in numpy, `gltf_oracle.py`, whose answers are
//! in `data/gltf_poses.txt`. The models are not in this repository: without `RENTIX_SCENES` nothing is compared. And a
//! glTF file is an INPUT.

mod common;

use common::{assert_same, pictures, render, report};
use rentix::format::{ClipChoice, Gltf, GltfOptions};
use rentix::math::DVec3;
use rentix::scene::Object;
use std::collections::HashMap;
use std::fmt::Write;
use std::path::Path;
use std::process::Command;

/// The greatest distance from the oracle's place, of the diagonal of the model's box.
const TOLERANCE: f64 = 1e-4;

/// The world positions of all vertices in order, by object.
fn objects(gltf: &Gltf, time_s: f64, clip: &ClipChoice) -> Vec<Vec<[f64; 3]>> {
    let frame = gltf.frame(time_s, clip).expect("a sample model can be shown");
    let places = |object: &Object| {
        let world = |p: &[f32; 3]| {
            let p = DVec3::from_array(p.map(f64::from));
            object.transform.map_or(p, |world| world.transform_point3(p)).to_array()
        };
        object.geometry.positions.0.iter().map(world).collect()
    };
    frame.objects.iter().map(places).collect()
}

fn vertices(gltf: &Gltf, time_s: f64) -> Vec<[f64; 3]> {
    objects(gltf, time_s, &ClipChoice::Auto).concat()
}

#[test]
fn poses_agree_with_numpy() {
    let Some(folder) =
        std::env::var_os("RENTIX_SCENES").map(|f| Path::new(&f).join("gltf")).filter(|f| f.is_dir())
    else {
        eprintln!("skipped: RENTIX_SCENES names no folder with gltf/");
        return;
    };
    let mut opened: HashMap<&str, Gltf> = HashMap::new();
    let mut worst = (0.0, "");
    let mut lines = 0;
    for line in include_str!("data/gltf_poses.txt").lines() {
        let mut words = line.split(' ');
        let name = words.next().expect("a line names its model");
        let mut number = || words.next().and_then(|w| w.parse::<f64>().ok());
        let (time_s, count) = (number().expect("a time"), number().expect("a count"));
        let wanted: Vec<f64> = std::iter::from_fn(number).collect();
        let (wanted, rest) = wanted.as_chunks::<3>();
        assert!(wanted.len() == 14 && rest.is_empty(), "{name}");
        let gltf = opened.entry(name).or_insert_with(|| {
            Gltf::open(&folder.join(name), &GltfOptions::default()).expect("a sample model can be read")
        });
        let all = vertices(gltf, time_s);
        assert_eq!(all.len() as f64, count, "{name}");
        let corner = |pick: fn(f64, f64) -> f64, from: f64| {
            all.iter().fold([from; 3], |m, p| [0, 1, 2].map(|k| pick(m[k], p[k])))
        };
        let mut got = vec![corner(f64::min, f64::INFINITY), corner(f64::max, f64::NEG_INFINITY)];
        got.extend((0..12).map(|i| all[i * (all.len() - 1) / 11]));
        let distance = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
        let size = distance(&wanted[0], &wanted[1]);
        for (got, wanted) in got.iter().zip(wanted) {
            let off = distance(got, wanted) / size;
            assert!(off < TOLERANCE, "{name} at {time_s} s: {got:?}, not {wanted:?}");
            worst = if off > worst.0 { (off, name) } else { worst };
        }
        lines += 1;
    }
    eprintln!("{lines} poses, the greatest distance is {:.1e} of the box ({})", worst.0, worst.1);
}

/// `RENTIX_BLENDER_PYTHON=PYTHON cargo test --release --test gltf -- --ignored --nocapture blender`, where PYTHON is one
/// with Blender in it (`pip install bpy`) and `RENTIX_SCENES` names the models' folder.
#[test]
#[ignore = "needs Blender as a module of Python"]
fn poses_agree_with_blender() {
    let needed = |name: &str| {
        std::env::var(name).unwrap_or_else(|_| panic!("{name} must be set, see the test's head"))
    };
    let (python, folder) =
        (needed("RENTIX_BLENDER_PYTHON"), Path::new(&needed("RENTIX_SCENES")).join("gltf"));
    let script = |args: &[&Path]| -> String {
        let ran = Command::new(&python)
            .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/gltf_blender.py"))
            .args(args)
            .output()
            .unwrap_or_else(|error| panic!("{python}: {error}"));
        assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
        String::from_utf8_lossy(&ran.stdout).into_owned()
    };
    let t = tempfile::tempdir().unwrap();
    let cases = script(&[Path::new("cases"), &folder]);
    for (i, case) in cases.lines().enumerate() {
        let (name, times) = case.split_once(' ').expect("a line names its model");
        let times: Vec<f64> = times.split(' ').map(|time| time.parse().unwrap()).collect();
        let gltf = Gltf::open(&folder.join(name), &GltfOptions::default()).unwrap();
        let first = ClipChoice::Named("0".to_owned());
        let poses: Vec<_> = times.iter().map(|&time_s| objects(&gltf, time_s, &first)).collect();
        let counts = poses[0].iter().map(|object| object.len() as u64);
        let mut bytes: Vec<u8> = [poses.len() as u64, poses[0].len() as u64]
            .into_iter()
            .chain(counts)
            .flat_map(u64::to_le_bytes)
            .collect();
        bytes.extend(poses.concat().concat().as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        std::fs::write(t.path().join(i.to_string()), bytes).unwrap();
    }
    let told = script(&[Path::new("compare"), &folder, t.path()]);
    let told: Vec<&str> = told.lines().filter_map(|line| line.strip_prefix("pose ")).collect();
    eprintln!("{}", told.join("\n"));
    assert!(!told.is_empty() && told.len() == cases.lines().count());
    for line in told {
        let worst: f64 = line.split(' ').nth(1).and_then(|word| word.parse().ok()).expect("a distance");
        assert!(worst < TOLERANCE, "{line}");
    }
}

/// A triangle that moves by (0, 0, −1) in a second, a camera that looks at it, and a lamp, in one file of text.
fn write_mover(path: &Path) {
    let floats: Vec<f32> = [
        &[-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 0.0, 1.0, 0.0][..],
        &[0.0, 1.0],
        &[0.0, 0.0, 0.0, 0.0, 0.0, -1.0],
    ]
    .concat();
    let mut bytes = String::new();
    for byte in floats.iter().flat_map(|x| x.to_le_bytes()) {
        write!(bytes, "%{byte:02x}").unwrap();
    }
    let accessor = |at: usize, count: usize, kind: &str| {
        format!(
            r#"{{"bufferView":0,"byteOffset":{at},"count":{count},"type":"{kind}","componentType":5126}}"#
        )
    };
    let accessors = [accessor(0, 3, "VEC3"), accessor(36, 2, "SCALAR"), accessor(44, 2, "VEC3")].join(",");
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":68,"uri":"data:,{bytes}"}}],
        "bufferViews":[{{"buffer":0,"byteLength":68}}],"accessors":[{accessors}],
        "cameras":[{{"name":"front","type":"perspective","perspective":{{"yfov":0.8,"znear":0.1}}}}],
        "extensionsUsed":["KHR_lights_punctual"],
        "extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"directional","intensity":1}}]}}}},
        "nodes":[{{"mesh":0}},{{"camera":0,"translation":[0,0,4]}},
            {{"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
        "animations":[{{"name":"go","channels":[{{"sampler":0,"target":{{"node":0,"path":"translation"}}}}],
            "samplers":[{{"input":1,"output":2}}]}}]}}"#
    );
    std::fs::write(path, json).unwrap();
}

#[test]
fn a_gltf_file_is_an_input() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    std::fs::create_dir(t.join("w")).unwrap();
    let file = t.join("w/mover.gltf");
    write_mover(&file);
    let r = t.join("r.json");
    let small = ["--size", "32x18", "--fps", "2", "--report", r.to_str().unwrap()];
    render(t, &file, "file", &small, 0);
    let made = pictures(&t.join("file"));
    assert_eq!(made.keys().collect::<Vec<_>>(), ["mover_0000.png", "mover_0001.png", "mover_0002.png"]);
    assert!(made["mover_0000.png"] != made["mover_0002.png"]);
    assert_eq!(report(&r)["totals"]["rendered"], 3);
    // a folder and a pattern take it too; a part of a run gives the run's pictures
    render(t, &t.join("w"), "folder", &small, 0);
    assert_same(&made, &pictures(&t.join("folder")), "folder");
    render(t, &t.join("w/m*.gltf"), "pattern", &[&small[..], &["--frames", "2", "--clip", "go"]].concat(), 0);
    assert_eq!(pictures(&t.join("pattern"))["mover_0002.png"], made["mover_0002.png"]);
    let said = render(t, &file, "none", &["--clip", "stay"], 2).stderr;
    assert!(said.contains("`stay`") && said.contains("`go`"), "{said}");
    let said = render(t, &file, "none", &["--fps", "2", "--memory", "1"], 3).stderr;
    assert!(said.contains("mover.gltf: frame 2: "), "{said}");
    // what is wrong with the file is wrong with each of its frames, and told once
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replace("\"count\":3", "\"count\":3000")).unwrap();
    let said = render(t, &file, "none", &["--fps", "2"], 1).stderr;
    assert_eq!(said.matches("error: ").count(), 2, "{said}");
    assert!(said.contains("error: the same 2 more times: "), "{said}");
    std::fs::write(&file, "{}").unwrap();
    let said = render(t, &file, "none", &[], 2).stderr;
    assert!(said.contains("mover.gltf") && said.contains("export it again"), "{said}");
}

#[test]
fn cameras_and_lights_of_a_gltf_are_used() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    write_mover(&t.join("mover.gltf"));
    let picture = |name: &str, yaml: &str| {
        std::fs::write(t.join("job.yaml"), format!("sequence: mover.gltf\nfps: 1\n{yaml}\n")).unwrap();
        render(t, &t.join("job.yaml"), name, &["--size", "32x18", "--frames", "0"], 0);
        pictures(&t.join(name))["mover_0000.png"].clone()
    };
    // yfov 0.8 is 45.8366 degrees; what the file has is what can be written down
    let given = "camera: {eye: [0, 0, 4], look_at: [0, 0, 0], fov: 45.836624}";
    let lamp = "lights: [{directional: {direction: [0, 0, -1]}}]";
    let by_name = picture("a", "camera: {gltf: front}");
    assert_eq!(by_name, picture("b", &format!("{given}\n{lamp}")));
    assert!(by_name != picture("c", &format!("{given}\nlights: [{{point: {{position: [9, 9, 1]}}}}]")));
    assert!(by_name != picture("d", "camera: {gltf: front, fov: 60}"));
    std::fs::write(t.join("job.yaml"), "sequence: mover.gltf\ncamera: {gltf: rear}\n").unwrap();
    let said = render(t, &t.join("job.yaml"), "e", &["--frames", "0"], 1).stderr;
    assert!(said.contains("`rear`") && said.contains("`front`"), "{said}");
}

#[test]
fn a_gltf_is_a_layer() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    write_mover(&t.join("mover.gltf"));
    let job = "layers:\n  - sequence: mover.gltf\n  - sequence: mover.gltf\n    transform: {translate: [1, 0, 0]}\n\
               fps: 2\nname: two\n";
    std::fs::write(t.join("job.yaml"), job).unwrap();
    render(t, &t.join("job.yaml"), "out", &["--size", "32x18"], 0);
    let made = pictures(&t.join("out"));
    assert_eq!(made.keys().collect::<Vec<_>>(), ["two_0000.png", "two_0001.png", "two_0002.png"]);
}
