//! Textures: picture files to texels with their mip levels, each file decoded once.

mod decode;
mod mip;
mod stored;

use super::error::FormatError;
use super::text;
use crate::clock::FileTime;
use crate::scene::{Part, TexelSpace, Texels, Texture};
use crate::store::Store;
use decode::Picture;
pub(super) use decode::Room;
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

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
    limit_bytes: Option<u64>,
    store: Option<Arc<Store>>,
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
    /// One that refuses textures of one load that take more than so many bytes together, mip levels included. Textures that a store holds are taken from it, others put into it.
    pub fn new(limit_bytes: Option<u64>, store: Option<Arc<Store>>) -> Self {
        Self { limit_bytes, store, ..Self::default() }
    }

    /// One with the same limit that holds nothing and has no store.
    #[must_use]
    pub fn emptied(&self) -> Self {
        Self::new(self.limit_bytes, None)
    }

    /// The textures in those files, each decoded where it is not held. `obj` is what they are loaded for.
    ///
    /// # Errors
    /// Where all of them together are beyond the limit; what was to be decoded is then not kept.
    pub(super) fn load(
        &self,
        obj: &Path,
        wanted: &[(PathBuf, TextureUse)],
    ) -> Result<Vec<LoadedTexture>, FormatError> {
        let keys: Vec<_> = wanted.iter().map(|(path, texture_use)| key(path, *texture_use)).collect();
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        held.loads += 1;
        let this_load = held.loads;
        // two names of one file have one key
        let absent: HashSet<&Key> =
            keys.iter().flatten().filter(|key| !held.textures.contains_key(key)).collect();
        let limit_bytes = self.limit_bytes.unwrap_or(u64::MAX);
        let room = Room::new(limit_bytes);
        let present: HashSet<&Key> = keys.iter().flatten().filter(|key| !absent.contains(key)).collect();
        for entry in present.into_iter().filter_map(|key| held.textures.get(key)) {
            room.take(entry.texture.as_ref().map_or(0, Part::bytes));
        }
        let store = self.store.as_deref();
        let mut decoded: HashMap<&Key, _> = absent
            .into_par_iter()
            .map(|key| (key, decoded(&key.path, key.texture_use, &room, store)))
            .collect();
        if let Some(needed_bytes) = room.exceeded() {
            return Err(FormatError::TexturesTooLarge { path: obj.to_path_buf(), needed_bytes, limit_bytes });
        }
        let mut textures = Vec::with_capacity(keys.len());
        for key in &keys {
            textures.push(match key {
                Err(error) => LoadedTexture { texture: Err(error.to_string()), bytes_read: 0 },
                Ok(key) => held.take(key, decoded.remove(key)),
            });
        }
        held.textures.retain(|_, entry| entry.last_load + KEPT_LOADS > this_load);
        Ok(textures)
    }
}

impl Held {
    /// The texture of a key, which is held or was just decoded.
    fn take(&mut self, key: &Key, decoded: Option<Result<Part<Texture>, FormatError>>) -> LoadedTexture {
        let bytes_read = if decoded.is_some() { key.size } else { 0 };
        if let Some(decoded) = decoded {
            let texture = decoded.map_err(|error| error.to_string());
            self.textures.insert(key.clone(), Entry { texture, last_load: self.loads });
        }
        let texture = match self.textures.get_mut(key) {
            Some(entry) => {
                entry.last_load = self.loads;
                entry.texture.clone()
            }
            None => Err(format!("{}: was not decoded", key.path.display())),
        };
        LoadedTexture { texture, bytes_read }
    }
}

fn key(path: &Path, texture_use: TextureUse) -> Result<Key, FormatError> {
    let unreadable = |cause| FormatError::Unreadable { path: path.to_path_buf(), cause };
    let real = path.canonicalize().map_err(unreadable)?;
    let metadata = fs::metadata(&real).map_err(unreadable)?;
    Ok(Key { path: real, size: metadata.len(), changed: metadata.modified().ok(), texture_use })
}

/// Reads a picture of colours, for the background: 8-bit ones are sRGB.
pub fn load_picture(path: &Path) -> Result<Part<Texture>, FormatError> {
    decoded(path, TextureUse::Color, &Room::new(u64::MAX), None)
}

/// Reads and decodes a file, or takes from the store what becomes of it.
fn decoded(
    path: &Path,
    texture_use: TextureUse,
    room: &Room,
    store: Option<&Store>,
) -> Result<Part<Texture>, FormatError> {
    let bytes = text::read(path)?;
    let stored = store.map(|store| (store, stored::key(&bytes, texture_use)));
    if let Some(texture) = stored.and_then(|(store, key)| stored::get(store, key)) {
        let part = Part::new(texture);
        room.take(part.bytes());
        return Ok(part);
    }
    decoded_from_bytes(&bytes, path, texture_use, room)
        .inspect(|texture| {
            if let Some((store, key)) = stored {
                stored::put(store, key, texture);
            }
        })
        .map_err(|cause| FormatError::BadPicture { path: path.to_path_buf(), cause })
}

/// Decodes a picture in memory, known by its first bytes, or by a file's name where those say nothing. An error is
/// what is wrong with it. The memory for its texels is taken from the room first.
pub(super) fn decoded_from_bytes(
    bytes: &[u8],
    name: &Path,
    texture_use: TextureUse,
    room: &Room,
) -> Result<Part<Texture>, String> {
    // decoders are other people's code: what they do on broken files must not end the run
    let picture = catch_unwind(AssertUnwindSafe(|| decode::decode(bytes, name, room)))
        .unwrap_or_else(|_| Err("is broken, its decoder gave up on it".to_owned()));
    picture.map(|picture| Part::new(texture(picture, texture_use)))
}

/// A texture of shares of 255, one a texel, row by row from the top, with its mip levels. There must be as many as
/// the size says.
pub(super) fn share_texture(size: [u32; 2], shares: impl Iterator<Item = u8>) -> Texture {
    let texels = decode::Level::U8(shares.map(|share| [share, share, share, 255]).collect());
    texture(Picture { size, texels }, TextureUse::Data)
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
