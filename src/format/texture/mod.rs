//! Textures: picture files to texels with their mip levels, each file decoded once.

mod decode;
mod mip;

use super::error::FormatError;
use super::text;
use crate::clock::FileTime;
use crate::scene::{Part, TexelSpace, Texels, Texture};
use decode::Picture;
use rayon::prelude::*;
use std::collections::HashMap;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Textures that none of so many loads has used are given up: more than the frames that are read ahead.
const KEPT_LOADS: u64 = 16;

/// What the numbers of a map are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) enum TextureUse {
    /// Colour: on the sRGB curve where they are integers.
    Color,
    /// Heights, normals, shares: as they stand.
    Data,
}

/// Decoded textures by file, so that frames that follow one another decode each once. What the last few loads did not
/// use is given up.
///
/// Loading decodes on all threads of rayon's pool while others that load wait. It must not be called from a thread of
/// that pool, which could take up another load while it waits for its own, and so for itself.
#[derive(Debug, Default)]
pub struct TextureCache {
    held: Mutex<Held>,
}

#[derive(Debug, Default)]
struct Held {
    loads: u64,
    textures: HashMap<Key, Entry>,
}

/// A file's content, as far as the system tells it apart, and its use.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Key {
    path: PathBuf,
    size: u64,
    changed: Option<FileTime>,
    texture_use: TextureUse,
}

#[derive(Debug)]
struct Entry {
    texture: Result<Part<Texture>, String>,
    last_load: u64,
}

/// A texture, or why there is none.
#[derive(Clone, Debug)]
pub(super) struct LoadedTexture {
    pub texture: Result<Part<Texture>, String>,
    /// Bytes of the file, where it was read for this.
    pub bytes_read: u64,
}

impl TextureCache {
    /// The textures in those files.
    pub(super) fn load(&self, wanted: &[(PathBuf, TextureUse)]) -> Vec<LoadedTexture> {
        let keys: Vec<_> = wanted.iter().map(|(path, texture_use)| key(path, *texture_use)).collect();
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        held.loads += 1;
        let this_load = held.loads;
        let absent: Vec<Option<&Key>> =
            keys.iter().map(|key| key.as_ref().ok().filter(|key| !held.textures.contains_key(key))).collect();
        let decoded: Vec<Option<_>> =
            absent.par_iter().map(|key| key.map(|key| (key, decoded(&key.path, key.texture_use)))).collect();
        let mut read = vec![0; keys.len()];
        for (read, (key, texture)) in read.iter_mut().zip(decoded).filter_map(|(read, d)| Some((read, d?))) {
            *read = key.size;
            let texture = texture.map_err(|error| error.to_string());
            held.textures.insert(key.clone(), Entry { texture, last_load: this_load });
        }
        let of_key = |held: &mut Held, key: &Key| {
            let entry = held.textures.get_mut(key)?;
            entry.last_load = this_load;
            Some(entry.texture.clone())
        };
        let textures = keys.iter().zip(read).map(|(key, bytes_read)| LoadedTexture {
            texture: match key {
                // every key was held or has just been decoded
                Ok(key) => of_key(&mut held, key).unwrap_or_else(|| Err("is gone".to_owned())),
                Err(error) => Err(error.to_string()),
            },
            bytes_read,
        });
        let textures = textures.collect();
        held.textures.retain(|_, entry| entry.last_load + KEPT_LOADS > this_load);
        textures
    }
}

fn key(path: &Path, texture_use: TextureUse) -> Result<Key, FormatError> {
    let unreadable = |source| FormatError::Unreadable { path: path.to_path_buf(), source };
    let real = path.canonicalize().map_err(unreadable)?;
    let metadata = fs::metadata(&real).map_err(unreadable)?;
    Ok(Key { path: real, size: metadata.len(), changed: metadata.modified().ok(), texture_use })
}

/// Reads a picture of colours, for the background: 8-bit ones are sRGB.
pub fn load_picture(path: &Path) -> Result<Part<Texture>, FormatError> {
    decoded(path, TextureUse::Color)
}

/// Reads and decodes a file.
fn decoded(path: &Path, texture_use: TextureUse) -> Result<Part<Texture>, FormatError> {
    let bytes = text::read(path)?;
    // decoders are other people's code: what they do on broken files must not end the run
    let picture = catch_unwind(AssertUnwindSafe(|| decode::decode(&bytes, path)))
        .unwrap_or_else(|_| Err("is broken, its decoder gave up on it".to_owned()));
    picture
        .map(|picture| Part::new(texture(picture, texture_use)))
        .map_err(|cause| FormatError::BadPicture { path: path.to_path_buf(), cause })
}

/// Makes a texture of decoded texels. 8-bit ones stay what they are; finer integers become floats, colours through the
/// sRGB curve.
fn texture(picture: Picture, texture_use: TextureUse) -> Texture {
    let is_color = texture_use == TextureUse::Color;
    let Picture { size, texels: level } = picture;
    let space = match (&level, texture_use) {
        (decode::Level::U8(_), TextureUse::Color) => TexelSpace::Srgb,
        _ => TexelSpace::Linear,
    };
    let (alpha_varies, texels) = match level {
        decode::Level::U8(texels) => {
            let varies = texels.par_iter().any(|texel| texel[3] != 255);
            (varies, Texels::U8(mip::levels_u8(size, texels, space, is_color && varies)))
        }
        decode::Level::U16(texels) => {
            let texels: Vec<_> = texels.par_iter().map(|texel| mip::floats(*texel, is_color)).collect();
            with_levels_f32(size, texels, is_color)
        }
        decode::Level::F32(texels) => with_levels_f32(size, texels, is_color),
    };
    Texture { size, space, alpha_varies, texels }
}

fn with_levels_f32(size: [u32; 2], texels: Vec<[f32; 4]>, is_color: bool) -> (bool, Texels) {
    let varies = texels.par_iter().any(|texel| texel[3] != 1.0);
    (varies, Texels::F32(mip::levels_f32(size, texels, is_color && varies)))
}
