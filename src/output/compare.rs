//! Two pictures, or two folders of pictures, compared.

use super::encoding::Format;
use super::error::OutputError;
use super::read::{decode, read_bytes};
use crate::film::compare::{Comparison, compare};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A picture and how it compares.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureComparison {
    /// Its name: the first file's, or its path below both folders.
    pub picture: PathBuf,
    /// How it compares.
    pub outcome: PictureOutcome,
}

/// How a picture compares.
#[derive(Clone, Debug, PartialEq)]
pub enum PictureOutcome {
    /// Value by value.
    Compared(Comparison),
    /// As another one by its size or channels: how.
    Incomparable(String),
    /// It is in one folder only: in which.
    Alone(PathBuf),
    /// One of the two cannot be read: why.
    Unreadable(String),
}

/// Compares two pictures, or the pictures of two folders and their subfolders by name (hidden ones left out), in the
/// order of names. Files that are the same byte for byte are equal, whether they can be read as pictures or not.
///
/// # Errors
/// Where the two cannot be read at all, or are folders without pictures; what is wrong with a picture of a folder is its
/// outcome.
pub fn compare_paths(a: &Path, b: &Path) -> Result<Vec<PictureComparison>, OutputError> {
    let is_folder = |path: &Path| path.metadata().map(|m| m.is_dir()).map_err(OutputError::read(path));
    match (is_folder(a)?, is_folder(b)?) {
        (true, true) => compare_folders(a, b),
        (false, false) => {
            let outcome = compare_files(a, b)?;
            let picture = a.file_name().map_or_else(|| a.to_path_buf(), PathBuf::from);
            Ok(vec![PictureComparison { picture, outcome }])
        }
        _ => Err(OutputError::FolderAndFile(a.to_path_buf(), b.to_path_buf())),
    }
}

fn compare_files(a: &Path, b: &Path) -> Result<PictureOutcome, OutputError> {
    let [in_a, in_b] = [read_bytes(a)?, read_bytes(b)?];
    if in_a == in_b {
        return Ok(PictureOutcome::Compared(Comparison::EQUAL));
    }
    Ok(match compare(&decode(&in_a, a)?, &decode(&in_b, b)?) {
        Ok(comparison) => PictureOutcome::Compared(comparison),
        Err(mismatch) => PictureOutcome::Incomparable(mismatch.to_string()),
    })
}

fn compare_folders(a: &Path, b: &Path) -> Result<Vec<PictureComparison>, OutputError> {
    let (in_a, in_b) = (pictures_below(a)?, pictures_below(b)?);
    if in_a.is_empty() && in_b.is_empty() {
        return Err(OutputError::NoPictures(a.to_path_buf(), b.to_path_buf()));
    }
    let compared = in_a.union(&in_b).map(|picture| {
        let outcome = match (in_a.contains(picture), in_b.contains(picture)) {
            (true, false) => PictureOutcome::Alone(a.to_path_buf()),
            (false, _) => PictureOutcome::Alone(b.to_path_buf()),
            (true, true) => compare_files(&a.join(picture), &b.join(picture))
                .unwrap_or_else(|error| PictureOutcome::Unreadable(error.to_string())),
        };
        PictureComparison { picture: picture.clone(), outcome }
    });
    Ok(compared.collect())
}

/// Paths of all pictures below a folder, relative to it.
pub(super) fn pictures_below(folder: &Path) -> Result<BTreeSet<PathBuf>, OutputError> {
    let mut pictures = BTreeSet::new();
    let mut subfolders = vec![PathBuf::new()];
    while let Some(subfolder) = subfolders.pop() {
        let path = folder.join(&subfolder);
        for entry in path.read_dir().map_err(OutputError::read(&path))? {
            let entry = entry.map_err(OutputError::read(&path))?;
            let name = entry.file_name();
            if name.as_encoded_bytes().starts_with(b".") {
                continue;
            }
            // links to files count as files; those to folders are not followed, so that the walk ends
            if entry.file_type().map_err(OutputError::read(&path))?.is_dir() {
                subfolders.push(subfolder.join(name));
            } else if Format::of_file(Path::new(&name)).is_some() {
                pictures.insert(subfolder.join(name));
            }
        }
    }
    Ok(pictures)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ppm(folder: &Path, name: &str, pixels: &[[u8; 3]]) {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        let mut bytes = format!("P6\n{} 1\n255\n", pixels.len()).into_bytes();
        bytes.extend(pixels.as_flattened());
        std::fs::write(path, bytes).unwrap();
    }

    #[test]
    fn folders_by_name() {
        let (a, b) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        for folder in [a.path(), b.path()] {
            ppm(folder, "same.ppm", &[[1, 2, 3]]);
            ppm(folder, "sub/same.PPM", &[[1, 2, 3]]);
            ppm(folder, ".hidden.ppm", &[[1, 2, 3]]);
            std::fs::write(folder.join("notes.txt"), "no picture").unwrap();
        }
        ppm(a.path(), "differs.ppm", &[[0, 0, 0], [0, 51, 0]]);
        ppm(b.path(), "differs.ppm", &[[0, 0, 0], [0, 0, 0]]);
        ppm(a.path(), "size.ppm", &[[0, 0, 0]]);
        ppm(b.path(), "size.ppm", &[[0, 0, 0], [0, 0, 0]]);
        ppm(a.path(), "sub/extra.ppm", &[[1, 2, 3]]);
        ppm(b.path(), "missing.ppm", &[[1, 2, 3]]);
        std::fs::write(a.path().join("torn.png"), b"\x89PNG\r\n\x1a\n\0\0").unwrap();
        ppm(b.path(), "torn.png", &[[1, 2, 3]]);

        let compared = compare_paths(a.path(), b.path()).unwrap();
        let names: Vec<_> = compared.iter().map(|c| c.picture.to_str().unwrap()).collect();
        assert_eq!(
            names,
            [
                "differs.ppm",
                "missing.ppm",
                "same.ppm",
                "size.ppm",
                "sub/extra.ppm",
                "sub/same.PPM",
                "torn.png"
            ]
        );
        let told = |i: usize| match &compared[i].outcome {
            PictureOutcome::Compared(c) => format!("{:.4} {}", c.max, c.psnr.is_none()),
            PictureOutcome::Incomparable(why) => why.clone(),
            PictureOutcome::Alone(folder) => format!("only in {}", folder.display()),
            PictureOutcome::Unreadable(why) => format!("unreadable: {why}"),
        };
        // 51 / 255 = 0.2
        assert_eq!(
            (told(0).as_str(), told(2).as_str(), told(5).as_str()),
            ("0.2000 false", "0.0000 true", "0.0000 true")
        );
        assert_eq!(told(1), format!("only in {}", b.path().display()));
        assert_eq!(told(4), format!("only in {}", a.path().display()));
        assert_eq!(told(3), "the sizes differ: 1x1 and 2x1");
        assert!(told(6).starts_with("unreadable: ") && told(6).contains("torn.png"), "{}", told(6));
        // what cannot be read is equal to itself
        std::fs::copy(a.path().join("torn.png"), b.path().join("torn.png")).unwrap();
        let compared = compare_paths(a.path(), b.path()).unwrap();
        assert_eq!(compared[6].outcome, PictureOutcome::Compared(Comparison::EQUAL));
    }

    #[test]
    fn what_cannot_be_compared_at_all_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let told = compare_paths(folder.path(), folder.path()).unwrap_err().to_string();
        assert!(told.contains("no pictures"), "{told}");
        ppm(folder.path(), "a.ppm", &[[1, 2, 3]]);
        let file = folder.path().join("a.ppm");
        assert_eq!(compare_paths(&file, &file).unwrap()[0].picture, Path::new("a.ppm"));
        let error = |a: &Path, b: &Path| compare_paths(a, b).unwrap_err().to_string();
        assert!(error(&file, folder.path()).contains("name two pictures or two folders"));
        assert!(error(&file, &folder.path().join("gone.ppm")).contains("gone.ppm: cannot be read"));
        let text = folder.path().join("text.png");
        std::fs::write(&text, "this is no picture").unwrap();
        assert!(error(&file, &text).contains("text.png: is not a picture"));
        ppm(folder.path(), "b.ppm", &[[1, 2, 3], [1, 2, 3]]);
        let outcome = &compare_paths(&file, &folder.path().join("b.ppm")).unwrap()[0].outcome;
        assert_eq!(outcome, &PictureOutcome::Incomparable("the sizes differ: 1x1 and 2x1".to_string()));
    }
}
