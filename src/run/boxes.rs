//! The box of a sequence for its auto camera: files are scanned on all cores; what was scanned stays in the store.

use super::animation::Animations;
use super::read::read_options;
use super::source::file_bytes;
use crate::format::{self, FormatError, Gltf};
use crate::job::{FrameFile, Layer, Sequence, auto};
use crate::math::{Bounds, DVec3};
use crate::scene::{PartHash, PartHasher};
use crate::store::{Key, Store};
use crate::warning::Warnings;
use rayon::prelude::*;
use std::path::Path;
use std::sync::Arc;

/// Another name for each form in which boxes are kept, or in which they are found.
const STORED: &str = "boxes-2";
/// Below so many bytes files are scanned in less than a millisecond.
const LEAST_STORED_BYTES: u64 = 1 << 20;

/// Products of three lengths are numbers of 32 bits when a ray is tested against a triangle.
const WIDTHS: [f64; 2] = [1e-15, 2e12];

/// The box of a sequence's layers over the frames that are looked at. What cannot be read is left out and said.
pub(super) fn bounds(
    sequence: &Sequence,
    animations: &Animations,
    store: Option<&Store>,
    warnings: &mut Warnings,
) -> Bounds {
    // opening decodes textures on rayon's pool, which must not be done from within it
    let opened: Vec<_> = sequence.layers.iter().map(|l| animation(sequence, l, animations)).collect();
    let files: Vec<_> = sequence
        .layers
        .iter()
        .zip(&opened)
        .flat_map(|(l, a)| auto::scanned(l).map(move |i| (l, a, &l.files[i])))
        .collect();
    let scan = || files.par_iter().map(|(_, a, file)| file_bounds(file, a.as_ref())).collect::<Vec<_>>();
    let paths: Vec<&Path> = files.iter().map(|(_, _, file)| &*file.path).collect();
    let are_objs = files.iter().all(|(_, _, file)| file.moment.is_none());
    let boxes = match store.filter(|_| are_objs) {
        Some(store) => through(store, &paths, scan),
        None => scan(),
    };
    let mut all = Bounds::EMPTY;
    for ((layer, ..), bounds) in files.iter().zip(boxes) {
        match bounds {
            Ok(b) => all.merge(&auto::placed(layer, &b)),
            Err(error) => {
                // it names the file, and the line where there is one
                warnings.add(None, None, format!("{error}; it is left out of the auto camera's box"));
            }
        }
    }
    let width = (all.max - all.min).max_element();
    if width > WIDTHS[1] || width > 0.0 && width < WIDTHS[0] {
        let text = format!(
            "{} is {width:.1e} wide; rays meet what is {:.0e} to {:.0e} wide: scale it (transform of a layer in a job file)",
            sequence.name, WIDTHS[0], WIDTHS[1]
        );
        warnings.add(None, None, text);
    }
    all
}

/// The boxes of files from the store, by the content of all of them; else by a scan, which is kept where nothing is wrong.
fn through<E>(
    store: &Store,
    paths: &[&Path],
    scan: impl FnOnce() -> Vec<Result<Bounds, E>>,
) -> Vec<Result<Bounds, E>> {
    let bytes: u64 = paths.iter().map(|path| file_bytes(path)).sum();
    let digests = (bytes >= LEAST_STORED_BYTES)
        .then(|| paths.par_iter().map(|path| format::digest(path).ok()).collect::<Option<Vec<PartHash>>>());
    let Some(digests) = digests.flatten() else { return scan() };
    let mut h = PartHasher::new(STORED);
    h.bytes(env!("CARGO_PKG_VERSION").as_bytes());
    for digest in digests {
        h.part(digest);
    }
    let key = Key(h.finish().0);
    let stored = store.get(STORED, key, |payload| {
        let corners: Vec<[[f64; 3]; 2]> = payload.values(paths.len())?;
        (payload.left() == 0).then_some(corners)
    });
    if let Some(corners) = stored.filter(|c| !c.as_flattened().as_flattened().iter().any(|x| x.is_nan())) {
        let bounds = |[min, max]: [[f64; 3]; 2]| Bounds { min: DVec3::from(min), max: DVec3::from(max) };
        return corners.into_iter().map(|corners| Ok(bounds(corners))).collect();
    }
    let boxes = scan();
    let corners: Option<Vec<_>> =
        boxes.iter().map(|b| b.as_ref().ok().map(|b| [b.min.to_array(), b.max.to_array()])).collect();
    if let Some(corners) = corners {
        store.put(STORED, key, &[bytemuck::cast_slice(&corners)]);
    }
    boxes
}

/// The glTF file of a layer, where it is one and can be opened.
fn animation(sequence: &Sequence, layer: &Layer, animations: &Animations) -> Option<Arc<Gltf>> {
    let file = layer.files.first().filter(|file| file.moment.is_some())?;
    let read = read_options(&sequence.first, layer.materials.as_deref(), false);
    animations.open(&file.path, &read, false).ok().map(|(gltf, _)| gltf)
}

fn file_bounds(file: &FrameFile, animation: Option<&Arc<Gltf>>) -> Result<Bounds, FormatError> {
    match (&file.moment, animation) {
        (None, _) => format::scan_bounds(&file.path),
        (Some(moment), Some(gltf)) => gltf.bounds(moment.time_s, &moment.clip),
        // why it cannot be opened is told when its frames fail
        (Some(_), None) => Ok(Bounds::EMPTY),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_found_by_content() {
        let t = tempfile::tempdir().unwrap();
        let store = Store::new(&t.path().join("store"), 1 << 20);
        let [a, b] = ["a.obj", "b.obj"].map(|name| t.path().join(name));
        let text = |first: &str| format!("v {first} 0 0\n{}", "# filled up\n".repeat(60_000));
        std::fs::write(&a, text("1")).unwrap();
        std::fs::write(&b, text("2")).unwrap();
        let box_of = |x: f64| Bounds { min: DVec3::new(x, 0.0, 0.0), max: DVec3::new(x, 0.0, 0.0) };
        let ask = |paths: &[&Path], scanned: Result<[Bounds; 2], ()>| {
            let mut scans = 0;
            let boxes = through(&store, paths, || {
                scans += 1;
                scanned.map_or_else(|()| vec![Ok(box_of(1.0)), Err(())], |boxes| boxes.map(Ok).to_vec())
            });
            (boxes, scans)
        };
        let found = [box_of(1.0), Bounds::EMPTY];
        // what is wrong is told each time
        for _ in 0..2 {
            assert_eq!(ask(&[&a, &b], Err(())), (vec![Ok(box_of(1.0)), Err(())], 1));
        }
        assert_eq!(ask(&[&a, &b], Ok(found)), (found.map(Ok).to_vec(), 1));
        assert_eq!(ask(&[&a, &b], Err(())), (found.map(Ok).to_vec(), 0));
        // another order and another content are something else
        assert_eq!(ask(&[&b, &a], Ok(found)).1, 1);
        std::fs::write(&b, text("3")).unwrap();
        assert_eq!(ask(&[&a, &b], Ok(found)).1, 1);
        // one that is not there, few bytes: as without a store
        assert_eq!(ask(&[&a, &t.path().join("none.obj")], Ok(found)).1, 1);
        std::fs::write(&a, "v 1 0 0\n").unwrap();
        std::fs::write(&b, "v 1 0 0\n").unwrap();
        for _ in 0..2 {
            assert_eq!(ask(&[&a, &b], Ok(found)).1, 1);
        }
    }
}
