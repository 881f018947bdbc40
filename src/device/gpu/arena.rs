//! The small lists of one frame, side by side in one buffer that is written at once.

use super::adapter::Gpu;
use crate::device::DeviceError;
use bytemuck::Pod;
use std::ops::Range;

/// Bindings begin at multiples of this on every adapter.
const ALIGNMENT: usize = 256;

/// Bytes of one frame.
#[derive(Debug, Default)]
pub(super) struct Arena {
    bytes: Vec<u8>,
}

/// Where a list is in the arena.
pub(super) type Section = Range<u64>;

impl Arena {
    pub(super) fn clear(&mut self) {
        self.bytes.clear();
    }

    /// Adds a list; one without anything gets one zeroed record, for a binding must not be empty.
    pub(super) fn add<T: Pod>(&mut self, list: &[T]) -> Section {
        let start = self.bytes.len().next_multiple_of(ALIGNMENT);
        self.bytes.resize(start, 0);
        if list.is_empty() {
            self.bytes.extend_from_slice(bytemuck::bytes_of(&T::zeroed()));
        } else {
            self.bytes.extend_from_slice(bytemuck::cast_slice(list));
        }
        start as u64..self.bytes.len() as u64
    }

    /// Adds records each of which is bound alone, by an offset; gives the first, the others follow at [`Self::STEP`].
    pub(super) fn add_apart<T: Pod>(&mut self, list: &[T]) -> Section {
        let mut first = None;
        for record in list {
            let section = self.add(std::slice::from_ref(record));
            first.get_or_insert(section);
        }
        first.unwrap_or_else(|| self.add::<T>(&[]))
    }

    /// How far records that are bound alone are apart.
    pub(super) const STEP: u32 = ALIGNMENT as u32;

    /// Writes it all into a buffer, which is made anew where it is too small.
    pub(super) fn write(&mut self, gpu: &Gpu, buffer: &mut Option<wgpu::Buffer>) -> Result<(), DeviceError> {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let needed = self.bytes.len() as u64;
        if buffer.as_ref().is_none_or(|b| b.size() < needed) {
            let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
            *buffer = Some(gpu.buffer("lists of a frame", needed.next_power_of_two().max(1 << 16), usage)?);
        }
        if let Some(buffer) = buffer {
            gpu.queue.write_buffer(buffer, 0, &self.bytes);
        }
        Ok(())
    }
}
