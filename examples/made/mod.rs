//! Sample sequences as programs make them: written, or compared with what is there.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::ExitCode;
use std::{fs, io};

/// Names and contents of a folder's files.
pub(crate) type Files = BTreeMap<String, Vec<u8>>;

/// The files of a folder that are not what is made, and those that are too many.
pub(crate) fn differences(folder: &Path, made: &Files) -> io::Result<BTreeSet<String>> {
    let mut different = BTreeSet::new();
    for entry in fs::read_dir(folder)? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        if !made.contains_key(&name) {
            different.insert(name);
        }
    }
    let is_made =
        |name: &str, content: &Vec<u8>| fs::read(folder.join(name)).is_ok_and(|there| there == *content);
    different.extend(made.iter().filter(|(name, content)| !is_made(name, content)).map(|(n, _)| n.clone()));
    Ok(different)
}

/// Writes the files of a folder of `sequences/`; with `--check` among the arguments it tells whether those there are the
/// same.
pub(crate) fn write_or_check(folder: &str, made: &Files) -> io::Result<ExitCode> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("sequences").join(folder);
    if std::env::args().any(|a| a == "--check") {
        let different = differences(&folder, made)?;
        for name in &different {
            eprintln!("{}: not what this program makes", folder.join(name).display());
        }
        return Ok(if different.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE });
    }
    fs::create_dir_all(&folder)?;
    for (name, content) in made {
        fs::write(folder.join(name), content)?;
    }
    Ok(ExitCode::SUCCESS)
}
