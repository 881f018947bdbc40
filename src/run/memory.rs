//! What a frame on its way takes of the host's memory.

use super::source::file_bytes;
use crate::job::{Job, Picture};
use crate::scene::{Aov, Frame};

/// Bytes that reading a frame and building its trees takes for each byte of its OBJ files, about: 4 to 11 were
/// measured on real scenes.
const BYTES_PER_TEXT_BYTE: u64 = 12;
/// Bytes that building a tree takes for each triangle until it is built.
const BUILD_BYTES_PER_TRIANGLE: u64 = 250;

/// What a picture will take before its files are read: their sizes, and its film.
pub(super) fn expected_bytes(job: &Job, picture: &Picture) -> u64 {
    let layers = &job.sequences[picture.sequence].layers;
    let files = picture.sources.iter().filter_map(|s| Some(&layers[s.layer].files[s.file?].path));
    let text: u64 = files.map(|path| file_bytes(path)).sum();
    let settings = &picture.settings;
    let floats = 3
        + u64::from(settings.alpha)
        + Aov::ALL.iter().filter(|aov| settings.aovs.contains(**aov)).map(|aov| aov.channels()).sum::<u64>();
    let [width, height] = settings.size.map(u64::from);
    text.saturating_mul(BYTES_PER_TEXT_BYTE) + 4 * floats * width * height
}

/// What a frame that was read takes until it is traced.
pub(super) fn needed_bytes(frame: &Frame) -> u64 {
    let mut parts: Vec<_> = frame.objects.iter().flat_map(|o| o.geometry.parts()).collect();
    parts.sort_unstable();
    parts.dedup();
    let largest = frame.objects.iter().map(|o| o.geometry.triangles.0.len()).max().unwrap_or(0);
    parts.iter().map(|(_, bytes)| bytes).sum::<u64>() + largest as u64 * BUILD_BYTES_PER_TRIANGLE
}

/// Why a frame is not even tried.
pub(super) fn refusal(needed_bytes: u64, budget_bytes: u64) -> String {
    format!(
        "needs about {needed_bytes} bytes of memory, {budget_bytes} are allowed; the frame is not rendered (raise --memory)"
    )
}
