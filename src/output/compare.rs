//! Two pictures, or two folders of pictures, compared.

use super::encoding::Format;
use super::error::OutputError;
use super::read::read_picture;
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
    /// Not at all, and why: it is missing on one side, has another size or other channels, or is broken.
    Incomparable(String),
}

/// Compares two pictures, or the pictures of two folders and their subfolders by name (hidden ones left out), in the
/// order of names. An error where the two cannot be read at all; what is wrong with a picture of a folder is its outcome.
pub fn compare_paths(a: &Path, b: &Path) -> Result<Vec<PictureComparison>, OutputError> {
    let is_folder = |path: &Path| path.metadata().map(|m| m.is_dir()).map_err(OutputError::read(path));
    match (is_folder(a)?, is_folder(b)?) {
        (true, true) => compare_folders(a, b),
        (false, false) => {
            let outcome = PictureOutcome::Compared(compare_files(a, b)?);
            let picture = a.file_name().map_or_else(|| a.to_path_buf(), PathBuf::from);
            Ok(vec![PictureComparison { picture, outcome }])
        }
        _ => Err(OutputError::FolderAndFile(a.to_path_buf(), b.to_path_buf())),
    }
}

fn compare_files(a: &Path, b: &Path) -> Result<Comparison, OutputError> {
    Ok(compare(&read_picture(a)?, &read_picture(b)?)?)
}

fn compare_folders(a: &Path, b: &Path) -> Result<Vec<PictureComparison>, OutputError> {
    let (in_a, in_b) = (pictures_below(a)?, pictures_below(b)?);
    let compared = in_a.union(&in_b).map(|picture| {
        let outcome = if !in_b.contains(picture) {
            PictureOutcome::Incomparable(format!("is only in {}", a.display()))
        } else if !in_a.contains(picture) {
            PictureOutcome::Incomparable(format!("is only in {}", b.display()))
        } else {
            match compare_files(&a.join(picture), &b.join(picture)) {
                Ok(comparison) => PictureOutcome::Compared(comparison),
                Err(error) => PictureOutcome::Incomparable(error.to_string()),
            }
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
        };
        // 51 / 255 = 0.2
        assert_eq!(
            (told(0).as_str(), told(2).as_str(), told(5).as_str()),
            ("0.2000 false", "0.0000 true", "0.0000 true")
        );
        assert_eq!(told(1), format!("is only in {}", b.path().display()));
        assert_eq!(told(4), format!("is only in {}", a.path().display()));
        assert_eq!(told(3), "the sizes differ: 1x1 and 2x1");
        assert!(told(6).contains("torn.png"), "{}", told(6));
    }

    #[test]
    fn what_cannot_be_compared_at_all_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        ppm(folder.path(), "a.ppm", &[[1, 2, 3]]);
        let file = folder.path().join("a.ppm");
        assert_eq!(compare_paths(&file, &file).unwrap()[0].picture, Path::new("a.ppm"));
        let error = |a: &Path, b: &Path| compare_paths(a, b).unwrap_err().to_string();
        assert!(error(&file, folder.path()).contains("name two pictures or two folders"));
        assert!(error(&file, &folder.path().join("gone.ppm")).contains("gone.ppm: cannot be read"));
        let text = folder.path().join("text.png");
        std::fs::write(&text, "this is no picture").unwrap();
        assert!(error(&file, &text).contains("text.png: is not a picture"));
    }
}
