//! The sample sequences are what their programs make, and render as the README says.

mod common;

#[path = "../examples/make_inchworm.rs"]
#[allow(dead_code, reason = "its main belongs to the example")]
mod make_inchworm;
#[path = "../examples/make_materials.rs"]
#[allow(dead_code, clippy::duplicate_mod, reason = "its main belongs to the example, which shares a module")]
mod make_materials;

use std::path::{Path, PathBuf};

fn sequences() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("sequences")
}

#[test]
fn the_samples_are_what_their_programs_make() {
    use make_inchworm::{files as inchworm, made::differences};
    for (name, files) in [("inchworm", inchworm()), ("materials", make_materials::files())] {
        let different = differences(&sequences().join(name), &files).unwrap();
        assert!(different.is_empty(), "cargo run --example make_{name} makes anew: {different:?}");
    }
}

#[test]
fn the_sample_renders() {
    let t = tempfile::tempdir().unwrap();
    let job = sequences().join("inchworm.yaml");
    common::render(t.path(), &job, "out", &["--size", "96x54", "--samples", "1"], 0);
    let pictures = common::pictures(&t.path().join("out"));
    assert_eq!(pictures.len(), 36);
    let different: std::collections::BTreeSet<_> = pictures.values().collect();
    assert_eq!(different.len(), 36, "a frame shows what another shows");
}
