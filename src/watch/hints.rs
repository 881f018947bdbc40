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
        let watcher = notify::recommended_watcher(move |event: notify::Result<notify::Event>| {
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
        });
        let watched = watcher.and_then(|mut watcher| {
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
