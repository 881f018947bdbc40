//! What is in picture files: read back by others, byte by byte where it matters, and never a panic on a broken one.

use proptest::prelude::*;
use rentix::film::compare::{Picture, Samples};
use rentix::film::{Aovs, Film};
use rentix::output::{Bits, Encoding, Format, file_names, picture_files, read_picture};
use rentix::scene::{Aov, AovSet, PartHasher};
use std::path::Path;
use std::process::Command;

const PNG8: Encoding = Encoding { format: Format::Png, bits: Bits::Eight, exposure_stops: 0.0, quality: 92 };
const PNG16: Encoding = Encoding { bits: Bits::Sixteen, ..PNG8 };
const PPM8: Encoding = Encoding { format: Format::Ppm, ..PNG8 };
const PPM16: Encoding = Encoding { bits: Bits::Sixteen, ..PPM8 };
const EXR: Encoding = Encoding { format: Format::Exr, ..PNG8 };

/// 2x1 pixels: half of linear light, and a pixel brighter than white whose alpha is a half.
fn film(alpha: bool, aovs: bool) -> Film {
    let layers = Aovs {
        depth: Some(vec![2.5, f32::INFINITY]),
        normal: Some(vec![[0.0, 0.0, 1.0], [0.0; 3]]),
        position: Some(vec![[1.0, -2.0, 1e6], [0.0; 3]]),
        albedo: Some(vec![[0.5, 0.25, 0.125], [0.0; 3]]),
        id: Some(vec![[3, 1 << 24 | 1], [u32::MAX; 2]]),
        material: Some(vec![7, u32::MAX]),
        uv: Some(vec![[0.25, -3.5], [0.0; 2]]),
        coverage: Some(vec![1.0, 0.5]),
    };
    Film {
        size: [2, 1],
        rgb: vec![[0.5, 0.0, 0.25], [2.0, 0.25, 0.125]].into(),
        codes: None,
        alpha: alpha.then(|| vec![1.0, 0.5]),
        aovs: if aovs { layers } else { Aovs::default() },
    }
}

fn encode(film: &Film, encoding: Encoding) -> Vec<u8> {
    picture_files(Path::new("a"), film, encoding).unwrap().swap_remove(0).bytes
}

fn read_back(bytes: &[u8]) -> Picture {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    read_picture(file.path()).unwrap()
}

/// The names of a PNG's chunks.
fn chunks(png: &[u8]) -> Vec<String> {
    let (mut names, mut rest) = (Vec::new(), &png[8..]);
    while !rest.is_empty() {
        let length = u32::from_be_bytes(rest[..4].try_into().unwrap()) as usize;
        names.push(String::from_utf8(rest[4..8].to_vec()).unwrap());
        rest = &rest[length + 12..];
    }
    names.dedup();
    names
}

#[test]
fn png_holds_pixels_and_colour_space_only() {
    for (alpha, encoding) in [(false, PNG8), (true, PNG8), (false, PNG16), (true, PNG16)] {
        assert_eq!(chunks(&encode(&film(alpha, false), encoding)), ["IHDR", "sRGB", "IDAT", "IEND"]);
    }
}

#[test]
fn png_is_what_another_reader_sees() {
    let read = |alpha, encoding| image::load_from_memory(&encode(&film(alpha, false), encoding)).unwrap();
    // 0.5 → 188, 0.25 → 137, 0.125 → 1.055 · 0.125^(1/2.4) − 0.055 = 0.388573, · 255 = 99.09
    assert_eq!(read(false, PNG8).as_rgb8().unwrap().as_raw(), &[188, 0, 137, 255, 137, 99]);
    // straight: 0.25 / 0.5 = 0.5 and 0.125 / 0.5 = 0.25
    assert_eq!(read(true, PNG8).as_rgba8().unwrap().as_raw(), &[188, 0, 137, 255, 255, 188, 137, 128]);
    let rgb16 = read(false, PNG16);
    assert_eq!(rgb16.as_rgb16().unwrap().as_raw()[..4], [48192, 0, 35199, 65535]);
    let rgba16 = read(true, PNG16);
    assert_eq!(rgba16.as_rgba16().unwrap().as_raw()[4..], [65535, 48192, 35199, 32768]);
    // two stops more: 0.25 → 1, 0.125 → 0.5
    let bright =
        image::load_from_memory(&encode(&film(false, false), Encoding { exposure_stops: 2.0, ..PNG8 }));
    assert_eq!(bright.unwrap().as_rgb8().unwrap().as_raw(), &[255, 0, 255, 255, 255, 188]);
}

#[test]
fn ppm_byte_by_byte() {
    assert_eq!(encode(&film(false, false), PPM8), b"P6\n2 1\n255\n\xbc\x00\x89\xff\x89\x63");
    // no alpha: what is there stands on black
    assert_eq!(encode(&film(true, true), PPM8), b"P6\n2 1\n255\n\xbc\x00\x89\xff\x89\x63");
    // 48192 = 0xbc40, 35199 = 0x897f, 0.388573 · 65535 = 25465.1 = 0x6379
    assert_eq!(
        encode(&film(false, false), PPM16),
        b"P6\n2 1\n65535\n\xbc\x40\x00\x00\x89\x7f\xff\xff\x89\x7f\x63\x79"
    );
}

#[test]
fn exr_holds_the_film_as_it_is() {
    let picture = read_back(&encode(&film(true, true), EXR));
    assert_eq!(picture.size, [2, 1]);
    let floats = |name: &str| match &picture.channels.iter().find(|c| c.name == name).unwrap().samples {
        Samples::Float(values) => values.clone(),
        other => panic!("{name} is {other:?}"),
    };
    // premultiplied and unclamped
    for (name, values) in [
        ("R", [0.5, 2.0]),
        ("G", [0.0, 0.25]),
        ("B", [0.25, 0.125]),
        ("A", [1.0, 0.5]),
        ("depth.Z", [2.5, f32::INFINITY]),
        ("normal.Z", [1.0, 0.0]),
        ("position.X", [1.0, 0.0]),
        ("position.Y", [-2.0, 0.0]),
        ("position.Z", [1e6, 0.0]),
        ("albedo.R", [0.5, 0.0]),
        ("albedo.G", [0.25, 0.0]),
        ("albedo.B", [0.125, 0.0]),
        ("uv.U", [0.25, 0.0]),
        ("uv.V", [-3.5, 0.0]),
        ("coverage.A", [1.0, 0.5]),
    ] {
        assert_eq!(floats(name), values, "{name}");
    }
    let ids = |name: &str| picture.channels.iter().find(|c| c.name == name).unwrap().samples.clone();
    assert_eq!(ids("id.part"), Samples::Id(vec![3, u32::MAX]));
    assert_eq!(ids("id.triangle"), Samples::Id(vec![(1 << 24) + 1, u32::MAX]));
    assert_eq!(ids("material.slot"), Samples::Id(vec![7, u32::MAX]));
    assert_eq!(picture.channels.len(), 20);
}

#[test]
fn exr_holds_pixels_only() {
    let bytes = encode(&film(true, true), EXR);
    let meta = exr::meta::MetaData::read_from_buffered(bytes.as_slice(), true).unwrap();
    let [header] = meta.headers.as_slice() else { panic!("one part") };
    let none = exr::prelude::LayerAttributes::default();
    assert_eq!(header.own_attributes, none);
    let size_alone = exr::prelude::ImageAttributes::with_size((2, 1));
    assert_eq!(header.shared_attributes, size_alone);
}

#[test]
fn auxiliary_pictures_stand_beside_other_formats() {
    let mut all = AovSet::default();
    for aov in Aov::ALL {
        all.insert(aov);
    }
    let picture = Path::new("walk/a.b_0001.png");
    let files = picture_files(picture, &film(true, true), PNG8).unwrap();
    let names: Vec<_> = files.iter().map(|f| f.path.clone()).collect();
    assert_eq!(names, [picture, Path::new("walk/a.b_0001.aov.exr")]);
    assert_eq!(names, file_names(picture, Format::Png, all));
    let layers = read_back(&files[1].bytes);
    assert_eq!(layers.channels.len(), 16);
    assert!(layers.channels.iter().all(|c| c.name.contains('.')), "colour stands in the picture");

    let alone = [picture];
    assert_eq!(file_names(picture, Format::Png, AovSet::default()), alone);
    assert_eq!(file_names(picture, Format::Exr, all), alone);
    assert_eq!(picture_files(picture, &film(true, false), PNG8).unwrap().len(), 1);
    assert_eq!(picture_files(picture, &film(true, true), EXR).unwrap().len(), 1);
}

#[test]
fn bytes_do_not_depend_on_threads() {
    let mut large = Film::new([200, 150], true, AovSet::default());
    for (i, pixel) in large.rgb.iter_mut().enumerate() {
        *pixel = [i as f32 / 3e4, (i % 200) as f32 / 200.0, 0.5];
    }
    for encoding in [PNG8, PNG16, PPM8, EXR] {
        let bytes = encode(&large, encoding);
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert!(pool.install(|| encode(&large, encoding)) == bytes);
        }
    }
}

#[test]
fn the_fingerprint_counts_what_bears_on_the_bytes() {
    let name = |encoding: Encoding| {
        let mut h = PartHasher::new("test");
        encoding.hash_into(&mut h);
        h.finish()
    };
    let brighter = Encoding { exposure_stops: 1.0, ..PNG8 };
    for (i, a) in [PNG8, PNG16, PPM8, EXR, brighter].into_iter().enumerate() {
        for (j, b) in [PNG8, PNG16, PPM8, EXR, brighter].into_iter().enumerate() {
            assert_eq!(name(a) == name(b), i == j, "{a:?} {b:?}");
        }
    }
    assert_eq!(
        name(EXR),
        name(Encoding { exposure_stops: 1.0, bits: Bits::Sixteen, ..EXR }),
        "linear floats"
    );
}

#[test]
fn words_of_formats() {
    assert_eq!(Format::from_word("PNG"), Some(Format::Png));
    assert_eq!(Format::from_word("bmp4"), None);
    assert_eq!(Format::of_file(Path::new("a.aov.exr")), Some(Format::Exr));
    assert_eq!(Format::of_file(Path::new("png")), None);
    assert_eq!((Bits::from_number(16), Bits::from_number(12)), (Some(Bits::Sixteen), None));
}

#[test]
fn a_film_without_pixels_is_refused() {
    let none = Film::new([0, 5], false, AovSet::default());
    for encoding in [PNG8, PPM8, EXR] {
        let error = picture_files(Path::new("a"), &none, encoding).unwrap_err().to_string();
        assert!(error.starts_with("a film of 0x5 pixels cannot become "), "{error}");
    }
}

#[test]
fn pictures_that_claim_too_much_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.ppm");
    for header in ["P6\n65535 65535\n255\n", "P6\n4000000000 1\n255\n", "P6\n60000 60000\n65535\n"] {
        std::fs::write(&path, header).unwrap();
        let error = read_picture(&path).unwrap_err().to_string();
        assert!(error.contains("huge.ppm: is not a picture that can be compared"), "{error}");
    }
    // the data window of a small EXR made as wide and high as the format allows
    let mut bytes = encode(&film(false, false), EXR);
    let window =
        bytes.windows(10).position(|w| w == b"dataWindow").unwrap() + "dataWindow\0box2i\0".len() + 4 + 8;
    bytes[window..window + 4].copy_from_slice(&100_000i32.to_le_bytes());
    bytes[window + 4..window + 8].copy_from_slice(&100_000i32.to_le_bytes());
    std::fs::write(&path, bytes).unwrap();
    let error = read_picture(&path).unwrap_err().to_string();
    assert!(error.contains("are allowed"), "{error}");
}

#[test]
fn torn_pictures_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("torn");
    for encoding in [PNG8, PPM8, EXR] {
        let bytes = encode(&film(true, true), encoding);
        for end in 0..bytes.len() - 12 {
            std::fs::write(&path, &bytes[..end]).unwrap();
            // a torn PNG or EXR may be missing nothing but what follows its pixels
            if let Ok(picture) = read_picture(&path) {
                assert_eq!(picture.size, [2, 1], "{encoding:?} torn at {end}");
                assert_ne!(encoding, PPM8, "torn at {end}");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn damaged_pictures_never_end_the_program(format in 0..3usize, at in any::<prop::sample::Index>(), byte: u8) {
        let mut bytes = encode(&film(true, true), [PNG8, PPM8, EXR][format]);
        let at = at.index(bytes.len());
        bytes[at] = byte;
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        let _ = read_picture(file.path());
    }
}

#[test]
#[ignore = "needs Python with Pillow and Mitsuba; cargo test --test pictures -- --ignored"]
fn others_read_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let mut python = Command::new("python3");
    python.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/pictures_oracle.py"));
    for (name, alpha, encoding) in [
        ("rgb.png", false, PNG8),
        ("rgba.png", true, PNG8),
        ("rgb.ppm", false, PPM8),
        ("rgba.exr", true, EXR),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, encode(&film(alpha, false), encoding)).unwrap();
        python.arg(path);
    }
    let output = python.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let printed = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<_> = printed.lines().collect();
    assert_eq!(
        lines,
        [
            "2 1 RGB 188 0 137 255 137 99",
            "2 1 RGBA 188 0 137 255 255 188 137 128",
            "2 1 RGB 188 0 137 255 137 99",
            "2 1 R G B A 0.5 0 0.25 1 2 0.25 0.125 0.5",
        ]
    );
}
