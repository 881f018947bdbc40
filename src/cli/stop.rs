//! SIGINT and SIGTERM ask the run to stop; a second one ends the process at once. SIGUSR1 asks how far it is.

use crate::device::Stop;
use anyhow::{Context, Result};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Asked by signals.
#[derive(Clone)]
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

static LISTENING: OnceLock<OnSignals> = OnceLock::new();

/// How far it is, in words.
static STATE: Mutex<String> = Mutex::new(String::new());

/// Keeps how far it is, for whoever asks by SIGUSR1.
pub(super) fn keep_state(words: String) {
    *STATE.lock().unwrap_or_else(PoisonError::into_inner) = words;
}

/// Listens before anything else is done, where a daemon is started: whoever started it may stop it at once.
pub(super) fn early() {
    if std::env::args_os().any(|word| word == "watch") {
        // what is wrong is told by whoever needs the signals
        let _ = on_signals();
    }
}

/// Listens from now on.
pub(super) fn on_signals() -> Result<OnSignals> {
    if let Some(listening) = LISTENING.get() {
        return Ok(listening.clone());
    }
    let on = listen()?;
    Ok(LISTENING.get_or_init(|| on).clone())
}

#[cfg(unix)]
fn listen() -> Result<OnSignals> {
    use signal_hook::consts::{SIGINT, SIGTERM, SIGUSR1};
    let on = OnSignals { asked: Arc::default(), signal: Arc::default() };
    let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM, SIGUSR1])
        .context("signals cannot be caught")?;
    let (asked, signal) = (Arc::clone(&on.asked), Arc::clone(&on.signal));
    std::thread::spawn(move || {
        for s in signals.forever() {
            if s == SIGUSR1 {
                err!("{}", STATE.lock().unwrap_or_else(PoisonError::into_inner));
                continue;
            }
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
fn listen() -> Result<OnSignals> {
    Ok(OnSignals { asked: Arc::default(), signal: Arc::new(AtomicUsize::new(2)) })
}
