//! What frames on their way may take of the host's memory: a bound on their number, and one on their bytes.

use super::source::file_bytes;
use crate::job::{Job, Picture};
use crate::scene::{Aov, Frame};
use std::sync::{Condvar, Mutex, PoisonError};

/// Bytes that reading a frame and building its trees takes for each byte of its OBJ files, about: 4 to 11 were
/// measured on real scenes.
const BYTES_PER_TEXT_BYTE: u64 = 12;
/// Bytes that building a tree takes for each triangle until it is built.
const BUILD_BYTES_PER_TRIANGLE: u64 = 250;

/// What a picture will take before its files are read: their sizes, and its film.
pub(super) fn expected_bytes(job: &Job, picture: &Picture) -> u64 {
    let layers = &job.sequences[picture.sequence].layers;
    let files = picture.sources.iter().filter_map(|s| Some(&layers[s.layer].files[s.file?].path));
    let text: u64 = files.map(|path| file_bytes(path)).sum();
    let settings = &picture.settings;
    let floats = 3
        + u64::from(settings.alpha)
        + Aov::ALL.iter().filter(|aov| settings.aovs.contains(**aov)).map(|aov| aov.channels()).sum::<u64>();
    let [width, height] = settings.size.map(u64::from);
    text.saturating_mul(BYTES_PER_TEXT_BYTE) + 4 * floats * width * height
}

/// What a frame that was read takes until it is traced.
pub(super) fn needed_bytes(frame: &Frame) -> u64 {
    let mut parts: Vec<_> = frame.objects.iter().flat_map(|o| o.geometry.parts()).collect();
    parts.sort_unstable();
    parts.dedup();
    let largest = frame.objects.iter().map(|o| o.geometry.triangles.0.len()).max().unwrap_or(0);
    parts.iter().map(|(_, bytes)| bytes).sum::<u64>() + largest as u64 * BUILD_BYTES_PER_TRIANGLE
}

/// Why a frame is not even tried.
pub(super) fn refusal(needed_bytes: u64, budget_bytes: u64) -> String {
    format!(
        "needs about {needed_bytes} bytes of memory, {budget_bytes} are allowed; the frame is not rendered (raise --memory)"
    )
}

/// Frames on their way from the readers to the end of the device stage, which takes them in their order.
#[derive(Debug)]
pub(super) struct InFlight {
    budget_bytes: u64,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug)]
struct State {
    free_slots: usize,
    bytes: u64,
    /// The frame that the device stage waits for.
    turn: usize,
}

impl InFlight {
    /// At most so many frames and bytes.
    pub(super) fn new(slots: usize, budget_bytes: u64) -> Self {
        let state = Mutex::new(State { free_slots: slots, bytes: 0, turn: 0 });
        Self { budget_bytes, state, changed: Condvar::new() }
    }

    /// Waits for a free slot and takes it.
    pub(super) fn take_slot(&self) {
        self.wait_until(|s| s.free_slots > 0, |s| s.free_slots -= 1);
    }

    /// Waits until so many bytes are free and takes them. The frame that the device waits for is not held up: those
    /// before it are done, and those behind it wait for it.
    pub(super) fn take_bytes(&self, index: usize, bytes: u64) {
        let fits = |s: &State| s.turn >= index || s.bytes.saturating_add(bytes) <= self.budget_bytes;
        self.wait_until(fits, |s| s.bytes += bytes);
    }

    /// The device stage has taken a frame: its slot is free, the next one's turn has come.
    pub(super) fn give_slot(&self) {
        self.change(|s| {
            s.free_slots += 1;
            s.turn += 1;
        });
    }

    /// A reader found nothing more to read.
    pub(super) fn give_back_slot(&self) {
        self.change(|s| s.free_slots += 1);
    }

    /// A frame has left the device stage.
    pub(super) fn give_bytes(&self, bytes: u64) {
        self.change(|s| s.bytes -= bytes);
    }

    fn wait_until(&self, ready: impl Fn(&State) -> bool, then: impl Fn(&mut State)) {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let mut state = self.changed.wait_while(state, |s| !ready(s)).unwrap_or_else(PoisonError::into_inner);
        then(&mut state);
    }

    fn change(&self, change: impl FnOnce(&mut State)) {
        change(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner));
        self.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frame_whose_turn_it_is_is_never_held_up() {
        let flight = InFlight::new(3, 100);
        flight.take_slot();
        flight.take_slot();
        // the second came first, the first does not fit beside it, and goes on all the same
        flight.take_bytes(1, 90);
        flight.take_bytes(0, 50);
        flight.give_slot();
        flight.give_bytes(50);
        flight.take_slot();
        std::thread::scope(|scope| {
            let third = scope.spawn(|| flight.take_bytes(2, 20));
            flight.give_slot();
            flight.give_bytes(90);
            third.join().unwrap();
        });
        assert_eq!(flight.state.lock().unwrap().bytes, 20);
    }
}
