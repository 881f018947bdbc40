use super::*;
use ::tar::{Builder, EntryType, Header};
use ::zip::write::SimpleFileOptions;
use ::zip::{CompressionMethod, ZipWriter};
use std::io::Cursor;

const TRIANGLE: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn out(&self) -> PathBuf {
        self.0.path().join("a/b/c/out")
    }

    /// Unpacks; else what is said. What fails leaves nothing, and nothing is ever outside.
    fn unpack(&self, packed: Packed, bytes: &[u8], limits: Limits) -> Result<Vec<String>, String> {
        let archive = self.0.path().join("archive");
        fs::write(&archive, bytes).unwrap();
        let done = unpack(&archive, packed, &self.out(), limits).map_err(|e| e.to_string());
        let files = files(self.0.path());
        let inside: Vec<String> =
            files.iter().filter_map(|f| f.strip_prefix("a/b/c/out/")).map(str::to_owned).collect();
        assert_eq!(files.len(), inside.len() + 1, "{files:?}");
        match done {
            Ok(()) => {
                fs::remove_dir_all(self.out()).unwrap();
                Ok(inside)
            }
            Err(error) => {
                assert!(!self.out().exists() && error.contains("archive"), "{error}");
                Err(error)
            }
        }
    }
}

fn files(folder: &Path) -> Vec<String> {
    fn below(folder: &Path, root: &Path, found: &mut Vec<String>) {
        for entry in fs::read_dir(folder).unwrap() {
            let entry = entry.unwrap();
            if entry.file_type().unwrap().is_dir() {
                below(&entry.path(), root, found);
            } else {
                found.push(entry.path().strip_prefix(root).unwrap().to_str().unwrap().to_owned());
            }
        }
    }
    let mut found = Vec::new();
    below(folder, folder, &mut found);
    found.sort();
    found
}

fn zipped(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
        if name.ends_with('/') {
            zip.add_directory(*name, options).unwrap();
        } else {
            zip.start_file(*name, options).unwrap();
            zip.write_all(bytes).unwrap();
        }
    }
    zip.finish().unwrap().into_inner()
}

/// A tar of entries: name, kind, where a link leads, bytes. Names are put in as they are.
fn tarred(entries: &[(&str, EntryType, &str, &[u8])]) -> Vec<u8> {
    let mut tar = Builder::new(Vec::new());
    for (name, kind, link, bytes) in entries {
        let mut header = Header::new_ustar();
        header.as_mut_bytes()[..name.len()].copy_from_slice(name.as_bytes());
        header.as_mut_bytes()[157..157 + link.len()].copy_from_slice(link.as_bytes());
        header.set_entry_type(*kind);
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        header.set_cksum();
        tar.append(&header, *bytes).unwrap();
    }
    tar.into_inner().unwrap()
}

fn gzipped(bytes: &[u8]) -> Vec<u8> {
    let mut gz = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    gz.write_all(bytes).unwrap();
    gz.finish().unwrap()
}

fn zstd(bytes: &[u8]) -> Vec<u8> {
    ruzstd::encoding::compress_to_vec(bytes, ruzstd::encoding::CompressionLevel::Fastest)
}

const FILE: EntryType = EntryType::Regular;

#[test]
fn what_is_good_is_unpacked() {
    let place = Place::new();
    let names = ["walk/a_1.obj", "walk/tex/b.png"];
    let good = zipped(&[("walk/", b""), (names[0], TRIANGLE), (names[1], b"x")]);
    assert_eq!(place.unpack(Packed::Zip, &good, LIMITS).unwrap(), names);
    let windows = zipped(&[("walk\\a_1.obj", TRIANGLE), ("./walk/tex/b.png", b"x")]);
    assert_eq!(place.unpack(Packed::Zip, &windows, LIMITS).unwrap(), names);
    let tar = tarred(&[
        ("walk/", EntryType::Directory, "", b""),
        ("./walk/a_1.obj", FILE, "", TRIANGLE),
        (names[1], FILE, "", b"x"),
    ]);
    for (packed, bytes) in
        [(Packed::Tar, tar.clone()), (Packed::TarGz, gzipped(&tar)), (Packed::TarZst, zstd(&tar))]
    {
        assert_eq!(place.unpack(packed, &bytes, LIMITS).unwrap(), names, "{packed:?}");
    }
}

#[test]
fn long_names_are_read() {
    let place = Place::new();
    let long = format!("{}/a_1.obj", "n".repeat(180));
    let mut tar = Builder::new(Vec::new());
    let mut header = Header::new_gnu();
    header.set_size(TRIANGLE.len() as u64);
    tar.append_data(&mut header, &long, TRIANGLE).unwrap();
    assert_eq!(
        place.unpack(Packed::Tar, &tar.into_inner().unwrap(), LIMITS).unwrap(),
        std::slice::from_ref(&long)
    );
    let record = |key: &str, value: &str| {
        let body = format!(" {key}={value}\n");
        let length = (body.len()..body.len() + 9).find(|n| n.to_string().len() + body.len() == *n).unwrap();
        format!("{length}{body}").into_bytes()
    };
    let pax = |key: &str, value: &str| {
        let record = record(key, value);
        tarred(&[("x", EntryType::XHeader, "", &record), ("short.obj", FILE, "", TRIANGLE)])
    };
    assert_eq!(place.unpack(Packed::Tar, &pax("path", &long), LIMITS).unwrap(), [long]);
    for (key, value) in
        [("path", "../x"), ("linkpath", "/etc/passwd"), ("size", "99"), ("GNU.sparse.major", "1")]
    {
        place.unpack(Packed::Tar, &pax(key, value), LIMITS).unwrap_err();
    }
    place.unpack(Packed::Tar, &pax("path", &"x".repeat(70_000)), LIMITS).unwrap_err();
}

#[test]
fn no_name_leads_out() {
    let place = Place::new();
    for name in [
        "../x",
        "../../x",
        "a/../../x",
        "a/..",
        "/x",
        "/etc/x",
        "\\x",
        "..\\x",
        "a\\..\\..\\x",
        "C:\\x",
        "c:/x",
        "a\nb",
        "a\u{1b}[2J",
    ] {
        let error = place.unpack(
            Packed::Tar,
            &tarred(&[("ok.obj", FILE, "", TRIANGLE), (name, FILE, "", b"x")]),
            LIMITS,
        );
        assert!(error.unwrap_err().contains("nothing of the archive"), "{name:?}");
        let error = place.unpack(Packed::Zip, &zipped(&[("ok.obj", TRIANGLE), (name, b"x")]), LIMITS);
        assert!(error.is_err(), "{name:?}");
    }
    let long = "n/".repeat(40) + "x";
    assert!(place.unpack(Packed::Zip, &zipped(&[(&long, b"x")]), LIMITS).is_err());
    assert!(place.unpack(Packed::Zip, &zipped(&[(&"n".repeat(300), b"x")]), LIMITS).is_err());
}

#[test]
fn each_name_is_of_one_thing() {
    let place = Place::new();
    for (first, second, why) in [
        ("a.obj", "A.obj", "case only"),
        ("tex/a.png", "TEX/b.png", "case only"),
        ("a.obj", "a.obj", "twice"),
        ("a", "a/b", "which is a file"),
        ("a/b", "a", "case only"),
    ] {
        let error = place
            .unpack(Packed::Tar, &tarred(&[(first, FILE, "", b"x"), (second, FILE, "", b"y")]), LIMITS)
            .unwrap_err();
        assert!(
            error.contains(why) || why == "case only" && error.contains("twice"),
            "{first} {second}: {error}"
        );
    }
}

#[test]
fn only_plain_files_and_folders() {
    let place = Place::new();
    for kind in [
        EntryType::Symlink,
        EntryType::Link,
        EntryType::Fifo,
        EntryType::Char,
        EntryType::Block,
        EntryType::GNUSparse,
        EntryType::GNULongLink,
        EntryType::new(b'M'),
    ] {
        let tar = tarred(&[
            ("ok.obj", FILE, "", TRIANGLE),
            ("bad", kind, "../../ok", b""),
            ("bad/x", FILE, "", b"x"),
        ]);
        let error = place.unpack(Packed::Tar, &tar, LIMITS).unwrap_err();
        assert!(error.contains("`bad`"), "{kind:?}: {error}");
    }
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    zip.add_symlink("bad", "/etc", SimpleFileOptions::default()).unwrap();
    let error = place.unpack(Packed::Zip, &zip.finish().unwrap().into_inner(), LIMITS).unwrap_err();
    assert!(error.contains("`bad` is a link"), "{error}");
}

#[test]
fn what_becomes_too_much_is_refused() {
    let place = Place::new();
    let zeros = vec![b'#'; 8 << 20];
    let tar = tarred(&[("a_1.obj", FILE, "", &zeros)]);
    for (packed, bytes) in [
        (Packed::Zip, zipped(&[("a_1.obj", &zeros)])),
        (Packed::TarGz, gzipped(&tar)),
        (Packed::TarZst, zstd(&tar)),
    ] {
        let error = place.unpack(packed, &bytes, LIMITS).unwrap_err();
        assert!(error.contains("at most 100:1"), "{packed:?}: {error}");
    }
    let small = Limits { bytes: 100, ..LIMITS };
    let error = place.unpack(Packed::Zip, &zipped(&[("a", &[7; 60]), ("b", &[8; 60])]), small).unwrap_err();
    assert!(error.contains("100 bytes are unpacked"), "{error}");
    let few = Limits { entries: 2, ..LIMITS };
    let three: [(&str, &[u8]); 3] = [("a", b""), ("b", b""), ("c", b"")];
    let error = place.unpack(Packed::Zip, &zipped(&three), few).unwrap_err();
    assert!(error.contains("more than 2 entries"), "{error}");
    let error = place.unpack(Packed::Tar, &tarred(&three.map(|(n, b)| (n, FILE, "", b))), few).unwrap_err();
    assert!(error.contains("more than 2 entries"), "{error}");
    // folders count, also where no entry is about them
    let deep = |names: &[&str]| {
        let files: Vec<(&str, &[u8])> = names.iter().map(|name| (*name, &b""[..])).collect();
        place.unpack(Packed::Zip, &zipped(&files), few)
    };
    assert!(deep(&["a/b/c"]).unwrap_err().contains("more folders"));
    assert_eq!(deep(&["a/", "a/b"]).unwrap(), ["a/b"]);
    // a header that says little does not help
    let mut lying = zipped(&[("a_1.obj", &zeros)]);
    let size = (zeros.len() as u32).to_le_bytes();
    for at in 0..lying.len() - 4 {
        if lying[at..at + 4] == size {
            lying[at..at + 4].copy_from_slice(&9u32.to_le_bytes());
        }
    }
    place.unpack(Packed::Zip, &lying, LIMITS).unwrap_err();
}

#[test]
fn torn_anywhere_it_fails_whole() {
    let place = Place::new();
    let noise: Vec<u8> = (0..3000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    let tar = tarred(&[("a_1.obj", FILE, "", TRIANGLE), ("b.bin", FILE, "", &noise)]);
    let whole = [
        (Packed::Zip, zipped(&[("a_1.obj", TRIANGLE), ("b.bin", &noise)])),
        (Packed::TarGz, gzipped(&tar)),
        (Packed::TarZst, zstd(&tar)),
        (Packed::Tar, tar),
    ];
    for (packed, bytes) in whole {
        // the zeros at the end of a tar say nothing
        let end = if packed == Packed::Tar { bytes.len() - 1024 } else { bytes.len() - 1 };
        for cut in (0..=end).step_by(37).chain([end]) {
            let torn = place.unpack(packed, &bytes[..cut], LIMITS);
            assert!(torn.is_err(), "{packed:?} cut at {cut} of {}: {torn:?}", bytes.len());
        }
    }
    // a byte that fell over
    let mut zip = zipped(&[("b.bin", &noise)]);
    zip[200] ^= 1;
    place.unpack(Packed::Zip, &zip, LIMITS).unwrap_err();
    for packed in [Packed::Zip, Packed::Tar, Packed::TarGz, Packed::TarZst] {
        place.unpack(packed, b"", LIMITS).unwrap_err();
        place.unpack(packed, &noise, LIMITS).unwrap_err();
    }
}

#[test]
fn the_job_file_is_found_without_unpacking() {
    let t = tempfile::tempdir().unwrap();
    let find = |files: &[(&str, &[u8])]| {
        fs::write(t.path().join("a.zip"), zipped(files)).unwrap();
        job_file(&t.path().join("a.zip"), Packed::Zip, LIMITS).map_err(|e| e.to_string())
    };
    assert_eq!(find(&[("a.obj", b"x")]).unwrap(), None);
    assert_eq!(find(&[("w/job.yaml", b"inner"), ("a.obj", b"x")]).unwrap().unwrap(), b"inner");
    assert_eq!(find(&[("w/job.yaml", b"inner"), ("job.yml", b"outer")]).unwrap().unwrap(), b"outer");
    assert_eq!(find(&[("w/x/job.yaml", b"deep")]).unwrap(), None);
    assert!(find(&[("job.yaml", b"x"), ("../x", b"")]).is_err());
}
