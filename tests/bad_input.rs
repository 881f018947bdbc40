//! Bad input is named: file, line, what is wrong. It fails its own frame, never the run, and takes no more memory than
//! 20 times its size and 64 MB, beside what the tree over its triangles takes.

mod common;

use common::{pictures, render, report};
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

const SIZE: [&str; 2] = ["--size", "16x9"];

fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/bad")
}

#[test]
fn each_file_is_rendered_or_refused_as_the_table_says() {
    let table = fs::read_to_string(data().join("table.txt")).unwrap();
    let mut in_table = BTreeSet::new();
    for line in table.lines().filter(|line| !line.starts_with('#')) {
        let mut columns = line.split('|').map(str::trim);
        let (name, status) = (columns.next().unwrap(), columns.next().unwrap().parse().unwrap());
        let words: Vec<&str> = columns.next().unwrap().split(';').map(str::trim).collect();
        let store = tempfile::tempdir().unwrap();
        let run = render(store.path(), &data().join(name), "out", &SIZE, status);
        assert_eq!(pictures(&store.path().join("out")).len(), usize::from(status == 0), "{name}");
        for word in &words {
            assert!(run.stderr.contains(word), "{name} is not refused with `{word}`: {}", run.stderr);
        }
        assert!(words != [""] || !run.stderr.contains(name), "{name}: {}", run.stderr);
        let is_plain = |c: char| c == '\n' || !c.is_control();
        assert!(run.stderr.chars().all(is_plain), "{name}: control characters are not for terminals");
        in_table.insert(name.to_owned());
    }
    let inputs = fs::read_dir(data()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let is_input = |name: &String| Path::new(name).extension().is_some_and(|e| e == "obj" || e == "yaml");
    assert_eq!(inputs.filter(is_input).collect::<BTreeSet<_>>(), in_table);
}

#[test]
fn with_strict_what_is_missing_fails_the_frame() {
    for name in ["latin1_names.obj", "textures.obj"] {
        let store = tempfile::tempdir().unwrap();
        let run = render(store.path(), &data().join(name), "out", &[&SIZE[..], &["--strict"]].concat(), 1);
        assert!(run.stderr.contains("--strict") && pictures(&store.path().join("out")).is_empty());
    }
}

#[test]
fn with_strict_what_is_missing_is_told_once() {
    let store = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| fs::write(store.path().join(name), text).unwrap();
    let strict = [&SIZE[..], &["--strict"]].concat();
    file("a.obj", &format!("usemtl x\n{TRIANGLE}f 1 2 3\n"));
    let said = render(store.path(), &store.path().join("a.obj"), "out", &strict, 1).stderr;
    assert!(said.contains("a.obj:1: material `x` is in no library"), "{said}");
    assert_eq!(said.matches("in no library").count(), 1, "{said}");
    file("b.obj", &format!("mtllib b.mtl\nusemtl x\n{TRIANGLE}f 1 2 3\n"));
    file("b.mtl", "newmtl x\nmap_Kd gone.png\nmap_d lost.png\n");
    let said = render(store.path(), &store.path().join("b.obj"), "out", &strict, 1).stderr;
    // the one that fails the frame, and the other
    assert_eq!([said.matches("gone.png").count(), said.matches("lost.png").count()], [1, 1], "{said}");
    assert_eq!(said.matches("--strict").count(), 1, "{said}");
}

#[test]
fn faces_that_are_all_transparent_are_warned_of_once() {
    let store = tempfile::tempdir().unwrap();
    fs::write(store.path().join("a.mtl"), "newmtl a\nd 0\n").unwrap();
    let obj = store.path().join("a.obj");
    fs::write(&obj, format!("mtllib a.mtl\nusemtl a\n{TRIANGLE}f 1 2 3\n")).unwrap();
    let said = render(store.path(), &obj, "out", &SIZE, 0).stderr;
    assert_eq!(said.matches("warning").count(), 1, "{said}");
    assert!(said.contains("every face is wholly transparent (d 0)") && said.contains("mistake"), "{said}");
}

/// The most that a device takes for a triangle while it builds its tree, bytes.
const TREE_BYTES: u64 = 400;

/// Renders a file to the background of a folder; what was said. It must not take more memory than those bytes of input
/// may.
fn rendered(input: &Path, bytes: usize) -> String {
    let store = tempfile::tempdir().unwrap();
    let report_path = store.path().join("report.json");
    // a driver that is looked for takes memory of its own
    let more = [&SIZE[..], &["--device", "cpu", "--report", report_path.to_str().unwrap()]].concat();
    let run = render(store.path(), input, "out", &more, 0);
    let totals = report(&report_path);
    let peak = totals["totals"]["peak_rss_bytes"].as_u64().unwrap();
    let triangles = totals["frames"][0]["triangles"].as_u64().unwrap();
    let allowed = 20 * bytes as u64 + (64 << 20) + TREE_BYTES * triangles;
    assert!(peak < allowed, "{peak} bytes of memory for {bytes} of {}", input.display());
    run.stderr
}

fn rendered_text(text: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    fs::write(&path, text).unwrap();
    rendered(&path, text.len())
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

#[test]
fn a_face_of_ten_thousand_corners() {
    let mut star = String::new();
    for i in 0..10_000 {
        let (angle, r) = (f64::from(i) * std::f64::consts::TAU / 1e4, f64::from(1 + i % 2));
        writeln!(star, "v {} {} 0", r * angle.cos(), r * angle.sin()).unwrap();
    }
    star += "f";
    (1..=10_000).for_each(|i| write!(star, " {i}").unwrap());
    let said = rendered_text(&star);
    assert!(!said.contains("warning"), "{said}");
}

fn one_line(bytes: usize) {
    for (start, filling) in [
        ("f 1 2 3", " 1 2 3"),
        ("# ", "-"),
        ("o ", "long name "),
        ("v 1 2 3", " 4.5"),
        ("usemtl ", "- "),
        ("mtllib ", "a "),
        ("", "\\\n"),
        ("l", " 1 2"),
        ("unknown", "\u{1}"),
    ] {
        rendered_text(&format!("{TRIANGLE}f 1 2 3\n{start}{}", filling.repeat(bytes / filling.len())));
    }
}

#[test]
fn a_megabyte_on_one_line() {
    one_line(1 << 20);
}

#[test]
#[ignore = "a minute and 14 GB of memory; cargo test --release --test bad_input -- --ignored"]
fn a_hundred_megabytes_on_one_line() {
    one_line(100 << 20);
}

fn lines(count: u32, line: impl Fn(u32) -> String) -> String {
    (0..count).fold(String::new(), |text, i| text + &line(i))
}

fn many(count: u32) {
    for of in [
        |i| format!("g {i}\n"),
        |i| format!("o {i}\nf 1 2 3\n"),
        |i| format!("usemtl {i}\nf 1 2 3\n"),
        |i| format!("s {i}\nf 1 2 3\n"),
        |i| format!("mtllib {i}\n"),
    ] as [fn(u32) -> String; 5]
    {
        rendered_text(&(TRIANGLE.to_owned() + &lines(count, of)));
    }
    // one material of many is used
    let folder = tempfile::tempdir().unwrap();
    let mtl = lines(count, |i| format!("newmtl m{i}\n"));
    fs::write(folder.path().join("a.mtl"), &mtl).unwrap();
    let path = folder.path().join("a.obj");
    fs::write(&path, format!("mtllib a.mtl\n{TRIANGLE}usemtl m7\nf 1 2 3\n")).unwrap();
    assert!(!rendered(&path, mtl.len()).contains("warning"));
}

#[test]
fn a_hundred_thousand_groups_objects_and_materials() {
    many(100_000);
}

#[test]
#[ignore = "ten seconds; cargo test --release --test bad_input -- --ignored"]
fn a_million_groups_objects_and_materials() {
    many(1_000_000);
}

/// A PNG that says it is 16,384 x 16,384 texels and ends there, and others that end early.
#[test]
fn pictures_that_are_less_than_they_say() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    file("a.pgm", b"P5\n16384 16384\n255\n123");
    file("a.ppm", b"P3\n16384 16384\n255\n1 2 3");
    file("a.qoi", b"qoif\0\0\x40\0\0\0\x40\0\x04\0\0\0");
    file("a.tga", b"\0\0\x02\0\0\0\0\0\0\0\0\0\0\x40\0\x40\x20\x08\x01");
    file("a.hdr", b"#?RADIANCE\n\n-Y 8000 +X 8000\n\x01");
    let names = ["a.pgm", "a.ppm", "a.qoi", "a.tga", "a.hdr"];
    let mtl = lines(5, |i| format!("newmtl {0}\nmap_Kd {0}\n", names[i as usize]));
    file("a.mtl", mtl.as_bytes());
    let faces = lines(5, |i| format!("usemtl {}\nf 1 2 3\n", names[i as usize]));
    file("a.obj", format!("mtllib a.mtl\n{TRIANGLE}{faces}").as_bytes());
    let said = rendered(&folder.path().join("a.obj"), 0);
    for name in names {
        assert!(said.contains(&format!("{name}: is broken")), "{name}: {said}");
    }
}

#[cfg(unix)]
#[test]
fn a_frame_that_cannot_be_read_fails_alone() {
    let store = tempfile::tempdir().unwrap();
    let folder = store.path().join("walk");
    fs::create_dir(&folder).unwrap();
    let triangle = format!("{TRIANGLE}f 1 2 3\n");
    fs::write(folder.join("a_1.obj"), &triangle).unwrap();
    std::os::unix::fs::symlink(folder.join("gone.obj"), folder.join("a_2.obj")).unwrap();
    fs::create_dir(folder.join("a_3.obj")).unwrap();
    fs::write(folder.join("a_4.obj"), triangle.replace('3', "4")).unwrap();
    fs::write(folder.join("a_5.obj"), &triangle).unwrap();
    let run = render(store.path(), &folder, "out", &SIZE, 1);
    let names: Vec<String> = pictures(&store.path().join("out")).into_keys().collect();
    assert_eq!(names, ["a_1.png", "a_5.png"], "{}", run.stderr);
    assert!(run.stderr.contains("a_4.obj:4: position index 4"), "{}", run.stderr);
}

#[test]
fn files_that_are_something_else_fail_alone_and_move_no_camera() {
    let store = tempfile::tempdir().unwrap();
    let folder = store.path().join("walk");
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("a_1.obj"), format!("{TRIANGLE}f 1 2 3\n")).unwrap();
    let run = render(store.path(), &folder, "alone", &SIZE, 0);
    assert!(!run.stderr.contains("warning"), "{}", run.stderr);
    fs::write(folder.join("a_2.obj"), "\u{1}\0\0\nv 900 0 0\nv 0 900 0\n").unwrap();
    fs::write(folder.join("a_3.obj"), "<html>\n<p>gone</p>\n</html>\n").unwrap();
    let run = render(store.path(), &folder, "out", &SIZE, 1);
    for told in ["a_2.obj:1: is binary, not text", "a_3.obj:1: is no OBJ", "the first is `<html>`"] {
        assert!(run.stderr.contains(told), "{told}: {}", run.stderr);
    }
    assert_eq!(pictures(&store.path().join("out")), pictures(&store.path().join("alone")));
    let inspected = common::run(store.path(), ["inspect", folder.to_str().unwrap(), "--device", "cpu"]);
    assert!(inspected.status == 1 && inspected.stdout.contains("a_1"), "{}", inspected.stderr);
    assert!(inspected.stderr.contains("a_2.obj:1: ") && inspected.stderr.contains("a_3.obj:1: "));
}

#[cfg(unix)]
#[test]
fn names_of_any_bytes() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let store = tempfile::tempdir().unwrap();
    let file = |name: &[u8]| store.path().join(OsStr::from_bytes(name));
    let picture = b"P3\n1 1\n255\n9 9 9\n";
    fs::write(file(b"a b \xff\"'.ppm"), picture).unwrap();
    fs::write(file(b"m \xfe.mtl"), b"newmtl m\xfd\nmap_Kd -clamp on a b \xff\"'.ppm\n").unwrap();
    let obj = file(b"\xfc #$(1).obj");
    let text = [b"mtllib m \xfe.mtl\n", TRIANGLE.as_bytes(), b"usemtl m\xfd\nf 1 2 3\n"].concat();
    fs::write(&obj, text).unwrap();
    let run = render(store.path(), &obj, "out", &SIZE, 0);
    assert!(!run.stderr.contains("warning"), "{}", run.stderr);
}

#[cfg(unix)]
#[test]
fn a_folder_without_rights_is_named() {
    use std::os::unix::fs::PermissionsExt;
    let store = tempfile::tempdir().unwrap();
    let folder = store.path().join("locked");
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("a_1.obj"), TRIANGLE).unwrap();
    fs::set_permissions(&folder, fs::Permissions::from_mode(0o000)).unwrap();
    if fs::read_dir(&folder).is_ok() {
        println!("skipped: this user may read everything");
    } else {
        let run = render(store.path(), &folder, "out", &SIZE, 2);
        assert!(run.stderr.contains("locked") && run.stderr.contains("permission"), "{}", run.stderr);
    }
    fs::set_permissions(&folder, fs::Permissions::from_mode(0o700)).unwrap();
}
