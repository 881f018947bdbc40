//! Lines, blanks, comments and names: what OBJ and MTL have in common as text. Names are bytes; nothing here asks
//! for UTF-8.

use super::error::FormatError;
use crate::scene::{PartHash, PartHasher};
use memchr::{memchr, memchr_iter, memchr2, memrchr_iter};
use std::borrow::Cow;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

/// The longest file that is read: what a line can name (corners, triangles, three normals each) then fits 32 bits.
pub(crate) const MAX_FILE_BYTES: u64 = 1 << 31;

/// Whether a byte parts two words.
#[inline]
pub(super) fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | 0x0b | 0x0c)
}

/// Whether a byte ends a line: LF, CR LF and a lone CR all do.
#[inline]
pub(super) fn is_line_end(byte: u8) -> bool {
    matches!(byte, b'\n' | b'\r')
}

/// Whether a number ends before this byte. A comment may stand right behind it.
#[inline]
pub(super) fn ends_number(byte: u8) -> bool {
    is_blank(byte) || is_line_end(byte) || byte == b'#'
}

/// Reads a plain file whole.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, FormatError> {
    read_into(Vec::new(), path)
}

/// [`read`] into memory that is at hand, unless it is too small or much too large.
pub(super) fn read_into(room: Vec<u8>, path: &Path) -> Result<Vec<u8>, FormatError> {
    let (mut file, length) = open(path)?;
    let least = length as usize + 1;
    let fits = (least..=2 * least).contains(&room.capacity());
    // files of a sequence are of nearly the same length
    let mut bytes = if fits { room } else { Vec::with_capacity(least + least / 16) };
    bytes.clear();
    file.read_to_end(&mut bytes).map_err(|source| unreadable(path, source))?;
    within_limit(path, bytes.len() as u64)?;
    Ok(bytes)
}

/// The hash of a plain file's bytes, as [`digest_of`] gives it; no more is held than a piece.
pub(super) fn digest(path: &Path) -> Result<(PartHash, u64), FormatError> {
    let (mut file, _) = open(path)?;
    let mut hasher = PartHasher::new("file");
    let mut buffer = vec![0; PIECE_BYTES];
    let mut length = 0;
    loop {
        let read = fill(&mut file, &mut buffer).map_err(|source| unreadable(path, source))?;
        if read > 0 {
            hasher.bytes(&buffer[..read]);
        }
        length += read as u64;
        if read < buffer.len() {
            return within_limit(path, length).map(|()| (hasher.finish(), length));
        }
    }
}

/// The hash of bytes, and how many they are.
pub(super) fn digest_of(bytes: &[u8]) -> (PartHash, u64) {
    let mut hasher = PartHasher::new("file");
    bytes.chunks(PIECE_BYTES).for_each(|piece| hasher.bytes(piece));
    (hasher.finish(), bytes.len() as u64)
}

/// Bytes read at a time by [`read_pieces`] and [`digest`]: what a core's second cache holds.
const PIECE_BYTES: usize = 256 << 10;

/// Reads a plain file in pieces of whole lines, continued ones not parted, and gives each to `take`. No more is held
/// than a piece, or a line where that is longer.
pub(super) fn read_pieces(path: &Path, mut take: impl FnMut(&Text)) -> Result<(), FormatError> {
    let (mut file, _) = open(path)?;
    let mut buffer = Vec::new();
    let mut held = 0;
    let mut is_first = true;
    loop {
        if buffer.len() - held < PIECE_BYTES {
            buffer.resize(held + PIECE_BYTES, 0);
        }
        let read = fill(&mut file, &mut buffer[held..]).map_err(|source| unreadable(path, source))?;
        let bytes = &buffer[..held + read];
        let is_last = bytes.len() < buffer.len();
        let mut line_ends = memrchr_iter(b'\n', &bytes[held..]).map(|end| held + end);
        let end = line_ends.find(|&end| !continues(bytes, end)).map_or(0, |end| end + 1);
        let end = if is_last { bytes.len() } else { end };
        if end > 0 {
            take(&if is_first { Text::new(&bytes[..end], path)? } else { Text::of_lines(&bytes[..end]) });
            is_first = false;
        }
        if is_last {
            return Ok(());
        }
        held = bytes.len() - end;
        buffer.copy_within(end..end + held, 0);
    }
}

/// Reads until the buffer is full or the file ends; how many bytes.
fn fill(file: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match file.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(count) => filled += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}

/// Whether the line whose LF stands at `end` may be continued.
fn continues(bytes: &[u8], end: usize) -> bool {
    bytes[..end].strip_suffix(b"\r").unwrap_or(&bytes[..end]).ends_with(b"\\")
}

fn unreadable(path: &Path, cause: io::Error) -> FormatError {
    FormatError::Unreadable { path: path.to_path_buf(), cause }
}

/// Opens a plain file that is not too long; its length, which may grow.
fn open(path: &Path) -> Result<(io::Take<File>, u64), FormatError> {
    let opened = open_plain(path).map_err(|source| unreadable(path, source))?;
    let Some((file, length)) = opened else {
        return Err(FormatError::NotAFile { path: path.to_path_buf() });
    };
    within_limit(path, length)?;
    // a byte more than the limit tells a file that has grown beyond it
    Ok((file.take(MAX_FILE_BYTES + 1), length))
}

/// Opens a plain file, or a link to one, and gives its length; None where it is something else: a pipe or a device could
/// keep us waiting, or never end.
///
/// # Errors
/// Where it is not there or may not be read.
pub fn open_plain(path: &Path) -> io::Result<Option<(File, u64)>> {
    let metadata = fs::metadata(path)?;
    if !metadata.is_file() {
        return Ok(None);
    }
    Ok(Some((File::open(path)?, metadata.len())))
}

fn within_limit(path: &Path, bytes: u64) -> Result<(), FormatError> {
    if bytes <= MAX_FILE_BYTES {
        return Ok(());
    }
    Err(FormatError::TooLarge { path: path.to_path_buf(), bytes, limit: MAX_FILE_BYTES })
}

/// A text file in memory.
pub(super) struct Text<'a> {
    as_written: &'a [u8],
    /// Whether a byte-order mark stands before it.
    is_marked: bool,
    /// Its content with lines joined that `\` continues; as long as what was written, so that a place in one is
    /// the same place in the other.
    pub joined: Cow<'a, [u8]>,
    /// Where the first zero byte stands: no text has one.
    pub first_zero: Option<usize>,
}

impl<'a> Text<'a> {
    /// Takes the bytes of a file, which must not be something else than text.
    pub(super) fn new(bytes: &'a [u8], path: &Path) -> Result<Self, FormatError> {
        within_limit(path, bytes.len() as u64)?;
        if bytes.starts_with(b"version https://git-lfs") {
            return Err(FormatError::LfsPointer { path: path.to_path_buf() });
        }
        if is_utf16(bytes) {
            return Err(FormatError::Utf16 { path: path.to_path_buf() });
        }
        let as_written = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
        Ok(Self { is_marked: as_written.len() < bytes.len(), ..Self::of_lines(as_written) })
    }

    /// Takes bytes that are text.
    fn of_lines(as_written: &'a [u8]) -> Self {
        let (joined, first_zero) = join_lines(as_written);
        Self { as_written, is_marked: false, joined, first_zero }
    }

    /// Whether it is the file byte by byte: no line is continued, no byte-order mark taken off.
    pub(super) fn is_plain(&self) -> bool {
        !self.is_marked && matches!(self.joined, Cow::Borrowed(_))
    }

    /// The line, from 1, in which the byte at `offset` stands.
    pub(super) fn line_at(&self, offset: usize) -> u32 {
        let before = &self.as_written[..offset.min(self.as_written.len())];
        let lone_returns =
            memchr_iter(b'\r', before).filter(|&i| self.as_written.get(i + 1) != Some(&b'\n')).count();
        (1 + memchr_iter(b'\n', before).count() + lone_returns) as u32
    }
}

/// A byte-order mark, or every other of the first bytes zero.
fn is_utf16(bytes: &[u8]) -> bool {
    let zeros = |from: usize| {
        let mut of_unit = bytes.iter().take(64).skip(from).step_by(2);
        of_unit.len() >= 2 && of_unit.all(|&b| b == 0)
    };
    bytes.starts_with(b"\xFE\xFF") || bytes.starts_with(b"\xFF\xFE") || zeros(0) != zeros(1)
}

/// Blanks out each `\` at the end of a line together with that line end. A comment is not continued: paths of
/// Windows stand there. On the way the first zero byte is found, which costs nothing beside the search for the others.
fn join_lines(bytes: &[u8]) -> (Cow<'_, [u8]>, Option<usize>) {
    let mut joined = Cow::Borrowed(bytes);
    let (mut seen, mut in_comment) = (0, false);
    let (mut next, mut first_zero) = (0, None);
    loop {
        let rest = &bytes[next..];
        let found = if first_zero.is_none() { memchr2(b'\\', 0, rest) } else { memchr(b'\\', rest) };
        let Some(at) = found.map(|found| next + found) else { break };
        next = at + 1;
        if bytes[at] == 0 {
            first_zero = Some(at);
            continue;
        }
        let length = match bytes[at + 1..] {
            [b'\r', b'\n', ..] => 3,
            [b'\r' | b'\n', ..] => 2,
            _ => continue,
        };
        let mut line = &bytes[seen..at];
        if let Some(end) = line.iter().rposition(|&b| is_line_end(b)) {
            line = &line[end + 1..];
            in_comment = false;
        }
        in_comment |= without_comment(line).len() < line.len();
        seen = at + 1;
        if !in_comment {
            joined.to_mut()[at..at + length].fill(b' ');
            seen = at + length;
        }
    }
    (joined, first_zero)
}

/// Where the line that holds `from` ends: the place of its line end, or of the end of the text.
#[inline]
pub(super) fn line_end(text: &[u8], from: usize) -> usize {
    let mut at = from;
    // lines are short: eight bytes at a time, without a call
    while let Some(chunk) = text[at..].first_chunk::<8>() {
        let bytes = u64::from_le_bytes(*chunk);
        let found = has_zero(bytes ^ 0x0A0A_0A0A_0A0A_0A0A) | has_zero(bytes ^ 0x0D0D_0D0D_0D0D_0D0D);
        if found != 0 {
            return at + (found.trailing_zeros() / 8) as usize;
        }
        at += 8;
    }
    text[at..].iter().position(|&b| is_line_end(b)).map_or(text.len(), |length| at + length)
}

/// The high bit of the first byte that is zero, if one is (and maybe bits behind it).
#[inline]
fn has_zero(bytes: u64) -> u64 {
    bytes.wrapping_sub(0x0101_0101_0101_0101) & !bytes & 0x8080_8080_8080_8080
}

/// A line without its comment: `#` opens one at the start of the line or behind a blank.
pub(super) fn without_comment(line: &[u8]) -> &[u8] {
    let comment = memchr_iter(b'#', line).find(|&i| i == 0 || is_blank(line[i - 1]));
    &line[..comment.unwrap_or(line.len())]
}

/// Without the blanks at both ends.
pub(super) fn trimmed(mut text: &[u8]) -> &[u8] {
    while let [first, rest @ ..] = text
        && is_blank(*first)
    {
        text = rest;
    }
    while let [rest @ .., last] = text
        && is_blank(*last)
    {
        text = rest;
    }
    text
}

/// The first word and what follows it, trimmed.
pub(super) fn first_word(line: &[u8]) -> (&[u8], &[u8]) {
    let line = trimmed(line);
    let end = line.iter().position(|&b| is_blank(b)).unwrap_or(line.len());
    (&line[..end], trimmed(&line[end..]))
}

/// The words between blanks.
pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(|&b| is_blank(b)).filter(|word| !word.is_empty())
}

/// How often something was met, and where first.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tally {
    /// How often.
    pub count: u64,
    /// Place in the text of the first.
    pub first: usize,
}

impl Tally {
    /// Counts one more, at `offset`.
    pub(super) fn add(&mut self, offset: usize) {
        if self.count == 0 {
            self.first = offset;
        }
        self.count += 1;
    }
}

/// A name for people to read, its first bytes where they are many. What would steer a terminal is not shown.
pub(super) fn shown(name: &[u8]) -> String {
    shortened(name, 100)
}

/// A statement or a word of one for people to read: as much of it as tells what it is.
pub(super) fn shown_statement(statement: &[u8]) -> String {
    shortened(statement, 40)
}

/// At most so many bytes; what cannot be shown is one sign, however long it is.
fn shortened(bytes: &[u8], most: usize) -> String {
    const NONE: char = char::REPLACEMENT_CHARACTER;
    let mut short = String::new();
    for c in String::from_utf8_lossy(&bytes[..bytes.len().min(most)]).chars() {
        let c = if c.is_control() { NONE } else { c };
        if c != NONE || !short.ends_with(NONE) {
            short.push(c);
        }
    }
    if bytes.len() > most { format!("{}…", short.trim_end_matches(NONE)) } else { short }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(bytes: &[u8]) -> Text<'_> {
        Text::new(bytes, Path::new("a.obj")).unwrap()
    }

    #[test]
    fn lines_are_counted_whatever_ends_them() {
        let t = text(b"a\nb\r\nc\rd");
        let lines: Vec<u32> = [0, 2, 5, 7].map(|offset| t.line_at(offset)).to_vec();
        assert_eq!(lines, [1, 2, 3, 4]);
    }

    #[test]
    fn a_backslash_joins_lines_but_not_comments() {
        let joined = |bytes: &'static [u8]| text(bytes).joined.into_owned();
        assert_eq!(joined(b"f 1 \\\n2 3\n"), b"f 1   2 3\n");
        assert_eq!(joined(b"f 1 \\\r\n2\\\r3\n"), b"f 1    2  3\n");
        assert_eq!(joined(b"# C:\\out\\\nv 1 2 3\n"), b"# C:\\out\\\nv 1 2 3\n");
        assert_eq!(joined(b"map_Kd a\\b.png\n"), b"map_Kd a\\b.png\n");
        assert_eq!(text(b"f 1 \\\n2 3\nf").line_at(10), 3, "lines are those of the file");
    }

    #[test]
    fn what_is_no_text_is_named() {
        let refused = |bytes: &[u8]| Text::new(bytes, Path::new("a.obj")).err().map(|e| e.to_string());
        assert!(refused(b"version https://git-lfs.github.com/spec/v1\n").unwrap().contains("Git LFS"));
        for utf16 in [&b"\xFE\xFF\0v"[..], b"\xFF\xFEv\0", b"\0v\0 \0\x31", b"v\0 \0\x31\0"] {
            assert!(refused(utf16).unwrap().contains("UTF-16"));
        }
        for plain in [&b""[..], b"v", b"\xEF\xBB\xBFv 1 2 3", b"o \xE6\n", b"\0\0\0\0\0\0"] {
            assert_eq!(refused(plain), None);
        }
    }

    #[test]
    fn the_first_zero_byte_is_found_and_lines_are_joined_all_the_same() {
        let t = text(b"v 1 \\\n2 3\nv\0\0 \\\n1\n");
        assert_eq!((t.first_zero, &t.joined[..]), (Some(11), &b"v 1   2 3\nv\0\0   1\n"[..]));
        assert_eq!(text(b"v 1 2 3\n").first_zero, None);
    }

    #[test]
    fn what_is_shown_is_short_and_plain() {
        assert_eq!(shown_statement("é \u{1b}[31m".as_bytes()), "é \u{fffd}[31m");
        assert_eq!(shown_statement(&[0xff; 30]), "\u{fffd}");
        assert_eq!(shown_statement(&[b'a'; 41]), format!("{}…", "a".repeat(40)));
        // cut within a letter of two bytes
        assert_eq!(
            shown_statement(&[&[b'a'; 39][..], "éé".as_bytes()].concat()),
            format!("{}…", "a".repeat(39))
        );
        assert_eq!(shown(&[b'a'; 100]), "a".repeat(100));
    }

    #[test]
    fn memory_is_used_again_where_it_fits() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        fs::write(&path, [b'#'; 1000]).unwrap();
        let again = |capacity: usize| {
            let mut room = Vec::with_capacity(capacity);
            room.extend_from_slice(b"what was there before");
            let place = room.as_ptr();
            let bytes = read_into(room, &path).unwrap();
            assert_eq!(bytes, [b'#'; 1000]);
            assert!(bytes.capacity() <= 2 * 1001);
            bytes.as_ptr() == place
        };
        assert!(again(1001) && again(2002));
        again(100);
        assert!(!again(1 << 20));
    }

    #[test]
    fn pieces_are_whole_lines() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        let long = format!("f {}\n", "1 \\\n".repeat(PIECE_BYTES / 3));
        for (content, pieces) in [
            (String::new(), 0),
            ("v 1 2 3".to_owned(), 1),
            ("v 1 2 3\n".repeat(PIECE_BYTES / 4), 2),
            ("v 1 2 3 \\\r\n".repeat(PIECE_BYTES / 4), 1),
            (long.repeat(3), 3),
            ("x".repeat(PIECE_BYTES), 1),
        ] {
            fs::write(&path, &content).unwrap();
            let (mut joined, mut count) = (Vec::new(), 0);
            let mut take = |text: &Text| {
                joined.extend_from_slice(&text.joined);
                count += 1;
            };
            read_pieces(&path, &mut take).unwrap();
            let whole = Text::new(content.as_bytes(), &path).unwrap();
            assert!(joined == whole.joined.as_ref(), "{} bytes", content.len());
            assert_eq!(count, pieces, "{} bytes", content.len());
            assert_eq!(digest(&path).unwrap(), digest_of(content.as_bytes()));
        }
    }

    #[test]
    fn a_comment_needs_a_blank_before_it() {
        assert_eq!(without_comment(b"usemtl red#2 # the second"), b"usemtl red#2 ");
        assert_eq!(without_comment(b"# all"), b"");
        assert_eq!(first_word(b"  usemtl \t a  b "), (&b"usemtl"[..], &b"a  b"[..]));
    }
}
