//! Mitsuba 3 as a peer for moving meshes, by a script that prints one JSON object a line.

use serde::Deserialize;
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// The script and the variant of Mitsuba that it runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mitsuba {
    /// Where the script is.
    pub script: PathBuf,
    /// `cuda_ad_rgb`, `llvm_ad_rgb` or `scalar_rgb`.
    pub variant: String,
}

/// Frames a second of pictures of a size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rate {
    pub(super) size: [u32; 2],
    pub(super) samples: u32,
    pub(super) frames_per_s: f64,
}

#[derive(Deserialize)]
struct Line {
    what: String,
    size: Option<String>,
    spp: Option<u32>,
    fps: Option<f64>,
}

impl Mitsuba {
    /// Runs the script with positions from the host; nothing where it cannot be run.
    pub(super) fn rates(&self) -> Vec<Rate> {
        let output = Command::new("python3")
            .arg(&self.script)
            .args([&self.variant, "--from", "host", "--frames", "48"])
            .stdin(Stdio::null())
            .stderr(Stdio::null())
            .output();
        output.map(|o| parse(&String::from_utf8_lossy(&o.stdout))).unwrap_or_default()
    }
}

fn parse(text: &str) -> Vec<Rate> {
    let rate = |line: &str| {
        let line: Line = serde_json::from_str(line).ok()?;
        let (width, height) = line
            .size
            .filter(|_| line.what == "anim")?
            .split_once('x')
            .map(|(w, h)| (w.parse(), h.parse()))?;
        Some(Rate { size: [width.ok()?, height.ok()?], samples: line.spp?, frames_per_s: line.fps? })
    };
    text.lines().filter_map(rate).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_lines_are_understood() {
        let text = "{\"what\": \"start\", \"import_s\": 1.0}\nnoise\n{\"what\": \"anim\", \"size\": \"1280x720\", \"spp\": 16, \"fps\": 117.5}\n";
        assert_eq!(parse(text), [Rate { size: [1280, 720], samples: 16, frames_per_s: 117.5 }]);
    }
}
