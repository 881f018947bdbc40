//! What a frame on its way takes of the host's memory.

use super::source::file_bytes;
use crate::job::{Job, Picture, Settings};
use crate::plan::TREE_BYTES_PER_TRIANGLE;
use crate::scene::{Aov, Frame};
use std::collections::BTreeMap;

/// Bytes that reading a frame and building its trees takes for each byte of its OBJ files, about: 4 to 11 were
/// measured on real scenes.
const BYTES_PER_TEXT_BYTE: u64 = 12;
/// Bytes that building a tree takes for each triangle until it is built.
const BUILD_BYTES_PER_TRIANGLE: u64 = 250;

/// What a picture will take before its files are read: their sizes, and its film.
pub(super) fn expected_bytes(job: &Job, picture: &Picture) -> u64 {
    text_bytes(job, picture).saturating_mul(BYTES_PER_TEXT_BYTE) + film_bytes(&picture.settings)
}

/// Bytes of a picture's film.
fn film_bytes(settings: &Settings) -> u64 {
    let floats = 3
        + u64::from(settings.alpha)
        + Aov::ALL.iter().filter(|aov| settings.aovs.contains(**aov)).map(|aov| aov.channels()).sum::<u64>();
    let [width, height] = settings.size.map(u64::from);
    4 * floats * width * height
}

/// Bytes of the files of a picture.
pub(super) fn text_bytes(job: &Job, picture: &Picture) -> u64 {
    let layers = &job.sequences[picture.sequence].layers;
    let files = picture.sources.iter().filter_map(|s| Some(&layers[s.layer].files[s.file?].path));
    files.map(|path| file_bytes(path)).sum()
}

/// What a frame that was read takes until it is traced.
pub(super) fn needed_bytes(frame: &Frame) -> u64 {
    let largest = frame.objects.iter().map(|o| o.geometry.triangles.0.len()).max().unwrap_or(0);
    part_bytes(frame) + largest as u64 * BUILD_BYTES_PER_TRIANGLE
}

/// Bytes of its parts, each once.
pub(super) fn part_bytes(frame: &Frame) -> u64 {
    let parts: BTreeMap<_, _> = frame.objects.iter().flat_map(|o| o.geometry.parts()).collect();
    parts.values().sum()
}

/// What a run takes of which this is the first frame, so many of them on their way at once: each its text, its geometry
/// unless one file shows all, and its film; their textures and one build once, and trees where the host has them.
pub(super) fn reckoned_bytes(
    job: &Job,
    picture: &Picture,
    frame: &Frame,
    on_their_way: u64,
    trees: u64,
) -> u64 {
    let once = needed_bytes(frame);
    let own = part_bytes(frame).saturating_sub(frame.texture_bytes());
    let moves = job.sequences[picture.sequence].layers.iter().any(|layer| layer.files.len() > 1);
    let others = if moves { on_their_way.saturating_sub(1) } else { 0 };
    let text = text_bytes(job, picture);
    once + others * (own + text)
        + on_their_way * film_bytes(&picture.settings)
        + trees * TREE_BYTES_PER_TRIANGLE * frame.triangles()
}

/// Why a frame is not even tried.
pub(super) fn refusal(needed_bytes: u64, budget_bytes: u64) -> String {
    format!(
        "needs about {needed_bytes} bytes of memory, {budget_bytes} are allowed; the frame is not rendered (raise --memory)"
    )
}
