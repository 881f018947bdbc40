//! Each rule bites on a made-up file, and lets be what it should.

use crate::HOUSE;
use crate::rules::{File, check};

/// The breaches of some files, as they would be printed.
fn breaches(files: &[(&str, &str)]) -> Vec<String> {
    let files: Vec<File<'_>> = files.iter().map(|&(path, text)| File { path, text }).collect();
    check(&HOUSE, &files).iter().map(ToString::to_string).collect()
}

/// One file breaks one rule, on line 2, with a message that says so.
#[track_caller]
fn bites(path: &str, second_line: &str, message: &str) {
    let found = breaches(&[(path, &format!("use crate::math::Vec3;\n{second_line}\n"))]);
    assert_eq!(found.len(), 1, "{found:#?}");
    assert!(found[0].starts_with(&format!("{path}:2: ")), "{found:#?}");
    assert!(found[0].contains(message), "{found:#?}");
}

#[track_caller]
fn passes(path: &str, text: &str) {
    assert_eq!(breaches(&[(path, text)]), [""; 0]);
}

#[test]
fn rooms_use_only_rooms_below_them() {
    let above = "`scene` may not use `format`";
    bites("src/scene/mesh.rs", "use crate::format::obj;", above);
    bites("src/scene/mesh.rs", "fn f() { crate::format::obj::read(); }", above);
    bites("src/scene/mesh.rs", "use crate::{format::obj, math::Vec2};", above);
    bites("src/scene/mesh.rs", "use super::super::format::obj as reader;", above);
    bites("src/scene/mesh.rs", "mod inner { use super::super::super::format; }", above);
    bites("src/scene/mesh.rs", "macro_rules! m { () => { $crate::format::obj::read() } }", above);
    bites("src/scene/mesh.rs", "#[cfg(test)] mod tests { use crate::format::obj; }", above);
    bites("src/math/mod.rs", "use crate::scene::Frame;", "`math` may not use `scene`");
    assert_eq!(
        breaches(&[("src/attic/mod.rs", "struct A;")]),
        ["src/attic/mod.rs:1: `attic` is no room of the table"]
    );
}

#[test]
fn rooms_may_use_what_is_below_and_beside() {
    passes(
        "src/format/obj/mod.rs",
        "use crate::scene::Frame; use crate::math; use super::mtl; use self::lines::Line;",
    );
    passes("src/cli/render.rs", "use crate::{run, device::{Device, cpu}, scene::*};");
    passes("src/main.rs", "fn main() { rentix::cli::main(); }");
    passes(
        "src/scene/mod.rs",
        "//! Read by [`crate::format`].\n/// See [`crate::run`].\npub struct A; // crate::run::B",
    );
    passes("src/clock.rs", "use crate::warning::Warning;");
}

#[test]
fn only_some_rooms_write_files() {
    let rule = "only output, store, run and watch write files";
    bites("src/film/mod.rs", "fn f() { std::fs::write(a, b); }", rule);
    bites("src/film/mod.rs", "fn f() { use std::fs; fs::remove_dir_all(a); }", rule);
    bites("src/film/mod.rs", "use std::fs::{create_dir_all};", rule);
    bites("src/film/mod.rs", "use std::fs::{self as disk}; fn f() { disk::rename(a, b); }", rule);
    bites("src/job/mod.rs", "use std::fs::File; fn f() { File::create_new(a); }", rule);
    bites("src/job/mod.rs", "use std::fs::OpenOptions;", rule);
    bites("src/job/mod.rs", "use std::fs::*;", rule);
    passes("src/output/atomic.rs", "use std::fs::{File, rename}; fn f() { File::create(a); rename(a, b); }");
    passes(
        "src/film/mod.rs",
        "fn f(out: &mut Vec<u8>) { out.write(b); remove(x); } struct File; fn g() { File::create(); }",
    );
}

#[test]
fn only_some_rooms_read_files() {
    bites("src/film/mod.rs", "fn f() { std::fs::read(a); }", "read files");
    bites("src/cli/mod.rs", "use std::fs::read_dir;", "read files");
    passes("src/format/mod.rs", "fn f() { std::fs::File::open(a); memmap2::Mmap::map(b); }");
}

#[test]
fn libraries_stay_in_their_rooms() {
    bites("src/device/cpu/mod.rs", "use obvhs::bvh2::Bvh2;", "only accel names obvhs");
    bites("src/device/cpu/mod.rs", "extern crate obvhs;", "only accel names obvhs");
    bites("src/run/mod.rs", "fn f() { serde_yaml::from_str(a); }", "only job reads YAML");
    bites("src/film/mod.rs", "use png::Decoder;", "only output knows picture formats");
    bites("src/format/texture.rs", "use png::Encoder;", "only output encodes pictures");
    bites("src/format/texture.rs", "use image::codecs::bmp::BmpEncoder;", "only output encodes pictures");
    passes("src/format/texture.rs", "use png::Decoder; use image::codecs::bmp::BmpDecoder;");
    passes("src/kernel/mod.rs", "fn f(image: &[f32]) { let png = image.len(); let exr = self.exr; }");
}

#[test]
fn only_the_command_line_prints() {
    bites("src/run/mod.rs", "fn f() { std::eprintln![\"a\"]; }", "only cli/say prints lines");
    bites("src/run/mod.rs", "use std::io::{stderr as out};", "only cli prints");
    bites("src/run/mod.rs", "use indicatif::ProgressBar;", "only cli prints");
    bites("src/cli/mod.rs", "fn f() { println!(\"a\"); }", "only cli/say prints lines");
    passes("src/cli/say.rs", "fn f() { println!(\"a\"); std::io::stderr().lock(); }");
    passes("src/run/mod.rs", "/// `println!(\"a\")`\nconst A: &str = \"println!()\";");
}

#[test]
fn clocks_threads_and_environment_have_one_place() {
    bites("src/run/mod.rs", "fn f() { std::time::Instant::now(); }", "only clock reads clocks");
    bites("src/run/mod.rs", "fn f() { std::env::var(a); }", "only cli reads arguments and environment");
    bites("src/plan/mod.rs", "use std::time::Duration;", "no clock in");
    bites("src/diff/mod.rs", "use crate::clock::Stopwatch;", "no clock in");
    bites("src/kernel/mod.rs", "use rayon::prelude::*;", "no thread in");
    bites("src/schedule/mod.rs", "fn f() { std::thread::spawn(g); }", "no thread in");
    bites("src/scene/mod.rs", "fn f(path: &std::path::Path) -> bool { path.exists() }", "no file in");
    passes(
        "src/run/mod.rs",
        "use std::time::Duration; use crate::clock; use std::thread; const V: &str = env!(\"V\");",
    );
}

#[test]
fn test_code_may_use_files_and_threads() {
    let text = "#[cfg(test)]\nmod tests {\n    use std::{fs, thread, time::Instant};\n    fn f() { fs::read(a).unwrap(); }\n}";
    passes("src/plan/mod.rs", text);
    // The module may lie in a file of its own.
    let own_file = ("src/plan/tests.rs", "fn f() { std::fs::read(a); }");
    assert_eq!(breaches(&[("src/plan/mod.rs", "#[cfg(test)]\nmod tests;"), own_file]), [""; 0]);
    assert_ne!(breaches(&[("src/plan/mod.rs", "mod tests;"), own_file]), [""; 0]);
    // What follows a test module is no test code.
    bites(
        "src/plan/mod.rs",
        "#[cfg(test)] mod tests { use std::fs::read; } use std::thread;",
        "no thread in",
    );
}

#[test]
fn unsafe_is_listed_and_proved() {
    bites("src/film/mod.rs", "fn f() { unsafe { g() } }", "not listed");
    let house = crate::rules::House { unsafe_files: &["src/film/mod.rs"], ..HOUSE };
    let found = |text| check(&house, &[File { path: "src/film/mod.rs", text }]).len();
    assert_eq!(found("fn f() {\n    unsafe { g() }\n}"), 1);
    assert_eq!(found("fn f() {\n    // Fast.\n    unsafe { g() }\n}"), 1);
    assert_eq!(found("// SAFETY: of f\nfn f() {\n    unsafe { g() }\n}"), 1);
    assert_eq!(found("fn f() {\n    // SAFETY: g has no\n    // conditions.\n    unsafe { g() }\n}"), 0);
    assert_eq!(
        found("fn f() {\n    // SAFETY: g has no conditions.\n    let a =\n        unsafe { g() };\n}"),
        0
    );
    assert_eq!(found("/// # Safety\n/// None.\n#[inline]\nunsafe fn f() {}"), 0);
}

#[test]
fn unwrap_is_proved() {
    bites("src/film/mod.rs", "fn f() { a.unwrap(); }", "without a comment");
    bites("src/film/mod.rs", "fn f() { a.expect(\"b\"); }", "without a comment");
    passes("src/film/mod.rs", "fn f() {\n    // Four bytes make a word.\n    a.b()\n        .unwrap();\n}");
    passes("src/device/conformance.rs", "fn f() { a.unwrap(); }");
    passes("src/film/mod.rs", "fn f() { a.unwrap_or(b); a.unwrap(); // never empty\n}");
}

#[test]
fn files_are_short_finished_and_read() {
    let long = "\n".repeat(501);
    assert_eq!(breaches(&[("tests/a.rs", &long)]).len(), 1);
    assert_eq!(breaches(&[("shaders/a.wgsl", &long)]).len(), 1);
    assert_eq!(breaches(&[("tests/a.rs", &long[1..])]), [""; 0]);
    bites("examples/a.rs", "fn f() { todo![] }", "`todo!` is left behind");
    bites("tests/a.rs", "fn f() { unimplemented![] }", "`unimplemented!` is left behind");
    bites("src/film/mod.rs", "fn f() { dbg![a] }", "`dbg!` is left behind");
    assert_eq!(breaches(&[("src/film/mod.rs", "fn f( {")]).len(), 1);
}
