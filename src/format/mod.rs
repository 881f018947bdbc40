//! Bytes to values with diagnostics: OBJ, MTL, glTF and textures. The only room that reads scenes.

#[cfg(target_arch = "x86_64")]
mod decimals;
mod error;
mod gltf;
mod library;
mod lookup;
mod material;
mod mtl;
mod number;
mod obj;
mod text;
mod texture;
mod triple;
#[cfg(target_arch = "x86_64")]
mod wide;

use crate::clock::Stopwatch;
use crate::math::Bounds;
use crate::scene::{Geometry, PartHash};
use crate::store::Store;
use crate::warning::Warnings;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use error::FormatError;
pub use gltf::{ClipChoice, Gltf, GltfClips, GltfFrame, GltfOptions, NamedCamera, gltf_clips, is_gltf};
pub use library::Library;
pub use mtl::{mtl_word_accepts, mtl_word_takes, mtl_words};
pub use obj::{Parsed, ParsedObj, parse_obj};
use text::Text;
pub use text::open_plain;
pub use texture::{TextureCache, load_picture};

/// How files are read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// Whether faces that cannot be rendered are dropped with a warning, where they would fail their frame.
    pub lenient: bool,
    /// Normals are smoothed over triangles within this angle, degrees, where the file gives none; None: within
    /// smoothing groups.
    pub smooth_angle_deg: Option<f32>,
    /// Whether the colours in an MTL are sRGB; else they are linear.
    pub mtl_srgb: bool,
    /// An MTL whose materials replace those of the same name.
    pub materials_file: Option<PathBuf>,
    /// Statements of the job that replace those of the materials named; applied last.
    pub material_overrides: Vec<MaterialOverride>,
    /// The folder out of which no name leads, links followed: what is behind such a name counts as missing. None: names
    /// lead anywhere.
    pub within: Option<PathBuf>,
}

/// Statements for one material.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialOverride {
    /// The material's name.
    pub name: Vec<u8>,
    /// Words of an MTL and what stands behind them.
    pub words: Vec<(String, String)>,
    /// The job file that says so; the files of maps are relative to it.
    pub said_in: PathBuf,
}

/// How an OBJ was parsed, by rising work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum ParseKind {
    /// Not at all: a store had what stands in it.
    #[default]
    Restored,
    /// With another frame of the sequence at hand.
    Incremental,
    /// Whole.
    Full,
}

/// An OBJ with all that it refers to.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// How it was parsed.
    pub kind: ParseKind,
    /// Shape and materials.
    pub geometry: Arc<Geometry>,
    /// Every file whose content it is made of: OBJ, MTL, textures.
    pub inputs: Vec<PathBuf>,
    /// For each slot of [`Geometry::materials`] the first name under which it was used.
    pub material_names: Vec<Vec<u8>>,
    /// Bytes that were read; a texture that was in the cache costs none.
    pub bytes_read: u64,
    /// Time to read the OBJ, milliseconds.
    pub read_ms: f64,
    /// Time for everything else, milliseconds: parsing, materials, triangles, hashes.
    pub parse_ms: f64,
    /// What is wrong but does not stop the frame.
    pub warnings: Warnings,
    /// Libraries, textures and materials that were named and cannot be had, each as a sentence.
    pub missing: Vec<String>,
    /// Names of materials that the options' overrides speak of and no face has.
    pub unmet_overrides: Vec<Vec<u8>>,
}

/// Reads an OBJ and all that it refers to; textures through a cache. Must not be called from a thread of rayon's pool
/// (see [`TextureCache`]).
pub fn load_obj(path: &Path, options: &ReadOptions, textures: &TextureCache) -> Result<Loaded, FormatError> {
    load_obj_after(None, Vec::new(), path, options, textures).map(|(loaded, _)| loaded)
}

/// [`load_obj`] with another frame of the sequence at hand: what is the same there is not read again, and shared. What
/// comes out does not depend on it. The text goes into `room`, for which an older frame's can be given: new memory costs
/// more than reading does. The second value serves the next frame; None where it would not help.
pub fn load_obj_after(
    before: Option<&Parsed>,
    room: Vec<u8>,
    path: &Path,
    options: &ReadOptions,
    textures: &TextureCache,
) -> Result<(Loaded, Option<Parsed>), FormatError> {
    let watch = Stopwatch::start();
    let bytes = text::read_into(room, path)?;
    load_text(before, bytes, watch.ms(), None, path, options, textures)
}

/// [`load_obj`] through a store: the shape in a file of the same bytes is taken from it, where it holds it, and put into
/// it, where it does not. What comes out does not depend on it. The second value is that of [`load_obj_after`], where
/// another frame follows.
pub fn load_obj_stored(
    store: &Store,
    is_followed: bool,
    path: &Path,
    options: &ReadOptions,
    textures: &TextureCache,
) -> Result<(Loaded, Option<Parsed>), FormatError> {
    let watch = Stopwatch::start();
    // the text itself is for the next frame, or to be parsed
    let text = if is_followed { Some(text::read(path)?) } else { None };
    let digest = text.as_deref().map_or_else(|| text::digest(path), |text| Ok(text::digest_of(text)))?;
    let read_ms = watch.ms();
    let watch = Stopwatch::start();
    let key = obj::stored::key(digest, is_followed, options);
    let Some(stored) = obj::stored::get(store, key, digest.1) else {
        let bytes = text.map_or_else(|| text::read(path), Ok)?;
        let store = Some((store, is_followed));
        return load_text(None, bytes, read_ms + watch.ms(), store, path, options, textures);
    };
    let mut warnings = stored.warnings(path);
    let mut loader = library::Loader::new(path, options);
    let line_of = |word: &[u8], behind: &[u8]| line_in_file(path, text.as_deref(), word, behind);
    let library =
        loader.library(&stored.libraries(), stored.used_materials(), textures, &line_of, &mut warnings)?;
    let shape = stored.into_shape(&library, path, &line_of, &mut warnings);
    Ok(loaded(ParseKind::Restored, path, digest.1, text, shape, loader, warnings, read_ms, &watch))
}

/// The line of a statement in a file of which the text may be at hand.
fn line_in_file(path: &Path, text: Option<&[u8]>, word: &[u8], behind: &[u8]) -> Option<u32> {
    let read = if text.is_none() { Some(text::read(path).ok()?) } else { None };
    obj::line_of(&Text::new(text.or(read.as_deref())?, path).ok()?, word, behind)
}

/// Reads an OBJ in memory and all that it refers to; puts it into a store, where one is given, with whether another
/// frame follows.
fn load_text(
    before: Option<&Parsed>,
    bytes: Vec<u8>,
    read_ms: f64,
    store: Option<(&Store, bool)>,
    path: &Path,
    options: &ReadOptions,
    textures: &TextureCache,
) -> Result<(Loaded, Option<Parsed>), FormatError> {
    let watch = Stopwatch::start();
    let kind = if before.is_some() { ParseKind::Incremental } else { ParseKind::Full };
    let text = Text::new(&bytes, path)?;
    let mut warnings = Warnings::default();
    let lines = obj::Lines::new(&text, path, options.lenient, before, &mut warnings)?;
    let said = store.map(|_| lines.said(&warnings));
    let mut loader = library::Loader::new(path, options);
    let line_of = |word: &[u8], behind: &[u8]| obj::line_of(&text, word, behind);
    let library =
        loader.library(lines.libraries(), lines.used_materials(), textures, &line_of, &mut warnings)?;
    let shape = lines.into_shape(&library, options, &mut warnings);
    if let (Some((store, is_followed)), Some(said)) = (store, said) {
        // of these bytes: the file may have changed since it was looked for
        let key = obj::stored::key(text::digest_of(&bytes), is_followed, options);
        obj::stored::put(store, key, &said, &shape, is_followed);
    }
    Ok(loaded(kind, path, bytes.len() as u64, Some(bytes), shape, loader, warnings, read_ms, &watch))
}

#[allow(clippy::too_many_arguments, reason = "the two ways' ends")]
fn loaded(
    kind: ParseKind,
    path: &Path,
    length: u64,
    text: Option<Vec<u8>>,
    mut shape: obj::Shape,
    loader: library::Loader,
    warnings: Warnings,
    read_ms: f64,
    watch: &Stopwatch,
) -> (Loaded, Option<Parsed>) {
    let missing = loader.missing.into_iter().chain(shape.missing.take()).collect();
    let inputs = std::iter::once(path.to_path_buf()).chain(loader.inputs).collect();
    let (geometry, material_names, parsed) = shape.keep(text);
    let loaded = Loaded {
        kind,
        geometry,
        inputs,
        material_names,
        bytes_read: length + loader.bytes_read,
        read_ms,
        parse_ms: watch.ms(),
        warnings,
        missing,
        unmet_overrides: loader.unmet_overrides,
    };
    (loaded, parsed)
}

/// Whether an OBJ can be read to its end; libraries and textures are not looked at.
pub fn check_obj(path: &Path) -> Result<(), FormatError> {
    let bytes = text::read(path)?;
    let text = Text::new(&bytes, path)?;
    obj::Lines::new(&text, path, false, None, &mut Warnings::default()).map(drop)
}

/// The box of the positions in an OBJ that are finite, as [`load_obj`] gives them; empty where there is none.
pub fn scan_bounds(path: &Path) -> Result<Bounds, FormatError> {
    let (mut bounds, mut is_binary) = (Bounds::EMPTY, false);
    text::read_pieces(path, |text| {
        is_binary |= text.first_zero.is_some();
        obj::add_to_bounds(&mut bounds, text);
    })?;
    if is_binary {
        // tells the line, which no piece knows
        check_obj(path)?;
    }
    Ok(bounds)
}

/// A name for the content of a file.
pub fn digest(path: &Path) -> Result<PartHash, FormatError> {
    text::digest(path).map(|(hash, _)| hash)
}

/// The libraries that an OBJ names and the maps of all materials, as far as they are there; the buffers and images of a
/// glTF. The shape is not read, and what cannot be read names nothing: this is for what must not be written over.
pub fn named_files(path: &Path, options: &ReadOptions) -> Vec<PathBuf> {
    if is_gltf(path) {
        return gltf::named_files(path);
    }
    let mut libraries: Vec<Vec<u8>> = Vec::new();
    let read = text::read_pieces(path, |text| {
        libraries.extend(obj::library_statements(text).into_iter().map(<[u8]>::to_vec));
    });
    if read.is_err() {
        return Vec::new();
    }
    let libraries: Vec<&[u8]> = libraries.iter().map(Vec::as_slice).collect();
    library::Loader::new(path, options).named_files(&libraries)
}
