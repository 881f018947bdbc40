//! A sequence that is rendered while it is written (CONTRACT 8, `--follow`): every complete frame gets its picture once, that
//! which `render` gives for the finished sequence, and no torn frame is read, however the writer writes.
//!
//! Each frame is a row of triangles between whose lines it may be cut: whatever comes before is an OBJ of its own with fewer
//! triangles, so that a torn read shows in a frame's event and in its picture. Writers keep pace with the daemon's scans, which
//! its page tells of, not with a clock.

mod common;
#[path = "common/watched.rs"]
mod watched;
use common::{assert_same, pictures, render};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::sync::mpsc::{Receiver, channel};
use watched::{PATIENCE, until};

const VIEW: [&str; 6] = ["--size", "64x36", "--eye", "0,0,8", "--look-at", "0,0,0"];
/// Triangles of a frame.
const TRIANGLES: usize = 24;

/// A daemon that follows, and what it told.
struct Daemon {
    t: tempfile::TempDir,
    child: Child,
    lines: Receiver<String>,
    told: Vec<Value>,
    page: String,
}

impl Daemon {
    fn start(settle: &str) -> Self {
        let t = tempfile::tempdir().unwrap();
        fs::create_dir(t.path().join("inbox")).unwrap();
        let mut command = common::rentix(t.path());
        command.arg("watch").arg(t.path().join("inbox")).arg("-o").arg(t.path().join("done")).args(VIEW);
        command.args([
            "--settle",
            settle,
            "--follow",
            "--device",
            "cpu",
            "--json",
            "--listen",
            "127.0.0.1:0",
        ]);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let (send, lines) = channel();
        let out = BufReader::new(child.stdout.take().unwrap());
        std::thread::spawn(move || out.lines().map_while(Result::ok).try_for_each(|line| send.send(line)));
        let mut daemon = Self { t, child, lines, told: Vec::new(), page: String::new() };
        daemon.until("ready", |told| told.iter().any(|e| e["event"] == "ready"));
        let page = daemon.told[0]["page"].as_str().unwrap();
        daemon.page = page.trim_start_matches("http://").trim_end_matches('/').to_owned();
        daemon
    }

    fn path(&self, name: &str) -> PathBuf {
        self.t.path().join(name)
    }

    /// A new folder in the inbox.
    fn folder(&self) -> PathBuf {
        let folder = self.path("inbox/sim");
        fs::create_dir(&folder).unwrap();
        folder
    }

    /// Waits for what it tells.
    fn until(&mut self, what: &str, is_so: impl Fn(&[Value]) -> bool) {
        while !is_so(&self.told) {
            match self.lines.recv_timeout(PATIENCE) {
                Ok(line) => self.told.push(serde_json::from_str(&line).unwrap()),
                Err(error) => panic!("{what}: {error}; told: {:#?}", self.told),
            }
        }
    }

    /// Waits until the job has come to a state.
    fn until_state(&mut self, state: &str) {
        self.until(state, |told| told.iter().any(|e| e["event"] == "state" && e["state"] == state));
    }

    /// Waits until it has rendered so many frames.
    fn until_rendered(&mut self, frames: usize) {
        self.until(&format!("{frames} frames"), |told| rendered(told).count() >= frames);
    }

    /// When its last scan ended, s since its start.
    fn scanned(&self) -> f64 {
        let mut stream = TcpStream::connect(&self.page).unwrap();
        write!(stream, "GET /metrics HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        let up = answer.lines().find_map(|line| line.strip_prefix("rentix_up_seconds "));
        up.unwrap().parse().unwrap()
    }

    /// Waits until it has scanned once more.
    fn scan(&self) {
        let before = self.scanned();
        until("a scan", || self.scanned() > before);
    }

    fn status(&self) -> Value {
        serde_json::from_slice(&fs::read(self.path("done/sim/status.json")).unwrap()).unwrap()
    }

    /// Ends the sequence; the frames are those that `render` makes of it, each made once of all its triangles.
    fn all_is_right(&mut self, frames: usize) {
        fs::write(self.path("inbox/sim/.done"), "").unwrap();
        self.until_state("finished");
        self.each_was_rendered_once(frames);
        // by the run of the whole: no frame was gone through for nothing before
        let again = self.told.iter().filter(|e| e["event"] == "frame" && e["status"] == "resumed");
        assert!(again.count() <= frames);
        assert_eq!(self.status()["frames"], serde_json::json!({"done": frames, "failed": 0, "all": frames}));
        render(self.t.path(), &self.path("inbox/sim"), "want", &VIEW, 0);
        let mut made = pictures(&self.path("done/sim"));
        made.remove("status.json");
        assert_same(&pictures(&self.path("want")), &made, "followed");
    }

    fn each_was_rendered_once(&self, frames: usize) {
        let mut times = BTreeMap::new();
        for event in rendered(&self.told) {
            assert_eq!(event["triangles"], TRIANGLES, "a torn frame was read: {event}");
            *times.entry(event["frame"].as_u64().unwrap()).or_insert(0) += 1;
        }
        let each_once: BTreeMap<u64, usize> = (1..=frames as u64).map(|frame| (frame, 1)).collect();
        assert_eq!(times, each_once, "how often each frame was rendered");
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The frames whose pictures were made.
fn rendered(told: &[Value]) -> impl Iterator<Item = &Value> {
    told.iter().filter(|e| e["event"] == "frame" && (e["status"] == "rendered" || e["status"] == "copied"))
}

fn name(frame: usize) -> String {
    format!("sim_{frame:04}.obj")
}

/// A frame's text in pieces, after each of which it is an OBJ.
fn pieces(frame: usize) -> Vec<String> {
    let triangle = |i: usize| {
        let mut text = String::new();
        let (x, y) = ((i % 6) as f64 - 2.5, (i / 6) as f64 - 1.5);
        let size = 0.3 + 0.05 * frame as f64;
        writeln!(text, "v {x} {y} 0\nv {} {y} 0\nv {x} {} 0\nf -3 -2 -1", x + size, y + size).unwrap();
        text
    };
    (0..TRIANGLES).map(triangle).collect()
}

fn text(frame: usize) -> String {
    pieces(frame).concat()
}

/// Writes a frame's pieces, so many together, with a scan after each, and gives the file.
fn write_slowly(daemon: &Daemon, path: &Path, frame: usize, together: usize) -> File {
    let mut file = File::create(path).unwrap();
    for pieces in pieces(frame).chunks(together) {
        // also within a line: what is there then is a whole file but for its last line's end
        let text = pieces.concat();
        for part in [&text[..text.len() - 1], &text[text.len() - 1..]] {
            file.write_all(part.as_bytes()).unwrap();
            file.flush().unwrap();
            daemon.scan();
        }
    }
    file
}

#[test]
fn a_writer_that_writes_slowly() {
    let mut daemon = Daemon::start("1");
    let folder = daemon.folder();
    for frame in 1..=3 {
        write_slowly(&daemon, &folder.join(name(frame)), frame, 2);
    }
    // the one before the last does not wait for the end
    daemon.until_rendered(2);
    daemon.all_is_right(3);
}

#[test]
fn a_writer_that_writes_many_frames_at_once() {
    let mut daemon = Daemon::start("1");
    let folder = daemon.folder();
    for burst in [1..=20, 21..=40, 41..=60] {
        let last = *burst.end();
        let mut files: Vec<(File, String)> =
            burst.map(|frame| (File::create(folder.join(name(frame))).unwrap(), text(frame))).collect();
        for (file, text) in &mut files {
            file.write_all(&text.as_bytes()[..text.len() / TRIANGLES * 6]).unwrap();
        }
        daemon.scan();
        for (file, text) in &mut files {
            file.write_all(&text.as_bytes()[text.len() / TRIANGLES * 6..]).unwrap();
        }
        daemon.until_rendered(last);
    }
    daemon.all_is_right(60);
}

#[test]
fn a_writer_that_renames_what_is_whole() {
    let mut daemon = Daemon::start("0.3");
    let folder = daemon.folder();
    let temporary = |frame: usize| match frame % 3 {
        0 => format!("{}.tmp", name(frame)),
        1 => format!(".{}", name(frame)),
        _ => format!("{}.part", name(frame)),
    };
    for frame in 1..=6 {
        let path = folder.join(temporary(frame));
        let mut file = File::create(&path).unwrap();
        let whole = text(frame);
        let (one, two) = whole.split_at(whole.len() / 2);
        file.write_all(one.as_bytes()).unwrap();
        // it rests under that name until the frames before it are there
        daemon.until_rendered(frame - 1);
        file.write_all(two.as_bytes()).unwrap();
        drop(file);
        fs::rename(path, folder.join(name(frame))).unwrap();
    }
    daemon.until_rendered(6);
    daemon.all_is_right(6);
}

#[test]
fn a_writer_that_writes_frames_anew_in_place() {
    let mut daemon = Daemon::start("1");
    let folder = daemon.folder();
    for frame in 1..=3 {
        let path = folder.join(name(frame));
        // whole, but another picture, and then nothing, before it is itself
        fs::write(&path, text(frame + 10)).unwrap();
        daemon.scan();
        File::create(&path).unwrap();
        daemon.scan();
        write_slowly(&daemon, &path, frame, 6);
    }
    daemon.until_rendered(3);
    daemon.all_is_right(3);
}

#[test]
fn a_frame_that_changes_after_its_picture_was_made_has_another() {
    let mut daemon = Daemon::start("0.3");
    let folder = daemon.folder();
    for frame in [1, 2] {
        fs::write(folder.join(name(frame)), text(frame + 10)).unwrap();
    }
    daemon.until_rendered(2);
    fs::write(folder.join(name(2)), text(2)).unwrap();
    daemon.until_rendered(3);
    assert_eq!(daemon.status()["frames"]["all"], 2);
    fs::write(folder.join(name(1)), text(1)).unwrap();
    daemon.until_rendered(4);
    daemon.told.retain(|e| e["event"] != "frame");
    fs::write(folder.join(".done"), "").unwrap();
    daemon.until_state("finished");
    assert_eq!(rendered(&daemon.told).count(), 0, "all was there");
    render(daemon.t.path(), &folder, "want", &VIEW, 0);
    let mut made = pictures(&daemon.path("done/sim"));
    made.remove("status.json");
    assert_same(&pictures(&daemon.path("want")), &made, "changed");
}

/// A daemon, three frames that it rendered, and a fourth that is cut there; nobody ends it.
fn a_writer_dies(cut: impl Fn(&str) -> usize, state: &str) -> Daemon {
    let mut daemon = Daemon::start("0.2");
    let folder = daemon.folder();
    for frame in 1..=3 {
        fs::write(folder.join(name(frame)), text(frame)).unwrap();
        daemon.until_rendered(frame);
    }
    let torn = text(4);
    fs::write(folder.join(name(4)), &torn[..cut(&torn)]).unwrap();
    daemon.until_state(state);
    let noted =
        daemon.told.iter().find(|e| e["event"] == "note" && e["text"].as_str().unwrap().contains("torn"));
    assert!(noted.unwrap()["text"].as_str().unwrap().contains(&name(4)), "{noted:?}");
    daemon
}

#[test]
fn what_cannot_be_followed_waits_no_longer_than_without() {
    // a span that it would have to rest thirty times
    let mut daemon = Daemon::start("5");
    let gltf = serde_json::json!({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{}]});
    fs::write(daemon.folder().join("still.gltf"), gltf.to_string()).unwrap();
    daemon.until_state("finished");
}

#[test]
fn a_writer_that_dies_within_a_line_that_needs_its_end() {
    let daemon = a_writer_dies(|text| text.rfind('-').unwrap() + 1, "failed");
    daemon.each_was_rendered_once(3);
    let status = daemon.status();
    assert_eq!(status["frames"], serde_json::json!({"done": 3, "failed": 1, "all": 4}));
    let error = status["error"].as_str().unwrap();
    assert!(error.contains(&name(4)) && !error.contains(&name(3)), "{error}");
    let mut made = pictures(&daemon.path("done/sim"));
    made.remove("status.json");
    let folder = daemon.path("inbox/sim");
    fs::remove_file(folder.join(name(4))).unwrap();
    render(daemon.t.path(), &folder, "want", &VIEW, 0);
    assert_same(&pictures(&daemon.path("want")), &made, "the complete ones");
}

#[test]
fn a_writer_that_dies_where_what_is_there_can_be_read() {
    let mut daemon = a_writer_dies(|text| text.rfind("v ").unwrap() + 3, "finished");
    // what is torn was told of; the others are what they are
    daemon.told.retain(|e| e["frame"] != 4);
    daemon.each_was_rendered_once(3);
    let mut made = pictures(&daemon.path("done/sim"));
    made.remove("status.json");
    render(daemon.t.path(), &daemon.path("inbox/sim"), "want", &VIEW, 0);
    assert_same(&pictures(&daemon.path("want")), &made, "as it stands");
}
