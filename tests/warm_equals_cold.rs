//! Promise 1: sequences on which refitting decays or must not be tried give the same bytes warm and cold, refitted and
//! rebuilt, in any order, by `rentix verify` and by pictures of processes of their own.

mod common;
use common::{assert_same, pictures, render, report, run};
use rentix::bench::sequences::{HOSTILE, Hostile, Sheet};
use std::path::{Path, PathBuf};

const FRAMES: u32 = 8;
const SIDE: u32 = 13;

/// The sheet in a frame, moved.
fn moved(frame: u32, place: impl Fn(f64, [f64; 3]) -> [f64; 3]) -> String {
    Sheet { side: SIDE, frames: FRAMES }.moved(frame, |t, p, _| place(t, p))
}

fn write(folder: &Path, hostile: &Hostile) -> PathBuf {
    let folder = folder.join(hostile.name);
    hostile.write(SIDE, FRAMES, &folder).unwrap();
    folder
}

#[test]
fn hostile_sequences_by_verify() {
    let t = tempfile::tempdir().unwrap();
    for hostile in HOSTILE {
        let (name, folder) = (hostile.name, write(t.path(), &hostile));
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
    for hostile in HOSTILE {
        let (name, folder) = (hostile.name, write(t, &hostile));
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
        assert_eq!(alone["f_0005.png"], warm["f_0005.png"], "{name}: a frame alone differs");
        let report = report(&r);
        let actions: Vec<_> =
            report["frames"].as_array().unwrap().iter().map(|f| &f["update"]["action"]).collect();
        let is_warm = actions[1..].iter().all(|a| **a == "refit" || **a == "none");
        assert_eq!(is_warm, hostile.keeps_its_faces, "{name}: {actions:?}");
    }
}

/// A frame that fails is named, and the next is right.
#[test]
fn nan_in_one_frame() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let twist = HOSTILE.into_iter().find(|h| h.name == "twist").unwrap();
    let folder = write(t, &twist);
    let bad = folder.join("f_0003.obj");
    std::fs::write(&bad, std::fs::read_to_string(&bad).unwrap().replacen("v ", "v nan ", 5)).unwrap();
    let said = render(t, &folder, "warm", &["--size", "96x54", "--update", "refit"], 1).stderr;
    assert!(said.contains("f_0003.obj") && said.contains("--frames 3"), "{said}");
    render(t, &folder, "cold", &["--size", "96x54", "--cold"], 1);
    assert!(pictures(&t.join("warm")) == pictures(&t.join("cold")));
    assert!(pictures(&t.join("warm"))["f_0002.png"] != pictures(&t.join("warm"))["f_0004.png"]);
    assert_eq!(pictures(&t.join("warm")).len(), FRAMES as usize - 1);
    let told = run(t, ["verify", folder.to_str().unwrap(), "--size", "96x54"]);
    assert!(told.status == 0 && told.stderr.contains("1 failed in every way alike"), "{}", told.stderr);
}

/// Where every frame fails there is nothing to compare, which is no success; each file that warns counts once, not in each
/// way; what only one run has is refused.
#[test]
fn verify_says_what_it_cannot_do() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let folder = t.join("w");
    std::fs::create_dir(&folder).unwrap();
    for frame in 1..=5 {
        let text = format!("mtllib gone.mtl\n{}", moved(frame, |t, [x, y, z]| [x, y + t, z]));
        std::fs::write(folder.join(format!("f_{frame}.obj")), text).unwrap();
    }
    let input = folder.to_str().unwrap();
    let verify = |more: &[&str]| run(t, [&["verify", input, "--size", "32x18"], more].concat());
    let told = verify(&[]);
    assert!(told.status == 0 && told.stderr.contains("the same for 2 more files"), "{}", told.stderr);
    let report = t.join("r.json");
    for (more, named) in [
        (&["--report", report.to_str().unwrap()][..], "--report"),
        (&["-o", "out"], "-o"),
        (&["--dry-run"], "--dry-run"),
        (&["--cold"], "--cold"),
        (&["--order", "reverse"], "--order"),
        (&["--overwrite"], "--overwrite"),
        (&["--movie", "a.mp4"], "--movie"),
    ] {
        let told = verify(more);
        assert!(told.status == 2 && told.stderr.contains(named), "{}", told.stderr);
    }
    assert!(!report.exists());
    let told = verify(&["--device", "cpu", "--device-memory", "1"]);
    assert!(told.status == 3 && told.stderr.contains("nothing to compare"), "{}", told.stderr);
    for frame in 1..=5 {
        std::fs::write(folder.join(format!("f_{frame}.obj")), "f 1 2 3\n").unwrap();
    }
    let told = verify(&["-q"]);
    assert!(told.status == 2 && told.stderr.contains("f_1.obj:1: "), "{}", told.stderr);
    assert!(!told.stderr.contains("cannot be read"), "{}", told.stderr);
    let told = verify(&["--json"]);
    assert!(told.status == 2 && told.stdout.contains("\"verdict\":\"nothing\""), "{}", told.stdout);
}

/// What equals the frame before is copied, also where its file's names differ.
#[test]
fn equal_frames_are_copied() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let folder = t.join("w");
    std::fs::create_dir(&folder).unwrap();
    let still = moved(0, |_, p| p);
    for (frame, head) in ["o a\n", "o b\n", "# c\n"].iter().enumerate() {
        std::fs::write(folder.join(format!("f_{frame}.obj")), format!("{head}{still}")).unwrap();
    }
    std::fs::write(folder.join("f_3.obj"), moved(3, |t, [x, y, z]| [x, y + t, z])).unwrap();
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
        let text = moved(frame, |t, [x, y, z]| [x, y + t, z]);
        std::fs::write(figure.join(format!("f_{frame:02}.obj")), text).unwrap();
    }
    let room = t.join("room.obj");
    std::fs::write(&room, moved(0, |_, [x, y, z]| [5.0 * x, 5.0 * y, z - 3.0])).unwrap();
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

/// Shapes that take turns for as long as the job lasts: with space each is built once; with too little, what was used
/// least recently makes way, and the pictures are the same.
#[test]
fn what_comes_again_stays_until_space_is_short() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let shapes = t.join("shapes");
    std::fs::create_dir(&shapes).unwrap();
    for frame in 0..3 {
        // another number of faces in each
        let faces = format!("f 1 2 {}\n", SIDE + 2).repeat(frame);
        let text = moved(0, |_, [x, y, z]| [x, y + 0.1 * frame as f64, z]) + &faces;
        std::fs::write(shapes.join(format!("s_{frame}.obj")), text).unwrap();
    }
    let job = t.join("job.yaml");
    std::fs::write(
        &job,
        "layers:\n  - sequence: shapes\n    frames: {outside: loop}\nframes: 0-11\noutput: {size: [96, 54]}\n",
    )
    .unwrap();
    let with = |out: &str, budget: &str| {
        let r = t.join(format!("{out}.json"));
        let args = ["--report", r.to_str().unwrap(), "--device-memory", budget];
        render(t, &job, out, &args, 0);
        (report(&r), pictures(&t.join(out)))
    };
    let evictions =
        |report: &serde_json::Value| report["devices"][0]["resident"]["evictions"].as_u64().unwrap();
    let builds = |report: &serde_json::Value| {
        let frames = report["frames"].as_array().unwrap();
        frames
            .iter()
            .filter(|f| ["load", "rebuild"].contains(&f["update"]["action"].as_str().unwrap()))
            .count()
    };
    let (ample, right) = with("ample", "1G");
    assert_eq!((evictions(&ample), builds(&ample), right.len()), (0, 3, 12));
    let held = ample["devices"][0]["resident"]["peak"].as_u64().unwrap();
    let (tight, pictures) = with("tight", &(held - 1).to_string());
    assert!(evictions(&tight) > 0 && builds(&tight) > 3, "{tight}");
    assert!(tight["devices"][0]["resident"]["peak"].as_u64().unwrap() < held);
    assert_same(&right, &pictures, "with little memory");
    let told = run(t, ["verify", job.to_str().unwrap(), "--device-memory", &(held - 1).to_string()]);
    assert_eq!(told.status, 0, "{}", told.stderr);
}
