//! The sample sequence is what its program makes, and renders as the README says.

mod common;

#[path = "../examples/make_inchworm.rs"]
#[allow(dead_code, reason = "its main belongs to the example")]
mod make_inchworm;

use std::path::Path;

#[test]
fn the_sample_is_what_its_program_makes() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("sequences/inchworm");
    let different = make_inchworm::differences(&folder).unwrap();
    assert!(different.is_empty(), "cargo run --example make_inchworm makes anew: {different:?}");
}

#[test]
fn the_sample_renders() {
    let t = tempfile::tempdir().unwrap();
    let job = Path::new(env!("CARGO_MANIFEST_DIR")).join("sequences/inchworm.yaml");
    common::render(t.path(), &job, "out", &["--size", "96x54", "--samples", "1"], 0);
    let pictures = common::pictures(&t.path().join("out"));
    assert_eq!(pictures.len(), 36);
    let different: std::collections::BTreeSet<_> = pictures.values().collect();
    assert_eq!(different.len(), 36, "a frame shows what another shows");
}
