//! Real OBJ files: what tobj reads, we read alike; what is broken is survived or refused by name and line.
//!
//! `RENTIX_SCENES` names the folder with the scenes; without it nothing is tested here, and that is said.

use rentix::format::{FormatError, Loaded, ReadOptions, TextureCache, scan_bounds};
use rentix::math::{Bounds, DVec3};
use rentix::scene::{ABSENT, Geometry};
use std::collections::HashMap;
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};

fn load_obj(path: &Path, options: &ReadOptions) -> Result<Loaded, FormatError> {
    rentix::format::load_obj(path, options, &TextureCache::default())
}

/// All OBJ files below a folder of the scenes, in order.
fn objs(below: &str) -> Vec<PathBuf> {
    let Some(scenes) = std::env::var_os("RENTIX_SCENES") else {
        println!("RENTIX_SCENES is not set: skipped");
        return Vec::new();
    };
    let mut folders = vec![PathBuf::from(scenes).join(below)];
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in folder.read_dir().unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj")) {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

/// Of long sequences every tenth frame, of all others every file.
fn sample() -> Vec<PathBuf> {
    let mut seen: HashMap<PathBuf, usize> = HashMap::new();
    let mut files = objs("");
    files.retain(|file| {
        let place = seen.entry(file.parent().unwrap().to_path_buf()).or_default();
        *place += 1;
        let sequence = file.parent().unwrap().file_name().unwrap().to_string_lossy().starts_with("seq-");
        !sequence || *place % 10 == 1
    });
    files
}

/// One triangle corner as both readers give it.
#[derive(Debug, PartialEq)]
struct Corner {
    position: [u32; 3],
    texcoord: Option<[u32; 2]>,
    normal: Option<[u32; 3]>,
}

fn bits<const N: usize>(values: [f32; N]) -> [u32; N] {
    values.map(f32::to_bits)
}

/// The corners of all polygons' fans, as tobj makes triangles, with attributes where our triangles are those fans.
fn our_corners(g: &Geometry) -> Vec<Corner> {
    let mut fans = Vec::new();
    let mut first = 0;
    for &count in &g.faces.counts {
        let corner = |k: u32| g.faces.corners[(first + k) as usize];
        fans.extend((1..count - 1).map(|k| [corner(0), corner(k), corner(k + 1)]));
        first += count;
    }
    assert_eq!(fans.len(), g.triangles.0.len());
    let mut corners = Vec::new();
    for (t, fan) in fans.iter().enumerate() {
        for (k, &position) in fan.iter().enumerate() {
            let same = g.triangles.0[t] == *fan;
            let texcoord = g.texcoords.as_ref().map_or(ABSENT, |a| a.corners.0[t][k]);
            let normal = g.normals.as_ref().map_or(ABSENT, |a| a.corners.0[t][k]);
            corners.push(Corner {
                position: bits(g.positions.0[position as usize]),
                texcoord: (same && texcoord != ABSENT)
                    .then(|| bits(g.texcoords.as_ref().unwrap().values.0[texcoord as usize])),
                normal: (same && normal != ABSENT)
                    .then(|| bits(g.normals.as_ref().unwrap().values.0[normal as usize])),
            });
        }
    }
    corners
}

fn tobj_corners(models: &[tobj::Model]) -> Vec<Corner> {
    let at = |values: &[f32], index: u32, k: usize| values[index as usize * 3 + k];
    let mut corners = Vec::new();
    for mesh in models.iter().map(|model| &model.mesh) {
        for (c, &position) in mesh.indices.iter().enumerate() {
            let texcoord = mesh.texcoord_indices.get(c).map(|&i| i as usize);
            corners.push(Corner {
                position: bits([0, 1, 2].map(|k| at(&mesh.positions, position, k))),
                texcoord: texcoord.map(|i| bits([mesh.texcoords[2 * i], mesh.texcoords[2 * i + 1]])),
                normal: mesh.normal_indices.get(c).map(|&i| bits([0, 1, 2].map(|k| at(&mesh.normals, i, k)))),
            });
        }
    }
    corners
}

/// The name that tobj gives each triangle's material, None where it has none.
fn tobj_materials(models: &[tobj::Model], materials: &[tobj::Material]) -> Vec<Option<String>> {
    let name = |mesh: &tobj::Mesh| mesh.material_id.map(|id| materials[id].name.clone());
    models.iter().flat_map(|m| vec![name(&m.mesh); m.mesh.indices.len() / 3]).collect()
}

fn our_slots(g: &Geometry) -> Vec<u32> {
    let ends = g.material_runs.0.iter().skip(1).map(|run| run[0]).chain([g.triangles.0.len() as u32]);
    g.material_runs
        .0
        .iter()
        .zip(ends)
        .flat_map(|(&[first, slot], end)| vec![slot; (end - first) as usize])
        .collect()
}

#[test]
fn what_tobj_reads_is_read_alike() {
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_lines: true,
        ignore_points: true,
        ..Default::default()
    };
    let (mut compared, mut with_materials) = (0, 0);
    let files = sample();
    for file in &files {
        // tobj fails on much that is legal, and panics on some
        let Ok(Ok((models, materials))) = catch_unwind(|| tobj::load_obj(file, &options)) else { continue };
        let Ok(ours) = load_obj(file, &ReadOptions::default()) else { continue };
        // tobj divides by w, which is a weight of curves; and it makes triangles of lines, also of those that call themselves faces
        let lines = |text: &str| text.contains("fewer than 3") || text.contains("points, lines");
        if file.ends_with("cube-vertex-w-component.obj")
            || ours.warnings.list().iter().any(|w| lines(&w.text))
        {
            continue;
        }
        let name = file.display();
        let (our, their) = (our_corners(&ours.geometry), tobj_corners(&models));
        assert_eq!(our.len(), their.len(), "{name}");
        for (our, their) in our.iter().zip(&their) {
            assert_eq!(our.position, their.position, "{name}");
            // a corner without an attribute has that of the corner before it there; ours may be derived, also in the
            // place of a normal without length
            for equal in [
                our.texcoord.is_none() || their.texcoord.is_none() || our.texcoord == their.texcoord,
                our.normal.is_none()
                    || their.normal.is_none_or(|n| n == [0; 3])
                    || our.normal == their.normal,
            ] {
                assert!(equal, "{name}: {our:?}, {their:?}");
            }
        }
        compared += 1;
        if let Ok(materials) = materials {
            let mut slot_of_name = HashMap::new();
            for (their, slot) in
                tobj_materials(&models, &materials).into_iter().zip(our_slots(&ours.geometry))
            {
                let Some(their) = their else { continue };
                assert_eq!(*slot_of_name.entry(their.clone()).or_insert(slot), slot, "{name}: {their}");
                assert_ne!(slot, ABSENT, "{name}: {their}");
            }
            with_materials += usize::from(!slot_of_name.is_empty());
        }
    }
    println!("{compared} of {} files compared, {with_materials} with materials", files.len());
    assert!(files.is_empty() || (compared > 250 && with_materials > 60), "{compared}, {with_materials}");
}

#[test]
fn the_box_is_that_of_all_positions() {
    for file in sample() {
        let Ok(loaded) = load_obj(&file, &ReadOptions { lenient: true, ..ReadOptions::default() }) else {
            assert!(scan_bounds(&file).is_err(), "{}", file.display());
            continue;
        };
        let mut expected = Bounds::EMPTY;
        for p in loaded.geometry.positions.0.iter().filter(|p| p.iter().all(|x| x.is_finite())) {
            expected.add(DVec3::from(p.map(f64::from)));
        }
        assert_eq!(scan_bounds(&file).unwrap(), expected, "{}", file.display());
    }
}

#[test]
fn torture_is_survived() {
    let refused = |lenient| -> Vec<String> {
        let options = ReadOptions { lenient, ..ReadOptions::default() };
        objs("torture")
            .iter()
            .filter_map(|file| load_obj(file, &options).err())
            .map(|e| e.to_string())
            .collect()
    };
    let files = objs("torture");
    if files.is_empty() {
        return;
    }
    assert!(files.len() > 150);
    let strict = refused(false);
    let expected = [
        "box_UTF16BE.obj:1: is UTF-16",
        "malformed.obj:23: position index 12 is beyond the file's 8 vertices",
        "elephav.obj:1: is a Git LFS pointer",
        "invalid-relative-texture-index.obj:2: position index 1 is beyond the file's 0 vertices",
        "invalid-relative-vertex-index.obj:1: position index -4 reaches back",
        "issue-140-zero-face-idx.obj:16: position index 0",
        "test-nan.obj:27: vertex 1 (line 12) is not three finite numbers",
        "invalid_index.obj:12: position index 7 is beyond the file's 6 vertices",
    ];
    for text in expected {
        assert!(strict.iter().any(|error| error.contains(text)), "{text}: {strict:#?}");
    }
    assert_eq!(strict.len(), expected.len(), "{strict:#?}");
    let lenient = refused(true);
    assert!(
        lenient.len() == 2 && lenient.iter().all(|e| e.contains("UTF-16") || e.contains("LFS")),
        "{lenient:#?}"
    );
}

#[test]
fn names_change_and_content_stays() {
    // each frame of these names its objects, materials and libraries anew
    let frames = objs("seq-xbot-dance");
    let Some([first, second]) = frames.first_chunk() else { return };
    let load = |path: &Path| load_obj(path, &ReadOptions::default()).unwrap().geometry;
    let (a, b) = (load(first), load(second));
    assert_ne!(a.positions, b.positions);
    assert_eq!(a.faces, b.faces);
    assert_eq!(a.material_runs, b.material_runs);
    assert_eq!(a.materials, b.materials);
    assert_eq!(a.meshes, b.meshes);
}
