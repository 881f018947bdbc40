//! A glTF file as a sequence: one frame for each step of its clips (CONTRACT 2).

use super::discover::{Files, FrameFile, Taking, input_name};
use super::{JobError, MAX_FRAMES};
use crate::format::{self, ClipChoice};
use crate::warning::Warnings;
use std::path::Path;

/// Frames a second where none are given.
pub(super) const FPS: f64 = 24.0;

/// What of a glTF file a frame shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    /// The time, seconds.
    pub time_s: f64,
    /// The clips that play.
    pub clip: ClipChoice,
}

/// The frames of a glTF file: frame k shows time k/fps, from 0 to the last that is not behind the last key.
pub(super) fn frames(path: &Path, taking: Taking<'_>, warnings: &mut Warnings) -> Result<Files, JobError> {
    let clips = format::gltf_clips(path, taking.clip).map_err(JobError::BadGltf)?;
    if let Some(text) = clips.left_out {
        warnings.add(Some(path), None, text);
    }
    let last = last_frame(clips.duration_s, taking.fps);
    if last >= MAX_FRAMES {
        let text = format!("{}: has more than {MAX_FRAMES} frames; give less --fps", path.display());
        return Err(JobError::Options(text));
    }
    let stem = input_name(path);
    let frame = |number: u64| FrameFile {
        number: Some(number as i64),
        path: path.to_path_buf(),
        stem: stem.clone(),
        moment: Some(Moment { time_s: number as f64 / taking.fps, clip: taking.clip.clone() }),
    };
    Ok(Files { files: (0..=last).map(frame).collect(), name: stem.clone() })
}

/// floor(duration · fps). Times of keys are f32: one that is a frame's but for its rounding counts as that.
fn last_frame(duration_s: f64, fps: f64) -> u64 {
    (duration_s * fps * (1.0 + f64::from(f32::EPSILON))).floor() as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_frame() {
        // 50/24 as f32 is 2.08333325…, less than 50/24
        assert_eq!(last_frame(f64::from(50.0f32 / 24.0), 24.0), 50);
        assert_eq!([last_frame(0.0, 24.0), last_frame(2.0, 24.0), last_frame(3.99, 0.5)], [0, 48, 1]);
    }
}
