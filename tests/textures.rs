//! Pictures of every format are the texels that another program wrote; broken, huge and odd ones are refused by name.
//! `tests/data/textures/make.py` wrote the files.

use rentix::format::load_picture;
use rentix::scene::{Part, TexelSpace, Texels, Texture};
use std::fs;
use std::path::{Path, PathBuf};

const RGB: [[u8; 3]; 6] = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [10, 20, 30], [128; 3], [255; 3]];
const ALPHA: [u8; 6] = [255, 128, 0, 1, 254, 255];

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/textures").join(name)
}

fn bytes(name: &str) -> Part<Texture> {
    let texture = load_picture(&data(name)).unwrap();
    assert_eq!(texture.space, TexelSpace::Srgb, "{name}: bytes of colour are sRGB");
    texture
}

/// The texels of the first level.
fn first_level(texture: &Texture) -> &[[u8; 4]] {
    let Texels::U8(texels) = &texture.texels else { panic!("no bytes") };
    &texels[..(texture.size[0] * texture.size[1]) as usize]
}

#[test]
fn colours_are_those_that_were_written() {
    let expected = RGB.map(|[r, g, b]| [r, g, b, 255]);
    for name in [
        "rgb.png",
        "palette.png",
        "rgb.bmp",
        "rgb.tga",
        "rgb.ppm",
        "rgb.gif",
        "rgb.webp",
        "rgb.tif",
        "rgb.qoi",
    ] {
        let texture = bytes(name);
        assert_eq!((texture.size, texture.levels(), texture.alpha_varies), ([3, 2], 2, false), "{name}");
        assert_eq!(first_level(&texture), expected, "{name}");
    }
    for name in ["gray.png", "gray.tga", "gray.pgm"] {
        assert_eq!(first_level(&bytes(name)), ALPHA.map(|x| [x, x, x, 255]), "{name}");
    }
}

#[test]
fn alpha_is_kept() {
    for name in ["rgba.png", "rgba.tga", "rgba.webp", "rgba.tif", "rgba.qoi"] {
        let texture = bytes(name);
        let expected: Vec<_> = RGB.iter().zip(ALPHA).map(|(&[r, g, b], a)| [r, g, b, a]).collect();
        assert_eq!((first_level(&texture), texture.alpha_varies), (&expected[..], true), "{name}");
    }
    assert_eq!(first_level(&bytes("gray_alpha.png")), ALPHA.map(|a| [10, 10, 10, a]));
}

#[test]
fn colours_of_lossy_formats_are_near() {
    for name in ["red.jpg", "red.webp", "red.dds"] {
        let texture = bytes(name);
        let near = |texel: &[u8; 4]| (0..4).all(|k| texel[k].abs_diff([200, 40, 40, 255][k]) <= 8);
        assert!(first_level(&texture).iter().all(near), "{name}: {:?}", first_level(&texture)[0]);
    }
}

#[test]
fn sixteen_bits_become_linear_floats() {
    let texture = load_picture(&data("gray16.png")).unwrap();
    let Texels::F32(texels) = &texture.texels else { panic!("no floats") };
    // 128/255 on the sRGB curve is ((0.50196 + 0.055) / 1.055)^2.4 = 0.21586
    assert!((texels[1][0] - 0.21586).abs() < 1e-5 && texels[1][3] == 1.0, "{:?}", texels[1]);
    assert_eq!((texture.space, texels[0], texels[2]), (TexelSpace::Linear, [1.0; 4], [0.0, 0.0, 0.0, 1.0]));
}

#[test]
fn radiance_pictures_are_linear() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sky.hdr");
    // mantissas 128, 64, 0 with exponent 129: m / 256 · 2^(129 − 128) = 1, 0.5, 0
    let mut hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n".to_vec();
    hdr.extend([128, 64, 0, 129, 128, 128, 128, 132]);
    fs::write(&path, hdr).unwrap();
    let texture = load_picture(&path).unwrap();
    let Texels::F32(texels) = &texture.texels else { panic!("no floats") };
    assert_eq!((texels[0], texels[1]), ([1.0, 0.5, 0.0, 1.0], [8.0, 8.0, 8.0, 1.0]));
    assert_eq!(texels[2], [4.5, 4.25, 4.0, 1.0], "the second level is the mean");
}

#[test]
fn exr_of_any_channels_is_read_and_is_finite() {
    use exr::prelude::*;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let read = |channels: Vec<(&str, [f32; 2])>| {
        let channels =
            channels.iter().map(|(name, values)| AnyChannel::new(*name, FlatSamples::F32(values.to_vec())));
        let list = AnyChannels::sort(channels.collect());
        Image::from_channels((2, 1), list).write().to_file(&path).unwrap();
        let texture = load_picture(&path).map_err(|error| error.to_string())?;
        let Texels::F32(texels) = &texture.texels else { panic!("no floats") };
        Ok::<_, String>(texels.clone())
    };
    let (r, g, b) = (("R", [2.0, f32::NAN]), ("G", [0.0, f32::INFINITY]), ("B", [-1.0, f32::NEG_INFINITY]));
    let texels = read(vec![r, g, b, ("A", [0.5, 1.0])]).unwrap();
    assert_eq!(texels[..2], [[2.0, 0.0, -1.0, 0.5], [0.0, 65504.0, -65504.0, 1.0]]);
    assert_eq!(read(vec![("Y", [3.0, 4.0])]).unwrap()[..2], [[3.0, 3.0, 3.0, 1.0], [4.0, 4.0, 4.0, 1.0]]);
    let layer = read(vec![("sky.R", [1.0; 2]), ("sky.G", [2.0; 2]), ("sky.B", [3.0; 2])]).unwrap();
    assert_eq!(layer[0], [1.0, 2.0, 3.0, 1.0]);
    assert!(read(vec![("Z", [1.0; 2])]).unwrap_err().contains("no channels R, G and B"));
}

#[test]
fn every_beginning_of_a_file_is_refused_or_read() {
    let folder = tempfile::tempdir().unwrap();
    for entry in fs::read_dir(data("")).unwrap() {
        let whole = entry.unwrap().path();
        let name = whole.file_name().unwrap().to_str().unwrap().to_owned();
        let bytes = fs::read(&whole).unwrap();
        if name == "make.py" {
            continue;
        }
        let path = folder.path().join(&name);
        let mut refused = 0;
        for length in 0..bytes.len() {
            fs::write(&path, &bytes[..length]).unwrap();
            if let Err(error) = load_picture(&path) {
                assert!(error.to_string().contains(&name), "{error}");
                refused += 1;
            }
        }
        // some formats end in what is not needed, up to half of so small a file
        assert!(
            5 * refused > 2 * bytes.len(),
            "{name}: only {refused} of {} beginnings refused",
            bytes.len()
        );
    }
}

/// A PNG of those sides that holds no texels.
fn png(width: u32, height: u32) -> Vec<u8> {
    let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut header = b"IHDR".to_vec();
    header.extend([width.to_be_bytes(), height.to_be_bytes()].concat());
    header.extend([8, 2, 0, 0, 0]);
    for chunk in [&header[..], b"IDAT\x78\x9c\x03\x00\x00\x00\x00\x01", b"IEND"] {
        png.extend((chunk.len() as u32 - 4).to_be_bytes());
        png.extend(chunk);
        png.extend(crc32(chunk).to_be_bytes());
    }
    png
}

/// The check sum of PNG chunks (ISO 3309), bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, &byte| {
        (0..8)
            .fold(crc ^ u32::from(byte), |crc: u32, _| (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg()))
    })
}

#[test]
fn sizes_are_looked_at_before_texels() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        let error = load_picture(&path).unwrap_err().to_string();
        assert!(error.starts_with(&path.display().to_string()), "{error}");
        error
    };
    for [width, height] in [[0, 0], [0, 5], [60_000, 1], [1, 60_000], [u32::MAX, u32::MAX]] {
        refused("a.png", &png(width, height));
        refused("a.pgm", format!("P5 {width} {height} 255\n").as_bytes());
        let qoi = [&b"qoif"[..], &width.to_be_bytes(), &height.to_be_bytes(), &[3, 0], &[0; 8]].concat();
        refused("a.qoi", &qoi);
        refused("a.hdr", format!("#?RADIANCE\n\n-Y {height} +X {width}\n").as_bytes());
        let (w, h) = (width.min(65_535) as u16, height.min(65_535) as u16);
        let tga = [&[0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0][..], &w.to_le_bytes(), &h.to_le_bytes(), &[24, 0]]
            .concat();
        refused("a.tga", &tga);
    }
    assert!(refused("a.png", &png(60_000, 1)).contains("scale it down"));
    refused("a.png", &png(16_384, 16_384));
    for (name, bytes, words) in [
        ("empty.png", &b""[..], "is empty"),
        ("text.png", b"no picture", "is no picture of a known format"),
        ("lfs.png", b"version https://git-lfs.github.com/spec/v1\n", "Git LFS"),
        ("jpeg2000.jp2", b"\0\0\0\x0cjP  \r\n\x87\n", "is no picture of a known format"),
    ] {
        assert!(refused(name, bytes).contains(words), "{}", refused(name, bytes));
    }
    assert!(load_picture(folder.path()).unwrap_err().to_string().contains("not a plain file"));
    assert!(
        load_picture(&folder.path().join("gone.png")).unwrap_err().to_string().contains("cannot be read")
    );
}
