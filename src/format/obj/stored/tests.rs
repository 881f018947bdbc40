use super::*;
use crate::format::obj::{Parsed, again::scan_again};
use crate::format::text::{Text, digest_of};
use crate::format::{TextureCache, load_obj, load_obj_stored};
use crate::scene::Material;
use std::fs;

/// Triangles and polygons, all kinds of attributes, what is dropped, what is warned of.
const TEXTS: [&str; 7] = [
    "",
    "v 0 0 0\nv 1.5 0 0\nv 0.25 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\n",
    "mtllib no.mtl\nmtllib a b.mtl\no A\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 .5 .7\nvt 0 0\nvt 1 0\nvt .5 1\nvn 0 0 1\nvn .7 0 .7\n\
     usemtl red\nf 1/1/1 2/2/1 3/3/1 4/1/2\no B\nf 2/2/2 5/3/2 3/1/1\nusemtl blue\nusemtl red\nf 1/1/2 2/2/2 5/3/2\nusemtl last\n",
    "v 0 0 0\nv 2 1 0\nv 4 0 0\nv 2 4 0\nv 1 2 .1\nvn 0 0 1\ns 1\nf 1 2 3 4\nf 1//1 2 3 4 5\ns 2\nf 1 2 5\ns off\nf 5 4 1\n",
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv .1 .2 .3 .5 .5 .5\nf 1 2 3\nf 1 2 4\n",
    "ny 1\nv 0 0 0\nv nan 0 0\nv 1 0 0\nv 0 1 0\nl 1 2\nf 1 2\nf 1 3 4\nf 4/9 3/9 1/9\n",
    "vt 0 0\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf -3/-1/-1 -2/-1/-1 -1/-1/-1\nvt 1 1\nf 1/2/1 2 3\n",
];

fn options() -> [ReadOptions; 3] {
    [
        ReadOptions::default(),
        ReadOptions { lenient: true, ..ReadOptions::default() },
        ReadOptions { smooth_angle_deg: Some(60.0), ..ReadOptions::default() },
    ]
}

#[test]
fn what_comes_from_the_store_is_what_is_parsed() {
    let t = tempfile::tempdir().unwrap();
    let path = t.path().join("a.obj");
    let store = Store::new(&t.path().join("store"), 1 << 30);
    let textures = TextureCache::default();
    for (text, options) in TEXTS.iter().flat_map(|text| options().map(|options| (text, options))) {
        fs::write(&path, text).unwrap();
        let parsed = load_obj(&path, &options, &textures);
        let known = |parsed: &Option<Parsed>| format!("{:?}", parsed.as_ref().map(|p| (&p.known, &p.bytes)));
        let mut first = None;
        for (round, is_followed) in [(0, false), (1, false), (0, true), (1, true)] {
            let entries = store.stat().entries;
            let (loaded, next) = match load_obj_stored(&store, is_followed, &path, &options, &textures) {
                Ok(loaded) => loaded,
                Err(error) => {
                    assert_eq!(error.to_string(), parsed.as_ref().unwrap_err().to_string());
                    continue;
                }
            };
            let wanted = parsed.as_ref().unwrap();
            assert_eq!(store.stat().entries - entries, 1 - round, "{text}");
            assert_eq!(format!("{:?}", loaded.geometry), format!("{:?}", wanted.geometry), "{text}");
            assert_eq!(loaded.geometry.hash(), wanted.geometry.hash());
            assert_eq!(loaded.warnings.list(), wanted.warnings.list(), "{text}");
            assert_eq!(
                (&loaded.missing, &loaded.inputs, &loaded.material_names, loaded.bytes_read),
                (&wanted.missing, &wanted.inputs, &wanted.material_names, wanted.bytes_read)
            );
            match is_followed {
                false if round == 1 => assert!(next.is_none()),
                false => {}
                true => {
                    let first = first.get_or_insert_with(|| known(&next));
                    assert_eq!(known(&next), *first, "{text}");
                }
            }
        }
    }
}

/// What would be wrong with a checksum that is right.
#[test]
fn no_byte_of_an_entry_can_do_harm() {
    let t = tempfile::tempdir().unwrap();
    let path = t.path().join("a.obj");
    let store = Store::new(&t.path().join("store"), 1 << 30);
    let textures = TextureCache::default();
    let material = |kd| Part::new(Material { kd: [kd; 3], ..Material::default() });
    let library: Library =
        [(b"red".to_vec(), material(0.1)), (b"blue".to_vec(), material(0.2))].into_iter().collect();
    let options = ReadOptions { lenient: true, ..ReadOptions::default() };
    let (mut taken, mut refused) = (0, 0);
    for text in TEXTS {
        fs::write(&path, text).unwrap();
        load_obj_stored(&store, true, &path, &options, &textures).unwrap();
        let whole = store.get(KIND, key(digest_of(text.as_bytes()), true, &options), Payload::rest::<u8>);
        let whole = whole.unwrap();
        for (at, change) in
            (0..whole.len()).flat_map(|at| [0x01, 0x02, 0x80, 0xFF].map(|change| (at, change)))
        {
            let mut changed = whole.clone();
            changed[at] ^= change;
            store.put(KIND, Key(1), &[&changed]);
            let Some(stored) = get(&store, Key(1), text.len() as u64) else {
                refused += 1;
                continue;
            };
            taken += 1;
            let mut warnings = stored.warnings(&path);
            let shape = stored.into_shape(&library, &path, &|_, _| None, &mut warnings);
            let (geometry, _, next) = shape.keep(Some(text.as_bytes().to_vec()));
            assert!(
                geometry
                    .triangles
                    .0
                    .as_flattened()
                    .iter()
                    .all(|&i| (i as usize) < geometry.positions.0.len())
            );
            if let Some(next) = next {
                let text = Text::new(text.as_bytes(), &path).unwrap();
                let _ = scan_again(&text.joined, &next);
                if let Ok(lines) = Lines::new(&text, &path, true, Some(&next), &mut warnings) {
                    let _ = lines.into_shape(&library, &options, &mut warnings);
                }
            }
        }
    }
    assert!(taken > 1000 && refused > 1000, "{taken} taken, {refused} refused");
    assert!(store.take_notes().is_empty());
}
