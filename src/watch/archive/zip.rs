//! Zip: the central directory names the entries, which are read one after the other, so that a directory of millions of names
//! takes no memory; each file is checked against its CRC while it is read.

use super::{ArchiveError, Visit};
use std::io::{Read, Seek};
use zip::ZipReadOptions;
use zip::read::Config;
use zip::unstable::read::ZipIterable;

/// The kinds of file in a Unix mode (stat(2)).
const KIND: u32 = 0o170_000;
const PLAIN: u32 = 0o100_000;
const FOLDER: u32 = 0o040_000;

/// Visits the entries: `directory` and `files` read the same archive.
pub(super) fn visit<R: Read + Seek>(
    directory: R,
    files: R,
    visit: &mut Visit<'_>,
) -> Result<(), ArchiveError> {
    let mut zip = ZipIterable::try_new(directory, Config::default()).map_err(|e| visit.broken(e.into()))?;
    // before the first is unpacked
    if zip.len() as u64 > visit.limits.entries {
        return Err(visit.too_many());
    }
    let mut entries =
        zip.files_with_reader(files, ZipReadOptions::new()).map_err(|e| visit.broken(e.into()))?;
    while let Some(entry) = entries.next() {
        let entry = entry.map_err(|e| visit.broken(e.into()))?;
        let name = entry.name_raw().to_vec();
        // names in code page 437 have ASCII in common with UTF-8, and `name` turns the rest
        let name = if name.is_ascii() {
            name
        } else {
            entry.name().map_err(|e| visit.broken(e.into()))?.into_owned().into_bytes()
        };
        if entry.is_symlink() {
            return Err(visit.bad(&name, "is a link"));
        }
        let is_folder = name.ends_with(b"/") || name.ends_with(b"\\");
        match entry.unix_mode().map_or(0, |mode| mode & KIND) {
            0 => {}
            PLAIN if !is_folder => {}
            FOLDER if is_folder => {}
            _ => return Err(visit.bad(&name, "is neither a plain file nor a folder")),
        }
        if is_folder {
            visit.folder(&name)?;
        } else {
            let mut bytes = visit.budget.count(entry);
            visit.file(&name, &mut bytes)?;
        }
    }
    Ok(())
}
