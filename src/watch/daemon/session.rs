//! The part of a growing sequence that was seen, and what of it was rendered.

use crate::clock::Stopwatch;
use crate::watch::follow::{Frames, Look, Stamp};
use crate::watch::{follow_run, inbox};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::ffi::{OsStr, OsString};
use std::io;
use std::path::Path;
use std::time::Duration;

/// A look parses for so long, or one file: meanwhile nothing else is done, and no heartbeat given.
const PARSES: Duration = Duration::from_millis(100);

/// A followed job.
#[derive(Debug, Default)]
pub(super) struct Session {
    frames: Frames,
    /// Files that were handed over, as they were then.
    handed: HashMap<OsString, Stamp>,
    /// Those that are whole and were not, each with how it stands.
    pub(super) ready: HashMap<OsString, Look>,
    /// Whether it can be followed; None: not looked into yet, or that could not be told.
    pub(super) fits: Option<bool>,
    /// The set of files of which that was asked last.
    pub(super) asked: Option<u128>,
    /// Frame files there.
    pub(super) all: u64,
    /// How long the last look parsed.
    pub(super) parsed: Duration,
    /// Whether it left files for the next one.
    pub(super) goes_on: bool,
    /// Pictures that were made, and those whose frames failed.
    made: HashSet<String>,
    failed: HashSet<String>,
}

impl Session {
    /// Looks at the files of a folder now, and parses those that may be whole, for a while.
    pub(super) fn look(
        &mut self,
        folder: &Path,
        done: bool,
        settle: Duration,
        now: Duration,
    ) -> io::Result<()> {
        self.look_for(PARSES, folder, done, settle, now)
    }

    fn look_for(
        &mut self,
        parses: Duration,
        folder: &Path,
        done: bool,
        settle: Duration,
        now: Duration,
    ) -> io::Result<()> {
        (self.parsed, self.goes_on) = (Duration::ZERO, false);
        let root = inbox::root(folder)?;
        let files = inbox::obj_files(&root)?;
        self.all = files.len() as u64;
        self.frames.see(&files, now);
        self.ready.clear();
        let mut order: Vec<(Key, &OsString)> = files.keys().map(|name| (key(name), name)).collect();
        order.sort();
        // where the camera and the light stand follows from the first frame
        let mut first_is_whole = false;
        for (at, (of, name)) in order.iter().enumerate() {
            let stamp = self.frames.stamp(name);
            let was_handed = self.handed.get(*name).copied() == stamp;
            let next = order.get(at + 1).is_some_and(|(after, _)| after.text == of.text);
            let ends_whole = || {
                if self.parsed > parses {
                    self.goes_on = true;
                    return None;
                }
                let watch = Stopwatch::start();
                let ends = follow_run::ends_whole(&root.join(name));
                self.parsed += watch.elapsed();
                Some(ends)
            };
            let stands = if was_handed {
                Look::Whole
            } else {
                self.frames.look(name, next, done, settle, now, ends_whole)
            };
            first_is_whole |= at == 0 && stands != Look::Grows;
            if !first_is_whole {
                break;
            }
            if stands != Look::Grows && !was_handed {
                self.ready.insert((*name).clone(), stands);
            }
        }
        Ok(())
    }

    /// A picture's frame ended, perhaps not for the first time: how many were made, and how many failed.
    pub(super) fn ended(&mut self, picture: &str, failed: bool) -> (u64, u64) {
        let (now, before) =
            if failed { (&mut self.failed, &mut self.made) } else { (&mut self.made, &mut self.failed) };
        before.remove(picture);
        now.insert(picture.to_owned());
        (self.made.len() as u64, self.failed.len() as u64)
    }

    /// Takes the files that are ready, and names those of them that are taken for whole although they do not end so.
    pub(super) fn hand_over(&mut self) -> (HashSet<OsString>, Vec<OsString>) {
        let ready = std::mem::take(&mut self.ready);
        let stamps: BTreeMap<_, _> =
            ready.keys().filter_map(|n| Some((n.clone(), self.frames.stamp(n)?))).collect();
        self.handed.extend(stamps);
        let torn = ready.iter().filter(|(_, stands)| **stands == Look::Rests);
        let torn = torn.map(|(name, _)| name.clone()).collect();
        (ready.into_keys().collect(), torn)
    }
}

/// The order of frames: by the text of their names, then by the numbers in them.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    text: String,
    numbers: Vec<u64>,
}

fn key(name: &OsStr) -> Key {
    let name = name.to_string_lossy();
    let digits = |c: char| c.is_ascii_digit();
    let numbers = name.split(|c| !digits(c)).filter(|run| !run.is_empty());
    Key {
        text: name.chars().filter(|c| !digits(*c)).collect(),
        // a run of more digits than a number has comes last
        numbers: numbers.map(|run| run.parse().unwrap_or(u64::MAX)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn frames_come_as_they_are_whole_each_once() {
        let t = tempfile::tempdir().unwrap();
        let settle = Duration::from_secs(2);
        let at = Duration::from_secs_f64;
        let put = |name: &str, text: &str| fs::write(t.path().join(name), text).unwrap();
        let mut s = Session::default();
        let look = |s: &mut Session, now: f64| {
            s.look(t.path(), false, settle, at(now)).unwrap();
            let mut ready: Vec<_> = s.hand_over().0.into_iter().map(|n| n.into_string().unwrap()).collect();
            ready.sort();
            ready
        };
        put("a_9.obj", "v 0 0 0\n");
        assert!(look(&mut s, 0.0).is_empty());
        put("a_10.obj", "v 0 0");
        // half the span, as the next frame is there
        assert_eq!(look(&mut s, 1.0), ["a_9.obj"]);
        assert!(look(&mut s, 3.0).is_empty(), "no newline");
        put("a_10.obj", "v 0 0 0\n");
        assert!(look(&mut s, 3.5).is_empty() && look(&mut s, 5.4).is_empty());
        assert_eq!(look(&mut s, 5.5), ["a_10.obj"]);
        assert!(look(&mut s, 99.0).is_empty(), "each once");
        put("a_10.obj", "v 0 0 0\nv 1 0 0\n");
        assert!(look(&mut s, 100.0).is_empty());
        assert_eq!(look(&mut s, 102.0), ["a_10.obj"], "another content");
        assert_eq!(s.all, 2);
    }

    #[test]
    fn a_look_ends_in_time_and_the_next_one_goes_on() {
        let t = tempfile::tempdir().unwrap();
        let mut s = Session::default();
        for n in 1..=3 {
            fs::write(t.path().join(format!("a_{n}.obj")), "v 0 0 0\n").unwrap();
        }
        // each file takes longer than the time that is given
        let mut ready = Vec::new();
        for now in [0, 2, 2, 2] {
            let now = Duration::from_secs(now);
            s.look_for(Duration::ZERO, t.path(), false, Duration::from_secs(2), now).unwrap();
            ready.push((s.ready.len(), s.goes_on));
        }
        assert_eq!(ready, [(0, false), (1, true), (2, true), (3, false)]);
    }

    #[test]
    fn only_what_is_handed_over_torn_is_said_to_be() {
        let t = tempfile::tempdir().unwrap();
        let mut s = Session::default();
        let put = |text: &str| fs::write(t.path().join("a_1.obj"), text).unwrap();
        let look = |s: &mut Session, now: u64| {
            s.look(t.path(), false, Duration::from_secs(2), Duration::from_secs(now)).unwrap();
            s.ready.len()
        };
        put("v 0 0");
        // it rests so long that it is taken as it stands, but goes on before it is handed over
        assert_eq!([look(&mut s, 0), look(&mut s, 2), look(&mut s, 10)], [0, 0, 1]);
        put("v 0 0 0\n");
        assert_eq!([look(&mut s, 11), look(&mut s, 13)], [0, 1]);
        assert_eq!(s.hand_over(), (HashSet::from(["a_1.obj".into()]), Vec::new()));
        let mut s = Session::default();
        put("v 0 0");
        assert_eq!([look(&mut s, 0), look(&mut s, 2), look(&mut s, 10)], [0, 0, 1]);
        assert_eq!(s.hand_over().1, ["a_1.obj"]);
    }

    #[test]
    fn nothing_begins_before_the_first_frame_is_whole() {
        let t = tempfile::tempdir().unwrap();
        let mut s = Session::default();
        fs::write(t.path().join("a_1.obj"), "v 0").unwrap();
        fs::write(t.path().join("a_2.obj"), "v 0 0 0\n").unwrap();
        let settle = Duration::from_secs(2);
        for now in [0, 2, 4] {
            s.look(t.path(), false, settle, Duration::from_secs(now)).unwrap();
            assert!(s.ready.is_empty());
        }
        s.look(t.path(), false, settle, Duration::from_secs(5)).unwrap();
        assert_eq!(s.ready.len(), 2, "after five times half the span");
    }
}
