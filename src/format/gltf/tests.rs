//! Whole files: made here, broken by chance, and the sample models where they are.

use super::*;
use std::fmt::Write;

/// A glTF of little-endian floats and bytes, view by view.
struct Maker {
    bytes: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Maker {
    fn new() -> Self {
        Self { bytes: Vec::new(), views: Vec::new(), accessors: Vec::new() }
    }

    /// An accessor of floats; its place.
    fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let width = ["SCALAR", "", "VEC3", "VEC4"].iter().position(|k| *k == kind).map_or(16, |k| k + 1);
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.view(&bytes, values.len() / width, kind, 5126)
    }

    /// An accessor of bytes; its place.
    fn view(&mut self, bytes: &[u8], count: usize, kind: &str, component: u32) -> usize {
        let at = self.bytes.len();
        self.views.push(format!(r#"{{"buffer":0,"byteOffset":{at},"byteLength":{}}}"#, bytes.len()));
        let view = self.views.len() - 1;
        self.accessors.push(format!(
            r#"{{"bufferView":{view},"count":{count},"type":"{kind}","componentType":{component}}}"#
        ));
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.accessors.len() - 1
    }

    fn glb(&self, rest: &str) -> Vec<u8> {
        let mut json = format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{}}}],"bufferViews":[{}],"accessors":[{}],{rest}}}"#,
            self.bytes.len(),
            self.views.join(","),
            self.accessors.join(",")
        );
        while json.len() % 4 != 0 {
            json.push(' ');
        }
        let mut glb = b"glTF\x02\0\0\0".to_vec();
        glb.extend((28 + json.len() as u32 + self.bytes.len() as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", json.as_bytes()), (b"BIN\0", &self.bytes)] {
            glb.extend((chunk.len() as u32).to_le_bytes());
            glb.extend(kind);
            glb.extend(chunk);
        }
        glb
    }
}

fn open(bytes: &[u8]) -> Result<Gltf, String> {
    Gltf::from_bytes(bytes, Path::new("x.glb"), &GltfOptions::default()).map_err(|e| e.to_string())
}

const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// Two nodes show one triangle, one of them moves; a third is bent by two joints and has a morph target.
fn figure() -> Vec<u8> {
    let mut maker = Maker::new();
    let positions = maker.floats("VEC3", &TRIANGLE);
    let target = maker.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0]);
    let joints = maker.view(&[0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0], 3, "VEC4", 5121);
    let weights = maker.floats("VEC4", &[1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    let times = maker.floats("SCALAR", &[0.0, 2.0]);
    let moves = maker.floats("VEC3", &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
    let weighs = maker.floats("SCALAR", &[0.0, 1.0]);
    let indices = maker.view(&[0, 1, 2], 3, "SCALAR", 5121);
    maker.glb(&format!(
        r#""scenes":[{{"nodes":[0,1,2,3]}}],
        "nodes":[{{"mesh":0}},{{"mesh":0,"name":"mover"}},{{"mesh":1,"skin":0,"translation":[9,9,9]}},
            {{"children":[4],"name":"hip"}},{{"translation":[0,1,0]}}],
        "skins":[{{"joints":[3,4]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":{positions}}},"indices":{indices}}}]}},
            {{"primitives":[{{"attributes":{{"POSITION":{positions},"JOINTS_0":{joints},"WEIGHTS_0":{weights}}},
                "targets":[{{"POSITION":{target}}}]}}]}}],
        "animations":[{{"name":"go","channels":[
            {{"sampler":0,"target":{{"node":1,"path":"translation"}}}},
            {{"sampler":0,"target":{{"node":4,"path":"translation"}}}},
            {{"sampler":1,"target":{{"node":2,"path":"weights"}}}}],
          "samplers":[{{"input":{times},"output":{moves}}},{{"input":{times},"output":{weighs}}}]}}]"#
    ))
}

#[test]
fn what_moves_and_what_is_shared() {
    let gltf = open(&figure()).unwrap();
    assert!(gltf.warnings.is_empty(), "{:?}", gltf.warnings.list());
    assert_eq!(gltf.content.clips.iter().map(|clip| &clip.name[..]).collect::<Vec<_>>(), ["go"]);
    assert_eq!(duration_s(&gltf, &ClipChoice::Auto), 2.0);
    let [first, second] = [0.0, 1.0].map(|t| gltf.frame(t, &ClipChoice::Auto).unwrap().objects);
    assert_eq!(first.len(), 3);
    // a mesh of two nodes is one, and stays what it is; the one that stands has no place
    assert!(Arc::ptr_eq(&first[0].geometry, &first[1].geometry));
    assert!(Arc::ptr_eq(&first[1].geometry, &second[1].geometry));
    assert_eq!(first[0].transform, None);
    assert_eq!(second[1].transform, Some(DAffine3::from_translation(DVec3::new(2.0, 0.0, 0.0))));
    // the skinned one is in the world: its node's place does not count. At 1 s joint 1 is at (2, 0, 0), half of vertex
    // 1 and all of vertex 2, which the target lifts by half of 2
    let (a, b) = (&first[2], &second[2]);
    assert_eq!((a.transform, b.transform), (None, None));
    assert_eq!(a.geometry.positions.0, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(b.geometry.positions.0, [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 1.0]]);
    assert_eq!(a.geometry.triangles.hash(), b.geometry.triangles.hash());
    let again = gltf.frame(1.0, &ClipChoice::Auto).unwrap().objects;
    assert!(Arc::ptr_eq(&again[2].geometry, &b.geometry));
    // beyond the last key it stands
    let late = gltf.frame(99.0, &ClipChoice::Auto).unwrap().objects;
    assert_eq!(late[1].transform.unwrap().translation.x, 4.0);
    let bounds = gltf.bounds(2.0, &ClipChoice::Auto).unwrap();
    assert_eq!((bounds.min, bounds.max), (DVec3::ZERO, DVec3::new(5.0, 1.0, 2.0)));
}

#[test]
fn what_cannot_be_read_says_why() {
    let error = |bytes: &[u8]| open(bytes).unwrap_err();
    let json = |rest: &str| error(format!(r#"{{"asset":{{"version":"2.0"}},{rest}}}"#).as_bytes());
    for (got, wanted) in [
        (error(b""), "is empty"),
        (error(b"glTF"), "ends within its header"),
        (error(b"glTF\x01\0\0\0\x14\0\0\0"), "version 1"),
        (error(&figure()[..200]), "shorter than it says"),
        (error(b"{}"), "JSON"),
        (error(br#"{"asset":{"version":"1.0"}}"#), "version 1.0"),
        (error(b"version https://git-lfs.github.com/spec/v1"), "git lfs pull"),
        (json(r#""extensionsRequired":["KHR_draco_mesh_compression"]"#), "KHR_draco_mesh_compression"),
        (json(r#""nodes":[{"mesh":3}]"#), "mesh 3"),
        (json(r#""buffers":[{"byteLength":4}]"#), "buffer 0"),
        (json(r#""buffers":[{"byteLength":4,"uri":"data:,abc"}]"#), "3 bytes, 4"),
        (json(r#""buffers":[{"byteLength":4,"uri":"absent.bin"}]"#), "absent.bin"),
    ] {
        assert!(got.contains(wanted), "{got}, not {wanted}");
    }
    let mut maker = Maker::new();
    let positions = maker.floats("VEC3", &TRIANGLE);
    let indices = maker.view(&[0, 1, 3], 3, "SCALAR", 5121);
    let mesh = |attributes: &str| {
        error(&maker.glb(&format!(
            r#""nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":{positions}}}{attributes}}}]}}]"#
        )))
    };
    assert!(mesh(&format!(r#","indices":{indices}"#)).contains("vertex 3 of 3"));
    assert!(mesh(r#","indices":0"#).contains("no list of indices"));
    assert!(mesh(r#","indices":77"#).contains("accessor 77"));
    assert!(mesh(r#","material":5"#).contains("material 5"));
}

#[test]
fn colours_and_points_and_what_is_left_out() {
    let mut maker = Maker::new();
    let positions = maker.floats("VEC3", &TRIANGLE);
    let colors = maker.view(&[255, 0, 55, 0, 255, 0, 55, 0, 255, 0, 55, 0], 3, "VEC4", 5121);
    maker.accessors[colors] = maker.accessors[colors].replace('}', r#","normalized":true}"#);
    let mut primitives = String::new();
    for rest in ["", r#","material":0"#, r#","mode":0"#] {
        let comma = if primitives.is_empty() { "" } else { "," };
        write!(primitives, r#"{comma}{{"attributes":{{"POSITION":{positions},"COLOR_0":{colors}}}{rest}}}"#)
            .unwrap();
    }
    let bytes = maker.glb(&format!(
        r#""materials":[{{}}],"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{primitives}]}}],
        "extensionsUsed":["KHR_materials_sheen"]"#
    ));
    let gltf = open(&bytes).unwrap();
    let said: Vec<String> = gltf.warnings.list().iter().map(|w| w.text.clone()).collect();
    assert_eq!(said.len(), 3, "{said:?}");
    let objects = gltf.frame(0.0, &ClipChoice::Auto).unwrap().objects;
    let g = &objects[0].geometry;
    assert_eq!(
        (g.triangles.0.len(), g.material_runs.0.as_slice()),
        (2, &[[0, crate::scene::ABSENT], [1, 0]][..])
    );
    let colors = &g.colors.as_ref().unwrap().0;
    // 55/255 in linear light is 0.2157 there, 0.5019 on the curve
    assert!(colors[0][0] == 1.0 && (colors[0][2] - 0.5019).abs() < 1e-3 && colors[3][0].is_nan());
}

/// Pseudo-random numbers (xorshift).
fn random(state: &mut u64) -> u64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    *state
}

/// Opens what may be broken and shows it; whatever happens must be a value.
fn survives(bytes: &[u8]) -> bool {
    let options = GltfOptions {
        texture_limit_bytes: Some(1 << 26),
        smooth_angle_deg: Some(30.0),
        ..GltfOptions::default()
    };
    let Ok(gltf) = Gltf::from_bytes(bytes, Path::new("/nowhere/x.glb"), &options) else { return false };
    let mut shown = false;
    for time_s in [0.0, 0.7, f64::NAN, -1e300] {
        shown |= gltf.frame(time_s, &ClipChoice::All).is_ok();
    }
    shown
}

/// Changes bytes, numbers in the JSON, or lengths.
fn mutated(bytes: &[u8], state: &mut u64) -> Vec<u8> {
    let mut changed = bytes.to_vec();
    for _ in 0..=random(state) % 4 {
        let at = random(state) as usize % changed.len();
        match random(state) % 5 {
            0 => changed[at] = random(state) as u8,
            1 => changed[at] ^= 1 << (random(state) % 8),
            2 => {
                // a digit of the JSON
                let end = changed.len().min(at + 4096);
                if let Some(digit) = changed[at..end].iter().position(u8::is_ascii_digit) {
                    changed[at + digit] = b'0' + (random(state) % 10) as u8;
                }
            }
            3 => {
                let words = [0u32, 1, 0x7fff_ffff, 0xffff_ffff, 0x7f80_0000, 0x7fc0_0000, 5126];
                let word = words[random(state) as usize % words.len()].to_le_bytes();
                let at = at & !3;
                if let Some(place) = changed.get_mut(at..at + 4) {
                    place.copy_from_slice(&word);
                }
            }
            _ => {
                let other = random(state) as usize % changed.len();
                changed.swap(at, other);
            }
        }
    }
    if random(state).is_multiple_of(20) {
        changed.truncate(random(state) as usize % changed.len());
        if let (true, length) = (changed.len() >= 12, changed.len() as u32) {
            changed[8..12].copy_from_slice(&length.to_le_bytes());
        }
    }
    changed
}

#[test]
fn broken_files_end_as_values() {
    let mut state = 0x9e37_79b9_7f4a_7c15;
    let figure = figure();
    let shown = (0..4000).filter(|_| survives(&mutated(&figure, &mut state))).count();
    assert!(
        (200..4000).contains(&shown),
        "{shown} of 4000 were shown: the changes are too small or too large"
    );
    for name in ["InterpolationTest", "RiggedSimple", "AnimatedMorphCube", "AlphaBlendModeTest"] {
        let Some(path) = model(name) else { continue };
        let bytes = std::fs::read(&path).unwrap();
        for _ in 0..if bytes.len() > 500_000 { 50 } else { 250 } {
            survives(&mutated(&bytes, &mut state));
        }
    }
}

fn duration_s(gltf: &Gltf, choice: &ClipChoice) -> f64 {
    clip::duration_s(&gltf.content.clips, &gltf.chosen(choice).unwrap())
}

/// A sample model; None where they are not there.
fn model(name: &str) -> Option<PathBuf> {
    models().into_iter().find(|path| path.parent().is_some_and(|folder| folder.ends_with(name)))
}

/// All sample models, in order of their names.
fn models() -> Vec<PathBuf> {
    let Some(folder) = std::env::var_os("RENTIX_SCENES").map(|f| Path::new(&f).join("gltf")) else {
        return Vec::new();
    };
    let entries = |folder: &Path| std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path());
    let is_gltf = |path: &PathBuf| path.extension().is_some_and(|e| e == "glb" || e == "gltf");
    let mut found: Vec<PathBuf> =
        entries(&folder).flat_map(|f| entries(&f).filter(is_gltf).collect::<Vec<_>>()).collect();
    found.sort();
    found
}

#[test]
fn the_sample_models_are_shown() {
    let models = models();
    if models.is_empty() {
        eprintln!("skipped: RENTIX_SCENES names no folder with gltf/");
        return;
    }
    for path in &models {
        let gltf = Gltf::open(path, &GltfOptions::default()).unwrap();
        for choice in [ClipChoice::Auto, ClipChoice::All] {
            let duration_s = duration_s(&gltf, &choice);
            for k in 0..10 {
                let frame = gltf.frame(f64::from(k) / 9.0 * duration_s, &choice).unwrap();
                assert!(
                    frame.objects.iter().any(|o| !o.geometry.triangles.0.is_empty()),
                    "{}",
                    path.display()
                );
            }
        }
        for warning in gltf.warnings.list() {
            eprintln!("{warning}");
        }
        assert!(gltf.missing.is_empty());
    }
}
