//! Images: in buffer views, in the JSON, or files beside it; each decoded once for each use.

use super::Cause;
use super::file::File;
use super::uri;
use crate::format::error::FormatError;
use crate::format::text;
use crate::format::texture::{Room, TextureUse, decoded_from_bytes};
use crate::scene::{Part, Texture};
use crate::warning::Warnings;
use std::borrow::Cow;
use std::collections::HashMap;
use std::path::PathBuf;

/// The decoded images of a file.
#[derive(Debug)]
pub(super) struct Pictures {
    decoded: HashMap<(usize, TextureUse), Option<Part<Texture>>>,
    room: Room,
    limit_bytes: u64,
    /// Image files that were read.
    pub inputs: Vec<PathBuf>,
    /// Their bytes.
    pub bytes_read: u64,
    /// Images that cannot be had, each as a sentence.
    pub missing: Vec<String>,
}

impl Pictures {
    /// Those of one file may take so many bytes together, mip levels included.
    pub(super) fn with_limit(limit_bytes: u64) -> Self {
        Self {
            decoded: HashMap::new(),
            room: Room::new(limit_bytes),
            limit_bytes,
            inputs: Vec::new(),
            bytes_read: 0,
            missing: Vec::new(),
        }
    }

    /// An image; None where it cannot be had, which is told once.
    pub(super) fn get(
        &mut self,
        file: &File,
        image: usize,
        texture_use: TextureUse,
        warnings: &mut Warnings,
    ) -> Option<Part<Texture>> {
        if let Some(known) = self.decoded.get(&(image, texture_use)) {
            return known.clone();
        }
        let read = self.read(file, image, texture_use);
        let texture = match read {
            Ok(texture) => Some(texture),
            Err(why) => {
                let text = format!("image {image} {why}; the constant is used");
                self.missing.push(format!("{}: {text}", file.path.display()));
                warnings.add(Some(&file.path), None, text);
                None
            }
        };
        self.decoded.insert((image, texture_use), texture.clone());
        texture
    }

    fn read(&mut self, file: &File, image: usize, texture_use: TextureUse) -> Result<Part<Texture>, String> {
        let given = file.root.images.get(image).ok_or("is not there")?;
        let bytes: Cow<[u8]> = match (given.buffer_view, &given.uri) {
            (Some(view), _) => {
                let (bytes, _) = file.view(view).map_err(|Cause(why)| format!("cannot be read: {why}"))?;
                Cow::Borrowed(bytes)
            }
            (None, Some(uri)) => match uri::target(uri)? {
                uri::Target::Data(bytes) => Cow::Owned(bytes),
                uri::Target::File(name) => {
                    let path = file.beside(&name);
                    let bytes = text::read(&path).map_err(|error| error.to_string())?;
                    self.bytes_read += bytes.len() as u64;
                    self.inputs.push(path);
                    Cow::Owned(bytes)
                }
            },
            (None, None) => return Err("has neither bytes nor a uri".to_owned()),
        };
        decoded_from_bytes(&bytes, &file.path, texture_use, &self.room)
    }

    /// An error where all images together were beyond the limit.
    pub(super) fn within_limit(&self, file: &File) -> Result<(), FormatError> {
        self.room.exceeded().map_or(Ok(()), |needed_bytes| {
            Err(FormatError::TexturesTooLarge {
                path: file.path.clone(),
                needed_bytes,
                limit_bytes: self.limit_bytes,
            })
        })
    }
}
