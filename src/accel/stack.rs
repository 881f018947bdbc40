//! The stack of a traversal.

use super::tree::{MAX_DEPTH, WIDTH};
use std::mem::MaybeUninit;

/// Children that wait at most: each level leaves all but one behind.
const CAPACITY: usize = MAX_DEPTH * (WIDTH - 1) + 1;

/// A child that waits: its entry's bits above its number, so that integers compare as entries (which are not negative).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Waiting(u64);

impl Waiting {
    #[inline(always)]
    pub(crate) fn new(entry: f32, child: u32) -> Self {
        Self(u64::from(entry.to_bits()) << 32 | u64::from(child))
    }

    #[inline(always)]
    pub(crate) fn entry(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    #[inline(always)]
    pub(crate) fn child(self) -> u32 {
        self.0 as u32
    }
}

/// A stack that is not cleared before use: that would cost as much as a node.
pub(crate) struct Stack {
    waiting: [MaybeUninit<Waiting>; CAPACITY],
    len: usize,
}

impl Stack {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { waiting: [const { MaybeUninit::uninit() }; CAPACITY], len: 0 }
    }

    #[inline(always)]
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Adds a child among those above `floor`, of which the nearest is the topmost.
    #[inline(always)]
    pub(crate) fn insert(&mut self, child: Waiting, floor: usize) {
        let mut place = self.len;
        while place > floor {
            // SAFETY: place - 1 < len, and all below len were written
            let above = unsafe { self.waiting[place - 1].assume_init() };
            if above >= child {
                break;
            }
            self.waiting[place].write(above);
            place -= 1;
        }
        self.waiting[place].write(child);
        self.len += 1;
    }

    /// Takes the topmost that is not entered after a distance; drops those above it.
    #[inline(always)]
    pub(crate) fn pop_before(&mut self, distance: f32) -> Option<u32> {
        loop {
            self.len = self.len.checked_sub(1)?;
            // SAFETY: all below the former len were written
            let top = unsafe { self.waiting[self.len].assume_init() };
            if top.entry() <= distance {
                return Some(top.child());
            }
        }
    }
}
