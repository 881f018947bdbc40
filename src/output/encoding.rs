//! Which files a picture has, and the encoder of each format.

use super::error::OutputError;
use super::{exr, hdr, jp2, png, pnm, rasters, sun, tiff};
use crate::film::Film;
use crate::scene::{AovSet, PartHasher};
use std::path::{Path, PathBuf};

/// A picture format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Portable Network Graphics: integers on the sRGB curve, straight alpha.
    Png,
    /// `OpenEXR`: linear floats, unclamped, premultiplied alpha, auxiliary pictures as layers.
    Exr,
    /// Portable pixmap, binary (P6): integers on the sRGB curve, no alpha.
    Ppm,
    /// Portable graymap, binary (P5): luma of linear light, on the curve.
    Pgm,
    /// Portable bitmap, binary (P4): that, cut at one half.
    Pbm,
    /// JPEG: no alpha, as good as [`Encoding::quality`] says.
    Jpeg,
    /// Windows bitmap: no alpha.
    Bmp,
    /// TIFF: integers on the sRGB curve, straight alpha.
    Tiff,
    /// JPEG 2000, lossless: no alpha.
    Jp2,
    /// Sun raster: no alpha.
    Sun,
    /// Truevision TGA: straight alpha.
    Tga,
    /// WebP, lossless: straight alpha.
    Webp,
    /// Quite OK Image: straight alpha.
    Qoi,
    /// Radiance HDR: linear floats with a shared exponent, no alpha.
    Hdr,
}

struct FormatLine {
    format: Format,
    /// Its words on the command line, which are file extensions.
    words: &'static [&'static str],
    linear: bool,
    encode: Encode,
}

/// One line a format, in the order of [`Format`].
const FORMATS: [FormatLine; 14] = [
    line(Format::Png, &["png"], png::encode),
    FormatLine { linear: true, ..line(Format::Exr, &["exr"], exr::encode) },
    line(Format::Ppm, &["ppm"], |film, encoding| Ok(pnm::encode_ppm(film, encoding))),
    line(Format::Pgm, &["pgm"], |film, encoding| Ok(pnm::encode_pgm(film, encoding))),
    line(Format::Pbm, &["pbm"], |film, encoding| Ok(pnm::encode_pbm(film, encoding))),
    line(Format::Jpeg, &["jpg", "jpeg", "jpe"], rasters::encode_jpeg),
    line(Format::Bmp, &["bmp", "dib"], rasters::encode_bmp),
    line(Format::Tiff, &["tif", "tiff"], tiff::encode),
    line(Format::Jp2, &["jp2"], jp2::encode),
    line(Format::Sun, &["sr", "ras"], sun::encode),
    line(Format::Tga, &["tga"], rasters::encode_tga),
    line(Format::Webp, &["webp"], rasters::encode_webp),
    line(Format::Qoi, &["qoi"], rasters::encode_qoi),
    FormatLine { linear: true, ..line(Format::Hdr, &["hdr"], hdr::encode) },
];

type Encode = fn(&Film, Encoding) -> Result<Vec<u8>, String>;

const fn line(format: Format, words: &'static [&'static str], encode: Encode) -> FormatLine {
    FormatLine { format, words, linear: false, encode }
}

impl Format {
    /// The format of a word on the command line or a file's extension, in any case.
    pub fn from_word(word: &str) -> Option<Self> {
        let has = |line: &&FormatLine| line.words.iter().any(|w| w.eq_ignore_ascii_case(word));
        FORMATS.iter().find(has).map(|line| line.format)
    }

    /// The format that a file's extension names.
    pub fn of_file(path: &Path) -> Option<Self> {
        Self::from_word(path.extension()?.to_str()?)
    }

    /// The first of its words.
    pub fn word(self) -> &'static str {
        self.line().words[0]
    }

    fn line(self) -> &'static FormatLine {
        &FORMATS[self as usize]
    }
}

/// Bits of a channel in formats of integers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Bits {
    /// 8.
    #[default]
    Eight,
    /// 16.
    Sixteen,
}

impl Bits {
    /// 8 or 16.
    pub fn from_number(bits: u8) -> Option<Self> {
        match bits {
            8 => Some(Self::Eight),
            16 => Some(Self::Sixteen),
            _ => None,
        }
    }
}

/// How a film becomes a picture. Whether that has alpha is the film's to say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encoding {
    /// The format.
    pub format: Format,
    /// Bits of a channel where the format holds integers.
    pub bits: Bits,
    /// Exposure in stops where the format holds integers.
    pub exposure_stops: f32,
    /// Quality of JPEG, 1 to 100.
    pub quality: u8,
}

impl Encoding {
    /// Whether the colour of a picture is made of codes of 8 bits alone.
    pub fn takes_codes(self) -> bool {
        let luma = matches!(self.format, Format::Pgm | Format::Pbm);
        !self.format.line().linear && self.bits == Bits::Eight && !luma
    }

    /// Adds to a fingerprint what bears on the files' bytes.
    pub fn hash_into(self, h: &mut PartHasher) {
        h.bytes(self.format.word().as_bytes());
        if !self.format.line().linear {
            h.u64(self.bits as u64);
            h.f32(self.exposure_stops);
            h.u64(if self.format == Format::Jpeg { self.quality.into() } else { 0 });
        }
    }
}

/// A file of a finished frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PictureFile {
    /// Its path, relative to the output folder.
    pub path: PathBuf,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// The files that a picture consists of: itself and, where the format has no layers and auxiliary pictures are asked
/// for, `NAME.aov.exr` beside it.
pub fn file_names(picture: &Path, format: Format, aovs: AovSet) -> Vec<PathBuf> {
    let mut names = vec![picture.to_path_buf()];
    if format != Format::Exr && !aovs.is_empty() {
        names.push(aov_name(picture));
    }
    names
}

fn aov_name(picture: &Path) -> PathBuf {
    picture.with_extension("aov.exr")
}

/// Encodes a picture; auxiliary ones with it where the format has layers.
pub fn encode(film: &Film, encoding: Encoding) -> Result<Vec<u8>, OutputError> {
    let line = encoding.format.line();
    let refused = |why| OutputError::Encode { format: line.words[0], size: film.size, why };
    if film.rgb.is_empty() && film.codes.is_none() {
        return Err(refused("it has no pixels".into()));
    }
    (line.encode)(film, encoding).map_err(refused)
}

/// Encodes the files of a picture, the picture itself first. `picture` is relative to the output folder.
pub fn picture_files(
    picture: &Path,
    film: &Film,
    encoding: Encoding,
) -> Result<Vec<PictureFile>, OutputError> {
    let mut files = vec![PictureFile { path: picture.to_path_buf(), bytes: encode(film, encoding)? }];
    if encoding.format != Format::Exr && film.aovs.any() {
        let refused = |why| OutputError::Encode { format: "exr", size: film.size, why };
        files.push(PictureFile { path: aov_name(picture), bytes: exr::encode_aovs(film).map_err(refused)? });
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{Options, Settings, settings};

    #[test]
    fn the_table_is_in_order_and_has_the_words_of_the_job() {
        for (i, line) in FORMATS.iter().enumerate() {
            assert_eq!(line.format as usize, i);
        }
        let words: Vec<&str> = FORMATS.iter().flat_map(|line| line.words).copied().collect();
        assert_eq!(words, settings::FORMATS);
    }

    #[test]
    fn webp_holds_what_the_job_lets_through() {
        let encoding = Encoding { format: Format::Webp, bits: Bits::Eight, exposure_stops: 0.0, quality: 92 };
        let is_held = |size: [u32; 2]| {
            let options =
                Options { format: Some("webp".to_string()), size: Some(size), ..Options::default() };
            let mut film = Film::new(size, false, AovSet::default());
            film.rgb = vec![[0.5; 3]; (size[0] * size[1]) as usize].into();
            (encode(&film, encoding).is_ok(), Settings::new(&options).is_ok())
        };
        assert_eq!([is_held([16384, 1]), is_held([1, 16384])], [(true, true); 2]);
        assert_eq!([is_held([16385, 1]), is_held([1, 16385])], [(false, false); 2]);
    }
}
