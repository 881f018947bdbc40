//! A picture file is whole or absent; finished frames are not rendered twice; nothing foreign is written over
//! (CONTRACT 0.3, 4, 6).

mod common;
use common::{assert_same, pictures, render, rentix, report, start, wave};
use std::path::Path;

const SMALL: [&str; 2] = ["--size", "96x54"];

fn counts(t: &Path, input: &Path, more: &[&str]) -> (u64, u64) {
    let r = t.join("r.json");
    render(t, input, "out", &[&SMALL[..], more, &["--report", r.to_str().unwrap()]].concat(), 0);
    let totals = &report(&r)["totals"];
    (
        totals["rendered"].as_u64().unwrap() + totals["copied"].as_u64().unwrap(),
        totals["resumed"].as_u64().unwrap(),
    )
}

#[test]
fn only_what_changed_is_rendered_again() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 4, 8, 12);
    let camera = ["--eye", "0,1,5", "--look-at", "0,0,0"];
    let again = |rendered, more: &[&str], what: &str| {
        assert_eq!(counts(t, &input, &[&camera[..], more].concat()), (rendered, 4 - rendered), "{what}");
    };
    again(4, &[], "first");
    again(0, &["--threads", "1", "--order", "reverse", "--no-cache"], "nothing changed");
    let picture = t.join("out/wave_0002.png");
    let mut bytes = std::fs::read(&picture).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&picture, &bytes).unwrap();
    std::fs::remove_file(t.join("out/wave_0004.png")).unwrap();
    again(2, &[], "one picture damaged, one gone");
    let obj = input.join("wave_0003.obj");
    let text = std::fs::read_to_string(&obj).unwrap();
    std::fs::write(&obj, format!("# a remark\n{text}")).unwrap();
    again(0, &[], "a comment");
    std::fs::write(&obj, text.replacen("v ", "v 0.1 1.3 0.1\n#", 1)).unwrap();
    again(1, &[], "a vertex");
    let mtl = input.join("wave.mtl");
    std::fs::write(&mtl, std::fs::read_to_string(&mtl).unwrap().replace("0.8 0.3 0.2", "0.1 0.3 0.9"))
        .unwrap();
    again(4, &[], "a material");
    again(4, &["--samples", "2"], "an option");
    again(4, &["--samples", "2", "--overwrite"], "--overwrite");
}

#[cfg(target_os = "linux")]
#[test]
fn killed_runs_leave_whole_pictures_and_go_on() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 28, 16, 24);
    let args = ["--size", "320x180", "--samples", "4"];
    render(t, &input, "whole", &args, 0);
    let whole = pictures(&t.join("whole"));
    let mut finished = 0;
    for kill in 0..20 {
        let mut child = start(t, &input, "out", &args);
        // killed as the next picture appears, or between two
        let wanted = finished + 1 + kill % 2;
        while pictures_there(&t.join("out")) < wanted && child.try_wait().unwrap().is_none() {
            std::hint::spin_loop();
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let there = pictures(&t.join("out"));
        assert!(there.iter().all(|(name, bytes)| bytes == &whole[name]), "a torn picture after kill {kill}");
        finished = there.len();
    }
    let r = t.join("r.json");
    render(t, &input, "out", &[&args[..], &["--report", r.to_str().unwrap()]].concat(), 0);
    assert_same(&whole, &pictures(&t.join("out")), "after twenty kills");
    assert_eq!(report(&r)["totals"]["resumed"], finished as u64, "finished frames were rendered again");
    let hidden = std::fs::read_dir(t.join("out")).unwrap().filter(|e| {
        let name = e.as_ref().unwrap().file_name();
        name.to_string_lossy().starts_with('.') && name != ".rentix"
    });
    assert_eq!(hidden.count(), 0, "temporary files are left");
}

fn pictures_there(folder: &Path) -> usize {
    std::fs::read_dir(folder).map_or(0, |d| {
        d.filter(|e| e.as_ref().is_ok_and(|e| !e.file_name().to_string_lossy().starts_with('.'))).count()
    })
}

#[test]
fn foreign_files_and_inputs_are_kept() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 3, 8, 12);
    std::fs::create_dir(t.join("foreign")).unwrap();
    std::fs::write(t.join("foreign/wave_0002.png"), "mine").unwrap();
    let said = render(t, &input, "foreign", &SMALL, 2).stderr;
    assert!(said.contains("wave_0002.png") && said.contains("--overwrite"), "{said}");
    assert_eq!(std::fs::read(t.join("foreign/wave_0002.png")).unwrap(), b"mine");
    assert_eq!(std::fs::read_dir(t.join("foreign")).unwrap().count(), 1, "something was written");
    render(t, &input, "foreign", &[&SMALL[..], &["--overwrite"]].concat(), 0);

    // a texture that lies where the picture would go
    let card = t.join("card");
    std::fs::create_dir(&card).unwrap();
    std::fs::write(card.join("card.obj"), "mtllib c.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl c\nf 1 2 3\n")
        .unwrap();
    std::fs::write(card.join("c.mtl"), "newmtl c\nmap_Kd card.png\n").unwrap();
    std::fs::write(card.join("card.png"), "texture").unwrap();
    let said = render(t, &card, "card", &[&SMALL[..], &["--overwrite"]].concat(), 2).stderr;
    assert!(said.contains("card.png") && said.contains("input"), "{said}");
    assert_eq!(std::fs::read(card.join("card.png")).unwrap(), b"texture");
}

#[test]
fn success_is_never_claimed() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 4, 8, 12);
    std::fs::create_dir_all(t.join("out/wave_0002.png")).unwrap();
    let said = render(t, &input, "out", &[&SMALL[..], &["--overwrite"]].concat(), 1).stderr;
    assert!(said.contains("--frames 2"), "{said}");
    assert_eq!(pictures(&t.join("out")).len(), 3);
}

#[cfg(unix)]
#[test]
fn signals_stop_a_run_and_it_goes_on_later() {
    for (signal, status) in [("-INT", 130), ("-TERM", 143)] {
        let t = tempfile::tempdir().unwrap();
        let t = t.path();
        let input = wave(&t.join("w"), 12, 16, 24);
        let args = ["--size", "640x360", "--samples", "16"];
        let mut command = rentix(t);
        command.arg("render").arg(&input).arg("-o").arg(t.join("out")).args(args);
        let mut child = command.stderr(std::process::Stdio::piped()).spawn().unwrap();
        while pictures_there(&t.join("out")) == 0 && child.try_wait().unwrap().is_none() {
            std::hint::spin_loop();
        }
        let kill =
            std::process::Command::new("kill").arg(signal).arg(child.id().to_string()).status().unwrap();
        assert!(kill.success());
        let ended = child.wait_with_output().unwrap();
        assert_eq!(ended.status.code(), Some(status));
        let said = String::from_utf8_lossy(&ended.stderr);
        assert!(said.contains("stopped: ") && said.contains("of 12 frames are left"), "{said}");
        let there = pictures(&t.join("out"));
        assert!(!there.is_empty() && there.len() < 12, "{} pictures", there.len());
        let frames: Vec<String> = there.keys().map(|n| n[5..9].trim_start_matches('0').to_string()).collect();
        let r = t.join("r.json");
        let more = ["--frames", &frames.join(","), "--report", r.to_str().unwrap()];
        render(t, &input, "out", &[&args[..], &more].concat(), 0);
        assert_eq!(report(&r)["totals"]["resumed"], there.len() as u64);
    }
}

#[test]
fn a_report_takes_no_part_of_the_job() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 3, 8, 12);
    let job = t.join("job.yaml");
    std::fs::write(&job, "sequence: w\n").unwrap();
    let report_to = |file: &Path, status| {
        render(t, &job, "out", &[&SMALL[..], &["--report", file.to_str().unwrap()]].concat(), status).stderr
    };
    for file in [input.join("wave_0001.obj"), input.join("wave.mtl"), job.clone()] {
        let before = std::fs::read(&file).unwrap();
        let said = report_to(&file, 2);
        assert!(said.contains(file.to_str().unwrap()) && said.contains("--report"), "{said}");
        assert_eq!(std::fs::read(&file).unwrap(), before);
    }
    assert!(report_to(&t.join("out/wave_0002.png"), 2).contains("picture"));
    assert!(!t.join("out").exists(), "something was tried");
    // a folder is no place for it, one of an earlier run is
    assert!(report_to(&input, 2).contains("report"));
    let file = t.join("r.json");
    for resumed in [0, 3] {
        report_to(&file, 0);
        assert_eq!(report(&file)["totals"]["resumed"], resumed);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn where_nothing_can_be_written_nothing_is_tried() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 3, 8, 12);
    let said = render(t, &input, "/proc/rentix", &SMALL, 2).stderr;
    assert!(said.contains("/proc/rentix") && said.lines().count() == 1, "{said}");
}

#[test]
fn no_picture_takes_the_place_of_an_auxiliary_one() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    std::fs::create_dir(t.join("x")).unwrap();
    for name in ["a.obj", "a.aov.obj"] {
        std::fs::write(t.join("x").join(name), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    }
    let job = t.join("job.yaml");
    for more in ["", ", aov: []"] {
        let text = format!("sequence: x\naov: [depth]\noverrides: [{{files: a.aov, format: exr{more}}}]\n");
        std::fs::write(&job, text).unwrap();
        let said = render(t, &job, "out", &SMALL, 2).stderr;
        assert!(said.contains("a.aov.exr") && said.contains("--name"), "{said}");
    }
}
