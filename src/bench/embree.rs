//! Embree as a peer, by the program of `benches/peers/embree_bench.cpp`: one JSON object a line.

use super::times::Spread;
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// What the program said of a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Embree {
    /// Its version.
    pub(super) version: String,
    /// Refitting with one thread, ms.
    pub(super) refit_one_thread_ms: Option<f64>,
    /// Refitting with all threads, ms.
    pub(super) refit_ms: Option<f64>,
    /// Camera rays and a shadow ray for each hit, one by one, all threads, ms.
    pub(super) single_ms: Option<f64>,
    /// The same, coherent ones sixteen at a time, ms.
    pub(super) packet_ms: Option<f64>,
    /// How many camera rays hit.
    pub(super) hits: Option<f64>,
}

impl Embree {
    /// The median of each figure in several runs; None without any.
    pub(super) fn medians(runs: &[Self]) -> Option<Self> {
        let of = |figure: fn(&Self) -> Option<f64>| {
            Spread::of(runs.iter().filter_map(figure).collect()).map(|spread| spread.median)
        };
        Some(Self {
            version: runs.first()?.version.clone(),
            refit_one_thread_ms: of(|e| e.refit_one_thread_ms),
            refit_ms: of(|e| e.refit_ms),
            single_ms: of(|e| e.single_ms),
            packet_ms: of(|e| e.packet_ms),
            hits: of(|e| e.hits),
        })
    }
}

/// The program, and what it is run on.
pub(super) struct Program {
    /// Where it is.
    pub(super) path: PathBuf,
    /// The mesh.
    pub(super) obj: PathBuf,
    /// Options of a camera; the program's own where there are none.
    pub(super) camera: Vec<String>,
}

impl Program {
    /// Runs it. None where it cannot be run or says nothing that is understood.
    pub(super) fn run(&self, threads: usize) -> Option<Embree> {
        let output = Command::new(&self.path)
            .arg(&self.obj)
            .args(&self.camera)
            .args(["--brief", "--threads", &threads.to_string()])
            .stdin(Stdio::null())
            .stderr(Stdio::null())
            .output()
            .ok()?;
        read(&String::from_utf8_lossy(&output.stdout), threads)
    }
}

fn read(text: &str, threads: usize) -> Option<Embree> {
    let mut all = Embree::default();
    for line in text.lines() {
        let Ok(line) = serde_json::from_str::<serde_json::Value>(line) else { continue };
        let word = |name: &str| line[name].as_str().unwrap_or_default();
        let with = |n: usize| line["threads"].as_u64() == Some(n as u64);
        let value = line["value"].as_f64();
        match (word("what"), word("variant"), word("packet")) {
            ("refit", "dynamic", _) => {
                if with(1) {
                    all.refit_one_thread_ms = value;
                }
                if with(threads) {
                    all.refit_ms = value;
                }
            }
            ("primary+shadow frame", "medium", "1") if with(threads) => {
                all.single_ms = value;
                all.hits = line["hits"].as_f64();
            }
            ("primary+shadow frame", "medium", "16 coherent") if with(threads) => all.packet_ms = value,
            _ => continue,
        }
        all.version = word("version").to_string();
    }
    (!all.version.is_empty()).then_some(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_understood() {
        let text = r#"{"version":"4.4.0","what":"refit","variant":"dynamic","threads":1,"value":2.0}
{"version":"4.4.0","what":"refit","variant":"dynamic","threads":2,"value":1.5}
not json
{"version":"4.4.0","what":"primary+shadow frame","variant":"medium","threads":2,"value":30,"packet":"1","hits":12}"#;
        let expected = Embree {
            version: "4.4.0".to_string(),
            refit_one_thread_ms: Some(2.0),
            refit_ms: Some(1.5),
            single_ms: Some(30.0),
            packet_ms: None,
            hits: Some(12.0),
        };
        assert_eq!(read(text, 2), Some(expected));
        assert_eq!(read("", 2), None);
    }

    #[test]
    fn each_figure_has_its_own_median() {
        let run = |refit_ms, hits| Embree { refit_ms: Some(refit_ms), hits, ..Embree::default() };
        let runs = [run(3.0, Some(12.0)), run(1.0, None), run(2.0, Some(12.0))];
        assert_eq!(Embree::medians(&runs), Some(run(2.0, Some(12.0))));
        assert_eq!(Embree::medians(&[]), None);
    }
}
