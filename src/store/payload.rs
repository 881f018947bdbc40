//! The payload of an entry as it is read: lists of values straight to where they stay, the checksum on the way.

use super::entry::{Entry, HEAD_BYTES};
use bytemuck::Pod;
use std::fs::File;
use std::io::{self, Read};
use xxhash_rust::xxh3::Xxh3;

/// Read and added to the checksum in one go: what stays in a core's cache between the two.
const STEP_BYTES: usize = 128 << 10;

/// What is left of an entry's payload. Nothing of it may be trusted before the store has given what was made of it.
pub struct Payload {
    pub(super) file: File,
    pub(super) left: u64,
    hasher: Xxh3,
    /// Why the rest cannot be read.
    failed: Option<io::Error>,
}

impl Payload {
    /// Reads the head of a file.
    pub(super) fn open(entry: Entry, mut file: File) -> io::Result<(Self, [u8; HEAD_BYTES])> {
        let mut head = [0; HEAD_BYTES];
        file.read_exact(&mut head)?;
        let left = file.metadata()?.len().saturating_sub(HEAD_BYTES as u64);
        Ok((Self { file, left, hasher: entry.hasher(), failed: None }, head))
    }

    /// Bytes that are left.
    pub fn left(&self) -> u64 {
        self.left
    }

    /// The next values; None where there are not so many.
    pub fn values<T: Pod>(&mut self, count: usize) -> Option<Vec<T>> {
        let bytes = u64::try_from(count.checked_mul(size_of::<T>())?).ok()?;
        if bytes > self.left {
            return None;
        }
        // pages fresh from the system are zero and cost nothing until they are filled
        let mut values = bytemuck::zeroed_vec(count);
        self.fill(bytemuck::cast_slice_mut(&mut values))?;
        Some(values)
    }

    /// All that is left; None where that is no whole number of values.
    pub fn rest<T: Pod>(&mut self) -> Option<Vec<T>> {
        let left = usize::try_from(self.left).ok()?;
        left.is_multiple_of(size_of::<T>()).then(|| self.values(left / size_of::<T>()))?
    }

    fn fill(&mut self, bytes: &mut [u8]) -> Option<()> {
        for step in bytes.chunks_mut(STEP_BYTES) {
            if let Err(error) = self.file.read_exact(step) {
                self.failed = Some(error);
                return None;
            }
            self.hasher.update(step);
            self.left -= step.len() as u64;
        }
        Some(())
    }

    /// The checksum of the whole, after what was not asked for is read.
    pub(super) fn finish(&mut self) -> io::Result<u128> {
        let mut unasked = Vec::new();
        while self.left > 0 && self.failed.is_none() {
            unasked.resize(STEP_BYTES.min(self.left as usize), 0);
            let _ = self.fill(&mut unasked);
        }
        self.failed.take().map_or_else(|| Ok(self.hasher.digest128()), Err)
    }
}
