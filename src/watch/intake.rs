//! Looks into what arrived, one after the other, beside the thread that drives everything: an archive takes time, for which
//! folders do not wait.

use super::Message;
use super::job::{self, Place};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Sender, channel};

/// Where jobs are handed in to be looked into; the thread ends with it.
pub(super) struct Intake(Sender<(u64, String, Place)>);

impl Intake {
    /// Answers go to `messages`.
    pub(super) fn start(messages: &Sender<Message>) -> Self {
        let messages = messages.clone();
        let (jobs, incoming) = channel::<(u64, String, Place)>();
        std::thread::spawn(move || {
            for (id, run, place) in incoming {
                let examined =
                    catch_unwind(AssertUnwindSafe(|| job::examine(&place).map_err(|e| e.to_string())));
                let examined = examined.unwrap_or_else(|_| {
                    Err("internal error while it was looked into; please report this".to_owned())
                });
                if messages.send(Message::Examined(id, run, examined)).is_err() {
                    return;
                }
            }
        });
        Self(jobs)
    }

    /// Asks to look into a job's settled set.
    pub(super) fn examine(&self, id: u64, run: String, place: Place) {
        // the thread ends with the daemon alone
        let _ = self.0.send((id, run, place));
    }
}
