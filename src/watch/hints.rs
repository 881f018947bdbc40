//! File-system events wake the scan; what they say is not relied on (network shares send none).

use super::Message;
use notify::{RecommendedWatcher, RecursiveMode, Watcher};
use std::collections::HashSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError};

/// Names in the inbox under which something happened since they were last taken.
#[derive(Default)]
pub(super) struct Hints {
    names: Arc<Mutex<HashSet<OsString>>>,
    watcher: Option<RecommendedWatcher>,
}

impl Hints {
    /// Listens to an inbox; where that cannot be, scans alone decide and the reason is returned.
    pub(super) fn listen(inbox: &Path, messages: Sender<Message>) -> (Self, Option<String>) {
        let mut hints = Self::default();
        let root: PathBuf = inbox.canonicalize().unwrap_or_else(|_| inbox.to_path_buf());
        let (names, below) = (Arc::clone(&hints.names), root.clone());
        let told = move |event: notify::Result<notify::Event>| {
            let Ok(event) = event else { return };
            if event.kind.is_access() {
                return;
            }
            let mut names = names.lock().unwrap_or_else(PoisonError::into_inner);
            let was_empty = names.is_empty();
            let tops = event.paths.iter().filter_map(|p| p.strip_prefix(&below).ok()?.components().next());
            names.extend(tops.map(|top| top.as_os_str().to_os_string()));
            // one wakes for all until they are taken
            if was_empty && !names.is_empty() {
                let _ = messages.send(Message::Hint);
            }
        };
        // a link is refused when its job is read: what is behind it may be the whole disk, or go round in a circle
        let config = notify::Config::default().with_follow_symlinks(false);
        let watched = RecommendedWatcher::new(told, config).and_then(|mut watcher| {
            watcher.watch(&root, RecursiveMode::Recursive)?;
            Ok(watcher)
        });
        match watched {
            Ok(watcher) => hints.watcher = Some(watcher),
            Err(error) => {
                let why =
                    format!("{}: events cannot be had ({error}); it is scanned instead", inbox.display());
                return (hints, Some(why));
            }
        }
        (hints, None)
    }

    /// Takes the names.
    pub(super) fn take(&self) -> HashSet<OsString> {
        std::mem::take(&mut *self.names.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::sync::mpsc::channel;
    use std::time::Duration;

    #[test]
    #[cfg(target_os = "linux")]
    fn what_is_behind_a_link_tells_of_nothing() {
        let t = tempfile::tempdir().unwrap();
        let (inbox, outside) = (t.path().join("inbox"), t.path().join("outside"));
        fs::create_dir_all(inbox.join("walk")).unwrap();
        fs::create_dir(&outside).unwrap();
        std::os::unix::fs::symlink(&outside, inbox.join("walk/link")).unwrap();
        std::os::unix::fs::symlink(&outside, inbox.join("linked")).unwrap();
        let (send, messages) = channel();
        let (hints, why) = Hints::listen(&inbox, send);
        assert_eq!(why, None);
        // events come in the order in which they happen
        fs::write(outside.join("x"), "").unwrap();
        fs::write(inbox.join("last"), "").unwrap();
        let mut names = HashSet::new();
        while !names.contains(&OsString::from("last")) {
            messages.recv_timeout(Duration::from_mins(1)).expect("no event came for a minute");
            names.extend(hints.take());
        }
        assert_eq!(names, HashSet::from(["last".into()]));
    }
}
