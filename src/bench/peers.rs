//! Other programs that are installed here.

use serde::Serialize;
use std::path::Path;
use std::process::Command;

/// A program and its version, None where it is absent.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Peer {
    /// Its name.
    pub(super) name: &'static str,
    /// What it is compared by.
    pub(super) role: &'static str,
    /// Its version; of Embree the program that was made of it, which tells its version with its figures.
    pub(super) version: Option<String>,
}

/// Peers that are packages of Python, with their names there.
const PACKAGES: [(&str, &str, &str); 4] = [
    ("Mitsuba", "mitsuba", "accuracy; moving meshes"),
    ("Blender", "bpy", "whole jobs, path traced by Cycles"),
    ("F3D", "f3d", "whole jobs, rasterised"),
    ("VTK", "vtk", "whole jobs, rasterised"),
];

/// All of them.
pub(super) fn installed(embree: Option<&Path>) -> Vec<Peer> {
    let embree = embree.filter(|path| path.is_file()).map(|path| path.display().to_string());
    let mut peers = vec![Peer { name: "Embree", role: "trees and rays of a CPU", version: embree }];
    let script = "import importlib.metadata as m, sys\nfor n in sys.argv[1:]:\n try: print(m.version(n))\n except Exception: print()";
    let names = PACKAGES.map(|(_, package, _)| package);
    let told = Command::new("python3").arg("-c").arg(script).args(names).output();
    let told = told.map(|output| String::from_utf8_lossy(&output.stdout).into_owned()).unwrap_or_default();
    let mut versions = told.lines();
    for (name, _, role) in PACKAGES {
        let version = versions.next().filter(|v| !v.is_empty()).map(ToString::to_string);
        peers.push(Peer { name, role, version });
    }
    peers
}
