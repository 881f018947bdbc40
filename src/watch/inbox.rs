//! What is in the inbox: a scan decides; file-system events only say when to scan.

use super::follow::Stamp;
use super::settle::{Seen, is_unfinished};
use super::{WatchError, cannot};
use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::Xxh3Default;

/// What a job is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A folder.
    Folder,
    /// An archive, by the end of its name.
    Archive(Packed),
}

/// How files are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Packed {
    /// PKWARE's.
    Zip,
    /// Tar alone.
    Tar,
    /// Tar and gzip.
    TarGz,
    /// Tar and zstd.
    TarZst,
}

const ENDS: [(&str, Packed); 5] = [
    (".zip", Packed::Zip),
    (".tar", Packed::Tar),
    (".tar.gz", Packed::TarGz),
    (".tgz", Packed::TarGz),
    (".tar.zst", Packed::TarZst),
];

/// So many folders deep a job is looked at.
const DEPTH_MAX: usize = 32;
/// A job has no more files.
const FILES_MAX: u64 = 1_000_000;

/// The archive that a name says and the name without its end.
fn packed(name: &str) -> Option<(Packed, &str)> {
    let lower = name.to_ascii_lowercase();
    let found = ENDS.iter().filter(|(end, _)| lower.ends_with(end)).max_by_key(|(end, _)| end.len());
    // the ends are ASCII, so that the same bytes end the name as it is written
    found.map(|(end, packed)| (*packed, &name[..name.len() - end.len()]))
}

/// One thing in the inbox that is a job.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Found {
    pub(super) file: OsString,
    pub(super) kind: Kind,
    /// The name that its job has where no other has it.
    pub(super) name: String,
}

/// What is in the inbox.
#[derive(Debug, Default)]
pub(super) struct Inbox {
    /// Jobs by the names of their files.
    pub(super) jobs: Vec<Found>,
    /// What is neither a folder nor an archive, nor says something about one.
    pub(super) others: Vec<OsString>,
}

/// Of a name that says something of a job beside it, as `NAME.cancel`, that of the job's file, or of what that is without
/// the end of an archive.
pub(super) fn said_of(name: &OsStr) -> Option<&OsStr> {
    let name = Path::new(name);
    let says = name.extension().is_some_and(|e| e == "done" || e == "cancel");
    name.file_stem().filter(|_| says)
}

/// The name of a job's file, and that without the end of an archive where it has one: what stands before `.done` and
/// `.cancel` beside it.
pub(super) fn names(file: &OsStr) -> impl Iterator<Item = &OsStr> {
    let stem = file.to_str().and_then(packed).map(|(_, stem)| OsStr::new(stem));
    [Some(file), stem].into_iter().flatten()
}

/// Lists the inbox.
pub(super) fn list(inbox: &Path) -> Result<Inbox, WatchError> {
    let mut found = Inbox::default();
    for entry in fs::read_dir(inbox).map_err(cannot("read", inbox))? {
        let entry = entry.map_err(cannot("read", inbox))?;
        let file = entry.file_name();
        let text = file.to_string_lossy().into_owned();
        if text.starts_with('.') || said_of(&file).is_some() || is_unfinished(&text) {
            continue;
        }
        let kind = entry.file_type().map_err(cannot("read", &entry.path()))?;
        if kind.is_dir() {
            found.jobs.push(Found { name: plain(&text), kind: Kind::Folder, file });
        } else if let Some((packed, stem)) =
            packed(&text).filter(|(_, stem)| kind.is_file() && !stem.is_empty())
        {
            found.jobs.push(Found { name: plain(stem), kind: Kind::Archive(packed), file });
        } else {
            found.others.push(file);
        }
    }
    found.jobs.sort_by(|a, b| a.file.cmp(&b.file));
    Ok(found)
}

/// No job's name is longer, so that there is room for what is added to it.
const NAME_BYTES_MAX: usize = 200;

/// A name that is good for a folder and a terminal.
fn plain(text: &str) -> String {
    let bad = |c: char| c.is_control() || c == '\\' || c == char::REPLACEMENT_CHARACTER;
    let mut name: String = text.chars().map(|c| if bad(c) { '_' } else { c }).collect();
    while name.len() > NAME_BYTES_MAX {
        name.pop();
    }
    name
}

/// Whether a look failed for what the job is: time does not mend that, and the system gave no number for it.
pub(super) fn is_limit(error: &io::Error) -> bool {
    error.raw_os_error().is_none()
}

/// Looks at one job: everything inside it, and what is said beside it.
pub(super) fn look(inbox: &Path, found: &Found) -> io::Result<Seen> {
    let path = inbox.join(&found.file);
    let mut set = Set::default();
    match found.kind {
        Kind::Folder => set.folder(&path, 0)?,
        Kind::Archive(_) => set.file(OsStr::new(""), &fs::symlink_metadata(&path)?),
    }
    let (run, exact) = (set.run.digest128(), set.exact.digest128());
    let beside = |end: &str| {
        names(&found.file).any(|name| {
            let mut name = name.to_os_string();
            name.push(end);
            inbox.join(name).exists()
        })
    };
    let inside = |name: &str| found.kind == Kind::Folder && path.join(name).exists();
    Ok(Seen {
        run,
        exact,
        files: set.files,
        unfinished: set.unfinished,
        done: inside(".done") || beside(".done"),
        cancelled: inside(".cancel") || beside(".cancel"),
    })
}

/// A file of a job whose name says that it is still being written.
pub(super) fn unfinished(job: &Path) -> Option<PathBuf> {
    let mut folders = vec![job.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            if entry.file_type().is_ok_and(|t| t.is_dir()) {
                folders.push(entry.path());
            } else if is_unfinished(&entry.file_name().to_string_lossy()) {
                return Some(entry.path());
            }
        }
    }
    None
}

#[derive(Default)]
struct Set {
    run: Xxh3Default,
    exact: Xxh3Default,
    files: u64,
    unfinished: bool,
}

impl Set {
    fn folder(&mut self, folder: &Path, depth: usize) -> io::Result<()> {
        if depth > DEPTH_MAX {
            return Err(io::Error::other(format!("folders lie deeper than {DEPTH_MAX}; move them up")));
        }
        let mut entries = fs::read_dir(folder)?.collect::<io::Result<Vec<_>>>()?;
        entries.sort_by_key(fs::DirEntry::file_name);
        for entry in entries {
            let name = entry.file_name();
            if depth == 0 && (name == ".done" || name == ".cancel") {
                continue;
            }
            let meta = match entry.metadata() {
                // gone between the two: the next scan sees another set
                Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                meta => meta?,
            };
            if meta.is_dir() {
                self.name(&name, "/");
                self.folder(&entry.path(), depth + 1)?;
                self.name(OsStr::new(".."), "/");
            } else {
                self.file(&name, &meta);
            }
            if self.files > FILES_MAX {
                return Err(io::Error::other(format!("has more than {FILES_MAX} files; split it")));
            }
        }
        Ok(())
    }

    fn name(&mut self, name: &OsStr, end: &str) {
        for hasher in [&mut self.run, &mut self.exact] {
            hasher.update(name.as_encoded_bytes());
            // no name holds it, so that names do not run together
            hasher.update(b"\0");
            hasher.update(end.as_bytes());
        }
    }

    fn file(&mut self, name: &OsStr, meta: &fs::Metadata) {
        self.files += 1;
        self.unfinished |= is_unfinished(&name.to_string_lossy());
        self.name(name, "");
        let (size, time) = (meta.len(), modified_ns(meta));
        for hasher in [&mut self.run, &mut self.exact] {
            hasher.update(&size.to_le_bytes());
            hasher.update(&time.to_le_bytes());
        }
        self.exact.update(&changed_ns(meta).to_le_bytes());
    }
}

fn modified_ns(meta: &fs::Metadata) -> i128 {
    let since = meta.modified().ok().map(|t| t.duration_since(crate::clock::EARLIEST));
    match since {
        None => 0,
        Some(Ok(after)) => after.as_nanos() as i128,
        Some(Err(before)) => -(before.duration().as_nanos() as i128),
    }
}

#[cfg(unix)]
fn changed_ns(meta: &fs::Metadata) -> i128 {
    use std::os::unix::fs::MetadataExt;
    i128::from(meta.ctime()) * 1_000_000_000 + i128::from(meta.ctime_nsec())
}

#[cfg(not(unix))]
fn changed_ns(_: &fs::Metadata) -> i128 {
    0
}

/// The OBJ files of a folder with their sizes and times.
pub(super) fn obj_files(folder: &Path) -> io::Result<BTreeMap<OsString, Stamp>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name();
        let is_obj = Path::new(&name).extension().is_some_and(|e| e.eq_ignore_ascii_case("obj"));
        if is_obj
            && !name.as_encoded_bytes().starts_with(b".")
            && let Ok(meta) = entry.metadata()
            && meta.is_file()
        {
            found.insert(name, (meta.len(), meta.modified().ok()));
        }
    }
    Ok(found)
}

/// The folder of a job's files: that which is given, or the only one in it where nothing else is there.
pub(super) fn root(folder: &Path) -> io::Result<PathBuf> {
    let mut root = folder.to_path_buf();
    for _ in 0..DEPTH_MAX {
        let entries = fs::read_dir(&root)?.collect::<io::Result<Vec<_>>>()?;
        let shown = entries.iter().filter(|e| !e.file_name().as_encoded_bytes().starts_with(b"."));
        let shown: Vec<_> = shown.filter(|e| e.file_name() != "__MACOSX").collect();
        match shown.as_slice() {
            [only] if only.file_type()?.is_dir() => root = only.path(),
            _ => break,
        }
    }
    Ok(root)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_and_archives_are_jobs() {
        let t = tempfile::tempdir().unwrap();
        for name in [
            "a.zip",
            "B.TAR.GZ",
            "c.tar.zst",
            "d.tgz",
            "e.tar",
            "notes.txt",
            ".f.zip",
            ".zip",
            "a.done",
            "g.zip.part",
        ] {
            fs::write(t.path().join(name), "").unwrap();
        }
        for name in ["walk.v2", "walk.part", "walk.TMP", "walk~", "part"] {
            fs::create_dir(t.path().join(name)).unwrap();
        }
        let inbox = list(t.path()).unwrap();
        let names: Vec<&str> = inbox.jobs.iter().map(|j| j.name.as_str()).collect();
        assert_eq!(names, ["B", "a", "c", "d", "e", "part", "walk.v2"]);
        assert_eq!(inbox.jobs[0].kind, Kind::Archive(Packed::TarGz));
        assert_eq!(inbox.others, ["notes.txt"]);
        let error = list(&t.path().join("gone")).unwrap_err().to_string();
        assert!(error.contains("gone"), "{error}");
    }

    #[test]
    fn any_change_is_another_set() {
        let t = tempfile::tempdir().unwrap();
        let job = t.path().join("w");
        fs::create_dir_all(job.join("sub")).unwrap();
        let found = Found { file: "w".into(), kind: Kind::Folder, name: "w".into() };
        let look = || look(t.path(), &found).unwrap();
        assert_eq!(look().files, 0);
        fs::write(job.join("a_1.obj"), "v 0 0 0\n").unwrap();
        let first = look();
        assert_eq!((first, first.files, first.done), (look(), 1, false));
        let mut seen = vec![first];
        let mut changed = |what: &str| {
            let now = look();
            assert!(seen.iter().all(|s| s.run != now.run), "{what}");
            seen.push(now);
        };
        fs::write(job.join("sub/b.mtl"), "x").unwrap();
        changed("a file below");
        fs::write(job.join("a_1.obj"), "v 0 0 0\nv 1 0 0\n").unwrap();
        changed("a size");
        let file = fs::File::options().write(true).open(job.join("a_1.obj")).unwrap();
        file.set_modified(crate::clock::EARLIEST).unwrap();
        changed("a time");
        fs::rename(job.join("a_1.obj"), job.join("a_2.obj")).unwrap();
        changed("a name");
        let before = look();
        for (name, is) in [(".done", "done"), (".cancel", "cancelled")] {
            fs::write(job.join(name), "").unwrap();
            let now = look();
            assert_eq!((now.run, now.files), (before.run, before.files), "{name} is no part of the job");
            assert!(if is == "done" { now.done } else { now.cancelled });
        }
        fs::write(job.join("c.obj.part"), "").unwrap();
        assert!(look().unfinished);
        assert_eq!(unfinished(&job), Some(job.join("c.obj.part")));
    }

    #[test]
    fn what_lies_too_deep_is_told_from_what_cannot_be_read() {
        let t = tempfile::tempdir().unwrap();
        let found = Found { file: "w".into(), kind: Kind::Folder, name: "w".into() };
        assert!(!is_limit(&look(t.path(), &found).unwrap_err()), "it is not there");
        let deep = |depth: usize| fs::create_dir_all(t.path().join("w").join(["d"; 64][..depth].join("/")));
        deep(DEPTH_MAX).unwrap();
        look(t.path(), &found).unwrap();
        deep(DEPTH_MAX + 1).unwrap();
        let error = look(t.path(), &found).unwrap_err();
        assert!(is_limit(&error) && error.to_string().contains("move them up"), "{error}");
    }

    #[test]
    fn what_is_said_beside_an_archive() {
        let t = tempfile::tempdir().unwrap();
        fs::write(t.path().join("w.tar.gz"), "x").unwrap();
        let found = Found { file: "w.tar.gz".into(), kind: Kind::Archive(Packed::TarGz), name: "w".into() };
        assert!(!look(t.path(), &found).unwrap().done);
        fs::write(t.path().join("w.done"), "").unwrap();
        fs::write(t.path().join("w.tar.gz.cancel"), "").unwrap();
        let seen = look(t.path(), &found).unwrap();
        assert!(seen.done && seen.cancelled && seen.files == 1);
    }

    #[test]
    fn a_name_says_something_of_the_job_beside_it() {
        for (name, job) in
            [("w.cancel", Some("w")), ("w.TAR.gz.done", Some("w.TAR.gz")), ("w.zip", None), (".cancel", None)]
        {
            assert_eq!(said_of(OsStr::new(name)), job.map(OsStr::new), "{name}");
        }
        for (file, wanted) in [("w.v2", &["w.v2"][..]), ("w.TAR.gz", &["w.TAR.gz", "w"])] {
            assert!(names(OsStr::new(file)).eq(wanted.iter().map(OsStr::new)), "{file}");
        }
    }

    #[test]
    fn the_only_folder_is_the_job() {
        let t = tempfile::tempdir().unwrap();
        fs::create_dir_all(t.path().join("a/b")).unwrap();
        fs::create_dir_all(t.path().join("a/__MACOSX")).unwrap();
        fs::write(t.path().join("a/b/x.obj"), "").unwrap();
        assert!(root(t.path()).unwrap().ends_with("a/b"));
    }
}
