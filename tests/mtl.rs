//! Materials and the files they name: found however they are written, the same by content whatever their names.

use rentix::format::{Loaded, MaterialOverride, ReadOptions, load_obj};
use rentix::scene::{ABSENT, Material};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

/// A folder with those files.
fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }
    folder
}

fn load(folder: &TempDir, options: &ReadOptions) -> Loaded {
    load_obj(&folder.path().join("a.obj"), options).unwrap()
}

/// The first material of an OBJ with one triangle that uses `m` of the MTL given.
fn material(mtl: &str) -> Material {
    let obj = format!("mtllib a.mtl\n{TRIANGLE}usemtl m\nf 1 2 3\n");
    let loaded = load(&folder(&[("a.obj", &obj), ("a.mtl", mtl)]), &ReadOptions::default());
    Material::clone(&loaded.geometry.materials[0])
}

fn warnings(loaded: &Loaded, folder: &Path) -> Vec<String> {
    let prefix = format!("{}/", folder.display());
    loaded.warnings.list().iter().map(|w| w.to_string().replace(&prefix, "")).collect()
}

#[test]
fn values_and_defaults() {
    assert_eq!(material("newmtl m\n"), Material::default());
    let m = material(
        "newmtl m\n\tKa 0.1 # dark\r\nKd 0.1 0.2 0.3\nKs 0.5 0 0\nKe 2 3 4\nd 0.5\nTf 1 1 1\nNi 1.5\n",
    );
    assert_eq!((m.ka, m.kd, m.ks, m.ke), ([0.1; 3], [0.1, 0.2, 0.3], [0.5, 0.0, 0.0], [2.0, 3.0, 4.0]));
    assert_eq!((m.ns, m.d, m.illum), (10.0, 0.5, 2));
    assert_eq!(material("newmtl m\nKs 0 0 0\nillum 7\nTr 0.25\n").illum, 7);
    assert_eq!(material("newmtl m\nTr 0.25\n").d, 0.75);
    assert_eq!(material("newmtl m\nTr 1.0\nd 0.5\n"), material("newmtl m\nd 0.5\nTr 1.0\n"));
    assert_eq!(material("newmtl m\nKd x\nNs 1e\nd 0.5\n").kd, [0.8; 3], "a malformed line is left out");
}

#[test]
fn libraries_are_found() {
    let red = "newmtl m\nKd 1 0 0\n";
    for (statement, file) in [
        ("a.mtl", "a.mtl"),
        ("a.mtl   # comment", "a.mtl"),
        ("  a b.mtl", "a b.mtl"),
        (r"a\ b.mtl", "a b.mtl"),
        (r"absent.mtl  a\ b.mtl", "a b.mtl"),
        ("absent.mtl gone.mtl a.mtl", "a.mtl"),
        (r"sub\A.MTL", "sub/a.mtl"),
        ("./sub/../sub/a.mtl", "sub/a.mtl"),
        (r"D:\work\a.mtl", "a.mtl"),
    ] {
        let obj = format!("mtllib {statement}\n{TRIANGLE}usemtl m\nf 1 2 3\n");
        let folder = folder(&[("a.obj", &obj), (file, red), ("sub/other", "")]);
        let loaded = load(&folder, &ReadOptions::default());
        assert_eq!(loaded.geometry.materials[0].kd, [1.0, 0.0, 0.0], "{statement}");
        assert_eq!(loaded.inputs.len(), 2, "{statement}");
        assert_eq!(loaded.bytes_read, (obj.len() + red.len()) as u64);
    }
}

#[test]
fn the_first_library_and_the_last_definition_stand() {
    let obj = format!("mtllib a.mtl b.mtl\nmtllib c.mtl\n{TRIANGLE}usemtl m\nf 1 2 3\nusemtl n\nf 1 2 3\n");
    let files = [
        ("a.obj", obj.as_str()),
        ("a.mtl", "newmtl m\nKd 1\nnewmtl m\nKd 0.5\n"),
        ("b.mtl", "newmtl m\nKd 0\n"),
        ("c.mtl", "newmtl n\nKd 0.25\n"),
    ];
    let loaded = load(&folder(&files), &ReadOptions::default());
    assert_eq!(loaded.geometry.materials.iter().map(|m| m.kd[0]).collect::<Vec<_>>(), [0.5, 0.25]);
    assert_eq!(loaded.material_names, [b"m", b"n"]);
}

#[test]
fn a_missing_library_is_one_warning() {
    let obj = format!("mtllib gone.mtl\n{TRIANGLE}usemtl m\nf 1 2 3\nusemtl n\nf 1 2 3\n");
    let folder = folder(&[("a.obj", &obj)]);
    let loaded = load(&folder, &ReadOptions::default());
    assert_eq!(
        warnings(&loaded, folder.path()),
        ["a.obj: material library `gone.mtl` is not found; its materials are the default"]
    );
    assert_eq!(loaded.geometry.material_runs.0, [[0, ABSENT]]);
}

#[test]
fn maps_are_found_and_named_by_content() {
    let obj =
        format!("mtllib sub/a.mtl\n{TRIANGLE}usemtl m\nf 1 2 3\nusemtl n\nf 1 2 3\nusemtl o\nf 1 2 3\n");
    let mtl = "newmtl m\nmap_Kd -s 2 2 1 wood grain.png -clamp on\nnewmtl n\nmap_Kd ..\\COPY.png \nnewmtl o\nmap_Bump no.png\nmap_d no.png\n";
    let folder =
        folder(&[("a.obj", &obj), ("sub/a.mtl", mtl), ("sub/wood grain.png", "wood"), ("copy.png", "wood")]);
    let loaded = load(&folder, &ReadOptions::default());
    let [m, o] = &loaded.geometry.materials[..] else { panic!("m and n are the same") };
    assert_eq!((m.maps.len(), m.maps[0].word.as_str()), (1, "map_Kd"));
    assert_eq!(m.maps[0].path.as_deref(), Some(folder.path().join("sub/wood grain.png").as_path()));
    assert!(m.maps[0].content.is_some());
    let words: Vec<_> = o.maps.iter().map(|map| (map.word.as_str(), map.content.is_some())).collect();
    assert_eq!(words, [("bump", false), ("map_d", false)]);
    assert_eq!(
        warnings(&loaded, folder.path()),
        [
            "sub/a.mtl: bump `no.png` is not found; the constant is used",
            "sub/a.mtl: map_d `no.png` is not found; the constant is used",
        ]
    );
    assert_eq!(loaded.inputs.len(), 4);
    // another content is another material
    let before = m.hash();
    fs::write(folder.path().join("sub/wood grain.png"), "oak").unwrap();
    assert_ne!(load(&folder, &ReadOptions::default()).geometry.materials[0].hash(), before);
}

#[test]
fn options_replace_materials_by_name() {
    let obj = format!("mtllib a.mtl\n{TRIANGLE}usemtl m\nf 1 2 3\nusemtl n\nf 1 2 3\n");
    let folder = folder(&[
        ("a.obj", &obj),
        ("a.mtl", "newmtl m\nKd 0.5\nd 0.5\nnewmtl n\nKd 0.25\n"),
        ("fixed.mtl", "newmtl m\nKd 1\n"),
    ]);
    let of = |options: &ReadOptions| -> Vec<_> {
        load(&folder, options).geometry.materials.iter().map(|m| (m.kd[0], m.d)).collect()
    };
    assert_eq!(of(&ReadOptions::default()), [(0.5, 0.5), (0.25, 1.0)]);
    let mut options =
        ReadOptions { materials_file: Some(folder.path().join("fixed.mtl")), ..ReadOptions::default() };
    assert_eq!(of(&options), [(1.0, 1.0), (0.25, 1.0)]);
    let word = |name: &str, word: &str, value: &str| MaterialOverride {
        name: name.into(),
        words: vec![(word.to_owned(), value.to_owned())],
    };
    options.material_overrides =
        vec![word("n", "d", "0.75"), word("n", "Kd", "0.125 0 0"), word("z", "d", "0")];
    assert_eq!(of(&options), [(1.0, 1.0), (0.125, 0.75)]);
    for (change, text) in [(word("n", "Kd", "red"), "`Kd red`"), (word("n", "Kx", "1"), "`Kx 1`")] {
        options.material_overrides = vec![change];
        let error = load_obj(&folder.path().join("a.obj"), &options).unwrap_err().to_string();
        assert!(error.contains("`n`") && error.contains(text), "{error}");
    }
    options = ReadOptions { materials_file: Some(folder.path().join("gone.mtl")), ..ReadOptions::default() };
    let error = load_obj(&folder.path().join("a.obj"), &options).unwrap_err().to_string();
    assert!(error.contains("gone.mtl: cannot be read"), "{error}");
}

#[test]
fn colours_may_be_srgb() {
    let obj = format!("mtllib a.mtl\n{TRIANGLE}usemtl m\nf 1 2 3\n");
    let folder = folder(&[("a.obj", &obj), ("a.mtl", "newmtl m\nKd 0.5\nd 0.5\n")]);
    let loaded = load(&folder, &ReadOptions { mtl_srgb: true, ..ReadOptions::default() });
    // ((0.5 + 0.055) / 1.055)^2.4 = 0.21404
    assert!((loaded.geometry.materials[0].kd[0] - 0.21404).abs() < 1e-5);
    assert_eq!(loaded.geometry.materials[0].d, 0.5);
}

#[test]
fn what_cannot_be_read_is_named() {
    let folder = folder(&[("a.obj", "")]);
    let error =
        |name: &str| load_obj(&folder.path().join(name), &ReadOptions::default()).unwrap_err().to_string();
    assert!(error("gone.obj").contains("gone.obj: cannot be read"));
    assert!(error(".").contains("is not a plain file"));
}
