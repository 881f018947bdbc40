//! The first place at which two folders of pictures differ, byte for byte.

use super::compare::pictures_below;
use super::error::OutputError;
use super::read::read_picture;
use crate::film::compare::{Picture, Samples};
use std::fs;
use std::path::Path;

/// Where the pictures of two folders first differ, in the order of names: the file, the pixel and its ids in both, as far
/// as the files have them; None where they are the same byte for byte.
pub fn first_difference(a: &Path, b: &Path) -> Result<Option<String>, OutputError> {
    let (in_a, in_b) = (pictures_below(a)?, pictures_below(b)?);
    for name in in_a.union(&in_b) {
        if !(in_a.contains(name) && in_b.contains(name)) {
            let only = if in_a.contains(name) { a } else { b };
            return Ok(Some(format!("{} is only in {}", name.display(), only.display())));
        }
        let (a, b) = (a.join(name), b.join(name));
        let read = |path: &Path| fs::read(path).map_err(OutputError::read(path));
        if read(&a)? != read(&b)? {
            return Ok(Some(format!("{}: {}", name.display(), first_pixel(&a, &b))));
        }
    }
    Ok(None)
}

fn first_pixel(a: &Path, b: &Path) -> String {
    let (Ok(pa), Ok(pb)) = (read_picture(a), read_picture(b)) else {
        return "the bytes differ".to_string();
    };
    let Some(place) = first_place(&pa, &pb) else {
        return "the bytes differ, the pixels do not".to_string();
    };
    let width = pa.size[0] as usize;
    let [ia, ib] = [(a, &pa), (b, &pb)].map(|(path, picture)| ids(path, picture, place));
    format!("pixel ({}, {}) differs: {ia} and {ib}", place % width, place / width)
}

/// The first pixel at which any channel differs.
fn first_place(a: &Picture, b: &Picture) -> Option<usize> {
    let differ = |i: usize| {
        a.channels.iter().zip(&b.channels).any(|(a, b)| match (&a.samples, &b.samples) {
            (Samples::Share(a), Samples::Share(b)) => a[i] != b[i],
            (Samples::Float(a), Samples::Float(b)) => a[i].to_bits() != b[i].to_bits(),
            (Samples::Id(a), Samples::Id(b)) => a[i] != b[i],
            _ => true,
        })
    };
    let same_shape = a.size == b.size && a.channels.len() == b.channels.len();
    (0..a.size[0] as usize * a.size[1] as usize).find(|&i| !same_shape || differ(i))
}

/// Part and triangle at a pixel, from the picture or the auxiliary one beside it.
fn ids(path: &Path, picture: &Picture, place: usize) -> String {
    let of = |picture: &Picture| {
        let id = |name: &str| {
            picture.channels.iter().find(|c| c.name == name).and_then(|c| match &c.samples {
                Samples::Id(ids) => ids.get(place).copied(),
                _ => None,
            })
        };
        Some(format!("part {} triangle {}", id("id.part")?, id("id.triangle")?))
    };
    of(picture)
        .or_else(|| of(&read_picture(&path.with_extension("aov.exr")).ok()?))
        .unwrap_or_else(|| "no ids".to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_pixel_is_named() {
        let [a, b] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let write = |folder: &Path, name: &str, pixels: &[u8]| {
            let head = format!("P6\n2 {} \n255\n", pixels.len() / 6);
            fs::write(folder.join(name), [head.as_bytes(), pixels].concat()).unwrap();
        };
        for folder in [a.path(), b.path()] {
            write(folder, "same.ppm", &[1; 6]);
            write(folder, "w_2.ppm", &[7; 12]);
        }
        assert_eq!(first_difference(a.path(), b.path()).unwrap(), None);
        write(b.path(), "w_2.ppm", &[7, 7, 7, 7, 7, 7, 7, 7, 8, 7, 7, 7]);
        let told = first_difference(a.path(), b.path()).unwrap().unwrap();
        assert_eq!(told, "w_2.ppm: pixel (0, 1) differs: no ids and no ids");
        write(a.path(), "extra.ppm", &[1; 6]);
        assert!(first_difference(a.path(), b.path()).unwrap().unwrap().starts_with("extra.ppm is only in"));
    }
}
