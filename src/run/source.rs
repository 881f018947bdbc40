//! Loaded files of a run: what stands in more than one picture is parsed once.

use super::animation::Animations;
use crate::clock::FileTime;
use crate::format::{self, FormatError, Loaded, ReadOptions, TextureCache};
use crate::store::Store;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// A file's state as the system tells it: size and time of change.
pub(super) type Stamp = (u64, Option<FileTime>);

/// How long a file is; 0 where the system does not tell.
pub(super) fn file_bytes(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |m| m.len())
}

/// A file's state.
pub(super) fn stamp(path: &Path) -> Stamp {
    std::fs::metadata(path).map(|m| (m.len(), m.modified().ok())).unwrap_or_default()
}

struct Kept {
    stamp: Stamp,
    options: ReadOptions,
    loaded: Arc<Loaded>,
    /// Whether a picture has used it, so that its costs are told already.
    used: bool,
}

/// Files that will be used again: still layers for the whole run, first frames that were read for their lights until
/// their turn comes, and textures as long as frames use them.
#[derive(Default)]
pub struct Sources {
    kept: Mutex<HashMap<PathBuf, Kept>>,
    textures: TextureCache,
    pub(super) animations: Animations,
}

impl Sources {
    /// With a limit on the bytes that one frame's textures may take together, and a store.
    pub(super) fn new(texture_bytes: Option<u64>, store: Option<Arc<Store>>) -> Self {
        Self {
            textures: TextureCache::new(texture_bytes, store),
            animations: Animations::with_limit(texture_bytes),
            ..Self::default()
        }
    }

    /// Loads an OBJ before its picture's turn and keeps it until then.
    pub(super) fn ahead(&self, path: &Path, options: &ReadOptions) -> Result<Arc<Loaded>, FormatError> {
        self.get(path, options, true, false).map(|(loaded, _)| loaded)
    }

    /// Loads an OBJ for a picture, or gives what is kept of it if the file's size and time are the same. `still`
    /// keeps it for the other pictures. The flag tells whether this picture is the first to use it.
    pub(super) fn load(
        &self,
        path: &Path,
        options: &ReadOptions,
        still: bool,
    ) -> Result<(Arc<Loaded>, bool), FormatError> {
        self.get(path, options, still, true)
    }

    fn get(
        &self,
        path: &Path,
        options: &ReadOptions,
        keep: bool,
        uses: bool,
    ) -> Result<(Arc<Loaded>, bool), FormatError> {
        let stamp = stamp(path);
        {
            let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(k) = kept.get_mut(path).filter(|k| k.stamp == stamp && k.options == *options) {
                let found = (Arc::clone(&k.loaded), !k.used);
                k.used |= uses;
                if !keep {
                    kept.remove(path);
                }
                return Ok(found);
            }
        }
        let loaded = Arc::new(format::load_obj(path, options, &self.textures)?);
        if keep {
            let entry = Kept { stamp, options: options.clone(), loaded: Arc::clone(&loaded), used: uses };
            self.kept.lock().unwrap_or_else(PoisonError::into_inner).insert(path.to_path_buf(), entry);
        }
        Ok((loaded, true))
    }
}
