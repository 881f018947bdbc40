//! A ball of each illumination model as it was when a person last looked at it: the same pixels, no tolerance, since
//! every CPU path does the same operations. `RENTIX_BLESS=1 cargo test --test golden` takes what is rendered now for
//! right; look at the pictures then.

mod common;

use std::path::Path;

#[test]
fn a_ball_of_each_model() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let materials = root.join("sequences/materials");
    let golden = root.join("tests/golden");
    let t = tempfile::tempdir().unwrap();
    let mut different = Vec::new();
    for illum in 0..=10 {
        let name = format!("model_{illum}");
        let job = t.path().join(format!("{name}.yaml"));
        let there = materials.display();
        let text = format!(
            "layers:\n  - sequence: {there}/floor.obj\n  - sequence: {there}/ball.obj\n    materials: {there}/{name}.mtl\n\
             output: {{size: [80, 60], name: '{name}'}}\n\
             camera: {{eye: [1.5, 3.2, 6.5], look_at: [0, 0.95, 0], fov: 24}}\n\
             lights:\n  - point: {{position: [-4, 7, 5]}}\n  - directional: {{direction: [-1, -1, -0.3], intensity: 0.25}}\n\
             background: {there}/sky.ppm\nsamples: 4\n"
        );
        std::fs::write(&job, text).unwrap();
        common::render(t.path(), &job, "out", &[], 0);
        let (made, kept) = (t.path().join(format!("out/{name}.png")), golden.join(format!("{name}.png")));
        if std::env::var_os("RENTIX_BLESS").is_some() {
            std::fs::create_dir_all(&golden).unwrap();
            std::fs::copy(&made, &kept).unwrap();
        }
        let pixels = |path: &Path| image::open(path).map(image::DynamicImage::into_rgba8);
        let made = pixels(&made).unwrap();
        if pixels(&kept).ok() != Some(made) {
            different.push(name);
        }
    }
    assert!(different.is_empty(), "not as in tests/golden: {different:?}");
}
