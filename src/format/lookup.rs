//! Finding the files that an OBJ or MTL names, however their case and slashes are written.

use std::collections::HashMap;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

/// No file has a longer name with its folders; what names one is not worth looking for.
const MAX_NAME_BYTES: usize = 4096;

/// Finds files by name. A folder is listed once, and only when a name is not there as written.
#[derive(Debug, Default)]
pub(super) struct Lookup {
    /// Per folder its entries with their names in lower case, in order.
    listings: HashMap<PathBuf, Vec<(String, OsString)>>,
    /// The folder that holds all that may be found.
    within: Option<PathBuf>,
}

impl Lookup {
    /// Finds what lies within a folder (as the system names it, without links), or anything.
    pub(super) fn within(folder: Option<PathBuf>) -> Self {
        Self { within: folder, ..Self::default() }
    }

    /// Whether a file that was found may be read.
    fn is_within(&self, path: &Path) -> bool {
        self.within
            .as_ref()
            .is_none_or(|folder| path.canonicalize().is_ok_and(|real| real.starts_with(folder)))
    }

    /// Looks for a plain file: as written in each of the folders, then with either slash and in any case, last by
    /// the name behind the last slash.
    pub(super) fn find(&mut self, name: &[u8], folders: &[&Path]) -> Option<PathBuf> {
        if name.is_empty() || name.len() > MAX_NAME_BYTES {
            return None;
        }
        let as_written = path_from_bytes(name);
        let found = folders
            .iter()
            .map(|folder| folder.join(&as_written))
            .find(|path| path.is_file() && self.is_within(path));
        if found.is_some() {
            return found;
        }
        let parts: Vec<&[u8]> =
            name.split(|&b| b == b'/' || b == b'\\').filter(|part| !part.is_empty()).collect();
        let base = parts.last()?;
        folders
            .iter()
            .find_map(|folder| self.descend(folder, &parts))
            .or_else(|| folders.iter().find_map(|folder| self.descend(folder, &[base])))
    }

    /// Follows a path's parts from a folder, each as written or else in any case.
    fn descend(&mut self, folder: &Path, parts: &[&[u8]]) -> Option<PathBuf> {
        let mut path = folder.to_path_buf();
        for &part in parts {
            let next = path.join(path_from_bytes(part));
            path = match part {
                b"." => continue,
                b".." => next,
                _ if next.exists() => next,
                _ => path.join(self.in_any_case(&path, part)?),
            };
        }
        (path.is_file() && self.is_within(&path)).then_some(path)
    }

    fn in_any_case(&mut self, folder: &Path, name: &[u8]) -> Option<&OsString> {
        let wanted = String::from_utf8_lossy(name).to_lowercase();
        let listing = self.listings.entry(folder.to_path_buf()).or_insert_with(|| list(folder));
        let place = listing.partition_point(|(lower, _)| *lower < wanted);
        listing.get(place).filter(|(lower, _)| *lower == wanted).map(|(_, name)| name)
    }
}

fn list(folder: &Path) -> Vec<(String, OsString)> {
    // a path without a folder is in the current one
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut listing: Vec<_> = entries
        .map(|entry| (entry.file_name().to_string_lossy().to_lowercase(), entry.file_name()))
        .collect();
    listing.sort();
    listing
}

#[cfg(unix)]
fn path_from_bytes(bytes: &[u8]) -> PathBuf {
    use std::os::unix::ffi::OsStrExt;
    PathBuf::from(std::ffi::OsStr::from_bytes(bytes))
}

#[cfg(not(unix))]
fn path_from_bytes(bytes: &[u8]) -> PathBuf {
    PathBuf::from(String::from_utf8_lossy(bytes).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn however_it_is_written() {
        let root = tempfile::tempdir().unwrap();
        let (obj, mtl) = (root.path().join("obj"), root.path().join("mtl"));
        fs::create_dir_all(mtl.join("Maps")).unwrap();
        fs::create_dir_all(&obj).unwrap();
        for file in ["mtl/Maps/Wood.PNG", "mtl/both.png", "obj/both.png", "obj/near.png"] {
            fs::write(root.path().join(file), file).unwrap();
        }
        let mut lookup = Lookup::default();
        let mut find = |name: &str| {
            let found = lookup.find(name.as_bytes(), &[&mtl, &obj])?;
            Some(String::from_utf8(fs::read(found).unwrap()).unwrap())
        };
        let wood = Some("mtl/Maps/Wood.PNG".to_owned());
        for name in
            ["Maps/Wood.PNG", "maps/wood.png", r"MAPS\wood.png", r".\maps\\wood.png", "../mtl/Maps/wood.png"]
        {
            assert_eq!(find(name), wood, "{name}");
        }
        assert_eq!(find("both.png").as_deref(), Some("mtl/both.png"), "the first folder first");
        assert_eq!(
            find(r"C:\projects\textures\NEAR.png").as_deref(),
            Some("obj/near.png"),
            "by its base name"
        );
        for name in ["", "/", "Maps", "wood.png", "absent.png", "both.png\0"] {
            assert_eq!(find(name), None, "{name}");
        }
        assert_eq!(find(&format!("{}both.png", "./".repeat(3000))), None, "longer than any name");
        let mut inside = Lookup::within(Some(obj.canonicalize().unwrap()));
        let mut find_inside = |name: &str| inside.find(name.as_bytes(), &[&obj]).is_some();
        assert!(find_inside("near.png") && find_inside("../mtl/both.png"), "by its base name");
        assert!(
            !find_inside("../mtl/Maps/Wood.PNG") && !find_inside(mtl.join("Maps/Wood.PNG").to_str().unwrap())
        );
        let absolute = mtl.join("both.png");
        assert_eq!(find(absolute.to_str().unwrap()).as_deref(), Some("mtl/both.png"));
    }
}
