//! Materials and the files they name: found however they are written, the same by content whatever their names.

use rentix::format::{FormatError, Loaded, MaterialOverride, ReadOptions, TextureCache};
use rentix::scene::{ABSENT, Channel, Material, Part, TexelSpace, Texels, Texture};
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

fn load_obj(path: &Path, options: &ReadOptions) -> Result<Loaded, FormatError> {
    rentix::format::load_obj(path, options, &TextureCache::default())
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
    assert_eq!((m.ni, m.tf, m.tf_given, m.halo), (1.5, [1.0; 3], false, false));
    let m = material("newmtl m\nKt 0.1 0.2 0.3\nd -halo 0.25\nNi 0\n");
    assert_eq!((m.ni, m.tf, m.tf_given, m.halo, m.d), (1.0, [0.1, 0.2, 0.3], true, true, 0.25));
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
        ["a.obj:1: material library `gone.mtl` is not found; its materials are the default"]
    );
    assert_eq!(
        loaded.missing,
        [format!(
            "{}/a.obj:1: material library `gone.mtl` is not found; its materials are the default",
            folder.path().display()
        )]
    );
    assert_eq!(loaded.geometry.material_runs.0, [[0, ABSENT]]);
}

/// An ASCII picture of one texel.
fn texel(r: u8, g: u8, b: u8) -> String {
    format!("P3\n1 1\n255\n{r} {g} {b}\n")
}

fn texels(texture: &Part<Texture>) -> Vec<[u8; 4]> {
    match &texture.texels {
        Texels::U8(texels) => texels.clone(),
        Texels::F32(_) => panic!("bytes are kept as they are"),
    }
}

#[test]
fn maps_are_found_and_named_by_content() {
    let obj =
        format!("mtllib sub/a.mtl\n{TRIANGLE}usemtl m\nf 1 2 3\nusemtl n\nf 1 2 3\nusemtl o\nf 1 2 3\n");
    let mtl = "newmtl m\nmap_Kd -s 2 2 1 wood grain.ppm -clamp on\nnewmtl n\nmap_Kd -clamp on -s 2 2 ..\\COPY.ppm \nnewmtl o\nmap_Bump no.png\nmap_d no.png\n";
    let (wood, oak) = (texel(90, 60, 30), texel(120, 60, 30));
    let folder =
        folder(&[("a.obj", &obj), ("sub/a.mtl", mtl), ("sub/wood grain.ppm", &wood), ("copy.ppm", &wood)]);
    let loaded = load(&folder, &ReadOptions::default());
    let [m, o] = &loaded.geometry.materials[..] else { panic!("m and n are the same") };
    let map = m.textures.map_kd.as_ref().unwrap();
    assert_eq!((map.scale, map.clamp), ([2.0, 2.0], true));
    assert_eq!((texels(&map.texture), map.texture.space), (vec![[90, 60, 30, 255]], TexelSpace::Srgb));
    assert!(o.textures.slots().iter().all(Option::is_none));
    assert_eq!(
        warnings(&loaded, folder.path()),
        [
            "sub/a.mtl: bump `no.png` is not found; the constant is used",
            "sub/a.mtl: map_d `no.png` is not found; the constant is used",
        ]
    );
    assert_eq!((loaded.inputs.len(), loaded.missing.len()), (4, 2));
    // another content is another material
    let before = m.hash();
    fs::write(folder.path().join("sub/wood grain.ppm"), oak).unwrap();
    assert_ne!(load(&folder, &ReadOptions::default()).geometry.materials[0].hash(), before);
}

#[test]
fn one_file_is_colour_for_one_map_and_data_for_another() {
    let obj = format!("mtllib a.mtl\n{TRIANGLE}usemtl m\nf 1 2 3\nusemtl n\nf 1 2 3\n");
    let mtl = "newmtl m\nmap_Kd a.ppm\nmap_d -imfchan g a.ppm\nnewmtl n\nbump -bm 2 a.ppm\nmap_Ka a.ppm\n";
    let folder = folder(&[("a.obj", &obj), ("a.mtl", mtl), ("a.ppm", &texel(1, 2, 3))]);
    let loaded = load(&folder, &ReadOptions::default());
    let [m, n] = &loaded.geometry.materials[..] else { panic!("two materials") };
    let (kd, d) = (m.textures.map_kd.as_ref().unwrap(), m.textures.map_d.as_ref().unwrap());
    let (ka, bump) = (n.textures.map_ka.as_ref().unwrap(), n.textures.bump.as_ref().unwrap());
    assert_eq!((kd.texture.space, d.texture.space), (TexelSpace::Srgb, TexelSpace::Linear));
    assert_eq!((d.channel, bump.bump_multiplier), (Some(Channel::G), 2.0));
    assert!(kd.texture == ka.texture && d.texture == bump.texture && d.texture != kd.texture);
    assert_eq!(loaded.inputs.len(), 3);
    // each of the textures is one part, however often it is used
    let parts = loaded.geometry.parts();
    let count = |texture: &Part<Texture>| parts.iter().filter(|(hash, _)| *hash == texture.hash()).count();
    assert_eq!((count(&kd.texture), count(&d.texture)), (1, 1));
    assert_eq!(n.ka, [1.0; 3], "what has a map is 1 where it is absent");
}

#[test]
fn a_texture_is_decoded_once_for_frames_that_follow_one_another() {
    let obj = format!("mtllib a.mtl\n{TRIANGLE}usemtl m\nf 1 2 3\n");
    let picture = texel(1, 2, 3);
    let folder = folder(&[
        ("a.obj", obj.as_str()),
        ("plain.obj", TRIANGLE),
        ("a.mtl", "newmtl m\nmap_Kd a.ppm\n"),
        ("a.ppm", &picture),
    ]);
    let cache = TextureCache::default();
    let read = |name: &str| {
        let path = folder.path().join(name);
        rentix::format::load_obj(&path, &ReadOptions::default(), &cache).unwrap()
    };
    let (cold, warm) = (read("a.obj"), read("a.obj"));
    assert_eq!(cold.bytes_read - warm.bytes_read, picture.len() as u64);
    assert_eq!((cold.inputs, cold.geometry), (warm.inputs, warm.geometry));
    // after many frames without it, it is read again
    for _ in 0..20 {
        read("plain.obj");
    }
    assert_eq!(read("a.obj").bytes_read, cold.bytes_read);
}

#[test]
fn a_material_that_no_library_has_is_missing() {
    let obj = format!("mtllib a.mtl\n{TRIANGLE}usemtl m\nf 1 2 3\nusemtl n\nf 1 2 3\n");
    let folder = folder(&[("a.obj", &obj), ("a.mtl", "newmtl m\nd 0\n")]);
    let loaded = load(&folder, &ReadOptions::default());
    let told = ["a.obj:7: material `n` is in no library; its faces get the default"];
    assert_eq!(warnings(&loaded, folder.path()), told);
    assert_eq!(loaded.missing, told.map(|told| format!("{}/{told}", folder.path().display())));
    let of_job = MaterialOverride { name: b"n".to_vec(), words: Vec::new(), said_in: "job.yaml".into() };
    let options = ReadOptions { material_overrides: vec![of_job], ..ReadOptions::default() };
    assert!(load(&folder, &options).missing.is_empty(), "the job says what it is");
}

#[test]
fn what_is_odd_is_said_once() {
    let obj = format!("mtllib a.mtl\n{TRIANGLE}usemtl m\nf 1 2 3\nusemtl n\nf 1 2 3\n");
    let mtl = "newmtl m\nNi 0\nKd 0 0 0\nmap_Kd -t 1 1 1 a.ppm\nPr 0.5\nTf xyz 1 1 1\ndisp a.ppm\nnewmtl n\nNi -1\nPr 1\nmap_Kd b.ppm\nrefl c.tga\n";
    let folder = folder(&[
        ("a.obj", obj.as_str()),
        ("a.mtl", mtl),
        ("a.ppm", &texel(1, 2, 3)),
        ("b.ppm", "P3 1 1 255 1 2"),
        ("c.tga", ""),
    ]);
    let loaded = load(&folder, &ReadOptions::default());
    let told = warnings(&loaded, folder.path());
    assert_eq!(told.len(), 6, "{told:#?}");
    assert_eq!(told[0], "a.mtl: Kd 0 0 0 beside map_Kd counts as 1 1 1, else the map would not be seen");
    assert_eq!(told[1], "a.mtl: Ni of 0 or less counts as 1 (2 times)");
    assert!(told[2].starts_with("a.mtl: map_Kd b.ppm: is broken: "), "{told:#?}");
    assert_eq!(told[3], "a.mtl: refl c.tga: is empty; the constant is used");
    assert_eq!(told[4], "a.mtl:6: statements whose value is not understood are skipped, the first is `Tf`");
    assert_eq!(told[5], "a.mtl:4: without effect on the picture: -t, Pr, disp (4 times)");
    assert_eq!(loaded.missing.len(), 2, "a broken texture is missing, too");
}

#[test]
fn the_job_names_files_relative_to_itself() {
    let obj = format!("mtllib a.mtl\n{TRIANGLE}usemtl m\nf 1 2 3\n");
    let folder = folder(&[
        ("a.obj", obj.as_str()),
        ("a.mtl", "newmtl m\nd 1\nmap_Kd a.ppm\n"),
        ("a.ppm", &texel(1, 2, 3)),
        ("jobs/a.ppm", &texel(4, 5, 6)),
    ]);
    let words = [("map_Kd", "-s 2 a.ppm"), ("Tr", "0.75"), ("Tf", "1 1 1")];
    let options = ReadOptions {
        material_overrides: vec![MaterialOverride {
            name: b"m".to_vec(),
            words: words.map(|(word, value)| (word.to_owned(), value.to_owned())).to_vec(),
            said_in: folder.path().join("jobs/a.yaml"),
        }],
        ..ReadOptions::default()
    };
    let m = &load(&folder, &options).geometry.materials[0];
    let map = m.textures.map_kd.as_ref().unwrap();
    assert_eq!((texels(&map.texture), map.scale), (vec![[4, 5, 6, 255]], [2.0, 1.0]));
    assert_eq!((m.d, m.tf_given), (0.25, true));
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
        said_in: folder.path().join("job.yaml"),
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
