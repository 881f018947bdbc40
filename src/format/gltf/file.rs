//! A glTF file in memory: its JSON, its buffers, and what both refer to, each length checked.

use super::Cause;
use super::uri;
use crate::format::error::FormatError;
use crate::format::text;
use gltf::json;
use gltf::json::{Index, Root};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Extensions that a file may require.
const KNOWN_EXTENSIONS: [&str; 6] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_texture_transform",
];

/// The most bytes that all buffers of a file may have together.
const MAX_BUFFER_BYTES: u64 = text::MAX_FILE_BYTES;

/// The most numbers that are read from a file's buffers, each as often as it is read: what is named again and again
/// must not take memory beyond measure.
const MAX_NUMBERS: u64 = 1 << 29;

/// A glTF file and its buffers.
#[derive(Debug)]
pub(super) struct File {
    /// The file.
    pub path: PathBuf,
    /// Its JSON. Indices in it need not be those of anything.
    pub root: Root,
    /// Each buffer's bytes.
    buffers: Vec<Vec<u8>>,
    /// Every file that was read: glTF, buffers.
    pub inputs: Vec<PathBuf>,
    /// Their bytes.
    pub bytes_read: u64,
    numbers_read: AtomicU64,
}

impl File {
    /// Reads a file and its buffers.
    pub(super) fn open(path: &Path) -> Result<Self, FormatError> {
        let bytes = text::read(path)?;
        Self::from_bytes(&bytes, path)
    }

    /// The same from memory; other files that it names are relative to `path`.
    pub(super) fn from_bytes(bytes: &[u8], path: &Path) -> Result<Self, FormatError> {
        let bad = |cause: Cause| cause.at(path);
        let (root, blob) = parse(bytes).map_err(bad)?;
        check_extensions(&root).map_err(bad)?;
        let mut file = Self {
            path: path.to_path_buf(),
            root,
            buffers: Vec::new(),
            inputs: vec![path.to_path_buf()],
            bytes_read: bytes.len() as u64,
            numbers_read: AtomicU64::new(0),
        };
        file.read_buffers(blob)?;
        Ok(file)
    }

    fn read_buffers(&mut self, mut blob: Option<Vec<u8>>) -> Result<(), FormatError> {
        let mut all_bytes = 0;
        for i in 0..self.root.buffers.len() {
            let (length, uri) = (self.root.buffers[i].byte_length.0, self.root.buffers[i].uri.clone());
            let bytes = match uri {
                Some(uri) => self.named_bytes(&uri, &format!("buffer {i}"))?,
                None => blob.take().filter(|_| i == 0).ok_or_else(|| {
                    Cause::broken(format!("buffer {i} has neither a uri nor a BIN chunk")).at(&self.path)
                })?,
            };
            if (bytes.len() as u64) < length {
                let text = format!("buffer {i} has {} bytes, {length} are said", bytes.len());
                return Err(Cause::broken(text).at(&self.path));
            }
            all_bytes += bytes.len() as u64;
            if all_bytes > MAX_BUFFER_BYTES {
                let text = format!(
                    "its buffers have more than {MAX_BUFFER_BYTES} bytes together; split it into several files"
                );
                return Err(Cause(text).at(&self.path));
            }
            self.buffers.push(bytes);
        }
        Ok(())
    }

    /// The bytes behind a URI: the data in it, or a file beside the glTF.
    fn named_bytes(&mut self, uri: &str, what: &str) -> Result<Vec<u8>, FormatError> {
        match uri::target(uri) {
            Ok(uri::Target::Data(bytes)) => Ok(bytes),
            Ok(uri::Target::File(name)) => {
                let path = self.beside(&name);
                let bytes = text::read(&path)?;
                self.bytes_read += bytes.len() as u64;
                self.inputs.push(path);
                Ok(bytes)
            }
            Err(text) => Err(Cause::broken(format!("{what}: {text}")).at(&self.path)),
        }
    }

    /// A file named relative to the glTF.
    pub(super) fn beside(&self, name: &str) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(name)
    }

    /// The bytes of a buffer view and its stride.
    pub(super) fn view(&self, index: Index<json::buffer::View>) -> Result<(&[u8], Option<usize>), Cause> {
        let at = index.value();
        let broken = |text: &str| Cause::broken(format!("buffer view {at} {text}"));
        let view = self.root.buffer_views.get(at).ok_or_else(|| broken("is named and is not there"))?;
        let buffer = self
            .buffers
            .get(view.buffer.value())
            .ok_or_else(|| broken("is of a buffer that is not there"))?;
        let start = view.byte_offset.unwrap_or_default().0;
        let end = start.checked_add(view.byte_length.0).filter(|&end| end <= buffer.len() as u64);
        let end = end.ok_or_else(|| broken("reaches beyond its buffer"))?;
        // both are within a slice's length
        Ok((&buffer[start as usize..end as usize], view.byte_stride.map(|stride| stride.0)))
    }

    /// Counts numbers before they are read.
    pub(super) fn take_numbers(&self, count: u64) -> Result<(), Cause> {
        let before = self.numbers_read.fetch_add(count.min(MAX_NUMBERS + 1), Ordering::Relaxed);
        if before.saturating_add(count) > MAX_NUMBERS {
            return Err(Cause(format!(
                "its accessors give more than {MAX_NUMBERS} numbers; split it into several files"
            )));
        }
        Ok(())
    }
}

/// Splits a binary file and parses the JSON.
fn parse(bytes: &[u8]) -> Result<(Root, Option<Vec<u8>>), Cause> {
    if bytes.is_empty() {
        return Err(Cause("is empty; export it again".to_owned()));
    }
    if bytes.starts_with(b"version https://git-lfs") {
        return Err(Cause(
            "is a Git LFS pointer, not the file itself; fetch it with `git lfs pull`".to_owned(),
        ));
    }
    if !bytes.starts_with(b"glTF") {
        return Ok((root(bytes)?, None));
    }
    let header = |at: usize| {
        bytes.get(at..at + 4).map(|b| u32::from_le_bytes(<[u8; 4]>::try_from(b).unwrap_or_default()))
    };
    let (version, length) = (header(4), header(8));
    match (version, length) {
        (Some(2), Some(length)) if length >= 12 && length as usize <= bytes.len() => {}
        (Some(2), _) => {
            return Err(Cause::broken(format!("is shorter than it says: it has {} bytes", bytes.len())));
        }
        (Some(version), _) => {
            return Err(Cause(format!("is glTF of version {version}; version 2 is read, export it as that")));
        }
        (None, _) => return Err(Cause::broken("ends within its header")),
    }
    let glb = gltf::binary::Glb::from_slice(bytes)
        .map_err(|error| Cause::broken(format!("is no binary glTF: {error:?}")))?;
    Ok((root(&glb.json)?, glb.bin.map(std::borrow::Cow::into_owned)))
}

fn root(bytes: &[u8]) -> Result<Root, Cause> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let root: Root = json::deserialize::from_slice(bytes)
        .map_err(|error| Cause::broken(format!("its JSON is not that of glTF: {error}")))?;
    if !root.asset.version.starts_with("2.") {
        return Err(Cause(format!(
            "is glTF of version {}; version 2 is read, export it as that",
            root.asset.version
        )));
    }
    Ok(root)
}

fn check_extensions(root: &Root) -> Result<(), Cause> {
    let unknown: Vec<&str> = root
        .extensions_required
        .iter()
        .map(String::as_str)
        .filter(|name| !KNOWN_EXTENSIONS.contains(name))
        .collect();
    if unknown.is_empty() {
        return Ok(());
    }
    Err(Cause(format!(
        "requires extensions that are not read: {}; export it without (read are {})",
        unknown.join(", "),
        KNOWN_EXTENSIONS.join(", ")
    )))
}

/// The buffers and images that a file names; what cannot be read names nothing.
pub(in crate::format) fn named_files(path: &Path) -> Vec<PathBuf> {
    let Ok((root, _)) = text::read(path).map_err(drop).and_then(|bytes| parse(&bytes).map_err(drop)) else {
        return Vec::new();
    };
    let uris = root.buffers.iter().map(|b| &b.uri).chain(root.images.iter().map(|i| &i.uri));
    uris.flatten()
        .filter_map(|uri| match uri::target(uri) {
            Ok(uri::Target::File(name)) => Some(path.parent().unwrap_or(Path::new("")).join(name)),
            _ => None,
        })
        .collect()
}

/// Extensions that are used and change nothing here.
pub(super) fn idle_extensions(root: &Root) -> impl Iterator<Item = &str> {
    root.extensions_used.iter().map(String::as_str).filter(|name| !KNOWN_EXTENSIONS.contains(name))
}
