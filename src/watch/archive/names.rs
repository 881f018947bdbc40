//! Names within an archive: relative, downwards, each of one thing only.

use std::collections::HashMap;
use std::path::PathBuf;

/// No name is longer with its folders.
const NAME_BYTES_MAX: usize = 1024;
/// Nor is a part of one.
const PART_BYTES_MAX: usize = 255;
/// Nor lies deeper.
const DEPTH_MAX: usize = 32;

/// The names that an archive has used so far.
#[derive(Debug)]
pub(super) struct Names {
    left: u64,
    /// By their lower case: how they are written, and whether they are folders.
    used: HashMap<String, (String, bool)>,
}

impl Names {
    pub(super) fn new(most: u64) -> Self {
        Self { left: most, used: HashMap::new() }
    }

    /// Counts an entry; false where there are too many.
    pub(super) fn count(&mut self) -> bool {
        let left = self.left.checked_sub(1);
        self.left = left.unwrap_or(0);
        left.is_some()
    }

    /// Where a folder goes; None for the job's own. An error is what is wrong with the name.
    pub(super) fn folder(&mut self, name: &[u8]) -> Result<Option<PathBuf>, String> {
        let parts = parts(name)?;
        self.use_folders(&parts, parts.len())?;
        Ok((!parts.is_empty()).then(|| parts.iter().collect()))
    }

    /// Where a file goes.
    pub(super) fn file(&mut self, name: &[u8]) -> Result<PathBuf, String> {
        let parts = parts(name)?;
        let Some((_, folders)) = parts.split_last() else { return Err("has no name".to_owned()) };
        self.use_folders(folders, 0)?;
        let whole = parts.join("/");
        match self.used.insert(whole.to_lowercase(), (whole.clone(), false)) {
            None => Ok(parts.iter().collect()),
            Some((same, _)) if same == whole => Err("is there twice".to_owned()),
            Some((other, _)) => Err(format!("differs from `{other}` in case only")),
        }
    }

    /// Uses a name's folders, each below the one before. Those that no entry is about count as entries themselves; the one at
    /// depth `own` is counted already.
    fn use_folders(&mut self, parts: &[String], own: usize) -> Result<(), String> {
        for depth in 1..=parts.len() {
            let path = parts[..depth].join("/");
            let is_new = !self.used.contains_key(&path.to_lowercase());
            if is_new && depth != own && !self.count() {
                return Err("lies in more folders than are unpacked".to_owned());
            }
            let (used, is_folder) =
                self.used.entry(path.to_lowercase()).or_insert_with(|| (path.clone(), true));
            if !*is_folder {
                return Err(format!("lies below `{used}`, which is a file"));
            }
            if *used != path {
                return Err(format!("differs from `{used}` in case only"));
            }
        }
        Ok(())
    }
}

/// The parts of a name; old Windows programs write `\`.
fn parts(name: &[u8]) -> Result<Vec<String>, String> {
    let name = std::str::from_utf8(name).map_err(|_| "is not UTF-8".to_owned())?;
    if name.len() > NAME_BYTES_MAX {
        return Err(format!("is longer than {NAME_BYTES_MAX} bytes"));
    }
    if name.chars().any(char::is_control) {
        return Err("has signs in its name that are not for printing".to_owned());
    }
    if name.starts_with(['/', '\\']) {
        return Err("is an absolute path".to_owned());
    }
    let mut parts = Vec::new();
    for part in name.split(['/', '\\']) {
        match part {
            "" | "." => continue,
            ".." => return Err("leads out of the archive".to_owned()),
            _ => {}
        }
        if part.as_bytes()[1..].first() == Some(&b':') {
            return Err("names a drive".to_owned());
        }
        if part.len() > PART_BYTES_MAX {
            return Err(format!("has a part longer than {PART_BYTES_MAX} bytes"));
        }
        parts.push(part.to_owned());
    }
    if parts.len() > DEPTH_MAX {
        return Err(format!("lies deeper than {DEPTH_MAX} folders"));
    }
    Ok(parts)
}
