//! No bytes do harm: files that are read by programs, changed at random. `RENTIX_FUZZ_CASES=1000000 cargo test --release
//! --test fuzz` takes its time; a case is told by its number, and the same in every run.

use rentix::format::{Library, ReadOptions, TextureCache, load_obj, load_picture, parse_obj};
use rentix::job::{Request, resolve};
use rentix::scene::{ABSENT, Geometry, Texels};
use rentix::warning::Warnings;
use std::fs;
use std::path::{Path, PathBuf};

/// Cases of each kind.
fn cases() -> u64 {
    std::env::var("RENTIX_FUZZ_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(2_000)
}

/// Steele, Lea and Flood 2014, "Fast splittable pseudorandom number generators": `SplitMix64`.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }

    fn of<'a, T>(&mut self, list: &'a [T]) -> &'a T {
        &list[self.below(list.len())]
    }
}

/// One of the files, changed in a few places.
fn changed(random: &mut Random, files: &[Vec<u8>], words: &[&[u8]]) -> Vec<u8> {
    let mut bytes = random.of(files).clone();
    for _ in 0..=random.below(6) {
        let at = random.below(bytes.len() + 1);
        let end = (at + random.below(40)).min(bytes.len());
        match random.below(8) {
            0 => bytes.truncate(at),
            1 => drop(bytes.drain(at..end)),
            2 => drop(bytes.splice(at..at, bytes[at..end].to_vec())),
            3 => {
                let other = random.of(files);
                let from = random.below(other.len());
                bytes.splice(at.., other[from..].to_vec());
            }
            4 | 5 => drop(bytes.splice(at..end.min(at + 4), random.of(words).to_vec())),
            _ => {
                let any = random.next() as u8;
                if let Some(byte) = bytes.get_mut(at) {
                    *byte = *random.of(&[0, 1, 0x7f, 0x80, 0xff, b' ', b'\n', any]);
                }
            }
        }
        bytes.truncate(1 << 16);
    }
    bytes
}

/// Calls `check` with each case; a panic names it.
fn for_each_case(files: &[Vec<u8>], words: &[&[u8]], check: impl Fn(&[u8]) + Sync) {
    let threads = std::thread::available_parallelism().map_or(1, usize::from) as u64;
    std::thread::scope(|scope| {
        for thread in 0..threads {
            let check = &check;
            scope.spawn(move || {
                for case in (thread..cases()).step_by(threads as usize) {
                    let bytes = changed(&mut Random(case), files, words);
                    let checked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| check(&bytes)));
                    assert!(checked.is_ok(), "case {case}: {:?}", String::from_utf8_lossy(&bytes));
                }
            });
        }
    });
}

/// What devices count on.
fn assert_sound(geometry: &Geometry) {
    let positions = &geometry.positions.0;
    let used = geometry.triangles.0.as_flattened().iter().map(|&i| positions[i as usize]);
    assert!(used.flatten().all(f32::is_finite));
    let corners: u32 = geometry.faces.counts.iter().sum();
    assert_eq!(corners as usize, geometry.faces.corners.len());
    assert_eq!(corners as usize - 2 * geometry.faces.counts.len(), geometry.triangles.0.len());
    let within = |indices: &[[u32; 3]], count: usize| {
        indices.len() == geometry.triangles.0.len()
            && indices.as_flattened().iter().all(|&i| i == ABSENT || (i as usize) < count)
    };
    assert!(geometry.texcoords.as_ref().is_none_or(|a| within(&a.corners.0, a.values.0.len())));
    assert!(geometry.normals.as_ref().is_none_or(|a| within(&a.corners.0, a.values.0.len())));
    assert!(geometry.material_runs.0.iter().all(|run| {
        run[0] < geometry.triangles.0.len() as u32
            && (run[1] == ABSENT || (run[1] as usize) < geometry.materials.len())
    }));
    let of_meshes: u32 = geometry.meshes.iter().map(|mesh| mesh.triangle_count).sum();
    assert_eq!(of_meshes as usize, geometry.triangles.0.len());
}

const NUMBERS: [&[u8]; 14] = [
    b"nan",
    b"-inf",
    b"1e39",
    b"1e-46",
    b"-0",
    b"4294967295",
    b"18446744073709551616",
    b"-1",
    b"0",
    b".",
    b"1e",
    b"3.",
    b"99999999999999999999999999999999999999999",
    b"\\\n",
];

#[test]
fn objs() {
    let files = [
        &b"mtllib a.mtl\no a\nv 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0.5\nvt 0 0\nvt 1 0 0\nvn 0 0 1\ns 1\nusemtl m\nf 1/1/1 2/2/1 3//1\nf -1 -2 -3 -4\ng b\ns off\nf 1 2 4\n"[..],
        b"v 0 0 0\r\nv 2 0 0\r\nv 2 2 0\r\nv 1 0.5 0\r\nv 0 2 0\r\nf 1 2 3 4 5\r\nl 1 2\r\np 1\r\nvp 1\r\nf 5 4 3 2 1 \\\r\n 2\r\n# end",
    ]
    .map(<[u8]>::to_vec);
    let words =
        [&NUMBERS[..], &[b"f ", b"v ", b"vt ", b"vn ", b"o ", b"s ", b"usemtl ", b"/", b"//", b"\r", b" # "]]
            .concat();
    for_each_case(&files, &words, |bytes| {
        for lenient in [false, true] {
            let options = ReadOptions { lenient, smooth_angle_deg: None, ..ReadOptions::default() };
            let mut warnings = Warnings::default();
            match parse_obj(bytes, Path::new("a.obj"), &Library::default(), &options, &mut warnings) {
                Ok(parsed) => assert_sound(&parsed.geometry),
                Err(error) => assert!(error.to_string().starts_with("a.obj:"), "{error}"),
            }
        }
    });
}

/// A folder of each thread's own.
fn folder(root: &Path) -> PathBuf {
    let folder = root.join(format!("{:?}", std::thread::current().id()));
    fs::create_dir_all(&folder).unwrap();
    folder
}

#[test]
fn mtls() {
    let files = [
        &b"newmtl m\nKa 0.1 0.2 0.3\nKd 0.5\nKs 1 1 1\nKe 0 0 0\nTf 1 1 1\nNs 10\nNi 1.5\nd 0.5\nTr 0.5\nillum 7\nmap_Kd -s 2 2 1 -o 0.5 0 0 a.pgm\nbump -bm 0.5 a.pgm -clamp on\n"[..],
        b"newmtl m\r\nd -halo 0.5\r\nmap_d -imfchan m -mm 0 1 a.pgm\r\nrefl -type cube_top a.pgm\r\nrefl -type sphere a.pgm\r\nnorm a.pgm\r\nPr 0.5\r\nmap_Pr a.pgm\r\nmap_Ns -t 1 -texres 64 a.pgm -blendu off",
    ]
    .map(<[u8]>::to_vec);
    let words = [
        &NUMBERS[..],
        &[b"-s ", b"-o ", b"-mm ", b"-bm ", b"map_Kd ", b"refl ", b"a.pgm", b"newmtl", b"-type cube_left "],
    ]
    .concat();
    let root = tempfile::tempdir().unwrap();
    let cache = TextureCache::default();
    for_each_case(&files, &words, |bytes| {
        let folder = folder(root.path());
        let (obj, mtl) = (folder.join("a.obj"), folder.join("a.mtl"));
        if !obj.exists() {
            fs::write(folder.join("a.pgm"), "P2 2 1 255 0 255").unwrap();
            fs::write(&obj, "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n").unwrap();
        }
        fs::write(&mtl, bytes).unwrap();
        let loaded = load_obj(&obj, &ReadOptions::default(), &cache).unwrap();
        for m in &loaded.geometry.materials {
            let colors = [m.ka, m.kd, m.ks, m.ke, m.tf];
            assert!(colors.as_flattened().iter().chain([&m.ns, &m.d, &m.ni]).all(|x| x.is_finite()));
            assert!(m.ns >= 0.0 && (0.0..=1.0).contains(&m.d) && m.ni > 0.0 && m.illum <= 10);
            for map in m.textures.slots().into_iter().flatten() {
                let numbers = [map.scale, map.offset, map.base_gain];
                assert!(numbers.as_flattened().iter().chain([&map.bump_multiplier]).all(|x| x.is_finite()));
            }
        }
    });
}

#[test]
fn pictures() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/textures");
    let mut paths: Vec<PathBuf> = fs::read_dir(data).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths.retain(|path| path.extension().is_some_and(|extension| extension != "py"));
    let mut files: Vec<Vec<u8>> = paths.iter().map(|path| fs::read(path).unwrap()).collect();
    files.push(exr());
    files.push(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x40\0\x81\x80\x80\x80\x84".to_vec());
    let words: [&[u8]; 8] = [
        b"\xff\xff",
        b"\0\0\0\0",
        b"\xff\xff\xff\xff",
        b"\0\x40\0\0",
        b"\x7f\xff\xff\xff",
        b"60000",
        b"0",
        b"\x01",
    ];
    let root = tempfile::tempdir().unwrap();
    for_each_case(&files, &words, |bytes| {
        // TGA is known by its name alone
        let path = folder(root.path()).join("a.tga");
        fs::write(&path, bytes).unwrap();
        let Ok(texture) = load_picture(&path) else { return };
        let sizes = (0..texture.levels()).map(|level| texture.level_size(level));
        let texels: usize = sizes.map(|[width, height]| width as usize * height as usize).sum();
        match &texture.texels {
            Texels::U8(of_levels) => assert_eq!(of_levels.len(), texels),
            Texels::F32(of_levels) => {
                assert_eq!(of_levels.len(), texels);
                assert!(of_levels.as_flattened().iter().all(|x| x.is_finite()));
            }
        }
    });
}

/// A picture as EXR, compressed.
fn exr() -> Vec<u8> {
    use exr::prelude::*;
    let channels = SpecificChannels::rgb(|at: Vec2<usize>| (at.0 as f32, at.1 as f32, 0.5_f32));
    let mut bytes = std::io::Cursor::new(Vec::new());
    let layer = Layer::new((5, 3), LayerAttributes::named("a"), Encoding::SMALL_LOSSLESS, channels);
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

#[test]
fn job_files() {
    let files = [
        &b"version: 1\nname: a\nsequence: a.obj\nframes: 1-3x2\noutput: {folder: out, name: \"{stem}\", format: png, size: [64, 36], bits: 8}\ncamera: {eye: [0, 0, 5], look_at: [0, 0, 0], fov: 40}\nlights:\n  - point: {position: [0, 5, 0], intensity: 1}\nbackground: sky.hdr\nsamples: 4\nmaterials: {m: {Kd: [1, 0, 0], map_Kd: -s 2 a.png}}\n"[..],
        b"layers:\n  - sequence: a.obj\n    transform: {keys: [{frame: 1, translate: [0, 0, 0]}, {frame: 9, scale: 2}]}\n    frames: {start: 1, step: -1, outside: loop}\ncamera: {keys: [{frame: 1, eye: [0, 0, 5], look_at: [0, 0, 0]}], interpolate: smooth}\noverrides:\n  - {frames: 1-2, samples: 2, background: [0, 0, 1]}\n  - {files: \"a*\", name: \"{name}_{frame:04}\"}\nframes: 1-4\n",
    ]
    .map(<[u8]>::to_vec);
    let words = [
        &NUMBERS[..],
        &[
            b": ",
            b"- ",
            b"{",
            b"}",
            b"[",
            b"]",
            b"&a ",
            b"*a",
            b"!!",
            b"\"",
            b"1-999999",
            b"{frame}",
            b".inf",
            b"~",
        ],
    ]
    .concat();
    let root = tempfile::tempdir().unwrap();
    for_each_case(&files, &words, |bytes| {
        let folder = folder(root.path());
        let job = folder.join("a.yaml");
        if !folder.join("a.obj").exists() {
            fs::write(folder.join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        }
        fs::write(&job, bytes).unwrap();
        if let Err(error) = resolve(&Request { inputs: vec![job], ..Request::default() }) {
            assert!(!error.to_string().is_empty());
        }
    });
}
