//! Claims: lock files by which two daemons never work on one job.
//!
//! A claim of a job is a file `HASH.GENERATION.lock` that is linked into place whole and says whose it is. Whose owner is
//! dead is not removed first, which two could do at once, each the other's: a claim of the next generation is made
//! beside it, which one alone succeeds in; whoever then sees another living claim of the job gives its own back. Both
//! make before they look, so that two never hold one job; the dead ones' files go last.
//!
//! An owner is dead when its process has ended (known on its own host alone), or when its heartbeat, the time of a file
//! of its own, has stood still for 30 s of the looker's own clock: hosts' clocks are not compared.

use super::{WatchError, cannot};
use crate::clock::{self, FileTime};
use crate::output::{is_gone, own_name};
use std::collections::HashMap;
use std::fs::{self, File};
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;
use xxhash_rust::xxh3::xxh3_128;

/// A heartbeat that stands still for so long is that of a dead daemon.
const DEAD_AFTER: Duration = Duration::from_secs(30);
/// How often a daemon's own heartbeat is given.
const BEAT_EVERY: Duration = Duration::from_secs(5);

/// The claims in an output folder, as one daemon sees them.
#[derive(Debug)]
pub(super) struct Claims {
    folder: PathBuf,
    /// This daemon's name.
    me: String,
    beaten: Option<Duration>,
    /// Of other daemons the last heartbeat and when it was first seen.
    beats: HashMap<String, (Option<FileTime>, Duration)>,
}

/// A job that is this daemon's until it is given back.
#[derive(Debug)]
pub(super) struct Claim(PathBuf);

impl Claims {
    /// Those in a folder of their own, which is made.
    pub(super) fn open(folder: &Path, now: Duration) -> Result<Self, WatchError> {
        let mut claims =
            Self { folder: folder.to_path_buf(), me: own_name("", ""), beaten: None, beats: HashMap::new() };
        claims.beat(now)?;
        claims.sweep(now);
        Ok(claims)
    }

    /// This daemon's name.
    pub(super) fn me(&self) -> &str {
        &self.me
    }

    /// Gives a heartbeat where it is time to; whether it was.
    pub(super) fn beat(&mut self, now: Duration) -> Result<bool, WatchError> {
        if self.beaten.is_some_and(|at| now.saturating_sub(at) < BEAT_EVERY) {
            return Ok(false);
        }
        // someone may have removed it
        fs::create_dir_all(&self.folder).map_err(cannot("made", &self.folder))?;
        let path = self.heart(&self.me);
        let touched = File::options()
            .create(true)
            .append(true)
            .open(&path)
            .and_then(|file| file.set_modified(clock::file_time()));
        touched.map_err(cannot("written", &path))?;
        self.beaten = Some(now);
        Ok(true)
    }

    fn heart(&self, owner: &str) -> PathBuf {
        self.folder.join(format!("{owner}.alive"))
    }

    /// Removes what daemons of this host that have ended left: heartbeats, drafts, and claims, those by taking them over as
    /// anyone else would. What cannot be removed does no harm.
    fn sweep(&mut self, now: Duration) {
        for entry in fs::read_dir(&self.folder).into_iter().flatten().flatten() {
            let name = entry.file_name();
            let Some((stem, end)) = name.to_str().and_then(|n| n.rsplit_once('.')) else { continue };
            if matches!(end, "alive" | "new") && is_gone(stem) {
                let _ = fs::remove_file(entry.path());
            } else if end == "lock"
                && let Some((hash, _)) = stem.split_once('.')
                && let Ok(Some(claim)) = self.take_hash(hash, now)
            {
                claim.give_back();
            }
        }
    }

    /// Claims a job; None where another daemon has it.
    pub(super) fn take(&mut self, job: &str, now: Duration) -> Result<Option<Claim>, WatchError> {
        self.take_hash(&format!("{:032x}", xxh3_128(job.as_bytes())), now)
    }

    fn take_hash(&mut self, hash: &str, now: Duration) -> Result<Option<Claim>, WatchError> {
        let before = self.of_job(hash)?;
        if before.iter().any(|(_, owner)| self.lives(owner, now)) {
            return Ok(None);
        }
        let generation = before.iter().map(|(generation, _)| generation + 1).max().unwrap_or(0);
        let path = self.lock(hash, generation);
        if !self.make(&path)? {
            return Ok(None);
        }
        let claim = Claim(path);
        let others = self.of_job(hash)?.into_iter().filter(|(g, _)| *g != generation).collect::<Vec<_>>();
        if others.iter().any(|(_, owner)| self.lives(owner, now)) {
            claim.give_back();
            return Ok(None);
        }
        for (generation, _) in others {
            let _ = fs::remove_file(self.lock(hash, generation));
        }
        Ok(Some(claim))
    }

    fn lock(&self, hash: &str, generation: u64) -> PathBuf {
        self.folder.join(format!("{hash}.{generation}.lock"))
    }

    /// Links a lock into place whole; false where there is one.
    fn make(&self, path: &Path) -> Result<bool, WatchError> {
        let draft = self.folder.join(own_name("", ".new"));
        let written = File::create(&draft).and_then(|mut file| file.write_all(self.me.as_bytes()));
        let linked = written.and_then(|()| fs::hard_link(&draft, path));
        let _ = fs::remove_file(&draft);
        match linked {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(false),
            linked => linked.map(|()| true).map_err(cannot("written", path)),
        }
    }

    /// The generations of a job's locks and whose they are.
    fn of_job(&self, hash: &str) -> Result<Vec<(u64, String)>, WatchError> {
        let mut found = Vec::new();
        for entry in fs::read_dir(&self.folder).map_err(cannot("read", &self.folder))? {
            let entry = entry.map_err(cannot("read", &self.folder))?;
            let name = entry.file_name();
            let generation = name.to_str().and_then(|name| {
                name.strip_prefix(hash)?.strip_prefix('.')?.strip_suffix(".lock")?.parse().ok()
            });
            let Some(generation) = generation else { continue };
            let mut owner = String::new();
            match File::open(entry.path()).and_then(|file| file.take(1024).read_to_string(&mut owner)) {
                Ok(_) => found.push((generation, owner)),
                // given back between the two
                Err(error) if error.kind() == ErrorKind::NotFound => {}
                Err(error) => return Err(cannot("read", &entry.path())(error)),
            }
        }
        Ok(found)
    }

    /// Whether a daemon lives, as far as that is known.
    pub(super) fn lives(&mut self, owner: &str, now: Duration) -> bool {
        if owner == self.me {
            return true;
        }
        if is_gone(owner) {
            return false;
        }
        let beat = fs::metadata(self.heart(owner)).and_then(|m| m.modified()).ok();
        let seen = self.beats.entry(owner.to_owned()).or_insert((beat, now));
        if seen.0 != beat {
            *seen = (beat, now);
        }
        now.saturating_sub(seen.1) < DEAD_AFTER
    }
}

impl Drop for Claims {
    fn drop(&mut self) {
        // one that stays is swept by the next daemon
        let _ = fs::remove_file(self.heart(&self.me));
    }
}

impl Claim {
    /// Whether it still stands: a daemon that was thought dead finds its claims taken over.
    pub(super) fn stands(&self) -> bool {
        // what cannot be looked at is not gone
        !matches!(self.0.try_exists(), Ok(false))
    }

    /// Gives the job back.
    pub(super) fn give_back(self) {
        // one that cannot be removed dies with this process
        let _ = fs::remove_file(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(s: u64) -> Duration {
        Duration::from_secs(s)
    }

    /// A daemon on another host: its process cannot be looked at.
    fn elsewhere(folder: &Path, name: &str) -> Claims {
        let mut claims = Claims::open(folder, at(0)).unwrap();
        let _ = fs::remove_file(claims.heart(&claims.me));
        claims.me = format!("{name}.7.0");
        claims.beaten = None;
        claims.beat(at(0)).unwrap();
        claims
    }

    #[test]
    fn one_of_two_has_a_job() {
        let t = tempfile::tempdir().unwrap();
        let (mut a, mut b) = (elsewhere(t.path(), "a"), elsewhere(t.path(), "b"));
        let claim = a.take("walk", at(0)).unwrap().unwrap();
        assert!(b.take("walk", at(1)).unwrap().is_none() && a.take("walk", at(1)).unwrap().is_none());
        assert!(b.take("run", at(1)).unwrap().is_some());
        claim.give_back();
        assert!(b.take("walk", at(2)).unwrap().is_some());
        assert!(a.take("walk", at(2)).unwrap().is_none());
    }

    #[test]
    fn a_heartbeat_that_stands_still_is_taken_over_after_half_a_minute() {
        let t = tempfile::tempdir().unwrap();
        let (mut a, mut b) = (elsewhere(t.path(), "a"), elsewhere(t.path(), "b"));
        let claim = a.take("walk", at(0)).unwrap().unwrap();
        assert!(b.take("walk", at(0)).unwrap().is_none() && b.take("walk", at(29)).unwrap().is_none());
        let taken = b.take("walk", at(30)).unwrap().unwrap();
        assert!(!claim.stands() && taken.stands());
        // the one that was thought dead does not take it back
        assert!(a.take("walk", at(31)).unwrap().is_none());
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_dead_process_is_taken_over_at_once() {
        let t = tempfile::tempdir().unwrap();
        let mut a = Claims::open(t.path(), at(0)).unwrap();
        let mut child = std::process::Command::new("true").spawn().unwrap();
        let me = a.me.replace(&format!(".{}.", std::process::id()), &format!(".{}.", child.id()));
        let _ = fs::remove_file(a.heart(&a.me));
        a.me = me;
        // ended, and nobody has asked for its exit status
        let watch = clock::Stopwatch::start();
        while !is_gone(&a.me) {
            assert!(watch.s() < 120.0, "`true` runs still");
            std::thread::yield_now();
        }
        a.take("walk", at(0)).unwrap().unwrap();
        a.take("run", at(0)).unwrap().unwrap();
        fs::write(t.path().join(format!("{}.new", a.me)), "").unwrap();
        let mut b = Claims::open(t.path(), at(0)).unwrap();
        assert_eq!(
            fs::read_dir(t.path()).unwrap().count(),
            1,
            "all that is left is the heartbeat of the living"
        );
        assert!(b.take("walk", at(0)).unwrap().is_some());
        child.wait().unwrap();
    }

    #[test]
    fn of_many_at_once_never_two_hold_it() {
        let t = tempfile::tempdir().unwrap();
        // a dead one's lock to take over
        let mut dead = elsewhere(t.path(), "dead");
        std::mem::forget(dead.take("walk", at(0)).unwrap());
        let holders = std::sync::atomic::AtomicUsize::new(0);
        let taken = std::sync::atomic::AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for n in 0..4 {
                let (folder, holders, taken) = (t.path(), &holders, &taken);
                scope.spawn(move || {
                    use std::sync::atomic::Ordering::SeqCst;
                    let mut claims = elsewhere(folder, &format!("h{n}"));
                    claims.beats.insert("dead.7.0".into(), (None, at(0)));
                    let beat = fs::metadata(claims.heart("dead.7.0")).unwrap().modified().ok();
                    claims.beats.insert("dead.7.0".into(), (beat, at(0)));
                    for _ in 0..200 {
                        // the others are seen alive: at their first sight
                        claims.beats.retain(|owner, _| owner == "dead.7.0");
                        if let Some(claim) = claims.take("walk", at(60)).unwrap() {
                            assert_eq!(holders.fetch_add(1, SeqCst), 0, "two hold one job");
                            taken.fetch_add(1, SeqCst);
                            holders.fetch_sub(1, SeqCst);
                            claim.give_back();
                        }
                    }
                });
            }
        });
        assert!(taken.into_inner() > 0);
    }
}
