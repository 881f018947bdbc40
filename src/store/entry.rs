//! One entry: a head that says what it is, its payload, and a checksum over both.

use super::{Key, Payload};
use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use xxhash_rust::xxh3::Xxh3;

/// The first bytes of an entry.
const MAGIC: [u8; 8] = *b"rentix01";
/// Magic, kind, key, length, checksum.
pub(super) const HEAD_BYTES: usize = 8 + 8 + 16 + 8 + 16;

/// The kind of an entry as a number, so that equal keys of different kinds differ.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kind(u64);

impl Kind {
    pub(super) fn new(kind: &str) -> Self {
        Self(xxhash_rust::xxh3::xxh3_64(kind.as_bytes()))
    }
}

/// What an entry is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub(super) kind: Kind,
    pub(super) key: Key,
}

impl Entry {
    /// What its checksum begins with.
    pub(super) fn hasher(self) -> Xxh3 {
        let mut hasher = Xxh3::new();
        hasher.update(&self.kind.0.to_le_bytes());
        hasher.update(&self.key.0.to_le_bytes());
        hasher
    }

    /// What `take` makes of the payload; None where there is no file or `take` gives none; else what is wrong with the
    /// file, whatever was made of it. A file that is read counts as used now.
    pub(super) fn read<T>(
        self,
        path: &Path,
        take: impl FnOnce(&mut Payload) -> Option<T>,
    ) -> Result<Option<T>, String> {
        let file = match File::open(path) {
            Ok(file) => file,
            Err(e) if matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => return Ok(None),
            Err(e) => return Err(e.to_string()),
        };
        let (mut payload, head) = Payload::open(self, file).map_err(|e| match e.kind() {
            ErrorKind::UnexpectedEof => "it is cut off".to_string(),
            _ => e.to_string(),
        })?;
        let length = payload.left;
        let taken = take(&mut payload);
        let checksum = payload.finish().map_err(|e| e.to_string())?;
        if head[..] != self.head(length, checksum) {
            return Err("its checksum is another".to_string());
        }
        // a store that cannot be written forgets in another order
        let _ = payload.file.set_modified(crate::clock::file_time());
        Ok(taken)
    }

    /// Writes it whole or not at all.
    pub(super) fn write(self, path: &Path, payload: &[&[u8]]) -> io::Result<()> {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let folder = path.parent().ok_or(ErrorKind::InvalidInput)?;
        fs::create_dir_all(folder)?;
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let unfinished = folder.join(format!("{}{}-{number}", super::folder::UNFINISHED, std::process::id()));
        let length = payload.iter().map(|bytes| bytes.len() as u64).sum();
        let mut hasher = self.hasher();
        for bytes in payload {
            hasher.update(bytes);
        }
        let written = File::create(&unfinished).and_then(|mut file| {
            file.write_all(&self.head(length, hasher.digest128()))?;
            payload.iter().try_for_each(|bytes| file.write_all(bytes))?;
            // not flushed to the disk: what a power cut leaves is recognised by its checksum
            drop(file);
            fs::rename(&unfinished, path)
        });
        if written.is_err() {
            super::folder::remove(&unfinished);
        }
        written
    }

    fn head(self, length: u64, checksum: u128) -> Vec<u8> {
        let mut head = Vec::with_capacity(HEAD_BYTES);
        head.extend(MAGIC);
        head.extend(self.kind.0.to_le_bytes());
        head.extend(self.key.0.to_le_bytes());
        head.extend(length.to_le_bytes());
        head.extend(checksum.to_le_bytes());
        head
    }
}
