use super::super::options::{CameraChoice, LightChoice};
use super::*;
use crate::math::{DVec3, Vec3};

fn read_text(yaml: &str) -> JobFile {
    parse(yaml, Path::new("jobs/a.yaml")).unwrap_or_else(|e| panic!("{}:{}: {e}", e.line, e.column))
}

#[test]
fn the_job_of_the_contract() {
    let job = read_text(
        "version: 1
name: walk
layers:
  - sequence: room.obj
  - sequence: walk/
    name: figure
    transform: {translate: [0, 0, 1.5], rotate: [0, 90, 0], scale: 0.01}
    frames: {start: 1, step: 1, outside: hold}
    materials: fixed.mtl
  - sequence: bird/
    transform: {keys: [{frame: 1, translate: [0,0,0]}, {frame: 48, translate: [2,0,0]}]}
frames: 1-48
output: {folder: out/walk, name: \"{stem}\", format: png, size: [1280, 720], alpha: false, bits: 8, quality: 92}
camera: {keys: [{frame: 1, eye: [0,0,5], look_at: [0,0,0]}], interpolate: smooth}
lights:
  - point: {position: [0, 5, 0], color: [1, 1, 1], intensity: 1, falloff: inverse-square}
  - directional: {direction: [0, -1, 0], intensity: 1}
  - spot: {position: [0,5,0], direction: [0,-1,0], inner: 20, outer: 30}
  - area: {material: all, samples: 1}
ambient: [0.1, 0.1, 0.1]
background: [0, 0, 0]
samples: 1
filter: box
depth: 10
seed: 0
up: z
exposure: -1
smooth_angle: 30
aov: [depth, id]
mtl_color: srgb
prune: 0
priority: 0
materials: {Glass: {Ni: 1.5, illum: 7, Kd: [0.1, 0.2, 0.3]}}
overrides:
  - {frames: 10-20, camera: auto, lights: auto, background: sky.hdr}
  - {files: \"Cornell*\", size: [1920, 1080], format: exr, name: \"{stem}-hd\", samples: 4}
",
    );
    assert_eq!((job.layers.len(), job.name.as_deref()), (3, Some("walk")));
    assert_eq!(job.layers[0].sequence, Path::new("jobs/room.obj"));
    assert_eq!(job.layers[1].materials.as_deref(), Some(Path::new("jobs/fixed.mtl")));
    assert_eq!(job.layers[2].placed.as_ref().unwrap().keys.len(), 2);
    assert!(matches!(&job.options.lights, Some(LightChoice::Given(l)) if l.len() == 4));
    assert_eq!((job.options.up, job.options.size), (Some(DVec3::Z), Some([1280, 720])));
    let glass = &job.options.materials[0];
    assert!(glass.words.contains(&("Kd".to_string(), "0.1 0.2 0.3".to_string())), "{glass:?}");
    assert_eq!(glass.said_in, Path::new("jobs/a.yaml"));
    assert_eq!(job.options.background, Some(Background::Color(Vec3::ZERO)));
    let sky = Background::File("jobs/sky.hdr".into());
    assert_eq!(job.overrides[0].options.background, Some(sky));
    assert_eq!(job.overrides[1].options.format.as_deref(), Some("exr"));
}

#[test]
fn errors_have_line_and_column_what_is_allowed_and_the_nearest_name() {
    // the third line of a job, where the error is, and what is told
    let cases: &[(&str, (u64, u64), &[&str])] = &[
        ("output: {sise: [64, 64]}", (3, 10), &["output", "sise", "did you mean `size`", "quality"]),
        ("output:\n  sise: [64, 64]", (4, 3), &["sise", "size"]),
        ("sampels: 3", (3, 1), &["sampels", "did you mean `samples`"]),
        (
            "camera: {eye: [0, 0, 5], look_at: [0, 0, 0], fov: 400}",
            (3, 51),
            &["camera.fov: 400", "0.01 to 179"],
        ),
        ("camera:\n  eye: [0, 0, 5]\n  look_at: [0, 0, 0]\n  fov: 400", (6, 8), &["fov", "400"]),
        ("camera:\n  keys:\n    - {frame: 1, eye: [0, 0], look_at: [0, 0, 0]}", (5, 23), &["eye", "three"]),
        ("camera: {eye: [0, 0, 5]}", (3, 9), &["camera", "look_at", "missing"]),
        ("camera: {eye: [0, 0, 5], look_at: [0, 0, 5]}", (3, 9), &["camera", "same point"]),
        ("camera: {keys: []}", (3, 16), &["keys", "empty"]),
        ("camera:\n  keys:\n    - {frame: 1, eye: 1, look_at: 0}", (5, 23), &["eye", "three numbers"]),
        ("camera: {gltf: Main, up: z}", (3, 22), &["a glTF camera has no `up`"]),
        ("camera: {gltf: 3}", (3, 16), &["text"]),
        ("camera: front", (3, 9), &["camera", "`auto` or a map", "front"]),
        ("camera: atuo", (3, 9), &["did you mean `auto`", "atuo"]),
        ("lights: none", (3, 9), &["`auto`, or a list of lights, [] for none", "none"]),
        ("lights: auot", (3, 9), &["did you mean `auto`"]),
        ("samples: many", (3, 10), &["samples", "a whole number from 1 to 65536", "many"]),
        ("samples: 0", (3, 10), &["samples", "out of range", "1 to 65536"]),
        ("samples: 1.5", (3, 10), &["samples", "whole"]),
        ("samples:", (3, 8), &["samples", "nothing"]),
        ("samples: '4'", (3, 10), &["samples", "whole number", "the text `4`"]),
        ("seed: 4294967296", (3, 7), &["seed", "out of range"]),
        ("exposure: .nan", (3, 11), &["exposure", "NaN", "out of range"]),
        ("materials: {a: {Kd: [.inf, 0, 0]}}", (3, 22), &["inf", "out of range"]),
        ("filter: bx", (3, 9), &["filter", "bx", "did you mean `box`"]),
        ("up: x", (3, 5), &["up", "y, z"]),
        ("up: [0, 0, 0]", (3, 5), &["up", "direction"]),
        ("name: 7", (3, 7), &["name", "quotes"]),
        ("name: ../x", (3, 7), &["name", "path"]),
        ("lights:\n  - pont: {position: [0, 1, 0]}", (4, 5), &["pont", "did you mean `point`"]),
        ("lights: [{point: {}}]", (3, 18), &["position", "missing"]),
        ("lights:\n  - area: {material: some}", (4, 22), &["material", "some", "all"]),
        (
            "lights: [{point: {position: [0, 0, 0], falloff: inverse}}]",
            (3, 49),
            &["falloff", "inverse-square"],
        ),
        (
            "lights: [{spot: {position: [0,0,0], direction: [0,1,0], inner: 30, outer: 20}}]",
            (3, 17),
            &["inner is 30"],
        ),
        ("background: [0, -1, 0]", (3, 13), &["background", "out of range"]),
        ("background: {sky: 1}", (3, 13), &["background", "a colour", "sky.hdr"]),
        ("output: {format: gif}", (3, 18), &["format", "gif", "png"]),
        ("output: {name: \"{foo}\"}", (3, 16), &["output.name", "{foo}", "{stem}"]),
        ("overrides: [{name: a//b}]", (3, 20), &["a//b"]),
        ("output: {bits: 12}", (3, 16), &["bits", "8 or 16"]),
        ("output: {size: [1280]}", (3, 16), &["size", "two numbers"]),
        ("output: {size: [1280, 0]}", (3, 23), &["size", "out of range"]),
        ("output: {alpha: 1}", (3, 17), &["alpha", "true or false"]),
        ("output: 3", (3, 9), &["output", "a map"]),
        ("frames: 1-", (3, 9), &["frames", "1-"]),
        ("aov: [depth, norml]", (3, 6), &["aov", "norml", "did you mean `normal`"]),
        ("materials: {a: {Kx: 1}}", (3, 17), &["materials.a: `Kx`"]),
        ("materials: {a: {Nii: 1.5}}", (3, 17), &["`Nii`", "did you mean `Ni`", "allowed: Ka, Kd", "illum"]),
        ("materials: {a: {illum: 11}}", (3, 24), &["materials.a.illum", "a whole number from 0 to 10", "11"]),
        ("materials: {a: {Kd: red}}", (3, 21), &["materials.a.Kd", "three numbers, or one", "`red`"]),
        ("materials: {a: {Kd: [1, 2]}}", (3, 21), &["three numbers, or one", "a list of 2"]),
        ("materials: {a: {Kd: [1, 2, 3, 4]}}", (3, 21), &["three numbers, or one", "a list of 4"]),
        ("materials: {a: {d: 2}}", (3, 20), &["a number from 0 to 1", "the number 2"]),
        ("materials: {a: {d: true}}", (3, 20), &["a number from 0 to 1", "true"]),
        ("materials: {a: {Ni: [1, 2, 3]}}", (3, 21), &["expected a number,", "a list of 3"]),
        ("overrides:\n  - materials: {a: {map_Kd: -s 2}}", (4, 29), &["a file, with options"]),
        ("ambient: [0, -1, 0]", (3, 10), &["ambient", "out of range"]),
        ("overrides:\n  - {frames: 1, samples: 2}\n  - {frames: 2, samples: x}", (5, 26), &["samples"]),
        ("overrides: [{folder: a}]", (3, 14), &["unknown key `folder`"]),
        ("layers: [{sequence: b}]", (3, 9), &["either `sequence` or `layers`"]),
        ("sequence: b/", (3, 1), &["duplicate", "sequence"]),
        ("output: {bits: 8, bits: 16}", (3, 19), &["duplicate", "bits"]),
        ("output: [1, 2\nsamples: 1", (4, 8), &["':'"]),
        ("name: \"x", (3, 7), &["unclosed quote"]),
    ];
    let told: Vec<String> = cases
        .iter()
        .filter_map(|(line, place, words)| {
            let e = parse(&format!("version: 1\nsequence: a/\n{line}\n"), Path::new("")).unwrap_err();
            let is_right = (e.line, e.column) == *place && words.iter().all(|w| e.to_string().contains(w));
            (!is_right).then(|| format!("{line} → {}:{}: {e}", e.line, e.column))
        })
        .collect();
    assert!(told.is_empty(), "{}", told.join("\n"));
}

#[test]
fn errors_of_layers_and_of_the_whole() {
    let cases: &[(&str, (u64, u64), &str)] = &[
        ("version: 1\n", (1, 1), "needs either `sequence` or `layers`"),
        ("", (1, 1), "is empty"),
        ("# nothing\n", (2, 1), "is empty"),
        ("- a\n- b\n", (1, 1), "a map"),
        ("sequence: a\nversion: 2\n", (2, 10), "version 1"),
        ("layers: []\n", (1, 9), "empty"),
        ("layers:\n  - name: a\n", (2, 5), "`sequence` is missing"),
        ("layers:\n  - sequence: a\n    frames: {outside: stop}\n", (3, 23), "hold, loop, hide"),
        ("layers:\n  - sequence: a\n    frames: {step: 0}\n", (3, 20), "step"),
        ("layers: [{sequence: a, transform: {scale: big}}]\n", (1, 43), "scale"),
        (
            "layers: [{sequence: a, transform: {keys: [{frame: 1}, {frame: 1}]}}]\n",
            (1, 55),
            "another key at frame 1",
        ),
        ("layers: [{sequence: a, transform: {keys: [{frame: 1}], scale: 2}}]\n", (1, 35), "in the keys"),
        ("sequence: a\n---\nsequence: b\n", (3, 1), "multiple YAML documents, parted by `---`"),
        ("sequence: a\n\tsamples: 4\n", (2, 1), "a tab indents this line"),
        ("sequence: a\noutput:\n\tbits: 8\n", (3, 1), "a tab indents this line"),
        ("sequence: a\n\n# so\n  \tsamples: 4\n", (4, 3), "a tab indents this line"),
    ];
    for (yaml, place, words) in cases {
        let e = parse(yaml, Path::new("")).unwrap_err();
        let is_right = (e.line, e.column) == *place && e.to_string().contains(words);
        assert!(is_right, "{yaml} → {}:{}: {e}", e.line, e.column);
    }
}

#[test]
fn a_job_file_is_utf_8() {
    let refused = |bytes: &[u8]| {
        let wrong = decoded(bytes.to_vec()).unwrap_err();
        format!("{}:{}: {wrong}", wrong.line, wrong.column)
    };
    assert_eq!(refused(b"\xff\xfes\0e\0"), "1:1: is UTF-16 text; save it as UTF-8");
    assert_eq!(refused(b"name: a\nsequence: w\xf6\n"), "2:12: is not UTF-8 text; save it as UTF-8");
    assert_eq!(refused(b"name: \xc3\xb6\xff"), "1:8: is not UTF-8 text; save it as UTF-8");
    assert_eq!(decoded("sequence: wö".into()).unwrap(), "sequence: wö");
}

#[test]
fn hostile_yaml_is_refused_quickly() {
    let laughs: String = (1..12)
        .map(|i| format!("a{i}: &a{i} [{}]\n", format!("*a{},", i - 1).repeat(10)))
        .fold("a0: &a0 [x, x]\n".to_string(), |all, line| all + &line);
    for yaml in [laughs, "[".repeat(100_000), "{a: ".repeat(100_000), "a: &a [*a]".to_string()] {
        assert!(parse(&yaml, Path::new("")).is_err());
    }
}

#[test]
fn up_and_fov_alone_are_of_the_auto_camera() {
    let job = read_text("sequence: a\ncamera: {fov: 25, up: z}\n");
    assert_eq!(job.options.camera, Some(CameraChoice::Auto));
    assert_eq!((job.options.fov, job.options.up), (Some(25.0), Some(DVec3::Z)));
}
