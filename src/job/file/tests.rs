use super::*;

fn parsed(text: &str) -> JobFile {
    parse(text, Path::new("jobs/a.yaml")).unwrap_or_else(|(place, e)| panic!("{place}: {e}"))
}

#[test]
fn the_job_of_the_contract() {
    let job = parsed(
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
fn errors_have_a_place_what_is_allowed_and_the_nearest_name() {
    let cases: &[(&str, &str, &[&str])] = &[
        ("output: {sise: [64, 64]}", ":3:", &["sise", "size"]),
        ("output:\n  sise: [64, 64]", ":4:3", &["sise", "did you mean `size`"]),
        ("camera: {eye: [0, 0, 5], look_at: [0, 0, 0], fov: 400}", ":3:", &["fov", "400", "179"]),
        ("camera:\n  eye: [0, 0, 5]\n  look_at: [0, 0, 0]\n  fov: 400", ":6:8", &["fov", "400", "179"]),
        ("camera:\n  keys:\n    - {frame: 1, eye: [0, 0], look_at: [0, 0, 0]}", ":5:", &["three numbers"]),
        ("samples: many", ":3:10", &["samples", "whole number"]),
        ("samples: 0", ":3:10", &["samples", "out of range"]),
        ("samples: 1.5", ":3:10", &["samples", "whole"]),
        ("filter: bx", ":3:9", &["bx", "did you mean `box`"]),
        ("lights:\n  - pont: {position: [0, 1, 0]}", ":4:", &["pont", "did you mean `point`"]),
        ("lights:\n  - area: {material: some}", ":4:", &["some", "all"]),
        ("camera: {eye: [0, 0, 5]}", ":3:1", &["look_at"]),
        ("output: {format: gif}", ":3:", &["gif", "png"]),
        ("frames: 1-", ":3:9", &["1-"]),
        ("materials: {a: {Kx: 1}}", ":3:1", &["Kx"]),
        ("ambient: [0, -1, 0]", ":3:", &["ambient", "out of range"]),
        ("background: [0, -1, 0]", ":3:", &["background", "out of range"]),
        ("background: {sky: 1}", ":3:", &["background", "a colour", "sky.hdr"]),
        ("sequence: b/", ":3:1", &["duplicate", "sequence"]),
        ("version: 2", "", &["duplicate", "version"]),
    ];
    for (line, place, words) in cases {
        let (at, text) = parse(&format!("version: 1\nsequence: a/\n{line}\n"), Path::new("")).unwrap_err();
        assert!(at.starts_with(place), "{line}: at {at}: {text}");
        assert!(words.iter().all(|w| text.contains(w)), "{line}: {text}");
    }
}

#[test]
fn a_job_has_a_sequence_or_layers() {
    assert!(parse("version: 1\n", Path::new("")).is_err());
    assert!(parse("sequence: a\nlayers: [{sequence: b}]\n", Path::new("")).is_err());
    assert!(parse("version: 2\nsequence: a\n", Path::new("")).unwrap_err().1.contains("version 1"));
    assert!(parse("", Path::new("")).is_err());
    assert!(parse("- a\n- b\n", Path::new("")).is_err());
}
