//! When what is put into the inbox is whole: pure, over what scans saw and when.

use std::time::Duration;

/// What a scan saw of one thing in the inbox.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Seen {
    /// Names the set of (name, size, time of change) of every file within.
    pub(super) run: u128,
    /// The same with the times that cannot be set (ctime), which tell of copies that bring old times along.
    pub(super) exact: u128,
    /// Files within.
    pub(super) files: u64,
    /// Whether a name says that it is still being written (.part, .tmp, .crdownload, ~).
    pub(super) unfinished: bool,
    /// Whether `.done` is there.
    pub(super) done: bool,
    /// Whether `.cancel` is there.
    pub(super) cancelled: bool,
}

/// What was seen last, and since when it is so.
#[derive(Clone, Copy, Debug)]
pub(super) struct Settling {
    seen: Seen,
    since: Duration,
    /// Whether it was asked for since then what it waits for.
    is_told: bool,
}

impl Settling {
    /// Begins with what is seen now.
    pub(super) fn new(seen: Seen, now: Duration) -> Self {
        Self { seen, since: now, is_told: false }
    }

    /// Takes what is seen now; whether it is another set of files than before.
    pub(super) fn see(&mut self, seen: Seen, now: Duration) -> bool {
        let is_other = seen.exact != self.seen.exact || seen.files != self.seen.files;
        if is_other {
            *self = Self::new(seen, now);
        }
        self.seen = seen;
        is_other
    }

    /// What was seen last.
    pub(super) fn seen(&self) -> &Seen {
        &self.seen
    }

    /// When the set will have been equal over the whole span, if nothing in it changes.
    pub(super) fn settles(&self, span: Duration) -> Option<Duration> {
        (self.seen.files > 0 && !self.seen.unfinished).then(|| self.since + span)
    }

    /// Whether it is to be told what is waited for: once, where the set was seen equal over the whole span and a name in it
    /// holds it back.
    pub(super) fn is_to_be_told(&mut self, span: Duration, now: Duration) -> bool {
        let is_held_back = self.seen.unfinished && !self.seen.done;
        let is_due = is_held_back && now.saturating_sub(self.since) >= span && !self.is_told;
        self.is_told |= is_due;
        is_due
    }

    /// Whether the set was seen equal over the whole span, or its owner says that it is whole. Nothing is not yet a job.
    pub(super) fn is_settled(&self, span: Duration, now: Duration) -> bool {
        let rested = now.saturating_sub(self.since) >= span;
        self.seen.files > 0 && (self.seen.done || rested && !self.seen.unfinished)
    }
}

/// Whether a file of that name is still being written by whoever downloads or copies it.
pub(super) fn is_unfinished(name: &str) -> bool {
    let lower = name.to_ascii_lowercase();
    [".part", ".tmp", ".crdownload", "~"].iter().any(|end| lower.ends_with(end))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPAN: Duration = Duration::from_secs(2);

    fn at(s: f64) -> Duration {
        Duration::from_secs_f64(s)
    }

    fn set(exact: u128) -> Seen {
        Seen { run: exact, exact, files: 1, ..Seen::default() }
    }

    #[test]
    fn equal_over_the_whole_span() {
        let mut s = Settling::new(set(1), at(10.0));
        assert!(!s.is_settled(SPAN, at(11.9)));
        assert!(!s.see(set(1), at(11.9)));
        assert!(s.is_settled(SPAN, at(12.0)));
        // a change begins anew, also one that is taken back
        assert!(s.see(set(2), at(12.5)) && s.see(set(1), at(13.0)));
        assert!(!s.is_settled(SPAN, at(14.9)) && s.is_settled(SPAN, at(15.0)));
        // an old time that a copy brings along shows in what cannot be set
        assert!(s.see(Seen { exact: 7, ..set(1) }, at(16.0)));
        assert!(!s.is_settled(SPAN, at(17.0)));
    }

    #[test]
    fn what_is_unfinished_is_waited_for_and_done_starts_at_once() {
        let mut s = Settling::new(Seen { unfinished: true, ..set(1) }, at(0.0));
        assert!(!s.is_settled(SPAN, at(1e6)));
        assert!(!s.is_to_be_told(SPAN, at(1.9)) && s.is_to_be_told(SPAN, at(2.0)));
        assert!(!s.is_to_be_told(SPAN, at(9.0)), "once");
        s.see(Seen { unfinished: true, done: true, ..set(1) }, at(1e6));
        assert!(s.is_settled(SPAN, at(1e6)) && !s.is_to_be_told(SPAN, at(1e6)));
        let s = Settling::new(Seen { done: true, ..set(1) }, at(0.0));
        assert!(s.is_settled(SPAN, at(0.0)));
        let empty = Settling::new(Seen { files: 0, ..set(1) }, at(0.0));
        assert!(!empty.is_settled(SPAN, at(1e6)), "an empty folder is not yet a job");
        // a clock of the machine that goes back changes nothing here: these are times since the daemon's start
        assert!(!s.is_settled(SPAN, at(0.0)) || s.seen().done);
    }

    #[test]
    fn names_that_say_so() {
        for name in ["a.obj.part", "a.tmp", "A.CRDOWNLOAD", "a.obj~"] {
            assert!(is_unfinished(name), "{name}");
        }
        for name in ["a.obj", "part", "tmp.obj", "a.parts"] {
            assert!(!is_unfinished(name), "{name}");
        }
    }
}
