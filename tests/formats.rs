//! Every picture format shows what the PNG shows, holds what the job says it holds, and names no program.

use image::DynamicImage;
use openjp2::openjpeg::OPJ_CODEC_JP2;
use openjp2::{Codec, Stream, opj_dparameters_t};
use rentix::film::Film;
use rentix::film::compare::{Samples, compare};
use rentix::job::settings::{ALPHA, FLOATS, FORMATS, SIXTEEN_BITS};
use rentix::output::{Bits, Encoding, Format, picture_files, read_picture};
use rentix::scene::AovSet;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Odd, so that rows are padded where a format pads them.
const SIZE: [u32; 2] = [37, 23];

/// Ramps in red and green, a block of one colour, black and more than white, alpha from 0 to 1.
fn film(alpha: bool) -> Film {
    let mut film = Film::new(SIZE, alpha, AovSet::default());
    for (i, pixel) in film.rgb.iter_mut().enumerate() {
        let (x, y) = (i % 37, i / 37);
        *pixel = match (x, y) {
            (_, 0) => [0.0; 3],
            (_, 1) => [4.0, 1.0, 2.0],
            (10..30, 5..15) => [0.25, 0.5, 0.125],
            _ => [x as f32 / 36.0, y as f32 / 22.0, (x * y) as f32 / 800.0],
        };
        if let Some(alpha) = &mut film.alpha {
            alpha[i] = y as f32 / 22.0;
            *pixel = pixel.map(|c| c * alpha[i]);
        }
    }
    film
}

fn encoding(word: &str, bits: Bits) -> Encoding {
    Encoding { format: Format::from_word(word).unwrap(), bits, exposure_stops: 0.0, quality: 92 }
}

fn encode(word: &str, bits: Bits, alpha: bool) -> Vec<u8> {
    picture_files(Path::new("a"), &film(alpha), encoding(word, bits)).unwrap().swap_remove(0).bytes
}

fn png(bits: Bits, alpha: bool) -> DynamicImage {
    image::load_from_memory(&encode("png", bits, alpha)).unwrap()
}

fn saved(folder: &tempfile::TempDir, word: &str, bits: Bits, alpha: bool) -> PathBuf {
    let path = folder.path().join(format!("a.{word}"));
    std::fs::write(&path, encode(word, bits, alpha)).unwrap();
    path
}

/// What the image crate reads, the format known by the file's extension.
fn read(word: &str, bits: Bits, alpha: bool) -> DynamicImage {
    image::open(saved(&tempfile::tempdir().unwrap(), word, bits, alpha)).unwrap()
}

#[test]
fn lossless_formats_hold_the_pngs_pixels() {
    for word in ["ppm", "bmp", "tif", "tiff", "tga", "webp", "qoi"] {
        let read = read(word, Bits::Eight, false);
        assert!(read.as_rgb8().is_some() && read == png(Bits::Eight, false), "{word}");
    }
    // a name that the image crate does not know, the same file
    assert_eq!(encode("dib", Bits::Eight, false), encode("bmp", Bits::Eight, false));
    for word in ["tif", "tga", "webp", "qoi"] {
        let read = read(word, Bits::Eight, true);
        assert!(read.as_rgba8().is_some() && read == png(Bits::Eight, true), "{word} with alpha");
    }
    for word in ["ppm", "tif"] {
        let read = read(word, Bits::Sixteen, false);
        assert!(read.as_rgb16().is_some() && read == png(Bits::Sixteen, false), "{word} of 16 bits");
    }
    assert!(read("tif", Bits::Sixteen, true) == png(Bits::Sixteen, true), "tif of 16 bits with alpha");
}

#[test]
fn jpeg_is_near_and_nearer_with_quality() {
    let wanted = png(Bits::Eight, false).into_rgb8();
    let mean_difference = |quality| {
        let encoding = Encoding { quality, ..encoding("jpg", Bits::Eight) };
        let file = picture_files(Path::new("a"), &film(false), encoding).unwrap().swap_remove(0);
        let read = image::load_from_memory(&file.bytes).unwrap().into_rgb8();
        let sum: f64 = read.iter().zip(wanted.iter()).map(|(&a, &b)| f64::from(a.abs_diff(b))).sum();
        sum / wanted.len() as f64
    };
    let (low, usual, high) = (mean_difference(20), mean_difference(92), mean_difference(100));
    assert!(high < 1.0 && usual < 3.0 && high < usual && usual < low, "{low} {usual} {high}");
}

#[test]
fn gray_is_the_luma_of_the_png() {
    let linear = |code: u8| rentix::math::linear_from_srgb(f64::from(code) / 255.0);
    let colour = png(Bits::Eight, false).into_rgb8();
    let luma = colour.pixels().map(|p| {
        let [r, g, b] = p.0.map(linear);
        255.0 * rentix::math::srgb_from_linear(0.2126 * r + 0.7152 * g + 0.0722 * b)
    });
    let luma: Vec<f64> = luma.collect();
    let (pgm, pbm) = (read("pgm", Bits::Eight, false), read("pbm", Bits::Eight, false));
    let (pgm, pbm) = (pgm.as_luma8().unwrap(), pbm.to_luma8());
    // the PNG's codes are rounded by half a code, by up to 1.5 codes of the luma where its curve is steeper
    assert!(pgm.iter().zip(&luma).all(|(&code, y)| (f64::from(code) - y).abs() < 1.5));
    assert!(pbm.iter().zip(pgm.iter()).all(|(&bit, &code)| (bit == 255) == (code >= 128)));
    let fine = read("pgm", Bits::Sixteen, false);
    let fine = fine.as_luma16().unwrap();
    assert!(
        fine.iter().zip(pgm.iter()).all(|(&a, &b)| (f64::from(a) / 257.0 - f64::from(b)).abs() <= 0.5 + 1e-9)
    );
}

#[test]
fn sun_raster_holds_the_pngs_pixels() {
    let bytes = encode("sr", Bits::Eight, false);
    assert_eq!(bytes, encode("ras", Bits::Eight, false));
    let words: Vec<u32> =
        bytes[..32].chunks(4).map(|word| u32::from_be_bytes(word.try_into().unwrap())).collect();
    // 3 · 37 = 111 bytes of pixels and one of padding a row, 23 rows
    assert_eq!(words, [0x59a6_6a95, 37, 23, 24, 112 * 23, 1, 0, 0]);
    let rgb: Vec<u8> = bytes[32..]
        .chunks(112)
        .flat_map(|row| row[..111].chunks(3).flat_map(|bgr| [bgr[2], bgr[1], bgr[0]]))
        .collect();
    assert_eq!(&rgb, png(Bits::Eight, false).as_rgb8().unwrap().as_raw());
}

#[test]
fn jpeg_2000_holds_the_pngs_pixels() {
    let folder = tempfile::tempdir().unwrap();
    for (bits, wanted) in [
        (Bits::Eight, png(Bits::Eight, false).into_rgb8().iter().map(|&x| i32::from(x)).collect::<Vec<_>>()),
        (Bits::Sixteen, png(Bits::Sixteen, false).into_rgb16().iter().map(|&x| i32::from(x)).collect()),
    ] {
        let mut stream = Stream::new_file(saved(&folder, "jp2", bits, false), 1 << 16, true).unwrap();
        let mut codec = Codec::new_decoder(OPJ_CODEC_JP2).unwrap();
        assert_eq!(codec.setup_decoder(&mut opj_dparameters_t::default()), 1);
        let mut image = codec.read_header(&mut stream).unwrap();
        assert_eq!(codec.decode(&mut stream, &mut image), 1);
        let planes: Vec<&[i32]> = image.comps().unwrap().iter().map(|c| c.data().unwrap()).collect();
        assert_eq!((planes.len(), image.x1, image.y1), (3, SIZE[0], SIZE[1]));
        let interleaved: Vec<i32> =
            (0..planes[0].len()).flat_map(|i| [planes[0][i], planes[1][i], planes[2][i]]).collect();
        assert!(interleaved == wanted, "{bits:?}");
    }
}

#[test]
fn the_smallest_pictures_have_every_format() {
    let white = Film { rgb: vec![[1.0; 3]].into(), ..Film::new([1, 1], false, AovSet::default()) };
    for word in FORMATS {
        picture_files(Path::new("a"), &white, encoding(word, Bits::Eight)).unwrap();
    }
}

#[test]
fn hdr_is_linear_and_unclamped() {
    let bytes = encode("hdr", Bits::Eight, false);
    assert!(bytes.starts_with(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 23 +X 37\n"));
    let read = read("hdr", Bits::Eight, false);
    for (read, wanted) in read.as_rgb32f().unwrap().pixels().zip(&*film(false).rgb) {
        let greatest = wanted.iter().copied().fold(0.0, f32::max);
        for (a, b) in read.0.iter().zip(wanted) {
            // mantissas of 8 bits, the greatest from 128, rounded down
            assert!(a <= b && b - a <= greatest / 128.0, "{a} {b}");
        }
    }
    // rows of 3 pixels are not run-length coded
    let narrow = Film { rgb: vec![[1.0; 3]; 3].into(), ..Film::new([3, 1], false, AovSet::default()) };
    let file = picture_files(Path::new("a"), &narrow, encoding("hdr", Bits::Eight)).unwrap().swap_remove(0);
    assert!(file.bytes.ends_with(b"+X 3\n\x80\x80\x80\x81\x80\x80\x80\x81\x80\x80\x80\x81"));
}

#[test]
fn what_the_job_says_of_formats_is_so() {
    for word in FORMATS {
        let of_bits = |bits| encode(word, bits, false);
        let finer = of_bits(Bits::Sixteen).len() > of_bits(Bits::Eight).len();
        assert_eq!(finer, SIXTEEN_BITS.contains(&word), "{word}: 16 bits");
        let brighter = Encoding { exposure_stops: 1.0, ..encoding(word, Bits::Eight) };
        let brighter = picture_files(Path::new("a"), &film(false), brighter).unwrap().swap_remove(0).bytes;
        assert_eq!(brighter == of_bits(Bits::Eight), FLOATS.contains(&word), "{word}: floats");
        // the same colour, with alpha and without
        let clear = film(true);
        let opaque = Film { alpha: None, ..clear.clone() };
        let bytes = |film| picture_files(Path::new("a"), film, encoding(word, Bits::Eight)).unwrap();
        assert_eq!(bytes(&clear) != bytes(&opaque), ALPHA.contains(&word), "{word}: alpha");
    }
}

#[test]
fn no_picture_names_a_program() {
    for word in FORMATS {
        let text = String::from_utf8_lossy(&encode(word, Bits::Eight, true)).to_lowercase();
        for name in ["rust", "openjp", "created", "software", "rentix", "encoder"] {
            assert!(!text.contains(name), "{word} says {name}");
        }
        assert_eq!(encode(word, Bits::Eight, true), encode(word, Bits::Eight, true), "{word}");
    }
}

#[test]
fn compare_reads_them() {
    let folder = tempfile::tempdir().unwrap();
    let read = |word| read_picture(&saved(&folder, word, Bits::Eight, false));
    let png = read("png").unwrap();
    for word in ["ppm", "bmp", "dib", "tif", "tiff", "tga", "webp", "qoi", "sr", "ras"] {
        assert_eq!(compare(&png, &read(word).unwrap()).unwrap().max, 0.0, "{word}");
    }
    for word in ["jpg", "jpeg", "jpe", "pgm", "pbm"] {
        assert_eq!(read(word).unwrap().size, SIZE, "{word}");
    }
    let hdr = read("hdr").unwrap();
    assert!(matches!(&hdr.channels[0].samples, Samples::Float(red) if red[37] == 4.0), "linear, not clamped");
    let error = read("jp2").unwrap_err().to_string();
    assert!(error.ends_with("all formats but jp2 are read"), "{error}");
}

#[test]
fn what_a_format_cannot_hold_is_refused() {
    let wide = Film::new([16385, 1], false, AovSet::default());
    let error = picture_files(Path::new("a"), &wide, encoding("webp", Bits::Eight)).unwrap_err().to_string();
    assert!(error.starts_with("a film of 16385x1 pixels cannot become webp: "), "{error}");
}

/// `convert` of `ImageMagick`, as interleaved samples of 16 bits.
fn image_magick(path: &Path, channels: &str) -> Vec<u8> {
    let program = std::env::var("IMAGEMAGICK").unwrap_or_else(|_| "convert".into());
    let mut convert = Command::new(program);
    convert.arg(path).args(["-depth", "16", "-endian", "MSB", &format!("{channels}:-")]);
    let output = convert.output().unwrap();
    assert!(output.status.success(), "{}: {}", path.display(), String::from_utf8_lossy(&output.stderr));
    output.stdout
}

#[test]
#[ignore = "needs ImageMagick; IMAGEMAGICK=convert cargo test --test formats -- --ignored image_magick"]
fn image_magick_reads_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let big_endian = |samples: Vec<u16>| samples.into_iter().flat_map(u16::to_be_bytes).collect::<Vec<u8>>();
    for bits in [Bits::Eight, Bits::Sixteen] {
        let sixteen = bits == Bits::Sixteen;
        let rgb = big_endian(png(bits, false).into_rgb16().into_raw());
        for word in ["png", "ppm", "bmp", "dib", "tif", "tiff", "jp2", "sr", "ras", "tga", "webp"] {
            if !sixteen || SIXTEEN_BITS.contains(&word) {
                assert!(image_magick(&saved(&folder, word, bits, false), "rgb") == rgb, "{word} {bits:?}");
            }
        }
        let rgba = big_endian(png(bits, true).into_rgba16().into_raw());
        for word in ["png", "tif", "tga", "webp"] {
            if !sixteen || SIXTEEN_BITS.contains(&word) {
                assert!(
                    image_magick(&saved(&folder, word, bits, true), "rgba") == rgba,
                    "{word} {bits:?} alpha"
                );
            }
        }
        let gray = big_endian(read("pgm", bits, false).into_luma16().into_raw());
        assert!(image_magick(&saved(&folder, "pgm", bits, false), "gray") == gray, "pgm {bits:?}");
    }
    let pbm = big_endian(read("pbm", Bits::Eight, false).into_luma16().into_raw());
    assert!(image_magick(&saved(&folder, "pbm", Bits::Eight, false), "gray") == pbm, "pbm");
}

#[test]
#[ignore = "needs Python with Pillow; cargo test --test formats -- --ignored pillow"]
fn pillow_reads_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let cases: Vec<(&str, bool)> = FORMATS
        .into_iter()
        .filter(|word| !["exr", "hdr", "pgm", "pbm", "jpg", "jpeg", "jpe"].contains(word))
        .flat_map(|word| [(word, false), (word, true)])
        .filter(|(word, alpha)| !alpha || ALPHA.contains(word))
        .collect();
    for (word, alpha) in cases {
        let output = Command::new("python3")
            .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/pictures_oracle.py"))
            .arg(saved(&folder, word, Bits::Eight, alpha))
            .output()
            .unwrap();
        assert!(output.status.success(), "{word}: {}", String::from_utf8_lossy(&output.stderr));
        let wanted = png(Bits::Eight, alpha);
        let values: Vec<String> = wanted.as_bytes().iter().map(u8::to_string).collect();
        let mode = if alpha { "RGBA" } else { "RGB" };
        let line = format!("37 23 {mode} {}\n", values.join(" "));
        assert!(String::from_utf8_lossy(&output.stdout) == line, "{word} alpha {alpha}");
    }
}
