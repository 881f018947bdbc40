//! The sample sequence is what its program makes, and renders as the README says.

mod common;

use std::path::Path;

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
