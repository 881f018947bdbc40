//! Large buffers in which parts have places: they come and go, and the buffers grow.

use super::adapter::Gpu;
use crate::accel::{NODE_BYTES, TRIANGLE_BYTES};
use crate::device::DeviceError;
use crate::math::LINEAR_FROM_SRGB8;
use std::collections::BTreeMap;
use std::ops::Range;

/// A buffer of so many units of equal size.
#[derive(Debug)]
pub(super) struct Heap {
    label: &'static str,
    unit_bytes: u64,
    buffer: wgpu::Buffer,
    /// Units that the buffer has.
    capacity: u32,
    /// What is free: starts and lengths, no two of them side by side.
    free: BTreeMap<u32, u32>,
}

/// Units at first.
const FIRST: u32 = 1024;

impl Heap {
    pub(super) fn new(gpu: &Gpu, label: &'static str, unit_bytes: u64) -> Result<Self, DeviceError> {
        let buffer = gpu.buffer(label, u64::from(FIRST) * unit_bytes, USAGE)?;
        Ok(Self { label, unit_bytes, buffer, capacity: FIRST, free: BTreeMap::from([(0, FIRST)]) })
    }

    pub(super) fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// Bytes that the buffer has.
    pub(super) fn bytes(&self) -> u64 {
        u64::from(self.capacity) * self.unit_bytes
    }

    /// Takes a place of so many units, which begins at a multiple of four units: the first that is large enough, else the
    /// buffer grows, beyond what is needed by no more than there are bytes to spare.
    pub(super) fn take(
        &mut self,
        gpu: &Gpu,
        units: u64,
        spare_bytes: u64,
    ) -> Result<Range<u32>, DeviceError> {
        // all places have multiples of four, so that all begin at one
        let units = units.next_multiple_of(4);
        let fits = |(_, length): &(&u32, &u32)| u64::from(**length) >= units;
        let start = match self.free.iter().find(fits) {
            Some((&start, _)) => start,
            None => self.grow(gpu, units, spare_bytes)?,
        };
        let length = self.free.remove(&start).unwrap_or(0);
        let end = start + units as u32;
        if start + length > end {
            self.free.insert(end, start + length - end);
        }
        Ok(start..end)
    }

    /// Gives a place back.
    pub(super) fn give(&mut self, place: Range<u32>) {
        if place.is_empty() {
            return;
        }
        let Range { mut start, mut end } = place;
        if let Some((&before, &length)) = self.free.range(..start).next_back()
            && before + length == start
        {
            self.free.remove(&before);
            start = before;
        }
        if let Some(length) = self.free.remove(&end) {
            end += length;
        }
        self.free.insert(start, end - start);
    }

    /// Makes the buffer larger; gives where so many units are free at its end.
    fn grow(&mut self, gpu: &Gpu, units: u64, spare_bytes: u64) -> Result<u32, DeviceError> {
        let last = self.free.iter().next_back().map(|(&start, &length)| (start, start + length));
        let start = last.filter(|(_, end)| *end == self.capacity).map_or(self.capacity, |(start, _)| start);
        let needed = u64::from(start) + units;
        // places are numbers of 32 bits
        let most = (gpu.binding_bytes / self.unit_bytes).min(u64::from(u32::MAX));
        if needed > most {
            return Err(gpu.too_large(self.label, needed * self.unit_bytes, most * self.unit_bytes));
        }
        // by a half where it may, so that what grows bit by bit is copied a few times only
        let spare = u64::from(self.capacity).saturating_add(spare_bytes / self.unit_bytes);
        let wanted = (u64::from(self.capacity) * 3 / 2).min(spare).max(needed).min(most);
        let make =
            |units: u64| gpu.buffer(self.label, units * self.unit_bytes, USAGE).map(|b| (b, units as u32));
        let (buffer, capacity) = make(wanted).or_else(|_| make(needed))?;
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(&self.buffer, 0, &buffer, 0, self.bytes());
        gpu.queue.submit([encoder.finish()]);
        self.give(self.capacity..capacity);
        (self.buffer, self.capacity) = (buffer, capacity);
        Ok(start)
    }

    /// Writes from a unit on; bytes are whole words.
    pub(super) fn write(&self, gpu: &Gpu, start: u32, bytes: &[u8]) {
        if !bytes.is_empty() {
            gpu.queue.write_buffer(&self.buffer, u64::from(start) * self.unit_bytes, bytes);
        }
    }
}

const USAGE: wgpu::BufferUsages =
    wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_DST).union(wgpu::BufferUsages::COPY_SRC);

/// The buffers that parts and trees have places in.
#[derive(Debug)]
pub(super) struct Heaps {
    /// Nodes of trees, [`NODE_BYTES`] each.
    pub(super) nodes: Heap,
    /// Triangles of leaves, [`TRIANGLE_BYTES`] each.
    pub(super) triangles: Heap,
    /// Indices and attributes, by words.
    pub(super) words: Heap,
    /// The linear values of sRGB's codes, then texels, by words.
    pub(super) texels: Heap,
}

impl Heaps {
    pub(super) fn new(gpu: &Gpu) -> Result<Self, DeviceError> {
        let mut heaps = Self {
            nodes: Heap::new(gpu, "nodes of trees", NODE_BYTES)?,
            triangles: Heap::new(gpu, "triangles", TRIANGLE_BYTES)?,
            words: Heap::new(gpu, "indices and attributes", 4)?,
            texels: Heap::new(gpu, "textures", 4)?,
        };
        let table = heaps.take(gpu, |heaps| &mut heaps.texels, LINEAR_FROM_SRGB8.len() as u64)?;
        heaps.texels.write(gpu, table.start, bytemuck::cast_slice(&*LINEAR_FROM_SRGB8));
        Ok(heaps)
    }

    /// Takes a place of so many units in one of them. What a buffer grows by beyond that stays within the device's budget.
    pub(super) fn take(
        &mut self,
        gpu: &Gpu,
        heap: fn(&mut Self) -> &mut Heap,
        units: u64,
    ) -> Result<Range<u32>, DeviceError> {
        let bytes: u64 =
            [&self.nodes, &self.triangles, &self.words, &self.texels].map(Heap::bytes).iter().sum();
        let spare_bytes = gpu.budget_bytes.saturating_sub(bytes);
        heap(self).take(gpu, units, spare_bytes)
    }
}
