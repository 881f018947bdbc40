//! SIGINT and SIGTERM ask the run to stop; a second one ends the process at once.

use crate::device::Stop;
use anyhow::{Context, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Asked by signals.
pub(super) struct OnSignals {
    /// What the run looks at.
    pub(super) asked: Arc<Stop>,
    signal: Arc<AtomicUsize>,
}

impl OnSignals {
    /// 128 + the signal that came.
    pub(super) fn exit_status(&self) -> u8 {
        128 + self.signal.load(Ordering::Relaxed) as u8
    }
}

/// Listens from now on.
#[cfg(unix)]
pub(super) fn on_signals() -> Result<OnSignals> {
    use signal_hook::consts::{SIGINT, SIGTERM};
    let on = OnSignals { asked: Arc::default(), signal: Arc::default() };
    let mut signals =
        signal_hook::iterator::Signals::new([SIGINT, SIGTERM]).context("signals cannot be caught")?;
    let (asked, signal) = (Arc::clone(&on.asked), Arc::clone(&on.signal));
    std::thread::spawn(move || {
        for s in signals.forever() {
            if asked.asked() {
                // 128 + n is what a shell reports for a process that signal n ended
                std::process::exit(128 + s);
            }
            signal.store(s as usize, Ordering::Relaxed);
            asked.ask();
        }
    });
    Ok(on)
}

/// Signals are not caught on this system.
#[cfg(not(unix))]
pub(super) fn on_signals() -> Result<OnSignals> {
    Ok(OnSignals { asked: Arc::default(), signal: Arc::new(AtomicUsize::new(2)) })
}
