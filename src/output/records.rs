//! What is known of finished frames: the records that all runs left in `DIR/.rentix/`.
//!
//! One append-only file a run, one line a frame: a checksum of the rest of the line (XXH3, 64 bits), the frame's
//! fingerprint, then size, checksum (XXH3, 128 bits) and name of each of its files, separated by tabs. Numbers but
//! sizes are hexadecimal. A line that is torn or damaged counts for nothing.

use super::encoding::PictureFile;
use super::error::OutputError;
use super::record_name::{name_from_path, path_from_name};
use crate::scene::PartHash;
use std::collections::{BTreeSet, HashMap};
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::{Xxh3, xxh3_64, xxh3_128};

/// Most bytes of one file of records; a million frames take a quarter of that.
const RECORDS_BYTES_MAX: u64 = 1 << 30;

/// A finished frame, its picture first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Record {
    fingerprint: PartHash,
    files: Vec<FileRecord>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct FileRecord {
    name: String,
    size: u64,
    checksum: u128,
}

impl Record {
    pub(super) fn new(fingerprint: PartHash, files: &[PictureFile]) -> Self {
        let files = files.iter().map(|file| FileRecord {
            name: name_from_path(&file.path),
            size: file.bytes.len() as u64,
            checksum: xxh3_128(&file.bytes),
        });
        Self { fingerprint, files: files.collect() }
    }

    /// Its line with the line end.
    pub(super) fn line(&self) -> String {
        let mut rest = self.fingerprint.to_string();
        for FileRecord { name, size, checksum } in &self.files {
            rest.extend(["\t", &size.to_string(), "\t", &format!("{checksum:032x}"), "\t", name]);
        }
        format!("{:016x}\t{rest}\n", xxh3_64(rest.as_bytes()))
    }

    /// What a line says, without its line end; None where it is damaged.
    fn from_line(line: &[u8]) -> Option<Self> {
        let (checksum, rest) = std::str::from_utf8(line).ok()?.split_once('\t')?;
        if u64::from_str_radix(checksum, 16).ok()? != xxh3_64(rest.as_bytes()) {
            return None;
        }
        let mut words = rest.split('\t');
        let fingerprint = PartHash(u128::from_str_radix(words.next()?, 16).ok()?);
        let mut files = Vec::new();
        while let Some(size) = words.next() {
            let (size, checksum) = (size.parse().ok()?, u128::from_str_radix(words.next()?, 16).ok()?);
            files.push(FileRecord { name: words.next()?.to_string(), size, checksum });
        }
        Some(Self { fingerprint, files })
    }
}

impl FileRecord {
    /// Whether the file is there with the size and checksum of the record.
    fn agrees(&self, folder: &Path) -> bool {
        let Some(path) = path_from_name(&self.name) else { return false };
        let path = folder.join(path);
        // size first: a picture of another size need not be read
        path.metadata().is_ok_and(|m| m.is_file() && m.len() == self.size)
            && file_checksum(&path).is_ok_and(|checksum| checksum == self.checksum)
    }
}

fn file_checksum(path: &Path) -> io::Result<u128> {
    let mut file = File::open(path)?;
    let mut hasher = Xxh3::new();
    let mut buffer = vec![0; 1 << 18];
    loop {
        match file.read(&mut buffer) {
            Ok(0) => return Ok(hasher.digest128()),
            Ok(n) => hasher.update(&buffer[..n]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

/// The records of an output folder as they stood when they were read.
#[derive(Debug)]
pub struct Records {
    folder: PathBuf,
    all: Vec<Record>,
    /// Records that name a file, as indices.
    by_name: HashMap<String, Vec<usize>>,
}

impl Records {
    /// Reads the records that all runs left in an output folder; none where there is no folder.
    pub fn read(folder: &Path) -> Result<Self, OutputError> {
        let mut read = Self { folder: folder.to_path_buf(), all: Vec::new(), by_name: HashMap::new() };
        for line in read_lines(&records_folder(folder))? {
            read.all.extend(Record::from_line(&line));
        }
        for (i, record) in read.all.iter().enumerate() {
            for file in &record.files {
                read.by_name.entry(file.name.clone()).or_default().push(i);
            }
        }
        Ok(read)
    }

    /// Whether any record names a file, relative to the output folder.
    pub fn names(&self, file: &Path) -> bool {
        self.by_name.contains_key(&name_from_path(file))
    }

    /// Whether a frame is finished: a record has this picture, relative to the output folder, and this fingerprint,
    /// and each of its files is there with the record's size and checksum. Reads the files.
    pub fn finished(&self, picture: &Path, fingerprint: PartHash) -> bool {
        let name = name_from_path(picture);
        self.by_name.get(&name).into_iter().flatten().map(|&i| &self.all[i]).any(|record| {
            record.fingerprint == fingerprint
                && record.files.first().is_some_and(|file| file.name == name)
                && record.files.iter().all(|file| file.agrees(&self.folder))
        })
    }
}

/// Where the records of an output folder lie.
pub(super) fn records_folder(folder: &Path) -> PathBuf {
    folder.join(".rentix")
}

/// The suffix of files of records.
pub(super) const LOG_SUFFIX: &str = ".log";

/// All files of records in a folder; none where it is not there.
pub(super) fn logs(records_folder: &Path) -> Result<BTreeSet<PathBuf>, OutputError> {
    let entries = match records_folder.read_dir() {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(BTreeSet::new()),
        entries => entries.map_err(OutputError::read(records_folder))?,
    };
    let mut logs = BTreeSet::new();
    for entry in entries {
        let entry = entry.map_err(OutputError::read(records_folder))?;
        if entry.file_name().as_encoded_bytes().ends_with(LOG_SUFFIX.as_bytes()) {
            logs.insert(entry.path());
        }
    }
    Ok(logs)
}

/// The whole, undamaged lines of all files of records in a folder, each once.
///
/// Another run may fold files meanwhile: what vanishes unread stands in a file that a later listing shows.
fn read_lines(records_folder: &Path) -> Result<BTreeSet<Vec<u8>>, OutputError> {
    let (mut lines, mut read) = (BTreeSet::new(), BTreeSet::new());
    loop {
        let listed = logs(records_folder)?;
        let new: Vec<_> = listed.difference(&read).cloned().collect();
        if new.is_empty() {
            return Ok(lines);
        }
        for log in new {
            lines.extend(log_lines(&log)?);
            read.insert(log);
        }
    }
}

/// The whole, undamaged lines of a file of records without their ends; none where it has vanished.
pub(super) fn log_lines(log: &Path) -> Result<Vec<Vec<u8>>, OutputError> {
    let mut bytes = Vec::new();
    let read = File::open(log).and_then(|file| file.take(RECORDS_BYTES_MAX + 1).read_to_end(&mut bytes));
    match read {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        read => read.map_err(OutputError::read(log))?,
    };
    if bytes.len() as u64 > RECORDS_BYTES_MAX {
        return Err(OutputError::RecordsTooLarge { path: log.to_path_buf(), max_bytes: RECORDS_BYTES_MAX });
    }
    let whole = bytes.split_inclusive(|&b| b == b'\n').filter_map(|line| line.strip_suffix(b"\n"));
    Ok(whole.filter(|line| Record::from_line(line).is_some()).map(<[u8]>::to_vec).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(name: &str, bytes: &[u8]) -> Record {
        let file = |path: &str| PictureFile { path: path.into(), bytes: bytes.to_vec() };
        Record::new(PartHash(0x1234), &[file(name), file("side.aov.exr")])
    }

    #[test]
    fn lines_come_back() {
        let record = record("a b\t\n%.png", b"picture");
        let line = record.line();
        assert_eq!(line.matches('\n').count(), 1);
        assert!(line.ends_with("\tside.aov.exr\n") && line.contains("\t7\t"), "{line}");
        assert_eq!(Record::from_line(line.trim_end().as_bytes()), Some(record));
    }

    #[test]
    fn damaged_lines_count_for_nothing() {
        let line = record("a.png", b"picture").line();
        let whole = line.trim_end().as_bytes();
        for i in 0..whole.len() {
            assert_eq!(Record::from_line(&whole[..i]), None, "torn at {i}");
            let mut flipped = whole.to_vec();
            flipped[i] ^= 1;
            assert_eq!(Record::from_line(&flipped), None, "damaged at {i}");
        }
    }

    #[test]
    fn a_torn_last_line_is_dropped_and_the_others_stay() {
        let folder = tempfile::tempdir().unwrap();
        let (one, two) = (record("1.png", b"1").line(), record("2.png", b"2").line());
        let log = folder.path().join("x.log");
        for torn in 0..two.len() {
            std::fs::write(&log, format!("{one}no record\n\n{}", &two[..torn])).unwrap();
            assert_eq!(log_lines(&log).unwrap(), [one.trim_end().as_bytes()], "torn at {torn}");
        }
        std::fs::write(&log, format!("{one}{two}")).unwrap();
        assert_eq!(log_lines(&log).unwrap().len(), 2);
        assert_eq!(log_lines(&folder.path().join("vanished.log")).unwrap().len(), 0);
    }
}
