//! Which frames of a sequence that is still growing are whole: pure, over what scans saw and when (CONTRACT 8).

use crate::clock::FileTime;
use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::time::Duration;

/// A file without a final newline, or one that does not parse to its end, rests so many times longer.
pub(super) const LONGER: u32 = 5;

/// A file's size and time of change.
pub(super) type Stamp = (u64, Option<FileTime>);

/// What is known of one frame's file.
#[derive(Clone, Copy, Debug)]
struct Growing {
    stamp: Stamp,
    since: Duration,
    /// Whether it ends as a whole file does; None: not looked at since it changed.
    ends_whole: Option<bool>,
}

/// How a file stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Look {
    /// It may still grow.
    Grows,
    /// It is whole.
    Whole,
    /// It does not end as a whole file does, and has rested so long that nobody seems to go on with it.
    Rests,
}

/// The files of a growing sequence.
#[derive(Clone, Debug, Default)]
pub(super) struct Frames {
    files: BTreeMap<OsString, Growing>,
}

impl Frames {
    /// Takes what is seen of all files now; those that are gone are forgotten.
    pub(super) fn see(&mut self, files: &BTreeMap<OsString, Stamp>, now: Duration) {
        self.files.retain(|name, _| files.contains_key(name));
        for (name, &stamp) in files {
            let fresh = Growing { stamp, since: now, ends_whole: None };
            let known = self.files.entry(name.clone()).or_insert(fresh);
            if known.stamp != stamp {
                *known = fresh;
            }
        }
    }

    /// How a file stands. `next` says whether the frame after it is there already; `ends_whole` looks whether it
    /// ends with a newline and parses to its end, and is asked only when the file has rested long enough for that to
    /// matter, again where it had no time to look.
    pub(super) fn look(
        &mut self,
        name: &OsStr,
        next: bool,
        done: bool,
        settle: Duration,
        now: Duration,
        ends_whole: impl FnOnce() -> Option<bool>,
    ) -> Look {
        let Some(file) = self.files.get_mut(name) else { return Look::Grows };
        if done {
            return Look::Whole;
        }
        if file.stamp.0 == 0 {
            // writers make a file before they fill it; a frame that stays empty waits for `.done`
            return Look::Grows;
        }
        let rested = now.saturating_sub(file.since);
        let span = if next { settle / 2 } else { settle };
        if rested < span {
            return Look::Grows;
        }
        file.ends_whole = file.ends_whole.or_else(ends_whole);
        match file.ends_whole {
            Some(true) => Look::Whole,
            Some(false) if rested >= span * LONGER => Look::Rests,
            _ => Look::Grows,
        }
    }

    /// What was seen of a file last.
    pub(super) fn stamp(&self, name: &OsStr) -> Option<Stamp> {
        self.files.get(name).map(|file| file.stamp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTLE: Duration = Duration::from_secs(2);

    fn at(s: f64) -> Duration {
        Duration::from_secs_f64(s)
    }

    fn seen(size: u64) -> BTreeMap<OsString, Stamp> {
        [(OsString::from("a_1.obj"), (size, None))].into()
    }

    fn whole(frames: &mut Frames, next: bool, done: bool, now: f64, ends: bool) -> bool {
        frames.look(OsStr::new("a_1.obj"), next, done, SETTLE, at(now), || Some(ends)) != Look::Grows
    }

    #[test]
    fn a_file_rests_before_it_is_whole() {
        let mut f = Frames::default();
        f.see(&seen(10), at(0.0));
        assert!(!whole(&mut f, false, false, 1.9, true) && whole(&mut f, false, false, 2.0, true));
        f.see(&seen(20), at(2.5));
        assert!(!whole(&mut f, false, false, 4.4, true) && whole(&mut f, false, false, 4.5, true));
        let other = f.look(OsStr::new("a_2.obj"), true, true, SETTLE, at(9e9), || Some(true));
        assert_eq!(other, Look::Grows, "not there");
    }

    #[test]
    fn the_next_frame_halves_and_a_missing_newline_takes_five_times() {
        let mut f = Frames::default();
        f.see(&seen(10), at(0.0));
        assert!(!whole(&mut f, true, false, 0.9, true) && whole(&mut f, true, false, 1.0, true));
        let mut f = Frames::default();
        f.see(&seen(10), at(0.0));
        assert!(!whole(&mut f, false, false, 9.9, false) && whole(&mut f, false, false, 10.0, false));
        let rests = |f: &mut Frames, ends| {
            f.look(OsStr::new("a_1.obj"), false, false, SETTLE, at(10.0), || Some(ends))
        };
        assert_eq!(rests(&mut f, false), Look::Rests);
        let mut f = Frames::default();
        f.see(&seen(10), at(0.0));
        assert!(!whole(&mut f, true, false, 4.9, false) && whole(&mut f, true, false, 5.0, false));
        f.see(&seen(0), at(5.0));
        assert!(!whole(&mut f, true, false, 1e6, true), "an empty file is not yet one");
        assert!(whole(&mut f, false, true, 5.0, false), ".done starts at once");
    }

    #[test]
    fn a_files_end_is_looked_at_once_after_each_change() {
        let mut f = Frames::default();
        f.see(&seen(10), at(0.0));
        let mut looks = 0;
        for now in [2.0, 3.0, 4.0] {
            f.see(&seen(10), at(now));
            f.look(OsStr::new("a_1.obj"), false, false, SETTLE, at(now), || {
                looks += 1;
                Some(false)
            });
        }
        f.see(&seen(11), at(5.0));
        f.look(OsStr::new("a_1.obj"), false, false, SETTLE, at(7.0), || {
            looks += 1;
            Some(true)
        });
        assert_eq!(looks, 2);
    }
}
