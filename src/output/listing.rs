//! Which files a whole run left in an output folder: `DIR/.rentix/pictures`. Records do not say it, for they name what
//! earlier runs made, too.
//!
//! A line a file, relative to the folder, as records write names.

use super::compare::pictures_below;
use super::error::OutputError;
use super::record_name::{name_from_path, path_from_name};
use super::records::records_folder;
use std::collections::{HashMap, HashSet};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

const LISTING: &str = "pictures";

/// Keeps which files a run left in an output folder, relative to it, now that all are there.
pub fn keep_listing(folder: &Path, files: impl IntoIterator<Item = PathBuf>) -> Result<(), OutputError> {
    let folder = records_folder(folder);
    fs::create_dir_all(&folder).map_err(OutputError::write(&folder))?;
    let lines: String = files.into_iter().map(|file| name_from_path(&file) + "\n").collect();
    let file = folder.join(LISTING);
    // neither flushed nor in one step: what a kill or a power cut leaves of it lets a job be looked through once more
    fs::write(&file, lines).map_err(OutputError::write(&file))
}

/// What is gone of the files that a run left in an output folder, in words; None where all are there. No file is read, and
/// each folder is listed once. Where no listing is kept, there must be at least so many pictures.
pub fn gone(folder: &Path, pictures: u64) -> Option<String> {
    let Ok(lines) = fs::read_to_string(records_folder(folder).join(LISTING)) else {
        let there = pictures_below(folder).map_or(0, |pictures| pictures.len() as u64);
        let few = || format!("{}: {there} pictures are there of {pictures} that were made", folder.display());
        return (there < pictures).then(few);
    };
    let mut listed = HashMap::new();
    let is_gone = |file: &PathBuf| {
        let parent = file.parent().map(|parent| folder.join(parent)).unwrap_or_default();
        let names = listed.entry(parent).or_insert_with_key(|parent| names_of_files(parent));
        let is_there = file.file_name().is_some_and(|name| names.contains(name));
        // a link counts, and so does a name that the file system writes otherwise
        !(is_there || folder.join(file).is_file())
    };
    let gone = lines.lines().filter_map(path_from_name).find(is_gone)?;
    Some(format!("{}: is gone", folder.join(gone).display()))
}

fn names_of_files(folder: &Path) -> HashSet<OsString> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.filter(|e| e.file_type().is_ok_and(|t| t.is_file())).map(|e| e.file_name()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_gone_is_named() {
        let t = tempfile::tempdir().unwrap();
        let folder = t.path();
        let files = ["a b.png", "sub/c.png", "sub/c.aov.exr"];
        fs::create_dir(folder.join("sub")).unwrap();
        for file in files {
            fs::write(folder.join(file), "").unwrap();
        }
        // without a listing they are counted
        assert_eq!(gone(folder, 3), None);
        assert!(gone(folder, 4).unwrap().contains("3 pictures are there of 4"));
        keep_listing(folder, files.map(PathBuf::from)).unwrap();
        fs::write(folder.join("other.png"), "").unwrap();
        assert_eq!(gone(folder, 9), None);
        for file in files {
            let away = t.path().join("away");
            fs::rename(folder.join(file), &away).unwrap();
            assert_eq!(gone(folder, 0), Some(format!("{}: is gone", folder.join(file).display())));
            fs::create_dir(folder.join(file)).unwrap();
            assert!(gone(folder, 0).is_some(), "a folder is no picture");
            fs::remove_dir(folder.join(file)).unwrap();
            fs::rename(away, folder.join(file)).unwrap();
        }
        assert_eq!(gone(folder, 0), None);
        assert!(gone(&folder.join("absent"), 1).is_some());
    }
}
