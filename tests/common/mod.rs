//! What the tests through the binary share: running it, made sequences, pictures by their bytes.
#![allow(dead_code, unreachable_pub, reason = "each test file uses its own share")]

use rentix::math::DVec3;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

/// The binary with a store of its own beside the given folder, quiet on colours and progress.
pub fn rentix(store: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rentix"));
    command.env("RENTIX_CACHE", store.join("store")).env("NO_COLOR", "1").stdin(Stdio::null());
    command
}

/// What a run of the binary left behind.
pub struct Run {
    pub status: i32,
    pub stdout: String,
    pub stderr: String,
}

/// Runs the binary to its end.
pub fn run<I: IntoIterator<Item = S>, S: AsRef<OsStr>>(store: &Path, args: I) -> Run {
    let Output { status, stdout, stderr } = rentix(store).args(args).output().unwrap();
    let run = Run {
        status: status.code().unwrap_or(-1),
        stdout: String::from_utf8_lossy(&stdout).into_owned(),
        stderr: String::from_utf8_lossy(&stderr).into_owned(),
    };
    assert!(!run.stderr.contains("panicked at"), "{}", run.stderr);
    run
}

/// Renders an input to a folder with further options, wants the exit status, and gives what was said.
pub fn render(store: &Path, input: &Path, out: &str, more: &[&str], status: i32) -> Run {
    let mut args: Vec<&OsStr> = vec!["render".as_ref(), input.as_ref()];
    let out = store.join(out);
    args.extend(["-o".as_ref(), out.as_os_str()]);
    args.extend(more.iter().map(OsStr::new));
    let run = run(store, args);
    assert_eq!(run.status, status, "render {} {more:?}: {}", input.display(), run.stderr);
    run
}

/// Starts a render and does not wait for it.
pub fn start(store: &Path, input: &Path, out: &str, more: &[&str]) -> Child {
    let mut command = rentix(store);
    command.arg("render").arg(input).arg("-o").arg(store.join(out)).args(more);
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Where a ray meets a triangle's plane, in f64 (Möller and Trumbore 1997): the distance in units of its direction's
/// length, and the weights of the corners there, of which one is negative outside. NaN where it runs along the plane.
pub fn meets([a, b, c]: [DVec3; 3], origin: DVec3, direction: DVec3) -> (f64, [f64; 3]) {
    let (e, f) = (b - a, c - a);
    let det = direction.cross(f).dot(e);
    let u = direction.cross(f).dot(origin - a) / det;
    let v = (origin - a).cross(e).dot(direction) / det;
    let t = (origin - a).cross(e).dot(f) / det;
    (t, [1.0 - u - v, u, v])
}

/// The report as JSON.
pub fn report(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// Names and bytes of the pictures in a folder, hidden files left out.
pub fn pictures(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let Ok(entries) = std::fs::read_dir(folder) else { return BTreeMap::new() };
    entries
        .filter_map(|e| {
            let e = e.ok()?;
            let name = e.file_name().to_string_lossy().into_owned();
            let picture = e.file_type().ok()?.is_file() && !name.starts_with('.');
            picture.then(|| (name, std::fs::read(e.path()).unwrap()))
        })
        .collect()
}

/// Whether two folders hold the same pictures, byte for byte; there must be some.
pub fn assert_same(a: &BTreeMap<String, Vec<u8>>, b: &BTreeMap<String, Vec<u8>>, what: &str) {
    assert!(!a.is_empty(), "{what}: no picture at all");
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>(), "{what}: other pictures");
    for (name, bytes) in a {
        assert!(bytes == &b[name], "{what}: {name} differs");
    }
}

/// A made sequence: a breathing sphere of 2·rings·sectors triangles over a still floor, two materials, one OBJ a frame.
pub fn wave(folder: &Path, frames: u32, rings: u32, sectors: u32) -> PathBuf {
    std::fs::create_dir_all(folder).unwrap();
    let mtl = "newmtl Ball\nKd 0.8 0.3 0.2\nKs 0.4 0.4 0.4\nNs 60\nillum 2\nnewmtl Floor\nKd 0.5 0.5 0.55\nillum 1\n";
    std::fs::write(folder.join("wave.mtl"), mtl).unwrap();
    for frame in 1..=frames {
        std::fs::write(folder.join(format!("wave_{frame:04}.obj")), wave_obj(frame, rings, sectors)).unwrap();
    }
    folder.to_path_buf()
}

fn wave_obj(frame: u32, rings: u32, sectors: u32) -> String {
    let mut obj = String::from("mtllib wave.mtl\n");
    for i in 0..=rings {
        let theta = std::f64::consts::PI * (f64::from(i) + 0.5) / f64::from(rings + 1);
        for j in 0..sectors {
            let phi = std::f64::consts::TAU * f64::from(j) / f64::from(sectors);
            let r = 1.0 + 0.25 * (4.0 * theta + 0.3 * f64::from(frame)).sin() * (3.0 * phi).sin();
            let (x, y, z) = (r * theta.sin() * phi.cos(), r * theta.cos(), r * theta.sin() * phi.sin());
            writeln!(obj, "v {x:.6} {y:.6} {z:.6}").unwrap();
        }
    }
    obj += "v -3 -1.6 -3\nv 3 -1.6 -3\nv 3 -1.6 3\nv -3 -1.6 3\ng ball\nusemtl Ball\n";
    for i in 0..rings {
        for j in 0..sectors {
            let (a, b) = (i * sectors + j + 1, i * sectors + (j + 1) % sectors + 1);
            writeln!(obj, "f {a} {} {} {b}", a + sectors, b + sectors).unwrap();
        }
    }
    let n = (rings + 1) * sectors;
    writeln!(obj, "g floor\nusemtl Floor\nf {} {} {} {}", n + 1, n + 4, n + 3, n + 2).unwrap();
    obj
}
