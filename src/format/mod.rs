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
use crate::scene::Geometry;
use crate::warning::Warnings;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use error::FormatError;
pub use gltf::{ClipChoice, Gltf, GltfClips, GltfFrame, GltfOptions, NamedCamera, gltf_clips, is_gltf};
pub use library::Library;
pub use mtl::is_mtl_word;
pub use obj::{Parsed, ParsedObj, parse_obj};
use text::Text;
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

/// An OBJ with all that it refers to.
#[derive(Clone, Debug)]
pub struct Loaded {
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
    /// Libraries and textures that were named and cannot be had, each as a sentence.
    pub missing: Vec<String>,
}

/// Reads an OBJ and all that it refers to; textures through a cache. Must not be called from a thread of rayon's pool
/// (see [`TextureCache`]).
pub fn load_obj(path: &Path, options: &ReadOptions, textures: &TextureCache) -> Result<Loaded, FormatError> {
    load_obj_after(None, path, options, textures).map(|(loaded, _)| loaded)
}

/// [`load_obj`] with another frame of the sequence at hand: what is the same there is not read again, and shared. What
/// comes out does not depend on it. The second value serves the next frame; None where it would not help.
pub fn load_obj_after(
    before: Option<&Parsed>,
    path: &Path,
    options: &ReadOptions,
    textures: &TextureCache,
) -> Result<(Loaded, Option<Parsed>), FormatError> {
    let watch = Stopwatch::start();
    let bytes = text::read(path)?;
    let read_ms = watch.ms();
    let watch = Stopwatch::start();
    let text = Text::new(&bytes, path)?;
    let mut warnings = Warnings::default();
    let lines = obj::Lines::new(&text, path, options.lenient, before, &mut warnings)?;
    let mut loader = library::Loader::new(path, options);
    let library = loader.library(lines.libraries(), lines.used_materials(), textures, &mut warnings)?;
    let shape = lines.into_shape(&library, options, &mut warnings);
    let inputs = std::iter::once(path.to_path_buf()).chain(loader.inputs).collect();
    let bytes_read = bytes.len() as u64 + loader.bytes_read;
    let (geometry, material_names, parsed) = shape.keep(bytes);
    let loaded = Loaded {
        geometry,
        inputs,
        material_names,
        bytes_read,
        read_ms,
        parse_ms: watch.ms(),
        warnings,
        missing: loader.missing,
    };
    Ok((loaded, parsed))
}

/// The box of the positions in an OBJ that are finite, as [`load_obj`] gives them; empty where there is none.
pub fn scan_bounds(path: &Path) -> Result<Bounds, FormatError> {
    let mut bounds = Bounds::EMPTY;
    text::read_pieces(path, |text| obj::add_to_bounds(&mut bounds, text))?;
    Ok(bounds)
}

/// The libraries that an OBJ names and the maps of all materials, as far as they are there; the buffers and images of a
/// glTF. The shape is not read, and what cannot be read names nothing: this is for what must not be written over.
pub fn named_files(path: &Path, options: &ReadOptions) -> Vec<PathBuf> {
    if is_gltf(path) {
        return gltf::named_files(path);
    }
    let Ok(bytes) = text::read(path) else { return Vec::new() };
    let Ok(text) = Text::new(&bytes, path) else { return Vec::new() };
    library::Loader::new(path, options).named_files(&obj::library_statements(&text))
}
