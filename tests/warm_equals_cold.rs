//! Promise 1: sequences on which refitting decays or must not be tried give the same bytes warm and cold, refitted and
//! rebuilt, in any order, by `rentix verify` and by pictures of processes of their own.

mod common;
use common::{pictures, render, report, run};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

const FRAMES: u32 = 8;
const SIDE: u32 = 13;

/// Numbers in [0, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / 16_777_216.0
    }
}

/// A point of a wavy sheet.
fn sheet(i: u32, j: u32) -> [f64; 3] {
    let [x, y] = [i, j].map(|k| 2.0 * f64::from(k) / f64::from(SIDE - 1) - 1.0);
    [x, y, 0.3 * (4.0 * x).sin() * (3.0 * y).cos()]
}

/// The sheet in each frame, its points moved.
fn moved(frame: u32, place: impl Fn(f64, [f64; 3], u32) -> [f64; 3]) -> String {
    let t = f64::from(frame) / f64::from(FRAMES - 1);
    let mut text = String::new();
    for j in 0..SIDE {
        for i in 0..SIDE {
            let [x, y, z] = place(t, sheet(i, j), j * SIDE + i);
            let _ = writeln!(text, "v {x} {y} {z}");
        }
    }
    faces(&mut text, 0);
    text
}

fn faces(text: &mut String, before: u32) {
    for j in 0..SIDE - 1 {
        for i in 0..SIDE - 1 {
            let a = before + j * SIDE + i + 1;
            let _ = writeln!(text, "f {a} {} {} {}", a + 1, a + SIDE + 1, a + SIDE);
        }
    }
}

/// The frames of each sequence.
fn text(name: &str, frame: u32) -> String {
    let mut random = Random(u64::from(frame));
    match name {
        "random places" => {
            let mut text = String::new();
            for _ in 0..SIDE * SIDE {
                let [x, y, z] = [0; 3].map(|_| 2.0 * random.next() - 1.0);
                let _ = writeln!(text, "v {x} {y} {z}");
            }
            faces(&mut text, 0);
            text
        }
        "explosion" => moved(frame, |t, [x, y, z], i| {
            let far = 1.0 + 20.0 * t * f64::from(i % 7);
            [x * far, y * far, z * far]
        }),
        "bodies that swap places" => moved(frame, |t, [x, y, z], i| {
            let side = if i % SIDE < SIDE / 2 { 1.0 } else { -1.0 };
            [x + side * 2.0 * t, y + side * (std::f64::consts::PI * t).sin(), z]
        }),
        "twist" => moved(frame, |t, [x, y, z], _| {
            let (sin, cos) = (20.0 * std::f64::consts::TAU * t * y).sin_cos();
            [x * cos - z * sin, y, x * sin + z * cos]
        }),
        "collapse and back" => moved(frame, |t, p, _| p.map(|x| x * (2.0 * t - 1.0).abs().max(0.0))),
        "to a point" => moved(frame, |t, p, _| if t < 0.5 { p } else { [0.5, 0.5, 0.5] }),
        "inflation" => moved(frame, |t, p, _| p.map(|x| x * 1e6_f64.powf(t))),
        "duplicates" => {
            moved(frame, |t, [x, y, z], i| if i % 3 == 0 { [0.0, t, 0.0] } else { [x, y + t, z] })
        }
        "nothing, something, nothing" if (3..6).contains(&frame) => moved(frame, |_, p, _| p),
        "nothing, something, nothing" => "v 0 0 0\n".to_string(),
        "new topology" => {
            let mut text = moved(frame, |_, p, _| p);
            for _ in 0..5 + frame {
                let corner = |random: &mut Random| 1 + (random.next() * f64::from(SIDE * SIDE)) as u32;
                let [a, b, c] = [0; 3].map(|_| corner(&mut random));
                let _ = writeln!(text, "f {a} {b} {c}");
            }
            text
        }
        "meshes that come and go" => {
            let mut text = String::new();
            for k in (0..4).filter(|k| (frame >> k) & 1 == 1 || *k == 3) {
                let count = text.matches("v ").count() as u32;
                let _ = writeln!(text, "o {k}");
                for j in 0..SIDE {
                    for i in 0..SIDE {
                        let [x, y, z] = sheet(i, j);
                        let _ = writeln!(text, "v {} {y} {}", x + f64::from(k), z + 0.1 * f64::from(frame));
                    }
                }
                faces(&mut text, count);
            }
            text
        }
        other => unreachable!("{other}"),
    }
}

const SEQUENCES: [&str; 11] = [
    "random places",
    "explosion",
    "bodies that swap places",
    "twist",
    "collapse and back",
    "to a point",
    "inflation",
    "duplicates",
    "nothing, something, nothing",
    "new topology",
    "meshes that come and go",
];

fn write(folder: &Path, name: &str) -> PathBuf {
    let folder = folder.join(name);
    std::fs::create_dir_all(&folder).unwrap();
    for frame in 0..FRAMES {
        std::fs::write(folder.join(format!("f_{frame:02}.obj")), text(name, frame)).unwrap();
    }
    folder
}

#[test]
fn hostile_sequences_by_verify() {
    let t = tempfile::tempdir().unwrap();
    for name in SEQUENCES {
        let folder = write(t.path(), name);
        for update in ["auto", "refit", "rebuild"] {
            let args = ["verify", folder.to_str().unwrap(), "--size", "96x54", "--update", update, "--json"];
            let told = run(t.path(), args);
            let verdict: serde_json::Value = serde_json::from_str(&told.stdout).unwrap();
            assert!(told.status == 0 && verdict["verdict"] == "equal", "{name}, {update}: {verdict}");
            assert!(verdict["pictures"] == FRAMES && verdict["failed"] == 0, "{name}, {update}: {verdict}");
        }
    }
}

/// Not by verify's word.
#[test]
fn hostile_sequences_by_processes_of_their_own() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    for name in SEQUENCES {
        let folder = write(t, name);
        let (r, size) = (t.join(format!("{name}.json")), ["--size", "96x54"]);
        let with = |more: &[&'static str]| -> Vec<String> {
            size.iter().chain(more).map(ToString::to_string).collect()
        };
        let render_to = |out: &str, args: Vec<String>| {
            let out = format!("{name} {out}");
            render(t, &folder, &out, &args.iter().map(String::as_str).collect::<Vec<_>>(), 0);
            pictures(&t.join(out))
        };
        let mut refit = with(&["--update", "refit", "--report"]);
        refit.push(r.to_string_lossy().into_owned());
        let warm = render_to("warm", refit);
        assert_eq!(warm.len(), FRAMES as usize);
        let shown: std::collections::BTreeSet<_> = warm.values().collect();
        assert!(shown.len() > 1, "{name}: all frames show the same");
        assert!(warm == render_to("cold", with(&["--cold"])), "{name}: cold differs");
        let alone = render_to("alone", with(&["--frames", "5"]));
        assert_eq!(alone["f_05.png"], warm["f_05.png"], "{name}: a frame alone differs");
        let report = report(&r);
        let actions: Vec<_> =
            report["frames"].as_array().unwrap().iter().map(|f| &f["update"]["action"]).collect();
        let is_warm = actions[1..].iter().all(|a| **a == "refit" || **a == "none");
        let keeps_its_faces =
            !["nothing, something, nothing", "new topology", "meshes that come and go"].contains(&name);
        assert_eq!(is_warm, keeps_its_faces, "{name}: {actions:?}");
    }
}

/// A frame that fails is named, and the next is right.
#[test]
fn nan_in_one_frame() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let folder = write(t, "twist");
    let bad = folder.join("f_03.obj");
    std::fs::write(&bad, std::fs::read_to_string(&bad).unwrap().replacen("v ", "v nan ", 5)).unwrap();
    let said = render(t, &folder, "warm", &["--size", "96x54", "--update", "refit"], 1).stderr;
    assert!(said.contains("f_03.obj") && said.contains("--frames 3"), "{said}");
    render(t, &folder, "cold", &["--size", "96x54", "--cold"], 1);
    assert!(pictures(&t.join("warm")) == pictures(&t.join("cold")));
    assert!(pictures(&t.join("warm"))["f_02.png"] != pictures(&t.join("warm"))["f_04.png"]);
    assert_eq!(pictures(&t.join("warm")).len(), FRAMES as usize - 1);
    let told = run(t, ["verify", folder.to_str().unwrap(), "--size", "96x54"]);
    assert!(told.status == 0 && told.stderr.contains("1 failed in every way alike"), "{}", told.stderr);
}

/// What equals the frame before is copied, also where its file's names differ.
#[test]
fn equal_frames_are_copied() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let folder = t.join("w");
    std::fs::create_dir(&folder).unwrap();
    let still = moved(0, |_, p, _| p);
    for (frame, head) in ["o a\n", "o b\n", "# c\n"].iter().enumerate() {
        std::fs::write(folder.join(format!("f_{frame}.obj")), format!("{head}{still}")).unwrap();
    }
    std::fs::write(folder.join("f_3.obj"), moved(3, |t, [x, y, z], _| [x, y + t, z])).unwrap();
    let r = t.join("r.json");
    render(t, &folder, "out", &["--size", "96x54", "--report", r.to_str().unwrap()], 0);
    let report = report(&r);
    let statuses: Vec<_> =
        report["frames"].as_array().unwrap().iter().map(|f| f["status"].as_str().unwrap()).collect();
    assert_eq!(statuses, ["rendered", "copied", "copied", "rendered"]);
    assert_eq!((&report["totals"]["copied"], &report["totals"]["rendered"]), (&2.into(), &2.into()));
    let pictures = pictures(&t.join("out"));
    assert!(pictures["f_0.png"] == pictures["f_2.png"] && pictures["f_2.png"] != pictures["f_3.png"]);
}

/// A still room and a moving figure as layers: after the first frame nothing of the room is read, uploaded or rebuilt.
#[test]
fn what_stands_still_costs_nothing() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    // it moves as a whole, so that no diagonal of its quads flips
    let figure = t.join("figure");
    std::fs::create_dir(&figure).unwrap();
    for frame in 0..FRAMES {
        let text = moved(frame, |t, [x, y, z], _| [x, y + t, z]);
        std::fs::write(figure.join(format!("f_{frame:02}.obj")), text).unwrap();
    }
    let room = t.join("room.obj");
    std::fs::write(&room, moved(0, |_, [x, y, z], _| [5.0 * x, 5.0 * y, z - 3.0])).unwrap();
    let job = t.join("job.yaml");
    let figure_path = figure.display();
    std::fs::write(
        &job,
        format!(
            "layers:\n  - sequence: room.obj\n  - sequence: '{figure_path}'\noutput: {{size: [96, 54]}}\n"
        ),
    )
    .unwrap();
    for _ in 0..5 {
        let r = t.join("r.json");
        render(t, &job, "out", &["--report", r.to_str().unwrap(), "--overwrite", "--update", "refit"], 0);
        let report = report(&r);
        let frames = report["frames"].as_array().unwrap();
        assert_eq!(frames.len(), FRAMES as usize);
        let size = |path: &Path| path.metadata().unwrap().len();
        let own =
            |f: &serde_json::Value| size(&figure.join(format!("f_{:02}.obj", f["frame"].as_u64().unwrap())));
        let read = |f: &serde_json::Value| f["bytes"]["read"].as_u64().unwrap();
        // two readers begin side by side, one of them reads the room
        let first_two: u64 = frames[..2].iter().map(read).sum();
        assert_eq!(first_two, size(&room) + own(&frames[0]) + own(&frames[1]));
        assert!(frames[2..].iter().all(|f| read(f) == own(f)));
        for f in &frames[1..] {
            // positions of the figure alone
            assert_eq!(
                f["bytes"]["uploaded"].as_u64().unwrap(),
                u64::from(12 * SIDE * SIDE),
                "{}",
                f["bytes"]
            );
            assert_eq!((&f["update"]["action"], &f["change"]["same"]), (&"refit".into(), &1.into()));
        }
    }
}
