//! Each rule bites, on snippets made up for it.

use crate::rules::{File, House, OnePlace, Places, check};

const HOUSE: House = House {
    rooms: &["cli", "run", "plan", "scene"],
    ground: &["math"],
    one_place: &[
        OnePlace {
            rule: "only run writes",
            names: &["std::fs::write", "std::fs::File::create*"],
            places: Places::Only(&["run"]),
        },
        OnePlace { rule: "only cli prints", names: &["println!"], places: Places::Only(&["cli"]) },
        OnePlace {
            rule: "no file in plan",
            names: &["std::fs", ".exists"],
            places: Places::AllBut(&["plan"]),
        },
    ],
    unsafe_files: &["src/plan/proved.rs"],
    suites: &["src/plan/suite.rs"],
    longest_file: 12,
};

/// `LINE: RULE` of each breach in one file.
fn breaches(path: &str, text: &str) -> Vec<String> {
    check(&HOUSE, &[File { path, text }]).iter().map(|b| format!("{}: {}", b.line, b.rule)).collect()
}

/// Whether exactly one breach is found, on this line, with this text in it.
fn bites(path: &str, text: &str, line: usize, word: &str) {
    let found = breaches(path, text);
    assert!(
        found.len() == 1 && found[0].starts_with(&format!("{line}: ")) && found[0].contains(word),
        "{text}: {found:?}"
    );
}

#[test]
fn rooms_use_what_lies_below_them() {
    bites("src/plan/a.rs", "use crate::run::Run;", 1, "`plan` may not use `run`");
    bites("src/scene.rs", "fn f() {\n    crate::plan::go()\n}", 2, "`scene` may not use `plan`");
    bites("src/math/b.rs", "use crate::scene::Frame;", 1, "`math` may not use `scene`");
    bites("src/attic.rs", "use crate::scene::Frame;", 1, "no room");
    assert!(breaches("src/run/a.rs", "use crate::{plan::Plan, scene};\nuse crate::math::Vec3;").is_empty());
    assert!(breaches("src/plan/a.rs", "// use crate::run::Run;\nconst S: &str = \"crate::run\";").is_empty());
}

#[test]
fn what_has_one_place_has_no_other() {
    bites("src/plan/a.rs", "fn f() { std::fs::remove_file(p) }", 1, "no file in plan");
    bites("src/scene/a.rs", "use std::fs;\nfn f() { fs::write(p, b) }", 2, "only run writes");
    bites("src/scene/a.rs", "use std::fs::File;\nfn f() { File::create_new(p) }", 2, "only run writes");
    bites("src/run/a.rs", "fn f() { println!(\"x\") }", 1, "only cli prints");
    bites("src/plan/a.rs", "fn f(p: &P) -> bool { p.exists() }", 1, "no file in plan");
    assert!(breaches("src/run/a.rs", "fn f() { std::fs::write(p, b) }").is_empty());
    assert!(
        breaches("src/scene/a.rs", "#[cfg(test)]\nmod tests {\n    fn f() { std::fs::write(p, b) }\n}")
            .is_empty()
    );
}

#[test]
fn test_modules_in_their_own_files_are_test_code() {
    let files = [
        File { path: "src/plan/mod.rs", text: "#[cfg(test)]\nmod tests;" },
        File { path: "src/plan/tests.rs", text: "fn f() { std::fs::write(p, b).unwrap() }" },
    ];
    assert!(check(&HOUSE, &files).is_empty());
    assert!(!check(&HOUSE, &files[1..]).is_empty(), "and not without the declaration");
}

#[test]
fn unsafe_and_unwrap_are_proved() {
    bites("src/plan/a.rs", "// SAFETY: yes\nfn f() { unsafe { g() } }", 2, "not listed");
    bites("src/plan/proved.rs", "fn f() { unsafe { g() } }", 1, "SAFETY");
    assert!(
        breaches("src/plan/proved.rs", "// SAFETY: g has no preconditions\nfn f() { unsafe { g() } }")
            .is_empty()
    );
    bites("src/plan/a.rs", "fn f() {\n    x.unwrap();\n}", 2, "unwrap");
    assert!(breaches("src/plan/suite.rs", "fn f() {\n    x.unwrap();\n}").is_empty());
    assert!(breaches("src/plan/a.rs", "fn f() {\n    // x was checked\n    x.unwrap();\n}").is_empty());
}

#[test]
fn long_and_unfinished_files_are_named() {
    bites("benches/a.rs", &"//\n".repeat(13), 13, "split it");
    bites("src/plan/a.rs", "fn f() { todo!() }", 1, "todo!");
    bites("src/plan/a.rs", "fn f( {", 1, "not Rust");
}
