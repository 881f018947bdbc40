//! Wrong use and bad input are named, with the exit status of CONTRACT 1; a bad frame fails alone.

mod common;
use common::{pictures, render, report, run, wave};
use std::fmt::Write as _;

#[test]
fn wrong_use_ends_in_2_and_writes_nothing() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 2, 4, 6);
    assert_eq!(run(t, ["--help"]).status, 0);
    assert_eq!(run(t, ["--version"]).status, 0);
    assert_eq!(run(t, ["render", "--no-such-option"]).status, 2);
    for command in ["render", "inspect", "compare", "devices", "completions"] {
        let help = run(t, [command, "--help"]);
        assert!(help.status == 0 && help.stdout.contains(&format!("rentix {command}")), "{command}");
    }
    let refused = |input: &std::path::Path, more: &[&str], word: &str| {
        let said = render(t, input, "out", more, 2).stderr;
        assert!(said.contains(word), "{more:?}: {said}");
        assert!(!t.join("out").exists(), "{more:?} made a folder");
    };
    refused(&t.join("absent"), &[], "absent");
    refused(&input, &["--frames", "1-9"], "3");
    refused(&input, &["--device", "gpu:99"], "gpu:99");
    refused(&input, &["--size", "0x9"], "size");
    refused(&input, &["--chunk", "3/2"], "chunk");
    refused(&input, &["--samples=-1"], "1..=65536");
    refused(&input, &["--device", "cpu,"], "no device ``");
    refused(&input, &["--size", "20000x16", "--format", "webp"], "16384 pixels a side, not 20000x16");
    refused(&input, &["--frames", "2-1"], "`2-1` ends before it begins; write 1-2");
    std::fs::write(t.join("file"), "kept").unwrap();
    let said = render(t, &input, "file", &[], 2).stderr;
    assert!(said.contains("file: is no folder") && said.contains("-o"), "{said}");
    assert_eq!(std::fs::read(t.join("file")).unwrap(), b"kept");
}

#[test]
fn a_bad_frame_is_named_and_fails_alone() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 3, 4, 6);
    let obj = input.join("wave_0002.obj");
    let text = std::fs::read_to_string(&obj).unwrap();
    std::fs::write(&obj, format!("{text}f 1 2 999999\n")).unwrap();
    let line = text.lines().count() + 1;
    let r = t.join("r.json");
    let args = ["--size", "32x18", "--report", r.to_str().unwrap()];
    let said = render(t, &input, "out", &args, 1).stderr;
    assert!(said.contains(&format!("wave_0002.obj:{line}: ")) && said.contains("999999"), "{said}");
    assert!(said.contains("--frames 2"), "{said}");
    assert_eq!(pictures(&t.join("out")).keys().collect::<Vec<_>>(), ["wave_0001.png", "wave_0003.png"]);
    assert_eq!(report(&r)["totals"]["failed"], 1);
    render(t, &input, "lenient", &["--size", "32x18", "--lenient"], 0);
    std::fs::write(&obj, text).unwrap();
    render(t, &input, "out", &["--size", "32x18", "--frames", "2"], 0);
    assert_eq!(pictures(&t.join("out")).len(), 3);
}

#[test]
fn inspect_goes_on_after_bad_frames_and_tells_costs_by_the_last_good_one() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 5, 4, 7);
    for bad in [2, 5] {
        std::fs::write(input.join(format!("wave_000{bad}.obj")), "f 1 2 3\n").unwrap();
    }
    let said = run(t, ["inspect", input.to_str().unwrap(), "--device", "cpu"]);
    assert_eq!(said.status, 1, "{}", said.stderr);
    for bad in [2, 5] {
        assert!(said.stderr.contains(&format!("wave_000{bad}.obj:1: ")), "{}", said.stderr);
    }
    let lines: Vec<&str> = said.stdout.lines().collect();
    assert_eq!(lines.iter().filter(|l| l.contains("vertices")).count(), 1, "{}", said.stdout);
    let changes: Vec<&&str> = lines.iter().filter(|l| l.contains("wave_")).collect();
    assert!(changes.len() == 3 && changes[0].ends_with("1 added"), "{}", said.stdout);
    assert!(changes[1..].iter().all(|l| l.ends_with("1 deformed")), "{}", said.stdout);
    assert_eq!(lines.iter().filter(|l| **l == "expected, ms").count(), 1, "{}", said.stdout);
}

#[test]
fn names_that_no_frame_has_are_warned_of_once() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let frame = |i: u32, name: &str| format!("usemtl {name}\nv 0 0 0\nv 1 0 0\nv 0 1 {i}\nf 1 2 3\n");
    for (i, name) in [(1, "Glass"), (2, "Glass"), (3, "Brass")] {
        std::fs::write(t.join(format!("a_{i}.obj")), frame(i, name)).unwrap();
    }
    let job = t.join("j.yaml");
    let text = "sequence: a_#.obj
materials: {Glass: {d: 0.5}, Glas: {Kd: 1}}
overrides: [{frames: 2-3, materials: {Brass: {Kd: 1}}}, {frames: 7, samples: 2}]
";
    std::fs::write(&job, text).unwrap();
    let said = render(t, &job, "out", &["--size", "32x18"], 0).stderr;
    assert_eq!(said.matches("warning").count(), 2, "{said}");
    assert!(said.contains("j.yaml: materials: no frame has a material `Glas`;"), "{said}");
    assert!(said.contains("j.yaml:3: an override is for none of the frames"), "{said}");
}

#[test]
fn events_are_one_json_object_a_line() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 2, 4, 7);
    let said = render(t, &input, "out", &["--size", "32x18", "--json"], 0).stdout;
    let events: Vec<serde_json::Value> = said.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    let kinds: Vec<&str> = events.iter().map(|e| e["event"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["start", "frame", "frame", "end"]);
    let said = render(t, &t.join("absent"), "out", &["--json"], 2);
    let event: serde_json::Value = serde_json::from_str(&said.stdout).unwrap();
    assert!(event["event"] == "error" && said.stderr.contains(event["text"].as_str().unwrap()), "{event}");
    // two writers may end in either order
    let of = |number: i64| events.iter().find(|e| e["frame"] == number).unwrap();
    let frame = of(1);
    assert_eq!(frame["rays"]["camera"], 32 * 18);
    assert_eq!(frame["triangles"], 2 * 4 * 7 + 2);
    assert_eq!(frame["change"]["added"], 1);
    assert_eq!(of(2)["change"]["deformed"], 1, "{}", of(2));
}

#[test]
fn what_does_not_fit_is_refused_with_the_figures() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 2, 4, 7);
    let said = render(t, &input, "out", &["--size", "32x18", "--memory", "8K"], 3).stderr;
    assert!(said.contains("8192 are allowed") && said.contains("--memory"), "{said}");
    assert!(pictures(&t.join("out")).is_empty());
    // the frames fit one at a time, but not side by side
    render(t, &input, "out", &["--size", "32x18", "--memory", "64K"], 0);
    assert_eq!(pictures(&t.join("out")).len(), 2);

    // 512 x 512 texels of four bytes, and a third more for their levels
    image::RgbImage::new(512, 512).save(t.join("a.png")).unwrap();
    std::fs::write(t.join("a.mtl"), "newmtl m\nmap_Kd a.png\n").unwrap();
    let obj = t.join("a.obj");
    std::fs::write(&obj, "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n")
        .unwrap();
    let said = render(t, &obj, "textured", &["--size", "32x18", "--memory", "1M"], 3).stderr;
    assert!(said.contains("textures") && said.contains("1398100") && said.contains("1048576"), "{said}");
    render(t, &obj, "textured", &["--size", "32x18", "--memory", "2M"], 0);
}

#[test]
fn render_farms_read_progress() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 2, 4, 7);
    for (kind, lines) in [
        ("openjd", "openjd_progress: 50.0\nopenjd_progress: 100.0\nopenjd_status: 2 of 2 frames, 0 failed\n"),
        ("alf", "ALF_PROGRESS 50%\nALF_PROGRESS 100%\n"),
    ] {
        assert_eq!(render(t, &input, kind, &["--size", "32x18", "--progress", kind], 0).stdout, lines);
    }
    // pictures may end in any order
    let told = render(t, &input, "afanasy", &["--size", "32x18", "--progress", "afanasy"], 0).stdout;
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!([lines[0], lines[2]], ["PROGRESS: 50%", "PROGRESS: 100%"]);
    for picture in [lines[1], lines[3]] {
        let path = picture.strip_prefix("@IMAGE@").unwrap();
        assert!(t.join(path).is_file(), "{picture}");
    }
    // a frame that fails fails its chunk
    std::fs::write(input.join("wave_0002.obj"), "f 1 2 3\n").unwrap();
    let told = render(t, &input, "openjd", &["--size", "32x18", "--progress", "openjd"], 1).stdout;
    assert!(told.ends_with("openjd_fail: 1 frames failed\n"), "{told}");
}

#[test]
fn compare_says_what_differs_and_what_it_cannot_tell() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 2, 4, 7);
    let said = |status: i32, wanted: &str| {
        let run = run(t, ["compare".as_ref(), t.join("a").as_os_str(), t.join("b").as_os_str()]);
        assert!(run.status == status && run.stderr.contains(wanted), "{}{}", run.stdout, run.stderr);
        run.stdout
    };
    for (folder, format) in [("a", "jp2"), ("b", "jp2"), ("a", "ras")] {
        render(t, &input, folder, &["--size", "32x18", "--format", format], 0);
    }
    for flip in ["nan", "-0.1", "2", "x"] {
        assert_eq!(run(t, ["compare", t.to_str().unwrap(), t.to_str().unwrap(), "--flip", flip]).status, 2);
    }
    for empty in [t.join("empty/a"), t.join("empty/b")] {
        std::fs::create_dir_all(&empty).unwrap();
        std::fs::write(empty.join("notes.txt"), "").unwrap();
    }
    let told = run(t, ["compare".as_ref(), t.join("empty/a").as_os_str(), t.join("empty/b").as_os_str()]);
    assert!(told.status == 2 && told.stderr.contains("no pictures"), "{}", told.stderr);
    // the same bytes are equal whatever they are
    let told = said(1, "2 pictures compared, 0 differ, 2 are in one folder only");
    assert!(told.contains("wave_0001.ras: is only in "), "{told}");
    render(t, &input, "b", &["--size", "32x18", "--format", "ras"], 0);
    said(0, "4 pictures compared, 0 differ\n");
    let picture = t.join("b/wave_0002.ras");
    let mut bytes = std::fs::read(&picture).unwrap();
    bytes[99] ^= 0xff;
    std::fs::write(&picture, bytes).unwrap();
    let told = said(1, "4 pictures compared, 1 differ\n");
    assert!(told.contains("wave_0002.ras: max "), "{told}");
    std::fs::write(t.join("b/wave_0001.jp2"), "torn").unwrap();
    let told = said(2, "3 pictures compared, 1 differ, 1 cannot be read\n");
    assert!(told.contains("a/wave_0001.jp2: is not a picture that can be compared"), "{told}");
}

/// A pipe into which nobody writes is not waited for, and a device without end not read.
#[test]
#[cfg(unix)]
fn what_is_no_plain_file_is_refused() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let path = |name: &str| t.join(name).to_str().unwrap().to_owned();
    let fifo = |name: &str| {
        let made = std::process::Command::new("mkfifo").arg(t.join(name)).status().unwrap();
        assert!(made.success());
        path(name)
    };
    let (job, picture, endless) = (fifo("job.yaml"), fifo("a.png"), path("endless.png"));
    std::os::unix::fs::symlink("/dev/zero", &endless).unwrap();
    let input = wave(&t.join("w"), 1, 4, 7);
    let obj = input.join("wave_0001.obj").to_str().unwrap().to_owned();
    for args in [
        vec!["render", &job],
        vec!["render", &obj, "--job", &job],
        vec!["compare", &picture, &picture],
        vec!["compare", &obj, &endless],
        vec!["render", &obj, "--background", &picture, "-o", &path("out")],
    ] {
        let mut child = common::rentix(t).args(&args).stderr(std::process::Stdio::piped()).spawn().unwrap();
        let since = std::time::Instant::now();
        while child.try_wait().unwrap().is_none() {
            if since.elapsed().as_secs() > 60 {
                child.kill().unwrap();
                panic!("{args:?} hangs");
            }
            std::thread::yield_now();
        }
        let ended = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&ended.stderr);
        assert!(ended.status.code() != Some(0) && said.contains("plain file"), "{args:?}: {said}");
    }
}

/// Nine panes of refracting glass, each entered and none left.
#[test]
fn media_that_are_too_deep_are_told_of() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let (mut obj, mut mtl) = ("mtllib p.mtl\n".to_string(), String::new());
    for i in 0..9 {
        let z = -0.1 * f64::from(i);
        writeln!(obj, "v -9 -9 {z}\nv 9 -9 {z}\nv 0 9 {z}\nusemtl m{i}\nf -3 -2 -1").unwrap();
        writeln!(mtl, "newmtl m{i}\nNi 1.{}\nillum 6\nKs 0 0 0", i + 1).unwrap();
    }
    std::fs::write(t.join("p.mtl"), mtl).unwrap();
    std::fs::write(t.join("p.obj"), obj).unwrap();
    let view = ["--size", "8x8", "--eye", "0,0,5", "--look-at", "0,0,0", "--fov", "5"];
    let said = render(t, &t.join("p.obj"), "out", &view, 0).stderr;
    assert!(
        said.contains("p.obj") && said.contains("more than 8 media") && said.contains("(64 times)"),
        "{said}"
    );
}

/// What is missing for all is told once, before anything is tried.
#[test]
fn a_background_that_no_frame_has_ends_in_2() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 3, 4, 6);
    let said = render(t, &input, "out", &["--background", "gone.hdr"], 2).stderr;
    assert!(said.contains("gone.hdr") && said.lines().count() == 1, "{said}");
    // where it is one frame's it fails that alone
    let job = t.join("job.yaml");
    std::fs::write(&job, "sequence: w\noverrides: [{frames: 2, background: gone.hdr}]\n").unwrap();
    assert!(render(t, &job, "out", &["--size", "32x18"], 1).stderr.contains("--frames 2"));
}

/// Whoever reads may go at any time.
#[cfg(unix)]
#[test]
fn a_reader_that_is_gone_ends_nothing() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 3, 4, 6);
    let (input, out, file) = (input.to_str().unwrap(), t.join("out"), t.join("r.json"));
    let (out, file) = (out.to_str().unwrap(), file.to_str().unwrap());
    let small = ["render", input, "-o", out, "--size", "32x18", "--report", file];
    for args in [
        [&small[..], &["--json"]].concat(),
        [&small[..], &["--overwrite", "--progress", "openjd"]].concat(),
        [&small[..], &["--overwrite", "--progress", "plain", "-v"]].concat(),
        vec!["inspect", input, "--device", "cpu"],
        vec!["devices", "--json"],
        vec!["completions", "bash"],
    ] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let mut command = common::rentix(t);
        command.args(&args).stdout(writer.try_clone().unwrap()).stderr(writer);
        assert_eq!(command.status().unwrap().code(), Some(0), "{args:?}");
    }
    assert_eq!(report(t.join("r.json").as_path())["totals"]["frames"], 3);
}

#[test]
fn colors_are_where_they_are_asked_for() {
    let t = tempfile::tempdir().unwrap();
    let absent = ["inspect", "absent"];
    for (more, is_colored) in [(&[][..], false), (&["--color", "always"], true), (&["--color=never"], false)]
    {
        let said = run(t.path(), [&absent[..], more].concat()).stderr;
        assert_eq!(said.contains("\u{1b}[1;31merror:"), is_colored, "{said:?}");
    }
}

/// What a device has before it is told by the frames before in the list.
#[test]
fn the_report_has_frames_in_the_order_in_which_they_were_taken() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let input = wave(&t.join("w"), 12, 4, 6);
    let file = t.join("r.json");
    let more = ["--size", "32x18", "--device", "cpu/2", "--report", file.to_str().unwrap()];
    render(t, &input, "out", &more, 0);
    let report = report(&file);
    for device in ["cpu:0", "cpu:1"] {
        let frames = report["frames"].as_array().unwrap().iter().filter(|f| f["device"] == device);
        let loads: Vec<bool> = frames.map(|f| f["update"]["action"] == "load").collect();
        assert!(loads.iter().skip(1).all(|load| !load), "{device}: {loads:?}");
        assert!(loads.first().is_none_or(|&load| load), "{device}: {loads:?}");
    }
}

/// What is so large or small that no ray meets it is not left out in silence.
#[test]
fn scenes_beyond_what_rays_meet_are_warned_of() {
    let t = tempfile::tempdir().unwrap();
    let t = t.path();
    let obj = t.join("a.obj");
    for (size, is_met) in [("1e13", false), ("1e12", true), ("1e-15", true), ("1e-16", false)] {
        std::fs::write(&obj, format!("v -{size} -{size} 0\nv {size} -{size} 0\nv 0 {size} 0\nf 1 2 3\n"))
            .unwrap();
        let said = render(t, &obj, "out", &["--size", "16x16", "--overwrite"], 0).stderr;
        assert_eq!(said.contains("wide; rays meet"), !is_met, "{size}: {said}");
        let picture = image::open(t.join("out/a.png")).unwrap().to_rgb8();
        assert_eq!(picture.pixels().any(|p| p.0 != [0; 3]), is_met, "{size}");
    }
}
