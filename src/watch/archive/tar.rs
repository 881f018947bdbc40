//! Tar: headers of 512 bytes, each before its file. Long names (GNU's and POSIX's) are read here, within limits, as the
//! reader would take any length for them.

use super::{ArchiveError, Visit};
use std::io::{self, Read};
use tar::{Archive, EntryType};

/// Headers that carry a long name or attributes are not longer.
const EXTENSION_BYTES_MAX: u64 = 1 << 16;

pub(super) fn visit<R: Read>(stream: R, visit: &mut Visit<'_>) -> Result<(), ArchiveError> {
    let mut stream = Tail { inner: stream, block: 0, zeros: 0, read: 0 };
    let mut archive = Archive::new(&mut stream);
    let entries = archive.entries().map_err(|e| visit.broken(e))?.raw(true);
    let mut long_name: Option<Vec<u8>> = None;
    for entry in entries {
        let mut entry = entry.map_err(|e| visit.broken(e))?;
        let kind = entry.header().entry_type();
        let name = long_name.clone().unwrap_or_else(|| entry.path_bytes().into_owned());
        match kind {
            EntryType::GNULongName | EntryType::XHeader => {
                visit.skip()?;
                let mut text = Vec::new();
                let most = EXTENSION_BYTES_MAX + 1;
                (&mut entry).take(most).read_to_end(&mut text).map_err(|e| visit.broken(e))?;
                if text.len() as u64 == most {
                    return Err(visit.bad(&name, "has a header that is too long"));
                }
                if kind == EntryType::GNULongName {
                    text.truncate(text.iter().position(|&b| b == 0).unwrap_or(text.len()));
                    long_name = Some(text);
                } else {
                    long_name = attributes(&text).map_err(|why| visit.bad(&name, why))?.or(long_name);
                }
                continue;
            }
            // a commit's number, as git archive writes it
            EntryType::XGlobalHeader => {
                visit.skip()?;
                continue;
            }
            EntryType::Directory => visit.folder(&name)?,
            EntryType::Regular | EntryType::Continuous => visit.file(&name, &mut entry)?,
            EntryType::Symlink | EntryType::Link | EntryType::GNULongLink => {
                return Err(visit.bad(&name, "is a link"));
            }
            _ => return Err(visit.bad(&name, "is neither a plain file nor a folder")),
        }
        long_name = None;
    }
    let _ = archive;
    // the checksum of what is packed stands at its end
    io::copy(&mut stream, &mut io::sink()).map_err(|e| visit.broken(e))?;
    if stream.zeros == 0 {
        let torn = io::Error::new(io::ErrorKind::UnexpectedEof, "its end is missing");
        return Err(visit.broken(torn));
    }
    Ok(())
}

/// The path that a header's attributes give (POSIX.1, pax): lines of `LENGTH KEY=VALUE`.
fn attributes(text: &[u8]) -> Result<Option<Vec<u8>>, &'static str> {
    const BROKEN: &str = "has a header that is not understood";
    let mut path = None;
    let mut rest = text;
    while !rest.is_empty() {
        let blank = rest.iter().position(|&b| b == b' ').ok_or(BROKEN)?;
        let length = std::str::from_utf8(&rest[..blank]).ok().and_then(|n| n.parse::<usize>().ok());
        let line = length.filter(|n| *n > blank + 1 && *n <= rest.len()).ok_or(BROKEN)?;
        let record = rest[blank + 1..line].strip_suffix(b"\n").ok_or(BROKEN)?;
        let equals = record.iter().position(|&b| b == b'=').ok_or(BROKEN)?;
        let (key, value) = (&record[..equals], &record[equals + 1..]);
        match key {
            b"path" => path = Some(value.to_vec()),
            b"linkpath" => return Err("is a link"),
            // the size in the header itself would no longer hold
            b"size" => return Err("is larger than what is unpacked"),
            _ if key.starts_with(b"GNU.sparse") => return Err("has holes; pack it without --sparse"),
            _ => {}
        }
        rest = &rest[line..];
    }
    Ok(path)
}

/// Looks whether whole blocks of zeros come by, which end an archive.
struct Tail<R> {
    inner: R,
    /// Bytes of the block that is being read.
    block: usize,
    /// Blocks of zeros without another one since.
    zeros: u64,
    /// Zeros of the block that is being read.
    read: usize,
}

impl<R: Read> Read for Tail<R> {
    fn read(&mut self, room: &mut [u8]) -> io::Result<usize> {
        let n = self.inner.read(room)?;
        let mut rest = &room[..n];
        while !rest.is_empty() {
            let (part, after) = rest.split_at(rest.len().min(512 - self.block));
            self.read += if part.iter().all(|&b| b == 0) { part.len() } else { 0 };
            self.block += part.len();
            if self.block == 512 {
                self.zeros = if self.read == 512 { self.zeros + 1 } else { 0 };
                (self.block, self.read) = (0, 0);
            }
            rest = after;
        }
        Ok(n)
    }
}
