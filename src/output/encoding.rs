//! Which files a picture has, and the encoder of each format.

use super::error::OutputError;
use super::{exr, png, ppm};
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
}

struct FormatLine {
    format: Format,
    word: &'static str,
    linear: bool,
    encode: fn(&Film, Encoding) -> Result<Vec<u8>, String>,
}

/// One line a format, in the order of [`Format`].
const FORMATS: [FormatLine; 3] = [
    FormatLine { format: Format::Png, word: "png", linear: false, encode: png::encode },
    FormatLine { format: Format::Exr, word: "exr", linear: true, encode: exr::encode },
    FormatLine {
        format: Format::Ppm,
        word: "ppm",
        linear: false,
        encode: |film, encoding| Ok(ppm::encode(film, encoding)),
    },
];

impl Format {
    /// The format of a word on the command line or a file's extension, in any case.
    pub fn from_word(word: &str) -> Option<Self> {
        FORMATS.iter().find(|line| line.word.eq_ignore_ascii_case(word)).map(|line| line.format)
    }

    /// The format that a file's extension names.
    pub fn of_file(path: &Path) -> Option<Self> {
        Self::from_word(path.extension()?.to_str()?)
    }

    /// Its word.
    pub fn word(self) -> &'static str {
        self.line().word
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
}

impl Encoding {
    /// Adds to a fingerprint what bears on the files' bytes.
    pub fn hash_into(self, h: &mut PartHasher) {
        h.bytes(self.format.word().as_bytes());
        if !self.format.line().linear {
            h.u64(self.bits as u64);
            h.f32(self.exposure_stops);
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

/// Encodes the files of a picture, the picture itself first. `picture` is relative to the output folder.
pub fn picture_files(
    picture: &Path,
    film: &Film,
    encoding: Encoding,
) -> Result<Vec<PictureFile>, OutputError> {
    let line = encoding.format.line();
    let refused = |format| move |why| OutputError::Encode { format, size: film.size, why };
    if film.rgb.is_empty() {
        return Err(refused(line.word)("it has no pixels".into()));
    }
    let bytes = (line.encode)(film, encoding).map_err(refused(line.word))?;
    let mut files = vec![PictureFile { path: picture.to_path_buf(), bytes }];
    if encoding.format != Format::Exr && film.aovs.any() {
        let bytes = exr::encode_aovs(film).map_err(refused("exr"))?;
        files.push(PictureFile { path: aov_name(picture), bytes });
    }
    Ok(files)
}
