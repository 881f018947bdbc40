//! The store on disk: what was made from inputs and can be made again, by the hash of what it was made from. Knows bytes,
//! not scenes.
//!
//! An entry is a file that is written under another name, flushed and renamed, so that it is whole or absent, for other
//! processes too; none locks another out. Its checksum covers what it is and for what, so that a damaged, cut or
//! swapped file is recognised, given up and told of.

mod entry;
mod folder;
mod payload;

pub use folder::{Removed, Stat, is_own_checkout};
pub use payload::Payload;

use entry::{Entry, Kind};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicBool, Ordering};

/// Bytes that a store keeps unless told otherwise.
pub const DEFAULT_LIMIT_BYTES: u64 = 4 << 30;

/// A store.
#[derive(Debug)]
pub struct Store {
    root: PathBuf,
    limit_bytes: u64,
    /// What is to be told: damaged entries, and once that nothing can be written.
    notes: Mutex<Vec<String>>,
    is_full: AtomicBool,
}

/// The name of an entry: what made it of what. 128 bits of a hash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key(pub u128);

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl Store {
    /// The store in a folder, which is made when something is put into it.
    pub fn new(root: &Path, limit_bytes: u64) -> Self {
        Self {
            root: root.to_path_buf(),
            limit_bytes,
            notes: Mutex::default(),
            is_full: AtomicBool::new(false),
        }
    }

    /// What `take` makes of what was put under a key; None where nothing was, or where it is damaged: then it is given
    /// up. `take` sees it before that is known, so it must bear with anything.
    pub fn get<T>(&self, kind: &str, key: Key, take: impl FnOnce(&mut Payload) -> Option<T>) -> Option<T> {
        let path = self.path(kind, key);
        match (Entry { kind: Kind::new(kind), key }).read(&path, take) {
            Ok(taken) => taken,
            Err(why) => {
                self.note(format!("{}: damaged ({why}); it is made anew", path.display()));
                folder::remove(&path);
                None
            }
        }
    }

    /// Puts something under a key. That it cannot be written stops nothing and is told once.
    pub fn put(&self, kind: &str, key: Key, payload: &[&[u8]]) {
        if self.is_full.load(Ordering::Relaxed) {
            return;
        }
        let path = self.path(kind, key);
        if let Err(error) = (Entry { kind: Kind::new(kind), key }).write(&path, payload)
            && !self.is_full.swap(true, Ordering::Relaxed)
        {
            self.note(format!(
                "{}: nothing more is kept in the store: {error}; --cache names another place, --no-cache does without",
                path.display()
            ));
        }
    }

    /// Takes what is to be told.
    pub fn take_notes(&self) -> Vec<String> {
        std::mem::take(&mut self.notes.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// What is in it.
    pub fn stat(&self) -> Stat {
        folder::stat(&self.root)
    }

    /// Removes what was not used for longest until it is within its limit, and what dead processes left; gives what was
    /// removed.
    pub fn collect_garbage(&self) -> Removed {
        folder::shrink(&self.root, self.limit_bytes)
    }

    /// Removes everything; gives what was removed.
    pub fn clear(&self) -> Removed {
        folder::shrink(&self.root, 0)
    }

    /// Its folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The bytes that it keeps at most.
    pub fn limit_bytes(&self) -> u64 {
        self.limit_bytes
    }

    fn note(&self, text: String) {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner).push(text);
    }

    fn path(&self, kind: &str, key: Key) -> PathBuf {
        let name = key.to_string();
        self.root.join(folder::VERSION).join(kind).join(&name[..2]).join(&name[2..])
    }
}

#[cfg(test)]
mod tests;
